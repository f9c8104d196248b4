"""Markov automata: what their measures are, on each engine, and what is refused."""

from __future__ import annotations

import sys
from fractions import Fraction
from itertools import pairwise
from math import exp
from pathlib import Path

import pytest

import symcheck
from symcheck.check.result import Certified, Exact
from symcheck.errors import InputError, UnsupportedError
from symcheck.syntax.ast import ModelType

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "benchmarks"))
from markov_automata import run

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")

WORKER = """
ma
module worker
  x : [0..6];
  [fast] x=0 -> (x'=1);
  [slow] x=0 -> 0.7:(x'=2) + 0.3:(x'=3);
  <> x=1 -> 4:(x'=4) + 1:(x'=0);
  <> x=2 -> 1:(x'=5) + 0.5:(x'=0);
  <> x=3 -> 10:(x'=6);
  [r] x=4 -> 0.5:(x'=5) + 0.5:(x'=0);
  [q] x=4 -> (x'=3);
  <> x=5 -> 1:(x'=0);
  <> x=6 -> 2:(x'=0);
endmodule
rewards x=1:3; [r] true:7; x=2:11; endrewards
"""

ZENO = """
ma
module m
  x : [0..2];
  [stay] x=0 -> true;
  [go] x=0 -> (x'=1);
  <> x=1 -> 2:(x'=2);
  <> x=2 -> 1:(x'=2);
endmodule
rewards x=1:1; endrewards
"""


def value(text: str, formula: str, engine: str = "explicit") -> float:
    """The value, which is within its bounds."""
    result = symcheck.loads(text, engine=engine).check(formula)
    assert isinstance(result.accuracy, Certified | Exact)
    return float(result.value)


def chain(*commands: str, states: int = 3) -> str:
    """A model with one variable x from 0."""
    return f"ma module m x:[0..{states - 1}]; {' '.join(commands)} endmodule"


