from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

def reach(
    edges: Int64s, indices: Int32s, table: Int32s, letter: Int32s, initial: int, found: Masks
) -> None: ...
def split(found: Masks, size: int, state: Int32s, automaton: Int32s, number: Int32s) -> None: ...
def rows(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    chosen: Int64s,
    following: Int32s,
    number: Int32s,
    size: int,
    out_indptr: Int64s,
    out_indices: Int32s,
    out_data: Floats,
) -> None: ...
def matching(
    state: Int32s, automaton: Int32s, letter: Int32s, wanted: Masks, out: Masks
) -> None: ...
