"""Problems whose rows stay among those of all states: the same answers as with rows of their own."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import System, brute_force, solve_chain
from symcheck.matrices.rows import Bools, SparseMatrix
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import Solution
from symcheck.numerics.settings import Accuracy

Parts = list[int]  # of 32, per state

STATES, GOAL = 5, 3
"""State 3 is worth 1 and state 4 nothing; the others are unknown."""


@st.composite
def leaving(draw: st.DrawFn) -> Parts:
    """A row over five states, two of which are known, that leaves the unknowns at times."""
    cuts = sorted(draw(st.lists(st.integers(0, 31), min_size=4, max_size=4)))
    parts = [b - a for a, b in zip([0, *cuts], [*cuts, 32], strict=True)]
    return [parts[i] for i in draw(st.permutations(range(4)))] + [parts[4]]


models = st.lists(st.lists(leaving(), min_size=1, max_size=3), min_size=3, max_size=3)


def matrix_of(rows: list[list[Parts]], grouped: bool, scale: int = 32) -> SparseMatrix:
    """The rows of the unknowns and loops on the two others, in the order of the states."""
    everything = [*rows, [[0, 0, 0, 32, 0]], [[0, 0, 0, 0, 32]]]
    flat = [r for choices in everything for r in choices]
    indptr = np.cumsum([0] + [sum(p > 0 for p in r) for r in flat]).astype(np.int64)
    indices = np.array([j for r in flat for j, p in enumerate(r) if p], dtype=np.int32)
    data = np.array([p / scale for r in flat for p in r if p])
    groups = (
        np.cumsum([0] + [len(choices) for choices in everything]).astype(np.int64)
        if grouped
        else None
    )
    return SparseMatrix(indptr, indices, data, STATES, groups)


def oracle_of(rows: list[list[Parts]], gains: bool) -> System:
    return [
        [
            (
                {j: Fraction(p, 32) for j, p in enumerate(r[:3]) if p},
                Fraction(sum(r[:2]) + 1, 32) if gains else Fraction(r[GOAL], 32),
                Fraction(r[3] + r[4], 32),
            )
            for r in choices
        ]
        for choices in rows
    ]


def only(*states: int) -> Bools:
    return np.isin(np.arange(STATES), states)


def holds(found: Solution, exact: list[Fraction]) -> None:
    for low, value, high in zip(found.lower, exact, found.upper, strict=True):
        slack = Fraction(1, 10**12) * value if found.up_to_rounding else 0
        assert Fraction(float(low)) - slack <= value <= Fraction(float(high)) + slack
    assert found.certified
    assert found.width() <= 1e-6


@pytest.mark.parametrize("direction", [None, "min", "max"])
@settings(max_examples=60, deadline=None)
@given(rows=models)
def test_probabilities(direction: str | None, rows: list[list[Parts]]) -> None:
    rows = rows if direction else [choices[:1] for choices in rows]
    problem = MaskedProblem(
        matrix_of(rows, direction is not None), only(0, 1, 2), [(only(GOAL), 1.0)], None, direction
    )
    system = oracle_of(rows, gains=False)
    exact = (
        brute_force(system, direction, proper_only=False)
        if direction
        else solve_chain([c[0] for c in system])
    )
    assert exact is not None
    holds(solve_linear(problem, Accuracy()), exact)
    holds(solve_linear(problem.extract(), Accuracy()), exact)


@pytest.mark.parametrize("direction", [None, "min", "max"])
@settings(max_examples=60, deadline=None)
@given(rows=models)
def test_rewards(direction: str | None, rows: list[list[Parts]]) -> None:
    rows = rows if direction else [choices[:1] for choices in rows]
    gains = np.array([(sum(r[:2]) + 1) / 32 for choices in rows for r in choices] + [7.0, np.inf])
    problem = MaskedProblem(
        matrix_of(rows, direction is not None),
        only(0, 1, 2),
        (),
        gains,
        direction,
        probability=False,
    )
    system = oracle_of(rows, gains=True)
    exact = (
        brute_force(system, direction, proper_only=True)
        if direction
        else solve_chain([c[0] for c in system])
    )
    assert exact is not None
    holds(solve_linear(problem, Accuracy()), exact)
    holds(solve_linear(problem.extract(), Accuracy()), exact)


@settings(max_examples=60, deadline=None)
@given(rows=models, scale=st.integers(1, 100))
def test_rates_count_as_shares_of_their_row(rows: list[list[Parts]], scale: int) -> None:
    rows = [choices[:1] for choices in rows]
    problem = MaskedProblem(
        matrix_of(rows, False, scale), only(0, 1, 2), [(only(GOAL), 1.0)], rates=True
    )
    exact = solve_chain([c[0] for c in oracle_of(rows, gains=False)])
    assert exact is not None
    holds(solve_linear(problem, Accuracy()), exact)
    holds(solve_linear(problem.extract(), Accuracy()), exact)


@pytest.mark.parametrize("method", ["power", "interval"])
def test_other_methods_get_rows_of_their_own(method: str) -> None:
    problem = MaskedProblem(
        matrix_of([[[8, 8, 0, 8, 8]], [[0, 0, 16, 8, 8]], [[16, 0, 0, 0, 16]]], False),
        only(0, 1, 2),
        [(only(GOAL), 1.0)],
    )
    found = solve_linear(problem, Accuracy(method=method, epsilon=1e-9))
    assert found.method == method
    assert found.middle == pytest.approx(solve_linear(problem, Accuracy()).middle, rel=1e-6)


def test_end_components_are_collapsed() -> None:
    stay, leave = [0, 32, 0, 0, 0], [0, 0, 0, 8, 24]
    rows = [[stay], [[32, 0, 0, 0, 0], leave], [[0, 0, 0, 16, 16]]]
    for direction, value, ends in (("max", 0.25, True), ("min", 0.0, False)):
        problem = MaskedProblem(
            matrix_of(rows, True), only(0, 1, 2), [(only(GOAL), 1.0)], None, direction
        )
        assert problem.collapsible() is ends
        if ends:
            assert solve_linear(problem, Accuracy()).middle == pytest.approx([value, value, 0.5])


def test_edges_out_of_the_unknowns_make_no_cycle() -> None:
    rows = [[[0, 8, 8, 8, 8]], [[0, 0, 16, 8, 8]], [[0, 0, 16, 8, 8]]]
    found = solve_linear(
        MaskedProblem(matrix_of(rows, False), only(0, 1, 2), [(only(GOAL), 1.0)]), Accuracy()
    )
    assert "acyclic" in found.explanation
    rows[0] = [[0, 16, 16, 0, 0]]
    back = SparseMatrix(
        *(lambda m: (m.indptr, np.where(m.indices == 4, 0, m.indices).astype(np.int32), m.data))(
            matrix_of(rows, False)
        ),
        STATES,
    )
    assert (
        "acyclic"
        in solve_linear(
            MaskedProblem(back, only(1, 2), [(only(GOAL), 1.0)]), Accuracy()
        ).explanation
    )


@pytest.mark.parametrize(
    ("direction", "rates"), [(None, False), (None, True), ("min", False), ("max", False)]
)
def test_a_long_walk_between_two_known_ends(direction: str | None, rates: bool) -> None:
    n = 300
    inner = np.arange(1, n)
    indptr = np.concatenate(([0, 1], 1 + 2 * inner, [2 * n])).astype(np.int64)
    indices = np.concatenate(
        ([0], np.stack([inner - 1, inner + 1], axis=1).reshape(-1), [n])
    ).astype(np.int32)
    data = np.full(2 * n, 3.0 if rates else 0.5)
    data[[0, -1]] = 1.0
    groups = None if direction is None else np.arange(n + 2, dtype=np.int64)
    unknown = np.isin(np.arange(n + 1), inner)
    problem = MaskedProblem(
        SparseMatrix(indptr, indices, data, n + 1, groups),
        unknown,
        [(np.arange(n + 1) == n, 1.0)],
        None,
        direction,
        rates=rates,
    )
    found = solve_linear(problem, Accuracy())
    assert np.all(found.lower <= inner / n * (1 + 1e-12))
    assert np.all(found.upper >= inner / n * (1 - 1e-12))
    assert found.width() <= 1e-6
