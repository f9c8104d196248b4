"""The cone of influence: which variables are outside, and the same values without them."""

from __future__ import annotations

import contextlib
import re
from dataclasses import replace
from random import Random

import numpy as np
import pytest

import symcheck
from generate import Generated, random_question, wild_model
from symcheck.api.arguments import properties_file
from symcheck.api.model import Model
from symcheck.api.stages import Smaller
from symcheck.check.property_instance import PropertyInstance, observations_up_to_symmetry
from symcheck.engines import selection, tuning
from symcheck.errors import InputError, ModelFault, SymcheckError
from symcheck.semantics.reduction import tuning as reduction_tuning
from symcheck.semantics.reduction.cone_of_influence import outside_cone, restricted_to_cone

TIMED = """mdp
module walker
  x : [0..3];
  [tick] x<3 -> 0.5:(x'=x+1) + 0.5:true;
  [jump] x=1 -> 0.25:(x'=3) + 0.75:(x'=0);
  [tick] x=3 -> true;
endmodule
module timer
  t : [0..9];
  [tick] t<9 -> (t'=t+1);
  [tick] t=9 -> true;
endmodule
rewards "ticks" [tick] x<3 : 1; endrewards
rewards "late" t>5 : 1; endrewards
"""
WITHOUT_LATE = TIMED[: TIMED.index('rewards "late"')]


def instances_of(asked: str) -> list[PropertyInstance]:
    file = properties_file(asked)
    return [PropertyInstance(file, i, {}) for i in range(len(file.properties))]


def outside(text: str, asked: str) -> list[str]:
    bound = symcheck.loads(text).bound
    observed = observations_up_to_symmetry(bound, instances_of(asked))
    assert observed is not None
    return [bound.variables[i].name for i in sorted(outside_cone(bound, observed))]


def restricted(model: Model, instance: PropertyInstance) -> Model | None:
    observed = observations_up_to_symmetry(model.bound, [instance])
    names = frozenset() if observed is None else outside_cone(model.bound, observed)
    if not names:
        return None
    smaller = restricted_to_cone(model.bound, names)
    return replace(model, smaller=Smaller(smaller))


def test_a_timer_that_only_counts_is_outside() -> None:
    assert outside(WITHOUT_LATE, "Pmin=? [ F x=3 ]; Rmax=? [ F x=3 ]") == ["t"]


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        (WITHOUT_LATE, "Pmin=? [ F x=3 & t<9 ]"),
        (TIMED, 'R{"late"}max=? [ F x=3 ]'),
        (WITHOUT_LATE, 'Pmin=? [ F x=3 & !"init" ]'),
        (WITHOUT_LATE.replace("[tick] t=9 -> true;", ""), "Pmin=? [ F x=3 ]"),
        (WITHOUT_LATE.replace("t<9 -> (t'", "t<9 -> 0.5:(t'"), "Pmin=? [ F x=3 ]"),
        (WITHOUT_LATE.replace("t<9 -> (t'", "t<9 -> 1/(t+1):(t'"), "Pmin=? [ F x=3 ]"),
        (WITHOUT_LATE.replace("x=1 ->", "x=1 & t<4 ->"), "Pmin=? [ F x=3 ]"),
        (WITHOUT_LATE.replace("(x'=x+1)", "(x'=t=0?x+1:3)"), "Pmin=? [ F x=3 ]"),
        (WITHOUT_LATE.replace("mdp", "dtmc").replace("t=9", "t>3"), "P=? [ F x=3 ]"),
        (
            WITHOUT_LATE.replace("mdp", "ctmc").replace("t=9 -> true", "t=9 -> 2:true"),
            "P=? [ F x=3 ]",
        ),
        (WITHOUT_LATE + "init x=0 & t=0 endinit", "Pmin=? [ F x=3 ]"),
    ],
    ids=[
        "asked for",
        "earns a reward",
        "tells the initial state",
        "blocks an action",
        "has no certain step",
        "has a probability",
        "guards a step",
        "is assigned",
        "is counted twice in a chain",
        "has another rate",
        "is a condition on initial states",
    ],
)
def test_a_variable_that_matters_is_inside(text: str, asked: str) -> None:
    assert outside(text, asked) == []


def test_several_commands_may_be_enabled_in_an_mdp() -> None:
    assert outside(WITHOUT_LATE.replace("t=9", "t>3"), "Pmin=? [ F x=3 ]") == ["t"]


def test_a_variable_may_matter_through_others() -> None:
    chain = """dtmc
    module m a:[0..2]; b:[0..2]; c:[0..2]; d:[0..2];
      [] true -> 0.5:(a'=b)&(b'=c)&(d'=a) + 0.5:(c'=mod(c+1,3));
    endmodule"""
    assert outside(chain, "P=? [ F a=2 ]") == ["d"]
    assert outside(chain, "P=? [ F d=2 ]") == []


def test_what_takes_too_long_to_decide_is_inside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reduction_tuning, "MAX_CONE_VALUATIONS", 9)
    assert outside(WITHOUT_LATE, "Pmin=? [ F x=3 ]") == []
    monkeypatch.undo()
    monkeypatch.setattr(reduction_tuning, "MAX_CONE_PARTICIPANTS", 2)
    assert outside(WITHOUT_LATE, "Pmin=? [ F x=3 ]") == []


