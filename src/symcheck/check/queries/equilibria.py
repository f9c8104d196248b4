"""Equilibria of concurrent games, in which two coalitions optimise objectives of their own.

In each state and step, they play a bimatrix game, whose payoffs are what a step earns and the
values of what follows. Once an objective is settled, its coalition helps the other one. Bounds on
steps are counted down: the values are those of an equilibrium in each state and step (a
subgame-perfect one). Without any, the values are iterated until they hardly change. A rounding
error may decide which equilibrium is chosen, so that no bounds on the error are computed.

Sources: Kwiatkowska, Norman, Parker & Santos (2021), Automatic verification of concurrent
stochastic systems; (2022), Correlated equilibria and fairness in concurrent stochastic games.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.queries.values import values
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, Values
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import Diagnostic, NumericalError, Span, UnsupportedError
from symcheck.matrices.rows import Bools, Floats, best_of_rows
from symcheck.numerics.bimatrix_games import correlated_values, nash_values
from symcheck.numerics.concurrent_games import Game
from symcheck.numerics.linear.problem import Progress, largest_width
from symcheck.semantics.features import Feature, require
from symcheck.semantics.path_formulas import NextPath, StatePath, UntilPath
from symcheck.semantics.query import (
    CumulativeReward,
    InstantaneousReward,
    PathProbability,
    Query,
    ReachReward,
)
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import Equilibrium

__all__ = ["equilibrium_values"]

_CHANGE = 1e-2
"""The change, per requested accuracy, at which value iteration ends."""
_MOST_STEPS = 10_000
"""The most steps of value iteration, which does not converge in general."""
_OBJECTIVES = "objectives are P of X, F, G, U, W and R (release), and the rewards F, C<=k and I=k"


@dataclass(frozen=True, eq=False)
class _Objective:
    """What a coalition maximises; what it minimises is negated.

    Attributes:
        going: the states in which it is not settled.
        settled: its value in the others.
        last: its value in states that go on, after the last step; without a bound, to begin with.
        earned: the reward of each joint action of each state, a row of the matrix.
        cooperative: its value if both coalitions maximise it; with a bound, after the last step.
        steps: their number; None: no bound.
    """

    going: Bools
    settled: Floats
    last: Floats
    earned: Floats
    cooperative: Floats
    steps: int | None


def equilibrium_values(
    context: Context, formula: Equilibrium, queries: Sequence[Query[StateSet]]
) -> list[Values]:
    """The value of each objective in an equilibrium from each state.

    Args:
        context: a concurrent game, the options and the log.
        formula: which equilibrium is asked for.
        queries: its objectives.

    Raises:
        UnsupportedError: there are other objectives or more coalitions, a target of a reward may be
            missed, or a state has too many joint actions.
        NumericalError: the values do not converge.
    """
    if len(queries) != 2:
        message = f"equilibria of two coalitions are supported, and here are {len(queries)}"
        raise _refused(message, formula.coalitions[0].span)
    if context.engine.is_rational:
        require(context.engine.model, Feature.RATIONALS)
    first, second = queries
    engine = context.engine.capability(ExplicitEngine)
    assert engine is not None, "concurrent games are explored explicitly"
    assert first.coalition is not None
    game = engine.concurrent_game(first.coalition)
    sign = 1.0 if first.direction is Direction.MAX else -1.0
    play = _Play(context, engine, game, sign, formula.correlated, formula.fair)
    objectives = map(play.objective, (first, second), (o.span for o in formula.objectives))
    system = context.engine.system(context.engine.all)
    return [system.lift(v, v) for v in play.values(*objectives)]


def _refused(message: str, place: Span, hint: str | None = None) -> UnsupportedError:
    return UnsupportedError(Diagnostic(message, place, "equilibrium", hint))


@dataclass(frozen=True, eq=False)
class _Play:
    context: Context
    engine: ExplicitEngine
    game: Game
    sign: float
    correlated: bool
    fair: bool

    def objective(self, query: Query[StateSet], place: Span) -> _Objective:
        engine = self.context.engine
        system, none = engine.system(engine.all), np.zeros(self.engine.states)
        going, settled, last, earned = none == 0.0, none, none, self.game.nothing
        window = Window()
        match query.quantity:
            case PathProbability(StatePath(states, negative)):
                going, settled = none != 0.0, (engine.to_bools(states) != negative) * 1.0
            case PathProbability(NextPath(target, Window(is_unbounded=True), negative)):
                last = (engine.to_bools(target) != negative) * 1.0
                window = Window(upper=Fraction(1))
            case PathProbability(UntilPath(left, right, window, negative)):
                goal = engine.to_bools(right)
                going, settled = engine.to_bools(left) & ~goal, (goal != negative) * 1.0
                last = none + negative
            case ReachReward(reward, target):
                earned = system.step_rewards(reward)
                certain = engine.graph.prob1(engine.all, target, Direction.MIN)
                self._require_certain(certain, place)
                going = engine.to_bools(certain - target)
            case CumulativeReward(reward, window):
                earned = system.step_rewards(reward)
            case InstantaneousReward(reward, time):
                last, window = system.state_rewards(reward), Window(upper=time)
            case _:
                raise _refused("this is no objective of an equilibrium", place, _OBJECTIVES)
        steps = window.steps()
        if steps.lower:
            raise _refused("an objective of an equilibrium has no lower bound on steps", place)
        if not (np.isfinite(earned).all() and np.isfinite(last).all()):
            raise _refused("an objective of an equilibrium has no infinite rewards", place)
        cooperative = last
        if steps.upper is None:
            # As accurately as possible, so that ties between equilibria are recognised.
            inner = self.context.within(self.engine, self.engine.all.members).with_epsilon(ROUNDING)
            low, high = values(inner, replace(query, coalition=None)).at(engine.all)
            cooperative = np.where(going, 0.5 * (low + high), 0.0)
        cooperative = np.where(going, cooperative, settled)
        sign = self.sign
        return _Objective(
            going, sign * settled, sign * last, sign * earned, sign * cooperative, steps.upper
        )

    def _require_certain(self, certain: StateSet, place: Span) -> None:
        relevant = self.context.relevant_states
        missing = (self.context.engine.all if relevant is None else relevant) - certain
        if missing:
            raise _refused(
                "an objective of an equilibrium has a target that is reached almost surely, "
                "whatever players do, and this one may be missed from state "
                f"{self.context.example(missing)}",
                place,
            )

    def values(self, *objectives: _Objective) -> list[Floats]:
        """The values of both objectives, with the last step first, or by iteration."""
        bounds = [o.steps for o in objectives if o.steps is not None]
        bound = min(bounds, default=None)
        cooperative = [
            self._together(o, (o.steps or 0) - (bound or 0), o.cooperative) for o in objectives
        ]
        joint = cooperative
        if bound is None:
            both = np.logical_and(*(o.going for o in objectives))
            joint = [
                np.where(both, o.last, c) for o, c in zip(objectives, cooperative, strict=True)
            ]
        options, taken, change = self.context.options, 0, np.inf
        end = 0.0 if bounds else _CHANGE * options.epsilon
        limit = min(options.max_iterations, _MOST_STEPS) if bound is None else bound
        while taken < limit and change > end:
            taken += 1
            before = *joint, *cooperative
            cooperative = [
                self._together(o, 1, c) for o, c in zip(objectives, cooperative, strict=True)
            ]
            joint = self._step(objectives, cooperative, joint)
            after = *joint, *cooperative
            change = max(
                largest_width(np.minimum(b, a), np.maximum(b, a), options.relative)
                for b, a in zip(before, after, strict=True)
            )
            if self.context.observer is not None:
                self.context.observer(Progress("bimatrix games", taken, change, len(after[0])))
        if bound is None and change > end:
            raise NumericalError(
                f"the equilibria of {taken:,} steps of value iteration still differ by "
                f"{change:.1E} from step to step, and may never converge",
                hint="bounds on steps, as in F<=k and C<=k, need no convergence",
            )
        kind = "correlated" if self.correlated else "Nash"
        note = f"{taken} steps of bimatrix games, a {kind} equilibrium in each"
        self.context.log.runs.append(
            SolverRun("linear", "bimatrix games", self.engine.states, taken, note, certified=False)
        )
        return [self.sign * values + 0.0 for values in joint]  # not -0

    def _together(self, objective: _Objective, steps: int, after: Floats) -> Floats:
        """The values some steps earlier if both coalitions maximise; the same without a bound."""
        for _ in range(steps if objective.steps is not None else 0):
            rows = objective.earned + self.game.matrix.multiply(after)
            best = best_of_rows(rows, self.game.matrix.groups, Direction.MAX)
            after = np.where(objective.going, best, objective.settled)
        return after

    def _step(
        self,
        objectives: Sequence[_Objective],
        cooperative: Sequence[Floats],
        after: Sequence[Floats],
    ) -> list[Floats]:
        """The values in equilibria one step earlier; both maximise one if the other is settled."""
        joint = [c.copy() for c in cooperative]
        both = np.logical_and(*(o.going for o in objectives))
        worth = [
            o.earned + self.game.matrix.multiply(a) for o, a in zip(objectives, after, strict=True)
        ]
        solve = correlated_values if self.correlated else nash_values
        for rows, _, _ in self.game.shapes:
            states = self.game.state_of_row[rows[:, 0, 0]]
            played, states = rows[both[states]], states[both[states]]
            if len(states):
                found = solve(worth[0][played], worth[1][played], fair=self.fair)
                joint[0][states], joint[1][states] = found
        return joint
