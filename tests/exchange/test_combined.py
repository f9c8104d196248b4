"""Combined explicit files (.pexp), labelled transition systems, and UMB files as text."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

import numpy as np
import pytest

import symcheck
from exchange.models import some_model
from symcheck.cli import main
from symcheck.errors import SyntaxFault, UnsupportedError
from symcheck.syntax.ast import ModelType

LTS = """# Transitions (LTS)
3 4 4
0 0 1 up
0 1 2 down
1 0 0 up
2 0 2
"""


def saved(folder: Path, text: str) -> str:
    path = folder / "model.pexp"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
def test_a_combined_file_holds_what_the_single_files_hold(kind, seed, tmp_path):
    model = symcheck.loads(some_model(Random(seed), kind).text)
    (combined,) = symcheck.export(model, f"{tmp_path}/one.pexp")
    symcheck.export(model, f"{tmp_path}/several.all")
    one = symcheck.load_explicit(combined)
    several = symcheck.load_explicit(f"{tmp_path}/several.all")
    assert one.bound.type is model.bound.type
    assert np.array_equal(one.matrix.todense(), several.matrix.todense())
    assert list(one.rewards) == [r.name or "" for r in model.bound.rewards]
    for name, rewards in several.rewards.items():
        for a, b in zip(rewards, one.rewards[name], strict=True):
            assert np.array_equal(a, b)
    for name, states in model.labels.items():
        assert one.labels[name].count == states.count
    again = symcheck.export(one, f"{tmp_path}/again.pexp")
    assert Path(again[0]).read_text() == Path(combined).read_text()


def test_rewards_and_labels_may_be_left_out(tmp_path, capsys):
    model = symcheck.loads(
        "dtmc module m x:[0..1]; [] true -> (x'=1-x); endmodule rewards 1=1:1; endrewards"
    )
    (file,) = symcheck.export(model, f"{tmp_path}/m.pexp:rewards=false,labels=false")
    assert '0="init"\n' in Path(file).read_text()
    assert "Reward" not in Path(file).read_text()


def test_transition_rewards_may_stand_alone(tmp_path):
    text = '# Transitions (DTMC)\n1 1\n0 0 1\n\n# Reward structure "r"\n# Transition rewards\n1 1\n0 0 3\n'
    model = symcheck.load_explicit(saved(tmp_path, text))
    assert model.check('R{"r"}=? [ C<=2 ]').value == 6


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("# States\n(x)\n0:(1)\n", "1:1", "there is no part '# Transitions'"),
        ("0 0 1\n# Transitions (DTMC)\n1 1\n0 0 1\n", "1:1", "text before the first part"),
        ("# Transitions\n1 1\n0 0 1\n\n# States\n(x)\n0:(1)\n1:(2)\n", "8:1", "has 1 state"),
        ("# Transitions\n1 1\n0 7 1\n", "3:3", "state 7 does not exist"),
        ("# Transitions\n1 1\n0 0 1\n# Transitions\n1 1\n0 0 1\n", "4:3", "a second part"),
    ],
)
def test_faults_are_shown_where_they_stand(text, place, message, tmp_path):
    with pytest.raises(SyntaxFault, match=message) as caught:
        symcheck.load_explicit(saved(tmp_path, text))
    assert f"model.pexp:{place}: " in str(caught.value)


def test_partially_observable_models_are_refused(tmp_path):
    text = "# Transitions (POMDP)\n1 1 1\n0 0 0 1\n\n# Observations\n1 1\n0:0\n"
    with pytest.raises(UnsupportedError, match="partially observable"):
        symcheck.load_explicit(saved(tmp_path, text))


def test_a_labelled_transition_system_is_an_mdp_without_chance(tmp_path, capsys):
    model = symcheck.load_explicit(saved(tmp_path, LTS))
    assert model.bound.type is ModelType.MDP
    assert [t.action for t in model.transitions] == ["up", "down", "up", None]
    (tmp_path / "m.tra").write_text(LTS.partition("\n")[2])  # the header is optional
    formulas = "E [ F x=2 ]; A [ F x=2 ]; Pmax=? [ F x=2 ]"
    assert main(["-importtrans", str(tmp_path / "m.tra"), "-pf", formulas]) == 0
    results = [x for x in capsys.readouterr().out.splitlines() if x.startswith("Result")]
    assert [line.split()[1] for line in results] == ["true", "false", "1.0"]


def test_a_line_of_a_transition_system_has_no_probability(tmp_path):
    with pytest.raises(SyntaxFault, match="source, choice, target, and perhaps an action"):
        symcheck.load_explicit(saved(tmp_path, LTS.replace("0 0 1 up", "0 0 1 1 up")))


def test_a_umb_file_as_text_names_its_members_and_their_values(tmp_path, capsys):
    pytest.importorskip("umbi")
    model = symcheck.loads(
        "dtmc module m x:[0..1]; [go] x=0 -> 0.25:(x'=0)+0.75:(x'=1); endmodule label \"end\" = x=1;"
    )
    (file,) = symcheck.export(model, f"{tmp_path}/m.umbt")
    names, texts = zip(
        *(part.split(":\n", 1) for part in ("\n" + Path(file).read_text()).split("\n/")[1:]),
        strict=True,
    )
    members = dict(zip(names, texts, strict=True))
    assert json.loads(members["index.json"])["transition-system"]["#states"] == 2
    assert members["state-is-initial.bin"].strip() == "[10]"
    assert members["branch-to-target.bin"].strip() == "[0,1,1]"
    assert members["branch-to-probability.bin"].strip() == "[0.25,0.75,1]"
    assert members["annotations/aps/end/states/values.bin"].strip() == "[01]"
    assert members["valuations/states/valuations.bin"].strip() == "[{x=0},{x=1}]"
