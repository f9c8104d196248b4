"""The likeliest paths to a set of states, one after the other.

A path is a walk: it may visit a state several times. The logarithm of its probability is the
negative of its length if a transition of probability p has the length -log p, so the k likeliest
paths are the k shortest walks (Han, Katoen & Damman 2009, 'Counterexample generation in
probabilistic model checking'). They are found by a best-first search in the tree of all walks. The
length of the shortest walk from each state, known in advance, tells how much a transition deviates
from it (Eppstein 1998, 'Finding the k shortest paths'); the sum of these deviations orders the
search, so that it expands no state that is not on one of the paths found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from heapq import heappop, heappush
from itertools import count
from typing import cast

import numpy as np

from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.numbers import Numbers, doubles
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, first_best

__all__ = ["FoundPath", "StepProblem", "WalkProblem", "likeliest_paths"]

_TIE = 1e-12
"""A transition deviates if it makes a walk longer by more than this. Smaller deviations are
rounding; without them, walks of the same probability are found one after the other."""


@dataclass(frozen=True, slots=True)
class FoundPath:
    """A path: its states, the row of the matrix that each step takes, and its probability."""

    states: tuple[int, ...]
    rows: tuple[int, ...]
    probability: float | Fraction


@dataclass(frozen=True, eq=False)
class WalkProblem:
    """Walks of a chain that pass through some states and end in the first target.

    matrix: probabilities, one row per state. through: bool[n], the states that are left. target:
    bool[n], the states in which a walk ends.
    """

    matrix: SparseMatrix
    through: Bools
    target: Bools

    def distances(self) -> tuple[list[Floats], list[Int64s]]:
        """The length of the shortest walk from each state, and the row of each state."""
        require_memory_for_scipy()
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        m, n = self.matrix, self.matrix.states
        source = np.repeat(np.arange(n), m.lengths)
        kept = (self.through & ~self.target)[source]
        lengths = _lengths(m)[kept]
        # Reversed; a length of 0 is an edge, because it is stored.
        graph = csr_array((lengths, (m.indices[kept], source[kept])), (n, n))
        ends = np.flatnonzero(self.target)
        lengths_to_end = (
            dijkstra(graph, indices=ends, min_only=True)
            if len(ends)
            else np.full(n, np.inf, dtype=np.float64)
        )
        return [lengths_to_end], [np.arange(n)]


@dataclass(frozen=True, eq=False)
class StepProblem:
    """Walks of at most `steps` steps of a chain or an MDP.

    A walk ends in the first target, or after all steps in a state of `end`. In an MDP, the strategy
    is the one that maximises the probability of these walks, or what they earn; it depends on the
    number of steps that are left.

    matrix: probabilities. through, target: as in `WalkProblem`. end: bool[n]. earned: what each row
    earns, float64[rows] or rationals; None for probabilities.
    """

    matrix: SparseMatrix
    through: Bools
    target: Bools
    end: Bools
    steps: int
    earned: Numbers | None = None

    def distances(self) -> tuple[list[Floats], list[Int64s]]:
        """The length of the shortest walk from each state, and its row, by steps that are left."""
        m = self.matrix
        lengths, plain = _lengths(m), np.arange(m.states)
        numeric = m.doubles()
        last = self.target | self.end
        earned = np.zeros(m.rows) if self.earned is None else doubles(self.earned)
        value = last.astype(np.float64) if self.earned is None else np.zeros(m.states)
        distances, rows = [np.where(last, 0.0, np.inf)], [plain]
        for _ in range(self.steps):
            by_row = numeric.multiply(value) + earned
            chosen = plain if m.groups is None else first_best(by_row, m.groups)
            walks = np.minimum.reduceat(lengths + distances[-1][m.indices], m.indptr[:-1])[chosen]
            value = np.where(self.target, 1.0, np.where(self.through, by_row[chosen], 0.0))
            distances.append(np.where(self.target, 0.0, np.where(self.through, walks, np.inf)))
            rows.append(chosen)
        return distances, rows


def _lengths(matrix: SparseMatrix) -> Floats:
    """The length of each transition."""
    return np.maximum(-np.log(doubles(matrix.data)), 0.0)


def likeliest_paths(problem: WalkProblem | StepProblem, initial: int) -> Iterator[FoundPath]:
    """The paths from a state in the order of decreasing probability (of equal ones, in any order).

    Args:
        problem: which walks are paths.
        initial: the number of the first state.

    Returns:
        An iterator, which finds each path when it is asked for. Probabilities are the products of
        the entries of the matrix, rationals if these are.
    """
    m = problem.matrix
    distances, rows = problem.distances()
    bounded = isinstance(problem, StepProblem)
    one: float | Fraction = Fraction(1) if m.is_rational else 1.0
    start = (initial, len(rows) - 1)
    if not np.isfinite(distances[-1][initial]):
        return
    order = count()
    # A walk: deviation so far, a longer one first, number, state and steps left, probability, and
    # the walk before its last step with the row of that step.
    heap: list[_Walk] = [(0.0, 0, 0, start, one, None, -1)]
    while heap:
        walk = heappop(heap)
        deviation, length, _, (state, left), probability, _, _ = walk
        if problem.target[state] or (bounded and left == 0):
            yield _path(walk)
            continue
        row = int(rows[left][state])
        after = left - 1 if bounded else 0
        here, ahead = distances[left][state], distances[after]
        part = slice(m.indptr[row], m.indptr[row + 1])
        steps = zip(m.indices[part].tolist(), m.data[part].tolist(), strict=True)
        for target, weight in steps:
            if weight and np.isfinite(ahead[target]):
                more = max(0.0, -float(np.log(float(weight))) + ahead[target] - here)
                total = deviation + (more if more > _TIE else 0.0)
                product = probability * weight
                where = target, after
                heappush(heap, (total, length - 1, next(order), where, product, walk, row))


_Walk = tuple[float, int, int, tuple[int, int], float | Fraction, "object", int]


def _path(walk: _Walk) -> FoundPath:
    states, rows = [], []
    current: _Walk | None = walk
    while current is not None:
        states.append(current[3][0])
        rows.append(current[6])
        current = cast("_Walk | None", current[5])
    return FoundPath(tuple(reversed(states)), tuple(reversed(rows[:-1])), walk[4])
