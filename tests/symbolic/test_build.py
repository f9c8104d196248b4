"""Symbolic models against the scalar semantics, state by state."""

from __future__ import annotations

import pytest

from symbolic.oracle import assert_same, at, bound, states_of, symbolic
from symcheck.errors import ModelFault, UnsupportedError
from symcheck.options import Options
from symcheck.symbolic.build import build, construct
from symcheck.symbolic.matrix.transitions import transitions
from symcheck.symbolic.model import EncodedEvent, Iteration, StateSpace, Transitions
from symcheck.symbolic.reachability.search import SCHEDULES, reach, search

DIE = """dtmc
module die
  s : [0..7] init 0;
  d : [0..6] init 0;
  [] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=2);
  [] s=1 -> 0.5 : (s'=3) + 0.5 : (s'=4);
  [] s=2 -> 0.5 : (s'=5) + 0.5 : (s'=6);
  [] s=3 -> 0.5 : (s'=1) + 0.5 : (s'=7) & (d'=1);
  [] s=4 -> 0.5 : (s'=7) & (d'=2) + 0.5 : (s'=7) & (d'=3);
  [] s=5 -> 0.5 : (s'=7) & (d'=4) + 0.5 : (s'=7) & (d'=5);
  [] s=6 -> 0.5 : (s'=2) + 0.5 : (s'=7) & (d'=6);
  [] s=7 -> (s'=7);
endmodule
rewards "flips" [] s<7 : 1; endrewards
rewards s=7 : d; endrewards
"""

OVERLAPS = """dtmc
module a
  x : [-2..3] init 0;
  [go] x<3 -> 0.5 : (x'=x+1) + 0.5 : true;
  [go] x=0 -> (x'=-2);
  [] x>=0 -> (x'=max(x-1,-1));
endmodule
module b
  y : [0..2] init 1; done : bool;
  [go] y<2 -> 1/3 : (y'=y+1) + 2/3 : (done'=!done);
  [go] y=1 -> (y'=0);
endmodule
rewards "r" [go] true : x+2; [] y>0 : 0.25; done : 3; endrewards
"""

QUEUE = """ctmc
const double lambda = 1.5;
module arrivals
  n : [0..4];
  [] n<4 -> lambda : (n'=n+1);
  [serve] n>0 -> n : (n'=n-1);
  [serve] n>2 -> 0.5 : (n'=n-2);
endmodule
module server
  up : bool init true;
  [serve] up -> 2 : true + 0.5 : (up'=false);
  [] !up -> 0.1*(n+1) : (up'=true);
endmodule
rewards true : n; [serve] up : 1; endrewards
"""

COIN = """mdp
global c : [0..4] init 2;
module p
  s : [0..2];
  [flip] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=2);
  [] s>0 & c<4 -> (c'=c+1) & (s'=0);
  [] s=2 & c>0 -> (c'=c-1) & (s'=0);
  [end] c=0 | c=4 -> true;
endmodule
module q = p [ s=t ] endmodule
module r
  b : bool;
  [flip] !b -> (b'=true);
  [flip] true -> 0.25 : (b'=!b) + 0.75 : true;
endmodule
rewards "r" [flip] b : 2; [] true : 0.5; c=4 : 1; endrewards
"""

DEADLOCK = """dtmc
module m
  x : [0..3]; y : [0..3];
  [] x<3 & y=0 -> 0.5 : (x'=x+1) + 0.5 : (y'=x);
endmodule
init x<=1 & y=0 endinit
"""

MODELS = {"die": DIE, "overlaps": OVERLAPS, "queue": QUEUE, "coin": COIN, "deadlock": DEADLOCK}


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("schedule", SCHEDULES)
def test_models_do_what_the_semantics_says(name, schedule):
    model = bound(MODELS[name])
    assert_same(model, symbolic(model, schedule))


@pytest.mark.parametrize("name", MODELS)
def test_any_order_of_the_variables_gives_the_same_model(name):
    model = bound(MODELS[name])
    order = [v.name for v in reversed(model.variables)]
    made = symbolic(model, order=order)
    assert_same(model, made)
    assert not made.space.symbolic.encoding.in_declaration_order


def test_images_are_steps():
    made = symbolic(bound(DIE))
    space, model = made.space, made.space.symbolic
    one = model.translator.state({"s": 0, "d": 0})
    assert list(space.valuations(model.successors(one))) == [(1, 0), (2, 0)]
    seven = space.where(bound(DIE).rewards[1].items[0].guard)
    assert list(space.valuations(model.predecessors(seven) - seven)) == [
        (3, 0),
        (4, 0),
        (5, 0),
        (6, 0),
    ]


