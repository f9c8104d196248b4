"""From diagrams to arrays: a model that was built symbolically, written out as states and compressed rows.

Diagrams explore in milliseconds what a search takes seconds for; but a fixpoint of many iterations on them, such as prob0 of
a deep model, takes seconds where one pass over rows takes milliseconds. So a model whose rows fit well into memory is
explored as a diagram and checked as arrays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from symcheck.engines.arrays import ArraySet
from symcheck.engines.explicit import ExplicitEngine
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import Layout, Rows, StateTable
from symcheck.numerics.matrix import Int64s
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.engines.symbolic import SymbolicEngine

__all__ = ["WrittenEngine", "stored_states", "written_out"]


@dataclass(frozen=True)
class WrittenEngine(ExplicitEngine):
    """States and rows as arrays; which states satisfy an expression is still asked of the diagrams, where it costs nothing."""

    source: SymbolicEngine | None = None

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables."""
        assert self.source is not None
        return ArraySet(self.source.to_bools(self.source.where(expression)))

    def valuations(self, states: ArraySet, limit: int | None = None) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order."""
        assert self.source is not None
        if limit is None:
            return super().valuations(states)
        return self.source.valuations(self.source.from_bools(states.members), limit)


def written_out(engine: SymbolicEngine) -> WrittenEngine:
    """The same model with its states and rows as arrays, under the name 'sparse'. Its states must be in declaration order.

    Raises OverflowError for more than 2**31 - 1 states, ModelFault for a reward that has no value.
    """
    system = engine.system(engine.all)
    matrix = system.matrix
    actions = system.actions
    rewards = [system.rewards(i) for i in range(len(engine.model.rewards))]
    model = ExplicitModel(
        engine.model,
        _States(engine),
        matrix,
        np.full(matrix.rows, -1, np.int32) if actions is None else actions,
        np.flatnonzero(engine.to_bools(engine.initial)),
        np.flatnonzero(engine.to_bools(engine.deadlocks)),
        [r[0] for r in rewards],
        [r[1] for r in rewards],
    )
    return WrittenEngine(model, name="sparse", source=engine)


def stored_states(engine: SymbolicEngine) -> StateTable:
    """The reachable states in the order of their numbers, as a table that is filled when it is first looked into."""
    return _States(engine)


class _States(StateTable):
    """The reachable states as packed rows, made when they are first asked for: most checks never do."""

    def __init__(self, engine: SymbolicEngine) -> None:
        object.__setattr__(self, "layout", Layout.of(engine.model.variables))
        object.__setattr__(self, "_engine", engine)

    def __len__(self) -> int:
        return self._source.states

    @property
    def _source(self) -> SymbolicEngine:
        engine: SymbolicEngine = self.__dict__["_engine"]
        return engine

    @cached_property
    def rows(self) -> Rows:
        """uint64[states, words]."""
        encoding, odd = self._source.space.symbolic.encoding, self._source.diagrams.odd
        columns: list[Int64s] = []
        for variable in encoding.variables:
            weights = np.zeros(len(odd.rows), np.int64)
            for place, bit in enumerate(reversed(variable.rows)):
                weights[odd.rows.index(bit)] = 1 << place
            columns.append(odd.weigh(weights, variable.low))
        return self.layout.pack(columns)
