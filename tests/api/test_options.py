"""The table of options: one declaration for the library, the command line and the documentation."""

from __future__ import annotations

import inspect
import typing
from dataclasses import fields

import pytest

import symcheck
from symcheck.cli.switches.arguments import make_parser, parse_arguments
from symcheck.engines.registry import BUILDERS
from symcheck.errors import UsageError
from symcheck.exchange.api_io import load_explicit
from symcheck.numerics.linear import methods
from symcheck.options import ENGINES, METHODS, OPTIONS, Options, OptionValues, make_options

MODEL = "dtmc const int N; module m x : [0..N]; [] x<N -> 0.5:(x'=x+1) + 0.5:true; endmodule"


def test_keyword_parameters_are_the_fields():
    assert typing.get_type_hints(OptionValues) == typing.get_type_hints(Options)


@pytest.mark.parametrize(
    "function", [symcheck.load, symcheck.loads, load_explicit, symcheck.Model.with_options]
)
def test_help_shows_each_option_with_its_default(function):
    shown = inspect.signature(function).parameters
    assert {f.name: f.default for f in fields(Options)}.items() <= {
        n: p.default for n, p in shown.items()
    }.items()
    assert all(p.kind is not p.VAR_KEYWORD for p in shown.values())


def test_choices_are_those_that_exist():
    assert set(ENGINES) == set(BUILDERS)
    assert set(METHODS) == {"auto", *methods.METHODS}


def test_defaults_are_accepted_and_explained():
    for option in OPTIONS:
        assert option.values.accepts(option.default), option.name
        assert option.sentence.endswith("."), option.name
        assert option.sentence in (Options.__doc__ or "")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"engine": "sprase"}, "engine='sprase': expected one of .*did you mean 'sparse'"),
        ({"method": "topologic"}, "did you mean 'topological'"),
        ({"epsilon": -1}, "epsilon=-1: expected a number between 0 and 1"),
        ({"epsilon": 0}, "between 0 and 1"),
        ({"epsilon": float("nan")}, "between 0 and 1"),
        ({"epsilon": "1e-6"}, "between 0 and 1"),
        ({"exact": 1}, "exact=1: expected True or False"),
        ({"max_iterations": 2.5}, "a whole number from 0"),
        ({"max_iterations": True}, "a whole number from 0"),
        ({"max_memory": "4g"}, "a number of bytes, or None"),
        ({"threads": 0}, "a whole number from 1, or None"),
        ({"time_limit": 0}, "a number of seconds above 0"),
        ({"order": "force"}, r"a tuple of names of variables, \('force',\)"),
        ({"order": ()}, "a tuple of names"),
        ({"ltl2da_syntax": "ltl"}, "one of lbt, spin, spot, rabinizer"),
        ({"engin": "sparse"}, "there is no option 'engin' .did you mean 'engine'"),
        ({"magic": 1}, "hint: the options are engine, method, exact"),
    ],
)
def test_a_wrong_name_or_value_is_refused_at_once(values, message):
    with pytest.raises(UsageError, match=message):
        symcheck.loads(MODEL, **values)
    with pytest.raises(UsageError, match=message):
        symcheck.loads(MODEL, {"N": 1}).with_options(**values)


def test_the_exact_engine_and_exact_arithmetic_are_the_same():
    assert Options(engine="exact").exact
    exact = make_options({"engine": "exact"})
    assert exact.exact
    assert not make_options({"engine": "sparse"}, exact).exact
    assert make_options({"epsilon": 1e-3}, exact).exact
    assert make_options({"engine": "sparse", "exact": True}).exact


SWITCHES = [
    ("-s", "engine", "sparse"),
    ("--hybrid", "engine", "hybrid"),
    ("-method interval", "method", "interval"),
    ("-exact", "exact", True),
    ("-ptamethod backwards", "timed_method", "backwards"),
    ("-gridresolution 12", "grid_resolution", 12),
    ("-beliefs 1e3", "beliefs", 1000),
    ("-e 1e-3", "epsilon", 1e-3),
    ("-regions 0.9", "regions", 0.9),
    ("-lifting", "lifting", True),
    ("-abs", "relative", False),
    ("-maxiters 1e3", "max_iterations", 1000),
    ("-estimate", "certify", False),
    ("-fair", "fairness", True),
    ("-fair -nofair", "fairness", False),
    ("-bisim", "bisim", True),
    ("-exportstrat x", "strategy", True),
    ("-exportvector x", "everywhere", True),
    ("-ltl2datool x", "ltl2da", "x"),
    ("-ltl2dasyntax spot", "ltl2da_syntax", "spot"),
    ("-nofixdl", "fix_deadlocks", False),
    ("-noprobchecks", "check_sums", False),
    ("-reduce", "reduce", True),
    ("-nostates", "stop_at_targets", True),
    ("-symmetry", "symmetry", True),
    ("-nosymmetry", "symmetry", False),
    ("-nowarnunsatisfiable", "warn_unsatisfiable", False),
    ("-nowarnblocked", "warn_blocked", False),
    ("-nowarnrenaming", "warn_renaming", False),
    ("-nowarnoverlaps", "warn_overlaps", False),
    ("-truncate", "truncate", True),
    ("-notruncate", "truncate", False),
    ("-order x,y", "order", ("x", "y")),
    ("-cuddmaxmem 1.5m", "max_memory", 3 << 19),
    ("-workdir d", "workdir", "d"),
    ("-threads 2", "threads", 2),
    ("-timeout 2m", "time_limit", 120),
]


@pytest.mark.parametrize(("words", "name", "value"), SWITCHES)
def test_switches_set_options(words, name, value):
    assert parse_arguments(["m.pm", *words.split()]).options == make_options({name: value})


def test_every_option_has_a_switch():
    assert {name for _, name, _ in SWITCHES} == {o.name for o in OPTIONS}
    known = make_parser().counts()
    assert {f"-{n}" for o in OPTIONS for s in o.switches for n in s.names} <= known.keys()


def test_a_model_in_explicit_files_has_every_engine(tmp_path):
    symcheck.export(symcheck.loads(MODEL, "N=2"), str(tmp_path / "m.all"))
    model = load_explicit(str(tmp_path / "m.all"), engine="exact")
    assert str(model.check("P=? [ F<=2 x=2 ]").value) == "1/4"
    for engine in ("auto", "explicit", "sparse", "hybrid", "mtbdd"):
        chosen = model.with_options(engine=engine, exact=False)
        assert chosen.engine.name == ("explicit" if engine == "auto" else engine)
        assert chosen.check("P=? [ F<=2 x=2 ]").value == 0.25
