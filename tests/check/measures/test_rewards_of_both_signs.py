"""Rewards of both signs and of any size: values contain those of plain fractions, on every engine.

The oracle is written out below: it shares no code with symcheck.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import factorial

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from symcheck.check.result import Accuracy, Certified, Exact, Result
from symcheck.errors import InputError

DOUBLES = ["explicit", "sparse", "hybrid", "mtbdd"]
LAST = 3
"""The number of the last state, which is absorbing or leads back to the first."""

Row = dict[int, Fraction]

AMOUNTS = [
    "0",
    "1",
    "-1",
    "3",
    "-2",
    "0.1",
    "-0.3",
    "1/3",
    "1e17",
    "-1e17",
    "1e-17",
    "-1e30",
    "1e30",
]
DISTRIBUTIONS = [("1",), ("1/2", "1/2"), ("1/3", "2/3"), ("1e-9", "1-1e-9")]


def number(text: str) -> Fraction:
    if text == "1-1e-9":
        return 1 - Fraction(1, 10**9)
    return Fraction(text)


@dataclass(frozen=True)
class Model:
    """choices: per state its rows, texts of probabilities and their targets. states, choice: texts of the
    rewards of each state, and of each choice by its number."""

    kind: str
    choices: tuple[tuple[tuple[tuple[str, int], ...], ...], ...]
    states: tuple[tuple[str, ...], ...]
    choice: tuple[tuple[str, ...], ...]

    @property
    def text(self) -> str:
        lines = [f"{self.kind} module m s:[0..{LAST}];"]
        for s, rows in enumerate(self.choices):
            for a, row in enumerate(rows):
                updates = " + ".join(f"{p}:(s'={t})" for p, t in row)
                lines.append(f"[a{a}] s={s} -> {updates};")
        lines += [f"[a{a}] false -> true;" for a in range(len(self.choice))]  # all actions exist
        lines.append("endmodule rewards")
        for s, amounts in enumerate(self.states):
            lines += [f"s={s} : {amount};" for amount in amounts]
        for a, amounts in enumerate(self.choice):
            lines += [f"[a{a}] s<{LAST} : {amount};" for amount in amounts]
        return "\n".join([*lines, "endrewards"])

    def rows(self, s: int) -> list[tuple[Fraction, Row]]:
        """The reward and the distribution of each choice."""
        earned = sum(map(number, self.states[s]), Fraction(0))
        found = []
        for a, row in enumerate(self.choices[s]):
            reward = sum(map(number, self.choice[a]), Fraction(0)) if s < LAST else Fraction(0)
            to: Row = {}
            for p, t in row:
                to[t] = to.get(t, Fraction(0)) + number(p)
            found.append((earned + reward, to))
        return found


def steps(model: Model, count: int, factor: Fraction, best) -> Fraction:
    x = [Fraction(0)] * (LAST + 1)
    for _ in range(count):
        x = [
            best(r + factor * sum(p * x[t] for t, p in row.items()) for r, row in model.rows(s))
            for s in range(LAST + 1)
        ]
    return x[0]


def after(model: Model, count: int, best) -> Fraction:
    x = [sum(map(number, a), Fraction(0)) for a in model.states]
    for _ in range(count):
        x = [
            best(sum(p * x[t] for t, p in row.items()) for _, row in model.rows(s))
            for s in range(LAST + 1)
        ]
    return x[0]


def solve(a: list[list[Fraction]], b: list[Fraction]) -> list[Fraction]:
    """Gauss-Jordan elimination."""
    m = [[*row, v] for row, v in zip(a, b, strict=True)]
    for i in range(len(m)):
        pivot = next(k for k in range(i, len(m)) if m[k][i] != 0)
        m[i], m[pivot] = m[pivot], m[i]
        m[i] = [v / m[i][i] for v in m[i]]
        for k in range(len(m)):
            if k != i:
                m[k] = [u - m[k][i] * v for u, v in zip(m[k], m[i], strict=True)]
    return [row[-1] for row in m]


def strategies(model: Model):
    return product(*(model.rows(s) for s in range(LAST + 1)))


def discounted(model: Model, factor: Fraction, best) -> Fraction:
    def value(strategy) -> Fraction:
        n = range(LAST + 1)
        a = [[Fraction(i == j) - factor * strategy[i][1].get(j, 0) for j in n] for i in n]
        return solve(a, [r for r, _ in strategy])[0]

    return best(map(value, strategies(model)))


def until_last(model: Model, best) -> Fraction:
    def value(strategy) -> Fraction:
        n = range(LAST)
        a = [[Fraction(i == j) - strategy[i][1].get(j, 0) for j in n] for i in n]
        return solve(a, [r for r, _ in strategy[:LAST]])[0]

    return best(map(value, strategies(model)))


def average(model: Model, best) -> Fraction:
    """Of a model in which every strategy returns to the first state."""
    return best(map(chain_average, strategies(model)))


def chain_average(rows) -> Fraction:
    n = range(LAST + 1)
    a = [[rows[j][1].get(i, Fraction(0)) - (i == j) for j in n] for i in n]
    a[0] = [Fraction(1)] * (LAST + 1)
    shares = solve(a, [Fraction(1), *[Fraction(0)] * LAST])
    return sum(p * r for p, (r, _) in zip(shares, rows, strict=True))


@st.composite
def models(draw, kind: str, *, recurrent: bool = False, rare: bool = True) -> Model:
    def distribution(s: int) -> tuple[tuple[str, int], ...]:
        first, *more = draw(st.sampled_from(DISTRIBUTIONS if rare else DISTRIBUTIONS[:-1]))
        # The first branch moves on, so that the last state is always reached.
        targets = [draw(st.integers(s + 1, LAST)), *(draw(st.integers(0, s)) for _ in more)]
        return tuple(zip((first, *more), targets, strict=True))

    width = 2 if kind == "mdp" else 1
    choices = [
        tuple(distribution(s) for _ in range(draw(st.integers(1, width)))) for s in range(LAST)
    ]
    choices.append(((("1", 0 if recurrent else LAST),),))
    amounts = st.lists(st.sampled_from(AMOUNTS), max_size=3).map(tuple)
    states = tuple(draw(amounts) for _ in range(LAST + 1))
    return Model(kind, tuple(choices), states, tuple(draw(amounts) for _ in range(width)))


def contains(accuracy: Accuracy, result: Result, expected: Fraction) -> bool:
    match accuracy:
        case Exact(rounding=True):
            return abs(Fraction(result.value) - expected) <= Fraction(1, 10**12) * abs(expected)
        case Exact():
            return Fraction(result.value) == expected
        case Certified():
            return accuracy.lower <= expected <= accuracy.upper
    return False


def check_all(model: Model, queries: dict[str, Fraction]) -> None:
    for name in DOUBLES:
        engine = engine_of(model.text, name)
        for query, expected in queries.items():
            result = check_text(engine, query)
            accuracy = result.accuracy
            assert contains(accuracy, result, expected), (name, query, result, expected, model.text)
            # Bounds of averages are wide or close relative to the largest reward.
            if isinstance(accuracy, Certified) and expected and "[ S ]" not in query:
                wide = accuracy.upper - accuracy.lower > 1e-5 * abs(expected)
                assert not wide or result.warnings, (name, query, result, model.text)


@settings(max_examples=20, deadline=None)
@given(models("dtmc"), st.integers(0, 6))
def test_chains(model, count):
    check_all(
        model,
        {
            f"R=? [ C<={count} ]": steps(model, count, Fraction(1), max),
            f"R=? [ C<={count} discount=0.9 ]": steps(model, count, Fraction(9, 10), max),
            f"R=? [ I={count} ]": after(model, count, max),
            "R=? [ C discount=0.75 ]": discounted(model, Fraction(3, 4), max),
            f"R=? [ F s={LAST} ]": until_last(model, max),
        },
    )


@settings(max_examples=20, deadline=None)
@given(models("dtmc", recurrent=True))
def test_averages(model):
    check_all(model, {"R=? [ S ]": average(model, max)})


@settings(max_examples=20, deadline=None)
@given(models("mdp"), st.integers(0, 6), st.sampled_from(["min", "max"]))
def test_decision_processes(model, count, ways):
    best = min if ways == "min" else max
    check_all(
        model,
        {
            f"R{ways}=? [ C<={count} ]": steps(model, count, Fraction(1), best),
            f"R{ways}=? [ I={count} ]": after(model, count, best),
            f"R{ways}=? [ C discount=0.75 ]": discounted(model, Fraction(3, 4), best),
        },
    )


# With probabilities of 1e-9, policy iteration of signed rewards may find no certificate, and says so.
@settings(max_examples=20, deadline=None)
@given(models("mdp", rare=False), st.sampled_from(["min", "max"]))
def test_decision_processes_until_a_state(model, ways):
    best = min if ways == "min" else max
    check_all(model, {f"R{ways}=? [ F s={LAST} ]": until_last(model, best)})


@settings(max_examples=20, deadline=None)
@given(models("mdp", recurrent=True, rare=False), st.sampled_from(["min", "max"]))
def test_averages_of_decision_processes(model, ways):
    best = min if ways == "min" else max
    check_all(model, {f"R{ways}=? [ S ]": average(model, best)})


def exponential(x: Fraction) -> Fraction:
    """exp(-x) for x up to 4, to 60 digits."""
    return sum(((-x) ** k / factorial(k) for k in range(120)), Fraction(0))


@pytest.mark.parametrize("name", DOUBLES)
@pytest.mark.parametrize("items", [["1e17", "1", "-1e17"], ["0.1", "0.2", "-0.3"], ["2", "-5"]])
@pytest.mark.parametrize("place", ["state", "transition", "both"])
def test_continuous_time(name, items, place):
    """One jump with rate 1/2: what a unit of time earns counts 2 units of it on average."""
    guards = {"state": "s=0", "transition": "[a] true", "both": "s=0"}
    rewards = [f"{guards[place]} : {v};" for v in items[:-1]]
    # Per unit of time, a transition earns its rate times its reward.
    last = {"state": items[-1], "transition": items[-1], "both": f"2 * ({items[-1]})"}[place]
    rewards.append(f"{'s=0' if place == 'state' else '[a] true'} : {last};")
    text = (
        "ctmc module m s:[0..1]; [a] s=0 -> 1/2:(s'=1); [] s=1 -> true; endmodule rewards "
        + " ".join(rewards)
        + " endrewards"
    )
    rate = sum(map(number, items), Fraction(0)) * (Fraction(1, 2) if place == "transition" else 1)
    spent = 2 * (1 - exponential(Fraction(3, 2)))
    engine = engine_of(text, name)
    queries = {"R=? [ C<=3 ]": rate * spent, "R=? [ F s=1 ]": 2 * rate}
    for query, expected in queries.items():
        result = check_text(engine, query)
        assert contains(result.accuracy, result, expected), (query, result, expected)
        assert abs(Fraction(result.value) - expected) <= Fraction(1, 10**6) * abs(expected)


CANCELLING = """dtmc module m s:[0..3];
[a] s=0 -> 1/2:(s'=1) + 1/2:(s'=2); [b] s=1 | s=2 -> (s'=3); [] s=3 -> true; endmodule
rewards s=1 | s=2 : 1e17; [b] s=1 : 2; [b] s=2 : 4; [b] true : -1e17; s=3 : 0.1; s=3 : 0.2; s=3 : -0.3;
endrewards"""
"""Steps earn 2, 4 and then nothing; as doubles, the sums are 0, 0 and 5.6e-17."""


@pytest.mark.parametrize("name", DOUBLES)
@pytest.mark.parametrize("bisimulation", [False, True])
def test_sums_of_one_step_keep_their_digits(name, bisimulation):
    engine = engine_of(CANCELLING, name)
    for query in (
        "C<=2",
        "C<=9",
        "C",
        "F s=3",
        "F (s=1 & X s=3) | (s=2 & X s=3)",
        "C discount=0.5",
    ):
        result = check_text(engine, f"R=? [ {query} ]", bisim=bisimulation)
        assert result.value == pytest.approx(1.5 if "discount" in query else 3, rel=1e-15), query
        assert str(result.accuracy) == "exact up to rounding", query
        verdicts = [check_text(engine, f"R{op} [ {query} ]").value for op in (">2.9", "<1.4")]
        assert verdicts == [query != "C discount=0.5", False]
    assert check_text(engine, "R=? [ S ]", bisim=bisimulation).value == 0
    assert check_text(engine, "R>0 [ S ]", bisim=bisimulation).value is False


@pytest.mark.parametrize("name", DOUBLES)
def test_a_whole_number_beyond_53_bits_is_rounded(name):
    text = "dtmc module m s:[0..1]; [] true -> (s'=1-s); endmodule rewards true : 1e30; true : 1; endrewards"
    result = check_text(engine_of(text, name), "R=? [ S ]")
    assert contains(result.accuracy, result, Fraction(10**30 + 1))


def test_a_choice_that_is_not_taken_does_not_widen_the_bounds():
    text = (
        "mdp module m s:[0..1]; [a] s=0 -> (s'=1); [b] s=0 -> (s'=1); [c] s=1 -> (s'=0); endmodule "
        "rewards [a] true : 2; [b] true : -1e17; [c] true : -0.5; endrewards"
    )
    for name in DOUBLES:
        for query, expected in (("C discount=0.5", Fraction(7, 3)), ("C<=3", Fraction(7, 2))):
            result = check_text(engine_of(text, name), f"Rmax=? [ {query} ]")
            assert str(result.accuracy) == "exact up to rounding"
            assert contains(result.accuracy, result, expected)
            assert not result.warnings


HUGE = """{} module m s:[0..2]; [a] s=0 -> 1/2:(s'=1) + 1/2:(s'=0); [b] s=0 -> (s'=1);
[a] s=1 -> (s'=2); [a] s=2 -> (s'=0); endmodule
rewards "r" s=0 : 1e200*1e200; [b] true : -3; s=1 : -1e200*1e200; endrewards
rewards "p" s=0 : 1e200*1e200; endrewards"""


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_rationals_may_exceed_doubles(kind):
    engine, large = engine_of(HUGE.format(kind), "exact"), Fraction(10) ** 400
    ways = "min" if kind == "mdp" else ""
    chain = kind == "dtmc"  # which takes a and b equally often, so that 3/4 lead to s=1
    expected = {
        "C<=1": large - (Fraction(3, 2) if chain else 3),
        "I=1": -large / 2 if chain else -large,
        "F s=2": large / 3 - 2 if chain else Fraction(-3),
        "S": (large / 3 - Fraction(2)) / (Fraction(10, 3)) if chain else Fraction(-1),
    }
    for query, value in expected.items():
        result = check_text(engine, f'R{{"r"}}{ways}=? [ {query} ]')
        assert str(result.accuracy) == "exact"
        assert result.value == value, query
    assert check_text(engine, f'R{{"p"}}>={"3" if chain else "1"} [ C discount=0.5 ]').value is True
    if not chain:
        assert check_text(engine, 'Pmax=? [ F{"p"}<=3 s=2 ]').value == 0


@pytest.mark.parametrize("name", [*DOUBLES, "exact"])
def test_a_discount_below_1_is_legal_also_where_its_double_is_1(name):
    text = "dtmc module m s:[0..1]; [] s=0 -> (s'=1); [] s=1 -> true; endmodule rewards s=1 : 1; endrewards"
    engine, discount = engine_of(text, name), "0.99999999999999999"
    assert check_text(engine, f"R=? [ C<=3 discount={discount} ]").value == pytest.approx(2)
    result = check_text(engine, f"R=? [ C discount={discount} ]")
    low, high = result.bounds
    assert low <= 10**17 - 1 <= high
    assert check_text(engine, f"R>=99999999999999999 [ C discount={discount} ]").value is True
    assert check_text(engine, f"R>99999999999999999 [ C discount={discount} ]").value is False
    with pytest.raises(InputError, match="must be at least 0 and less than 1"):
        check_text(engine, "R=? [ C discount=1 ]")
