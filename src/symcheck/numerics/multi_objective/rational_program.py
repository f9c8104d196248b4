"""Several objectives of an MDP at once, in rational arithmetic: the linear programs of `symcheck.numerics.multi_objective.linear_program`, proved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise
from math import isinf
from typing import Any

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.rows import Bools
from symcheck.numerics.multi_objective.exact_lp import Column, Program, solve_program
from symcheck.numerics.multi_objective.linear_program import Flow

__all__ = ["ExactFlow", "ExactOutcome", "exact_corners"]

Least = Sequence[Fraction | float]
"""What each objective must have at least: a Fraction, or -inf for anything."""


@dataclass(frozen=True, eq=False)
class ExactOutcome:
    """The optimum of a program (inf: unbounded), and what each objective has there (none where unbounded)."""

    value: Fraction | float
    gains: list[Fraction]


@dataclass(frozen=True, eq=False)
class ExactFlow:
    """A flow whose probabilities (`values`, per entry of `shape.matrix`) and rewards (per objective and row) are rationals."""

    shape: Flow
    values: Any = field(repr=False)
    rewards: Sequence[Sequence[Fraction]] = field(repr=False)

    @property
    def objectives(self) -> int:
        """Number of objectives."""
        return len(self.rewards)

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self._columns)

    @property
    def _begins(self) -> bool:
        return bool(self.shape.live[self.shape.initial])

    @cached_property
    def _right(self) -> list[Fraction]:
        number = np.cumsum(self.shape.live) - 1
        right = [Fraction(0)] * int(self.shape.live.sum())
        right[int(number[self.shape.initial])] = Fraction(1)
        return right

    @cached_property
    def _columns(self) -> list[Column]:
        """Per variable: what it adds to the balance of each live state."""
        flow, m = self.shape, self.shape.matrix
        number = (np.cumsum(flow.live) - 1).tolist()
        live, owner = flow.live.tolist(), flow.edges.owner_of_rows
        columns: list[Column] = []
        for r in flow.usable.tolist():
            column: Column = {number[int(owner[r])]: Fraction(1)}
            for k in range(int(m.indptr[r]), int(m.indptr[r + 1])):
                t = int(m.indices[k])
                if live[t]:
                    column[number[t]] = column.get(number[t], Fraction(0)) - self.values[k]
            columns.append({i: v for i, v in column.items() if v})
        for places in flow.places:
            columns += [{number[s]: Fraction(1)} for s in places.tolist()]
        return columns

    @cached_property
    def gains(self) -> list[list[Fraction]]:
        """Per objective, what each variable gives."""
        flow = self.shape
        rows = flow.usable.tolist()
        out = [[own[r] for r in rows] for own in self.rewards]
        for stay, places in zip(flow.stays, flow.places, strict=True):
            for i, own in enumerate(out):
                own += [Fraction(int(stay.gains[i]))] * len(places)
        return out

    def _program(self, least: Least) -> tuple[list[Column], list[Fraction]]:
        """Columns and right sides with a row per bound: gain - slack = least."""
        columns, right = [dict(c) for c in self._columns], list(self._right)
        for i in [i for i, v in enumerate(least) if not isinf(v)]:
            row = len(right)
            for column, gain in zip(columns, self.gains[i], strict=False):
                if gain:
                    column[row] = gain
            columns.append({row: Fraction(-1)})
            right.append(Fraction(least[i]))
        return columns, right

    def _total(self, x: dict[int, Fraction]) -> list[Fraction]:
        n = self.size
        return [sum((own[j] * v for j, v in x.items() if j < n), Fraction(0)) for own in self.gains]

    def best(self, weights: Sequence[Fraction], least: Least) -> ExactOutcome | None:
        """The greatest weighted sum of objectives where each has at least `least`; None where none have."""
        if not self._begins:
            return None
        columns, right = self._program(least)
        cost = [
            sum((w * own[j] for w, own in zip(weights, self.gains, strict=True)), Fraction(0))
            for j in range(self.size)
        ]
        found = solve_program(
            Program(columns, cost + [Fraction(0)] * (len(columns) - len(cost)), right)
        )
        if found is None:
            return None
        return ExactOutcome(found.value, [] if isinf(found.value) else self._total(found.x))

    def margin(self, least: Least) -> ExactOutcome | None:
        """By how much all of `least` can be exceeded at once (at most 1; negative where they cannot be had)."""
        if not self._begins:
            return None
        columns, right = self._program(least)
        plus: Column = {i: Fraction(-1) for i in range(len(self._right), len(right))}
        limit = len(right)
        columns += [
            {**plus, limit: Fraction(1)},
            {**{i: Fraction(1) for i in plus}, limit: Fraction(-1)},
            {limit: Fraction(1)},
        ]
        cost = [Fraction(0)] * (len(columns) - 3) + [Fraction(1), Fraction(-1), Fraction(0)]
        found = solve_program(Program(columns, cost, [*right, Fraction(1)]))
        return None if found is None else ExactOutcome(found.value, self._total(found.x))

    def connected(self, least: Least) -> ExactFlow:
        """The same without end components where flow could circulate that never comes from the initial state."""
        flow = self
        while True:
            paying = flow.shape.paying()
            idle = flow._never_entered(paying, least) if paying else []
            if not idle:
                return flow
            banned = (
                np.zeros(flow.shape.matrix.states, np.bool_)
                if flow.shape.banned is None
                else flow.shape.banned.copy()
            )
            for states in idle:
                banned |= states
            flow = ExactFlow(replace(flow.shape, banned=banned), flow.values, flow.rewards)

    def _never_entered(self, components: Sequence[Bools], least: Least) -> list[Bools]:
        left = list(components)
        while left and self._begins:
            columns, right = self._program(least)
            entering = self._entering(left)
            first = len(columns)
            for own in entering:
                row = len(right)
                for j, v in own.items():
                    columns[j][row] = -v
                columns += [
                    {row: Fraction(1), row + 1: Fraction(1)},
                    {row: Fraction(1)},
                    {row + 1: Fraction(1)},
                ]
                right += [Fraction(0), Fraction(1)]
            cost = [Fraction(0)] * len(columns)
            for i in range(len(left)):
                cost[first + 3 * i] = Fraction(1)
            found = solve_program(Program(columns, cost, right))
            if found is None:
                return []
            entered = [first + 3 * i in found.x for i in range(len(left))]
            if not any(entered):
                break
            left = [c for c, yes in zip(left, entered, strict=True) if not yes]
        return left

    def _entering(self, components: Sequence[Bools]) -> list[dict[int, Fraction]]:
        flow, m = self.shape, self.shape.matrix
        owner = flow.edges.owner_of_rows
        out: list[dict[int, Fraction]] = [{} for _ in components]
        for j, r in enumerate(flow.usable.tolist()):
            for own, states in zip(out, components, strict=True):
                if not states[owner[r]]:
                    span = range(int(m.indptr[r]), int(m.indptr[r + 1]))
                    mass = sum((self.values[k] for k in span if states[m.indices[k]]), Fraction(0))
                    if mass:
                        own[j] = mass
        return out


def exact_corners(
    flow: ExactFlow, first: int, second: int, least: Least
) -> list[tuple[Fraction, Fraction]] | None:
    """The corners of the Pareto curve of two objectives, by falling value of the first; None where `least` cannot be had."""

    def at(one: Fraction, two: Fraction, floor: Least) -> tuple[Fraction, Fraction] | None:
        weights = [Fraction(0)] * flow.objectives
        weights[first], weights[second] = one, two
        found = flow.best(weights, floor)
        if found is None:
            return None
        if isinf(found.value):
            raise NumericalError(
                "a reward of this Pareto query has no bound: some strategy collects it for ever"
            )
        return found.gains[first], found.gains[second]

    def extreme(main: int) -> tuple[Fraction, Fraction] | None:
        one = Fraction(1)
        best = at(one * (main == 0), one * (main == 1), least)
        if best is None:
            return None
        floor, index = list(least), (first, second)[main]
        floor[index] = max(floor[index], best[main])
        return at(one * (main == 1), one * (main == 0), floor)

    ends = extreme(0), extreme(1)
    if ends[0] is None or ends[1] is None:
        return None
    points = [ends[0], ends[1]] if ends[0] != ends[1] else [ends[0]]
    i = 0
    while i < len(points) - 1:
        p, q = points[i], points[i + 1]
        one, two = p[1] - q[1], q[0] - p[0]
        found = at(abs(one), abs(two), least)
        if (
            found is not None
            and found not in (p, q)
            and abs(one) * found[0] + abs(two) * found[1] > abs(one) * p[0] + abs(two) * p[1]
        ):
            points.insert(i + 1, found)
        else:
            i += 1
    assert all(a != b for a, b in pairwise(points))
    return points
