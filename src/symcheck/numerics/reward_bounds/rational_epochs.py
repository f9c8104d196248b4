"""Reward-bounded until formulas in rational arithmetic, one epoch after the other.

The structure of an epoch is that of `symcheck.numerics.reward_bounds.epochs`. Its values are
computed state by state, and cycles without reward by policy iteration.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.numbers import Numbers, Rationals, doubles, rationals
from symcheck.matrices.rows import Bools, SparseMatrix, starts_of
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.reward_bounds.epoch_system import (
    EpochSystem,
    RewardBoundedReachability,
    epoch_system,
)
from symcheck.numerics.settings import Accuracy

__all__ = ["rational_epochs"]

Level = list[Fraction]
Entries = list[tuple[int, Fraction]]


def rational_epochs(
    problem: RewardBoundedReachability, unbounded: Numbers | None
) -> tuple[Rationals, int]:
    """The probability at each state, and the number of levels that were computed.

    Args:
        problem: the matrix and the rewards; entries are rationals.
        unbounded: the probabilities without the bound, where it is from below only.
    """
    run = _Levels(problem)
    return rationals(run.solve(unbounded)), run.count


def _cycle(
    rows: list[Entries], constants: list[Fraction], groups: list[int], direction: Direction | None
) -> list[Fraction]:
    """The values of the states of a cycle, given what rows have from elsewhere."""
    matrix = SparseMatrix(
        starts_of([len(row) for row in rows]),
        np.array([t for row in rows for t, _ in row], dtype=np.int32),
        rationals(p for row in rows for _, p in row),
        len(groups) - 1,
        None if direction is None else np.array(groups, np.int64),
    )
    problem = LinearProblem(rationals(constants), matrix, direction=direction)
    values: list[Fraction] = solve_linear(problem, Accuracy()).lower.tolist()
    return values


class _Levels:
    """The levels, as many as matter."""

    def __init__(self, problem: RewardBoundedReachability) -> None:
        self.problem, self.count = problem, 0
        m = problem.matrix
        columns, values, starts = m.indices.tolist(), m.data.tolist(), m.indptr.tolist()
        self.rows: list[Entries] = [
            list(zip(columns[i:j], values[i:j], strict=True)) for i, j in pairwise(starts)
        ]
        exits = np.where(problem.exit > 0, np.maximum(doubles(problem.exit), 1e-300), 0.0)
        self.shape = replace(problem, matrix=m.doubles(), exit=exits)
        self.levels: dict[int, Level] = {}
        self.keep = int(problem.rewards.max(initial=0)) + 1

    def solve(self, unbounded: Numbers | None) -> Level:
        """The values at the last level."""
        problem = self.problem
        n = problem.matrix.states
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
        """Compute levels; `start`: known values; `least`: all lower levels equal this one."""
        system = epoch_system(self.shape, unknown)
        parts = _Parts(system, self.problem.direction, self.problem.rewards.tolist(), self.rows)
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
        self,
        system: EpochSystem,
        direction: Direction | None,
        rewards: list[int],
        rows: list[Entries],
    ) -> None:
        self.system, self.direction, self.rewards, self.rows = system, direction, rewards, rows
        self.block, self.row_ptr, self.row_id = (
            system.block.tolist(),
            system.row_ptr.tolist(),
            system.row_id.tolist(),
        )
        self.member_ptr, self.members = system.member_ptr.tolist(), system.members.tolist()
        self.place = {
            s: i
            for i in range(len(system.state))
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
                # Two successors may be the same place: the solver needs each place once.
                merged: dict[int, Fraction] = {}
                for t, p in inside:
                    if t != i - begin:
                        merged[t] = merged.get(t, Fraction(0)) + p / (1 - loop)
                rows.append(list(merged.items()))
                constants.append(constant / (1 - loop))
            groups.append(len(rows))
        if end == begin + 1:
            return [min(constants) if self.direction == Direction.MIN else max(constants)]
        return _cycle(rows, constants, groups, self.direction)

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
