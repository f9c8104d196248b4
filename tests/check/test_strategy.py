"""Strategies: the Markov chain that one induces has, checked by itself, the value that was promised."""

from __future__ import annotations

from dataclasses import dataclass, replace
from io import StringIO
from math import inf
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st

import symcheck
from checking import LOSSY, check_text, engine_of
from generate import random_model
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import InputError, NoStrategyError, UnsupportedError, UsageError
from symcheck.exchange.strategies.files import (
    StrategyTarget,
    strategy_target,
    strategy_texts,
    write_strategy,
)
from symcheck.numerics.linear import methods
from symcheck.syntax.ast import ModelType

MODELS = Path(__file__).parents[2] / "models"

SLOW = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
QUERIES = [
    'P{}=? [ F "a" ]',
    'P{}=? [ "b" U "a" ]',
    'P{}=? [ G "b" ]',
    'P{}=? [ X "a" ]',
    'P{}=? [ !"a" W "b" ]',
    'R{}=? [ F "a" ]',
    "R{}=? [ C discount=0.9 ]",
]


@dataclass(frozen=True, eq=False)
class Chain:
    """An explored MDP reduced to the rows of a strategy."""

    mdp: object
    model: object
    matrix: object
    choice_rewards: list

    def __getattr__(self, name):
        return getattr(self.mdp, name)


def induced(strategy):
    explored = strategy.engine.explored
    rewards = [r[strategy.rows] for r in explored.choice_rewards]
    return ExplicitEngine(
        Chain(explored, replace(explored.model, type=ModelType.DTMC), strategy.induced, rewards)
    )


@SLOW
@given(
    seed=st.integers(0, 2**20),
    direction=st.sampled_from(["min", "max"]),
    query=st.sampled_from(QUERIES),
)
def test_the_induced_chain_has_the_value(seed, direction, query):
    try:
        engine = engine_of(random_model(Random(seed), "mdp").text)
    except InputError:
        assume(False)
    result = check_text(engine, query.format(direction), strategy=True)
    assert not result.warnings
    chain = check_text(induced(result.strategy), query.format("")).values
    for (low, high), (other_low, other_high) in zip(
        zip(*result.values.at(engine.all), strict=True),
        zip(*chain.at(engine.all), strict=True),
        strict=True,
    ):
        if inf in (low, other_low):
            assert low == other_low
        else:
            assert other_low <= high * (1 + 2e-6) + 1e-11
            assert low <= other_high * (1 + 2e-6) + 1e-11


LONGER = [
    'P{}=? [ F<=3 "a" ]',
    'P{}=? [ "b" U<=4 "a" ]',
    'P{}=? [ G<=2 "b" ]',
    'P{}=? [ F[1,3] "a" ]',
    'P{}=? [ G F "a" ]',
    'P{}=? [ F G "b" ]',
    'P{}=? [ (G F "a") & (G F !"b") ]',
    'P{}=? [ (G F "a") => (G F "b") ]',
    'P{}=? [ G ("a" => (F "b")) ]',
    'P{}=? [ (G F "a") & (G F !"a") & (F G "b") ]',
    'P{}=? [ F ("a" & (X "b")) ]',
    'P{}=? [ X X "a" ]',
]


@SLOW
@given(
    seed=st.integers(0, 2**20),
    direction=st.sampled_from(["min", "max"]),
    query=st.sampled_from(LONGER),
)
@example(seed=13774, direction="min", query='P{}=? [ F ("a" & (X "b")) ]')
def test_the_induced_chain_of_a_strategy_with_memory(seed, direction, query):
    try:
        engine = engine_of(random_model(Random(seed), "mdp", largest=4).text)
    except InputError:
        assume(False)
    result = check_text(engine, query.format(direction), strategy=True)
    assert not result.warnings
    chain = check_text(induced(result.strategy), query.format("")).values
    entry = slice(None) if result.strategy.entry is None else result.strategy.entry
    low, high = result.values.at(engine.all)
    other_low, other_high = (side[entry] for side in (chain.lower, chain.upper))
    assert (other_low <= high * (1 + 2e-6) + 1e-11).all()
    assert (low <= other_high * (1 + 2e-6) + 1e-11).all()


