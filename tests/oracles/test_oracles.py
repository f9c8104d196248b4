"""Each oracle against closed forms, and against another oracle; none of them knows symcheck."""

from __future__ import annotations

import ast
from fractions import Fraction as Q
from math import exp, inf, isnan
from pathlib import Path

import pytest

from oracles import chains, continuous, decisions, linear_time

HALF = Q(1, 2)
# A fair gambler who plays up to 4: rows 0 and 4 are absorbing.
GAMBLER = [{0: Q(1)}, *({i - 1: HALF, i + 1: HALF} for i in (1, 2, 3)), {4: Q(1)}]
ALL = range(5)
# Leave with probability 1e-200, or 1e-16; in state 0 only.
PATIENT = [
    [{0: 1 - Q(1, 10**200), 1: Q(1, 10**200)}, {0: 1 - Q(1, 10**16), 1: Q(1, 10**16)}],
    [{1: Q(1)}],
]


def test_no_oracle_imports_symcheck():
    files = [f for f in Path(__file__).parent.glob("*.py") if not f.name.startswith("test_")]
    known = {"__future__", "collections.abc", "dataclasses", "fractions", "itertools", "math"}
    known |= {
        "oracles",
        "oracles.chains",
        "oracles.continuous",
        "oracles.decisions",
        "oracles.draw",
    }
    known |= {"oracles.linear_time", "random", "typing", "functools", "operator"}
    known |= {"symcheck_verify"}  # the checker of certificates, which imports nothing of symcheck
    imported = set()
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Import):
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                imported.add(node.module)
    assert len(files) >= 4
    assert "fractions" in imported
    assert imported <= known


def test_a_fair_gambler_wins_in_proportion():
    assert chains.until(GAMBLER, ALL, {4}) == [0, Q(1, 4), HALF, Q(3, 4), 1]
    assert chains.until(GAMBLER, {1, 3}, {4})[1:4] == [0, 0, HALF]
    assert chains.reach_reward(GAMBLER, [Q(1)] * 5, {0, 4}) == [0, 3, 4, 3, 0]
    assert chains.reach_reward(GAMBLER, [Q(1)] * 5, {4}) == [inf, inf, inf, inf, 0]
    assert chains.total(GAMBLER, [0, 1, 1, 1, 0]) == [0, 3, 4, 3, 0]
    assert chains.total(GAMBLER, [0, 1, 1, 1, 1])[:2] == [0, inf]
    assert isnan(chains.total(GAMBLER, [-1, 1, 1, 1, 1])[1])
    assert chains.long_run(GAMBLER, [0, 7, 7, 7, 8]) == [0, 2, 4, 6, 8]
    assert chains.next_step(GAMBLER, {2, 4}) == [0, HALF, 0, 1, 1]


def test_steps_of_a_coin_are_powers():
    tiny = Q(1, 10**200)
    coin = [{0: 1 - tiny, 1: tiny}, {1: Q(1)}]
    for k in (0, 1, 2, 9):
        assert chains.bounded_until(coin, {0, 1}, {1}, 0, k)[0] == 1 - (1 - tiny) ** k
        assert chains.bounded_until(coin, {0, 1}, {0}, k, k)[0] == (1 - tiny) ** k
        assert chains.instantaneous(coin, [3, 0], k)[0] == 3 * (1 - tiny) ** k
        assert chains.cumulated(coin, [1, 0], k)[0] == sum((1 - tiny) ** i for i in range(k))
        assert chains.until_within_cost(coin, [1, 0], {0, 1}, {1}, k)[0] == 1 - (1 - tiny) ** k
    assert chains.bounded_until(coin, {0, 1}, {0}, 2, 3)[0] == (1 - tiny) ** 2
    assert chains.until_from(coin, {0}, {1}, 3)[0] == (1 - tiny) ** 2
    assert chains.discounted(coin, [1, 0], HALF)[0] == 1 / (1 - HALF * (1 - tiny))
    assert chains.until_within_cost(coin, [0, 0], {0, 1}, {1}, 0)[0] == 1  # waiting is free


