"""Quantiles: the least or greatest bound for which a property holds.

`quantile(min B, P>=0.9 [ F{"cost"}<=B "goal" ])` is the least budget that suffices. A probability
is monotone in a bound, so that the bounds that satisfy the property are all up to one, or all from
one on. It is found by doubling and bisection; every comparison is proved, as for any property.

Source: Baier, Daum, Dubslaff, Klein & Klüppelholz (2014), Energy-Utility Quantiles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from typing import assert_never

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.errors import NumericalError
from symcheck.semantics.query import direction_of
from symcheck.semantics.rewards import Reward, Steps, Structure, Time, bounded_reward
from symcheck.syntax.ast import (
    BinaryTemporal,
    Bound,
    Eventually,
    Expression,
    Globally,
    Limits,
    Literal,
    Next,
    Parameter,
    PathBound,
    ProbabilityOperator,
    Quantile,
    RewardBound,
    RewardBounds,
    TimeBound,
    Type,
    UnaryTemporal,
    Until,
)
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = ["quantile"]

Satisfying = Callable[[Context, Expression, StateSet], StateSet]
Change = Callable[[ProbabilityOperator], ProbabilityOperator]


def quantile(
    context: Context, formula: Quantile, satisfying: Satisfying, relevant: StateSet
) -> Values:
    """The quantile at the relevant states; 0 at others.

    Args:
        context: the engine, the options and the log.
        formula: the quantile; its variable is one limit of a bound.
        satisfying: gives the states that satisfy a formula, proved at some states.
        relevant: the states that are asked for.

    Returns:
        Integers; infinite for a maximum if all bounds satisfy the property, and for a minimum if
        none does. -Infinity for a maximum if none does.

    Raises:
        NumericalError: a comparison is not decided, or a bound is not found among the first ones.
    """
    search = _Search.of(context, formula, satisfying)
    first = search.first_crossing(relevant)
    least = formula.optimum == "min"
    values = context.engine.constant(0)
    holds = search.upward  # from the crossing on; otherwise before it
    for bound, states in first.items():
        crossed = bound < inf
        if least:
            value = bound if holds else (0.0 if bound > 0 else inf)
        else:
            value = (inf if crossed else -inf) if holds else bound - 1 if bound > 0 else -inf
        _note(context, formula, states, value, holds=holds, crossed=crossed)
        values = context.engine.constant(value).choose(states, values)
    return values


def _note(
    context: Context,
    formula: Quantile,
    states: StateSet,
    value: float,
    *,
    holds: bool,
    crossed: bool,
) -> None:
    """Say why a quantile has no proper value."""
    name, where = formula.variable, context.example(states)
    if (formula.optimum == "min" and value == inf) or value == -inf:
        context.log.warn(f"no value of {name} satisfies the property, as in state {where}")
    elif value == inf and not (holds and crossed):
        context.log.warn(f"every value of {name} satisfies the property, as in state {where}")
    elif value == inf:
        context.log.warn(
            f"every large value of {name} satisfies the property, as in state {where}; "
            f"quantile(min {name}, …) asks for the first"
        )
    elif formula.optimum == "min" and not holds:
        context.log.warn(
            f"small values of {name} satisfy the property, and quantile(max {name}, …) asks for "
            "the last"
        )


@dataclass(frozen=True)
class _Search:
    """The search for the first bound at which the property changes.

    upward: whether the bounds that satisfy the property are those from some bound on.
    increasing: whether the probability increases with the bound. upper: whether the variable is an
    upper limit.
    """

    context: Context
    formula: ProbabilityOperator
    satisfying: Satisfying
    upward: bool
    increasing: bool
    upper: bool

    @staticmethod
    def of(context: Context, formula: Quantile, satisfying: Satisfying) -> _Search:
        operator = formula.formula
        assert isinstance(operator, ProbabilityOperator)
        assert operator.bound is not None
        upper = any(
            isinstance(n, Limits) and isinstance(n.upper, Parameter) for n in nodes(operator.path)
        )
        reaches = isinstance(operator.path, Eventually | Until | Next)
        above = operator.bound.operator.is_lower_bound
        increasing = reaches == upper
        return _Search(context, operator, satisfying, increasing == above, increasing, upper)

    def first_crossing(self, relevant: StateSet) -> dict[float, StateSet]:
        """States by the first bound at which the property changes; infinite if it never does."""
        satisfying: dict[float, StateSet] = {}
        at_zero = self._crossed(0, relevant)
        if at_zero:
            satisfying[0] = at_zero
        waiting = sure = relevant - at_zero
        if waiting and self.upper:
            sure, possible = self._crosses_at_last(waiting)
            never = waiting - sure - possible
            if never:
                satisfying[inf] = never
            waiting = sure | possible
        elif waiting and (change := self._recurrence()) is not None:
            never = waiting - self._crosses_in_the_limit(change, waiting)
            if never:
                satisfying[inf] = never
            sure = waiting = waiting - never
        low, high = 0, 1
        while waiting:
            if high > (tuning.QUANTILE_BOUND if waiting & sure else self._last_trial()):
                raise NumericalError(
                    f"the property does not change up to the bound {low:,}, for example in state "
                    f"{self.context.example(waiting)}, and larger bounds are not tried"
                )
            crossed = self._crossed(high, waiting)
            self._bisect(low, high, crossed, satisfying)
            waiting = waiting - crossed
            low, high = high, 2 * high
        return satisfying

    def _bisect(
        self, low: int, high: int, states: StateSet, satisfying: dict[float, StateSet]
    ) -> None:
        """Enter the states that cross after `low` and up to `high`."""
        if not states:
            return
        if high - low == 1:
            satisfying[high] = states
            return
        middle = (low + high) // 2
        crossed = self._crossed(middle, states)
        self._bisect(low, middle, crossed, satisfying)
        self._bisect(middle, high, states - crossed, satisfying)

    def _crosses_at_last(self, states: StateSet) -> tuple[StateSet, StateSet]:
        """The states where some bound crosses, and those where one may, by the limit of the
        probability.

        If the limit is the threshold, it must be attained. In a chain, and for a strategy that
        makes reaching most likely, the runs that attain it visit no cycle with a cost, and cost at
        most that of as many steps as there are states. Otherwise another strategy may have a
        larger limit and come near it slowly; and a second bound may need cycles.
        """
        bound = self.formula.bound
        assert bound is not None
        beyond = Operator.GT if self.increasing else Operator.LT
        sure = self._with_operator(beyond, states)
        # The property changes where the probability attains the threshold for >= and <, and only
        # beyond it for > and <=.
        attains = bound.operator in (
            (Operator.GE, Operator.LT) if self.increasing else (Operator.LE, Operator.GT)
        )
        rest = states - sure
        if not (attains and rest):
            return sure, states - states
        reached = self._with_operator(Operator.GE if self.increasing else Operator.LE, rest)
        if not reached:
            return sure, reached
        crossed = self._crossed(self._largest(), reached)
        possible = reached - crossed
        if self._attained_without_cycles():
            possible = states - states
        return sure | crossed, possible

    def _recurrence(self) -> Change | None:
        """The property with `G F right` for `F>=B right`, or `F G right` for `G>=B right`.

        A path satisfies `G F right` if it satisfies `F>=B right` for all B, so that its probability
        is at most that of each bound, under each strategy. `F G right` is the dual.
        """
        path = self.formula.path
        limit: UnaryTemporal
        match path:
            case Eventually(bound=TimeBound(upper=None)):
                limit = Globally(Eventually(path.operand, span=path.span), span=path.span)
            case Globally(bound=TimeBound(upper=None)):
                limit = Eventually(Globally(path.operand, span=path.span), span=path.span)
            case _:
                return None
        return lambda formula: replace(formula, path=limit)

    def _crosses_in_the_limit(self, change: Change, states: StateSet) -> StateSet:
        """The states where the property has changed for the limit of the paths."""
        holds = self._holds(change, states)
        return states & (holds if self.upward else ~holds)

    def _attained_without_cycles(self) -> bool:
        """Whether a limit that is attained is attained within as many steps as states."""
        path = self.formula.path
        assert isinstance(path, UnaryTemporal | BinaryTemporal)
        if isinstance(path.bound, RewardBounds) and len(path.bound.parts) > 1:
            return False
        most = Direction.MAX if isinstance(path, Eventually | Until | Next) else Direction.MIN
        return self._direction() in (None, most)

    def _last_trial(self) -> int:
        """The largest bound that is tried where none may be the answer."""
        return min(tuning.QUANTILE_BOUND, tuning.QUANTILE_ROUNDS * self._largest())

    def _direction(self) -> Direction | None:
        """The strategies that the bound is about; None for a chain."""
        return direction_of(self.formula, self.context.engine.model.type)

    def _with_operator(self, operator: Operator, states: StateSet) -> StateSet:
        """The states whose limit compares so with the threshold."""
        direction = self._direction()

        def change(formula: ProbabilityOperator) -> ProbabilityOperator:
            path, bound = formula.path, formula.bound
            assert isinstance(path, UnaryTemporal | BinaryTemporal)
            assert path.bound is not None
            assert bound is not None
            return replace(
                formula,
                direction=direction and direction.value,
                bound=Bound(operator, bound.threshold, span=bound.span),
                path=replace(path, bound=_without_variable(path.bound)),
            )

        return self._holds(change, states)

    def _crossed(self, value: int, states: StateSet) -> StateSet:
        """The states where the property has changed at this bound."""
        holds = self._holds(lambda f: _with_value(f, value), states)
        return states & (holds if self.upward else ~holds)

    def _holds(self, change: Change, states: StateSet) -> StateSet:
        return states & self.satisfying(self.context, change(self.formula), states)

    def _largest(self) -> int:
        """The largest cost of as many steps as there are states, rounded up."""
        engine = self.context.engine
        largest = 0.0
        for node in nodes(self.formula.path):
            match node:
                case RewardBound() if isinstance(node.upper, Parameter):
                    largest = _largest_step(self.context, bounded_reward(node, engine.model))
                case TimeBound() if isinstance(node.upper, Parameter):
                    largest = 1.0
                case _:
                    pass
        return int(np.ceil(largest * engine.states))


def _largest_step(context: Context, reward: Reward) -> float:
    """The largest reward of a step."""
    match reward:
        case Structure():
            system = context.engine.system(context.engine.all)
            return float(max(system.step_rewards(reward), default=0.0))
        case Steps() | Time():
            return 1.0
        case _:
            assert_never(reward)


def _with_value(formula: ProbabilityOperator, value: int) -> ProbabilityOperator:
    """The property with a value in place of the variable."""

    def put(node: Tree) -> Tree:
        return Literal(value, Type.INT, span=node.span) if isinstance(node, Parameter) else node

    return transform(formula, put)


def _without_variable(bound: PathBound) -> PathBound | None:
    """The bound without the limit that is the variable."""
    match bound:
        case TimeBound() | RewardBound() if isinstance(bound.upper, Parameter):
            less = replace(bound, upper=None, upper_strict=False)
            return None if less.lower is None else less
        case RewardBounds(parts):
            left = [_without_variable(p) for p in parts]
            kept = tuple(p for p in left if isinstance(p, RewardBound))
            return RewardBounds(kept, span=bound.span) if kept else None
        case TimeBound() | RewardBound():
            return bound
        case _:
            assert_never(bound)
