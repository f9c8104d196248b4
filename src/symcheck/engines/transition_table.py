"""The transitions of a built model as a table and as a graph."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from symcheck.engines.base import Engine
from symcheck.engines.capabilities import HasActions
from symcheck.engines.states import State, States, refuse_many
from symcheck.engines.transition_actions import transition_parts
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int64s, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.semantics.features import class_name
from symcheck.syntax.ast import Weights
from symcheck.tables import SHOWN_ROWS, Columns, Table, Tabular, optional_package

if TYPE_CHECKING:
    from fractions import Fraction

    from networkx import DiGraph

__all__ = ["Choice", "Transition", "TransitionTable"]


class Transition(NamedTuple):
    """A transition. action: None for none; the names of several actions that contribute to a
    transition of a chain are joined by commas. probability: a rate in a CTMC, a Fraction in
    rational arithmetic.
    """

    source: State
    action: str | None
    target: State
    probability: float | Fraction


class Choice(NamedTuple):
    """A choice of a state: a row of the matrix.

    Attributes:
        action: None for none, and in a chain.
        successors: the probability of each successor (its rate, if the choice takes time), a
            Fraction in rational arithmetic.
        takes_time: whether the choice is a race of rates: in a CTMC, and in a Markovian state of a
            Markov automaton.
    """

    action: str | None
    successors: Mapping[State, float | Fraction]
    takes_time: bool


@dataclass(frozen=True, eq=False, repr=False)
class TransitionTable(Tabular):
    """The transitions, ordered by source and choice; they are listed when they are asked for.

    Examples:
        >>> import symcheck
        >>> model = symcheck.load("models/die/die.pm")
        >>> source, action, target, probability = next(iter(model.transitions))
        >>> source, target, probability
        ((s=0, d=0), (s=1, d=0), 0.5)
    """

    engine: Engine = field(repr=False)

    @property
    def matrix(self) -> SparseMatrix:
        """The matrix: a row per choice, which is a state in a chain."""
        return self._kernel.weights

    @cached_property
    def _kernel(self) -> TransitionKernel[SparseMatrix]:
        if self.engine.model.weights is Weights.INTERVALS:
            raise UnsupportedError(
                f"tables of transitions are not available for {class_name(self.engine.model)}",
                hint="symcheck.export(model, 'out.tra') writes the intervals",
            )
        refuse_many(self.engine.transitions, "transitions")
        return self.engine.system(self.engine.all).row_kernel

    @property
    def choice(self) -> Int64s:
        """The choice (row of the matrix) of each transition, int64[transitions]."""
        return np.repeat(np.arange(self.matrix.rows), self.matrix.lengths)

    @property
    def source(self) -> Int64s:
        """The number of the source of each transition, int64[transitions]."""
        groups = self.matrix.groups
        if groups is None:
            return self.choice
        return np.repeat(np.arange(self.matrix.states), np.diff(groups))[self.choice]

    @property
    def target(self) -> Int64s:
        """The number of the target of each transition, int64[transitions]."""
        return self.matrix.indices.astype(np.int64)

    @property
    def action(self) -> NDArray[np.object_]:
        """The action of each transition, object[transitions]; None for none.

        Those of a transition of a chain are joined by commas.
        """
        model = self.engine.model
        if model.type.has_choices:
            return np.array(self._actions, object)[self.choice]
        actions = np.full(self.matrix.entries, None, object)
        if (parts := transition_parts(self.engine)) is not None:
            joined = parts.joined(model.actions, self.matrix.entries)
            actions[:] = [text or None for text in joined]
        return actions

    @property
    def probability(self) -> Numbers:
        """The probability (rate) of each transition: float64[transitions], or Fractions."""
        return self.matrix.data.copy()

    @cached_property
    def _actions(self) -> Sequence[str | None]:
        """The action of each choice, None for none and in a chain."""
        model, known = self.engine.model, self.engine.capability(HasActions)
        if not model.type.has_choices:
            return [None] * self.matrix.rows
        assert known is not None
        names = np.array([*model.actions, None, None])
        actions: list[str | None] = names[known.row_actions()].tolist()
        return actions

    def choices(self, state: State) -> tuple[Choice, ...]:
        """The choices of a state, in the order of the rows of the matrix."""
        matrix, rates = self.matrix, self._kernel.exit_rates
        n, groups, states = state.number, matrix.groups, States(self.engine, self.engine.all)
        found = []
        for row in range(n, n + 1) if groups is None else range(*groups[n : n + 2].tolist()):
            part = slice(*matrix.indptr[row : row + 2].tolist())
            targets = [states[t] for t in matrix.indices[part].tolist()]
            successors = dict(zip(targets, matrix.data[part].tolist(), strict=True))
            takes_time = rates is not None and bool(rates[row] > 0)
            found.append(Choice(self._actions[row], successors, takes_time))
        return tuple(found)

    def __len__(self) -> int:
        return self.engine.transitions

    def __iter__(self) -> Iterator[Transition]:
        states = list(States(self.engine, self.engine.all))
        return (Transition(states[s], a, states[t], p) for s, _, a, t, p in self._rows())

    def _rows(self) -> Iterator[tuple[int, int, str | None, int, float | Fraction]]:
        columns = (self.source, self.choice, self.action, self.target, self.matrix.data)
        return zip(*(c.tolist() for c in columns), strict=True)

    def __repr__(self) -> str:
        return f"<TransitionTable: {len(self):,} transitions>"

    def _table(self) -> Table:
        texts = ((s, "" if a is None else a, t, p) for s, _, a, t, p in self._rows())
        note = f"{self.engine.transitions:,} transitions between states of these numbers"
        return Table.of(Transition._fields, texts, note, SHOWN_ROWS)

    def columns(self) -> Columns:
        """Numbers of source, choice and target of each transition, its action and probability."""
        return {
            "transition": np.arange(len(self)),
            "source": self.source,
            "choice": self.choice,
            "action": self.action,
            "target": self.target,
            "probability": self.probability,
        }

    def to_networkx(self) -> DiGraph:
        """A graph of networkx (a multigraph for an MDP).

        Nodes are numbers of states, with the variables as attributes; edges have `probability`,
        `action` and `choice`. The attribute `initial` of the graph has the initial states.
        """
        networkx = optional_package("networkx", "frames")
        several = self.engine.model.type.has_choices
        graph = networkx.MultiDiGraph() if several else networkx.DiGraph()
        for state in States(self.engine, self.engine.all):
            graph.add_node(state.number, **state)
        graph.graph["initial"] = States(self.engine, self.engine.initial).numbers.tolist()
        for source, choice, action, target, probability in self._rows():
            graph.add_edge(source, target, probability=probability, action=action, choice=choice)
        return graph
