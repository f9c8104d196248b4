"""Quotients by bisimulation: the engine of the blocks, and lifting from blocks to states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symcheck.engines.base import Engine, OwnSet, OwnValues
from symcheck.engines.capabilities import HasBlocks, HasRationalTwin
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.explicit.explored import States
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import StateLayout, StateTable
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics.bisimulation import Lumping
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.engines.symbolic.bisimulation import LumpedDiagrams
    from symcheck.engines.symbolic.engine import SymbolicEngine

__all__ = [
    "ArrayQuotient",
    "DiagramQuotient",
    "ExplicitQuotient",
    "MaterializedQuotient",
    "Quotient",
]


class Quotient(Protocol):
    """A quotient as an engine, with lifting of its values and sets to the model."""

    @property
    def engine(self) -> ExplicitEngine:
        """The engine of the blocks."""
        ...

    @property
    def rounds(self) -> int:
        """Number of refinement rounds."""
        ...

    @property
    def cost(self) -> str:
        """How the quotient was computed, in words."""
        ...

    def lift(self, values: OwnValues) -> OwnValues:
        """Lift values of blocks to states."""
        ...

    def lift_set(self, states: OwnSet) -> OwnSet:
        """Lift a set of blocks to states."""
        ...


@dataclass(frozen=True, eq=False)
class QuotientModel:
    """An explicit model whose states are the blocks, represented by their first states.

    The states of a block agree in the atomic observations, but not in each label within these.
    """

    base: ExplicitEngine = field(repr=False)
    lumping: Lumping = field(repr=False)

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        return self.base.model

    @property
    def matrix(self) -> SparseMatrix:
        """The quotient's matrix."""
        return self.lumping.matrix

    def _blocks(self, states: ArraySet) -> Int64s:
        return np.unique(self.lumping.block[states.members]).astype(np.int64)

    @cached_property
    def initial(self) -> Int64s:
        """Blocks with an initial state."""
        return self._blocks(self.base.initial)

    @cached_property
    def deadlocks(self) -> Int64s:
        """Blocks with a deadlock state."""
        return self._blocks(self.base.deadlocks)

    @cached_property
    def states(self) -> States:
        """The first state of each block."""
        return self.base.explored.states.take(self.lumping.first)

    @property
    def state_rewards(self) -> list[Floats]:
        """Per reward structure, the state reward of each block's first state."""
        return [r[self.lumping.first] for r in self.base.explored.state_rewards]

    @property
    def choice_rewards(self) -> list[Floats]:
        """Per reward structure, the transition reward of each row."""
        return [r[self.lumping.rows] for r in self.base.explored.choice_rewards]

    @property
    def choice_actions(self) -> Int32s:
        """The action of each row."""
        actions: Int32s = self.base.explored.choice_actions
        return actions[self.lumping.rows]

    def evaluate(self, expression: Expression) -> NDArray[Any]:
        """The value of an expression in the first state of each block."""
        value = np.asarray(self.base.explored.evaluate(expression))
        return value if value.ndim == 0 else value[self.lumping.first]


@dataclass(frozen=True)
class BlockEngine(ExplicitEngine, HasBlocks, HasRationalTwin):
    """The explicit engine of the blocks."""

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return self.states

    def rational(self) -> Engine:
        """Raises UnsupportedError: rational arithmetic is used on the model, not on a quotient."""
        raise UnsupportedError("a quotient is not computed in rational arithmetic")


@dataclass(frozen=True)
class QuotientEngine(BlockEngine):
    """The engine of the blocks of explicit states."""

    base: ExplicitEngine | None = field(default=None, repr=False)
    lumping: Lumping | None = field(default=None, repr=False)

    def where(self, expression: Expression) -> ArraySet:
        """The blocks whose first states satisfy an expression."""
        assert self.base is not None
        assert self.lumping is not None
        return ArraySet(self.base.where(expression).members[self.lumping.first])


