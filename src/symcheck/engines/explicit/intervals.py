"""Models with intervals of probabilities, as explicit rows of lower and upper ends.

All lower ends are positive, so that nature cannot change the graph: graph analysis is that of the
other models. What is computed from probabilities as numbers is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from symcheck.direction import Direction
from symcheck.engines.base import CapabilityT, Engine, EquationsOf, SolvedValues, erased
from symcheck.engines.capabilities import (
    HasActions,
    HasBestExpectations,
    HasRationalTwin,
    HasUncertainty,
)
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.base import Numeric
from symcheck.engines.explicit.engine import ExplicitEngine, ExplicitSystem
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.linear_system import lifted
from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.interval_rows import IntervalRows
from symcheck.matrices.numbers import Numbers, doubles, full, numbers
from symcheck.matrices.rows import Bools, Int64s, spans, starts_of
from symcheck.numerics.linear.intervals import IntervalProblem, require_signs, solve_intervals
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import Settings
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.rewards import Reward, Structure
from symcheck.syntax.ast import Expression, ModelType

__all__ = ["IntervalEngine", "IntervalSystem"]


@dataclass(frozen=True)
class IntervalEngine(ExplicitEngine, HasUncertainty, HasBestExpectations, HasRationalTwin):
    """An explored model with intervals as an engine.

    Attributes:
        explored: the model, with the upper ends as its matrix.
        lower: the lower end of each entry.
        source: the model of the upper ends; it knows labels.
        twin: builds the same model in rational arithmetic.
        opposed: nature minimises what strategies maximise, and conversely; if not, it does what
            they do. None: nature has no direction yet (see `against`).
    """

    explored: Any
    lower: Numbers = field(kw_only=True, repr=False)
    source: ExplicitEngine = field(kw_only=True, repr=False)
    twin: Callable[[], Engine] = field(kw_only=True, repr=False)
    opposed: bool | None = field(default=None, kw_only=True)

    def capability(self, kind: type[CapabilityT]) -> CapabilityT | None:
        """Only that of nature, and of rational numbers: others would read ends as numbers."""
        offered: tuple[object, ...] = (ExplicitEngine, IntervalEngine, HasActions)
        natures = (HasUncertainty, HasRationalTwin)
        offered += natures if self.opposed is None else (HasBestExpectations,)
        return super().capability(kind) if kind in offered else None

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables, or that have a label."""
        return self.source.where(expression)

    def rational(self) -> Engine:
        """The same model in rational arithmetic."""
        return self._rational

    @cached_property
    def _rational(self) -> Engine:
        return self.twin()

    @cached_property
    def _against(self) -> dict[object, Engine]:
        return {}

    def against(
        self, direction: Direction | None, nature: Direction
    ) -> tuple[Engine, Direction | None]:
        """The engine in which nature minimises or maximises, and the direction to ask it for."""
        key: object = None
        if not np.array_equal(self.lower, self.weights.data):
            key = direction not in (None, nature)
        if key not in self._against:
            self._against[key] = self._made(key)
        return self._against[key], (direction if key is None else direction or nature)

    def _made(self, opposed: object) -> Engine:
        if opposed is None:  # all intervals are numbers
            return erased(self.source)
        explored, model = self.explored, self.model
        if not model.type.has_choices:
            model = replace(model, type=ModelType.with_properties(has_choices=True))
            matrix = replace(explored.matrix, groups=np.arange(self.states + 1))
            explored = replace(explored, model=model, matrix=matrix)
        return erased(replace(self, explored=explored, opposed=bool(opposed)))

    @property
    def ends(self) -> NDArray[np.complex128]:
        """Each interval as a complex number: its lower end, and its upper end times i."""
        return doubles(self.lower) + 1j * doubles(self.weights.data)

    def rows(self, direction: Direction | None) -> IntervalRows:
        """The rows, in which nature does what the direction of strategies implies."""
        lower = replace(self.weights, data=self.lower)
        nature = self.nature(direction)
        return IntervalRows(lower, self.weights.data, nature, self.entry_error)

    def with_nature(self, values: Numbers, direction: Direction) -> ExplicitEngine:
        """The engine in which nature has chosen the best distributions for values of the states."""
        chosen = self.rows(direction).chosen(values)
        return ExplicitEngine(replace(self.explored, matrix=chosen), self.name)

    def nature(self, direction: Direction | None) -> Direction:
        """What nature does where strategies have a direction."""
        if direction is None or self.opposed is None:
            self.refuse()
        return direction.dual if self.opposed else direction

    def best_expectations(
        self, lower: Numbers, upper: Numbers, direction: Direction | None
    ) -> tuple[Numbers, Numbers]:
        """Per row, bounds of the expectation that nature chooses."""
        rows = self.rows(direction)
        if self.is_rational:
            exact = rows.multiply(lower)
            return exact, exact
        compiled = self._compiled.setdefault(rows.nature, rows.compiled)
        return compiled.multiply(lower, False), compiled.multiply(upper, True)

    @cached_property
    def _compiled(self) -> dict[Direction, Any]:
        return {}

    def refuse(self) -> NoReturn:
        """Raise UnsupportedError: this needs probabilities that are numbers."""
        raise UnsupportedError(
            "what is asked for needs probabilities that are numbers, and this model has intervals "
            "of probabilities"
        )

    def system(self, states: ArraySet, direction: Direction | None = None) -> IntervalSystem:
        """The equations over some states."""
        self._require_normal_numbers()
        return IntervalSystem(self, states, direction)

    @cached_property
    def entry_range(self) -> tuple[float, float]:
        """The least lower and the greatest upper end."""
        least = self.lower.min(initial=np.inf)
        return float(least), float(self.weights.data.max(initial=0.0))

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards [states] and transition rewards per row [rows]."""
        if isinstance(reward, Structure):
            return super().rewards(reward)
        return self._full(self.states, 0), self._full(self.choices, 1)

    def over(self, pairs: ProductModel) -> IntervalEngine:
        """The engine on pairs of a state and a memory value, whose rows are those of the states."""
        base = self.weights.indptr
        entries = spans(base[:-1][pairs.rows], base[1:][pairs.rows])
        name = f"{self.name} product"
        return replace(self, explored=pairs, lower=self.lower[entries], name=name)


@dataclass(frozen=True, eq=False)
class IntervalSystem(ExplicitSystem):
    """The equations over some states: best expectations in place of products with numbers."""

    engine: IntervalEngine = field(repr=False)

    def earned(self, reward: Reward) -> Numbers:
        """Per row, the sum of its rewards. Raises UnsupportedError: one is negative, in doubles."""
        require_signs(*self.rewards(reward))
        return super().earned(reward)

    @property
    def weights(self) -> NoReturn:
        """None: probabilities are no numbers."""
        self.engine.refuse()

    @property
    def weight_operator(self) -> NoReturn:
        """None: probabilities are no numbers."""
        self.engine.refuse()

    def weight_into(self, target: ArraySet) -> NoReturn:  # noqa: ARG002
        """None: probabilities are no numbers."""
        self.engine.refuse()

    def weighted_values(self, values: Numeric) -> NoReturn:  # noqa: ARG002
        """None: probabilities are no numbers."""
        self.engine.refuse()

    def equations(self, *_: Any, **__: Any) -> NoReturn:
        """None: constants do not say what nature chooses."""
        self.engine.refuse()

    def reward_error(self, reward: Reward) -> float:
        """That of some distribution of a row, which is divided by its sum."""
        rounding = self.engine.weights.longest * UNIT_ROUNDOFF
        return super().reward_error(reward) + 2.0 * (self.entry_error + rounding)

    def reachability(self, target: ArraySet) -> Any:  # noqa: ARG002
        """The equations of the probability of reaching `target`; it is known where that is 1."""
        rows = self.engine.weights.rows_of(self.states.members)
        constant = full(int(np.count_nonzero(rows)), 0, rational=self.engine.is_rational)
        return IntervalEquations(self, constant, True, self.engine.none)

    def expected_reward(self, reward: Reward, infinite: ArraySet) -> Any:
        """The equations of the expected reward until the states are left."""
        error = self.reward_error(reward)
        return IntervalEquations(self, self.step_rewards(reward), False, infinite, error)


@dataclass(frozen=True, eq=False)
class IntervalEquations(EquationsOf[ArraySet, Numeric]):
    """x = opt (best expectation of x + constant), with known values elsewhere.

    Attributes:
        infinite: other states, whose value is infinite.
        constant_error: the relative error of constants.
    """

    system: IntervalSystem
    constant: Numbers = field(repr=False)
    probability: bool
    infinite: ArraySet
    constant_error: float = 0.0

    @property
    def states(self) -> ArraySet:
        """The states that are unknowns."""
        return self.system.states

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.system.n

    @cached_property
    def usable_rows(self) -> Bools | None:
        """Rows that cannot lead to infinite values, if the player minimises."""
        system = self.system
        if system.direction is not Direction.MIN or not self.infinite:
            return None
        weights = system.engine.weights
        usable: Bools = weights.sums(system.states.members, self.infinite.members) == 0
        return usable

    def problem(self) -> LinearProblem:
        """None: the equations are not linear."""
        self.system.engine.refuse()

    def solve(
        self,
        known: Sequence[tuple[ArraySet, float]],
        settings: Settings,
        observer: Observer | None = None,
    ) -> SolvedValues[Numeric]:
        """The solution on all states; `known`: finite constants on other sets, 0 elsewhere."""
        system, engine = self.system, self.system.engine
        rest = [*known, (self.infinite, np.inf)] if self.infinite else known
        if not system.states:
            return SolvedValues(system.lift(system.full(0), None, rest), "", 0, 0)
        assert system.direction is not None
        n, members = self.n, system.states.members
        column_of = np.full(engine.states, n, np.int32)
        for i, (states, _) in enumerate(known, n + 1):
            column_of[states.members] = i
        column_of[members] = np.arange(n)
        rows, groups = np.flatnonzero(engine.weights.rows_of(members)), system.groups
        constant = self.constant
        assert groups is not None
        if self.usable_rows is not None:
            kept = self.usable_rows
            rows, constant, chosen = rows[kept], constant[kept], starts_of(kept)[groups]
        else:
            chosen = groups
        problem = IntervalProblem(
            engine.rows(system.direction).choose(rows, chosen, column_of, n + 1 + len(known)),
            numbers(np.array([0, *(v for _, v in known)]), rational=engine.is_rational),
            constant,
            system.direction,
            self.probability,
            self.constant_error,
        )
        solution = solve_intervals(problem, settings, observer)
        solved = lifted(system, solution, rest, settings)
        return replace(solved, choices=self._choices(solution.strategy, groups, settings))

    def _choices(self, rows: Int64s | None, groups: Int64s, settings: Settings) -> Int64s | None:
        if rows is None or not settings.strategy:
            return None
        if self.usable_rows is not None:
            rows = np.where(rows < 0, -1, np.flatnonzero(self.usable_rows)[rows])
        return np.where(rows < 0, -1, rows - groups[:-1])
