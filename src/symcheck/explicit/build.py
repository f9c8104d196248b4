"""Explicit exploration: from a bound model to states and a sparse matrix, without diagrams.

The search itself runs in compiled code (`symcheck.kernels.explore.breadth_first`), some tens of
milliseconds at a time; between these slices the limits are looked at, the observer is told, and
Ctrl-C is heard.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np

from symcheck.errors import (
    SMALLER_ENGINES,
    Interrupted,
    MemoryLimitError,
    ModelFault,
    ResourceError,
    TimeLimitError,
    UnsupportedError,
    converts_memory_error,
)
from symcheck.explicit.faults import raise_model_fault
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.model import ExplicitModel, evaluate_states
from symcheck.explicit.states import Layout, Rows, StateTable
from symcheck.explicit.tables import Assignments, tables, total_reward
from symcheck.kernels.explore.breadth_first import Explorer, Outcome, give_back
from symcheck.kernels.explore.packed_states import order_rows
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.semantics import state_faults
from symcheck.semantics.model import BoundModel
from symcheck.semantics.settings import BuildSettings
from symcheck.syntax.ast import ModelType

__all__ = ["Exploration", "Observer", "Progress", "explore"]

_SLICE = 0.05  # seconds of search between looks at limits and signals
_EXAMPLES = 3
_LARGE = 500_000  # states after whose search freed memory is given back to the system
_NO_BUDGET = 1 << 62
_LESS_MEMORY = f"-cuddmaxmem gives more; {SMALLER_ENGINES}"


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a search is. `level`: breadth-first distance of the states being explored; memory in
    bytes.
    """

    states: int
    explored: int
    choices: int
    transitions: int
    level: int
    memory: int
    seconds: float

    @property
    def frontier(self) -> int:
        """States that are known and not yet explored."""
        return self.states - self.explored

    def __str__(self) -> str:
        rate = self.explored / self.seconds / 1e6 if self.seconds > 0 else 0.0
        return (
            f"{self.states} states, {self.transitions} transitions, {self.frontier} to explore, level {self.level}, "
            f"{self.memory / 1e6:.0f} MB, {self.seconds:.1f} s ({rate:.2f} M states/s)"
        )


Observer = Callable[[Progress], None]


