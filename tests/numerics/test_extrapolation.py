"""Extrapolated sweeps: bounds that hold exactly, policies that attain them, and few sweeps where plain ones need very many."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from numerics.oracle import Row, System, brute_force, component_block, problem_of, solve_chain
from symcheck.numerics import tuning
from symcheck.numerics.linear.extrapolation import solve_extrapolated
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.linear.subsystem import Bounds
from symcheck.numerics.settings import Accuracy


@pytest.fixture(
    scope="module",
    autouse=True,
    params=[tuning.SLOW_EVALUATIONS, 0],
    ids=["by extrapolation", "by BiCGStab"],
)
def evaluation(request: pytest.FixtureRequest) -> Iterator[None]:
    """Policies are evaluated by extrapolation, or by BiCGStab from the first one on."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning, "SLOW_EVALUATIONS", request.param)
        yield


@st.composite
def leaking(draw: st.DrawFn, least: int = 1) -> Row:
    """A row over 4 unknowns that leaves with at least `least` parts of 64, of 2^10 or of 2^20."""
    whole = draw(st.sampled_from([64, 2**10, 2**20]))
    targets = draw(st.lists(st.integers(0, 3), min_size=1, max_size=3, unique=True))
    left, entries = whole - least, {}
    for place, target in enumerate(targets, 1):
        weight = draw(st.integers(1, left - (len(targets) - place)))
        entries[target] = Fraction(weight, whole)
        left -= weight
    return (
        entries,
        draw(st.sampled_from([Fraction(1, 64), Fraction(1), Fraction(0)])),
        1 - sum(entries.values()),
    )


systems = st.lists(st.lists(leaking(), min_size=1, max_size=3), min_size=4, max_size=4)


@pytest.mark.parametrize("relative", [True, False])
@pytest.mark.parametrize("direction", ["min", "max"])
@settings(max_examples=100, deadline=None)
@given(system=systems)
def test_bounds_hold_and_policies_attain_them(
    direction: str, relative: bool, system: System
) -> None:
    exact = brute_force(system, direction, proper_only=False)
    problem = problem_of(system, direction, probability=False)
    block = component_block(problem)
    found, _ = solve_extrapolated(block, 1e-6, relative)
    solved = solve_linear(problem, Accuracy(epsilon=1e-6, relative=relative))
    for bounds in filter(None, (found, solved)):
        for low, value, high in zip(bounds.lower, exact, bounds.upper, strict=True):
            assert Fraction(float(low)) <= value <= Fraction(float(high)) + Fraction(1, 10**300)
    if found is None:  # rounding forbids the width, or the proof takes too many sweeps
        return
    assert np.all(found.upper - found.lower <= 1e-6 * (found.upper if relative else 1.0))
    if found.policy is None:
        return
    flat = [row for choices in system for row in choices]
    values = solve_chain([flat[r] for r in block.global_rows(found.policy)])
    assert values is not None
    for low, value, high in zip(found.lower, values, found.upper, strict=True):
        assert (
            Fraction(float(low)) <= value
            if direction == "max"
            else value <= Fraction(float(high)) + Fraction(1, 10**300)
        )


@pytest.mark.parametrize("direction", ["min", "max"])
def test_a_width_below_the_rounding_of_large_values_is_not_proved(direction: str) -> None:
    """A margin of 1e-6 shrinks by 1e-12 in a step, and a sum of 2^20 is rounded by 1e-10."""
    leak = Fraction(1, 2**20)
    system: System = [
        [
            ({(s + 1) % 4: 1 - leak}, Fraction(1), leak),
            ({s: 1 - 2 * leak}, Fraction(2 if direction == "max" else 3), 2 * leak),
        ]
        for s in range(4)
    ]
    problem = problem_of(system, direction, probability=False)
    assert solve_extrapolated(component_block(problem), 1e-6, relative=False)[0] is None
    solved = solve_linear(problem, Accuracy(epsilon=1e-6, relative=False))
    assert (solved.lower <= 2.0**20).all()
    assert (solved.upper >= 2.0**20).all()
    assert (solved.upper - solved.lower).max() <= 1e-6, (
        "rational arithmetic proves what sweeps do not"
    )
    found, _ = solve_extrapolated(component_block(problem), 1e-6, relative=True)
    assert isinstance(found, Bounds)


