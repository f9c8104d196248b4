"""Every method against exact fractions: the interval holds the true value, and is as narrow as asked."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import Row, System, brute_force, leaves, problem_of, solve_chain
from symcheck.matrices.operators import BoundStep
from symcheck.matrices.rows import Floats
from symcheck.numerics import graph
from symcheck.numerics.linear.methods import METHODS, solve_linear
from symcheck.numerics.linear.problem import LinearProblem, Solution
from symcheck.numerics.settings import Accuracy

SOUND = [m.name for m in METHODS.values() if m.sound and not m.is_rational]
TINY = Fraction(1, 10**300)


@st.composite
def rows(draw: st.DrawFn, n: int, reward: bool = False) -> Row:
    """A row over n unknowns, the target and the rest, in 64ths (now and then with a tiny weight)."""
    picks = draw(st.lists(st.integers(0, n + 1), min_size=1, max_size=4, unique=True))
    weights = draw(st.lists(st.integers(1, 16), min_size=len(picks), max_size=len(picks)))
    share = [Fraction(w, 64) for w in weights]
    share[0] += 1 - sum(share)
    entries = {p: w for p, w in zip(picks, share, strict=True) if p < n}
    into_target = dict(zip(picks, share, strict=True)).get(n, Fraction(0))
    gain = (
        draw(st.sampled_from([Fraction(0), Fraction(1), Fraction(3, 8)])) if reward else into_target
    )
    return entries, gain, 1 - sum(entries.values(), Fraction(0))


def inside(solution: Solution, exact: list[Fraction], slack: Fraction = Fraction(0)) -> None:
    for s, value in enumerate(exact):
        assert Fraction(float(solution.lower[s])) <= value + slack, (s, value, solution)
        upper = float(solution.upper[s])
        assert upper == np.inf or Fraction(upper) >= value - slack, (s, value, solution)


@st.composite
def chains(draw: st.DrawFn, reward: bool = False) -> list[Row]:
    n = draw(st.integers(1, 8))
    chain = [draw(rows(n, reward)) for _ in range(n)]
    free = leaves(chain)
    # What never leaves has been removed by graph analysis: cut it off (it is then an exit that pays nothing).
    return [
        (r[0], r[1], r[2]) if i in free else ({}, Fraction(0), Fraction(1))
        for i, r in enumerate(chain)
    ]


@pytest.mark.parametrize("method", SOUND)
@settings(max_examples=120, deadline=None)
@given(chain=chains())
def test_probabilities_of_chains(method: str, chain: list[Row]) -> None:
    exact = solve_chain(chain)
    assert exact is not None
    keep = {s for s, v in enumerate(exact) if v > 0}
    solution = solve_linear(
        problem_of(restrict([[r] for r in chain], keep), None), Accuracy(method=method)
    )
    inside(solution, [v for v in exact if v > 0], TINY)
    assert solution.certified
    assert solution.width() <= 1e-6


@pytest.mark.parametrize("method", [m for m in SOUND if METHODS[m].rewards])
@settings(max_examples=120, deadline=None)
@given(chain=chains(reward=True))
def test_rewards_of_chains(method: str, chain: list[Row]) -> None:
    exact = solve_chain(chain)
    assert exact is not None
    solution = solve_linear(problem_of([[r] for r in chain], None, False), Accuracy(method=method))
    inside(solution, exact, TINY)
    # Where leaving takes some ten thousand steps, bounds of values alone run out of iterations, and say so.
    assert solution.width() <= 1e-6 or (
        method == "optimistic" and "accuracy not reached" in solution.explanation
    )


@st.composite
def mdps(draw: st.DrawFn, reward: bool = False) -> System:
    n = draw(st.integers(1, 5))
    return [draw(st.lists(rows(n, reward), min_size=1, max_size=3)) for _ in range(n)]


def restrict(system: System, keep: set[int], ones: Set[int] = frozenset()) -> System:
    """The equations of the states in `keep`; `ones` have value 1, all others 0."""
    place = {s: i for i, s in enumerate(sorted(keep))}
    out: System = []
    for s in sorted(keep):
        out.append([])
        for entries, gain, leave in system[s]:
            kept = {place[t]: p for t, p in entries.items() if t in keep}
            gone = sum((p for t, p in entries.items() if t not in keep), Fraction(0))
            out[-1].append(
                (
                    kept,
                    gain + sum((p for t, p in entries.items() if t in ones), Fraction(0)),
                    leave + gone,
                )
            )
    return out


def split(system: System, direction: str) -> tuple[set[int], set[int]]:
    """States whose probability is 0 and 1, by the graph algorithms (tested on their own)."""
    n = len(system)
    full = [
        [sorted(r[0]) + ([n] if r[1] > 0 else []) + ([n + 1] if r[2] > r[1] else []) for r in c]
        for c in system
    ]
    full += [[[n]], [[n + 1]]]
    flat = [r for c in full for r in c]
    from symcheck.matrices.rows import SparseMatrix

    matrix = SparseMatrix(
        np.cumsum([0] + [len(r) for r in flat]).astype(np.int64), np.array([t for r in flat for t in r], dtype=np.int32),
        np.ones(sum(map(len, flat))), n + 2, np.cumsum([0] + [len(c) for c in full]).astype(np.int64),
    )  # fmt: skip
    everything, target = np.ones(n + 2, dtype=bool), np.arange(n + 2) == n
    zero = np.flatnonzero(graph.prob0(matrix, everything, target, direction))
    one = np.flatnonzero(graph.prob1(matrix, everything, target, direction))
    return {int(s) for s in zero if s < n}, {int(s) for s in one if s < n}


@pytest.mark.parametrize("direction", ["min", "max"])
@pytest.mark.parametrize("method", SOUND)
@settings(max_examples=120, deadline=None)
@given(system=mdps())
def test_probabilities_of_mdps_and_their_strategies(
    method: str, direction: str, system: System
) -> None:
    zero, one = split(system, direction)
    exact = brute_force(system, direction, proper_only=False)
    assert all(
        (exact[s] == 0) == (s in zero) and (exact[s] == 1) == (s in one) for s in range(len(system))
    )
    maybe = set(range(len(system))) - zero - one
    if not maybe:
        return
    part = restrict(system, maybe, one)
    values = [exact[s] for s in sorted(maybe)]
    solution = solve_linear(problem_of(part, direction), Accuracy(method=method))
    inside(solution, values, TINY)
    assert solution.width() <= 1e-6
    if method in ("topological", "policy"):
        attained(part, solution, values, direction)


def attained(system: System, solution: Solution, values: list[Fraction], direction: str) -> None:
    """The strategy's own value lies between the bounds, on the side that it should attain."""
    assert solution.strategy is not None
    first = np.cumsum([0] + [len(c) for c in system])
    chosen = [system[s][int(solution.strategy[s]) - first[s]] for s in range(len(system))]
    assert leaves(chosen) == set(range(len(system)))
    own = solve_chain(chosen)
    assert own is not None
    for s, value in enumerate(own):
        assert abs(value - values[s]) <= Fraction(3, 10**6) * values[s], (direction, s)


