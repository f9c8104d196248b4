"""Confidence intervals of a mean from the moments of its samples.

An interval *holds* if it contains the mean with at least its confidence, for every distribution of
the samples and every number of them. That of Clopper and Pearson holds for probabilities, those of
Hoeffding and of Maurer and Pontil for samples within a known range. Student's t and the normal
approximation hold in the limit of many samples only: without a range, nothing else is possible,
because a rare path could earn any reward.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, inf, isfinite, log, sqrt
from typing import Literal

import numpy as np

from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.rows import Floats
from symcheck.simulate import tuning

__all__ = ["UNKNOWN", "IntervalEstimate", "Moments", "Range", "error_within", "interval"]


@dataclass(frozen=True, slots=True)
class Moments:
    """What intervals need to know of some samples.

    Attributes:
        count: number of samples, at least 1.
        mean: infinite if a sample is.
        deviation: the standard deviation of the samples, with `count` - 1 in the denominator; 0
            for a single one, and NaN if a sample is infinite.
        least, greatest: the extremes of the samples.
    """

    count: int
    mean: float
    deviation: float
    least: float
    greatest: float

    @staticmethod
    def of(values: Floats) -> Moments:
        """The moments of samples, float64[n] with n > 0."""
        count, least, greatest = len(values), float(np.min(values)), float(np.max(values))
        if not np.isfinite(least) or not np.isfinite(greatest):
            return Moments(count, greatest, float("nan"), least, greatest)
        if least == greatest:
            return Moments(count, least, 0.0, least, greatest)
        scale = max(abs(least), abs(greatest))  # sums and squares of large numbers overflow
        scaled = values / scale
        deviation = float(np.std(scaled, ddof=1)) * scale
        return Moments(count, float(np.mean(scaled)) * scale, deviation, least, greatest)

    def joined(self, other: Moments) -> Moments:
        """The moments of the samples of both.

        Source: Chan, Golub and LeVeque, The American Statistician 37 (1983).
        """
        count = self.count + other.count
        share = other.count / count
        distance = other.mean - self.mean
        squares = self.deviation**2 * (self.count - 1) + other.deviation**2 * (other.count - 1)
        squares += distance**2 * self.count * share
        return Moments(
            count,
            self.mean + distance * share,
            sqrt(squares / (count - 1)) if np.isfinite(squares) else float("nan"),
            min(self.least, other.least),
            max(self.greatest, other.greatest),
        )

    @property
    def is_constant(self) -> bool:
        """Whether all samples are equal."""
        return self.least == self.greatest


@dataclass(frozen=True, slots=True)
class Range:
    """The samples lie between `low` and `high`, which are infinite if no bound is known."""

    low: float
    high: float

    @property
    def is_known(self) -> bool:
        """Whether both bounds are known."""
        return isfinite(self.low) and isfinite(self.high) and isfinite(self.high - self.low)

    def clipped(self, low: float, high: float) -> tuple[float, float]:
        """The part of an interval that is within the range."""
        return max(low, self.low), min(high, self.high)


UNKNOWN = Range(-inf, inf)


@dataclass(frozen=True, slots=True)
class IntervalEstimate:
    """A sample mean and an interval that contains the true value with probability `confidence`.

    Attributes:
        bound: whose interval it is.
        approximate: the confidence is that of the limit of many samples.
        warnings: what the samples leave open.
    """

    mean: float
    lower: float
    upper: float
    confidence: float
    samples: int
    bound: str
    approximate: bool = False
    warnings: tuple[str, ...] = ()

    @property
    def half(self) -> float:
        """The largest distance between the mean and the ends."""
        return max(self.upper - self.mean, self.mean - self.lower)


def interval(
    samples: Moments,
    error: float,
    support: Range,
    *,
    probability: bool,
    limit: Literal["t", "normal"] | None = None,
) -> IntervalEstimate:
    """The interval that misses the mean with probability at most `error`.

    Args:
        samples: finite, and at least two.
        error: the probability of missing the mean, between 0 and 1.
        support: what is known of the range of the samples.
        probability: the samples are 0 or 1.
        limit: prefer the approximation of this distribution; None: only if no other is possible.
    """
    mean, n = samples.mean, samples.count
    approximate = (limit == "normal" or not (probability or support.is_known)) and (
        not samples.is_constant
    )
    warnings: tuple[str, ...] = ()
    if approximate:
        half = _quantile(limit or "t", n, error) * samples.deviation / sqrt(n)
        lower, upper = support.clipped(mean - half, mean + half)
        bound = "the normal distribution" if limit == "normal" else "Student's t"
    elif probability:
        lower, upper = _clopper_pearson(round(mean * n), n, error)
        bound = "Clopper and Pearson"
    elif support.is_known:
        lower, upper = _within_range(samples, error, support)
        bound = "Hoeffding and Bernstein" if support.low < support.high else "its only value"
    else:
        lower, upper, bound = support.low, support.high, "the range of the reward"
    if samples.is_constant and not probability and lower < upper:
        warnings = (_constant(samples, error, support),)
    margin = tuning.ROUNDING * max(abs(samples.least), abs(samples.greatest))
    return IntervalEstimate(
        mean,
        lower if probability else lower - margin,
        upper if probability else upper + margin,
        1 - error,
        n,
        bound,
        approximate,
        warnings,
    )


def _constant(samples: Moments, error: float, support: Range) -> str:
    share = 1 - error ** (1 / samples.count)
    known = support.is_known
    return (
        f"all {samples.count} samples are {samples.mean:.6g}: at most {share:.2g} of the paths "
        f"earn another reward, with probability {1 - error:g}, "
        + (
            f"and each between {support.low:.6g} and {support.high:.6g}"
            if known
            else "but no bound on it is known ('most' gives one)"
        )
    )


def error_within(samples: Moments, width: float, support: Range, *, t: bool) -> tuple[float, bool]:
    """The probability that the sample mean is farther than `width` from the true mean, and whether
    it is an approximation.
    """
    if samples.is_constant:  # they say nothing about the variance; Hoeffding's bound needs none
        if not support.is_known:
            return 1.0, False
        length = support.high - support.low
        share = width / length if length > 0 else inf
        return min(1.0, 2 * exp(-2 * samples.count * share * share)), False
    require_memory_for_scipy()
    from scipy import special

    n = samples.count
    x = width * sqrt(n) / samples.deviation
    tail = float(special.stdtr(n - 1, -x)) if t else float(special.ndtr(-x))
    return min(1.0, 2 * tail), True


def _quantile(limit: Literal["t", "normal"], n: int, error: float) -> float:
    require_memory_for_scipy()
    from scipy import special

    return float(
        special.stdtrit(n - 1, 1 - error / 2) if limit == "t" else special.ndtri(1 - error / 2)
    )


def _clopper_pearson(hits: int, n: int, error: float) -> tuple[float, float]:
    require_memory_for_scipy()
    from scipy import special

    lower = 0.0 if hits == 0 else float(special.betaincinv(hits, n - hits + 1, error / 2))
    upper = 1.0 if hits == n else float(special.betaincinv(hits + 1, n - hits, 1 - error / 2))
    return lower, upper


def _within_range(samples: Moments, error: float, support: Range) -> tuple[float, float]:
    """The part that two intervals share, each of which misses the mean with half the error.

    Hoeffding's is narrow if the mean is near to an end of the range, Bernstein's if the variance is
    small.

    Source: Hoeffding, Journal of the American Statistical Association 58 (1963), Theorem 1; Maurer
    and Pontil, Empirical Bernstein bounds, COLT 2009, Theorem 4.
    """
    length, n = support.high - support.low, samples.count
    if length == 0:
        return support.low, support.high
    mean = min(1.0, max(0.0, (samples.mean - support.low) / length))
    # Each of two sides of two intervals may have a quarter of the error.
    low, high = _relative_entropy_at_most(mean, log(4 / error) / n)
    variance, spread = (samples.deviation / length) ** 2, log(2 / (error / 4))
    half = sqrt(2 * variance * spread / n) + 7 * spread / (3 * (n - 1))
    low, high = max(low, mean - half), min(high, mean + half)
    return support.low + length * low, support.low + length * high


def _relative_entropy_at_most(mean: float, distance: float) -> tuple[float, float]:
    """The least and the greatest parameter of a coin whose relative entropy to a coin with this
    parameter is at most `distance`.
    """

    def far(parameter: float) -> bool:
        entropy = 0.0
        for p, q in ((mean, parameter), (1 - mean, 1 - parameter)):
            if p > 0:
                entropy += p * log(p / q) if q > 0 else inf
        return entropy > distance

    return _outermost(far, 0.0, mean), _outermost(far, 1.0, mean)


def _outermost(far: Callable[[float], bool], outside: float, inside: float) -> float:
    """Where `far` begins to hold between two numbers, by bisection; not too far inside."""
    if not far(outside):
        return outside
    while True:
        middle = (outside + inside) / 2
        if middle in (outside, inside):
            return outside
        outside, inside = (middle, inside) if far(middle) else (outside, middle)
