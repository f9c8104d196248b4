from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

def resolve_representatives(
    representative: Int32s, sink: int, path_reward: Floats | None = None
) -> None: ...
def restrict_in_place(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    groups: Int64s,
    target: Masks,
    column: Int32s,
    n: int,
) -> tuple[Int64s, Floats, Floats, int]: ...
