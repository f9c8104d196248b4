"""Values are computed where the answer reads them; at every state if the options say so."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import symcheck

# A walk on 160 000 places, too many for work that nothing asks for.
WALK = """
ctmc
module m
  x : [0..399] init 0;
  y : [0..399] init 0;
  [] x<399 -> 2 : (x'=x+1);
  [] x>0 -> 1 : (x'=x-1);
  [] y<399 -> 2 : (y'=y+1);
  [] y>0 -> 1 : (y'=y-1);
endmodule
"""


@pytest.mark.parametrize("engine", ["auto", "sparse", "hybrid", "explicit"])
@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("P=? [ F<=50 x=0 ]", 1),
        ("P=? [ G<=50 x>0 ]", 0),
        ("P=? [ x>3 U<=50 y>3 ]", 0),
        ("P=? [ x>3 W y>3 ]", 0),
        ("P=? [ x<3 R y<3 ]", 1),
        ("P=? [ F x=0 & y=0 ]", 1),
    ],
)
def test_what_the_initial_state_decides_needs_no_numbers(engine, formula, value):
    result = symcheck.loads(WALK, engine=engine).check(formula)
    assert (result.value, str(result.accuracy), result.runs) == (value, "exact", ())


def test_a_window_that_begins_later_is_not_decided_at_once():
    model = symcheck.loads(
        "dtmc module m x:[0..400000] init 0; [] x<400000 -> 1/2:(x'=x+1)+1/2:(x'=0); endmodule",
        engine="explicit",
    )
    assert model.check("P=? [ F[1,1] x=0 ]").value == 0.5
    assert model.check("P=? [ F>0 x=0 ]").value == pytest.approx(1, rel=1e-9)
    assert model.check("P=? [ x=0 U[2,2] x=0 ]").value == 0.25
    assert model.check("P=? [ x=0 U<=2 x=1 ]").value == 0.75


def test_elsewhere_bounds_may_be_wide_unless_values_are_wanted_everywhere():
    formula = "P=? [ F<=1 x=0 ]"
    model = symcheck.loads(WALK, engine="explicit")
    low, high = model.check(formula).values.at(model.engine.all)
    assert (low[0], high[0]) == (1, 1)
    assert np.any(high - low == 1)
    model = model.with_options(everywhere=True)
    low, high = model.check(formula).values.at(model.engine.all)
    assert np.all(high - low <= 1e-6 * high + 1e-299)
    assert np.all(low[:400] == 1)
    assert 0 < low[400] < 1


def test_a_written_vector_has_the_values_of_all_states(tmp_path, capsys):
    from symcheck.cli import main

    model, file = tmp_path / "walk.sm", tmp_path / "values.txt"
    model.write_text(WALK)
    assert main([str(model), "-pf", "P=? [ F<=1 x=0 ]", "-exportvector", str(file)]) == 0
    values = np.loadtxt(file)
    assert values[0] == 1
    places = 60  # of x; those further away cannot matter within the time
    rates = np.diag(np.full(places - 1, 2.0), 1) + np.diag(np.full(places - 1, 1.0), -1)
    rates[0] = 0
    expected = expm(rates - np.diag(rates.sum(axis=1)))[:, 0]
    assert values[: 400 * 20 : 400] == pytest.approx(expected[:20], rel=1e-6)
    assert capsys.readouterr().out.count("Warning") == 0
