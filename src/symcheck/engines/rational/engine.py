"""An engine over rational numbers: states explored one by one, arrays of Fraction objects. For models of moderate size.

It shares no code with the other builders (it uses `symcheck.semantics.interpreter`), and so it is also their oracle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import isinf
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.base import Enumerated
from symcheck.engines.explicit.graph import ExplicitGraph
from symcheck.engines.rational.values import RationalMatrix, Rationals, RationalValues
from symcheck.errors import ModelFault, UnsupportedError
from symcheck.matrices.rows import SparseMatrix
from symcheck.semantics import state_faults
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.interpreter import (
    State,
    initial_states,
    state_rewards,
    transitions,
    valuation,
)
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, Steps, Structure, Time
from symcheck.syntax.ast import Expression, ModelType, Type

__all__ = ["ExactEngine", "explore_exactly"]


@dataclass(frozen=True, eq=False)
class ExactEngine(Enumerated):
    """A model explored in rational arithmetic. `table`: the states in index order; `rewards`: per structure, for states and rows."""

    model: BoundModel
    table: tuple[State, ...] = field(repr=False)
    rationals: RationalMatrix = field(repr=False)
    initial: ArraySet
    deadlocks: ArraySet
    state_rewards: tuple[Rationals, ...] = field(repr=False)
    row_rewards: tuple[Rationals, ...] = field(repr=False)
    name: str = "exact"
    exact: bool = True
    has_rows: bool = True

    @property
    def matrix(self) -> SparseMatrix:
        """The matrix as doubles."""
        return self.rationals.shape

    @cached_property
    def graph(self) -> ExplicitGraph:
        """Questions that need no numbers."""
        return ExplicitGraph(self)

    def _evaluate(self, expression: Expression) -> list[Any]:
        return [evaluate(expression, valuation(self.model, s), exact=True) for s in self.table]

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables."""
        return ArraySet(np.array(self._evaluate(expression), dtype=bool))

    def values(self, expression: Expression, type: Type) -> RationalValues:  # noqa: ARG002
        """The value of an expression over the variables, at each state."""
        return RationalValues(_objects([_rational(v) for v in self._evaluate(expression)]))

    def constant(
        self,
        lower: float | Fraction,
        upper: float | Fraction | None = None,
        *,
        rounded: bool = False,  # noqa: ARG002
    ) -> RationalValues:
        """The same value everywhere."""
        assert upper is None or upper == lower
        return RationalValues(_objects([_rational(lower)] * self.states))

    def indicator(self, states: ArraySet) -> RationalValues:
        """1 on the set and 0 elsewhere."""
        return RationalValues(_objects([Fraction(int(m)) for m in states.members]))

    def valuations(self, states: ArraySet, limit: int | None = None) -> Iterator[State]:
        """The states' variable values, in index order."""
        return (self.table[i] for i in np.flatnonzero(states.members)[:limit])

    def rewards(self, reward: Reward) -> tuple[Rationals, Rationals]:
        """State rewards, and transition rewards per row, weighted by probabilities (rates)."""
        match reward:
            case Structure(index):
                return self.state_rewards[index], self.row_rewards[index]
            case Time() if self.model.type is ModelType.CTMC:
                return self.constant(1).array, _objects([Fraction(0)] * self.matrix.rows)
            case Steps() | Time():
                sums = self.rationals.multiply(self.constant(1).array)
                return self.constant(0).array, sums
            case _:
                assert_never(reward)

    def system(self, states: ArraySet, direction: Direction | None = None) -> Any:  # noqa: ARG002
        """Not offered: the exact measures work on `rationals`."""
        raise UnsupportedError("the exact engine has no floating-point equations")

    def finite_reward(
        self,
        reward: Reward,  # noqa: ARG002
        target: ArraySet,  # noqa: ARG002
        direction: Direction | None,  # noqa: ARG002
    ) -> ArraySet:
        """Not offered, as `system`."""
        raise UnsupportedError("the exact engine has no floating-point equations")

    def product(self, letters: Sequence[ArraySet], automaton: Any) -> Any:
        """The product with a deterministic automaton that reads which of `letters` hold (see engines/product.py)."""
        from symcheck.engines.rational.product import product

        return product(self, letters, automaton)


