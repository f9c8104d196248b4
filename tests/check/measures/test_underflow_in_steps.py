"""Bounded numbers of steps whose probabilities underflow, against products of fractions.

A value that is positive by the graph is never called 0, and never decides a verdict as 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from random import Random

import pytest

import symcheck
from symcheck.check.result import Certified, Exact, Result

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")
Choice = list[tuple[str, int]]
"""The probability of each successor, as the text of the model has it."""
Process = list[list[Choice]]
Column = list[Fraction]
Optimum = Callable[[Iterable[Fraction]], Fraction]

PROBABILITIES = ("1e-100", "1e-150", "1e-200", "1e-300", "1e-307", "1e-16", "1e-8", "0.5")
TWO_JUMPS = """dtmc
module m
  s : [0..3] init 0;
  [] s=0 -> 1e-200:(s'=1) + 1-1e-200:true;
  [] s=1 -> 1e-200:(s'=2) + 1-1e-200:true;
  [] s>1 -> true;
endmodule
rewards "steps" true : 1; endrewards
rewards "goal" s=2 : 1; endrewards
"""
SQUARE = Fraction("1e-400")


def text_of(process: Process, kind: str) -> str:
    """The model; state s earns s."""
    commands = [
        f"[a{c}] s={s} -> " + " + ".join(f"{p}:(s'={t})" for p, t in choice) + ";"
        for s, choices in enumerate(process)
        for c, choice in enumerate(choices)
    ]
    return (
        f"{kind} module m s:[0..{len(process) - 1}] init 0; {' '.join(commands)} endmodule "
        'rewards "r" true : s + 1; endrewards'
    )


def drawn(random: Random, kind: str) -> Process:
    """Some states with rows of one to three extreme probabilities, and what is left to 1."""
    n = random.randint(3, 5)

    def choice() -> Choice:
        small = [random.choice(PROBABILITIES) for _ in range(random.randint(0, 2))]
        if sum(map(Fraction, small)) >= 1:
            small = small[:1]
        rest = "-".join(["1", *small])
        return [(p, random.randrange(n)) for p in [*small, rest]]

    return [
        [choice() for _ in range(random.randint(1, 2) if kind == "mdp" else 1)] for _ in range(n)
    ]


def number(text: str) -> Fraction:
    """1-p-q, or p."""
    first, *others = map(
        Fraction, text.replace("e-", "e_").replace("-", " ").replace("_", "-").split()
    )
    return first - sum(others)


def step(process: Process, x: Column, optimum: Optimum) -> Column:
    """The expected value of the next state."""
    return [
        optimum([sum((number(p) * x[t] for p, t in choice), Fraction(0)) for choice in choices])
        for choices in process
    ]


def until(process: Process, left: set[int], goal: int, a: int, b: int, optimum: Optimum) -> Column:
    """The probability of `left U[a,b] goal`."""
    x = [Fraction(s == goal) for s in range(len(process))]
    for _ in range(b - a):
        y = step(process, x, optimum)
        x = [Fraction(1) if s == goal else y[s] * (s in left) for s in range(len(process))]
    for _ in range(a):
        x = [v * (s in left) for s, v in enumerate(step(process, x, optimum))]
    return x


def within_cost(process: Process, goal: int, budget: int, optimum: Optimum) -> Fraction:
    """The probability that `goal` is reached from state 0 at a cost of at most `budget`."""
    known: dict[int, Column] = {}
    for left in range(-len(process), budget + 1):
        known[left] = [
            Fraction(left >= 0)
            if s == goal
            else optimum(
                [
                    sum((number(p) * known[left - s - 1][t] for p, t in choice), Fraction(0))
                    if left > s
                    else Fraction(0)
                    for choice in choices
                ]
            )
            for s, choices in enumerate(process)
        ]
    return known[budget][0]


def earned(process: Process, steps: int, optimum: Optimum, *, at_end: bool) -> Fraction:
    """The reward of all steps, or of the state after them, from state 0."""
    rewards = [Fraction(s + 1) for s in range(len(process))]
    x = rewards if at_end else [Fraction(0)] * len(process)
    for _ in range(steps):
        y = step(process, x, optimum)
        x = y if at_end else [r + v for r, v in zip(rewards, y, strict=True)]
    return x[0]


def measures(process: Process, random: Random, sign: str) -> dict[str, Fraction]:
    """Properties without their operator, and their values in state 0."""
    optimum, dual = (min, max) if sign == "min" else (max, min)
    n, goal, k, a = (
        len(process),
        random.randrange(len(process)),
        random.randint(1, 4),
        random.randint(1, 2),
    )
    everywhere, left = set(range(n)), {0, *random.sample(range(n), 2)}
    inside = "|".join(f"s={s}" for s in left)
    return {
        f"P [ F<={k} s={goal} ]": until(process, everywhere, goal, 0, k, optimum)[0],
        f"P [ F={k} s={goal} ]": until(process, everywhere, goal, k, k, optimum)[0],
        f"P [ ({inside}) U[{a},{a + k}] s={goal} ]": until(process, left, goal, a, a + k, optimum)[
            0
        ],
        f"P [ G<={k} s!={goal} ]": 1 - until(process, everywhere, goal, 0, k, dual)[0],
        f"P [ X s={goal} ]": until(process, everywhere, goal, 1, 1, optimum)[0],
        f"P [ X s!={goal} ]": 1 - until(process, everywhere, goal, 1, 1, dual)[0],
        f'P [ F{{"r"}}<={k + 2} s={goal} ]': within_cost(process, goal, k + 2, optimum),
        f'P [ G{{"r"}}<={k + 2} s!={goal} ]': 1 - within_cost(process, goal, k + 2, dual),
        f"R [ I={k} ]": earned(process, k, optimum, at_end=True),
        f"R [ C<={k} ]": earned(process, k, optimum, at_end=False),
    }


def is_true(result: Result, exact: Fraction) -> bool:
    """Whether the value and its accuracy are true of the exact value."""
    error = Fraction(1, 10**12)
    match result.accuracy:
        case Exact(rounding=False):
            return Fraction(result.value) == exact  # type: ignore[arg-type]
        case Exact():
            return abs(Fraction(result.value) - exact) <= error * exact  # type: ignore[arg-type]
        case Certified(lower, upper):
            return Fraction(lower) * (1 - error) <= exact <= Fraction(upper) * (1 + error)
        case _:
            return False


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("seed", range(4))
def test_values_and_verdicts_are_those_of_fractions(engine: str, kind: str, seed: int) -> None:
    random = Random(f"{kind} {seed}")
    process = drawn(random, kind)
    model = symcheck.loads(text_of(process, kind), engine=engine)
    for sign in ("min", "max") if kind == "mdp" else ("",):
        for path, exact in measures(process, random, sign).items():
            operator, rest = path[0], path[1:]
            result = model.check(f"{operator}{sign}=? {rest}")
            assert is_true(result, exact), (path, result, float(exact))
            bounds = {
                "min": [(">0", exact > 0), (">=1", exact >= 1), (">1e-399", exact > 10 * SQUARE)],
                "max": [("<=0", exact <= 0), ("<1", exact < 1)],
            }
            for bound, expected in bounds.get(sign, bounds["min"] + bounds["max"]):
                assert bool(model.check(f"{operator}{bound} {rest}")) is expected, (path, bound)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_positive_product_of_probabilities_is_not_0(engine: str) -> None:
    model = symcheck.loads(TWO_JUMPS, engine=engine)
    for formula in (
        "P=? [ F<=2 s=2 ]",
        'P=? [ F{"steps"}<=2 s=2 ]',
        'R{"goal"}=? [ I=2 ]',
        'R{"goal"}=? [ C{"steps"}<=3 ]',
    ):
        lower, upper = model.check(formula).bounds
        assert lower <= SQUARE <= upper <= 1e-289, formula
    assert str(model.check("P=? [ F<=1 s=2 ]")) == "0.0 (exact)"
    assert str(model.check("P=? [ F<=2 s=1 ]")) == "2e-200 (exact up to rounding)"


@pytest.mark.parametrize("engine", ENGINES)
def test_values_beside_those_that_underflow_stay_exact_up_to_rounding(engine: str) -> None:
    values = symcheck.loads(TWO_JUMPS, engine=engine, everywhere=True)
    assert str(values.check("filter(max, P=? [ F<=2 s=2 ], s=1)")) == (
        "2e-200 (exact up to rounding)"
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_filters_compare_values_that_underflow_as_rationals(engine: str) -> None:
    text = TWO_JUMPS.replace("init 0", "").replace("rewards", "init true endinit rewards", 1)
    model = symcheck.loads(text, engine=engine)
    formula = "P=? [ F<=2 s=2 ], s=0 | s=3"
    greatest, least = (model.check(f"filter({f}, {formula})").lines for f in ("argmax", "argmin"))
    assert [line.state for line in greatest] == [(0,)]
    assert [line.state for line in least] == [(3,)]
    shown = model.check("filter(print, P=? [ F<=2 s=2 ])").lines
    assert [line.state for line in shown] == [(0,), (1,), (2,)], "0 is not known of state 0"


def test_a_quantile_sees_a_probability_that_underflows() -> None:
    model = symcheck.loads(TWO_JUMPS)
    assert model.check('quantile(min B, P>0 [ F{"steps"}<=B s=2 ])').value == 2


def test_bounds_close_to_underflow_reach_a_fixed_point() -> None:
    """Many steps that change nothing do not widen them, and end the iteration."""
    text = TWO_JUMPS.replace("1-1e-200:true", "1-1e-200:(s'=3)")
    results = [symcheck.loads(text).check(f"P=? [ F<={k} s=2 ]") for k in (2, 10**12)]
    assert results[0].bounds == pytest.approx(results[1].bounds)
    assert results[1].iterations < 64  # squarings


@pytest.mark.parametrize("engine", ENGINES)
def test_the_next_state_within_a_reward_is_certain_by_the_graph_only(engine: str) -> None:
    """1 - 1e-200 is 1 in doubles."""
    model = symcheck.loads(TWO_JUMPS, engine=engine)
    assert model.check('P>=1 [ X{"steps"}<=1 s=0 ]').value is False
    assert model.check('P<1 [ X{"steps"}<=1 s=0 ]').value is True
    assert model.check('P>=1 [ X{"steps"}<=1 s<2 ]').value is True
    assert str(model.check('P=? [ X{"steps"}<=1 s=0 ]').accuracy) == "exact up to rounding"


RETURNING = """dtmc
module m
  s : [0..2] init 0;
  [] s=0 -> 1e-160:(s'=1) + 1-1e-160:true;
  [] s=1 -> 1e-190:(s'=2) + 1-1e-190:(s'=0);
  [] s=2 -> (s'=0);
endmodule
rewards "small" s=2 : 1e-100; endrewards
rewards "large" s=2 : 1e250; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "ctmc"])
def test_a_share_of_the_time_that_underflows_is_bounded(engine: str, kind: str) -> None:
    model = symcheck.loads(RETURNING.replace("dtmc", kind), engine=engine)
    for formula, exact in {
        "S=? [ s=2 ]": Fraction("1e-350"),
        'R{"small"}=? [ S ]': Fraction("1e-450"),
        'R{"large"}=? [ S ]': Fraction("1e-100"),
    }.items():
        lower, upper = model.check(formula).bounds
        assert lower <= exact * (1 - Fraction("1e-100")), formula
        assert exact <= upper, formula
    assert model.check("S>0 [ s=2 ]").value is True
    assert model.check("S<1 [ s<2 ]").value is True


JUMPS = """ctmc
module m
  s : [0..2] init 0;
  [] s=0 -> 1:(s'=1);
  [] s=1 -> 1:(s'=2) + 1:(s'=0);
  [] s=2 -> 1:true;
endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_probabilities_within_a_time_are_1_by_the_graph_only(engine: str) -> None:
    """1 - e^-100000 is 1 in doubles."""
    model = symcheck.loads(JUMPS, engine=engine)
    assert model.check("P>=1 [ F<=100000 s=2 ]").value is False
    assert model.check("P<1 [ F<=100000 s=2 ]").value is True
    assert model.check("P>=1 [ F<=100000 s=0 ]").value is True
    assert model.check("P>=1 [ true U[1,100000] s<2 ]").value is False
    assert model.check("P>=1 [ s<3 U[1,100000] s<3 ]").value is True
    assert model.check("P>0 [ G<=100000 s=0 ]").value is True
    assert model.check("P>0 [ X[100000,200000] s=1 ]").value is True
    assert model.check("P>0 [ X[1,1] s=1 ]").value is False
    lower, upper = model.check("P=? [ X[100000,200000] s=1 ]").bounds
    assert lower == 0 < upper


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("formula", ["C<=3", "I=3", "C<=3 discount=0.5", "I=1000000"])
def test_negative_rewards_that_underflow_are_not_0(engine: str, formula: str) -> None:
    """-1e-400 was 0.0, `R<0` false, and (I=1000000) -5e-389 a subnormal number without an error."""
    text = TWO_JUMPS + 'rewards "loss" s=2 : -1; endrewards'
    model = symcheck.loads(text).with_options(engine=engine)
    accuracy = model.check(f'R{{"loss"}}=? [ {formula} ]').accuracy
    assert isinstance(accuracy, Certified)
    assert accuracy.lower < 0.0 <= accuracy.upper
    if formula != "I=1000000":
        assert model.check(f'R{{"loss"}}<0 [ {formula} ]').value is True
