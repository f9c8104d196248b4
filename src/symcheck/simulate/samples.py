"""The values of a property on the paths of a seed, sampled by this process or by workers."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from math import ceil

import numpy as np

from symcheck.engines.base import Engine
from symcheck.errors import ResourceError, UsageError
from symcheck.matrices.rows import Floats
from symcheck.parallel.workers import Lost, Workers
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.simulate import tuning
from symcheck.simulate.intervals import Moments, Range
from symcheck.simulate.monitors import Monitor
from symcheck.simulate.sampling import Batch, Sampler
from symcheck.simulate.sources import CommandSource, Source, TableSource
from symcheck.syntax.ast import Expression

__all__ = ["SampledProperty", "Samples"]


@dataclass(frozen=True, eq=False)
class SampledProperty:
    """What is sampled; workers make a sampler of it.

    Attributes:
        model: its commands give the paths.
        table: the explicit engine of a model without commands, whose rows give the paths.
        monitor: the property.
        reward: the reward that the property accumulates; None for a probability.
        labels: labels of the properties file.
        seed, max_steps, fix_deadlocks: see `Sampler`.
    """

    model: BoundModel
    table: Engine | None
    monitor: Monitor
    reward: Reward | None
    labels: Mapping[str, Expression]
    seed: int
    max_steps: int
    fix_deadlocks: bool

    def sampler(self) -> Sampler:
        """A sampler of the property. Raises UnsupportedError, InputError."""
        source: Source = (
            CommandSource(self.model, self.reward, self.labels)
            if self.table is None
            else TableSource(self.table, self.reward, self.labels)
        )
        return Sampler(source, self.monitor, self.seed, self.max_steps, self.fix_deadlocks)


class Samples:
    """The values of a property on paths 0, 1, 2, …; they do not depend on the workers.

    Args:
        sampled: the property.
        workers: sample many paths; this process samples few.
        observer: is told of the moments of the samples so far, and how many there will be.

    Attributes:
        samples, steps: number of paths sampled so far, and the sum of their steps.
    """

    def __init__(
        self,
        sampled: SampledProperty,
        workers: Workers,
        observer: Callable[[Moments, int], None] | None = None,
    ) -> None:
        self.samples = 0
        self.steps = 0
        self._sampled, self._workers, self._observer = sampled, workers, observer
        self._moments: Moments | None = None
        self._sampler = sampled.sampler()

    @cached_property
    def support(self) -> Range:
        """Bounds on the value of a path, which are infinite if none are known."""
        return Range(0.0, 1.0) if self._sampled.reward is None else self._sampler.support

    def sample(self, count: int) -> Floats:
        """The values on the next `count` paths, float64[count]; infinite where a reward accumulates
        until a target that is never reached.

        Raises:
            NumericalError: a path is undecided after `max_steps` steps.
            ModelFault: the model breaks a rule in a state on a path.
            ResourceError: a worker was killed again and again.
            UsageError: the model cannot be sent to workers.
        """
        if self._workers.here or count < tuning.MIN_PATHS_ON_WORKERS:
            batches = self._here(count)
        else:
            size = min(tuning.PATHS_PER_BATCH, ceil(count / tuning.BATCHES_ON_WORKERS))
            batches = self._on_workers(_parts(self.samples, count, size))
        self.samples += count
        self.steps += sum(batch.steps for batch in batches)
        return np.concatenate([batch.values for batch in batches]) if batches else np.empty(0)

    def _here(self, count: int) -> list[Batch]:
        """Batches that grow as long as they are sampled fast."""
        batches: list[Batch] = []
        size, done = tuning.FIRST_BATCH, 0
        while done < count:
            size = min(size, count - done)
            batches.append(self._sampler.sample(self.samples + done, size))
            done += size
            self._report(batches[-1], self.samples + count)
            if batches[-1].steps < tuning.STEPS_PER_BATCH:
                size = min(4 * size, tuning.PATHS_PER_BATCH)
        return batches

    def _report(self, batch: Batch, target: int) -> None:
        """Tell the observer of a batch, the next one by the numbers of paths."""
        if self._observer is None:
            return
        moments = Moments.of(batch.values)
        self._moments = moments if self._moments is None else self._moments.joined(moments)
        self._observer(self._moments, target)

    def _on_workers(self, parts: list[tuple[int, int]]) -> list[Batch]:
        batches: list[Batch | None] = [None] * len(parts)
        function, reported = partial(_sample, self._pickled), 0
        with closing(self._workers.completed(function, parts)) as completed:
            for i, batch in completed:
                if isinstance(batch, Lost):
                    raise ResourceError(f"paths {parts[i][0]} and following: {batch}")
                batches[i] = batch
                # Batches that are finished first may be those with short paths.
                while reported < len(parts) and (following := batches[reported]) is not None:
                    self._report(following, parts[-1][0] + parts[-1][1])
                    reported += 1
        return [batch for batch in batches if batch is not None]

    @property
    def _pickled(self) -> bytes:
        try:
            return pickle.dumps(self._sampled)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            raise UsageError(
                f"the model cannot be sent to workers: {error}", hint="sample in one process"
            ) from None


def _parts(first: int, count: int, size: int) -> list[tuple[int, int]]:
    """The first path and the number of paths of each batch."""
    return [(first + b, min(size, count - b)) for b in range(0, count, size)]


def _sample(sampled: bytes, part: tuple[int, int]) -> Batch:
    """A batch of paths, on a worker."""
    return _sampler(sampled).sample(*part)


@lru_cache(maxsize=1)
def _sampler(sampled: bytes) -> Sampler:
    loaded: SampledProperty = pickle.loads(sampled)
    return loaded.sampler()
