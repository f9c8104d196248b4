"""Measures in rational arithmetic, for all types of model. Values are Fractions; what is infinite is `inf`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import Any

import numpy as np

from symcheck.check.context import Context
from symcheck.check.rational.linear_systems import (
    Entries,
    RationalProblem,
    exact_matrix,
    least_solution,
)
from symcheck.check.result import SolverRun
from symcheck.check.time_bounds import Count, Window
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.rational.engine import ExactEngine
from symcheck.engines.rational.values import RationalMatrix, Rationals, RationalValues
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools
from symcheck.numerics import graph
from symcheck.numerics.linear.rational import stationary_distribution
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import ModelType

__all__ = ["MEASURES", "ExactMeasures"]


@dataclass(frozen=True)
class ExactMeasures:
    """Measures of an `ExactEngine` (see `symcheck.check.measures.base.Measures`)."""

    type: ModelType

    def next_probability(
        self, context: Context, target: StateSet, window: Window, direction: Direction | None
    ) -> Values:
        """Probability that the next state is in `target`."""
        engine = _engine(context)
        if self.type is ModelType.CTMC and not window.trivial:
            raise _transient()
        if self.type is not ModelType.CTMC:
            steps = window.steps()
            if steps.lower > 1 or (steps.upper is not None and steps.upper < 1):
                return engine.constant(0)
        return RationalValues(
            _step(engine, _probabilities(engine), _array(engine.indicator(_own(target))), direction)
        )

    def until(
        self, context: Context, left: StateSet, right: StateSet, direction: Direction | None
    ) -> Values:
        """Probability of left U right."""
        engine = _engine(context)
        no = engine.graph.prob0(_own(left), _own(right), direction)
        yes = engine.graph.prob1(_own(left), _own(right), direction)
        matrix = _probabilities(engine)
        enter = matrix.multiply(_array(engine.indicator(yes)))
        return _solve(context, matrix, ~(no | yes), enter, direction, engine.indicator(yes))

    def bounded_until(
        self,
        context: Context,
        left: StateSet,
        right: StateSet,
        window: Window,
        direction: Direction | None,
    ) -> Values:
        """Probability of left U[a,b] right, in steps."""
        engine = _engine(context)
        if self.type is ModelType.CTMC:
            raise _transient()
        steps = window.steps()
        matrix = _probabilities(engine)
        if steps.upper is None:
            x = _array(self.until(context, left, right, direction))
        else:
            x = one = _array(engine.indicator(_own(right)))
            inside = _own(left - right).members
            for _ in range(steps.upper - steps.lower):
                x = _pick(inside, _step(engine, matrix, x, direction), one)
        for _ in range(steps.lower):
            x = _pick(_own(left).members, _step(engine, matrix, x, direction), Fraction(0))
        return RationalValues(x)

    def reward_bounded_until(
        self,
        context: Context,
        left: StateSet,
        right: StateSet,
        counts: Sequence[Count],
        direction: Direction | None,
    ) -> Values:
        """Probability of left U right where the rewards gathered until `right` are within bounds."""
        from symcheck.check.rational.reward_bounded_until import counted_limits, counted_values

        engine = _engine(context)
        limits = counted_limits(context, engine, [c for c in counts if not c.window.trivial])
        if not limits:
            return self.until(context, left, right, direction)
        bounded = any(limit.upper is not None for limit in limits)
        if not bounded and len(limits) > 1:
            raise UnsupportedError(
                "several bounds on rewards, all from below, are not supported in rational arithmetic; without -exact they are"
            )
        unbounded = None if bounded else _array(self.until(context, left, right, direction))
        sets = (_own(left), _own(right))
        return RationalValues(
            counted_values(
                context, engine, _probabilities(engine), sets, limits, direction, unbounded
            )
        )

    def reward_bounded_next(
        self,
        context: Context,
        target: StateSet,
        counts: Sequence[Count],
        direction: Direction | None,
    ) -> Values:
        """Probability that the next state is in `target`, and the rewards of the step are within bounds."""
        from symcheck.check.rational.reward_bounded_until import counted_limits

        engine = _engine(context)
        allowed = np.ones(engine.matrix.rows, bool)
        for limit in counted_limits(context, engine, counts):
            allowed &= (limit.rewards >= limit.lower) & (
                limit.upper is None or limit.rewards <= limit.upper
            )
        into = _probabilities(engine).multiply(_array(engine.indicator(_own(target))))
        return RationalValues(_best(engine, _pick(allowed, into, Fraction(0)), direction))

    def prob_greater_zero(
        self,
        context: Context,
        left: StateSet,
        right: StateSet,
        window: Window,
        direction: Direction | None,
    ) -> StateSet | None:
        """Where a bounded until has a positive probability: by its value, but for a CTMC as with doubles."""
        if self.type is not ModelType.CTMC:
            return None
        from symcheck.check.measures import ctmc

        return ctmc.prob_greater_zero(context, left, right, window, direction)

    def reach_reward(
        self, context: Context, reward: Reward, target: StateSet, direction: Direction | None
    ) -> Values:
        """Expected reward until `target`; infinite where it is missed with positive probability."""
        engine = _engine(context)
        certain = engine.graph.prob1(engine.all, _own(target), direction and direction.dual)
        rest = RationalValues(_pick(certain.members, Fraction(0), inf))
        unknown = certain - _own(target)
        return _solve(
            context,
            _probabilities(engine),
            unknown,
            _reward(engine, reward),
            direction,
            rest,
            proper=direction == Direction.MIN,
        )

    def cumulative_reward(
        self, context: Context, reward: Reward, window: Window, direction: Direction | None
    ) -> Values:
        """Expected reward of the first k steps."""
        engine = _engine(context)
        if self.type is ModelType.CTMC:
            raise _transient()
        steps = window.steps().upper
        assert steps is not None
        per_step, x = _reward(engine, reward), _array(engine.constant(0))
        for _ in range(steps):
            x = _step(engine, _probabilities(engine), x, direction, per_step)
        return RationalValues(x)

    def instantaneous_reward(
        self, context: Context, reward: Reward, time: Fraction, direction: Direction | None
    ) -> Values:
        """Expected state reward after k steps."""
        engine = _engine(context)
        x, _ = engine.rewards(reward)
        if self.type is ModelType.CTMC:
            if time > 0:
                raise _transient()
            return RationalValues(x)
        steps = Window(upper=time).steps().upper
        assert steps is not None
        for _ in range(steps):
            x = _step(engine, _probabilities(engine), x, direction)
        return RationalValues(x)

    def total_reward(self, context: Context, reward: Reward, direction: Direction | None) -> Values:
        """Expected reward for ever, as `symcheck.check.measures.total_reward` defines it."""
        engine = _engine(context)
        per_step = _reward(engine, reward)
        if any(r < 0 for r in per_step):
            raise UnsupportedError("a total reward with negative rewards is not supported; C<=k is")
        paying = np.array([r > 0 for r in per_step], dtype=bool)
        rewarding = ArraySet(_any_row(engine, paying))
        if direction is None:
            return self.reach_reward(
                context, reward, ~engine.graph.exists_until(engine.all, rewarding), None
            )
        everywhere = np.ones(engine.states, bool)
        if direction == Direction.MIN:
            free = graph.maximal_end_components(engine.matrix, everywhere, ~paying)
            return self.reach_reward(context, reward, ArraySet(free.of >= 0), Direction.MIN)
        parts = graph.maximal_end_components(engine.matrix, everywhere)
        infinite = engine.graph.exists_until(
            engine.all, ArraySet(_any_row(engine, parts.rows & paying))
        )
        rest = RationalValues(_pick(infinite.members, inf, Fraction(0)))
        unknown = engine.graph.exists_until(engine.all, rewarding) - infinite
        return _solve(context, _probabilities(engine), unknown, per_step, Direction.MAX, rest)

    def steady_probability(
        self, context: Context, states: StateSet, direction: Direction | None
    ) -> Values:
        """Long-run share of the time in `states`."""
        if self.type is ModelType.MDP:
            from symcheck.check.rational.long_run_mdp import mean_payoff

            engine = _engine(context)
            share = _array(engine.indicator(_own(states)))
            return RationalValues(mean_payoff(context, engine, _per_row(engine, share), direction))
        return _average(context, _array(_engine(context).indicator(_own(states))))

    def steady_reward(
        self, context: Context, reward: Reward, direction: Direction | None
    ) -> Values:
        """Long-run average of the reward per step or unit of time."""
        engine = _engine(context)
        if self.type is ModelType.MDP:
            from symcheck.check.rational.long_run_mdp import mean_payoff

            return RationalValues(mean_payoff(context, engine, _reward(engine, reward), direction))
        states, rows = engine.rewards(reward)
        return _average(context, states + rows)


MEASURES: Mapping[ModelType, ExactMeasures] = {t: ExactMeasures(t) for t in ModelType}


def _engine(context: Context) -> ExactEngine:
    assert isinstance(context.engine, ExactEngine)
    return context.engine


def _own(states: StateSet) -> ArraySet:
    assert isinstance(states, ArraySet)
    return states


def _pick(members: Bools, there: Any, elsewhere: Any) -> Rationals:
    """Values (of an array, or one for all) on a set, and others elsewhere."""
    return np.asarray(np.where(members, there, elsewhere), dtype=object)


def _array(values: Values) -> Rationals:
    assert isinstance(values, RationalValues)
    return values.array


def _transient() -> UnsupportedError:
    return UnsupportedError(
        "time-bounded properties of a ctmc have no rational values; check them without -exact"
    )


def _rates(engine: ExactEngine) -> Rationals | None:
    """The exit rate of each state of a CTMC."""
    if engine.model.type is not ModelType.CTMC:
        return None
    return engine.rationals.multiply(_array(engine.constant(1)))


def _probabilities(engine: ExactEngine) -> RationalMatrix:
    """One-step probabilities: of the embedded chain, in a CTMC."""
    rates = _rates(engine)
    return engine.rationals if rates is None else engine.rationals.scaled(rates)


def _reward(engine: ExactEngine, reward: Reward) -> Rationals:
    """Per row: the expected reward of a step."""
    states, rows = engine.rewards(reward)
    total = _per_row(engine, states) + rows
    rates = _rates(engine)
    return np.asarray(total if rates is None else total / rates)


def _per_row(engine: ExactEngine, states: Rationals) -> Rationals:
    """A value per state spread over its rows."""
    groups = engine.matrix.groups
    return states if groups is None else np.asarray(np.repeat(states, np.diff(groups)))


def _any_row(engine: ExactEngine, rows: Bools) -> Bools:
    """Per state: whether some of its rows is marked."""
    groups = engine.matrix.groups
    return rows if groups is None else np.logical_or.reduceat(rows, groups[:-1])


def _step(
    engine: ExactEngine,
    matrix: RationalMatrix,
    x: Rationals,
    direction: Direction | None,
    add: Rationals | None = None,
) -> Rationals:
    """One step back: the best expected value of x after a step."""
    y = matrix.multiply(x)
    return _best(engine, y if add is None else y + add, direction)


def _best(engine: ExactEngine, y: Rationals, direction: Direction | None) -> Rationals:
    """The best row of each state."""
    groups = engine.matrix.groups
    if groups is None:
        return y
    fold = min if direction == Direction.MIN else max
    out = np.empty(engine.states, dtype=object)
    out[:] = [fold(y[groups[s] : groups[s + 1]]) for s in range(engine.states)]
    return out


def _solve(
    context: Context,
    matrix: RationalMatrix,
    unknown: ArraySet,
    constant: Rationals,
    direction: Direction | None,
    rest: Values,
    *,
    proper: bool = False,
) -> Values:
    """Values on `unknown` as the least solution of x = A x + constant, and those of `rest` elsewhere.

    Rows that lead to where `rest` is infinite are left out. `proper`: over strategies that leave almost surely.
    """
    chosen = np.flatnonzero(unknown.members)
    if not len(chosen):
        return rest
    outside = _array(rest)
    number = {int(s): i for i, s in enumerate(chosen)}
    rows: list[Entries] = []
    constants: list[Fraction] = []
    groups = [0]
    for s in chosen.tolist():
        for r in matrix.rows_of(s):
            entries = matrix.row(r)
            if any(t not in number and outside[t] == inf for t, _ in entries):
                continue
            rows.append([(number[t], p) for t, p in entries if t in number])
            constants.append(constant[r])
        groups.append(len(rows))
    problem = RationalProblem(rows, constants, groups, direction, reward=proper)
    solution, iterations = least_solution(problem)
    context.log.runs.append(SolverRun("exact", "rational elimination", len(chosen), iterations))
    values = outside.copy()
    values[chosen] = solution
    return RationalValues(values)


def _average(context: Context, reward: Rationals) -> Values:
    """The long-run average of a reward per step or unit of time."""
    engine = _engine(context)
    averages = np.full(engine.states, Fraction(0), dtype=object)
    settled = np.zeros(engine.states, bool)
    for component in graph.bsccs(engine.matrix):
        members = component.tolist()
        place = {s: i for i, s in enumerate(members)}
        shares = stationary_distribution(
            exact_matrix([[(place[t], p) for t, p in engine.rationals.row(s)] for s in members])
        )
        averages[component] = sum(
            (share * reward[s] for s, share in zip(members, shares, strict=True)), Fraction(0)
        )
        settled[component] = True
    matrix = _probabilities(engine)
    enter = matrix.multiply(averages)
    return _solve(context, matrix, ArraySet(~settled), enter, None, RationalValues(averages))
