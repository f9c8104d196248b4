from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

_Odd = tuple[Int32s, Int32s, Int32s, Int64s, int]

def build(
    level: Int32s, low: Int32s, high: Int32s, value: Floats, root: int, levels: Int32s
) -> _Odd: ...
def emit(
    depth: Int32s,
    low: Int32s,
    high: Int32s,
    count: Int64s,
    root: int,
    weights: Int64s,
    offset: int,
    out: Int64s,
) -> None: ...
def rank(
    depth: Int32s, low: Int32s, high: Int32s, count: Int64s, root: int, bits: Masks, out: Int64s
) -> None: ...
def unrank(
    depth: Int32s, low: Int32s, high: Int32s, count: Int64s, root: int, indices: Int64s, bits: Masks
) -> None: ...
def embed(sub: _Odd, sup: _Odd, out: Int64s) -> None: ...
