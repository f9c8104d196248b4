"""Forward uniformisation from one state, on the states that hold probability, with error bounds.

The value of one state is the sum over k of weight_k · (p_k · start), where p_k is its distribution
after k steps. p_k is stored for active states only, and probabilities below a threshold are dropped
before each step. What was dropped could have earned the largest reward in each later step, which
bounds the error. So a process that moves through a large state space is followed in a window.

Source: Henzinger, Mateescu & Wolf (2009), 'Sliding window abstraction for infinite Markov chains'.
"""

from __future__ import annotations

import math

import numpy as np

from symcheck.kernels.chains import uniformization
from symcheck.matrices.rows import Floats, Int32s, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.settings import Settings
from symcheck.numerics.transient.poisson import poisson

__all__ = ["ForwardValue", "forward_value"]


class ForwardValue:
    """Bounds on the value of one state, which become closer with each step.

    Attributes:
        lower, upper: the bounds, rounding included.
        steps: the steps made.
        largest: the greatest number of active states so far.
    """

    lower: float = 0.0
    upper: float = math.inf
    steps: int = 0
    largest: int = 1


def forward_value(
    rates: SparseMatrix,
    exit_rates: Floats,
    start: Floats,
    time: float,
    source: bool,
    state: int,
    settings: Settings,
    observer: Observer | None,
) -> ForwardValue:
    """Bounds on x(time) at one state, for x' = Q x + reward rate, x(0) = terminal.

    Args:
        rates: the rates among the n states.
        exit_rates: the exit rate of each state, float64[n].
        start: the reward rate or the terminal values, non-negative, float64[n].
        time: the horizon.
        source: whether `start` is the reward rate.
        state: the state whose value is computed.
        settings: the accuracy.
        observer: receives the progress.

    Returns:
        The bounds; the upper one is infinite if too many states are active or too much was dropped.
    """
    run = _Run(rates, exit_rates, start, time, source, state)
    budget = tuning.FORWARD_WORK
    while run.threshold >= tuning.UNDERFLOW_RISK:
        spoilt = False
        while not spoilt:
            visited = run.advance()
            budget -= visited
            ahead = visited * (len(run.weights) - run.steps) // tuning.CHECK_INTERVAL
            if run.count < 0 or budget < 0:
                return run.abandoned()
            if observer is not None:
                observer(Progress("uniformisation", run.steps, run.upper - run.lower, run.count))
            if run.converged(settings):
                return run
            if ahead > tuning.FORWARD_WORK:
                return run.abandoned()
            spoilt = run.is_spoilt(settings)
        goal = settings.epsilon * (run.lower if settings.relative else 1.0)
        if run.loss <= 0.01 * goal:  # rounding alone is too much
            break
        factor = 0.01 * goal / run.loss
        run.restart(run.threshold * min(factor or 1.0, tuning.FORWARD_REFINEMENT))
    return run.abandoned()


class _Run(ForwardValue):
    """Steps with one threshold."""

    def __init__(
        self,
        rates: SparseMatrix,
        exit_rates: Floats,
        start: Floats,
        time: float,
        source: bool,
        state: int,
    ) -> None:
        self.rates, self.exit_rates, self.start = rates, exit_rates, start
        self.source, self.state = source, state
        self.q = float(exit_rates.max())
        self.greatest = float(start.max()) / (self.q if source else 1.0)
        self.window = poisson(self.q * time)
        self.weights = self.window.tails() if source else self.window.masses()
        n = len(start)
        capacity = max(int(tuning.FORWARD_ACTIVE_SHARE * n), 1)
        self.active: Int32s = np.zeros(capacity, np.int32)
        self.following: Int32s = np.zeros(capacity, np.int32)
        self.y, self.z, self.arrivals = np.zeros(n), np.zeros(n), np.zeros(n, np.int32)
        self.count = 0
        self.restart(tuning.FORWARD_THRESHOLD)

    def restart(self, threshold: float) -> None:
        """Begin with another threshold."""
        self.threshold = threshold
        self.y[self.active[: self.count]] = 0.0
        self.active[0], self.y[self.state], self.count = self.state, 1.0, 1
        self.lower, self.upper, self.steps, self.terms = 0.0, math.inf, 0, 0
        self.total = self.lost = self.loss = 0.0

    def abandoned(self) -> ForwardValue:
        """The lower bound alone, which also holds within a step."""
        self.upper = math.inf
        return self

    def advance(self) -> int:
        """Make some steps; return the entries visited."""
        values, lost = np.zeros(tuning.CHECK_INTERVAL), np.zeros(tuning.CHECK_INTERVAL)
        self.count, visited, terms = uniformization.active_steps(
            *self.rates.arrays,
            self.exit_rates,
            self.q,
            self.start,
            self.y,
            self.z,
            self.arrivals,
            self.active,
            self.following,
            self.count,
            self.threshold,
            values,
            lost,
        )
        known = self.weights.between(self.steps, self.steps + len(values))
        unit = 1.0 / (self.q if self.source else 1.0)
        self.total += float(known @ values[: len(known)]) * unit
        before = self.lost + np.cumsum(lost) - lost  # what is dropped in a step is missed later
        self.loss += self.greatest * (1.0 + 1e-9) * float(known @ before[: len(known)])
        self.lost = (self.lost + float(lost.sum())) * (1.0 + 1e-12)
        self.steps += len(values)
        self.largest = max(self.largest, self.count)
        self.terms = max(self.terms, terms)
        # Of a step, of the sum over active states, and of exit rates (see `_series_error`).
        steps = (self.steps + 4) * (self.terms + 14) + self.largest
        roundings = steps + (self.rates.longest + 2) * self.window.rate
        error = roundings * tuning.UNIT_ROUNDOFF + self.window.error + 1e-10
        self.lower = max(self.total * (1.0 - error), 0.0)
        self.upper = self.total * (1.0 + error) + (self.loss + self.rest) * (1.0 + 1e-9)
        return int(visited)

    @property
    def rest(self) -> float:
        """The most that later steps add."""
        return (self.weights.tail_sum(self.steps) + self.weights.missing) * self.greatest

    def converged(self, settings: Settings) -> bool:
        """Whether the bounds are close enough."""
        return self.upper - self.lower <= settings.epsilon * (
            self.upper if settings.relative else 1.0
        )

    def is_spoilt(self, settings: Settings) -> bool:
        """Whether the bounds will not be close enough, because too much was dropped."""
        if self.steps >= len(self.weights):
            return True
        most = self.total + self.loss + self.rest if settings.relative else 1.0
        return self.loss > settings.epsilon * most
