"""Strategies without the memory on which no decision depends.

Two pairs of a state and a memory value are equivalent if the strategy decides alike in both and
after each choice goes on in equivalent pairs. Memory values become one if the states that are
reached with both are equivalent.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from symcheck.engines.explicit.finite_memory import Decisions, finite_memory_strategy
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.explicit.strategy import Strategy
from symcheck.matrices.numbers import full
from symcheck.matrices.rows import Int64s, spans

__all__ = ["without_idle_memory"]


def without_idle_memory(strategy: Strategy) -> Strategy:
    """The same decisions with fewer memory values; without memory if one is enough.

    Args:
        strategy: one with memory, all of whose pairs are reached.
    """
    explored = strategy.engine.explored
    assert isinstance(explored, ProductModel)
    assert strategy.memory is not None
    memory = strategy.memory.astype(np.int64)
    merged = _merged(strategy.origin, memory, _equivalence(strategy, explored.rows[strategy.taken]))
    if not merged.any():
        return _without_memory(strategy, explored.rows)
    counts = np.diff(strategy.starts)
    pairs = np.column_stack((strategy.origin, merged[memory]))
    _, first = np.unique(pairs, axis=0, return_index=True)
    kept = spans(strategy.starts[:-1][first], strategy.starts[1:][first])
    decisions = Decisions(
        np.repeat(pairs[first, 0], counts[first]),
        np.repeat(pairs[first, 1], counts[first]),
        explored.rows[strategy.taken[kept]].astype(np.int64),
        strategy.shares[kept],
        merged[strategy.following[kept]],
    )
    return finite_memory_strategy(strategy.base, decisions, int(merged[explored.first]))


def _equivalence(strategy: Strategy, rows: Int64s) -> Int64s:
    """A class for each pair, by partition refinement.

    rows: the model's row of each row in `strategy.taken`.
    """
    matrix, taken = strategy.engine.matrix, strategy.taken
    lengths = matrix.lengths[taken]
    entries = spans(matrix.indptr[:-1][taken], matrix.indptr[1:][taken])
    _, shares = np.unique(strategy.shares, return_inverse=True)
    targets = matrix.indices[entries]
    entry_starts = np.append(0, np.cumsum(lengths))[strategy.starts]
    fixed = np.column_stack((np.repeat(rows, lengths), np.repeat(shares, lengths)))
    longest = int(np.diff(entry_starts).max())
    of, count = strategy.origin, 0
    while len(np.unique(of)) > count:
        count = len(np.unique(of))
        words = np.column_stack((fixed, of[targets]))
        _, letters = np.unique(words, axis=0, return_inverse=True)
        letters = np.append(letters.ravel(), -1)
        for place in range(longest):
            at = np.where(
                entry_starts[:-1] + place < entry_starts[1:], entry_starts[:-1] + place, -1
            )
            _, of = np.unique(np.column_stack((of, letters[at])), axis=0, return_inverse=True)
            of = of.ravel()
    return of


def _merged(state: Int64s, memory: Int64s, of: Int64s) -> Int64s:
    """The new value of each memory value: the first with which it agrees in all states."""
    order = np.lexsort((state, memory))
    ends = np.flatnonzero(np.diff(memory[order], prepend=-1, append=-1))
    merged = np.zeros(int(memory.max()) + 1, np.int64)
    known: list[dict[int, int]] = []
    for begin, end in pairwise(ends.tolist()):
        part = order[begin:end]
        classes = dict(zip(state[part].tolist(), of[part].tolist(), strict=True))
        agreeing = (
            i
            for i, other in enumerate(known)
            if all(other.get(s, c) == c for s, c in classes.items())
        )
        number = next(agreeing, len(known))
        if number == len(known):
            known.append({})
        known[number].update(classes)
        merged[memory[part[0]]] = number
    return merged


def _without_memory(strategy: Strategy, rows: Int64s) -> Strategy:
    """A strategy whose decisions depend on the state alone.

    rows: the model's row of each row of the product.
    """
    base, origin = strategy.base, strategy.origin
    groups = base.matrix.groups
    assert groups is not None
    chosen, matters = groups[:-1].copy(), np.zeros(base.states, np.bool_)
    chosen[origin], matters[origin] = rows[strategy.rows], strategy.matters
    plain = Strategy(base, chosen, None, matters)
    if strategy.weights is None:
        return plain
    # Each state has the decision of its first pair.
    _, first = np.unique(origin, return_index=True)
    kept = spans(strategy.starts[:-1][first], strategy.starts[1:][first])
    weights = full(base.matrix.rows, 0, rational=base.is_rational)
    weights[chosen] = full(1, 1, rational=base.is_rational)[0]
    weights[chosen[origin]] = full(1, 0, rational=base.is_rational)[0]
    np.add.at(weights, rows[strategy.taken[kept]], strategy.shares[kept])
    return replace(plain, weights=weights)
