"""The product of an explicitly stored model with an automaton: the pairs that may be reached, and
their rows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from symcheck.engines import tuning
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.base import ExplicitOwner, Numeric
from symcheck.errors import MemoryLimitError
from symcheck.explicit.explored import ExploredModel, States
from symcheck.kernels.graph import product as kernel
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.engines.base import Automaton, EngineOf

__all__ = ["Base", "ExplicitProduct", "ProductModel", "pair_matrix", "product", "reachable_pairs"]


class Base(ExplicitOwner, Protocol):
    """The engine that a product is built from."""

    @property
    def explored(self) -> ExploredModel:
        """The explored model."""
        ...


@dataclass(frozen=True, eq=False)
class ProductModel:
    """The pairs as a model: state p is the pair (state[p], automaton[p]), in this order.

    A pair has the variables, rewards and actions of its state.
    """

    base: Base = field(repr=False)
    state: Int32s = field(repr=False)
    automaton: Int32s = field(repr=False)
    matrix: SparseMatrix = field(repr=False)
    rows: Int64s = field(repr=False)
    """The row of the base matrix that each row comes from."""
    first: int = 0
    """The automaton's initial state."""

    @property
    def model(self) -> BoundModel:
        """The base model, whose variables the pairs have."""
        return self.base.model

    @cached_property
    def initial(self) -> Int64s:
        """Pairs of an initial state and the automaton's initial state."""
        return np.flatnonzero(
            self.base.initial.members[self.state] & (self.automaton == self.first)
        )

    @cached_property
    def deadlocks(self) -> Int64s:
        """Pairs of a deadlock state."""
        return np.flatnonzero(self.base.deadlocks.members[self.state])

    @cached_property
    def states(self) -> States:
        """The state of each pair."""
        return self.base.explored.states.take(self.state)

    @property
    def state_rewards(self) -> list[Floats]:
        """Per reward structure, the state reward of each pair."""
        return [r[self.state] for r in self.base.explored.state_rewards]

    @property
    def choice_rewards(self) -> list[Floats]:
        """Per reward structure, the transition reward of each row."""
        return [r[self.rows] for r in self.base.explored.choice_rewards]

    @property
    def choice_actions(self) -> Int32s:
        """The action of each row."""
        actions: Int32s = self.base.explored.choice_actions
        return actions[self.rows]

    def evaluate(self, expression: Expression) -> NDArray[np.generic]:
        """The value of an expression over the variables in each pair."""
        value = np.asarray(self.base.explored.evaluate(expression))
        return value if value.ndim == 0 else value[self.state]


@dataclass(frozen=True, eq=False)
class ExplicitProduct:
    """See `symcheck.engines.base.Product`. `entry`: per base state, the pair with the
    automaton's initial state.
    """

    engine: EngineOf[ArraySet, Numeric]
    pairs: ProductModel = field(repr=False)
    entry: Int64s = field(repr=False)
    letter: Int32s = field(repr=False)

    def lift(self, states: ArraySet) -> ArraySet:
        """The pairs whose first part is in the set."""
        return ArraySet(states.members[self.pairs.state])

    def automaton_states(self, states: frozenset[int]) -> ArraySet:
        """The pairs whose second part is one of these."""
        return ArraySet(np.isin(self.pairs.automaton, np.array(sorted(states), dtype=np.int32)))

    def edges(self, edges: frozenset[tuple[int, int]]) -> ArraySet:
        """The pairs (s, q) for which (q, letter of s) is one of these."""
        if not edges:
            return ArraySet(np.zeros(len(self.pairs.state), bool))
        width = int(self.letter.max(initial=0)) + 1
        requested = np.zeros((int(self.pairs.automaton.max(initial=0)) + 1, width), bool)
        for q, letter in edges:
            if q < len(requested) and letter < width:
                requested[q, letter] = True
        return ArraySet(requested[self.pairs.automaton, self.letter[self.pairs.state]])

    def project(self, values: Numeric) -> Numeric:
        """For each base state, the value at its pair with the automaton's initial state."""
        return values.gather(self.entry)

    def project_set(self, states: ArraySet) -> ArraySet:
        """The base states whose pair with the automaton's initial state is in the set."""
        return ArraySet(states.members[self.entry])


def product(
    base: Base,
    letters: Sequence[ArraySet],
    automaton: Automaton,
    over: Callable[[ProductModel], EngineOf[ArraySet, Numeric]],
) -> ExplicitProduct:
    """The product of an engine with an automaton.

    It contains the pairs reachable from (s, initial state) for every state s of the base model.
    Building takes a byte for each possible pair.

    Raises:
        MemoryLimitError: there are more than 2**33 possible pairs, or 2**31 reachable ones.
    """
    table = np.asarray(automaton.table, dtype=np.int32)
    letter = np.zeros(base.states, np.int32)
    for i, members in enumerate(letters):
        letter[members.members] |= 1 << i
    size = table.shape[0]
    if base.states * size > tuning.PRODUCT_PAIRS:
        raise MemoryLimitError(
            f"the product with an automaton of {size} states is too large for the explicit engine"
        )
    reachable = reachable_pairs(base.weights, table, letter, automaton.initial)
    count = int(np.count_nonzero(reachable))
    if count >= 2**31:
        raise MemoryLimitError(
            f"the product with an automaton of {size} states has {count:,} states: "
            "too many for the explicit engine"
        )
    state, second, number = (
        np.empty(count, np.int32),
        np.empty(count, np.int32),
        np.empty(len(reachable), np.int32),
    )
    kernel.number_pairs(reachable.view(np.uint8), size, state, second, number)
    del reachable
    matrix, rows = pair_matrix(base.weights, table[second, letter[state]], state, number, size)
    model = ProductModel(base, state, second, matrix, rows, automaton.initial)
    entry = number[automaton.initial :: size].astype(np.int64)
    return ExplicitProduct(over(model), model, entry, letter)


def _entries(matrix: SparseMatrix) -> Int64s:
    """Where the entries of each state begin: int64[states+1]."""
    return matrix.indptr if matrix.groups is None else matrix.indptr[matrix.groups]


def reachable_pairs(
    matrix: SparseMatrix, table: Int32s, letter: Int32s, initial: int
) -> NDArray[np.bool_]:
    """Which pairs (numbered state * size + automaton state) are reachable from (s, initial) for
    some s.
    """
    reachable = np.zeros(matrix.states * table.shape[0], np.uint8)
    kernel.mark_reachable(
        _entries(matrix), matrix.indices, np.ascontiguousarray(table), letter, initial, reachable
    )
    return reachable.view(np.bool_)


def pair_matrix(
    matrix: SparseMatrix, following: Int32s, state: Int32s, number: Int32s, size: int
) -> tuple[SparseMatrix, Int64s]:
    """The rows of the pairs, in their order, and the base row of each."""
    if matrix.groups is None:
        rows, groups, after = state.astype(np.int64), None, following
    else:
        per_state = np.diff(matrix.groups)[state]
        rows = spans(matrix.groups[:-1][state], matrix.groups[1:][state])
        groups = starts_of(per_state)
        after = np.repeat(following, per_state)
    indptr = starts_of(matrix.lengths[rows])
    indices, data = np.empty(int(indptr[-1]), np.int32), np.empty(int(indptr[-1]))
    kernel.product_rows(
        matrix.indptr,
        matrix.indices,
        matrix.handles,
        rows,
        after,
        number,
        size,
        indptr,
        indices,
        data,
    )
    return SparseMatrix(indptr, indices, matrix.from_handles(data), len(state), groups), rows
