"""Equations of some states copied together: rows that are left out, and what leaves."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from numerics.oracle import Row, System, component_block, problem_of

HALF, QUARTER = Fraction(1, 2), Fraction(1, 4)


def test_rows_that_only_loop_are_left_out_and_choices_still_name_the_rows_there_were() -> None:
    loop: Row = ({0: Fraction(1)}, Fraction(0), Fraction(0))
    system: System = [
        [loop, ({1: HALF}, QUARTER, HALF), loop, ({1: QUARTER}, QUARTER, 1 - QUARTER)],
        [({0: HALF}, QUARTER, HALF)],
    ]
    block = component_block(problem_of(system, "max"), [1, 0])
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
    block = component_block(problem_of(system, None), [0, 1], x=1.0)
    assert block.exit_masses().tolist() == [0.5, 0.5]
    assert np.asarray(block.data)[: block.entries].tolist() == [0.5, 0.5]
    assert block.constant_low[0] == pytest.approx(0.25, rel=1e-14)


def test_bounds_begin_at_the_least_and_the_greatest_value_on_leaving() -> None:
    system: System = [[({1: HALF}, Fraction(1, 8), HALF)], [({0: HALF}, Fraction(3, 8), HALF)]]
    block = component_block(problem_of(system, None), [0, 1])
    assert block.x.tolist() == [pytest.approx([0.25, 0.75])] * 2
    assert np.all(block.x[:, 0] <= 0.25)
    assert np.all(block.x[:, 1] >= 0.75)
