"""Long-run averages from the few states towards which a chain drifts enclose the exact ones."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import sparse_of
from symcheck.kernels.chains import drift as kernel
from symcheck.kernels.chains import gauss_seidel
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.long_run import drift, stationary
from symcheck.numerics.settings import Accuracy

MARGIN = 1e-12


def queue(capacity: int, up: float, down: float) -> SparseMatrix:
    """A birth-death process; its first state is the full queue."""
    n = capacity + 1
    here = np.arange(n)
    rows = np.concatenate((here[1:], here[:-1]))
    columns = np.concatenate((here[1:] - 1, here[:-1] + 1))
    data = np.concatenate((np.full(capacity, up), np.full(capacity, down)))
    order = np.lexsort((columns, rows))
    indptr = np.searchsorted(rows[order], np.arange(n + 1)).astype(np.int64)
    return SparseMatrix(indptr, columns[order].astype(np.int32), data[order], n)


def exact_average(rates: SparseMatrix, rewards: Floats) -> Fraction:
    """The long-run average in rational arithmetic."""
    data = np.array([Fraction(float(x)) for x in rates.data])
    rational = SparseMatrix(rates.indptr, rates.indices, data, rates.columns)
    values = np.array([Fraction(float(x)) for x in rewards])
    average = stationary.long_run_average(rational, values, Accuracy(epsilon=0.0))
    assert average.lower == average.upper
    return Fraction(average.lower)


def mean_length(capacity: int, load: Fraction) -> Fraction:
    """The mean of the truncated geometric distribution."""
    weights = [load**k for k in range(capacity + 1)]
    return sum((k * w for k, w in enumerate(weights)), Fraction(0)) / sum(weights)


@pytest.mark.parametrize(("up", "down"), [(1.0, 4.0), (1.0, 2.0), (3.0, 4.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_mean_length_of_a_queue(
    up: float, down: float, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its capacity is so large that only a small part of the states is the core."""
    monkeypatch.setattr(tuning, "DRIFT_STATES", 0)
    monkeypatch.setattr(tuning, "ELIMINATION_STATES", 0)
    monkeypatch.setattr(tuning, "SMALL_CHAIN_STATES", 0)
    capacity = 20_000
    rates, length = queue(capacity, up, down), np.arange(capacity, -1, -1.0)
    average = stationary.long_run_average(rates, sign * length, Accuracy(epsilon=1e-6))
    assert "drift towards" in average.explanation
    load = Fraction(up) / Fraction(down)
    truth = Fraction(sign) * mean_length(300, load)  # to more than 30 digits
    assert average.lower <= truth <= average.upper
    assert average.upper - average.lower <= 1e-6 * abs(truth)


@pytest.mark.parametrize(("up", "down"), [(1.0, 1.0), (1.0, 1.05)])
def test_a_chain_that_is_in_many_states_has_no_core(up: float, down: float) -> None:
    rates = queue(1_000, up, down)
    leave = gauss_seidel.exit_rates(*rates.arrays)
    assert drift.average_by_drift(rates, leave, np.arange(1_001.0), lambda *_: np.empty(0)) is None


chains = st.integers(2, 6).flatmap(
    lambda n: st.tuples(
        st.lists(
            st.lists(st.sampled_from([0.0, 0.0, 1e-6, 0.1, 1.0, 50.0]), min_size=n, max_size=n),
            min_size=n,
            max_size=n,
        ),
        *(st.lists(st.floats(-20.0, 20.0), min_size=n, max_size=n) for _ in range(3)),
    )
)


@given(chains, st.booleans())
@settings(max_examples=200, deadline=None)
def test_any_solution_and_any_lyapunov_function_prove_bounds(
    drawn: tuple[list[list[float]], list[float], list[float], list[float]], least: bool
) -> None:
    """The bounds enclose the average whatever h and w are, if w drifts outside of the core."""
    table, rewards, h, logarithm = (np.array(x) for x in drawn)
    n = len(rewards)
    table[np.arange(n), (np.arange(n) + 1) % n] += 0.5  # irreducible
    rates, falls = sparse_of(table), np.empty(n)
    kernel.drift(*rates.arrays, logarithm, MARGIN, falls)
    core: Bools = falls >= 0.0
    if not least:
        core = core | (rewards > 0.0)
    assert core.any()  # no w falls everywhere
    found = drift._bounds(rates, rewards, h, core, logarithm, falls)
    assert Fraction(found.lower) <= exact_average(rates, rewards) <= Fraction(found.upper)


def test_costs_rise_along_unlikely_jumps_only() -> None:
    rates = queue(3, 1.0, 4.0)
    leave = gauss_seidel.exit_rates(*rates.arrays)
    cost = np.array([np.inf, np.inf, np.inf, 0.0])
    order = np.array([3, 2, 1, 0], dtype=np.int32)
    assert not kernel.spread(*rates.arrays, leave, order, cost)
    # Out of the empty queue with certainty, then with probability 1/5.
    assert cost == pytest.approx(np.log([2.5 * 2.5, 2.5, 1.0, 1.0]))
    # Against the order of distance, states become cheaper after their turns.
    again, passes = np.array([np.inf, np.inf, np.inf, 0.0]), 1
    while kernel.spread(*rates.arrays, leave, order[::-1].copy(), again):
        passes += 1
    assert passes == 4
    assert np.array_equal(again, cost)


