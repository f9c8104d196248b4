"""Storm's DRN files, as they are written here and by Storm."""

from __future__ import annotations

import re
from math import isclose
from pathlib import Path
from random import Random

import pytest

import symcheck
from exchange.models import some_model
from symcheck.cli import main
from symcheck.errors import SyntaxFault, UnsupportedError, UsageError

MODELS = Path(__file__).parents[2] / "models"
SMALL = """// a comment
@type: MDP
@value_type: double
@parameters

@reward_models
r "two words"
@nr_states
2
@nr_choices
3
@model
state 0 [1, 0] init "not done"
//[x=0]
\taction a [2, 0]
\t\t0 : 1/4
\t\t1 : 0.75
\taction 1
\t\t1 : 1
state 1 [0, 5] done
\taction __NOLABEL__ [0, 0.5]
\t\t1 : 1
"""


def written(tmp_path, text, name="m.drn"):
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


def test_each_part_of_a_file_is_read(tmp_path):
    model = symcheck.load_explicit(written(tmp_path, SMALL.replace('r "two words"', "r s")))
    assert model.bound.type.value == "mdp"
    assert model.bound.actions == ("a",)
    assert model.matrix.todense().tolist() == [[0.25, 0.75], [0, 1], [0, 1]]
    assert set(model.labels) == {"init", "not_done", "done", "deadlock"}
    assert model.rewards["r"].states.tolist() == [1, 0]
    assert model.rewards["r"].choices.tolist() == [2, 0, 0]
    assert model.rewards["s"].choices.tolist() == [0, 0, 0.5]
    # Staying with action a earns (1 + 2) in each of 4/3 visits.
    assert model.check('R{"r"}max=? [ F "done" ]').value == pytest.approx(4)


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
def test_what_is_written_is_read_again(kind, seed, engine, tmp_path):
    model = symcheck.loads(some_model(Random(seed), kind).text)
    (path,) = symcheck.export(model, str(tmp_path / "m.drn"))
    try:
        again = symcheck.load_explicit(path, engine=engine)
    except symcheck.SymcheckError as error:
        pytest.skip(str(error))
    assert again.bound.type is model.bound.type
    best = "max" if kind == "mdp" else ""
    for formula in (
        f'P{best}=? [ F "a" ]',
        f'R{{"r"}}{best}=? [ F "b" ]',
        f'R{{"r"}}{best}=? [ C<=2 ]',
        f'P{best}=? [ F<=3 "b" ]',
    ):
        if not set(re.findall(r'\[ F.* "(.)"', formula)) <= set(again.labels):
            continue  # a label that no state has is not in the file
        found, expected = again.check(formula).value, model.check(formula).value
        assert found == expected or isclose(found, expected, rel_tol=1e-6, abs_tol=1e-9), formula
    assert again.engine.transitions == model.engine.transitions


def test_the_command_line_reads_it(tmp_path, capsys):
    path = str(tmp_path / "die.drn")
    symcheck.export(symcheck.load(MODELS / "die/die.pm"), path)
    assert main([path, "-pf", 'P=? [ F<=3 "done" ]; R{"tosses"}=? [ F "done" ]']) == 0
    out = capsys.readouterr().out
    assert "Result: 0.75" in out
    assert "Result: 3.66666" in out
    with pytest.raises(UsageError, match="load_explicit"):
        symcheck.load(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "@type: MDP",
            "@type: POMDP",
            "0 of the 2 states of a POMDP have an observation",
        ),
        ("@parameters\n", "@parameters\np", "parametric models are not supported"),
        (
            "1/4",
            "1/5",
            "m.drn:15:2: error[drn]: the probabilities of this action sum to 0.95, not to 1",
        ),
        ("1/4", "-1", "must be finite and not negative"),
        ("1/4", "q", "'q' is not a number"),
        ("1/4", "nan", "'nan' is not a finite number"),
        ("1/4", "9" * 400 + "/1", "is not a number"),
        ("[0, 5]", "[0, inf]", "'inf' is not a finite number"),
        ("[0, 5]", "[0, 5", "a state is written as"),
        ("[2, 0]", "[2, 0", "an action is written as"),
        ("state 1 ", "state 1 !2 ", "states of an MDP have no exit rates"),
        ("\t\t0 : 1/4", "\t\t7 : 1/4", "state 7 does not exist: there are 2, numbered from 0"),
        ("\t\t0 : 1/4", "\t\t1 : 1/4", "this transition is in the action already"),
        ("state 1 ", "state 2 ", "state 1 is expected here"),
        ("@model", "@modell", "a line of the header starts with @"),
        ("@nr_states\n2", "@nr_states\n3", "the header announces 3 states, but 2 follow"),
        ("state 1 [0, 5]", "state 1 {3} [0, 5]", "states of a MDP have no observations"),
        ("\taction a [2, 0]\n", "", "an action is expected before this transition"),
    ],
)
def test_faults_have_their_place(old, new, message, tmp_path):
    with pytest.raises(SyntaxFault) as error:
        symcheck.load_explicit(written(tmp_path, SMALL.replace(old, new)))
    assert message in str(error.value)


def test_rates_that_do_not_sum_to_that_of_the_state_are_an_error_in_its_line(tmp_path):
    text = "@type: CTMC\n@parameters\n\n@nr_states\n2\n@model\nstate 0 !0 init\nstate 1 !3\n"
    for actions in "", "\taction 0\n\t\t0 : 2\n":
        with pytest.raises(SyntaxFault, match=r"m\.drn:8:1: .* the rates of state 1 sum to"):
            symcheck.load_explicit(written(tmp_path, text + actions))


