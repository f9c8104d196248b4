"""Poisson weights for uniformisation.

They are computed outwards from the mode as products of ratios and normalised by their sum, so no
relevant weight underflows and no large factorial is formed.

The relative error of each weight, and of each sum of weights within the window, is at most
`PoissonWeights.error`. The sequences that they form begin or end with the window; the sum of what
they lack is at most `WeightSequence.missing`.
The weight that is d numbers from the mode is a product of d ratios of exact integers and the rate,
which takes 2 d roundings. The total of n weights, by which they are divided, has the error of its
terms, n roundings, and what the window omits; a sum of weights has n roundings more. So with at
most m numbers on one side of the mode the error is (4 m + 2 n + 1) u to first order; a hundredth
and 7 u are added for higher orders. The rate is taken as exact.

Sources: Fox & Glynn (1988); Jansen (2011).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.rows import Floats
from symcheck.numerics import tuning

__all__ = ["PoissonWeights", "WeightSequence", "poisson"]


@dataclass(frozen=True, eq=False)
class PoissonWeights:
    """P(N = left + i) = values[i] for N ~ Poisson(rate); `missing` bounds the probability
    elsewhere, `error` the relative error of values and of sums of them.
    """

    rate: float
    left: int
    values: Floats
    missing: float
    error: float = 0.0

    @property
    def right(self) -> int:
        """The last number in the window."""
        return self.left + len(self.values) - 1

    def masses(self) -> WeightSequence:
        """P(N = k) as a sequence over k = 0, 1, ..."""
        return WeightSequence(self.left, 0.0, self.values, self.missing)

    def tails(self) -> WeightSequence:
        """P(N > k) as a sequence over k = 0, 1, ..."""
        tail = np.minimum(np.cumsum(self.values[::-1])[::-1], 1.0)
        # Each weight lacks P(N > right); beyond, P(N > k + 1) / P(N > k) is at most rate / (k + 2).
        later = self.rate / (self.right + 2.0 - self.rate)
        missing = self.missing * (len(self.values) + later) * (1.0 + 1e-9)
        return WeightSequence(self.left, 1.0, np.append(tail[1:], 0.0), missing)


@dataclass(frozen=True, eq=False)
class WeightSequence:
    """A sequence of weights: `constant` for k < left, then `values`, then 0.

    It is not stored in full, as left may be 1e9. missing: a bound on the sum of what the weights
    lack, since the window ends. spread: up to how many numbers later the values really are.
    """

    left: int
    constant: float
    values: Floats
    missing: float = 0.0
    spread: float = 0.0

    @property
    def end(self) -> int:
        """The number of weights, which may be beyond 64 bits."""
        return self.left + len(self.values)

    def __len__(self) -> int:
        return self.end

    def between(self, begin: int, end: int) -> Floats:
        """The weights of begin <= k < end, float64[end - begin]."""
        flat = np.full(max(0, min(end, self.left) - begin), self.constant)
        return np.concatenate(
            (flat, self.values[max(0, begin - self.left) : max(0, end - self.left)])
        )

    @cached_property
    def _tail_sums(self) -> Floats:
        return np.append(np.cumsum(self.values[::-1])[::-1], 0.0)

    def tail_sum(self, begin: int) -> float:
        """The sum of the weights from k = begin on."""
        flat = self.constant * max(0, self.left - begin)
        return flat + float(self._tail_sums[max(0, begin - self.left) :][:1].sum())

    def powers(self, begin: int, ratio: float, upper: bool = True) -> float:
        """The sum over k >= begin of weight_k * ratio^(k - begin), relative error about 1e-10.

        upper: whether it should be too large rather than too small, if values are spread.
        """
        if ratio <= 0.0:
            return float(self.between(begin, begin + 1).sum())
        flat = max(0, self.left - begin)
        log = math.log(ratio)
        front = 0.0
        if flat and self.constant:
            front = self.constant * (flat if log == 0.0 else _expm1(flat * log) / math.expm1(log))
        values = self.values[max(0, begin - self.left) :]
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            later = self.spread if (log > 0.0) == upper else 0.0
            whole = front + float(values @ np.exp(log * (flat + later + np.arange(len(values)))))
        # A weight of 0 times an overflow is NaN.
        return math.inf if math.isnan(whole) else whole


def _expm1(x: float) -> float:
    return math.expm1(x) if x < 700.0 else math.inf


def poisson(rate: float, epsilon: float = 1e-300) -> PoissonWeights:
    """The weights that are at least `epsilon` times the largest one; of huge rates, 1e-16 times.

    Raises:
        ValueError: the rate is negative.
        NumericalError: the rate is so large that the window would not fit into memory.
    """
    if rate < 0.0:
        raise ValueError("a Poisson rate cannot be negative")
    if rate > tuning.LARGEST_POISSON_RATE:
        raise NumericalError(
            f"uniformisation would take {rate:.1e} steps, the greatest rate times the time; more "
            f"than {tuning.LARGEST_POISSON_RATE:.0e} are not supported",
            hint="check the property without the time bound",
        )
    if rate == 0.0:
        return PoissonWeights(0.0, 0, np.ones(1), 0.0)
    mode = int(rate)
    # ln P(mode + d) - ln P(mode) is below -d^2 / (2 (rate + d)): solve for the d at which it
    # reaches ln(epsilon).
    room = tuning.WINDOW**2 / (2.0 * rate)
    drop = min(-np.log(epsilon), max(room, -np.log(1e-16)))
    epsilon = np.exp(-drop)
    reach = int(drop + np.sqrt(drop * drop + 2.0 * drop * (rate + 1.0))) + 2
    with np.errstate(under="ignore"):
        up = np.cumprod(rate / np.arange(mode + 1.0, mode + reach + 1.0))
        down = np.cumprod(np.arange(mode, max(mode - reach, 0), -1.0) / rate)
    up, down = up[up >= epsilon], down[down >= epsilon]
    values = np.concatenate((down[::-1], [1.0], up))
    total = float(np.sum(np.sort(values)))
    # Beyond the ends the weights fall at least geometrically, with the ratio at the end.
    last, first = mode + len(up), mode - len(down)
    beyond = values[-1] * rate / (last + 1.0 - rate) if last + 1.0 > rate else 0.0
    before = values[0] * first / (rate - first) if rate > first > 0 else 0.0
    missing = float((beyond + before) / total)
    roundings = 4 * max(len(up), len(down)) + 2 * len(values) + 8
    error = 1.01 * roundings * tuning.UNIT_ROUNDOFF + missing
    return PoissonWeights(rate, first, values / total, missing, error)
