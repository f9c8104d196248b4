"""Operators whose bound leaves no time: every engine gives what holds now, without any error."""

from __future__ import annotations

from fractions import Fraction

import pytest

from checking import check_text, engine_of
from symcheck.check.result import Result
from symcheck.engines.base import Engine

ENGINES = ["explicit", "exact", "sparse", "hybrid", "mtbdd"]
KINDS = ["dtmc", "ctmc", "mdp"]
PROBABILITIES = {
    "F{} s=0": 1,
    "F{} s=1": 0,
    "G{} s=0": 1,
    "G{} s=1": 0,
    "s=0 U{} s=1": 0,
    "s=1 U{} s=0": 1,
    "s=0 W{} s=1": 1,
    "s=1 R{} s=0": 1,
    "s=0 R{} s=1": 0,
    "X{} s=1": 0,
    "X{} true": 0,
}
REWARDS = {"C<=0": 0, "I=0": Fraction(3, 10), "C<=0 discount=0.5": 0}


def model(kind: str, engine: str) -> Engine:
    weights = ("3", "2") if kind == "ctmc" else ("1/3", "2/3")
    return engine_of(
        f"{kind} module m s:[0..2]; [a] s=0 -> {weights[0]}:(s'=1) + {weights[1]}:(s'=2);"
        "[b] s=0 -> (s'=1); [a] s=1 -> 0.7:(s'=2) + 0.3:(s'=2); [] s=2 -> true; endmodule "
        "rewards s=0 : 0.3; s=1 : 7; [a] true : 11; s=2 : -1; endrewards",
        engine,
    )


def ask(engine: Engine, operator: str, bound: str, query: str) -> Result:
    ways = "max" if engine.model.type.value == "mdp" and bound == "=?" else ""
    return check_text(engine, f"{operator}{ways}{bound} [ {query} ]")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ENGINES)
def test_values_at_time_zero_are_exact(kind, engine):
    built = model(kind, engine)
    for query, expected in PROBABILITIES.items():
        for window in ("<=0", "[0,0]"):
            result = ask(built, "P", "=?", query.format(window))
            assert result.value == expected, query
            assert str(result.accuracy) == "exact", query
            for relation, holds in ((">=", True), (">", False), ("<=", True), ("<", False)):
                verdict = ask(built, "P", f"{relation}{expected}", query.format(window))
                assert verdict.value is holds, query
    for query, expected in REWARDS.items():
        if kind == "ctmc" and "discount" in query:
            continue
        result = ask(built, "R", "=?", query)
        assert result.value == (expected if engine == "exact" else float(expected)), query
        is_rounded = query == "I=0" and engine != "exact"  # 0.3 is no double
        assert str(result.accuracy) == ("exact up to rounding" if is_rounded else "exact"), query
        for relation, holds in ((">=", True), (">", False), ("<=", True), ("<", False)):
            assert ask(built, "R", f"{relation}{expected}", query).value is holds, query


@pytest.mark.parametrize("engine", ENGINES)
def test_a_jump_happens_at_no_single_time(engine):
    result = check_text(model("ctmc", engine), "P=? [ X[2,2] s=1 ]")
    assert result.value == 0
    assert str(result.accuracy) == "exact"


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_window_of_one_step_reads_the_states_after_it(kind, engine):
    built = model(kind, engine)
    ways = "max" if kind == "mdp" else ""
    half = Fraction(1, 2)
    for query, expected in {
        "F[1,1] s=1": (half + half / 3, 1),
        "F[2,2] s=2": (1, 1),
        "G[1,1] s!=1": (half * Fraction(2, 3), Fraction(2, 3)),
    }.items():
        result = check_text(built, f"P{ways}=? [ {query} ]")
        assert float(result.value) == pytest.approx(float(expected[kind == "mdp"]), rel=1e-15)
