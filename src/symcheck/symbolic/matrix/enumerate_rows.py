"""The rows of a Markov chain, enumerated state by state from the diagrams of its commands, without
a matrix diagram.

Where the states do not compress, a matrix diagram is larger than the rows and takes long to build.
Guards, probabilities and assignments are still small diagrams over few bits each. They are
evaluated on the bits of every reachable state, which the ODD enumerates, and the ODD gives the
numbers of the successors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.diagrams.vectors import lookup
from symcheck.kernels.rows.sparse import merge_columns
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix, starts_of
from symcheck.symbolic import tuning
from symcheck.symbolic.model import EncodedEvent, EncodedUpdate, StateSpace
from symcheck.syntax.ast import ModelType

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

__all__ = ["enumerate_rows"]

Bits = NDArray[np.uint8]


def enumerate_rows(space: StateSpace) -> SparseMatrix | None:
    """The matrix of a DTMC or CTMC on its reachable states, numbered by `space.odd`; deadlocks have
    a loop.

    Time grows with states times bits. Besides the matrix, memory is needed for a chunk of states
    only.

    Returns:
        The matrix; None for an MDP, and where an event has too many joint updates.
    """
    model = space.symbolic.model
    if model.type is ModelType.MDP or any(
        _joint_updates(e) > tuning.MAX_JOINT_UPDATES for e in space.symbolic.events
    ):
        return None
    enumerator = _RowEnumerator(space)
    parts = [
        enumerator.chunk(start) for start in range(0, space.odd.count, tuning.STATES_PER_CHUNK)
    ]
    loops = (
        np.flatnonzero(space.odd.to_mask(space.deadlocks))
        if space.deadlocks
        else np.empty(0, np.int64)
    )
    rows, columns = (np.concatenate([*(p[i] for p in parts), loops]) for i in (0, 1))
    weights = np.concatenate([*(p[2] for p in parts), np.ones(len(loops))])
    n = space.odd.count
    order = np.argsort(rows, kind="stable")
    indptr = starts_of(np.bincount(rows, minlength=n))
    same = np.arange(n, dtype=np.int32)
    return SparseMatrix(
        *merge_columns(indptr, columns[order].astype(np.int32), weights[order], same, n), n
    )


def _joint_updates(event: EncodedEvent) -> int:
    return prod(sum(len(c.updates) for c in commands) for commands in event.participants)


@dataclass(frozen=True, eq=False)
class _Function:
    """A diagram over row bits as arrays, for evaluation on many states."""

    level: NDArray[np.int32]
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    values: Floats
    root: int
    column_of_level: NDArray[np.int32]

    def at(self, bits: Bits) -> Floats:
        out = np.empty(len(bits))
        lookup(
            (self.level, self.low, self.high, self.values, self.root),
            self.column_of_level,
            bits,
            out,
        )
        return out


@dataclass(frozen=True, eq=False)
class _JointUpdate:
    """A joint update: one update of each participant.

    Attributes:
        guards: numbers of the commands' guards.
        probability: product of the constant probabilities.
        factors: the other probabilities.
        targets: columns of some assigned bits, highest first, and the function that gives them as a
            number.
    """

    guards: tuple[int, ...]
    probability: float
    factors: tuple[_Function, ...]
    targets: tuple[tuple[NDArray[np.int64], _Function], ...]


class _RowEnumerator:
    def __init__(self, space: StateSpace) -> None:
        self.space = space
        symbolic = space.symbolic
        self.manager, self.encoding = symbolic.manager, symbolic.encoding
        self.column = {name: i for i, name in enumerate(self.encoding.rows)}
        self.column_of_level = np.zeros(
            max(map(self.manager.level_of, self.encoding.bits), default=0) + 1, np.int32
        )
        for name, i in self.column.items():
            self.column_of_level[self.manager.level_of(name)] = i
        self.counting = symbolic.model.type is ModelType.DTMC
        self.guards: list[_Function] = []
        # Per event and participant, the numbers of its commands' guards.
        self.commands: list[list[list[int]]] = []
        self.joint_updates: list[_JointUpdate] = []
        for event in symbolic.events:
            if not event.guard.disjoint(space.states):
                self._add(event)

    def _add(self, event: EncodedEvent) -> None:
        numbers, choices = [], []
        for commands in event.participants:
            first = len(self.guards)
            self.guards += [self._set(c.guard) for c in commands]
            numbers.append(list(range(first, len(self.guards))))
            choices.append(
                [(g, u) for g, c in zip(numbers[-1], commands, strict=True) for u in c.updates]
            )
        self.commands.append(numbers)
        for joint in product(*choices):
            updates = [u for _, u in joint]
            fixed = prod(u.probability for u in updates if isinstance(u.probability, float))
            factors = tuple(
                self._number(u.probability) for u in updates if not isinstance(u.probability, float)
            )
            targets = tuple(t for u in updates for t in self._targets(u))
            self.joint_updates.append(
                _JointUpdate(tuple(g for g, _ in joint), fixed, factors, targets)
            )

    def _set(self, states: Bdd) -> _Function:
        t = self.manager.export_bdd(states)
        return _Function(t.level, t.low, t.high, np.array([0.0, 1.0]), t.root, self.column_of_level)

    def _number(self, function: Mtbdd) -> _Function:
        t = self.manager.export_mtbdd(function)
        return _Function(t.level, t.low, t.high, t.values, t.root, self.column_of_level)

    def _targets(self, update: EncodedUpdate) -> Iterator[tuple[NDArray[np.int64], _Function]]:
        """The new bits of each assigned variable, a few at a time, as functions of the state."""
        for index, expression in update.update.assignments:
            variable = self.encoding.variables[index]
            relation = self.space.symbolic.translator.assignment(variable, expression).relation
            all_columns = self.manager.cube(variable.columns)
            for start in range(0, variable.width, tuning.TARGET_BITS):
                names = variable.columns[start : start + tuning.TARGET_BITS]
                code = self.manager.table(names, np.arange(1 << len(names), dtype=np.float64))
                value = relation.to_mtbdd().multiply_sum(code, all_columns)
                places = np.array(
                    [self.column[r] for r in variable.rows[start : start + tuning.TARGET_BITS]],
                    np.int64,
                )
                yield places, self._number(value)

    def chunk(self, start: int) -> tuple[Int64s, Int64s, Floats]:
        """Row, column and weight of each transition from the states of a chunk."""
        odd = self.space.odd
        bits = odd.unrank(np.arange(start, min(start + tuning.STATES_PER_CHUNK, odd.count)))
        enabled = [g.at(bits) != 0.0 for g in self.guards]
        share = self._share(enabled, len(bits))
        rows, columns, weights = [], [], []
        for joint in self.joint_updates:
            chosen = np.flatnonzero(np.logical_and.reduce([enabled[g] for g in joint.guards]))
            if len(chosen):
                weight, targets = self._apply(joint, bits[chosen], share[chosen])
                positive = weight != 0.0
                rows.append(chosen[positive] + start)
                columns.append(odd.rank(targets[positive]))
                weights.append(weight[positive])
        if not rows:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        result = np.concatenate(columns)
        assert (result >= 0).all(), "a transition leaves the reachable states"
        return np.concatenate(rows), result, np.concatenate(weights)

    def _share(self, enabled: list[NDArray[np.bool_]], n: int) -> Floats:
        """The probability of each enabled joint command: in a DTMC they are equally likely, else it
        is 1.
        """
        if not self.counting:
            return np.ones(n)
        total = np.zeros(n)
        for event in self.commands:
            total += prod(
                (sum(enabled[g].astype(np.float64) for g in commands) for commands in event),
                start=np.ones(n),
            )
        return 1.0 / np.maximum(total, 1.0)

    @staticmethod
    def _apply(joint: _JointUpdate, bits: Bits, share: Floats) -> tuple[Floats, Bits]:
        weight = share * joint.probability
        for factor in joint.factors:
            weight = weight * factor.at(bits)
        after = bits.copy()
        for places, function in joint.targets:
            code = function.at(bits).astype(np.int64)
            for shift, place in enumerate(reversed(places.tolist())):
                after[:, place] = code >> shift & 1
        return weight, after
