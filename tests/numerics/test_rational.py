"""Rational solutions against Gauss-Jordan elimination and brute force in fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import System, brute_force, solve_chain
from numerics.test_methods import attained, chains, mdps, restrict, split
from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.matrices.numbers import rationals
from symcheck.matrices.rows import SparseMatrix, starts_of
from symcheck.numerics.linear import rational
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem, Solution
from symcheck.numerics.settings import Accuracy


def problem_of(system: System, direction: str | None, probability: bool = True) -> LinearProblem:
    flat = [row for choices in system for row in choices]
    matrix = SparseMatrix(
        starts_of([len(r[0]) for r in flat]),
        np.array([t for r in flat for t in r[0]], dtype=np.int32),
        rationals(p for r in flat for p in r[0].values()),
        len(system),
        starts_of([len(c) for c in system]) if direction else None,
    )
    constant, leave = (rationals(r[i] for r in flat) for i in (1, 2))
    chosen = None if direction is None else Direction(direction)
    return LinearProblem(constant, matrix, None, leave, chosen, probability)


def solve(problem: LinearProblem) -> Solution:
    return solve_linear(problem, Accuracy())


@settings(max_examples=150, deadline=None)
@given(chains(reward=True))
def test_chains(chain: list) -> None:  # type: ignore[type-arg]
    assert solve(problem_of([[r] for r in chain], None, False)).lower.tolist() == solve_chain(chain)


def test_small_systems_need_no_flint() -> None:
    small, large = (rational.number_form(rational.SMALL_SYSTEM + k)(Fraction(1, 3)) for k in (0, 1))
    assert type(small) is Fraction
    assert type(large) is not Fraction
    assert rational.fractions([small, large]).tolist() == [small] * 2


@pytest.mark.parametrize("cheap", [0, 2, 10**6])
@settings(max_examples=60, deadline=None)
@given(chain=chains(reward=True))
def test_elimination_and_lifting_agree(chain: list, cheap: int) -> None:  # type: ignore[type-arg]
    rows = [{t: rational.flint_number(p) for t, p in r[0].items()} for r in chain]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rational, "CHEAP_PIVOT", cheap)
        found = rational._eliminate_and_lift(rows, [rational.flint_number(r[1]) for r in chain])
    assert rational.fractions(found).tolist() == solve_chain(chain)


@settings(max_examples=150, deadline=None)
@given(mdps(), st.sampled_from(["min", "max"]))
def test_probabilities_of_mdps(system: System, direction: str) -> None:
    zero, one = split(system, direction)
    maybe = set(range(len(system))) - zero - one
    if not maybe:
        return
    values = brute_force(system, direction, proper_only=False)
    part = restrict(system, maybe, one)
    found = solve(problem_of(part, direction))
    expected = [values[s] for s in sorted(maybe)]
    assert found.lower.tolist() == expected
    attained(
        part,
        Solution(np.zeros(0), np.zeros(0), "exact", strategy=found.strategy),
        expected,
        direction,
    )


@settings(max_examples=150, deadline=None)
@given(mdps(reward=True), st.sampled_from(["min", "max"]))
def test_rewards_of_mdps(system: System, direction: str) -> None:
    _, sure = split(
        [[(r[0], r[2], r[2]) for r in c] for c in system], "min" if direction == "max" else "max"
    )
    part = restrict(
        [[r for r in c if direction == "max" or set(r[0]) <= sure] for c in system], sure
    )
    if not sure:
        return
    assert solve(problem_of(part, direction, False)).lower.tolist() == brute_force(
        part, direction, direction == "min"
    )


def test_a_long_walk_is_exact() -> None:
    n = 400
    half = Fraction(1, 2)
    system: System = []
    for i in range(n):
        entries = {j: half for j in (i - 1, i + 1) if 0 <= j < n}
        system.append(
            [(entries, half if i == n - 1 else Fraction(0), 1 - sum(entries.values(), Fraction(0)))]
        )
    assert solve(problem_of(system, None)).lower.tolist() == [
        Fraction(i + 1, n + 1) for i in range(n)
    ]


def test_what_never_leaves_is_an_error() -> None:
    one = Fraction(1)
    with pytest.raises(NumericalError, match="infinite"):
        solve(problem_of([[({0: one}, one, Fraction(0))]], None, False))
    with pytest.raises(NumericalError, match="no unique solution"):
        solve(
            problem_of(
                [[({1: one}, one, Fraction(0))], [({0: one}, Fraction(0), Fraction(0))]],
                None,
                False,
            )
        )


@settings(max_examples=100, deadline=None)
@given(st.integers(1, 7), st.data())
def test_stationary_distributions(n: int, data: st.DataObject) -> None:
    """pi Q = 0 and the sum is 1, exactly."""
    rates = np.array(
        data.draw(
            st.lists(st.lists(st.integers(0, 3), min_size=n, max_size=n), min_size=n, max_size=n)
        ),
        dtype=float,
    )
    rates += np.roll(np.eye(n), 1, axis=1)  # irreducible
    nonzero = rates > 0
    matrix = SparseMatrix(
        np.concatenate(([0], np.cumsum(nonzero.sum(1)))).astype(np.int64),
        np.nonzero(nonzero)[1].astype(np.int32),
        rationals(rates[nonzero].tolist()),
        n,
    )
    pi = rational.stationary_distribution(matrix)
    assert sum(pi) == 1
    for j in range(n):
        flow = sum((pi[i] * Fraction(rates[i, j]) for i in range(n) if i != j), Fraction(0))
        assert flow == pi[j] * sum((Fraction(rates[j, i]) for i in range(n) if i != j), Fraction(0))


def test_a_stationary_distribution_of_many_states() -> None:
    """A grid of 900 states whose rates differ everywhere: elimination alone would take minutes."""
    side = 30
    entries: dict[int, dict[int, Fraction]] = {}
    for i in range(side):
        for j in range(side):
            row = {}
            for k, (a, b) in enumerate(((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1))):
                if 0 <= a < side and 0 <= b < side:
                    row[a * side + b] = Fraction(1 + (7 * i + 3 * j + k) % 5, 10)
            entries[i * side + j] = row
    matrix = problem_of([[(row, Fraction(0), Fraction(0))] for row in entries.values()], None).rows
    pi = rational.stationary_distribution(matrix)
    assert pi.sum() == 1
    flow = [Fraction(0)] * len(pi)
    for s, row in entries.items():
        for t, rate in row.items():
            flow[t] += pi[s] * rate
    assert flow == [p * sum(entries[s].values()) for s, p in enumerate(pi)]
