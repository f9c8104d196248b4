"""The explicit engine: states as rows of a table, transitions as compressed rows, sets as bool
arrays; no diagrams.

Its numbers are those of the explored model: float64, or rationals (the exact engine).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from fractions import Fraction
from functools import cached_property
from math import isfinite, isnan
from typing import TYPE_CHECKING, assert_never

import numpy as np

from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.base import Automaton, Number, erased, require_expression
from symcheck.engines.capabilities import (
    Capable,
    HasActions,
    HasExploredModel,
    HasMatrix,
    RepresentsOrbits,
)
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues, around
from symcheck.engines.explicit.base import Numeric
from symcheck.engines.explicit.full_matrix import FullMatrix
from symcheck.engines.explicit.graph import ExplicitGraph
from symcheck.engines.explicit.rational_values import RationalValues
from symcheck.engines.linear_system import (
    LinearSystem,
    Preprocessing,
    refuse_infinite_minimum,
    require_normal_numbers,
    require_normal_rewards,
)
from symcheck.engines.reward_sums import RewardSums
from symcheck.explicit.explored import RACE, ExploredModel
from symcheck.explicit.model import ExplicitModel
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, Rationals, full, is_infinite, numbers
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix
from symcheck.semantics.entry_errors import CLOSE, entry_error
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, Steps, Structure, Time
from symcheck.syntax.ast import Expression, Type

if TYPE_CHECKING:
    from symcheck.engines.explicit.product import ExplicitProduct, ProductModel
    from symcheck.explicit.orbits import Represented
    from symcheck.numerics.concurrent_games import Game

__all__ = ["ExplicitEngine", "ExplicitSystem"]


@dataclass(frozen=True)
class ExplicitEngine(Capable, HasMatrix, HasExploredModel, RepresentsOrbits, HasActions):
    """An explored model as an engine.

    number_error: the relative error of sums of entries of a row; None: that of the model's text.
    """

    explored: ExploredModel
    name: str = "explicit"
    has_rows: bool = True
    represented: Represented | None = None
    opponents: Bools | None = field(default=None, compare=False)
    number_error: float | None = field(default=None, kw_only=True)

    @property
    def has_opponents(self) -> bool:
        """Whether in some states opponents choose."""
        return self.opponents is not None

    @cached_property
    def owners(self) -> Int32s:
        """The player of each state of a game, numbered from 0; -1 where nothing can be done.

        Raises:
            InputError: two players can do something in a state, or nobody owns what can be done.
        """
        from symcheck.semantics.players import owned_states, two_owners

        owners = np.full(self.states, -1, np.int32)
        for player, states in enumerate(owned_states(self.model)):
            here = self.where(states)
            if both := here & ArraySet(owners >= 0):
                raise two_owners(self.model, next(self.valuations(both, 1)))
            owners[here.members] = player
        return owners

    @cached_property
    def _coalitions(self) -> dict[frozenset[int], ExplicitEngine]:
        return {}

    def playing(self, coalition: frozenset[int]) -> ExplicitEngine:
        """The game of some players against all others.

        Args:
            coalition: the players who choose in the direction of what is asked.

        Raises:
            InputError: see `owners`.
        """
        if coalition not in self._coalitions:
            opponents = ~np.isin(self.owners, list(coalition))
            self._coalitions[coalition] = replace(self, opponents=opponents)
        return self._coalitions[coalition]

    def concurrent_game(self, maximisers: frozenset[int]) -> Game:
        """The concurrent game of some players, who maximise, against all others.

        Args:
            maximisers: the players, numbered from 0.
        """
        from symcheck.engines.explicit.joint_rows import game_between

        if maximisers not in self._games:
            self._games[maximisers] = game_between(self.explored, maximisers)
        return self._games[maximisers]

    @cached_property
    def _games(self) -> dict[frozenset[int], Game]:
        return {}

    @property
    def is_rational(self) -> bool:
        """Whether numbers are rationals, as those of the explored model are."""
        return self.weights.is_rational

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        return self.explored.model

    @property
    def weights(self) -> SparseMatrix:
        """One-step probabilities, in continuous time times exit rates, deadlocks fixed."""
        return self.explored.matrix

    @property
    def matrix(self) -> SparseMatrix:
        """One-step probabilities, deadlocks fixed; in continuous time a new matrix at each use."""
        return self.system(self.all).matrix if self.model.type.continuous_time else self.weights

    @property
    def states(self) -> int:
        """Number of reachable states."""
        return self.weights.states

    @property
    def transitions(self) -> int:
        """Number of stored transitions."""
        return self.weights.entries

    @property
    def choices(self) -> int:
        """Number of choices (states, where there is no nondeterminism)."""
        return self.weights.rows

    @cached_property
    def all(self) -> ArraySet:
        """Every reachable state."""
        return ArraySet(np.ones(self.states, bool))

    @cached_property
    def none(self) -> ArraySet:
        """The empty set."""
        return ArraySet(np.zeros(self.states, bool))

    def from_bools(self, members: Bools) -> ArraySet:
        """The states at which the array (in index order) is True."""
        return ArraySet(np.asarray(members, dtype=bool))

    def to_bools(self, states: ArraySet) -> Bools:
        """Membership of each state, in index order."""
        return states.members

    def numbers(self, states: ArraySet, limit: int | None = None, start: int = 0) -> Int64s:
        """The index of each state of a set."""
        return np.flatnonzero(states.members)[start:][:limit]

    def first(self, states: ArraySet) -> ArraySet:
        """The singleton of the state with the lowest index."""
        return ArraySet.of(self.states, int(np.argmax(states.members)))

    @cached_property
    def initial(self) -> ArraySet:
        """The initial states."""
        return ArraySet.of(self.states, self.explored.initial)

    @cached_property
    def deadlocks(self) -> ArraySet:
        """States that had no transition before they were given a self-loop."""
        return ArraySet.of(self.states, self.explored.deadlocks)

    @cached_property
    def graph(self) -> ExplicitGraph:
        """Questions that need no numbers."""
        return ExplicitGraph(self)

    @cached_property
    def _sets(self) -> dict[Expression, ArraySet]:
        """Recently used sets: several properties use the same labels."""
        return {}

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables."""
        require_expression(expression)
        if expression not in self._sets:
            value = np.asarray(self.explored.evaluate(expression))
            while self._sets and len(self._sets) >= min(
                tuning.CACHED_SETS, tuning.CACHED_SETS_BYTES // self.states
            ):
                self._sets.pop(next(iter(self._sets)))
            self._sets[expression] = ArraySet(
                np.array(np.broadcast_to(value, (self.states,)), dtype=bool)
            )
        return self._sets[expression]

    def values(self, expression: Expression, type: Type) -> Numeric:  # noqa: ARG002 (numbers hold all three types)
        """The value of an expression over the variables, at each state (1 and 0 for a bool)."""
        value = np.asarray(self.explored.evaluate(expression))
        return self._known(
            numbers(np.broadcast_to(value, (self.states,)), rational=self.is_rational)
        )

    def constant(
        self, lower: Number, upper: Number | None = None, *, rounded: bool = False
    ) -> Numeric:
        """The same value (or bounds of it) everywhere."""
        low = full(self.states, lower, rational=self.is_rational)
        if self.is_rational:
            assert upper is None or upper == lower or isnan(upper), "rational values have no bounds"
            return RationalValues(low)
        high = low if upper is None or upper == lower else np.full(self.states, float(upper))
        return ArrayValues(low, high, self.all.members if rounded else None)

    def rationals(self, values: Rationals) -> RationalValues:
        """Values that are known without error."""
        return RationalValues(np.broadcast_to(values, (self.states,)))

    def indicator(self, states: ArraySet) -> Numeric:
        """1 on the set and 0 elsewhere."""
        return self._known(numbers(states.members, rational=self.is_rational))

    def _known(self, array: Numbers) -> Numeric:
        """Values without rounding; zeros of one sign."""
        if self.is_rational:
            return RationalValues(array)
        array = array + 0.0
        return ArrayValues(array, array)

    def system(self, states: ArraySet, direction: Direction | None = None) -> ExplicitSystem:
        """The equations over some states."""
        self._require_normal_numbers()
        if self.transitions > tuning.KEPT_TRANSPOSE_TRANSITIONS and 2 * states.count > self.states:
            self.graph.forget()
        return ExplicitSystem(self, states, direction)

    def _require_normal_numbers(self) -> None:
        if not self.is_rational and self.transitions:
            rates = self.model.type.continuous_time
            require_normal_numbers(*self.entry_range, self.weights.longest, rates)

    @cached_property
    def entry_range(self) -> tuple[float, float]:
        """The least positive and the greatest one-step probability (rate)."""
        data = self.weights.data
        if (smallest := float(data.min(initial=np.inf))) <= 0.0:
            smallest = float(data.min(initial=np.inf, where=data > 0.0))
        return smallest, float(data.max(initial=0.0))

    @cached_property
    def entry_error(self) -> float:
        """A bound on the relative error of a sum of entries of a row."""
        explored, model = self.explored, self.model
        if self.is_rational:
            return 0.0
        if self.number_error is not None:
            return self.number_error
        if not model.events:  # it was read
            return entry_error(model, self.weights.longest)
        if not isinstance(explored, ExplicitModel):
            return entry_error(model)
        error = entry_error(model, explored.terms, shares=explored.shares)
        if error < CLOSE:
            return error
        # The values that occur may show that what is added is not negative.
        occurring = list(model.variables)
        for i, variable in enumerate(explored.states.layout.variables):
            if variable.low is None:
                values = explored.states.column(i)
                bounded = replace(variable, low=int(values.min()), high=int(values.max()))
                occurring[occurring.index(variable)] = bounded
        return entry_error(model, explored.terms, shares=explored.shares, variables=occurring)

    def finite_reward(
        self, reward: Reward, target: ArraySet, direction: Direction | None
    ) -> ArraySet:
        """States from which the expected reward until `target` is finite (see
        `symcheck.engines.base.Engine`).
        """
        finite = self.graph.prob1(self.all, target, direction and direction.dual)
        infinite = self.system(finite - target, direction).infinite_rewards(reward)
        if infinite:
            refuse_infinite_minimum(Direction.MIN if self.has_opponents else direction)
            finite = finite - self.graph.exists_until(~target, infinite)
        return finite

    @cached_property
    def reward_sums(self) -> RewardSums:
        """The sums of rewards that floating point gets wrong."""
        return RewardSums(erased(self))

    def row_actions(self) -> Int32s:
        """Per row, the number of its action among the model's, -1 for none."""
        actions: Int32s = self.explored.choice_actions
        return actions

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards [states] and transition rewards, summed with weights, per row [rows]."""
        match reward:
            case Structure(index):
                return self.explored.state_rewards[index], self.explored.choice_rewards[index]
            case Time() if self.model.type.continuous_time:
                return self._full(self.states, 1), self._full(self.choices, 0)
            case Steps() | Time():
                return self._full(self.states, 0), self.system(self.all).weight_sums()
            case _:
                assert_never(reward)

    def _full(self, n: int, value: int) -> Numbers:
        return full(n, value, rational=self.is_rational)

    def valuations(
        self, states: ArraySet, limit: int | None = None, start: int = 0
    ) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order."""
        return self.explored.states.valuations(self.numbers(states, limit, start))

    def product(self, letters: Sequence[ArraySet], automaton: Automaton) -> ExplicitProduct:
        """The product with a deterministic automaton whose letters are sets of states."""
        from symcheck.engines.explicit.product import product

        return product(self, letters, automaton, self.over)

    def over(self, pairs: ProductModel) -> ExplicitEngine:
        """The engine on pairs of a state and a memory value, whose rows are those of the states."""
        theirs = self.opponents
        return ExplicitEngine(
            pairs,
            f"{self.name} product",
            opponents=None if theirs is None else theirs[pairs.state],
            number_error=self.entry_error,
        )


