"""Transient analysis against matrix exponentials in rational arithmetic (Taylor series with a bound), and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import sparse_of
from symcheck.errors import NumericalError
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import tuning
from symcheck.numerics.settings import Accuracy
from symcheck.numerics.transient.poisson import poisson
from symcheck.numerics.transient.values import transient_distribution, transient_values


def integrate(
    rates: Floats,
    leave: Floats,
    terminal: list[Fraction],
    reward_rate: list[Fraction],
    time: Fraction,
) -> list[Fraction]:
    """x(time) for x' = Q x + reward_rate by its Taylor series in fractions; the rest is below 1e-30."""
    n = len(leave)
    q = [[Fraction(rates[i, j]) for j in range(n)] for i in range(n)]
    for i in range(n):
        q[i][i] -= Fraction(leave[i])
    total = list(terminal)
    term = list(terminal)
    size = float(leave.max()) * 2 * float(time)
    for k in range(1, int(3 * size) + 120):
        product = [
            sum((q[i][j] * term[j] for j in range(n) if q[i][j]), Fraction(0)) for i in range(n)
        ]
        source = reward_rate if k == 1 else [Fraction(0)] * n
        term = [(p + g) * time / k for p, g in zip(product, source, strict=True)]
        total = [a + b for a, b in zip(total, term, strict=True)]
    return total


@st.composite
def cases(draw: st.DrawFn) -> tuple[Floats, Floats, list[float], list[float], float]:
    n = draw(st.integers(1, 4))
    weights = st.lists(st.sampled_from([0.0, 0.0, 0.25, 1.0, 3.0]), min_size=n, max_size=n)
    rates = np.array([draw(weights) for _ in range(n)])
    outside = np.array(draw(weights))
    return (
        rates,
        rates.sum(1) + outside,
        draw(weights),
        draw(weights),
        draw(st.sampled_from([0.125, 1.0, 4.0])),
    )


@settings(max_examples=60, deadline=None)
@given(cases())
def test_values_and_distributions(
    case: tuple[Floats, Floats, list[float], list[float], float],
) -> None:
    rates, leave, terminal, reward_rate, time = case
    n = len(leave)
    exact = integrate(
        rates,
        leave,
        [Fraction(v) for v in terminal],
        [Fraction(v) for v in reward_rate],
        Fraction(time),
    )
    found = transient_values(
        TransitionKernel(sparse_of(rates), leave),
        time,
        Accuracy(),
        terminal=np.array(terminal),
        reward_rate=np.array(reward_rate),
    )
    slack = Fraction(1, 10**28)
    for s in range(n):
        assert Fraction(float(found.lower[s])) <= exact[s] + slack
        assert Fraction(float(found.upper[s])) >= exact[s] - slack
    assert np.all(
        found.upper - found.lower <= np.maximum(1e-6 * found.upper, 1e-300)
    )  # 0 is not told from what is below doubles
    initial = np.zeros(n)
    initial[0] = 1.0
    distribution = transient_distribution(
        TransitionKernel(sparse_of(rates), leave), initial, time, Accuracy()
    )
    for s in range(n):
        unit = [Fraction(int(i == s)) for i in range(n)]
        value = integrate(rates, leave, unit, [Fraction(0)] * n, Fraction(time))[0]
        assert Fraction(float(distribution.lower[s])) <= value + slack
        assert Fraction(float(distribution.upper[s])) >= value - slack


@pytest.mark.parametrize("rate", [0.0, 0.01, 1.0, 30.5, 1e4, 1e7])
def test_poisson_weights(rate: float) -> None:
    weights = poisson(rate)
    assert weights.values.sum() == pytest.approx(1.0, abs=1e-12)
    mean = float(np.arange(weights.left, weights.right + 1) @ weights.values)
    assert mean == pytest.approx(rate, rel=1e-9)
    for k in {weights.left, int(rate), weights.right}:
        exact = math.exp(k * math.log(rate) - rate - math.lgamma(k + 1)) if rate else 1.0
        assert weights.values[k - weights.left] == pytest.approx(exact, rel=1e-12 + 1e-14 * rate)
    assert weights.missing <= 1e-290


