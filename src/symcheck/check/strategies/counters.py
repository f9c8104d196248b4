"""The product of a model with counters: the memory of what depends on steps or rewards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from symcheck.check import tuning
from symcheck.check.measures.reward_scaling import ScaledBound
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.product import ProductModel
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, spans, starts_of

__all__ = ["CounterProduct", "counter_product"]


@dataclass(frozen=True, eq=False)
class CounterProduct:
    """The pairs of a state and the values of counters that begin with 0.

    Attributes:
        engine: the pairs as a model: (s, c) is the state s * codes + c.
        state, code: the state and the code of the counters of each pair.
        entry: for each state, the pair with all counters 0.
        within: the pairs that have exceeded no upper bound, bool[pairs].
        met: those among them that satisfy the lower bounds too, bool[pairs].
    """

    engine: ExplicitEngine
    state: Int32s
    code: Int32s
    entry: Int64s
    within: Bools
    met: Bools


def counter_product(
    base: ExplicitEngine, counters: Sequence[ScaledBound], what: str = "a strategy"
) -> CounterProduct:
    """The product with counters that add up rewards, each up to where its bounds are decided.

    Args:
        base: the model.
        counters: the rewards of each row, and the bounds; a counter with an upper bound has one
            more value, which stands for all greater ones.
        what: what needs the product, for the message.

    Raises:
        UnsupportedError: there are too many pairs.
    """
    sizes = [c.lower + 1 if c.upper is None else c.upper + 2 for c in counters]
    codes = int(np.prod(sizes, dtype=object))
    matrix = base.matrix
    groups = np.arange(matrix.states + 1) if matrix.groups is None else matrix.groups
    if codes * max(matrix.entries, matrix.states) > tuning.STRATEGY_ENTRIES:
        raise UnsupportedError(
            f"{what} would need a memory of {codes:,} values in each of {matrix.states:,} "
            f"states, which is too large"
        )
    state = np.repeat(np.arange(matrix.states, dtype=np.int32), codes)
    code = np.tile(np.arange(codes, dtype=np.int32), matrix.states)
    rows = spans(groups[state], groups[state + 1])
    counts = np.diff(groups)[state]
    before, after, stride = np.repeat(code, counts), np.zeros(len(rows), np.int64), 1
    within, met = np.ones(len(state), bool), np.ones(len(state), bool)
    for counter, size in zip(counters, sizes, strict=True):
        now = before // stride % size
        after += stride * np.minimum(now + np.minimum(counter.rewards[rows], size), size - 1)
        value = code // stride % size
        within &= counter.upper is None or value <= counter.upper
        met &= value >= counter.lower
        stride *= size
    lengths = matrix.lengths[rows]
    entries = spans(matrix.indptr[:-1][rows], matrix.indptr[1:][rows])
    pairs = SparseMatrix(
        starts_of(lengths),
        (matrix.indices[entries].astype(np.int64) * codes + np.repeat(after, lengths)).astype(
            np.int32
        ),
        matrix.data[entries],
        len(state),
        None if matrix.groups is None else starts_of(counts),
    )
    model = ProductModel(base, state, code, pairs, rows)
    entry = np.arange(matrix.states, dtype=np.int64) * codes
    engine = ExplicitEngine(model, f"{base.name} product")
    return CounterProduct(engine, state, code, entry, within, met & within)
