"""Bounds by supermartingales are above the exact solution, and tiny where that is tiny."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import sparse_of
from symcheck.kernels.chains import supermartingale as kernel
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.linear.rational import solve_chain
from symcheck.numerics.settings import Accuracy
from symcheck.numerics.transient.supermartingale import bound_negligible_values
from symcheck.numerics.transient.values import transient_values

TIME = 10.0


def queue(capacity: int, up: float, down: float) -> tuple[SparseMatrix, Floats, Floats]:
    """A birth-death process with states below its capacity; its exit rates, and the rate of
    reaching the capacity.
    """
    rates = np.diag(np.full(capacity - 1, up), 1) + np.diag(np.full(capacity - 1, down), -1)
    entering = np.zeros(capacity)
    entering[-1] = up
    return sparse_of(rates), rates.sum(1) + entering, entering


def exact(
    rates: SparseMatrix, exit_rates: Floats, reward: Floats, killing: float
) -> list[Fraction]:
    """The solution of (killing - Q) v = reward in rational arithmetic."""
    owner = np.repeat(np.arange(rates.states), rates.lengths)
    leaving = [Fraction(float(x)) + Fraction(killing) for x in exit_rates]
    data = np.array(
        [Fraction(float(x)) / leaving[i] for i, x in zip(owner, rates.data, strict=True)]
    )
    jumps = SparseMatrix(rates.indptr, rates.indices, data, rates.columns)
    right = np.array([Fraction(float(r)) / x for r, x in zip(reward, leaving, strict=True)])
    return list(solve_chain(jumps, right))


@pytest.mark.parametrize(("up", "down"), [(1.0, 4.0), (1.0, 1.5), (0.2, 3.0), (3.0, 7.0)])
@pytest.mark.parametrize("capacity", [1, 2, 20, 60])
def test_the_bound_of_a_queue_is_above_the_exact_solution(
    capacity: int, up: float, down: float
) -> None:
    rates, leave, entering = queue(capacity, up, down)
    start = np.zeros(1, np.int64)
    bound = bound_negligible_values(rates, leave, TIME, entering, start, math.inf)
    assert bound is not None
    shift = tuning.SUPERMARTINGALE_SHIFT
    truth = exact(rates, leave, entering, shift / TIME)[0]
    assert Fraction(bound) >= truth * Fraction(math.exp(shift) * (1 - 1e-12))


@given(
    st.integers(1, 8).flatmap(
        lambda n: st.tuples(
            st.lists(
                st.lists(st.sampled_from([0.0, 0.0, 1e-6, 0.1, 1.0, 50.0]), min_size=n, max_size=n),
                min_size=n,
                max_size=n,
            ),
            st.lists(st.sampled_from([0.0, 0.0, 1e-3, 1.0, 7.0]), min_size=n, max_size=n),
            st.lists(st.sampled_from([0.0, 0.01, 2.0]), min_size=n, max_size=n),
        )
    ),
    st.sampled_from(tuning.SUPERMARTINGALE_EXPONENTS),
)
@settings(max_examples=150, deadline=None)
def test_the_constant_makes_a_supermartingale(
    drawn: tuple[list[list[float]], list[float], list[float]], exponent: float
) -> None:
    """u >= (killing - Q)^-1 reward, in rationals, for any chain and any costs."""
    table, reward, leak = (np.array(x, dtype=np.float64) for x in drawn)
    rates, killing = sparse_of(table), 0.5
    leave = table.sum(1) + leak
    chain = (*rates.arrays, leave + killing, reward)
    cost, order = np.full(len(reward), np.inf), np.arange(len(reward), dtype=np.int32)
    while kernel.relax(*chain, order, cost):
        pass
    constant = kernel.missing_constant(*chain, killing, cost, exponent, 1e-12)
    if not math.isfinite(constant):
        return
    truth = exact(rates, leave, reward, killing)
    for u, v in zip(np.exp(-exponent * cost) + constant, truth, strict=True):
        assert Fraction(float(u) * (1 + 1e-9)) >= v


def test_costs_are_those_of_the_cheapest_paths() -> None:
    rates, leave, entering = queue(3, 1.0, 4.0)
    chain = (*rates.arrays, leave, entering)
    cost = np.full(3, np.inf)
    assert kernel.relax(*chain, np.arange(3, dtype=np.int32)[::-1].copy(), cost)
    # Upwards from 2 and 1 with probability 1/5, from 0 with certainty.
    assert cost == pytest.approx(np.log([2.5 * 2.5, 2.5 * 2.5, 2.5]))
    assert not kernel.relax(*chain, np.arange(3, dtype=np.int32), cost)


@pytest.mark.parametrize("relative", [True, False])
def test_a_value_below_the_doubles_has_a_bound(
    relative: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The queue fills up with a probability of about 4^-700."""
    monkeypatch.setattr(tuning, "TRUNCATION_ENTRIES", 0.0)
    monkeypatch.setattr(tuning, "FORWARD_ENTRIES", math.inf)
    rates, leave, entering = queue(700, 1.0, 4.0)
    accuracy = Accuracy(epsilon=1e-6, relative=relative)
    result = transient_values(
        TransitionKernel(rates, leave),
        TIME,
        accuracy,
        reward_rate=entering,
        interest=np.zeros(1, np.int64),
    )
    assert "supermartingale" in result.explanation
    assert result.lower[0] == 0.0
    assert result.upper[0] <= (1e-299 if relative else 1e-6)
    assert result.upper[-1] >= 1.0