def test_nothing_is_left_after_the_last_weight() -> None:
    for weights in (poisson(100.0).masses(), poisson(100.0).tails()):
        assert weights.tail_sum(len(weights)) == 0.0
        assert weights.tail_sum(len(weights) + 7) == 0.0


@pytest.mark.parametrize("rate", [0.0, 0.3, 20.0, 2000.0])
@pytest.mark.parametrize("epsilon", [1e-3, 1e-6])
def test_what_the_weights_lack_is_bounded(rate: float, epsilon: float) -> None:
    """The sum of P(N = k) is 1, and that of P(N > k) is the rate."""
    window = poisson(rate, epsilon)
    numbers = range(window.left, window.right + 1)
    inside = sum(
        math.exp(k * math.log(rate) - rate - math.lgamma(k + 1)) if rate else 1.0 for k in numbers
    )
    assert 1.0 - inside <= window.masses().missing + 1e-12
    tails = replace(window, values=window.values * inside).tails()
    assert rate - tails.tail_sum(0) <= tails.missing + 1e-12 * rate


def exact_weight(rate: float, k: int) -> float:
    """P(N = k) for large k, by Stirling's series in 60 digits (the next term is below 1e-40)."""
    with localcontext() as context:
        context.prec = 60
        n, mean = Decimal(k), Decimal(rate)
        two_pi = Decimal("6.28318530717958647692528676655900576839433879875021164194989")
        log_factorial = n * n.ln() - n + (two_pi * n).ln() / 2 + 1 / (12 * n) - 1 / (360 * n**3)
        return float((n * mean.ln() - mean - log_factorial).exp())


@pytest.mark.parametrize("rate", [3.7e5, 1e8, 2e9 + 0.25, 1e11])
def test_weights_of_huge_rates_are_as_accurate_as_stated(rate: float) -> None:
    weights = poisson(rate)
    assert weights.error <= 1e-8
    deviation = math.isqrt(int(rate))
    for k in (int(rate) + i * deviation for i in (-8, -5, -1, 0, 2, 7)):
        exact = exact_weight(rate, k)
        assert abs(weights.values[k - weights.left] - exact) <= weights.error * exact


def test_a_horizon_beyond_the_proved_weights_is_refused() -> None:
    with pytest.raises(NumericalError, match="hint: check the property without the time bound"):
        poisson(1e200)


def test_states_that_hardly_stay_are_as_accurate_as_others() -> None:
    """The probability of still being there falls with the slow state; 1 - rate/q would be 0 there."""
    slow = np.array([1.0 - 2.0**-53, 1.0])
    found = transient_values(
        TransitionKernel(sparse_of(np.zeros((2, 2))), slow), 40.0, Accuracy(), terminal=np.ones(2)
    )
    exact = np.exp(-40.0 * slow)
    assert np.all((found.lower <= exact) & (exact <= found.upper))


def test_few_weights_of_a_huge_rate_are_kept() -> None:
    weights = poisson(1e11)
    assert len(weights.values) < 6e6
    assert weights.missing <= 1e-15
    mode = weights.values[int(1e11) - weights.left]
    assert mode == pytest.approx(1 / math.sqrt(2 * math.pi * 1e11), rel=1e-9)


def test_a_long_horizon_ends_early_and_right() -> None:
    """Failure of one of two redundant parts with fast repair, over 1e8 uniformisation steps: P(down by t) in closed form."""
    fail, repair, time = 1e-4, 10.0, 1e7
    rates = np.array([[0.0, 2 * fail], [repair, 0.0]])
    leave = np.array([2 * fail, repair + fail])
    found = transient_values(
        TransitionKernel(sparse_of(rates), leave),
        time,
        Accuracy(),
        reward_rate=np.array([0.0, fail]),
    )
    # Survival is a sum of two exponentials with the roots of x^2 + (3 fail + repair) x + 2 fail^2.
    b, c = 3 * fail + repair, 2 * fail * fail
    slow = 2 * c / (b + math.sqrt(b * b - 4 * c))
    fast = b - slow
    exact = 1.0 - (fast * math.exp(-slow * time) - slow * math.exp(-fast * time)) / (fast - slow)
    assert found.lower[0] <= exact * (1 + 1e-12)
    assert found.upper[0] >= exact * (1 - 1e-12)
    assert found.upper[0] - found.lower[0] <= 1e-6 * found.upper[0]
    assert found.iterations < 10_000


