"""What may surprise in a property or in its value is told in a note."""

from __future__ import annotations

import pytest

import symcheck

CHAIN = """dtmc
module m
  x : [0..2];
  [] x=0 -> 0.5 : (x'=1) + 0.5 : (x'=2);
  [] x>0 -> true;
endmodule
rewards "r" true : 1; endrewards
label "end" = x=2;
"""
CHOICE = CHAIN.replace("dtmc", "mdp").replace(
    "0.5 : (x'=1) + 0.5 : (x'=2);", "(x'=1);\n  [] x=0 -> (x'=2);"
)


@pytest.mark.parametrize(
    ("model", "formula", "reason"),
    [
        (CHAIN, "R=? [ F x=2 ]", "the probability of F x=2 is less than 1"),
        (CHAIN, "T=? [ x=0 U x=2 ]", "the probability of x=0 U x=2 is less than 1"),
        (CHAIN, "R=? [ C ]", "rewards are earned for ever"),
        (CHOICE, "Rmax=? [ F x=2 ]", "the probability of F x=2 is less than 1 under some strategy"),
        (
            CHOICE,
            "Rmin=? [ F x=2 & x=1 ]",
            "the probability of F x=2 & x=1 is less than 1 under every strategy",
        ),
    ],
)
def test_why_a_value_is_infinite(model: str, formula: str, reason: str) -> None:
    result = symcheck.loads(model, warn_unsatisfiable=False).check(formula)
    assert result.value == float("inf")
    assert result.notes == (f"Infinity: {reason}",)


@pytest.mark.parametrize(
    ("model", "formula"),
    [(CHAIN, "R=? [ F x>0 ]"), (CHAIN, "R=? [ C<=3 ]"), (CHOICE, "Rmin=? [ F x=2 ]")],
)
def test_a_finite_value_needs_no_reason(model: str, formula: str) -> None:
    assert symcheck.loads(model).check(formula).notes == ()


@pytest.mark.parametrize(
    ("formula", "others"),
    [
        ("P=? [ x=1 ]", "F x=1 about some, G x=1 about all"),
        ("P>=1 [ x<2 ]", "F x<2 about some, G x<2 about all"),
        ('P>0 [ "end" ]', 'F "end" about some, G "end" about all'),
        ("A [ x<2 ]", "F x<2 about some, G x<2 about all"),
        ("E [ x=1 ]", "F x=1 about some, G x=1 about all"),
        ("R=? [ x=1 ]", "F x=1 about some"),
        ("T=? [ x=1 ]", "F x=1 about some"),
    ],
)
def test_a_path_formula_without_operator_is_about_the_first_state(
    formula: str, others: str
) -> None:
    (note,) = symcheck.loads(CHAIN).check(formula).notes
    assert note.endswith(f" without a path operator is about the first state, {others}")


@pytest.mark.parametrize(
    "formula", ["P=? [ X x=1 ]", "P=? [ !(F x=1) ]", "P=? [ true ]", "S=? [ x=1 ]", "A [ G x<3 ]"]
)
def test_other_path_formulas_have_no_note(formula: str) -> None:
    assert symcheck.loads(CHAIN).check(formula).notes == ()
