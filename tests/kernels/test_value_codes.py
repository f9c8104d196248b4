"""Numbers as codes: the table and the codes give back each number, and few bytes hold them."""

from __future__ import annotations

import numpy as np
import pytest

from symcheck.matrices.rows import SparseMatrix
from symcheck.matrices.value_codes import encode
from symcheck.numerics.transient.uniformized_chain import uniformize


@pytest.mark.parametrize(
    ("distinct", "kind"),
    [(1, np.uint8), (256, np.uint8), (257, np.uint16), (65_536, np.uint16), (65_537, np.float64)],
)
def test_codes_give_back_every_number(distinct: int, kind: type) -> None:
    rng = np.random.default_rng(distinct)
    values = np.cumsum(rng.random(distinct)) * 10.0 ** rng.integers(-300, 300)
    data = np.concatenate((values, rng.choice(values, 1000)))
    rng.shuffle(data)
    codes, table = encode(data)
    assert codes.dtype == kind
    if kind is np.float64:
        assert codes is data
    else:
        assert len(table) == distinct
        assert np.array_equal(table[codes], data)


def test_zeros_of_both_signs_have_one_code() -> None:
    codes, table = encode(np.array([0.0, -0.0, 1.0]))
    assert table.tolist() == [0.0, 1.0]
    assert codes.tolist() == [0, 0, 1]


def test_no_numbers_have_no_codes() -> None:
    codes, table = encode(np.empty(0))
    assert len(codes) == 0
    assert len(table) == 1


@pytest.mark.parametrize("distinct", [3, 1000, 70_000])
def test_a_step_of_the_uniformised_chain_does_not_depend_on_codes(distinct: int) -> None:
    rng = np.random.default_rng(distinct)
    n, degree = 20_000, 5
    data = 0.1 * (1.0 + rng.integers(distinct, size=n * degree))
    indices = rng.integers(n, size=n * degree).astype(np.int32)
    rates = SparseMatrix(np.arange(n + 1, dtype=np.int64) * degree, indices, data, n)
    exit_rates, y = rates.row_sums(), rng.random(n)
    q = float(exit_rates.max())
    entries = (data / q * y[indices]).reshape(n, degree)
    expected = (q - exit_rates) / q * y
    for k in range(degree):  # in the order of the entries, so that the digits are the same
        expected = expected + entries[:, k]
    total = np.zeros(n)
    found = uniformize(rates, exit_rates).advance(
        y.copy(), np.empty(n), total, np.array([0.5]), 0.0
    )
    assert np.array_equal(found[0], expected)
    assert np.array_equal(total, 0.5 * y)
    assert found[2] <= found[3]
