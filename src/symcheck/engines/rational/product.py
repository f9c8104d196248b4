"""The product of a model in rational arithmetic with an automaton: the states of the pairs, listed like any others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from symcheck.engines.base import Engine
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.product import pair_matrix, reachable_pairs
from symcheck.engines.rational.values import RationalMatrix, Rationals, RationalValues
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix
from symcheck.semantics.interpreter import State

if TYPE_CHECKING:
    from symcheck.engines.product import Automaton

__all__ = ["Base", "ExactProduct", "product"]


class Base(Engine, Protocol):
    """What a product asks of the engine that it is made with: a dataclass of these fields, of which the product is another."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def matrix(self) -> SparseMatrix:
        """The matrix as doubles."""
        ...

    @property
    def rationals(self) -> RationalMatrix:
        """The matrix."""
        ...

    @property
    def table(self) -> tuple[State, ...]:
        """The states in index order."""
        ...

    @property
    def initial(self) -> ArraySet:
        """The initial states."""
        ...

    @property
    def deadlocks(self) -> ArraySet:
        """States that had no transition before they were given a self-loop."""
        ...

    @property
    def state_rewards(self) -> tuple[Rationals, ...]:
        """Per structure, the reward of each state."""
        ...

    @property
    def row_rewards(self) -> tuple[Rationals, ...]:
        """Per structure, the reward of each row."""
        ...


@dataclass(frozen=True, eq=False)
class ExactProduct:
    """See `symcheck.engines.product.Product`.

    Pair p is (state[p], automaton[p]); entry: per base state, the pair with the automaton's initial state; letter: per
    base state.
    """

    engine: Base
    state: Int32s = field(repr=False)
    automaton: Int32s = field(repr=False)
    entry: Int64s = field(repr=False)
    letter: Int32s = field(repr=False)

    def lift(self, states: ArraySet) -> ArraySet:
        """The pairs whose first part is in the set."""
        return ArraySet(states.members[self.state])

    def automaton_states(self, states: frozenset[int]) -> ArraySet:
        """The pairs whose second part is one of these."""
        return ArraySet(np.isin(self.automaton, np.array(sorted(states), dtype=np.int32)))

    def edges(self, edges: frozenset[tuple[int, int]]) -> ArraySet:
        """The pairs (s, q) for which (q, letter of s) is one of these."""
        own = zip(self.automaton.tolist(), self.letter[self.state].tolist(), strict=True)
        return ArraySet(np.fromiter((pair in edges for pair in own), bool, len(self.state)))

    def project(self, values: RationalValues) -> RationalValues:
        """For each base state, the value at its pair with the automaton's initial state."""
        return RationalValues(values.array[self.entry])

    def project_set(self, states: ArraySet) -> ArraySet:
        """The base states whose pair with the automaton's initial state is in the set."""
        return ArraySet(states.members[self.entry])


def product(base: Base, letters: Sequence[ArraySet], automaton: Automaton) -> ExactProduct:
    """The pairs reachable from (s, initial state) for every state s of the base model."""
    table = np.asarray(automaton.table, dtype=np.int32)
    letter = np.zeros(base.states, np.int32)
    for i, members in enumerate(letters):
        letter[members.members] |= 1 << i
    size = len(table)
    # Entries that hold their own place, so that the rationals can follow them into the product.
    places = replace(base.matrix, data=np.arange(base.matrix.entries, dtype=np.float64))
    keys = np.flatnonzero(reachable_pairs(places, table, letter, automaton.initial))
    state, second = (keys // size).astype(np.int32), (keys % size).astype(np.int32)
    number = np.full(base.states * size, -1, np.int32)
    number[keys] = np.arange(len(keys), dtype=np.int32)
    placed, rows = pair_matrix(places, table[second, letter[state]], state, number, size)
    values = base.rationals.values[placed.data.astype(np.int64)]
    shape = SparseMatrix(
        placed.indptr, placed.indices, values.astype(np.float64), placed.columns, placed.groups
    )
    engine = replace(
        base,
        table=tuple(base.table[s] for s in state),
        rationals=RationalMatrix(shape, values),
        initial=ArraySet(base.initial.members[state] & (second == automaton.initial)),
        deadlocks=ArraySet(base.deadlocks.members[state]),
        state_rewards=tuple(r[state] for r in base.state_rewards),
        row_rewards=tuple(r[rows] for r in base.row_rewards),
        name=f"{base.name} product",
    )
    entry = number[np.arange(base.states, dtype=np.int64) * size + automaton.initial].astype(
        np.int64
    )
    return ExactProduct(engine, state, second, entry, letter)
