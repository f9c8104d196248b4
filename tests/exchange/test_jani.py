"""Models and properties written as JANI are the same when they are read again."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest

import symcheck
from exchange.models import some_model
from generate import random_property
from symcheck.cli import main
from symcheck.errors import SymcheckError, UnsupportedError, UsageError
from symcheck.syntax.jani.read import read_jani
from symcheck.syntax.operators import Operator, Signature
from symcheck.syntax.parse import parse_expression
from symcheck.syntax.printer import pretty
from syntax.operations import APPLICATIONS, applied

MODELS = Path(__file__).parents[2] / "models"
CASES = [
    ("die/die.pm", "die/die.pctl", {}),
    ("gambler/stakes.nm", "gambler/stakes.pctl", {}),
    ("queue/queue.sm", "queue/queue.csl", {}),
    ("polling/polling.sm", "polling/polling.csl", {}),
    ("dining/dining.nm", "dining/dining.pctl", {}),
    ("herman/herman7.pm", "herman/herman7.pctl", {}),
    ("kanban/kanban.sm", "kanban/kanban.csl", {"t": 1}),
    ("multiplex/multiplex.pm", "multiplex/multiplex.pctl", {"N": 4, "K": 1}),
    ("timed/contention.nm", "timed/contention.pctl", {}),
]

COMPOSED = """mdp
const int N = 3;
formula low = x<N;
global g : [0..3];
module one
  x : [0..N];
  [a] low -> 1/3 : (x'=x+1) + 2/3 : (x'=0);
  [] x=2 -> (g'=1);
endmodule
module two
  y : [0..2];
  [a] y<2 -> (y'=y+1);
  [b] y=2 -> (y'=0);
endmodule
module three = two [y=z, b=c] endmodule
label "top" = x=N;
rewards "r"
  [a] x=0 : 3;
  [] g=1 : 7;
  [c] true : round(1.5);
  x=1 : 2;
endrewards
rewards
  true : 1/3;
endrewards
"""
PROPERTIES = [
    'Pmax=? [ F<=6 "top" ]',
    'R{"r"}max=? [ C<=5 ]',
    'R{2}min=? [ F "top" ]',
    "Pmin>=0.1 [ !(y=1) U x=2 ]",
    "P>0.9 [ F x=3 ]",
    "Rmax=? [ I=4 ]",
    "filter(max, Pmax=? [ X x=2 ], y=0)",
    "Pmax=? [ G F x=0 ]",
    'R{"r"}max=? [ S ]',
    "Smax=? [ y=1 ]",
    "E [ F x=3 ]",
    'Pmax=? [ F^{rew{"r"}<=4} y=2 ]',
    "Tmin=? [ F y=2 ]",
    "Pmax=? [ (y<2 W x=1) & (x=0 R y<2) ]",
]


def round_trip(model, properties, path):
    """The model that is read again, and the values of the properties."""
    assert symcheck.export(model, str(path), properties) == [str(path)]
    again = symcheck.load(path, engine=model.options.engine, exact=model.options.exact)
    assert (again.engine.states, again.engine.transitions) == (
        model.engine.states,
        model.engine.transitions,
    )
    return again, [result.value for _, result in again.check_all(path)]


def assert_same(found, expected):
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert a == (b if isinstance(b, bool) else pytest.approx(b, rel=2e-6, abs=2e-6))


@pytest.mark.parametrize(("name", "properties", "constants"), CASES, ids=[c[0] for c in CASES])
def test_our_models_keep_their_values(name, properties, constants, tmp_path):
    model = symcheck.load(MODELS / name, constants)
    file = symcheck.parse_properties_file(MODELS / properties)
    expected = [result.value for _, result in model.check_all(file)]
    _, found = round_trip(model, file, tmp_path / "m.jani")
    assert_same(found, expected)


@pytest.mark.parametrize(
    "system",
    [
        "",
        "system (one |[a]| (two ||| three)) / {b} endsystem",
        "system (one || two {a<-d}) || three endsystem",
    ],
)
@pytest.mark.parametrize("engine", ["explicit", "mtbdd", "exact"])
def test_every_form_of_composition_and_property_is_kept(system, engine, tmp_path):
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    model = symcheck.loads(COMPOSED + system, **options)
    asked = [p for p in PROPERTIES if engine != "exact" or "rew{" not in p]
    file = symcheck.parse_properties(";".join(asked))
    expected = [result.value for _, result in model.check_all(file)]
    _, found = round_trip(model, file, tmp_path / "m.jani")
    assert_same(found, expected)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("seed", range(20))
def test_random_models_keep_their_values(kind, seed, tmp_path):
    rng = Random(seed)
    generated = some_model(rng, kind)
    model = symcheck.loads(generated.text)
    text = random_property(rng, generated)
    try:
        expected = model.check(text).value
    except SymcheckError:
        pytest.skip("the property has no value")
    try:
        _, found = round_trip(model, text, tmp_path / "m.jani")
    except UnsupportedError as error:
        pytest.skip(str(error))
    assert_same(found, [expected])


TIMED = """pta
module one
  s : [0..3];
  x : clock;
  invariant (s=0 => x<=2) & (s=1 => x<=3) endinvariant
  [a] s=0 & x>=1 -> 0.9:(s'=1)&(x'=0) + 0.1:(s'=2)&(x'=0);
  [b] s=1 & x>=2 -> 0.5:(s'=0)&(x'=1) + 0.5:(s'=3);
endmodule
module two
  y : clock;
  [b] y>3 -> (y'=0);
  [b] y<=3 -> true;
endmodule
label "d" = s=3;
rewards "e" s=0:2; s=1:1; [a] true:3; endrewards
"""


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        (TIMED, 'Pmax=? [ F<=3 "d" ]; Pmin=? [ F<5 "d" & x>=2 ]; Pmax=? [ G<=4 s<2 ]'),
        (
            TIMED.replace("y>3", "y>=3"),
            'Tmin=? [ F s>1 ]; R{"e"}max=? [ F s>1 ]; P>0.4 [ F<=6 s>1 ]',
        ),
    ],
    ids=["zones", "digital"],
)
def test_timed_automata_keep_their_values(text, asked, tmp_path):
    model = symcheck.loads(text, exact=True)
    file = symcheck.parse_properties(asked)
    expected = [result.value for _, result in model.check_all(file)]
    symcheck.export(model, str(tmp_path / "m.jani"), file)
    again = symcheck.load(tmp_path / "m.jani", exact=True)
    assert again.type is model.type
    assert [result.value for _, result in again.check_all(tmp_path / "m.jani")] == expected


@pytest.mark.parametrize(("operator", "count"), APPLICATIONS)
def test_every_operator_is_written(operator, count, tmp_path):
    parts = ["x=1", "x=2"] if operator.signature is Signature.LOGICAL else ["x", "2", "x+1"]
    expression = pretty(applied(operator, *map(parse_expression, parts[:count])))
    bound = "" if isinstance(operator, Operator) and operator.is_boolean else ">=1"
    model = symcheck.loads(
        f'dtmc module m x : [1..2]; [] true -> (x\'=3-x); endmodule label "a" = ({expression}){bound};'
    )
    symcheck.export(model, str(tmp_path / "m.jani"))
    again = symcheck.load(tmp_path / "m.jani")
    assert again.labels["a"].count == model.labels["a"].count


def test_the_command_line_writes_the_selected_properties(tmp_path, capsys):
    path = tmp_path / "die.jani"
    assert (
        main(
            [
                str(MODELS / "die/die.pm"),
                "-pf",
                'P=? [ F d=6 ]; "mean": R=? [ F s=7 ]',
                "-prop",
                "mean",
                "-exportjani",
                str(path),
            ]
        )
        == 0
    )
    assert [p.name for p in read_jani(path.read_text()).properties.properties] == ["mean"]
    assert main([str(path)]) == 0
    assert "Result: 3.66666" in capsys.readouterr().out


def test_what_jani_has_not_is_an_error_and_leaves_no_file(tmp_path, capsys):
    path = tmp_path / "m.jani"
    two = "multi(Pmax=? [ F x=1 ], P>=0.5 [ F x=0 ])"
    model = symcheck.loads("mdp module m x:[0..1]; [] true -> (x'=1); endmodule")
    with pytest.raises(UnsupportedError) as caught:
        symcheck.export(model, str(path), f"Pmax=? [ F x=1 ];\n1 - {two}")
    assert str(caught.value) == (
        "<properties>:2:5: error[jani]: JANI has nothing for "
        "multi(Pmax=? [ F x=1 ], P>=0.5 [ F x=0 ])\n"
        "  2 | 1 - multi(Pmax=? [ F x=1 ], P>=0.5 [ F x=0 ])\n"
        "          ^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^^\n"
        "  hint: JANI has P, S, expected times and rewards (F, C, C<=k, I=k, S), A, E and filters: "
        "leave this property out"
    )
    with pytest.raises(UsageError, match=r"m\.drn holds no properties"):
        symcheck.export(model, str(tmp_path / "m.drn"), two)
    symcheck.export(model, str(tmp_path / "m.drn"))
    assert not path.exists()


def test_a_model_without_commands_is_refused(tmp_path):
    symcheck.export(symcheck.load(MODELS / "die/die.pm"), str(tmp_path / "m.all"))
    with pytest.raises(UnsupportedError, match="a model without commands"):
        symcheck.export(symcheck.load_explicit(str(tmp_path / "m.all")), str(tmp_path / "m.jani"))
