"""Quotients by bisimulation as engines, and the way back from blocks to states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from symcheck.engines.base import OwnSet, OwnValues
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import Layout, StateTable
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics.bisimulation import Lumping
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.engines.symbolic.bisimulation import LumpedDiagrams
    from symcheck.engines.symbolic.engine import SymbolicEngine

__all__ = ["BothQuotient", "DiagramQuotient", "ListedQuotient", "Quotient", "WrittenQuotient"]


class Quotient(Protocol):
    """The quotient as an engine, and the way back. `cost`: how it was found, in words."""

    @property
    def engine(self) -> ExplicitEngine:
        """The blocks as states."""
        ...

    @property
    def rounds(self) -> int:
        """Rounds of refinement."""
        ...

    @property
    def cost(self) -> str:
        """How it was found, in words."""
        ...

    def lift(self, values: OwnValues) -> OwnValues:
        """Values of blocks as values of states."""
        ...

    def lift_set(self, states: OwnSet) -> OwnSet:
        """Blocks as states."""
        ...


@dataclass(frozen=True, eq=False)
class LumpedModel:
    """The blocks as states: what is asked of a block is asked of its first state.

    All of them agree in what a formula says of them as a whole; not in each label that it combines.
    """

    base: ExplicitEngine = field(repr=False)
    lumping: Lumping = field(repr=False)

    @property
    def model(self) -> BoundModel:
        """The base model, whose variables the blocks have."""
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
    def states(self) -> StateTable:
        """The first state of each block."""
        table = self.base.explored.states
        return StateTable(table.layout, table.rows[self.lumping.first])

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
class BlockEngine(ExplicitEngine):
    """The explicit engine on blocks."""

    def rational(self) -> Any:
        """Not to be had: raises UnsupportedError, so that what only rationals decide is decided on the model itself."""
        raise UnsupportedError("a quotient is not computed in rational arithmetic")


@dataclass(frozen=True)
class LumpedEngine(BlockEngine):
    """The blocks of listed states."""

    base: ExplicitEngine | None = field(default=None, repr=False)
    lumping: Lumping | None = field(default=None, repr=False)

    def where(self, expression: Expression) -> ArraySet:
        """The blocks whose first states satisfy an expression."""
        assert self.base is not None
        assert self.lumping is not None
        return ArraySet(self.base.where(expression).members[self.lumping.first])


@dataclass(frozen=True, eq=False)
class ListedQuotient:
    """Of listed states."""

    base: ExplicitEngine = field(repr=False)
    lumping: Lumping = field(repr=False)

    @cached_property
    def engine(self) -> ExplicitEngine:
        """The blocks as states."""
        model: Any = LumpedModel(self.base, self.lumping)
        return LumpedEngine(model, base=self.base, lumping=self.lumping)

    @property
    def rounds(self) -> int:
        """Rounds of refinement."""
        return self.lumping.rounds

    @property
    def cost(self) -> str:
        """How it was found."""
        return f"{self.rounds} rounds on listed states"

    def lift(self, values: ArrayValues) -> ArrayValues:
        """Values of blocks as values of states."""
        return _spread(values, self.lumping.block)

    def lift_set(self, states: ArraySet) -> ArraySet:
        """Blocks as states."""
        return ArraySet(states.members[self.lumping.block])


def _spread(values: ArrayValues, block: Int32s | Int64s) -> ArrayValues:
    """Values of blocks as values of the states that are in them."""
    lower = values.lower[block]
    upper = lower if values.upper is values.lower else values.upper[block]
    return ArrayValues(
        lower, upper, None if values.computed is None else values.computed[block], values.slack
    )


@dataclass(frozen=True, eq=False)
class WrittenQuotient(ListedQuotient):
    """Of the states of diagrams, which were listed for it."""

    source: SymbolicEngine = field(repr=False)

    def lift(self, values: ArrayValues) -> Any:
        """Values of blocks as values of states."""
        from symcheck.engines.symbolic.sets import Piece, SymbolicValues

        d = self.source.diagrams
        return SymbolicValues(d, (Piece(d.states, super().lift(values), d.odd),))

    def lift_set(self, states: ArraySet) -> Any:
        """Blocks as states."""
        return self.source.from_bools(super().lift_set(states).members)


class _Chosen(list[Floats]):
    """Rewards of the structures that the partition respects; the others are not to be asked for."""

    def __init__(self, rewards: Mapping[int, Floats]) -> None:
        super().__init__(rewards.get(i, np.empty(0)) for i in range(max(rewards, default=-1) + 1))


@dataclass(frozen=True, eq=False)
class DiagramQuotient:
    """Of states that are held on diagrams, and never listed."""

    source: SymbolicEngine = field(repr=False)
    lumped: LumpedDiagrams

    @cached_property
    def engine(self) -> ExplicitEngine:
        """The blocks as states, each with the variables of its first state. Rows of an MDP have no actions."""
        lumped, encoding = self.lumped, self.source.space.symbolic.encoding
        layout = Layout.of(self.source.model.variables)
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
        """Rounds of refinement."""
        return self.lumped.rounds

    @property
    def cost(self) -> str:
        """How it was found."""
        return f"{self.rounds} rounds on diagrams, {self.lumped.nodes:,} nodes and signatures, {self.lumped.seconds:.2f} s"

    def lift(self, values: ArrayValues) -> Any:
        """Values of blocks as values of states."""
        return self.lumped.lift(values)

    def lift_set(self, states: ArraySet) -> Any:
        """Blocks as states."""
        return self.lumped.lift_set(states.members)


@dataclass(frozen=True, eq=False)
class BothQuotient(DiagramQuotient):
    """Of listed states whose diagrams are still there: found on these, and lifted to arrays."""

    @cached_property
    def _block(self) -> Int64s:
        return self.lumped.block_of_states()

    def lift(self, values: ArrayValues) -> ArrayValues:
        """Values of blocks as values of states."""
        return _spread(values, self._block)

    def lift_set(self, states: ArraySet) -> ArraySet:
        """Blocks as states."""
        return ArraySet(states.members[self._block])