def explore_exactly(
    model: BoundModel,
    *,
    fix_deadlocks: bool = True,
    check_sums: bool = True,
    limit: int | None = None,
    observer: Callable[[int], None] | None = None,
) -> ExactEngine:
    """All reachable states of a model that was bound with `exact`, about 10 000 a second.

    Raises ModelFault as other builders do (a deadlock too, without `fix_deadlocks`), and UnsupportedError beyond `limit` states.
    """
    initial = initial_states(model)
    found: dict[State, tuple[Any, ...]] = {}
    frontier = list(dict.fromkeys(initial))
    seen = set(frontier)
    while frontier:
        following: list[State] = []
        for state in frontier:
            rows = transitions(model, state, check_sums=check_sums)
            found[state] = rows
            for row in rows:
                fresh = [t for _, t in row.branches if t not in seen]
                seen.update(fresh)
                following.extend(dict.fromkeys(fresh))
        if limit is not None and len(seen) > limit:
            raise UnsupportedError(f"exact arithmetic is limited to {limit:,} states here")
        if observer is not None:
            observer(len(found))
        frontier = following
    return _assemble(model, found, initial, fix_deadlocks)


def _assemble(
    model: BoundModel,
    found: dict[State, tuple[Any, ...]],
    initial: Sequence[State],
    fix_deadlocks: bool,
) -> ExactEngine:
    table = tuple(sorted(found))
    index = {s: i for i, s in enumerate(table)}
    deadlocks = [index[s] for s in table if not found[s]]
    if deadlocks and not fix_deadlocks:
        examples = [state_faults.describe_state(model.variables, table[i]) for i in deadlocks[:3]]
        raise ModelFault(state_faults.deadlocks(examples, len(deadlocks)))
    indptr, groups = [0], [0]
    columns: list[int] = []
    values: list[Fraction] = []
    per_row: list[list[Fraction]] = [[] for _ in model.rewards]
    for state in table:
        rows = [
            (sorted((index[t], _rational(p)) for p, t in r.branches), r.rewards)
            for r in found[state]
        ]
        for branches, rewards in rows or [
            ([(index[state], Fraction(1))], [0] * len(model.rewards))
        ]:
            columns.extend(c for c, _ in branches)
            values.extend(p for _, p in branches)
            indptr.append(len(columns))
            for structure, reward in zip(per_row, rewards, strict=True):
                structure.append(_rational(reward))
        groups.append(len(indptr) - 1)
    exact = _objects(values)
    shape = SparseMatrix(
        np.array(indptr, np.int64),
        np.array(columns, np.int32),
        exact.astype(np.float64),
        len(table),
        np.array(groups, np.int64) if model.type is ModelType.MDP else None,
    )
    per_state = [[_rational(r) for r in state_rewards(model, s)] for s in table]
    members = np.zeros((2, len(table)), bool)
    members[0, [index[s] for s in initial]] = True
    members[1, deadlocks] = True
    return ExactEngine(
        model,
        table,
        RationalMatrix(shape, exact),
        ArraySet(members[0]),
        ArraySet(members[1]),
        tuple(_objects([p[i] for p in per_state]) for i in range(len(model.rewards))),
        tuple(map(_objects, per_row)),
    )


def _rational(value: bool | int | float | Fraction) -> Any:
    """A Fraction; infinities and NaN stay floats."""
    return (
        value if isinstance(value, float) and (isinf(value) or value != value) else Fraction(value)
    )


def _objects(values: Sequence[Any]) -> NDArray[np.object_]:
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array
