"""Turn-based games: x = A x + b, in which each state maximises or minimises over its rows.

If one side fixes its rows, a decision process of the other side remains, whose proved bounds hold
for the game on one side: what the maximiser ensures is a lower bound, what the minimiser ensures an
upper one. So a proof needs a strategy for each side, however they were found:

- One side has to make progress: the maximiser where the least solution is wanted, the minimiser
  where the rest must be left. Its strategy is improved until no row is better than the chosen one,
  against best responses (Hoffman & Karp 1966).
- The other side then needs to take best rows only: under them, the values that the first side
  attains are a super- (or sub-) martingale.

`interval` iterates bounds from both sides and lowers the upper ones of end components, in which the
minimiser can keep a run, to what the maximiser gets by leaving (Kelmendi, Krämer, Křetínský &
Weininger 2018).

Sources: Condon (1992), The complexity of stochastic games; Eisentraut, Kelmendi, Křetínský &
Weininger (2022), Value iteration for simple stochastic games; for rewards, Chen, Forejt,
Kwiatkowska, Parker & Simaitis (2013), and Křetínský, Meggendorfer & Weininger (2023), Stopping
criteria for value iteration on stochastic games with quantitative objectives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.kernels.solve.game_sweeps import sweep_game
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, doubles, full
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, first_best, starts_of
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics import tuning
from symcheck.numerics.game_graph import Arena
from symcheck.numerics.graph import Incidence, maximal_end_components
from symcheck.numerics.linear.bellman import BellmanOperator
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.problem import (
    LinearProblem,
    Observer,
    Progress,
    Solution,
    largest_width,
)
from symcheck.numerics.settings import ROUNDING, Accuracy, Settings
from symcheck.tables import counted

__all__ = ["solve"]

Inner = Callable[[LinearProblem, Settings], Solution]
"""Solves decision processes."""


def solve(
    problem: LinearProblem, settings: Settings, observer: Observer | None, inner: Inner
) -> Solution:
    """Certified bounds on the values of a game, with rows of both sides that attain them.

    Args:
        problem: the equations, with the states of the opponents. Their values are positive, and
            finite.
        settings: accuracy and method: 'interval', or one that solves decision processes.
        observer: receives the progress.
        inner: solves the decision processes that remain if a side fixes its rows.

    Raises:
        UnsupportedError: the method does not solve this problem.
    """
    if settings.method == "interval":
        if not problem.probability:
            raise UnsupportedError("method 'interval' does not solve reward problems")
        return _interval(problem, settings, observer)
    if problem.signed:
        raise UnsupportedError(
            "negative rewards of games are not supported without a bound on steps; C<=k is"
        )
    if problem.is_rational:
        return _Game(problem, settings, observer, inner, settings.epsilon).solution()
    for share in tuning.GAME_ACCURACIES:
        epsilon = max(settings.epsilon * share, ROUNDING)
        found = _Game(problem, settings, observer, inner, epsilon).solution()
        if found.width(settings.relative) <= settings.epsilon:
            break
    return found


@dataclass(frozen=True, eq=False)
class _Game:
    """The computation of strategies of both sides.

    epsilon: the width of the bounds on the values of decision processes.
    """

    problem: LinearProblem
    settings: Settings
    observer: Observer | None
    inner: Inner
    epsilon: float

    def solution(self) -> Solution:
        """Bounds by a strategy of each side."""
        problem = self.problem
        leads = problem.maximises if problem.least else ~problem.maximises
        policy, ours, rounds = self._improved(leads)
        policy = np.where(leads, policy, self._best_rows(ours.middle)[0])
        note = f"{counted(problem.n, 'state')}: strategy iteration, {counted(rounds, 'round')}"
        if problem.is_rational:
            return Solution(ours.lower, ours.upper, "policy", True, True, rounds, note, policy)
        theirs = self._response(policy, ~leads)
        lower, upper = (ours, theirs) if problem.least else (theirs, ours)
        low, high = lower.lower, upper.upper
        rounded = lower.up_to_rounding and upper.up_to_rounding
        if rounded:
            rounded = largest_width(low, high, relative=True) <= tuning.GAME_ROUNDING
        if problem.probability:
            high = np.minimum(high, 1.0)
        return Solution(low, high, "policy", rounded, True, rounds, note, policy)

    def _improved(self, leads: Bools) -> tuple[Int64s, Solution, int]:
        """A strategy of the leading side that no row improves, its values, and the rounds."""
        problem = self.problem
        policy = self._first(leads)
        sign = 1 if problem.least else -1
        rounds = 0
        while True:
            rounds += 1
            found = self._response(policy, leads)
            values = found.middle
            if self.observer is not None:
                self.observer(Progress("strategy iteration", rounds, np.inf, problem.n))
            if rounds > min(self.settings.max_iterations, tuning.POLICY_ROUNDS):
                return policy, found, rounds
            rows, best, current = self._best_rows(values, policy)
            gain = sign * (best - current)
            if problem.is_rational:
                better = leads & (gain > 0)
            else:
                error = 4.0 * (found.upper - found.lower) + tuning.GAME_ROUNDING * np.abs(current)
                better = leads & (gain > error)
            if not better.any():
                return policy, found, rounds
            policy = np.where(better, rows, policy)

    def _best_rows(
        self, values: Numbers, policy: Int64s | None = None
    ) -> tuple[Int64s, Numbers, Numbers]:
        """For some values, the best row of each state, what it gives, and what the policy gives."""
        problem = self.problem
        groups = problem.rows.groups
        assert groups is not None
        rows = problem.rows.multiply(values) + problem.constant
        sign = np.where(problem.rows.rows_of(problem.maximises), 1, -1)
        best = first_best(rows * sign, groups)
        return best, rows[best], rows[best if policy is None else policy]

    def _response(self, policy: Int64s, fixed: Bools) -> Solution:
        """The values if some states are left by the rows of a policy."""
        problem = self.problem
        rows = problem.rows
        allowed = ~rows.rows_of(fixed)
        allowed[policy[fixed]] = True
        process = replace(_with_rows(problem, allowed), opponents=None, direction=None)
        others = problem.maximises[~fixed]
        maximise = bool(others[0]) if len(others) else problem.least
        process = replace(process, direction=Direction.MAX if maximise else Direction.MIN)
        accuracy = Accuracy(
            method=self.settings.method,
            epsilon=self.epsilon,
            relative=self.settings.relative,
            max_iterations=self.settings.max_iterations,
        )
        return _process_values(process, accuracy, self.inner)

    def _first(self, leads: Bools) -> Int64s:
        """A strategy for the leading side, and any rows of the other one."""
        problem = self.problem
        groups = problem.rows.groups
        assert groups is not None
        start = groups[:-1].copy()
        if problem.is_rational:
            rounded = replace(
                problem,
                matrix=problem.rows.doubles(),
                constant=doubles(problem.constant),
                upper=None,
                exit=np.maximum(doubles(problem.leaving), (problem.leaving > 0) * 1e-300),
            )
            guess = replace(self, problem=rounded, epsilon=1e-9)
            try:
                start = guess._improved(leads)[0]
            except NumericalError:
                start = guess._first(leads)
        if not problem.least:
            safe = self._exits()
            start = start if problem.is_rational and self._leaves(start, leads) else safe
        return start if problem.is_rational else self._iterated(start, leads)

    def _exits(self) -> Int64s:
        """Rows by which the minimiser leaves the states almost surely."""
        problem = self.problem
        arena = Arena(Incidence(problem.rows), problem.maximises)
        every, none = np.ones(problem.n, np.bool_), np.zeros(problem.rows.rows, np.bool_)
        sure, rows = arena.almost_surely(np.asarray(problem.leaving > 0, np.bool_), none, every)
        if not sure.all():
            raise NumericalError("the expected reward is infinite")
        assert problem.rows.groups is not None
        return np.where(rows < 0, problem.rows.groups[:-1], rows)

    def _leaves(self, policy: Int64s, leads: Bools) -> bool:
        """Whether the minimiser leaves the states almost surely by these rows."""
        problem = self.problem
        allowed = ~problem.rows.rows_of(leads)
        allowed[policy[leads]] = True
        rest = _with_rows(problem, allowed)
        every, none = np.ones(problem.n, np.bool_), np.zeros(rest.rows.rows, np.bool_)
        arena = Arena(Incidence(rest.rows), every)
        return bool(arena.almost_surely(np.asarray(rest.leaving > 0), none, every)[0].all())

    def _iterated(self, policy: Int64s, leads: Bools) -> Int64s:
        """A better strategy by value iteration: rows that raised (or lowered) the values last.

        The values begin with those of the given strategy (with 0, where the least solution is
        wanted), so that the strategy of each iterate attains it.
        """
        problem = self.problem
        x = np.zeros(problem.n)
        if not problem.least:
            x = self._response(policy, leads).upper.copy()
        original, policy, rows = policy, policy.copy(), problem.rows
        assert rows.groups is not None
        sweep = rows.entries + problem.n + tuning.GAME_SWEEP_WORK
        most = max(tuning.GAME_SWEEPS, tuning.GAME_ENTRIES // sweep)
        maximises, leading = problem.maximises.view(np.uint8), leads.view(np.uint8)
        least = problem.least
        for i in range(min(most, self.settings.max_iterations)):
            change = sweep_game(
                *rows.arrays,
                rows.groups,
                problem.constant,
                maximises,
                leading,
                least,
                tuning.SMALLEST_CHANGE,
                x,
                policy,
                i % 2 == 1,
            )
            if change <= tuning.GAME_CHANGE:
                break
        return policy if problem.least or self._leaves(policy, leads) else original


def _with_rows(problem: LinearProblem, allowed: Bools) -> LinearProblem:
    """The problem with some rows only, of which every state has one."""
    matrix = problem.rows
    assert matrix.groups is not None
    rows = np.flatnonzero(allowed)
    return replace(
        problem,
        constant=problem.constant[rows],
        matrix=matrix.choose(rows, starts_of(allowed)[matrix.groups]),
        upper=None if problem.upper is None else problem.upper[rows],
        exit=problem.leaving[rows],
    )


def _process_values(problem: LinearProblem, settings: Settings, inner: Inner) -> Solution:
    """The values of a decision process in all states, whose graph was not analysed before.

    If a side fixes its rows, values may become 0 or infinite.
    """
    matrix, high = problem.rows, problem.high
    maximise = problem.direction is Direction.MAX
    graph, every = Incidence(matrix), np.ones(problem.n, np.bool_)
    pays, leaves = np.asarray(high > 0, np.bool_), np.asarray(problem.leaving > 0, np.bool_)
    never = np.zeros(matrix.rows, np.bool_)
    infinite = ~every
    if problem.least:
        arena = Arena(graph, every ^ maximise)
        unknown, _ = arena.attract(pays, every)
        if not problem.probability:
            infinite, _ = arena.repeatedly(pays, leaves)
    else:
        unknown, _ = Arena(graph, every & maximise).almost_surely(leaves, never, every)
        infinite = ~unknown
    unknown = unknown & ~infinite
    exact = matrix.is_rational
    low = full(problem.n, 0, rational=exact)
    low[infinite] = np.inf
    high = low.copy()
    if not unknown.any():
        return Solution(low, high, "graph", up_to_rounding=True)
    mine = matrix.rows_of(unknown)
    part = LinearProblem(
        problem.constant[mine],
        matrix.among(unknown),
        None if problem.upper is None else problem.upper[mine],
        problem.leaving[mine] + matrix.sums(unknown, ~unknown),
        problem.direction,
        problem.probability,
        error=problem.error,
        constant_error=problem.constant_error,
    )
    if infinite.any():
        part = _with_rows(part, (matrix.sums(unknown, infinite) == 0))
    quotient = None
    if problem.least and maximise and not problem.probability:
        # Staying where nothing is earned is never better than leaving.
        quotient = collapse(replace(part, direction=Direction.MIN))
    if quotient is None:
        found = inner(part, settings)
    else:
        found = quotient.expand(inner(replace(quotient.problem, direction=Direction.MAX), settings))
    low[unknown], high[unknown] = found.lower, found.upper
    return replace(found, lower=low, upper=high, strategy=None)


def _interval(problem: LinearProblem, settings: Settings, observer: Observer | None) -> Solution:
    """Bounds from both sides; upper ones are lowered in end components from time to time."""
    bellman = BellmanOperator.of(problem)
    matrix, graph = problem.rows, Incidence(problem.rows)
    free = np.asarray((problem.leaving <= 0.0) & (problem.high == 0.0), np.bool_)
    lower, upper = np.zeros(problem.n), np.ones(problem.n)
    every, mine = np.ones(problem.n, np.bool_), matrix.rows_of(problem.maximises)
    count, pause, width = 0, 1, 1.0
    while settings.epsilon < width and count < settings.max_iterations:
        lower, upper = bellman.improve_both(lower, upper)
        count += 1
        if count % pause == 0:
            # The minimiser may stay by rows that are best for the lower bounds.
            rows = bellman.product(lower) + problem.constant
            best = np.repeat(bellman.best(rows), np.diff(graph.groups))
            parts = maximal_end_components(graph, every, free & (mine | (rows <= best)))
            upper = _deflated(bellman, parts.of, mine & ~parts.rows, upper)
            pause = min(pause * 2, tuning.DEFLATION_INTERVAL)
        width = largest_width(lower, upper, settings.relative)
        if observer is not None:
            observer(Progress("interval iteration", count, width, problem.n, lower, upper))
    note = f"{counted(problem.n, 'state')}: interval iteration, {count} iterations"
    note += "" if width <= settings.epsilon else ", accuracy not reached"
    upper = np.minimum(upper, 1.0)
    return Solution(lower, upper, "interval", False, True, count, note)


def _deflated(bellman: BellmanOperator, of: Int32s, exits: Bools, upper: Floats) -> Floats:
    """Upper bounds of end components, lowered to what the maximiser gets by leaving.

    of: the component of each state, -1 for none. exits: the maximiser's rows that leave them.
    """
    problem = bellman.problem
    component = of[problem.rows.state_of_row]
    rows = np.flatnonzero(exits & (component >= 0))
    best = np.zeros(int(of.max(initial=-1)) + 1)
    gets = (bellman.product(upper) + problem.high) * (1.0 + bellman.rounding_error)
    np.maximum.at(best, component[rows], gets[rows] + UNDERFLOW_MARGIN)
    return np.where(of >= 0, np.minimum(upper, best[of]) if len(best) else upper, upper)
