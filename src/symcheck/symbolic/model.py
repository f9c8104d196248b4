"""The stages of symbolic model construction: an encoded model, its state space, and its
transitions.

       build                 reach            transitions
    BoundModel ──▶ SymbolicModel ──▶ StateSpace ──▶ Transitions

`SymbolicModel` has guards, updates and one transition relation per group of events, each over the
variables that it touches. `StateSpace` is the set of reachable states. `Transitions` has the
matrices on the reachable rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, TypeVar, overload

from symcheck.semantics.interpreter import value
from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate, Event
from symcheck.symbolic.encoding.enumerate_states import enumerate_states
from symcheck.symbolic.encoding.variables import Encoding
from symcheck.syntax.ast import Expression
from symcheck.tables import counted

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd, Transition
    from symcheck.dd.odd import Odd
    from symcheck.symbolic.encoding.translate import Translator

__all__ = [
    "ChoiceClass",
    "EncodedCommand",
    "EncodedEvent",
    "EncodedUpdate",
    "Iteration",
    "LazySequence",
    "Relation",
    "StateSpace",
    "SymbolicModel",
    "TransitionPart",
    "Transitions",
]


T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class EncodedUpdate:
    """One update.

    Attributes:
        probability: a number, or an MTBDD over row bits (a rate in a CTMC).
        assigned: indices of the assigned variables.
        relation: over row bits and the column bits of the assigned variables.
        in_range: the rows where every assigned value is in the range of its variable.
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
    """An event: commands that are taken together, one of each participant.

    Attributes:
        participants: the commands of each participant.
        touched: indices of the variables that its commands assign.
        guard: the rows where a joint command is enabled.
        relation: its transitions of positive probability, over row bits and the column bits of the
            touched variables.
        evaluated: number of valuations for which it is encoded on the fly; None if it is encoded in
            full.
    """

    event: Event
    participants: tuple[tuple[EncodedCommand, ...], ...]
    touched: tuple[int, ...]
    guard: Bdd
    relation: Bdd
    evaluated: int | None = None

    def __repr__(self) -> str:
        commands = " × ".join(str(len(p)) for p in self.participants)
        touches = f"{self.relation.node_count} nodes, touches {len(self.touched)} variables"
        return f"EncodedEvent({self.event.action or '[]'}: {commands} commands, {touches})"

    def __str__(self) -> str:
        name = f"Action {self.event.action}" if self.event.action else "A command without action"
        count = len(self.touched)
        changes = f"changes {count} variable{'s' * (count != 1)}"
        return f"{name} {changes} (a relation of {self.relation.node_count} nodes)"


@dataclass(frozen=True, eq=False)
class TransitionPart:
    """A part of the partitioned transition relation, over the variables that it touches.

    Attributes:
        relation: over row bits and the column bits of the touched variables.
        transition: the touched variables, prepared for images.
        top: position of the first touched variable in the order.
    """

    relation: Bdd
    transition: Transition
    top: int

    def image(self, states: Bdd) -> Bdd:
        """Successors."""
        return self.transition.image(states, self.relation)

    def preimage(self, states: Bdd) -> Bdd:
        """Predecessors, reachable or not."""
        return self.transition.preimage(states, self.relation)


@dataclass(frozen=True, eq=False)
class Relation(TransitionPart):
    """The transitions of all events (by number) that touch the same variables (by index)."""

    events: tuple[int, ...]
    touched: tuple[int, ...]

    def __repr__(self) -> str:
        size = f"{len(self.events)} events, {self.relation.node_count} nodes"
        return f"Relation({size}, touches {len(self.touched)} variables)"


