"""The semantics of transitions, worked out by hand."""

from __future__ import annotations

from fractions import Fraction

import pytest

from semantics.cases import explore
from symcheck.errors import ModelFault
from symcheck.semantics import state_faults
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.interpreter import Row, choices, initial_states, state_rewards, transitions
from symcheck.semantics.model import BoundModel
from symcheck.syntax.parse import parse_model

F = Fraction


def model(text: str) -> BoundModel:
    return bind(parse_model(text), exact=True)


def branches(row: Row) -> dict[object, object]:
    return {state: p for p, state in row.branches}


BODY = """module m s : [0..3]; [] s=0 -> 0.5:(s'=1) + 0.5:(s'=2); [] s=0 -> 0.25:(s'=1) + 0.75:(s'=3); [] s=1 -> true; endmodule
rewards [] s=0 : 2; [] true : 1; s<2 : 5; endrewards"""


def test_dtmc_chooses_evenly() -> None:
    bound = model("dtmc " + BODY)
    (row,) = transitions(bound, (0,))
    assert branches(row) == {(1,): F(3, 8), (2,): F(1, 4), (3,): F(3, 8)}
    assert row.rewards == (3,)
    assert state_rewards(bound, (0,)) == (5,)
    assert state_rewards(bound, (2,)) == (0,)


def test_ctmc_races() -> None:
    (row,) = transitions(model("ctmc " + BODY), (0,))
    assert branches(row) == {(1,): F(3, 4), (2,): F(1, 2), (3,): F(3, 4)}
    assert row.rewards == (6,)


def test_mdp_keeps_choices() -> None:
    rows = transitions(model("mdp " + BODY), (0,))
    assert [branches(r) for r in rows] == [
        {(1,): F(1, 2), (2,): F(1, 2)},
        {(1,): F(1, 4), (3,): F(3, 4)},
    ]
    assert [r.rewards for r in rows] == [(3,), (3,)]


def test_deadlocks_have_no_rows() -> None:
    for kind in ("dtmc", "ctmc", "mdp"):
        bound = model(f"{kind} {BODY}")
        assert transitions(bound, (2,)) == ()
        assert [branches(r) for r in transitions(bound, (1,))] == [{(1,): 1}]


SYNCHRONISED = """module m x : [0..2]; [a] x=0 -> 2:(x'=1) + 3:(x'=2); [a] x=0 -> 5:true; [] x=0 -> 7:(x'=1); endmodule
module n y : [0..1]; [a] y=0 -> 11:(y'=1-x); endmodule
module o z : bool; [b] !z -> 1:(z'=true); endmodule
rewards "r" [a] x=0 : 1; [b] true : 10; [] true : 100; endrewards"""


def test_rates_multiply() -> None:
    (row,) = transitions(model("ctmc " + SYNCHRONISED), (0, 0, False))
    assert branches(row) == {
        (1, 1, False): 22,
        (2, 1, False): 33,
        (0, 1, False): 55,
        (1, 0, False): 7,
        (0, 0, True): 1,
    }
    assert row.rewards == (110 + 10 + 700,)
    assert row.action is None


def test_choices_of_an_mdp_with_actions() -> None:
    text = "mdp " + SYNCHRONISED.replace("2:(x'=1) + 3:", "0.4:(x'=1) + 0.6:").replace(
        "5:", ""
    ).replace("7:", "").replace("11:", "")
    bound = model(text)
    found = choices(bound, (0, 0, False))
    assert [(c.action, len(c.commands), len(c.branches), c.rewards) for c in found] == [
        (None, 1, 1, (100,)),
        ("a", 2, 2, (1,)),
        ("a", 2, 1, (1,)),
        ("b", 1, 1, (10,)),
    ]
    assert [r.action for r in transitions(bound, (0, 0, False))] == [None, "a", "a", "b"]
    assert [r.action for r in transitions(bound, (2, 0, True))] == []


def test_updates_read_the_old_state() -> None:
    bound = model(
        "dtmc module m x : [0..3] init 1; y : [0..3] init 2; [] true -> (x'=y) & (y'=x); endmodule"
    )
    (row,) = transitions(bound, (1, 2))
    assert branches(row) == {(2, 1): 1}


