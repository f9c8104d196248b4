"""The rows of a chain, listed state by state from the diagrams of its commands; no matrix is made as a diagram.

A matrix whose states do not compress is larger as a diagram than as rows, and takes long to make. But guards,
probabilities and assignments are small diagrams over few bits each (learned ones too): they are looked up at the bits of
every reachable state, which the ODD lists, and the ODD gives the number of the state that comes out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import prod
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.diagrams.lookup import lookup
from symcheck.kernels.rows.sparse import merge_columns
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix, starts_of
from symcheck.symbolic.model import EncodedEvent, EncodedUpdate, StateSpace
from symcheck.syntax.ast import ModelType

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

__all__ = ["listed_rows"]

_MOVES = 500  # joint updates of an event: more are better multiplied as diagrams
_CHUNK = 65536  # states at a time
_SLICE = 10  # bits of a target that one diagram gives

Bits = NDArray[np.uint8]


def listed_rows(space: StateSpace) -> SparseMatrix | None:
    """The matrix of a DTMC or CTMC on its reachable states (deadlocks with a loop), numbered as by `space.odd`.

    None for an MDP, and where an event has too many joint updates. Time is in states times bits; beside the matrix, memory
    for 65536 states at a time. Raises AssertionError where a transition leaves the reachable states.
    """
    model = space.symbolic.model
    if model.type is ModelType.MDP or any(
        _joint_updates(e) > _MOVES for e in space.symbolic.events
    ):
        return None
    lister = _Lister(space)
    parts = [lister.chunk(start) for start in range(0, space.odd.count, _CHUNK)]
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
    """A diagram over row bits, as arrays to be looked up."""

    level: NDArray[np.int32]
    low: NDArray[np.int32]
    high: NDArray[np.int32]
    values: Floats
    root: int
    place: NDArray[np.int32]

    def at(self, bits: Bits) -> Floats:
        out = np.empty(len(bits))
        lookup(self.level, self.low, self.high, self.values, self.root, self.place, bits, out)
        return out


@dataclass(frozen=True, eq=False)
class _Move:
    """One update of each participant. targets: places of the bits that change, highest first, and what gives them as a number."""

    guards: tuple[int, ...]
    probability: float
    factors: tuple[_Function, ...]
    targets: tuple[tuple[NDArray[np.int64], _Function], ...]


class _Lister:
    def __init__(self, space: StateSpace) -> None:
        self.space = space
        symbolic = space.symbolic
        self.manager, self.encoding = symbolic.manager, symbolic.encoding
        self.column = {name: i for i, name in enumerate(self.encoding.rows)}
        self.place = np.zeros(
            max(map(self.manager.level_of, self.encoding.bits), default=0) + 1, np.int32
        )
        for name, i in self.column.items():
            self.place[self.manager.level_of(name)] = i
        self.counting = symbolic.model.type is ModelType.DTMC
        self.guards: list[_Function] = []
        # Per event and participant, the numbers of its commands' guards; what gives a choice of one command each.
        self.commands: list[list[list[int]]] = []
        self.moves: list[_Move] = []
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
            self.moves.append(_Move(tuple(g for g, _ in joint), fixed, factors, targets))

    def _set(self, states: Bdd) -> _Function:
        t = self.manager.export_bdd(states)
        return _Function(t.level, t.low, t.high, np.array([0.0, 1.0]), t.root, self.place)

    def _number(self, function: Mtbdd) -> _Function:
        t = self.manager.export_mtbdd(function)
        return _Function(t.level, t.low, t.high, t.values, t.root, self.place)

    def _targets(self, update: EncodedUpdate) -> Iterator[tuple[NDArray[np.int64], _Function]]:
        """For each assigned variable the new bits, some at a time, as functions of the state."""
        for index, expression in update.update.assignments:
            variable = self.encoding.variables[index]
            relation = self.space.symbolic.translator.assignment(variable, expression).relation
            all_columns = self.manager.cube(variable.columns)
            for start in range(0, variable.width, _SLICE):
                names = variable.columns[start : start + _SLICE]
                code = self.manager.table(names, np.arange(1 << len(names), dtype=np.float64))
                value = relation.to_mtbdd().multiply_sum(code, all_columns)
                places = np.array(
                    [self.column[r] for r in variable.rows[start : start + _SLICE]], np.int64
                )
                yield places, self._number(value)

    def chunk(self, start: int) -> tuple[Int64s, Int64s, Floats]:
        """Row, column and weight of each transition from some of the states."""
        odd = self.space.odd
        bits = odd.unrank(np.arange(start, min(start + _CHUNK, odd.count)))
        enabled = [g.at(bits) != 0.0 for g in self.guards]
        share = self._share(enabled, len(bits))
        rows, columns, weights = [], [], []
        for move in self.moves:
            chosen = np.flatnonzero(np.logical_and.reduce([enabled[g] for g in move.guards]))
            if len(chosen):
                weight, number = self._follow(move, bits[chosen], share[chosen])
                happens = weight != 0.0
                rows.append(chosen[happens] + start)
                columns.append(odd.rank(number[happens]))
                weights.append(weight[happens])
        if not rows:
            return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
        found = np.concatenate(columns)
        assert (found >= 0).all(), "a transition leaves the reachable states"
        return np.concatenate(rows), found, np.concatenate(weights)

    def _share(self, enabled: list[NDArray[np.bool_]], n: int) -> Floats:
        """What each joint command's probabilities are multiplied with: in a DTMC, enabled ones are equally likely."""
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
    def _follow(move: _Move, bits: Bits, share: Floats) -> tuple[Floats, Bits]:
        weight = share * move.probability
        for factor in move.factors:
            weight = weight * factor.at(bits)
        after = bits.copy()
        for places, function in move.targets:
            code = function.at(bits).astype(np.int64)
            for shift, place in enumerate(reversed(places.tolist())):
                after[:, place] = code >> shift & 1
        return weight, after