@dataclass(frozen=True, eq=False)
class SymbolicModel:
    """The guards, updates and transition relations of a model as diagrams; `initial` is over row
    bits.
    """

    model: BoundModel
    manager: DiagramManager
    encoding: Encoding
    translator: Translator
    initial: Bdd
    events: tuple[EncodedEvent, ...]
    relations: tuple[Relation, ...]

    def successors(self, states: Bdd) -> Bdd:
        """The states that a transition from `states` leads to."""
        return self.manager.disjunction([relation.image(states) for relation in self.relations])

    def predecessors(self, states: Bdd) -> Bdd:
        """The states with a transition into `states`, reachable or not."""
        return self.manager.disjunction([relation.preimage(states) for relation in self.relations])

    def raise_fault(self, expression: Expression, states: Bdd) -> None:
        """Raise the ModelFault of an expression that has been translated, if it has no value in
        one of the states.
        """
        faulty = self.translator.faults(expression) & states
        for state in islice(enumerate_states(self.manager, self.encoding, faulty), 1):
            value(self.model, state, expression)
            raise AssertionError(f"no value in {state}, where the interpreter finds one")

    def __repr__(self) -> str:
        nodes = sum(r.relation.node_count for r in self.relations)
        return (
            f"SymbolicModel({self.model.type.value}: {len(self.encoding.variables)} variables in "
            f"{len(self.encoding.rows)} bits, "
            f"{len(self.events)} events in {len(self.relations)} relations of {nodes} nodes)"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{e.event.action or '[]'}</td>"
            f"<td>{' × '.join(str(len(p)) for p in e.participants)}</td>"
            f"<td>{e.guard.node_count}</td><td>{e.relation.node_count}</td>"
            f"<td>{', '.join(self.encoding.variables[i].name for i in e.touched)}</td></tr>"
            for e in self.events[:50]
        )
        head = (
            "<tr><th>action</th><th>commands</th><th>guard nodes</th><th>relation "
            "nodes</th><th>touches</th></tr>"
        )
        return f"<p>{self!r}</p><table>{head}{rows}</table>"


