"""Transient values and distributions of a CTMC by uniformisation, with a bound on the error.

x(t) solves x' = Q x + reward_rate, x(0) = terminal, with Q = rates - diag(exit rates) on the
unknown states. For bounded until, reward_rate is the rate into the target; for instantaneous
rewards, terminal is the reward; for cumulative rewards, reward_rate is the reward rate. With P = I
+ Q/q and y_k = P^k y_0 the solution is a sum of weight_k * y_k with non-negative terms (Jensen
1953; Grassmann 1977).

Long horizons need fewer steps: if a y_k <= P y_k <= b y_k then a^m y_k <= P^m y_k <= b^m y_k
for all m (Collatz & Wielandt). The ratio bounds converge as the chain forgets its start, to a
steady state (a = b = 1) or to a quasi-stationary decay or growth, and the rest of the sum is then
known. Even without them, P^m y_k lies between the least (if no jump leaves the states) and the
greatest entry of y_k, or 0, however large m is: nothing remains once all is absorbed.

Other methods take its place for long horizons (see `methods`).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.rows import Floats, Int64s
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.horizon import Transient, close_enough
from symcheck.numerics.transient.poisson import PoissonWeights, WeightSequence, poisson
from symcheck.numerics.transient.uniformized_chain import UniformizedChain

__all__ = ["smooth", "sum_series"]


def sum_series(
    chain: UniformizedChain,
    start: Floats,
    time: float,
    source: bool,
    settings: Settings,
    interest: Int64s | None,
    observer: Observer | None,
    mass: bool = False,
    conservative: bool = False,
    limit: Callable[[], Floats] | None = None,
) -> Transient:
    """The sum of weight_k * P^k start over the Poisson window, cut short if bounds permit it.

    source: the weights are P(N > k), else P(N = k).
    mass: start is a distribution, whose sum does not grow; else values, whose maximum does not.
    conservative: no jump leaves the states, so that the minimum of values does not fall.
    limit: computes an upper bound on the values.
    """
    work = chain.q * time * (chain.entries or len(start))
    window, weights = _weights(chain.q * time, source, work > tuning.LONG_SERIES_ENTRIES)
    end = weights.end
    y, z, total = start.copy(), np.empty_like(start), np.zeros_like(start)
    at_interest: Callable[[Floats], Floats] = (
        (lambda v: v) if interest is None else (lambda v: v[interest])
    )
    k, check_interval = 0, min(tuning.CHECK_INTERVAL, end)
    rounding_error = _step_error(chain)
    largest: Floats | None = None
    while True:
        # The ratio bounds ignore negligible entries, which converge last.
        floor = (
            0.0
            if mass or k == 0
            else 1e-3 * settings.epsilon * float(at_interest(y).min(initial=np.inf)) / end
        )
        floor = floor if np.isfinite(floor) else 0.0
        y, z, low, high, most = chain.advance(
            y, z, total, weights.between(k, k + check_interval), floor
        )
        k += check_interval
        error = _series_error(chain, window, k, source and not mass)
        below = total * max(1.0 - error, 0.0)
        remaining_weight = weights.tail_sum(k) + weights.missing
        size = float(y.sum()) if mass else most
        above = total * (1.0 + error) + remaining_weight * size * (1.0 + error)
        if not mass and k <= weights.left:
            # All that is left is between the least and the greatest entry.
            error_now = _error_of_extremes(chain, k, source, error)
            least = float(y.min()) - error_now * (float(y.min()) if source else most)
            least = max(least, 0.0) if conservative else 0.0
            rest = weights.tail_sum(k) * (max(1.0 - error, 0.0) if source else 1.0)
            below = below + least * rest
            rest = remaining_weight * (1.0 + error if source else 1.0)
            above = np.minimum(above, total * (1.0 + error) + rest * most * (1.0 + error_now))
        out_of_work = (
            work > tuning.LONG_SERIES_ENTRIES
            and k * float(chain.entries or len(start)) > tuning.SERIES_ENTRIES
        )
        compares = out_of_work or min(k, end - k) >= tuning.LIMIT_STEPS
        if limit is not None and largest is None and compares:
            largest = limit()
        if largest is not None:
            above = np.maximum(np.minimum(above, largest), below)
        if observer is not None:
            observer(Progress("uniformisation", k, high - low, len(start)))
        if (
            k >= end
            or close_enough(at_interest(below), at_interest(above), settings)
            or out_of_work
        ):
            return _result(below, above, k, end, "")
        if (
            low <= high < np.inf
            and _worth_computing(
                low, high, remaining_weight, at_interest(total), at_interest(y), settings
            )
            and math.isfinite(powers := weights.powers(k, high * (1.0 + rounding_error)))
        ):
            least = weights.powers(k, low * (1.0 - rounding_error), upper=False)
            greatest = powers + 2.0 * weights.missing
            kept = np.where(y > floor / (1.0 - rounding_error), y, 0.0)
            error = _series_error(chain, window, k)
            shortcut = (
                np.maximum(below, (total + least * kept) * (1.0 - error)),
                np.minimum(
                    above, total * (1.0 + error) + greatest * (y + 2.0 * floor) * (1.0 + error)
                ),
            )
            # Ratios that differ by rounding only will not converge further.
            if high - low <= 2.0 * rounding_error or close_enough(
                at_interest(shortcut[0]), at_interest(shortcut[1]), settings
            ):
                return _result(
                    *shortcut,
                    k,
                    end,
                    f", then a steady ratio of {0.5 * (low + high):.12g} per step",
                )
        check_interval = min(max(tuning.CHECK_INTERVAL, k // 20), end - k)


def _weights(rate: float, source: bool, shortened: bool) -> tuple[PoissonWeights, WeightSequence]:
    """The window and the sequence of weights.

    shortened: the steps are too many, so that the end is not reached. Then one number stands for
    all within 40 standard deviations, where all but 1e-300 of the probability is. So any rate is
    possible, and the sums from the numbers before on are right.
    """
    deviations = 40.0 * math.sqrt(rate)
    if not shortened or deviations > 0.1 * rate:
        window = poisson(rate)
        return window, window.tails() if source else window.masses()
    if not math.isfinite(rate):
        raise NumericalError("the greatest rate times the time is beyond doubles")
    left = int(rate - deviations)
    window = PoissonWeights(rate, left, np.ones(1), 1e-300, 1e-15)
    last = rate - left if source else 1.0
    return window, WeightSequence(left, float(source), np.full(1, last), 1e-300, 2.0 * deviations)


def smooth(
    chain: UniformizedChain,
    start: Floats,
    time: float,
    source: bool,
    growth: float,
    observer: Observer | None,
) -> tuple[Floats, int, float]:
    """The sum of weight_k * P^k start over the whole Poisson window, for a short time.

    Args:
        chain: gives P and its rate.
        start: the vector, non-negative, float64[n].
        time: the horizon.
        source: the weights are P(N > k), else P(N = k).
        growth: a bound on the growth of the maximum.
        observer: receives the progress.

    Returns:
        The sum, the steps, and a bound on the absolute error.
    """
    window = poisson(chain.q * time, 1e-12)
    weights = window.tails() if source else window.masses()
    y, z, total, most = start.copy(), np.empty_like(start), np.zeros_like(start), 0.0
    for k in range(0, len(weights), tuning.CHECK_INTERVAL):
        part = weights.between(k, min(k + tuning.CHECK_INTERVAL, len(weights)))
        y, z, low, high, most = chain.advance(y, z, total, part, 0.0)
        if observer is not None:
            observer(Progress("uniformisation", k + len(part), high - low, len(start)))
    error = _series_error(chain, window, len(weights))
    remaining = (weights.tail_sum(len(weights)) + weights.missing) * most * growth
    return total, len(weights), (float(total.max()) * error + remaining) * (1.0 + 2.0 * error)


def _step_error(chain: UniformizedChain) -> float:
    """The relative error of a step, which rounds each product and sum, but no difference except
    q - exit rate.
    """
    return (chain.longest + 14) * tuning.UNIT_ROUNDOFF + max(chain.error - tuning.ENTRY_ERROR, 0.0)


def _exit_error(chain: UniformizedChain) -> float:
    """The relative error of exit rates, which are rounded sums."""
    return max(chain.longest * tuning.UNIT_ROUNDOFF, chain.error) + 2 * tuning.UNIT_ROUNDOFF


def _series_error(
    chain: UniformizedChain, window: PoissonWeights, steps: int, grows: bool = False
) -> float:
    """The relative error of the sum after some steps.

    Exit rates are rounded sums, and q t is a rounded product: if they differ by e relatively, the
    weight of each path has a factor within exp(±e q t), however many steps it has. 1e-10 is the
    error of `WeightSequence.powers`; it also covers that weights beyond the window count more than
    twice where values grow.

    grows: what is summed are rewards up to the time. If all states are left faster by a factor of
    up to 1 + e, a run earns what it earned, divided by up to 1 + e, within a time longer by the
    same factor. With the rate r and the window up to r + d, P(N > k) changes relatively by at most
    8 e max(sqrt(r), d): P(N > k) is at least P(N = k) min(sqrt(r), r/d) / 8 for k <= r + d. For k
    far below r, it is 1, and the sum of those that follow is that of all, r, minus k.
    """
    differ = _exit_error(chain)
    shift = window.rate
    if grows:
        beyond = max(40.0 * math.sqrt(window.rate), window.right - window.rate, 1.0)
        early = steps <= 0.5 * window.left
        shift = min(shift, 4.0 if early else 2.0 + 16.0 * beyond)
    fixed = 1e-10 + window.error + differ * shift
    return math.expm1(min((steps + 4) * _step_error(chain) + fixed, 200.0))


def _error_of_extremes(chain: UniformizedChain, steps: int, source: bool, error: float) -> float:
    """The error of the least and the greatest entry of P^k start, relative to the greatest.

    Rates that only grow with the time are those of a chain with other exit rates (see
    `_series_error`), of which the entries are as accurate as the sum. Otherwise an entry of P on
    the diagonal is wrong by as much as exit rates are, relative to 1, in each step.
    """
    differ = _exit_error(chain)
    return error if source else (steps + 4) * (_step_error(chain) + 2.0 * differ)


def _worth_computing(
    low: float, high: float, remaining_weight: float, total: Floats, y: Floats, settings: Settings
) -> bool:
    """A cheap test whether the ratio bounds may be close enough for the full test."""
    if not len(y):
        return True
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        room = (
            settings.epsilon * (total + remaining_weight * y)
            if settings.relative
            else settings.epsilon
        )
        need = np.nanmin(np.where(y > 0.0, room / (remaining_weight * y), np.inf))
    return (
        (high - low) * remaining_weight <= 4.0 * need
        or remaining_weight == 0.0
        or high - low <= 1e-14
    )


def _result(lower: Floats, upper: Floats, steps: int, all_steps: int, note: str) -> Transient:
    count = f"{all_steps}" if all_steps < 10**15 else f"{float(all_steps):.1e}"
    text = f"uniformisation, {steps} of {count} steps{note}"
    return Transient(lower, upper, steps, text)
