"""Symmetries of a model: components that may be exchanged without changing what a property sees.

A permutation of the variables is a symmetry if it maps the commands, the initial states, the
rewards and the observed expressions to themselves; it may rename actions. States that a symmetry
maps to each other then have the same value, so that one state of each orbit is enough (Kwiatkowska,
Norman, Parker: Symmetry reduction for probabilistic model checking. CAV 2006).

Candidates are permutations of modules of the same shape, as module renaming makes them: all
permutations of interchangeable modules, or the rotations of a ring. Each generator is verified on
normal forms of the expressions, in which the order of operands does not matter. Observed
expressions whose normal forms differ, such as `a=b & b=c` and `b=a & a=c`, are compared on all
valuations.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import reduce as fold
from math import factorial

import numpy as np

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.vectorised import evaluate_columns, open_mesh
from symcheck.semantics.features import Feature, offers
from symcheck.semantics.model import (
    BoundCommand,
    BoundModel,
    BoundReward,
    BoundUpdate,
    Event,
    Observations,
    Variable,
)
from symcheck.semantics.reduction import tuning
from symcheck.syntax.ast import Binary, Call, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.traversal import Tree, children, names, nodes, substitute

__all__ = ["Symmetry", "find_symmetries", "observed_symmetries"]

_COMMUTATIVE = {Operator.EQ, Operator.NE, Operator.IFF}
_UNORDERED_FUNCTIONS = {Function.MIN, Function.MAX}


@dataclass(frozen=True, slots=True)
class Symmetry:
    """Components of a model whose permutations are symmetries.

    Attributes:
        components: the variables (indices) of each component; variables at the same position
            correspond.
        is_ring: whether the permutations are the rotations, in the order of the components;
            otherwise they are all permutations.
        names: the modules of each component.
    """

    components: tuple[tuple[int, ...], ...]
    is_ring: bool
    names: tuple[str, ...]

    @property
    def order(self) -> int:
        """The number of permutations."""
        n = len(self.components)
        return n if self.is_ring else factorial(n)

    def __str__(self) -> str:
        first, *middle, last = self.names
        shown = f"{first}, …, {last}" if len(middle) > 1 else ", ".join(self.names)
        return f"{'the rotations' if self.is_ring else 'all permutations'} of {shown}"


def observed_symmetries(model: BoundModel) -> tuple[Symmetry, ...]:
    """The symmetries that what is asked of a model does not see; none if all may be asked."""
    observations = model.observations
    if observations is None or not offers(model, Feature.SYMMETRY):
        return ()
    return find_symmetries(model, observations)


def find_symmetries(model: BoundModel, observed: Observations) -> tuple[Symmetry, ...]:
    """Symmetries of a model that observations do not see, on disjoint sets of variables.

    Args:
        model: the model.
        observed: what the properties read.

    Returns:
        None or several; the permutations of each may be combined with those of the others.
    """
    if _size(model) > tuning.MAX_SYMMETRY_NODES:
        return ()
    verifier = _Verifier(model, observed)
    shapes: dict[Hashable, list[int]] = {}
    for number, module in enumerate(model.modules):
        if module.variables:
            shape = (*(_shape(model.variables[v]) for v in module.variables), len(module.commands))
            shapes.setdefault(shape, []).append(number)
    classes = [c for c in shapes.values() if 2 <= len(c) <= tuning.MAX_RING_COMPONENTS]
    result: list[Symmetry] = []
    rest: dict[int, list[list[int]]] = {}
    for modules in classes:
        symmetries = _of_components(model, verifier, [(m,) for m in modules])
        result += symmetries
        if not symmetries:
            rest.setdefault(len(modules), []).append(modules)
    for together in rest.values():  # a component may have several modules
        if len(together) > 1:
            result += _of_components(model, verifier, list(zip(*together, strict=True)))
    return tuple(result)


def _size(model: BoundModel) -> int:
    """Number of nodes of all expressions of the commands, counted up to the limit."""
    count = 0
    for module in model.modules:
        for command in module.commands:
            for part in _expressions(command):
                count += sum(1 for _ in nodes(part))
                if count > tuning.MAX_SYMMETRY_NODES:
                    return count
    return count


def _expressions(command: BoundCommand) -> Iterable[Expression]:
    yield command.guard
    for update in command.updates:
        yield update.probability
        yield from (value for _, value in update.assignments)


def _shape(variable: Variable) -> Hashable:
    return variable.type, variable.low, variable.high, variable.initial


def _of_components(
    model: BoundModel, verifier: _Verifier, components: Sequence[tuple[int, ...]]
) -> list[Symmetry]:
    """The symmetries among components, each of which consists of modules."""
    groups: list[list[tuple[int, ...]]] = []
    few = len(components) <= tuning.MAX_SYMMETRY_COMPONENTS
    for component in components if few else ():
        for group in groups:
            exchanged = [*zip(group[0], component, strict=True)]
            if verifier.accepts(dict(exchanged) | {b: a for a, b in exchanged}):
                group.append(component)
                break
        else:
            groups.append([component])
    result = [_symmetry(model, g, is_ring=False) for g in groups if len(g) > 1]
    if not result and len(components) > 2:
        following = [*components[1:], components[0]]
        rotation = {
            a: b
            for component, successor in zip(components, following, strict=True)
            for a, b in zip(component, successor, strict=True)
        }
        if verifier.accepts(rotation):
            result.append(_symmetry(model, components, is_ring=True))
    return result


def _symmetry(
    model: BoundModel, components: Sequence[tuple[int, ...]], *, is_ring: bool
) -> Symmetry:
    return Symmetry(
        tuple(tuple(v for m in c for v in model.modules[m].variables) for c in components),
        is_ring,
        tuple("+".join(model.modules[m].name for m in c) for c in components),
    )


class _Verifier:
    """Decides whether a permutation of modules is a symmetry."""

    def __init__(self, model: BoundModel, observed: Observations) -> None:
        self.model = model
        self.observed = observed
        self.forms = _NormalForms(model.variables)
        commands = {id(c): c for e in model.events for p in e.participants for c in p}
        self.keys = {i: self._command(c, {}, ()) for i, c in commands.items()}
        self.known_keys = set(self.keys.values())
        self.touching: dict[int, list[BoundCommand]] = {}  # by variable
        for command in commands.values():
            for variable in self._touched(command):
                self.touching.setdefault(variable, []).append(command)
        self.events = [self._event(e, self.keys, {}) for e in model.events]
        self.events_of: dict[int, list[int]] = {}  # by id of a command
        for number, event in enumerate(model.events):
            for i in {id(c) for p in event.participants for c in p}:
                self.events_of.setdefault(i, []).append(number)
        self.rewards = [Counter(self._rewards(r.items, {}, {})) for r in model.rewards]

    def accepts(self, permutation: Mapping[int, int]) -> bool:
        """Whether the permutation (module number to module number) is a symmetry."""
        actions = self._actions(permutation)
        if actions is None:
            return False
        model = self.model
        variables = {
            v: w
            for a, b in permutation.items()
            for v, w in zip(model.modules[a].variables, model.modules[b].variables, strict=True)
        }
        renaming: dict[str, Expression] = {
            model.variables[v].name: Name(model.variables[w].name) for v, w in variables.items()
        }
        order = [variables.get(v, v) for v in range(len(model.variables))]
        moved = {id(c): c for v in variables for c in self.touching.get(v, ())}
        keys = dict(self.keys)
        for i, command in moved.items():
            keys[i] = self._command(command, renaming, order)
            if keys[i] not in self.known_keys:
                return False
        return (
            self._keeps_events(moved, keys, actions)
            and self._keeps_rewards(renaming, actions)
            and all(self._keeps(e, renaming) for e in self._conditions())
        )

    def _keeps_events(
        self, moved: Iterable[int], keys: Mapping[int, Hashable], actions: Mapping[str, str]
    ) -> bool:
        """Whether the events with moved commands or actions are the same ones in another order."""
        numbers = {n for i in moved for n in self.events_of[i]}
        numbers.update(n for n, e in enumerate(self.model.events) if e.action in actions)
        left = Counter(self.events[n] for n in numbers)
        for n in numbers:
            key = self._event(self.model.events[n], keys, actions)
            if not left[key]:
                return False
            left[key] -= 1
        return True

    def _conditions(self) -> Iterable[Expression]:
        if self.model.initial is not None:
            yield self.model.initial
        yield from self.observed.expressions

    def _actions(self, permutation: Mapping[int, int]) -> dict[str, str] | None:
        """The renaming of actions that a permutation of modules implies; None: there is none."""
        renaming: dict[str, str] = {}
        for a, b in permutation.items():
            pairs = zip(self.model.modules[a].commands, self.model.modules[b].commands, strict=True)
            for one, other in pairs:
                if (one.action is None) != (other.action is None):
                    return None
                if one.action is not None and other.action is not None:
                    if renaming.setdefault(one.action, other.action) != other.action:
                        return None
        return renaming if set(renaming) == set(renaming.values()) else None

    def _touched(self, command: BoundCommand) -> set[int]:
        """The variables that a command reads or assigns."""
        assigned = {i for u in command.updates for i, _ in u.assignments}
        read = {name for e in _expressions(command) for name in self.forms.support(e)}
        return assigned | {v for v, w in enumerate(self.model.variables) if w.name in read}

    def _command(
        self, command: BoundCommand, renaming: Mapping[str, Expression], order: Sequence[int]
    ) -> Hashable:
        def update(u: BoundUpdate) -> Hashable:
            values = sorted(
                (order[i] if order else i, self.forms.of(e, renaming)) for i, e in u.assignments
            )
            return self.forms.of(u.probability, renaming), tuple(values)

        updates = Counter(map(update, command.updates))
        return self.forms.of(command.guard, renaming), frozenset(updates.items())

    def _event(
        self, event: Event, keys: Mapping[int, Hashable], actions: Mapping[str, str]
    ) -> Hashable:
        """A key in which the order of participants and commands does not matter."""
        participants = Counter(
            frozenset(Counter(keys[id(c)] for c in p).items()) for p in event.participants
        )
        action = event.action
        return (
            action if action is None else actions.get(action, action),
            frozenset(participants.items()),
        )

    def _rewards(
        self,
        items: Sequence[BoundReward],
        renaming: Mapping[str, Expression],
        actions: Mapping[str, str],
    ) -> Iterable[Hashable]:
        for item in items:
            action = item.action if item.action is None else actions.get(item.action, item.action)
            guard, value = (self.forms.of(e, renaming) for e in (item.guard, item.value))
            yield item.on_states, action, guard, value

    def _keeps_rewards(
        self, renaming: Mapping[str, Expression], actions: Mapping[str, str]
    ) -> bool:
        return not self.observed.rewards or all(
            Counter(self._rewards(structure.items, renaming, actions)) == keys
            for structure, keys in zip(self.model.rewards, self.rewards, strict=True)
        )

    def _keeps(self, expression: Expression, renaming: Mapping[str, Expression]) -> bool:
        forms = self.forms
        return forms.are_equal(forms.of(expression, {}), forms.of(expression, renaming))


class _NormalForms:
    """Numbers of expressions: two expressions with the same number have the same value.

    Sums and products of doubles keep their order, because the rounding depends on it.
    """

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.variables = {v.name: v for v in variables}
        self.numbers: dict[Hashable, int] = {}
        self.forms: list[tuple[Hashable, tuple[int, ...]]] = []  # by number: kind, operands
        self.expressions: list[Expression] = []  # by number: an expression of that form
        self.doubles: set[int] = set()  # those whose values may be doubles
        self.supports: dict[int, set[str]] = {}
        self.known: dict[int, tuple[Expression, int]] = {}  # by id; the expression stays alive

    def support(self, expression: Expression) -> set[str]:
        """The names of the variables that an expression reads."""
        number = self.of(expression, {})
        if number not in self.supports:
            self.supports[number] = names(expression)
        return self.supports[number]

    def of(self, expression: Expression, renaming: Mapping[str, Expression]) -> int:
        """The number of an expression after a renaming of variables."""
        if renaming:
            expression = substitute(expression, renaming)
        elif id(expression) in self.known:
            return self.known[id(expression)][1]
        numbers: dict[int, int] = {}
        for node in reversed(list(nodes(expression))):
            numbers[id(node)] = self._number(node, [numbers[id(c)] for c in children(node)])
        if not renaming:
            self.known[id(expression)] = expression, numbers[id(expression)]
        return numbers[id(expression)]

    def _number(self, node: Tree, below: list[int]) -> int:
        kind: Hashable
        match node:
            case Binary(operator) if operator.is_associative and not self._may_round(node, below):
                kind = operator
                below = sorted(
                    part
                    for b in below
                    for part in (self.forms[b][1] if self.forms[b][0] is operator else (b,))
                )
            case Binary(operator) if operator in _COMMUTATIVE or operator.is_associative:
                kind, below = operator, sorted(below)
            case Binary(operator) if operator.is_lower_bound:
                kind, below = operator.mirrored, below[::-1]
            case Binary(operator) | Unary(operator):
                kind = (type(node).__name__, operator)
            case Call(function):
                kind = function
                below = sorted(below) if function in _UNORDERED_FUNCTIONS else below
            case Name(name):
                kind = ("name", name)
            case Literal(value, type_):
                kind = ("literal", type_, value)
            case _:
                kind = type(node).__name__
        key = (kind, tuple(below))
        if key not in self.numbers:
            assert isinstance(node, Expression)
            if self._is_double(node, below):
                self.doubles.add(len(self.forms))
            self.numbers[key] = len(self.forms)
            self.forms.append(key)
            self.expressions.append(node)
        return self.numbers[key]

    def _is_double(self, node: Tree, below: Sequence[int]) -> bool:
        match node:
            case Literal(_, type_):
                return type_ is Type.DOUBLE
            case Binary(operator) if operator.is_boolean:
                return False
            case Binary(operator) if operator is Operator.DIVIDE:
                return True
            case Call(function) if function not in _UNORDERED_FUNCTIONS:
                return True
        return any(b in self.doubles for b in below)

    def _may_round(self, node: Binary, below: Sequence[int]) -> bool:
        """Whether the order of the operands of a sum or product may matter."""
        return not node.operator.is_logical and any(b in self.doubles for b in below)

    def are_equal(self, a: int, b: int) -> bool:
        """Whether two forms have the same values; False also if that takes too long to decide."""
        if a == b:
            return True
        (kind, below), (other_kind, others) = self.forms[a], self.forms[b]
        if kind == other_kind and len(below) == len(others):
            if isinstance(kind, Operator) and kind.is_associative:
                one, other = Counter(below), Counter(others)
                ones, rest = [*(one - other).elements()], [*(other - one).elements()]
                if len(ones) == 1 and self.are_equal(ones[0], rest[0]):
                    return True
                near = [*((one & other).elements())]
                shared = self._sharing(near, [*ones, *rest])
                return self._have_equal_tables(
                    self._joined(kind, ones + shared), self._joined(kind, rest + shared)
                )
            if all(map(self.are_equal, below, others)):
                return True
        return self._have_equal_tables(self.expressions[a], self.expressions[b])

    def _sharing(self, numbers: Sequence[int], others: Sequence[int]) -> list[int]:
        """Those of some forms that read a variable of the others, or of each other."""
        read = set().union(*(names(self.expressions[n]) for n in others))
        support = {n: names(self.expressions[n]) for n in numbers}
        known = -1
        while known != len(read):
            known = len(read)
            read = read.union(*(s for s in support.values() if not read.isdisjoint(s)))
        return [n for n in numbers if not read.isdisjoint(support[n])]

    def _joined(self, operator: Operator, numbers: Sequence[int]) -> Expression:
        parts = (self.expressions[n] for n in numbers)
        return fold(lambda x, y: Binary(operator, x, y), parts)

    def _have_equal_tables(self, a: Expression, b: Expression) -> bool:
        read = sorted(names(a) | names(b))
        if any(n not in self.variables for n in read):
            return False
        domains = {n: self.variables[n].domain for n in read}
        mesh = open_mesh(domains, tuning.MAX_SYMMETRY_VALUATIONS)
        if mesh is None:
            return False
        columns, shape = mesh
        one, other = (evaluate_columns(e, columns).spread(shape) for e in (a, b))
        return bool(np.array_equal(one.numbers(), other.numbers(), equal_nan=True))
