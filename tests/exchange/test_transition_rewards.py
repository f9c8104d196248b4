"""Rewards of single transitions of a chain, in rationals: those of its commands, weighted."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from random import Random

import pytest

import symcheck
from generate import random_model
from symcheck.errors import SymcheckError
from symcheck.exchange import transition_rewards
from symcheck.exchange.explicit_export import explicit_export
from symcheck.semantics.interpreter import choices

MEETING = """dtmc
module a x:[0..2]; [t] x<2 -> 1/3:(x'=x+1) + 2/3:true; [] x=0 -> 0.1:(x'=2) + 0.9:(x'=1); endmodule
module b y:[0..3]; [t] y<3 -> 1/7:(y'=y+1) + 6/7:(y'=3); [] y=3 -> true; endmodule
rewards "one" [t] y>0 : 1/3; [] true : 2; [t] x=0 : y; endrewards
rewards "two" x=1 : 5; [] y=3 : 1/7; endrewards"""


def by_hand(engine: symcheck.Engine) -> Iterator[tuple[int, dict[int, list[Fraction]]]]:
    """The mean reward of each transition of each state, from the definition."""
    number = {state: i for i, state in enumerate(engine.valuations(engine.all))}
    for state, source in number.items():
        total: dict[int, Fraction] = {}
        earned: dict[int, list[Fraction]] = {}
        for choice in choices(engine.model, state, check_sums=False):
            for weight, after in choice.branches:
                target = number[after]
                total[target] = total.get(target, Fraction(0)) + Fraction(weight)
                before = earned.get(target, [Fraction(0)] * len(choice.rewards))
                pairs = zip(before, choice.rewards, strict=True)
                earned[target] = [b + Fraction(weight) * Fraction(r) for b, r in pairs]
        yield source, {t: [e / total[t] for e in earned[t]] for t in total}


def explored(text: str) -> symcheck.Engine:
    return symcheck.loads(text, exact=True).engine


def assert_right(engine: symcheck.Engine) -> None:
    export = explicit_export(engine)
    rewards = [export.entry_rewards(i) for i in range(len(engine.model.rewards))]
    for state, expected in by_hand(engine):
        for entry in range(export.matrix.indptr[state], export.matrix.indptr[state + 1]):
            target = int(export.matrix.indices[entry])
            if target in expected:  # else it is the loop of a deadlock
                found = [r[entry] for r in rewards]
                assert found == expected[target]


@pytest.mark.parametrize("kind", ["dtmc", "ctmc"])
@pytest.mark.parametrize("seed", range(15))
def test_random_chains(kind: str, seed: int) -> None:
    try:
        engine = explored(random_model(Random(seed), kind).text)
    except SymcheckError:  # some random models are faulty
        return
    assert_right(engine)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc"])
@pytest.mark.parametrize("loops", ["[] y=3 -> true;", ""])
def test_several_commands_with_rewards_of_their_own_lead_to_one_state(
    kind: str, loops: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Commands with constant weights are compiled; the interpreter is left out."""
    monkeypatch.delattr(transition_rewards, "_interpreted")
    assert_right(explored(MEETING.replace("dtmc", kind).replace("[] y=3 -> true;", loops)))


def test_weights_that_are_computed() -> None:
    assert_right(explored(MEETING.replace("0.1:", "1/(y+2):").replace("0.9:", "1-1/(y+2):")))


def test_a_reward_without_a_value_that_no_step_earns() -> None:
    """The guard holds in a deadlock, and the interpreter finds that it earns nothing there."""
    text = """dtmc module m x:[0..2]; [a] x<2 -> 1/3:(x'=2) + 2/3:(x'=1); endmodule
    rewards [a] true : 1/(2-x); endrewards"""
    assert_right(explored(text))
