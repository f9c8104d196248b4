"""Preprocessing: equations over most states are solved on the rows of all states, without copying a
submatrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field
from typing import Protocol

from symcheck.engines import tuning
from symcheck.engines.base import SolvedValues
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.base import ExplicitOwner, Numeric
from symcheck.engines.linear_system import (
    ExpectedReward,
    LinearSystem,
    Query,
    require_normal_rewards,
    solved_values,
)
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.linear.problem import Observer
from symcheck.numerics.settings import Settings
from symcheck.numerics.underflow import may_underflow
from symcheck.semantics.rewards import Reward

__all__ = ["FullMatrix"]


class Owner(ExplicitOwner, Protocol):
    """The engine that the full matrix is read from."""

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards [states] and transition rewards per row [rows]."""
        ...


@dataclass(frozen=True, eq=False)
class FullMatrix:
    """Equations on the full matrix, with a mask of the unknowns (bool[states])."""

    engine: Owner = field(repr=False)
    unknown: Bools = field(repr=False)

    def accepts(self, query: Query[ArraySet, Numeric], settings: Settings) -> bool:
        """Whether most states are unknown, and all their rows are used. Masks save memory of
        doubles only, and the solution has no strategy.
        """
        if (
            self.engine.has_opponents
            or self.engine.weights.is_rational
            or (settings.strategy and query.system.direction is not None)
        ):
            return False
        if tuning.STATES_PER_UNKNOWN * query.n < len(self.unknown):
            return False
        return not isinstance(query, ExpectedReward) or query.usable_rows is None

    def apply(
        self,
        query: Query[ArraySet, Numeric],
        known: Sequence[tuple[ArraySet, float]],
        settings: Settings,
        observer: Observer | None,
    ) -> SolvedValues[Numeric] | None:
        """The solution of the masked problem; None if rewards of steps underflow."""
        system, matrix, constant = query.system, self.engine.weights, None
        outside = [(where.members, value) for where, value in known]
        if isinstance(query, ExpectedReward):
            states, rows = self.engine.rewards(query.reward)
            require_normal_rewards(states, rows)
            whole = self.engine.system(self.engine.all)
            assert isinstance(whole, LinearSystem)
            constant, outside = whole.of_stay(states) + rows, []
            if system.continuous_time and may_underflow(
                constant, 1.0 / (matrix.longest * self.engine.entry_range[1])
            ):
                return None  # the rewards of steps decide
        problem = MaskedProblem(
            matrix,
            self.unknown,
            outside,
            constant,
            system.direction,
            constant is None,
            system.continuous_time,
            self.engine.entry_error,
            query.constant_error,
        )
        return solved_values(system, problem, known, settings, observer)
