"""Quotients by bisimulation: the engine of the blocks, and lifting from blocks to states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from symcheck.engines.base import Engine, StateSet, V, V_co, Values, erased
from symcheck.engines.capabilities import HasBlocks, HasRationalTwin
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.rational_values import RationalValues, in_doubles
from symcheck.errors import UnsupportedError
from symcheck.explicit.explored import States
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import StateLayout, StateTable
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics.bisimulation import Lumping
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.engines.symbolic.bisimulation import LumpedDiagrams
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.engines.symbolic.sets import SymbolicSet, SymbolicValues

__all__ = [
    "ArrayLifting",
    "Lifting",
    "MaterializedLifting",
    "Quotient",
    "lumped_diagrams_engine",
    "lumped_engine",
]

S_co = TypeVar("S_co", bound=StateSet, covariant=True)


class Lifting(Protocol[S_co, V_co]):
    """Lifts sets and values of blocks to the states of the engine that was reduced."""

    def lift(self, values: ArrayValues) -> V_co:
        """The value of each state: that of its block."""
        ...

    def lift_set(self, blocks: Bools) -> S_co:
        """The states of some blocks, bool[blocks]."""
        ...


@dataclass(frozen=True, eq=False)
class Quotient:
    """A quotient: the engine of the blocks, with lifting of its values and sets to the model.

    Attributes:
        engine: the engine of the blocks.
        rounds: number of refinement rounds.
        cost: how the quotient was computed, in words.
        lifting: to the states of the model's engine.
    """

    engine: Engine
    rounds: int
    cost: str
    lifting: Lifting[StateSet, Values] = field(repr=False)

    @classmethod
    def of(
        cls, engine: ExplicitEngine, rounds: int, cost: str, lifting: Lifting[StateSet, V]
    ) -> Quotient:
        """The quotient. What it lifts to are sets and values of the engine that was reduced."""
        # As in `engines.base.erased`: only that engine receives the values.
        return cls(erased(engine), rounds, cost, cast(Lifting[StateSet, Values], lifting))

    @classmethod
    def of_rows(cls, rows: ExplicitEngine, source: SymbolicEngine) -> Quotient:
        """The rows of diagrams, each of whose states is a block."""
        each = np.arange(rows.states, dtype=np.int32)
        return cls.of(rows, 0, "", MaterializedLifting(source, each))

    def lift(self, values: Values) -> Values:
        """Lift values of blocks to states."""
        assert isinstance(values, ArrayValues | RationalValues)
        return self.lifting.lift(in_doubles(values))

    def lift_set(self, states: StateSet) -> StateSet:
        """Lift a set of blocks to states."""
        return self.lifting.lift_set(self.engine.to_bools(states))


@dataclass(frozen=True, eq=False)
class ArrayLifting:
    """To arrays over the states. block: the block of each state, int[states]."""

    block: Int32s | Int64s = field(repr=False)

    def lift(self, values: ArrayValues) -> ArrayValues:
        """The value of each state: that of its block."""
        return values.gather(self.block)

    def lift_set(self, blocks: Bools) -> ArraySet:
        """The states of some blocks."""
        return ArraySet(blocks[self.block])


@dataclass(frozen=True, eq=False)
class MaterializedLifting:
    """To sets and values of a symbolic engine whose states have a block each, int[states]."""

    source: SymbolicEngine = field(repr=False)
    block: Int32s = field(repr=False)

    def lift(self, values: ArrayValues) -> SymbolicValues:
        """The value of each state: that of its block."""
        from symcheck.engines.symbolic.sets import Piece, SymbolicValues

        d = self.source.diagrams
        return SymbolicValues(d, (Piece(d.states, values.gather(self.block), d.odd),))

    def lift_set(self, blocks: Bools) -> SymbolicSet:
        """The states of some blocks."""
        return self.source.from_bools(blocks[self.block])


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

    def evaluate(self, expression: Expression) -> NDArray[np.generic]:
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


def _chosen(rewards: Mapping[int, Floats]) -> list[Floats]:
    """Rewards of the structures that the partition respects; others are empty."""
    return [rewards.get(i, np.empty(0)) for i in range(max(rewards, default=-1) + 1)]


def lumped_engine(base: ExplicitEngine, lumping: Lumping) -> ExplicitEngine:
    """The engine of the blocks of explicit states."""
    return QuotientEngine(QuotientModel(base, lumping), base=base, lumping=lumping)


def lumped_diagrams_engine(source: SymbolicEngine, lumped: LumpedDiagrams) -> ExplicitEngine:
    """The engine of the blocks, with values of their first states; choices have no actions."""
    layout = StateLayout.of(source.model.variables)
    columns = source.space.symbolic.encoding.decode(lumped.members)
    d = lumped.diagrams
    model = ExplicitModel(
        source.model,
        StateTable(layout, layout.pack(columns)),
        lumped.matrix,
        np.full(lumped.matrix.rows, -1, np.int32),
        lumped.meeting(d.initial),
        lumped.meeting(d.deadlocks),
        _chosen({i: lumped.at_members(d.state_rewards[i]) for i in lumped.rewards}),
        _chosen(lumped.rewards),
    )
    return BlockEngine(model)
