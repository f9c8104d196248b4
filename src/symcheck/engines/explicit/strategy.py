"""A strategy of an MDP: a choice per state, and the chain that it induces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count, islice
from typing import Any, cast

import numpy as np

from symcheck.direction import Direction
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.states import variable_names
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix
from symcheck.numerics import graph
from symcheck.tables import SHOWN_ROWS, Table, Tabular, state_table

__all__ = ["Strategy"]


@dataclass(frozen=True, eq=False)
class Strategy(Tabular):
    """A strategy: one row of the matrix for each state.

    Attributes:
        engine: the model, or its product with an automaton if the strategy has memory.
        rows: the row of each state, int64[states].
        direction: whether the strategy attains the minimum or the maximum; None if it was read.
        matters: the states in which the choice is relevant to the value, bool[states]; of a
            strategy that was read, those in the file.
        memory: the state of the automaton in each state of the product, int32[states]; None without
            memory.
        entry: the initial state of the product for each state of the model; None without memory.
    """

    engine: ExplicitEngine = field(repr=False)
    rows: Int64s = field(repr=False)
    direction: Direction | None
    matters: Bools = field(repr=False)
    memory: Int32s | None = field(default=None, repr=False)
    entry: Int64s | None = field(default=None, repr=False)

    @cached_property
    def induced(self) -> SparseMatrix:
        """The Markov chain that the strategy induces, on all states."""
        return self.engine.matrix.choose(self.rows)

    @cached_property
    def reachable(self) -> Bools:
        """States that the strategy reaches from the initial ones."""
        return graph.forward_reachable(self.induced, self.engine.initial.members)

    @property
    def base(self) -> ExplicitEngine:
        """The model, without memory."""
        explored = self.engine.explored
        return (
            cast(ExplicitEngine, explored.base)
            if isinstance(explored, ProductModel)
            else (self.engine)
        )

    @property
    def origin(self) -> Int64s:
        """The number of the model's state in each state, int64[states]."""
        explored = self.engine.explored
        if isinstance(explored, ProductModel):
            return explored.state.astype(np.int64)
        return np.arange(self.engine.states)

    @property
    def choice_counts(self) -> Int64s:
        """The number of choices of each state, int64[states]."""
        groups = self.engine.matrix.groups
        assert groups is not None
        return np.diff(groups)

    @property
    def choices(self) -> Int64s:
        """The number of the choice within its state, in each state, int64[states]."""
        groups = self.engine.matrix.groups
        assert groups is not None
        return self.rows - groups[:-1]

    @property
    def actions(self) -> list[str]:
        """The action of the choice in each state; '' for a choice without action."""
        names = self.engine.model.actions
        return [
            names[a] if a >= 0 else ""
            for a in self.engine.explored.choice_actions[self.rows].tolist()
        ]

    def states(self) -> Iterator[tuple[bool | int, ...]]:
        """The values of the variables in each state, followed by the memory if there is one."""
        values = self.engine.valuations(self.engine.all)
        if self.memory is None:
            return values
        return ((*state, m) for state, m in zip(values, self.memory.tolist(), strict=True))

    def _names(self) -> list[str]:
        names = variable_names(self.engine.model)
        return names if self.memory is None else [*names, "memory"]

    def _table(self) -> Table:
        states = zip(count(), self.states(), self.actions, self.reachable.tolist(), strict=False)
        shown = islice(((n, s, action) for n, s, action, there in states if there), SHOWN_ROWS)
        note = f"{np.count_nonzero(self.reachable):,} of {self.engine.states:,} states are reached"
        return state_table(self._names(), shown, ("action",), note)

    def columns(self) -> dict[str, Any]:
        """Number, variables and memory of each state, its action, and whether it is reached."""
        columns: dict[str, Any] = {"state": range(self.engine.states)}
        columns |= zip(self._names(), zip(*self.states(), strict=True), strict=True)
        return columns | {"action": self.actions, "reached": self.reachable}
