"""Poisson weights for uniformisation.

Computed outwards from the mode as products of ratios and normalised by their sum, so that nothing underflows that matters and
no large factorial is formed (Fox & Glynn 1988; Jansen 2011). Relative accuracy of each weight: about 1e-12 for rates up to 1e8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.numerics.matrix import Floats

__all__ = ["Weights", "poisson"]


@dataclass(frozen=True, eq=False)
class Weights:
    """P(N = left + i) = values[i] for N ~ Poisson(rate), and what lies outside of the window, at most `missing`."""

    rate: float
    left: int
    values: Floats
    missing: float

    @property
    def right(self) -> int:
        """The last number in the window."""
        return self.left + len(self.values) - 1

    def at_least(self) -> Floats:
        """P(N >= k) for k = 0 .. right: float64[right+1]."""
        tail = np.cumsum(self.values[::-1])[::-1]
        return np.concatenate((np.ones(self.left), np.minimum(tail, 1.0)))


def poisson(rate: float, epsilon: float = 1e-300) -> Weights:
    """The weights that matter: all that are at least `epsilon` times the greatest (rate >= 0)."""
    if rate < 0.0:
        raise ValueError("a Poisson rate cannot be negative")
    if rate == 0.0:
        return Weights(0.0, 0, np.ones(1), 0.0)
    mode = int(rate)
    # ln P(mode + d) - ln P(mode) is below -d^2 / (2 (rate + d)): solve for the d at which it reaches ln(epsilon).
    drop = -np.log(epsilon)
    reach = int(drop + np.sqrt(drop * drop + 2.0 * drop * (rate + 1.0))) + 2
    up = np.cumprod(rate / np.arange(mode + 1.0, mode + reach + 1.0))
    down = np.cumprod(np.arange(mode, max(mode - reach, 0), -1.0) / rate)
    up, down = up[up >= epsilon], down[down >= epsilon]
    values = np.concatenate((down[::-1], [1.0], up))
    total = float(np.sum(np.sort(values)))
    # Beyond the ends the weights fall at least as fast as the last ratio says.
    last, first = mode + len(up), mode - len(down)
    beyond = values[-1] * rate / (last + 1.0 - rate) if last + 1.0 > rate else 0.0
    before = values[0] * first / (rate - first) if rate > first > 0 else 0.0
    return Weights(rate, first, values / total, float((beyond + before) / total))
