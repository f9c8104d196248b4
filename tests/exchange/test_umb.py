"""UMB files: what the package that defines them reads of ours, and what we read of ours and of others'."""

from __future__ import annotations

from math import isclose
from random import Random

import numpy as np
import pytest

import symcheck
from exchange.models import some_model
from generate import random_property
from symcheck.errors import SymcheckError, UnsupportedError, UsageError
from symcheck.exchange.explicit_export import explicit_export
from symcheck.syntax.ast import ModelType

pytest.importorskip("umbi")
import umbi.umb

KINDS = ("dtmc", "ctmc", "mdp")
MDP = """mdp
module m
  s : [0..2] init 0;
  b : bool;
  [a] s=0 -> 1/3 : (s'=1) + 2/3 : (s'=2);
  [b] s=0 -> (b'=true);
  [] s=1 -> true;
endmodule
label "one" = s=1;
rewards "r" s=1 : 2; [a] true : 3; endrewards
rewards "t" [b] true : 1; endrewards
"""


@pytest.mark.parametrize("kind", KINDS)
def test_the_model_is_in_the_file(kind, tmp_path):
    model = symcheck.loads(some_model(Random(4), kind).text)
    symcheck.export(model, str(tmp_path / "m.umb"))
    assert [p.name for p in tmp_path.iterdir()] == ["m.umb"]
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.validate()
    shot = explicit_export(
        model.engine, ["a", "b"], lambda n: model.engine.where(model.bound.labels[n])
    )
    system = raw.index.transition_system
    assert (system.num_states, system.num_choices) == (shot.n, shot.matrix.rows)
    # A chain has a branch for each action that contributes to an entry: the sum is the entry.
    row_of_branch = np.repeat(np.arange(shot.matrix.rows), np.diff(raw.choice_to_branches))
    pairs = np.stack([row_of_branch, raw.branch_to_target])
    entries, entry_of_branch = np.unique(pairs, axis=1, return_inverse=True)
    assert system.num_branches == len(row_of_branch)
    assert kind != "mdp" or system.num_branches == shot.matrix.entries
    assert (
        np.flatnonzero(raw.state_is_initial).tolist()
        == np.flatnonzero(shot.labels["init"]).tolist()
    )
    values = shot.values / shot.row_sums[shot.row_of_entry] if kind == "ctmc" else shot.values
    assert entries.tolist() == [shot.row_of_entry.tolist(), shot.matrix.indices.tolist()]
    probabilities = np.array([float(p) for p in raw.branch_to_probability])
    sums = np.bincount(entry_of_branch, probabilities)
    assert sums.tolist() == pytest.approx(values.tolist())
    if kind == "ctmc":
        assert [float(r) for r in raw.state_to_exit_rate] == pytest.approx(shot.row_sums.tolist())
    assert {n: v["states"] for n, v in raw.annotations["aps"].items()} == {
        n: m.tolist() for n, m in shot.labels.items() if n != "init"
    }
    rewards = raw.annotations["rewards"]["r"]
    assert rewards["states"] == shot.rewards[0].states.tolist()
    earned = np.array(rewards.get("branches") or np.array(rewards["choices"])[row_of_branch])
    means = np.bincount(entry_of_branch, earned * probabilities) / sums
    assert means.tolist() == pytest.approx(shot.entry_rewards(0).tolist())
    names = [v.name for v in shot.variables]
    assert raw.valuations["states"] == [
        dict(zip(names, row, strict=True)) for row in np.array(shot.columns).T.tolist()
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(8))
def test_answers_survive_a_round_trip(kind, seed, tmp_path):
    rng = Random(seed)
    generated = some_model(rng, kind)
    model = symcheck.loads(generated.text, engine="explicit")
    symcheck.export(model, str(tmp_path / "m.umb"))
    again = symcheck.load_explicit(str(tmp_path / "m.umb"))
    assert again.engine.model.type is ModelType(kind)
    for size in ("states", "transitions", "choices"):
        assert getattr(again.engine, size) == getattr(model.engine, size)
    for _ in range(5):
        formula = random_property(rng, generated)
        try:
            expected = model.check(formula).value
        except SymcheckError:
            continue
        assert _near(again.check(formula).value, expected), formula


