"""DRN files of partially observed models."""

from __future__ import annotations

from pathlib import Path

import pytest

import symcheck
from symcheck.errors import SyntaxFault, UnsupportedError

MODELS = Path(__file__).parents[2] / "models"
TEXT = """@type: POMDP
@parameters

@reward_models
cost
@nr_states
4
@nr_choices
6
@model
state 0 {0} [0] init
	action 0 [1]
		1 : 0.25
		2 : 0.75
state 1 {7} [0]
	action 0 [1]
		3 : 1
	action 1 [5]
		1 : 1
state 2 {7} [0]
	action 0 [1]
		2 : 1
	action 1 [2]
		3 : 1
state 3 {2} [0] goal
	action 0 [0]
		3 : 1
"""


def read(tmp_path: Path, text: str) -> symcheck.Model:
    file = tmp_path / "model.drn"
    file.write_text(text)
    return symcheck.load_explicit(str(file))


def test_observations_are_read(tmp_path):
    """In both states of observation 7, one action ends: trying both in turn costs least."""
    model = read(tmp_path, TEXT)
    assert model.check('Pmax=? [ F "goal" ]').value == 1
    low, high = model.check('Rmin=? [ F "goal" ]').bounds
    # Action 1 first: 1 + (0.75 * 2 + 0.25 * (5 + 1)); action 0 first: 1 + 0.25 + 0.75 * (1 + 2).
    assert low <= 3.5 <= high
    assert model.check("Pmax=? [ F<=2 observation=2 ]").value == 0.75


@pytest.mark.parametrize("kind", ["pexp", "umb", "umbt"])
def test_files_without_observations_are_refused(tmp_path, kind):
    model = read(tmp_path, TEXT)
    with pytest.raises(UnsupportedError, match=f"the kind {kind} cannot hold observations"):
        symcheck.export(model, str(tmp_path / f"m.{kind}"))


@pytest.mark.parametrize("name", ["tiger", "rover", "channels"])
def test_a_model_is_written_and_read_again(tmp_path, name):
    model = symcheck.load(MODELS / name / f"{name}.prism")
    file = tmp_path / "again.drn"
    symcheck.export(model, file)
    again = symcheck.load_explicit(str(file))
    query = 'Pmax=? [ F "both" ]' if name == "channels" else 'Pmax=? [ F<=4 "free" ]'
    if name == "rover":
        query = 'Pmax=? [ F "arrived" ]'
    assert again.check(query).value == pytest.approx(model.check(query).value, abs=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("state 2 {7}", "state 2", "3 of the 4 states of a POMDP have an observation"),
        ("state 2 {7}", "state 2 {a}", "the observation 'a' is not a whole number"),
    ],
)
def test_faults(tmp_path, old, new, message):
    with pytest.raises(SyntaxFault, match=message):
        read(tmp_path, TEXT.replace(old, new)).engine  # noqa: B018
