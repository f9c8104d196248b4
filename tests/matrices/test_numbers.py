"""Sparse matrices of rationals do what sparse matrices of doubles do."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from symcheck.matrices.numbers import full, is_infinite, is_rational, rationals, sum_segments
from symcheck.matrices.rows import SparseMatrix, starts_of


def both(seed: int) -> tuple[SparseMatrix, SparseMatrix]:
    """A random matrix of an MDP whose entries are small binary fractions, in both types of number."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 9))
    groups = starts_of(random.integers(1, 4, n))
    rows = [
        np.sort(random.choice(n, random.integers(0, n + 1), replace=False))
        for _ in range(groups[-1])
    ]
    indices = np.concatenate(rows).astype(np.int32)
    data = random.integers(1, 16, len(indices)) / 8
    doubles = SparseMatrix(starts_of([len(r) for r in rows]), indices, data, n, groups)
    return doubles, replace(doubles, data=rationals(data.tolist()))


def dense(matrix: SparseMatrix) -> list[list[Fraction]]:
    out = [[Fraction(0)] * matrix.columns for _ in range(matrix.rows)]
    for r in range(matrix.rows):
        for k in range(matrix.indptr[r], matrix.indptr[r + 1]):
            out[r][matrix.indices[k]] += Fraction(matrix.data[k])
    return out


def exact(values: np.ndarray) -> list[Fraction]:
    return [Fraction(v) for v in values]


@pytest.mark.parametrize("seed", range(20))
def test_operations_agree(seed: int) -> None:
    doubles, fractions = both(seed)
    random = np.random.default_rng(seed)
    n = doubles.states
    assert fractions.is_rational
    assert not doubles.is_rational
    assert np.array_equal(fractions.doubles().data, doubles.data)
    x = random.integers(-8, 8, n) / 4
    y = rationals(x.tolist())
    assert is_rational(fractions.multiply(y))
    assert exact(fractions.multiply(y)) == exact(doubles.multiply(x))
    left = random.integers(-8, 8, doubles.rows) / 4
    products = [Fraction(a) * np.array(row) for a, row in zip(left, dense(doubles), strict=True)]
    assert exact(doubles.multiply_left(left)) == list(sum(products))
    some, columns = random.random(n) < 0.6, random.random(n) < 0.5
    assert exact(fractions.sums(some, columns)) == exact(doubles.sums(some, columns))
    assert exact(fractions.sums(some, columns, y)) == exact(doubles.sums(some, columns, x))
    assert dense(fractions.among(some)) == dense(doubles.among(some))
    place = random.integers(0, 2, n).astype(np.int32)
    assert dense(fractions.merge(place, 2)) == dense(doubles.merge(place, 2))
    rows = random.permutation(doubles.rows)[: n + 1].astype(np.int64)
    assert dense(fractions.choose(rows)) == dense(doubles.choose(rows))
    divisor = 2.0 ** random.integers(0, 3, doubles.rows)
    assert dense(fractions.divided(rationals(divisor.tolist()))) == dense(doubles.divided(divisor))


def test_numbers_of_either_type() -> None:
    assert full(2, 1, rational=True).tolist() == [Fraction(1), Fraction(1)]
    assert full(2, 1, rational=False).tolist() == [1.0, 1.0]
    assert rationals([True, 0.5, np.inf]).tolist() == [Fraction(1), Fraction(1, 2), np.inf]
    assert is_infinite(rationals([1, np.inf, -np.inf])).tolist() == [False, True, True]
    assert is_infinite(np.array([1.0, -np.inf])).tolist() == [False, True]
    sums = sum_segments(rationals([1, 2, 3]), np.array([0, 0, 2, 2, 3]))
    assert sums.tolist() == [0, 3, 0, 3]