def _near(found, expected):
    if isinstance(expected, tuple):
        return all(map(_near, found, expected))
    return found == expected or isclose(found, expected, rel_tol=3e-6, abs_tol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_read_is_written_again_as_it_was(kind, tmp_path):
    symcheck.export(symcheck.loads(some_model(Random(7), kind).text), str(tmp_path / "a.umb"))
    symcheck.export(symcheck.load_explicit(str(tmp_path / "a.umb")), str(tmp_path / "b.umb"))
    first, second = (umbi.umb.read(tmp_path / f"{name}.umb") for name in "ab")
    assert second.branch_to_target == first.branch_to_target
    assert second.branch_to_probability == pytest.approx(first.branch_to_probability)
    assert second.valuations == first.valuations
    assert second.annotations["aps"] == first.annotations["aps"]
    assert second.annotations["rewards"].keys() == first.annotations["rewards"].keys()


def test_actions_and_rewards_of_an_mdp_are_kept(tmp_path):
    symcheck.export(symcheck.loads(MDP), str(tmp_path / "m.umb"))
    again = symcheck.load_explicit(str(tmp_path / "m.umb"))
    assert again.engine.model.actions == ("a", "b")
    assert again.check('R{"r"}max=? [ F s>0 ]').value == float("inf")  # b may be taken for ever
    assert again.check('R{"r"}min=? [ F s>0 ]').value == pytest.approx(3)
    assert again.check('Pmax=? [ F "one" ]').value == pytest.approx(1 / 3)
    assert again.check("filter(count, b)").value == 3


def test_exact_probabilities_are_rationals_in_the_file(tmp_path):
    symcheck.export(symcheck.loads(MDP, exact=True), str(tmp_path / "m.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    assert "1/3" in [str(p) for p in raw.branch_to_probability]
    again = symcheck.load_explicit(str(tmp_path / "m.umb"), exact=True)
    assert str(again.check('Pmax=? [ F "one" ]').value) == "1/3"


def test_rewards_of_choices_and_branches_add_up(tmp_path):
    text = "dtmc module m s:[0..2]; [] s=0 -> 1/4:(s'=1)+3/4:(s'=2); [] s>0 -> true; endmodule rewards \"r\" [] s=0 : 2; endrewards"
    symcheck.export(symcheck.loads(text), str(tmp_path / "m.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.annotations["rewards"]["r"]["branches"] = [8.0, 0.0, 0.0, 0.0]
    raw.index.annotations["rewards"]["r"].applies_to.append("branches")
    umbi.umb.write(raw, tmp_path / "n.umb")
    again = symcheck.load_explicit(str(tmp_path / "n.umb"))
    assert again.check("R=? [ F s>0 ]").value == 2 + 8 / 4


def test_other_models_are_refused(tmp_path):
    symcheck.export(symcheck.loads(MDP), str(tmp_path / "m.umb"))
    with pytest.raises(UsageError, match="holds a MDP"):
        symcheck.load_explicit(str(tmp_path / "m.umb"), type=ModelType.DTMC)
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.index.transition_system.time = "urgent-stochastic"
    umbi.umb.write(raw, tmp_path / "n.umb")
    with pytest.raises(UnsupportedError, match="urgent-stochastic time and 1 players"):
        symcheck.load_explicit(str(tmp_path / "n.umb"))


def test_files_that_are_none_are_refused(tmp_path):
    with pytest.raises(UsageError, match="no such file"):
        symcheck.load_explicit(str(tmp_path / "missing.umb"))
    (tmp_path / "bad.umb").write_text("no tar file")
    with pytest.raises(UsageError, match="cannot read"):
        symcheck.load_explicit(str(tmp_path / "bad.umb"))
    symcheck.export(symcheck.loads(MDP), str(tmp_path / "m.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.branch_to_probability[0] = 0.9
    umbi.umb.write(raw, tmp_path / "n.umb")
    with pytest.raises(UsageError, match="sum to"):
        symcheck.load_explicit(str(tmp_path / "n.umb"))


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -0.5])
def test_what_is_no_probability_is_refused(wrong, tmp_path):
    symcheck.export(
        symcheck.loads("dtmc module m s:[0..1]; [] s=0 -> 0.5:(s'=1)+0.5:(s'=0); endmodule"),
        str(tmp_path / "m.umb"),
    )
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.branch_to_probability = [wrong, 1.5, 1.0]
    umbi.umb.write(raw, tmp_path / "n.umb")
    with pytest.raises(UsageError, match="is not a probability or rate"):
        symcheck.load_explicit(str(tmp_path / "n.umb"))


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), -2.0])
def test_rates_and_rewards_are_numbers(wrong, tmp_path):
    text = "ctmc module m s:[0..1]; [] s=0 -> 2:(s'=1); [] s=1 -> 3:(s'=0); endmodule"
    rewards = ' rewards "r" s=0: 5; endrewards'
    symcheck.export(symcheck.loads(text + rewards), str(tmp_path / "m.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.state_to_exit_rate = [wrong, 3.0]
    umbi.umb.write(raw, tmp_path / "n.umb")
    with pytest.raises(UsageError, match=r"is not an exit rate \(state 0\)"):
        symcheck.load_explicit(str(tmp_path / "n.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    (structure,) = raw.annotations["rewards"].values()
    structure["states"] = [0.0, wrong]
    umbi.umb.write(raw, tmp_path / "n.umb")
    if wrong == -2:
        assert symcheck.load_explicit(str(tmp_path / "n.umb")).rewards["r"].states[1] == -2
        return
    with pytest.raises(UsageError, match=r"is not finite \(states 1\)"):
        symcheck.load_explicit(str(tmp_path / "n.umb"))


@pytest.mark.parametrize(
    ("part", "place", "number"),
    [
        ("choice_to_branches", -1, 2**62),
        ("choice_to_branches", -1, 2**70),
        ("choice_to_branches", 1, 2**40),
        ("state_to_choices", -1, 2**40),
        ("state_to_choices", 0, 1),
        ("branch_to_target", 0, 2**70),
    ],
)
def test_numbers_that_no_part_can_have_are_refused(part, place, number, tmp_path, monkeypatch):
    symcheck.export(symcheck.loads(MDP), str(tmp_path / "m.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    numbers = list(getattr(raw, part))
    numbers[place] = number
    setattr(raw, part, numbers)
    monkeypatch.setattr(umbi.umb, "read", lambda _: raw)
    with pytest.raises(UsageError, match="contradicts itself"):
        symcheck.load_explicit(str(tmp_path / "m.umb"))


def test_branches_of_probability_0_never_happen(tmp_path):
    text = "dtmc module m s:[0..1]; [] s=0 -> 0.5:(s'=1)+0.5:(s'=0); endmodule rewards \"r\" [] s=0 : 2; endrewards"
    symcheck.export(symcheck.loads(text), str(tmp_path / "m.umb"))
    raw = umbi.umb.read(tmp_path / "m.umb")
    raw.branch_to_probability = [1.0, 0.0, 1.0]
    umbi.umb.write(raw, tmp_path / "n.umb")
    again = symcheck.load_explicit(str(tmp_path / "n.umb"))
    assert again.check("E [ F s=1 ]").value is False
    assert again.check("P=? [ F s=1 ]").value == 0
    assert again.check("R=? [ C<=3 ]").value == 6
