"""Explicit exploration: from a bound model to its reachable states and a sparse matrix, without
diagrams.

The search runs in compiled code (`symcheck.kernels.explore.breadth_first`) in slices of some tens
of milliseconds. Between slices limits and signals are checked and the observer is called.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import field
from functools import partial
from typing import TYPE_CHECKING, NoReturn, assert_never

import numpy as np

from symcheck.errors import (
    SMALLER_ENGINES,
    Interrupted,
    MemoryLimitError,
    ModelFault,
    ResourceError,
    TimeLimitError,
    converts_memory_error,
)
from symcheck.explicit import tuning
from symcheck.explicit.faults import raise_model_fault
from symcheck.explicit.file_arrays import arrays_in
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.model import ExplicitModel, evaluate_states
from symcheck.explicit.states import Rows, StateLayout, StateTable
from symcheck.explicit.tables import compile_model, total_reward
from symcheck.explicit.unbounded import ReachedValues, growth
from symcheck.kernels.explore.breadth_first import (
    CsrBuilder,
    Explorer,
    Outcome,
    StateSet,
    malloc_trim,
)
from symcheck.lazy_dataclass import dataclass
from symcheck.machine import available_memory
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix
from symcheck.options import Options
from symcheck.parallel.threads import even_shares, helpers, on_threads, thread_count, use_threads
from symcheck.semantics import state_faults
from symcheck.semantics.model import BoundModel

if TYPE_CHECKING:
    from symcheck.explicit.orbits import StateOrbits
    from symcheck.semantics.reduction.symmetry import Symmetry

__all__ = ["Exploration", "ExplorationObserver", "ExplorationProgress", "explore", "row_arrays"]

_EXAMPLES = 3  # deadlock states in a message
_NO_BUDGET = 1 << 62
_LESS_MEMORY = f"-cuddmaxmem gives more; {SMALLER_ENGINES}"


def _threads(states: int, entries: int) -> int:
    """The threads for an exploration of some size."""
    is_large = states > tuning.THREADED_STATES or entries > tuning.THREADED_ENTRIES
    return thread_count() if is_large else 1


def row_arrays(
    rows: CsrBuilder, order: Int32s, rank: Int32s, model: BoundModel
) -> tuple[SparseMatrix, Int32s, list[Floats]]:
    """The matrix of explored rows, the action of each row, and its reward in each structure.

    Args:
        rows: the rows; they release their memory.
        order: int32[n], the states in the order of the matrix. States without rows come last.
        rank: int32[n], the inverse of `order`.
        model: the model that was explored.

    Returns:
        The matrix, int32[rows], and a float64[rows] for each reward structure.
    """
    groups = np.zeros(len(order) + 1, np.int64) if model.type.has_choices else None
    indptr = np.zeros(rows.closed + 1, np.int64)
    indices, data = np.empty(rows.entries, np.int32), np.empty(rows.entries)
    actions = np.empty(rows.closed, np.int32)
    earning = [any(not item.on_states for item in r.items) for r in model.rewards]
    rewards = [np.empty(rows.closed) if e else np.zeros(rows.closed) for e in earning]
    earned = [r for r, e in zip(rewards, earning, strict=True) if e]
    count = _threads(len(order), rows.entries)
    rows.place(order, indptr, groups, actions)
    on_threads(partial(rows.renumber, rank), even_shares(rows.starts_of_rows, count))
    shares = even_shares(indptr if groups is None else indptr[groups], count)
    on_threads(partial(rows.write_columns, order, indptr, groups, indices), shares)
    rows.release_columns()
    on_threads(partial(rows.write_weights, order, indptr, groups, data), shares)
    rows.write_rewards(order, groups is not None, earned)
    return SparseMatrix(indptr, indices, data, len(order), groups), actions, rewards


@dataclass(frozen=True, slots=True)
class ExplorationProgress:
    """The progress of an exploration.

    Attributes:
        explored: states whose successors are known.
        level: breadth-first distance of the states that are being explored.
        memory: bytes of the exploration's arrays.
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
        """Number of states that are known but not yet explored."""
        return self.states - self.explored

    def __str__(self) -> str:
        rate = self.explored / self.seconds / 1e6 if self.seconds > 0 else 0.0
        return (
            f"{self.states} states, {self.transitions} transitions, {self.frontier} to explore, "
            f"level {self.level}, "
            f"{self.memory / 1e6:.0f} MB, {self.seconds:.1f} s ({rate:.2f} M states/s)"
        )


ExplorationObserver = Callable[[ExplorationProgress], None]


