"""Quantiles: against all bounds one by one in rational arithmetic, and against Storm."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from itertools import islice
from math import inf
from random import Random

import pytest

import symcheck
from checking import check_text, engine_of
from generate import bound_models
from symcheck.errors import NumericalError, SyntaxFault

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd", "exact")

CYCLE = """
dtmc
module m
  s : [0..2] init 0;
  [a] s=0 -> 1/2 : (s'=1) + 1/2 : (s'=0);
  [b] s=1 -> (s'=2);
  [c] s=2 -> (s'=0);
endmodule
rewards "c" [a] true : 2; s=1 : 1; endrewards
label "g" = s=2;
"""
"""The goal is first met at a cost of 2k+1 with probability 2^-k, k = 1, 2, …"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ('quantile(min B, P>=0.5 [ F{"c"}<=B "g" ])', 3),
        ('quantile(min B, P>0.5 [ F{"c"}<=B "g" ])', 5),
        ('quantile(min B, P>=0.999 [ F{"c"}<=B "g" ])', 21),
        ('quantile(max B, P<0.999 [ F{"c"}<=B "g" ])', 20),
        ('quantile(max B, P<=0.5 [ F{"c"}<=B "g" ])', 4),
        ('quantile(max B, P>0.25 [ G{"c"}<=B s<2 ])', 4),
        ('quantile(min B, P<=0.25 [ G{"c"}<=B s<2 ])', 5),
        ("quantile(min B, P>=0.5 [ F<=B s=2 ])", 2),
        ("quantile(max B, P>=0.75 [ s<2 U>=B s=2 ])", 2),
        ('quantile(min B, P>=0.9 [ F^{rew{"c"}<=100, steps<=B} "g" ])', 5),
        # Certain in the limit only, and certain from some bound on.
        ('quantile(min B, P>=1 [ F{"c"}<=B "g" ])', inf),
        ("quantile(min B, P>=1 [ F<=B s<2 ])", 0),
        ('quantile(max B, P<1 [ F{"c"}<=B "g" ])', inf),
        ('quantile(max B, P<0 [ F{"c"}<=B "g" ])', -inf),
        ('quantile(min B, P<0.9 [ F{"c"}<=B "g" ])', 0),
        ('filter(max, quantile(min B, P>=0.5 [ F{"c"}<=B "g" ]))', 3),
        ('quantile(min B, P>=0.5 [ F{"c"}<=B "g" ]) * 2', 6),
    ],
)
def test_by_hand(engine, formula, value):
    result = check_text(engine_of(CYCLE, engine), formula)
    assert result.value == value
    assert isinstance(result.value, int) or value in (inf, -inf) or engine == "exact"


