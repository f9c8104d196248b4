"""Exact steps with numbers such as 1e-300: no fraction is reduced before the end."""

from __future__ import annotations

import fractions
import math
from fractions import Fraction

import pytest

import symcheck

TEXT = """{kind}
module m
  s : [0..3];
  [] s=0 -> 1e-300:(s'=1) + 1-1e-300:(s'=2);
  [] s=1 -> 1/3:(s'=0) + 2/3-1e-200:(s'=2) + 1e-200:(s'=3);
  [] s=2 -> 1/7:(s'=1) + 1-1/7-1e-17:true + 1e-17:(s'=3);
  [] s=3 -> 1e-9:(s'=0) + 1-1e-9:true;
{more}endmodule
rewards "r" s=0 : 1e17; s=3 : 1/3; s=2 : -1; endrewards
"""
TINY, SMALL = Fraction(1, 10**300), Fraction(1, 10**200)
ROWS = [
    {1: TINY, 2: 1 - TINY},
    {0: Fraction(1, 3), 2: Fraction(2, 3) - SMALL, 3: SMALL},
    {1: Fraction(1, 7), 2: Fraction(6, 7) - Fraction(1, 10**17), 3: Fraction(1, 10**17)},
    {0: Fraction(1, 10**9), 3: 1 - Fraction(1, 10**9)},
]
EARNED = [Fraction(10**17), Fraction(0), Fraction(-1), Fraction(1, 3)]


def stepped(x: list[Fraction], steps: int, factor: Fraction, *, earns: bool) -> list[Fraction]:
    for _ in range(steps):
        following = [sum((p * x[t] for t, p in row.items()), Fraction(0)) for row in ROWS]
        x = [factor * v + (e if earns else 0) for v, e in zip(following, EARNED, strict=True)]
    return x


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize(
    ("formula", "start", "factor", "earns"),
    [
        ("P{}=? [ F=12 s=3 ]", [0, 0, 0, 1], 1, False),
        ('R{{"r"}}{}=? [ C<=12 ]', [0, 0, 0, 0], 1, True),
        ('R{{"r"}}{}=? [ I=12 ]', EARNED, 1, False),
        ('R{{"r"}}{}=? [ C<=12 discount=0.9 ]', [0, 0, 0, 0], "0.9", True),
    ],
)
def test_values(kind, formula, start, factor, earns):
    more = "  [] s=3 -> 1e-9:(s'=0) + 1-1e-9:true;\n" if kind == "mdp" else ""
    model = symcheck.loads(TEXT.format(kind=kind, more=more)).with_options(exact=True)
    found = model.check(formula.format("max" if kind == "mdp" else "")).value
    assert found == stepped([Fraction(v) for v in start], 12, Fraction(factor), earns=earns)[0]


@pytest.mark.parametrize("formula", ["P=? [ F=40 s=3 ]", 'R{"r"}=? [ C<=40 discount=0.9 ]'])
def test_steps_have_no_greatest_common_divisors(monkeypatch, formula):
    model = symcheck.loads(TEXT.format(kind="dtmc", more="")).with_options(exact=True)
    model.check("P=? [ F=1 s=3 ]")
    calls = []

    def gcd(*numbers: int) -> int:
        calls.append(numbers)
        return math_gcd(*numbers)

    math_gcd = math.gcd
    monkeypatch.setattr(fractions.math, "gcd", gcd)
    model.check(formula)
    assert len(calls) < 1000


def test_values_that_stay_the_same_end_the_steps():
    text = "dtmc module m s:[0..3]; [] s<3 -> 1/2:(s'=s+1) + 1/2:(s'=3); [] s=3 -> true; endmodule"
    model = symcheck.loads(text).with_options(exact=True)
    assert model.check("P=? [ F<=100000 s=3 ]").value == 1
    assert model.check("P=? [ F[50000,50001] s=2 ]").value == 0


def test_discounted_values_of_too_many_digits_are_refused():
    model = symcheck.loads(TEXT.format(kind="dtmc", more="")).with_options(exact=True)
    with pytest.raises(symcheck.SymcheckError, match="fraction of about"):
        model.check('R{"r"}=? [ C<=1000000000000 discount=0.9 ]')