@pytest.mark.parametrize("direction", ["min", "max"])
@pytest.mark.parametrize("method", [m for m in SOUND if METHODS[m].rewards])
@settings(max_examples=120, deadline=None)
@given(system=mdps(reward=True))
def test_rewards_of_mdps(method: str, direction: str, system: System) -> None:
    """Reward until leaving; states where it is infinite are cut off first."""
    target: System = [[(r[0], r[2], r[2]) for r in c] for c in system]  # leaving is the target
    _, sure = split(target, "min" if direction == "max" else "max")
    if direction == "max":
        part = restrict([list(c) for c in system], sure)
    else:
        # Only rows that stay among the states with a strategy that leaves almost surely are of use.
        part = restrict([[r for r in c if set(r[0]) <= sure] for c in system], sure)
    if not sure or any(not c for c in part):
        return
    exact = brute_force(part, direction, proper_only=direction == "min")
    solution = solve_linear(problem_of(part, direction, False), Accuracy(method=method))
    inside(solution, exact, TINY)
    # Zeros among other values are known to 1e-30 only where no graph argument finds them.
    assert np.all(solution.upper - solution.lower <= 1e-6 * solution.upper + 1e-25)


@settings(max_examples=100, deadline=None)
@given(
    system=mdps(reward=True),
    signs=st.lists(st.booleans(), min_size=20, max_size=20),
    direction=st.sampled_from(["min", "max"]),
)
def test_negative_rewards(system: System, signs: list[bool], direction: str) -> None:
    """With some gains negated, where every strategy leaves almost surely."""
    _, sure = split([[(r[0], r[2], r[2]) for r in c] for c in system], "min")
    if not sure:
        return
    flip = iter(signs)
    part = restrict(
        [[(r[0], -r[1] if next(flip) else r[1], r[2]) for r in c] for c in system], sure
    )
    exact = brute_force(part, direction, proper_only=False)
    solution = solve_linear(problem_of(part, direction, False), Accuracy())
    inside(solution, exact, TINY)
    assert np.all(solution.upper - solution.lower <= 2e-6 * (1.0 + np.abs(solution.upper)))


