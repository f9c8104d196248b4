"""Whether there is a counterexample is known from the text and the verdict."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.check.explanation.path_search import is_explained
from symcheck.check.property_instance import PropertyInstance
from symcheck.errors import UnsupportedError
from symcheck.syntax.parse import parse_properties

STEPS = """
module m
  x : [0..2] init 0;
  [a] x<2 -> 0.5 : (x'=x+1) + 0.5 : (x'=0);
  [b] x=1 -> 1 : (x'=0);
  [] x=2 -> true;
endmodule
rewards "r" true : 1; endrewards
"""
PROPERTIES = [
    "P>=0.9 [ F x=2 ]",
    "P<=0.1 [ F x=2 ]",
    "P>=0.9 [ F<=1 x=2 ]",
    "P<=0.1 [ F<=2 x=2 ]",
    "P<=0.1 [ F>=2 x=2 ]",
    "P>=0.1 [ X x=1 ]",
    "P<=0.1 [ X x=1 ]",
    "P>=0.9 [ x=1 ]",
    "P>=0.9 [ X X x=1 ]",
    "P>=0.1 [ G F x=2 ]",
    'R{"r"}<=1 [ F x=2 ]',
    'R{"r"}>=100 [ F x=2 ]',
    'R{"r"}<=1 [ C<=3 ]',
    'R{"r"}<=0.5 [ I=3 ]',
    "S>=0.5 [ x=2 ]",
    "!P>=0.9 [ F x=2 ]",
    "E [ F x=2 ]",
]


@pytest.mark.parametrize("text", PROPERTIES)
@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_what_is_explained_has_a_counterexample(kind: str, text: str) -> None:
    model = symcheck.loads(kind + STEPS)
    result = model.check(text)
    formula = PropertyInstance(parse_properties(text), 0, {}).bind(model.bound)[0].formula
    assert isinstance(result.value, bool)
    found = is_explained(formula, model.bound, model.options, holds=result.value)
    try:
        result.counterexample()
    except UnsupportedError:
        assert not found
    else:
        assert found


def test_nothing_is_explained_over_fair_strategies() -> None:
    model = symcheck.loads("mdp" + STEPS, fairness=True)
    formula = PropertyInstance(parse_properties("P>=0.9 [ F x=2 ]"), 0, {}).bind(model.bound)[0]
    assert not is_explained(formula.formula, model.bound, model.options, holds=True)


def test_the_first_state_shows_the_value_of_a_state_formula() -> None:
    model = symcheck.loads("ctmc" + STEPS)
    shown = model.check("P>=0.9 [ x=1 ]").counterexample()
    assert [[s["x"] for s in path] for path in shown.paths] == [[0]]
    assert shown.probability == 1
