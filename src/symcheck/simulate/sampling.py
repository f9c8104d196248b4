"""Samples of the value of a property on many paths at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from symcheck.errors import NumericalError, UnsupportedError
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Rows, StateLayout
from symcheck.matrices.rows import Floats, Int32s, Int64s
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.simulate import tuning
from symcheck.simulate.lazy_chain import LazyChain
from symcheck.simulate.monitors import Paths, Question
from symcheck.simulate.state_predicates import compile_predicate
from symcheck.syntax.ast import Expression

__all__ = ["Sampler"]


@dataclass(eq=False)
class Sampler:
    """Samples of a property's value on independent paths from the initial state, reproducible by
    the generator's seed.

    Args:
        structure: index of the reward structure, where the property needs one.
        max_steps: steps after which an undecided path raises NumericalError, because leaving it
            out, or giving it any value, would bias the estimate.

    Attributes:
        samples, steps, longest: number of paths so far, sum of their steps, and the steps of the
            longest.
    """

    model: BoundModel
    question: Question
    generator: np.random.Generator
    reward: Reward | None = None
    labels: Mapping[str, Expression] = field(default_factory=dict)
    max_steps: int = 10_000
    fix_deadlocks: bool = True
    max_branches: int = tuning.MAX_BRANCHES
    samples: int = 0
    steps: int = 0
    longest: int = 0

    def __post_init__(self) -> None:
        labels = {**self.model.labels, **self.labels}
        layout = StateLayout.of(self.model.variables)
        self._chain = LazyChain(
            self.model,
            self.reward,
            tuple(compile_predicate(a, self.model, layout, labels) for a in self.question.atoms),
            fix_deadlocks=self.fix_deadlocks,
            max_branches=self.max_branches,
        )
        self._initial: Rows = initial_rows(self.model, layout)
        if len(self._initial) != 1:
            raise UnsupportedError(
                "-sim samples paths from one initial state, and this model has "
                f"{len(self._initial)}; "
                "init … endinit can be narrowed to one, and without -sim the result is the range "
                "over all of them"
            )

    def sample(self, count: int) -> Floats:
        """The values on `count` new paths, in the order of the paths: float64[count]; infinite
        where a target is never reached.

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
        step, next_check, goal = 0, tuning.FIRST_GRAPH_CHECK, self.question.goal
        while True:
            ids = self._chain.expand(ids)
            leave = time + self._durations(ids)
            decided, results = self.question.look(self._chain, Paths(step, ids, time, leave, total))
            if goal is not None:
                missed = (goal.lost if step == next_check else goal.trapped)(
                    self._chain, ids
                ) & ~decided
                results, decided = np.where(missed, goal.missed, results), decided | missed
                next_check *= 1 + (step == next_check)
            values[alive[decided]] = results[decided]
            open_ = ~decided
            alive, ids, time, leave, total = (
                alive[open_],
                ids[open_],
                time[open_],
                leave[open_],
                total[open_],
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
        """Random branches (int64[n]); the state rewards of the stay are added to `total`."""
        total += self._chain.reward(ids) * duration
        return self._chain.sample(ids, self.generator.random(len(ids)))

    def _durations(self, ids: Int32s) -> Floats:
        if not self._chain.continuous:
            return np.ones(len(ids))
        return self.generator.standard_exponential(len(ids)) / self._chain.rate(ids)

    def _too_long(self, undecided: int, count: int) -> NumericalError:
        return NumericalError(
            f"{undecided} of {count} sampled paths are undecided after {self.max_steps} steps, and "
            "an estimate without them would "
            "be biased: -simpathlen allows longer paths, a bound (such as F<=k) ends them, and "
            "without -sim nothing is sampled"
        )
