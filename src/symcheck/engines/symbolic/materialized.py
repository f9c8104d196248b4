"""Materialized engines: models that were built as diagrams and are checked on compressed rows.

Diagrams explore in milliseconds a model that explicit exploration takes seconds for. A fixpoint of
many iterations, such as prob0 of a deep model, takes seconds on diagrams and milliseconds on rows.
A model whose rows fit well into memory is therefore explored as a diagram and checked as arrays.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.engines import tuning
from symcheck.engines.base import CapabilityT
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.system import SymbolicSystem
from symcheck.explicit.model import evaluate_states
from symcheck.explicit.states import StateLayout, StateTable
from symcheck.matrices.blocks import flatten, quad_dag
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics.model import BoundModel
from symcheck.symbolic.model import LazySequence
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.engines.symbolic.engine import SymbolicEngine

__all__ = ["MaterializedEngine", "MaterializedModel", "materialize"]


@dataclass(frozen=True)
class MaterializedEngine(ExplicitEngine):
    """States and rows as arrays; expressions are translated to diagrams, which is cheap."""

    source: SymbolicEngine = field(kw_only=True)

    def capability(self, kind: type[CapabilityT]) -> CapabilityT | None:
        """The engine as what offers `kind`, or the diagrams that it was materialized from; None
        where neither does.
        """
        offered = super().capability(kind)
        return self.source.capability(kind) if offered is None else offered

    @property
    def states(self) -> int:
        """Number of reachable states."""
        return self.source.states

    @property
    def transitions(self) -> int:
        """Number of stored transitions."""
        return self.source.transitions

    @property
    def choices(self) -> int:
        """Number of choices (states, where there is no nondeterminism)."""
        return self.source.choices

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables."""
        return ArraySet(self.source.to_bools(self.source.where(expression)))

    def valuations(
        self, states: ArraySet, limit: int | None = None, start: int = 0
    ) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order."""
        if limit is None:
            return super().valuations(states, limit, start)
        return self.source.valuations(self.source.from_bools(states.members), limit, start)


@dataclass(frozen=True, eq=False)
class MaterializedModel:
    """An explored model (see `symcheck.explicit.model.ExplicitModel`) read from diagrams.

    The rows are written on first use and kept. Rewards and actions are read from the diagrams at
    each use and not kept: most properties use none of them, and each takes as much memory as a
    vector of values.
    """

    source: SymbolicEngine = field(repr=False)
    system: SymbolicSystem = field(repr=False)

    @cached_property
    def matrix(self) -> SparseMatrix:
        """One-step probabilities (rates), deadlocks fixed."""
        # `system.weights` would keep the distinct sub-matrices as well.
        source, system = self.source, self.system
        indptr, indices, data = flatten(
            quad_dag(system.roots, system.odd, system.odd, source.diagrams.columns), system.layout
        )
        return SparseMatrix(indptr, indices, data, system.n, system.groups)

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        return self.source.model

    @cached_property
    def states(self) -> StateTable:
        """The states in the order of their numbers."""
        layout, encoding = StateLayout.of(self.model.variables), self.source.space.symbolic.encoding
        odd, size = self.source.diagrams.odd, tuning.DECODED_STATES
        parts = (np.arange(i, min(i + size, odd.count)) for i in range(0, odd.count, size))
        rows = [layout.pack(encoding.decode(odd.unrank(part))) for part in parts]
        return StateTable(layout, np.concatenate(rows))

    @cached_property
    def initial(self) -> Int64s:
        """Numbers of the initial states, ascending."""
        return np.flatnonzero(self.source.to_bools(self.source.initial))

    @cached_property
    def deadlocks(self) -> Int64s:
        """Numbers of the states that had no transition, ascending."""
        return np.flatnonzero(self.source.to_bools(self.source.deadlocks))

    @property
    def state_rewards(self) -> Sequence[Floats]:
        """Per structure, the reward of each state: float64[states]."""
        functions = self.source.diagrams.state_rewards
        return LazySequence([partial(self.system.odd.to_vector, f) for f in functions])

    @property
    def choice_rewards(self) -> Sequence[Floats]:
        """Per structure, the expected transition reward of each row: float64[rows]."""
        functions = self.source.diagrams.transition_rewards
        return LazySequence([partial(self.system.per_row, f) for f in functions])

    @property
    def choice_actions(self) -> Int32s:
        """Per row, the number of its action among the model's, -1 for none."""
        actions = self.system.row_actions()
        return np.full(self.matrix.rows, -1, np.int32) if actions is None else actions

    def evaluate(self, expression: Expression) -> NDArray[np.generic]:
        """Value of an expression in each state; ModelFault if it has none in some state."""
        return evaluate_states(self.model, self.states, expression)


def materialize(engine: SymbolicEngine) -> MaterializedEngine:
    """The same model with states and compressed rows as arrays, under the name 'sparse'.

    Args:
        engine: an engine whose states are in declaration order.

    Raises:
        OverflowError: the model has more than 2**31 - 1 states.
        ModelFault: a reward has no value in some state.
    """
    if engine.states >= 2**31:
        raise OverflowError(f"{engine.states:,} states are too many for rows of 32-bit numbers")
    diagrams = engine.diagrams
    for rewards in (diagrams.state_rewards, diagrams.transition_rewards):
        list(rewards)  # raises ModelFault now, not at the first use
    # Not `engine.system`, which the engine keeps: its rows would be a second copy.
    model = MaterializedModel(engine, SymbolicSystem(engine, engine.all))
    error = engine.entry_error
    return MaterializedEngine(model, name="sparse", source=engine, number_error=error)