ROUND = """mdp
module m
  s : [0..3];
  [go] s=0 -> (s'=1);
  [on] s=1 -> (s'=0);
  [out] s=1 -> 0.5:(s'=2) + 0.5:(s'=3);
  [wait] s=0 -> true;
  [] s>1 -> true;
endmodule
rewards "cost"
  [out] true : 4;
endrewards
"""


def actions(text, **kwargs):
    return check_text(engine_of(ROUND), text, strategy=True, **kwargs).strategy.actions


def test_progress_in_end_components():
    # Each of go, on and wait keeps the greatest probability of 1/2 (1), and only go and out attain it.
    assert actions("Pmax=? [ F s=2 ]")[:2] == ["go", "out"]
    assert actions("Pmax=? [ F s>=2 ]")[:2] == ["go", "out"]
    assert actions('R{"cost"}min=? [ F s>=2 ]')[:2] == ["go", "out"]
    assert actions("P>=0.5 [ F s>=2 ]")[1] == "on"  # over all strategies: the worst
    assert actions("Pmin=? [ F s=2 ]")[1] == "on"


def test_files():
    strategy = check_text(engine_of(ROUND), "Pmax=? [ F s=2 ]", strategy=True).strategy

    def written(kind, **kwargs):
        out = StringIO()
        write_strategy(strategy, out, kind, **kwargs)
        return out.getvalue()

    assert written("actions") == "(0)=go\n(1)=out\n"  # the other states have nothing to decide
    assert written("indices").splitlines() == [
        f"0={strategy.rows[0]}",
        f"1={strategy.rows[1] - 2}",
    ]
    assert written("induced") == "4 5\n0 1 1 go\n1 2 0.5 out\n1 3 0.5 out\n2 2 1\n3 3 1\n"
    assert written("dot").startswith("digraph")
    assert '1 -> 3 [label="0.5:out"];' in written("dot")
    least = check_text(engine_of(ROUND), "Pmin=? [ F s=2 ]", strategy=True).strategy
    out = StringIO()
    write_strategy(least, out)
    assert "(2)" not in out.getvalue()
    assert np.array_equal(least.reachable[2:], [False, False])
    reached = "".join(strategy_texts(least, StrategyTarget("", "induced", reach=True)))
    assert reached == f"2 2\n0 {least.induced.indices[0]} 1 {least.actions[0]}\n1 0 1 on\n"
    whole = StrategyTarget("", "induced", restrict=True, reach=False)
    restricted = "".join(strategy_texts(strategy, whole))
    assert restricted == "4 4 5\n0 0 1 1 go\n1 0 2 0.5 out\n1 0 3 0.5 out\n2 0 2 1\n3 0 3 1\n"
    numbers = "".join(strategy_texts(least, StrategyTarget("", states=False, reach=True)))
    assert numbers.splitlines() == [f"{s}={least.actions[s]}" for s in (0, 1) if least.matters[s]]
    drawn = "".join(
        strategy_texts(strategy, StrategyTarget("", "dot", restrict=True, states=False))
    )
    assert '1 -> n1_0 [label="0:out",arrowhead="none"];' in drawn
    assert 'n1_0 -> 3 [label="0.5"];' in drawn


def test_targets():
    assert strategy_target("a.txt") == StrategyTarget("a.txt")
    assert strategy_target("a.tra") == StrategyTarget("a.tra", "induced", reach=False)
    assert strategy_target("x:y.dot") == StrategyTarget("x:y.dot", "dot")
    assert strategy_target("a:type=induced,mode=restrict,states=false") == StrategyTarget(
        "a", "induced", restrict=True, reach=False, states=False
    )
    with pytest.raises(UsageError):
        strategy_target("a:type=other")


def test_what_is_remembered():
    strategy = check_text(
        engine_of(ROUND), "Pmax=? [ (G F s=0) & (G F s=1) ]", strategy=True
    ).strategy
    assert len(next(strategy.states())) == 2  # s, and the memory
    run = [
        a for a, there in zip(strategy.actions, strategy.reachable.tolist(), strict=True) if there
    ]
    assert set(run) == {"go", "on"}
    out = StringIO()
    write_strategy(strategy, out)
    assert out.getvalue().startswith("(0),0=go\n")
    late = check_text(engine_of(ROUND), "Pmax=? [ F<=2 s=2 ]", strategy=True)
    assert late.value == 0.5
    assert late.strategy.actions[late.strategy.entry[0]] == "go"


