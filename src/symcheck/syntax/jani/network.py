"""The automata of a JANI model, with names and expressions of the PRISM language."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import prod

from symcheck.errors import Span
from symcheck.syntax.ast import (
    WITHOUT_KEYWORD,
    Binary,
    Conditional,
    Expression,
    Literal,
    ModelType,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.declarations import Constant, VariableDeclaration
from symcheck.syntax.grammars import load
from symcheck.syntax.jani.expressions import (
    MOST_CELLS,
    ONE,
    TRUE,
    ZERO,
    Cells,
    ExpressionReader,
    FunctionDefinition,
    at_index,
    conjunction,
    is_literal,
    negation,
)
from symcheck.syntax.jani.json_tree import Json
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import names, substitute

__all__ = [
    "Branch",
    "Edge",
    "Element",
    "Network",
    "RawAssignment",
    "Transient",
    "UniqueNames",
    "assigned_values",
    "read_network",
    "whole_time",
]

_TYPES = {
    kind.value: kind for kind in ModelType if kind.players < 2 and not kind.partially_observed
} | {"lts": WITHOUT_KEYWORD, "ta": ModelType.PTA, "sta": ModelType.PTA}
_OTHER_TYPES = {
    "ctmdp": "continuous-time Markov decision processes",
    "ha": "hybrid automata",
    "pha": "probabilistic hybrid automata",
    "sha": "stochastic hybrid automata",
}


class UniqueNames:
    """Gives each thing of a model a name that the PRISM language accepts."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def take(self, proposal: str, *, given: bool = False) -> str:
        """The wanted name if it is free and valid, or else one that is close to it.

        A constant that is `given` a value by its name may be called as a word of the language.
        """
        name = re.sub(r"\W|[^\x00-\x7f]", "_", proposal)
        if not name or name[0].isdigit() or (load("prism").reserves(name) and not given):
            name = f"_{name}"
        free, number = name, 1
        while free in self._taken:
            number += 1
            free = f"{name}_{number}"
        self._taken.add(free)
        return free


@dataclass(frozen=True)
class Transient:
    """A transient variable: it has a value in each state and on each transition.

    Attributes:
        name: its name; a placeholder in expressions.
        identifier: its name in JANI.
        initial: its value where nothing assigns one.
    """

    name: str
    identifier: str
    type: Type
    initial: Expression


@dataclass(frozen=True, slots=True)
class RawAssignment:
    """An assignment to a variable or transient variable. Those of lower index come first."""

    index: int
    target: str
    value: Expression
    span: Span


