"""Equations of some states copied together: numbers of either width, rows that are left out, and what leaves."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import Row, System, problem_of
from symcheck.kernels.solve import component_bounds
from symcheck.numerics.linear.extrapolation import solve_extrapolated
from symcheck.numerics.linear.problem import LinearProblem

HALF, QUARTER = Fraction(1, 2), Fraction(1, 4)


def block_of(
    problem: LinearProblem, states: list[int], wide: bool = False, x: float = 0.0
) -> component_bounds.Block:
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
    return system.block(np.array(states, dtype=np.int32), np.full((problem.n, 2), x), wide)


@st.composite
def row(draw: st.DrawFn) -> Row:
    """A row over 3 unknowns that may leave."""
    parts = draw(st.lists(st.integers(0, 5), min_size=4, max_size=4).filter(lambda p: p[3] > 0))
    entries = {j: Fraction(p, 32) for j, p in enumerate(parts[:3]) if p}
    return entries, Fraction(parts[3], 64), 1 - sum(entries.values())


systems = st.lists(st.lists(row(), min_size=1, max_size=3), min_size=3, max_size=3)


@pytest.mark.parametrize("direction", [None, "min", "max"])
@settings(max_examples=40, deadline=None)
@given(system=systems)
def test_the_width_of_numbers_changes_no_digit(direction: str | None, system: System) -> None:
    problem = problem_of(system if direction else [rows[:1] for rows in system], direction)
    narrow, wide = (block_of(problem, [2, 0, 1], w) for w in (False, True))
    assert (narrow.indptr.dtype, wide.indptr.dtype) == (np.int32, np.int64)
    assert np.array_equal(narrow.groups, wide.groups)
    assert narrow.interval_iteration(1e-9, True, 7) == wide.interval_iteration(1e-9, True, 7)
    assert np.array_equal(narrow.x, wide.x)
    assert narrow.optimistic_value_iteration(1e-6, True, 500) == wide.optimistic_value_iteration(
        1e-6, True, 500
    )
    assert np.array_equal(narrow.x, wide.x)
    assert np.array_equal(narrow.policy, wide.policy)
    (one, _), (other, _) = (solve_extrapolated(b, 1e-6, True) for b in (narrow, wide))
    assert (one is None) == (other is None)
    if one is not None and other is not None:
        assert np.array_equal(one.lower, other.lower)
        assert np.array_equal(one.upper, other.upper)


def test_rows_that_only_loop_are_left_out_and_choices_still_name_the_rows_there_were() -> None:
    loop: Row = ({0: Fraction(1)}, Fraction(0), Fraction(0))
    system: System = [
        [loop, ({1: HALF}, QUARTER, HALF), loop, ({1: QUARTER}, QUARTER, 1 - QUARTER)],
        [({0: HALF}, QUARTER, HALF)],
    ]
    block = block_of(problem_of(system, "max"), [1, 0])
    assert block.rows == 3
    assert block.groups.tolist() == [0, 1, 3]
    assert block.global_rows(np.array([0, 0], dtype=np.int32)).tolist() == [4, 1]
    assert block.global_rows(np.array([-1, 1], dtype=np.int32)).tolist() == [-1, 3]


def test_what_leaves_counts_known_states_and_is_scaled_as_the_loop_is() -> None:
    system: System = [
        [({0: HALF, 1: QUARTER, 2: Fraction(1, 8)}, Fraction(0), Fraction(1, 8))],
        [({0: HALF}, Fraction(0), HALF)],
        [({}, Fraction(0), Fraction(1))],
    ]
    block = block_of(problem_of(system, None), [0, 1], x=1.0)
    assert block.exit_masses().tolist() == [0.5, 0.5]
    assert np.asarray(block.data)[: block.entries].tolist() == [0.5, 0.5]
    assert block.constant_low[0] == pytest.approx(0.25, rel=1e-14)


def test_bounds_begin_at_the_least_and_the_greatest_value_on_leaving() -> None:
    system: System = [[({1: HALF}, Fraction(1, 8), HALF)], [({0: HALF}, Fraction(3, 8), HALF)]]
    block = block_of(problem_of(system, None), [0, 1])
    assert block.x.tolist() == [pytest.approx([0.25, 0.75])] * 2
    assert np.all(block.x[:, 0] <= 0.25)
    assert np.all(block.x[:, 1] >= 0.75)
