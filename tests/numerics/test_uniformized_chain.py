"""What is left to come when a chain has settled: the bounds against sums that go on to the end."""

from __future__ import annotations

import numpy as np
import pytest

from symcheck.kernels.graph.components import breadth_first_order
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.numerics.transient.poisson import poisson
from symcheck.numerics.transient.uniformized_chain import (
    OccupationBounds,
    UniformizedChain,
    uniformize,
)


def chain_of(rates: Floats, leave: Floats) -> tuple[UniformizedChain, Floats]:
    """The chain, and its matrix in full."""
    nonzero = rates > 0
    indptr = np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64)
    matrix = SparseMatrix(
        indptr, np.nonzero(nonzero)[1].astype(np.int32), rates[nonzero], len(rates)
    )
    chain = uniformize(matrix, leave)
    return chain, rates / chain.q + np.diag(chain.diagonal)


def visits_of(p: Floats, q: float, weights: Floats) -> Floats:
    """The expected time in each state from state 0 until the horizon: sum over i of P(N > i) P^i / q."""
    at, time = np.eye(len(p))[0], np.zeros(len(p))
    for w in weights:
        time += w * at
        at = at @ p
    return time / q


@pytest.mark.parametrize("seed", range(40))
def test_what_remains_lies_within_the_bounds(seed):
    """At every step, settled or not: from either bound the sum may not escape."""
    random = np.random.default_rng(seed)
    n, time = int(random.integers(2, 7)), float(random.choice([3.0, 20.0, 80.0]))
    rates = random.random((n, n)) * (random.random((n, n)) < 0.6)
    leave = rates.sum(1) + random.random(n) * random.choice([0.0, 0.001, 0.1]) + 1e-3
    chain, p = chain_of(rates, leave)
    weights = poisson(chain.q * time).tails()
    everything = weights.between(0, len(weights))
    visits = OccupationBounds(visits_of(p, chain.q, everything), leak=0.0)
    before = random.random(n)
    for k in range(1, len(weights), max(1, len(weights) // 15)):
        y = p @ before
        left, ahead = 0.0, y
        for w in everything[k:]:
            left += w * ahead[0]
            ahead = p @ ahead
        ratio, off = visits.settled(y, before, chain, weights.tail_sum(k))
        known = weights.powers(k, ratio) * y[0]
        assert 0.0 <= ratio <= 1.0
        assert known - off - 1e-12 <= left <= known + off + 1e-12
        before = y


def test_bounds_close_in_on_a_chain_that_decays():
    """Two states that lose 1 % a step: after some steps the ratio tells everything."""
    chain, p = chain_of(np.array([[0.5, 0.49], [0.49, 0.5]]), np.array([1.0, 1.0]))
    weights = poisson(chain.q * 200.0).tails()
    visits = OccupationBounds(visits_of(p, chain.q, weights.between(0, len(weights))), leak=1.0)
    before = np.array([1.0, 0.2])
    for _ in range(60):
        before, y = p @ before, p @ (p @ before)
    ratio, off = visits.settled(y, before, chain, weights.tail_sum(60))
    assert ratio == pytest.approx(0.99, rel=1e-12)
    assert off <= 1e-9 * weights.powers(60, ratio) * y[0]


def test_breadth_first_order_lists_all_states_by_distance() -> None:
    """0 -> 1 -> 2, and 3 that nobody reaches."""
    indptr, indices = np.array([0, 1, 2, 2, 3], dtype=np.int64), np.array([1, 2, 0], dtype=np.int32)
    assert breadth_first_order(
        indptr, indices, np.array([1, 0, 0, 0], dtype=np.uint8)
    ).tolist() == [
        0,
        1,
        2,
        3,
    ]
    assert breadth_first_order(
        indptr, indices, np.array([0, 0, 1, 0], dtype=np.uint8)
    ).tolist() == [
        2,
        0,
        1,
        3,
    ]