def test_no_bound_is_invented_where_the_chain_drifts_to_the_reward() -> None:
    rates, leave, entering = queue(700, 4.0, 1.0)
    assert bound_negligible_values(rates, leave, TIME, entering, np.zeros(1, np.int64), 0.1) is None


def test_a_reward_that_is_never_earned_is_0() -> None:
    table = np.array([[0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    reward = np.array([0.0, 0.0, 1.0])
    start = np.zeros(1, np.int64)
    found = bound_negligible_values(sparse_of(table), table.sum(1), TIME, reward, start, 1e-300)
    assert found == 0.0


@pytest.mark.parametrize("time", [0.0, math.inf])
def test_there_is_no_bound_without_a_horizon(time: float) -> None:
    rates, leave, entering = queue(9, 1.0, 4.0)
    assert bound_negligible_values(rates, leave, time, entering, np.zeros(1, np.int64), 1.0) is None


def test_a_stored_rate_of_0_is_no_jump() -> None:
    """The edge of rate 0 to the reward is short, but the way along the others is certain."""
    indptr, indices = np.array([0, 2, 3, 4, 4]), np.array([3, 1, 2, 3], np.int32)
    rates = SparseMatrix(indptr, indices, np.array([0.0, 1.0, 1.0, 1.0]), 4)
    leave, reward = np.array([1.0, 1.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
    start = np.zeros(1, np.int64)
    for enough in (1e-300, math.inf):
        found = bound_negligible_values(rates, leave, TIME, reward, start, enough)
        assert found is None or Fraction(found) >= exact(rates, leave, reward, 2.0)[0]


@pytest.mark.parametrize("reward", [(1e-200, 1e150), (1e-310, 0.0), (1e300, 1e-10)])
def test_rewards_at_the_ends_of_the_range(reward: tuple[float, float]) -> None:
    rates, leave = sparse_of(np.array([[3.0, 0.0], [0.0, 2.0]])), np.array([3.0, 2.0])
    rewards, start = np.array(reward), np.zeros(1, np.int64)
    found = bound_negligible_values(rates, leave, TIME, rewards, start, math.inf)
    truth = exact(rates, leave, rewards, tuning.SUPERMARTINGALE_SHIFT / TIME)[0]
    assert found is None or Fraction(found) >= truth


@given(
    st.integers(1, 6).flatmap(
        lambda n: st.tuples(
            *(
                st.lists(
                    st.one_of(st.just(0.0), st.floats(-12.0, 12.0).map(lambda x: 10.0**x)),
                    min_size=count,
                    max_size=count,
                )
                for count in (n * n, n, n)
            )
        )
    ),
    st.sampled_from([1e-6, 1.0, 1e6]),
)
@settings(max_examples=200, deadline=None)
def test_bounds_over_24_orders_of_magnitude(
    drawn: tuple[list[float], list[float], list[float]], time: float
) -> None:
    entries, reward, leak = (np.array(x) for x in drawn)
    n = len(reward)
    table = entries.reshape(n, n)
    if not reward.any():
        return
    rates, leave = sparse_of(table), table.sum(1) + leak
    start = np.zeros(1, np.int64)
    found = bound_negligible_values(rates, leave, time, reward, start, math.inf)
    if found is None or not math.isfinite(found):
        return
    shift = tuning.SUPERMARTINGALE_SHIFT
    truth = exact(rates, leave, reward, shift / time)[0]
    assert Fraction(found) >= truth * Fraction(math.exp(shift) * (1 - 1e-9))