def test_branches_to_one_state_are_added() -> None:
    bound = model(
        "dtmc module m x : [0..1]; [] true -> 1/3:(x'=0) + 1/6:(x'=x) + 1/2:(x'=1); endmodule"
    )
    assert branches(transitions(bound, (0,))[0]) == {(0,): F(1, 2), (1,): F(1, 2)}


def test_what_has_probability_zero_does_not_happen() -> None:
    bound = model("dtmc module m x : [0..1]; [] true -> x:(x'=2) + 1-x:(x'=1); endmodule")
    assert branches(transitions(bound, (0,))[0]) == {(1,): 1}
    with pytest.raises(ModelFault, match="x would become 2"):
        transitions(bound, (1,))


def test_a_rate_of_zero_is_no_transition() -> None:
    assert (
        transitions(model("ctmc module m x : [0..1]; [] true -> x:(x'=0); endmodule"), (0,)) == ()
    )


def test_sums_can_be_left_unchecked() -> None:
    bound = model("dtmc module m x : [0..1]; [] true -> 0.5:(x'=1) + 0.4:(x'=0); endmodule")
    assert branches(transitions(bound, (0,), check_sums=False)[0]) == {(1,): F(1, 2), (0,): F(2, 5)}
    with pytest.raises(ModelFault, match="probabilities sum to 9/10"):
        transitions(bound, (0,))


def test_sums_in_floating_point_have_tolerance() -> None:
    text = "dtmc module m x : [0..1]; [] true -> 0.333333:(x'=1) + 0.666666:(x'=0); endmodule"
    assert len(transitions(bind(parse_model(text)), (0,))) == 1
    with pytest.raises(ModelFault):
        transitions(model(text), (0,))
    assert state_faults.sums_to_one(1 + 0.9e-5)
    assert not state_faults.sums_to_one(1 + 1.1e-5)
    assert not state_faults.sums_to_one(float("nan"))


def test_initial_states() -> None:
    assert initial_states(
        model("dtmc module m x : [0..2] init 1; b : bool init true; endmodule")
    ) == ((1, True),)
    several = model("dtmc module m x : [0..2]; b : bool; endmodule init x>0 & (b | x=2) endinit")
    assert initial_states(several) == ((1, True), (2, False), (2, True))


def test_a_step_of_a_composition() -> None:
    bound = model(
        """mdp module m x : [0..1]; [a] x=0 -> (x'=1); endmodule module n y : [0..1]; [a] y=0 -> (y'=1); endmodule
        system m ||| n endsystem rewards [a] true : 1; endrewards"""
    )
    assert [branches(r) for r in transitions(bound, (0, 0))] == [{(1, 0): 1}, {(0, 1): 1}]
    hidden = model(
        """mdp module m x : [0..1]; [a] x=0 -> (x'=1); endmodule system m / {a} endsystem
        rewards [a] true : 1; [] true : 2; endrewards"""
    )
    assert [(r.action, r.rewards) for r in transitions(hidden, (0,))] == [(None, (2,))]


def test_known_numbers_of_states() -> None:
    die = """dtmc module die s : [0..7] init 0; d : [0..6] init 0;
    [] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=2); [] s=1 -> 0.5 : (s'=3) + 0.5 : (s'=4); [] s=2 -> 0.5 : (s'=5) + 0.5 : (s'=6);
    [] s=3 -> 0.5 : (s'=1) + 0.5 : (s'=7) & (d'=1); [] s=4 -> 0.5 : (s'=7) & (d'=2) + 0.5 : (s'=7) & (d'=3);
    [] s=5 -> 0.5 : (s'=7) & (d'=4) + 0.5 : (s'=7) & (d'=5); [] s=6 -> 0.5 : (s'=2) + 0.5 : (s'=7) & (d'=6);
    [] s=7 -> (s'=7); endmodule"""
    assert explore(model(die)) == 13


def test_deadlock_words() -> None:
    assert str(state_faults.deadlocks(["(s=1)"], 1)).startswith(
        "error[deadlock]: 1 state has no transition (a deadlock), for example (s=1)"
    )
    assert "5 states have" in state_faults.deadlocks(["(s=1)", "(s=2)"], 5).message
