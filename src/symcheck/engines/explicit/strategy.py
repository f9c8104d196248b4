"""A strategy of an MDP: a choice per state, or a distribution over choices, and the chain that it
induces.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count, pairwise
from typing import cast

import numpy as np

from symcheck.direction import Direction
from symcheck.engines.base import erased
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.states import State, StateKey, States, variable_names
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix
from symcheck.numerics import graph
from symcheck.semantics.expressions.literals import format_value
from symcheck.tables import Columns, Table, Tabular, state_table

__all__ = ["Strategy"]


@dataclass(frozen=True, eq=False)
class Strategy(Tabular):
    """A strategy: one row of the matrix for each state, or a distribution over its rows.

    `strategy[state]` is the action that it takes there, and `strategy[state, memory]` if it has
    memory; `dict(strategy)` has them all. A state is given as in `model.states[…]`.

    Examples:
        >>> import symcheck
        >>> game = symcheck.load("models/gambler/stakes.nm", strategy=True)
        >>> strategy = game.check("Pmax=? [ F money=8 ]").strategy
        >>> strategy[{"money": 3}], strategy[game.states[4]]
        ('stake1', 'stake4')

    Attributes:
        engine: the model, or its product with an automaton if the strategy has memory.
        rows: the row of each state, int64[states]; of a randomised strategy, a likeliest one.
        direction: whether the strategy attains the minimum or the maximum; None if it was read.
        matters: the states in which the choice is relevant to the value, bool[states]; of a
            strategy that was read, those in the file.
        memory: the state of the automaton in each state of the product, int32[states]; None without
            memory.
        entry: the initial state of the product for each state of the model, -1 where there is none;
            None without memory.
        weights: the probability of each row of the matrix, float64[rows] or Fractions, of a
            randomised strategy; None if `rows` are taken for certain.
    """

    engine: ExplicitEngine = field(repr=False)
    rows: Int64s = field(repr=False)
    direction: Direction | None
    matters: Bools = field(repr=False)
    memory: Int32s | None = field(default=None, repr=False)
    entry: Int64s | None = field(default=None, repr=False)
    weights: Numbers | None = field(default=None, repr=False)

    @cached_property
    def taken(self) -> Int64s:
        """The rows that the strategy takes with positive probability, ascending, int64[k]."""
        return self.rows if self.weights is None else np.flatnonzero(self.weights > 0)

    @cached_property
    def starts(self) -> Int64s:
        """Where the rows of each state begin in `taken`, int64[states+1]."""
        if self.weights is None:
            return np.arange(self.engine.states + 1)
        return np.searchsorted(self.taken, self._groups)

    @property
    def shares(self) -> Numbers:
        """The probability of each row in `taken`, float64[k] or Fractions."""
        if self.weights is None:
            return full(len(self.rows), 1, rational=self.engine.is_rational)
        return np.asarray(self.weights[self.taken])

    @property
    def _groups(self) -> Int64s:
        groups = self.engine.matrix.groups
        assert groups is not None
        return groups

    @cached_property
    def induced(self) -> SparseMatrix:
        """The Markov chain that the strategy induces, on all states."""
        chosen = self.engine.matrix.choose(self.taken)
        if self.weights is None:
            return chosen
        data = chosen.data * np.repeat(self.shares, chosen.lengths)
        mixed = SparseMatrix(chosen.indptr[self.starts], chosen.indices, data, chosen.columns)
        return mixed.merge(np.arange(mixed.columns, dtype=np.int32), mixed.columns)

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
    def _origin_rows(self) -> Int64s:
        """The row of the model that each row in `taken` comes from."""
        explored = self.engine.explored
        return explored.rows[self.taken] if isinstance(explored, ProductModel) else self.taken

    @property
    def choice_counts(self) -> Int64s:
        """The number of choices that the model has in each state, int64[states]."""
        groups = self.base.matrix.groups
        assert groups is not None
        return np.diff(groups)[self.origin]

    @property
    def undecided(self) -> Bools:
        """States that are reached, with several choices of which none matters: bool[states]."""
        return self.reachable & ~self.matters & (self.choice_counts > 1)

    @property
    def choices(self) -> list[str]:
        """The number of the choice within the model's state, in each state: `1`, `0.5:0+0.5:1`."""
        groups = self.base.matrix.groups
        assert groups is not None
        first = np.repeat(groups[:-1][self.origin], np.diff(self.starts))
        return self._texts((self._origin_rows - first).tolist())

    @cached_property
    def actions(self) -> list[str]:
        """The action of the choice in each state, '' for none; `0.5:go+0.5:stay` if randomised."""
        names = (*self.engine.model.actions, "", "")
        actions = self.engine.explored.choice_actions[self.taken].tolist()
        return self._texts([names[a] for a in actions])

    def _texts(self, chosen: Sequence[object]) -> list[str]:
        """A text per state from those of the rows in `taken`, with probabilities below 1."""
        if self.weights is None:
            return [str(c) for c in chosen]
        starts, shares = self.starts.tolist(), self.shares.tolist()
        return [
            "+".join(f"{format_value(shares[i])}:{chosen[i]}" for i in range(a, b))
            if b - a > 1
            else str(chosen[a])
            for a, b in pairwise(starts)
        ]

    @property
    def following(self) -> Int32s:
        """The memory after each row in `taken`, int32[k]. For strategies with memory only."""
        assert self.memory is not None
        matrix = self.engine.matrix
        return self.memory[matrix.indices[matrix.indptr[:-1][self.taken]]]

    def keys(self) -> Iterator[State | tuple[State, int]]:
        """Each state, with each memory that it can have if the strategy has memory."""
        if self.memory is None:
            return iter(self._model_states)
        pairs = zip(self.origin.tolist(), self.memory.tolist(), strict=True)
        listed = list(self._model_states)
        return ((listed[state], memory) for state, memory in pairs)

    __iter__ = keys

    def __len__(self) -> int:
        return self.engine.states

    def __getitem__(self, key: StateKey | tuple[StateKey, int]) -> str:
        if self.memory is None:
            state = self._model_states[cast(StateKey, key)]
            return self.actions[state.number]
        if not isinstance(key, tuple) or len(key) != 2:
            raise TypeError(f"the strategy has memory: expected strategy[state, memory], not {key}")
        state, memory = self._model_states[key[0]], key[1]
        found = np.flatnonzero((self.origin == state.number) & (self.memory == memory)).tolist()
        if not found:
            raise KeyError(f"the state {state} never has the memory {memory}")
        return self.actions[found[0]]

    @property
    def _model_states(self) -> States:
        return States(erased(self.base), self.base.all)

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
        shown = ((n, s, action) for n, s, action, there in states if there)
        note = f"{np.count_nonzero(self.reachable):,} of {self.engine.states:,} states are reached"
        return state_table(self._names(), shown, ("action",), note)

    def columns(self) -> Columns:
        """Number, variables and memory of each state, its action, and whether it is reached."""
        columns = zip(self._names(), zip(*self.states(), strict=True), strict=True)
        return {
            "state": range(self.engine.states),
            **dict(columns),
            "action": self.actions,
            "reached": self.reachable,
        }
