"""Exploration of beliefs: the states of a decision process without hidden ones.

Beliefs are kept exactly, as whole numbers without a common divisor, so that equal beliefs are found
to be equal: cycles of the beliefs are those of the model, and no rounding leaves them.

Sources: Kaelbling, Littman & Cassandra (1998); Norman, Parker & Zou (2017), 'Verification and
control of partially observable probabilistic systems'; Bork, Junges, Katoen & Quatmann (2020),
'Verification of indefinite-horizon POMDPs'.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from itertools import count
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers, Rationals, rationals
from symcheck.matrices.rows import Bools, Floats, Int64s, spans, starts_of
from symcheck.numerics.beliefs.observed import GOAL, LARGEST, SINK, Observed, Whole
from symcheck.numerics.beliefs.triangulation import reduced, totals, triangulate

__all__ = ["Beliefs", "Exploration", "Rows"]

_PRIME = 2**62 - 57
_LONGEST = 2**1000
"""Probabilities of observations are normal doubles if the numbers of beliefs are below it."""
_LEAST = 1e-250
"""The least weight of a point of a grid."""
_ENTRIES = 1 << 23
"""The most states of all beliefs together; more take gigabytes."""
_BATCH = 1 << 18
"""Entries of successors that are found at once."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """Beliefs by number: `states[starts[i]:starts[i+1]]` with `values` in proportion.

    The beliefs GOAL and SINK, of which no state matters, are empty. States are in the order of
    their classes.
    """

    starts: Int64s
    states: Int64s
    values: Whole

    def __len__(self) -> int:
        return len(self.starts) - 1

    def mean(self, of_states: Floats) -> Floats:
        """The expectation of a number per state under each belief; 0 of the empty ones."""
        each = self.shares * of_states[self.states]
        return np.asarray(np.bincount(self.owner, each, len(self)), np.float64)

    def within(self, members: Bools) -> Bools:
        """The beliefs whose states are all among these observable ones; GOAL is one of them."""
        out: Bools = np.arange(len(self)) == GOAL
        out[self.owner] = members[self.states]
        return out

    @cached_property
    def owner(self) -> Int64s:
        """The belief of each entry of `states`."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    @cached_property
    def shares(self) -> NDArray[np.float64]:
        """The probability of each state of each belief."""
        filled = np.diff(self.starts) > 0
        sums = np.add.reduceat(self.values, self.starts[:-1][filled])
        of_entry = np.repeat(sums, np.diff(self.starts)[filled])
        return np.asarray(self.values / of_entry, np.float64)


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of beliefs that were expanded, in the order of their expansion.

    Attributes:
        first: of each belief, the number of its first row; -1 if it was not expanded.
        row, target, weight: the transitions. `observed`: the class of the target.
        row_of_belief: the belief of each row. earned: the expected reward of each row.
    """

    first: Int64s
    row_of_belief: Int64s
    earned: Numbers
    row: Int64s
    target: Int64s
    observed: Int64s
    weight: Numbers = field(repr=False)


class Exploration:
    """The beliefs that are found from those given, and their rows.

    Args:
        model: the model.
        earned: the reward of each of its rows; None: none.
        rational: whether weights are rationals.
        supports: keep which states are possible, and forget how likely they are.

    Attributes:
        beliefs: those that were found so far.
    """

    def __init__(
        self,
        model: Observed,
        earned: Rationals | None = None,
        *,
        rational: bool = False,
        supports: bool = False,
    ) -> None:
        self.model, self._rational = model, rational
        # Rewards as whole numbers.
        self._unit = lcm(*(r.denominator for r in earned)) if earned is not None else 1
        self._earned = None if earned is None else np.asarray(earned * self._unit, object)
        self._supports = supports
        none = np.zeros(0, np.int64)
        self.beliefs = Beliefs(np.zeros(3, np.int64), none, none)
        self._known: dict[int, int] = {}
        self._first = np.full(2, -1, np.int64)
        number = none.astype(object if rational else np.float64)
        self._parts: list[tuple[NDArray[Any], ...]] = [(none, number, none, none, none, number)]
        self._row_count = 0
        self._fixed = np.full(len(model.choices) + 2, -1, np.int64)
        self._fixed[GOAL], self._fixed[SINK] = GOAL, SINK

    def __len__(self) -> int:
        return len(self.beliefs)

    @property
    def pending(self) -> Int64s:
        """The beliefs that were not expanded."""
        return np.flatnonzero(self._first[2:] < 0) + 2

    def points(self, states: Int64s) -> Int64s:
        """The numbers of the beliefs that are certain of a state."""
        number = np.arange(len(states) + 1)
        return self.memory_of(Beliefs(number, states, np.ones_like(states)), number[:-1])

    def by_observation(self) -> None:
        """Remember nothing but the last observation: its belief has all states of the class."""
        states = self.model.by_class
        classes = self.model.classes[states]
        states, classes = states[classes > SINK], classes[classes > SINK]
        present, starts = np.unique(classes, return_index=True)
        if len(present):
            ends = np.append(starts, len(states))
            self._fixed[present] = self._numbers(ends, states, np.ones(len(states), np.int64))

    def memory_of(self, beliefs: Beliefs, numbers: Int64s) -> Int64s:
        """The numbers of the known supports of some beliefs, or of their observations."""
        begin, end = beliefs.starts[numbers], beliefs.starts[numbers + 1]
        out = self._fixed[self.model.classes[beliefs.states[begin]]]
        free = np.flatnonzero(out < 0)
        starts = starts_of((end - begin)[free])
        states = beliefs.states[spans(begin[free], end[free])]
        out[free] = self._numbers(starts, states, np.ones(len(states), np.int64))
        return out

    def clone(self) -> Exploration:
        """The same beliefs and rows, to be explored further in another way."""
        other = copy(self)
        other._known, other._parts = dict(self._known), list(self._parts)
        return other

    def run(
        self,
        limit: int,
        resolution: int | None = None,
        *,
        levels: int | None = None,
        upper: bool = True,
    ) -> bool:
        """Expand beliefs in the order in which they were found.

        Args:
            limit: stop when there are more beliefs, or when they or their numbers become long.
            resolution: replace successors by points of a grid; None: keep them.
            levels: expand so many generations, whatever their numbers; None: all.
            upper: whether tiny weights in a grid are made larger; otherwise, they are dropped.

        Returns:
            Whether everything was expanded that was asked for.
        """
        self._upper = upper
        size_of_state = np.add.reduceat(self.model.matrix.lengths, self.model.groups[:-1])
        for _ in count() if levels is None else range(levels):
            pending = self.pending
            if not len(pending):
                return True
            beliefs = self.beliefs
            if resolution is None and levels is None:
                newest = beliefs.values[beliefs.starts[pending[0]] :]
                if newest.max() > (_LONGEST**4 if self._rational else _LONGEST):
                    return False
            sizes = np.add.reduceat(size_of_state[beliefs.states], beliefs.starts[:-1][pending])
            cuts = np.flatnonzero(np.diff(np.cumsum(sizes) // _BATCH)) + 1
            for batch in np.split(pending, cuts):
                if len(self) > limit or len(self.beliefs.states) > _ENTRIES:
                    return False
                self._expand(batch, resolution)
        return True

    def rows(self) -> Rows:
        """The rows found so far."""
        return Rows(self._first, *(np.concatenate(p) for p in zip(*self._parts, strict=True)))

    # ------------------------------------------------------------------------------------ internals

    def _numbers(self, starts: Int64s, states: Int64s, values: Whole) -> Int64s:
        """The numbers of beliefs; those that are new are added."""
        if len(starts) == 1:
            return np.zeros(0, np.int64)
        key = _mixed(states.astype(np.uint64) ^ _mixed((values % _PRIME).astype(np.uint64)))
        keys = np.add.reduceat(key, starts[:-1])
        each, where, of = np.unique(keys, return_index=True, return_inverse=True)
        listed = each.tolist()
        numbers = np.array([self._known.get(k, -1) for k in listed], np.int64)
        fresh = np.flatnonzero(numbers < 0)
        if len(fresh):
            fresh = fresh[np.argsort(where[fresh])]  # in the order in which they come
            numbers[fresh] = len(self) + np.arange(len(fresh))
            self._known.update(zip(listed, numbers.tolist(), strict=True))
            begin, end = starts[:-1][where[fresh]], starts[1:][where[fresh]]
            entries = spans(begin, end)
            old = self.beliefs
            self.beliefs = Beliefs(
                np.append(old.starts, old.starts[-1] + np.cumsum(end - begin)),
                np.append(old.states, states[entries]),
                np.append(old.values, values[entries]),
            )
            self._first = np.append(self._first, np.full(len(fresh), -1))
        numbers = numbers[of]
        stored = self.beliefs
        begin, end = stored.starts[numbers], stored.starts[numbers + 1]
        entries = spans(begin, end)
        if not (
            np.array_equal(end - begin, np.diff(starts))
            and np.array_equal(stored.states[entries], states)
            and np.array_equal(stored.values[entries], values)
        ):
            raise NumericalError("two beliefs have the same hash")
        return numbers

    def _expand(self, nodes: Int64s, resolution: int | None) -> None:
        model, beliefs = self.model, self.beliefs
        begin, end = beliefs.starts[nodes], beliefs.starts[nodes + 1]
        observation = model.observation[beliefs.states[begin]]
        choices = model.choices[observation]
        of_node = np.repeat(np.arange(len(nodes)), choices)
        position = spans(np.zeros(len(nodes), np.int64), choices)
        slot = model.first_slot[observation][of_node] + position
        entries = spans(begin[of_node], end[of_node])
        pair = np.repeat(np.arange(len(of_node)), (end - begin)[of_node])
        row = model.groups[beliefs.states[entries]] + position[pair]
        # Whole numbers: the belief times the numerators, over its sum times the denominator.
        parts = beliefs.values[spans(begin, end)]
        sums = totals(starts_of(end - begin), parts)
        largest = int(sums.max()) * int(model.denominators.max()) * (resolution or 1)
        kind = np.int64 if largest < LARGEST else object
        value, numerators = beliefs.values[entries].astype(kind), model.numerators
        first, last = model.matrix.indptr[row], model.matrix.indptr[row + 1]
        below = (sums.astype(kind)[of_node]) * model.denominators.astype(kind)[slot]
        steps = spans(first, last)
        product = np.repeat(value, last - first) * numerators[steps].astype(kind)
        keys = (
            np.repeat(pair, last - first) * model.states + model.rank[model.matrix.indices[steps]]
        )
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        starts = np.flatnonzero(np.diff(keys, prepend=-1))
        value = np.add.reduceat(product[order], starts)
        pair2, rank = np.divmod(keys[starts], model.states)
        states = model.by_class[rank]
        classes = model.classes[states]
        change = np.flatnonzero(np.diff(pair2 * len(self._fixed) + classes, prepend=-1))
        bounds = np.append(change, len(value))
        mass, of_pair, observed = np.add.reduceat(value, change), pair2[change], classes[change]
        value = np.ones(len(value), np.int64) if self._supports else reduced(bounds, value)
        target = self._fixed[observed]
        free = np.flatnonzero(target < 0)
        inside = spans(bounds[free], bounds[free + 1])
        bounds = starts_of(bounds[free + 1] - bounds[free])
        states, value = states[inside], value[inside]
        weight = self._ratio(mass, below[of_pair])
        if resolution is None:
            target[free] = self._numbers(bounds, states, value)
        elif len(free):
            whole = totals(bounds, value)
            owner, part, bounds, states, value = triangulate(bounds, states, value, resolution)
            fixed = np.flatnonzero(target >= 0)
            keep = np.concatenate((fixed, free[owner]))
            share = np.concatenate((np.ones(len(fixed)), part / whole[owner])).astype(np.float64)
            weight = np.maximum(weight[keep] * share, _LEAST if self._upper else 0.0)
            target = np.concatenate((target[fixed], self._numbers(bounds, states, value)))
            order = np.argsort(of_pair[keep], kind="stable")
            order = order[weight[order] >= _LEAST]
            keep, target, weight = keep[order], target[order], weight[order]
            of_pair, observed = of_pair[keep], observed[keep]
        number = self._row_count + np.arange(len(of_node))
        self._first = self._first.copy()
        self._first[nodes] = self._row_count + starts_of(choices)[:-1]
        self._row_count += len(of_node)
        earned = np.zeros(len(of_node), np.int64)
        if self._earned is not None:
            each = beliefs.values[entries] * self._earned[row]
            earned = np.add.reduceat(each, np.flatnonzero(np.diff(pair, prepend=-1)))
        earned = self._ratio(earned, sums[of_node].astype(object) * self._unit)
        self._parts.append((nodes[of_node], earned, number[of_pair], target, observed, weight))

    def _ratio(self, above: Whole, below: Whole) -> Numbers:
        """Quotients of whole numbers: rationals, or the nearest doubles."""
        if not self._rational:
            return np.asarray(above / below, np.float64)
        pairs = zip(above.tolist(), below.tolist(), strict=True)
        return rationals(Fraction(*pair) for pair in pairs)


def _mixed(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Well mixed bits (the finaliser of SplitMix64; Steele, Lea & Flood 2014)."""
    x = x * np.uint64(0x9E3779B97F4A7C15) + np.uint64(0x7F4A7C15F39CC060)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(x ^ (x >> np.uint64(31)))
