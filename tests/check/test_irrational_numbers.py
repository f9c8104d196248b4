"""Numbers without a fraction concern only what reads them."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.errors import ModelFault

ENGINES = [
    *({"engine": e} for e in ("auto", "explicit", "sparse", "hybrid", "mtbdd")),
    {"exact": True},
]

MODEL = """dtmc
const double r = pow(2,0.5)/2;
const int k = floor(r*10);
module m
  s : [0..3];
  [] s=0 & s*0.1>r-1 -> 1/3:(s'=1) + 2/3:(s'=2);
  [] s>0 -> true;
endmodule
label "big" = s>r;
rewards "k" s=2 : k; endrewards
"""
IRRATIONAL = 'rewards "r" s=1 : r; endrewards'


@pytest.mark.parametrize("options", ENGINES)
@pytest.mark.parametrize(
    ("formula", "truth"),
    [
        ("P>=1/3 [ F s=1 ]", True),
        ("P>1/3 [ F s=1 ]", False),
        ('filter(count, "big")', 2),
        ('R{"k"}<=14/3 [ C<=2 ]', True),
        ("k", 7),
        ("r>0.7071", True),
    ],
)
def test_conditions_on_an_irrational_constant_are_decided(options, formula, truth):
    assert symcheck.loads(MODEL, **options).check(formula).value == truth


@pytest.mark.parametrize("options", ENGINES)
def test_the_constant_itself_is_no_fraction(options):
    model = symcheck.loads(MODEL, **options)
    if options.get("exact"):
        with pytest.raises(ModelFault, match=r"<model>:2:18: .*exact-power") as fault:
            model.check("r")
        assert "has no exact value" in str(fault.value)
    else:
        assert model.check("r").value == pytest.approx(0.5**0.5, rel=1e-12)


@pytest.mark.parametrize("engine", ["auto", "explicit", "sparse", "hybrid", "mtbdd"])
def test_an_irrational_reward_does_not_keep_a_threshold_on_a_probability_open(engine):
    model = symcheck.loads(MODEL + IRRATIONAL, engine=engine)
    assert model.check("P>=1/3 [ F s=1 ]").value is True
    assert model.check('P>1/3 [ F s=1 ] | filter(count, "big")=3').value is False