@pytest.mark.parametrize("text", ['Pmax=? [ X^{rew{"cost"}<=3} s=1 ]', "s=1"])
def test_unsupported_strategies_leave_the_result(text):
    result = check_text(engine_of(ROUND), text, strategy=True)
    assert result.strategies == ()
    assert result.warnings[0] == f"no strategy: {result.no_strategy}"


@pytest.mark.parametrize("engine", ["sparse", "mtbdd"])
def test_engines_on_diagrams(engine):
    built = engine_of(ROUND, engine)
    result = check_text(built, "Pmax=? [ F s=2 ]", strategy=True)
    assert result.strategy.actions[:2] == ["go", "out"]
    assert result.engine is built
    assert result.values.of_engine.at(built.initial)[0] == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("engine", ["explicit", "exact", "sparse", "hybrid", "mtbdd"])
@pytest.mark.parametrize(
    "text",
    [
        "Pmax=? [ F s=2 ]",
        "Pmin=? [ F s=2 ]",
        "Pmax=? [ G s!=2 ]",
        "Pmin=? [ G s!=2 ]",
        'R{"cost"}max=? [ F s>=2 ]',
        'R{"cost"}min=? [ F s>=2 ]',
        'R{"cost"}min=? [ F (s=1 & (X s>=2)) ]',
        'R{"cost"}max=? [ C ]',
        'R{"cost"}max=? [ C discount=0.9 ]',
        'R{"cost"}min=? [ S ]',
        "Smax=? [ s=2 ]",
        "Pmax=? [ F (s=1 & (X s=2)) ]",
        "Pmin=? [ F F s=2 ]",
        "Pmin=? [ !(G F s=2) ]",
        "Pmax=? [ F P>=0.9 [ F s=2 ] ]",
        "Pmax=? [ (G F s=2) | (G F s=3) ]",
        "P>=0.1 [ F s=2 ]",
    ],
)
def test_the_strategy_comes_with_the_solution(text, engine, monkeypatch):
    """Nothing is explored or solved again for it."""
    built, rows, solved = engine_of(LOSSY, engine), engine_of(LOSSY), []
    solve = methods.solve_linear

    def counting(problem, settings, observer=None):
        solved.append(problem)
        return solve(problem, settings, observer)

    monkeypatch.setattr(methods, "solve_linear", counting)
    monkeypatch.setattr("symcheck.explicit.build.explore", None)
    plain = check_text(built if engine == "exact" else rows, text)
    before, solved[:] = len(solved), []
    result = check_text(built, text, strategy=True)
    assert result.strategies
    assert len(solved) <= before
    assert len(result.runs) <= len(plain.runs)
    assert result.value == pytest.approx(plain.value)


@pytest.mark.parametrize("engine", ["explicit", "sparse", "mtbdd"])
@pytest.mark.parametrize(
    "text", ["filter(count, s<2)", "filter(avg, Pmax=? [ F s=2 ], s<2)", "Pmax=? [ F s=2 ]", "s<2"]
)
def test_a_result_is_the_same_without_a_strategy(text, engine):
    """Also of a filter, in a model with several initial states, where diagrams are listed as rows."""
    several = LOSSY + "init s<2 endinit\n"
    built = engine_of(several, engine)
    plain, found = (check_text(built, text, strategy=wanted) for wanted in (False, True))
    assert found.value == pytest.approx(plain.value)
    assert found.explanation == plain.explanation
    assert found.engine is plain.engine


SHIFT = """mdp
module m
  s : [0..2];
  [save] s=0 -> (s'=1);
  [take] s=0 -> true;
  [on] s=1 -> (s'=2);
  [stop] s=2 -> true;
endmodule
rewards "gain" [take] true : 2; [on] true : 5; endrewards
"""


def test_rewards_of_the_first_steps_need_the_number_of_steps():
    # With one step left, taking 2 is best; with two, saving earns 5.
    found = check_text(engine_of(SHIFT), 'R{"gain"}max=? [ C<=3 ]', strategy=True)
    assert found.value == 7
    out = StringIO()
    write_strategy(found.strategy, out)
    assert out.getvalue().splitlines() == [
        "(0),0=take",
        "(0),1=save",
        "(1),2=on",
        "# memory: 0",
        "# (0),0 -> 1",
        "# (0),1 -> 2",
        "# (1),2 -> 3",
    ]