def walk(n: int, up: float) -> LinearProblem:
    """Gambler's ruin: probability of passing state n before falling below state 1, from each of n states."""
    chain: System = []
    for i in range(n):
        entries = {j: Fraction(p) for j, p in ((i - 1, 1 - up), (i + 1, up)) if 0 <= j < n}
        chain.append(
            [
                (
                    entries,
                    Fraction(up) if i == n - 1 else Fraction(0),
                    1 - sum(entries.values(), Fraction(0)),
                )
            ]
        )
    return problem_of(chain, None)


@pytest.mark.parametrize(
    ("n", "up"), [(20, 0.5), (50, 0.25), (200, 0.25), (1000, 0.5), (1000, 0.375), (3000, 0.5)]
)
def test_gamblers_ruin_has_the_right_digits(n: int, up: float) -> None:
    """Down to 1e-222, and with 3 000 states, where sweeps would need millions of rounds."""
    q = (1 - Fraction(up)) / Fraction(up)
    exact = Fraction(1, n + 1) if q == 1 else (1 - q) / (1 - q ** (n + 1))
    solution = solve_linear(walk(n, up), Accuracy())
    assert Fraction(float(solution.lower[0])) <= exact <= Fraction(float(solution.upper[0]))
    assert solution.width() <= 1e-6


def haddad_monmege(n: int, choices: bool) -> LinearProblem:
    """n lucky steps in a row, to the left or to the right; any unlucky one starts again in the middle. Value 1/2.

    Value iteration that stops on small changes gives 0 here. With choices, an end component offers to wait.
    """
    half = Fraction(1, 2)
    middle, chain = 2 * (n - 1), []
    for side in range(2):
        for k in range(n - 1):
            there = side * (n - 1) + k
            last = k == n - 2
            entries = {middle: half} if last else {middle: half, there + 1: half}
            row = (entries, half if last and side else Fraction(0), half if last else Fraction(0))
            waits = ({there: Fraction(1)}, Fraction(0), Fraction(0))
            chain.append([row, waits] if choices else [row])
    chain.append([({0: half, n - 1: half}, Fraction(0), Fraction(0))])
    return problem_of(chain, "max" if choices else None)


@pytest.mark.parametrize("choices", [False, True])
@pytest.mark.parametrize("n", [20, 40, 100])
def test_haddad_monmege(n: int, choices: bool) -> None:
    solution = solve_linear(haddad_monmege(n, choices), Accuracy())
    middle = 2 * (n - 1)
    assert solution.lower[middle] <= 0.5 <= solution.upper[middle]
    assert solution.width() <= 1e-6
    assert solution.lower[-2] > solution.upper[0]


