from symcheck.kernels.arrays import Floats, Int32s, Int64s

def uniformized_steps(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    diagonal: Floats,
    y: Floats,
    z: Floats,
    total: Floats,
    weights: Floats,
    floor: float,
) -> tuple[bool, float, float, float]: ...
