"""BiCGStab gives candidates; the bounds made from them hold the true values, whatever the candidate was."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import Row, leaves, problem_of, solve_chain
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear import subsystem
from symcheck.numerics.linear.krylov import bicgstab
from symcheck.numerics.linear.subsystem import LocalSystem, solve_krylov


@st.composite
def chains(draw: st.DrawFn) -> list[Row]:
    """Chains that leave, without loops, with a gain everywhere."""
    n = draw(st.integers(2, 9))
    rows: list[Row] = []
    for s in range(n):
        others = draw(
            st.lists(
                st.sampled_from([t for t in range(n) if t != s]),
                min_size=1,
                max_size=3,
                unique=True,
            )
        )
        weights = draw(st.lists(st.integers(1, 20), min_size=len(others), max_size=len(others)))
        entries = {t: Fraction(w, 64) for t, w in zip(others, weights, strict=True)}
        exit_ = 1 - sum(entries.values(), Fraction(0))
        rows.append((entries, exit_ * draw(st.sampled_from([Fraction(1, 3), Fraction(1)])), exit_))
    return rows


@settings(max_examples=100, deadline=None)
@given(rows=chains())
def test_the_bounds_hold_the_solution(rows: list[Row]) -> None:
    exact = solve_chain(rows)
    assert exact is not None
    assert len(leaves(rows)) == len(rows)
    found = solve_krylov(
        LocalSystem.whole(problem_of([[r] for r in rows], None)), 1e-6, np.ones(len(rows))
    )
    if found is None:  # a breakdown is allowed, a wrong bound is not
        return
    for s, value in enumerate(exact):
        assert Fraction(float(found.lower[s])) <= value <= Fraction(float(found.upper[s]))
        assert found.upper[s] - found.lower[s] <= 1e-6 * found.upper[s]


@pytest.mark.parametrize("wrong", [0.9, 1.1, 2.0])
def test_a_wrong_candidate_is_never_certified(
    wrong: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows: list[Row] = [
        ({(s + 1) % 5: Fraction(1, 2), (s + 2) % 5: Fraction(1, 4)}, Fraction(1, 4), Fraction(1, 4))
        for s in range(5)
    ]
    local = LocalSystem.whole(problem_of([[r] for r in rows], None))
    right = subsystem._Krylov.solve

    def off(self: subsystem._Krylov, b: Floats, scale: Floats, goal: float) -> Floats | None:
        x = right(self, b, scale, goal)
        return None if x is None else x * wrong

    monkeypatch.setattr(subsystem._Krylov, "solve", off)
    found = solve_krylov(local, 1e-6, np.ones(5))
    assert found is None or np.all((found.lower <= 1.0) & (found.upper >= 1.0))


def test_a_walk_is_solved() -> None:
    n = 200
    matrix = np.eye(n) - 0.5 * np.eye(n, k=1) - 0.45 * np.eye(n, k=-1)
    right = np.linspace(1.0, 2.0, n)
    solution = np.linalg.solve(matrix, right)
    steps = bicgstab(lambda v: matrix @ v, lambda v: v / 1.0, right, np.ones(n))
    x = next(x for x, rest in steps if np.max(np.abs(rest)) < 1e-11)
    assert np.allclose(x, solution, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_sizes_that_cannot_be_measured_end_the_search(scale):
    """Squares that overflow or vanish: nothing is found, and nothing is looked for without end."""
    steps = list(
        itertools.islice(
            bicgstab(lambda v: v, lambda v: v, np.array([0.0, 1.0]), np.full(2, scale)), 3
        )
    )
    assert len(steps) < 3
