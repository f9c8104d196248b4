"""Formulas on the quotient by bisimulation: the same values as on the model."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from generate import random_model, random_property
from symcheck.api.loading import load, loads
from symcheck.check import tuning
from symcheck.check.bisimulation import on_quotient
from symcheck.check.checker import check
from symcheck.engines.symbolic.materialized import materialize
from symcheck.errors import InputError, UnsupportedError
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind_properties
from symcheck.syntax.parse import parse_properties

SLOW = settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck))


def random_engine(seed, kind, name="explicit"):
    try:
        return random_model(Random(seed), kind, largest=5), engine_of(
            random_model(Random(seed), kind, largest=5).text, name
        )
    except InputError:
        assume(False)


@SLOW
@given(
    seed=st.integers(0, 2**20),
    kind=st.sampled_from(["dtmc", "ctmc", "mdp"]),
    name=st.sampled_from(["explicit", "sparse", "mtbdd"]),
)
def test_the_same_values(seed, kind, name):
    model, engine = random_engine(seed, kind, name)
    rng = Random(seed + 1)
    for _ in range(3):
        text = random_property(rng, model)
        try:
            want = check_text(engine, text)
        except UnsupportedError:
            assume(False)
        found = check_text(engine, text, bisim=True)
        for one, other in zip(want.values.at(engine.all), found.values.at(engine.all), strict=True):
            assert other == pytest.approx(one, rel=1e-5, abs=1e-9), text


def test_symmetric_parts_are_lumped():
    part = "module m{0}\n x{0} : [0..2];\n [] x{0}=0 -> 2:(x{0}'=1);\n [] x{0}=1 -> 1:(x{0}'=2) + 3:(x{0}'=0);\nendmodule\n"
    text = "ctmc\n" + "".join(part.format(i) for i in range(5))
    engine = engine_of(text + 'label "all" = ' + " & ".join(f"x{i}=2" for i in range(5)) + ";\n")
    result = check_text(engine, 'P=? [ F<=2 "all" ]', bisim=True)
    assert "243 states -> 21" in result.explanation  # multisets of 5 of 3 states
    assert result.value == pytest.approx(check_text(engine, 'P=? [ F<=2 "all" ]').value, rel=1e-6)
    assert check_text(engine, 'P>=0.99 [ F "all" ]', bisim=True).value is True
    assert check_text(engine, 'P=? [ F "init" ]', bisim=True).value == 1


LINE = "dtmc\nmodule m\n x : [0..4];\n [] x=0 -> 1/3:(x'=1) + 1/3:(x'=2) + 1/3:(x'=3);\n [] x>0 -> true;\nendmodule\n"


@pytest.mark.parametrize(
    "text", ["filter(max, filter(min, P=? [ F x=1 ]))", "P=? [ F E [ X x=1 ] ]"]
)
def test_what_is_checked_without(text):
    assert any(
        "without -bisim" in w for w in check_text(engine_of(LINE), text, bisim=True).warnings
    )


def test_searches_for_a_path_need_no_quotient():
    result = check_text(engine_of(LINE), "E [ F x=1 ]", bisim=True)
    assert result.value is True
    assert [state["x"] for state in result.witness] == [0, 1]
    assert not result.warnings


FORK = "dtmc\nmodule m\n x : [0..3];\n [] x<2 -> 0.25:(x'=2) + 0.75:(x'=3);\n [] x>1 -> true;\nendmodule\ninit x<2 endinit\n"


@pytest.mark.parametrize("name", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_initial_states_of_one_block_have_a_range(name):
    engine = engine_of(FORK, name)
    for text in ("P=? [ F x=2 ]", "P>0.5 [ F x=2 ]", "P<0.5 [ F x=2 ]"):
        want, found = check_text(engine, text), check_text(engine, text, bisim=True)
        assert found.value == want.value
        assert found.explanation.startswith(want.explanation)
    assert check_text(engine, "P=? [ F x=2 ]", bisim=True).value == (0.25, 0.25)


@pytest.mark.parametrize("name", ["explicit", "sparse", "hybrid"])
@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("filter(max, P=? [ F x=1|x=2 ])", 1),
        ("filter(min, P=? [ F x=1|x=2 ])", 0),
        ("filter(sum, P=? [ F x=1|x=2 ])", 8 / 3),
        ("filter(avg, P=? [ F x=1|x=2 ], x=0|x=3)", 1 / 3),
        ("filter(count, P>=0.6 [ F x=1|x=2 ])", 3),
        ("filter(count, P>0.5 [ F x=1|x=2 ], P<1 [ F x=1|x=2 ])", 1),
        ("filter(forall, P>=0 [ X x=1 ])", True),
        ("filter(state, P=? [ F x=1|x=2 ], x=2)", 1),
        ('filter(range, P=? [ F x=1|x=2 ], "init"|x=1)', (pytest.approx(2 / 3), 1)),
    ],
)
def test_filters_speak_of_all_states(name, text, value):
    result = check_text(engine_of(LINE, name), text, bisim=True)
    assert result.value == (pytest.approx(value) if isinstance(value, float) else value)
    assert "by bisimulation" in result.explanation
    assert not result.warnings


def test_a_threshold_at_the_value():
    engine = engine_of(LINE)
    result = check_text(engine, "P>=2/3 [ F x=1|x=2 ]", bisim=True)
    assert result.value is True
    assert result.engine.states == 4


@pytest.mark.parametrize("engine", ["auto", "sparse"])
def test_other_engines_answer(engine):
    assert check_text(
        engine_of(LINE, engine), "P=? [ F x=1|x=2 ]", bisim=True
    ).value == pytest.approx(2 / 3)


@pytest.mark.parametrize("name", ["explicit", "sparse"])
def test_labels_that_a_formula_combines_are_not_distinguished(name):
    engine = engine_of(LINE + 'label "one" = x=1|x=4;\nlabel "two" = x=2|x=4;\n', name)
    result = check_text(engine, 'P=? [ F "one" | "two" ]', bisim=True)
    assert "4 states -> 3" in result.explanation
    assert result.value == pytest.approx(2 / 3)
    assert "4 states -> 4" in check_text(engine, 'P=? [ !"one" U "two" ]', bisim=True).explanation


def test_explicit_states_that_have_diagrams(monkeypatch):
    monkeypatch.setattr(tuning, "DIAGRAMS_FIRST_STATES", 2)
    monkeypatch.setattr(tuning, "STATES_PER_BLOCK", 1)
    engine = materialize(engine_of(LINE, "sparse"))
    result = check_text(engine, "P=? [ F x=1|x=2 ]", bisim=True)
    assert "on diagrams" in result.runs[0].explanation
    assert result.values.at(engine.all)[0].tolist() == pytest.approx([2 / 3, 1, 1, 0])
    assert check_text(engine, "P>0.5 [ F x=1|x=2 ]", bisim=True).satisfying.mask.tolist() == [
        True,
        True,
        True,
        False,
    ]
    assert check_text(engine, "filter(count, P>0.5 [ F x=1|x=2 ])", bisim=True).value == 3


def test_diagrams_that_do_not_lump_are_listed():
    text = "ctmc\nmodule m\n x : [0..99];\n [] x<99 -> 1:(x'=x+1);\n [] x>0 -> 2:(x'=x-1);\nendmodule\n"
    found = check_text(engine_of(text, "sparse"), "S=? [ x=99 ]", bisim=True)
    assert "100 states -> 100" in found.explanation
    assert "on explicit states" in found.runs[0].explanation


def test_rewards_of_choices_tell_blocks_apart():
    text = """mdp
