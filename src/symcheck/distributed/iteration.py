"""Bounds on the values of a part, which rise and fall until they meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.direction import Direction
from symcheck.distributed import tuning
from symcheck.distributed.end_components import CollapsedComponents
from symcheck.distributed.explored_part import ExploredPart
from symcheck.distributed.messages import Message
from symcheck.distributed.state_sets import StateSets
from symcheck.distributed.substitution import PartEquations, Substitution
from symcheck.kernels.solve.part_sweeps import PartSweeps
from symcheck.matrices.rows import Bools, Floats, Int32s, SparseMatrix, spans, starts_of
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.settings import Settings
from symcheck.semantics.rewards import Reward

__all__ = ["Iteration"]


class Iteration:
    """The values of a part, from the least ones: 1 on `known` and 0 elsewhere; for a reward,
    infinite on `zero` and 0 elsewhere.

    The unknowns are the states outside of the sets `known` and `zero`.

    Args:
        part: its rows.
        sets: of its states; the unknowns become one of them.
        known, zero: names of sets.
        direction: of choices.
        reward: None for probabilities.

    Attributes:
        lower: float64[states and ghosts].
        sums: of weighted values of the initial states, float64[initial states].
        unknown_own: the unknowns that are no ghosts.
        constant: the rewards of the rows, None for probabilities.
        collapsed: end components whose values come from all parts.
    """

    def __init__(
        self,
        part: ExploredPart,
        sets: StateSets,
        known: str,
        zero: str,
        direction: Direction | None,
        reward: Reward | None,
    ) -> None:
        self._part, self._sets = part, sets
        self._unknown: Bools = ~(sets[known] | sets[zero])
        self._known = sets[known]
        self.unknown_own: Bools = self._unknown.copy()
        self.unknown_own[part.own :] = False
        sets["unknown"] = self._unknown
        self._direction = direction
        self.constant = None if reward is None else part.rewards(reward)
        if reward is None:
            self.lower: Floats = self._known.astype(np.float64)
        else:
            self.lower = np.where(sets[zero], np.inf, 0.0)
        self.sums = np.zeros(len(part.rows.initial))
        self._upper: Floats | None = None
        self._upper_of_known = self.lower
        self._sent_lower = [self.lower[s] for s in part.boundary.sent]
        self._sent_upper: list[Floats] = []
        self.collapsed: CollapsedComponents | None = None
        self._sweeps: PartSweeps | None = None
        self._active = self._violated = np.empty(0, np.uint8)

    @property
    def mode(self) -> int:
        """The kernels' code for the direction."""
        return self._part.mode(self._direction)

    def changes(self, threshold: float = 0.0) -> list[Message]:
        """The lower bounds that the others do not know."""
        return self._part.boundary.of_changes(self.lower, self._sent_lower, threshold)

    def initial(self, upper: bool) -> list[float]:
        """The lower or upper values of the initial states of this part."""
        values = self._upper if upper and self._upper is not None else self.lower
        return [float(x) for x in values[self._part.rows.initial]]

    # ------------------------------------------------------------------------ linear systems

    def _equations(self) -> tuple[SparseMatrix, Floats | None]:
        """The rows and their rewards, without choices that may lead to an infinite least reward."""
        matrix, constant, row_state = self._part.matrix, self.constant, self._part.row_state
        if constant is None or self.mode != 1:
            return matrix, constant
        kept = ~(matrix.multiply(np.isinf(self.lower).astype(np.float64)) > 0)
        kept |= ~matrix.rows_of(self._unknown)
        sizes = np.bincount(row_state[kept], minlength=self._part.total)
        return matrix.choose(np.flatnonzero(kept), starts_of(sizes)), constant[kept]

    def solve_alone(self, settings: Settings) -> tuple[float, float, str]:
        """Bounds on the value of the initial state, where there is no other part."""
        from symcheck.numerics.linear.methods import solve_linear

        matrix, constant = self._equations()
        problem = MaskedProblem(
            matrix,
            self._unknown,
            [(self._known, 1.0)] if constant is None else [],
            constant,
            self._direction,
            constant is None,
            self._part.continuous_time,
        )
        solution = solve_linear(problem, settings)
        place = int(np.count_nonzero(self._unknown[: self._part.rows.initial[0]]))
        lower, upper = float(solution.lower[place]), float(solution.upper[place])
        if constant is None:
            upper = min(upper, 1.0)
        return lower, upper, solution.explanation

    def substitution(self, settings: Settings, formula: str, number: int | None) -> Substitution:
        """The backward substitution of the unknowns, which holds the values until it ends.

        number: of a checkpoint of the substitution to go on from; None: there is none.
        """
        part = self._part
        values = np.stack([self.lower, self.lower], axis=1)
        unknown = self._unknown.copy()
        if number is not None:
            assert part.files is not None
            saved = part.files.load_values(formula, number)["values"]
            found = np.flatnonzero(unknown[: part.own] & ~np.isnan(saved[:, 0]))
            values[found], unknown[found] = saved[found], False
        told = [~self._unknown[s] for s in part.boundary.sent]
        matrix, constant = self._equations()
        self.lower = self._upper_of_known = np.empty(0)
        equations = PartEquations(
            matrix, constant, self.mode, part.continuous_time, *part.columns, part.row_state
        )
        return Substitution(equations, unknown, part.own, values, settings, part.boundary, told)

    def end_substitution(self, substitution: Substitution) -> list[tuple[float, float]]:
        """Continue with the states that are still unknown: the bounds of initial states that are
        known.
        """
        values = substitution.values
        self._sets["unknown"] = self._unknown = substitution.unknown
        self.unknown_own &= self._unknown
        self.lower, self._upper_of_known = values[:, 0].copy(), values[:, 1].copy()
        self._sent_lower = [self.lower[s] for s in self._part.boundary.sent]
        initial = self._part.rows.initial
        known = initial[~self._unknown[initial]]
        return [(float(low), float(high)) for low, high in values[known]]

    # -------------------------------------------------------------------- interval iteration

    def begin_phase(self) -> list[Message]:
        """Begin a phase of `raise_lower`, in which all lower bounds may rise."""
        part = self._part
        self._sweeps = PartSweeps(
            *part.matrix.arrays,
            part.matrix.groups,
            *part.columns,
            part.row_state,
            self.constant,
            self.unknown_own.view(np.uint8),
            self.mode,
            part.continuous_time,
        )
        self._active = self.unknown_own.astype(np.uint8)
        return self.changes()

    def raise_lower(
        self, incoming: Sequence[Message], threshold: float, components: Floats | None
    ) -> tuple[bool, list[Message], Floats | None]:
        """Raise lower bounds; whether states are left whose bounds may rise, messages, and the
        values of components as far as this part knows.

        threshold: relative changes up to this one are not passed on.
        components: the values of components by all parts; None: not yet, or there are none.
        """
        assert self._sweeps is not None
        self._receive(self.lower, incoming)
        if self.collapsed is not None and components is not None:
            self._activate_before(self.collapsed.raise_lower(self.lower, components))
        left = self._sweeps.raise_lower(
            self.lower, self._active, threshold, tuning.SWEEPS_PER_ROUND
        )
        return left, self.changes(threshold), self._leave(self.lower, upwards=False)

    def _receive(self, values: Floats, incoming: Sequence[Message]) -> None:
        boundary = self._part.boundary
        boundary.receive(values, incoming)
        self._activate_before(boundary.ghosts(incoming))

    def _leave(self, values: Floats, *, upwards: bool) -> Floats | None:
        if self.collapsed is None:
            return None
        return self.collapsed.best_values(values, upwards=upwards)

    def _activate_before(self, changed: Int32s) -> None:
        column_ptr, column_rows = self._part.columns
        entries = spans(column_ptr[changed], column_ptr[changed + 1])
        self._active[self._part.row_state[column_rows[entries]]] = 1

    def begin_bounding(self, width: float | None) -> list[Message]:
        """Begin a phase of `lower_upper`, in which all candidates for upper bounds may fall.

        width: guess them anew, greater than the lower bounds by this relative width; None: go on
            from the bounds that there are, at first the greatest probability.
        """
        boundary = self._part.boundary
        if self._upper is None or width is not None:
            guess = np.full(self._part.total, 1.0) if width is None else self.lower * (1 + width)
            self._upper = np.where(
                self._unknown, np.minimum(guess, self._cap), self._upper_of_known
            )
            self._violated = self._unknown.astype(np.uint8)
            self._violated[self._part.own :] = 0
            self._sent_upper = [np.full(len(s), np.nan) for s in boundary.sent]
        self._active = self.unknown_own.astype(np.uint8)
        return boundary.of_changes(self._upper, self._sent_upper, 0.0)

    def lower_upper(
        self, incoming: Sequence[Message], threshold: float, components: Floats | None
    ) -> tuple[bool, list[Message], Floats | None, int]:
        """Lower candidates for upper bounds, as `raise_lower` raises lower bounds; also how many
        candidates are not yet bounds.
        """
        assert self._sweeps is not None
        assert self._upper is not None
        self._receive(self._upper, incoming)
        if self.collapsed is not None and components is not None:
            values = np.minimum(components, self._cap)
            self._activate_before(self.collapsed.lower_upper(self._upper, self._violated, values))
        left, violated = self._sweeps.lower_upper(
            self._upper,
            self._active,
            self._violated,
            self._cap,
            threshold,
            tuning.SWEEPS_PER_ROUND,
        )
        messages = self._part.boundary.of_changes(self._upper, self._sent_upper, threshold)
        return left, messages, self._leave(self._upper, upwards=True), violated

    @property
    def _cap(self) -> float:
        return 1.0 if self.constant is None else np.inf

    def greatest_rate(self) -> float:
        """The greatest exit rate of the unknowns."""
        return float(self._part.matrix.row_sums()[self.unknown_own].max(initial=0.0))

    # ------------------------------------------------------------------------- checkpoints

    def save_values(self, formula: str, number: int) -> None:
        """Write the values, as a checkpoint with a number."""
        assert self._part.files is not None
        values = {"values": self.lower[: self._part.own], "sums": self.sums}
        self._part.files.save_values(formula, number, values)

    def load_values(self, formula: str, number: int) -> None:
        """Go on from a checkpoint: the values of this part, which are sent to the others."""
        assert self._part.files is not None
        saved = self._part.files.load_values(formula, number)
        self.lower[: self._part.own], self.sums = saved["values"], saved["sums"]
