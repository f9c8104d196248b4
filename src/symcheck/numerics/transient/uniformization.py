"""Transient values and distributions of a CTMC by uniformisation, with a bound on the error.

x(t) solves x' = Q x + gain, x(0) = terminal, with Q = rates - diag(exit rates) on the unknown states: for bounded until, gain is
the rate into the target; for instantaneous rewards, terminal is the reward; for cumulative ones, gain is the reward rate.
With P = I + Q/q and y_k = P^k y_0 everything is a sum of weight_k * y_k with non-negative terms (Jensen 1953; Grassmann 1977).

Long horizons end early, with proof: if a y_k <= P y_k <= b y_k then a^m y_k <= P^m y_k <= b^m y_k for all m (Collatz & Wielandt).
The ratio bounds close in on each other as the chain forgets where it started, be it on a steady state (a = b = 1) or on a
quasi-stationary decay or growth (a = b = another number), and what remains of the sum is then known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from symcheck.errors import NumericalError
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics.linear.preconditioned_bicgstab import scaled
from symcheck.numerics.linear.problem import Observer, Progress, SweepOperator
from symcheck.numerics.settings import Accuracy, Settings
from symcheck.numerics.transient.poisson import poisson
from symcheck.numerics.transient.rational_krylov import excess, implicit_values, importance
from symcheck.numerics.transient.state_space_truncation import truncate
from symcheck.numerics.transient.uniformized_chain import ROUND, Chain, Visits, uniformise

__all__ = ["Transient", "transient_distribution", "transient_values"]

TINY = 1e-300  # more than 1e7 steps with 1e3 roundings each lose to underflow, 1e7 times over
LOOK = 50  # steps between two looks at the stopping test
BUDGET = 1e10  # entries to go over, at most, before states are cut off that do not matter (a tenth of it if the whole is hopeless)
PATIENCE = 0.01  # of the entries to go over in all, likewise
HOPELESS = 1e12  # entries to go over in all
LONG, STIFF = (
    2e3,
    1e10,
)  # steps, and entries to go over in all, from which on implicit means are tried
POLES: tuple[float, ...] = (15.0,)  # γ is the time over these, in turn
WIDE: tuple[float, ...] = (
    20.0,
    150.0,
    800.0,
)  # in terms of weights, where what is fast goes on all the time
SELDOM = 0.01  # of the states, where gain comes from
LAYER = 200.0  # steps of uniformisation before that
HASTE = (20.0, 5.0)  # of the rounds of cutting off


@dataclass(frozen=True, eq=False)
class Transient:
    """Certified bounds, float64[n] each; steps made, steps that plain uniformisation makes, and a line for people."""

    lower: Floats
    upper: Floats
    iterations: int
    explanation: str
    statistics: dict[str, Any] = field(default_factory=dict)

    @property
    def middle(self) -> Floats:
        """The point between the bounds."""
        return 0.5 * (self.lower + self.upper)

    def widened(self, room: float) -> Transient:
        """Bounds a little apart in absolute terms: numbers near the least double lose what relative bounds on roundings promise."""
        return replace(self, lower=np.maximum(self.lower - room, 0.0), upper=self.upper + room)

    def plus(self, other: Transient) -> Transient:
        """The sum of two, each rounded outwards."""
        lower, upper = (
            (self.lower + other.lower) * (1 - 2 * ROUND),
            (self.upper + other.upper) * (1 + 2 * ROUND),
        )
        return Transient(
            lower,
            upper,
            self.iterations + other.iterations,
            f"{self.explanation}; {other.explanation}",
            self.statistics,
        )


def transient_values(
    rates: SparseMatrix | SweepOperator,
    exit_rates: Floats,
    time: float,
    settings: Settings,
    *,
    terminal: Floats | None = None,
    gain: Floats | None = None,
    interest: Int64s | None = None,
    observer: Observer | None = None,
) -> Transient:
    """Bounds on x(time) for every state: see above. All arrays non-negative, float64[n].

    What is too small for a double is bounded by 1e-300, and so are states that gain nothing: leave them out before.

    rates: among the n states (an entry on the diagonal is a self-loop and must be counted in exit_rates). exit_rates: the
    total rate of leaving each state, to states outside as well. interest: states where the accuracy is needed (None: all).
    Raises NumericalError for negative arrays (give positive and negative parts apart).
    """
    n = len(exit_rates)
    found: Transient | None = None
    chain = uniformise(rates, exit_rates)
    for start, source in ((terminal, False), (gain, True)):
        if start is None or not np.any(start):
            continue
        if start.min() < 0.0:
            raise NumericalError(
                "transient values need non-negative rewards: treat gains and losses apart"
            )
        part = _part(chain, rates, exit_rates, start, time, source, settings, interest, observer)
        found = part if found is None else found.plus(part)
    return (
        found.widened(TINY)
        if found
        else Transient(np.zeros(n), np.zeros(n), 0, "nothing to gain: 0")
    )


def _part(
    chain: Chain,
    rates: SparseMatrix | SweepOperator,
    exit_rates: Floats,
    start: Floats,
    time: float,
    source: bool,
    settings: Settings,
    interest: Int64s | None,
    observer: Observer | None,
) -> Transient:
    """The part of the terminal values or of the gain, by the ways that may pay, the most promising first."""
    y = start / chain.q if source else start
    if interest is not None and len(interest) and isinstance(rates, SparseMatrix):
        whole = chain.q * time * chain.entries
        # A gain in few places is likely to matter to few states on the way there.
        seldom = source and whole > BUDGET and np.count_nonzero(start) < SELDOM * len(start)
        part = (
            _truncated(rates, exit_rates, time, settings, start, interest, observer)
            if seldom
            else None
        )
        part = part or _implicit(
            chain, rates, exit_rates, start, time, source, settings, interest, observer
        )
        if part is None and source and not seldom:
            part = _sum(
                chain, y, time, source, settings, interest, observer, budget=_budget(chain, time)
            )
            part = part or _truncated(rates, exit_rates, time, settings, start, interest, observer)
        if part is not None:
            return part
    part = _sum(chain, y, time, source, settings, interest, observer)
    assert part is not None
    return part


def _implicit(
    chain: Chain,
    rates: SparseMatrix,
    exit_rates: Floats,
    start: Floats,
    time: float,
    source: bool,
    settings: Settings,
    interest: Int64s,
    observer: Observer | None,
    weights: Floats | None = None,
) -> Transient | None:
    """By implicit means, for stiff chains, after uniformisation has smoothed the start; None where that does not pay.

    weights: positive, what values are measured by (None: all alike). Divided by them, Q is diag(w)^-1 Q diag(w).
    """
    layer = LAYER / chain.q
    if chain.q * time < LONG or chain.q * time * chain.entries < STIFF:
        return None
    fine = Accuracy(epsilon=1e-300, max_iterations=settings.max_iterations)
    growth, later, scale, poles = 1.0, 1.0, np.ones(1), POLES
    if weights is not None:
        rates, scale, poles = scaled(rates, weights), weights, WIDE
        start = start / weights
        chain = uniformise(rates, exit_rates)
        growth, later = (math.exp(t * excess(rates, exit_rates)) for t in (4.0 * layer, time))
    first = _sum(
        chain,
        start / chain.q if source else start,
        layer,
        source,
        fine,
        None,
        observer,
        tail=1e-16,
        growth=growth,
    )
    assert first is not None
    near = later * (1.0 + 1e-6) * float(np.max(first.upper - first.lower))
    gain = start if source else None
    found = implicit_values(
        rates, exit_rates, first.middle, gain, time - layer, interest, settings, observer, poles
    )
    if found is None:
        return None
    error = (found.error + near) * scale
    values = found.values * scale
    lower, upper = np.maximum(values - error, 0.0), values + error
    if not _near(lower[interest], upper[interest], settings):
        return None
    note = f"uniformisation, {first.iterations} steps, then implicitly: {found.vectors} vectors, {found.steps} steps of BiCGStab"
    made = first.iterations + found.steps
    return Transient(
        lower,
        upper,
        made,
        note,
        {"steps": made, "steps_without_shortcut": math.ceil(chain.q * time)},
    )


def _budget(chain: Chain, time: float) -> float:
    whole = chain.q * time * chain.entries
    if whole <= BUDGET:
        return math.inf
    return BUDGET * (0.1 if whole > HOPELESS else min(1.0, max(0.1, PATIENCE * whole / BUDGET)))


def transient_distribution(
    rates: SparseMatrix,
    exit_rates: Floats,
    initial: Floats,
    time: float,
    settings: Settings,
    observer: Observer | None = None,
) -> Transient:
    """Bounds on the probability of each state at `time`, from the distribution `initial` (float64[n])."""
    chain = uniformise(rates, exit_rates, transposed=True)
    found = _sum(chain, initial, time, False, settings, None, observer, mass=True)
    assert found is not None
    found.upper[:] = np.minimum(found.upper, 1.0)
    return found


def _sum(
    chain: Chain,
    start: Floats,
    time: float,
    source: bool,
    settings: Settings,
    interest: Int64s | None,
    observer: Observer | None,
    mass: bool = False,
    budget: float = math.inf,
    visits: Visits | None = None,
    tail: float = 1e-300,
    growth: float = 1.0,
) -> Transient | None:
    """Sum of weight_k * P^k start over the Poisson window, or less where a proof ends it early.

    source: weights P(N > k), else P(N = k). mass: start is a distribution (its sum does not grow), else a value (its greatest
    entry does not grow). None where it takes more than `budget` entries to go over. visits: see there.
    tail: weights below so much of the greatest are left out, and counted as an error. growth: of the greatest entry at most, in all
    steps that count (values are then not looked at for what is negligible).
    """
    window = poisson(chain.q * time, tail)
    weights = window.tails() if source else window.masses()
    y, z, total = start.copy(), np.empty_like(start), np.zeros_like(start)
    pick: Callable[[Floats], Floats] = (
        (lambda v: v) if interest is None else (lambda v: v[interest])
    )
    k, look = 0, min(LOOK, len(weights))
    slip = (chain.longest + 6) * ROUND
    while True:
        # Entries that have become negligible where it matters must not hide that the others have settled.
        floor = (
            0.0
            if mass or k == 0 or growth > 1.0
            else 1e-3 * settings.epsilon * float(pick(y).min(initial=np.inf)) / len(weights)
        )
        floor = floor if np.isfinite(floor) else 0.0
        y, z, low, high, most = chain.advance(y, z, total, weights.part(k, k + look), floor)
        k += look
        error = (k + 4) * slip + 1e-10
        below = total * (1.0 - error)
        ahead = weights.rest(k) + window.missing
        size = float(y.sum()) if mass else most * growth
        above = total * (1.0 + error) + ahead * size * (1.0 + error)
        if observer is not None:
            observer(Progress("uniformisation", k, high - low, len(start)))
        if k >= len(weights) or _near(pick(below), pick(above), settings):
            return _result(below, above, k, len(weights), "")
        if low <= high < np.inf and _promising(low, high, ahead, pick(total), pick(y), settings):
            least = weights.powers(k, low * (1.0 - slip))
            greatest = weights.powers(k, high * (1.0 + slip)) + 2.0 * window.missing
            kept = np.where(y > floor / (1.0 - slip), y, 0.0)
            shortcut = (
                below + least * kept * (1.0 - error),
                total * (1.0 + error) + greatest * (y + 2.0 * floor) * (1.0 + error),
            )
            # Ratios that differ by rounding only will not come nearer.
            if high - low <= 2.0 * slip or _near(pick(shortcut[0]), pick(shortcut[1]), settings):
                return _result(
                    *shortcut,
                    k,
                    len(weights),
                    f", then a steady ratio of {0.5 * (low + high):.12g} per step",
                )
        if visits is not None and interest is not None and k >= visits.patience:
            rest = weights.rest(k)
            level = visits.level(y, interest, chain.q, rest), ", then a level rate"
            ratio, off = visits.settled(y, z, chain, rest)
            ahead_of_it = weights.powers(k, ratio) * y[interest]
            steady = (
                (ahead_of_it - off, ahead_of_it + off),
                f", then a steady ratio of {ratio:.12g} where it matters",
            )
            for known, note in (level, steady):
                shortcut = below.copy(), above.copy()
                shortcut[0][interest] = np.maximum(
                    below[interest], below[interest] + known[0] * (1.0 - error)
                )
                shortcut[1][interest] = (
                    total[interest] * (1.0 + error)
                    + known[1] * (1.0 + error)
                    + window.missing * most
                )
                if _near(pick(shortcut[0]), pick(shortcut[1]), settings):
                    return _result(*shortcut, k, len(weights), note)
        if k * chain.entries > budget:
            return None
        look = min(max(LOOK, k // 20), len(weights) - k)


def _truncated(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    settings: Settings,
    gain: Floats,
    interest: Int64s,
    observer: Observer | None,
) -> Transient | None:
    """As `transient_values` for a gain, on the states that matter to those of interest; trivial bounds for all others."""
    kept, loss, matrix = np.arange(rates.states, dtype=np.int64), 0.0, rates
    for haste in HASTE:
        place = np.full(rates.states, -1, dtype=np.int32)
        place[kept] = np.arange(len(kept))
        at = place[interest].astype(np.int64)
        cut = truncate(
            matrix, exit_rates[kept], time, gain[kept], at, 0.1 * settings.epsilon, haste
        )
        if cut is None:
            return None
        kept, loss = kept[cut.kept], loss + cut.loss
        place[:] = -1
        place[kept] = np.arange(len(kept))
        matrix = SparseMatrix(
            *sparse.select(rates.indptr, rates.indices, rates.data, kept, place), len(kept)
        )
    if len(kept) > 0.5 * rates.states:
        return None
    at = place[interest].astype(np.int64)
    assert cut is not None
    chain = uniformise(matrix, exit_rates[kept])
    weights = importance(matrix, exit_rates[kept], gain[kept], time, cut.values)
    found = None
    if weights is not None:
        found = _implicit(
            chain, matrix, exit_rates[kept], gain[kept], time, True, settings, at, observer, weights
        )
    if found is None:
        found = _sum(
            chain,
            gain[kept] / chain.q,
            time,
            True,
            settings,
            at,
            observer,
            visits=Visits.of(chain, cut.visits),
        )
    assert found is not None
    lower, upper = (
        np.zeros(rates.states),
        np.full(rates.states, time * float(gain.max()) * (1.0 + 1e-9)),
    )
    lower[interest] = found.lower[at]
    upper[interest] = found.upper[at] + loss
    note = f"{len(kept)} of {rates.states} states matter: {found.explanation}"
    return Transient(
        lower, upper, found.iterations, note, found.statistics | {"kept": len(kept), "loss": loss}
    )


def _promising(
    low: float, high: float, ahead: float, total: Floats, y: Floats, settings: Settings
) -> bool:
    """A cheap test of whether the ratio bounds are close enough to be worth the full one."""
    if not len(y):
        return True
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        room = settings.epsilon * (total + ahead * y) if settings.relative else settings.epsilon
        need = np.nanmin(np.where(y > 0.0, room / (ahead * y), np.inf))
    return (high - low) * ahead <= 4.0 * need or ahead == 0.0 or high - low <= 1e-14


def _near(below: Floats, above: Floats, settings: Settings) -> bool:
    width = above - below
    if settings.relative:
        width = width / np.maximum(above, 1e-300)
    return bool(np.all(width <= settings.epsilon))


def _result(lower: Floats, upper: Floats, made: int, all_steps: int, note: str) -> Transient:
    text = f"uniformisation, {made} of {all_steps} steps{note}"
    return Transient(lower, upper, made, text, {"steps": made, "steps_without_shortcut": all_steps})
