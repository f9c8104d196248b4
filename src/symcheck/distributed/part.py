"""The states of one worker: exploration, backward search and iteration on their rows.

A part numbers its states, and the states of other parts that its rows lead to (its ghosts). The
owner of a ghost keeps the list of the ghosts of each other part in their order there. So parts
exchange values without numbers: an array for each pair of parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from symcheck.direction import Direction
from symcheck.distributed import tuning
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.successors import Choices, SuccessorGenerator
from symcheck.kernels.explore.breadth_first import StateSet
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, spans
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.semantics.state_faults import describe_state
from symcheck.simulate.state_predicates import compile_predicate
from symcheck.syntax.ast import Expression, ModelType

D = TypeVar("D", np.int64, np.float64)

__all__ = ["Counts", "Part", "owners"]

Messages = list[NDArray[np.generic]]
"""An array for each part."""


class Counts(NamedTuple):
    """Sizes of a part."""

    states: int
    transitions: int
    ghosts: int
    deadlocks: int


def owners(rows: Rows, parts: int) -> Int64s:
    """The part that each packed state belongs to, by a hash: int64[n]."""
    mixed = np.full(len(rows), 0xD1B54A32D192ED03, np.uint64)
    for word in rows.T:
        mixed = (mixed ^ word) * np.uint64(0x94D049BB133111EB)
        mixed ^= mixed >> np.uint64(31)
    mixed *= np.uint64(0xBF58476D1CE4E5B9)
    return ((mixed >> np.uint64(32)) % np.uint64(parts)).astype(np.int64)


class Part:
    """The part of a model that one worker holds.

    Args:
        model: a DTMC, CTMC or MDP with commands.
        number: of this part, from 0.
        parts: number of parts.
    """

    def __init__(self, model: BoundModel, number: int, parts: int) -> None:
        self._model, self._number, self._parts = model, number, parts
        self._layout = StateLayout.of(model.variables)
        self._generator = SuccessorGenerator(model, self._layout)
        self._states = StateSet(self._layout.words)
        self._ghosts = [StateSet(self._layout.words) for _ in range(parts)]
        self._exports: list[list[Int32s]] = [[] for _ in range(parts)]
        self._explored = 0
        self._targets: list[Int64s] = []
        self._weights: list[Floats] = []
        self._lengths: list[Int64s] = []
        self._choices: list[Int64s] = []
        self._dead: list[Int64s] = []
        initial = initial_rows(model, self._layout)
        self._initial = np.empty(int((owners(initial, parts) == number).sum()), np.int32)
        self._add(self._states, initial[owners(initial, parts) == number], self._initial)

    # ------------------------------------------------------------------------- exploration

    def expand(self) -> Messages:
        """Expand known states, and those that they lead to here; the new ghosts of each part."""
        known = [len(ghosts) for ghosts in self._ghosts]
        end = self._explored + tuning.ROUND_STATES
        while self._explored < min(len(self._states), end):
            self._expand_batch()
        return [
            ghosts.view_rows()[before:].copy()
            for ghosts, before in zip(self._ghosts, known, strict=True)
        ]

    def _expand_batch(self) -> None:
        rows = self._states.view_rows()[self._explored :][: tuning.BATCH_STATES].copy()
        found = self._generator.choices(rows)
        lengths = np.diff(found.branch_ends, prepend=0)
        choices = np.diff(found.ends, prepend=0)
        targets = np.empty(len(found.targets), np.int64)
        owner = owners(found.targets, self._parts)
        for p in range(self._parts):
            here = np.flatnonzero(owner == p)
            ids = np.empty(len(here), np.int32)
            table = self._states if p == self._number else self._ghosts[p]
            self._add(table, found.targets[here], ids)
            targets[here] = ids.astype(np.int64) * self._parts + p
        self._targets.append(targets)
        self._weights.append(self._row_weights(found, choices, lengths))
        self._lengths.append(lengths if self._is_mdp else _sums(lengths, found.ends))
        self._choices.append(choices)
        self._dead.append(found.deadlocks + self._explored)
        self._explored += len(rows)

    @property
    def _is_mdp(self) -> bool:
        return self._model.type is ModelType.MDP

    def _row_weights(self, found: Choices, choices: Int64s, lengths: Int64s) -> Floats:
        """Probabilities within the rows: choices of an MDP, else states."""
        if self._is_mdp:
            return found.weights
        branches = _sums(lengths, found.ends)
        if self._model.type is ModelType.DTMC:
            return np.asarray(found.weights / np.repeat(choices, branches))
        ends = np.cumsum(branches)
        return np.asarray(found.weights / np.repeat(_sums(found.weights, ends), branches))

    @staticmethod
    def _add(table: StateSet, rows: Rows, ids: Int32s) -> None:
        table.add(np.ascontiguousarray(rows), ids)

    def receive(self, incoming: Sequence[Rows]) -> int:
        """Number the ghosts of the other parts; the number of states that are not expanded."""
        for part, rows in enumerate(incoming):
            ids = np.empty(len(rows), np.int32)
            self._add(self._states, rows, ids)
            self._exports[part].append(ids)
        return len(self._states) - self._explored

    def finish(self) -> Counts:
        """End the exploration: the rows are compressed, with ghosts as the last columns."""
        n = len(self._states)
        sizes = [len(ghosts) for ghosts in self._ghosts]
        self._starts = np.cumsum([n, *sizes])
        targets = np.concatenate([np.empty(0, np.int64), *self._targets])
        part, local = targets % self._parts, targets // self._parts
        columns = np.where(part == self._number, local, self._starts[part] + local)
        lengths = np.concatenate([np.zeros(1, np.int64), *self._lengths])
        data = np.concatenate([np.empty(0), *self._weights])
        shape = len(lengths) - 1, int(self._starts[-1])
        self._matrix = csr_array((data, columns, np.cumsum(lengths)), shape)
        self._matrix.sum_duplicates()
        choices = np.concatenate([np.zeros(1, np.int64), *self._choices])
        self._groups = np.cumsum(choices) if self._is_mdp else np.arange(n + 1)
        self._state_of = np.repeat(np.arange(n), np.diff(self._groups))
        self._by_column = self._matrix.tocsc()
        self._sent = [np.concatenate([np.empty(0, np.int32), *ids]) for ids in self._exports]
        self._sets: dict[str, Bools] = {}
        dead = np.concatenate([np.empty(0, np.int64), *self._dead])
        self._deadlocks = np.isin(np.arange(n), dead)
        self._rows = self._states.view_rows().copy()
        del self._targets, self._weights, self._lengths, self._choices, self._dead
        del self._states, self._ghosts, self._exports
        return Counts(n, self._matrix.nnz, sum(sizes), len(dead))

    def deadlock_examples(self) -> list[str]:
        """The first deadlock states of this part, as texts."""
        rows = self._rows[np.flatnonzero(self._deadlocks)[:3]]
        return [describe_state(self._model.variables, self._layout.unpack(row)) for row in rows]

    # ------------------------------------------------------------------------------- sets

    def evaluate(self, name: str, formula: Expression, labels: Mapping[str, Expression]) -> None:
        """Keep the states that satisfy a state formula as a set with this name."""
        holds = compile_predicate(formula, self._model, self._layout, labels)
        self._sets[name] = np.asarray(holds(self._rows, self._deadlocks), np.bool_)

    def combine(self, name: str, included: str, excluded: str) -> None:
        """Keep the states of one set that are not in another."""
        self._sets[name] = self._sets[included] & ~self._sets[excluded]

    def complement(self, name: str, excluded: str) -> None:
        """Keep the states that are not in a set."""
        self._sets[name] = ~self._sets[excluded]

    def begin_search(self, source: str, through: str, every_choice: bool) -> Messages:
        """Begin a backward search from a set, over states of another.

        every_choice: a state is reached if all of its choices may lead to reached states.
        """
        self._reached = np.zeros(int(self._starts[-1]), np.bool_)
        self._reached[: len(self._rows)] = self._sets[source]
        self._hit = np.zeros(self._matrix.shape[0], np.bool_)
        self._misses = np.diff(self._groups) if every_choice else None
        self._through = self._sets[through]
        self._search(np.flatnonzero(self._reached))
        return self._outgoing(self._reached)

    def continue_search(self, incoming: Messages) -> tuple[bool, Messages]:
        """Go on from the ghosts that are reached; whether there are new ones, and messages."""
        before = self._reached[len(self._rows) :].copy()
        self._incoming(self._reached, incoming)
        new = np.flatnonzero(self._reached[len(self._rows) :] & ~before)
        self._search(new + len(self._rows))
        return bool(len(new)), self._outgoing(self._reached)

    def _search(self, new: Int64s) -> None:
        starts = self._by_column.indptr
        while len(new):
            entries = spans(starts[new].astype(np.int64), starts[new + 1].astype(np.int64))
            rows = np.unique(self._by_column.indices[entries])
            rows = rows[~self._hit[rows]]
            self._hit[rows] = True
            states = self._state_of[rows]
            if self._misses is not None:
                np.subtract.at(self._misses, states, 1)
                states = states[self._misses[states] == 0]
            states = np.unique(states)
            new = states[self._through[states] & ~self._reached[states]]
            self._reached[new] = True

    def end_search(self, name: str) -> None:
        """Keep the reached states as a set."""
        self._sets[name] = self._reached[: len(self._rows)].copy()

    # ---------------------------------------------------------------------------- iteration

    def begin_iteration(
        self, known: str, zero: str, direction: Direction | None, reward: Reward | None
    ) -> Messages:
        """Begin with the least values: 1 (for a reward, 0) on `known`, and 0 elsewhere.

        The unknowns are the states outside of `known` and `zero`.
        """
        n = len(self._rows)
        self._unknown = np.flatnonzero(~(self._sets[known] | self._sets[zero]))
        rows = spans(self._groups[self._unknown], self._groups[self._unknown + 1])
        self._equations = self._matrix[rows]
        sizes = np.diff(self._groups)[self._unknown]
        self._first = np.cumsum(sizes) - sizes
        self._direction = direction
        self._constant = np.zeros(len(rows)) if reward is None else self._rewards(reward)[rows]
        self._cap = 1.0 if reward is None else np.inf
        # Each row is a sum of products; the numbers of the row are rounded as well.
        most = int(np.diff(self._equations.indptr).max(initial=0))
        self._slack = (most + 6) * float(np.finfo(np.float64).eps)
        self._lower = np.zeros(int(self._starts[-1]))
        if reward is None:
            self._lower[:n] = self._sets[known]
        return self._outgoing(self._lower)

    def _rewards(self, reward: Reward) -> Floats:
        """The expected reward of a step, for each row."""
        generator = SuccessorGenerator(self._model, self._layout, reward)
        found = []
        for begin in range(0, len(self._rows), tuning.BATCH_STATES):
            rows = self._rows[begin : begin + tuning.BATCH_STATES]
            batch, of_states = generator.choices(rows), generator.state_rewards(rows)
            choices = np.diff(batch.ends, prepend=0)
            if self._is_mdp:
                found.append(batch.rewards + np.repeat(of_states, choices))
                continue
            share = 1 / np.repeat(choices, choices)
            if self._model.type is ModelType.CTMC:
                rates = _sums(batch.weights, batch.branch_ends)
                exits = _sums(rates, batch.ends)
                share, of_states = rates / np.repeat(exits, choices), of_states / exits
            found.append(_sums(batch.rewards * share, batch.ends) + of_states)
        return np.concatenate([np.empty(0), *found])

    def _bellman(self, values: Floats) -> Floats:
        """The best value of a step from each unknown."""
        found = np.asarray(self._equations @ values) + self._constant
        if self._direction is None or not len(found):
            return found
        best = np.minimum if self._direction is Direction.MIN else np.maximum
        return np.asarray(best.reduceat(found, self._first))

    def improve(self, incoming: Messages) -> tuple[float, Messages]:
        """Raise the lower bounds by some sweeps: the greatest relative change, and messages."""
        self._incoming(self._lower, incoming)
        old = self._lower[self._unknown]
        new = old
        for _ in range(tuning.SWEEPS_PER_ROUND):
            new = np.maximum(new, self._bellman(self._lower) * (1 - self._slack))
            self._lower[self._unknown] = new
        raised = new > old
        change = ((new[raised] - old[raised]) / new[raised]).max(initial=0.0)
        return float(change), self._outgoing(self._lower)

    def begin_verification(self, width: float) -> Messages:
        """Guess upper bounds: the lower ones, greater by a relative width."""
        self._upper = self._lower.copy()
        raised = self._upper[self._unknown] * (1 + width)
        self._upper[self._unknown] = np.minimum(raised, self._cap)
        return self._outgoing(self._upper)

    def verify(self, incoming: Messages) -> tuple[bool, bool, Messages]:
        """Whether the guess is inductive here, whether sweeps lower it, and messages.

        It is lowered where they do, which keeps an inductive guess inductive.
        """
        self._incoming(self._upper, incoming)
        inductive, begin = True, self._upper[self._unknown]
        for sweep in range(tuning.SWEEPS_PER_ROUND):
            old = self._upper[self._unknown]
            new = np.minimum(self._bellman(self._upper) * (1 + self._slack), self._cap)
            if sweep == 0:
                inductive = bool((new <= old).all())
            self._upper[self._unknown] = np.minimum(old, new)
        lowered = bool((self._upper[self._unknown] < begin).any())
        return inductive, lowered, self._outgoing(self._upper)

    def step(self, incoming: Messages) -> Messages:
        """One step of a bounded until formula, in place of the values."""
        self._incoming(self._lower, incoming)
        self._lower[self._unknown] = self._bellman(self._lower)
        return self._outgoing(self._lower)

    def slack(self) -> float:
        """The relative error of a step by rounding."""
        return self._slack

    def initial(self, upper: bool) -> Floats:
        """The lower or upper values of the initial states of this part."""
        return np.asarray((self._upper if upper else self._lower)[self._initial])

    def members(self, name: str) -> tuple[int, int]:
        """How many initial states of this part are in a set, and how many states."""
        members = self._sets[name]
        return int(members[self._initial].sum()), int(members.sum())

    # ----------------------------------------------------------------------------- messages

    def _outgoing(self, values: NDArray[np.generic]) -> Messages:
        return [values[ids] for ids in self._sent]

    def _incoming(self, values: NDArray[np.generic], messages: Messages) -> None:
        for part, received in enumerate(messages):
            values[self._starts[part] : self._starts[part + 1]] = received


def _sums(values: NDArray[D], ends: Int64s) -> NDArray[D]:
    """The sum of each segment; none is empty."""
    return np.asarray(np.add.reduceat(values, ends - np.diff(ends, prepend=0)), values.dtype)
