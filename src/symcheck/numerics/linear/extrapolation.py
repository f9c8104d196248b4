"""Components by policy iteration whose evaluation is accelerated by extrapolation (Anderson 1965).

Guessed bounds around the solution are then proved. Let x = opt(A x + b) have a unique solution
(everything leaves almost surely, as far as it is finite). Then L <= opt(A L + b) proves that L is a
lower bound, and U >= opt(A U + b) that U is an upper one. A good approximation, made a little
smaller and a little larger, satisfies this after a few sweeps.

Where extrapolation stays slow, BiCGStab evaluates the policies, with the eigenvalue near 1 of a
chain that is hardly left moved away (Brauer 1952).

Sources: Howard (1960); Anderson (1965); Hartmanns & Kaminski (2020) for the proof.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from symcheck.kernels.solve.component_bounds import Block
from symcheck.kernels.solve.extrapolation import PolicyEvaluator
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.linear.subsystem import Bounds, LocalSystem, make_proper

if TYPE_CHECKING:
    from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix

__all__ = ["solve_extrapolated"]


def solve_extrapolated(
    block: Block,
    goal: float,
    relative: bool,
    probability: bool = False,
    observer: Observer | None = None,
) -> tuple[Bounds | None, int]:
    """Extrapolated sweeps over a block.

    Args:
        block: the equations of a component.
        goal: the requested width, relative to the values if `relative`.
        relative: whether the width is relative.
        probability: whether the values are probabilities.
        observer: receives the progress.

    Returns:
        Proved bounds, or None, and the number of sweeps.
    """
    local = LocalSystem.of(block)
    constants_width = _constants_width(local.low, local.high, relative)
    if not _applies(local) or not constants_width < goal:
        return None, 0
    evaluator = PolicyEvaluator(
        block.indptr,
        block.indices,
        block.data,
        local.groups,
        local.low,
        local.high,
        local.mode,
        relative,
        block.error,
    )
    tolerance = max((1e-3 if relative else 1e-6) * (goal - constants_width), tuning.SMALLEST_CHANGE)
    shifted = _ShiftedChains(local, 1e-2 * (goal - constants_width))
    for change in _changes(evaluator, local, shifted, not probability):
        if observer is not None:
            observer(Progress("extrapolated sweeps", evaluator.sweeps, change, local.n))
        if change <= tolerance:
            if local.mode != 0:
                evaluator.release_history()  # the next improvement discards the differences anyway
            bounds = _prove(evaluator, goal, constants_width, relative)
            if bounds is not None or tolerance <= tuning.SMALLEST_CHANGE:
                return bounds, evaluator.sweeps
            tolerance = max(tolerance * 1e-2, tuning.SMALLEST_CHANGE)
    return None, evaluator.sweeps


def _changes(
    evaluator: PolicyEvaluator, local: LocalSystem, shifted: _ShiftedChains, reward: bool
) -> Iterator[float]:
    """Improve and evaluate policies; yield the change by a sweep over all rows, per policy."""
    best, stalled, slow = np.inf, 0, 0
    change, changed = evaluator.improve(tuning.SWEEPS_BEFORE_FIRST_POLICY)
    for _ in range(tuning.EXTRAPOLATION_ROUNDS):
        if local.mode != 0:
            change, more = evaluator.improve()
            changed += more
        yield change
        best, stalled = (change, 0) if change < 0.5 * best else (best, stalled + 1)
        # Only for minimal rewards may a policy stay forever while its values are too low to show
        # it.
        if changed and reward and local.mode == 1 and not _make_proper(evaluator, local):
            return
        changed = 0
        goal = max(tuning.EVALUATION_ACCURACY * min(change, 1.0), tuning.SMALLEST_CHANGE)
        exact = slow >= tuning.SLOW_EVALUATIONS and shifted.evaluate(evaluator, min(change, 1.0))
        last = evaluator.evaluate(
            goal, tuning.STEPS_AFTER_BICGSTAB if exact else tuning.EXTRAPOLATION_STEPS
        )
        slow = slow + 1 if exact or last > goal else 0
        if stalled > tuning.EXTRAPOLATION_PATIENCE or not np.isfinite(last):
            return
        change = last


@dataclass(eq=False)
class _ShiftedChains:
    """The values of policies whose chains are hardly left, where I - A is almost singular.

    Let e = 1 - A 1 be the probability of leaving, let u be a distribution, and let
    M = I - A + 1 u^T, whose eigenvalue near 0 has moved to about 1. With M y = b and M h = e, the
    solution of (I - A) x = b is y + (u·y / u·h) (1 - h). Large values lose no digits, as e is known
    by itself; small ones, where leaving is likely, may, and sweeps repair them.

    accuracy: the residuals that suffice, relative to the average of y or of h. works: whether
    BiCGStab has converged. constants, leaving: y and h, where the next policy begins.
    """

    local: LocalSystem
    accuracy: float
    works: bool = True
    constants: Floats = field(default_factory=lambda: np.zeros(0))
    leaving: Floats = field(default_factory=lambda: np.zeros(0))

    def evaluate(self, evaluator: PolicyEvaluator, change: float) -> bool:
        """Set the evaluator's values to those of its policy; whether this has worked.

        change: the relative change by the last improvement; the values need not be much closer.
        """
        from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix

        local, n = self.local, self.local.n
        rows = np.arange(n)
        if local.mode != 0:
            assert local.matrix.groups is not None
            rows = local.matrix.groups[:-1] + np.asarray(evaluator.policy)
        middle = local.low[rows] + 0.5 * (local.high[rows] - local.low[rows])
        if not self.works or not np.isfinite(middle).all():
            return False
        matrix, leave = local.chain(rows)
        shift = SplitMatrix.of(matrix, np.ones(n)).with_rank_one(np.ones(n), np.full(n, 1.0 / n))
        goal = max(tuning.SHIFTED_ACCURACY * change, tuning.SMALLEST_CHANGE)
        y = self._solution(shift, matrix, middle, self.constants, goal)
        h = None if y is None else self._solution(shift, matrix, leave, self.leaving, goal)
        self.works = y is not None and h is not None and float(h.mean()) > 0.0
        if y is None or h is None or not self.works:
            return False
        self.constants, self.leaving = y, h
        evaluator.release_history()
        x = y + float(y.mean()) / float(h.mean()) * (1.0 - h)
        np.maximum(x, 0.0, out=np.asarray(evaluator.x))
        return True

    def _solution(
        self, shift: SplitMatrix, matrix: SparseMatrix, right: Floats, start: Floats, goal: float
    ) -> Floats | None:
        """M^-1 right with a residual of `goal`, or of what rounding lets it be if that suffices.

        None if BiCGStab does not converge.
        """
        z = start if len(start) else np.zeros_like(right)
        before = np.inf
        while True:
            mean = float(z.mean())
            rest = right - (z - matrix.multiply(z) + mean)
            error = float(np.abs(rest).max())
            if not goal * abs(mean) < error <= 0.5 * before:
                return z if error <= max(goal, self.accuracy) * abs(mean) else None
            before = error
            wanted = 0.3 * goal * (abs(mean) or 1e-3 * error)
            change = shift.solution(rest, wanted, tuning.SHIFTED_PATIENCE)
            if change is None:
                return None
            z = z + change


def _make_proper(evaluator: PolicyEvaluator, local: LocalSystem) -> bool:
    """Make the policy leave almost surely; False if no policy does."""
    assert local.matrix.groups is not None
    first = local.matrix.groups[:-1]
    policy = first + np.asarray(evaluator.policy)
    repaired = make_proper(local, policy)
    if repaired is None:
        return False
    if repaired is not policy:
        evaluator.set_policy((repaired - first).astype(np.int32))
    return True


def _applies(local: LocalSystem) -> bool:
    """Whether every state has a row, and constants are non-negative and (unless for min) finite."""
    groups = local.groups
    if groups is not None and bool(np.any(np.diff(groups) == 0)):
        return False
    if local.n == 0 or bool(local.low.min() < 0.0):
        return False
    return local.mode == 1 or bool(np.isfinite(local.high).all())


def _constants_width(low: Floats, high: Floats, relative: bool) -> float:
    """The largest width of the bounds on the constants, among the finite ones."""
    apart = (high > low) & np.isfinite(high)
    width = high[apart] - low[apart]
    return float(np.max(width / high[apart] if relative else width, initial=0.0))


def _prove(
    evaluator: PolicyEvaluator, goal: float, constants_width: float, relative: bool
) -> Bounds | None:
    """Proved bounds around the evaluator with a width of at most `goal`, or None."""
    # Solutions are non-negative, and outward rounding assumes it. NaN proves nothing.
    x = np.maximum(np.asarray(evaluator.x), 0.0)
    if not np.isfinite(x).all():
        return None
    policy = np.full(evaluator.n if evaluator.mode else 0, -1, dtype=np.int32)
    margin = 0.5 * constants_width + 0.4 * (goal - constants_width)
    rounds = 30 + evaluator.sweeps // 8
    upper = x * (1.0 + margin) if relative else x + margin
    lower = x * (1.0 - margin) if relative else np.maximum(x - margin, 0.0)
    del x
    if not (
        evaluator.verify_bound(upper, True, rounds, policy)
        and evaluator.verify_bound(lower, False, rounds, policy)
    ):
        return None
    width = (
        (upper - lower) / np.maximum(upper, tuning.SMALLEST_DIVISOR) if relative else upper - lower
    )
    if not (float(width.max()) <= goal and bool(np.all(lower <= upper))):
        return None
    return Bounds(lower, upper, policy if evaluator.mode else None)
