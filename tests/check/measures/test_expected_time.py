"""Expected time: `T=? [ path ]` counts every step of a DTMC or MDP, and the time of a CTMC."""

from __future__ import annotations

import pytest

import symcheck
from checking import check_text, engine_of
from symcheck.errors import InputError, UnsupportedError

CORRIDOR = """
dtmc
const int T = 2;
module corridor
  x : [0..5];
  y : [0..1];
  [] x=0 -> (x'=1);
  [] x=1 -> (x'=2);
  [] x=2 -> (x'=3);
  [] x=3 -> 0.5 : (x'=0) + 0.5 : (x'=4) & (y'=1);
  [] x=4 -> (x'=5);
  [] x=5 -> true;
endmodule
rewards "ten" true : 10; endrewards
"""
"""From x=0, four steps end in x=4 or in x=0 again: 8 steps on average, and one more to x=5."""

RACE = """
ctmc
module race
  x : [0..3];
  [] x=0 -> 3 : (x'=1) + 1 : (x'=2);
  [] x=1 | x=2 -> 4 : (x'=3);
  [] x=3 -> 1 : true;
endmodule
"""

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd", "exact")


@pytest.mark.parametrize("engine", ENGINES)
def test_steps_are_counted_and_rewards_are_not(engine) -> None:
    model = engine_of(CORRIDOR, engine)
    assert check_text(model, "T=? [ F x=5 ]").value == pytest.approx(9, rel=1e-9)
    assert check_text(model, "T=? [ x<4 U x=4 ]").value == pytest.approx(8, rel=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_model_needs_no_rewards(engine) -> None:
    model = engine_of(RACE, engine)
    assert check_text(model, "T=? [ F x=3 ]").value == pytest.approx(0.5, rel=1e-9)


@pytest.mark.parametrize("engine", ENGINES[:-1])
def test_a_reduction_keeps_the_number_of_steps(engine) -> None:
    model = symcheck.loads(CORRIDOR, engine=engine, reduce=True)
    assert model.check("T=? [ F x=5 ]").value == pytest.approx(9, rel=1e-9)
    assert model.check("T<9.5 [ F x=5 ]").value is True


@pytest.mark.parametrize("engine", ENGINES[:-1])
def test_a_quotient_keeps_the_number_of_steps(engine) -> None:
    model = symcheck.loads(CORRIDOR, engine=engine, bisim=True)
    assert model.check("T=? [ F x=5 ]").value == pytest.approx(9, rel=1e-9)


def test_the_quotient_of_a_ctmc_keeps_the_time() -> None:
    model = symcheck.loads(RACE, bisim=True)
    result = model.check("T=? [ F x=3 ]")
    assert result.value == pytest.approx(0.5, rel=1e-9)
    assert "4 states -> 3" in result.explanation


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("T", 2),
        ("T<3", True),
        ("T<=x+2 & x=0", True),
        ("P=? [ x<T U x=T ]", 1),
        ("P=? [ T<3 U[1,2] x=1 ]", 1),
        ("P=? [ T<=(3) & x=0 U[0,1] x=1 ]", 1),
        ("P=? [ F[0,T] x=2 ]", 1),
        ("P>=T>5 ? 0.5 : 0.1 [ F x=2 ]", True),
        ('R{"ten"}=? [ C<=T ]', 20),
        ("T<=9+T [ F x=5 ]", True),
        ("T<=T [ F x=5 ]", False),
        ("T>(2+min((1),(pow(2,(1))))) [ F x=5 ]", True),
        ("T > 1e-3 [ F x=5 ]", True),
        ("S=? [ T<=0 [ F x=5 ] ]", 1),
    ],
)
def test_a_constant_may_be_called_t(text, value) -> None:
    assert check_text(engine_of(CORRIDOR), text).value == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("T=? [ x ]", "a path formula must be a bool"),
        ("T>=true [ F x=5 ]", "a threshold must be a number"),
        ("T>=x [ F x=5 ]", "a threshold must be constant"),
        ("T=? [ G x=5 ]", "needs a co-safe formula"),
        ("T=? [ C<=4 ]", "unexpected 'C'"),
    ],
)
def test_faults_are_named(text, message) -> None:
    with pytest.raises(symcheck.SymcheckError, match=message):
        check_text(engine_of(CORRIDOR), text)


def test_an_mdp_needs_a_direction() -> None:
    mdp = CORRIDOR.replace("dtmc", "mdp")
    model = engine_of(mdp)
    with pytest.raises(InputError, match=r"Tmin=\? or Tmax=\?"):
        check_text(model, "T=? [ F x=5 ]")
    with pytest.raises(UnsupportedError, match="Tminmax is not supported"):
        check_text(model, "Tminmax=? [ F x=5 ]")
    with pytest.raises(UnsupportedError, match="fair strategies"):
        check_text(engine_of(mdp, fairness=True), "Tmin=? [ F x=5 ]", fairness=True)


def test_simulation_estimates_it() -> None:
    race = symcheck.loads(RACE).estimate("T=? [ F x=3 ]", samples=2000, seed=1)
    assert race.value == pytest.approx(0.5, rel=0.1)
    with pytest.raises(UnsupportedError, match="until states are reached"):
        symcheck.loads(RACE).estimate("T=? [ x=0 U x=1 ]", samples=10)