@dataclass(frozen=True, slots=True)
class Branch:
    """A destination of an edge; probability None: 1."""

    probability: Expression | None
    assignments: tuple[RawAssignment, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge of an automaton. The location is part of the guard and of the assignments."""

    action: str | None
    guard: Expression
    rate: Expression | None
    branches: tuple[Branch, ...]
    node: Json


@dataclass(frozen=True)
class Element:
    """An automaton of the composition.

    Attributes:
        name: of the module.
        variables: the local variables, the one of the location first.
        locations: where the transient variables get values: a condition (true if there is one
            location) and the values.
        initial: a condition of initial states, if the initial values do not say it all.
        invariant: the states in which time may pass.
    """

    name: str
    variables: tuple[VariableDeclaration, ...]
    edges: tuple[Edge, ...]
    locations: tuple[tuple[Expression, Mapping[str, Expression]], ...]
    initial: Expression
    invariant: Expression


@dataclass(frozen=True)
class Network:
    """A model without its properties.

    Attributes:
        names, arrays: for expressions of properties, what each identifier stands for.
        vectors: the synchronisation vectors: an action or None for each element, and the result.
        initial: a condition of initial states, if the initial values do not say it all.
        unique: the names in use.
    """

    type: ModelType
    constants: tuple[Constant, ...]
    globals: tuple[VariableDeclaration, ...]
    transients: Mapping[str, Transient]
    functions: Mapping[str, FunctionDefinition]
    names: Mapping[str, Expression]
    elements: tuple[Element, ...]
    vectors: tuple[tuple[tuple[str | None, ...], str | None], ...]
    initial: Expression
    unique: UniqueNames = field(repr=False)
    arrays: Mapping[str, Cells] = field(default_factory=dict)

    @property
    def is_timed(self) -> bool:
        """Whether time passes in states."""
        return self.type.continuous_time or self.type.has_clocks

    @property
    def variables(self) -> dict[str, VariableDeclaration]:
        """The variables by name."""
        local = (v for e in self.elements for v in e.variables)
        return {v.name: v for v in (*self.globals, *local)}

    @property
    def types(self) -> dict[str, Type]:
        """The types of variables, constants and transient variables."""
        return {
            **{c.name: c.type for c in self.constants},
            **{v.name: v.type for v in self.variables.values()},
            **{t.name: t.type for t in self.transients.values()},
        }

    @cached_property
    def assigned(self) -> frozenset[str]:
        """The variables and transient variables that edges assign."""
        edges = (edge for element in self.elements for edge in element.edges)
        return frozenset(a.target for e in edges for b in e.branches for a in b.assignments)

    @cached_property
    def valued_in_states(self) -> frozenset[str]:
        """The transient variables that have values in locations."""
        locations = (values for element in self.elements for _, values in element.locations)
        return frozenset(name for values in locations for name in values)

    @cached_property
    def edges_only(self) -> frozenset[str]:
        """The transient variables that edges assign and no location gives a value.

        They have their initial value in every state; what they say is said on edges.
        """
        return (self.assigned & self.transients.keys()) - self.valued_in_states

    def in_states(self, expression: Expression) -> Expression:
        """An expression with the values that transient variables have in states."""
        return substitute(expression, self._state_values)

    @cached_property
    def _state_values(self) -> dict[str, Expression]:
        result: dict[str, Expression] = {}
        for name, transient in self.transients.items():
            value = transient.initial
            for element in self.elements:
                for condition, values in element.locations:
                    if name in values:
                        one = condition == TRUE
                        value = values[name] if one else Conditional(condition, values[name], value)
            result[name] = value
        return result


def whole_time(value: Expression | None) -> Expression | None:
    """The value of a clock, an int if it is a whole number."""
    match value:
        case Literal(Fraction() as number) if number.denominator == 1:
            return Literal(int(number), Type.INT, span=value.span)
        case _:
            return value


def assigned_values(
    assignments: Iterable[RawAssignment], transients: Mapping[str, Transient]
) -> tuple[dict[str, Expression], dict[str, Expression]]:
    """The values that assignments give to variables, and to transient variables.

    They are expressions over the state before. Assignments of an index see the values that those of
    lower indices have given.
    """
    start: dict[str, Expression] = {n: t.initial for n, t in transients.items()}
    values = dict(start)
    pending: dict[str, Expression] = {}
    last: int | None = None
    for assignment in sorted(assignments, key=lambda a: a.index):
        if assignment.index != last:
            values |= pending
            pending, last = {}, assignment.index
        pending[assignment.target] = substitute(assignment.value, values)
    values |= pending
    written = {n: v for n, v in values.items() if v is not start.get(n)}
    return (
        {n: v for n, v in written.items() if n not in transients},
        {n: v for n, v in written.items() if n in transients},
    )


# ------------------------------------------------------------------------------------------ reading

_SELECTED = "?"
"""Stands for the value of a selection."""
_MOST_DRAWS = 10_000
"""The most values of the random numbers of one destination."""

_MODEL = (
    "jani-version", "name", "metadata", "type", "features", "actions", "constants", "variables",
    "restrict-initial", "properties", "automata", "system", "functions", "datatypes",
)  # fmt: skip
_AUTOMATON = (
    "name", "variables", "restrict-initial", "locations", "initial-locations", "edges", "functions",
)  # fmt: skip
_VARIABLE = ("name", "type", "transient", "initial-value")
_LOCATION = ("name", "time-progress", "transient-values")
_EDGE = ("location", "action", "rate", "guard", "destinations", "assignments")
_DESTINATION = ("location", "probability", "assignments")
_ASSIGNMENT = ("ref", "value", "index")


def read_network(root: Json) -> Network:
    """Read a model. Raises SyntaxFault, UnsupportedError."""
    kind = root["type"]
    if kind.text in _OTHER_TYPES:
        raise kind.unsupported(
            f"{_OTHER_TYPES[kind.text]} are not supported: models are DTMCs, CTMCs, MDPs and MAs"
        )
    if kind.text not in _TYPES:
        raise kind.fault(f"'{kind.text}' is no model type", f"the types are {', '.join(_TYPES)}")
    if root["jani-version"].value != 1:
        raise root["jani-version"].unsupported("only version 1 of JANI is supported")
    return _NetworkReader(root, _TYPES[kind.text]).read()


class _NetworkReader:
    def __init__(self, root: Json, kind: ModelType) -> None:
        self.root = root
        self.kind = kind
        self.unique = UniqueNames()
        self.names: dict[str, Expression] = {}
        self.transients: dict[str, Transient] = {}
        self.functions: dict[str, FunctionDefinition] = {}
        self.arrays: dict[str, Cells] = {}
        self.all_arrays: dict[str, Cells] = {}
        self.limits: list[VariableDeclaration] = []
        self.constants: dict[str, Expression | None] = {}
        self.actions: set[str] = set()
        self.boolean: set[str] = set()

    def read(self) -> Network:
        root = self.root
        root.check_members(_MODEL)
        self.actions = {a["name"].text for a in root.each("actions")}
        constants = tuple(map(self._constant, root.each("constants")))
        variables = self._variables(root, self.names)
        self.functions = self._functions(root)
        shared = dict(self.arrays)
        automata = {a["name"].text: a for a in root["automata"].items}
        parts = self._elements(automata)
        elements = tuple(self._element(automata[name], enabled, shared) for name, enabled in parts)
        initial = self._restriction(root, self._reader(self.names))
        actions = {e.action for element in elements for e in element.edges}
        return Network(
            self.kind,
            constants,
            (*variables, *self.limits),
            self.transients,
            self.functions,
            self.names,
            elements,
            self._vectors(len(parts), actions),
            initial,
            self.unique,
            self.all_arrays,
        )

    def _reader(self, names: Mapping[str, Expression]) -> ExpressionReader:
        return ExpressionReader(names, self.functions, arrays=self.arrays)

    def _limit(self, what: str, count: Expression) -> None:
        """Refuse a constant above the most cells when it has a value: a range without values."""
        name = self.unique.take(f"{what}_up_to_{MOST_CELLS}")
        room = Binary(Operator.MINUS, Literal(MOST_CELLS, Type.INT), count, span=count.span)
        limit = VariableDeclaration(name, Type.INT, ZERO, room, ZERO, span=count.span)
        self.limits.append(limit)

    # ------------------------------------------------------------------------------ declarations

    def _constant(self, node: Json) -> Constant:
        identifier = node["name"].text
        kind, _, _ = self._type(node["type"], "a constant")
        value = node.get("value")
        expression = None if value is None else ExpressionReader(self.names).read(value)
        self._check_new(node["name"], self.names)
        name = self.unique.take(identifier, given=expression is None)
        self.names[identifier] = Name(name)
        self.constants[name] = expression
        return Constant(name, kind, expression, span=node["name"].span)

    def _check_new(self, node: Json, names: Mapping[str, Expression]) -> None:
        if node.text in names:
            raise node.fault(f"there is a variable or constant '{node.text}' already")

    def _type(self, node: Json, what: str) -> tuple[Type, Json | None, Json | None]:
        """A type, and the bounds of its values."""
        match node.value:
            case "bool":
                return Type.BOOL, None, None
            case "int":
                return Type.INT, None, None
            case "real":
                return Type.DOUBLE, None, None
            case "clock" if self.kind.has_clocks:
                return Type.INT, None, None
            case "clock":
                raise node.fault("only timed automata have clocks", 'their type is "pta"')
            case "continuous":
                raise node.unsupported("continuous variables are not supported")
            case str():
                raise node.fault(f"'{node.text}' is no type", "the types are bool, int, real")
            case _ if node["kind"].text == "bounded":
                base, _, _ = self._type(node["base"], what)
                return base, node.get("lower-bound"), node.get("upper-bound")
            case _:
                kind = node["kind"].text
                raise node.unsupported(
                    f"{what} of type '{kind}' is not supported: bool, int, real are"
                )

    def _variables(
        self, owner: Json, names: dict[str, Expression], prefix: str = ""
    ) -> tuple[VariableDeclaration, ...]:
        """Declare the variables of a model or an automaton in `names`."""
        result = []
        reader = self._reader(dict(self.names))
        for node in owner.each("variables"):
            kind_of = node["type"]
            if isinstance(kind_of.value, Mapping) and kind_of["kind"].text == "array":
                node.check_members(_VARIABLE)
                result += self._array(node, reader, names)
                continue
            node.check_members(_VARIABLE)
            identifier = node["name"].text
            self._check_new(node["name"], names)
            kind, low, high = self._type(node["type"], "a variable")
            initial = node.get("initial-value")
            value = None if initial is None else reader.read(initial)
            is_known = any(
                isinstance(n, Name) and n.name == identifier for n in self.names.values()
            )
            name = self.unique.take(f"{prefix}_{identifier}" if is_known else identifier)
            names[identifier] = Name(name)
            if node.flag("transient"):
                if value is None:
                    raise node.fault(
                        f"the transient variable '{identifier}' needs an initial value"
                    )
                self.transients[name] = Transient(name, identifier, kind, value)
                continue
            if kind is Type.DOUBLE:
                raise node["type"].unsupported(
                    f"the variable '{identifier}' is real: variables of states are bool or int"
                )
            if (low is None) != (high is None):
                raise node["type"].unsupported(
                    f"the variable '{identifier}' has one bound only",
                    "give both bounds, or none",
                )
            first, last = (None if b is None else reader.read(b) for b in (low, high))
            span = node["name"].span
            clock = node["type"].value == "clock"
            if clock:
                value = whole_time(value)
            result.append(VariableDeclaration(name, kind, first, last, value, clock, span=span))
        return tuple(result)

    def _array(
        self, node: Json, reader: ExpressionReader, names: Mapping[str, Expression]
    ) -> list[VariableDeclaration]:
        """Declare a variable for each cell of an array."""
        identifier, initial = node["name"].text, node.get("initial-value")
        self._check_new(node["name"], names)
        kind, low, high = self._type(node["type"]["base"], "a cell of an array")
        if initial is None or node.flag("transient") or kind is Type.DOUBLE:
            raise node["type"].unsupported(
                f"the array '{identifier}' is transient, of reals, or without an initial value"
            )
        first, last = (None if b is None else reader.read(b) for b in (low, high))
        start, span = reader.array(initial), node["name"].span
        default = first or (Literal(False, Type.BOOL) if kind is Type.BOOL else ZERO)
        cells = []
        for i, value in enumerate(start.cells):
            name = self.unique.take(f"{identifier}_{i}")
            if start.length is not None:
                value = Conditional(start.has(i), value, default)
            cells.append(VariableDeclaration(name, kind, first, last, value, span=span))
        if start.length is not None:
            self._limit(identifier, start.length)
        self.arrays[identifier] = Cells(tuple(Name(c.name) for c in cells), start.length)
        self.all_arrays.setdefault(identifier, self.arrays[identifier])
        return cells

    def _functions(self, owner: Json) -> dict[str, FunctionDefinition]:
        return {
            node["name"].text: FunctionDefinition(
                [p["name"].text for p in node.each("parameters")], node["body"]
            )
            for node in owner.each("functions")
        }

    def _restriction(self, owner: Json, reader: ExpressionReader) -> Expression:
        node = owner.get("restrict-initial")
        return TRUE if node is None else reader.read(node["exp"])

    # ------------------------------------------------------------------------------- composition

    def _elements(self, automata: Mapping[str, Json]) -> list[tuple[str, Sequence[Json]]]:
        """Per element its automaton, and the actions for which its input is always enabled."""
        system = self.root.get("system")
        if system is None:
            if len(automata) > 1:
                raise self.root.fault(
                    'this object needs a member "system", which composes the automata'
                )
            return [(name, ()) for name in automata]
        result = []
        for node in system["elements"].items:
            if node["automaton"].text not in automata:
                raise node["automaton"].fault(f"there is no automaton '{node['automaton'].text}'")
            result.append((node["automaton"].text, node.each("input-enable")))
        return result

    def _vectors(
        self, elements: int, actions: set[str | None]
    ) -> tuple[tuple[tuple[str | None, ...], str | None], ...]:
        system = self.root.get("system")
        if elements == 1 and (system is None or system.get("syncs") is None):
            return tuple(((a,), a) for a in sorted(a for a in actions if a is not None))
        if system is not None and system.get("syncs") is None and actions - {None}:
            raise system.fault('the composition needs "syncs", which say how actions synchronise')
        vectors = []
        for node in () if system is None else system.each("syncs"):
            parts = node["synchronise"].items
            if len(parts) != elements:
                raise node["synchronise"].fault(
                    f"this vector should have an entry for each of the {elements} automata"
                )
            taking_part = tuple(None if p.value is None else self._action(p) for p in parts)
            result = node.get("result")
            action = None if result is None else self._action(result)
            if any(p is not None for p in taking_part):
                vectors.append((taking_part, action))
        return tuple(vectors)

    def _action(self, node: Json) -> str:
        """The name of a declared action."""
        if node.text not in self.actions:
            known = ", ".join(sorted(self.actions)) or "there are none"
            raise node.fault(
                f"there is no action '{node.text}'", f'the model declares its "actions": {known}'
            )
        return node.text

    # ---------------------------------------------------------------------------------- automata

    def _element(
        self, node: Json, input_enable: Sequence[Json], shared: Mapping[str, Cells]
    ) -> Element:
        self.arrays = dict(shared)
        node.check_members(_AUTOMATON)
        module = self.unique.take(node["name"].text)
        names = dict(self.names)
        local: dict[str, Expression] = {}
        variables = self._variables(node, local, module)
        names |= local
        for identifier, name in local.items():
            self.names.setdefault(identifier, name)
        functions = {**self.functions, **self._functions(node)}
        reader = replace(self._reader(names), functions=functions)
        locations = [x["name"].text for x in node["locations"].items]
        starts = [self._location(x, locations) for x in node["initial-locations"].items]
        if not starts:
            raise node["initial-locations"].fault("an automaton needs an initial location")
        location_variable: Name | None = None
        if len(locations) > 1:
            location_variable = Name(self.unique.take(f"{module}_location"))
            first = Literal(starts[0], Type.INT) if len(starts) == 1 else None
            last = Literal(len(locations) - 1, Type.INT)
            span = node["locations"].span
            at = VariableDeclaration(location_variable.name, Type.INT, ZERO, last, first, span=span)
            variables = (at, *variables)
        initial = self._restriction(node, reader)
        if location_variable is not None and len(starts) > 1:
            initial = conjunction(_any(_at(location_variable, s) for s in starts), initial)
        edges = [
            self._edge(edge, location_variable, locations, selecting, condition)
            for edge in node["edges"].items
            for selecting, condition in self._selections(edge, reader)
        ]
        for action in input_enable:
            edges += self._input_edges(action, edges, node)
        invariant: Expression = TRUE
        for i, location in enumerate(node["locations"].items):
            if (condition := location.get("time-progress")) is not None:
                here = _at(location_variable, i)
                part = Binary(Operator.IMPLIES, here, reader.read(condition["exp"]))
                invariant = conjunction(invariant, part)
        return Element(
            module,
            variables,
            tuple(edges),
            tuple(
                (_at(location_variable, i), self._transient_values(x, reader))
                for i, x in enumerate(node["locations"].items)
            ),
            initial,
            invariant,
        )

    def _location(self, node: Json, locations: Sequence[str]) -> int:
        if node.text not in locations:
            raise node.fault(f"there is no location '{node.text}'")
        return locations.index(node.text)

    def _transient_values(self, location: Json, reader: ExpressionReader) -> dict[str, Expression]:
        location.check_members(_LOCATION)
        if location.get("time-progress") is not None and not self.kind.has_clocks:
            raise location["time-progress"].fault("only timed automata let time progress")
        result = {}
        for node in location.each("transient-values"):
            name = self._target(node["ref"], reader)
            if name not in self.transients:
                raise node["ref"].fault("a location gives values to transient variables only")
            result[name] = reader.read(node["value"])
        return result

    def _target(self, node: Json, reader: ExpressionReader) -> str:
        if not isinstance(node.value, str):
            raise node.unsupported("datatypes are not supported, and no arrays here")
        found = reader.read(node)
        if not isinstance(found, Name):
            raise node.fault("a variable is expected here")
        return found.name

    def _selections(
        self, edge: Json, reader: ExpressionReader
    ) -> Iterator[tuple[ExpressionReader, Expression]]:
        """A reader for each value that an edge may select, and when it may: an edge each."""
        found = [n for n in edge.nodes() if isinstance(n.value, Mapping) and "op" in n.value]
        found = [n for n in found if n["op"].value == "nondet"]
        if not found:
            yield reader, TRUE
            return
        variable, condition = found[0]["var"].text, found[0]["exp"]
        match reader.with_name(variable, Name(_SELECTED)).read(condition):
            case Binary(
                Operator.AND,
                Binary(Operator.LE, Literal(int() as first), Name("?")),
                Binary(Operator.LE, Name("?"), last),
            ) if len(found) == 1 and first >= 0:
                pass
            case _:
                raise found[0].unsupported("a selection has a range, from a number to a constant")
        if isinstance(last, Literal):
            most = int(last.value)
        else:
            most = MOST_CELLS
            self._limit(variable, last)
        for value in range(first, most + 1):
            at = Literal(value, Type.INT)
            yield replace(reader, selected=value), Binary(Operator.LE, at, last)

    def _edge(
        self,
        node: Json,
        location_variable: Name | None,
        locations: Sequence[str],
        reader: ExpressionReader,
        selected: Expression = TRUE,
    ) -> Edge:
        node.check_members(_EDGE)
        action, guard, rate = node.get("action"), node.get("guard"), node.get("rate")
        if rate is not None and not self.kind.continuous_time:
            raise rate.fault(f"edges of {self.kind.name}s have no rate")
        at = _at(location_variable, self._location(node["location"], locations))
        condition = selected if guard is None else conjunction(selected, reader.read(guard["exp"]))
        branches = []
        if not node["destinations"].items:
            raise node["destinations"].fault("an edge needs a destination")
        for destination in node["destinations"].items:
            destination.check_members(_DESTINATION)
            probability = destination.get("probability")
            given = None if probability is None else reader.read(probability["exp"])
            there = destination["location"]
            target = Literal(self._location(there, locations), Type.INT, span=there.span)
            for chance, drawn in self._draws((node, destination), reader):
                of_edge, own = (self._assignments(n, drawn) for n in (node, destination))
                assignments = [*of_edge, *own]
                if location_variable is not None:
                    assignments.append(RawAssignment(0, location_variable.name, target, there.span))
                weight = chance if given is None else _times(given, chance)
                branches.append(Branch(weight, tuple(assignments), destination.span))
                self._check_assigned_once(assignments, destination)
        return Edge(
            None if action is None else self._action(action),
            conjunction(at, condition),
            None if rate is None else reader.read(rate["exp"]),
            tuple(branches),
            node,
        )

    def _draws(
        self, owners: Sequence[Json], reader: ExpressionReader
    ) -> Iterator[tuple[Expression | None, ExpressionReader]]:
        """For all values of the random numbers in assignments their probability, None for 1, and a
        reader for which they have these values.
        """
        values = [a["value"] for owner in owners for a in owner.each("assignments")]
        found = [
            n
            for value in values
            for n in value.nodes()
            if isinstance(n.value, Mapping) and n.get("distribution") is not None
        ]
        outcomes = [self._outcomes(n, reader) for n in found]
        if prod(map(len, outcomes)) > _MOST_DRAWS:
            raise found[0].unsupported(f"random numbers have more than {_MOST_DRAWS:,} values here")
        for draw in product(*outcomes):
            chance: Expression | None = None
            for probability, _ in draw:
                chance = _times(chance, probability)
            drawn = {n.span: value for n, (_, value) in zip(found, draw, strict=True)}
            yield chance, replace(reader, drawn=drawn)

    def _outcomes(
        self, node: Json, reader: ExpressionReader
    ) -> Sequence[tuple[Expression, Expression]]:
        """The probabilities and values of a random number."""
        arguments = [reader.read(n) for n in node["args"].items]
        match node["distribution"].text, arguments:
            case "Bernoulli", [p] if names(p) <= self.constants.keys():
                return (p, ONE), (Binary(Operator.MINUS, ONE, p), ZERO)
            case "Bernoulli", [_]:
                raise node["args"].unsupported("the probability of Bernoulli reads no variable")
            case "DiscreteUniform", [first, last]:
                low, high = (self._whole(node["args"], e) for e in (first, last))
                if low > high:
                    raise node["args"].fault(f"there is no number from {low} to {high}")
                if high - low >= _MOST_DRAWS:
                    raise node.unsupported(f"more than {_MOST_DRAWS:,} random values are too many")
                each = Literal(Fraction(1, high - low + 1), Type.DOUBLE)
                return [(each, Literal(i, Type.INT)) for i in range(low, high + 1)]
            case "Bernoulli" | "DiscreteUniform", _:
                raise node["args"].fault("Bernoulli has 1 argument, DiscreteUniform has 2")
            case _:
                reader.read(node)  # tells that it is not supported
                raise AssertionError("a distribution that is read as a value")

    def _whole(self, node: Json, expression: Expression) -> int:
        """The value of an integer bound of a random number, of constants that the model defines."""
        match expression:
            case Literal(int() as value) if not isinstance(value, bool):
                return value
            case Name(name) if (given := self.constants.get(name)) is not None:
                return self._whole(node, given)
            case Unary(UnaryOperator.MINUS, operand):
                return -self._whole(node, operand)
            case Binary(Operator.PLUS, left, right):
                return self._whole(node, left) + self._whole(node, right)
            case Binary(Operator.MINUS, left, right):
                return self._whole(node, left) - self._whole(node, right)
            case Binary(Operator.TIMES, left, right):
                return self._whole(node, left) * self._whole(node, right)
            case _:
                pass
        raise node.unsupported(
            "a bound of DiscreteUniform is an integer, or made of constants to which the model "
            "gives values by +, - and *"
        )

    def _assignments(self, owner: Json, reader: ExpressionReader) -> list[RawAssignment]:
        result = []
        for node in owner.each("assignments"):
            node.check_members(_ASSIGNMENT)
            index = node.get("index")
            if index is not None and not isinstance(index.value, int):
                raise index.fault("the index of an assignment is an integer")
            at = index.value if index is not None and isinstance(index.value, int) else 0
            cells = self._assigned_cells(node, reader)
            if cells is None:
                cells = {self._target(node["ref"], reader): reader.read(node["value"])}
            result += [RawAssignment(at, name, value, node.span) for name, value in cells.items()]
        return result

    def _assigned_cells(self, node: Json, reader: ExpressionReader) -> dict[str, Expression] | None:
        """What an assignment to an array, or to one of its cells, gives to each cell; None: it is
        to another variable.
        """
        ref = node["ref"]
        if isinstance(ref.value, str):
            if ref.text not in reader.arrays or ref.text in reader.names:
                return None
            array, given = reader.arrays[ref.text], reader.array(node["value"])
            if len(array.cells) != len(given.cells):
                raise node["value"].unsupported("the lengths of the arrays are not the same")
            whens = [array.has(i) for i in range(len(array.cells))]
            values: Sequence[Expression] = given.cells
        elif ref["op"].text != "aa":
            return None
        else:
            array, index = reader.array(ref["exp"]), reader.read(ref["index"])
            whens = [at_index(index, i) for i in range(len(array.cells))]
            values = [reader.read(node["value"])] * len(array.cells)
            if isinstance(index, Literal):
                whens = [Literal(i == index.value, Type.BOOL) for i in range(len(array.cells))]
        return {
            cell.name: value if when == TRUE else Conditional(when, value, cell)
            for cell, value, when in zip(array.cells, values, whens, strict=True)
            if isinstance(cell, Name) and not is_literal(when, False)
        }

    def _check_assigned_once(self, assignments: Sequence[RawAssignment], node: Json) -> None:
        seen = set()
        for a in assignments:
            if (a.index, a.target) in seen:
                raise replace(node, span=a.span).fault(f"'{a.target}' is assigned twice at once")
            seen.add((a.index, a.target))

    def _input_edges(self, action: Json, edges: Sequence[Edge], node: Json) -> list[Edge]:
        """The edge that does nothing where no edge has the action."""
        guards = [e.guard for e in edges if e.action == action.text]
        guard = negation(_any(guards)) if guards else TRUE
        rate = None if self.kind.has_probabilities else ONE
        return [Edge(action.text, guard, rate, (Branch(None, (), node.span),), node)]


def _times(left: Expression | None, right: Expression | None) -> Expression | None:
    """The product of two probabilities, of which None is 1."""
    if left is None or right is None:
        return left or right
    return Binary(Operator.TIMES, left, right)


def _at(location_variable: Name | None, location: int) -> Expression:
    if location_variable is None:
        return TRUE
    return Binary(Operator.EQ, location_variable, Literal(location, Type.INT))


def _any(conditions: Iterable[Expression]) -> Expression:
    first, *rest = conditions
    for condition in rest:
        first = Binary(Operator.OR, first, condition)
    return first