def test_a_step_without_effect_is_kept() -> None:
    """It is counted, and a strategy may choose it for ever."""
    text = "mdp module m x:[0..1]; t:[0..1]; [a] true -> (t'=1-t); [b] true -> (x'=1); endmodule "
    rewards = 'rewards "a" [a] true : 1; endrewards'
    for asked, value in (("Pmin=? [ F x=1 ]", 0), ('R{"a"}max=? [ C<=4 ]', 4)):
        (instance,) = instances_of(asked)
        smaller = restricted(symcheck.loads(text + rewards), instance)
        assert smaller is not None
        assert smaller.engine.states < 4
        assert smaller.check_instance(instance).value == value


def with_observers(rng: Random, model: Generated) -> str:
    """The model beside a module that takes part in some of its actions."""
    high = rng.randint(1, 3)
    lines = [f"t : [0..{high}]; u : bool;"]
    for action in sorted(set(re.findall(r"\[(\w+)\]", model.text))):
        pick = rng.random()
        if pick < 0.4:
            lines += [f"[{action}] t<{high} -> (t'=t+1);", f"[{action}] t={high} -> (u'=!u);"]
        elif pick < 0.6:
            lines.append(f"[{action}] true -> 0.5:(t'=0) + 0.5:(u'=true);")
        elif pick < 0.8:
            lines += [f"[{action}] t>0 -> (t'=t-1);", f"[{action}] t<2 -> (u'=!u);"]
    lines.append(rng.choice(("", "[] u -> (t'=0);", "[] true -> (t'=0);")))
    return f"{model.text}\nmodule observer {' '.join(lines)} endmodule\n"


def outcome(model: Model, instance: PropertyInstance) -> object:
    """The value of a property (an array of several), or the kind of its error."""
    try:
        value = model.check_instance(instance).value
    except SymcheckError as error:
        return type(error)
    return value if isinstance(value, bool) else np.asarray(value, float)


def close_to(expected: object) -> object:
    """What the value of a property on the restricted model has to equal."""
    if isinstance(expected, np.ndarray):
        return pytest.approx(expected, rel=1e-6, nan_ok=True)
    return expected


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_values_are_those_of_the_whole_model(kind: str) -> None:
    compared = smaller_models = 0
    for seed in range(60):
        rng = Random(f"cone{seed}")
        generated = wild_model(rng, kind)
        with contextlib.suppress(InputError):
            model = symcheck.loads(with_observers(rng, generated), engine="explicit")
            (instance,) = instances_of(random_question(rng, generated))
            instance.bind(model.bound)
            smaller = restricted(model, instance)
            if smaller is None:
                continue
            assert outcome(smaller, instance) == close_to(outcome(model, instance)), f"cone{seed}"
            compared += 1
            smaller_models += smaller.engine.states < model.engine.states
    assert compared >= 20
    assert smaller_models >= 5


@pytest.fixture
def every_model_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("SMALL_MODEL_STATES", "SPARSE_MODEL_STATES"):
        monkeypatch.setattr(tuning, name, 20)
    monkeypatch.setattr(tuning, "FIRST_EXPLORATION_TRANSITIONS", 20)
    monkeypatch.setattr(tuning, "MAX_NODES_PER_STATE", 100)


@pytest.mark.usefixtures("every_model_is_large")
def test_the_default_engine_counts_all_states_and_checks_few() -> None:
    text = WITHOUT_LATE.replace("..9]", "..99]").replace("<9", "<99").replace("=9", "=99")
    asked, choices = "Rmax=? [ F x=3 ]", []
    model = symcheck.loads(text, symmetry=True).with_observer(choices.append)
    whole = symcheck.loads(text, engine="explicit")
    engine = model.reduced_for(instances_of(asked)).engine
    (choice,) = (c for c in choices if isinstance(c, selection.EngineChoice))
    assert choice.reason.startswith("the properties do not depend on t; ")
    assert engine.states == 4
    counts = engine.represented
    assert (counts.states, counts.choices, counts.transitions, counts.initial) == (
        whole.engine.states,
        whole.engine.choices,
        whole.engine.transitions,
        1,
    )
    assert counts.outside_cone == ("t",)
    assert model.check(asked).value == pytest.approx(whole.check(asked).value)


@pytest.mark.usefixtures("every_model_is_large")
@pytest.mark.parametrize("asked", ["Pmax>=0.25 [ X x=3 ]", "Pmax>0.25 [ X x=3 ]"])
def test_rational_arithmetic_decides_without_them_too(asked: str) -> None:
    text = WITHOUT_LATE.replace("x : [0..3]", "x : [0..3] init 1").replace("9", "99")
    model = symcheck.loads(text, symmetry=True)
    assert model.reduced_for(instances_of(asked)).engine.states == 4
    assert model.check(asked).value is (">=" in asked)


@pytest.mark.usefixtures("every_model_is_large")
def test_a_fault_outside_the_cone_is_found() -> None:
    text = TIMED.replace("[tick] t=9 -> true;", "[tick] t=9 -> (t'=t+1);")
    text = text[: text.index('rewards "late"')].replace("9", "99")
    with pytest.raises(ModelFault, match="t'=t\\+1"):
        symcheck.loads(text, symmetry=True).check("Pmin=? [ F x=3 ]")
