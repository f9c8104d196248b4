"""A component's values by policies that are evaluated by extrapolated sweeps; then guesses around them are proved to be bounds.

For x = opt(A x + b) with a solution that is unique (everything leaves almost surely, as far as it is finite), L <= opt(A L + b)
proves L to be a lower bound, and U >= opt(A U + b) an upper one. A good approximation, made a little smaller and a little
greater, fulfils this after a few sweeps. Sources: Howard (1960); Anderson (1965); Hartmanns & Kaminski (2020) for the proof.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symcheck.kernels.solve.extrapolation import Candidate
from symcheck.kernels.solve.sweeps import Block
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.problem import Observer, Step
from symcheck.numerics.linear.subsystem import Bounds, LocalSystem, proper

__all__ = ["accelerated"]

FIRST = 16  # sweeps before the first policy
STEPS = 40  # combinations per policy
GAIN = 0.03  # of the change that is left of it after a policy's evaluation
ROUNDS = 150  # policies, or slices of a chain's evaluation
PATIENCE = 25  # rounds without progress
FLOOR = 2e-15  # changes that are rounding


def accelerated(
    block: Block,
    goal: float,
    relative: bool,
    probability: bool = False,
    observer: Observer | None = None,
) -> tuple[Bounds | None, int]:
    """Proved bounds that are `goal` apart (None where that fails), and the number of sweeps; `policy` counts a state's rows."""
    local = LocalSystem.of(block)
    spread = _spread(local.low, local.high, relative)
    if not _fits(local) or not spread < goal:
        return None, 0
    candidate = Candidate(
        block.row_ptr,
        block.idx,
        block.val,
        local.groups,
        local.low,
        local.high,
        local.mode,
        relative,
    )
    tolerance = max((1e-3 if relative else 1e-6) * (goal - spread), FLOOR)
    for change in _changes(candidate, local, not probability):
        if observer is not None:
            observer(Step("accelerated sweeps", candidate.sweeps, change, local.n))
        if change <= tolerance:
            if local.mode != 0:
                candidate.rest()  # the next improvement forgets them anyway
            found = _prove(candidate, goal, spread, relative)
            if found is not None or tolerance <= FLOOR:
                return found, candidate.sweeps
            tolerance = max(tolerance * 1e-2, FLOOR)
    return None, candidate.sweeps


def _changes(candidate: Candidate, local: LocalSystem, reward: bool) -> Iterator[float]:
    """Improve and evaluate policies: the change that a sweep over all rows still makes, per policy."""
    best, stalled = np.inf, 0
    change, changed = candidate.improve(FIRST)
    for _ in range(ROUNDS):
        if local.mode != 0:
            change, more = candidate.improve()
            changed += more
        yield change
        best, stalled = (change, 0) if change < 0.5 * best else (best, stalled + 1)
        # Only for the least reward may a policy stay for ever, while its values are too low to show that.
        if changed and reward and local.mode == 1 and not _mend(candidate, local):
            return
        changed = 0
        last = candidate.evaluate(max(GAIN * min(change, 1.0), FLOOR), STEPS)
        if stalled > PATIENCE or not np.isfinite(last):
            return
        change = last


def _mend(candidate: Candidate, local: LocalSystem) -> bool:
    """Make the policy leave almost surely; False where none does."""
    assert local.matrix.groups is not None
    first = local.matrix.groups[:-1]
    policy = first + np.asarray(candidate.choice)
    mended = proper(local, policy)
    if mended is None:
        return False
    if mended is not policy:
        candidate.take((mended - first).astype(np.int32))
    return True


def _fits(local: LocalSystem) -> bool:
    """Whether every state has a row, and constants are finite and not negative (with min, rows that lead to infinity do no harm)."""
    groups = local.groups
    if groups is not None and bool(np.any(np.diff(groups) == 0)):
        return False
    if local.n == 0 or bool(local.low.min() < 0.0):
        return False
    return local.mode == 1 or bool(np.isfinite(local.high).all())


def _spread(low: Floats, high: Floats, relative: bool) -> float:
    """How far the constants' bounds are apart, where they are finite."""
    apart = (high > low) & np.isfinite(high)
    width = high[apart] - low[apart]
    return float(np.max(width / high[apart] if relative else width, initial=0.0))


def _prove(candidate: Candidate, goal: float, spread: float, relative: bool) -> Bounds | None:
    """Bounds around the candidate, as near as the constants allow and the goal asks; None where no proof is found."""
    # No solution is negative; a candidate may be, and rounding outwards is for numbers that are not. NaN proves nothing.
    x = np.maximum(np.asarray(candidate.x), 0.0)
    if not np.isfinite(x).all():
        return None
    policy = np.full(candidate.n if candidate.mode else 0, -1, dtype=np.int32)
    away = 0.5 * spread + 0.4 * (goal - spread)
    rounds = 30 + candidate.sweeps // 8
    upper = x * (1.0 + away) if relative else x + away
    lower = x * (1.0 - away) if relative else np.maximum(x - away, 0.0)
    del x
    if not (
        candidate.bound(upper, True, rounds, policy)
        and candidate.bound(lower, False, rounds, policy)
    ):
        return None
    width = (upper - lower) / np.maximum(upper, 1e-300) if relative else upper - lower
    if not (float(width.max()) <= goal and bool(np.all(lower <= upper))):
        return None
    return Bounds(lower, upper, policy if candidate.mode else None)
