"""Time-bounded values of Markov automata, from below and from above.

The jumps of the states that take time are those of a Poisson process. The horizon is divided into
intervals, and what is known at the end of one bounds the values at its begin:

- from one side by a strategy that keeps to its choices within the interval;
- from the other side by strategies that know at the begin how many jumps there will be, and so
  are at least as good as any that does not: for each number, choices are optimal for what remains.
  In intervals with less than one jump on average, a policy is followed instead, and what other
  choices gain is bounded at each instant.

Both are the same where choices do not change with time, for intervals of any length; elsewhere the
distance shrinks with the square of the length, which is chosen accordingly.

Sources: Butkova, Hatefi, Hermanns & Krcal, 'Optimal continuous time Markov decisions' (ATVA 2015),
for the knowledge of the number of jumps; Buchholz & Schulz, 'Numerical analysis of continuous time
Markov decision processes over finite horizons' (2011), for intervals with constant choices.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import comb, exp, factorial

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import UnsupportedError
from symcheck.kernels.chains.timed_choices import TimedChoices
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.problem import Observer, Progress, largest_width
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.horizon import Transient
from symcheck.numerics.transient.poisson import PoissonWeights, poisson
from symcheck.numerics.tuning import UNIT_ROUNDOFF

__all__ = ["TimedProblem", "TimedSteps", "timed_values"]


@dataclass(frozen=True, eq=False)
class TimedProblem:
    """What is earned until a time by the states of a Markov automaton.

    Attributes:
        matrix: the probabilities of the rows, float64.
        exit_rates: float64[rows], 0 where a row takes no time.
        constant: float64[rows], what a row earns; at least 0.
        leave: float64[rows], the probability of leaving the states.
        lower, upper: float64[n], bounds on what is earned in a state at the end.
        direction: of the choices.
        instant: what is earned by choices that take no time for ever, and so keep time from
            passing.
        greatest: more than any value.
        error: of the numbers of a row and of rates, relative.
    """

    matrix: SparseMatrix
    exit_rates: Floats
    constant: Floats
    leave: Floats
    lower: Floats
    upper: Floats
    direction: Direction
    instant: float
    greatest: float
    error: float = 0.0

    @cached_property
    def groups(self) -> Int64s:
        """The rows of each state."""
        assert self.matrix.groups is not None
        return self.matrix.groups

    @cached_property
    def instants(self) -> Bools:
        """The states that take no time."""
        return np.asarray(self.exit_rates[self.groups[:-1]] == 0.0)

    def without_cycles(self) -> tuple[TimedProblem, Int32s]:
        """The problem in which each end component of states that take no time is one state.

        It may be left, or not, which earns `instant`. Also returns the state of each state.
        """
        m = self.matrix
        parts = graph.maximal_end_components(m, self.instants, self.leave == 0.0)
        state, count = parts.quotient_states()
        if not parts.count:
            return self, state
        owner = m.state_of_row
        rows = np.flatnonzero(~parts.rows)
        kept = m.choose(rows).merge(state, count)
        indptr = np.concatenate((kept.indptr, np.full(parts.count, kept.entries)))
        staying = np.empty(parts.count, np.int32)
        inside = parts.of >= 0
        staying[parts.of[inside]] = state[inside]
        of = np.concatenate((state[owner[rows]], staying))
        order = np.argsort(of, kind="stable").astype(np.int64)
        groups = starts_of(np.bincount(of, minlength=count))

        def of_rows(values: Floats, new: float) -> Floats:
            return np.concatenate((values[rows], np.full(parts.count, new)))[order]

        first = np.unique(state, return_index=True)[1]
        problem = replace(
            self,
            matrix=replace(kept, indptr=indptr).choose(order, groups),
            exit_rates=of_rows(self.exit_rates, 0.0),
            constant=of_rows(self.constant, self.instant),
            leave=of_rows(self.leave, 1.0),
            lower=self.lower[first],
            upper=self.upper[first],
        )
        return problem, state


@dataclass(eq=False)
class TimedSteps:
    """The steps of a problem, and how many were made."""

    problem: TimedProblem
    rate: float
    jumps: int = 0
    weight_error: float = 0.0
    beyond: float = 0.0

    def __post_init__(self) -> None:
        p, instants = self.problem, self.problem.instants
        parts = graph.sccs(p.matrix, instants)
        rates = p.exit_rates[p.groups[:-1]]
        levels, self.depth = self._levels(parts)
        self.has_cycles = bool((parts.sizes > 1).any())
        order = parts.order
        if not self.has_cycles:  # as they are in memory, which is read faster
            order = order[np.lexsort((order, levels[parts.of[order]]))]
        self.most = (self.depth + 1) * float(p.constant.max(initial=0.0))
        self.policy = np.zeros(p.matrix.states, np.int64)
        self.steps, self.gains = (
            TimedChoices(
                *p.matrix.arrays,
                p.groups,
                constant,
                p.leave,
                rates / self.rate,
                (self.rate - rates) / self.rate,
                np.flatnonzero(~instants).astype(np.int32),
                order,
                parts.start[1:],
            )
            for constant in (p.constant, np.zeros(p.matrix.rows))
        )

    def _levels(self, parts: graph.Components) -> tuple[Int64s, int]:
        """The level of each component, above its successors', and the number of levels: the most
        choices that follow each other in no time, or more where that is not plain.
        """
        depth = np.zeros(parts.count + 1, np.int64)
        m, of = self.problem.matrix, parts.of
        source, target = of[m.state_of_row[m.row_of_entry]], of[m.indices]
        inner = (source > target) & (target >= 0)
        source, target = source[inner], target[inner]
        for level in range(1, tuning.TIMED_LEVELS):
            deeper = depth.copy()
            np.maximum.at(deeper, source, depth[target] + 1)
            if np.array_equal(deeper, depth):
                return depth, level
            depth = deeper
        return np.arange(parts.count), parts.count + 1

    def work(self, jumps: int) -> float:
        """About the products that so many jumps take; each takes some time for itself."""
        return jumps * (self.problem.matrix.entries + tuning.TIMED_JUMP_WORK)

    @property
    def error(self) -> float:
        """A bound on the relative error of all steps and weights so far."""
        return self._error_of(self.jumps, self.weight_error)

    def _error_of(self, jumps: int, weights: float) -> float:
        """A bound on the relative error of so many steps, with that of their weights."""
        step = (2 * self.problem.matrix.longest + 10) * UNIT_ROUNDOFF + self.problem.error
        # Other rates change the density of a run with k jumps up to t by (1 + error)^(k + rate t).
        # There are twice as many jumps here.
        return 1.01 * (jumps * (self.depth + 1) * step + weights)

    def resolved(self, x: Floats, start: float) -> Floats:
        """The values with those of the states that take no time; the policy is kept."""
        maximise = self.problem.direction is Direction.MAX
        self.steps.resolve(x, maximise, self.policy, start)
        return x

    def jumped(self, x: Floats, count: int) -> Floats:
        """The values before a number of jumps, from those after them."""
        masses, total = np.zeros(count + 1), np.zeros(len(x))
        masses[-1] = 1.0
        maximise, average = self.problem.direction is Direction.MAX, np.zeros(len(x))
        self.steps.advance(
            x.copy(),
            masses,
            np.zeros(count + 1),
            1.0,
            maximise,
            self.policy,
            False,
            0.0,
            total,
            average,
        )
        return total

    def interval(
        self, lower: Floats, upper: Floats, jumps: float, least: float
    ) -> tuple[Floats, Floats]:
        """The bounds before an interval with so many jumps on average, from those after it.

        least: jumps whose probability is less than this part of the greatest one are left out.
        """
        maximise = self.problem.direction is Direction.MAX
        better, worse = (upper, lower) if maximise else (lower, upper)
        rate, weights = jumps, poisson(jumps, least)
        if (
            jumps < tuning.TIMED_SHORT
            and weights.right < tuning.TIMED_POWERS
            and not self.has_cycles
        ):
            best = self._followed(better, jumps, weights)
        else:
            # If they are few, their number tells little about the time of each if there are more
            # that change nothing.
            rate = max(jumps, tuning.TIMED_JUMPS)
            weights = poisson(rate, min(least, 1e-16))
            best = self._foreseen(better, jumps / rate, weights)
        start = 0.0 if maximise else self.problem.greatest
        kept, other = np.zeros(len(lower)), worse.copy()
        mass, none = weights.masses().between(0, weights.right + 1), np.empty(0)
        share, tail = jumps / rate, np.zeros(len(mass))
        self.steps.advance(other, mass, tail, share, maximise, self.policy, True, start, kept, none)
        self._account(weights, other)
        return (kept, best) if maximise else (best, kept)

    def _account(self, weights: PoissonWeights, last: Floats) -> None:
        """Count the jumps of a window, and bound what is left out beyond them, by the last values.

        Of later jumps, each earns `most` at most, and is less likely than the one before. Twice as
        much also covers what others would gain after them. Lower bounds may leave it out.
        """
        self.jumps += weights.right + 1
        self.weight_error += weights.error
        later = (weights.right + 2.0) / (weights.right + 2.0 - weights.rate)
        greatest = float(last.max(initial=0.0)) + self.most * later
        self.beyond += 2.0 * weights.missing * min(greatest, self.problem.greatest)

    def _foreseen(self, better: Floats, share: float, weights: PoissonWeights) -> Floats:
        """The bound by strategies that know the number of jumps; the policy is set."""
        masses, tails = weights.masses(), weights.tails()
        mass, tail = (sequence.between(0, masses.end) for sequence in (masses, tails))
        maximise = self.problem.direction is Direction.MAX
        start = self.problem.greatest if maximise else 0.0
        best, average, last = np.zeros(len(better)), np.zeros(len(better)), better.copy()
        self.steps.advance(
            last, mass, tail, share, maximise, self.policy, False, start, best, average
        )
        self.resolved(average / max(float(tail.sum()), 1e-300), 0.0)
        self._account(weights, last)
        return best

    def _followed(self, better: Floats, jumps: float, weights: PoissonWeights) -> Floats:
        """The bound by a policy, and by what others gain at most at each instant of an interval.

        The values of a policy with the matrix P are w(t) = exp(-t) p(t), where p(t) is the sum of
        t^k / k! times those after k jumps. Let b range over all choices. The greatest values are
        w + d at most, with d' <= max_b P_b d - d + r, where r = exp(-t) (max_b P_b p - P p) is what
        other rows gain; the least are w - d at least, with r = exp(-t) (P p - min_b P_b p). On d,
        P_b earns nothing. Bernstein polynomials are not negative, so the best rows for each
        coefficient of p bound the best ones at each t. Let G be the integral of exp(t) r over the
        interval. Then D = exp(t) d has D(t) <= G + the integral of max_b P_b D, and so D is at most
        the sum of t^j / j! (max_b P_b)^j G.
        """
        maximise = self.problem.direction is Direction.MAX
        n, none = len(better), np.empty(0)
        middle, share = np.zeros(n), np.array([1.0 - 0.5 * jumps, 0.5 * jumps])
        self.steps.advance(
            better.copy(), share, np.zeros(2), 1.0, maximise, self.policy, False, 0.0, middle, none
        )
        self.resolved(middle, 0.0)
        mass, k = weights.masses().between(0, weights.right + 1), weights.right
        powers = [jumps**j / factorial(j) for j in range(k + 1)]
        basis = np.array(
            [[comb(i, j) / comb(k, j) * p for j, p in enumerate(powers)] for i in range(k + 1)]
        )
        values, gain, last = np.zeros(n), np.zeros(n), better.copy()
        self.steps.follow(last, mass, basis, maximise, self.policy, values, gain)
        self._account(weights, last)
        # For their coefficients. A gain that was dropped is a relative error of 16 u of its jump,
        # and each jump counts for 24 u at least.
        self.jumps += 2 * (k + 2)
        gain *= jumps / (k + 1)  # the integral of each Bernstein polynomial
        # No P_b raises the maximum, and the terms from j on are T^j / j! at most, times exp(T).
        count = next((j for j, p in enumerate(powers) if p < 1e-5), k)
        more: Floats = np.full(n, float(gain.max()) * jumps**count / factorial(count))
        share, scratch = np.array(powers[:count]) * exp(-jumps), np.zeros(n, np.int64)
        self.gains.advance(gain, share, np.zeros(count), 1.0, True, scratch, False, 0.0, more, none)
        if maximise:
            return values + more
        # Each has a relative error. That of the difference is three times as large at most, unless
        # it is small itself.
        made = 3 * (k + 2)  # k + 1 jumps, and 2 (k + 2) for coefficients
        self.jumps += 2 * made
        self.weight_error += 2.0 * weights.error
        error = self._error_of(made, weights.error)
        small = np.maximum(values * (1.0 - error) - more * (1.0 + error), 0.0)
        return np.asarray(np.where(2.0 * more <= values, values - more, small))


def timed_values(
    problem: TimedProblem,
    time: float,
    settings: Settings,
    interest: Int64s | None = None,
    observer: Observer | None = None,
) -> Transient:
    """Bounds on the optimal expected earnings until a time.

    Args:
        problem: what is earned.
        time: the horizon.
        settings: the accuracy.
        interest: states whose values need the accuracy; None: all.
        observer: receives the progress.

    Returns:
        Bounds, float64[n], further apart than requested if that would take too much work.

    Raises:
        UnsupportedError: choices that take no time form a cycle, and rewards have no bound there.
    """
    problem, state = problem.without_cycles()
    wanted = np.unique(state if interest is None else state[interest])
    rate = float(problem.exit_rates.max(initial=0.0)) or 1.0
    total = rate * time
    tolerance = 0.5 * settings.epsilon
    allowed, jumps, before = 0.7 * tolerance, 0, np.inf
    if not np.isfinite(problem.greatest) and TimedSteps(problem, rate).has_cycles:
        raise UnsupportedError(
            "rewards up to a time are not supported where choices that take no time form a cycle"
        )
    while True:
        run = TimedSteps(problem, rate)
        lower, upper, intervals = _swept(run, wanted, total, allowed, tolerance, observer)
        jumps += run.jumps
        lower = lower * (1.0 - run.error)
        upper = upper * (1.0 + run.error) + run.beyond + tuning.UNDERFLOW_BOUND
        low, high = lower[wanted], upper[wanted]
        width = largest_width(low, np.maximum(low, high - 1e-299), settings.relative)
        least = float(high[high > 1e-290].min(initial=1.0)) if settings.relative else 1.0
        finer = min(tolerance, 0.5 * settings.epsilon * least)
        stuck = width > 0.5 * before and finer > 0.5 * tolerance
        if width <= settings.epsilon or run.work(jumps) > tuning.TIMED_WORK or stuck:
            break
        before, tolerance = width, finer
        allowed *= max(min(0.25, (settings.epsilon / width) ** 1.5), 1e-4)
    text = f"{intervals:,} intervals of {total:.6g} jumps"
    return Transient(lower[state], upper[state], jumps, text)


def _swept(
    run: TimedSteps,
    wanted: Int32s,
    total: float,
    allowed: float,
    tolerance: float,
    observer: Observer | None,
) -> tuple[Floats, Floats, int]:
    """The bounds at time 0, interval by interval; each may move them by `allowed` apart.

    Values that begin with 0 never fall with more time, and those that begin with the greatest value
    never rise. So bounds for less time are bounds, where the rest would take too much work, or
    where they are as close to the greatest value, or to 0, as they can be.
    """
    problem = run.problem
    rises = not problem.lower.any()
    falls = bool((problem.upper >= problem.greatest).all())
    lower = run.resolved(problem.lower.copy(), 0.0)
    upper = run.resolved(problem.upper.copy(), min(problem.greatest, 1e300))
    left, length, gap, intervals = total, min(total, tuning.TIMED_FIRST_JUMPS), 0.0, 0
    growth = 2.0
    gap = float((upper - lower).max(initial=0.0))
    while left > 0.0:
        length = min(length, left)
        size = max(1.0, float(upper.max()) + run.most * (length + 10.0))
        least = min(max(0.01 * tolerance * length / total / size, 1e-290), 1e-12)
        low, high = run.interval(lower, upper, length, least)
        low, high = run.resolved(low, 0.0), run.resolved(high, min(problem.greatest, 1e300))
        apart = float((high - low).max(initial=0.0))
        if (
            apart - gap > max(allowed, 1e-15 * float(high.max()))
            and length > tuning.TIMED_LEAST_JUMPS
        ):
            length *= min(0.7, max(0.1, 0.8 * (allowed / (apart - gap)) ** (1.0 / 3.0)))
            growth = 1.2
            continue
        lower, upper = low, high
        left -= length
        intervals += 1
        if apart - gap < 0.5 * allowed:
            length = min(growth * length, tuning.TIMED_MOST_JUMPS)
            growth = min(2.0, 1.3 * growth)
        gap = max(gap, apart)
        if observer is not None:
            observer(Progress("intervals", intervals, apart, problem.matrix.states))
        least = float(lower[wanted].min(initial=np.inf))
        most = float(upper[wanted].max(initial=0.0))
        near = max(1e-4 * tolerance, run.error)
        closed = (rises and least >= (1.0 - near) * problem.greatest) or (
            falls and most <= tuning.UNDERFLOW_BOUND
        )
        if closed or run.work(run.jumps) > tuning.TIMED_WORK:
            break
    if left > 0.0:
        lower = lower if rises else np.zeros_like(lower)
        upper = upper if falls else np.full_like(upper, problem.greatest)
    return lower, upper, intervals
