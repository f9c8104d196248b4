from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

def sum_columns(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    groups: Int64s | None,
    chosen: Masks,
    columns: Masks,
    values: Floats | None,
) -> Floats: ...
def take_rows(rows: Floats, groups: Int64s, chosen: Masks) -> Floats: ...
def select_groups(groups: Int64s, chosen: Masks) -> Int64s: ...
def select_states(
    indptr: Int64s, indices: Int32s, data: Floats, groups: Int64s | None, chosen: Masks
) -> tuple[Int64s, Int32s, Floats]: ...