def test_breadth_first_search_tells_each_step():
    model = build(bound(DIE), Options())
    found = list(search(model, "frontier"))
    assert [f.iteration.frontier for f in found] == [1, 2, 4, 6, 0]
    assert [f.iteration.states for f in found] == [1, 3, 7, 13, 13]
    assert found[-1].states == reach(model).states


def test_construct_shows_every_stage():
    seen: list[object] = []
    made = construct(bound(DIE), Options(), seen.append)
    assert {type(x) for x in seen} == {EncodedEvent, Iteration, StateSpace, Transitions}
    assert seen[-1] is made
    assert "13 states" in repr(made.space)
    assert "20 transitions" in repr(made)
    assert "die" not in repr(made)
    assert made.space.symbolic._repr_html_().count("<tr>") == 9


def test_unknown_schedules_are_refused():
    with pytest.raises(ValueError, match="frontier"):
        list(search(build(bound(DIE), Options()), "backwards"))


def test_unbounded_integers_are_refused_with_what_works():
    with pytest.raises(UnsupportedError, match="explicit"):
        build(bound("dtmc module m x : int init 0; [] x<3 -> (x'=x+1); endmodule"), Options())


def test_deadlock_states_get_a_loop():
    made = symbolic(bound("ctmc module m x : [0..1]; [] x=0 -> 2 : (x'=1); endmodule"))
    assert list(made.space.valuations(made.fixed)) == [(1,)]
    assert at(made.space, made.matrix, (1,), (1,)) == 1.0


def test_an_mdp_where_nothing_happens_has_one_choice():
    model = bound("mdp module m x : [0..1]; [] x=1 -> true; endmodule")
    made = symbolic(model)
    assert_same(model, made)
    assert (made.choice_count, made.transition_count) == (1, 1)


FAULTS = {
    "update-sum": (
        "dtmc module m x : [0..3]; [] x<3 -> 0.5 : (x'=x+1) + 0.4 : true; endmodule",
        "0.9",
    ),
    "update-negative": (
        "dtmc module m x : [0..3]; [] x<3 -> (x-1)/2 : (x'=x+1) + (3-x)/2 : (x'=x+1); endmodule",
        "-0.5",
    ),
    "update-range": (
        "dtmc module m x : [0..3]; y : bool; [] true -> (x'=x+1) & (y'=true); endmodule",
        "4",
    ),
    "update-not-finite": (
        "ctmc module m x : [0..3]; [] x<3 -> 1/(1-x) : (x'=x+1); endmodule",
        "x=1",
    ),
    "no-initial-state": (
        "dtmc module m x : [0..3]; [] true -> true; endmodule init x>3 endinit",
        "endinit",
    ),
}


@pytest.mark.parametrize("code", FAULTS)
def test_faults_are_reported_with_a_state(code):
    text, part = FAULTS[code]
    with pytest.raises(ModelFault) as caught:
        symbolic(bound(text))
    assert [d.code for d in caught.value.diagnostics] == [code]
    assert part in str(caught.value)


def test_a_fault_that_no_reachable_state_meets_is_none():
    model = bound("dtmc module m x : [0..3]; [] x<3 -> (x'=0); [] x=3 -> 0.5 : (x'=x+1); endmodule")
    assert_same(model, symbolic(model))


def test_sums_need_not_be_checked():
    text, _ = FAULTS["update-sum"]
    space = reach(build(bound(text), Options()))
    made = transitions(space, Options(check_sums=False))
    assert at(space, made.matrix, (0,), (1,)) == 0.5


def test_deadlocks_are_errors_where_they_are_not_fixed():
    space = reach(build(bound(DEADLOCK), Options()))
    with pytest.raises(ModelFault, match=r"deadlock.*x=1,y=1"):
        transitions(space, Options(fix_deadlocks=False))


def test_infinite_rewards_are_reported_when_they_are_asked_for():
    made = symbolic(
        bound(
            "dtmc module m x : [0..3]; [] x<3 -> (x'=x+1); endmodule rewards true : 1/(2-x); endrewards"
        )
    )
    with pytest.raises(ModelFault, match="x=2"):
        _ = made.state_rewards[0]


def test_many_initial_states():
    made = symbolic(bound(DEADLOCK))
    assert list(made.space.valuations(made.space.initial)) == [(0, 0), (1, 0)]
    assert states_of(made.space)[0] == (0, 0)