@dataclass(frozen=True, slots=True)
class Iteration:
    """Counters of one step of a search: states and BDD nodes (None: not counted), seconds since its
    start.
    """

    number: int
    states: int | None
    nodes: int | None
    frontier: int | None
    frontier_nodes: int | None
    seconds: float

    def __str__(self) -> str:
        counts = (
            ""
            if self.states is None or self.nodes is None
            else f": {counted(self.states, 'state')} in a diagram of {counted(self.nodes, 'node')}"
        )
        return f"Search, step {self.number}{counts} ({self.seconds:.3f} s)"


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The reachable states of a model.

    Attributes:
        symbolic: the model, complete on the reachable states where it is encoded on the fly.
        states: the reachable states, over row bits.
        deadlocks: those of them without a transition.
        count: their number.
        schedule: the schedule that found them last (see `symcheck.symbolic.reachability.search`).
        seconds: duration of the search.
        iterations: its counters.
    """

    symbolic: SymbolicModel
    states: Bdd
    deadlocks: Bdd
    count: int
    schedule: str
    seconds: float
    iterations: tuple[Iteration, ...]

    @property
    def initial(self) -> Bdd:
        """The initial states."""
        return self.symbolic.initial

    @cached_property
    def odd(self) -> Odd:
        """The numbering of the states, lexicographic in diagram order (by default the order of
        declaration).
        """
        from symcheck.dd.odd import Odd

        return Odd(self.symbolic.manager, self.states, self.symbolic.encoding.rows)

    def where(self, expression: Expression) -> Bdd:
        """The reachable states that satisfy a boolean expression over the variables.

        Raises ModelFault if it has no value in one of them.
        """
        satisfying = self.symbolic.translator.boolean_on(expression, self.states) & self.states
        self.symbolic.raise_fault(expression, self.states)
        return satisfying

    def values(self, expression: Expression, states: Bdd | None = None) -> Mtbdd:
        """The values of a numeric expression on the reachable states (or those in `states`), 0
        elsewhere.

        They are also 0 in the states `symbolic.translator.undefined(expression)`, where it is NaN,
        such as 0/0. Raises ModelFault if it has no value in one of the states.
        """
        chosen = self.states if states is None else states & self.states
        values = self.symbolic.translator.number_on(expression, chosen)
        self.symbolic.raise_fault(expression, chosen)
        return values

    def valuations(self, states: Bdd) -> Iterator[tuple[bool | int, ...]]:
        """The values of the variables in the reachable states of a set, in diagram order (take few
        of a large set).
        """
        symbolic = self.symbolic
        return enumerate_states(symbolic.manager, symbolic.encoding, states & self.states)

    def __repr__(self) -> str:
        return (
            f"StateSpace({self.count} states, {self.states.node_count} nodes, "
            f"{len(self.iterations)} iterations "
            f"({self.schedule}), {self.seconds:.3f} s)"
        )

    def __str__(self) -> str:
        return (
            f"Reachable states: {self.count} in a diagram of {self.states.node_count} nodes "
            f"({self.schedule}, {self.seconds:.3f} s)"
        )

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{i.number}</td><td>{i.states}</td><td>{i.nodes}</td><td>{i.frontier}</td><td>{i.frontier_nodes}</td></tr>"
            for i in self.iterations[:100]
        )
        head = (
            "<tr><th>iteration</th><th>states</th><th>nodes</th><th>frontier</th><th>frontier "
            "nodes</th></tr>"
        )
        return f"<p>{self!r}</p><table>{head}{rows}</table>"


@dataclass(frozen=True, eq=False)
class ChoiceClass:
    """A choice class of an MDP: choices of which each state has at most one.

    Attributes:
        matrix: per row, the distribution of the choice over column bits.
        guard: the rows with such a choice.
    """

    matrix: Mtbdd
    guard: Bdd


class LazySequence(Sequence[T]):
    """A sequence whose items are computed on first access."""

    def __init__(self, makers: Sequence[Callable[[], T]]) -> None:
        self._makers = makers
        self._items: dict[int, T] = {}

    def __len__(self) -> int:
        return len(self._makers)

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[T]: ...
    def __getitem__(self, index: int | slice) -> T | Sequence[T]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = range(len(self))[index]
        if number not in self._items:
            self._items[number] = self._makers[number]()
        return self._items[number]

    def __repr__(self) -> str:
        return f"LazySequence({len(self)} items, {len(self._items)} computed)"


@dataclass(frozen=True, eq=False)
class Transitions:
    """The transition matrices and rewards of a model, on reachable rows.

    Rewards are computed on first access to a structure, which raises ModelFault where one is
    infinite or has no value.

    Attributes:
        matrix: probabilities (DTMC) or rates (CTMC) over row and column bits; None for an MDP.
        choices: the choice classes of an MDP; empty otherwise.
        action_sets: (number of a choice class, action or None) to the states whose choice in that
            class has that action; empty for a DTMC or CTMC.
        state_rewards: per structure, over row bits.
        transition_rewards: per structure and choice class (a single one for a DTMC or CTMC), over
            row bits: the sum of probability (rate) times reward over the transitions of a row.
        fixed: deadlock states that were given a self-loop of weight 1 (in an MDP, in choice class
            0).
        seconds: duration of the construction.
    """

    space: StateSpace
    matrix: Mtbdd | None
    choices: tuple[ChoiceClass, ...]
    action_sets: Mapping[tuple[int, str | None], Bdd]
    state_rewards: Sequence[Mtbdd]
    transition_rewards: Sequence[tuple[Mtbdd, ...]]
    fixed: Bdd
    seconds: float = 0.0

    @property
    def roots(self) -> tuple[Mtbdd, ...]:
        """The matrix of a DTMC or CTMC, or one matrix per choice class of an MDP."""
        return tuple(c.matrix for c in self.choices) if self.matrix is None else (self.matrix,)

    @cached_property
    def transition_count(self) -> int:
        """Number of non-zero entries of all choices, self-loops of deadlocks included."""
        encoding, manager = self.space.symbolic.encoding, self.space.symbolic.manager
        return sum(manager.count(root.to_bdd(), encoding.bits) for root in self.roots)

    @cached_property
    def choice_count(self) -> int:
        """Number of choices of all states (for a DTMC or CTMC, the number of states)."""
        symbolic = self.space.symbolic
        if self.matrix is not None:
            return self.space.count
        return sum(symbolic.manager.count(c.guard, symbolic.encoding.rows) for c in self.choices)

    def __repr__(self) -> str:
        nodes = sum(root.node_count for root in self.roots)
        classes = (
            ""
            if self.matrix is not None
            else f", {self.choice_count} choices in {len(self.choices)} classes"
        )
        return f"Transitions({self.transition_count} transitions{classes}, {nodes} nodes)"

    def __str__(self) -> str:
        nodes = sum(root.node_count for root in self.roots)
        return f"Matrix: {self.transition_count} transitions in diagrams of {nodes} nodes"
