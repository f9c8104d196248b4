"""Long-run averages of Markov decision processes in rational arithmetic: policy iteration in each end component.

A policy's average g and bias h (g + h = r + P h) are exact, and prove that the policy is best where no row has r + P h above
g + h. Source: Puterman (1994), 8.6 and 9.5; how end components come together is told in `symcheck.numerics.long_run.mean_payoff`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from symcheck.check.context import Context
from symcheck.check.rational.linear_systems import (
    Entries,
    RationalProblem,
    exact_matrix,
    least_solution,
)
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.rational.engine import ExactEngine
from symcheck.engines.rational.values import Rationals
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.rows import SparseMatrix, starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.rational import ExactProblem, solve_exact, stationary_exact

__all__ = ["mean_payoff"]

_POLICIES = 1_000


def mean_payoff(
    context: Context, engine: ExactEngine, rewards: Rationals, direction: Direction | None
) -> Rationals:
    """The least or greatest long-run average of a reward per row (Fractions), at each state.

    Raises NumericalError where policy iteration does not end.
    """
    assert direction is not None
    if context.options.fairness:
        raise UnsupportedError(
            "long-run averages over fair strategies only are not supported; without -fair they are"
        )
    sign = -1 if direction == Direction.MIN else 1
    matrix, n = engine.rationals, engine.states
    parts = graph.maximal_end_components(matrix.shape, np.ones(n, np.bool_))
    gains: list[Fraction] = []
    evaluated = 0
    for c in range(parts.count):
        states = np.flatnonzero(parts.of == c).tolist()
        place = {s: i for i, s in enumerate(states)}
        rows, values, groups = [], [], [0]
        for s in states:
            for r in matrix.rows_of(s):
                if parts.rows[r]:
                    rows.append([(place[t], p) for t, p in matrix.row(r)])
                    values.append(sign * rewards[r])
            groups.append(len(rows))
        gain, count = _Component(rows, values, groups).best()
        gains.append(sign * gain)
        evaluated += count
    out, count = _endings(engine, parts, gains, direction)
    context.log.runs.append(SolverRun("exact", "rational policy iteration", n, evaluated + count))
    return out


def _endings(
    engine: ExactEngine, parts: graph.EndComponents, gains: Sequence[Fraction], direction: Direction
) -> tuple[Rationals, int]:
    """The best way to end: components are single states, with a row more for their average."""
    matrix, n = engine.rationals, engine.states
    shift = -min(Fraction(0), *gains)
    number: dict[int, int] = {}
    place = [
        number.setdefault(c if c >= 0 else -2 - s, len(number))
        for s, c in enumerate(parts.of.tolist())
    ]
    rows: list[list[Entries]] = [[] for _ in number]
    constants: list[list[Fraction]] = [[] for _ in number]
    for s in range(n):
        for r in matrix.rows_of(s):
            if not parts.rows[r]:
                merged: dict[int, Fraction] = {}
                for t, p in matrix.row(r):
                    merged[place[t]] = merged.get(place[t], Fraction(0)) + p
                rows[place[s]].append(list(merged.items()))
                constants[place[s]].append(Fraction(0))
    for c, gain in enumerate(gains):
        rows[number[c]].insert(0, [])
        constants[number[c]].insert(0, gain + shift)
    flat = [row for own in rows for row in own]
    groups = starts_of([len(own) for own in rows]).tolist()
    solution, count = least_solution(
        RationalProblem(flat, [v for own in constants for v in own], groups, direction)
    )
    out = np.empty(n, dtype=object)
    out[:] = [solution[p] - shift for p in place]
    return out, count


@dataclass(frozen=True, eq=False)
class _Component:
    """An end component alone: entries and reward (more is better) per row, rows `groups[s]` to `groups[s+1]` of state s."""

    rows: Sequence[Entries]
    rewards: Sequence[Fraction]
    groups: Sequence[int]

    @property
    def n(self) -> int:
        return len(self.groups) - 1

    def best(self) -> tuple[Fraction, int]:
        """The greatest average, and how many policies were evaluated."""
        policy = [
            max(range(a, b), key=lambda r: self.rewards[r])
            for a, b in zip(self.groups, self.groups[1:], strict=False)
        ]
        for count in range(1, _POLICIES + 1):
            policy, anchor, gain = self._unichain(policy)
            bias = self._bias(policy, anchor, gain)
            better = False
            for s in range(self.n):
                top, chosen = gain + bias[s], -1
                for r in range(self.groups[s], self.groups[s + 1]):
                    value = self.rewards[r] + sum(
                        (p * bias[t] for t, p in self.rows[r]), Fraction(0)
                    )
                    if value > top:
                        top, chosen = value, r
                if chosen >= 0:
                    policy[s], better = chosen, True
            if not better:
                return gain, count
        raise NumericalError(
            "policy iteration for a long-run average in rational arithmetic did not end"
        )

    def _unichain(self, policy: list[int]) -> tuple[list[int], int, Fraction]:
        """The policy, led to its best bottom component where it does not go there; a state of that, and its average."""
        chain = exact_matrix([self.rows[r] for r in policy]).rounded()
        found: list[tuple[Fraction, list[int]]] = []
        for component in graph.bsccs(chain):
            states = component.tolist()
            place = {s: i for i, s in enumerate(states)}
            shares = stationary_exact(
                exact_matrix([[(place[t], p) for t, p in self.rows[policy[s]]] for s in states])
            )
            found.append(
                (
                    sum(
                        (x * self.rewards[policy[s]] for x, s in zip(shares, states, strict=True)),
                        Fraction(0),
                    ),
                    states,
                )
            )
        gain, target = max(found, key=lambda f: f[0])
        everywhere, goal = np.ones(self.n, np.bool_), np.zeros(self.n, np.bool_)
        goal[target] = True
        sure = graph.prob1(chain, everywhere, goal)
        if not sure.all():
            flat = exact_matrix(self.rows).rounded()
            shape = SparseMatrix(
                flat.indptr, flat.indices, flat.data, self.n, np.array(self.groups, np.int64)
            )
            _, rows = graph.prob1e_strategy(shape, everywhere, sure)
            policy = [old if sure[s] else int(rows[s]) for s, old in enumerate(policy)]
        return list(policy), target[0], gain

    def _bias(self, policy: Sequence[int], anchor: int, gain: Fraction) -> list[Fraction]:
        """H with h + gain = r + P h, and 0 at the anchor."""
        others = [s for s in range(self.n) if s != anchor]
        place = {s: i for i, s in enumerate(others)}
        inner = exact_matrix(
            [[(place[t], p) for t, p in self.rows[policy[s]] if t != anchor] for s in others]
        )
        values = (
            solve_exact(
                ExactProblem(inner, [self.rewards[policy[s]] - gain for s in others])
            ).values
            if others
            else []
        )
        return [Fraction(0) if s == anchor else values[place[s]] for s in range(self.n)]
