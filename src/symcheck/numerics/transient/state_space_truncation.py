"""Which states matter for a transient value at a few states: the others are cut off, at a proved cost.

Both bounds come from the resolvent, as 1 <= exp(a - a s/T) for s <= T: the value of a state at any time up to T is at most
V = e^a (a/T - Q)^-1 gain, and the expected time that the chain spends in a state up to T at most N = e^a alpha (a/T - Q)^-1.
Cutting a set D off loses at most the sum of N(s) rate(s, d) V(d) over the edges into D. Both are linear systems with positive
solutions, of which rough upper bounds are good enough; relative accuracy is what makes it work for rare events, where N falls
and V rises by hundreds of orders of magnitude.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.kernels.graph import components
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.component_bounds import System
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.preconditioned_bicgstab import relative_solution

__all__ = ["Truncation", "truncate"]

SWEEPS = 20_000
TRIAL = 600  # sweeps in the order that components give
FIRST = 600  # sweeps that give a guess for BiCGStab: an end of their own is nearer, and begins anew
WIDEST = 1e-150  # least part of the greatest: rarer events have guesses that are too rough
EASIER = 0.8  # of a, for which that solves


@dataclass(frozen=True, eq=False)
class Truncation:
    """The states kept (ascending), and what cutting the others off loses at most, in all, at a state of interest.

    visits: bounds on the expected time spent in each kept state, from whichever state of interest. values: bounds on the value
    of each kept state at any time, V with Q V <= (a/T) V.
    """

    kept: Int64s
    loss: float
    visits: Floats
    values: Floats


def truncate(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    gain: Floats,
    interest: Int64s | Floats,
    epsilon: float,
    haste: float,
) -> Truncation | None:
    """Keep what matters to epsilon, relative to the least value of interest; None where the bounds are not found.

    gain: rates of entering the target (or of earning), non-negative. haste: a above; 1 keeps the fewest states, more is found
    faster. interest: the states, or a distribution to start from (the value is then the expected one).
    """
    given = interest.dtype == np.float64
    start: Floats = np.zeros(rates.states)
    if given:
        start[:] = interest
    else:
        start[interest] = 1.0
    with ThreadPoolExecutor(1) as other:  # the sweeps hold no lock: both systems at the same time
        later = other.submit(_resolvent, rates, exit_rates, time, start, haste, True)
        value = _resolvent(rates, exit_rates, time, gain, haste, False)
        visits = later.result()
    if value is None or visits is None:
        return None
    # The least value, or less: within a/T the chain gains a part of what it gains within T.
    least = float(start @ value) if given else float(value[interest].min())
    target = least * math.exp(-haste) / (4.0 * haste)
    owner = np.repeat(np.arange(rates.states), np.diff(rates.indptr))
    flow = visits[owner] * rates.data
    inflow = np.bincount(rates.indices, weights=flow, minlength=rates.states)
    if given:
        inflow = np.asarray(inflow + start)
    with np.errstate(under="ignore", over="ignore"):
        importance = inflow * value
    order = np.argsort(importance)
    lost = np.cumsum(importance[order])
    cut = order[: int(np.searchsorted(lost, epsilon * target))]
    keep = np.ones(rates.states, dtype=np.bool_)
    keep[cut] = False
    if not given:
        keep[interest] = True
    crossing = keep[owner] & ~keep[rates.indices]
    loss = float(np.sum(flow[crossing] * value[rates.indices[crossing]])) * (1.0 + 1e-9)
    if given:
        loss += float(np.sum((start * value)[~keep])) * (1.0 + 1e-9)
    return Truncation(np.flatnonzero(keep).astype(np.int64), loss, visits[keep], value[keep])


def _resolvent(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    right: Floats,
    haste: float,
    transposed: bool,
) -> Floats | None:
    """Upper bounds, within a factor of about two, on e^a (a/time - Q)^-1 right (or its transpose)."""
    scale = 1.0 / (exit_rates + haste / time)
    arrays: tuple[Int64s, Int32s, Floats] = (rates.indptr, rates.indices, rates.data)
    back = sparse.transpose_values(*arrays, rates.columns)
    if transposed:
        arrays, back = back, arrays
    data = arrays[2] * np.repeat(scale, np.diff(arrays[0]))
    # Every loop has been counted in the exit rate; here the equations are used as they are, whatever their rows sum to.
    system = System(*arrays[:2], data, None, right * scale, right * scale, np.ones(rates.states), 0)
    # Along the way that the values spread sweeps take them furthest; but within a component's own order they may settle far sooner.
    nearest = components.breadth_first_order(back[0], back[1], (right > 0.0).view(np.uint8))
    del back
    trials = [(nearest, SWEEPS)]
    matrix = SparseMatrix(*arrays, rates.columns)
    if not transposed:
        trials.insert(0, (graph.sccs(matrix).order, TRIAL))
    for order, sweeps in trials:
        block = system.block(order, np.zeros((rates.states, 2)))
        done, _, _ = block.optimistic(1.0, True, min(sweeps, FIRST))
        if not done:
            guess = np.empty(rates.states)
            guess[order] = np.asarray(block.x)[: block.n, 0]
            known = _supersolution(matrix, exit_rates, haste / time, right, guess)
            if known is not None:
                return known * math.exp(haste) * (1.0 + 1e-9)
            done = sweeps > FIRST and block.optimistic(1.0, True, sweeps)[0]
        if done:
            break
    else:
        return None
    out = np.empty(rates.states)
    out[order] = block.x[:, 1]
    return out * math.exp(haste) * (1.0 + 1e-9)


def _supersolution(
    matrix: SparseMatrix, exit_rates: Floats, rest: float, right: Floats, guess: Floats
) -> Floats | None:
    """A proved upper bound, within EASIER or so, on the solution of (rest + exit rate) x = right + R x; None where none is found.

    What solves the equations with a somewhat smaller rest leaves room for what BiCGStab leaves; guess: as in `relative_solution`.
    """
    if not guess.min(initial=np.inf) > WIDEST * guess.max(initial=0.0):
        return None
    diagonal = (
        exit_rates
        + EASIER * rest
        - ssor_eisenstat.loops(matrix.indptr, matrix.indices, matrix.data)
    )
    # Residuals that the room is enough for, if the guess is not more than ten times too large.
    goal = 0.1 * (1.0 - EASIER) * rest / float(np.max(exit_rates) + rest)
    found = relative_solution(matrix, 1.0 / diagonal, right, guess, goal)
    if found is None:
        return None
    out = np.empty(matrix.states)
    sparse.multiply(matrix.indptr, matrix.indices, matrix.data, found, out)
    slip = (int(np.max(np.diff(matrix.indptr), initial=0)) + 8) * 2.0**-53
    out = (out + right) / (exit_rates + rest) * (1.0 + slip)
    return found if bool(np.all(out <= found)) else None
