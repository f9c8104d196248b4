"""State-space truncation for transient values at a few states, with a proved bound on the error.

A value is an expected reward within the time T, or the probability of entering a target within it;
Q is the generator of the chain. Both bounds come from the resolvent, since 1 <= exp(a - a s/T) for
s <= T with a Laplace shift a/T.
The value of a state at any time up to T is at most V = e^a (a/T - Q)^-1 reward_rate. The expected
time spent in a state up to T is at most N = e^a start (a/T - Q)^-1. Removing a set D of states
loses at most the sum of N(s) rate(s, d) V(d) over the transitions into D. Both are linear systems
with positive solutions, of which rough upper bounds suffice. The bounds must be relative: for rare
events, N falls and V rises by hundreds of orders of magnitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from symcheck.kernels.chains import gauss_seidel, ssor_eisenstat
from symcheck.kernels.graph import components
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.certificates import gauss_seidel_sweep
from symcheck.kernels.solve.component_bounds import ComponentSolver
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.preconditioned_bicgstab import relative_solution
from symcheck.parallel.threads import helpers, thread_count

__all__ = ["Truncation", "expected_times", "truncate"]

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class Truncation:
    """The states kept, and the error at the states of interest.

    kept: int64, ascending. loss: the sum of the values that these lose, at most, if all other
    states are removed.
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
        rates: the rates among the n states.
        exit_rates: the exit rate of each state, float64[n].
        time: the horizon T.
        reward_rate: rates of entering the target or of earning rewards, float64[n], non-negative.
        interest: the states whose values are wanted.
        epsilon: the loss that is aimed at, relative to the least value of interest, which is
            guessed; the loss of the result is proved.
        laplace_shift: a; 1 keeps the fewest states, larger shifts are solved faster.

    Returns:
        None if the bounds are not found, or if a few sweeps show that nearly all states matter.
    """
    start: Floats = np.zeros(rates.states)
    start[interest] = 1.0
    # V <= e^a (T/a) max reward_rate; `upper` may be twice V. States whose lower bounds lose more
    # than the greatest possible target are kept in any case.
    most = 2.0 * math.exp(laplace_shift) * time / laplace_shift * float(reward_rate.max())
    negligible = epsilon * _guessed_value(most, laplace_shift)

    def is_hopeless(occupation: Floats, value: Floats) -> bool:
        matters = _importance(rates, occupation, value) > negligible
        return bool(np.count_nonzero(matters) > tuning.TRUNCATION_HOPELESS * rates.states)

    growing = _lower_bounds(rates, exit_rates, time, laplace_shift, start, reward_rate)
    if any(is_hopeless(*bounds) for bounds in growing):
        return None
    resolvent = partial(_Resolvent.of, rates, exit_rates, time, laplace_shift)
    occupied, valued = _on_two_threads(
        partial(resolvent, start, transposed=True), partial(resolvent, reward_rate)
    )
    if is_hopeless(occupied.estimate, valued.estimate):
        return None
    occupation, value = _on_two_threads(occupied.upper, valued.upper)
    if value is None or occupation is None:
        return None
    target = _guessed_value(float(value[interest].min()), laplace_shift)
    importance = _importance(rates, occupation, value)
    order = np.argsort(importance)
    lost = np.cumsum(importance[order])
    cut = order[: int(np.searchsorted(lost, epsilon * target))]
    keep = np.ones(rates.states, dtype=np.bool_)
    keep[cut] = False
    keep[interest] = True
    owner = rates.row_of_entry
    crossing = np.flatnonzero(keep[owner] & ~keep[rates.indices])
    flow = occupation[owner[crossing]] * rates.data[crossing]
    loss = float(np.sum(flow * value[rates.indices[crossing]])) * (1.0 + 1e-9)
    # States that reach no reward any more have the value 0, and no positive weights exist for them.
    keep &= graph.backward_reachable(rates, keep & (reward_rate > 0.0), keep)
    keep[interest] = True
    return Truncation(np.flatnonzero(keep).astype(np.int64), loss, value[keep])


def expected_times(
    rates: SparseMatrix, exit_rates: Floats, time: float, start: Floats, laplace_shift: float
) -> Floats:
    """About an upper bound on the expected time in each state up to the horizon: float64[n].

    Args:
        rates: the rates among the n states.
        exit_rates: the exit rate of each state, float64[n].
        time: the horizon T.
        start: the initial distribution, float64[n].
        laplace_shift: a.
    """
    found = _Resolvent.of(rates, exit_rates, time, laplace_shift, start, transposed=True)
    return found.estimate


def _lower_bounds(
    rates: SparseMatrix,
    exit_rates: Floats,
    time: float,
    laplace_shift: float,
    start: Floats,
    reward_rate: Floats,
) -> Iterator[tuple[Floats, Floats]]:
    """About lower bounds on N and V, by Gauss-Seidel sweeps over the rows as they are.

    Yields:
        The bounds after more and more sweeps; the arrays change afterwards.
    """
    rest, factor = laplace_shift / time, math.exp(laplace_shift)
    leaving = np.maximum(exit_rates - ssor_eisenstat.diagonal(*rates.arrays), 0.0) + rest
    rows, earned = rates.divided(exit_rates + rest), reward_rate / (exit_rates + rest)
    mass, spent, value = start.copy(), np.zeros(rates.states), np.zeros(rates.states)

    def sweep_occupation(sweeps: int) -> None:
        for _ in range(sweeps):
            gauss_seidel.occupation_sweep(*rates.arrays, leaving, mass, spent)

    def sweep_values(sweeps: int) -> None:
        for _ in range(sweeps):
            for backwards in (False, True):
                gauss_seidel_sweep(*rows.arrays, earned, value, backwards)

    for sweeps in tuning.TRUNCATION_TRIAL_SWEEPS:
        _on_two_threads(partial(sweep_occupation, sweeps), partial(sweep_values, sweeps))
        yield spent * factor, value * factor


def _on_two_threads(one: Callable[[], Found], other: Callable[[], Found]) -> tuple[Found, Found]:
    """What two functions return, whose compiled loops release the lock of the interpreter."""
    if thread_count() == 1:
        return one(), other()
    first = helpers().submit(one)
    second = other()
    return first.result(), second


def _guessed_value(bound: float, laplace_shift: float) -> float:
    """About the value of a state, by its bound V: without the factor e^a, what is earned within
    T/a, and with a margin of 4.
    """
    return bound * math.exp(-laplace_shift) / (4.0 * laplace_shift)


def _importance(rates: SparseMatrix, occupation: Floats, value: Floats) -> Floats:
    """The value that is lost at most if a state is removed: float64[n].

    Args:
        rates: the transitions.
        occupation: float64[n], the expected time in each state.
        value: float64[n].
    """
    with np.errstate(under="ignore", over="ignore"):
        return np.asarray(rates.multiply_left(occupation) * value)


@dataclass(eq=False)
class _Resolvent:
    """Bounds on e^a (a/time - Q)^-1 right, or on its transpose: the solution of x = A x + b.

    matrix, constant: A and b, without the factor e^a. slack: a/time in the same scale.
    nearest: the states in the order of their distance from those where `right` is positive.
    lower: lower bounds, without the factor e^a.
    """

    transposed: bool
    laplace_shift: float
    matrix: SparseMatrix
    constant: Floats
    slack: Floats
    system: ComponentSolver
    nearest: Int32s
    lower: Floats

    @staticmethod
    def of(
        rates: SparseMatrix,
        exit_rates: Floats,
        time: float,
        laplace_shift: float,
        right: Floats,
        *,
        transposed: bool = False,
    ) -> _Resolvent:
        """The lower bounds after a few sweeps."""
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
        matrix, constant = SparseMatrix(*arrays[:2], data, rates.states), right * scale
        system = ComponentSolver(*matrix.arrays, None, constant, constant, np.ones(rates.states), 0)
        reached, parent = components.breadth_first(back[0], back[1], (right > 0.0).view(np.uint8))
        nearest = np.append(reached, np.flatnonzero(parent == -2).astype(np.int32))
        result = _Resolvent(
            transposed,
            laplace_shift,
            matrix,
            constant,
            laplace_shift / time * scale,
            system,
            nearest,
            np.zeros(rates.states),
        )
        result._sweep(nearest, tuning.TRUNCATION_FIRST_SWEEPS)
        return result

    @property
    def estimate(self) -> Floats:
        """The lower bounds."""
        return self.lower * math.exp(self.laplace_shift)

    def upper(self) -> Floats | None:
        """Upper bounds within about a factor of 2; None if they are not found."""
        found = self._by_bicgstab()
        if found is None:
            found = self._by_sweeps()
        return None if found is None else found * math.exp(self.laplace_shift) * (1.0 + 1e-9)

    def _by_bicgstab(self) -> Floats | None:
        """Upper bounds that one product proves, if the lower bounds are near enough to start from.

        The equations get a little more on the right, so that the residual may have either sign.
        """
        guess, ones = np.maximum(self.lower, np.finfo(np.float64).tiny), np.ones(len(self.lower))
        goal = tuning.TRUNCATION_RESIDUAL * float(self.slack.min())
        rounding = 4.0 * (self.matrix.longest + 8) * tuning.UNIT_ROUNDOFF  # of a row, outwards
        for _ in range(tuning.TRUNCATION_SOLUTIONS):
            more = tuning.TRUNCATION_SLACK * self.slack * guess
            with np.errstate(over="ignore", invalid="ignore"):
                solution = relative_solution(
                    self.matrix,
                    ones,
                    self.constant + more,
                    guess,
                    goal,
                    early=tuning.TRUNCATION_EARLY_STEPS,
                    largest=tuning.TRUNCATION_DIVERGED,
                )
                if solution is None:
                    return None
                product = self.matrix.multiply(solution) + self.constant
            if bool(np.all(product <= solution * (1.0 - rounding))):
                return solution
            guess = solution
        return None

    def _by_sweeps(self) -> Floats | None:
        """Upper bounds by optimistic value iteration."""
        # Values spread furthest in the order of distance, but may settle sooner in that of
        # components.
        orders = [self.nearest]
        if not self.transposed:
            orders = [graph.sccs(self.matrix).order, self.nearest] * 2
        sweeps = tuning.TRUNCATION_SWEEPS[-len(orders) :]
        for order, budget in zip(orders, sweeps, strict=True):
            found = self._sweep(order, budget)
            if found is not None:
                return found
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
