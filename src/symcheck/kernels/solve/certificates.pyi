from symcheck.kernels.arrays import Floats, Int32s, Int64s

def certify(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    groups: Int64s | None,
    lower_b: Floats,
    upper_b: Floats,
    x: Floats,
    weight: Floats,
    policy: Int64s,
    mode: int,
) -> tuple[float, float]: ...
def component_depths(
    edges: Int64s, indices: Int32s, component: Int32s, order: Int32s, start: Int64s, size: int
) -> Int32s: ...
def gauss_seidel_sweep(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    groups: Int64s | None,
    b: Floats,
    x: Floats,
    mode: int,
    backwards: bool,
) -> None: ...
