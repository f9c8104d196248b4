"""Upper bounds on transient values that are too small for any other method, by supermartingales.

A value within the time T is at most e^a (a/T - Q)^-1 reward_rate, as in `state_space_truncation`.
Any u with (a/T - Q) u >= reward_rate is at least that solution. Where a chain drifts away from what
is rewarded, such a u falls exponentially with the cost of the cheapest path to a reward. A jump of
probability p costs -log 2p, or nothing if it is likelier than not:

    u(s) = (T/a) exp(-c max(cost(s) - free, 0)) + constant.

For jumps towards the reward with probability p < 1/2, and away from it with 1 - p, c = 1 is enough,
since p/2p + (1 - p) 2p <= 1. A part of the cost is free, for irregular states next to the reward.
The killing rate a/T pays for the constant, where the chain stays. One pass over the matrix proves
the bound. Other methods need a step for each jump, and their numbers underflow.

Source: Hajek (1982), 'Hitting-time and occupation-time bounds implied by drift analysis'.
"""

from __future__ import annotations

import math

import numpy as np

from symcheck.kernels.chains import supermartingale
from symcheck.kernels.graph import components
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics import tuning

__all__ = ["bound_negligible_values"]

_UNDERFLOW = 1e-320
"""More than two numbers lose that fall below the smallest double."""


def bound_negligible_values(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    reward_rate: Floats,
    interest: Int64s,
    enough: float,
) -> float | None:
    """A bound on the values at the states of interest, if it is at most `enough`.

    Args:
        rates, exit_rates: as in `transient_values`.
        time: the horizon T.
        reward_rate: rates of entering the target or of earning rewards, float64[n], non-negative.
        interest: the states whose values are wanted.
        enough: the bound that suffices.

    Returns:
        The bound; None if it is not found.
    """
    killing = tuning.SUPERMARTINGALE_SHIFT / time
    # Even the constant 1 / killing is large enough, so a smaller u may be cut off there.
    most = float(reward_rate.max()) * math.exp(tuning.SUPERMARTINGALE_SHIFT) / killing
    leaving, reward = exit_rates + killing, reward_rate * (killing / float(reward_rate.max()))
    chain = (*rates.arrays, leaving, reward)
    back = sparse.transpose(rates.indptr, rates.indices, rates.columns)
    nearest, _ = components.breadth_first(*back, (reward > 0.0).view(np.uint8))
    cost = np.full(rates.states, np.inf)
    for _ in range(tuning.SUPERMARTINGALE_PASSES):
        changed = supermartingale.relax(*chain, nearest, cost)
        least = float(cost[interest].min())
        if math.isinf(least):
            return 0.0  # no reward can be earned
        # Costs only become less, and the bound greater.
        if most * math.exp(-max(tuning.SUPERMARTINGALE_EXPONENTS) * least) > enough:
            return None
        if not changed:
            break
    free = tuning.SUPERMARTINGALE_FREE * least
    cost, least = np.maximum(cost - free, 0.0), least - free
    for exponent in tuning.SUPERMARTINGALE_EXPONENTS:
        if most * math.exp(-exponent * least) > enough:
            continue  # whatever the constant is
        constant = supermartingale.missing_constant(*chain, killing, cost, exponent)
        bound = most * (math.exp(-exponent * least) + constant + _UNDERFLOW) * (1.0 + 1e-9)
        if bound <= enough:
            return bound
    return None
