"""Rounding, and the width of proved bounds, put no probability below 0 or above 1; the bounds stay bounds."""

from __future__ import annotations

from random import Random

import pytest

import symcheck
from symcheck.check.result import Certified, Exact


def chain(seed):
    rng = Random(seed)
    n = rng.randint(4, 8)
    commands = (
        f"[] s={s} -> {' + '.join(f'{3 * rng.random():.3f} : (s{chr(39)}={rng.randrange(n)})' for _ in range(rng.randint(1, 4)))};"
        for s in range(n)
    )
    return n, f"ctmc module m s:[0..{n - 1}] init 0; {' '.join(commands)} endmodule"


@pytest.mark.parametrize("engine", ["explicit", "hybrid", "mtbdd"])
@pytest.mark.parametrize("seed", range(6))
def test_probabilities_are_between_0_and_1(seed, engine):
    n, text = chain(seed)
    model = symcheck.loads(text, engine=engine)
    for formula in (
        "S=? [ s>=0 & s<100 ]",
        f"S=? [ s<{n - 1} | s>{n - 2} ]",
        f"P=? [ F[3,3] s<{n} ]",
        f"P=? [ F>=2 s<{n - 1} ]",
    ):
        result = model.check(formula)
        assert min(result.values.lower) >= 0
        assert max(result.values.upper) <= 1
        if isinstance(result.accuracy, Certified):
            assert 0 <= result.accuracy.lower <= result.value <= result.accuracy.upper <= 1
    assert model.check(f"S=? [ s<{n} ]").value == 1


def test_expressions_of_probabilities_are_not_clipped():
    model = symcheck.loads(
        "dtmc module m s:[0..1]; [] s=0 -> 0.5:(s'=1)+0.5:(s'=0); [] s=1 -> true; endmodule"
    )
    assert model.check("P=? [ X s=1 ] + P=? [ F s=1 ]").value == 1.5
    assert model.check("P=? [ X s=1 ] - P=? [ F s=1 ]").value == -0.5


TINY = """mdp
module m
  s : [0..2] init 0;
  [] s=0 -> 1e-16/4.9 : (s'=1) + 1-1e-16/4.9 : (s'=2);
  [] s=1 -> true;
  [] s=2 -> true;
endmodule
"""


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_a_small_complement_does_not_claim_digits_that_rounding_took(engine):
    model = symcheck.loads(TINY, engine=engine)
    result = model.check("Pmin=? [ F G s=1 ]")
    assert isinstance(result.accuracy, Certified)
    assert result.accuracy.lower <= 1e-16 / 4.9 <= result.accuracy.upper <= 1e-11


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
@pytest.mark.parametrize("path", ["G s!=2", "G<=5 s!=2"])
def test_a_small_probability_of_staying_has_its_digits(engine, path):
    model = symcheck.loads(TINY, engine=engine)
    result = model.check(f"Pmin=? [ {path} ]")
    assert result.value == pytest.approx(1e-16 / 4.9, rel=1e-12, abs=0)
    assert result.accuracy == Exact(rounding=True)
    assert model.check(f"P>0 [ {path} ]").value is True
    impossible = model.check("Pmin=? [ G s>2 ]")
    assert (impossible.value, impossible.accuracy) == (0, Exact())