@given(chains)
@settings(max_examples=100, deadline=None)
def test_the_drift_is_an_upper_bound(
    drawn: tuple[list[list[float]], list[float], list[float], list[float]],
) -> None:
    table, _, _, logarithm = (np.array(x) for x in drawn)
    rates, found = sparse_of(table), np.empty(len(table))
    kernel.drift(*rates.arrays, logarithm, MARGIN, found)
    growth = np.exp(logarithm[None, :] - logarithm[:, None]) - 1.0
    truth = (table * growth).sum(1)
    size = (table * (growth + 2.0)).sum(1)
    assert np.all(truth <= found)
    assert np.all(found <= truth + 2e-12 * size)


def test_the_drift_of_a_long_row_is_an_upper_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """200,000 small rates are lost one by one when they are added to a large one."""
    n = 200_000
    indptr = np.concatenate(([0, n + 1], np.arange(n + 2, 2 * n + 3))).astype(np.int64)
    first = np.concatenate(([1], np.arange(2, n + 2)))
    indices = np.concatenate((first, np.zeros(n + 1))).astype(np.int32)
    data = np.concatenate(([1.0], np.full(n, 0.6e-16), np.full(n + 1, 1e3)))
    rates = SparseMatrix(indptr, indices, data, n + 2)
    drifts: list[Floats] = []
    prove = drift._bounds

    def watched(*args: object) -> drift.CoreBounds:
        drifts.append(np.array(args[-2]))
        return prove(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(drift, "_bounds", watched)
    monkeypatch.setattr(drift, "_raised", lambda *_: np.r_[0.0, np.full(n + 1, 1 / exponent)])
    monkeypatch.setattr(drift, "_visits", lambda _: np.r_[1, np.zeros(n + 1, np.int64)])
    monkeypatch.setattr(tuning, "CORE_SHARE", 1.0)
    exponent = tuning.DRIFT_EXPONENTS[0]
    leave = gauss_seidel.exit_rates(*rates.arrays)
    drift.average_by_drift(rates, leave, np.zeros(n + 2), lambda m, _: np.zeros(m.states))
    truth = (Fraction(1.0) + n * Fraction(0.6e-16)) * (Fraction(np.e) - 1)
    assert Fraction(float(drifts[0][0])) >= truth * (1 - Fraction(1, 10**15))


def test_raised_costs_drift() -> None:
    """Where a rare jump is far dearer than the way back is cheap, the cost before it is raised."""
    table = np.array([[0.0, 0.2, 0.0], [3.0, 0.0, 0.2], [0.0, 3.0, 0.0]])
    rates, leave, found = sparse_of(table), table.sum(1), np.empty(3)
    cost = np.array([0.0, 1.0, 9.0])
    kernel.drift(*rates.arrays, cost, MARGIN, found)
    assert found[1] > 0.0
    assert kernel.raise_costs(*rates.arrays, leave, cost, 1.0, 1e-5, 0.5) == 1
    kernel.drift(*rates.arrays, cost, MARGIN, found)
    assert cost[1] > 1.0
    assert np.all(found[1:] < 0.0)


def test_a_path_visits_states_as_often_as_it_jumps() -> None:
    rates = queue(40, 1.0, 4.0)
    visits = np.zeros(41, np.int64)
    uniform = np.random.default_rng(3).random(10_000)
    kernel.walk(*rates.arrays, rates.row_sums(), uniform, 0, visits)
    assert visits.sum() == 10_000
    assert int(np.argmax(visits)) in (39, 40)
    # The embedded chain is in state 39 with probability 1/2 + 1/8 - 1/4, and in 40 with 3/8.
    assert visits[40] / 10_000 == pytest.approx(0.375, abs=0.03)


def test_a_core_that_each_jump_leaves_proves_nothing_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    """A state with jumps to three others, from which the chain returns."""
    for name in ("DRIFT_STATES", "ELIMINATION_STATES", "SMALL_CHAIN_STATES"):
        monkeypatch.setattr(tuning, name, 0)
    monkeypatch.setattr(tuning, "CORE_SHARE", 1.0)
    monkeypatch.setattr(tuning, "CORE_RISE", 0.0)
    monkeypatch.setattr(tuning, "CORE_FREQUENT", 1.0)
    table = np.zeros((4, 4))
    table[0, 1:], table[1:, 0] = 1.0, (1.0, 1.5, 2.0)
    rates, rewards = sparse_of(table), np.array([0.0, 3.0, 1.0, 7.0])
    average = stationary.long_run_average(rates, rewards, Accuracy(epsilon=1e-6))
    assert average.lower <= exact_average(rates, rewards) <= average.upper
