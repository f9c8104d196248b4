"""The composition of automata as modules of the PRISM language.

Each synchronisation vector, and the silent edges of each automaton, are an *event class*: the edges
of each participant, of which one each is taken at once. A class becomes an action that its
participants alone have, so that the default composition of modules synchronises them. Classes with
the same result share an action, unless rewards must tell them apart.

If automata write variables that a module of the PRISM language could not write, or if assignments
of one read what another has just assigned, the network is first combined into one automaton.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import product

from symcheck.errors import UnsupportedError
from symcheck.syntax.ast import Binary, Expression, Literal, Name
from symcheck.syntax.declarations import (
    Assignment,
    Command,
    Composition,
    Hiding,
    Module,
    ModuleReference,
    Parallel,
    Renaming,
    RewardItem,
    RewardStructure,
    Update,
    VariableDeclaration,
)
from symcheck.syntax.jani.expressions import TRUE, conjunction, is_literal
from symcheck.syntax.jani.network import (
    Branch,
    Edge,
    Network,
    RawAssignment,
    assigned_values,
    whole_time,
)
from symcheck.syntax.jani.rewards import RewardRequest, edge_reward, state_reward
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["Composed", "compose"]

_MOST_JOINT_EDGES = 100_000

Signature = tuple[Expression | None, ...]
"""The reward of an edge for each request; None: none."""


@dataclass(frozen=True)
class _EventClass:
    """Edges that are taken at once: one of each participant.

    action: the result; None: silent. parts: the edges of each participant, by its index.
    """

    action: str | None
    parts: Mapping[int, Sequence[Edge]]


@dataclass(frozen=True)
class Composed:
    """The parts of a program that a network becomes."""

    globals: tuple[VariableDeclaration, ...]
    modules: tuple[Module, ...]
    rewards: tuple[RewardStructure, ...]
    initial: Expression | None
    system: Composition | None


def compose(network: Network, requests: Mapping[str, RewardRequest]) -> Composed:
    """Compose the automata of a network.

    Args:
        network: the automata and their synchronisation vectors.
        requests: the reward structures of the result, by name.

    Raises:
        SyntaxFault: an edge is faulty.
        UnsupportedError: the joint edges are too many.
    """
    return _Composer(network, tuple(requests.items())).composed()


class _Composer:
    def __init__(self, network: Network, requests: Sequence[tuple[str, RewardRequest]]) -> None:
        self.network = network
        self.requests = requests
        self.modules = [e.name for e in network.elements]
        self.items: list[list[RewardItem]] = [[] for _ in requests]
        self.hidden: list[str] = []
        self.renamed: list[tuple[str, str]] = []
        self.names: dict[str, str] = {}

    def composed(self) -> Composed:
        network = self.network
        classes = list(self._classes())
        for event_class in classes:
            self._check_rates(event_class)
        if self._must_combine(classes):
            classes = [self._combined(c) for c in classes]
            self.modules = [network.unique.take("network")]
        classes = self._with_distinct_actions(classes)
        if len(self.modules) > 1 and self._writes_labelled(classes):
            classes = [self._combined(c) for c in classes]
            self.modules = [network.unique.take("network")]
        commands = self._commands(classes)
        self._add_common_rewards(commands)
        initial, variables = self._initial()
        globals_, local = self._owners(classes, variables)
        modules = tuple(
            Module(name, local[k], tuple(commands[k]), self._invariant(k))
            for k, name in enumerate(self.modules)
        )
        rewards = tuple(
            RewardStructure(name, tuple(items))
            for (name, _), items in zip(self.requests, self.items, strict=True)
        )
        return Composed(globals_, modules, rewards, initial, self._system())

    # ------------------------------------------------------------------------------ event classes

    def _classes(self) -> Iterator[_EventClass]:
        elements = self.network.elements
        for k, element in enumerate(elements):
            silent = [e for e in element.edges if e.action is None]
            if silent:
                yield _EventClass(None, {k: silent})
        for vector, result in self.network.vectors:
            parts = {
                k: [e for e in elements[k].edges if e.action == action]
                for k, action in enumerate(vector)
                if action is not None
            }
            if all(parts.values()):  # a participant without such an edge blocks the others
                yield _EventClass(result, parts)

    def _check_rates(self, event_class: _EventClass) -> None:
        kind, edges_of = self.network.type, list(event_class.parts.values())
        if kind.immediate_choices and len(edges_of) > 1:
            for edge in (e for edges in edges_of for e in edges if e.rate is not None):
                raise edge.node.unsupported("edges with a rate cannot synchronise")
        if kind.has_probabilities:
            return
        # An event has a rate if each choice of edges has one: all edges of some participant do.
        parts = event_class.parts.values()
        if not any(all(e.rate is not None for e in edges) for edges in parts):
            edge = next(e for edges in parts for e in edges if e.rate is None)
            raise edge.node.fault("edges of CTMCs need a rate")

    def _must_combine(self, classes: Sequence[_EventClass]) -> bool:
        """Whether a participant reads or writes what another one assigns in the same event."""
        for event_class in classes:
            if len(event_class.parts) < 2:
                continue
            assigned: dict[str, dict[int, int]] = {}
            for k, edges in event_class.parts.items():
                for a in _assignments(edges):
                    least = assigned.setdefault(a.target, {})
                    least[k] = min(a.index, least.get(k, a.index))
            if any(len(by) > 1 for by in assigned.values()):
                return True
            for k, edges in event_class.parts.items():
                for a in _assignments(edges) if any(a.index for a in _assignments(edges)) else ():
                    for name in names(a.value) & assigned.keys():
                        if any(i < a.index for j, i in assigned[name].items() if j != k):
                            return True
        return self._writes_labelled(classes)

    def _writes_labelled(self, classes: Sequence[_EventClass]) -> bool:
        """Whether a labelled edge writes a variable that several automata write."""
        writers = self._writers(classes)
        return any(
            len(writers[a.target]) > 1
            for c in classes
            if c.action is not None or len(c.parts) > 1
            for edges in c.parts.values()
            for a in _assignments(edges)
            if a.target in writers
        )

    def _writers(self, classes: Sequence[_EventClass]) -> dict[str, set[int]]:
        """The modules that write each variable."""
        writers: dict[str, set[int]] = {}
        for c in classes:
            for k, edges in c.parts.items():
                for a in _assignments(edges):
                    if a.target not in self.network.transients:
                        writers.setdefault(a.target, set()).add(k)
        return writers

    def _combined(self, event_class: _EventClass) -> _EventClass:
        """The class with each combination of edges as one edge of a single automaton."""
        parts = list(event_class.parts.values())
        count = reduce(lambda n, edges: n * sum(len(e.branches) for e in edges), parts, 1)
        if count > _MOST_JOINT_EDGES:
            raise UnsupportedError(
                "the automata write shared variables while they synchronise, and have more than "
                f"{_MOST_JOINT_EDGES:,} joint edges: this is not supported"
            )
        return replace(event_class, parts={0: [_joint(edges) for edges in product(*parts)]})

    # ------------------------------------------------------------------------------------ rewards

    def _with_distinct_actions(self, classes: Sequence[_EventClass]) -> list[_EventClass]:
        """The classes; those that earn different rewards with the same action get actions."""
        pools: dict[str | None, list[_EventClass]] = {}
        for c in classes:
            pools.setdefault(c.action, []).append(c)
        return [c for action, pool in pools.items() for c in self._pool(action, pool)]

    def _pool(self, action: str | None, pool: list[_EventClass]) -> list[_EventClass]:
        signed = [{k: self._by_signature(edges) for k, edges in c.parts.items()} for c in pool]
        if not any(any(s) for parts in signed for by in parts.values() for s in by):
            return pool
        totals = {
            tuple(map(_sum, zip(*(next(iter(by)) for by in parts.values()), strict=True)))
            for parts in signed
        }
        if len(totals) == 1 and all(len(by) == 1 for parts in signed for by in parts.values()):
            self._add(self._action(action), TRUE, totals.pop())
            return pool
        if len(pool) == 1 and all(map(_are_disjoint, pool[0].parts.values())):
            for by in signed[0].values():
                for signature, edges in by.items():
                    for edge in edges:
                        guard = self.network.in_states(edge.guard)
                        self._add(self._action(action), guard, signature)
            return pool
        result = []
        for parts in signed:
            for chosen in product(*(by.items() for by in parts.values())):
                total = tuple(map(_sum, zip(*(s for s, _ in chosen), strict=True)))
                edges_of = dict(zip(parts, (edges for _, edges in chosen), strict=True))
                name = action
                if any(total):
                    base = action or f"{self.modules[next(iter(edges_of))]}_step"
                    name = f"{base} {len(self.names)}"
                    self.names[name] = self.network.unique.take(base)
                    self._add(self.names[name], TRUE, total)
                result.append(_EventClass(name, edges_of))
        return result

    def _by_signature(self, edges: Sequence[Edge]) -> dict[Signature, list[Edge]]:
        by_signature: dict[Signature, list[Edge]] = {}
        for edge in edges:
            signature = tuple(edge_reward(r, edge, self.network) for _, r in self.requests)
            by_signature.setdefault(signature, []).append(edge)
        return by_signature

    def _add(self, action: str | None, guard: Expression, signature: Signature) -> None:
        for items, value in zip(self.items, signature, strict=True):
            if value is not None:
                items.append(RewardItem(action, guard, value))

    def _add_common_rewards(self, commands: Mapping[int, Sequence[Command]]) -> None:
        """The rewards of states, and those of all transitions."""
        labelled = {c.action: None for of_module in commands.values() for c in of_module}
        new = dict(self.renamed)
        actions = dict.fromkeys(
            None if a in self.hidden else new.get(a, a) if a else a for a in labelled
        )
        for items, (_, request) in zip(self.items, self.requests, strict=True):
            rewards = state_reward(request, self.network)
            items[:0] = [RewardItem(False, TRUE, v) for v in rewards.states]
            items += [RewardItem(a, TRUE, v) for v in rewards.transitions for a in actions]

    # ----------------------------------------------------------------------- commands and modules

    def _action(self, action: str | None) -> str | None:
        """The action of the PRISM language; the same for the same action of JANI."""
        if action is None:
            return None
        if action not in self.names:
            self.names[action] = self.network.unique.take(action)
        return self.names[action]

    def _commands(self, classes: Sequence[_EventClass]) -> dict[int, list[Command]]:
        commands: dict[int, list[Command]] = {k: [] for k in range(len(self.modules))}
        several = len(self.modules) > 1
        shared = [c.action for c in classes]
        for c in classes:
            action = self._action(c.action)
            if several and c.action is None and len(c.parts) > 1:
                action = self.network.unique.take("silent")
                self.hidden.append(action)
            elif several and action is not None and shared.count(c.action) > 1:
                renamed = self.network.unique.take(action)
                self.renamed.append((renamed, action))
                action = renamed
            for k, edges in c.parts.items():
                commands[k] += [self._command(action, e) for e in edges]
        return commands

    def _command(self, action: str | None, edge: Edge) -> Command:
        updates = []
        for branch in edge.branches:
            written, _ = assigned_values(branch.assignments, self.network.transients)
            spans = {a.target: a.span for a in branch.assignments}
            clocks = {v.name for v in self.network.variables.values() if v.clock}
            written = {n: whole_time(v) or v if n in clocks else v for n, v in written.items()}
            assignments = tuple(Assignment(n, v, span=spans[n]) for n, v in written.items())
            weight = _product(edge.rate, branch.probability)
            if weight is not None:
                weight = self.network.in_states(weight)
            updates.append(Update(weight, assignments, span=branch.span))
        guard = self.network.in_states(edge.guard)
        markovian = self.network.type.immediate_choices and edge.rate is not None
        return Command(action, guard, tuple(updates), markovian, span=edge.node.span)

    def _invariant(self, module: int) -> Expression | None:
        """The states in which a module lets time pass; None: all."""
        elements = self.network.elements
        if len(self.modules) == len(elements):
            elements = elements[module : module + 1]
        whole: Expression = TRUE
        for element in elements:
            whole = conjunction(whole, element.invariant)
        return None if whole == TRUE else self.network.in_states(whole)

    def _initial(self) -> tuple[Expression | None, list[VariableDeclaration]]:
        """The condition of initial states where values do not say it all, and the variables."""
        network = self.network
        variables = list(network.variables.values())
        condition = network.initial
        for element in network.elements:
            condition = conjunction(condition, element.initial)
        if all(v.initial is not None for v in variables) and condition == TRUE:
            return None, variables
        for v in variables:
            if v.initial is not None:
                given = Binary(Operator.EQ, Name(v.name), v.initial, span=v.initial.span)
                condition = conjunction(condition, given)
        return network.in_states(condition), [replace(v, initial=None) for v in variables]

    def _owners(
        self, classes: Sequence[_EventClass], variables: Sequence[VariableDeclaration]
    ) -> tuple[tuple[VariableDeclaration, ...], list[tuple[VariableDeclaration, ...]]]:
        """The global variables, and those of each module: a module owns what it alone writes."""
        writers = self._writers(classes)
        if len(self.modules) > 1:
            for k, element in enumerate(self.network.elements):
                writers |= {v.name: {k} for v in element.variables}
        single = len(self.modules) == 1
        owner = {n: 0 if single else next(iter(by)) for n, by in writers.items() if len(by) == 1}
        return (
            tuple(v for v in variables if v.name not in owner),
            [
                tuple(v for v in variables if owner.get(v.name) == k)
                for k in range(len(self.modules))
            ],
        )

    def _system(self) -> Composition | None:
        if not self.renamed and not self.hidden:
            return None
        system: Composition = Parallel(tuple(map(ModuleReference, self.modules)))
        if self.renamed:
            system = Renaming(system, tuple(self.renamed))
        return Hiding(system, tuple(self.hidden)) if self.hidden else system


def _assignments(edges: Iterable[Edge]) -> Iterator[RawAssignment]:
    for edge in edges:
        for branch in edge.branches:
            yield from branch.assignments


def _sum(values: tuple[Expression | None, ...]) -> Expression | None:
    present = [v for v in values if v is not None]
    return reduce(lambda a, b: Binary(Operator.PLUS, a, b), present) if present else None


def _product(left: Expression | None, right: Expression | None) -> Expression | None:
    if left is None or right is None:
        return right if left is None else left
    if is_literal(left, 1) or is_literal(right, 1):
        return right if is_literal(left, 1) else left
    return Binary(Operator.TIMES, left, right, span=right.span)


def _joint(edges: Sequence[Edge]) -> Edge:
    """The edge that takes one edge of each participant at once. Raises SyntaxFault."""
    branches = []
    for parts in product(*(e.branches for e in edges)):
        assignments: dict[tuple[int, str], RawAssignment] = {}
        for a in (a for part in parts for a in part.assignments):
            other = assignments.setdefault((a.index, a.target), a)
            if other.value != a.value:
                location = replace(edges[0].node, span=a.span)
                raise location.unsupported(
                    f"two automata that synchronise assign different values to '{a.target}'"
                )
        probability: Expression | None = reduce(_product, (p.probability for p in parts), None)
        branches.append(Branch(probability, tuple(assignments.values()), parts[0].span))
    return Edge(
        edges[0].action,
        reduce(conjunction, (e.guard for e in edges)),
        reduce(_product, (e.rate for e in edges), None),
        tuple(branches),
        edges[0].node,
    )


def _are_disjoint(edges: Sequence[Edge]) -> bool:
    """Whether it is plain that no two of the edges are enabled in a state: they fix a variable."""
    facts = [_facts(e.guard) for e in edges]
    fixed = set.intersection(*map(set, facts))
    return len(edges) == 1 or any(len({f[n] for f in facts}) == len(facts) for n in fixed)


def _facts(guard: Expression) -> dict[str, object]:
    """The values of variables that a conjunction requires."""
    values: dict[str, object] = {}
    stack = [guard]
    while stack:
        match stack.pop():
            case Binary(Operator.AND, left, right):
                stack += [left, right]
            case Binary(Operator.EQ, Name(name), Literal(value)):
                values[name] = value
            case Binary(Operator.EQ, Literal(value), Name(name)):
                values[name] = value
            case _:
                pass
    return values
