"""What a chain gains from a distribution on, over a long time: only the states that matter from there on are kept.

The states that a chain runs through in the beginning need not be carried along for the long rest:
value = gain until an early time + sum over s of P(in s by then) * value of s at the time that is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics.linear.problem import Observer, Step
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.poisson import poisson
from symcheck.numerics.transient.state_space_truncation import truncate
from symcheck.numerics.transient.uniformized_chain import ROUND, Chain, Visits, uniformise

__all__ = ["Later", "value_from"]

LOOK = 200  # steps between two looks
HASTE = 5.0  # of the cutting off


@dataclass(frozen=True)
class Later:
    """Bounds on an expected value, steps made, and states kept."""

    lower: float
    upper: float
    steps: int
    kept: int


def value_from(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    gain: Floats,
    start: tuple[Floats, Floats],
    settings: Settings,
    observer: Observer | None = None,
) -> Later | None:
    """Bounds on the gain within `time` from a distribution, itself given by bounds float64[n]; None where most states matter.

    rates, exit_rates, gain: as in `transient_values`; the gain is not negative.
    """
    cut = truncate(rates, exit_rates, time, gain, start[1], 0.1 * settings.epsilon, HASTE)
    if cut is None or len(cut.kept) > 0.5 * rates.states:
        return None
    kept = cut.kept
    place = np.full(rates.states, -1, dtype=np.int32)
    place[kept] = np.arange(len(kept))
    matrix = SparseMatrix(
        *sparse.select(rates.indptr, rates.indices, rates.data, kept, place), len(kept)
    )
    chain = uniformise(matrix, exit_rates[kept])
    visits = Visits.of(chain, cut.visits)
    lower, upper, steps = _sum(
        chain,
        gain[kept] / chain.q,
        time,
        (start[0][kept], start[1][kept]),
        visits,
        settings,
        observer,
    )
    return Later(lower, (upper + cut.loss) * (1.0 + 4 * ROUND), steps, len(kept))


def _sum(
    chain: Chain,
    gain: Floats,
    time: float,
    start: tuple[Floats, Floats],
    visits: Visits,
    settings: Settings,
    observer: Observer | None,
) -> tuple[float, float, int]:
    """Sum of P(N > k) * start P^k gain, until what remains is known: the chain has settled at a level or a ratio, or time is up."""
    window = poisson(chain.q * time)
    weights = window.tails()
    y, z, total = gain.copy(), np.empty_like(gain), np.zeros_like(gain)
    slip = (chain.longest + 6) * ROUND
    low_start, high_start = start
    around = (len(gain) + 4) * ROUND
    low_mass, high_mass = (
        float(low_start.sum()) * (1.0 - around),
        float(high_start.sum()) * (1.0 + around),
    )
    k, look = 0, min(LOOK, len(weights))
    while True:
        y, z, _, _, most = chain.advance(y, z, total, weights.part(k, k + look), 0.0)
        k += look
        error = (k + 4) * slip + around + 1e-10
        rest = weights.rest(k)
        level = float(high_start @ y) / high_mass if high_mass > 0.0 else 0.0
        low_rest, _ = visits.around(y, level, low_mass, chain.q, rest)
        _, high_rest = visits.around(y, level, high_mass, chain.q, rest)
        high_rest = min(high_rest, rest * most * high_mass)
        ratio, off = visits.settled(y, z, chain, rest)
        steady = weights.powers(k, ratio)
        low_rest = max(low_rest, steady * float(low_start @ y) * (1.0 - around) - off)
        high_rest = min(high_rest, steady * float(high_start @ y) * (1.0 + around) + off)
        lower = (float(low_start @ total) + low_rest) * (1.0 - error)
        upper = (float(high_start @ total) + high_rest) * (1.0 + error) + window.missing * most
        if observer is not None:
            observer(Step("uniformisation", k, upper - lower, len(gain)))
        goal = 0.9 * settings.epsilon * (lower if settings.relative else 1.0)
        if k >= len(weights) or upper - lower <= goal:
            return max(lower, 0.0), upper, k
        look = min(max(LOOK, k // 20), len(weights) - k)