module m
 x : [0..4];
 [a] x=0 -> (x'=3);
 [b] x=1 -> (x'=3);
 [a] x=2 -> (x'=3);
 [] x=3 -> (x'=0);
 [] x=3 -> (x'=1);
 [] x=3 -> (x'=2);
 [] x=3 -> 0.5:(x'=4) + 0.5:(x'=0);
endmodule
rewards "one" [a] true : 1; [b] true : 2; endrewards
rewards "none" endrewards
"""
    for name in ("explicit", "hybrid"):
        engine = engine_of(text, name)
        for direction in ("min", "max"):
            lumped = check_text(engine, f'R{{"one"}}{direction}=? [ F x=4 ]', bisim=True)
            assert "5 states -> 4" in lumped.explanation
            assert lumped.value == pytest.approx(
                check_text(engine, f'R{{"one"}}{direction}=? [ F x=4 ]').value
            )
        assert "5 states -> 3" in check_text(engine, "Pmax=? [ F x=4 ]", bisim=True).explanation


# One quotient for several formulas.

THREE = [('P=? [ F "one" ]', 2 / 3), ("P=? [ F x=2 ]", 1 / 3), ("P>=0.6 [ F x=2 ]", False)]


TAIL = """dtmc
module m
 x : [0..20];
 [] x=0 -> 1/3:(x'=1) + 1/3:(x'=2) + 1/3:(x'=4);
 [] x>3&x<20 -> (x'=x+1);
 [] x=1|x=2|x=20 -> true;
endmodule
label "one" = x=1|x=2;
"""


def several(name, texts):
    model = loads(TAIL, engine=name, bisim=True)
    return [result for _, result in model.check_all("\n".join(f"{t};" for t in texts))]


@pytest.mark.parametrize("name", ["explicit", "sparse", "hybrid", "mtbdd", "auto"])
def test_formulas_share_a_quotient(name):
    results = several(name, [text for text, _ in THREE])
    assert [r.value for r in results] == [
        pytest.approx(v) if isinstance(v, float) else v for _, v in THREE
    ]
    # The chain 4, 5, … 20 ends in one state that never changes: it is one block. x=1 and x=2 are told apart for one of them.
    assert all("20 states -> 4 by bisimulation" in r.explanation for r in results)


def test_what_has_no_quotient_does_not_take_it_from_the_others():
    results = several(
        "explicit",
        [
            "P=? [ F x=1 ]",
            "filter(max, filter(min, P=? [ F x=1 ]))",
            "P=? [ F x=2 ]",
            "E [ F x=1 ]",
        ],
    )
    assert ["by bisimulation" in r.explanation for r in results] == [True, False, True, False]
    assert "-> 4 by" in results[0].explanation


def test_formulas_that_tell_most_states_apart_keep_their_own_quotients():
    results = several("explicit", ["P=? [ F x=1 ]", *(f"P=? [ F x={k} ]" for k in range(5, 21, 2))])
    assert results[0].explanation.endswith("20 states -> 3 by bisimulation")
    assert results[3].explanation.endswith("20 states -> 8 by bisimulation")


def test_one_formula_with_many_bounds_has_one_quotient():
    file = parse_properties("const int k; P=? [ F<=k x=2 ]; P>=0.3 [ F<=k x=2 ];")
    engine = engine_of(TAIL)
    asked = [
        (p.formula, b.labels)
        for k in range(4)
        for b in [bind_properties(file, engine.model, {"k": str(k)})]
        for p in b.properties
    ]
    shared = on_quotient.shared_quotient(engine, asked, Options(bisim=True))
    assert str(shared).startswith("20 states -> 3, common to all 8 properties")


@SLOW
@given(
    seed=st.integers(0, 2**20),
    kind=st.sampled_from(["dtmc", "ctmc", "mdp"]),
    name=st.sampled_from(["explicit", "sparse", "mtbdd"]),
)
def test_a_shared_quotient_has_the_same_values(seed, kind, name):
    model, engine = random_engine(seed, kind, name)
    rng = Random(seed + 1)
    asked = []
    for _ in range(4):
        bound = bind_properties(parse_properties(random_property(rng, model)), engine.model, {})
        asked.append((bound.properties[0].formula, bound.labels))
    shared = on_quotient.shared_quotient(engine, asked, Options(bisim=True))
    for formula, labels in asked if shared is not None else []:
        try:
            want = check(engine, formula, Options(), labels=labels)
        except UnsupportedError:
            continue
        found = check(engine, formula, Options(bisim=True), labels=labels, shared=shared)
        for one, other in zip(want.values.at(engine.all), found.values.at(engine.all), strict=True):
            assert other == pytest.approx(one, rel=1e-5, abs=1e-9)


def test_the_study_has_one_quotient():
    """Its model at one position: the eight properties that are no search, exactly as on the model."""
    folder = Path(__file__).parents[2] / "models" / "cell_injection"
    constants = {
        "CellBoundaryX": 175,
        "CellBoundaryY": 175,
        "NoisePercentage": "0.01",
        "StepSizeXY": 18,
    }
    constants |= {"InitialPositionXY": 100, "MaxDistance": 250, "Damping": 1}
    whole = load(folder / "cell_injection.pm", constants, engine="explicit")
    want = [r for _, r in whole.check_all(folder / "cell_injection.pctl", {"ForceBound": 10})]
    for reduce, states in ((False, 194_042), (True, 176_068)):
        model = whole.with_options(bisim=True, reduce=reduce)
        found = [r for _, r in model.check_all(folder / "cell_injection.pctl", {"ForceBound": 10})]
        assert [r.value for r in found] == pytest.approx([r.value for r in want], rel=1e-14)
        assert [f"{states} states -> 7275 by bisimulation" in r.explanation for r in found] == [
            False
        ] + [True] * 8
