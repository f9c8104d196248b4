"""Independent answers for small systems, in fractions and by brute force."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np

from symcheck.kernels.solve import component_bounds
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics.linear.problem import LinearProblem

Row = tuple[dict[int, Fraction], Fraction, Fraction]  # entries, constant, exit
System = list[list[Row]]  # per state, per choice


def sparse_of(dense: Floats) -> SparseMatrix:
    """The positive entries of a matrix."""
    nonzero = dense > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    return SparseMatrix(indptr, np.nonzero(nonzero)[1].astype(np.int32), dense[nonzero], len(dense))


def solve_chain(rows: list[Row]) -> list[Fraction] | None:
    """Gauss-Jordan elimination of x = A x + b; None where singular."""
    n = len(rows)
    m = [
        [Fraction(int(i == j)) - rows[i][0].get(j, Fraction(0)) for j in range(n)] + [rows[i][1]]
        for i in range(n)
    ]
    for c in range(n):
        pivot = next((r for r in range(c, n) if m[r][c] != 0), None)
        if pivot is None:
            return None
        m[c], m[pivot] = m[pivot], m[c]
        m[c] = [v / m[c][c] for v in m[c]]
        for r in range(n):
            if r != c and m[r][c] != 0:
                m[r] = [a - m[r][c] * b for a, b in zip(m[r], m[c], strict=True)]
    return [row[n] for row in m]


def leaves(rows: list[Row]) -> set[int]:
    """States that may leave the system."""
    out = {i for i, r in enumerate(rows) if r[2] > 0}
    while more := {i for i, r in enumerate(rows) if i not in out and set(r[0]) & out}:
        out |= more
    return out


def brute_force(system: System, direction: str, proper_only: bool) -> list[Fraction]:
    """The best value over all memoryless strategies. Strategies that may stay for ever: their states that never leave get 0
    (probabilities), or are left out (rewards, `proper_only`)."""
    best: list[Fraction | None] = [None] * len(system)
    for choice in product(*(range(len(c)) for c in system)):
        rows = [system[s][r] for s, r in enumerate(choice)]
        stuck = set(range(len(rows))) - leaves(rows)
        rows = [({}, Fraction(0), Fraction(1)) if s in stuck else r for s, r in enumerate(rows)]
        values = solve_chain(rows)
        assert values is not None
        bad = set(stuck)
        while more := {i for i, r in enumerate(rows) if i not in bad and set(r[0]) & bad}:
            bad |= more
        for s, v in enumerate(values):
            if proper_only and s in bad:
                continue
            old = best[s]
            if old is None or (v > old if direction == "max" else v < old):
                best[s] = v
    assert all(v is not None for v in best)
    return [v for v in best if v is not None]


def problem_of(system: System, direction: str | None, probability: bool = True) -> LinearProblem:
    """The floating-point problem; every number must be a double exactly."""
    flat = [row for choices in system for row in choices]
    indptr = np.cumsum([0] + [len(r[0]) for r in flat]).astype(np.int64)
    indices = np.array([j for r in flat for j in sorted(r[0])], dtype=np.int32)
    data = np.array([float(r[0][j]) for r in flat for j in sorted(r[0])])
    groups = np.cumsum([0] + [len(c) for c in system]).astype(np.int64) if direction else None
    return LinearProblem(
        constant=np.array([float(r[1]) for r in flat]),
        matrix=SparseMatrix(indptr, indices, data, len(system), groups),
        exit=np.array([float(r[2]) for r in flat]),
        direction=direction,
        probability=probability,
    )


def component_block(
    problem: LinearProblem, states: Sequence[int] | None = None, x: float = 0.0
) -> component_bounds.Block:
    """The states (None: all of them) as one block of a solver, with this value everywhere."""
    m = problem.rows
    system = component_bounds.ComponentSolver(
        m.indptr,
        m.indices,
        m.data,
        m.groups,
        problem.constant,
        problem.high,
        problem.leaving,
        problem.mode,
    )
    return system.block(
        np.array(range(problem.n) if states is None else states, np.int32),
        np.full((problem.n, 2), x),
    )