def test_a_cycle_has_its_shares():
    cycle = [{1: Q(1)}, {0: Q(1, 3), 1: Q(2, 3)}, {0: Q(1)}]
    assert chains.components(cycle) == [{0, 1}]
    assert chains.stationary(cycle, {0, 1}) == {0: Q(1, 4), 1: Q(3, 4)}


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        (("F", "won"), HALF),
        (("U", "inside", "won"), HALF),
        (("G", "inside"), 0),
        (("X", ("X", "won")), Q(1, 4)),
        (("F", ("&", "inside", ("X", "won"))), HALF),
        (("F", ("G", "won")), HALF),
        (("G", ("F", ("!", "won"))), HALF),
        (("W", "inside", "won"), HALF),
        (("R", "won", "inside"), 0),
        (("|", ("F", "won"), ("X", ("X", "middle"))), Q(3, 4)),
        # won, except without a step from 3 to 2, which has 1/4 + 1/4 of itself
        (("F", ("&", "high", ("X", ("&", "middle", ("F", "won"))))), HALF - Q(1, 3)),
    ],
)
def test_linear_time_on_the_gambler(formula, value):
    labels = {"won": {4}, "inside": {1, 2, 3}, "middle": {2}, "high": {3}}
    assert linear_time.probability(GAMBLER, labels, formula)[2] == value


def test_a_condition_is_a_quotient():
    labels = {"won": {4}, "low": {1}, "lost": {0}}
    given = linear_time.conditional(GAMBLER, labels, ("F", "won"), ("F", "low"))
    assert given[2] == Q(1, 4)
    assert given[4] is None


def test_strategies_are_all_tried():
    assert decisions.until(PATIENT, min, range(2), {1}) == [1, 1]
    rewards = [[Q(1), Q(1)], [Q(0)]]
    assert decisions.reach_reward(PATIENT, rewards, min, {1})[0] == 10**16
    assert decisions.reach_reward(PATIENT, rewards, max, {1})[0] == 10**200
    assert (
        decisions.bounded_until(PATIENT, max, range(2), {1}, 0, 2)[0] == 1 - (1 - Q(1, 10**16)) ** 2
    )
    assert decisions.next_step(PATIENT, min, {1}) == [Q(1, 10**200), 1]
    assert decisions.cumulated(PATIENT, rewards, min, 2)[0] == 2 - Q(1, 10**16)
    assert decisions.instantaneous(PATIENT, [Q(1), Q(0)], max, 1)[0] == 1 - Q(1, 10**200)


def test_conditional_probabilities_of_processes():
    # 0: to 1 and 2 with 1/4, to 3 with 1/2, or to 2 and 3 with 1/2; 1 goes on to 2 if asked.
    third = [{3: Q(1)}]
    mdp = [
        [{1: Q(1, 4), 2: Q(1, 4), 3: HALF}, {2: HALF, 3: HALF}],
        [{2: Q(1)}, {3: Q(1)}],
        [{2: Q(1)}],
        third,
    ]
    assert decisions.conditional(mdp, max, {1}, {2})[0] == HALF
    assert decisions.conditional(mdp, min, {1}, {2})[0] == 0
    assert decisions.conditional(mdp, max, {1}, {2})[3] is None
    # 1 can avoid 2, and a strategy that does not has 1 behind it.
    assert decisions.conditional(mdp, min, {1}, {2})[1] == 1


def test_a_process_that_alternates_needs_memory():
    # 0 goes to 1 or 2, which return: no memoryless strategy visits both for ever.
    mdp = [[{1: Q(1)}, {2: Q(1)}], [{0: Q(1)}], [{0: Q(1)}]]
    labels = {"a": {1}, "b": {2}}
    both = linear_time.maximum(mdp, labels, [], ["a", "b"], lambda _, often: all(often))
    assert both == [1, 1, 1]
    once = linear_time.maximum(
        mdp, labels, [("F", "a")], ["b"], lambda done, often: not done[0] and often[0]
    )
    assert once == [1, 0, 1]
    assert linear_time.maximum(mdp, labels, [], ["a"], lambda *_: True, most_states=2) is None


