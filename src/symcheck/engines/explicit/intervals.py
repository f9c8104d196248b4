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

from symcheck.direction import Direction
from symcheck.engines.base import CapabilityT, Engine, EquationsOf, SolvedValues, erased
from symcheck.engines.capabilities import HasBestExpectations, HasRationalTwin, HasUncertainty
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.base import Numeric
from symcheck.engines.explicit.engine import ExplicitEngine, ExplicitSystem
from symcheck.engines.explicit.product import ExplicitProduct, ProductModel, product
from symcheck.engines.linear_system import lifted
from symcheck.errors import UnsupportedError
from symcheck.explicit.explored import ExploredModel, States
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.interval_rows import IntervalRows
from symcheck.matrices.numbers import Numbers, full, numbers
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics.linear.intervals import IntervalProblem, solve_intervals
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import Settings
from symcheck.semantics.features import class_name
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, Structure
from symcheck.syntax.ast import Expression, ModelType

__all__ = ["IntervalEngine", "IntervalModel", "IntervalSystem"]


@dataclass(frozen=True, eq=False)
class IntervalModel:
    """An explored model (see `symcheck.explicit.explored`) whose probabilities are intervals.

    Attributes:
        source: the states, and the upper ends as its matrix.
        lower: the lower end of each entry.
        model: the bound model.
        choice_rewards: per structure, the transition reward of each row.
        groups: the choices of each state.
    """

    source: ExploredModel = field(repr=False)
    lower: Numbers = field(repr=False)
    model: BoundModel
    choice_rewards: Sequence[Numbers] = field(repr=False)
    groups: Int64s | None = field(repr=False)

    @cached_property
    def matrix(self) -> SparseMatrix:
        """The upper ends."""
        return replace(self.source.matrix, groups=self.groups)

    @property
    def states(self) -> States:
        """The states, by number."""
        return self.source.states

    @property
    def choice_actions(self) -> Int32s:
        """The action of each row, -1 for none."""
        return self.source.choice_actions

    @property
    def initial(self) -> Int64s:
        """The numbers of the initial states."""
        return self.source.initial

    @property
    def deadlocks(self) -> Int64s:
        """The numbers of the states that had no transition."""
        return self.source.deadlocks

    @property
    def state_rewards(self) -> Sequence[Numbers]:
        """Per structure, the reward of each state."""
        return self.source.state_rewards

    def evaluate(self, expression: Expression) -> Numbers:
        """The value of an expression over the variables in each state."""
        return self.source.evaluate(expression)

    def rows(self, nature: Direction) -> IntervalRows:
        """The rows in which nature minimises or maximises."""
        matrix = self.matrix
        return IntervalRows(replace(matrix, data=self.lower), matrix.data, nature)


