"""What building yields: an encoded model, its state space, and its transitions as diagrams.

    encode/build            reach                transitions
    BoundModel ──▶ SymbolicModel ──▶ StateSpace ──▶ Transitions

`SymbolicModel` knows no reachable state: guards, updates and one relation per group of events, each over the variables
that it touches only. `StateSpace` is the reachable set. `Transitions` holds the full matrices, on reachable rows only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar, overload

from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate, Event
from symcheck.symbolic.encoding.enumerate_states import minterms
from symcheck.symbolic.encoding.variables import Encoding
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd, Transition
    from symcheck.dd.odd import Odd
    from symcheck.symbolic.encoding.translate import Translator

__all__ = [
    "ChoiceSlot",
    "Deferred",
    "EncodedCommand",
    "EncodedEvent",
    "EncodedUpdate",
    "Iteration",
    "Relation",
    "StateSpace",
    "Step",
    "SymbolicModel",
    "Transitions",
]


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class EncodedUpdate:
    """One update. `probability`: a number or an MTBDD over row bits; `relation`: row bits to the column bits of the
    `assigned` variables (indices); `in_range`: rows where every assigned value is in its variable's range.
    """

    update: BoundUpdate
    probability: float | Mtbdd
    assigned: tuple[int, ...]
    relation: Bdd
    in_range: Bdd


@dataclass(frozen=True, eq=False)
class EncodedCommand:
    """A command: its guard over row bits, and its updates."""

    command: BoundCommand
    guard: Bdd
    updates: tuple[EncodedUpdate, ...]


@dataclass(frozen=True, eq=False)
class EncodedEvent:
    """An event. `touched`: indices of the variables that any of its commands assigns; `guard`: some joint command is
    enabled; `relation`: row bits to the column bits of the touched variables, transitions of positive probability only;
    `learned`: None if it is encoded in full, else how many valuations it was encoded for (see `learn`).
    """

    event: Event
    participants: tuple[tuple[EncodedCommand, ...], ...]
    touched: tuple[int, ...]
    guard: Bdd
    relation: Bdd
    learned: int | None = None

    def __repr__(self) -> str:
        commands = " × ".join(str(len(p)) for p in self.participants)
        touches = f"{self.relation.node_count} nodes, touches {len(self.touched)} variables"
        return f"EncodedEvent({self.event.action or '[]'}: {commands} commands, {touches})"


@dataclass(frozen=True, eq=False)
class Step:
    """Some of the transitions, over the variables that they change; `top` is the place in the order of the first of them."""

    relation: Bdd
    transition: Transition
    top: int

    def image(self, states: Bdd) -> Bdd:
        """Successors."""
        return self.transition.image(states, self.relation)

    def preimage(self, states: Bdd) -> Bdd:
        """Predecessors (reachable or not)."""
        return self.transition.preimage(states, self.relation)


@dataclass(frozen=True, eq=False)
class Relation(Step):
    """The transitions of all events (by number) with the same touched variables."""

    events: tuple[int, ...]
    touched: tuple[int, ...]

    def __repr__(self) -> str:
        return f"Relation({len(self.events)} events, {self.relation.node_count} nodes, touches {len(self.touched)} variables)"


@dataclass(frozen=True, eq=False)
class SymbolicModel:
    """A model's guards and updates as diagrams in `manager`. `initial` over row bits."""

    model: BoundModel
    manager: DiagramManager
    encoding: Encoding
    translator: Translator = field(repr=False)
    initial: Bdd = field(repr=False)
    events: tuple[EncodedEvent, ...] = field(repr=False)
    relations: tuple[Relation, ...] = field(repr=False)

    def successors(self, states: Bdd) -> Bdd:
        """States that some transition from `states` leads to."""
        return self.manager.disjunction([relation.image(states) for relation in self.relations])

    def predecessors(self, states: Bdd) -> Bdd:
        """States with some transition into `states`, reachable or not."""
        return self.manager.disjunction([relation.preimage(states) for relation in self.relations])

    def __repr__(self) -> str:
        nodes = sum(r.relation.node_count for r in self.relations)
        return (
            f"SymbolicModel({self.model.type.value}: {len(self.encoding.variables)} variables in {len(self.encoding.rows)} bits, "
            f"{len(self.events)} events in {len(self.relations)} relations of {nodes} nodes)"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{e.event.action or '[]'}</td><td>{' × '.join(str(len(p)) for p in e.participants)}</td>"
            f"<td>{e.guard.node_count}</td><td>{e.relation.node_count}</td>"
            f"<td>{', '.join(self.encoding.variables[i].name for i in e.touched)}</td></tr>"
            for e in self.events[:50]
        )
        head = "<tr><th>action</th><th>commands</th><th>guard nodes</th><th>relation nodes</th><th>touches</th></tr>"
        return f"<p>{self!r}</p><table>{head}{rows}</table>"


