"""Stationary distributions and average rewards of irreducible chains, with certified bounds.

A stationary distribution is computed by elimination without subtraction, which preserves the
relative accuracy of every entry (Grassmann, Taksar & Heyman 1985). Where that needs too many
operations, average rewards are still certified: for *any* vector h,

    min over s of (r + Q h)(s)  <=  average of r  <=  max over s of (r + Q h)(s),

as the mean of Q h under the stationary distribution is 0. So h may be any approximate solution of
the Poisson equation (here, by BiCGStab preconditioned with the triangles of Q); its residual bounds
the error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from symcheck.kernels.chains import gauss_seidel
from symcheck.kernels.chains.gth_elimination import GthElimination
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear import rational
from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.long_run.drift import average_by_drift
from symcheck.numerics.settings import Accuracy, Settings
from symcheck.numerics.underflow import enclosed
from symcheck.tables import counted

__all__ = ["Average", "Stationary", "long_run_average", "stationary_distribution"]


@dataclass(frozen=True, eq=False)
class Stationary:
    """Bounds on the stationary probability of each state; `certified` False: an estimate."""

    lower: Floats
    upper: Floats
    certified: bool
    explanation: str

    @property
    def middle(self) -> Floats:
        """The point between the bounds."""
        return 0.5 * (self.lower + self.upper)


@dataclass(frozen=True)
class Average:
    """Bounds on a long-run average."""

    lower: float
    upper: float
    iterations: int
    explanation: str


def stationary_distribution(
    rates: SparseMatrix,
    settings: Settings,
    observer: Observer | None = None,
    error: float = tuning.ENTRY_ERROR,
) -> Stationary:
    """Stationary distribution of an irreducible chain.

    Args:
        rates: the rates of a CTMC or the probabilities of a DTMC; self-loops have no effect.
        settings: the accuracy of the sweeps.
        observer: receives the progress.
        error: of the rates, relative.

    Returns:
        Certified bounds if elimination is affordable, otherwise an estimate by Gauss-Seidel sweeps.
    """
    n = rates.states
    if n == 1:
        one = np.ones(1)
        return Stationary(one, one, True, "one state")
    known = _eliminated(rates, tuning.STATIONARY_OPERATIONS, error)
    if known is not None:
        return known
    pi, count = _estimate(rates, settings, observer)
    note = f"{counted(n, 'state')}: Gauss-Seidel, {counted(count, 'sweep')}; an estimate"
    return Stationary(pi, pi, False, note)


def _eliminated(rates: SparseMatrix, limit: int, rate_error: float) -> Stationary | None:
    """The distribution by elimination; None if that needs more than `limit` operations."""
    n = rates.states
    factors = GthElimination(*rates.arrays, np.zeros(n), limit)
    if not factors.complete:
        return None
    pi = factors.stationary()
    error = factors.error + (n + 4) * tuning.UNIT_ROUNDOFF + 2 * n * rate_error
    bounds = [pi * (1.0 - error), np.minimum(pi * (1.0 + error), 1.0)]
    lower, upper = enclosed(bounds, lambda: np.ones(n))  # a state that is left again has a share
    return Stationary(lower, upper, True, f"{counted(n, 'state')}: elimination")


def _estimate(
    rates: SparseMatrix, settings: Settings, observer: Observer | None
) -> tuple[Floats, int]:
    """Gauss-Seidel sweeps on pi Q = 0: the distribution and the number of sweeps."""
    columns = sparse.transpose_values(*rates.arrays, rates.columns)
    leave = gauss_seidel.exit_rates(*rates.arrays)
    pi = np.full(rates.states, 1.0 / rates.states)
    for count in range(1, settings.max_iterations + 1):
        change = gauss_seidel.stationary_sweep(*columns, leave, pi)
        total = float(pi.sum())
        pi /= total
        if observer is not None:
            observer(Progress("gauss-seidel", count, change / total, rates.states))
        if change <= settings.epsilon * 0.01 * total:
            break
    return pi, count


def long_run_average(
    rates: SparseMatrix,
    rewards: Floats,
    settings: Settings,
    observer: Observer | None = None,
    error: float = tuning.ENTRY_ERROR,
) -> Average:
    """Long-run average of a reward in an irreducible chain.

    Args:
        rates: the rates (the average is per unit of time) or probabilities (per step).
        rewards: the reward of each state, float64[n]; transition rewards are weighted with their
            rates or probabilities and summed per state.
        settings: the accuracy.
        observer: receives the progress.
        error: of the rates, relative.

    Returns:
        Certified bounds, which are equal if the rates are rationals.
    """
    if rates.is_rational:
        average = (rational.stationary_distribution(rates) * rewards).sum()
        note = f"{counted(rates.states, 'state')}: rational elimination"
        return Average(average, average, 1, note)
    n = rates.states
    if n == 1:
        return Average(rewards[0], rewards[0], 1, "one state")
    limit = (
        tuning.STATIONARY_OPERATIONS
        if n <= tuning.SMALL_CHAIN_STATES
        else tuning.QUICK_OPERATIONS_PER_ENTRY * rates.entries
        if n <= tuning.ELIMINATION_STATES
        else 0
    )
    known = _eliminated(rates, limit, error) if limit else None
    if known is not None:
        return _weighted(known, rewards)
    leave = gauss_seidel.exit_rates(*rates.arrays)
    core = (
        _by_drift(rates, leave, rewards, settings, observer, error)
        if n >= tuning.DRIFT_STATES
        else None
    )
    if core is not None and _close_enough((core.lower, core.upper), settings):
        return core
    solution, _ = _poisson_equation(rates, leave, rewards, settings, observer, error)
    if core is not None:
        closer = max(core.lower, solution.lower), min(core.upper, solution.upper)
        solution = replace(solution, lower=closer[0], upper=closer[1])
    if (
        not _close_enough((solution.lower, solution.upper), settings)
        and n <= tuning.ELIMINATION_STATES
    ):
        known = _eliminated(rates, tuning.STATIONARY_OPERATIONS, error)
        if known is not None:
            return _weighted(known, rewards)
    return solution


def _by_drift(
    rates: SparseMatrix,
    leave: Floats,
    rewards: Floats,
    settings: Settings,
    observer: Observer | None,
    error: float,
) -> Average | None:
    """Bounds from the states in which the chain is most of the time, if they are few."""
    half = Accuracy(
        epsilon=0.5 * settings.epsilon,
        relative=settings.relative,
        max_iterations=settings.max_iterations,
    )
    made = 0

    def solve(inner: SparseMatrix, inner_rewards: Floats) -> Floats:
        nonlocal made
        inner_leave = gauss_seidel.exit_rates(*inner.arrays)
        if not np.all(inner_leave):  # each jump from the most visited state leaves the core
            return np.zeros(inner.states)
        average, h = _poisson_equation(inner, inner_leave, inner_rewards, half, observer, error)
        made = average.iterations
        return h

    found = average_by_drift(rates, leave, rewards, solve, error)
    if found is None:
        return None
    core = f"{rates.states} states: drift towards {found.states} of them"
    note = f"{core}, preconditioned BiCGStab on the Poisson equation there, {made} steps"
    return Average(found.lower, found.upper, made, note)


def _weighted(known: Stationary, rewards: Floats) -> Average:
    """The average reward under bounds on the distribution, rounded outwards."""
    plus, minus = np.maximum(rewards, 0.0), np.maximum(-rewards, 0.0)
    low = float(known.lower @ plus - known.upper @ minus)
    high = float(known.upper @ plus - known.lower @ minus)
    rounding_error = (
        (len(rewards) + 2) * tuning.UNIT_ROUNDOFF * float(known.upper @ np.abs(rewards))
    )
    if rewards.any():  # products may underflow
        rounding_error += len(rewards) * math.ulp(0.0)
    if not minus.any():
        low = max(low, rounding_error)
    return Average(low - rounding_error, high + rounding_error, 1, known.explanation)


def _bordered(rates: SparseMatrix, leave: Floats) -> SplitMatrix:
    """The Poisson equation g - (Q h)(s) = r(s), divided by the exit rates, with g = row·h.

    Q annihilates constant vectors, so the row may be any that does not. An approximation of the
    stationary distribution by a few sweeps shifts the eigenvalue 0 into the range of the others.
    """
    mass, time = np.full(rates.states, 1.0 / rates.states), np.zeros(rates.states)
    for sweep in range(tuning.OCCUPATION_SWEEPS):
        if sweep == tuning.OCCUPATION_SWEEPS // 2:
            time[:] = 0.0  # discard the part that depends on the start
        gauss_seidel.occupation_sweep(*rates.arrays, leave, mass, time)
    time *= (
        tuning.EIGENVALUE_SHIFT * float(np.einsum("i,i->", time, leave)) / float(time.sum()) ** 2
    )
    slow = 1.0 / leave
    return SplitMatrix.of(rates, slow).with_rank_one(slow, time)


def _poisson_equation(
    rates: SparseMatrix,
    leave: Floats,
    rewards: Floats,
    settings: Settings,
    observer: Observer | None,
    error: float,
) -> tuple[Average, Floats]:
    """Improve h until the least and the greatest entry of r + Q h are close enough; the best h."""
    split = _bordered(rates, leave)
    longest = rates.longest
    largest = float(np.max(np.abs(rewards), initial=0.0))

    def compute_bounds(h: Floats) -> tuple[float, float]:
        out = np.empty(rates.states)
        gauss_seidel.apply_generator(*rates.arrays, h, out)
        most = gauss_seidel.largest_generator_term(*rates.arrays, h)
        rounding_error = (longest + 6) * 2.0 * tuning.UNIT_ROUNDOFF * (most + largest)
        rounding_error += 2.0 * error * most
        out += rewards
        return float(out.min()) - rounding_error, float(out.max()) + rounding_error

    best_h, narrowest = np.zeros(rates.states), np.inf
    best = compute_bounds(best_h)
    made, improved, least = 0, 0, np.inf
    # The residual when bounds were last computed, and their width divided by it.
    checked, ratio = np.inf, 0.0
    for x, residual in split.solve(rewards / leave):
        made += 1
        if residual < 0.5 * least:
            improved, least = made, residual
        promising = ratio * residual <= settings.epsilon * (
            max(abs(best[0]), abs(best[1])) if settings.relative else 1.0
        )
        if (promising and residual <= tuning.POISSON_RESIDUAL_DROP * checked) or (
            made - improved
        ) % tuning.POISSON_PATIENCE == tuning.POISSON_PATIENCE - 1:
            h = split.solve_upper(x)
            low, high = compute_bounds(h)
            checked, ratio = residual, (high - low) / residual if residual > 0.0 else 0.0
            if math.isfinite(high - low):
                best = max(low, best[0]), min(high, best[1])
            if high - low < narrowest:
                best_h, narrowest = h, high - low
        if observer is not None:
            observer(Progress("bicgstab", made, best[1] - best[0], rates.states))
        if (
            _close_enough(best, settings)
            or made - improved >= tuning.POISSON_STALL_STEPS
            or made >= settings.max_iterations
            or residual == 0.0
        ):
            break
    note = f"{rates.states} states: preconditioned BiCGStab on the Poisson equation, {made} steps"
    enough = "" if _close_enough(best, settings) else ", accuracy not reached"
    return Average(*best, made, note + enough), best_h


def _close_enough(bounds: tuple[float, float], settings: Settings) -> bool:
    width = bounds[1] - bounds[0]
    return math.isfinite(width) and width <= settings.epsilon * (
        max(abs(bounds[0]), abs(bounds[1]), 1e-300) if settings.relative else 1.0
    )
