"""Shared objects are numbered by identity, in the order in which they occur first."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from symcheck.kernels.rows.shared_objects import group_identical


def test_objects_are_numbered_by_identity() -> None:
    half, other_half, third = Fraction(1, 2), Fraction(1, 2), Fraction(1, 3)
    codes, firsts = group_identical([half, third, half, other_half, other_half, third])
    assert codes.tolist() == [0, 1, 0, 2, 2, 1]
    assert firsts.tolist() == [0, 1, 3]


def test_a_list_without_objects_has_no_numbers() -> None:
    codes, firsts = group_identical([])
    assert len(codes) == len(firsts) == 0


def test_more_objects_than_the_first_table_holds() -> None:
    known = [Fraction(1, i + 1) for i in range(10_000)]
    places = np.random.default_rng(1).integers(0, len(known), 50_000).tolist()
    values: list[object] = [known[i] for i in places]
    codes, firsts = group_identical(values)
    assert len(firsts) == len(set(places))
    assert all(values[firsts[code]] is value for code, value in zip(codes, values, strict=True))