@dataclass(frozen=True, eq=False)
class ExplicitQuotient:
    """The quotient of an explicit engine."""

    base: ExplicitEngine = field(repr=False)
    lumping: Lumping = field(repr=False)

    @cached_property
    def engine(self) -> ExplicitEngine:
        """The engine of the blocks."""
        model: Any = QuotientModel(self.base, self.lumping)
        return QuotientEngine(model, base=self.base, lumping=self.lumping)

    @property
    def rounds(self) -> int:
        """Number of refinement rounds."""
        return self.lumping.rounds

    @property
    def cost(self) -> str:
        """How the quotient was computed, in words."""
        return f"{self.rounds} rounds on listed states"

    def lift(self, values: ArrayValues) -> ArrayValues:
        """Lift values of blocks to states."""
        return _spread(values, self.lumping.block)

    def lift_set(self, states: ArraySet) -> ArraySet:
        """Lift a set of blocks to states."""
        return ArraySet(states.members[self.lumping.block])


def _spread(values: ArrayValues, block: Int32s | Int64s) -> ArrayValues:
    """The value of each state: that of its block."""
    lower = values.lower[block]
    upper = lower if values.upper is values.lower else values.upper[block]
    return ArrayValues(
        lower, upper, None if values.computed is None else values.computed[block], values.slack
    )


@dataclass(frozen=True, eq=False)
class MaterializedQuotient(ExplicitQuotient):
    """The quotient of a symbolic engine, computed on materialized rows."""

    source: SymbolicEngine = field(repr=False)

    def lift(self, values: ArrayValues) -> Any:
        """Lift values of blocks to states."""
        from symcheck.engines.symbolic.sets import Piece, SymbolicValues

        d = self.source.diagrams
        return SymbolicValues(d, (Piece(d.states, super().lift(values), d.odd),))

    def lift_set(self, states: ArraySet) -> Any:
        """Lift a set of blocks to states."""
        return self.source.from_bools(super().lift_set(states).members)


class _Chosen(list[Floats]):
    """Rewards of the structures that the partition respects; others are empty."""

    def __init__(self, rewards: Mapping[int, Floats]) -> None:
        super().__init__(rewards.get(i, np.empty(0)) for i in range(max(rewards, default=-1) + 1))


@dataclass(frozen=True, eq=False)
class DiagramQuotient:
    """The quotient of a symbolic engine, computed on diagrams."""

    source: SymbolicEngine = field(repr=False)
    lumped: LumpedDiagrams

    @cached_property
    def engine(self) -> ExplicitEngine:
        """The engine of the blocks, with values of their first states; choices have no actions."""
        lumped, encoding = self.lumped, self.source.space.symbolic.encoding
        layout = StateLayout.of(self.source.model.variables)
        codes = encoding.codes(lumped.members)
        table = StateTable(layout, layout.pack(list(np.ascontiguousarray(codes.T))))
        d = lumped.diagrams
        model = ExplicitModel(
            self.source.model,
            table,
            lumped.matrix,
            np.full(lumped.matrix.rows, -1, np.int32),
            lumped.meeting(d.initial),
            lumped.meeting(d.deadlocks),
            _Chosen({i: lumped.at_members(d.state_rewards[i]) for i in lumped.rewards}),
            _Chosen(lumped.rewards),
        )
        return BlockEngine(model)

    @property
    def rounds(self) -> int:
        """Number of refinement rounds."""
        return self.lumped.rounds

    @property
    def cost(self) -> str:
        """How the quotient was computed, in words."""
        return (
            f"{self.rounds} rounds on diagrams, {self.lumped.nodes:,} nodes and signatures, "
            f"{self.lumped.seconds:.2f} s"
        )

    def lift(self, values: ArrayValues) -> Any:
        """Lift values of blocks to states."""
        return self.lumped.lift(values)

    def lift_set(self, states: ArraySet) -> Any:
        """Lift a set of blocks to states."""
        return self.lumped.lift_set(states.members)


@dataclass(frozen=True, eq=False)
class ArrayQuotient(DiagramQuotient):
    """The quotient of an explicit engine, computed on its diagrams and lifted to arrays."""

    @cached_property
    def _block(self) -> Int64s:
        return self.lumped.block_of_states()

    def lift(self, values: ArrayValues) -> ArrayValues:
        """Lift values of blocks to states."""
        return _spread(values, self._block)

    def lift_set(self, states: ArraySet) -> ArraySet:
        """Lift a set of blocks to states."""
        return ArraySet(states.members[self._block])