@dataclass(frozen=True)
class IntervalEngine(ExplicitEngine, HasUncertainty, HasBestExpectations, HasRationalTwin):
    """An explored model with intervals as an engine.

    Attributes:
        explored: the model.
        twin: builds the same model in rational arithmetic.
        opposed: nature minimises what strategies maximise, and conversely; if not, it does what
            they do. None: nature has no direction yet (see `against`).
    """

    explored: IntervalModel
    twin: Callable[[], Engine] | None = field(default=None, kw_only=True)
    opposed: bool | None = field(default=None, kw_only=True)

    def capability(self, kind: type[CapabilityT]) -> CapabilityT | None:
        """Only that of nature, and of rational numbers: others would read ends as numbers."""
        natures: tuple[object, ...] = (HasBestExpectations,)
        if self.opposed is None:
            natures = (HasUncertainty, HasRationalTwin, IntervalEngine)
        return super().capability(kind) if kind in natures else None

    def rational(self) -> Engine:
        """The same model in rational arithmetic."""
        if self.twin is None:
            raise UnsupportedError("the model cannot be read in rational arithmetic")
        return self.twin()

    @cached_property
    def _against(self) -> dict[object, Engine]:
        return {}

    def against(
        self, direction: Direction | None, nature: Direction
    ) -> tuple[Engine, Direction | None]:
        """The engine in which nature minimises or maximises, and the direction to ask it for."""
        key: object = None
        if not np.array_equal(self.explored.lower, self.weights.data):
            key = direction not in (None, nature)
        if key not in self._against:
            self._against[key] = self._made(key)
        return self._against[key], (direction if key is None else direction or nature)

    def _made(self, opposed: object) -> Engine:
        explored = self.explored
        if opposed is None:  # all intervals are numbers
            return erased(ExplicitEngine(explored.source, self.name))
        if explored.groups is None:
            kind = ModelType.with_properties(has_choices=True)
            groups = np.arange(self.states + 1)
            model = replace(explored.model, type=kind)
            explored = replace(explored, model=model, groups=groups)
        return erased(replace(self, explored=explored, opposed=bool(opposed)))

    def nature(self, direction: Direction | None) -> Direction:
        """What nature does where strategies have a direction."""
        if direction is None or self.opposed is None:
            self.refuse()
        return direction.dual if self.opposed else direction

    def best_expectations(
        self, lower: Numbers, upper: Numbers, direction: Direction | None
    ) -> tuple[Numbers, Numbers]:
        """Per row, bounds of the expectation that nature chooses."""
        rows = self.explored.rows(self.nature(direction))
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
        raise UnsupportedError(f"this is not available for {class_name(self.model)}")

    def system(self, states: ArraySet, direction: Direction | None = None) -> IntervalSystem:
        """The equations over some states."""
        self._require_normal_numbers()
        return IntervalSystem(self, states, direction)

    @cached_property
    def entry_range(self) -> tuple[float, float]:
        """The least lower and the greatest upper end."""
        least = self.explored.lower.min(initial=np.inf)
        return float(least), float(self.weights.data.max(initial=0.0))

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards [states] and transition rewards per row [rows]."""
        if isinstance(reward, Structure):
            return super().rewards(reward)
        return self._full(self.states, 0), self._full(self.choices, 1)

    def product(self, letters: Sequence[ArraySet], automaton: Any) -> ExplicitProduct:
        """The product with a deterministic automaton whose letters are sets of states."""

        def over(pairs: ProductModel) -> IntervalEngine:
            base, matrix = self.weights, pairs.matrix
            entries = spans(base.indptr[:-1][pairs.rows], base.indptr[1:][pairs.rows])
            explored = IntervalModel(
                *(pairs, self.explored.lower[entries], self.model, pairs.choice_rewards),
                matrix.groups,
            )
            return replace(self, explored=explored, name=f"{self.name} product")

        return product(self, letters, automaton, over)


@dataclass(frozen=True, eq=False)
class IntervalSystem(ExplicitSystem):
    """The equations over some states: best expectations in place of products with numbers."""

    engine: IntervalEngine = field(repr=False)

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

    def reachability(self, target: ArraySet) -> Any:
        """The equations of the probability of reaching `target`; it is known where that is 1."""
        rows = self.engine.weights.rows_of(self.states.members)
        constant = full(int(np.count_nonzero(rows)), 0, rational=self.engine.is_rational)
        return IntervalEquations(self, constant, True, self.engine.none)

    def expected_reward(self, reward: Reward, infinite: ArraySet) -> Any:
        """The equations of the expected reward until the states are left."""
        return IntervalEquations(self, self.step_rewards(reward), False, infinite)


@dataclass(frozen=True, eq=False)
class IntervalEquations(EquationsOf[ArraySet, Numeric]):
    """x = opt (best expectation of x + constant), with known values elsewhere.

    Attributes:
        infinite: other states, whose value is infinite.
    """

    system: IntervalSystem
    constant: Numbers = field(repr=False)
    probability: bool
    infinite: ArraySet

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
            engine.explored.rows(engine.nature(system.direction)).choose(
                rows, chosen, column_of, n + 1 + len(known)
            ),
            numbers(np.array([0, *(v for _, v in known)]), rational=engine.is_rational),
            constant,
            system.direction,
            self.probability,
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
