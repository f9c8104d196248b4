"""Strategies with finite memory, from their decisions in pairs of a state and a memory value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.explicit.strategy import Strategy
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Int64s, SparseMatrix, first_best, spans, starts_of

__all__ = ["Decisions", "finite_memory_strategy"]


@dataclass(frozen=True, eq=False)
class Decisions:
    """What a strategy decides in pairs of a state and a memory value, each an array of length k.

    A pair occurs once for each row that it may take.

    Attributes:
        state, memory: the pair, int64[k].
        row: a row of the model, int64[k].
        share: its probability, float64[k] or Fractions; those of a pair sum to 1.
        following: the memory after it, int64[k].
    """

    state: Int64s
    memory: Int64s
    row: Int64s
    share: Numbers
    following: Int64s


def finite_memory_strategy(base: ExplicitEngine, decisions: Decisions, first: int) -> Strategy:
    """The strategy on the product of a model with its memory.

    The product has the pairs that are reached from the initial states. In a pair without a decision
    the strategy takes the first row of the state and keeps its memory.

    Args:
        base: the MDP.
        decisions: its decisions.
        first: the memory in the initial states.
    """
    matrix, first_rows = base.matrix, base.matrix.groups
    assert first_rows is not None
    size = int(max(decisions.memory.max(initial=first), decisions.following.max(initial=first))) + 1
    key = decisions.state * size + decisions.memory
    order = np.argsort(key, kind="stable")
    key = key[order]
    row, share = decisions.row[order], decisions.share[order]
    following = decisions.following[order]

    def taken(pairs: Int64s) -> tuple[Int64s, Int64s]:
        """Where the decisions of pairs begin and end."""
        return np.searchsorted(key, pairs), np.searchsorted(key, pairs, side="right")

    def targets(pairs: Int64s) -> Int64s:
        begin, end = taken(pairs)
        parts = spans(begin, end)
        rows, after = row[parts], following[parts]
        free = pairs[begin == end]
        rows = np.concatenate((rows, first_rows[free // size]))
        after = np.concatenate((after, free % size))
        entries = spans(matrix.indptr[:-1][rows], matrix.indptr[1:][rows])
        states = matrix.indices[entries].astype(np.int64)
        return np.unique(states * size + np.repeat(after, matrix.lengths[rows]))

    frontier = np.flatnonzero(base.initial.members) * size + first
    reached = frontier
    while len(frontier):
        frontier = np.setdiff1d(targets(frontier), reached, assume_unique=True)
        reached = np.union1d(reached, frontier)
    state, memory = np.divmod(reached, size)
    begin, end = taken(reached)
    free = begin == end
    counts = np.where(free, 1, end - begin)
    groups = starts_of(counts)
    rows, after = np.empty(groups[-1], np.int64), np.empty(groups[-1], np.int64)
    weights = full(int(groups[-1]), 1, rational=base.is_rational)
    chosen, parts = np.repeat(~free, counts), spans(begin, end)
    rows[chosen], after[chosen], weights[chosen] = row[parts], following[parts], share[parts]
    rows[~chosen], after[~chosen] = first_rows[state[free]], memory[free]
    lengths = matrix.lengths[rows]
    entries = spans(matrix.indptr[:-1][rows], matrix.indptr[1:][rows])
    to = matrix.indices[entries].astype(np.int64) * size + np.repeat(after, lengths)
    pairs = SparseMatrix(
        starts_of(lengths),
        np.searchsorted(reached, to).astype(np.int32),
        matrix.data[entries],
        len(reached),
        groups,
    )
    model = ProductModel(base, state.astype(np.int32), memory.astype(np.int32), pairs, rows, first)
    index = np.searchsorted(reached, np.arange(base.states) * size + first)
    index = np.minimum(index, len(reached) - 1)
    entry = np.where(reached[index] == np.arange(base.states) * size + first, index, -1)
    return Strategy(
        base.over(model),
        first_best(weights, groups),
        None,
        ~free,
        model.automaton,
        entry,
        weights if (counts > 1).any() else None,
    )