@dataclass(eq=False)
class Exploration:
    """A search that can be stopped, looked at and resumed: `run`, then `finish`.

    `seed`: packed states (`layout`) known to be reachable, to begin with besides the initial ones.
    `canonical`: see `explore`. The states so far are `rows()`, in the order of discovery: the first
    `progress.explored` of them have been explored, the rest is the frontier.
    """

    model: BoundModel
    options: BuildSettings
    seed: Rows | None = None
    canonical: Assignments = ()
    layout: Layout = field(init=False)
    _explorer: Explorer = field(init=False, repr=False)
    _seconds: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        if self.model.type not in (ModelType.DTMC, ModelType.CTMC, ModelType.MDP):
            raise UnsupportedError(
                f"explicit exploration of a model of type {self.model.type.value}"
            )
        started = time.perf_counter()
        self.layout = Layout.of(self.model.variables)
        self._initial = initial_rows(self.model, self.layout)
        compiled = tables(
            self.model, self.layout, check_sums=self.options.check_sums, canonical=self.canonical
        )
        self._explorer = Explorer(compiled)
        self._explorer.add(self._initial)
        if self.seed is not None:
            self._explorer.add(np.ascontiguousarray(self.seed, np.uint64))
        self._seconds = time.perf_counter() - started

    def __repr__(self) -> str:
        return f"Exploration({self.progress})"

    @property
    def progress(self) -> Progress:
        """How far the search is."""
        e = self._explorer
        return Progress(
            len(e.states),
            e.explored,
            e.rows.closed,
            e.rows.entries,
            e.level,
            e.nbytes,
            self._seconds,
        )

    @property
    def complete(self) -> bool:
        """Whether nothing is left to explore."""
        return self._explorer.explored == len(self._explorer.states)

    def rows(self) -> Rows:
        """All states known so far, packed, in the order of discovery: uint64[states, words]."""
        rows = np.empty((len(self._explorer.states), self.layout.words), np.uint64)
        self._explorer.states.copy_rows(rows)
        return rows

    def run(self, state_budget: int | None = None, observer: Observer | None = None) -> bool:
        """Explore until nothing is left, or `state_budget` states are known; whether nothing is
        left.

        Raises ModelFault where the model breaks a rule, and TimeLimitError, MemoryLimitError or
        Interrupted, after which the states so far are still here and `run` can go on.
        """
        try:
            while not self._step(_NO_BUDGET if state_budget is None else state_budget):
                if observer is not None:
                    observer(self.progress)
                self._check_limits()
        except KeyboardInterrupt:
            self._stop(Interrupted, "interrupted")
        if observer is not None:
            observer(self.progress)
        return self.complete

    def _step(self, budget: int) -> bool:
        """Search for a while; whether the search ended, complete or at the budget."""
        started = time.perf_counter()
        outcome = self._explorer.run(budget, self._slice())
        self._seconds += time.perf_counter() - started
        match outcome:
            case Outcome.PAUSED:
                return False
            case Outcome.FAULT:
                self._fault()
            case Outcome.NO_MEMORY:
                self._stop(MemoryLimitError, "out of memory", SMALLER_ENGINES)
            case Outcome.TOO_MANY:
                self._stop(MemoryLimitError, "more than 2**31 - 1 states", SMALLER_ENGINES)
        return True

    def _slice(self) -> float:
        limit = self.options.time_limit
        return _SLICE if limit is None else max(0.0, min(_SLICE, limit - self._seconds))

    def _check_limits(self) -> None:
        limit, memory = self.options.time_limit, self.options.max_memory
        if limit is not None and self._seconds >= limit:
            self._stop(TimeLimitError, f"the time limit of {limit:g} s is reached")
        if memory is not None and self._explorer.nbytes > memory:
            self._stop(
                MemoryLimitError,
                f"the memory limit of {memory / 1e6:.0f} MB is reached",
                _LESS_MEMORY,
            )

    def _stop(self, error: type[ResourceError], why: str, hint: str | None = None) -> NoReturn:
        raise error(
            f"explicit exploration: {why}, after {self.progress}"
            + (f"\n  hint: {hint}" if hint else "")
        )

    def _fault(self) -> NoReturn:
        """Raise the fault of the state in which the search stopped."""
        e = self._explorer
        state = self.layout.unpack(self.rows()[e.fault_state])
        raise_model_fault(self.model, state, e.fault_status, check_sums=self.options.check_sums)

    def finish(self) -> ExplicitModel:
        """The model, once `run` is complete. Only once: the search gives its memory back."""
        if not self.complete:
            raise ValueError("the search is not complete")
        started = time.perf_counter()
        e, words = self._explorer, self.layout.words
        n = len(e.states)
        e.states.drop_table()
        order, rank = np.empty(n, np.int32), np.empty(n, np.int32)
        # Not copied: this is where the memory of a large model is at its peak.
        order_rows(e.states.view_rows(), order, rank)
        states = StateTable(self.layout, e.states.view_rows()[order].reshape(-1, words))
        e.states.drop_rows()
        deadlocks = np.empty(e.deadlock_count, np.int64)
        e.copy_deadlocks(deadlocks)
        deadlocks = np.sort(rank[deadlocks].astype(np.int64))
        self._check_deadlocks(states, deadlocks)
        matrix, actions, choice_rewards = self._matrix(order, rank)
        initial = states.find(self._initial).astype(np.int64)
        levels = e.level + 1
        state_rewards = self._state_rewards(states)
        if n > _LARGE:
            give_back()
        self._seconds += time.perf_counter() - started
        # Not np.unique, which imports numpy.ma: a tenth of the time that a small model takes.
        ordered = np.sort(initial)
        distinct = ordered[np.append(True, ordered[1:] != ordered[:-1])[: ordered.size]]
        return ExplicitModel(
            self.model,
            states,
            matrix,
            actions,
            distinct,
            deadlocks,
            state_rewards,
            choice_rewards,
            levels,
            self._seconds,
        )

    def _check_deadlocks(self, states: StateTable, deadlocks: Int64s) -> None:
        if len(deadlocks) and not self.options.fix_deadlocks:
            examples = [
                state_faults.describe_state(self.model.variables, states.row(int(i)))
                for i in deadlocks[:_EXAMPLES]
            ]
            raise ModelFault(state_faults.deadlocks(examples, len(deadlocks)))

    def _matrix(self, order: Int32s, rank: Int32s) -> tuple[SparseMatrix, Int32s, list[Floats]]:
        n, found = len(order), self._explorer.rows
        groups = np.empty(n + 1, np.int64) if self.model.type is ModelType.MDP else None
        indptr, indices, data = (
            np.empty(found.closed + 1, np.int64),
            np.empty(found.entries, np.int32),
            np.empty(found.entries),
        )
        actions = np.empty(found.closed, np.int32)
        having = [any(not i.on_states for i in r.items) for r in self.model.rewards]
        rewards = [np.empty(found.closed) if h else np.zeros(found.closed) for h in having]
        found.build(
            order,
            rank,
            indptr,
            indices,
            data,
            groups,
            actions,
            [r for r, h in zip(rewards, having, strict=True) if h],
        )
        return SparseMatrix(indptr, indices, data, n, groups), actions, rewards

    def _state_rewards(self, states: StateTable) -> list[Floats]:
        found = []
        for structure in self.model.rewards:
            items = [i for i in structure.items if i.on_states]
            values = (
                evaluate_states(self.model, states, total_reward(items))
                if items
                else np.zeros(len(states))
            )
            if not np.isfinite(values).all():
                self._reward_fault(states, int(np.flatnonzero(~np.isfinite(values))[0]))
            found.append(values)
        return found

    def _reward_fault(self, states: StateTable, state: int) -> NoReturn:
        from symcheck.semantics.interpreter import state_rewards

        state_rewards(self.model, states.row(state))
        raise AssertionError(
            "a state reward that is not finite, where the scalar semantics finds no fault"
        )


@converts_memory_error()
def explore(
    model: BoundModel,
    options: BuildSettings,
    observer: Observer | None = None,
    seed: Rows | None = None,
    *,
    canonical: Assignments = (),
) -> ExplicitModel:
    """All reachable states and transitions of a model, breadth first.

    observer: called with the progress every 50 ms or so. seed: packed states that another search
    has reached already. canonical: pairs (variable index, expression over the variables) by which
    every successor is changed before it is looked up; for reductions that identify states. Limits:
    `options.time_limit` (seconds), `options.max_memory` (bytes of the search's own arrays).
    Accuracy: probabilities as floating point gives them. Raises ModelFault where the model breaks a
    rule, TimeLimitError, MemoryLimitError, Interrupted.
    """
    exploration = Exploration(model, options, seed, canonical)
    exploration.run(None, observer)
    return exploration.finish()
