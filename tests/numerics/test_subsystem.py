"""BiCGStab gives candidates; the bounds made from them hold the true values, whatever the candidate was."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import Row, leaves, problem_of, solve_chain
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear import subsystem
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
    found = solve_krylov(LocalSystem.whole(problem_of([[r] for r in rows], None)), 1e-6)
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
    right = subsystem._BiCGStab.solve

    def off(
        self: subsystem._BiCGStab, b: Floats, scale: Floats | None, goal: float
    ) -> Floats | None:
        x = right(self, b, scale, goal)
        return None if x is None else x * wrong

    monkeypatch.setattr(subsystem._BiCGStab, "solve", off)
    found = solve_krylov(local, 1e-6)
    assert found is None or np.all((found.lower <= 1.0) & (found.upper >= 1.0))
