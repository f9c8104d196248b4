"""How likely a path of a CTMC is to be run within a time.

The time of a path is a sum of independent exponential times, one for each state that it leaves.
Uniformisation of these phases, one after the other, bounds its distribution from below.
Source: Han & Katoen (2009), 'Counterexample generation for continuous-time Markov chains', who
weigh the paths of the embedded chain in this way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.numerics.transient.poisson import poisson
from symcheck.numerics.tuning import UNIT_ROUNDOFF

__all__ = ["least_probability_within"]

_MOST_STEPS = 100_000
"""Uniformised steps of one path; each takes some microseconds."""
_POISSON_ERROR = 1e-11
"""The relative error of a Poisson weight (see `poisson`), or more."""


def least_probability_within(rates: Sequence[float], time: float) -> float:
    """A lower bound on the probability that independent exponential times sum to at most `time`.

    Args:
        rates: the rates of the times, all positive.
        time: the bound.

    Returns:
        The probability, below the true value by a relative 1e-9 at most, apart from tails below
        1e-300.

    Raises:
        UnsupportedError: the time is so long that there would be too many steps.

    Examples:
        >>> round(least_probability_within([2.0], 1.0), 6)  # 1 - exp(-2)
        0.864665
    """
    if not len(rates):
        return 1.0
    exit_rates = np.asarray(rates, np.float64)
    uniform = float(exit_rates.max())
    weights = poisson(uniform * time)
    if weights.right > _MOST_STEPS:
        raise UnsupportedError(
            f"a counterexample needs {weights.right:,} uniformised steps of each path, too many"
        )
    move = exit_rates / uniform * (1.0 - 2.0 * UNIT_ROUNDOFF)
    stay = np.maximum(1.0 - exit_rates / uniform - 2.0 * UNIT_ROUNDOFF, 0.0)
    phases, arrived, total = np.zeros(len(exit_rates)), 0.0, 0.0
    phases[0] = 1.0
    for step in range(weights.right + 1):
        if step >= weights.left:
            total += float(weights.values[step - weights.left]) * arrived
        moved = phases * move
        arrived += float(moved[-1])
        phases *= stay
        phases[1:] += moved[:-1]
    return total * (1.0 - _POISSON_ERROR - 8.0 * weights.right * UNIT_ROUNDOFF)
