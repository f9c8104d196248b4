"""Write models and properties in the JANI format, version 1.

Each module is an automaton with one location, each event a synchronisation vector. Labels and
reward structures are transient variables. Constants have their values. Invariants of timed automata
are conditions of locations.

Source: C. E. Budde, C. Dehnert, E. M. Hahn, A. Hartmanns, S. Junges, A. Turrini: JANI: quantitative
model and tool interaction. TACAS 2017; https://jani-spec.org.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial, reduce

from symcheck.direction import Direction
from symcheck.errors import Diagnostic, UnsupportedError
from symcheck.semantics.binding.bind import BoundProperty
from symcheck.semantics.expressions.literals import LARGEST_WHOLE
from symcheck.semantics.features import Feature, require
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, BoundUpdate, Event
from symcheck.semantics.query import (
    CumulativeReward,
    InstantaneousReward,
    LongRunReward,
    ReachReward,
    TotalReward,
    direction_of,
    query_of,
)
from symcheck.semantics.rewards import Reward, Structure, Time, bounded_reward
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    Call,
    Conditional,
    Eventually,
    ExpectedTime,
    Filter,
    Globally,
    LabelReference,
    Limits,
    Literal,
    Name,
    Next,
    PathBound,
    PathFormula,
    PathQuantifier,
    ProbabilityOperator,
    Release,
    RewardBound,
    RewardBounds,
    RewardOperator,
    SteadyState,
    TimeBound,
    Type,
    Unary,
    Until,
    WeakUntil,
)
from symcheck.syntax.jani.expressions import is_boolean, is_literal
from symcheck.syntax.jani.network import UniqueNames
from symcheck.syntax.jani.properties import FILTERS
from symcheck.syntax.operators import Function, Operator, UnaryOperator
from symcheck.syntax.printer import pretty

__all__ = ["LeftOut", "jani_text"]

LeftOut = Callable[[BoundProperty, Diagnostic], object]

Value = bool | int | float | str | Sequence["Value"] | Mapping[str, "Value"] | None
Object = dict[str, Value]

_FILTERS = {name: text for text, name in FILTERS.items()} | {"printall": "values"}
_LOCATION = "l"
_INITIAL: Object = {"op": "initial"}


def jani_text(
    model: BoundModel,
    properties: Sequence[BoundProperty] = (),
    left_out: LeftOut | None = None,
) -> Iterator[str]:
    """The text of a JANI file, in one chunk.

    Args:
        model: a model with commands.
        properties: those that the file holds.
        left_out: is told of each property that JANI has nothing for, and why.

    Raises:
        UnsupportedError: the model has no commands, or JANI has nothing for a property and
            `left_out` is None.
    """
    require(model, Feature.JANI_FILES)
    if model.builder is not None:
        raise UnsupportedError(
            "a model without commands cannot be written as JANI: formats for lists of states are "
            ".tra, .drn and .umb"
        )
    root = _Writer(model).root(properties, left_out)
    yield json.dumps(root, ensure_ascii=False, indent=1) + "\n"


@dataclass
class _Edges:
    """The edges of an automaton.

    rewards: the transition rewards that the edges assign, by the name of the structure.
    """

    module: int
    commands: Sequence[BoundCommand]
    action: str | None
    rewards: dict[str, list[Value]] = field(default_factory=dict)


class _Writer:
    def __init__(self, model: BoundModel) -> None:
        self.model = model
        self.variables = model.variables
        self.names = UniqueNames()
        for v in model.variables:
            self.names.take(v.name)
        self.labels = {name: self.names.take(name) for name in model.labels}
        self.types = {v.name: v.type for v in model.variables}
        self.rewards = [self.names.take(r.name or "reward") for r in model.rewards]
        self.is_timed = model.type.continuous_time or model.type.has_clocks

    def root(self, properties: Sequence[BoundProperty], left_out: LeftOut | None) -> Object:
        """The whole file."""
        model = self.model
        parts, vectors = self._composition()
        for part in parts:
            part.rewards = {}
        self._add_transition_rewards(parts, vectors)
        actions = dict.fromkeys(
            a for a in (*(p.action for p in parts), *(e.action for e, _ in vectors)) if a
        )
        root: Object = {
            "jani-version": 1,
            "name": "model",
            "type": model.type.value,
            "features": ["derived-operators"],
            "actions": [{"name": a} for a in actions],
            "constants": [],
            "variables": [*self._state_variables(), *self._transient_variables()],
            "automata": [self._automaton(k, parts) for k in range(len(model.modules))],
            "system": {
                "elements": [{"automaton": m.name} for m in model.modules],
                "syncs": [self._vector(event, taking) for event, taking in vectors],
            },
        }
        if model.initial is not None:
            root["restrict-initial"] = {"exp": self.expression(model.initial)}
        written: list[Object] = []
        for i, p in enumerate(properties, 1):
            try:
                written.append({"name": p.name or f"property{i}", "expression": self.query(p)})
            except _NotInJani as error:
                if left_out is None:
                    raise UnsupportedError(str(error.diagnostic)) from None
                left_out(p, error.diagnostic)
        root["properties"] = written
        return root

    # ---------------------------------------------------------------------------------- variables

    def _state_variables(self) -> Iterator[Object]:
        for v in self.variables:
            kind: Value = "bool" if v.type is Type.BOOL else "int"
            if v.type is Type.INT and v.low is not None and v.high is not None:
                kind = {
                    "kind": "bounded",
                    "base": "int",
                    "lower-bound": v.low,
                    "upper-bound": v.high,
                }
            if v.clock:
                kind = "clock"
            start: Object = {} if v.initial is None else {"initial-value": v.initial}
            yield {"name": v.name, "type": kind, **start}

    def _transient_variables(self) -> Iterator[Object]:
        for name in self.labels.values():
            yield {"name": name, "type": "bool", "initial-value": False, "transient": True}
        for name in self.rewards:
            yield {"name": name, "type": "real", "initial-value": 0, "transient": True}

    # -------------------------------------------------------------------------------- composition

    def _composition(self) -> tuple[list[_Edges], list[tuple[Event, list[_Edges]]]]:
        """The edges of the automata, and the synchronisation vectors with their participants."""
        count: dict[tuple[int, tuple[BoundCommand, ...]], int] = {}
        for event in self.model.events:
            for commands in event.participants:
                key = commands[0].module, commands
                count[key] = count.get(key, 0) + 1
        parts: list[_Edges] = []
        vectors: list[tuple[Event, list[_Edges]]] = []
        for event in self.model.events:
            taking = []
            for commands in event.participants:
                module, action = commands[0].module, commands[0].action
                if action is not None and count[module, commands] > 1:
                    # The edges of each event have an action of their own.
                    action = self.names.take(f"{action}_")
                elif action is None and (len(event.participants) > 1 or event.action is not None):
                    action = self.names.take("silent")
                taking.append(_Edges(module, commands, action))
            parts += taking
            if any(p.action is not None for p in taking):
                vectors.append((event, taking))
        return parts, vectors

    def _vector(self, event: Event, taking: Sequence[_Edges]) -> Object:
        actions: list[Value] = [None] * len(self.model.modules)
        for part in taking:
            actions[part.module] = part.action
        result: Object = {} if event.action is None else {"result": event.action}
        return {"synchronise": actions, **result}

    def _automaton(self, number: int, parts: Sequence[_Edges]) -> Object:
        location: Object = {"name": _LOCATION}
        invariant = self.model.modules[number].invariant
        if invariant is not None:
            location["time-progress"] = {"exp": self.expression(invariant)}
        if number == 0:
            location["transient-values"] = [
                *(
                    {"ref": self.labels[n], "value": self.expression(e)}
                    for n, e in self.model.labels.items()
                ),
                *self._state_rewards(),
            ]
        return {
            "name": self.model.modules[number].name,
            "locations": [location],
            "initial-locations": [_LOCATION],
            "edges": [e for p in parts if p.module == number for e in self._edges(p)],
        }

    def _edges(self, part: _Edges) -> Iterator[Object]:
        rewards = [{"ref": n, "value": _total(values)} for n, values in part.rewards.items()]
        for command in part.commands:
            edge: Object = {"location": _LOCATION}
            if part.action is not None:
                edge["action"] = part.action
            edge["guard"] = {"exp": self.expression(command.guard)}
            if self.model.type.continuous_time:
                # The branches of a command race: each is an edge with its rate.
                for update in command.updates:
                    rate: Object = {"exp": self.expression(update.probability)}
                    yield {**edge, "rate": rate, "destinations": [self._branch(update, rewards)]}
                continue
            branches = []
            for update in command.updates:
                branch = self._branch(update, rewards)
                if not is_literal(update.probability, 1):
                    branch["probability"] = {"exp": self.expression(update.probability)}
                branches.append(branch)
            yield {**edge, "destinations": branches}

    def _branch(self, update: BoundUpdate, rewards: Sequence[Object]) -> Object:
        assignments: list[Value] = [
            {"ref": self.variables[i].name, "value": self.expression(e)}
            for i, e in update.assignments
        ]
        return {"location": _LOCATION, "assignments": [*assignments, *rewards]}

    # ------------------------------------------------------------------------------------ rewards

    def _state_rewards(self) -> Iterator[Object]:
        for name, structure in zip(self.rewards, self.model.rewards, strict=True):
            values = [self._reward(item) for item in structure.items if item.on_states]
            if values:
                yield {"ref": name, "value": _total(values)}

    def _add_transition_rewards(
        self, parts: Sequence[_Edges], vectors: Sequence[tuple[Event, list[_Edges]]]
    ) -> None:
        """The first participant of an event assigns its rewards."""
        firsts = [(event.action, taking[0]) for event, taking in vectors]
        firsts += [(None, part) for part in parts if part.action is None]
        for name, structure in zip(self.rewards, self.model.rewards, strict=True):
            for item in structure.items:
                for action, part in firsts:
                    if not item.on_states and item.action == action:
                        part.rewards.setdefault(name, []).append(self._reward(item))

    def _reward(self, item: BoundReward) -> Value:
        value = self.expression(item.value)
        if is_literal(item.guard, True):
            return value
        return {"op": "ite", "if": self.expression(item.guard), "then": value, "else": 0}

    # -------------------------------------------------------------------------------- expressions

    def expression(self, node: PathFormula) -> Value:
        """An expression or formula. Raises _NotInJani."""
        match node:
            case Literal(value):
                return _number(value) if isinstance(value, Fraction) else value
            case Name(name):
                return name
            case LabelReference(name):
                if name in ("init", "deadlock"):
                    return {"op": "initial" if name == "init" else "deadlock"}
                if name not in self.labels:
                    raise _NotInJani(node)
                return self.labels[name]
            case Unary(UnaryOperator.NOT, operand):
                return {"op": "¬", "exp": self.expression(operand)}
            case Unary(UnaryOperator.MINUS, operand):
                return _binary("-", 0, self.expression(operand))
            case Binary(Operator(jani=str(name)), left, right):
                return _binary(name, self.expression(left), self.expression(right))
            case Conditional(condition, then, otherwise):
                return {
                    "op": "ite",
                    "if": self.expression(condition),
                    "then": self.expression(then),
                    "else": self.expression(otherwise),
                }
            case Call(Function.ROUND, (operand,)):
                half = _binary("+", self.expression(operand), 0.5)
                return {"op": "floor", "exp": half}
            case Call(Function(jani=str(name), arity=1), (operand,)):
                return {"op": name, "exp": self.expression(operand)}
            case Call(Function(jani=str(name), arity=2 | None), operands):
                return reduce(partial(_binary, name), map(self.expression, operands))
            case _:
                return self._formula(node)

    # --------------------------------------------------------------------------------- properties

    def query(self, bound: BoundProperty) -> Value:
        """A property; one that is no filter is asked for in the initial states."""
        formula = bound.formula
        if isinstance(formula, Filter):
            return self.expression(formula)
        return _filter("values", self.expression(formula), _INITIAL)

    def _formula(self, node: PathFormula) -> Value:
        match node:
            case Filter("state", formula, states) if states is not None:
                # One state satisfies the condition.
                function = "∀" if is_boolean(formula, self.types) else "min"
                return _filter(function, self.expression(formula), self.expression(states))
            case Filter(operator, formula, states) if operator in _FILTERS:
                where = True if states is None else self.expression(states)
                return _filter(_FILTERS[operator], self.expression(formula), where)
            case PathQuantifier(quantifier, path):
                return {"op": "∀" if quantifier == "A" else "∃", "exp": self.expression(path)}
            case ProbabilityOperator(path=path):
                return self._compared(node, "P", {"exp": self.expression(path)})
            case SteadyState(formula=formula):
                return self._compared(node, "S", {"exp": self.expression(formula)})
            case ExpectedTime() | RewardOperator():
                return self._expected(node)
            case Next(operand, None):
                once: Object = {"step-bounds": {"lower": 1, "upper": 1}}
                return {**_binary("U", True, self.expression(operand)), **once}
            case Eventually(operand) | Globally(operand):
                one: Object = {"op": node.symbol, "exp": self.expression(operand)}
                return {**one, **self._bounds(node, node.bound)}
            case Until(left, right) | WeakUntil(left, right) | Release(left, right):
                both = _binary(node.symbol, self.expression(left), self.expression(right))
                return {**both, **self._bounds(node, node.bound)}
            case _:
                raise _NotInJani(node)

    def _compared(self, node: AnyMeasure, letter: str, members: Object) -> Value:
        """The value of a measure, or its comparison with a bound."""
        # JANI has no other measures; in a chain, both directions are the same.
        direction = direction_of(node, self.model.type) or Direction.MAX
        value: Object = {"op": f"{letter}{direction}", **members}
        if node.bound is None:
            return value
        name = node.bound.operator.jani
        if name is None:
            raise _NotInJani(node)
        return _binary(name, value, self.expression(node.bound.threshold))

    @property
    def _kinds(self) -> list[Value]:
        return ["time", "steps"] if self.is_timed else ["exit", "steps"]

    @property
    def _instant(self) -> str:
        return "time-instant" if self.is_timed else "step-instant"

    def _expected(self, node: ExpectedTime | RewardOperator) -> Value:
        try:
            quantity = query_of(node, self.model).quantity
        except UnsupportedError:  # such as several costs
            raise _NotInJani(node) from None
        match quantity:
            case ReachReward(Time(), target):
                kind = "time" if self.is_timed else "steps"
                reach = self.expression(target)
                return self._compared(node, "E", {"exp": 1, "accumulate": [kind], "reach": reach})
            case ReachReward(reward, target):
                reach = self.expression(target)
                return self._compared(node, "E", {**self._gathered(reward), "reach": reach})
            case TotalReward(reward):
                return self._compared(node, "E", self._gathered(reward))
            case CumulativeReward(reward, Window(upper=Fraction() as time, upper_strict=False)):
                at: Object = {self._instant: self._time(time)}
                return self._compared(node, "E", {**self._gathered(reward), **at})
            case InstantaneousReward(Structure(index), time):
                members: Object = {"exp": self.rewards[index], self._instant: self._time(time)}
                return self._compared(node, "E", members)
            case LongRunReward(reward):
                return self._compared(node, "S", self._gathered(reward))
            case _:
                raise _NotInJani(node)

    def _gathered(self, reward: Reward) -> Object:
        """A structure, and when its reward is earned."""
        assert isinstance(reward, Structure)
        return {"exp": self.rewards[reward.index], "accumulate": self._kinds}

    def _time(self, time: Fraction) -> Value:
        return int(time) if time.denominator == 1 else _number(time)

    def _bounds(self, node: PathFormula, limits: PathBound | None) -> Object:
        match limits:
            case None:
                return {}
            case TimeBound() as bound:
                kind = "time" if self.is_timed else "step"
                return {f"{kind}-bounds": self._interval(bound)}
            case RewardBound(structure=None) as bound:
                return {"step-bounds": self._interval(bound)}
            case RewardBound() as bound:
                return {"reward-bounds": [self._reward_bound(bound)]}
            case RewardBounds(parts):
                steps = [p for p in parts if p.structure is None]
                if len(steps) > 1:
                    raise _NotInJani(node)
                result: Object = {"step-bounds": self._interval(steps[0])} if steps else {}
                rest: list[Value] = [self._reward_bound(p) for p in parts if p not in steps]
                return {**result, "reward-bounds": rest}

    def _reward_bound(self, bound: RewardBound) -> Object:
        gathered = self._gathered(bounded_reward(bound, self.model))
        return {**gathered, "bounds": self._interval(bound)}

    def _interval(self, limits: Limits) -> Object:
        result: Object = {}
        for side, value, strict in (
            ("lower", limits.lower, limits.lower_strict),
            ("upper", limits.upper, limits.upper_strict),
        ):
            if value is not None:
                result[side] = self.expression(value)
                if strict:
                    result[f"{side}-exclusive"] = True
        return result


class _NotInJani(Exception):
    """JANI has nothing for a part of a property."""

    def __init__(self, node: PathFormula | RewardBound) -> None:
        super().__init__(node)
        self.diagnostic = Diagnostic(
            f"JANI has nothing for {pretty(node)}",
            node.span,
            "jani",
            "JANI has P, S, expected times and rewards (F, C, C<=k, I=k, S), A, E and filters: "
            "leave this property out",
        )


def _binary(operator: str, left: Value, right: Value) -> Object:
    return {"op": operator, "left": left, "right": right}


def _filter(function: str, values: Value, states: Value) -> Object:
    return {"op": "filter", "fun": function, "values": values, "states": states}


def _total(values: Sequence[Value]) -> Value:
    return reduce(lambda a, b: _binary("+", a, b), values)


def _number(value: Fraction) -> Value:
    """A number whose digits are this fraction, or a quotient."""
    if value.denominator == 1 and abs(value) < LARGEST_WHOLE:
        return float(value)
    if Fraction(repr(float(value))) == value:
        return float(value)
    if max(abs(value.numerator), value.denominator) < LARGEST_WHOLE:
        return _binary("/", value.numerator, value.denominator)
    return float(value)
