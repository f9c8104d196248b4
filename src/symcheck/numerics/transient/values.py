"""Transient values and distributions of a CTMC, with bounds."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import Observer
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.horizon import Horizon, Transient
from symcheck.numerics.transient.methods import (
    Part,
    computed,
    is_squared,
    squared,
    squaring_pays,
)
from symcheck.numerics.transient.squaring import IntervalChain
from symcheck.numerics.transient.uniformization import sum_series
from symcheck.numerics.transient.uniformized_chain import uniformize

__all__ = ["transient_distribution", "transient_values"]


def transient_values(
    kernel: TransitionKernel[SparseMatrix | SweepOperator],
    time: float,
    settings: Settings,
    *,
    terminal: Floats | None = None,
    reward_rate: Floats | None = None,
    interest: Int64s | None = None,
    observer: Observer | None = None,
    leave: Floats | None = None,
    limit: Callable[[], Floats] | None = None,
    error: float = 0.0,
    trimmed: bool = False,
) -> Transient:
    """Bounds on x(time) for every state. All arrays are non-negative, float64[n].

    Args:
        kernel: the transitions among the n states, with exit rates, of which self-loops are a part.
        time: the horizon.
        settings: accuracy and limits.
        terminal: the initial values; None: 0.
        reward_rate: the source (see `uniformization`); None: 0.
        interest: states whose values need the accuracy; None: all.
        observer: receives the progress.
        leave: the probabilities of leaving for states outside; None: not known, and small chains
            are not squared.
        limit: computes an upper bound on the values at any time.
        error: of the rates, relative.
        trimmed: whether most states matter to those of interest, so that fewer are not looked for.

    Returns:
        Bounds, which are further apart than requested if rounding or the work does not allow for
        it. Values below 1e-300, such as those of states that earn nothing, may have the bounds
        0 and 2e-300.

    Raises:
        NumericalError: an array is negative (positive and negative parts must be given separately).
    """
    rates, exit_rates = kernel.weights, kernel.exit_rates
    assert exit_rates is not None, "time is continuous"
    horizon = Horizon(
        rates, exit_rates, time, settings, interest, observer, leave, limit, error, trimmed
    )
    starts = [
        (start, source)
        for start, source in ((terminal, False), (reward_rate, True))
        if start is not None and np.any(start)
    ]
    if any(start.min() < 0.0 for start, _ in starts):
        raise NumericalError("transient values require non-negative rewards")
    if not starts:
        nothing = np.zeros(len(exit_rates))
        return Transient(nothing, nothing.copy(), 0, "no reward is earned: 0")
    if is_squared(horizon):
        return squared(horizon, terminal, reward_rate, error)
    total = reduce(Transient.plus, (computed(Part(horizon, *start)) for start in starts))
    return total.widened(tuning.UNDERFLOW_BOUND)


def transient_distribution(
    kernel: TransitionKernel[SparseMatrix],
    initial: Floats,
    time: float,
    settings: Settings,
    error: float = 0.0,
) -> Transient:
    """Bounds on the probability of each state at a time.

    Args:
        kernel: as in `transient_values`.
        initial: the initial distribution, float64[n].
        time: the time.
        settings: accuracy and limits.
        error: of the rates, relative.
    """
    rates, exit_rates = kernel.weights, kernel.exit_rates
    assert exit_rates is not None, "time is continuous"
    steps = float(exit_rates.max(initial=0.0)) * time
    if squaring_pays(rates, steps):
        nothing = np.zeros(rates.states)
        error = max(error, tuning.ENTRY_ERROR) + rates.longest * tuning.UNIT_ROUNDOFF
        squared, _, halvings = IntervalChain.of_rates(rates, nothing, time, nothing, error)
        found = squared.distribution(1 << halvings, initial)
        text = f"{found.squarings} squarings of a matrix"
        return Transient(found.lower, found.upper, found.squarings, text)
    chain = uniformize(rates, exit_rates, transposed=True, error=error)
    series = sum_series(chain, initial, time, False, settings, None, None, mass=True)
    series.upper[:] = np.minimum(series.upper, 1.0)
    return series