@pytest.mark.parametrize("kind", ["CTMC", "Markov Automaton"])
@pytest.mark.parametrize(
    ("rate", "message"),
    [("-2", "an exit rate must not be negative")]
    + [(text, f"'{text}' is not a finite number") for text in ("nan", "inf", "1e999")],
)
def test_an_exit_rate_is_a_number(kind, rate, message, tmp_path):
    text = f"@type: {kind}\n@nr_states\n1\n@model\nstate 0 !{rate} init\n\taction 0\n\t\t0 : 1\n"
    with pytest.raises(SyntaxFault) as error:
        symcheck.load_explicit(written(tmp_path, text))
    assert f"m.drn:5:1: error[drn]: {message}" in str(error.value)


UNCERTAIN = """@value_type: double-interval
@type: MDP
@nr_states
2
@model
state 0 init
	action a
		0 : [0.2,0.6]
		1 : [1/2,2/3]
state 1
	action b
		1 : 1
"""


@pytest.mark.parametrize(
    ("new", "place", "message"),
    [
        ("[0,0.6]", "8:3", "lower end 0 is not supported.*hint: nature could remove"),
        ("[0.7,0.6]", "8:3", "its lower end is above its upper end"),
        ("[-0.2,0.6]", "8:3", "must be finite and not negative"),
        ("[0.2,1.6]", "8:3", "the upper end of this interval is more than 1"),
        ("[nan,0.6]", "8:3", "'nan' is not a finite number"),
        ("[0.2,0.6", "8:3", "a transition is written as"),
        ("[0.2,0.3]", "7:2", "the upper ends of these intervals sum to 0.966666666667.*1 lies"),
        ("[0.6,0.6]", "7:2", "the lower ends of these intervals sum to 1.1"),
    ],
)
def test_faulty_intervals_have_their_place(new, place, message, tmp_path):
    file = written(tmp_path, UNCERTAIN)
    assert symcheck.load_explicit(file).check("Pmaxmin=? [ X x=1 ]").value == 0.5
    file = written(tmp_path, UNCERTAIN.replace("[0.2,0.6]", new))
    with pytest.raises(SyntaxFault, match=rf"(?s)m\.drn:{place}: .*{message}"):
        symcheck.load_explicit(file)


def test_rates_have_no_intervals(tmp_path):
    text = UNCERTAIN.replace("MDP", "Markov Automaton").replace("state 0", "state 0 !2")
    with pytest.raises(SyntaxFault, match=r"m\.drn:8:3: .* intervals of rates are not supported"):
        symcheck.load_explicit(written(tmp_path, text))


def test_ends_of_intervals_are_rounded(tmp_path):
    """0.1 * 0.7 and 0.93 sum to 1, but for rounding."""
    text = UNCERTAIN.replace("[0.2,0.6]", f"[{0.1 * 0.7},{0.1 * 0.7}]")
    text = (
        text.replace("[1/2,2/3]", "[0.93,0.93]") + "\taction c\n\t\t0 : [0.1,1]\n\t\t1 : [0.1,1]\n"
    )
    file = written(tmp_path, text)
    assert symcheck.load_explicit(file).check("Pmaxmin=? [ X x=1 ]").value == 0.93
    with pytest.raises(UnsupportedError, match="intervals are rounded"):
        symcheck.load_explicit(file, exact=True).check("Pmaxmin=? [ X x=1 ]")


def test_a_type_that_differs_from_the_switch_is_an_error(tmp_path):
    with pytest.raises(SyntaxFault, match="the file holds a MDP, and a DTMC is asked for"):
        symcheck.load_explicit(written(tmp_path, SMALL), type="dtmc")


def test_storm_writes_what_is_read_here(tmp_path):
    stormpy = pytest.importorskip("stormpy")
    from stormpy.developer import export_sparse_model_as_drn
    from stormpy.developer._core import DirectEncodingExporterOptions

    for name, formula in (
        ("die/die.pm", "P=? [ F d=6 ]"),
        ("dining/dining.nm", 'Pmin=? [ F<=20 "eating" ]'),
        ("queue/queue.sm", "S=? [ n=0 ]"),
    ):
        ours = symcheck.load(MODELS / name)
        program = stormpy.parse_prism_program(str(MODELS / name), prism_compatibility=True)
        built = stormpy.build_model(program, options=stormpy.BuilderOptions(build_full=True))
        path = str(tmp_path / "m.drn")
        export_sparse_model_as_drn(built, path, DirectEncodingExporterOptions())
        again = symcheck.load_explicit(path)
        assert (again.engine.states, again.engine.transitions) == (
            ours.engine.states,
            ours.engine.transitions,
        )
        assert set(again.labels) == set(ours.labels)
        if '"' in formula:
            assert again.check(formula).value == pytest.approx(ours.check(formula).value, rel=1e-6)
        for reward in ours.rewards:
            expected = ours.check(
                f'R{{"{reward}"}}{"max" if ours.bound.type.value == "mdp" else ""}=? [ C<=3 ]'
            ).value
            found = again.check(
                f'R{{"{reward}"}}{"max" if ours.bound.type.value == "mdp" else ""}=? [ C<=3 ]'
            ).value
            assert found == pytest.approx(expected, rel=1e-5)
