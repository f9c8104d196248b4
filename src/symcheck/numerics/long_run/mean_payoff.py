"""Long-run average rewards of Markov decision processes, with certified bounds.

In an end component all states have the same best average, as one can go from any to any. For *any* vector h,

    min over s of (T h - h)(s)  <=  best average  <=  max over s of (T h - h)(s),    T h = max over rows of (r + P h),

(Odoni 1969; Puterman 1994, 8.5 and 9.5), so that h may come from anywhere: here, from value iteration on the aperiodic variant
of the process, and where that is slow from policy iteration. A strategy for ever ends in some end component, almost surely;
so the value is that of the best way to end in them (Chatterjee & Henzinger 2011; Ashok, Chatterjee, Daca, Kretinsky & Meggendorfer 2017).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem, Observer, Step
from symcheck.numerics.settings import Settings

__all__ = ["Gain", "Gains", "component_gains", "ending"]

_PATIENCE = 2_000
"""Value iterations before policy iteration is tried."""
_POLICIES = 60
_SOLVED = 100_000
"""States up to which a policy is evaluated by a direct solution."""
_STAY = 0.5
"""Probability with which the aperiodic variant stays where it is."""


@dataclass(frozen=True)
class Gain:
    """Bounds on the best average of an end component; `iterations` of any kind."""

    lower: float
    upper: float
    iterations: int = 0


@dataclass(frozen=True, eq=False)
class Gains:
    """Maximal end components (`parts`) and bounds on the best average of each: float64[parts.count]."""

    parts: graph.EndComponents
    lower: Floats
    upper: Floats
    iterations: int
    largest: int


@dataclass(frozen=True, eq=False)
class _Part:
    """An end component alone, with the rows that stay inside: rewards float64[rows], more is better."""

    matrix: SparseMatrix
    rewards: Floats = field(repr=False)

    @property
    def groups(self) -> Int64s:
        """Rows of each state."""
        assert self.matrix.groups is not None
        return self.matrix.groups

    def rows(self, h: Floats) -> Floats:
        """R + P h per row."""
        out = np.empty(self.matrix.rows)
        sparse.multiply(self.matrix.indptr, self.matrix.indices, self.matrix.data, h, out)
        return np.asarray(out + self.rewards)

    def best(self, rows: Floats) -> Floats:
        """The best row of each state."""
        return np.asarray(np.maximum.reduceat(rows, self.groups[:-1]))

    def slip(self, h: Floats) -> float:
        """What rounding may have done to T h - h."""
        longest = int(np.diff(self.matrix.indptr).max())
        return float(
            (longest + 6) * 2.0**-52 * (np.abs(self.rewards).max() + 2.0 * np.abs(h).max())
        )


def component_gains(
    matrix: SparseMatrix,
    rewards: Floats,
    direction: Direction,
    settings: Settings,
    observer: Observer | None = None,
) -> Gains:
    """The best ('max': greatest, 'min': least) long-run average reward per step in each maximal end component.

    rewards: per row, float64[rows]. Certified; relative to the average, but of the greatest reward where it is near 0.
    """
    sign = -1.0 if direction == Direction.MIN else 1.0
    parts = graph.maximal_end_components(matrix, np.ones(matrix.states, np.bool_))
    lower, upper = np.empty(parts.count), np.empty(parts.count)
    iterations = largest = 0
    sizes = np.bincount(parts.of[parts.of >= 0], minlength=parts.count)
    owner = graph.Incidence(matrix).owner_of_rows
    alone = sizes == 1
    if alone.any():
        # States that only stay where they are: the best of their loops.
        best = np.full(parts.count, -np.inf)
        np.maximum.at(best, parts.of[owner[parts.rows]], sign * rewards[parts.rows])
        lower[alone] = upper[alone] = best[alone]
    for c, part in _larger(matrix, sign * rewards, parts, sizes, owner):
        found = _gain(part, settings, observer)
        lower[c], upper[c] = found.lower, found.upper
        iterations += found.iterations
        largest = max(largest, part.matrix.states)
    if sign < 0:
        lower, upper = -upper, -lower
    return Gains(parts, lower, upper, iterations, largest)


def _larger(
    matrix: SparseMatrix, rewards: Floats, parts: graph.EndComponents, sizes: Int64s, owner: Int32s
) -> Iterator[tuple[int, _Part]]:
    """The components of more than one state, each alone."""
    inside = np.flatnonzero(parts.rows)
    inside = inside[np.argsort(parts.of[owner[inside]], kind="stable")]
    starts = starts_of(np.bincount(parts.of[owner[inside]], minlength=parts.count))
    place = np.full(matrix.states, -1, np.int32)
    for c in np.flatnonzero(sizes > 1).tolist():
        rows = inside[starts[c] : starts[c + 1]]
        states, counts = np.unique(owner[rows], return_counts=True)
        place[states] = np.arange(len(states), dtype=np.int32)
        chosen = sparse.select(
            matrix.indptr, matrix.indices, matrix.data, rows.astype(np.int64), place
        )
        place[states] = -1
        groups = starts_of(counts)
        yield c, _Part(SparseMatrix(*chosen, len(states), groups), rewards[rows])


def _gain(part: _Part, settings: Settings, observer: Observer | None) -> Gain:
    """Bounds on the greatest average of an end component."""
    top, n = float(part.rewards.max()), part.matrix.states
    everywhere = np.ones(n, np.bool_)
    if graph.maximal_end_components(part.matrix, everywhere, part.rewards == top).count:
        return Gain(top, top)  # nothing is better than the greatest reward at each step
    low, high, h, count = -np.inf, np.inf, np.zeros(n), 0
    for count in range(1, settings.max_iterations + 1):
        following = part.best(part.rows(h))
        low, high = _narrowed(part, h, following, low, high)
        if observer is not None:
            observer(Step("value iteration", count, high - low, n))
        if _near(low, high, part.slip(h), settings):
            return Gain(low, high, count)
        if count % _PATIENCE == 0 and n <= _SOLVED:
            better = _policies(part, h, settings)
            low, high, h = max(low, better[0]), min(high, better[1]), better[2]
            if _near(low, high, part.slip(h), settings) or count >= 5 * _PATIENCE:
                break
            continue
        h = _STAY * h + (1.0 - _STAY) * following
        h -= h[0]
    return Gain(low, high, count)


def _narrowed(
    part: _Part, h: Floats, following: Floats, low: float, high: float
) -> tuple[float, float]:
    change, slip = following - h, part.slip(h)
    return max(low, float(change.min()) - slip), min(high, float(change.max()) + slip)


def _near(low: float, high: float, slip: float, settings: Settings) -> bool:
    """Whether the bounds are near enough, or as near as rounding lets them be."""
    scale = max(abs(low), abs(high)) if settings.relative else 1.0
    return high - low <= max(0.25 * settings.epsilon * scale, 4.0 * slip)


def _policies(part: _Part, h: Floats, settings: Settings) -> tuple[float, float, Floats]:
    """Policy iteration from the policy that is greedy for h: bounds, and the h of the last policy."""
    low, high = -np.inf, np.inf
    values = part.rows(h)
    policy = _first_best(values, part, part.best(values))
    for _ in range(_POLICIES):
        policy = _unichain(part, policy, settings)
        bias = _bias(part, policy)
        if not np.isfinite(bias).all():
            break
        h = bias
        values = part.rows(h)
        best = part.best(values)
        low, high = _narrowed(part, h, best, low, high)
        better = best > values[policy] + 4.0 * part.slip(h)
        if _near(low, high, part.slip(h), settings) or not better.any():
            break
        policy = np.where(better, _first_best(values, part, best), policy)
    return low, high, h - h[0]


def _first_best(values: Floats, part: _Part, best: Floats) -> Int64s:
    """Per state, the first row with the best value."""
    rows = np.flatnonzero(values == np.repeat(best, np.diff(part.groups)))
    owner = np.repeat(np.arange(part.matrix.states), np.diff(part.groups))[rows]
    out = np.empty(part.matrix.states, np.int64)
    out[owner[::-1]] = rows[::-1]
    return out


def _chain(part: _Part, policy: Int64s) -> SparseMatrix:
    m = part.matrix
    chosen = sparse.select(
        m.indptr, m.indices, m.data, policy, np.arange(m.columns, dtype=np.int32)
    )
    return SparseMatrix(*chosen, m.columns)


def _unichain(part: _Part, policy: Int64s, settings: Settings) -> Int64s:
    """The policy, changed where it does not lead to its best bottom component almost surely, so that it does."""
    from symcheck.numerics.long_run.stationary import long_run_average

    chain = _chain(part, policy)
    bottoms = graph.bsccs(chain)
    n = part.matrix.states
    target = bottoms[0]
    if len(bottoms) > 1:
        rewards = part.rewards[policy]
        place = np.full(n, -1, np.int32)
        averages = []
        for states in bottoms:
            place[states] = np.arange(len(states), dtype=np.int32)
            own = sparse.select(
                chain.indptr, chain.indices, chain.data, states.astype(np.int64), place
            )
            found = long_run_average(SparseMatrix(*own, len(states)), rewards[states], settings)
            averages.append(found.lower)
            place[states] = -1
        target = bottoms[int(np.argmax(averages))]
    goal = np.zeros(n, np.bool_)
    goal[target] = True
    sure = graph.prob1(chain, np.ones(n, np.bool_), goal)
    if sure.all():
        return policy
    _, rows = graph.prob1e_strategy(part.matrix, np.ones(n, np.bool_), sure)
    return np.where(sure, policy, rows)


def _bias(part: _Part, policy: Int64s) -> Floats:
    """H with h + g = r + P h for the policy's chain, and 0 at a state of its bottom component."""
    from scipy.sparse import csc_array, csr_array
    from scipy.sparse.linalg import splu

    chain = _chain(part, policy)
    n = chain.states
    anchor = int(graph.bsccs(chain)[0][0])
    p = csr_array((chain.data, chain.indices, chain.indptr), shape=(n, n)).tocoo()
    keep = p.col != anchor
    diagonal = np.flatnonzero(np.arange(n) != anchor)
    data = np.concatenate((-p.data[keep], np.ones(n - 1), np.ones(n)))
    rows = np.concatenate((p.row[keep], diagonal, np.arange(n)))
    columns = np.concatenate((p.col[keep], diagonal, np.full(n, anchor)))
    matrix = csc_array((data, (rows, columns)), shape=(n, n))
    try:
        solution = np.asarray(splu(matrix).solve(part.rewards[policy]))
    except RuntimeError:  # singular in floating point
        return np.full(n, np.nan)
    solution[anchor] = 0.0
    return solution


