"""Vectors that satisfy the inequalities of a bound exactly, found from approximate values.

An upper bound x of x = opt (r + P x) satisfies x >= r + P x, a lower bound x <= r + P x: for all
rows of a state, or for those of a strategy. Approximate values do so up to their error. They are
moved by a multiple of the slack w, which has w >= x + P w in the rows that are almost tight: this
gives each of these rows some room, in proportion to its value; other rows have room already. What
results is rounded to a grid, and checked in integers: the vectors hold as they are stored.

Source: Hartmanns & Kaminski (2020), optimistic value iteration, for the idea of a guess that is
verified; Chatterjee et al. (TACAS 2025) for what a certificate needs.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import frexp, lcm
from typing import NamedTuple

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.kernels.graph.ranks import descending_ranks
from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.numbers import Numbers, Rationals, distinct, doubles, shared
from symcheck.matrices.rows import (
    Bools,
    Floats,
    Int32s,
    Int64s,
    SparseMatrix,
    first_best,
    starts_of,
)
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.settings import Accuracy

__all__ = [
    "AverageVectors",
    "InductiveVector",
    "Inequalities",
    "RationalRows",
    "average_vectors",
    "both_inductive",
    "contracted",
    "exactly_inductive",
    "inductive",
    "progress",
]


Whole = Numbers
"""Whole numbers: int64, or objects where these are too large."""


@dataclass(frozen=True, eq=False)
class InductiveVector:
    """A bound of each state, as integers over a denominator, and what proves it.

    Attributes:
        numerators: the integers, objects[n]; None for infinity.
        denominator: the denominator of all of them.
        choices: the row that a strategy takes in each state, int64[n]; None: all rows.
        ranks: int64[n], -1 for none; None where no ranks are needed.
    """

    numerators: Rationals
    denominator: int
    choices: Int64s | None = None
    ranks: Int64s | None = None


@dataclass(frozen=True, eq=False)
class RationalRows:
    """The rows of a model, and what the inequalities of both sides of a measure read of them.

    Attributes:
        matrix: the probabilities of all rows, as rationals.
    """

    matrix: SparseMatrix = field(repr=False)

    @cached_property
    def edges(self) -> graph.Incidence:
        """The matrix with its transposed graph."""
        return graph.Incidence(self.matrix)

    @cached_property
    def doubles(self) -> SparseMatrix:
        """The probabilities as doubles."""
        return self.matrix.doubles()

    @cached_property
    def ordinary(self) -> bool:
        """Whether no probability is so small that doubles lose its digits."""
        return bool(self.doubles.data.min(initial=1.0) > tuning.UNDERFLOW_RISK)


@dataclass(frozen=True, eq=False)
class Inequalities:
    """The inequalities of one side of a measure.

    Attributes:
        rows: the rows of the model.
        free: the states in which they have to hold, bool[n].
        fixed: the values of the other states, float64[n].
        earned: what each row earns, rationals[rows]; None: nothing.
        upper: whether x >= r + P x is needed.
        all_rows: whether they have to hold for all rows; otherwise for those of a strategy.
        strategy: the row of each state where not all rows count, int64[n]; None: one is chosen.
        ends: the states to which ranks descend, bool[n]; None: no ranks are needed.
        certain: states of a fixed value that rows among them and `ends` preserve, bool[n]; ranks
            descend through them. None: there are none.
        limit: no value of an upper bound of probabilities needs to be greater.
    """

    rows: RationalRows = field(repr=False)
    free: Bools
    fixed: Floats
    earned: Rationals | None
    upper: bool
    all_rows: bool
    ends: Bools | None
    strategy: Int64s | None = None
    certain: Bools | None = None
    limit: float = np.inf

    @property
    def matrix(self) -> SparseMatrix:
        """The probabilities of all rows, as rationals."""
        return self.rows.matrix

    @property
    def edges(self) -> graph.Incidence:
        """The matrix with its transposed graph."""
        return self.rows.edges

    @property
    def doubles(self) -> SparseMatrix:
        """The probabilities as doubles."""
        return self.rows.doubles

    @cached_property
    def rewards(self) -> Floats:
        """What each row earns, as doubles."""
        return np.zeros(self.matrix.rows) if self.earned is None else doubles(self.earned)

    @cached_property
    def considered(self) -> Bools:
        """Rows of free states; where an infinite value follows, a lower bound always holds."""
        rows = self.free[self.edges.owner_of_rows]
        if not self.upper and np.isinf(self.fixed).any():
            rows &= np.isfinite(self.doubles.multiply(np.where(self.free, 0.0, self.fixed)))
        return rows

    @cached_property
    def preserving(self) -> Bools:
        """The rows of certain states that lead only to them and to `ends`, bool[rows]."""
        if self.certain is None or self.ends is None:
            return np.zeros(self.matrix.rows, np.bool_)
        leaves = self.doubles.multiply(np.where(self.certain | self.ends, 0.0, 1.0)) > 0.0
        return self.certain[self.edges.owner_of_rows] & ~leaves

    def room(self, x: Floats) -> Floats:
        """By how much each considered row satisfies its inequality; infinite for other rows."""
        with np.errstate(invalid="ignore"):
            excess = x[self.edges.owner_of_rows] - self.rewards - self.doubles.multiply(x)
        return np.where(self.considered, excess if self.upper else -excess, np.inf)

    def surely(self, x: Floats) -> Bools:
        """The rows that satisfy their inequality whatever the rounding errors of `room` are.

        A sum of n products differs from the exact one by less than (n + 2) units of the last digit
        of what its terms have without their signs (Higham 2002, section 3.1).
        """
        if not self._ordinary:
            return np.zeros(self.matrix.rows, np.bool_)
        size = np.abs(x)
        terms = size[self.edges.owner_of_rows] + np.abs(self.rewards) + self.doubles.multiply(size)
        errors = (self.matrix.lengths + 8) * tuning.UNIT_ROUNDOFF * terms
        usual = (terms == 0.0) | (terms > tuning.UNDERFLOW_RISK)
        return np.asarray(usual & np.isfinite(terms) & (self.room(x) >= errors))

    @cached_property
    def _ordinary(self) -> bool:
        """Whether no probability and no reward is so small that doubles lose its digits."""
        earned = [] if self.earned is None else distinct(self.earned)
        return self.rows.ordinary and all(v == 0 or abs(v) > tuning.UNDERFLOW_RISK for v in earned)


class _Slack(NamedTuple):
    """The part of each state, all states of which get one value, int32[n]; and the slack of each
    state, float64[n].
    """

    part: Int32s
    w: Floats


def inductive(problem: Inequalities, guess: Floats) -> InductiveVector:
    """A vector that satisfies the inequalities exactly, near to approximate values.

    Args:
        problem: the inequalities.
        guess: values of the free states, float64[n].

    Raises:
        NumericalError: none was found.
    """
    return _inductive(problem, guess, None)[0]


def both_inductive(
    lower: Inequalities, upper: Inequalities, guess: Floats
) -> tuple[InductiveVector, InductiveVector]:
    """The vectors of both sides of a measure, as `inductive` finds them.

    A slack of all rows is one of those of a strategy: it is computed once.
    """
    if upper.all_rows:
        above, slack = _inductive(upper, guess, None)
        return _inductive(lower, guess, slack)[0], above
    below, slack = _inductive(lower, guess, None)
    return below, _inductive(upper, guess, slack)[0]


def _inductive(
    problem: Inequalities, guess: Floats, known: _Slack | None
) -> tuple[InductiveVector, _Slack]:
    """The vector and its slack; a known slack is tried first."""
    x = np.where(problem.free, guess, problem.fixed)
    room, scale = problem.room(x), np.abs(x)[problem.edges.owner_of_rows]
    tolerances = list(tuning.TIGHT_ROWS)
    if problem.all_rows:  # rows that miss their inequality need room
        missing = room < 0.0
        with np.errstate(divide="ignore"):
            worst = float(np.max(-room[missing] / scale[missing], initial=0.0))
        tolerances = [t for t in tolerances if t >= worst] or tolerances
    for slack in (None,) if known is None else (known, None):
        for tolerance in tolerances:
            found = _near(problem, x, room, np.abs(room) <= tolerance * scale, slack)
            if found is not None:
                return found
    raise NumericalError("no vector was found that satisfies the inequalities of a certificate")


def exactly_inductive(problem: Inequalities, values: Rationals) -> InductiveVector:
    """The exact values as a vector that satisfies the inequalities.

    Args:
        problem: the inequalities.
        values: the values of the free states, rationals[n].

    Raises:
        NumericalError: these are not the values, or no strategy attains them.
    """
    fixed = problem.fixed.astype(object)
    x = np.where(problem.free, values, fixed)
    x[~problem.free & np.isinf(problem.fixed)] = None
    numbers = [Fraction(0 if v is None else v) for v in x.tolist()]
    denominator = lcm(*{f.denominator for f in numbers})
    numerators = _whole(f.numerator * (denominator // f.denominator) for f in numbers)
    numerators[x == None] = None  # noqa: E711
    vector = InductiveVector(numerators, denominator)
    tight = problem.considered.copy()
    tight[tight] = _Integers.of(problem, problem.considered).excess(vector) == 0
    choices, ranks = None, None
    if problem.ends is not None:
        candidates = problem.preserving | (problem.considered if problem.all_rows else tight)
        ranks, towards = progress(problem.edges, candidates, problem.ends, problem.all_rows)
    rows = problem.considered
    if not problem.all_rows:
        choices = first_best(np.where(tight, 1.0, 0.0), problem.edges.groups)
        if problem.ends is not None:
            choices[towards >= 0] = towards[towards >= 0]
        rows = np.zeros_like(rows)
        rows[choices] = True
        rows &= problem.considered
    if not _Integers.of(problem, rows).satisfied_by(vector, upper=problem.upper):
        raise NumericalError("the exact values do not satisfy the inequalities of a certificate")
    return replace(vector, choices=choices, ranks=ranks)


def contracted(problem: Inequalities, guess: Floats) -> InductiveVector:
    """A vector near to approximate values, where the sum of each row is less than 1 by as much.

    Shifting all values by c gives each row the room c (1 - sum).

    Args:
        problem: the inequalities, of rows that are multiplied by a discount; all states are free.
        guess: values, float64[n].

    Raises:
        NumericalError: none was found.
    """
    room, rows, choices = problem.room(guess), problem.considered, None
    if not problem.all_rows:
        choices = first_best(room, problem.edges.groups)
        rows = np.zeros_like(rows)
        rows[choices] = True
    left = 1.0 - float(problem.doubles.row_sums().max())
    scale = float(np.max(np.abs(guess), initial=0.0)) + float(np.max(np.abs(problem.rewards)))
    step = max(0.0, -2.0 * float(room[rows].min())) / left + scale * 4.0 * tuning.UNIT_ROUNDOFF
    while step <= tuning.WIDEST_ROOM * scale:
        moved = guess + step if problem.upper else guess - step
        if (vector := _satisfying(problem, rows, moved)) is not None:
            return replace(vector, choices=choices)
        step *= tuning.ROOM_GROWTH
    raise NumericalError("no vector was found that satisfies the inequalities of a certificate")


def _near(
    problem: Inequalities, x: Floats, room: Floats, tight: Bools, slack: _Slack | None
) -> tuple[InductiveVector, _Slack] | None:
    """A vector that satisfies the inequalities, if these rows are those that need room."""
    rows, ranks, choices = problem.considered, None, None
    if problem.ends is not None:
        candidates = problem.preserving | (rows if problem.all_rows else tight)
        ranks, towards = progress(problem.edges, candidates, problem.ends, problem.all_rows)
        if (problem.free & (ranks < 0) & (x > 0)).any():
            return None
    if not problem.all_rows:
        if problem.strategy is None:
            choices = first_best(np.where(rows, room, -np.inf), problem.edges.groups)
        else:
            choices = problem.strategy.copy()
        if problem.ends is not None:
            choices[towards >= 0] = towards[towards >= 0]
        rows = np.zeros_like(rows)
        rows[choices] = True
        rows &= problem.considered
        tight = rows
    slack = slack or _slack(problem, x, rows, tight & rows)
    if slack is None:
        return None
    base = np.where(problem.free, _best(problem, x, slack.part)[slack.part], x)
    w = np.where(problem.free, slack.w, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        missing = np.maximum(-problem.room(base), 0.0) / np.abs(base)[problem.edges.owner_of_rows]
    worst = float(np.max(missing[tight & rows & np.isfinite(missing)], initial=0.0))
    rounding = (problem.matrix.longest + 8) * 4.0 * tuning.UNIT_ROUNDOFF
    weight = np.abs(base)[problem.edges.owner_of_rows] + np.abs(problem.rewards)
    step = 2.0 * worst + rounding
    while step < tuning.WIDEST_ROOM:
        moved = np.minimum(base + step * w, problem.limit) if problem.upper else base - step * w
        if problem.earned is None and not problem.upper:
            moved = np.maximum(moved, 0.0)
        whole = np.where(problem.free, moved, problem.fixed)
        if not (problem.room(whole) < -rounding * weight)[rows].any():  # not hopeless: exactly
            if (vector := _satisfying(problem, rows, whole)) is not None:
                return replace(vector, choices=choices, ranks=ranks), slack
        step *= tuning.ROOM_GROWTH
    return None


def _satisfying(problem: Inequalities, rows: Bools, x: Floats) -> InductiveVector | None:
    """The doubles as a vector, if they satisfy these rows exactly.

    Only rows that doubles do not decide are computed in integers.
    """
    undecided = rows & ~problem.surely(x)
    vector = InductiveVector(*_on_grid(x))
    if not undecided.any():
        return vector
    checked = _Integers.of(problem, undecided)
    return vector if checked.satisfied_by(vector, upper=problem.upper) else None


def progress(
    edges: graph.Incidence, rows: Bools, ends: Bools, all_rows: bool
) -> tuple[Int64s, Int64s]:
    """Ranks that some transition of each row lowers, down to `ends`.

    Args:
        edges: the matrix.
        rows: the rows that are considered, bool[rows].
        ends: the states of rank 0, bool[n].
        all_rows: whether all considered rows of a state have to lower its rank; otherwise one.

    Returns:
        The rank of each state, -1 for none, and a row that lowers it, -1 for none.
    """
    masks = rows.view(np.uint8), ends.view(np.uint8)
    return descending_ranks(edges.pre, edges.rows_in, edges.owner_of_rows, *masks, all_rows)


def _best(problem: Inequalities, x: Floats, part: Int32s) -> Floats:
    """The greatest value of each part for an upper bound, and the least one for a lower bound."""
    best = np.full(int(part.max(initial=-1)) + 1, -np.inf if problem.upper else np.inf)
    (np.maximum if problem.upper else np.minimum).at(best, part, x)
    return best


def _slack(problem: Inequalities, x: Floats, rows: Bools, tight: Bools) -> _Slack | None:
    """The slack of values that are equal within end components; None if it is infinite.

    States of an end component without rewards have one value; its rows are satisfied with equality.
    """
    from symcheck.numerics.linear.methods import solve_linear

    owner = problem.edges.owner_of_rows
    inner = rows & (problem.rewards == 0.0)
    parts = graph.maximal_end_components(problem.edges, problem.free, inner)
    index, count = parts.quotient_states()
    kept = np.flatnonzero(tight & ~parts.rows)
    kept = kept[np.argsort(index[owner[kept]], kind="stable")]
    sizes = np.bincount(index[owner[kept]], minlength=count)
    unknown = np.zeros(count, np.bool_)
    unknown[index[problem.free]] = True
    unknown &= sizes > 0
    groups = starts_of(sizes)
    whole = problem.doubles.choose(kept.astype(np.int64), groups).merge(index, count)
    inside, outer = whole.among(unknown), whole.rows_of(unknown)
    closed = inside.lengths == whole.lengths[outer]
    if graph.maximal_end_components(inside, np.ones(inside.states, np.bool_), closed).count:
        return None
    weight = np.abs(_best(problem, x, index))[unknown]
    assert inside.groups is not None
    constant = np.repeat(weight, np.diff(inside.groups))
    leaving = np.where(closed, 0.0, whole.row_sums()[outer] - inside.row_sums())
    system = LinearProblem(
        constant, inside, exit=leaving, direction=Direction.MAX, probability=False
    )
    try:
        solved = solve_linear(system, Accuracy(epsilon=1e-2))
    except NumericalError:
        return None
    of_part = np.zeros(count)
    of_part[unknown] = solved.upper * 1.02
    w = np.where(problem.free, of_part[index], 0.0)
    return _Slack(index, w) if np.isfinite(w).all() else None


def _on_grid(values: Floats) -> tuple[Rationals, int]:
    """Finite doubles as integers over the second number, without rounding; None for infinity."""
    positive = np.abs(values[np.isfinite(values) & (values != 0.0)])
    smallest = frexp(float(positive.min(initial=1.0)))[1]
    bits = max(0, tuning.GRID_BITS - smallest)
    mantissas, exponents = np.frexp(np.where(np.isfinite(values), values, 0.0))
    whole = np.ldexp(mantissas, 53).astype(np.int64).tolist()
    shifts = (exponents.astype(np.int64) - 53 + bits).tolist()
    numerators = np.empty(len(values), object)
    numerators[:] = [v << by if v else 0 for v, by in zip(whole, shifts, strict=True)]
    numerators[np.isinf(values)] = None
    return numerators, 1 << bits


@dataclass(frozen=True, eq=False)
class _Integers:
    """Some rows, multiplied by denominators that make their numbers whole.

    owner: the state of each row. earned: what it earns. stay: its mean time; 0 where it is not
    asked for.
    """

    matrix: SparseMatrix
    owner: Int64s
    denominators: Rationals
    earned: Rationals
    stay: Rationals

    @staticmethod
    def of(problem: Inequalities, rows: Bools, stay: Rationals | None = None) -> _Integers:
        """The rows of the inequalities; `stay` is the mean time of each row of the model."""
        kept = np.flatnonzero(rows)
        matrix = problem.matrix.choose(kept)
        tops, bottoms = _parts(matrix.data)
        by = _common_multiples(bottoms, matrix.indptr)
        of_rows = [None if p is None else _parts(p[kept]) for p in (problem.earned, stay)]
        multiples = by.astype(object)
        for parts in of_rows:
            multiples = multiples if parts is None else np.lcm(multiples, parts[1].astype(object))
        weights = _product(tops, np.repeat(by, matrix.lengths) // bottoms)
        more = multiples // by
        if (more != 1).any():
            weights = weights * np.repeat(more, matrix.lengths)
        nothing = np.zeros(len(kept), object)
        earned, staying = (
            nothing if parts is None else parts[0] * (multiples // parts[1]) for parts in of_rows
        )
        owner = problem.edges.owner_of_rows[kept].astype(np.int64)
        return _Integers(replace(matrix, data=weights), owner, multiples, earned, staying)

    def excess(self, vector: InductiveVector) -> Rationals:
        """Per row: `x - r - P x`, times its denominator and that of the vector."""
        values = np.where(vector.numerators == None, 0, vector.numerators)  # noqa: E711
        products = self.matrix.data * values[self.matrix.indices]
        expected = np.add.reduceat(products, self.matrix.indptr[:-1]) if len(products) else products
        excess = values[self.owner] * self.denominators - expected
        excess -= self.earned * vector.denominator
        return np.asarray(excess)

    def satisfied_by(
        self, vector: InductiveVector, gain: InductiveVector | None = None, *, upper: bool
    ) -> bool:
        """Whether all rows satisfy their inequality exactly, with the gain of a bias."""
        excess = self.excess(vector)
        if gain is not None:
            of_gain = self.stay * gain.numerators[self.owner]
            excess = excess * gain.denominator + of_gain * vector.denominator
        return bool((excess >= 0).all() if upper else (excess <= 0).all())


def _parts(values: Rationals) -> tuple[Whole, Whole]:
    """The numerators and the denominators."""
    objects, codes = shared(values)
    ratios = [v.as_integer_ratio() for v in objects]
    tops, bottoms = _whole(top for top, _ in ratios), _whole(bottom for _, bottom in ratios)
    return _compact(tops)[codes], _compact(bottoms)[codes]


def _compact(values: Rationals) -> Whole:
    """Whole numbers as int64, if all of them are small enough."""
    return values if any(abs(v) >= 1 << 62 for v in values.tolist()) else values.astype(np.int64)


def _product(one: Whole, other: Whole) -> Whole:
    """The products of whole numbers."""
    if one.dtype != object and other.dtype != object:
        if float(np.max(np.abs(one * other.astype(np.float64)), initial=0.0)) < 2.0**62:
            return np.asarray(one * other)
    return np.asarray(one.astype(object) * other)


def _common_multiples(numbers: Whole, starts: Int64s) -> Whole:
    """A common multiple of the numbers of each row, none of which is empty."""
    if numbers.dtype != object:
        found = np.lcm.reduceat(numbers, starts[:-1])
        each = np.repeat(found, np.diff(starts))
        if (found > 0).all() and not (each % numbers).any():  # otherwise it has overflowed
            return np.asarray(found)
    parts = numbers.tolist()
    return _whole(lcm(*parts[a:b]) for a, b in pairwise(starts.tolist()))


def _whole(values: Iterable[int]) -> Rationals:
    """Whole numbers as objects."""
    found = list(values)
    whole = np.empty(len(found), object)
    whole[:] = found
    return whole


@dataclass(frozen=True, eq=False)
class AverageVectors:
    """A bound of the long-run average of each state, and what proves it: g and h with g >= P g and
    t g + h >= r + P h (an upper bound; <= for a lower one), where t is the mean time of a step.
    """

    gain: InductiveVector
    bias: InductiveVector


def average_vectors(problem: Inequalities, stay: Rationals, gain: Floats) -> AverageVectors:
    """Vectors that satisfy both inequalities exactly.

    Args:
        problem: all states are free, `earned` is the reward of a step, and `strategy` the rows of
            an optimal strategy (None in a chain).
        stay: the mean time of a step of each row, rationals[rows].
        gain: the long-run averages, float64[n].

    Raises:
        NumericalError: none were found.
    """
    assert problem.earned is not None
    gain, bias, policy = _gain_and_bias(problem, doubles(stay), gain)
    shift = 1.0 + float(np.max(np.abs(gain), initial=0.0))
    best = float(gain.max(initial=0.0) if problem.upper else gain.min(initial=np.inf))
    if np.ptp(gain) <= tuning.EQUAL_GAINS * shift:  # a constant satisfies g = P g
        of_gain = InductiveVector(*_on_grid(np.full(len(gain), best + shift)))
    else:
        of_gain = inductive(replace(problem, earned=None), gain + shift)
    rows = np.ones(problem.matrix.rows, np.bool_)
    if not problem.all_rows:
        assert problem.strategy is not None
        rows[:] = False
        rows[problem.strategy] = True
    candidate, checked = InductiveVector(*_on_grid(bias)), _Integers.of(problem, rows, stay)

    def moved(by: float) -> InductiveVector:
        step = int((Fraction(by) - Fraction(shift)) * of_gain.denominator)
        return InductiveVector(of_gain.numerators + step, of_gain.denominator, problem.strategy)

    for rooms in (tuning.GAIN_ROOM[:4], tuning.GAIN_ROOM):
        for room in rooms:
            found = moved(room * shift if problem.upper else -room * shift)
            if checked.satisfied_by(candidate, found, upper=problem.upper):
                return AverageVectors(found, candidate)
        candidate = _refined(problem, stay, policy, moved(0.0), candidate)
    raise NumericalError("no bias was found that satisfies the inequalities of a certificate")


def _refined(
    problem: Inequalities,
    stay: Rationals,
    policy: Int64s,
    gain: InductiveVector,
    bias: InductiveVector,
) -> InductiveVector:
    """The bias of a policy with more digits than doubles have, by iterative refinement.

    A residual is computed exactly, and its correction in doubles. A bias may be 1e15 times as large
    as the gain, where a policy leaves transient states very slowly.
    """
    chosen = np.zeros(problem.matrix.rows, np.bool_)
    chosen[policy] = True
    equations, times = _Integers.of(problem, chosen, stay), doubles(stay)
    vector = InductiveVector(
        bias.numerators << tuning.MORE_BITS, bias.denominator << tuning.MORE_BITS
    )
    for _ in range(tuning.REFINEMENTS):
        missing = -equations.excess(vector) * gain.denominator
        missing -= equations.stay * gain.numerators * vector.denominator
        below = equations.denominators * vector.denominator * gain.denominator
        rewards = np.zeros(problem.matrix.rows)
        rewards[policy] = [top / bottom for top, bottom in zip(missing, below, strict=True)]
        _, change, _ = _of_policy(problem, policy, times, np.zeros(len(policy)), rewards)
        ratios = (c.as_integer_ratio() for c in change.tolist())
        added = _whole(top * vector.denominator // bottom for top, bottom in ratios)
        vector = replace(vector, numerators=vector.numerators + added)
    return vector


def _gain_and_bias(
    problem: Inequalities, stay: Floats, gain: Floats
) -> tuple[Floats, Floats, Int64s]:
    """The gain and the bias of an optimal policy that no row improves, by policy iteration."""
    groups = problem.edges.groups
    policy = groups[:-1].copy() if problem.strategy is None else problem.strategy
    sign = 1.0 if problem.upper else -1.0
    several = problem.all_rows and problem.matrix.groups is not None
    gain, bias, steps = _of_policy(problem, policy, stay, gain, problem.rewards)
    for _ in range(tuning.BIAS_POLICIES if several else 0):
        excess, falls = _excess(problem, stay, gain, bias)
        keeps = falls <= 1e-9 * (1.0 + np.abs(gain).max(initial=0.0))
        slack = 1e-9 * (1.0 + np.abs(bias).max(initial=0.0))
        best = first_best(np.where(keeps, excess, -np.inf), groups)
        improved = np.where(excess[best] > excess[policy] + slack, best, policy)
        if (improved == policy).all():
            break
        policy = improved
        better, bias, steps = _of_policy(problem, policy, stay, gain, problem.rewards)
        gain = sign * np.maximum(sign * gain, sign * better)
    if not several:  # the steps in transient states give their rows room; a bias is not stated
        room = tuning.BIAS_ROOM * (1.0 + float(np.max(np.abs(bias), initial=0.0)))
        return gain, bias + sign * room * steps, policy
    # Rows that lead to worse gains get room from a multiple of the gain.
    excess, falls = _excess(problem, stay, gain, bias)
    needs = (falls > 1e-9 * (1.0 + np.abs(gain).max(initial=0.0))) & (excess > 0.0)
    weight = float(np.max(2.0 * excess[needs] / falls[needs], initial=0.0))
    return gain, np.asarray(bias + weight * gain), policy


def _excess(
    problem: Inequalities, stay: Floats, gain: Floats, bias: Floats
) -> tuple[Floats, Floats]:
    """By how much each row misses its inequality of the bias, and by how much the gain falls."""
    owner, sign = problem.edges.owner_of_rows, 1.0 if problem.upper else -1.0
    expected = problem.rewards - stay * gain[owner] + problem.doubles.multiply(bias)
    return sign * (expected - bias[owner]), sign * (gain[owner] - problem.doubles.multiply(gain))


def _of_policy(
    problem: Inequalities, policy: Int64s, stay: Floats, gain: Floats, rewards: Floats
) -> tuple[Floats, Floats, Floats]:
    """The gain and the bias of a policy, and the mean number of steps in transient states.

    Gains of transient states are left as they are. Rows earn `rewards`.

    The gain of a recurrent component is unknown in the place of the bias of its first state, which
    is 0. So all equations of the component are solved to the last digits.
    """
    require_memory_for_scipy()
    from scipy.sparse import csc_array, csr_array, eye_array
    from scipy.sparse.linalg import splu

    chain, n = problem.doubles.choose(policy), problem.matrix.states
    matrix = csr_array((chain.data, chain.indices, chain.indptr), shape=(n, n))
    first, recurrent = np.ones(n), np.full(n, -1)
    for component in graph.bsccs(chain):
        first[component[0]] = 0.0
        recurrent[component] = component[0]
    inside = np.flatnonzero(recurrent >= 0)
    gains = csr_array((stay[policy][inside], (inside, recurrent[inside])), shape=(n, n))
    without_first = csr_array((first, (np.arange(n), np.arange(n))), shape=(n, n))
    system = csc_array((eye_array(n) - matrix) @ without_first + gains)
    right = rewards[policy] - np.where(recurrent < 0, stay[policy] * gain, 0.0)
    try:
        factors = splu(system)
    except RuntimeError:
        raise NumericalError("the equations of the bias are singular in doubles") from None
    found = factors.solve(right)
    found = found + factors.solve(right - system @ found)  # one step of refinement
    gain = np.where(recurrent >= 0, found[recurrent], gain)
    steps = np.maximum(factors.solve(np.where(recurrent < 0, 1.0, 0.0)), 0.0)
    steps = np.where(recurrent < 0, steps, 0.0)
    return gain, np.where(first == 0.0, 0.0, found), steps