ABSORBED = """
mdp
module m
  s : [0..2] init 0;
  [a] s=0 -> 1/2 : (s'=1) + 1/2 : (s'=2);
  [b] s=0 -> (s'=2);
  [] s>0 -> true;
endmodule
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("quantile(max B, P>=0 [ F>=B s=1 ])", inf),
        ("quantile(max B, Pmax>=0.5 [ F>=B s=1 ])", inf),
        ("quantile(max B, Pmax>=0.6 [ F>=B s=1 ])", -inf),
        ("quantile(max B, P>=0.9 [ F>=B s=0 ])", 0),
        ("quantile(min B, P<=0.3 [ F>=B s=1 ])", inf),
        ("quantile(min B, Pmin>=0.4 [ G>=B s=1 ])", inf),
        ("quantile(min B, P>=0.7 [ G>=B s>0 ])", 1),
        ("quantile(max B, P<=0.7 [ G>=B s=1 ])", inf),
    ],
)
def test_lower_limits_that_decide_nothing_end_at_once(engine, formula, value):
    assert check_text(engine_of(ABSORBED, engine), formula).value == value


def test_what_has_no_bound_says_so():
    model = symcheck.loads(CYCLE)
    warnings = model.check('quantile(min B, P>=1 [ F{"c"}<=B "g" ])').warnings
    assert any("no value of B satisfies" in w for w in warnings)
    warnings = model.check('quantile(max B, P<1 [ F{"c"}<=B "g" ])').warnings
    assert any("every value of B satisfies" in w for w in warnings)
    warnings = model.check('quantile(max B, P>0.5 [ F{"c"}<=B "g" ])').warnings
    assert any("quantile(min B" in w for w in warnings)
    with pytest.raises(NumericalError, match="larger bounds are not tried"):
        model.check('quantile(max B, P>=0.5 [ F{"c"}>=B "g" ])')


LINE = """
mdp
module m
  x : [0..4];
  [slow] x<4 -> 1/2 : (x'=x+1) + 1/2 : (x'=min(x+2,4));
  [fast] x<3 -> (x'=x+2);
  [] x=4 -> true;
endmodule
rewards "c" [slow] true : 1; [fast] true : 5; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_certain_cost_is_attained(engine):
    model = engine_of(LINE, engine)
    assert check_text(model, 'quantile(min B, Pmax>=1 [ F{"c"}<=B x=4 ])').value == 4
    assert check_text(model, 'quantile(min B, Pmin>=1 [ F{"c"}<=B x=4 ])').value == 10
    assert check_text(model, 'quantile(min B, P>=1 [ F{"c"}<=B x=4 ])').value == 10
    assert check_text(model, 'quantile(max B, Pmin<1 [ F{"c"}<=B x=4 ])').value == 9
    assert check_text(model, "quantile(min B, Pmin>=1 [ F<=B x=4 ])").value == 4


SLOW = """
mdp
module m
  s : [0..3];
  [a] s=0 -> 0.5 : (s'=2) + 0.5 : (s'=3);
  [b] s=0 -> 0.5625 : (s'=1) + 0.4375 : (s'=3);
  []  s=1 -> 0.0625 : (s'=2) + 0.9375 : (s'=1);
  []  s>=2 -> true;
endmodule
rewards "cost" s<2 : 1; endrewards
"""
"""[a] attains 0.5 at once; [b] comes near 0.5625 slowly, so that the least limit says little."""

TWO = """
dtmc
module m
  s : [0..1];
  [] s=0 -> (s'=1);
  [] s=1 -> (s'=0);
endmodule
rewards "c" true : 1; endrewards
rewards "d" s=0 : 1; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("model", "path"),
    [
        (SLOW, 'P>=0.5 [ F{"cost"}<=B s=2 ]'),
        (SLOW, 'P<=0.5 [ G{"cost"}<=B s!=2 ]'),
        (TWO, 'P>=1 [ F^{rew{"c"}<=B, rew{"d"}>=20} s=1 ]'),
    ],
)
def test_a_limit_at_the_threshold_may_be_met_late(engine, model, path):
    """The answer is the first bound that satisfies the property, which is tried one by one."""
    engine = engine_of(model, engine)
    first = next(
        b for b in itertools.count() if check_text(engine, path.replace("B", str(b))).value
    )
    assert first > 30
    assert check_text(engine, f"quantile(min B, {path})").value == first


def models(kind: str) -> Iterator[tuple[str, str]]:
    """Models with costs, and states whose probability depends on the bound on the costs."""
    direction = "" if kind == "dtmc" else "max"
    for model in bound_models("quantile", kind, costs=True):
        name, high = model.variables[0]
        target = f"{name}={Random(model.text).randint(0, high)}"
        engine = engine_of(model.text)
        first, last = (
            check_text(engine, f'P{direction}=? [ F{{"c"}}<={b} {target} ]').value for b in (0, 9)
        )
        if first < last:
            yield model.text, target


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_random_models_agree_with_all_bounds(kind):
    found = 0
    for number, (text, target) in enumerate(islice(models(kind), 8)):
        direction = "" if kind == "dtmc" else ("max", "min")[number // 4]
        path = f'F{{"c"}}<=%s {target}' if number % 2 else f'G{{"c"}}<=%s !({target})'
        formula = f"P{direction}{('>=', '<', '>', '<=')[number % 4]}0.3 [ {path} ]"
        exact = engine_of(text, "exact")
        holds = [check_text(exact, formula % bound).value for bound in range(12)]
        if len(set(holds)) == 1:
            continue
        found += 1
        for engine in ("explicit", "hybrid", "exact"):
            model = engine_of(text, engine)
            least = check_text(model, f"quantile(min B, {formula % 'B'})").value
            most = check_text(model, f"quantile(max B, {formula % 'B'})").value
            last = 11 - holds[::-1].index(True)
            assert least == holds.index(True), (formula, text)
            assert most == (inf if last == 11 else last), (formula, text)
    assert found >= 2


@pytest.mark.parametrize(
    ("model", "formula"),
    [
        (CYCLE, 'quantile(min K1, P>=0.45 [ F{"c"}<=K1 "g" ])'),
        (CYCLE, 'quantile(min K2, P>0.9 [ F{"c"}<=K2 "g" ])'),
        (CYCLE, 'quantile(max K3, P<0.99 [ F{"c"}<=K3 "g" ])'),
        (LINE, 'quantile(min K4, Pmax>0.9 [ F{"c"}<=K4 x=4 ])'),
        (LINE, 'quantile(min K5, Pmin>0.9 [ F{"c"}<=K5 x=4 ])'),
        (LINE, 'quantile(max K6, Pmax<0.4 [ F{"c"}<=K6 x=4 ])'),
    ],
)
def test_values_are_storms(model, formula, tmp_path):
    """Storm derives from the comparison whether the least or the greatest bound is meant."""
    stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
    file = tmp_path / "model.prism"
    file.write_text(model)
    program = stormpy.parse_prism_program(str(file))
    properties = stormpy.parse_properties(formula, program)
    built = stormpy.build_model(program, properties)
    found = stormpy.model_checking(built, properties[0], only_initial_states=True)
    assert check_text(engine_of(model), formula).value == int(str(found))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('quantile(min B, P>=0.5 [ F{"c"}<=2*B "g" ])', "stands once"),
        ('quantile(min B, P>=0.5 [ F{"c"}<B "g" ])', "stands once"),
        ('quantile(min B, P>=0.5 [ F{"c"}<=3 "g" ])', "stands once"),
        ('quantile(min B, P>=0.5 [ F "g" ])', "threshold"),
        ('quantile(min B, P=? [ F<=B "g" ])', "threshold"),
        ('quantile(min B, max D, P>=0.5 [ F{"c"}<=B "g" ])', "one variable"),
        ('quantile(B, P>=0.5 [ F{"c"}<=B "g" ])', "expected 'max' or 'min'"),
    ],
)
def test_faulty_quantiles(text, message):
    with pytest.raises(SyntaxFault, match=message):
        symcheck.loads(CYCLE).check(text)
