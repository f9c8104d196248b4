"""State-space truncation for transient values at a few states, with a proved bound on the error.

Both bounds come from the resolvent, since 1 <= exp(a - a s/T) for s <= T with a Laplace shift a.
The value of a state at any time up to T is at most V = e^a (a/T - Q)^-1 reward_rate. The expected
time spent in a state up to T is at most N = e^a start (a/T - Q)^-1. Removing a set D of states
loses at most the sum of N(s) rate(s, d) V(d) over the transitions into D. Both are linear systems
with positive solutions, of which rough upper bounds suffice. The bounds must be relative: for rare
events, N falls and V rises by hundreds of orders of magnitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.kernels.graph import components
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.component_bounds import ComponentSolver
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.preconditioned_bicgstab import relative_solution

__all__ = ["Truncation", "truncate"]


@dataclass(frozen=True, eq=False)
class Truncation:
    """The states kept, and the error at each state of interest.

    kept: int64, ascending. loss: the value lost by removing all other states, at most.
    occupation: bounds on the expected time spent in each kept state, from any state of interest.
    values: bounds on the value of each kept state at any time; Q V <= (a/T) V holds.
    """

    kept: Int64s
    loss: float
    occupation: Floats
    values: Floats


def truncate(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    reward_rate: Floats,
    interest: Int64s,
    epsilon: float,
    laplace_shift: float,
) -> Truncation | None:
    """Keep the states that matter to a relative error of epsilon at the states of interest.

    Args:
        rates, exit_rates: as in `transient_values`.
        time: the horizon T.
        reward_rate: rates of entering the target or of earning rewards, float64[n], non-negative.
        interest: the states whose values are wanted.
        epsilon: the error, relative to the least value of interest.
        laplace_shift: a; 1 keeps the fewest states, larger shifts are solved faster.

    Returns:
        None if the bounds are not found.
    """
    from concurrent.futures import ThreadPoolExecutor

    start: Floats = np.zeros(rates.states)
    start[interest] = 1.0
    with ThreadPoolExecutor(1) as pool:  # sweeps release the lock of the interpreter
        other = pool.submit(_resolvent, rates, exit_rates, time, start, laplace_shift, True)
        value = _resolvent(rates, exit_rates, time, reward_rate, laplace_shift, False)
        occupation = other.result()
    if value is None or occupation is None:
        return None
    # A lower bound on the least value: the reward within T/a is part of that within T.
    least = float(value[interest].min())
    target = least * math.exp(-laplace_shift) / (4.0 * laplace_shift)
    owner = np.repeat(np.arange(rates.states), rates.lengths)
    flow = occupation[owner] * rates.data
    inflow = np.bincount(rates.indices, weights=flow, minlength=rates.states)
    with np.errstate(under="ignore", over="ignore"):
        importance = inflow * value
    order = np.argsort(importance)
    lost = np.cumsum(importance[order])
    cut = order[: int(np.searchsorted(lost, epsilon * target))]
    keep = np.ones(rates.states, dtype=np.bool_)
    keep[cut] = False
    keep[interest] = True
    crossing = keep[owner] & ~keep[rates.indices]
    loss = float(np.sum(flow[crossing] * value[rates.indices[crossing]])) * (1.0 + 1e-9)
    return Truncation(np.flatnonzero(keep).astype(np.int64), loss, occupation[keep], value[keep])


def _resolvent(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    right: Floats,
    laplace_shift: float,
    transposed: bool,
) -> Floats | None:
    """Upper bounds on e^a (a/time - Q)^-1 right (or its transpose), within about a factor of 2."""
    scale = 1.0 / (exit_rates + laplace_shift / time)
    arrays = rates.arrays
    back = sparse.transpose_values(*arrays, rates.columns)
    if transposed:
        arrays, back = back, arrays
    data = arrays[2] * np.repeat(scale, np.diff(arrays[0]))
    # Self-loops are part of the exit rates. The equations are used whatever their rows sum to.
    system = ComponentSolver(
        *arrays[:2], data, None, right * scale, right * scale, np.ones(rates.states), 0
    )
    # Values spread furthest in the order of distance, but may settle sooner in that of components.
    nearest = components.breadth_first_order(back[0], back[1], (right > 0.0).view(np.uint8))
    del back
    trials = [(nearest, tuning.TRUNCATION_SWEEPS)]
    matrix = SparseMatrix(*arrays, rates.columns)
    if not transposed:
        trials.insert(0, (graph.sccs(matrix).order, tuning.COMPONENT_ORDER_SWEEPS))
    for order, sweeps in trials:
        block = system.block(order, np.zeros((rates.states, 2)))
        done, _, _ = block.optimistic_value_iteration(1.0, True, min(sweeps, tuning.GUESS_SWEEPS))
        if not done:
            guess = np.empty(rates.states)
            guess[order] = np.asarray(block.x)[: block.n, 0]
            known = _supersolution(matrix, exit_rates, laplace_shift / time, right, guess)
            if known is not None:
                return known * math.exp(laplace_shift) * (1.0 + 1e-9)
            done = (
                sweeps > tuning.GUESS_SWEEPS
                and block.optimistic_value_iteration(1.0, True, sweeps)[0]
            )
        if done:
            break
    else:
        return None
    out = np.empty(rates.states)
    out[order] = block.x[:, 1]
    return out * math.exp(laplace_shift) * (1.0 + 1e-9)


def _supersolution(
    matrix: SparseMatrix, exit_rates: Floats, rest: float, right: Floats, guess: Floats
) -> Floats | None:
    """A proved upper bound on the solution of (rest + exit rate) x = right + R x, or None.

    BiCGStab solves the equations with a smaller rest, which leaves room for its residual. The bound
    is within a factor of about SHIFT_REDUCTION. guess: as in `relative_solution`.
    """
    if not guess.min(initial=np.inf) > tuning.GUESS_RANGE * guess.max(initial=0.0):
        return None
    diagonal = exit_rates + tuning.SHIFT_REDUCTION * rest - ssor_eisenstat.diagonal(*matrix.arrays)
    # The room suffices for this residual if the guess is at most ten times too large.
    goal = 0.1 * (1.0 - tuning.SHIFT_REDUCTION) * rest / float(np.max(exit_rates) + rest)
    found = relative_solution(matrix, 1.0 / diagonal, right, guess, goal)
    if found is None:
        return None
    longest = matrix.longest
    rounding_error = (longest + 8) * tuning.UNIT_ROUNDOFF
    out = (matrix.multiply(found) + right) / (exit_rates + rest) * (1.0 + rounding_error)
    return found if bool(np.all(out <= found)) else None