@pytest.mark.parametrize("engine", ENGINES)
def test_a_state_without_choices_is_left_after_an_exponential_time(engine: str):
    text = chain("<> x=0 -> 3:(x'=1);", states=2)
    assert value(text, "Pmax=? [ F<=0.5 x=1 ]", engine) == pytest.approx(1 - exp(-1.5), abs=1e-9)
    assert value(text, "Tmin=? [ F x=1 ]", engine) == pytest.approx(1 / 3)


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
def test_markovian_commands_race(engine: str):
    text = chain("<> x=0 -> 1:(x'=1);", "<> x=0 -> 3:(x'=2);")
    exact = engine == "exact"
    model = symcheck.loads(text, engine="explicit" if exact else engine, exact=exact)
    assert float(model.check("Pmax=? [ F x=2 ]").value) == 0.75
    assert float(model.check("Tmax=? [ F x>0 ]").value) == 0.25


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
def test_time_does_not_pass_where_there_is_a_choice(engine: str):
    text = chain("[a] x=0 -> (x'=1);", "<> x=0 -> 1000000:(x'=2);")
    exact = engine == "exact"
    model = symcheck.loads(text, engine="explicit" if exact else engine, exact=exact)
    assert model.states.count == 2
    assert model.check("Pmax=? [ F x=2 ]").value == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_choices_take_no_time(engine: str):
    text = chain("[a] x=0 -> 0.25:(x'=1) + 0.75:(x'=2);", "<> x=2 -> 1:(x'=1);")
    assert value(text, "Pmax=? [ F<=0 x=1 ]", engine) == 0.25
    assert value(text, "Pmin=? [ F<=1 x=1 ]", engine) == pytest.approx(1 - 0.75 * exp(-1), abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_the_best_choice_depends_on_the_time_that_is_left(engine: str):
    # One goal is near for a while, the other one is sure; the better one changes at one time.
    text = chain(
        "[near] x=0 -> 0.5:(x'=1) + 0.5:(x'=3);",
        "[sure] x=0 -> (x'=2);",
        "<> x=1 -> 10:(x'=4);",
        "<> x=2 -> 1:(x'=4);",
        states=5,
    )
    for t in (0.1, 0.5, 1.0, 2.0):
        best = max(0.5 * (1 - exp(-10 * t)), 1 - exp(-t))
        assert value(text, f"Pmax=? [ F<={t} x=4 ]", engine) == pytest.approx(best, abs=1e-6)


def test_a_choice_after_a_time_uses_what_is_left():
    # First an exponential time, then the choice of the last test: the integral is known.
    text = chain(
        "<> x=0 -> 1:(x'=1);",
        "[near] x=1 -> 0.5:(x'=2) + 0.5:(x'=4);",
        "[sure] x=1 -> (x'=3);",
        "<> x=2 -> 10:(x'=5);",
        "<> x=3 -> 1:(x'=5);",
        states=6,
    )
    steps = 200_000
    t = 1.0 / steps
    truth = sum(
        t * exp(-s) * max(0.5 * (1 - exp(-10 * (1 - s))), 1 - exp(-(1 - s)))
        for s in ((i + 0.5) * t for i in range(steps))
    )
    found = symcheck.loads(text, engine="explicit").check("Pmax=? [ F<=1 x=5 ]")
    assert isinstance(found.accuracy, Certified)
    assert found.accuracy.upper - found.accuracy.lower < 2e-6
    assert float(found.value) == pytest.approx(truth, abs=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_agree(engine: str):
    expected = {
        "Pmax=? [ F<=1 x>=5 ]": 0.971448947556,
        "Pmin=? [ F<=1 x>=5 ]": 0.769954077156,
        "Pmin=? [ G<=1 x<5 ]": 1 - 0.971448947556,
        "Tmin=? [ F x=5 ]": 0.5,
        "Rmin=? [ F x=5 ]": 11.0,
        "Smax=? [ x=5 ]": 2 / 3,
        "Smax=? [ x=3|x=4 ]": 2 / 17,
        "Rmax=? [ S ]": 31 / 3,
        "Rmin=? [ S ]": 15 / 17,
        "Pmax=? [ F^{steps<=3} x=5 ]": 7 / 15,
    }
    for formula, truth in expected.items():
        assert value(WORKER, formula, engine) == pytest.approx(truth, abs=3e-6), formula


def test_long_run_averages_are_exact_in_rationals():
    model = symcheck.loads(WORKER, exact=True)
    assert model.check("Rmax=? [ S ]").value == Fraction(31, 3)
    assert model.check("Smin=? [ x=5 ]").value == 0


def test_rewards_up_to_a_time_and_at_a_time():
    text = chain("<> x=0 -> 2:(x'=1);", states=2).replace("endmodule", "endmodule rewards x=0:3; [] true:5; endrewards")  # fmt: skip
    stayed = (1 - exp(-2)) / 2
    assert value(text, "Rmax=? [ C<=1 ]") == pytest.approx(3 * stayed + 5 * (1 - exp(-2)), rel=1e-6)
    assert value(text, "Rmin=? [ I=1 ]") == pytest.approx(3 * exp(-2), rel=1e-6)


def test_runs_that_let_no_time_pass_reach_nothing():
    assert value(ZENO, "Pmin=? [ F<=5 x=2 ]") == 0
    assert value(ZENO, "Pmax=? [ F<=5 x=2 ]") == pytest.approx(1 - exp(-10), abs=1e-9)
    assert value(ZENO, "Tmin=? [ F x=2 ]") == 0.5
    assert value(ZENO, "Tmax=? [ F x=2 ]") == float("inf")


@pytest.mark.parametrize("formula", ["Smax=? [ x=2 ]", "Rmax=? [ S ]", "Rmax=? [ C<=1 ]"])
def test_zeno_runs_are_told_with_a_state(formula: str):
    with pytest.raises(UnsupportedError, match=r"no time, for example from state \(x=0\)"):
        symcheck.loads(ZENO).check(formula)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("Rmax=? [ Cdiscount=0.9 ]", "discounted rewards are not available for Markov automata"),
        ("multi(Rmax=? [ C<=2 ], P>=0.1 [ F x=6 ])", "rewards up to a bound are not available"),
        ("multi(Rmax=? [ S ], P>=0.1 [ F x=6 ])", "long-run averages are not available"),
        ("Pmax=? [ F (0,1] x=5 ]", "a strict bound at time 0"),
        ("Pmax=? [ F (x=4 & F<=1 x=5) ]", "bounds on time in a path formula"),
    ],
)
def test_what_is_not_there_is_refused_by_name(formula: str, message: str):
    if "(0,1]" in formula:
        formula = "Pmax=? [ F>0 x=5 ]"
    with pytest.raises(UnsupportedError, match=message):
        symcheck.loads(WORKER).check(formula)


NO_CHOICE = """ma
module m x:[0..3]; <up> x<3 -> 2:(x'=x+1); <> x>0 -> 1:(x'=x-1); endmodule
module k y:bool; <> true -> 1:(y'=!y); endmodule
rewards [up] true : 2; y : 3; endrewards
"""


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
def test_an_automaton_without_choices_is_a_ctmc(engine: str):
    """It has the values, distributions and estimates of the same text as a CTMC."""
    model = symcheck.loads(NO_CHOICE, engine=engine)
    same = "ctmc" + NO_CHOICE.replace("<>", "[]").replace("<up>", "[up]").removeprefix("ma")
    chain = symcheck.loads(same, engine=engine)
    assert model.type is chain.type is ModelType.CTMC
    for formula in ("Smax=? [ x=3 & y ]", "R=? [ F x=3 ]", "Tmin=? [ F x=3 & y ]", "P=? [ X x=1 ]"):
        assert model.check(formula).value == chain.check(formula).value
    if engine != "exact":
        assert model.check("P=? [ F<=2 x=3 ]").value == chain.check("P=? [ F<=2 x=3 ]").value
        assert list(model.steady_state()) == list(chain.steady_state())