@st.composite
def staying(draw: st.DrawFn) -> Row:
    """A row over 4 unknowns that never leaves, and costs something: whoever takes it for ever pays without end."""
    entries, _, rest = draw(leaking(least=2))
    place = draw(st.sampled_from(sorted(entries)))
    return (
        entries | {place: entries[place] + rest},
        draw(st.sampled_from([Fraction(1, 64), Fraction(1)])),
        Fraction(0),
    )


tempting = st.tuples(leaking(), st.lists(st.one_of(leaking(), staying()), max_size=2)).map(
    lambda rows: [rows[0], *rows[1]]
)


@pytest.mark.parametrize("relative", [True, False])
@settings(max_examples=100, deadline=None)
@given(system=st.lists(tempting, min_size=4, max_size=4))
def test_the_least_cost_where_some_policies_never_leave(relative: bool, system: System) -> None:
    exact = brute_force(system, "min", proper_only=True)
    found, _ = solve_extrapolated(
        component_block(problem_of(system, "min", probability=False)), 1e-6, relative
    )
    if found is None:
        assert min(exact) == 0
        return
    for low, value, high in zip(found.lower, exact, found.upper, strict=True):
        assert Fraction(float(low)) <= value <= Fraction(float(high)) + Fraction(1, 10**300)


def test_rows_that_lead_to_infinity_do_no_harm_to_the_least_cost() -> None:
    half = Fraction(1, 2)
    system: System = [
        [({1: half}, Fraction(1), half), ({0: half}, Fraction(1), half)],
        [({0: half}, Fraction(1), half)],
    ]
    problem = problem_of(system, "min", probability=False)
    problem.constant[0] = np.inf
    found, _ = solve_extrapolated(component_block(problem), 1e-6, relative=True)
    assert found is not None
    assert found.lower[0] <= 2.0 <= found.upper[0]
    assert found.lower[1] <= 2.0 <= found.upper[1]


@pytest.mark.parametrize("relative", [True, False])
def test_policies_that_stay_for_ever_and_seem_cheap(relative: bool) -> None:
    # The second row of state 0 costs 1/64 a round, and never leaves: extrapolated, its value runs away below 0.
    part = Fraction(1, 64)
    system: System = [
        [
            ({2: 63 * part}, Fraction(1), part),
            ({0: 62 * part, 3: part, 1: part}, Fraction(0), Fraction(0)),
        ],
        [({0: Fraction(1)}, Fraction(0), Fraction(0))],
        [({0: Fraction(1)}, Fraction(0), Fraction(0))],
        [({0: Fraction(1)}, Fraction(1), Fraction(0))],
    ]
    found, _ = solve_extrapolated(
        component_block(problem_of(system, "min", probability=False)), 1e-6, relative
    )
    assert isinstance(found, Bounds)
    for low, value, high in zip(found.lower, (64, 64, 64, 65), found.upper, strict=True):
        assert low <= value <= high


def walk(n: int, reward: bool) -> LinearProblem:
    """A symmetric walk on 1..n-1 that ends at 0 and n, with the choice of waiting in a side state (which costs a step)."""
    half = Fraction(1, 2)
    gain = Fraction(int(reward))
    system: System = []
    for s in range(n - 1):
        near = {t: half for t in (s - 1, s + 1) if 0 <= t < n - 1}
        won = half if s == n - 2 and not reward else gain
        system.append(
            [
                (near, won, 1 - sum(near.values(), Fraction(0))),
                ({n - 1 + s: Fraction(1)}, gain, Fraction(0)),
            ]
        )
    system += [[({s: Fraction(1)}, gain, Fraction(0))] for s in range(n - 1)]
    return problem_of(system, "min", probability=not reward)


