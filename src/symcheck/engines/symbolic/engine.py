"""The symbolic engines: one set of diagrams, three forms of the matrix (see forms.py)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.base import erased, require_expression
from symcheck.engines.capabilities import Capable, HasActions
from symcheck.engines.explicit.rational_values import RationalValues
from symcheck.engines.linear_system import (
    Preprocessing,
    refuse_infinite_minimum,
    require_normal_numbers,
)
from symcheck.engines.reward_sums import RewardSums
from symcheck.engines.symbolic.acyclic import AcyclicSolution
from symcheck.engines.symbolic.deterministic_elimination import DeterministicElimination
from symcheck.engines.symbolic.diagrams import Diagrams, HasDiagrams, diagrams_of
from symcheck.engines.symbolic.graph import SymbolicGraph
from symcheck.engines.symbolic.reduced_system import ReducedSet
from symcheck.engines.symbolic.sets import (
    Piece,
    SymbolicSet,
    SymbolicValues,
    constant_piece,
    values_of,
)
from symcheck.engines.symbolic.system import SymbolicSystem
from symcheck.matrices.numbers import Rationals
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix
from symcheck.semantics.entry_errors import entry_error
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import Expression, Type

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd
    from symcheck.engines.base import Automaton, Number
    from symcheck.engines.symbolic.product import SymbolicProduct
    from symcheck.symbolic.model import StateSpace, Transitions

__all__ = ["SymbolicEngine"]


@dataclass(frozen=True, eq=False)
class SymbolicEngine(Capable, HasDiagrams, HasActions):
    """A model built as diagrams (see `symcheck.engines.base.Engine`).

    States are numbered in the order of the diagrams: lexicographically in declaration order, unless
    another order of the variables was chosen. `space` translates expressions; in a product it is
    the model's, over the same row bits.
    """

    diagrams: Diagrams = field(repr=False)
    space: StateSpace = field(repr=False)
    name: ClassVar[str] = "symbolic"
    is_rational: ClassVar[bool] = False
    has_rows: ClassVar[bool] = False
    rows_limit: ClassVar[int | None] = 0
    """Entries up to which the rows of a system are written out to solve equations on them; None:
    always.
    """

    @classmethod
    def of(cls, transitions: Transitions) -> SymbolicEngine:
        """The engine of a built model."""
        return cls(diagrams_of(transitions), transitions.space)

    def over(self, diagrams: Diagrams) -> SymbolicEngine:
        """The same kind of engine over other diagrams, of which those of the space are a part."""
        return type(self)(diagrams, self.space)

    def operator(self, system: SymbolicSystem) -> SparseMatrix | SweepOperator:
        """The weights of a system in this engine's form."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.model.type.value}, {self.states:,} states>"

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        return self.space.symbolic.model

    @property
    def states(self) -> int:
        """Number of reachable states."""
        return self.diagrams.count

    @property
    def transitions(self) -> int:
        """Number of transitions."""
        return self.diagrams.transition_count

    @property
    def choices(self) -> int:
        """Number of choices (states, where there is no nondeterminism)."""
        return self.diagrams.choice_count

    @property
    def entry_range(self) -> tuple[float, float]:
        """The least positive and the greatest one-step probability (rate)."""
        return self.diagrams.entry_range

    @cached_property
    def entry_error(self) -> float:
        """A bound on the relative error of a sum of entries of a row."""
        return entry_error(self.model, table_bits=tuning.TABLE_BITS)

    @cached_property
    def all(self) -> SymbolicSet:
        """Every reachable state."""
        return self._set(self.diagrams.states)

    @cached_property
    def none(self) -> SymbolicSet:
        """The empty set."""
        return self._set(self.diagrams.manager.false)

    @cached_property
    def initial(self) -> SymbolicSet:
        """The initial states."""
        return self._set(self.diagrams.initial)

    @cached_property
    def deadlocks(self) -> SymbolicSet:
        """States that had no transition before they were given a self-loop."""
        return self._set(self.diagrams.deadlocks)

    @cached_property
    def graph(self) -> SymbolicGraph:
        """Questions that need no numbers."""
        return SymbolicGraph(self, elimination=self.elimination)

    def _set(self, bdd: Bdd) -> SymbolicSet:
        return SymbolicSet(self.diagrams, bdd)

    def where(self, expression: Expression) -> SymbolicSet:
        """The states that satisfy a boolean expression over the variables."""
        require_expression(expression)
        return self._set(self.space.where(expression) & self.diagrams.states)

    def values(self, expression: Expression, type: Type) -> SymbolicValues:
        """The value of an expression over the variables, at each state (1 and 0 for a bool)."""
        if type is Type.BOOL:
            return self.indicator(self.where(expression))
        function = self.space.values(expression)
        undefined = (
            self.space.symbolic.translator.undefined(expression) & self.diagrams.states
        )  # known once translated
        return values_of(self.diagrams, function, undefined or None)

    def constant(
        self, lower: Number, upper: Number | None = None, *, rounded: bool = False
    ) -> SymbolicValues:
        """The same value (or bounds of it) everywhere."""
        return SymbolicValues(
            self.diagrams, (constant_piece(self.diagrams.states, lower, upper, rounded),)
        )

    def rationals(self, values: Rationals) -> SymbolicValues:
        """Values that are known without error."""
        odd = self.diagrams.odd if len(values) > 1 else None
        piece = Piece(self.diagrams.states, RationalValues(values), odd)
        return SymbolicValues(self.diagrams, (piece,))

    def indicator(self, states: SymbolicSet) -> SymbolicValues:
        """1 on the set and 0 elsewhere."""
        parts = [(states.bdd, 1.0), ((~states).bdd, 0.0)]
        return SymbolicValues(self.diagrams, tuple(constant_piece(s, v) for s, v in parts if s))

    def from_bools(self, members: Bools) -> SymbolicSet:
        """The states at which the array (in index order) is True."""
        return self._set(self.diagrams.odd.from_mask(np.asarray(members, bool)))

    def to_bools(self, states: SymbolicSet) -> Bools:
        """Membership of each state, in index order."""
        return self.diagrams.odd.to_mask(states.bdd)

    def first(self, states: SymbolicSet) -> SymbolicSet:
        """The singleton of the state with the lowest index."""
        manager, rows = self.diagrams.manager, self.diagrams.rows
        bits = manager.pick(states.bdd, rows)
        if bits is None:
            raise ValueError("the set of states is empty")
        return self._set(manager.bdd_from_rows(rows, bits.reshape(1, -1)))

    @cached_property
    def _last(self) -> dict[tuple[Bdd, Direction | None], SymbolicSystem]:
        """The last system: one query uses it several times, and its rows are kept."""
        return {}

    def system(self, states: SymbolicSet, direction: Direction | None = None) -> SymbolicSystem:
        """The equations over some states."""
        d = self.diagrams
        require_normal_numbers(*self.entry_range, min(self.states, 10**15), d.continuous)
        if isinstance(states, ReducedSet):  # building its diagram takes as long as the solution
            return SymbolicSystem(self, states, direction)
        key = states.bdd, direction
        if key not in self._last:
            self._last.clear()
            self._last[key] = SymbolicSystem(self, states, direction)
        return self._last[key]

    @cached_property
    def reward_sums(self) -> RewardSums:
        """The sums of rewards that floating point gets wrong."""
        return RewardSums(erased(self))

    def row_actions(self) -> Int32s:
        """Per row of an MDP, the number of its action among the model's, -1 for none."""
        actions = self.system(self.all).actions
        assert actions is not None
        return actions

    @cached_property
    def elimination(self) -> DeterministicElimination:
        """Deterministic-state elimination on this model."""
        return DeterministicElimination(self)

    @cached_property
    def preprocessing(self) -> Sequence[Preprocessing[SymbolicSet, SymbolicValues]]:
        """Steps that may shorten equations, in the order in which they are tried."""
        return AcyclicSolution(self.diagrams), self.elimination

    def finite_reward(
        self, reward: Reward, target: SymbolicSet, direction: Direction | None
    ) -> SymbolicSet:
        """States from which the expected reward until `target` is finite (see
        `symcheck.engines.base.Engine`).
        """
        finite = self.graph.prob1(self.all, target, direction and direction.dual, reward)
        infinite = self.system(finite - target, direction).infinite_rewards(reward)
        if infinite:
            refuse_infinite_minimum(direction)
            finite = finite - self.graph.exists_until(~target, infinite)
        return finite

    def numbers(self, states: SymbolicSet, limit: int | None = None, start: int = 0) -> Int64s:
        """The index of each state of a set."""
        ranks = [self.diagrams.odd.rank(b) for b in self._bits(states, limit, start)]
        return np.concatenate([*ranks, np.empty(0, np.int64)])

    def valuations(
        self, states: SymbolicSet, limit: int | None = None, start: int = 0
    ) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order."""
        encoding = self.space.symbolic.encoding
        positions = list(map(self.diagrams.rows.index, encoding.rows))
        for bits in self._bits(states, limit, start):
            yield from encoding.valuations(bits[:, positions])

    def _bits(
        self, states: SymbolicSet, limit: int | None, start: int
    ) -> Iterator[NDArray[np.uint8]]:
        """The row bits of the states, in parts of bounded size."""
        odd, size = states.odd, tuning.DECODED_STATES
        stop = odd.count if limit is None else min(start + limit, odd.count)
        for first in range(start, stop, size):
            yield odd.unrank(np.arange(first, min(first + size, stop)))

    def product(self, letters: Sequence[SymbolicSet], automaton: Automaton) -> SymbolicProduct:
        """The product with a deterministic automaton that reads which of `letters` hold"""
        from symcheck.engines.symbolic.product import product

        return product(self, letters, automaton)
