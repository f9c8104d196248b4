from symcheck.kernels.arrays import Int32s, Int64s, Masks

def attractor(
    column_ptr: Int64s,
    column_rows: Int32s,
    row_state: Int32s,
    groups: Int64s,
    target: Masks,
    allowed: Masks,
) -> Masks: ...
def almost_sure_reachability(
    indptr: Int64s,
    indices: Int32s,
    groups: Int64s,
    column_ptr: Int64s,
    column_rows: Int32s,
    row_state: Int32s,
    target: Masks,
    allowed: Masks,
) -> tuple[Masks, Int64s]: ...
def maximal_end_components(
    indptr: Int64s,
    indices: Int32s,
    groups: Int64s,
    column_ptr: Int64s,
    column_rows: Int32s,
    row_state: Int32s,
    within: Masks,
    usable: Masks | None,
) -> tuple[Int32s, Masks, int]: ...
