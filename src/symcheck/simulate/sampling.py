"""Sampling of a property on many paths at once."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from symcheck.errors import NumericalError, UnsupportedError
from symcheck.explicit.states import Rows
from symcheck.matrices.rows import Floats, Int32s, Int64s
from symcheck.simulate import tuning
from symcheck.simulate.intervals import Range
from symcheck.simulate.lazy_chain import LazyChain
from symcheck.simulate.monitors import Monitor, Paths
from symcheck.simulate.reward_range import StepRewards
from symcheck.simulate.sources import Source

__all__ = ["Batch", "Sampler"]

_PER_COUNT = 4  # Philox gives four words for each value of its counter


class _Stream(IntEnum):
    """What the numbers decide."""

    BRANCH = 0
    DURATION = 1


class _PathNumbers:
    """Random numbers that are a function of the seed, the path and the step.

    So the value of a path does not depend on which paths are sampled with it, nor where. They are
    those of Philox, whose counter has the path, the step and the stream.

    Source: J. K. Salmon et al.: Parallel random numbers: as easy as 1, 2, 3 (SC 2011).

    Args:
        seed: a whole number from 0.
    """

    def __init__(self, seed: int) -> None:
        self._key = np.random.SeedSequence(seed).generate_state(2, np.uint64)

    def uniform(self, paths: Int64s, step: int, stream: _Stream) -> Floats:
        """A number from [0, 1) for each path: float64[n].

        Args:
            paths: numbers of paths, int64[n], ascending. The cost is that of all between them.
            step: the step that these paths take.
            stream: which of the numbers of this step.
        """
        if not len(paths):
            return np.empty(0)
        count = int(paths[0]) // _PER_COUNT
        philox = np.random.Philox(key=self._key, counter=[count, step, stream, 0])
        first = count * _PER_COUNT
        return np.random.Generator(philox).random(int(paths[-1]) + 1 - first)[paths - first]


@dataclass(frozen=True, eq=False)
class Batch:
    """The values of a property on some paths, float64[n], and the sum of their steps."""

    values: Floats
    steps: int


@dataclass(eq=False)
class Sampler:
    """Samples the value of a property on independent paths from the initial state.

    The value of a path depends on its number and the seed, not on the paths that are sampled with
    it.

    Args:
        source: the states and their successors, with the reward that the property accumulates.
        monitor: the property.
        seed: of the random numbers.
        fix_deadlocks: give deadlock states a loop; if False, a deadlock raises ModelFault.
        max_steps: steps after which an undecided path raises NumericalError, because leaving it
            out, or giving it any value, would bias the estimate.
    """

    source: Source
    monitor: Monitor
    seed: int
    max_steps: int = 10_000
    fix_deadlocks: bool = True

    def __post_init__(self) -> None:
        self._numbers = _PathNumbers(self.seed)
        self._chain = LazyChain(
            self.source,
            tuple(map(self.source.predicate, self.monitor.atoms)),
            fix_deadlocks=self.fix_deadlocks,
        )
        self._initial: Rows = self.source.initial
        if len(self._initial) != 1:
            raise UnsupportedError(
                "sampling starts paths from one initial state, and this model has "
                f"{len(self._initial)}; restrict init … endinit to one state, or check without "
                "sampling, which gives the range over all initial states"
            )

    @property
    def support(self) -> Range:
        """Bounds on the value of a path."""
        self._chain.add(self._initial)
        return self.monitor.range_of(StepRewards(self._chain))

    def sample(self, first: int, count: int) -> Batch:
        """Sample `count` paths, of which the first has this number.

        The values are infinite where a reward accumulates until a target that is never reached.

        Raises:
            NumericalError: a path is undecided after `max_steps` steps.
            ModelFault: the model breaks a rule in a state on a path.
        """
        values, steps = np.empty(count), 0
        alive: Int64s = np.arange(count)
        ids = np.repeat(self._chain.add(self._initial), count)
        time, total = np.zeros(count), np.zeros(count)
        step, next_check, goal = 0, tuning.FIRST_GRAPH_CHECK, self.monitor.goal
        while True:
            ids = self._chain.expand(ids)
            leave = time + self._durations(ids, first + alive, step)
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
            steps += len(alive)
            if not len(alive):
                return Batch(values, steps)
            if step >= self.max_steps:
                raise self._too_long(len(alive), count)
            total += self._chain.reward(ids) * (leave - time)
            uniform = self._numbers.uniform(first + alive, step, _Stream.BRANCH)
            ids, earned = self._chain.follow(self._chain.sample(ids, uniform))
            total += earned
            time = leave
            step += 1

    def _durations(self, ids: Int32s, paths: Int64s, step: int) -> Floats:
        """Sojourn times: one step in discrete time, exponentially distributed in a CTMC."""
        if not self._chain.continuous:
            return np.ones(len(ids))
        uniform = self._numbers.uniform(paths, step, _Stream.DURATION)
        return np.asarray(-np.log1p(-uniform) / self._chain.rate(ids))

    def _too_long(self, undecided: int, count: int) -> NumericalError:
        return NumericalError(
            f"{undecided} of {count} sampled paths are undecided after {self.max_steps} steps, and "
            "an estimate without them would be biased: allow longer paths ('max_steps'), bound "
            "the property (such as F<=k), or check it without sampling"
        )
