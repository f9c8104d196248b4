"""Odd over a real manager, against enumeration of the truth table."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symcheck.dd.manager import Bdd, DiagramManager
from symcheck.dd.odd import Odd

K = 6
ROWS = [f"r{i}" for i in range(K)]
COLUMNS = [f"c{i}" for i in range(K)]


def manager() -> DiagramManager:
    m = DiagramManager()
    m.add_variables(name for pair in zip(ROWS, COLUMNS, strict=True) for name in pair)
    return m


def random_set(m: DiagramManager, rng: np.random.Generator, share: float) -> tuple[Bdd, np.ndarray]:
    member = rng.random(2**K) < share
    return m.bdd_table(ROWS, member), member


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.1, 0.6, 1.0]))
def test_numbers_arrays_and_diagrams(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    m = manager()
    states, member = random_set(m, rng, share)
    odd = Odd(m, states, ROWS)
    assert odd.count == len(odd) == member.sum()
    bits = odd.unrank(np.arange(odd.count))
    assert (bits @ (1 << np.arange(K)[::-1])).tolist() == np.flatnonzero(member).tolist()
    assert odd.rank(bits).tolist() == list(range(odd.count))

    other, flags = random_set(m, rng, 0.5)
    np.testing.assert_array_equal(odd.to_mask(other), flags[member])
    assert odd.from_mask(odd.to_mask(other)) == states & other

    values = rng.integers(0, 5, 2**K) / 3
    function = m.table(ROWS, values)
    np.testing.assert_array_equal(odd.to_vector(function), values[member])
    assert odd.from_vector(values[member]) == function * states.to_mtbdd()

    sub = Odd(m, states & other, ROWS)
    np.testing.assert_array_equal(sub.indices_in(odd), np.flatnonzero(flags[member]))


def test_it_survives_a_reordering_that_keeps_the_rows_in_order() -> None:
    m = manager()
    states, member = random_set(m, np.random.default_rng(1), 0.5)
    odd = Odd(m, states, ROWS)
    assert odd.count == member.sum()
    m.reorder(ROWS + COLUMNS)
    other, flags = random_set(m, np.random.default_rng(2), 0.5)
    np.testing.assert_array_equal(odd.to_mask(other), flags[member])
    m.reorder(ROWS[::-1] + COLUMNS)
    with pytest.raises(ValueError, match="reordered"):
        odd.to_mask(other)


def test_places_need_a_superset() -> None:
    m = manager()
    a, _ = random_set(m, np.random.default_rng(1), 0.5)
    with pytest.raises(ValueError, match="superset"):
        Odd(m, m.true, ROWS).indices_in(Odd(m, a, ROWS))


def test_arrays_of_another_length_are_refused() -> None:
    m = manager()
    odd = Odd(m, m.true, ROWS)
    with pytest.raises(ValueError, match="64"):
        odd.from_mask(np.ones(63, bool))
    with pytest.raises(ValueError, match="64"):
        odd.from_vector(np.ones(65))


def test_a_set_over_other_variables_is_refused() -> None:
    m = manager()
    with pytest.raises(ValueError, match="levels"):
        _ = Odd(m, m.variable("c0"), ROWS).count
