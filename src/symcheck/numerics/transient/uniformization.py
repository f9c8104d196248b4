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

Small chains with a long horizon are squared instead (see `squaring`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.linear.preconditioned_bicgstab import scaled
from symcheck.numerics.linear.problem import Observer, Progress, largest_width
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.forward import forward_value
from symcheck.numerics.transient.poisson import PoissonWeights, WeightSequence, poisson
from symcheck.numerics.transient.rational_krylov import importance, krylov_values, largest_growth
from symcheck.numerics.transient.squaring import IntervalChain, squaring_entries
from symcheck.numerics.transient.state_space_truncation import truncate
from symcheck.numerics.transient.supermartingale import bound_negligible_values
from symcheck.numerics.transient.uniformized_chain import UniformizedChain, uniformize
from symcheck.tables import counted

__all__ = ["Transient", "transient_distribution", "transient_values"]


@dataclass(frozen=True, eq=False)
class Transient:
    """Certified bounds, float64[n] each, the number of steps, and one line for users."""

    lower: Floats
    upper: Floats
    iterations: int
    explanation: str

    @property
    def middle(self) -> Floats:
        """The midpoint of the bounds."""
        return 0.5 * (self.lower + self.upper)

    def widened(self, error: float) -> Transient:
        """The bounds, widened by an absolute error: relative ones do not hold near underflow."""
        return replace(self, lower=np.maximum(self.lower - error, 0.0), upper=self.upper + error)

    def plus(self, other: Transient) -> Transient:
        """The sum of two parts, rounded outwards."""
        lower, upper = (
            (self.lower + other.lower) * (1 - 2 * tuning.UNIT_ROUNDOFF),
            (self.upper + other.upper) * (1 + 2 * tuning.UNIT_ROUNDOFF),
        )
        return Transient(
            lower,
            upper,
            self.iterations + other.iterations,
            f"{self.explanation}; {other.explanation}",
        )


def transient_values(
    kernel: TransitionKernel[SparseMatrix | SweepOperator],
    time: float,
    settings: Settings,
    *,
    terminal: Floats | None = None,
    reward_rate: Floats | None = None,
    interest: Int64s | None = None,
    observer: Observer | None = None,
    leave: Floats | None = None,
    limit: Callable[[], Floats] | None = None,
) -> Transient:
    """Bounds on x(time) for every state. All arrays are non-negative, float64[n].

    Args:
        kernel: the transitions among the n states, with exit rates, of which self-loops are a part.
        time: the horizon.
        settings: accuracy and limits.
        terminal, reward_rate: the initial values and the source (see the module).
        interest: states whose values need the accuracy; None: all.
        observer: receives the progress.
        leave: the probabilities of leaving for states outside; None: not known, and small chains
            are not squared.
        limit: computes an upper bound on the values at any time.

    Returns:
        Bounds, which are further apart than requested if rounding or the work does not allow for
        it. Values below 1e-300, such as those of states that earn nothing, may have the bounds
        0 and 2e-300.

    Raises:
        NumericalError: an array is negative (positive and negative parts must be given separately).
    """
    rates, exit_rates = kernel.weights, kernel.exit_rates
    assert exit_rates is not None, "time is continuous"
    n = len(exit_rates)
    total: Transient | None = None
    horizon = _Horizon(rates, exit_rates, time, settings, interest, observer, leave, limit)
    starts = [
        (start, source)
        for start, source in ((terminal, False), (reward_rate, True))
        if start is not None and np.any(start)
    ]
    if any(start.min() < 0.0 for start, _ in starts):
        raise NumericalError("transient values require non-negative rewards")
    if starts and horizon.is_squared:
        return horizon.by_squaring(terminal, reward_rate)
    for start, source in starts:
        part = horizon.part(start, source)
        total = part if total is None else total.plus(part)
    return (
        total.widened(tuning.UNDERFLOW_BOUND)
        if total
        else Transient(np.zeros(n), np.zeros(n), 0, "no reward is earned: 0")
    )


@dataclass(frozen=True, eq=False)
class _Horizon:
    """Values at a time, which need the accuracy at some states (see `transient_values`).

    leave: the probabilities of leaving for states outside, or None.
    """

    rates: SparseMatrix | SweepOperator
    exit_rates: Floats
    time: float
    settings: Settings
    interest: Int64s | None
    observer: Observer | None
    leave: Floats | None = None
    limit: Callable[[], Floats] | None = None

    @property
    def is_squared(self) -> bool:
        """Whether squaring takes fewer multiplications than the steps of uniformisation."""
        rates, steps = self.rates, float(self.exit_rates.max()) * self.time
        return (
            isinstance(rates, SparseMatrix)
            and self.leave is not None
            and rates.states <= tuning.SQUARING_STATES
            and steps > tuning.SQUARING_STEPS
            and squaring_entries(rates.states, steps) < steps * (rates.entries + rates.rows)
        )

    def by_squaring(self, terminal: Floats | None, reward_rate: Floats | None) -> Transient:
        """Both parts, for a small chain."""
        rates, leave = self.rates, self.leave
        assert isinstance(rates, SparseMatrix)
        assert leave is not None
        # Of a sum, its quotient, a sum with what was cut off, and the product.
        error = tuning.ENTRY_ERROR + (rates.longest + 4) * tuning.UNIT_ROUNDOFF
        leave = leave * self.exit_rates
        earned = np.zeros(rates.states) if reward_rate is None else reward_rate
        chain, reward, halvings = IntervalChain.of_rates(rates, leave, self.time, earned, error)
        end = None if terminal is None else (terminal, terminal)
        found = chain.values(1 << halvings, end, None if reward_rate is None else reward)
        return Transient(
            found.lower, found.upper, found.squarings, f"{found.squarings} squarings of a matrix"
        )

    @cached_property
    def chain(self) -> UniformizedChain:
        """The uniformised chain."""
        return uniformize(self.rates, self.exit_rates)

    def part(self, start: Floats, source: bool) -> Transient:
        """The part of the terminal values or of the reward rate, by the first that applies."""
        rates, interest = self.rates, self.interest
        if interest is not None and len(interest) and isinstance(rates, SparseMatrix):
            steps = float(self.exit_rates.max()) * self.time
            entries = steps * (rates.entries + rates.rows)
            result, least = None, 0.0
            # Each step visits at least one entry.
            forward = entries > tuning.FORWARD_ENTRIES and steps <= tuning.FORWARD_WORK
            if len(interest) == 1 and forward:
                result, least = self.by_forward_steps(rates, int(interest[0]), start, source)
            if result is None and source and entries > tuning.TRUNCATION_ENTRIES:
                result = self.if_negligible(rates, interest, start, least)
                result = result or self.on_truncated_space(rates, interest, start)
            if result is None and steps <= tuning.LARGEST_POISSON_RATE:
                result = self.by_rational_krylov(rates, interest, start, source)
                if result is not None and not self.suffices(result, interest, entries):
                    result = None
            if result is not None:
                return result
        return self.by_series(start, source)

    def suffices(self, found: Transient, interest: Int64s, entries: float) -> bool:
        """Whether the bounds are as close as requested, or uniformisation, which would visit these
        entries, takes too long for closer ones.
        """
        close = _close_enough(found.lower[interest], found.upper[interest], self.settings)
        return close or entries > tuning.AFTER_KRYLOV_ENTRIES

    def by_series(self, start: Floats, source: bool) -> Transient:
        """Uniformisation."""
        y = start / self.chain.q if source else start
        conservative = self.leave is not None and not np.any(self.leave)
        return _sum_series(
            self.chain,
            y,
            self.time,
            source,
            self.settings,
            self.interest,
            self.observer,
            conservative=conservative,
            limit=self.limit if source else None,
        )

    def by_forward_steps(
        self, rates: SparseMatrix, state: int, start: Floats, source: bool
    ) -> tuple[Transient | None, float]:
        """Forward uniformisation from the state of interest; other states get trivial bounds.

        Returns:
            None if it did not end; and a lower bound on the value of the state in any case.
        """
        run = forward_value(
            rates, self.exit_rates, start, self.time, source, state, self.settings, self.observer
        )
        if math.isinf(run.upper):
            return None, run.lower
        lower, upper = self.trivial_bounds(start, source)
        lower[state], upper[state] = run.lower, run.upper
        note = (
            f"uniformisation, {run.steps} steps forward, with at most {run.largest} of "
            f"{counted(len(start), 'state')} active"
        )
        return Transient(lower, upper, run.steps, note), run.lower

    def trivial_bounds(self, start: Floats, source: bool) -> tuple[Floats, Floats]:
        """0, and what the largest reward would earn all the time: float64[n] each."""
        most = float(start.max()) * (self.time if source else 1.0) * (1.0 + 1e-9)
        return np.zeros(len(start)), np.full(len(start), most)

    def if_negligible(
        self, rates: SparseMatrix, interest: Int64s, reward_rate: Floats, least: float
    ) -> Transient | None:
        """Values from 0 to a proved bound, if that is close enough; others get trivial bounds.

        least: a lower bound on the values of interest.
        """
        enough = tuning.UNDERFLOW_BOUND
        if not self.settings.relative:
            enough = max(enough, self.settings.epsilon)
        if least > enough:
            return None
        bound = bound_negligible_values(
            rates, self.exit_rates, self.time, reward_rate, interest, enough
        )
        if bound is None:
            return None
        lower, upper = self.trivial_bounds(reward_rate, True)
        upper[interest] = bound
        return Transient(lower, upper, 0, "an exponential supermartingale")

    def by_rational_krylov(
        self,
        rates: SparseMatrix,
        interest: Int64s,
        start: Floats,
        source: bool,
        weights: Floats | None = None,
    ) -> Transient | None:
        """Rational Krylov subspaces for stiff chains, after uniformisation has smoothed the start.

        weights: positive; values are divided by them, and Q becomes diag(w)^-1 Q diag(w). None: 1.

        Returns:
            Bounds, perhaps further apart than requested (see `krylov_values`); None if the chain
            is not stiff or the subspace does not converge.
        """
        chain, exit_rates, time = self.chain, self.exit_rates, self.time
        settings, observer = self.settings, self.observer
        smoothing = tuning.SMOOTHING_STEPS / chain.q
        if (
            chain.q * time < tuning.KRYLOV_STEPS
            or chain.q * time * chain.entries < tuning.KRYLOV_ENTRIES
        ):
            return None
        growth, later_growth, scale, poles = 1.0, 1.0, np.ones(1), tuning.POLES
        if weights is not None:
            rates, scale, poles = scaled(rates, weights), weights, tuning.WEIGHTED_POLES
            start = start / weights
            chain = uniformize(rates, exit_rates)
            growth, later_growth = (
                largest_growth(rates, exit_rates, t) for t in (4.0 * smoothing, time)
            )
            if math.isinf(later_growth):
                return None
        rounding = 2.0 * (rates.longest + 6) * tuning.UNIT_ROUNDOFF * chain.q * time
        if settings.relative and rounding > settings.epsilon:
            return None  # it is an error relative to the greatest value (see `krylov_values`)
        terms = start / chain.q if source else start
        smooth, steps, smoothing_error = _smooth(chain, terms, smoothing, source, growth, observer)
        reward_rate = start if source else None
        result = krylov_values(
            rates,
            exit_rates,
            smooth,
            reward_rate,
            time - smoothing,
            interest,
            settings,
            observer,
            poles,
        )
        if result is None:
            return None
        error = (result.error + smoothing_error * later_growth * (1.0 + 1e-6)) * scale
        values = result.values * scale
        lower, upper = np.maximum(values - error, 0.0), values + error
        note = (
            f"uniformisation, {steps} steps, then a rational Krylov subspace of "
            f"{result.vectors} vectors, {result.steps} steps of BiCGStab"
        )
        return Transient(lower, upper, steps + result.steps, note)

    def on_truncated_space(
        self, rates: SparseMatrix, interest: Int64s, reward_rate: Floats
    ) -> Transient | None:
        """A reward rate on a truncated space; other states get trivial bounds."""
        exit_rates, time = self.exit_rates, self.time
        kept, loss, matrix = np.arange(rates.states, dtype=np.int64), 0.0, rates
        cut = None
        for laplace_shift in tuning.TRUNCATION_SHIFTS:
            index = np.full(rates.states, -1, dtype=np.int32)
            index[kept] = np.arange(len(kept))
            at = index[interest].astype(np.int64)
            closer = truncate(
                matrix,
                exit_rates[kept],
                time,
                reward_rate[kept],
                at,
                0.1 * self.settings.epsilon,
                laplace_shift,
            )
            if closer is None:
                break
            cut = closer
            kept, loss = kept[cut.kept], loss + cut.loss
            index[:] = -1
            index[kept] = np.arange(len(kept))
            matrix = rates.select(kept, index, len(kept))
        if cut is None or len(kept) > tuning.TRUNCATION_MAX_KEPT * rates.states:
            return None
        at = index[interest].astype(np.int64)
        leave, limit = None, self.limit
        if self.leave is not None:
            members = np.zeros(rates.states, np.bool_)
            members[kept] = True
            cut_off = np.zeros(rates.states)
            cut_off[members] = rates.sums(members, ~members)
            leave = (self.leave + cut_off / exit_rates)[kept]
        smaller = _Horizon(
            matrix,
            exit_rates[kept],
            time,
            self.settings,
            at,
            self.observer,
            leave,
            None if limit is None else lambda: limit()[kept],
        )
        result = smaller.by_squaring(None, reward_rate[kept]) if smaller.is_squared else None
        if result is None and smaller.chain.q * time <= tuning.LARGEST_POISSON_RATE:
            weights = importance(matrix, exit_rates[kept], reward_rate[kept], time, cut.values)
            if weights is not None:
                result = smaller.by_rational_krylov(matrix, at, reward_rate[kept], True, weights)
                entries = smaller.chain.q * time * smaller.chain.entries
                if result is not None and not smaller.suffices(result, at, entries):
                    result = None
        result = result or smaller.by_series(reward_rate[kept], True)
        lower, upper = self.trivial_bounds(reward_rate, True)
        lower[interest] = result.lower[at]
        upper[interest] = result.upper[at] + loss
        note = f"{len(kept)} of {rates.states} states kept: {result.explanation}"
        return Transient(lower, upper, result.iterations, note)


def transient_distribution(
    kernel: TransitionKernel[SparseMatrix], initial: Floats, time: float, settings: Settings
) -> Transient:
    """Bounds on the probability of each state at a time.

    Args:
        kernel: as in `transient_values`.
        initial: the initial distribution, float64[n].
        time: the time.
        settings: accuracy and limits.
    """
    rates, exit_rates = kernel.weights, kernel.exit_rates
    assert exit_rates is not None, "time is continuous"
    steps = float(exit_rates.max(initial=0.0)) * time
    if (
        rates.states <= tuning.SQUARING_STATES
        and steps > tuning.SQUARING_STEPS
        and squaring_entries(rates.states, steps) < steps * (rates.entries + rates.rows)
    ):
        nothing = np.zeros(rates.states)
        error = tuning.ENTRY_ERROR + rates.longest * tuning.UNIT_ROUNDOFF
        squared, _, halvings = IntervalChain.of_rates(rates, nothing, time, nothing, error)
        found = squared.distribution(1 << halvings, initial)
        text = f"{found.squarings} squarings of a matrix"
        return Transient(found.lower, found.upper, found.squarings, text)
    chain = uniformize(rates, exit_rates, transposed=True)
    series = _sum_series(chain, initial, time, False, settings, None, None, mass=True)
    series.upper[:] = np.minimum(series.upper, 1.0)
    return series


def _sum_series(
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
            or _close_enough(at_interest(below), at_interest(above), settings)
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
            if high - low <= 2.0 * rounding_error or _close_enough(
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


def _smooth(
    chain: UniformizedChain,
    start: Floats,
    time: float,
    source: bool,
    growth: float,
    observer: Observer | None,
) -> tuple[Floats, int, float]:
    """The sum of weight_k * P^k start over the whole Poisson window, for a short time.

    Args:
        source: the weights are P(N > k), else P(N = k).
        growth: a bound on the growth of the maximum.

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
    return (chain.longest + 14) * tuning.UNIT_ROUNDOFF


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
    differ = (chain.longest + 2) * tuning.UNIT_ROUNDOFF
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
    differ = (chain.longest + 2) * tuning.UNIT_ROUNDOFF
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


def _close_enough(below: Floats, above: Floats, settings: Settings) -> bool:
    return largest_width(below, above, settings.relative) <= settings.epsilon


def _result(lower: Floats, upper: Floats, steps: int, all_steps: int, note: str) -> Transient:
    count = f"{all_steps}" if all_steps < 10**15 else f"{float(all_steps):.1e}"
    text = f"uniformisation, {steps} of {count} steps{note}"
    return Transient(lower, upper, steps, text)
