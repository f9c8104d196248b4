"""Rewards until a target is reached, where runs that miss it count: the rewards Fc and F0.

Sources: Chen, Forejt, Kwiatkowska, Parker & Simaitis (2013), Automatic verification of competitive
stochastic systems.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.measures.reachability import until
from symcheck.check.measures.reward_scaling import in_multiples
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full, is_infinite, numbers
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix, per_row, spans, starts_of
from symcheck.numerics.game_graph import Arena
from symcheck.numerics.graph import Incidence
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem, largest_width
from symcheck.numerics.tuning import GAME_ROUNDING, UNIT_ROUNDOFF
from symcheck.semantics.rewards import Reward

__all__ = ["kept_reward", "lost_reward"]


def kept_reward(
    context: Context, reward: Reward, target: StateSet, direction: Direction | None
) -> Values:
    """Expected reward until `target` is reached; a run that misses it keeps what it earns.

    It is infinite where the maximiser can earn rewards again and again with positive probability.

    Raises:
        UnsupportedError: a reward is negative or infinite.
    """
    engine = context.engine
    system = engine.system(~target, direction)
    earned = _rewards(system.step_rewards(reward))
    arena = Arena(Incidence(system.matrix), _minimisers(system, direction))
    pays, every = np.asarray(earned > 0, np.bool_), np.ones(system.n, np.bool_)
    leaves = np.asarray(system.one_step_probability(target) > 0, np.bool_)
    some, _ = arena.attract(pays, every)
    endless, _ = arena.repeatedly(pays, leaves)
    infinite, unknown = _inside(context, system.states, endless), some & ~endless
    finite = engine.system(_inside(context, system.states, unknown), direction)
    equations = finite.equations(
        finite.step_rewards(reward),
        probability=False,
        allow_stay=True,
        infinite=infinite,
        constant_error=finite.reward_error(reward),
    )
    return context.solve(equations, known=[])


def lost_reward(
    context: Context, reward: Reward, target: StateSet, direction: Direction | None
) -> Values:
    """Expected reward until `target` is reached; a run that misses it gets nothing.

    Strategies remember the reward so far: the more it is, the more the chance of losing it matters.
    So the pairs of a state and a reward below a level are solved, and at the level and above

    - a lower bound is what the maximiser gets by maximising the probability of the target;
    - an upper bound is what the minimiser loses by minimising the reward without the target.

    Levels are doubled until the bounds are close.

    Raises:
        UnsupportedError: rewards are negative, infinite, or no multiples of a common step; or an
            exact value is asked for and bounds do not become equal.
    """
    context = context.with_any_method()
    engine = context.engine
    reached = until(context, engine.all, target, direction)
    never, _ = reached.compare("<=", 0)
    kept = kept_reward(context, reward, target | never, direction)
    finite, _ = kept.compare("<", np.inf)
    system = engine.system(finite - (target | never), direction)
    infinite = ~finite
    if not system.states:
        return engine.constant(0).choose(finite, engine.constant(np.inf))
    earned = _rewards(system.step_rewards(reward))
    multiples, step = in_multiples(context, system, earned)
    usable = np.asarray(system.one_step_probability(infinite) == 0, np.bool_)
    usable |= ~per_row(system.groups, _minimisers(system, direction))
    pairs = _Pairs(system, usable, multiples, system.one_step_probability(target), step)
    ends = reached.at(system.states)[0], kept.at(system.states)[1]
    levels = tuning.FIRST_LEVELS
    while True:
        low, high, rounded = pairs.values(context, direction, levels, *ends)
        width = float(largest_width(low, high, context.options.relative))
        if engine.is_rational:
            if np.array_equal(low, high):
                break
        elif width <= context.options.epsilon:
            rounded &= largest_width(low, high, relative=True) <= GAME_ROUNDING
            break
        levels *= 2
        most = tuning.MOST_EXACT_PAIRS if engine.is_rational else tuning.MOST_PAIRS
        if levels * system.n > max(most, 2 * tuning.FIRST_LEVELS * system.n):
            if engine.is_rational:
                raise UnsupportedError(
                    "the exact reward F0 of this game is not found",
                    hint="without -exact, bounds are computed",
                )
            context.warn_if_wide(
                width, f"rewards up to {levels // 2} steps of {step} are remembered"
            )
            rounded = False
            break
    context.log.runs.append(
        SolverRun("epochs", "level by level", system.n, levels, f"{levels} levels of the reward")
    )
    values = system.lift(low, None if engine.is_rational else high, up_to_rounding=rounded)
    return values.choose(finite, engine.constant(np.inf))


@dataclass(frozen=True, eq=False)
class _Pairs:
    """The pairs of a state and the reward so far.

    Attributes:
        system: the states from which the target may be reached or missed.
        usable: the rows that do not lead to an infinite value, bool[rows].
        multiples: the reward of each row in steps, int64[rows].
        into: the probability of entering the target, per row.
        step: a step of the rewards.
    """

    system: System
    usable: Bools
    multiples: Int64s
    into: Numbers
    step: Fraction

    def values(
        self,
        context: Context,
        direction: Direction | None,
        levels: int,
        chance: Numbers,
        rest: Numbers,
    ) -> tuple[Numbers, Numbers, bool]:
        """Bounds on the values of the states without a reward so far, and whether each is exact up
        to rounding.

        Args:
            context: the options, and the observer.
            direction: minimise or maximise.
            levels: the rewards that are remembered, in steps.
            chance: a lower bound on the probability of the target, per state.
            rest: an upper bound on the reward to come, per state.
        """
        problem = self._problem(direction, levels, chance, rest)
        # Methods take bounds on constants that differ by rounding, and these may be far apart.
        low, high = (
            solve_linear(replace(problem, constant=c, upper=None), context.options)
            for c in (problem.constant, problem.high)
        )
        n = self.system.n
        rounded = low.up_to_rounding and high.up_to_rounding
        return low.lower[:n], high.upper[:n], rounded

    def _problem(
        self, direction: Direction | None, levels: int, chance: Numbers, rest: Numbers
    ) -> LinearProblem:
        """The equations of the pairs: state s with the reward c in steps has the number c n + s."""
        system, n = self.system, self.system.n
        rows = np.flatnonzero(self.usable)
        whole = system.matrix
        assert whole.groups is not None
        base = whole.choose(rows, starts_of(self.usable)[whole.groups])
        assert base.groups is not None
        rational = base.is_rational
        step = self.step if rational else float(self.step)
        total = np.repeat(np.arange(levels), base.rows) + np.tile(self.multiples[rows], levels)
        inside, row = total < levels, np.tile(np.arange(base.rows), levels)
        lengths = np.where(inside, base.lengths[row], 0)
        entries = spans(base.indptr[:-1][row[inside]], base.indptr[1:][row[inside]])
        matrix = SparseMatrix(
            starts_of(lengths),
            (base.indices[entries] + np.repeat(total * n, lengths)).astype(np.int32),
            base.data[entries],
            levels * n,
            starts_of(np.tile(np.diff(base.groups), levels)),
        )
        into, sums = self.into[rows][row], numbers(total, rational=rational) * step
        stays, none = base.multiply(full(n, 1, rational=rational)), full(1, 0, rational=rational)
        low = into * sums + np.where(inside, none, base.multiply(chance)[row] * sums)
        high = into * sums + np.where(inside, none, base.multiply(rest)[row] + stays[row] * sums)
        leaving = system.one_step_probability(~system.states)[rows][row]
        if not rational:  # rounded outwards
            error = 2 * (base.longest + 8) * UNIT_ROUNDOFF
            low, high = low * (1.0 - error), high * (1.0 + error)
        return LinearProblem(
            low,
            matrix,
            high,
            leaving + np.where(inside, none, stays[row]),
            direction,
            False,
            opponents=np.tile(_opponents(system), levels),
            allow_stay=True,
            error=system.error,
        )


def _rewards(earned: Numbers) -> Numbers:
    """The rewards of rows. Raises UnsupportedError: one is negative or infinite."""
    if len(earned) and (earned.min() < 0 or is_infinite(earned).any()):
        raise UnsupportedError(
            "negative or infinite rewards of games are not supported without a bound on steps; "
            "C<=k is"
        )
    return earned


def _opponents(system: System) -> Bools:
    """The states in which opponents choose; none where only one side has choices."""
    return np.zeros(system.n, np.bool_) if system.opponents is None else system.opponents


def _minimisers(system: System, direction: Direction | None) -> Bools:
    """The states in which the least value is chosen."""
    return _opponents(system) ^ (direction is Direction.MIN)


def _inside(context: Context, states: StateSet, members: Bools) -> StateSet:
    """Those of some states that are members, bool[count]."""
    inside = context.engine.to_bools(states).copy()
    inside[inside] = members
    return context.engine.from_bools(inside)