def test_tiny_probabilities_keep_their_digits() -> None:
    """Twenty steps within a short time: about (rate t)^20/20!, 1e-38."""
    n, time = 20, 0.01
    rates = np.diag(np.ones(n - 1), 1)
    found = transient_values(
        TransitionKernel(sparse_of(rates), np.ones(n)),
        time,
        Accuracy(),
        reward_rate=np.eye(n)[n - 1],
    )
    exact = sum(math.exp(-time) * time**k / math.factorial(k) for k in range(n, n + 20))
    assert found.lower[0] <= exact * (1 + 1e-12)
    assert found.upper[0] >= exact * (1 - 1e-12)
    assert found.upper[0] - found.lower[0] <= 1e-6 * exact


def test_only_the_states_of_interest_decide_when_to_stop() -> None:
    n = 150
    rates = np.zeros((n, n))
    rates[np.arange(n - 1), np.arange(1, n)] = 1.0
    everywhere = transient_values(
        TransitionKernel(sparse_of(rates), np.ones(n)),
        1.0,
        Accuracy(),
        reward_rate=np.eye(n)[n - 1],
    )
    last = transient_values(
        TransitionKernel(sparse_of(rates), np.ones(n)),
        1.0,
        Accuracy(),
        reward_rate=np.eye(n)[n - 1],
        interest=np.array([n - 1]),
    )
    assert last.iterations < everywhere.iterations
    assert last.upper[n - 1] == pytest.approx(1 - math.exp(-1))
    assert everywhere.lower[0] == pytest.approx(math.exp(-1 - math.lgamma(n + 1)), rel=0.02)


def test_products_are_enough() -> None:
    rates = np.array([[0.0, 1.0], [2.0, 0.0]])

    class Product:
        longest = 1

        def multiply(self, x: Floats) -> Floats:
            return np.asarray(rates @ x)

    whole = transient_values(
        TransitionKernel(sparse_of(rates), np.array([1.5, 2.0])),
        2.0,
        Accuracy(),
        terminal=np.ones(2),
    )
    product = transient_values(
        TransitionKernel(Product(), np.array([1.5, 2.0])), 2.0, Accuracy(), terminal=np.ones(2)
    )
    assert np.all(product.lower <= whole.upper)
    assert np.all(product.upper >= whole.lower)
    assert np.all(product.upper - product.lower <= 1e-6 * product.upper)


def test_negative_rewards_are_refused() -> None:
    with pytest.raises(NumericalError, match="non-negative"):
        transient_values(
            TransitionKernel(sparse_of(np.zeros((1, 1))), np.ones(1)),
            1.0,
            Accuracy(),
            terminal=-np.ones(1),
        )


def queue(n: int, arrive: float, serve: float) -> tuple[SparseMatrix, Floats, Floats]:
    """A queue that must never overflow: rates, exit rates, and the rate of overflowing."""
    rates = np.zeros((n, n))
    rates[np.arange(n - 1), np.arange(1, n)] = arrive
    rates[np.arange(1, n), np.arange(n - 1)] = serve
    overflow = np.zeros(n)
    overflow[-1] = arrive
    return sparse_of(rates), rates.sum(1) + overflow, overflow


def beside(
    slow: SparseMatrix, leave: Floats, m: int, arrive: float, serve: float
) -> tuple[SparseMatrix, Floats]:
    """A model and, independent of it, a queue of m states that turns away who finds it full: state (s, q) is s m + q."""
    fast = np.zeros((m, m))
    fast[np.arange(m - 1), np.arange(1, m)] = arrive
    fast[np.arange(1, m), np.arange(m - 1)] = serve
    n = slow.states
    dense = np.zeros((n, n))
    dense[np.repeat(np.arange(n), np.diff(slow.indptr)), slow.indices] = slow.data
    both = sparse_of(np.kron(dense, np.eye(m)) + np.kron(np.eye(n), fast))
    return both, np.repeat(leave, m) + np.tile(fast.sum(1), n)


