"""Sampling of a property on many paths at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symcheck.errors import NumericalError, UnsupportedError
from symcheck.explicit.states import Rows
from symcheck.matrices.rows import Floats, Int32s, Int64s
from symcheck.simulate import tuning
from symcheck.simulate.lazy_chain import LazyChain
from symcheck.simulate.monitors import Monitor, Paths
from symcheck.simulate.sources import Source

__all__ = ["Sampler"]


@dataclass(eq=False)
class Sampler:
    """Samples the value of a property on independent paths from the initial state.

    The same seed of the generator gives the same samples.

    Args:
        source: the states and their successors, with the reward that the property accumulates.
        monitor: the property.
        fix_deadlocks: give deadlock states a loop; if False, a deadlock raises ModelFault.
        max_steps: steps after which an undecided path raises NumericalError, because leaving it
            out, or giving it any value, would bias the estimate.

    Attributes:
        samples, steps, longest: number of paths sampled so far, the sum of their steps, and the
            steps of the longest path.
    """

    source: Source
    monitor: Monitor
    generator: np.random.Generator
    max_steps: int = 10_000
    fix_deadlocks: bool = True
    samples: int = 0
    steps: int = 0
    longest: int = 0

    def __post_init__(self) -> None:
        self._chain = LazyChain(
            self.source,
            tuple(map(self.source.predicate, self.monitor.atoms)),
            fix_deadlocks=self.fix_deadlocks,
        )
        self._initial: Rows = self.source.initial
        if len(self._initial) != 1:
            raise UnsupportedError(
                "-sim samples paths from one initial state, and this model has "
                f"{len(self._initial)}; restrict init … endinit to one state, or check without "
                "-sim, which gives the range over all initial states"
            )

    def sample(self, count: int) -> Floats:
        """Sample `count` new paths.

        Returns:
            The values of the property, float64[count]; infinite where a reward accumulates until a
            target that is never reached.

        Raises:
            NumericalError: a path is undecided after `max_steps` steps.
            ModelFault: the model breaks a rule in a state on a path.
        """
        parts = [
            self._batch(min(tuning.PATHS_PER_BATCH, count - begin))
            for begin in range(0, count, tuning.PATHS_PER_BATCH)
        ]
        self.samples += count
        return np.concatenate(parts) if parts else np.empty(0)

    def _batch(self, count: int) -> Floats:
        values = np.empty(count)
        alive: Int64s = np.arange(count)
        ids = np.repeat(self._chain.add(self._initial), count)
        time, total = np.zeros(count), np.zeros(count)
        step, next_check, goal = 0, tuning.FIRST_GRAPH_CHECK, self.monitor.goal
        while True:
            ids = self._chain.expand(ids)
            leave = time + self._durations(ids)
            decided, results = self.monitor.decide(
                self._chain, Paths(step, ids, time, leave, total)
            )
            if goal is not None:
                never = (goal.unreachable if step == next_check else goal.absorbed_outside)(
                    self._chain, ids
                ) & ~decided
                results, decided = np.where(never, goal.value_if_missed, results), decided | never
                next_check *= 1 + (step == next_check)
            values[alive[decided]] = results[decided]
            remaining = ~decided
            alive, ids, time, leave, total = (
                alive[remaining],
                ids[remaining],
                time[remaining],
                leave[remaining],
                total[remaining],
            )
            self.steps += len(alive)
            if not len(alive):
                self.longest = max(self.longest, step)
                return values
            if step >= self.max_steps:
                raise self._too_long(len(alive), count)
            ids, earned = self._chain.follow(self._branches(ids, total, leave - time))
            total += earned
            time = leave
            step += 1

    def _branches(self, ids: Int32s, total: Floats, duration: Floats) -> Int64s:
        """Draw branches (int64[n]), and add the state rewards of the sojourns to `total`."""
        total += self._chain.reward(ids) * duration
        return self._chain.sample(ids, self.generator.random(len(ids)))

    def _durations(self, ids: Int32s) -> Floats:
        """Sojourn times: one step in discrete time, exponentially distributed in a CTMC."""
        if not self._chain.continuous:
            return np.ones(len(ids))
        return self.generator.standard_exponential(len(ids)) / self._chain.rate(ids)

    def _too_long(self, undecided: int, count: int) -> NumericalError:
        return NumericalError(
            f"{undecided} of {count} sampled paths are undecided after {self.max_steps} steps, and "
            "an estimate without them would be biased: allow longer paths with -simpathlen, bound "
            "the property (such as F<=k), or check it without -sim"
        )
