"""Exploration in rational arithmetic, state by state, by the interpreter of the semantics.

It shares no code with the search of the compiled exploration or with diagrams, so that it is their
oracle in tests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from symcheck.errors import (
    Interrupted,
    MemoryLimitError,
    ModelFault,
    ResourceError,
    UnsupportedError,
)
from symcheck.explicit import tuning
from symcheck.explicit.explored import RACE
from symcheck.explicit.initial import initial_states
from symcheck.explicit.unbounded import growth
from symcheck.lazy_dataclass import dataclass
from symcheck.machine import available_memory, used_data
from symcheck.matrices.numbers import Numbers, Rationals, rationals
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix
from symcheck.semantics import state_faults
from symcheck.semantics.interpreter import (
    Row,
    State,
    state_rewards,
    transitions,
    value,
)
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.explicit.orbits import StateOrbits
    from symcheck.explicit.states import StateTable

_STATES_BETWEEN_CHECKS = 1024
"""States that are explored between two checks of the memory."""

__all__ = ["RationalModel", "StateList", "explore_exactly"]


@dataclass(frozen=True, eq=False)
class StateList:
    """States as tuples of values, by number (see `symcheck.engines.explicit.engine.States`)."""

    states: Sequence[State] = field(repr=False)

    def __len__(self) -> int:
        return len(self.states)

    def __iter__(self) -> Iterator[State]:
        return iter(self.states)

    def column(self, variable: int) -> Int64s:
        """Values of a variable (by index); of a bool, 0 and 1."""
        return np.array([int(s[variable]) for s in self.states], np.int64)

    def take(self, indices: Int64s | Int32s) -> StateList:
        """Some of the states."""
        return StateList(tuple(self.valuations(indices)))

    def valuations(self, indices: Int64s | Int32s) -> Iterator[State]:
        """The values of the variables in some states."""
        return (self.states[i] for i in indices.tolist())


@dataclass(frozen=True, eq=False)
class RationalModel:
    """A model explored in rational arithmetic; fields as in `symcheck.explicit.model`."""

    model: BoundModel = field(repr=False)
    states: StateList | StateTable
    matrix: SparseMatrix = field(repr=False)
    choice_actions: Int32s = field(repr=False)
    initial: Int64s
    deadlocks: Int64s
    state_rewards: Sequence[Rationals] = field(repr=False)
    choice_rewards: Sequence[Rationals] = field(repr=False)

    def evaluate(self, expression: Expression) -> Numbers:
        """The value of an expression over the variables in each state, as objects."""
        values = [value(self.model, s, expression) for s in self.states]
        out = np.empty(len(values), dtype=object)
        out[:] = values
        return out


def explore_exactly(
    model: BoundModel,
    *,
    fix_deadlocks: bool = True,
    check_sums: bool = True,
    limit: int | None = None,
    max_memory: int | None = None,
    observer: Callable[[int], None] | None = None,
    orbits: StateOrbits | None = None,
) -> RationalModel:
    """Explore all reachable states, about 10 000 a second.

    Args:
        model: a model that was bound with `exact`.
        fix_deadlocks: give deadlock states a self-loop; else a deadlock is an error.
        check_sums: check that probabilities sum to 1.
        limit: the greatest number of states; None for any number.
        max_memory: bytes that the states may take; None: most of what is available.
        observer: is told the number of explored states now and then.
        orbits: if given, one state of each is explored.

    Raises:
        ModelFault: the model has a fault in some state.
        UnsupportedError: the model has more states than `limit`.
        MemoryLimitError, Interrupted: a limit is reached, or Ctrl-C.
    """
    initial: Sequence[State] = initial_states(model)
    if orbits is not None:
        initial = sorted({orbits.representative(state) for state in initial})
    explored: dict[State, tuple[Row, ...]] = {}
    frontier = list(dict.fromkeys(initial))
    seen = set(frontier)
    growing = _Growing(model, max_memory)
    try:
        while frontier:
            following: list[State] = []
            growing.note(frontier)
            for state in frontier:
                if not len(explored) % _STATES_BETWEEN_CHECKS:
                    growing.check_memory(len(explored))
                rows = transitions(model, state, check_sums=check_sums)
                if orbits is not None:
                    rows = tuple(_up_to_symmetry(row, orbits) for row in rows)
                explored[state] = rows
                for row in rows:
                    fresh = [t for _, t in row.branches if t not in seen]
                    seen.update(fresh)
                    following.extend(dict.fromkeys(fresh))
            if limit is not None and len(seen) > limit:
                raise UnsupportedError(f"exact arithmetic is limited to {limit:,} states here")
            if observer is not None:
                observer(len(explored))
            frontier = following
    except KeyboardInterrupt:
        raise growing.stopped(Interrupted, "interrupted", len(explored)) from None
    except MemoryError:
        count = len(explored)
        explored.clear()
        seen.clear()
        raise growing.stopped(MemoryLimitError, "out of memory", count) from None
    return _assemble(model, explored, initial, fix_deadlocks)


class _Growing:
    """The memory that a search takes, and what variables without bounds have reached."""

    def __init__(self, model: BoundModel, max_memory: int | None) -> None:
        self._model = model
        self._first = used_data()
        self._most = max_memory or tuning.MEMORY_SHARE * available_memory()
        self._reached: dict[int, tuple[int, int]] = {}
        self._unbounded = [i for i, v in enumerate(model.variables) if v.low is None]

    def note(self, frontier: Sequence[State]) -> None:
        """Take note of new states."""
        for i in self._unbounded:
            values = [int(state[i]) for state in frontier]
            low, high = self._reached.get(i, (values[0], values[0]))
            self._reached[i] = min(low, *values), max(high, *values)

    def check_memory(self, explored: int) -> None:
        """Raises MemoryLimitError if the search has taken more than it may."""
        if used_data() - self._first <= self._most:
            return
        why = f"the memory limit of {self._most / 1e6:.0f} MB is reached"
        raise self.stopped(MemoryLimitError, why, explored)

    def stopped(self, kind: type[ResourceError], why: str, explored: int) -> ResourceError:
        """The error of a search that was stopped."""
        grows = growth(self._model, self._reached)
        message = f"exploration in rational arithmetic: {why}, after {explored} states"
        if grows:
            return kind(message, hint=grows.hint, note=grows.note)
        if kind is MemoryLimitError:
            return kind(message, hint="-cuddmaxmem gives more; the other engines need less")
        return kind(message)


def _up_to_symmetry(row: Row, orbits: StateOrbits) -> Row:
    """A row whose branches lead to representatives, each once."""
    sums: dict[State, Fraction | float] = {}
    for probability, target in row.branches:
        state = orbits.representative(target)
        sums[state] = sums.get(state, 0) + probability
    return replace(row, branches=tuple((p, state) for state, p in sums.items()))


def _assemble(
    model: BoundModel,
    explored: dict[State, tuple[Row, ...]],
    initial: Sequence[State],
    fix_deadlocks: bool,
) -> RationalModel:
    table = tuple(sorted(explored))
    index = {s: i for i, s in enumerate(table)}
    deadlocks = [index[s] for s in table if not explored[s]]
    if deadlocks and not fix_deadlocks:
        examples = [state_faults.describe_state(model.variables, table[i]) for i in deadlocks[:3]]
        raise ModelFault(state_faults.deadlocks(examples, len(deadlocks)))
    indptr, groups = [0], [0]
    columns: list[int] = []
    values: list[Fraction | float] = []
    actions: list[int] = []
    number = {name: i for i, name in enumerate(model.actions)}
    per_row: list[list[Fraction | float]] = [[] for _ in model.rewards]
    loop = RACE if model.type.immediate_choices else -1
    for state in table:
        rows = [
            (
                sorted((index[t], p) for p, t in r.branches),
                r.rewards,
                RACE if r.is_race else number.get(r.action or "", -1),
            )
            for r in explored[state]
        ]
        for branches, rewards, action in rows or [
            ([(index[state], Fraction(1))], (0,) * len(model.rewards), loop)
        ]:
            actions.append(action)
            columns.extend(c for c, _ in branches)
            values.extend(p for _, p in branches)
            indptr.append(len(columns))
            for structure, reward in zip(per_row, rewards, strict=True):
                structure.append(reward)
        groups.append(len(indptr) - 1)
    matrix = SparseMatrix(
        np.array(indptr, np.int64),
        np.array(columns, np.int32),
        rationals(values),
        len(table),
        np.array(groups, np.int64) if model.type.has_choices else None,
    )
    per_state = [state_rewards(model, s) for s in table]
    return RationalModel(
        model,
        StateList(table),
        matrix,
        np.array(actions, np.int32),
        np.array(sorted(index[s] for s in initial), np.int64),
        np.array(deadlocks, np.int64),
        [rationals(rewards[i] for rewards in per_state) for i in range(len(model.rewards))],
        [rationals(rewards) for rewards in per_row],
    )
