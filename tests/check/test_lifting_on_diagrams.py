"""Parameter lifting on decision diagrams: the MDP of the corners of a box."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest

import symcheck
from symcheck.api.arguments import single_property
from symcheck.check.parametric import Search
from symcheck.check.property_instance import PropertyInstance
from symcheck.errors import SymcheckError, UnsupportedError

WALK = """dtmc
const double p; const double q;
module walker
  x : [0..4];
  [step] x>0 & x<4 -> p : (x'=x+1) + (1-p)*q : (x'=x-1) + (1-p)*(1-q) : true;
  [] x=0 -> q : (x'=1) + 1-q : true;
endmodule
module coin
  c : bool;
  [step] true -> p/2 : (c'=true) + 1-p/2 : (c'=false);
endmodule
rewards "steps" [step] true : 1; x=0 : 1/2; endrewards
label "lucky" = x=4 & c;
"""
"""Two modules with a common step. Its parameters occur in the commands of both."""

BOX = "p=0.3:0.7,q=0.2:0.6"
MEASURES = (
    'P{} [ F "lucky" ]',
    "P{} [ c=false U x=4 ]",
    "P{} [ F<=6 x=4 ]",
    "P{} [ G x<4 | c ]",
    'R{{"steps"}}{} [ F x=4 ]',
)


def search(text: str, box: str, formula: str, engine: str) -> Search:
    model = symcheck.loads(text).parametric(box).with_options(engine=engine)
    bound, labels = PropertyInstance(single_property(formula), 0, {}).bind(model.bound)
    return Search(model.engine, bound.formula, model.options, labels, model.bound)


@pytest.mark.parametrize("engine", ["mtbdd", "hybrid", "sparse"])
@pytest.mark.parametrize("measure", MEASURES)
def test_bounds_contain_the_exact_values_at_points(measure: str, engine: str) -> None:
    found = search(WALK, BOX, measure.format("<=0.5"), engine)
    rng = Random(measure)
    for width in (Fraction(1), Fraction(1, 7), Fraction(0)):
        box = {}
        for name, (low, high) in found.box.items():
            start = low + (high - low) * (1 - width) * Fraction(rng.randrange(11), 10)
            box[name] = start, start + (high - low) * width
        low, high = found.lifted(box)
        for _ in range(4):
            point = {
                n: str(a + (b - a) * Fraction(rng.randrange(11), 10)) for n, (a, b) in box.items()
            }
            exact = symcheck.loads(WALK, point, exact=True).check(measure.format("=?")).value
            assert low <= exact <= high
        if not width:
            assert high - low <= 1e-5 * max(1, high)


@pytest.mark.parametrize("formula", ["P>=0.3 [ F s=N+1 ]", 'R{"probes"}<=2 [ F s>N ]'])
def test_bounds_are_those_of_rows(formula: str) -> None:
    """With one module, the corners of commands are those of rows."""
    text = """dtmc const double p; const double q; const int N = 3;
    module host s : [0..N+2];
      [] s=0 -> q : (s'=1) + 1-q : (s'=N+2);
      [] s>0 & s<=N -> p : (s'=s+1) + 1-p : (s'=0);
      [] s>N -> true;
    endmodule
    rewards "probes" s>0 & s<=N : 1; endrewards"""
    ranges = "p=0.2:0.8,q=0.3:0.9"
    lifted = search(text, ranges, formula, "mtbdd")
    rows = search(text, ranges, formula, "auto")
    rows.field.sample({n: (a + b) / 2 for n, (a, b) in rows.box.items()})
    rows.to_number()
    ours, theirs = lifted.lifted(lifted.box), rows.lifted(rows.box)
    for low, high in zip(ours, theirs, strict=True):
        assert float(low) == pytest.approx(float(high), rel=1e-5)
    assert ours[0] <= theirs[0]
    assert ours[1] >= theirs[1]


@pytest.mark.parametrize("engine", ["mtbdd", "sparse"])
def test_verdicts_hold_at_points_of_their_boxes(engine: str) -> None:
    formula = 'P<=0.1 [ F<=8 "lucky" ]'
    model = symcheck.loads(WALK).parametric(BOX).with_options(engine=engine, regions=0.8)
    regions = model.check(formula).regions
    assert regions.share >= 0.8
    assert {case.value for case in regions.cases} == {True, False}
    rng = Random(1)
    for case in regions.cases:
        for box in rng.sample(case.boxes, min(6, len(case.boxes))):
            point = {n: str(rng.choice([a, b, (a + b) / 2])) for n, (a, b) in box.items()}
            assert symcheck.loads(WALK, point, exact=True).check(formula).value is case.value


def test_a_feasible_point() -> None:
    model = symcheck.loads(WALK).parametric(BOX).with_options(engine="mtbdd")
    point = model.feasible('P>=0.15 [ F<=8 "lucky" ]')
    assert point is not None
    values = {n: str(v) for n, v in point.items()}
    assert symcheck.loads(WALK, values, exact=True).check('P>=0.15 [ F<=8 "lucky" ]')
    assert model.feasible('P>=0.9 [ F<=8 "lucky" ]') is None


@pytest.mark.parametrize(
    ("text", "formula", "message"),
    [
        (WALK, "P=? [ F x=4 ]", "decision diagrams have no functions of parameters"),
        (WALK, "P>=0.5 [ F P>=0.5 [ X x=4 ] ]", "no nested operators"),
        (
            WALK.replace("dtmc", "mdp"),
            "P>=0.5 [ F x=4 ]",
            "Markov decision processes with parameters are not available",
        ),
        (WALK.replace("p/2", "p*p"), "P>=0.5 [ F x=4 ]", "linear in each parameter"),
        (WALK.replace("p/2", "1/(2+p)"), "P>=0.5 [ F x=4 ]", "linear in each parameter"),
        (WALK.replace("p/2", "pow(p,2)"), "P>=0.5 [ F x=4 ]", "linear in each parameter"),
        (WALK.replace(": 1;", ": p;"), "P>=0.5 [ F x=4 ]", "no parameters in rewards"),
        (
            WALK.replace("[] x=0", "[] x<2"),
            "P>=0.5 [ F x=4 ]",
            "several commands are enabled in a state",
        ),
        (WALK.replace("p/2", "2*p"), "P>=0.5 [ F x=4 ]", "negative"),
    ],
)
def test_refused_by_name(text: str, formula: str, message: str) -> None:
    with pytest.raises(SymcheckError, match=message):
        symcheck.loads(text).parametric(BOX).with_options(engine="mtbdd").check(formula)


def test_extremal_values_and_estimates_are_refused() -> None:
    model = symcheck.loads(WALK).parametric(BOX).with_options(engine="mtbdd")
    with pytest.raises(UnsupportedError, match="no extremal values"):
        model.extremum("P>=0.5 [ F x=4 ]", "max")
    with pytest.raises(UnsupportedError, match="an estimate has no bounds"):
        model.with_options(certify=False, method="power").check("P>=0.5 [ c=false U x=4 ]")
