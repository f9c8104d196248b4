"""Upper bounds on transient values that are too small for any other method, by supermartingales.

A value within the time T is at most e^a (a/T - Q)^-1 reward_rate, as in `state_space_truncation`.
The inverse is non-negative, so any u with (a/T - Q) u >= reward_rate is at least that solution: u
of the killed chain is a supermartingale until a reward is earned. Where a chain drifts away from
what is rewarded, such a u falls exponentially with the cost of the cheapest path to a reward. A
jump of probability p costs -log 2p, or nothing if it is likelier than not:

    u(s) = max(reward_rate) T/a (exp(-c max(cost(s) - free, 0)) + constant).

For jumps towards the reward with probability p < 1/2, and away from it with 1 - p, c = 1 is enough,
since p/2p + (1 - p) 2p <= 1. The part of the cost that is free makes u constant next to the reward,
where blocked transitions make chains irregular. Where the exponential alone fails, a constant C
helps, since (a/T - Q) C >= (a/T) C. One pass over the matrix finds the least C, so that nothing
about the costs needs to be proved. Other methods need a step for each jump, and their numbers
underflow.

After: Hajek (1982), 'Hitting-time and occupation-time bounds implied by drift analysis with
applications'.
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
        rates: the rates among the n states.
        exit_rates: the exit rate of each state, float64[n].
        time: the horizon T.
        reward_rate: rates of entering the target or of earning rewards, float64[n], non-negative.
        interest: the states whose values are wanted.
        enough: the bound that suffices.

    Returns:
        The bound; None if it is not found.
    """
    largest = float(reward_rate.max())
    if not 0.0 < time < math.inf or not 0.0 < largest < math.inf:
        return None
    killing = tuning.SUPERMARTINGALE_SHIFT / time
    most = largest * math.exp(tuning.SUPERMARTINGALE_SHIFT) / killing
    # A reward of at most `killing` permits u = 1.
    leaving, reward = exit_rates + killing, reward_rate / largest * killing
    if not (killing > 0.0 and most < math.inf) or np.any((reward == 0.0) & (reward_rate > 0.0)):
        return None
    margin = 2.0 * (rates.longest + tuning.EXPONENTIAL_ROUNDINGS) * tuning.UNIT_ROUNDOFF
    chain = (*rates.arrays, leaving, reward)
    back = sparse.transpose(rates.indptr, rates.indices, rates.columns)
    nearest, parent = components.breadth_first(*back, (reward > 0.0).view(np.uint8))
    if np.all(parent[interest] == -2):
        return 0.0  # no reward can be earned
    cost = np.full(rates.states, np.inf)
    for _ in range(tuning.SUPERMARTINGALE_PASSES):
        changed = supermartingale.relax(*chain, nearest, cost)
        least = float(cost[interest].min())
        if math.isinf(least):
            return None
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
        constant = supermartingale.missing_constant(*chain, killing, cost, exponent, margin)
        bound = most * (math.exp(-exponent * least) + constant + _UNDERFLOW) * (1.0 + 1e-9)
        if bound <= enough:
            return bound
    return None
