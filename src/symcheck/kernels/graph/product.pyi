from symcheck.kernels.arrays import Floats, Int32s, Int64s, Masks

def mark_reachable(
    state_ptr: Int64s,
    indices: Int32s,
    transitions: Int32s,
    letters: Int32s,
    initial: int,
    marked: Masks,
) -> None: ...
def number_pairs(
    marked: Masks, size: int, state: Int32s, automaton: Int32s, pair_number: Int32s
) -> None: ...
def product_rows(
    indptr: Int64s,
    indices: Int32s,
    data: Floats,
    base_rows: Int64s,
    next_automaton_state: Int32s,
    pair_number: Int32s,
    size: int,
    out_indptr: Int64s,
    out_indices: Int32s,
    out_data: Floats,
) -> None: ...