@pytest.mark.parametrize("choices", [False, True])
@pytest.mark.parametrize("n", [40, 1100, 2000])
def test_numbers_below_the_smallest_double_are_not_taken_for_0(n: int, choices: bool) -> None:
    """From the middle, one try succeeds with probability 2^(1 - n)."""
    solution = solve_linear(haddad_monmege(n, choices), Accuracy(max_iterations=2000))
    middle = 2 * (n - 1)
    assert solution.lower[middle] <= 0.5 <= solution.upper[middle]
    assert (solution.width() <= 1e-6) == (n < 1000)
    assert not solution.up_to_rounding or n < 1000


def test_a_value_below_the_smallest_double_is_not_exact() -> None:
    steps: System = [[({i + 1: Fraction(1, 8)}, Fraction(0), Fraction(7, 8))] for i in range(399)]
    solution = solve_linear(
        problem_of([*steps, [({}, Fraction(1, 8), Fraction(7, 8))]], None), Accuracy()
    )
    assert not solution.up_to_rounding
    assert (
        Fraction(float(solution.lower[0]))
        <= Fraction(1, 8) ** 400
        <= Fraction(float(solution.upper[0]))
    )


def test_the_power_method_is_an_estimate() -> None:
    solution = solve_linear(walk(20, 0.5), Accuracy(method="power"))
    assert not solution.certified
    assert solution.lower[0] == pytest.approx(1 / 21, rel=1e-3)


class ProductsOnly:
    """A matrix that can only be multiplied."""

    def __init__(self, problem: LinearProblem) -> None:
        m = problem.rows
        self.dense = np.zeros((m.rows, m.columns))
        for r in range(m.rows):
            for k in range(m.indptr[r], m.indptr[r + 1]):
                self.dense[r, m.indices[k]] += m.data[k]

    longest = 10

    def multiply(self, x: Floats) -> Floats:
        return np.asarray(self.dense @ x)

    def sweep(self, x: Floats, step: BoundStep, /) -> None:
        """One step of a chain: what is better than the bounds replaces them."""
        assert step.direction is None
        values = self.dense @ x + step.constant
        if step.upper:
            np.minimum(x, values * (1.0 + step.rounding_error), out=x)
        else:
            np.maximum(x, values * (1.0 - step.rounding_error), out=x)


@pytest.mark.parametrize("method", ["auto", "interval", "optimistic", "power"])
def test_products_are_enough_for_some_methods(method: str) -> None:
    problem = walk(10, 0.5)
    bare = LinearProblem(constant=problem.constant, operator=ProductsOnly(problem))
    solution = solve_linear(bare, Accuracy(method=method))
    assert solution.lower[0] == pytest.approx(1 / 11, rel=1e-4)
    assert solution.certified == (method != "power")


@pytest.mark.parametrize("method", ["interval", "optimistic"])
def test_bounds_that_stay_wide_for_thousands_of_steps_are_not_given_up(method: str) -> None:
    n = 60  # a fair walk on a line: for a long time the upper bound in the middle stays at 1, and the lower one near 0
    half = Fraction(1, 2)
    rows: list[list[Row]] = []
    for s in range(n):
        near = {t: half for t in (s - 1, s + 1) if 0 <= t < n}
        won = half if s == n - 1 else Fraction(0)
        rows.append(
            [
                (near, won, 1 - sum(near.values(), Fraction(0))),
                (near, won, 1 - sum(near.values(), Fraction(0))),
            ]
        )
    solution = solve_linear(problem_of(rows, "max"), Accuracy(method=method))
    assert solution.width() <= 1e-6
    assert solution.iterations > 1000
    inside(solution, [Fraction(s + 1, n + 1) for s in range(n)])


def test_steps_with_probability_1_round_nothing() -> None:
    """Time that passes by many steps of 1 leaves the digits as they are."""
    n, half = 20_000, Fraction(1, 2)
    certain: list[list[Row]] = [
        [({s + 1: Fraction(1)}, Fraction(0), Fraction(0))] for s in range(n)
    ]
    problem = problem_of([*certain, [({}, half, half)]], "min", probability=True)
    solved = solve_linear(replace(problem, error=0.0), Accuracy())
    assert solved.upper[0] - solved.lower[0] == solved.upper[n] - solved.lower[n] < 1e-15
