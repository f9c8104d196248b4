"""Number, mean, deviation and extremes of samples: all that intervals depend on."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from symcheck.matrices.rows import Floats

__all__ = ["Moments"]


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
