"""A proved bound on rewards in all states of a model, and on how fast it grows along its paths.

Let |s| be a weighted sum of absolute values of variables without bounds. A reward is at most
V(s) = C (K + |s|)^k, and V grows along paths at most by the rate c: the generator Q satisfies
Q V <= c V (in discrete time, an expectation grows by a factor of at most 1 + c <= e^c in a step,
under every strategy). Then the expectation of V after the time t is at most e^ct times its value.
In `RewardGrowth`, C is `factor`, K is `base`, k is `degree` and c is `rate`.

Bounds on expressions are polynomials in the |x_i| with non-negative coefficients, and intervals.
An invariant gives the signs of variables. If |s| grows at a rate of at most a + c0 |s| by jumps of
at most J + eta |s|, c = k (1 + J/K + eta)^(k - 1) c0 suffices for K >= a / c0. The weights w solve
(c0 I - M) w = c0 1 for the rates M at which variables make others grow; whether they do is checked
in fractions.

Source: S. Meyn, R. Tweedie: Stability of Markovian processes III: Foster-Lyapunov criteria for
continuous-time processes (1993), for bounds on expectations by drift.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import reduce
from itertools import product
from math import exp, inf, isfinite, prod
from operator import add
from typing import NamedTuple

import numpy as np

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, Event
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator, UnaryOperator

__all__ = ["RewardGrowth", "reward_growth"]

_Monomial = tuple[int, ...]
"""The variables that are multiplied, by index, ascending."""
_Polynomial = Mapping[_Monomial, Fraction]
_End = Fraction | float
_Box = tuple[tuple[_End, _End], ...]
"""Bounds of each variable."""

_ONE: _Polynomial = {(): Fraction(1)}
_EXACT_ROUNDS = 3
"""Rounds of the search for an invariant before bounds that change are given up."""
_LARGEST_POWER = 8
_MARGIN = 1 + 1e-9
_LEAST = 1e-300
"""Smaller positive numbers count as this one, so that none is rounded to 0 or to a subnormal."""
_INVERSE = {
    Operator.LT: Operator.GE,
    Operator.GE: Operator.LT,
    Operator.GT: Operator.LE,
    Operator.LE: Operator.GT,
    Operator.EQ: Operator.NE,
    Operator.NE: Operator.EQ,
}


@dataclass(frozen=True)
class RewardGrowth:
    """V(s) = factor (base + sum of weights |x|)^degree, of which the expectation grows at most by
    e^(rate t) within the time t, is at least the absolute reward (in continuous time, its rate).

    weights: by the index of the variable.
    """

    factor: Fraction
    base: Fraction
    weights: Mapping[int, Fraction]
    degree: int
    rate: Fraction

    def bound(self, columns: Mapping[int, np.ndarray], states: int, time: float) -> np.ndarray:
        """An upper bound on the expected reward at any time up to `time`: float64[states].

        Args:
            columns: the values of each weighted variable, int64[states].
            states: the number of states.
            time: the horizon; a bound beyond doubles is infinite.
        """
        size = np.full(states, _above(self.base))
        for i, weight in self.weights.items():
            size += _above(weight) * np.abs(columns[i].astype(np.float64))
        exponent = _above(self.rate) * time * _MARGIN
        grown = exp(exponent) if exponent < 700.0 else inf
        with np.errstate(over="ignore", invalid="ignore"):
            bound = _above(self.factor) * size**self.degree * grown * _MARGIN
        return np.where(np.isnan(bound), inf, bound)


def _above(x: Fraction) -> float:
    """A double that is at least x >= 0, up to a rounding that the margin covers."""
    try:
        return max(float(x), _LEAST) if x else 0.0
    except OverflowError:
        return inf


def reward_growth(
    model: BoundModel, items: Iterable[BoundReward], time: Fraction
) -> RewardGrowth | None:
    """The bound on what some items give, for a horizon; None if none is found.

    Args:
        model: a DTMC, CTMC or MDP with one initial state.
        items: rewards of states, and of transitions in a cumulative reward.
        time: the horizon, for which the weights are chosen; the bound holds for any.
    """
    try:
        return _Search(model).found(tuple(items), time)
    except OverflowError:  # a number is beyond doubles
        return None


class _Bound(NamedTuple):
    """The ends of an interval, and a polynomial that the absolute value does not exceed."""

    low: _End
    high: _End
    most: _Polynomial | None


_UNKNOWN = _Bound(-inf, inf, None)


class _Search:
    """The bounds on expressions over an invariant of a model."""

    def __init__(self, model: BoundModel) -> None:
        self._model = model
        self._index = {v.name: i for i, v in enumerate(model.variables)}
        self._is_continuous = model.type.continuous_time
        self._box = self._invariant()

    def found(self, items: Sequence[BoundReward], time: Fraction) -> RewardGrowth | None:
        reward = _total(self._of_item(item) for item in items)
        if reward is None:
            return None
        degree = _degree(reward)
        if degree == 0:
            return RewardGrowth(reward.get((), Fraction(0)), Fraction(1), {}, 0, Fraction(0))
        variables = sorted({i for monomial in reward for i in monomial})
        grows: dict[int, _Polynomial] = {}
        jumps: dict[int, _Polynomial] = {}
        for i in variables:  # the loop appends those that they depend on
            growth, jump = self._growth(i), self._jump(i) if degree > 1 else {}
            if growth is None or jump is None or max(_degree(growth), _degree(jump)) > 1:
                return None
            grows[i], jumps[i] = growth, jump
            variables += sorted({j for m in (*growth, *jump) for j in m} - {*variables})
        horizon = time * degree if time else Fraction(1)
        weights = _weights(variables, grows, 1 / horizon)
        if weights is None:
            return None
        size, longest = _weighted(weights, grows), _weighted(weights, jumps)
        rate = max(_slope(size, weights), 1 / horizon)
        at_once = longest.get((), Fraction(0))
        base = max(Fraction(1), size.get((), Fraction(0)) / rate, degree * at_once)
        relative = at_once / base + _slope(longest, weights)
        factor = sum(
            (
                a * base ** (len(m) - degree) / prod((weights[i] for i in m), start=Fraction(1))
                for m, a in reward.items()
            ),
            Fraction(0),
        )
        rate *= degree * (1 + relative) ** (degree - 1)
        return RewardGrowth(factor, base, weights, degree, rate)

    # ----------------------------------------------------------------------------------- the reward

    def _of_item(self, item: BoundReward) -> _Polynomial | None:
        box = self._refined(self._box, item.guard)
        if box is None:
            return {}
        value = self._bound(item.value, box).most
        if item.on_states or not self._is_continuous:
            return value
        return _total(
            _times(value, self._weight(e)) for e in self._model.events if e.action == item.action
        )

    def _weight(self, event: Event, without: int | None = None) -> _Polynomial | None:
        """The rate of an event without that of one participant; 1 in discrete time."""
        if not self._is_continuous:
            return _ONE
        weights = (
            _total(
                self._bound(update.probability, box).most
                for command, box in self._enabled(commands)
                for update in command.updates
            )
            for p, commands in enumerate(event.participants)
            if p != without
        )
        one: _Polynomial | None = _ONE
        return reduce(_times, weights, one)

    # ----------------------------------------------------------------------------------- its growth

    def _growth(self, variable: int) -> _Polynomial | None:
        """The rate at which the absolute value of a variable grows."""
        of_events = []
        for event in self._model.events:
            parts = []
            for p, commands in enumerate(event.participants):
                of_commands = [
                    _total(
                        _times(self._probability(u.probability, box), delta)
                        for u in command.updates
                        if (delta := self._delta(u.assignments, variable, box)) != {}
                    )
                    for command, box in self._enabled(commands)
                ]
                both = _total(of_commands) if self._is_continuous else _largest(of_commands)
                parts.append(both if both == {} else _times(both, self._weight(event, p)))
            of_events.append(_total(parts))
        return _total(of_events) if self._is_continuous else _largest(of_events)

    def _jump(self, variable: int) -> _Polynomial | None:
        """By how much the absolute value of a variable grows at a time."""
        return _largest(
            _total(
                _largest(
                    self._delta(u.assignments, variable, box)
                    for command, box in self._enabled(commands)
                    for u in command.updates
                )
                for commands in event.participants
            )
            for event in self._model.events
        )

    def _probability(self, weight: Expression, box: _Box) -> _Polynomial | None:
        found = self._bound(weight, box)
        if self._is_continuous or (found.high <= 1 and found.low >= 0):
            return found.most
        return _ONE

    def _delta(
        self, assignments: Sequence[tuple[int, Expression]], variable: int, box: _Box
    ) -> _Polynomial | None:
        """By how much the absolute value of a variable grows in an update."""
        value = dict(assignments).get(variable)
        if value is None:
            return {}
        rest = _without(value, self._model.variables[variable].name)
        if rest is None:
            return self._bound(value, box).most
        change = self._bound(rest, box)
        if self._box[variable][0] >= 0:  # before and after
            if change.high <= 0:
                return {}
            if isinstance(change.high, Fraction):
                return {(): change.high}
        return change.most

    # -------------------------------------------------------------------------------- the invariant

    def _enabled(self, commands: Iterable[BoundCommand]) -> Iterable[tuple[BoundCommand, _Box]]:
        """The commands that may be enabled, with bounds on the variables where they are."""
        for command in commands:
            if (box := self._refined(self._box, command.guard)) is not None:
                yield command, box

    def _invariant(self) -> _Box:
        """Bounds on each variable in all states."""
        box: list[tuple[_End, _End]] = []
        free = set()
        for i, v in enumerate(self._model.variables):
            if v.low is None or v.high is None:
                free.add(i)
                assert v.initial is not None
                box.append((Fraction(v.initial), Fraction(v.initial)))
            else:
                box.append((Fraction(v.low), Fraction(v.high)))
        changed, rounds = True, 0
        while changed:
            self._box = tuple(box)
            changed, rounds = False, rounds + 1
            for event in self._model.events:
                for command, inside in self._enabled(
                    c for commands in event.participants for c in commands
                ):
                    for update in command.updates:
                        for i, value in update.assignments:
                            if i not in free:
                                continue
                            found = self._bound(value, inside)
                            low, high = min(box[i][0], found.low), max(box[i][1], found.high)
                            if rounds > _EXACT_ROUNDS:
                                if low < box[i][0]:
                                    low = Fraction(0) if low >= 0 else -inf
                                if high > box[i][1]:
                                    high = Fraction(0) if high <= 0 else inf
                            if (low, high) != box[i]:
                                box[i], changed = (low, high), True
        return tuple(box)

    def _refined(self, box: _Box, guard: Expression) -> _Box | None:
        """Bounds on the variables where a condition holds; None if it holds nowhere."""
        match guard:
            case Literal(value):
                return box if value else None
            case Binary(Operator.AND, left, right):
                part = self._refined(box, left)
                return None if part is None else self._refined(part, right)
            case Binary(operator, left, right) if operator.is_comparison:
                part = self._compared(box, operator, left, right)
                return part and self._compared(part, operator.mirrored, right, left)
            case Unary(UnaryOperator.NOT, Binary(operator, left, right)) if operator in _INVERSE:
                return self._refined(box, Binary(_INVERSE[operator], left, right))
            case _:
                return box

    def _compared(
        self, box: _Box, operator: Operator, left: Expression, right: Expression
    ) -> _Box | None:
        if not isinstance(left, Name) or (i := self._index.get(left.name)) is None:
            return box
        if self._model.variables[i].type is Type.BOOL:
            return box
        other, (low, high) = self._bound(right, box), box[i]
        if operator in (Operator.GT, Operator.GE, Operator.EQ) and isfinite(other.low):
            least = Fraction(other.low.__floor__() + 1) if operator is Operator.GT else other.low
            low = max(low, least)
        if operator in (Operator.LT, Operator.LE, Operator.EQ) and isfinite(other.high):
            most = Fraction(other.high.__ceil__() - 1) if operator is Operator.LT else other.high
            high = min(high, most)
        return None if low > high else (*box[:i], (low, high), *box[i + 1 :])

    # ------------------------------------------------------------------------------- of expressions

    def _bound(self, e: Expression, box: _Box) -> _Bound:
        """Bounds on the value of a number."""
        found = self._raw(e, box)
        if not (isfinite(found.low) and isfinite(found.high)):
            return found
        largest = max(abs(Fraction(found.low)), abs(Fraction(found.high)))
        return found._replace(most={(): largest} if largest else {})

    def _raw(self, e: Expression, box: _Box) -> _Bound:
        match e:
            case Literal(value):
                number = Fraction(value)
                return _Bound(number, number, None)
            case Name(name) if name in self._index:
                i = self._index[name]
                return _Bound(*box[i], {(i,): Fraction(1)})
            case Unary(UnaryOperator.MINUS, operand):
                x = self._bound(operand, box)
                return _Bound(-x.high, -x.low, x.most)
            case Binary(Operator.PLUS | Operator.MINUS as operator, left, right):
                x, y = self._bound(left, box), self._bound(right, box)
                if operator is Operator.MINUS:
                    y = _Bound(-y.high, -y.low, y.most)
                return _Bound(x.low + y.low, x.high + y.high, _total((x.most, y.most)))
            case Binary(Operator.TIMES, left, right):
                return _product(self._bound(left, box), self._bound(right, box))
            case Binary(Operator.DIVIDE, left, right):
                x, y = self._bound(left, box), self._bound(right, box)
                if y.low <= 0 <= y.high:
                    return _UNKNOWN
                low, high = sorted((_inverse(y.low), _inverse(y.high)))
                return _product(x, _Bound(low, high, {(): max(abs(low), abs(high))}))
            case Binary(Operator.POWER, base, Literal(exponent)) | Call(
                Function.POW, (base, Literal(exponent))
            ) if exponent in range(1, _LARGEST_POWER + 1):
                return reduce(_product, [self._bound(base, box)] * int(exponent))
            case Conditional(condition, then, otherwise):
                parts = [
                    self._bound(value, part)
                    for value, part in (
                        (then, self._refined(box, condition)),
                        (otherwise, self._refined(box, Unary(UnaryOperator.NOT, condition))),
                    )
                    if part is not None
                ]
                if not parts:
                    return _UNKNOWN
                lows, highs, mosts = zip(*parts, strict=True)
                return _Bound(min(lows), max(highs), _largest(mosts))
            case Call(Function.MIN | Function.MAX as function, arguments):
                lows, highs, mosts = zip(*(self._bound(a, box) for a in arguments), strict=True)
                extreme = min if function is Function.MIN else max
                return _Bound(extreme(lows), extreme(highs), _largest(mosts))
            case Call(Function.FLOOR | Function.CEIL | Function.ROUND, (argument,)):
                x = self._bound(argument, box)
                return _Bound(x.low - 1, x.high + 1, _total((x.most, _ONE)))
            case Call(Function.MOD, (_, divisor)):
                y = self._bound(divisor, box)
                return _Bound(Fraction(0), y.high, y.most) if y.low > 0 else _UNKNOWN
            case _:
                return _UNKNOWN


def _product(x: _Bound, y: _Bound) -> _Bound:
    ends = [_end(a, b) for a, b in product(x[:2], y[:2])]
    return _Bound(min(ends), max(ends), _times(x.most, y.most))


def _end(a: _End, b: _End) -> _End:
    """The product of two ends, where 0 times infinity is 0."""
    if not a or not b:
        return Fraction(0)
    if isfinite(a) and isfinite(b):
        return a * b
    return inf if (a > 0) == (b > 0) else -inf


def _inverse(end: _End) -> Fraction:
    return 1 / Fraction(end) if isfinite(end) else Fraction(0)


def _without(e: Expression, name: str) -> Expression | None:
    """What is added to a variable in a sum; None if it is no sum with it."""
    match e:
        case Name(found) if found == name:
            return Literal(0, Type.INT)
        case Binary(Operator.PLUS | Operator.MINUS as operator, left, right):
            if (rest := _without(left, name)) is not None:
                return Binary(operator, rest, right)
            if operator is Operator.PLUS and (rest := _without(right, name)) is not None:
                return Binary(operator, left, rest)
            return None
        case _:
            return None


def _weights(
    variables: Sequence[int], grows: Mapping[int, _Polynomial], least: Fraction
) -> dict[int, Fraction] | None:
    """Weights with which a sum of variables grows at hardly more than the least rate, if it can."""
    rates = np.array([[float(grows[j].get((i,), 0)) for j in variables] for i in variables])
    rate = float(np.abs(np.linalg.eigvals(rates)).max()) + float(least)
    try:
        found = np.linalg.solve(rate * np.eye(len(variables)) - rates, np.full(len(rates), rate))
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(found).all() or found.min() <= 0.0:
        return None
    return dict(zip(variables, map(Fraction, found.tolist()), strict=True))


def _weighted(weights: Mapping[int, Fraction], parts: Mapping[int, _Polynomial]) -> _Polynomial:
    total = _total(_times(part, {(): weights[i]}) for i, part in parts.items())
    assert total is not None
    return total


def _slope(growth: _Polynomial, weights: Mapping[int, Fraction]) -> Fraction:
    """The growth relative to the weighted sum, but for the constant."""
    return max((a / weights[m[0]] for m, a in growth.items() if m), default=Fraction(0))


def _degree(p: _Polynomial) -> int:
    return max(map(len, p), default=0)


def _total(parts: Iterable[_Polynomial | None]) -> _Polynomial | None:
    return _merged(parts, add)


def _largest(parts: Iterable[_Polynomial | None]) -> _Polynomial | None:
    return _merged(parts, max)


def _merged(
    parts: Iterable[_Polynomial | None], merge: Callable[[Fraction, Fraction], Fraction]
) -> _Polynomial | None:
    """The coefficients of several polynomials merged; None if one is unknown."""
    result: dict[_Monomial, Fraction] = {}
    for part in parts:
        if part is None:
            return None
        for m, a in part.items():
            result[m] = merge(result.get(m, Fraction(0)), a)
    return result


def _times(p: _Polynomial | None, q: _Polynomial | None) -> _Polynomial | None:
    if p is None or q is None:
        return None
    result: dict[_Monomial, Fraction] = {}
    for (m, a), (n, b) in product(p.items(), q.items()):
        both = tuple(sorted(m + n))
        result[both] = result.get(both, Fraction(0)) + a * b
    return result
