"""Values of a question on many sampled paths at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from symcheck.errors import NumericalError, UnsupportedError
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Layout, Rows
from symcheck.matrices.rows import Floats, Int32s, Int64s
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.simulate.lazy_chain import MAX_BRANCHES, LazyChain
from symcheck.simulate.monitors import Paths, Question
from symcheck.simulate.state_predicates import compile_predicate
from symcheck.syntax.ast import Expression

__all__ = ["Sampler"]

_BATCH = 1 << 16  # paths at a time
_FIRST_LOOK_AHEAD = (
    16  # steps after which, and then after each doubling, hopeless paths are looked for
)


@dataclass(eq=False)
class Sampler:
    """Samples of a question's value: independent paths from the initial state, reproducible by the
    generator's seed.

    max_steps: paths that are undecided after so many steps raise NumericalError, for to leave them
    out, or to count them as anything, would bias the estimate. The sums after: samples, steps of
    all paths, the longest path.
    """

    model: BoundModel
    question: Question
    generator: np.random.Generator
    reward: Reward | None = None
    labels: Mapping[str, Expression] = field(default_factory=dict)
    max_steps: int = 10_000
    fix_deadlocks: bool = True
    max_branches: int = MAX_BRANCHES
    samples: int = 0
    steps: int = 0
    longest: int = 0

    def __post_init__(self) -> None:
        labels = {**self.model.labels, **self.labels}
        layout = Layout.of(self.model.variables)
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
                f"-sim samples paths from one initial state, and this model has {len(self._initial)}; "
                "init … endinit can be narrowed to one, and without -sim the result is the range over all of them"
            )

    def sample(self, count: int) -> Floats:
        """The values on so many new paths, in the order of the paths: float64[count]; infinite
        where nothing is reached.

        Raises NumericalError for paths longer than `max_steps`, ModelFault where the model breaks a
        rule on the way.
        """
        parts = [self._batch(min(_BATCH, count - begin)) for begin in range(0, count, _BATCH)]
        self.samples += count
        return np.concatenate(parts) if parts else np.empty(0)

    def _batch(self, count: int) -> Floats:
        values = np.empty(count)
        alive: Int64s = np.arange(count)
        ids = np.repeat(self._chain.add(self._initial), count)
        time, total = np.zeros(count), np.zeros(count)
        step, look_ahead, goal = 0, _FIRST_LOOK_AHEAD, self.question.goal
        while True:
            ids = self._chain.expand(ids)
            leave = time + self._durations(ids)
            decided, results = self.question.look(self._chain, Paths(step, ids, time, leave, total))
            if goal is not None:
                missed = (goal.lost if step == look_ahead else goal.trapped)(
                    self._chain, ids
                ) & ~decided
                results, decided = np.where(missed, goal.missed, results), decided | missed
                look_ahead *= 1 + (step == look_ahead)
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
        """Branches to take; what is earned in the states that are left is added to `total`."""
        total += self._chain.reward(ids) * duration
        return self._chain.sample(ids, self.generator.random(len(ids)))

    def _durations(self, ids: Int32s) -> Floats:
        if not self._chain.continuous:
            return np.ones(len(ids))
        return self.generator.standard_exponential(len(ids)) / self._chain.rate(ids)

    def _too_long(self, undecided: int, count: int) -> NumericalError:
        return NumericalError(
            f"{undecided} of {count} sampled paths are undecided after {self.max_steps} steps, and an estimate without them would "
            "be biased: -simpathlen allows longer paths, a bound (such as F<=k) ends them, and without -sim nothing is sampled"
        )
