"""The relative error of the doubles of a matrix follows from the text of the model."""

from __future__ import annotations

from fractions import Fraction

import pytest

import symcheck
from symcheck.semantics.entry_errors import CLOSE, ROUGH, UNIT, entry_error

MODEL = """{kind}
const double p = {p};
module m x : [0..{top}]; [a] true -> {number}:(x'=0) + {rest}:(x'=1); endmodule
{others}
"""


def error(
    number: str, rest: str, *, kind: str = "mdp", p: str = "0.5", top: int = 3, others: str = ""
) -> float:
    text = MODEL.format(kind=kind, p=p, top=top, number=number, rest=rest, others=others)
    return entry_error(symcheck.loads(text).bound, terms=1)


@pytest.mark.parametrize(
    ("number", "rest", "units"),
    [
        ("0.5", "0.5", 0),
        ("1/4", "3/4", 0),
        ("0.1", "0.9", 1),
        ("1/3", "2/3", 1),
        ("x/4", "(4-x)/4", 1),
        ("x/3", "(3-x)/3", 1),
        ("0.1*0.3", "0.97", 3),
    ],
)
def test_each_literal_and_operation_is_rounded_once(number: str, rest: str, units: int) -> None:
    assert error(number, rest, top=1 if "x" in number else 3) / UNIT <= units * (1 + 1e-6)


def test_constants_are_compared_with_their_exact_values() -> None:
    """A difference of constants is as good as its doubles show."""
    assert error("1-p", "p", p="0.9") < 16 * UNIT


def test_what_may_cancel_has_a_fixed_bound() -> None:
    text = "mdp module m x:[0..3]; [] true -> 1-x*0.3:(x'=0) + x*0.3:(x'=1); endmodule"
    assert entry_error(symcheck.loads(text).bound) >= CLOSE
    wide = text.replace("x:[0..3]", "x:[0..3]; y:[0..99999]").replace("x*0.3", "x*0.3/(y+1)")
    bound = symcheck.loads(wide).bound
    assert CLOSE <= entry_error(bound) < ROUGH <= entry_error(bound, table_bits=14)


def test_products_of_modules_and_sums_are_rounded_too() -> None:
    other = "module n y:[0..1]; [a] true -> 0.3:(y'=0) + 0.7:(y'=1); endmodule"
    text = MODEL.format(kind="mdp", p="1", top=3, number="0.1", rest="0.9", others=other)
    bound = symcheck.loads(text).bound
    assert entry_error(bound, terms=1) / UNIT == pytest.approx(3)
    assert entry_error(bound) / UNIT == pytest.approx(6), "four transitions may lead to one state"


@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
def test_the_bound_holds_of_the_entries_of_a_model(engine: symcheck.options.EngineName) -> None:
    text = """ctmc
    module m x:[0..3]; [a] true -> 0.1*(x+1)/3:(x'=0) + 1/7:(x'=mod(x+1,4)); endmodule
    module n y:[0..1]; [a] true -> 0.3:(y'=0) + 1.7:(y'=0) + 0.7:(y'=1); endmodule
    """
    built = symcheck.loads(text, engine=engine).engine
    exact = symcheck.loads(text, exact=True).engine
    for doubles, rationals in zip(
        built.system(built.all).weights.data.tolist(),
        exact.system(exact.all).weights.data.tolist(),
        strict=True,
    ):
        assert abs(Fraction(doubles) - rationals) <= Fraction(built.entry_error) * rationals


def test_a_variable_without_bounds_has_those_of_its_values() -> None:
    """The numbers of a sum may cancel as far as is declared, and never do where they occur."""
    text = """ctmc
    global id : int init {first};
    module m x:[0..3]; [] x<3 -> 0.2*id+0.9:(x'=x+1); [] x>0 -> 1:(x'=x-1)&(id'={first}); endmodule
    """
    built = symcheck.loads(text.format(first=1), engine="explicit").engine
    assert entry_error(built.model) >= CLOSE
    assert 0.0 < built.entry_error < 16 * UNIT
    assert symcheck.loads(text.format(first=-1), engine="explicit").engine.entry_error >= CLOSE
