"""The compiled search in whole numbers finds what the interpreter finds in rationals."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import pytest

import symcheck
from generate import random_model
from symcheck.engines.rational.explore import explore_exactly
from symcheck.engines.rational.whole_numbers import explore_in_whole_numbers
from symcheck.errors import SymcheckError

SMALL = """dtmc
module a x:[0..2]; [t] x<2 -> 1/3:(x'=x+1) + 2/3:true; [] x=0 -> 0.1:(x'=2) + 0.9:(x'=1); endmodule
module b y:[0..3]; [t] y<3 -> 1/7:(y'=y+1) + 6/7:(y'=3); [] y=3 -> true; endmodule
rewards "r" x=1 : 1/3; y>1 : y*2; endrewards"""


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("seed", range(20))
def test_random_models_are_the_same(kind: str, seed: int) -> None:
    assert_same(random_model(Random(seed), kind).text)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_commands_that_synchronise_have_one_factor(kind: str) -> None:
    assert_same(SMALL.replace("dtmc", kind), expected=True)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_rewards_of_choices_are_those_of_their_actions(kind: str) -> None:
    """In a chain, commands of several actions are enabled at once, and some states are deadlocks."""
    items = 'rewards "s" [t] y>0 : 1/3; [] true : 2; [t] x=0 : y; endrewards'
    assert_same(SMALL.replace("dtmc", kind) + items, expected=True)
    assert_same(SMALL.replace("[] y=3 -> true;", "").replace("dtmc", kind) + items, expected=True)


def test_rows_of_a_chain_are_those_of_its_commands_together() -> None:
    """Commands lead to the same state, and one action is that of the row only if all have it."""
    text = """ctmc module m x:[0..2];
    [a] x=0 -> 1/3:(x'=1) + 2:(x'=2); [a] x=0 -> 1/7:(x'=1); [b] x=1 -> 5:(x'=0);
    [] x=1 -> 1:(x'=0) + 1/2:(x'=1); endmodule
    rewards [a] true : 1/2; [b] true : 3; [] true : 5; x=2 : 1; endrewards"""
    assert_same(text, expected=True)
    assert_same(text.replace("ctmc", "ctmc const double k = 1/11;"), expected=True)


def test_deadlocks_of_a_markov_automaton() -> None:
    """A state has several rows, so that a deadlock is found by its row and not by its number."""
    text = """ma
    module m x:[0..3]; [a] x=0 -> 0.25:(x'=1) + 0.75:(x'=2); [b] x=0 -> 1/3:(x'=2) + 2/3:(x'=3);
    <> x=1 -> 1/2:(x'=2) + 3:(x'=3); endmodule
    rewards [a] true : 1/2; x=1 : 1/7; endrewards"""
    assert_same(text, expected=True)


@pytest.mark.parametrize("seed", range(20))
def test_random_automata_without_rates_are_the_same(seed: int) -> None:
    assert_same(random_model(Random(seed), "mdp").text.replace("mdp", "ma", 1))


def test_probabilities_that_depend_on_the_state_are_left_to_the_interpreter() -> None:
    text = (
        "dtmc module m x:[1..3]; [] x<3 -> 1/x:(x'=x+1) + 1-1/x:(x'=1); [] x=3 -> true; endmodule"
    )
    assert explore_in_whole_numbers(exact(text), symcheck.Options()) is None


def test_weights_beyond_the_whole_doubles_are_left_to_the_interpreter() -> None:
    text = (
        "dtmc module m x:[0..1]; [] x=0 -> 1e-17:(x'=1) + 1-1e-17:true; [] x=1 -> true; endmodule"
    )
    assert explore_in_whole_numbers(exact(text), symcheck.Options()) is None


def test_rates_beyond_the_doubles_are_left_to_the_interpreter() -> None:
    text = (
        "ctmc module m x:[0..2]; [a] x=0 -> 1e305:(x'=1) + 1e-7:(x'=2); [] x>0 -> 1:true; endmodule"
    )
    assert explore_in_whole_numbers(exact(text), symcheck.Options()) is None
    found = symcheck.loads(text, exact=True).check("P=? [ F x=2 ]").value
    assert found == 1 / (1 + Fraction(10) ** 312)


def exact(text: str) -> symcheck.BoundModel:
    return symcheck.bind(symcheck.parse_model(text), exact=True)


def assert_same(text: str, *, expected: bool = False) -> None:
    try:
        interpreted = explore_exactly(exact(text))
    except SymcheckError:
        return
    found = explore_in_whole_numbers(exact(text), symcheck.Options())
    assert found is not None or not expected
    if found is None:
        return
    assert list(found.states) == list(interpreted.states)
    for name in ("indptr", "indices", "data"):
        whole, rational = getattr(found.matrix, name), getattr(interpreted.matrix, name)
        assert whole.tolist() == rational.tolist()
    assert found.choice_actions.tolist() == interpreted.choice_actions.tolist()
    assert found.initial.tolist() == interpreted.initial.tolist()
    assert found.deadlocks.tolist() == interpreted.deadlocks.tolist()
    for name in ("state_rewards", "choice_rewards"):
        pairs = zip(getattr(found, name), getattr(interpreted, name), strict=True)
        assert all(a.tolist() == b.tolist() for a, b in pairs)
