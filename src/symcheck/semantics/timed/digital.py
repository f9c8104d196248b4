"""Digital clocks: a timed automaton as a Markov decision process whose clocks count time units.

If all constraints are closed (they admit their limits) and none compares two clocks, then
probabilities of reaching locations, and expected rewards until then, are those of the automaton.
Time passes by an action in which all modules take part. All constants are divided by their greatest
common divisor, and a clock stops one unit beyond the largest constant that it can still be compared
with (see `ceilings`).
Source: Kwiatkowska, Norman, Parker & Sproston, Performance analysis of probabilistic timed automata
using digital clocks, FMSD 29 (2006).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction
from functools import partial, reduce
from itertools import chain
from math import gcd
from typing import ClassVar

from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import as_expression
from symcheck.semantics.expressions.simplify import simplify
from symcheck.semantics.model import (
    BoundCommand,
    BoundModel,
    BoundReward,
    BoundRewards,
    BoundUpdate,
    Event,
    Value,
    Variable,
)
from symcheck.semantics.state_faults import describe_state
from symcheck.semantics.timed.ceilings import local_ceilings
from symcheck.semantics.timed.constraints import (
    ClockConstraint,
    clock_constraints,
    clocks_of,
    constraint,
    possible_values,
)
from symcheck.syntax.ast import Binary, Call, Expression, Literal, ModelType, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.traversal import Tree, substitute, transform

__all__ = [
    "Asked",
    "DigitalClocks",
    "NotDigital",
    "common_unit",
    "digital_clocks",
    "limits_of",
    "require_states",
]

_TRUE = Literal(True, Type.BOOL)
_FALSE = Literal(False, Type.BOOL)
_ONE = Literal(Fraction(1), Type.DOUBLE)


class NotDigital(UnsupportedError):
    """A constraint for which digital clocks would give other values than the automaton has."""


@dataclass(frozen=True)
class Asked:
    """What a property needs of the clocks.

    Attributes:
        conditions: state formulas without labels, each with whether it, or else its negation, is
            required: that one has to be closed.
        horizon: the largest time with which a property compares the time since the beginning; None
            if there is none.
        ticks: it tells whether the last step let time pass, so that it can ask whether time goes
            on for ever.
    """

    conditions: tuple[tuple[Expression, bool], ...] = ()
    horizon: tuple[Fraction, ...] = ()
    ticks: bool = False


@dataclass(frozen=True)
class DigitalClocks:
    """How a timed automaton is read on the decision process that counts time units.

    Attributes:
        automaton: the automaton.
        unit: the time that a step of time takes.
        time: the action of such a step, and the name of its reward structure.
        now: the variable that counts the units since the beginning; None if nothing asks for it.
        tick: the variable that tells whether the last step let time pass; None if nothing asks.
        can_wait: the states in which time may pass.
        ceilings: for some clocks, where they stop, in units; each depends on one variable.
        asked: what the property needs for which the model was made; None: it was made for none.
    """

    automaton: BoundModel = field(repr=False)
    unit: Fraction
    time: str
    now: str | None
    tick: str | None
    can_wait: Expression = field(repr=False)
    ceilings: Mapping[str, tuple[Expression, ...]] = field(repr=False)
    asked: Asked | None = field(default=None, repr=False)
    lists_states: ClassVar[bool] = True

    @property
    def for_property(self) -> bool:
        """Whether the model was made for one property."""
        return self.asked is not None

    def __str__(self) -> str:
        """How time is treated, in words."""
        return "digital clocks" + (f" with units of {self.unit}" if self.unit != 1 else "")

    def condition(self, expression: Expression) -> Expression:
        """A condition over clocks as one over counters of units."""
        return _in_units(expression, clocks_of(self.automaton), self.unit)

    def describe(self, state: Sequence[Value]) -> str:
        """A state of the automaton, for messages: without what is added, with times of clocks.

        A clock at its ceiling is left out: it may have any larger value.
        """
        variables = self.automaton.variables
        values = {v.name: x for v, x in zip(variables, state, strict=False)}
        own = [
            v
            for v in variables
            if all(values[v.name] < evaluate(c, values) for c in self.ceilings.get(v.name, ()))
        ]
        shown = [values[v.name] * self.unit if v.clock else values[v.name] for v in own]
        return describe_state(own, shown)

    def time_is(self, operator: Operator, time: Fraction) -> Expression:
        """The comparison of the time since the beginning with a number."""
        assert self.now is not None
        return Binary(operator, Name(self.now), _number(time / self.unit))


def digital_clocks(automaton: BoundModel, asked: Asked | None = None) -> BoundModel:
    """The decision process with digital clocks.

    Its variables are those of the automaton in their order, then those that a property asks for.
    Strategies observe what they did, and the counters that are added, which they remember anyway.
    A command without effect is left out where time may pass: it would only let an infinite number
    of steps happen at one instant.

    Args:
        automaton: a bound model whose variables include clocks, checked by `check_clocks`.
        asked: what a property needs; None: there is none.

    Raises:
        NotDigital: a constraint is strict or diagonal.
        UnsupportedError: the bound of a clock depends on too many values.
        InputError: a clock is reset to a negative number.
    """
    for_property, asked = asked, asked or Asked()
    clocks = clocks_of(automaton)
    variables = {v.name: v for v in automaton.variables}
    seen = {o.name for o in automaton.observables if isinstance(o, Name)}
    observed = [o for o in automaton.observables if not isinstance(o, Name)]
    observations = ((c, None) for o in observed for c in _comparisons(o, clocks))
    for found, holds in chain(_constraints(automaton, asked, clocks), observations):
        if found.other is not None:
            raise _refused(f"{found.clock}-{found.other}", "compares two clocks", found)
        if holds is not None and not found.is_closed(holds):
            raise _refused(found.clock, "does not admit its limit", found)
    conditions = [c for c, _ in asked.conditions]
    limits, _ = limits_of(automaton, conditions)
    labels = automaton.labels.values()
    for condition in (*observed, *(labels if for_property is None else ())):
        for found in _comparisons(condition, clocks):
            if found.other is None:
                limits[found.clock].update(possible_values(found.bound, variables))
    unit = common_unit([*(c for values in limits.values() for c in values), *asked.horizon])
    taken = {*variables, *automaton.actions, *(r.name for r in automaton.rewards)}
    time, tick, now = _free("time", taken), _free("tick", taken), _free("now", taken)
    top = {name: int(max(limits[name], default=Fraction(0)) / unit) + 1 for name in clocks}
    counters = [
        replace(v, low=0, high=max(top[v.name], 1), initial=0, clock=False) if v.clock else v
        for v in automaton.variables
    ]
    place = len(counters)
    if asked.horizon:
        counters.append(Variable(now, Type.INT, 0, int(max(asked.horizon) / unit) + 1, 0, None))
    if asked.ticks:
        counters.append(Variable(tick, Type.BOOL, 0, 1, False, None))
    growing = {i for i, v in enumerate(automaton.variables) if v.clock}
    growing |= {place} if asked.horizon else set()
    # Labels count, so that the states of a property that does not read them are those shown.
    read = [*conditions, *observed, *labels]
    unseen = {name: n for name, n in top.items() if name not in seen}
    ceilings = local_ceilings(automaton, read, unit, unseen)
    grown: dict[str, Expression] = {counters[i].name: _after(counters[i], {}) for i in growing}
    in_units = partial(_in_units, clocks=clocks, unit=unit)
    waits: list[BoundCommand] = []
    for k, module in enumerate(automaton.modules):
        own = {i for i in growing if i in module.variables}
        own |= {i for i in growing if k == 0 and counters[i].module is None}
        guard = _TRUE if module.invariant is None else in_units(module.invariant)
        later = substitute(guard, grown)
        if guard != later:
            guard = Binary(Operator.AND, guard, later)
        updates = [(i, _after(counters[i], ceilings)) for i in sorted(own)]
        if k == 0 and asked.ticks:
            updates.append((len(counters) - 1, _TRUE))
        span = automaton.program.span if module.invariant is None else module.invariant.span
        update = BoundUpdate(_ONE, tuple(updates), span=span)
        waits.append(BoundCommand(k, time, guard, (update,), span=span))
    can_wait = simplify(reduce(partial(Binary, Operator.AND), (c.guard for c in waits)))
    noted = ((len(counters) - 1, _FALSE),) if asked.ticks else ()
    rewarded = {i.action for r in automaton.rewards for i in r.items if not i.on_states}

    def converted(
        command: BoundCommand, further: tuple[tuple[int, Expression], ...]
    ) -> BoundCommand:
        updates = (
            replace(
                u,
                assignments=(
                    *((i, _in_time(v, unit) if i in growing else v) for i, v in u.assignments),
                    *further,
                ),
            )
            for u in command.updates
        )
        return replace(command, guard=in_units(command.guard), updates=tuple(updates))

    def event(given: Event) -> Event | None:
        first, *others = given.participants
        idle = not any(u.assignments for p in given.participants for c in p for u in c.updates)
        commands = [converted(c, noted) for c in first]
        # Who observes a part of the state must have the same commands in all that look alike.
        if idle and given.action not in rewarded and not automaton.type.partially_observed:
            if can_wait == _TRUE:
                return None
            stuck = Unary(UnaryOperator.NOT, can_wait)
            commands = [replace(c, guard=Binary(Operator.AND, c.guard, stuck)) for c in commands]
        rest = (tuple(converted(c, ()) for c in p) for p in others)
        return replace(given, participants=(tuple(commands), *rest))

    events = [e for e in map(event, automaton.events) if e is not None]
    events.append(Event(time, tuple((c,) for c in waits)))
    per_unit = as_expression(unit, Type.DOUBLE)
    rewards = [replace(r, items=tuple(_rates(r.items, time, per_unit))) for r in automaton.rewards]
    rewards.append(BoundRewards(time, (BoundReward(False, time, _TRUE, per_unit),)))
    own_kind = automaton.type
    kind = ModelType.with_properties(
        has_choices=True,
        several_players=own_kind.players > 1,
        partially_observed=own_kind.partially_observed,
    )
    modules = tuple(
        replace(m, commands=tuple(converted(c, ()) for c in m.commands), invariant=None)
        for m in automaton.modules
    )
    # A strategy remembers when it let time pass, and so it knows these counters.
    remembered = [Name(v.name) for v in counters[place:] if own_kind.partially_observed]
    readable = {
        name: in_units(label)
        for name, label in automaton.labels.items()
        if all(c.other is None for c in _comparisons(label, clocks))
    }
    return replace(
        automaton,
        type=kind,
        variables=tuple(counters),
        modules=modules,
        events=tuple(events),
        labels=readable,
        observables=(*map(in_units, automaton.observables), *remembered),
        rewards=tuple(rewards),
        derivation=partial(digital_clocks, asked=for_property),
        clocks=DigitalClocks(
            automaton,
            unit,
            time,
            now if asked.horizon else None,
            tick if asked.ticks else None,
            can_wait,
            ceilings,
            for_property,
        ),
    )


def require_states(model: BoundModel) -> None:
    """Refuse a timed automaton without a model whose states are listed, with the reason.

    Raises NotDigital: it has none, because a constraint is strict or diagonal.
    """
    if model.type.has_clocks:
        digital_clocks(model)


def limits_of(
    model: BoundModel, conditions: Iterable[Expression]
) -> tuple[dict[str, set[Fraction]], set[tuple[str, str, Fraction]]]:
    """The constants that clocks are compared with or set to, and the diagonal constraints.

    Args:
        model: a timed automaton.
        conditions: those of a property.

    Raises:
        UnsupportedError: a bound depends on too many values.
        InputError: a clock is set to a negative number.
    """
    variables, clocks = {v.name: v for v in model.variables}, clocks_of(model)
    limits: dict[str, set[Fraction]] = {name: set() for name in clocks}
    diagonals: set[tuple[str, str, Fraction]] = set()
    asked = Asked(tuple((c, True) for c in conditions))
    for found, _ in _constraints(model, asked, clocks):
        values = possible_values(found.bound, variables)
        if found.other is None:
            limits[found.clock].update(values)
        else:
            diagonals.update((found.clock, found.other, value) for value in values)
            for name in (found.clock, found.other):
                limits[name].update(map(abs, values))
    for command in _commands(model):
        for update in command.updates:
            for i, value in update.assignments:
                if model.variables[i].clock:
                    resets = possible_values(value, variables)
                    if min(resets, default=0) < 0:
                        message = f"clock {model.variables[i].name} is set to a negative number"
                        raise InputError(Diagnostic(message, value.span, "clock"))
                    limits[model.variables[i].name].update(resets)
    return limits, diagonals


def _commands(model: BoundModel) -> Iterator[BoundCommand]:
    return (c for m in model.modules for c in m.commands)


def _constraints(
    model: BoundModel, asked: Asked, clocks: frozenset[str]
) -> Iterator[tuple[ClockConstraint, bool]]:
    for command in _commands(model):
        yield from clock_constraints(command.guard, clocks)
    for module in model.modules:
        if module.invariant is not None:
            yield from clock_constraints(module.invariant, clocks)
    for condition, holds in asked.conditions:
        yield from clock_constraints(condition, clocks, holds)


def _comparisons(condition: Expression, clocks: frozenset[str]) -> Iterator[ClockConstraint]:
    return (c for c, _ in clock_constraints(condition, clocks))


def _refused(what: str, why: str, found: ClockConstraint) -> NotDigital:
    message = f"digital clocks cannot be used: this constraint on {what} {why}"
    hint = "zones decide properties with one operator P, and have other states"
    return NotDigital(Diagnostic(message, found.span, "digital", hint))


def common_unit(constants: Iterable[Fraction]) -> Fraction:
    """The greatest number of which all of these are multiples; 1 if all are 0."""
    above, below = 0, 1
    for value in constants:
        above, below = (
            gcd(above * value.denominator, value.numerator * below),
            below * value.denominator,
        )
        common = gcd(above, below)
        above, below = above // common, below // common
    return Fraction(above, below) if above else Fraction(1)


def _free(name: str, taken: set[str | None]) -> str:
    """A name that is not taken, which begins with this one."""
    while name in taken:
        name += "_"
    return name


def _number(value: Fraction) -> Literal:
    whole = value.denominator == 1
    return Literal(int(value), Type.INT) if whole else Literal(value, Type.DOUBLE)


def _in_units(expression: Expression, clocks: frozenset[str], unit: Fraction) -> Expression:
    """The expression with clocks that count units."""
    if unit == 1:
        return expression

    def convert(node: Tree) -> Tree:
        if not isinstance(node, Binary) or not node.operator.is_comparison:
            return node
        found = constraint(node, clocks)
        if found is None:
            return node
        left: Expression = Name(found.clock)
        if found.other is not None:
            left = Binary(Operator.MINUS, left, Name(found.other))
        if isinstance(found.bound, Literal):
            bound: Expression = _number(Fraction(found.bound.value) / unit)
        else:
            left, bound = Binary(Operator.TIMES, _number(unit), left), found.bound
        return Binary(found.operator, left, bound, span=node.span)

    return transform(expression, convert)


def _in_time(value: Expression, unit: Fraction) -> Expression:
    """The value of a reset in units."""
    if isinstance(value, Literal):
        return _number(Fraction(value.value) / unit)
    if unit == 1:
        return value
    return Call(Function.FLOOR, (Binary(Operator.DIVIDE, value, _number(unit)),), span=value.span)


def _after(counter: Variable, ceilings: Mapping[str, tuple[Expression, ...]]) -> Expression:
    assert counter.high is not None
    following = Binary(Operator.PLUS, Name(counter.name), Literal(1, Type.INT))
    highest = ceilings.get(counter.name, (Literal(counter.high, Type.INT),))
    return Call(Function.MIN, (following, *highest))


def _rates(items: Iterable[BoundReward], time: str, unit: Expression) -> Iterator[BoundReward]:
    """Rewards of states, which are earned per unit of time, as rewards of the steps of time."""
    for item in items:
        if item.on_states:
            value = simplify(Binary(Operator.TIMES, item.value, unit))
            yield replace(item, on_states=False, action=time, value=value)
        else:
            yield item