@dataclass(frozen=True, slots=True)
class Iteration:
    """One step of the search: numbers of states and of BDD nodes (None where not counted), seconds since it began."""

    number: int
    states: int | None
    nodes: int | None
    frontier: int | None
    frontier_nodes: int | None
    seconds: float


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The reachable states. `deadlocks` have no transition of their own. `symbolic` is the encoded model (complete on
    the reachable states, learned parts included); `schedule` says how the search went, `iterations` what it saw.
    """

    symbolic: SymbolicModel = field(repr=False)
    states: Bdd = field(repr=False)
    deadlocks: Bdd = field(repr=False)
    count: int
    schedule: str
    seconds: float
    iterations: tuple[Iteration, ...] = field(repr=False)

    @property
    def initial(self) -> Bdd:
        """The initial states."""
        return self.symbolic.initial

    @cached_property
    def odd(self) -> Odd:
        """State numbers, lexicographic in diagram order (declaration order by default)."""
        from symcheck.dd.odd import Odd

        return Odd(self.symbolic.manager, self.states, self.symbolic.encoding.rows)

    def where(self, expression: Expression) -> Bdd:
        """The reachable states that satisfy a boolean expression over the variables.

        Raises ModelFault where it has no value at one of them.
        """
        found = self.symbolic.translator.boolean_on(expression, self.states) & self.states
        self._raise_fault(expression, self.states)
        return found

    def values(self, expression: Expression, states: Bdd | None = None) -> Mtbdd:
        """The value of a numeric expression on the reachable states (or those in `states`), 0 elsewhere.

        Where it is NaN, such as 0/0, it is 0 here: `symbolic.translator.undefined(expression)` says where.
        Raises ModelFault where it has no value at one of them.
        """
        chosen = self.states if states is None else states & self.states
        found = self.symbolic.translator.number_on(expression, chosen)
        self._raise_fault(expression, chosen)
        return found

    def _raise_fault(self, expression: Expression, states: Bdd) -> None:
        """Raise what the scalar evaluation raises at the first of the states where it does."""
        for state in self.valuations(self.symbolic.translator.faults(expression) & states, 1):
            names = (v.name for v in self.symbolic.model.variables)
            evaluate(expression, dict(zip(names, state, strict=True)))

    def valuations(self, states: Bdd, limit: int | None = None) -> Iterator[tuple[bool | int, ...]]:
        """Variable values of the states in the set, lowest first in diagram order; at most `limit`."""
        encoding = self.symbolic.encoding
        rows = minterms(self.symbolic.manager, states & self.states, encoding.rows, limit)
        for row in encoding.codes(rows).tolist():
            yield tuple(
                bool(x) if v.is_bool else x for v, x in zip(encoding.variables, row, strict=True)
            )

    def __repr__(self) -> str:
        return (
            f"StateSpace({self.count} states, {self.states.node_count} nodes, {len(self.iterations)} iterations "
            f"({self.schedule}), {self.seconds:.3f} s)"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{i.number}</td><td>{i.states}</td><td>{i.nodes}</td><td>{i.frontier}</td><td>{i.frontier_nodes}</td></tr>"
            for i in self.iterations[:100]
        )
        head = "<tr><th>iteration</th><th>states</th><th>nodes</th><th>frontier</th><th>frontier nodes</th></tr>"
        return f"<p>{self!r}</p><table>{head}{rows}</table>"


@dataclass(frozen=True, eq=False)
class ChoiceSlot:
    """Choices of an MDP of which a state has at most one: its distribution over column bits, on the rows of `guard`."""

    matrix: Mtbdd
    guard: Bdd


class Deferred(Sequence[T]):
    """A sequence of which each item is made when it is first asked for."""

    def __init__(self, makers: Sequence[Callable[[], T]]) -> None:
        self._makers = makers
        self._made: dict[int, T] = {}

    def __len__(self) -> int:
        return len(self._makers)

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[T]: ...
    def __getitem__(self, index: int | slice) -> T | Sequence[T]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        place = range(len(self))[index]
        if place not in self._made:
            self._made[place] = self._makers[place]()
        return self._made[place]

    def __repr__(self) -> str:
        return f"Deferred({len(self)} items, {len(self._made)} made)"


@dataclass(frozen=True, eq=False)
class Transitions:
    """The matrices, on reachable rows; deadlocks have a self-loop (probability or rate 1; in an MDP in slot 0) where
    `fixed`.

    matrix: probabilities (DTMC) or rates (CTMC) over row and column bits; None for an MDP.
    choices: the slots of an MDP; empty otherwise.
    action_sets: (slot, action or None) to the states whose choice in that slot has that action; DTMC and CTMC: empty.
    state_rewards: per structure, over row bits. transition_rewards: per structure and slot (a single slot for DTMC and
    CTMC), over row bits: the sum over the row's transitions of probability (rate) times reward. Both are made when a
    structure is first asked for, which raises ModelFault where a reward is infinite or has no value.
    """

    space: StateSpace
    matrix: Mtbdd | None
    choices: tuple[ChoiceSlot, ...]
    action_sets: Mapping[tuple[int, str | None], Bdd]
    state_rewards: Sequence[Mtbdd]
    transition_rewards: Sequence[tuple[Mtbdd, ...]]
    fixed: Bdd
    seconds: float = 0.0

    @property
    def roots(self) -> tuple[Mtbdd, ...]:
        """The matrix of a DTMC or CTMC, or one matrix per slot of an MDP."""
        return tuple(c.matrix for c in self.choices) if self.matrix is None else (self.matrix,)

    @cached_property
    def transition_count(self) -> int:
        """Number of non-zero entries, of all choices; self-loops of deadlocks included."""
        encoding, manager = self.space.symbolic.encoding, self.space.symbolic.manager
        return sum(manager.count(root.to_bdd(), encoding.bits) for root in self.roots)

    @cached_property
    def choice_count(self) -> int:
        """Number of choices over all states (the number of states, for a DTMC or CTMC)."""
        symbolic = self.space.symbolic
        if self.matrix is not None:
            return self.space.count
        return sum(symbolic.manager.count(c.guard, symbolic.encoding.rows) for c in self.choices)

    def __repr__(self) -> str:
        nodes = sum(root.node_count for root in self.roots)
        slots = (
            ""
            if self.matrix is not None
            else f", {self.choice_count} choices in {len(self.choices)} slots"
        )
        return f"Transitions({self.transition_count} transitions{slots}, {nodes} nodes)"
