"""The façade: one model, and the steps from text to result."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import symcheck
from symcheck.engines.selection import EngineChoice
from symcheck.errors import NameFault, UsageError
from symcheck.syntax.parse import parse_properties

DIE = Path(__file__).parents[2] / "models/die/die.pm"
WALK = """dtmc const int N; module m x : [0..N]; y : [0..3];
  [] x<N -> 0.5:(x'=x+1)&(y'=2) + 0.5:(x'=0)&(y'=1); [] x=N -> true; endmodule
  label "end" = x=N;"""
CHOICE = "mdp module m x : [0..2]; [a] x=0 -> (x'=1); [b] x=0 -> (x'=2); [] x>0 -> true; endmodule"


def test_stages_are_made_once():
    model = symcheck.loads(WALK, "N=3")
    assert model.engine is model.engine
    assert model.bound is model.engine.model
    assert repr(model) == "<Model: dtmc, modules m, N=3>"


def test_variants_keep_everything_else():
    model = symcheck.loads(WALK, "N=3", type=symcheck.parse_model(WALK).type, epsilon=1e-3)
    other = model.with_constants({"N": 2}).with_options(engine="sparse")
    assert (other.constants, other.options.engine, other.options.epsilon) == (
        {"N": 2},
        "sparse",
        1e-3,
    )
    assert (other.program, other.type) == (model.program, model.type)


def test_an_observer_is_told_of_the_chosen_engine():
    events: list[object] = []
    assert symcheck.loads(WALK, "N=3").with_observer(events.append).engine.states == 5
    assert any(isinstance(event, EngineChoice) for event in events)


def test_an_observer_sees_iterations_and_may_end_them():
    def stop(step: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        symcheck.loads(WALK, "N=3").check("P=? [ F<=9 x=N ]", observer=stop)


def test_instances_combine_each_property_with_its_own_constants():
    model = symcheck.loads(WALK, "N=3")
    file = parse_properties('const int k; const int j; P=? [ F<=k "end" ]; x=j; "n": true')
    found = model.instances(file, {"k": ("2", "3"), "j": ("0",)})
    assert [(p.index, dict(p.relevant)) for p in found] == [
        (0, {"k": "2"}),
        (0, {"k": "3"}),
        (1, {"j": "0"}),
        (2, {}),
    ]
    assert [p.title for p in found[1:]] == ['P=? [ F<=k "end" ]', "x=j", "n"]
    assert [p.constants["k"] for p in found] == ["2", "3", "2", "2"]
    assert [model.check_instance(p).value for p in found] == [0.0, 0.125, True, True]
    assert [p.index for p in model.instances(file, {"k": ("2",), "j": ("0",)}, [2, 0])] == [2, 0]


def test_properties_are_checked_on_a_reduced_model():
    model = symcheck.loads(WALK, "N=3", reduce=True)
    (instance,) = model.instances(parse_properties('P=? [ F<=4 "end" ]'), {})
    smaller = model.reduced_for([instance])
    assert smaller.smaller is not None
    assert smaller.engine.states < model.engine.states
    assert smaller is model.reduced_for([instance])
    assert smaller.check_instance(instance).value == model.check_instance(instance).value
    whole = model.with_options(reduce=False)
    assert whole.reduced_for([instance]) is whole
    fair = model.with_options(fairness=True)
    assert fair.reduced_for([instance]) is fair


def test_one_quotient_serves_several_properties():
    model = symcheck.load(DIE, bisim=True)
    asked = model.instances(parse_properties("P=? [ F d=6 ]; P=? [ F<=4 d=6 ]"), {})
    prepared = model.prepared_for(asked)
    assert str(prepared.shared).startswith("13 states -> 5, common to all 2 properties")
    assert model.prepared_for(asked[:1]).shared is None
    plain = model.with_options(bisim=False)
    assert plain.prepared_for(asked).shared is None
    for instance in asked:
        quotient = prepared.check(instance)
        assert "by bisimulation" in quotient.explanation
        assert quotient.value == pytest.approx(plain.check_instance(instance).value)


def test_the_text_with_values_of_constants_is_the_same_model():
    text = symcheck.pretty(symcheck.loads(WALK, "N=3").instantiated())
    assert symcheck.loads(text).engine.states == 5


def test_distributions_from_a_given_one():
    model = symcheck.loads(WALK, "N=3")
    end = np.array(model.engine.to_bools(model.engine.where(model.bound.labels["end"])), float)
    assert model.transient(2, end).values == pytest.approx(end)
    assert model.steady_state(end).values == pytest.approx(end)


def test_estimates_take_the_fields_of_a_plan():
    model = symcheck.loads(WALK, "N=3")
    result = model.estimate("const int k; P=? [ F<=k x=N ]", "k=3", samples=200, seed=1)
    assert result.value == model.estimate("P=? [ F<=3 x=N ]", samples=200, seed=1).value
    assert result.accuracy.samples == 200


def test_sums_are_checked_on_random_paths_as_the_options_say():
    text = "dtmc module m x : [0..1]; [] true -> 0.5:(x'=1) + 0.4:(x'=0); endmodule"
    with pytest.raises(symcheck.SymcheckError, match=r"0\.9"):
        symcheck.loads(text).simulate(3)
    assert len(symcheck.loads(text, check_sums=False).simulate(3, seed=1, loop_check=False)) == 3


@pytest.mark.parametrize("formula", ["true; false", "const int k;"])
def test_one_property_at_a_time(formula):
    model = symcheck.loads(CHOICE)
    with pytest.raises(UsageError, match="one property is expected here"):
        model.check(formula)
    with pytest.raises(UsageError, match="one property is expected here"):
        model.estimate(formula)


def test_faults_of_any_property_are_found_before_the_model_is_built():
    model = symcheck.loads(WALK, "N=3")
    with pytest.raises(NameFault, match="no such constant"):
        next(model.check_all("P=? [ F x=N ]; x=1", {"z": 1}))
    assert "engine" not in vars(model)


@pytest.mark.parametrize(("name", "hint"), [("at", "result.value"), ("get_values", "numpy")])
def test_the_names_of_stormpy_have_a_hint(name: str, hint: str):
    result = symcheck.loads(WALK, "N=3").check("P=? [ F x=N ]")
    with pytest.raises(AttributeError, match=hint):
        getattr(result, name)
