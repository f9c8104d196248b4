"""Orbits of states under the symmetries of a model: their representatives and their sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from math import factorial, prod
from operator import mul
from typing import TYPE_CHECKING

import numpy as np

from symcheck.explicit import tuning
from symcheck.explicit.states import Rows, StateLayout
from symcheck.kernels.explore.breadth_first import Component, Orbits, Piece
from symcheck.matrices.rows import Int64s

if TYPE_CHECKING:
    from symcheck.semantics.reduction.symmetry import Symmetry

__all__ = ["Represented", "StateOrbits"]

_WORD = 64
_TOO_LARGE = 1 << 63  # for int64


@dataclass(frozen=True, slots=True)
class Represented:
    """The numbers of what representatives stand for, in the whole model.

    initial_orbits: the number of states that each initial representative stands for, in order.
    outside_cone: the variables that keep their initial values in all representatives.
    """

    states: int
    initial: int
    deadlocks: int
    choices: int
    transitions: int
    symmetries: tuple[Symmetry, ...]
    initial_orbits: tuple[int, ...]
    outside_cone: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class StateOrbits:
    """The orbits of packed states under symmetries on disjoint sets of variables.

    Attributes:
        symmetries: those whose components have fewer than 64 bits; of a ring, all together.
        compiled: replaces states by their representatives.
    """

    layout: StateLayout
    symmetries: tuple[Symmetry, ...]
    compiled: Orbits

    @staticmethod
    def of(layout: StateLayout, symmetries: Sequence[Symmetry]) -> StateOrbits | None:
        """The orbits; None if no symmetry can be used."""
        usable = tuple(s for s in symmetries if _fits(layout, s))
        if not usable:
            return None
        groups = [
            (s.is_ring, _width(layout, s), [_pieces(layout, c) for c in s.components])
            for s in usable
        ]
        return StateOrbits(layout, usable, Orbits(groups, layout.words))

    def representatives(self, rows: Rows) -> Rows:
        """The representatives of states, each once, in lexicographic order: uint64[n, words]."""
        rows = np.array(rows, np.uint64, order="C")
        self.compiled.represent(rows)
        return np.ascontiguousarray(np.unique(rows, axis=0))

    def representative(self, state: tuple[bool | int, ...]) -> tuple[bool | int, ...]:
        """The representative of a state, as the values of the variables."""
        rows = self.layout.pack([np.array([int(value)]) for value in state])
        self.compiled.represent(rows)
        return self.layout.unpack(rows[0])

    def counts(self, rows: Rows, *each: Int64s) -> list[int]:
        """The number of states in the orbits of some representatives, and sums over these states.

        Args:
            rows: the representatives.
            each: what each of the states has, int64[n].
        """
        totals = [0] * (1 + len(each))
        for start in range(0, len(rows), tuning.VALUATIONS_PER_BLOCK):
            part = slice(start, start + tuning.VALUATIONS_PER_BLOCK)
            block = rows[part]
            sizes = [self._sizes(block, symmetry) for symmetry in self.symmetries]
            products = [sizes, *([*sizes, amounts[part]] for amounts in each)]
            for number, factors in enumerate(products):
                greatest = prod(int(f.max()) for f in factors) * len(block)
                kind = np.int64 if greatest < _TOO_LARGE else np.object_
                product = reduce(mul, (f.astype(kind, copy=False) for f in factors))
                totals[number] += int(product.sum())
        return totals

    def represented(
        self, states: Rows, initial: Int64s, deadlocks: Int64s, choices: Int64s, transitions: Int64s
    ) -> Represented:
        """What representatives stand for.

        Args:
            states: the representatives.
            initial: the numbers of the initial ones, ascending, int64[].
            deadlocks: the numbers of the deadlocks among them, ascending, int64[].
            choices: how many choices each of them has in the whole model, int64[n].
            transitions: how many transitions each of them has in the whole model, int64[n].
        """
        factors = (self._sizes(states[initial], symmetry).tolist() for symmetry in self.symmetries)
        orbits = tuple(map(prod, zip(*factors, strict=True)))
        of_states, of_choices, of_transitions = self.counts(states, choices, transitions)
        return Represented(
            of_states,
            sum(orbits),
            self.counts(states[deadlocks])[0],
            of_choices,
            of_transitions,
            self.symmetries,
            orbits,
        )

    def _sizes(self, rows: Rows, symmetry: Symmetry) -> Int64s:
        """The number of states that one symmetry makes of each representative: int64[n]."""
        n = len(symmetry.components)
        keys = np.stack([self._keys(rows, c) for c in symmetry.components])
        if symmetry.is_ring:
            sizes = np.full(len(rows), n, np.int64)
            for period in (d for d in range(n - 1, 0, -1) if n % d == 0):
                sizes[(np.roll(keys, period, axis=0) == keys).all(axis=0)] = period
            return sizes
        keys.sort(axis=0)
        same, permutations = np.ones(len(rows), np.int64), np.ones(len(rows), np.int64)
        for before, after in pairwise(keys):
            same = np.where(before == after, same + 1, 1)
            permutations *= same
        return factorial(n) // permutations

    def _keys(self, rows: Rows, component: Sequence[int]) -> Rows:
        """The local states of a component as numbers: uint64[n]."""
        keys = np.zeros(len(rows), np.uint64)
        for variable in component:
            _, word, shift, bits = map(np.uint64, self.layout.fields[variable].tolist())
            mask = (np.uint64(1) << bits) - np.uint64(1)
            keys = keys << bits | rows[:, word] >> shift & mask
        return keys


def _width(layout: StateLayout, symmetry: Symmetry) -> int:
    """Bits of a component."""
    return int(sum(layout.fields[v][3] for v in symmetry.components[0]))


def _fits(layout: StateLayout, symmetry: Symmetry) -> bool:
    copies = len(symmetry.components) if symmetry.is_ring else 1
    return 0 < _width(layout, symmetry) * copies < _WORD


def _pieces(layout: StateLayout, component: Sequence[int]) -> Component:
    """Where a packed state has the bits of a component (see `Orbits`); adjacent ones are joined."""
    pieces: list[Piece] = []
    position = 0
    for variable in reversed(component):
        _, word, shift, bits = layout.fields[variable].tolist()
        if pieces and pieces[-1][:2] == (word, shift - pieces[-1][2]):
            _, low, below, at = pieces.pop()
            pieces.append((word, low, below + bits, at))
        elif bits:
            pieces.append((word, shift, bits, position))
        position += bits
    return tuple(pieces)
