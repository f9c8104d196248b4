"""The equations over some states, from diagrams: only the needed rows are written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from symcheck.dd.manager import Mtbdd
from symcheck.dd.odd import Odd
from symcheck.direction import Direction
from symcheck.engines.base import Number
from symcheck.engines.explicit.array_values import around
from symcheck.engines.explicit.rational_values import in_doubles
from symcheck.engines.linear_system import LinearSystem, Preprocessing
from symcheck.engines.reward_sums import RewardSums
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import (
    Piece,
    SymbolicOwner,
    SymbolicSet,
    SymbolicValues,
    array_piece,
    constants_on,
    merged,
)
from symcheck.explicit.explored import RACE
from symcheck.kernels.diagrams.quad_dag import QuadDag
from symcheck.matrices.blocks import BlockMatrix, RowLayout, blocks, flatten, quad_dag
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics.rewards import Reward

__all__ = ["SymbolicSystem"]


class Owner(SymbolicOwner, Protocol):
    """The engine of a system."""

    def operator(self, system: SymbolicSystem) -> SparseMatrix | SweepOperator:
        """The weights of a system in the engine's form."""
        ...

    @property
    def reward_sums(self) -> RewardSums:
        """The sums of rewards that floating point gets wrong."""
        ...

    @property
    def preprocessing(self) -> Sequence[Preprocessing[SymbolicSet, SymbolicValues]]:
        """Steps that may shorten equations, in the order in which they are tried."""
        ...


