"""Probabilities that sum to almost 1: every engine divides them by their sum, and a warning says so."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import ModelFault, UnsupportedError
from symcheck.semantics.binding.bind import bind, exactly_bound

ENGINES = ["explicit", "sparse", "hybrid", "mtbdd", "auto"]

MODEL = """{kind}
module m
  s : [0..2];
  x : [0..3];
  [] s=0 & x=0 -> 0.3:(s'=1) + 0.6999999:(s'=1);
  [] s=1 & x<3 -> (x+1)/10:(s'=2) + 0.9999995-(x+1)/10:(s'=2)&(x'=x+1);
  [] s=2 -> true;
endmodule
"""

CERTAIN = [
    ("X s=1", "F<=1 s=1"),
    ("F<=2 s=2", "F s=2"),
    ("G<=1 s<=1", "F[1,1] s=1"),
    ("s=0 U<=1 s=1", "s=0 U s=1"),
]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_every_method_gives_one_event_one_probability(engine, kind):
    model = symcheck.loads(MODEL.format(kind=kind), engine=engine)
    for path in (p for pair in CERTAIN for p in pair):
        assert model.check(f"P<1 [ {path} ]").value is False, path
        assert model.check(f"P>=1 [ {path} ]").value is True, path
    least = model.check(f"P{'' if kind == 'dtmc' else 'min'}=? [ F<=2 x=1 ]")
    assert least.value == pytest.approx(
        float(1 - Fraction("0.1") / Fraction("0.9999995")), rel=1e-9
    )


def test_a_warning_names_the_place_a_state_and_the_sum():
    first, second = symcheck.loads(MODEL.format(kind="dtmc")).check("P=? [ F s=2 ]").warnings
    assert first.startswith("<model>:5:3: the probabilities sum to 0.9999999, not 1")
    assert "in state (s=0,x=0): they are divided by their sum" in first
    assert second.startswith("<model>:6:3: the probabilities sum to 0.9999995, not 1")


def test_the_command_line_says_it_once(tmp_path, capsys):
    path = tmp_path / "m.pm"
    path.write_text(MODEL.format(kind="dtmc"))
    assert main([str(path), "-pf", "P<1 [ X s=1 ]; P<1 [ F<=1 s=1 ]"]) == 0
    printed = capsys.readouterr().out
    assert printed.count(f"Warning: {path}:5:3: the probabilities sum to 0.9999999") == 1
    assert printed.count("Result: false") == 2


def test_sampling_says_it_too():
    result = symcheck.loads(MODEL.format(kind="dtmc")).estimate("P=? [ F<=2 s=2 ]")
    assert result.value == 1
    assert len(result.warnings) == 2


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_rational_arithmetic_refuses_them(kind):
    model = symcheck.loads(MODEL.format(kind=kind), exact=True)
    with pytest.raises(ModelFault, match="sum to 9999999/10000000, not 1"):
        model.check("P>=1 [ X s=1 ]")


@pytest.mark.parametrize(
    "updates",
    [
        " + ".join(["0.1:(x'=1)"] * 10),
        "1/3:(x'=1) + 1/3:(x'=2) + 1/3:(x'=3)",
        "(x+1)/7:(x'=1) + (6-x)/7:(x'=2)",
        "p:(x'=1) + 1-p:(x'=2)",
        "p:(x'=1) + 0.9:(x'=2)",
        "1e-300:(x'=1) + 1-1e-300:(x'=2)",
        "pow(0.1,1):(x'=1) + pow(0.3,2):(x'=2) + 0.81:(x'=3)",
    ],
)
def test_sums_that_differ_by_rounding_are_1(updates):
    text = f"dtmc const double p = 0.1; module m x : [0..3]; [] true -> {updates}; endmodule"
    model = symcheck.loads(text)
    assert not model.bound.warnings
    assert not model.check("P=? [ F x=2 ]").warnings
    written = model.bound.modules[0].commands[0].updates
    again = symcheck.bind(model.program, {}, normalise=False).modules[0].commands[0].updates
    assert written == again


@pytest.mark.parametrize("engine", ENGINES)
def test_sums_further_from_1_remain_faults(engine):
    text = "dtmc module m x : [0..9]; [] x=0 -> 0.5:(x'=1) + 0.4999:(x'=2); endmodule"
    with pytest.raises(ModelFault, match=r"sum to 0.9999, not 1"):
        symcheck.loads(text, engine=engine, fix_deadlocks=True).check("P=? [ F x=1 ]")
    # The same command has sums of both kinds.
    text = """dtmc module m x : [0..9];
      [] true -> 0.5:(x'=min(x+1,9)) + (x=0 ? 0.4999999 : 0.4):(x'=9); endmodule"""
    with pytest.raises(ModelFault, match=r"sum to 0.9, not 1"):
        symcheck.loads(text, engine=engine).check("P=? [ F x=1 ]")


def test_rates_are_not_divided():
    text = "ctmc module m x : [0..1]; [] true -> 0.3:(x'=1) + 0.6999999:(x'=1); endmodule"
    assert not symcheck.loads(text).bound.warnings


def test_without_the_check_of_sums_nothing_is_divided():
    model = symcheck.loads(MODEL.format(kind="dtmc"), check_sums=False)
    assert not model.bound.warnings
    assert model.check("P=? [ F<=1 s=1 ]").value == pytest.approx(0.9999999, rel=1e-12)


MANY = """{kind}
module m
  s : [0..1];
  x : [0..100000] init 77777;
  y : [0..1000] init 5;
  [] s=0 -> (x=77777 & y=5 ? {sum} : 1):(s'=1);
  [] s=1 -> true;
endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_probabilities_over_many_valuations_are_divided_where_a_state_has_them(engine, kind):
    model = symcheck.loads(MANY.format(kind=kind, sum="0.9999999"), engine=engine)
    assert not model.bound.warnings
    least = model.check(f"P{'' if kind == 'dtmc' else 'min'}=? [ F<=1 s=1 ]")
    assert least.value == 1
    (warning,) = least.warnings
    assert warning.startswith("<model>:6:3: the probabilities sum to 0.9999999, not 1")
    assert "in state (s=0,x=77777,y=5): they are divided by their sum" in warning
    assert model.check("P<1 [ X s=1 ]").value is False


@pytest.mark.parametrize("engine", ENGINES)
def test_no_warning_concerns_valuations_of_no_state(engine):
    text = MANY.format(kind="dtmc", sum="0.9999999").replace("77777;", "77776;")
    result = symcheck.loads(text, engine=engine).check("P=? [ F<=1 s=1 ]")
    assert (result.value, result.warnings) == (1, ())


def test_sampling_divides_probabilities_over_many_valuations():
    result = symcheck.loads(MANY.format(kind="dtmc", sum="0.9999999")).estimate("P=? [ F s=1 ]")
    assert result.value == 1
    assert len(result.warnings) == 1


@pytest.mark.parametrize("engine", ENGINES)
def test_each_faulty_command_over_many_valuations_is_named(engine):
    text = """mdp
    module a
      x : [0..200000];
      [go] x<2 -> (x=0 ? 1.000001 : 1):(x'=x+1);
    endmodule
    module b = a [ x=y ] endmodule
    module c
      z : [0..200000];
      [go] true -> (z=1 ? 0.999999 : 1):(z'=z+1);
    endmodule"""
    result = symcheck.loads(text, engine=engine).check("Pmin=? [ F<=2 z=2 ]")
    assert result.value == 1
    assert [w.split(", for")[0] for w in result.warnings] == [
        "<model>:4:7: the probabilities sum to 1.000001, not 1",
        "<model>:9:7: the probabilities sum to 0.999999, not 1",
    ]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("sums", ["0.99999", "1.00001", "pow(2,0.5)/2+0.2928932"])
def test_the_limit_itself_and_irrational_numbers_are_divided(engine, sums):
    text = f"dtmc module m x:[0..1]; [] x=0 -> {sums}:(x'=1); [] x=1 -> true; endmodule"
    result = symcheck.loads(text, engine=engine).check("P=? [ F<=1 x=1 ]")
    assert result.value == pytest.approx(1, rel=1e-15)
    assert len(result.warnings) == 1


def test_a_jani_model_warns_with_its_place(tmp_path):
    edge = {
        "location": "l",
        "destinations": [{"location": "k", "probability": {"exp": p}} for p in (0.3, 0.6999999)],
    }
    model = {
        "jani-version": 1,
        "name": "m",
        "type": "dtmc",
        "automata": [
            {
                "name": "a",
                "locations": [{"name": "l"}, {"name": "k"}],
                "initial-locations": ["l"],
                "edges": [edge, {"location": "k", "destinations": [{"location": "k"}]}],
            }
        ],
        "system": {"elements": [{"automaton": "a"}]},
    }
    path = tmp_path / "m.jani"
    path.write_text(json.dumps(model))
    result = symcheck.load(path).check("P<1 [ F<=1 a_location=1 ]")
    assert result.value is False
    assert any(w.startswith(f"{path}:1:") and "0.9999999" in w for w in result.warnings)


# --------------------------------------------------------------------------- models without commands


def files(tmp_path, name):
    """A chain of three states whose first row sums to 0.9999999, as files of a format."""
    texts = {
        "m.tra": "3 4\n0 1 0.3\n0 2 0.6999999\n1 1 1\n2 2 1\n",
        "m.drn": """@type: DTMC
@parameters

@reward_models

@nr_states
3
@nr_choices
3
@model
state 0 init
\taction 0
\t\t1 : 0.3
\t\t2 : 0.6999999
state 1
\taction 0
\t\t1 : 1
state 2
\taction 0
\t\t2 : 1
""",
    }
    path = tmp_path / name
    path.write_text(texts[name])
    return str(path)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ["m.tra", "m.drn", "matrix", "function"])
def test_rows_that_are_read_are_divided_and_a_warning_says_so(tmp_path, engine, name):
    first = {1: 0.3, 2: 0.6999999}
    if name == "matrix":
        matrix = np.array([[0, 0.3, 0.6999999], [0, 1, 0], [0, 0, 1]])
        model = symcheck.from_matrix(matrix, engine=engine)
        variable = "s"
    elif name == "function":
        model = symcheck.from_function(0, lambda s: {0: first}.get(s, {s: 1}), engine=engine)
        variable = None
    else:
        model = symcheck.load_explicit(files(tmp_path, name), type="dtmc", engine=engine)
        variable = "x"
    (warning,) = model.bound.warnings
    assert "of state 0 sum to 0.9999999, not 1: they are divided by their sum" in warning
    if variable is None:
        return
    for path in (f"X {variable}>0", f"F<=1 {variable}>0", f"F {variable}>0"):
        result = model.check(f"P<1 [ {path} ]")
        assert result.value is False
        assert warning in result.warnings
    value = model.check(f"P=? [ X {variable}=1 ]").value
    assert value == pytest.approx(0.3 / 0.9999999, rel=1e-12)
    with pytest.raises((ModelFault, UnsupportedError), match="sum to"):
        model.with_options(exact=True, engine="auto").check(f"P=? [ X {variable}=1 ]")


def test_rows_that_were_rounded_are_left_alone():
    thirds = np.array([[1 / 3, 1 / 3, 1 / 3], [0.1, 0.2, 0.7], [0.7, 0.2, 0.1]])
    assert not symcheck.from_matrix(thirds).bound.warnings
    tenths = np.full((10, 10), 0.1)
    assert not symcheck.from_matrix(tenths).bound.warnings


def test_rationals_are_divided_if_and_only_if_the_model_divides():
    program = symcheck.parse_model(MODEL.format(kind="dtmc"))
    divided, kept = (bind(program, exact=True, normalise=divides) for divides in (True, False))
    assert divided != kept
    assert exactly_bound(bind(program)) == divided
    warned = replace(bind(program, normalise=False), warnings=("a warning about something else",))
    assert exactly_bound(warned) == kept
