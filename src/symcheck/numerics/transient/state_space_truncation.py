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
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.kernels.graph import components
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.component_bounds import ComponentSolver
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics import graph, tuning
from symcheck.parallel.threads import helpers, thread_count

__all__ = ["Truncation", "truncate"]

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Truncation:
    """The states kept, and the error at each state of interest.

    kept: int64, ascending. loss: the value lost by removing all other states, at most.
    values: bounds on the value of each kept state at any time; Q V <= (a/T) V holds.
    """

    kept: Int64s
    loss: float
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
        None if the bounds are not found, or if nearly all states matter.
    """
    start: Floats = np.zeros(rates.states)
    start[interest] = 1.0
    occupied = _Resolvent.of(rates, exit_rates, time, start, laplace_shift, transposed=True)
    valued = _Resolvent.of(rates, exit_rates, time, reward_rate, laplace_shift, transposed=False)
    estimates = _on_two_threads(occupied.estimate, valued.estimate)
    # The least value is at most about that of the greatest reward, for all the time.
    most = 2.0 * math.exp(laplace_shift) * time / laplace_shift * float(reward_rate.max())
    needed = _importance(rates, *estimates)[1] > epsilon * _target(most, laplace_shift)
    if np.count_nonzero(needed) > tuning.TRUNCATION_HOPELESS * rates.states:
        return None
    occupation, value = _on_two_threads(occupied.upper, valued.upper)
    if value is None or occupation is None:
        return None
    # A lower bound on the least value: the reward within T/a is part of that within T.
    target = _target(float(value[interest].min()), laplace_shift)
    flow, importance = _importance(rates, occupation, value)
    order = np.argsort(importance)
    lost = np.cumsum(importance[order])
    cut = order[: int(np.searchsorted(lost, epsilon * target))]
    keep = np.ones(rates.states, dtype=np.bool_)
    keep[cut] = False
    keep[interest] = True
    crossing = keep[rates.row_of_entry] & ~keep[rates.indices]
    loss = float(np.sum(flow[crossing] * value[rates.indices[crossing]])) * (1.0 + 1e-9)
    # States that reach no reward any more have the value 0, and no positive weights exist for them.
    keep &= graph.backward_reachable(rates, keep & (reward_rate > 0.0), keep)
    keep[interest] = True
    return Truncation(np.flatnonzero(keep).astype(np.int64), loss, value[keep])


def _on_two_threads(one: Callable[[], T], other: Callable[[], T]) -> tuple[T, T]:
    """What two functions return, whose sweeps release the lock of the interpreter."""
    if thread_count() == 1:
        return one(), other()
    first = helpers().submit(one)
    second = other()
    return first.result(), second


def _target(least: float, laplace_shift: float) -> float:
    """The loss that is relative to a least value, by a bound on the latter."""
    return least * math.exp(-laplace_shift) / (4.0 * laplace_shift)


def _importance(rates: SparseMatrix, occupation: Floats, value: Floats) -> tuple[Floats, Floats]:
    """The flow along each transition, and the value that flows into each state."""
    flow = occupation[rates.row_of_entry] * rates.data
    inflow = np.bincount(rates.indices, weights=flow, minlength=rates.states)
    with np.errstate(under="ignore", over="ignore"):
        return flow, inflow * value


@dataclass(eq=False)
class _Resolvent:
    """e^a (a/time - Q)^-1 right, or its transpose.

    orders: the orders of the sweeps. lower: what they have reached, without the factor e^a.
    """

    system: ComponentSolver
    orders: list[Int32s]
    laplace_shift: float
    lower: Floats

    @staticmethod
    def of(
        rates: SparseMatrix,
        exit_rates: Floats,
        time: float,
        right: Floats,
        laplace_shift: float,
        *,
        transposed: bool,
    ) -> _Resolvent:
        """Before the first sweep."""
        arrays = rates.arrays
        loops = ssor_eisenstat.diagonal(*arrays)
        leaving = np.maximum(exit_rates - loops - 4.0 * tuning.UNIT_ROUNDOFF * exit_rates, 0.0)
        scale = 1.0 / (leaving + laplace_shift / time)
        back = sparse.transpose_values(*arrays, rates.columns)
        if transposed:
            arrays, back = back, arrays
        owner = np.repeat(np.arange(rates.states), np.diff(arrays[0]))
        # Without self-loops, the equations are used whatever their rows sum to.
        data = np.where(arrays[1] == owner, 0.0, arrays[2] * scale[owner])
        system = ComponentSolver(
            *arrays[:2], data, None, right * scale, right * scale, np.ones(rates.states), 0
        )
        # Values spread furthest in the order of distance, but may settle sooner in that of
        # components.
        reached, parent = components.breadth_first(back[0], back[1], (right > 0.0).view(np.uint8))
        nearest = np.append(reached, np.flatnonzero(parent == -2).astype(np.int32))
        del back
        orders = [nearest] if transposed else [graph.sccs(rates).order, nearest] * 2
        return _Resolvent(system, orders, laplace_shift, np.zeros(rates.states))

    def estimate(self) -> Floats:
        """Lower bounds after a few sweeps."""
        self._sweep(self.orders[-1], tuning.TRUNCATION_FIRST_SWEEPS)
        return self.lower * math.exp(self.laplace_shift)

    def upper(self) -> Floats | None:
        """Upper bounds within about a factor of 2; None if the sweeps do not find them."""
        sweeps = tuning.TRUNCATION_SWEEPS[-len(self.orders) :]
        for order, budget in zip(self.orders, sweeps, strict=True):
            found = self._sweep(order, budget)
            if found is not None:
                return found * math.exp(self.laplace_shift) * (1.0 + 1e-9)
        return None

    def _sweep(self, order: Int32s, budget: int) -> Floats | None:
        """Raise the lower bounds; the upper ones, if they are found."""
        block = self.system.block(order, np.zeros((len(order), 2)))
        block.x[:, 0] = self.lower[order]  # go on from the last order
        found, _, _ = block.optimistic_value_iteration(1.0, True, budget, restart=False)
        self.lower[order] = block.x[:, 0]
        if not found:
            return None
        out = np.empty(len(order))
        out[order] = block.x[:, 1]
        return out