@dataclass(frozen=True, eq=False)
class ExplicitSystem(LinearSystem[ArraySet, Numeric]):
    """The equations over some states (see `symcheck.engines.base.System`)."""

    engine: ExplicitEngine = field(repr=False)
    states: ArraySet
    direction: Direction | None = None

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.states.count

    @cached_property
    def groups(self) -> Int64s | None:
        """Which of the rows belong to which state; None where each has one."""
        matrix = self.engine.weights
        return matrix.groups if self._whole else matrix.groups_of(self.states.members)

    @cached_property
    def weights(self) -> SparseMatrix:
        """The weights among the states."""
        whole = self.engine.weights
        if self._whole:
            return whole
        return whole.among(self.states.members)

    @property
    def _whole(self) -> bool:
        return self.n == self.engine.states

    @property
    def has_rows(self) -> bool:
        """Always: this engine works with rows."""
        return True

    @property
    def continuous_time(self) -> bool:
        """Whether entries of the matrix are rates."""
        return self.engine.model.type.continuous_time

    @cached_property
    def takes_time(self) -> Bools | None:
        """The rows whose weights are rates, in a Markov automaton."""
        if not self.engine.model.type.immediate_choices:
            return None
        timed: Bools = self.engine.row_actions() == RACE
        return timed if self._whole else timed[self.engine.weights.rows_of(self.states.members)]

    @property
    def has_end_components(self) -> bool:
        """Whether some end component lies within the states (MDP)."""
        return next(self.engine.graph.end_components(self.states), None) is not None

    @property
    def entry_error(self) -> float:
        """That of the engine."""
        return self.engine.entry_error

    @property
    def opponents(self) -> Bools | None:
        """The states in which opponents choose against a direction; None: it is no game."""
        theirs = self.engine.opponents
        return None if theirs is None else theirs[self.states.members]

    @property
    def reward_sums(self) -> RewardSums:
        """The sums of rewards of the engine that floating point gets wrong."""
        return self.engine.reward_sums

    @property
    def preprocessing(self) -> Sequence[Preprocessing[ArraySet, Numeric]]:
        """Equations over most states are solved on the full matrix."""
        return (FullMatrix(self.engine, self.states.members),)

    def infinite_rewards(self, reward: Reward) -> ArraySet:
        """The states with a row that earns an infinite reward."""
        states, rows = self.rewards(reward)
        members, infinite = is_infinite(states), is_infinite(rows)
        if infinite.any():
            members |= (
                infinite
                if self.groups is None
                else np.logical_or.reduceat(infinite, self.groups[:-1])
            )
        everywhere = np.zeros(self.engine.states, bool)
        everywhere[self.states.members] = members
        return ArraySet(everywhere)

    @property
    def weight_operator(self) -> SparseMatrix:
        """The weights as an operator."""
        return self.weights

    def weight_into(self, target: ArraySet) -> Numbers:
        """Per row: the sum of the weights that lead into the target."""
        return self._sums(target.members, None)

    def weighted_values(self, values: Numeric) -> tuple[Numbers, Numbers]:
        """Per row: sum over successors outside of the states of weight × value (lower, upper)."""
        outside = ~self.states.members
        lower = self._sums(outside, values.lower)
        return lower, lower if values.is_point else self._sums(outside, values.upper)

    def _sums(self, columns: Bools, values: Numbers | None) -> Numbers:
        return self.engine.weights.sums(self.states.members, columns, values)

    def weight_sums(self) -> Numbers:
        """Per row: the sum of all weights."""
        return self.weight_into(self.engine.all)

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards per state and transition rewards per row."""
        states, rows = self.engine.rewards(reward)
        require_normal_rewards(states, rows)
        if self._whole:
            return states, rows
        groups, inside = self.engine.weights.groups, self.states.members
        return states[inside], rows[
            inside if groups is None else np.repeat(inside, np.diff(groups))
        ]

    def restrict(self, values: Numeric | ArraySet) -> Numbers:
        """A lower value (or 0/1 membership) per state of the system."""
        array = values.members if isinstance(values, ArraySet) else values.lower
        return numbers(array[self.states.members], rational=self.engine.is_rational)

    def full(self, value: Number) -> Numbers:
        """The same number for each state of the system."""
        return full(self.n, value, rational=self.engine.is_rational)

    def lift(
        self,
        lower: Numbers,
        upper: Numbers | None,
        rest: Sequence[tuple[ArraySet, float]] = (),
        up_to_rounding: bool = False,
    ) -> Numeric:
        """Values on all states: these on the states of the system, constants on the sets in `rest`,
        0 elsewhere.
        """
        if up_to_rounding and upper is None and not self.engine.is_rational:
            lower, upper = around(lower)
        low = self._spread(lower, rest)
        if self.engine.is_rational:
            assert upper is None or upper is lower, "rational values have no bounds"
            exact = Fraction | RationalFunction
            assert all(isinstance(v, exact) or not isfinite(v) for v in low), "a float crept in"
            return RationalValues(low)
        high = low if upper is None or upper is lower else self._spread(upper, rest)
        return ArrayValues(low, high, self.states.members if up_to_rounding else None)

    def _spread(self, values: Numbers, rest: Sequence[tuple[ArraySet, float]]) -> Numbers:
        rational = self.engine.is_rational
        out = full(self.engine.states, 0, rational=rational)
        for states, constant in rest:
            out[states.members] = full(1, constant, rational=rational)[0]
        out[self.states.members] = values
        return out
