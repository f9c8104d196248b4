"""Conditions of models never depend on rounding: every engine has the states, labels and values of a plain exploration
with fractions, which shares no code with symcheck.

Random models have decimal guards, updates, probabilities, labels and rewards, and most comparisons are ties or near ties.
"""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

import symcheck

TENTHS = [Fraction(n, 10) for n in (1, 2, 3, 7)] + [
    Fraction(1, 3),
    Fraction(11, 100),
    Fraction(10**17 + 1, 10**17),
]
ENGINES = {
    "explicit": {"engine": "explicit"},
    "sparse": {"engine": "sparse"},
    "hybrid": {"engine": "hybrid"},
    "mtbdd": {"engine": "mtbdd"},
    "exact": {"exact": True},
    "default": {},
}
TOP = 5


def text_of(x: Fraction) -> str:
    """A decimal if it has one, otherwise a division."""
    places = len(str(x.denominator)) - 1
    if x.denominator == 10**places:
        return f"{x.numerator}e-{places}" if places else f"{x.numerator}.0"
    return f"({x.numerator}.0/{x.denominator}.0)"


class Random:
    """Random expressions: pairs of a text and its meaning, a function of x and y."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def literal(self):
        value = self.random.choice(TENTHS)
        return text_of(value), lambda x, y: value

    def number(self, depth: int = 2):
        kind = self.random.choice(
            ["variable", "literal", *(["sum", "product", "if", "min"] * depth)]
        )
        if kind == "variable":
            name = self.random.choice("xy")
            return (name, (lambda x, y: Fraction(x)) if name == "x" else (lambda x, y: Fraction(y)))
        if kind == "literal":
            return self.literal()
        (a, f), (b, g) = self.number(depth - 1), self.number(depth - 1)
        match kind:
            case "sum":
                sign = self.random.choice([1, -1])
                return f"({a}{'+' if sign > 0 else '-'}{b})", lambda x, y: f(x, y) + sign * g(x, y)
            case "product":
                (c, h) = self.literal()
                return f"({a}*{c})", lambda x, y: f(x, y) * h(x, y)
            case "if":
                return f"(x<y ? {a} : {b})", lambda x, y: f(x, y) if x < y else g(x, y)
            case _:
                return f"min({a},{b})", lambda x, y: min(f(x, y), g(x, y))

    def condition(self):
        """A comparison that is a tie in some valuation."""
        a, f = self.number()
        x, y = self.random.randint(0, TOP), self.random.randint(0, TOP)
        b, value = text_of(f(x, y)), f(x, y)
        if self.random.random() < 0.5:
            c, g = self.number(1)
            b, rest = f"({c}+({text_of(value - g(x, y))}))", value - g(x, y)
            right = lambda x, y: g(x, y) + rest  # noqa: E731
        else:
            right = lambda x, y: value  # noqa: E731
        operator = self.random.choice(["=", "!=", "<", "<=", ">", ">="])
        compare = {
            "=": lambda p, q: p == q,
            "!=": lambda p, q: p != q,
            "<": lambda p, q: p < q,
            "<=": lambda p, q: p <= q,
            ">": lambda p, q: p > q,
            ">=": lambda p, q: p >= q,
        }[operator]
        return f"({a}{operator}{b})", lambda x, y: compare(f(x, y), right(x, y))

    def integer(self):
        a, f = self.number()
        name, rounded = self.random.choice(
            [
                ("floor", math.floor),
                ("ceil", math.ceil),
                ("round", lambda v: math.floor(v + Fraction(1, 2))),
            ]
        )
        return (
            f"max(0,min({TOP},{name}(({a})*10)))",
            lambda x, y: max(0, min(TOP, rounded(f(x, y) * 10))),
        )


def model_of(seed: int):
    """A random DTMC as a text, and its rows: a function from states to probabilities of states."""
    r = Random(seed)
    (g, guard), (named, label), (w, condition) = r.condition(), r.condition(), r.condition()
    (u, update), (v, other) = r.integer(), r.integer()
    text = f"""dtmc
const double half = 0.1*5;
module m
  x : [0..{TOP}] init 1;
  y : [0..{TOP}] init 1;
  [] {g} -> half : (x'={u}) + ({w} ? 0.3 : 0.6-0.1*6) : (y'={v}) + ({w} ? 0.2 : 0.1*3+0.2) : true;
  [] !{g} -> half : (x'=mod(x+1,{TOP + 1})) + 0.5 : (y'=mod(y+x,{TOP + 1}));