@dataclass(eq=False)
class Exploration:
    """A search that can be interrupted, inspected and resumed: `run`, then `finish`.

    The states so far are `rows()`, in the order of discovery; the first `progress.explored` of them
    are explored, and the others are the frontier.

    Args:
        seed: packed states (`layout`) known to be reachable, from which the search starts besides
            the initial ones.
        symmetries: of the model. If there are some, one state of each orbit is explored.
        region: the states that are expanded; None: all.
    """

    model: BoundModel
    options: Options
    seed: Rows | None = None
    symmetries: tuple[Symmetry, ...] = ()
    region: StateSet | None = None
    layout: StateLayout = field(init=False)
    orbits: StateOrbits | None = field(init=False, repr=False)
    _explorer: Explorer = field(init=False, repr=False)
    _max_memory: float = field(init=False, repr=False)
    _seconds: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        started = time.perf_counter()
        self._max_memory = (
            tuning.MEMORY_SHARE * available_memory()
            if self.options.max_memory is None
            else self.options.max_memory
        )
        if self.options.workdir is not None:  # the arrays are not in memory
            self._max_memory = math.inf
        self.layout = StateLayout.of(self.model.variables)
        self.orbits = None
        if self.symmetries:
            from symcheck.explicit.orbits import StateOrbits

            self.orbits = StateOrbits.of(self.layout, self.symmetries)
        self._initial = initial_rows(self.model, self.layout)
        if self.orbits is not None:
            self._initial = self.orbits.representatives(self._initial)
        self._explorer = Explorer(
            compile_model(self.model, self.layout, check_sums=self.options.check_sums),
            None if self.orbits is None else self.orbits.compiled,
            region=None if self.region is None else (self.region, True),
        )
        self._reached = ReachedValues(self.layout)
        self._explorer.add(self._initial)
        if self.seed is not None:
            self._explorer.add(np.ascontiguousarray(self.seed, np.uint64))
        self._seconds = time.perf_counter() - started

    def __repr__(self) -> str:
        return f"Exploration({self.progress})"

    @property
    def progress(self) -> ExplorationProgress:
        """The progress of the search."""
        e = self._explorer
        return ExplorationProgress(
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
        """Whether all known states are explored."""
        return self._explorer.explored == len(self._explorer.states)

    def rows(self) -> Rows:
        """The packed states known so far, in the order of discovery: uint64[states, words]."""
        return self._explorer.states.view_rows().copy()

    def run(
        self, state_budget: int | None = None, observer: ExplorationObserver | None = None
    ) -> bool:
        """Explore until no state is left or `state_budget` states are known; returns whether no
        state is left.

        Raises:
            ModelFault: the model breaks a rule in a reachable state.
            TimeLimitError, MemoryLimitError, Interrupted: `run` may be called again and goes on.
        """
        budget = _NO_BUDGET if state_budget is None else state_budget
        try:
            with use_threads(self.options.threads):
                while not self._step(budget):
                    if observer is not None:
                        observer(self.progress)
                    self._check_limits()
        except KeyboardInterrupt:
            self._stop(Interrupted, "interrupted")
        except MemoryError:
            self._stop(MemoryLimitError, "out of memory", SMALLER_ENGINES)
        finally:
            self._explorer.forget_blocks()
        if observer is not None:
            observer(self.progress)
        return self.complete

    def _step(self, budget: int) -> bool:
        """Search for one slice; whether the search ended, complete or at the budget."""
        started = time.perf_counter()
        count = _threads(len(self._explorer.states), self._explorer.rows.entries)
        pool = None if count == 1 else helpers()
        outcome = self._explorer.run(budget, self._slice(), pool, count)
        self._seconds += time.perf_counter() - started
        match outcome:
            case Outcome.COMPLETE | Outcome.BUDGET:
                pass
            case Outcome.PAUSED:
                return False
            case Outcome.FAULT:
                self._fault()
            case Outcome.NO_MEMORY:
                self._stop(MemoryLimitError, "out of memory", SMALLER_ENGINES)
            case Outcome.TOO_MANY:
                self._stop(MemoryLimitError, "more than 2**31 - 1 states", SMALLER_ENGINES)
            case _:
                assert_never(outcome)
        return True

    def _slice(self) -> float:
        limit = self.options.time_limit
        return (
            tuning.SECONDS_PER_SLICE
            if limit is None
            else max(0.0, min(tuning.SECONDS_PER_SLICE, limit - self._seconds))
        )

    def _check_limits(self) -> None:
        self._reached.note(self._explorer.states.view_rows())
        limit, memory = self.options.time_limit, self._max_memory
        if limit is not None and self._seconds >= limit:
            self._stop(TimeLimitError, f"the time limit of {limit:g} s is reached")
        if self._explorer.nbytes > memory:
            self._stop(
                MemoryLimitError,
                f"the memory limit of {memory / 1e6:.0f} MB is reached",
                _LESS_MEMORY,
            )

    def _stop(self, error: type[ResourceError], why: str, hint: str | None = None) -> NoReturn:
        grows = growth(self.model, self._reached.values)
        raise error(
            f"explicit exploration: {why}, after {self.progress}",
            hint=grows.hint if grows else hint,
            note=grows.note if grows else None,
        )

    def _fault(self) -> NoReturn:
        """Raise the fault of the state in which the search stopped."""
        e = self._explorer
        state = self.layout.unpack(self.rows()[e.fault_state])
        raise_model_fault(self.model, state, e.fault_status, check_sums=self.options.check_sums)

    def finish(self) -> ExplicitModel:
        """The model, after a complete `run`. It can be called once, as the search releases its
        memory.

        Raises ValueError if the search is not complete, and ModelFault for deadlocks, unless these
        are fixed, and for rewards that are not finite.
        """
        if not self.complete:
            raise ValueError("the search is not complete")
        started = time.perf_counter()
        e, words = self._explorer, self.layout.words
        n = len(e.states)
        e.states.drop_table()
        # The rows are found by levels, whose parts are in order: a stable sort is fast.
        order = np.lexsort(e.states.view_rows().T[::-1]).astype(np.int32)
        rank = np.empty(n, np.int32)
        rank[order] = np.arange(n, dtype=np.int32)
        states = StateTable(self.layout, e.states.view_rows()[order].reshape(-1, words))
        e.states.drop_rows()
        deadlocks = np.sort(rank[e.deadlocks].astype(np.int64))
        self._check_deadlocks(states, deadlocks)
        with use_threads(self.options.threads):
            matrix, actions, choice_rewards = row_arrays(e.rows, order, rank, self.model)
        initial = np.sort(rank[: len(self._initial)].astype(np.int64))  # they were found first
        represented = None
        if self.orbits is not None:
            choices = np.ones(n, np.int64) if matrix.groups is None else np.diff(matrix.groups)
            represented = self.orbits.represented(
                states.rows, initial, deadlocks, choices, self._transition_counts(order, choices)
            )
        levels = e.level + 1
        state_rewards = self._state_rewards(states)
        if n > tuning.MIN_STATES_TO_TRIM:
            malloc_trim()
        self._seconds += time.perf_counter() - started
        return ExplicitModel(
            self.model,
            states,
            matrix,
            actions,
            initial,
            deadlocks,
            state_rewards,
            choice_rewards,
            levels,
            self._seconds,
            represented,
            e.rows.longest,
            e.rows.shares,
            None if self.region is None else np.flatnonzero(~self.region.contains(states.rows)),
        )

    def _transition_counts(self, order: Int32s, choices: Int64s) -> Int64s:
        """The number of transitions of each state, before successors are represented: int64[n].

        Args:
            order: the states in the order in which they were found.
            choices: the number of choices of each state.
        """
        found = np.empty(len(order), np.int64)
        found[order] = choices
        ends = found.cumsum()
        counts = self._explorer.target_counts.astype(np.int64).cumsum()
        until = counts[ends - 1]
        found[0], found[1:] = until[0], np.diff(until)
        return found[order]

    def _check_deadlocks(self, states: StateTable, deadlocks: Int64s) -> None:
        if len(deadlocks) and not self.options.fix_deadlocks:
            examples = [
                state_faults.describe_state(self.model.variables, states.row(int(i)))
                for i in deadlocks[:_EXAMPLES]
            ]
            raise ModelFault(state_faults.deadlocks(examples, len(deadlocks)))

    def _state_rewards(self, states: StateTable) -> list[Floats]:
        result = []
        for structure in self.model.rewards:
            items = [i for i in structure.items if i.on_states]
            values = (
                evaluate_states(self.model, states, total_reward(items))
                if items
                else np.zeros(len(states))
            )
            if not np.isfinite(values).all():
                self._reward_fault(states, int(np.flatnonzero(~np.isfinite(values))[0]))
            result.append(values)
        return result

    def _reward_fault(self, states: StateTable, state: int) -> NoReturn:
        from symcheck.semantics.interpreter import state_rewards

        state_rewards(self.model, states.row(state))
        raise AssertionError(
            "a state reward that is not finite, where the scalar semantics finds no fault"
        )


@converts_memory_error()
def explore(
    model: BoundModel,
    options: Options,
    observer: ExplorationObserver | None = None,
    seed: Rows | None = None,
    symmetries: tuple[Symmetry, ...] = (),
) -> ExplicitModel:
    """The reachable states and transitions of a model, breadth first.

    Args:
        model: the model.
        options: limits of time (seconds) and memory (bytes of the search's arrays), and checks.
        observer: is called with the progress about every 50 ms.
        seed: packed states that another search has reached already.
        symmetries: of the model; if there are some, one state of each orbit is explored.

    Returns:
        The model; probabilities are floating-point numbers.

    Raises:
        ModelFault: the model breaks a rule in a reachable state.
        TimeLimitError, MemoryLimitError, Interrupted: a limit is reached, or Ctrl-C.

    Examples:
        >>> import symcheck
        >>> text = "dtmc module m x:[0..5]; [] x<3 -> (x'=x+1); endmodule"
        >>> model = symcheck.explore(symcheck.bind(symcheck.parse_model(text)), symcheck.Options())
        >>> list(model.states), model.matrix.entries
        ([(0,), (1,), (2,), (3,)], 4)
    """
    with arrays_in(options.workdir):
        exploration = Exploration(model, options, seed, symmetries)
        exploration.run(None, observer)
        return exploration.finish()