@pytest.mark.parametrize("interest", [[0], [0, 3]])
def test_cutting_states_off_keeps_rare_events_right(
    monkeypatch: pytest.MonkeyPatch, interest: list[int]
) -> None:
    """Two queues, of which one is fast and never overflows in effect: most of its states do not matter, by 1e-60 or so."""
    slow, leave, overflow = queue(40, 1.0, 4.0)
    both, exits = beside(slow, leave, m := 30, 1.0, 200.0)
    reward_rate = np.repeat(overflow, m)
    starts = np.array(interest) * m
    alone = transient_values(
        TransitionKernel(slow, leave), 50.0, Accuracy(epsilon=1e-9), reward_rate=overflow
    )
    whole = transient_values(
        TransitionKernel(both, exits), 50.0, Accuracy(), reward_rate=reward_rate, interest=starts
    )
    monkeypatch.setattr(tuning, "TRUNCATION_ENTRIES", 1.0)
    cut = transient_values(
        TransitionKernel(both, exits), 50.0, Accuracy(), reward_rate=reward_rate, interest=starts
    )
    kept = int(cut.explanation.split()[0])
    assert f"{kept} of {len(exits)} states kept" in cut.explanation
    assert kept < 0.5 * len(exits)
    for s, t in zip(interest, starts.tolist(), strict=True):
        for found in (whole, cut):
            assert found.lower[t] <= alone.upper[s]
            assert found.upper[t] >= alone.lower[s]
            assert found.upper[t] - found.lower[t] <= 1e-6 * found.upper[t]
    assert alone.upper[0] < 1e-19
    assert np.all(cut.lower <= whole.upper)
    assert np.all(cut.upper >= whole.lower)


@pytest.mark.parametrize("length", [150, 1000])
def test_what_is_too_small_for_a_double_is_not_called_0(length: int) -> None:
    """A chain of states, one jump of rate 1 from each to the next, within a time of 0.01: 0.01**n exp(-0.01) / n! and a little more."""
    indptr = np.minimum(np.arange(length + 1), length - 1).astype(np.int64)
    rates = SparseMatrix(indptr, np.arange(1, length, dtype=np.int32), np.ones(length - 1), length)
    reward_rate = np.zeros(length)
    reward_rate[-1] = 1.0
    found = transient_values(
        TransitionKernel(rates, np.ones(length)),
        0.01,
        Accuracy(),
        reward_rate=reward_rate,
        interest=np.zeros(1, np.int64),
    )
    log10 = (length * math.log(0.01) - math.lgamma(length + 1.0)) / math.log(10.0)
    assert log10 < -500.0
    assert found.lower[0] == 0.0
    assert 0.0 < found.upper[0] <= 1e-299


def test_rare_events_are_found_implicitly_by_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    """Values from 1e-20 up: divided by what a resolvent says of them, they are alike, and a small space holds them all."""
    slow, leave, overflow = queue(40, 1.0, 4.0)
    both, exits = beside(slow, leave, m := 30, 1.0, 200.0)
    reward_rate, starts = np.repeat(overflow, m), np.zeros(1, np.int64)
    alone = transient_values(
        TransitionKernel(slow, leave), 50.0, Accuracy(epsilon=1e-10), reward_rate=overflow
    )
    for name, value in (
        ("KRYLOV_STEPS", 0.0),
        ("KRYLOV_ENTRIES", 0.0),
        ("TRUNCATION_ENTRIES", 1.0),
        ("SMOOTHING_STEPS", 50.0),
    ):
        monkeypatch.setattr(tuning, name, value)
    found = transient_values(
        TransitionKernel(both, exits), 50.0, Accuracy(), reward_rate=reward_rate, interest=starts
    )
    assert "rational Krylov" in found.explanation
    assert found.lower[0] <= alone.upper[0]
    assert found.upper[0] >= alone.lower[0]
    assert found.upper[0] - found.lower[0] <= 1e-6 * found.upper[0]
