"""Symmetries: which components may be exchanged, and the same values on one state of each orbit."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import symcheck
from generate import random_copies
from symcheck.api.arguments import properties_file
from symcheck.api.model import Model
from symcheck.check.property_instance import observations_up_to_symmetry
from symcheck.errors import ModelFault
from symcheck.explicit.build import explore
from symcheck.options import Options
from symcheck.semantics.reduction.symmetry import Symmetry, find_symmetries

COIN = """mdp
global counter : [0..12] init 6;
module a
  pc1 : [0..3]; coin1 : [0..1];
  [] pc1=0 -> 0.5:(coin1'=0)&(pc1'=1) + 0.5:(coin1'=1)&(pc1'=1);
  [] pc1=1 & coin1=0 & counter>0 -> (counter'=counter-1)&(pc1'=2);
  [] pc1=1 & coin1=1 & counter<12 -> (counter'=counter+1)&(pc1'=2);
  [] pc1=2 & (counter<=3 | counter>=9) -> (pc1'=3)&(coin1'=(counter<=3 ? 0 : 1));
  [] pc1=2 & counter>3 & counter<9 -> (pc1'=0)&(coin1'=0);
  [done] pc1=3 -> true;
endmodule
module b = a [ pc1=pc2, coin1=coin2 ] endmodule
module c = a [ pc1=pc3, coin1=coin3 ] endmodule
label "done" = pc1=3 & pc2=3 & pc3=3;
label "agree" = coin1=coin2 & coin2=coin3;
rewards "steps" true : 1; endrewards
rewards "first" pc1=1 : 1; endrewards
"""

BUS = """mdp
module bus
  b : [0..1];
  [send1] b=0 -> (b'=1); [send2] b=0 -> (b'=1); [send3] b=0 -> (b'=1);
  [end1] b=1 -> (b'=0);  [end2] b=1 -> (b'=0);  [end3] b=1 -> (b'=0);
endmodule
module one
  x1 : [0..2];
  [send1] x1=0 -> 0.9:(x1'=1) + 0.1:(x1'=0);
  [end1] x1=1 -> (x1'=2);
  [end1] x1=0 -> true;
endmodule
module two = one [ x1=x2, send1=send2, end1=end2 ] endmodule
module three = one [ x1=x3, send1=send3, end1=end3 ] endmodule
rewards "sent" [end1] true : 1; [end2] true : 1; [end3] true : 1; endrewards
rewards "one" [end1] true : 1; endrewards
"""


def found(text: str, *properties: str) -> list[Symmetry]:
    model = symcheck.loads(text)
    instances = model.instances(properties_file("; ".join(properties)), {})
    observed = observations_up_to_symmetry(model.bound, instances)
    return [] if observed is None else list(find_symmetries(model.bound, observed))


def groups(text: str, *properties: str) -> list[tuple[bool, tuple[str, ...]]]:
    return [(s.is_ring, s.names) for s in found(text, *properties)]


def test_modules_that_read_a_shared_variable_in_the_same_way_may_be_exchanged() -> None:
    assert groups(COIN, 'Pmin=? [ F "done" ]') == [(False, ("a", "b", "c"))]


def test_conditions_are_compared_by_their_values_where_their_texts_differ() -> None:
    assert groups(COIN, 'Pmax=? [ F "done" & !"agree" ]')
    assert groups(COIN, 'Pmax=? [ F "agree" & "done" ]')


@pytest.mark.parametrize(
    "asked",
    [
        "Pmax=? [ F pc1=3 ]",
        'Pmax=? [ F "done" ]; Pmax=? [ F pc1=3 ]',
        'R{"first"}max=? [ F "done" ]',
    ],
)
def test_a_component_that_a_property_names_stays_itself(asked: str) -> None:
    assert groups(COIN, asked) == [(False, ("b", "c"))]


@pytest.mark.parametrize("asked", ['filter(count, P>=0.5 [ F "done" ])', 'E [ F "done" ]'])
def test_a_property_that_counts_or_lists_states_sees_no_symmetry(asked: str) -> None:
    assert groups(COIN, asked) == []


def test_actions_are_exchanged_with_the_components() -> None:
    assert groups(BUS, "Pmin=? [ F x1=2&x2=2&x3=2 ]") == [(False, ("one", "two", "three"))]


def test_rewards_of_actions_tell_components_apart() -> None:
    of_all, of_one = BUS.partition('rewards "one"')[0], BUS
    asked = "R=? [ C<=5 ]".replace("=", "max=", 1)
    assert groups(of_all, asked) == [(False, ("one", "two", "three"))]
    assert groups(of_one, asked) == [(False, ("two", "three"))]


def test_an_initial_condition_may_tell_components_apart() -> None:
    text = """dtmc
    module a x : [0..1]; [] true -> 0.5:(x'=0) + 0.5:(x'=1); endmodule
    module b = a [ x=y ] endmodule"""
    for condition, symmetric in {"x+y=1": True, "x=1": False, "x!=y": True, "x<=y": False}.items():
        asked = groups(f"{text} init {condition} endinit", "P=? [ F x=1 & y=1 ]")
        assert bool(asked) is symmetric, condition


def test_results_speak_of_all_initial_states() -> None:
    text = """dtmc
    module a x1 : [0..2]; [] x1>0 -> 0.5:(x1'=x1-1) + 0.5:true; [] x1=0 -> true; endmodule
    module b = a [ x1=x2 ] endmodule
    init x1+x2=%d endinit"""
    for total, asked, satisfied in (
        (2, "P>=0.2 [ X x1+x2<2 ]", "satisfied in all of 3 initial states"),
        (2, "P>=0.4 [ X x1+x2<2 ]", "satisfied in 1 of 3 initial states"),
        (2, "P<=0.4 [ X x1+x2<2 ]", "satisfied in 2 of 3 initial states"),
        (1, "P<=0.6 [ X x1+x2<1 ]", "satisfied in all of 2 initial states"),
        (2, "P=? [ X x1+x2<2 ]", "range of values over 3 initial states"),
        (1, "P=? [ X x1+x2<1 ]", "range of values over 2 initial states"),
    ):
        whole, smaller = (model.check(asked) for model in both(text % total))
        assert smaller.explanation == whole.explanation == satisfied
        assert smaller.value == whole.value


def test_a_ring_has_its_rotations() -> None:
    ring = symcheck.load("models/herman/herman7.pm").program.span.source.text
    ((is_ring, names),) = groups(ring, 'R=? [ F "stable" ]')
    assert is_ring
    assert len(names) == 7


def test_components_of_several_modules() -> None:
    text = """dtmc
    module p1 x1:[0..1]; [] true -> 0.5:(x1'=0)+0.5:(x1'=1); endmodule
    module q1 y1:[0..2]; [] x1=1 & y1<2 -> (y1'=y1+1); [] y1=2 -> true; endmodule
    module p2 = p1 [x1=x2] endmodule
    module q2 = q1 [y1=y2, x1=x2] endmodule
    """
    assert groups(text, "P=? [ F y1=2 & y2=2 ]") == [(False, ("p1+q1", "p2+q2"))]


def both(text: str) -> tuple[Model, Model]:
    return (
        symcheck.loads(text, engine="explicit"),
        symcheck.loads(text, engine="explicit", symmetry=True),
    )


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        (COIN, 'Pmin=? [ F "done" & "agree" & coin1=1 ]'),
        (COIN, 'R{"steps"}max=? [ F "done" ]'),
        (COIN, "Pmax=? [ G F pc1+pc2+pc3=4 ]"),
        (COIN, 'filter(max, Pmin=? [ F<=20 "done" ], "init")'),
        (BUS, 'R{"sent"}max=? [ C<=5 ]'),
    ],
)
def test_values_are_those_of_the_whole_model(text: str, asked: str) -> None:
    whole, smaller = both(text)
    assert smaller.check(asked).value == pytest.approx(whole.check(asked).value, rel=1e-6)


STEPS = """mdp
module a x1 : [0..3]; [] x1<3 -> 0.5:(x1'=x1+1) + 0.5:true; endmodule
module b = a [ x1=x2 ] endmodule
module c = a [ x1=x3 ] endmodule
"""


@pytest.mark.parametrize(
    ("asked", "verdict"),
    [
        ("Pmax>=0.5 [ F<=1 x1+x2+x3=1 ]", True),
        ("Pmax>0.5 [ F<=1 x1+x2+x3=1 ]", False),
        ("Pmax>=0.5 [ F<=1 x1=1 ]", True),
    ],
)
def test_rational_arithmetic_decides_on_representatives_too(asked: str, verdict: bool) -> None:
    assert symcheck.loads(STEPS, engine="explicit", symmetry=True).check(asked).value is verdict


def test_each_value_of_a_constant_has_its_own_labels() -> None:
    file = properties_file(
        'const int k; label "t" = (k=0 ? x3=3 : x1=3&x2=3&x3=3); P=? [ F<=6 "t" ];'
    )
    model = symcheck.loads(STEPS.replace("mdp", "dtmc"), engine="explicit", symmetry=True)
    instances = model.instances(file, {"k": (0, 1)})
    smaller = model.reduced_for(instances)
    for instance in instances:
        whole = model.with_options(symmetry=False).check_instance(instance).value
        assert smaller.check_instance(instance).value == pytest.approx(whole, rel=1e-6)


@pytest.mark.parametrize(("high", "represented"), [(2**31 - 2, 729), (2**32 - 1, 729)])
def test_components_of_nearly_a_word(high: int, represented: int) -> None:
    text = f"""dtmc
    module a x1 : [0..{high}]; y1 : [0..{2**32 - 1}];
      [] x1<2 -> 0.5:(x1'=x1+1) + 0.5:true;
      [] y1<2 -> 0.5:(y1'=y1+1) + 0.5:true;
      [] x1=2 & y1=2 -> true;
    endmodule
    module b = a [ x1=x2, y1=y2 ] endmodule
    module c = a [ x1=x3, y1=y3 ] endmodule"""
    asked = "P=? [ F x1=2&x2=2&x3=2 ]"
    model = symcheck.loads(text)
    smaller = explore(model.bound, Options(), symmetries=tuple(found(text, asked)))
    counts = smaller.represented
    assert (counts.states if counts else len(smaller.states)) == represented
    assert (counts is not None) == (high < 2**31)


def test_sums_of_doubles_keep_their_order() -> None:
    def asked(weight: str) -> list[Symmetry]:
        return found(STEPS, f"Pmax=? [ F {weight}*x1+{weight}*x2+{weight}*x3>=3*{weight} ]")

    assert asked("2")
    assert not asked("0.1") or groups(STEPS, "Pmax=? [ F 0.1*x1+0.1*x2>=0.2 ]")


def orbits(text: str, asked: str) -> tuple[int, int, int]:
    """States of the whole model, representatives, and the states that they represent."""
    model = symcheck.loads(text)
    whole = explore(model.bound, Options())
    smaller = explore(model.bound, Options(), symmetries=tuple(found(text, asked)))
    counts = smaller.represented
    assert counts is not None
    assert counts.initial == len(whole.initial)
    assert counts.deadlocks == len(whole.deadlocks)
    assert (counts.choices, counts.transitions) == (whole.matrix.rows, whole.matrix.entries)
    return len(whole.states), len(smaller.states), counts.states


def test_representatives_stand_for_all_states() -> None:
    states, representatives, represented = orbits(COIN, 'Pmin=? [ F "done" ]')
    assert represented == states > 4 * representatives


def test_necklaces_stand_for_the_states_of_a_ring() -> None:
    ring = symcheck.load("models/herman/herman7.pm").program.span.source.text
    assert orbits(ring, 'R=? [ F "stable" ]') == (128, 20, 128)


def ring(size: int, variables: str, command: str, right: bool) -> str:
    """Modules in a ring, in which `&` stands for the number of a module and `<` for that of its
    neighbour to the left or to the right.
    """
    modules = []
    for i in range(size):
        neighbour = (i + 1 if right else i - 1) % size
        body = f"{variables} [step] {command}".replace("&", str(i)).replace("<", str(neighbour))
        modules.append(f"module m{i} {body} endmodule")
    return "dtmc " + " ".join(modules) + " init true endinit"


@pytest.mark.parametrize("right", [False, True])
@pytest.mark.parametrize(
    ("size", "variables", "command"),
    [
        pytest.param(9, "x&:[0..1];", "true -> 0.5:(x&'=x<) + 0.5:(x&'=1-x<);", id="all differ"),
        pytest.param(5, "x&:[0..2];", "true -> 0.5:(x&'=x<) + 0.5:true;", id="some are equal"),
        pytest.param(
            4, "x&:[0..1]; y&:[0..1];", "true -> 0.5:(x&'=y<) + 0.5:(y&'=1-x<);", id="two variables"
        ),
        pytest.param(3, "x&:[0..4095];", "true -> 0.9:(x&'=x<) + 0.1:(x&'=0);", id="a long word"),
    ],
)
def test_rotations_of_rings_of_several_layouts(
    size: int, variables: str, command: str, right: bool
) -> None:
    text = ring(size, variables, command, right)
    if "4095" in text:  # 36 bits, of which few are used
        text = text.replace("init true", "init " + "&".join(f"x{i}<=3" for i in range(size)))
    asked = "P=? [ F " + "&".join(f"x{i}=0" for i in range(size)) + " ]"
    (symmetry,) = found(text, asked)
    assert symmetry.is_ring
    states, representatives, represented = orbits(text, asked)
    assert represented == states
    assert representatives < 2 * states / size


@pytest.mark.parametrize(("size", "rings"), [(20, 1), (21, 1), (63, 1), (64, 0)])
def test_a_ring_may_have_more_components_than_may_be_exchanged(size: int, rings: int) -> None:
    """At first, one bit is set."""
    text = ring(size, "x&:[0..1];", "true -> 0.5:(x&'=x<) + 0.5:(x&'=x<);", right=False)
    total = "+".join(f"x{i}" for i in range(size))
    text = text.replace("init true", f"init {total}=1")
    assert not found(text, "P=? [ F x0=1 ]")
    assert [s.is_ring for s in found(text, f"P=? [ F {total}>1 ]")] == [True] * rings


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 2**32), st.sampled_from(["dtmc", "ctmc", "mdp"]))
def test_random_copies_have_the_same_values_with_and_without_symmetry(seed: int, kind: str) -> None:
    text, asked = random_copies(Random(seed), kind)
    assert [s.is_ring for s in found(text, asked)] == [False]
    whole, smaller = both(text)
    try:
        expected = whole.check(asked).value
    except ModelFault:
        with pytest.raises(ModelFault):
            smaller.check(asked)
        return
    assert smaller.check(asked).value == pytest.approx(expected, rel=1e-5, abs=1e-9)
    states, _, represented = orbits(text, asked)
    assert represented == states