def test_a_command_with_a_choice_makes_it_an_automaton_again():
    text = NO_CHOICE + "module n z:bool; [] x=3 & !z -> (z'=true); endmodule"
    assert symcheck.loads(text).type is ModelType.MA


def test_markovian_commands_belong_to_markov_automata():
    with pytest.raises(InputError, match="has no Markovian commands"):
        symcheck.loads("mdp module m x:[0..1]; <> x=0 -> 1:(x'=1); endmodule").bound  # noqa: B018


def test_markovian_commands_do_not_synchronise():
    text = "ma module a x:[0..1]; <go> x=0 -> 1:(x'=1); endmodule"
    text += " module b y:[0..1]; [go] y=0 -> (y'=1); endmodule"
    with pytest.raises(InputError, match="cannot synchronise"):
        symcheck.loads(text).bound  # noqa: B018


def test_a_strategy_chooses_where_no_time_passes():
    model = symcheck.loads(WORKER, strategy=True)
    assert model.check("Tmin=? [ F x=5 ]").strategy.actions == ["fast", "", "", "", "r", "", ""]
    result = model.check("Pmax=? [ F<=1 x=5 ]")
    assert any("are not available for Markov automata" in w for w in result.warnings)


def test_time_passes_in_markovian_states_of_a_random_path():
    path = list(symcheck.loads(WORKER).simulate(40, seed=1))
    for before, after in pairwise(path):
        assert (after.time > before.time) == (before.state[0] in (1, 2, 3, 5, 6))


def test_a_function_gives_rates_beside_actions():
    def step(x: int) -> object:
        match x:
            case 0:
                return [("a", {1: 0.5, 2: 0.5}), ("b", {2: 1})]
            case 1:
                return {3: 4}
            case 2:
                return [(1, 3)]
            case _:
                return None

    model = symcheck.from_function(0, step, type="ma")  # type: ignore[arg-type]
    assert model.check("Tmin=? [ F s=3 ]").value == 0.625
    assert model.check("Tmax=? [ F s=3 ]").value == 1.0


@pytest.mark.parametrize("seed", range(12))
def test_random_automata(seed: int):
    assert run(f"test {seed}") == []


AT_ONCE = chain(
    "[a] x=0 -> (x'=1);",
    "[b] x=0 -> 0.5:(x'=1) + 0.5:(x'=2);",
    "<> x=1 -> 3:(x'=2);",
    "<> x>=2 -> 1:true;",
    states=4,
)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("P>0 [ F<=0 x=3 ]", False),
        ("P<=0 [ F<=0 x=3 ]", True),
        ("P>=1 [ G<=0 x<3 ]", True),
        ("filter(forall, P<=0 [ F<=0 x=2 ], x=1)", True),
        ("P<=0 [ F<=0 x=2 ]", False),
    ],
)
def test_at_time_0_only_choices_are_made(formula: str, expected: bool):
    assert symcheck.loads(AT_ONCE).check(formula).value is expected


def test_at_time_0_the_value_is_that_of_choices():
    assert value(AT_ONCE, "Pmax=? [ F<=0 x=2 ]") == pytest.approx(0.5, rel=1e-14)
    assert value(AT_ONCE, "Pmin=? [ F<=0 x=2 ]") == 0
    assert value(AT_ONCE, "Pmin=? [ G<=0 x!=2 ]") == pytest.approx(0.5, rel=1e-14)


def test_a_long_time_is_not_gone_through_where_nothing_is_left_to_happen():
    for time in (1e6, 1e12):
        result = symcheck.loads(AT_ONCE).check(f"Pmin=? [ F<={time:.0f} x=2 ]")
        lower, upper = result.bounds
        assert 1 - 1e-10 < lower < 1
        assert upper == 1
        assert result.iterations < 10_000
        assert symcheck.loads(AT_ONCE).check(f"Pmax=? [ G<={time:.0f} x!=2 ]").bounds[1] < 1e-299


def test_too_much_work_leaves_the_bounds_of_less_time(monkeypatch: pytest.MonkeyPatch):
    text = chain(
        "<> x=0 -> 1:(x'=1) + 1:(x'=2);",
        "<> x=1 -> 1:true;",
        "<> x=2 -> 1:true;",
        "[] x>2 -> true;",
    )
    monkeypatch.setattr("symcheck.numerics.tuning.TIMED_WORK", 1e4)
    result = symcheck.loads(text).check("Pmax=? [ F<=1000000 x=1 ]")
    lower, upper = result.bounds
    assert 0.49 < lower <= 0.5
    assert upper == 1
    assert result.warnings