endmodule
label "l" = {named};
rewards {w} : 0.1*3; endrewards
"""

    def row(state):
        x, y = state
        if guard(x, y):
            small = Fraction(3, 10) if condition(x, y) else Fraction(0)
            branches = [
                (Fraction(1, 2), (update(x, y), y)),
                (small, (x, other(x, y))),
                (Fraction(1, 2) - small, state),
            ]
        else:
            branches = [
                (Fraction(1, 2), ((x + 1) % (TOP + 1), y)),
                (Fraction(1, 2), (x, (y + x) % (TOP + 1))),
            ]
        return [(p, t) for p, t in branches if p > 0]

    return text, row, label, condition


def expected(row, label, condition):
    """The reachable states, those with the label, and two values after four steps."""
    states, waiting = {(1, 1)}, [(1, 1)]
    while waiting:
        for _, t in row(waiting.pop()):
            if t not in states:
                states.add(t)
                waiting.append(t)
    until, reward = {s: Fraction(label(*s)) for s in states}, dict.fromkeys(states, Fraction(0))
    for _ in range(4):
        until = {
            s: Fraction(1) if label(*s) else sum(p * until[t] for p, t in row(s)) for s in states
        }
        earned = {s: Fraction(3, 10) if condition(*s) else Fraction(0) for s in states}
        reward = {s: earned[s] + sum(p * reward[t] for p, t in row(s)) for s in states}
    return states, until[1, 1], reward[1, 1]


@pytest.mark.parametrize("seed", range(40))
def test_engines_have_the_states_labels_and_values_of_fractions(seed: int, tmp_path) -> None:
    text, row, label, condition = model_of(seed)
    states, until, reward = expected(row, label, condition)
    file = tmp_path / "m.pm"
    file.write_text(text)
    for name, options in ENGINES.items():
        model = symcheck.load(file, **options)
        assert model.check('filter(count, "l")').value == sum(label(*s) for s in states), (
            name,
            text,
        )
        assert model.check("filter(count, true)").value == len(states), (name, text)
        assert float(model.check('P=? [ F<=4 "l" ]').value) == pytest.approx(
            float(until), rel=1e-9
        ), (name, text)
        assert float(model.check("R=? [ C<=4 ]").value) == pytest.approx(float(reward), rel=1e-9), (
            name,
            text,
        )


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sum_of_tenths_is_three_tenths(engine: str, tmp_path) -> None:
    file = tmp_path / "m.pm"
    file.write_text(
        """dtmc
const double p = 0.1; const double q = p*3;
module m
  x : [0..9] init 0;
  [] x*p+0.2=q -> (x'=floor((0.1+0.7)*10));
  [] x*p+0.2!=q & x<9 -> 0.5 : (x'=x+1) + 0.5-(0.3-3*0.1) : true + 0.3-3*0.1 : (x'=9);
  [] x>=9 -> true;
endmodule
label "tie" = x*0.1+0.2=0.3;
"""
    )
    model = symcheck.load(file, **ENGINES[engine])
    result = model.check('P>=1 [ F "tie" ]')
    assert result.value is True
    assert model.check("P=? [ F x=2 ]").value == 0
    assert model.check("P>0 [ F x=8 ]").value is True
    if engine != "exact":
        assert any("m.pm:5:6" in note for note in result.notes)
        assert not any("x>=9" in note for note in result.notes)


@pytest.mark.parametrize("engine", ENGINES)
def test_logarithms_are_enclosed(engine: str, tmp_path) -> None:
    file = tmp_path / "m.pm"
    file.write_text(
        "dtmc module m x : [1..9] init 1; [] log(x,2)<=3 & pow(x,0.5)<3 -> (x'=x+1); "
        "[] log(x,2)>3 | pow(x,0.5)>=3 -> true; endmodule"
    )
    model = symcheck.load(file, **ENGINES[engine])
    assert model.check("filter(count, true)").value == 9
    assert model.check("filter(count, log(x,2)=3)").value == 1


@pytest.mark.parametrize("engine", ENGINES)
def test_what_enclosures_do_not_decide_is_an_error_with_its_place(engine: str, tmp_path) -> None:
    file = tmp_path / "m.pm"
    file.write_text(
        "dtmc module m x : [2..9] init 2; [] log(x,3)*log(3,x)=1 -> true; "
        "[] log(x,3)*log(3,x)!=1 -> (x'=3); endmodule"
    )
    with pytest.raises(symcheck.SymcheckError, match=r"m\.pm:1:.*digits do not decide"):
        symcheck.load(file, **ENGINES[engine]).check("P=? [ F x=3 ]")


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_a_probability_whose_factors_are_normal_numbers_keeps_its_edge(engine: str) -> None:
    """No factor is small, and the product is below the doubles."""
    tiny = "*".join(["(x*1e-65)"] * 5)
    text = f"dtmc module m x : [0..3] init 1; [] x=1 -> {tiny} : (x'=2) + 1-{tiny} : (x'=3); "
    model = symcheck.loads(f"{text} [] x>1 -> true; endmodule", engine=engine)
    assert model.engine.states == 3
    assert model.check("E [ F x=2 ]").value is True
