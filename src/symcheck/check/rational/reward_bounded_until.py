"""Path formulas with bounds on rewards, in rational arithmetic: the budgets one after the other, as in floating point.

The structure of a level is that of `symcheck.numerics.reward_bounds.epochs`; its values are computed state by state, and cycles without
reward by policy iteration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reward_bounded_until import check_even
from symcheck.check.measures.reward_scaling import Limits, common_step, in_steps, main_first
from symcheck.check.rational.linear_systems import Entries, RationalProblem, least_solution
from symcheck.check.result import SolverRun
from symcheck.check.time_bounds import Count
from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.rational.engine import ExactEngine
from symcheck.engines.rational.values import RationalMatrix, Rationals
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools
from symcheck.numerics.reward_bounds.epoch_system import Epochs, Layer, layer_of
from symcheck.numerics.reward_bounds.epochs import unfold
from symcheck.semantics.rewards import Steps
from symcheck.syntax.ast import ModelType

__all__ = ["counted_limits", "counted_values"]

Level = list[Fraction]


def counted_limits(context: Context, engine: ExactEngine, counts: Sequence[Count]) -> list[Limits]:
    """The rewards of every row and the bounds, in whole steps. Raises UnsupportedError for rewards of another kind."""
    return [_limits(context, engine, c) for c in counts]


def _limits(context: Context, engine: ExactEngine, count: Count) -> Limits:
    rows, groups = engine.matrix.rows, engine.matrix.groups
    if isinstance(count.reward, Steps):
        return Limits(np.ones(rows, np.int64), *in_steps(count.window, Fraction(1)))
    states, own = engine.rewards(count.reward)
    check_even(context, count.reward, paying=any(own))
    if engine.model.type is ModelType.CTMC:
        if any(states):
            raise UnsupportedError(
                "a bound on state rewards of a ctmc, which are gathered per unit of time, is not supported"
            )
        total = own / np.add.reduceat(engine.rationals.values, engine.matrix.indptr[:-1])
    else:
        total = (states if groups is None else np.repeat(states, np.diff(groups))) + own
    for r, value in enumerate(total):
        if value < 0:
            place = r if groups is None else int(np.searchsorted(groups, r, side="right")) - 1
            where = context.example(ArraySet(np.arange(engine.states) == place))
            raise UnsupportedError(
                f"a bound on a reward needs rewards that are not negative: {value} in state {where} is"
            )
    step = common_step([Fraction(v) for v in set(total)])
    return Limits(np.array([int(v / step) for v in total], np.int64), *in_steps(count.window, step))


def counted_values(
    context: Context,
    engine: ExactEngine,
    matrix: RationalMatrix,
    sets: tuple[ArraySet, ArraySet],
    limits: list[Limits],
    direction: Direction | None,
    unbounded: Rationals | None,
) -> Rationals:
    """The probability of `left U right` (`sets`) within the limits, at each state. unbounded: that without limits, where no
    limit is from above (and there is one only).
    """
    left, right = (s.members for s in sets)
    limits = sorted(limits, key=main_first)
    problem = Epochs(
        matrix.shape,
        np.zeros(matrix.shape.rows),
        limits[0].rewards,
        left,
        right,
        limits[0].lower,
        limits[0].upper,
        direction,
    )
    origin = np.arange(matrix.shape.rows)
    for i, limit in enumerate(limits[1:], 1):
        problem, rows = unfold(problem, limit.rewards, limit.lower, limit.upper)
        limits[i + 1 :] = [replace(later, rewards=later.rewards[rows]) for later in limits[i + 1 :]]
        origin = origin[rows]
    run = _Levels(problem, matrix, origin)
    values = run.solve(unbounded)
    context.log.runs.append(
        SolverRun("exact", "rational, budget by budget", problem.matrix.states, run.count)
    )
    out = np.empty(engine.states, dtype=object)
    out[:] = values[:: problem.matrix.states // engine.states]
    return out


class _Levels:
    """The levels, as many as matter."""

    def __init__(self, problem: Epochs, matrix: RationalMatrix, origin: Any) -> None:
        self.problem, self.count = problem, 0
        shape = problem.matrix
        self.rows: list[Entries] = []
        for r, base in enumerate(origin.tolist()):
            i, j = int(shape.indptr[r]), int(shape.indptr[r + 1])
            begin = int(matrix.shape.indptr[base])
            self.rows.append(
                list(
                    zip(
                        shape.indices[i:j].tolist(),
                        matrix.values[begin : begin + j - i],
                        strict=True,
                    )
                )
            )
        self.levels: dict[int, Level] = {}
        self.keep = int(problem.rewards.max(initial=0)) + 1

    def solve(self, unbounded: Rationals | None) -> Level:
        """The values at the last level."""
        problem = self.problem
        n = problem.matrix.states
        if problem.upper is not None and problem.upper < problem.lower:
            return [Fraction(0)] * n
        last = 0
        if unbounded is not None:
            self.levels[0] = list(unbounded)
        else:
            assert problem.upper is not None
            last = problem.upper - problem.lower
            start = [Fraction(int(m)) for m in problem.right.tolist()]
            self.phase(problem.left & ~problem.right, 0, last + 1, start, None)
        if problem.lower > 0:
            self.phase(
                problem.left,
                last + 1,
                problem.lower,
                [Fraction(0)] * n,
                0 if unbounded is not None else None,
            )
            last += problem.lower
        return self.levels[last]

    def phase(
        self, unknown: Bools, first: int, count: int, start: Level, least: int | None
    ) -> None:
        """Compute levels. start: the values of the states that are not unknown. least: the level that all lower ones are like."""
        layer = layer_of(self.problem, unknown)
        parts = _Parts(layer, self.problem.direction, self.problem.rewards.tolist(), self.rows)
        for level in range(first, first + count):
            x = list(start)
            self.levels[level] = x
            parts.fill(x, level, self.levels, least)
            self.levels.pop(level - self.keep, None)
            self.count += 1
            if least is not None and least not in self.levels and level >= self.keep:
                least = None


class _Parts:
    """The equations of a level, to be filled in again and again."""

    def __init__(
        self, layer: Layer, direction: Direction | None, rewards: list[int], rows: list[Entries]
    ) -> None:
        self.layer, self.direction, self.rewards, self.rows = layer, direction, rewards, rows
        self.block, self.row_ptr, self.row_id = (
            layer.block.tolist(),
            layer.row_ptr.tolist(),
            layer.row_id.tolist(),
        )
        self.member_ptr, self.members = layer.member_ptr.tolist(), layer.members.tolist()
        self.place = {
            s: i
            for i in range(len(layer.state))
            for s in self.members[self.member_ptr[i] : self.member_ptr[i + 1]]
        }

    def fill(self, x: Level, level: int, levels: dict[int, Level], least: int | None) -> None:
        """Compute the values of one level, in place."""
        for b in range(len(self.block) - 1):
            begin, end = self.block[b], self.block[b + 1]
            for i, value in zip(
                range(begin, end), self.solve(begin, end, level, levels, least), strict=True
            ):
                for s in self.members[self.member_ptr[i] : self.member_ptr[i + 1]]:
                    x[s] = value

    def solve(
        self, begin: int, end: int, level: int, levels: dict[int, Level], least: int | None
    ) -> list[Fraction]:
        """The values of the states of a cycle, or of one state."""
        rows: list[Entries] = []
        constants: list[Fraction] = []
        groups = [0]
        for i in range(begin, end):
            for r in self.row_id[self.row_ptr[i] : self.row_ptr[i + 1]]:
                inside, constant = self.row(r, begin, end, level, levels, least)
                loop = sum((p for t, p in inside if t == i - begin), Fraction(0))
                # States that are one place here may both be successors: the solver wants every place once.
                merged: dict[int, Fraction] = {}
                for t, p in inside:
                    if t != i - begin:
                        merged[t] = merged.get(t, Fraction(0)) + p / (1 - loop)
                rows.append(list(merged.items()))
                constants.append(constant / (1 - loop))
            groups.append(len(rows))
        if end == begin + 1:
            return [min(constants) if self.direction == Direction.MIN else max(constants)]
        return least_solution(RationalProblem(rows, constants, groups, self.direction))[0]

    def row(
        self, r: int, begin: int, end: int, level: int, levels: dict[int, Level], least: int | None
    ) -> tuple[Entries, Fraction]:
        """The entries of a row within the cycle, and what it has from elsewhere."""
        at = level - self.rewards[r]
        if least is not None and at < least:
            at = least
        if at < 0:
            return [], Fraction(0)
        values, constant = levels[at], Fraction(0)
        inside: Entries = []
        for t, p in self.rows[r]:
            place = self.place.get(t, -1) if at == level else -1
            if begin <= place < end:
                inside.append((place - begin, p))
            elif values[t]:
                constant += p * values[t]
        return inside, constant
