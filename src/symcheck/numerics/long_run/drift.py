"""Long-run averages of chains that drift towards a few states, with certified bounds.

Such a chain, for example a stable queue, is rarely outside of a few states, the core. The Poisson
equation is solved on the core alone, and a Lyapunov function w bounds what the other states
contribute. With the generator Q and the reward rates r, for *any* vectors h and w and any number g,

    min (e - Q w)  <=  average of r, minus g  <=  max (e + Q w),    residual e = r + Q h - g,

as the means of Q h and Q w under the stationary distribution are 0. Let h solve Q h = g - r on the
core, with each transition out of it redirected to one state, and let it have the value of that
state outside. Let Q w be so negative outside that the residual does not matter there (the
Foster-Lyapunov criterion).

w(s) = weight exp(c cost(s)) is tried for several exponents c, where cost(s) is that of the cheapest
path to s from the states that are visited most. A jump of probability p costs -log 2p, or nothing
if it is likelier than not. So w is large where the chain rarely is; whether Q w is negative is then
checked in every state.

After: Glynn & Zeevi (2008), 'Bounding stationary expectations of Markov processes';
Dayar, Hermanns, Spieler & Wolf (2011), 'Bounding the equilibrium distribution of Markov population
models'.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from symcheck.kernels.chains import drift as kernel
from symcheck.kernels.chains import gauss_seidel
from symcheck.kernels.graph import components
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics import tuning

__all__ = ["CoreBounds", "average_by_drift"]

PoissonSolver = Callable[[SparseMatrix, Floats], Floats]
"""An approximate solution h of the Poisson equation for rates and rewards."""

_LEAST_WEIGHT = 1e-280
"""A smaller weight might underflow; this one changes no bound."""


@dataclass(frozen=True)
class CoreBounds:
    """Bounds on an average, and the number of states of the core."""

    lower: float
    upper: float
    states: int


def average_by_drift(
    rates: SparseMatrix,
    leaving: Floats,
    rewards: Floats,
    solve: PoissonSolver,
    error: float = tuning.ENTRY_ERROR,
) -> CoreBounds | None:
    """Bounds on the long-run average of a reward in an irreducible chain.

    Args:
        rates: the rates, or the probabilities of a DTMC; entries on the diagonal are self-loops.
        leaving: the sum of each row without its diagonal, float64[n].
        rewards: the reward of each state, float64[n].
        solve: solves the Poisson equation of the chain on the core, where each transition out of it
            is redirected to the most visited state.
        error: of the rates, relative.

    Returns:
        Bounds by the first exponent with a small core; they are valid, but may be loose. None if
        there is no such exponent, if a random path visits too many states, or if the bounds are
        infinite.
    """
    visits = _visits(rates)
    if np.count_nonzero(visits) > tuning.CORE_VISITED:
        return None
    cost = _costs(rates, leaving, visits >= tuning.CORE_FREQUENT * int(visits.max()))
    drift, largest = np.empty(rates.states), tuning.CORE_SHARE * rates.states
    margin = 2.0 * (rates.longest + tuning.EXPONENTIAL_ROUNDINGS) * tuning.UNIT_ROUNDOFF + error
    for exponent in tuning.DRIFT_EXPONENTS:
        if np.count_nonzero(exponent * cost <= tuning.CORE_RISE) > largest:
            continue
        logarithm = exponent * _raised(rates, leaving, cost, exponent)
        kernel.drift(*rates.arrays, logarithm, margin, drift)
        # The core has all states where Q w < 0 is not proved. If w is large in one of them, this
        # exponent is no good.
        undecided = float(logarithm[drift >= 0.0].max(initial=0.0))
        core = logarithm <= undecided + tuning.CORE_RISE
        if undecided <= tuning.CORE_UNDECIDED and np.count_nonzero(core) <= largest:
            h = _solution(rates, rewards, core, int(np.argmax(visits)), solve)
            bounds = _bounds(rates, rewards, h, core, logarithm, drift, error)
            return bounds if math.isfinite(bounds.upper - bounds.lower) else None
    return None


def _raised(rates: SparseMatrix, leaving: Floats, cost: Floats, exponent: float) -> Floats:
    """The costs, raised in states with large costs where Q w is not negative.

    A larger w(s) makes (Q w)(s) smaller, and Q w larger in the predecessors of s. They can afford
    that if s is entered at a low rate and soon left, as after a rare jump that is soon undone.
    """
    raised = cost.copy()
    for _ in range(tuning.DRIFT_RAISES):
        kernel.raise_costs(
            *rates.arrays,
            leaving,
            raised,
            exponent,
            tuning.DRIFT_MARGIN,
            0.5 * tuning.CORE_UNDECIDED / exponent,
        )
    return raised


def _visits(rates: SparseMatrix) -> Int64s:
    """How often a random path visits each state, once it has found its way from the first."""
    before, counted = tuning.CORE_JUMPS
    uniform = np.random.default_rng(0).random(before + counted)
    sums, visits = rates.row_sums(), np.zeros(rates.states, np.int64)
    state = kernel.walk(*rates.arrays, sums, uniform[:before], 0, np.zeros_like(visits))
    kernel.walk(*rates.arrays, sums, uniform[before:], state, visits)
    return visits


def _costs(rates: SparseMatrix, leaving: Floats, sources: Bools) -> Floats:
    """The costs of the cheapest paths to each state; larger ones if a few passes do not suffice."""
    order, _ = components.breadth_first(rates.indptr, rates.indices, sources.view(np.uint8))
    cost = np.where(sources, 0.0, np.inf)
    for _ in range(tuning.DRIFT_PASSES):
        if not kernel.spread(*rates.arrays, leaving, order, cost):
            break
    return cost


def _solution(
    rates: SparseMatrix, rewards: Floats, core: Bools, home: int, solve: PoissonSolver
) -> Floats:
    """The solution for all states: outside of the core, that of the state `home`."""
    states = np.flatnonzero(core)
    place: Int32s = np.full(rates.states, np.searchsorted(states, home), dtype=np.int32)
    place[states] = np.arange(len(states), dtype=np.int32)
    inner = rates.choose(states).merge(place, len(states))
    return np.asarray(solve(inner, rewards[states])[place])


def _bounds(
    rates: SparseMatrix,
    rewards: Floats,
    h: Floats,
    core: Bools,
    logarithm: Floats,
    drift: Floats,
    rate_error: float = 0.0,
) -> CoreBounds:
    """The bounds by h and w.

    logarithm: log w, except for that of its weight. drift: upper bounds on Q w / w, negative
    outside of the core.
    """
    value = np.empty(rates.states)
    gauss_seidel.apply_generator(*rates.arrays, h, value)
    value += rewards
    terms = gauss_seidel.largest_generator_term(*rates.arrays, h) + float(np.abs(rewards).max())
    error = ((rates.longest + 6) * 2.0 * tuning.UNIT_ROUNDOFF + 2.0 * rate_error) * terms
    inside = value[core]
    middle = 0.5 * (float(inside.min()) + float(inside.max()))
    residual = np.abs(value[~core] - middle) + 2.0 * error
    with np.errstate(divide="ignore"):
        log_weights = np.log(residual) - logarithm[~core] - np.log(-drift[~core])
    log_weight = float(log_weights.max(initial=-np.inf))
    if log_weight >= 700.0:
        return CoreBounds(-math.inf, math.inf, len(inside))
    weight = max(math.exp(log_weight) * (1.0 + 1e-9), _LEAST_WEIGHT)
    change = weight * np.exp(logarithm[core]) * drift[core]  # Q w
    return CoreBounds(
        min(float((inside - change).min()), middle) - 2.0 * error,
        max(float((inside + change).max()), middle) + 2.0 * error,
        len(inside),
    )
