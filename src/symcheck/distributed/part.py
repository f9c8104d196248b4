"""The part of a model that one worker holds: its exploration, then what is computed on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

from symcheck.direction import Direction
from symcheck.distributed.checkpoints import PartFiles
from symcheck.distributed.component_search import ComponentSearch
from symcheck.distributed.exploration import PartExploration, PartRows
from symcheck.distributed.explored_part import ExploredPart
from symcheck.distributed.iteration import Iteration
from symcheck.distributed.messages import Message
from symcheck.distributed.partition import Partition
from symcheck.distributed.state_sets import StateSets
from symcheck.distributed.steps import PartSteps
from symcheck.distributed.substitution import Substitution
from symcheck.explicit.states import Rows, StateLayout
from symcheck.numerics.settings import Settings
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import Expression

__all__ = ["Counts", "Part"]

H = TypeVar("H")


class Counts(NamedTuple):
    """Sizes of a part."""

    states: int
    transitions: int
    choices: int
    ghosts: int
    deadlocks: int
    initial: int


class Part:
    """The part of a model that one worker holds.

    A computation is one value after the other: `StateSets`, `Iteration`, and then a
    `ComponentSearch`, a `Substitution` or `PartSteps`. The methods `begin_…` make them, and their
    owner calls their methods by `perform`.

    Args:
        model: a DTMC, CTMC or MDP with commands.
        number: of this part, from 0.
        files: of its checkpoints; None: it has none. What they hold is not explored again.
    """

    def __init__(
        self,
        model: BoundModel,
        number: int,
        partition: Partition,
        files: PartFiles | None = None,
        *,
        check_sums: bool = True,
    ) -> None:
        self._model, self._number, self._files = model, number, files
        self._layout = StateLayout.of(model.variables)
        self._exploration: PartExploration | None = None
        self._generation, self._round = -1, 0  # of the exchange; no exchange has begun
        self._early: dict[int, Sequence[Rows]] = {}
        self._held: dict[str, object] = {}
        rows = None if files is None else files.load_rows()
        if rows is not None:
            self._hold_rows(rows)
        else:
            known = None if files is None else files.load_states(self._layout.words)
            self._exploration = PartExploration(
                model, number, partition, check_sums=check_sums, known=known
            )

    # ------------------------------------------------------------------------- exploration

    def is_explored(self) -> bool:
        """Whether the rows are complete."""
        return self._exploration is None

    def begin_exchange(self, generation: int) -> None:
        """Begin the exchange of the exploration anew: all ghosts are sent again.

        generation: rounds with another number are those of an earlier exchange.
        """
        assert self._exploration is not None
        self._exploration.resend()
        self._generation, self._round = generation, 0
        self._early.clear()

    def explore(
        self, incoming: Sequence[Rows], generation: int, number: int
    ) -> list[tuple[bool, list[Rows]]]:
        """Number ghosts of the other parts, and expand states.

        Args:
            incoming: the ghosts.
            generation: see `begin_exchange`.
            number: of the round. A round that arrives before its turn waits for it: ghosts have
                numbers in the order of the rounds.

        Returns:
            For each round whose turn it is: whether states are left, and the new ghosts of each
            part.
        """
        if generation != self._generation:
            return []
        self._early[number] = incoming
        answers = []
        while self._round in self._early:
            answers.append(self._expand(self._early.pop(self._round)))
            self._round += 1
        return answers

    def _expand(self, incoming: Sequence[Rows]) -> tuple[bool, list[Rows]]:
        assert self._exploration is not None
        busy, outgoing, own = self._exploration.explore(incoming)
        if self._files is not None:
            self._files.append_states(own)
        return busy, outgoing

    def finish(self) -> Counts:
        """End the exploration."""
        if self._exploration is not None:
            rows = self._exploration.finish()
            self._exploration = None
            if self._files is not None:
                self._files.save_rows(rows)
            self._hold_rows(rows)
        rows = self._holds(ExploredPart).rows
        states, groups = len(rows.states), rows.matrix.groups
        return Counts(
            states,
            rows.matrix.entries,
            states if groups is None else int(groups[-1]),
            int(rows.starts[-1] - rows.starts[0]),
            int(rows.deadlocks.sum()),
            len(rows.initial),
        )

    def _hold_rows(self, rows: PartRows) -> None:
        self._hold(ExploredPart(self._model, self._number, self._layout, rows, self._files))

    # ------------------------------------------------------------------------ computations

    def _hold(self, value: object) -> None:
        self._held[type(value).__name__] = value

    def _holds(self, kind: type[H]) -> H:
        found = self._held[kind.__name__]
        assert isinstance(found, kind)
        return found

    def perform(self, kind: str, method: str, *arguments: object) -> object:
        """Call a method of this part, or of what it holds: `kind` is the name of a class."""
        owner = self if kind == Part.__name__ else self._held[kind]
        return getattr(owner, method)(*arguments)

    def begin_formulas(
        self, left: Expression, right: Expression, labels: Mapping[str, Expression]
    ) -> list[Message]:
        """Begin with the states that satisfy two state formulas, the sets `left` and `right`."""
        sets = StateSets(self._holds(ExploredPart), left, right, labels)
        self._hold(sets)
        return sets.messages()

    def begin_iteration(
        self, known: str, zero: str, direction: Direction | None, reward: Reward | None
    ) -> None:
        """Begin with the least values (see `Iteration`)."""
        for kind in (Iteration, ComponentSearch, Substitution, PartSteps):
            self._held.pop(kind.__name__, None)
        part, sets = self._holds(ExploredPart), self._holds(StateSets)
        self._hold(Iteration(part, sets, known, zero, direction, reward))

    def begin_component_search(self) -> list[Message]:
        """Begin the search for end components of the unknowns."""
        search = ComponentSearch(
            self._holds(ExploredPart), self._holds(StateSets), self._holds(Iteration)
        )
        self._hold(search)
        return search.begin()

    def begin_substitution(
        self, settings: Settings, formula: str, number: int | None
    ) -> list[Message]:
        """Solve the components of unknown states that lead to known ones, before an iteration.

        number: of a checkpoint of the substitution to go on from; None: there is none.
        """
        substitution = self._holds(Iteration).substitution(settings, formula, number)
        self._hold(substitution)
        return substitution.solve_ready([])

    def end_substitution(self) -> tuple[float, list[tuple[float, float]]]:
        """Continue with the states that are still unknown: the largest relative width of the bounds
        of the others, and the bounds of initial states that are known.
        """
        substitution = self._holds(Substitution)
        del self._held[Substitution.__name__]
        return substitution.width, self._holds(Iteration).end_substitution(substitution)

    def begin_steps(self, rate: float | None) -> list[Message]:
        """Begin steps (see `PartSteps`)."""
        iteration = self._holds(Iteration)
        self._hold(PartSteps(self._holds(ExploredPart), iteration, rate))
        return iteration.changes()

    def save_substitution(self, formula: str, number: int) -> None:
        """Write the bounds of the states whose values are known, as a checkpoint with a number."""
        assert self._files is not None
        values = self._holds(Substitution).known_values()
        self._files.save_values(formula, number, {"values": values})
