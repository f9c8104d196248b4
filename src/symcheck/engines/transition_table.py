"""The transitions of a built model as a table and as a graph."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from symcheck.engines.base import Engine
from symcheck.engines.capabilities import HasActions
from symcheck.engines.states import State, States, refuse_many
from symcheck.engines.transition_actions import transition_parts
from symcheck.matrices.rows import Int64s, SparseMatrix
from symcheck.tables import SHOWN_ROWS, Columns, Table, Tabular, optional_package

if TYPE_CHECKING:
    from fractions import Fraction

    from networkx import DiGraph

__all__ = ["Transition", "TransitionTable"]


class Transition(NamedTuple):
    """A transition. action: None for none; the names of several actions that contribute to a
    transition of a chain are joined by commas. probability: a rate in a CTMC, a Fraction in
    rational arithmetic.
    """

    source: State
    action: str | None
    target: State
    probability: float | Fraction


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

    @cached_property
    def matrix(self) -> SparseMatrix:
        """The matrix: a row per choice, which is a state in a chain."""
        refuse_many(self.engine.transitions, "transitions")
        return self.engine.system(self.engine.all).weights

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
    def action(self) -> list[str | None]:
        """The action of each transition, None for none; those of a chain's are joined by commas."""
        model, known = self.engine.model, self.engine.capability(HasActions)
        if not model.type.has_choices:
            parts = transition_parts(self.engine)
            joined = [] if parts is None else parts.joined(model.actions, self.matrix.entries)
            return [text or None for text in joined] or [None] * self.matrix.entries
        assert known is not None
        names = np.array([*model.actions, None, None])
        actions: list[str | None] = names[known.row_actions()[self.choice]].tolist()
        return actions

    def __len__(self) -> int:
        return self.engine.transitions

    def __iter__(self) -> Iterator[Transition]:
        states = list(States(self.engine, self.engine.all))
        return (Transition(states[s], a, states[t], p) for s, _, a, t, p in self._rows())

    def _rows(self) -> Iterator[tuple[int, int, str | None, int, float | Fraction]]:
        columns = (self.source, self.choice, self.target, self.matrix.data)
        source, choice, target, data = (c.tolist() for c in columns)
        return zip(source, choice, self.action, target, data, strict=True)

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
            "probability": self.matrix.data,
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
