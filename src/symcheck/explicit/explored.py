"""The protocol of models that were explored state by state, for both types of number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

__all__ = ["RACE", "ExploredModel", "States"]

RACE = -2
"""The action of the row of a Markovian state of a Markov automaton: its weights are rates."""


class ExploredModel(Protocol):
    """A model explored state by state: see `symcheck.explicit.model.ExplicitModel`."""

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        ...

    @property
    def states(self) -> States:
        """The states, by number."""
        ...

    @property
    def matrix(self) -> SparseMatrix:
        """Probabilities (rates), deadlocks fixed: its numbers are those of the engine."""
        ...

    @property
    def choice_actions(self) -> Int32s:
        """The action of each row, -1 for none, `RACE` for a row of rates beside others."""
        ...

    @property
    def initial(self) -> Int64s:
        """The numbers of the initial states."""
        ...

    @property
    def deadlocks(self) -> Int64s:
        """The numbers of the states that had no transition."""
        ...

    @property
    def state_rewards(self) -> Sequence[Numbers]:
        """Per structure, the reward of each state."""
        ...

    @property
    def choice_rewards(self) -> Sequence[Numbers]:
        """Per structure, the transition reward of each row."""
        ...

    def evaluate(self, expression: Expression) -> Numbers:
        """The value of an expression over the variables in each state."""
        ...


class States(Protocol):
    """The states of an explored model: values of the variables by the number of a state."""

    def __len__(self) -> int: ...

    def __iter__(self) -> Iterator[tuple[bool | int, ...]]: ...

    def column(self, variable: int) -> Int64s:
        """Values of a variable (by index); of a bool, 0 and 1."""
        ...

    def take(self, indices: Int64s | Int32s) -> States:
        """Some of the states."""
        ...

    def valuations(self, indices: Int64s) -> Iterator[tuple[bool | int, ...]]:
        """The values of the variables in some states."""
        ...
