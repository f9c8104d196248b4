from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

def follow(place: Int32s, never: int, along: Floats | None = None) -> None: ...
def merge(indptr: Int64s, indices: Int32s, data: Floats, place: Int32s, columns: int) -> int: ...
def unknowns(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    groups: Int64s,
    member: Masks,
    place: Int32s,
    n: int,
) -> tuple[Int64s, Floats, Floats, int]: ...