def test_a_long_walk_takes_few_sweeps() -> None:
    n = 600
    found, sweeps = solve_extrapolated(component_block(walk(n, reward=True)), 1e-6, relative=True)
    assert found is not None
    place = np.arange(1.0, n)
    exact = place * (n - place)  # expected steps; waiting never helps
    assert np.all(found.lower[: n - 1] <= exact)
    assert np.all(exact <= found.upper[: n - 1])
    assert sweeps < n * n / 20  # plain sweeps need about n² per factor of e


@pytest.mark.parametrize("direction", ["min", "max"])
def test_a_queue_that_hardly_ever_overflows(direction: str) -> None:
    """An arrival has the probability 1/5; the other row of each state costs more, and serves less."""
    n, arrival, slow = 9, Fraction(1, 5), Fraction(1, 4)
    system: System = []
    for s in range(n):
        rows: list[Row] = []
        for up, cost in ((arrival, Fraction(1)), (slow, Fraction(2))):
            entries = {max(s - 1, 0): 1 - up}
            if s + 1 < n:
                entries[s + 1] = up
            rows.append((entries, cost, up if s + 1 == n else Fraction(0)))
        system.append(rows)
    exact = brute_force(system, direction, proper_only=False)
    assert min(exact) > 10**4
    problem = problem_of(system, direction, probability=False)
    found, _ = solve_extrapolated(component_block(problem), 1e-7, relative=True)
    assert found is not None
    for low, value, high in zip(found.lower, exact, found.upper, strict=True):
        assert Fraction(float(low)) <= value <= Fraction(float(high))


def test_a_chain_is_a_policy() -> None:
    block = component_block(
        problem_of([[r[0]] for r in _rows_of(walk(50, reward=True))], None, probability=False)
    )
    found, _ = solve_extrapolated(block, 1e-9, relative=True)
    assert found is not None
    assert found.policy is None
    assert np.all(np.abs(found.upper[:49] - np.arange(1.0, 50) * np.arange(49.0, 0, -1)) <= 1e-6)


def _rows_of(problem: LinearProblem) -> System:
    """The walk alone, without the side states."""
    m = problem.rows
    assert m.groups is not None
    out: System = []
    for s in range(49):
        r = int(m.groups[s])
        span = slice(int(m.indptr[r]), int(m.indptr[r + 1]))
        entries = {
            int(t): Fraction(float(p)) for t, p in zip(m.indices[span], m.data[span], strict=True)
        }
        out.append([(entries, Fraction(1), 1 - sum(entries.values(), Fraction(0)))])
    return out


def test_infinite_constants_are_left_to_others() -> None:
    problem = walk(10, reward=True)
    problem.constant[0] = np.inf
    block = component_block(
        LinearProblem(
            problem.constant, problem.matrix, exit=problem.exit, direction="max", probability=False
        )
    )
    assert solve_extrapolated(block, 1e-6, relative=True) == (None, 0)


def test_rounding_decides_how_near_proved_bounds_can_be() -> None:
    n = 20  # from every state it is 0.75 : 0.25 away from the exit, so that leaving takes some 3^20 steps
    rows: System = []
    for s in range(n):
        away = {min(s + 1, n - 1): Fraction(3, 4)}
        back = {s - 1: Fraction(1, 4)} if s else {}
        rows.append([(away | back, Fraction(1), Fraction(0) if s else Fraction(1, 4))] * 2)
    exact = solve_chain([choices[0] for choices in rows])
    assert exact is not None
    assert (
        solve_extrapolated(
            component_block(problem_of(rows, "max", probability=False)), 1e-9, relative=True
        )[0]
        is None
    )
    found, _ = solve_extrapolated(
        component_block(problem_of(rows, "max", probability=False)), 1e-3, relative=True
    )
    assert found is not None
    assert all(
        Fraction(float(low)) <= v <= Fraction(float(high))
        for low, v, high in zip(found.lower, exact, found.upper, strict=True)
    )