def test_long_run_averages_leave_and_stay():
    found = check_text(engine_of(SHIFT), 'R{"gain"}max=? [ S ]', strategy=True)
    assert (found.value, found.strategy.actions[0]) == (2, "take")
    least = check_text(engine_of(SHIFT), 'R{"gain"}min=? [ S ]', strategy=True)
    assert (least.value, least.strategy.actions) == (0, ["save", "on", "stop"])


SWAP = """mdp
module m
  s : [0..1] init 1;
  [] true -> 1/3 : (s'=1-s) + 2/3 : (s'=1);
  [go] true -> 1/3 : (s'=1-s) + 2/3 : (s'=0);
endmodule
"""


@pytest.mark.parametrize("engine", ["explicit", "exact"])
def test_the_policy_that_proves_a_long_run_average_is_the_strategy(engine):
    found = check_text(engine_of(SWAP, engine), "Smax=? [ s=0 ]", strategy=True)
    assert float(found) == pytest.approx(0.75)
    assert found.strategy.actions == ["go", "go"]


def test_a_memory_that_is_too_large_is_refused(monkeypatch):
    from symcheck.check import tuning

    monkeypatch.setattr(tuning, "STRATEGY_ENTRIES", 100)
    found = check_text(engine_of(SHIFT), 'R{"gain"}max=? [ C<=50 ]', strategy=True)
    with pytest.raises(NoStrategyError, match="the result has no strategy: a strategy would need"):
        _ = found.strategy
    assert "a strategy would need a memory of 51 values in each of 3 states" in found.warnings[0]


@pytest.mark.parametrize("engine", ["sparse", "mtbdd"])
def test_a_model_without_room_for_its_rows_is_refused_before_it_is_checked(engine, monkeypatch):
    built = engine_of(SHIFT, engine)
    monkeypatch.setenv("SYMCHECK_MEMORY", "0")
    with pytest.raises(UnsupportedError, match=r"(?s)rows of all 3 states.*without -exportstrat"):
        check_text(built, 'R{"gain"}max=? [ S ]', strategy=True)
    assert check_text(built, "Pmax=? [ F s=2 ]").value == 1


def test_a_model_with_too_many_rows_is_refused_before_they_are_listed(monkeypatch):
    """Consensus of 8 processes: its 366 nodes are built in seconds, its 61 million rows are not."""
    built = engine_of(SHIFT, "mtbdd")
    monkeypatch.setattr(type(built), "transitions", 403_856_384)
    monkeypatch.setattr("symcheck.check.strategies.to_explicit.available_memory", lambda: 10**12)
    with pytest.raises(UnsupportedError, match=r"403,856,384 transitions they(?s:.*)-ex \(engine"):
        check_text(built, 'R{"gain"}max=? [ S ]', strategy=True)
    listed = check_text(engine_of(SHIFT, "explicit"), 'R{"gain"}max=? [ S ]', strategy=True)
    assert listed.strategies


@pytest.mark.parametrize(
    ("model", "text", "wanted", "message"),
    [
        ("gambler/stakes.nm", "Pmax=? [ F money=8 ]", False, "the option strategy=True computes"),
        ("gambler/stakes.nm", "money=3", True, "the result has no strategy: "),
        ("die/die.pm", "P=? [ F d=6 ]", False, "only for MDPs, and this model is a DTMC"),
        ("die/die.pm", "P=? [ F d=6 ]", True, "only for MDPs, and this model is a DTMC"),
        ("gambler/stakes.nm", "multi(Pmax=? [ F money=8 ], Pmin=? [ F money=1 ])", True, "strategies[0]"),
    ],
)  # fmt: skip
def test_a_result_without_a_strategy_says_how_to_ask_for_one(model, text, wanted, message):
    loaded = symcheck.load(MODELS / model, strategy=wanted)
    result = loaded.check(text)
    if message == "strategies[0]":  # of a front with one point
        assert result.strategy is result.strategies[0]
        return
    with pytest.raises(NoStrategyError) as caught:
        _ = result.strategy.actions
    assert message in str(caught.value)
    assert not hasattr(result, "strategy")
    assert result.strategies == ()
    assert repr(result)