@dataclass(frozen=True, eq=False)
class SymbolicSystem(LinearSystem[SymbolicSet, SymbolicValues]):
    """See `symcheck.engines.base.System`. States are numbered by an ODD of their own."""

    engine: Owner = field(repr=False)
    states: SymbolicSet
    direction: Direction | None = None

    @property
    def _d(self) -> Diagrams:
        return self.engine.diagrams

    @property
    def odd(self) -> Odd:
        """Numbers of the unknowns."""
        return self.states.odd

    @cached_property
    def n(self) -> int:
        """Number of unknowns."""
        return self.states.count

    @cached_property
    def layout(self) -> RowLayout | None:
        """Rows of each state and choice class of each row; None where each state has one row."""
        if self._d.guards is None:
            return None
        return RowLayout.of([self.odd.to_mask(guard) for guard in self._d.guards], self.n)

    @property
    def groups(self) -> Int64s | None:
        """Which of the rows belong to which state; None where each has one."""
        return None if self.layout is None else self.layout.groups

    @cached_property
    def actions(self) -> Int32s | None:
        """Per row of an MDP: the number of its action among the model's, -1 for none."""
        return self.row_actions()

    def row_actions(self) -> Int32s | None:
        """`actions`, computed anew and not kept."""
        if self.layout is None:
            return None
        numbers = {name: i for i, name in enumerate(self.engine.model.actions)}
        out = np.full(self.layout.rows, -1, np.int32)
        if self.takes_time is not None:
            out[self.takes_time] = RACE
        for class_number, (present, rows) in enumerate(self.layout.each()):
            for (of, action), states in self._d.actions.items():
                if of == class_number and action is not None:
                    out[rows[self.odd.to_mask(states)[present]]] = numbers[action]
        return out

    @cached_property
    def roots(self) -> tuple[Mtbdd, ...]:
        """The matrices on the rows of the states, columns anywhere."""
        if self.states.bdd == self._d.states:
            return tuple(self._d.roots)
        return tuple(root.times_bdd(self.states.bdd) for root in self._d.roots)

    @cached_property
    def dag(self) -> QuadDag:
        """The distinct sub-matrices among the states."""
        return quad_dag(self.roots, self.odd, self.odd, self._d.columns)

    @cached_property
    def weights(self) -> SparseMatrix:
        """The weights among the states, as compressed rows."""
        indptr, indices, data = flatten(self.dag, self.layout)
        return SparseMatrix(indptr, indices, data, self.n, self.groups)

    @property
    def has_rows(self) -> bool:
        """Whether equations should be solved on `matrix`: it has no more entries than the engine is
        ready to write out.
        """
        limit = self.engine.rows_limit
        return limit is None or int(self.dag.entries.sum()) <= limit

    @cached_property
    def blocks(self) -> BlockMatrix:
        """The matrix among the states, as blocks."""
        return blocks(self.dag, self.layout)

    @cached_property
    def weight_operator(self) -> SparseMatrix | SweepOperator:
        """The weights in the engine's own form."""
        return self.engine.operator(self)

    @property
    def continuous_time(self) -> bool:
        """Whether entries of the matrix are rates."""
        return self.engine.model.type.continuous_time

    @cached_property
    def takes_time(self) -> Bools | None:
        """The rows whose weights are rates, in a Markov automaton: those of the first class."""
        if self.layout is None or not self.continuous_time:
            return None
        out = np.zeros(self.layout.rows, np.bool_)
        _, rows = next(iter(self.layout.each()))
        out[rows] = True
        return out

    @property
    def has_end_components(self) -> bool:
        """Whether some end component lies within the states (MDP)."""
        return next(self.engine.graph.end_components(self.states), None) is not None

    @property
    def entry_error(self) -> float:
        """That of the engine."""
        return self.engine.entry_error

    @property
    def reward_sums(self) -> RewardSums:
        """The sums of rewards of the engine that floating point gets wrong."""
        return self.engine.reward_sums

    @property
    def preprocessing(self) -> Sequence[Preprocessing[SymbolicSet, SymbolicValues]]:
        """Steps that may shorten the equations, in the order in which they are tried."""
        return self.engine.preprocessing

    def infinite_rewards(self, reward: Reward) -> SymbolicSet:
        """The states with a row that earns an infinite reward."""
        d, inf = self._d, np.inf
        states, transitions = d.rewards(reward)
        functions = (states, *transitions)
        sets = [f.equal(inf) for f in functions if f.maximum_leaf == inf]
        return SymbolicSet(d, d.union(sets) & self.states.bdd if sets else d.manager.false)

    def per_row(self, functions: Sequence[Mtbdd]) -> Floats:
        """A value per row from a function of the state per choice class."""
        if self.layout is None:
            return self.odd.to_vector(functions[0])
        out = np.empty(self.layout.rows)
        for function, (present, rows) in zip(functions, self.layout.each(), strict=True):
            out[rows] = self.odd.to_vector(function)[present]
        return out

    def weight_into(self, target: SymbolicSet) -> Floats:
        """Per row: the sum of the weights that lead into the target."""
        d = self._d
        columns = target.bdd.rename(d.to_columns).to_mtbdd()
        return self.per_row([root.multiply_sum(columns, d.column_cube) for root in self.roots])

    def weighted_values(self, values: SymbolicValues) -> tuple[Floats, Floats]:
        """Per row: sum over successors outside of the states of weight × value (lower, upper)."""
        outside = ~self.states
        lower: Floats = np.zeros(self.rows)
        upper = lower if values.is_point else lower.copy()
        for piece in values.pieces:
            target = SymbolicSet(self._d, piece.states & outside.bdd)
            if not target:
                continue
            add_low, add_high = self._weighted(piece, target)
            lower += add_low
            if upper is not lower:
                upper += add_high
        return lower, upper

    def _weighted(self, piece: Piece, target: SymbolicSet) -> tuple[Floats, Floats]:
        if piece.constant:
            weight = self.weight_into(target)
            low, high = float(piece.values.lower[0]), float(piece.values.upper[0])
            with np.errstate(invalid="ignore"):  # nothing times infinity is nothing here
                return np.where(weight > 0, weight * low, 0.0), np.where(
                    weight > 0, weight * high, 0.0
                )
        values = in_doubles(piece.over(target.bdd, target.odd))
        dag = quad_dag(self.roots, self.odd, target.odd, self._d.columns)
        matrix = blocks(dag, self.layout)
        low_part = matrix.multiply(values.lower)
        return low_part, low_part if values.upper is values.lower else matrix.multiply(values.upper)

    def weight_sums(self) -> Floats:
        """Per row: the sum of all weights."""
        if self.engine.has_rows and self.states.bdd == self._d.states:
            return self.weights.row_sums()  # which has all successors; diagrams take longer
        return self.per_row([root.sum_over(self._d.column_cube) for root in self.roots])

    def rewards(self, reward: Reward) -> tuple[Floats, Floats]:
        """State rewards per state and transition rewards per row."""
        states, transitions = self._d.rewards(reward)
        return self.odd.to_vector(states), self.per_row(transitions)

    def restrict(self, values: SymbolicValues | SymbolicSet) -> Floats:
        """A lower value (or 0/1 membership) per state of the system."""
        if isinstance(values, SymbolicSet):
            return self.odd.to_mask(values.bdd).astype(np.float64)
        return values.at(self.states)[0]

    def full(self, value: Number) -> Floats:
        """The same number for each state of the system."""
        return np.full(self.n, float(value))

    def lift(
        self,
        lower: Floats,
        upper: Floats | None,
        rest: Sequence[tuple[SymbolicSet, float]] = (),
        up_to_rounding: bool = False,
    ) -> SymbolicValues:
        """Values on all states: these on the states of the system, constants on the sets in `rest`,
        0 elsewhere.
        """
        d = self._d
        pieces = []
        if self.states:
            if up_to_rounding and upper is None:
                lower, upper = around(lower)
            same = upper is None or upper is lower
            pieces.append(
                array_piece(
                    self.states.bdd, self.odd, lower, None if same else upper, up_to_rounding
                )
            )
        pieces.extend(constants_on(d.states - self.states.bdd, rest))
        return SymbolicValues(d, merged(d, pieces))