@dataclass(frozen=True, eq=False)
class Ending:
    """Equations of where to end: each end component is one state (`place`, int32[n]), with a row more, which stays for its average."""

    problem: LinearProblem
    place: Int64s


def ending(matrix: SparseMatrix, gains: Gains, direction: Direction) -> Ending:
    """X = opt over rows of (A x + b): at an end component, also its average. All strategies end, so that there is one solution.

    The averages must not be negative.
    """
    parts, n = gains.parts, matrix.states
    inside = parts.of >= 0
    first = np.arange(n)
    leader = np.full(parts.count, n, dtype=np.int64)
    np.minimum.at(leader, parts.of[inside], np.flatnonzero(inside))
    first[inside] = leader[parts.of[inside]]
    leads: Bools = first == np.arange(n)
    place = (np.cumsum(leads) - 1)[first]
    count = int(leads.sum())
    owner = graph.Incidence(matrix).owner_of_rows
    rows = np.flatnonzero(~parts.rows)
    kept = sparse.select(
        matrix.indptr, matrix.indices, matrix.data, rows, np.arange(n, dtype=np.int32)
    )
    indptr, indices, data = sparse.merge_columns(*kept, place.astype(np.int32), count)
    whole = SparseMatrix(
        np.concatenate((indptr, np.full(parts.count, indptr[-1]))).astype(np.int64), indices, data, count
    )  # fmt: skip
    of = np.concatenate((place[owner[rows]], place[leader]))
    order = np.argsort(of, kind="stable").astype(np.int64)
    sorted_rows = sparse.select(
        whole.indptr, whole.indices, whole.data, order, np.arange(count, dtype=np.int32)
    )
    groups = starts_of(np.bincount(of, minlength=count))
    none = np.zeros(len(rows))
    low, high = (np.concatenate((none, g))[order] for g in (gains.lower, gains.upper))
    leave = np.concatenate((none, np.ones(parts.count)))[order]
    return Ending(
        LinearProblem(
            low, SparseMatrix(*sorted_rows, count, groups), high, leave, direction, False
        ),
        place,
    )
