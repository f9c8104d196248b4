"""The methods for the values of a CTMC at a time, and the choice of one.

Each has a condition, and may fail: the first that applies and succeeds computes the values. Only
the last one needs no rows, and serves all states.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.preconditioned_bicgstab import scaled
from symcheck.numerics.transient.forward import ForwardValue, forward_value
from symcheck.numerics.transient.horizon import Horizon, Transient, close_enough
from symcheck.numerics.transient.rational_krylov import importance, krylov_values, largest_growth
from symcheck.numerics.transient.squaring import IntervalChain, squaring_entries
from symcheck.numerics.transient.state_space_truncation import truncate
from symcheck.numerics.transient.supermartingale import bound_negligible_values
from symcheck.numerics.transient.uniformization import smooth, sum_series
from symcheck.numerics.transient.uniformized_chain import uniformize
from symcheck.tables import counted

__all__ = ["Part", "computed", "is_squared", "squared", "squaring_pays"]


@dataclass(frozen=True, eq=False)
class Part:
    """What the terminal values or the reward rate contribute to the values at a time.

    Attributes:
        horizon: the chain and the time.
        start: the terminal values or the reward rate, not negative, float64[n].
        source: whether `start` is the reward rate.
    """

    horizon: Horizon
    start: Floats
    source: bool

    @property
    def rates(self) -> SparseMatrix:
        """The rows, which all methods but the last one need."""
        assert isinstance(self.horizon.rates, SparseMatrix)
        return self.horizon.rates

    @property
    def interest(self) -> Int64s:
        """The states whose values matter."""
        assert self.horizon.interest is not None
        return self.horizon.interest

    @property
    def entries(self) -> float:
        """The entries that uniformisation would visit; 0 if it is the only method."""
        h = self.horizon
        if h.interest is None or not len(h.interest) or not isinstance(h.rates, SparseMatrix):
            return 0.0
        return h.steps * (h.rates.entries + h.rates.rows)

    @cached_property
    def followed(self) -> ForwardValue:
        """Bounds on the value of the one state of interest, from its distribution."""
        h, (state,) = self.horizon, map(int, self.interest)
        return forward_value(
            self.rates,
            h.exit_rates,
            self.start,
            h.time,
            self.source,
            state,
            h.settings,
            h.observer,
        )

    def with_trivial_bounds(
        self, lower: Floats | float, upper: Floats | float, steps: int, note: str
    ) -> Transient:
        """Bounds at the states of interest; others have 0, and what the largest reward would earn
        all the time.
        """
        n, time = len(self.start), self.horizon.time if self.source else 1.0
        most = float(self.start.max()) * time * (1.0 + 1e-9)
        found = Transient(np.zeros(n), np.full(n, most), steps, note)
        found.lower[self.interest], found.upper[self.interest] = lower, upper
        return found


class _Method(NamedTuple):
    """A method, and its condition.

    Attributes:
        applies: whether it is worth trying.
        values: bounds; None if it did not end, or if its bounds are not close enough.
    """

    applies: Callable[[Part], bool]
    values: Callable[[Part], Transient | None]


def computed(part: Part) -> Transient:
    """Bounds by the first method that applies and succeeds."""
    for method in _METHODS:
        if method.applies(part) and (found := method.values(part)) is not None:
            return found if method.values is _series else _perturbed(found, part.horizon)
    raise AssertionError("uniformisation serves all chains")


def _perturbed(found: Transient, h: Horizon) -> Transient:
    """Bounds for rates with a larger error than those that all methods include.

    The weight of a path with k jumps changes by a factor within exp(±error (k + q t)); that there
    are more jumps than `most` has a probability below 1e-300.
    """
    of_steps = max(h.error - tuning.ENTRY_ERROR, 0.0)
    of_exits = max(h.error - h.rates.longest * tuning.UNIT_ROUNDOFF, 0.0)
    most = h.steps + 40.0 * math.sqrt(h.steps) + 1_000.0
    relative = math.expm1(min(of_steps * most + of_exits * h.steps, 700.0))
    lower, upper = found.lower * max(1.0 - relative, 0.0), found.upper * (1.0 + relative)
    return replace(found, lower=lower, upper=upper)


# -------------------------------------------------------------------------------------- conditions


def _is_followed(part: Part) -> bool:
    """One value is asked for, and uniformisation is long. Each step visits at least one entry."""
    long = part.entries > tuning.FORWARD_ENTRIES and part.horizon.steps <= tuning.FORWARD_WORK
    return long and len(part.interest) == 1 and not part.horizon.trimmed


def _is_rare(part: Part) -> bool:
    """A reward rate, and uniformisation is very long: few states may matter."""
    is_long = part.entries > tuning.TRUNCATION_ENTRIES
    return part.source and is_long and not part.horizon.trimmed


def _may_be_negligible(part: Part) -> bool:
    """No lower bound tells that the value is greater than what is not computed."""
    least = part.followed.lower if _is_followed(part) else 0.0
    return _is_rare(part) and least <= _negligible(part)


def _may_be_stiff(part: Part) -> bool:
    return part.entries > 0.0 and part.horizon.steps <= tuning.LARGEST_POISSON_RATE


# ---------------------------------------------------------------------------------------- squaring


def squaring_pays(rates: SparseMatrix, steps: float) -> bool:
    """Whether squaring takes fewer multiplications than the steps of uniformisation."""
    return (
        rates.states <= tuning.SQUARING_STATES
        and steps > tuning.SQUARING_STEPS
        and squaring_entries(rates.states, steps) < steps * (rates.entries + rates.rows)
    )


def is_squared(h: Horizon) -> bool:
    """Whether the matrix of a small chain is squared, which computes both parts at once."""
    rates = h.rates
    return isinstance(rates, SparseMatrix) and h.leave is not None and squaring_pays(rates, h.steps)


def squared(
    h: Horizon,
    terminal: Floats | None,
    reward_rate: Floats | None,
    error: float = tuning.ENTRY_ERROR,
) -> Transient:
    """Both parts, for a small chain (see `is_squared`)."""
    rates, leave = h.rates, h.leave
    assert isinstance(rates, SparseMatrix)
    assert leave is not None
    # Of a sum, its quotient, a sum with what was cut off, and the product.
    error = max(error, tuning.ENTRY_ERROR) + (rates.longest + 4) * tuning.UNIT_ROUNDOFF
    leave = leave * h.exit_rates
    earned = np.zeros(rates.states) if reward_rate is None else reward_rate
    chain, reward, halvings = IntervalChain.of_rates(rates, leave, h.time, earned, error)
    end = None if terminal is None else (terminal, terminal)
    found = chain.values(1 << halvings, end, None if reward_rate is None else reward)
    note = f"{found.squarings} squarings of a matrix"
    return Transient(found.lower, found.upper, found.squarings, note)


# ----------------------------------------------------------------------------------------- methods


def _series(part: Part) -> Transient:
    """Uniformisation."""
    h = part.horizon
    return sum_series(
        h.chain,
        part.start / h.chain.q if part.source else part.start,
        h.time,
        part.source,
        h.settings,
        h.interest,
        h.observer,
        conservative=h.leave is not None and not np.any(h.leave),
        limit=h.limit if part.source else None,
    )


def _forward(part: Part) -> Transient | None:
    """Forward uniformisation from the state of interest."""
    run = part.followed
    if math.isinf(run.upper):
        return None
    note = (
        f"uniformisation, {run.steps} steps forward, with at most {run.largest} of "
        f"{counted(len(part.start), 'state')} active"
    )
    return part.with_trivial_bounds(run.lower, run.upper, run.steps, note)


def _negligible(part: Part) -> float:
    """The value below which 0 is close enough."""
    settings, least = part.horizon.settings, tuning.UNDERFLOW_BOUND
    return least if settings.relative else max(least, settings.epsilon)


def _supermartingale(part: Part) -> Transient | None:
    """Values from 0 to a proved bound, if that is close enough."""
    h = part.horizon
    bound = bound_negligible_values(
        part.rates, h.exit_rates, h.time, part.start, part.interest, _negligible(part)
    )
    if bound is None:
        return None
    return part.with_trivial_bounds(0.0, bound, 0, "an exponential supermartingale")


def _krylov(part: Part, weights: Floats | None = None) -> Transient | None:
    """Rational Krylov subspaces for stiff chains, after uniformisation has smoothed the start.

    Its bounds suffice if they are as close as requested, or if uniformisation takes too long for
    closer ones.

    weights: positive; values are divided by them, and Q becomes diag(w)^-1 Q diag(w). None: 1.
    """
    h, rates, start = part.horizon, part.rates, part.start
    chain, time, settings = h.chain, h.time, h.settings
    steps, smoothing = chain.q * time, tuning.SMOOTHING_STEPS / chain.q
    entries = steps * chain.entries
    if steps < tuning.KRYLOV_STEPS or entries < tuning.KRYLOV_ENTRIES:
        return None
    growth, later_growth, scale, poles = 1.0, 1.0, np.ones(1), tuning.POLES
    if weights is not None:
        rates, scale, poles = scaled(rates, weights), weights, tuning.WEIGHTED_POLES
        start = start / weights
        chain = uniformize(rates, h.exit_rates, error=h.error)
        growth, later_growth = (
            largest_growth(rates, h.exit_rates, t) for t in (4.0 * smoothing, time)
        )
        if math.isinf(later_growth):
            return None
    rounding = 2.0 * (rates.longest + 6) * tuning.UNIT_ROUNDOFF * chain.q * time
    if settings.relative and rounding > settings.epsilon:
        return None  # it is an error relative to the greatest value (see `krylov_values`)
    terms = start / chain.q if part.source else start
    smoothed, begun, smoothing_error = smooth(
        chain, terms, smoothing, part.source, growth, h.observer
    )
    result = krylov_values(
        rates,
        h.exit_rates,
        smoothed,
        start if part.source else None,
        time - smoothing,
        part.interest,
        settings,
        h.observer,
        poles,
    )
    if result is None:
        return None
    error = (result.error + smoothing_error * later_growth * (1.0 + 1e-6)) * scale
    values = result.values * scale
    lower, upper = np.maximum(values - error, 0.0), values + error
    close = close_enough(lower[part.interest], upper[part.interest], settings)
    if not close and entries <= tuning.AFTER_KRYLOV_ENTRIES:
        return None
    note = (
        f"uniformisation, {begun} steps, then a rational Krylov subspace of "
        f"{result.vectors} vectors, {result.steps} steps of BiCGStab"
    )
    return Transient(lower, upper, begun + result.steps, note)


def _truncated(part: Part) -> Transient | None:
    """A reward rate on a truncated space."""
    h, rates, reward_rate = part.horizon, part.rates, part.start
    exit_rates, time, limit = h.exit_rates, h.time, h.limit
    kept, loss, matrix = np.arange(rates.states, dtype=np.int64), 0.0, rates
    cut = None
    for laplace_shift in tuning.TRUNCATION_SHIFTS:
        index = np.full(rates.states, -1, dtype=np.int32)
        index[kept] = np.arange(len(kept))
        at = index[part.interest].astype(np.int64)
        closer = truncate(
            matrix,
            exit_rates[kept],
            time,
            reward_rate[kept],
            at,
            0.1 * h.settings.epsilon,
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
    at = index[part.interest].astype(np.int64)
    leave = None
    if h.leave is not None:
        members = np.zeros(rates.states, np.bool_)
        members[kept] = True
        cut_off = np.zeros(rates.states)
        cut_off[members] = rates.sums(members, ~members)
        leave = (h.leave + cut_off / exit_rates)[kept]
    smaller = Horizon(
        matrix,
        exit_rates[kept],
        time,
        h.settings,
        at,
        h.observer,
        leave,
        None if limit is None else lambda: limit()[kept],
        h.error,
    )
    inside = Part(smaller, reward_rate[kept], True)
    result = squared(smaller, None, inside.start) if is_squared(smaller) else None
    if result is None and _may_be_stiff(inside):
        weights = importance(matrix, smaller.exit_rates, inside.start, time, cut.values)
        result = None if weights is None else _krylov(inside, weights)
    result = result or _series(inside)
    note = f"{len(kept)} of {rates.states} states kept: {result.explanation}"
    lower, upper = result.lower[at], result.upper[at] + loss
    return part.with_trivial_bounds(lower, upper, result.iterations, note)


_METHODS = (
    _Method(_is_followed, _forward),
    _Method(_may_be_negligible, _supermartingale),
    _Method(_is_rare, _truncated),
    _Method(_may_be_stiff, _krylov),
    _Method(lambda _: True, _series),
)
"""In the order in which they are tried: what computes least comes first."""