@pytest.mark.parametrize(
    "formula",
    [
        ("F", ("&", "a", ("X", "a"))),
        ("U", ("!", "b"), ("&", "a", ("X", ("X", ("!", "a"))))),
        ("|", ("F", "b"), ("X", ("X", "a"))),
    ],
)
def test_refinement_and_strategies_agree_on_chains(formula):
    chain = [{0: HALF, 1: Q(1, 3), 2: Q(1, 6)}, {0: Q(1, 5), 1: Q(3, 5), 2: Q(1, 5)}, {2: Q(1)}]
    labels = {"a": {1}, "b": {2}}
    refined = linear_time.probability(chain, labels, formula)
    mdp = [[row] for row in chain]
    found = linear_time.maximum(mdp, labels, [formula], [], lambda done, _: done[0], most_states=12)
    assert found == refined
    assert any(0 < v < 1 for v in refined) or formula[0] == "|"


@pytest.mark.parametrize("time", [Q(0), Q(1, 10**9), Q(1, 3), Q(5), Q(10**12)])
def test_two_exponentials(time):
    rates = [{1: Q(2)}, {2: Q(3)}, {}]
    low, high = continuous.bounded_until(rates, range(3), {2}, Q(0), time)[0]
    x = float(time)
    assert high - low < Q(1, 10**500)
    if time >= Q(1, 3):
        assert float(low) == pytest.approx(1 - 3 * exp(-2 * x) + 2 * exp(-3 * x), rel=1e-14)
    elif time:
        assert float(low) == pytest.approx(3 * x**2 - 5 * x**3, rel=1e-15)
    first = continuous.cumulated(rates, [Q(1), Q(0), Q(0)], [Q(0)] * 3, time)[0]
    assert float(first[0]) == pytest.approx((1 - exp(-2 * x)) / 2, rel=1e-7)
    assert continuous.cumulated(rates, [Q(0)] * 3, [Q(1), Q(0), Q(0)], time)[0] == (
        pytest.approx(2 * first[0]),
        pytest.approx(2 * first[1]),
    )
    stays = continuous.bounded_until(rates, range(3), {0}, time, time)[0]
    assert float(stays[0]) == pytest.approx(exp(-2 * x), rel=1e-14, abs=1e-300)
    assert continuous.instantaneous(rates, [Q(1), Q(0), Q(0)], time)[0] == stays


def test_exponentials_have_proved_digits():
    """e^-1 to 300 digits, by its own series."""
    low, high = continuous.bounded_until([{1: Q(1)}, {}], {0, 1}, {0}, Q(1), Q(1))[0]
    series, term = Q(0), Q(1)
    for k in range(1, 200):
        series += term
        term = -term / k
    assert low - Q(1, 10**300) <= series <= high + Q(1, 10**300)
    assert low < high


def test_a_window_of_time_is_after_its_delay():
    rates = [{1: Q(2)}, {0: Q(3)}]
    low, high = continuous.bounded_until(rates, {0}, {1}, Q(1), Q(3))[0]
    assert float(low) == pytest.approx(exp(-2) - exp(-6), rel=1e-14)
    assert float(continuous.until_from(rates, {0}, {1}, Q(1))[0][1]) == pytest.approx(exp(-2))
    assert high - low < Q(1, 10**500)


def test_long_run_of_a_switch():
    rates = [{1: Q(2)}, {0: Q(3)}]
    assert continuous.long_run(rates, [Q(1), Q(0)], [Q(0), Q(0)]) == [Q(3, 5)] * 2
    assert continuous.long_run(rates, [Q(0), Q(0)], [Q(1), Q(0)]) == [Q(6, 5)] * 2
    assert continuous.occupied(rates, [Q(1), Q(0)], [Q(1), Q(0)]) == [Q(3, 2), 0]
