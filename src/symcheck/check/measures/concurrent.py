"""Values of concurrent games, in which both sides pick actions at once.

Within a bound on steps, each step solves a matrix game per state, and what the strategies found
guarantee bounds its value from both sides. Without a bound, value iteration proposes a memoryless
strategy for each side. A strategy of the maximiser induces a decision process of the minimiser,
whose value is a lower bound; one of the minimiser, an upper bound.

Sources: Kwiatkowska, Norman, Parker & Santos (2021), Automatic verification of concurrent
stochastic systems; Chatterjee, de Alfaro & Henzinger (2013), Strategy improvement for concurrent
reachability and turn-based stochastic safety games.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.check.measures.signed_steps import BellmanOperator, lifted
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, System, Values
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.given_rows import engine_of_rows
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.rows import Bools, Floats
from symcheck.numerics.concurrent_games import Game, Proposal, Side
from symcheck.numerics.linear.problem import Progress, largest_width
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.features import Feature, class_name, require
from symcheck.semantics.path_formulas import NextPath, PathFormula, StatePath, UntilPath, negated
from symcheck.semantics.query import (
    CumulativeReward,
    InstantaneousReward,
    PathProbability,
    Quantity,
    ReachReward,
)
from symcheck.semantics.rewards import Reward, Structure
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.operators import Operator

__all__ = ["concurrent_values"]

_CHANGES = (1e-1, 1e-3, 1e-6)
"""The changes, per requested accuracy, at which value iteration proposes strategies. If their
bounds are too far apart, it goes on."""
_WORK = 5_000_000
"""The most work of value iteration; a step is as much work as its rows, and `_WORK_OF_STEP`. A game
that is not solved then may have no optimal strategy, and come near its value ever more slowly."""
_WORK_OF_STEP = 1000
"""The work of a step beside that of its rows."""
_STEP_COST = 1e-3
"""What a step costs who minimises, per requested accuracy and greatest reward, where some steps
earn nothing, so that a strategy is proposed that goes on."""
_MIXED_IN = 1e-3
"""The probability, per requested accuracy, with which who minimises picks any action that does not
lose, where the proposed strategy might never reach the target."""

_Bounds = tuple[Floats, Floats]
"""Lower and upper bounds on the values of all states."""


def concurrent_values(context: Context, game: Game, quantity: Quantity[StateSet]) -> Values:
    """The value of a concurrent game at each state.

    Args:
        context: the engine, the options and the log.
        game: who maximises the quantity, and who minimises it.
        quantity: what is asked for.

    Raises:
        UnsupportedError: the quantity is not available.
        NumericalError: it is not known whether a value is finite.
    """
    if context.engine.is_rational:
        require(context.engine.model, Feature.RATIONALS)
    play = _Play(context, game)
    match quantity:
        case PathProbability(path):
            return play.probability(path)
        case ReachReward(reward, target):
            return play.reach_reward(reward, play.members(target))
        case CumulativeReward(reward, window):
            return play.cumulative_reward(reward, window)
        case InstantaneousReward(reward, time):
            return play.instantaneous_reward(reward, Window(upper=time))
        case _:
            raise play.not_available("rewards until LTL formulas are satisfied")


@dataclass(frozen=True, eq=False)
class _Play:
    context: Context
    game: Game

    @cached_property
    def engine(self) -> ExplicitEngine:
        engine = self.context.engine.capability(ExplicitEngine)
        assert engine is not None, "concurrent games are explored explicitly"
        return engine

    @cached_property
    def system(self) -> System:
        return self.context.engine.system(self.context.engine.all)

    @cached_property
    def mixing_error(self) -> float:
        """A bound on the error of a mixture of numbers by a strategy, relative to the mixture of
        their absolute values.
        """
        return 2 * (self.game.terms + 3) * UNIT_ROUNDOFF

    def members(self, states: StateSet) -> Bools:
        return self.context.engine.to_bools(states)

    def not_available(self, what: str) -> UnsupportedError:
        return UnsupportedError(f"{what} are not available for {class_name(self.engine.model)}")

    # -------------------------------------------------------------------------------- probabilities

    def probability(self, path: PathFormula[StateSet]) -> Values:
        match path:
            case StatePath(states, negative):
                return self.context.engine.indicator(~states if negative else states)
            case NextPath() | UntilPath() if path.negative:
                found = replace(self, game=self.game.swapped).probability(negated(path))
                return self.context.engine.constant(1).map(Operator.MINUS, found)
            case NextPath(target, window):
                steps = window.steps()
                if steps.lower > 1 or steps.upper == 0:
                    return self.context.engine.constant(0)
                first = self.members(target).astype(np.float64)
                return self._lifted(self._steps((first, first), 1), "one step")
            case UntilPath(left, right, window):
                return self._until(self.members(left), self.members(right), window)
            case _:
                raise self.not_available("probabilities of LTL formulas and with bounds on rewards")

    def _until(self, left: Bools, right: Bools, window: Window) -> Values:
        steps = window.steps()
        if steps.upper is None:
            bounds = self._unbounded_until(left, right)
            if steps.lower == 0:
                return self.system.lift(*bounds)
        else:
            goal = right.astype(np.float64)
            bounds = self._steps((goal, goal), steps.upper - steps.lower, left & ~right, goal)
        return self._lifted(self._steps(bounds, steps.lower, left), "step by step")

    def _unbounded_until(self, left: Bools, right: Bools) -> _Bounds:
        nothing, through, target = self.game.nothing, ArraySet(left), ArraySet(right)

        def proof(mine: Floats, theirs: Floats) -> _Bounds:
            inner = self._process(self.game.maximiser, mine, nothing)
            lower = until(inner, through, target, Direction.MIN).at(inner.engine.all)
            inner = self._process(self.game.minimiser, theirs, nothing)
            upper = until(inner, through, target, Direction.MAX).at(inner.engine.all)
            return lower[0], np.minimum(upper[1], 1.0)

        start = right.astype(np.float64)
        return self._proved(self.game.iterate(right | ~left, start, nothing), proof)

    # -------------------------------------------------------------------------------------- rewards

    def cumulative_reward(self, reward: Reward, window: Window) -> Values:
        steps = window.steps().upper
        assert steps is not None
        earned = self.system.step_rewards(reward), self.system.step_reward_errors(reward)
        nothing = np.zeros(self.engine.states)
        bounds = self._steps((nothing, nothing), steps, earned=earned)
        return self._lifted(bounds, "rewards of k steps")

    def instantaneous_reward(self, reward: Reward, window: Window) -> Values:
        steps = window.steps().upper
        assert steps is not None
        last = self.system.state_rewards(reward)
        margin = self.system.state_reward_error(reward) * np.abs(last)
        return self._lifted(
            self._steps((last - margin, last + margin), steps), "rewards after k steps"
        )

    def reach_reward(self, reward: Reward, target: Bools) -> Values:
        game, earned = self.game, self.system.step_rewards(reward)
        if not (earned.min(initial=0.0) >= 0.0 and earned.max(initial=0.0) < np.inf):
            raise self.not_available("negative and infinite rewards without a bound on steps")
        error = self.system.reward_error(reward) + self.mixing_error
        finite, safe = game.almost_surely(target)
        going = earned[(finite & ~target)[game.state_of_row]]
        cost = earned
        if (going == 0.0).any():
            scale = float(going.max()) or 1.0
            cost = earned + _STEP_COST * self.context.options.epsilon * scale
        spoiling = self._spoiling(target) if not finite.all() else game.maximiser.uniform()
        is_finite, wanted = np.repeat(finite, np.diff(game.maximiser.starts)), ArraySet(target)

        mixed_in = _MIXED_IN * self.context.options.epsilon
        proper = game.minimiser.uniform(game.minimiser.sums(safe.astype(np.float64)) > 0.0)

        def conceded(theirs: Floats) -> Floats:
            inner = self._process(game.minimiser, theirs, earned)
            return reach_reward(inner, Structure(0), wanted, Direction.MAX).at(inner.engine.all)[1]

        def proof(mine: Floats, theirs: Floats) -> _Bounds:
            inner = self._process(game.maximiser, np.where(is_finite, mine, spoiling), earned)
            lower = reach_reward(inner, Structure(0), wanted, Direction.MIN).at(inner.engine.all)
            upper = conceded(theirs)
            if np.isinf(upper[finite & self._relevant]).any():
                upper = conceded((1.0 - mixed_in) * theirs + mixed_in * proper)
            return lower[0] * (1.0 - error), np.where(finite, upper * (1.0 + error), np.inf)

        start = np.zeros(self.engine.states)
        low, high = self._proved(game.iterate(target | ~finite, start, cost, ~safe), proof)
        if (np.isfinite(low) & np.isinf(high) & self._relevant).any():
            raise NumericalError(
                "who minimises has no strategy that reaches the target almost surely, and no "
                "strategy without memory was found that makes the reward infinite"
            )
        return self.system.lift(low, high)

    def _spoiling(self, target: Bools) -> Floats:
        """A strategy of the maximiser that keeps the probability of reaching a target small."""
        start = target.astype(np.float64)
        steps = self.game.swapped.iterate(target, start, self.game.nothing)
        for before, after in pairwise(steps):
            if np.abs(after.values - before.values).max() <= self.context.options.epsilon:
                return after.theirs
        raise AssertionError("value iteration converges")

    # ------------------------------------------------------------------------------------ computing

    @property
    def _relevant(self) -> Bools:
        states = self.context.relevant_states
        return self.engine.all.members if states is None else self.members(states)

    def _process(self, fixed: Side, strategy: Floats, earned: Floats) -> Context:
        """The decision process of the other side, with what its rows earn as its rewards."""
        matrix, rewards = self.game.process(fixed, strategy, earned)
        error = self.engine.entry_error + self.mixing_error + (matrix.longest + 4) * UNIT_ROUNDOFF
        engine = engine_of_rows(
            self.engine, matrix, rewards, name="one side's choices", number_error=error
        )
        context = self.context.with_any_method()
        context = context.with_epsilon(max(context.options.epsilon / 4, ROUNDING))
        return context.within(engine, self._relevant)

    def _proved(
        self, proposals: Iterator[Proposal], proof: Callable[[Floats, Floats], _Bounds]
    ) -> _Bounds:
        """The bounds that a strategy of each side proves, of those that are proposed."""
        context, options, relevant = self.context, self.context.options, self._relevant
        budget = _WORK // (self.game.matrix.rows + _WORK_OF_STEP)
        budget = max(1, min(budget, options.max_iterations))
        steps, before = 0, np.zeros(self.engine.states)
        for limit in _CHANGES:
            change = np.inf
            while change > limit * options.epsilon and steps < budget:
                proposed = next(proposals)
                steps += 1
                change = largest_width(before, proposed.values, options.relative)
                before = proposed.values
                if context.observer is not None:
                    context.observer(Progress("matrix games", steps, change, len(before)))
            low, high = proof(proposed.mine, proposed.theirs)
            width = largest_width(low[relevant], high[relevant], options.relative)
            if width <= options.epsilon or steps >= budget:
                break
        note = f"{steps} steps of matrix games, and a strategy of each side"
        context.warn_if_wide(width, note)
        context.log.runs.append(
            SolverRun("linear", "matrix games", len(before), steps, note, certified=True)
        )
        return low, high

    def _steps(
        self,
        bounds: _Bounds,
        steps: int,
        inside: Bools | None = None,
        outside: Floats | float = 0.0,
        earned: tuple[Floats, Floats] | None = None,
    ) -> _Bounds:
        """The bounds after some steps.

        Args:
            bounds: those at the end.
            steps: their number.
            inside: the states that make steps; None: all.
            outside: the values of all others.
            earned: what rows earn, and the errors of that; None: nothing.
        """
        game = self.game
        operator = BellmanOperator(self.system, *(earned or (game.nothing, game.nothing)))
        going = self.engine.all.members if inside is None else inside
        taken = 0
        while taken < steps:
            taken += 1
            lower, upper = operator.bounds(*bounds)
            mine, theirs = game.strategies(0.5 * (lower + upper))
            low = game.ensured(mine, lower - self.mixing_error * np.abs(lower))
            high = game.conceded(theirs, upper + self.mixing_error * np.abs(upper))
            low, high = np.where(going, low, outside), np.where(going, high, outside)
            is_settled = np.array_equal(low, bounds[0]) and np.array_equal(high, bounds[1])
            bounds = low, high
            if self.context.observer is not None:
                self.context.observer(Progress("matrix games", taken, 0.0, len(low)))
            if is_settled:
                break
        if steps:
            run = SolverRun("steps", "matrix games", self.engine.states, taken)
            self.context.log.runs.append(run)
        return bounds

    def _lifted(self, bounds: _Bounds, name: str) -> Values:
        return lifted(self.context, self.system, *bounds, name)
