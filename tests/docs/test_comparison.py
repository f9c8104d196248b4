"""The feature table: each "yes" of symcheck is a command or a call that works."""

from __future__ import annotations

import re
import shlex
from contextlib import ExitStack
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "comparison.md").read_text()
ROWS = [
    [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in PAGE.partition("\n## Features\n")[2].splitlines()
    if line.startswith("| ") and not line.endswith("| symcheck |")
]
CLAIMS = {feature: own for feature, _, _, own in ROWS if own != "no"}


PROPERTIES = [
    (words[1], words[3], storm == "yes")
    for _, _, storm, own in ROWS
    if (found := re.fullmatch(r"yes: `(symcheck \S+ -pf '[^']*')`", own))
    and len(words := shlex.split(found[1])) == 4
    and storm in ("yes", "no", "of LTL formulas, in the program; not in stormpy")
]


@pytest.mark.parametrize(("model", "text", "answered"), PROPERTIES)
def test_storm_answers_as_its_column_says(model: str, text: str, answered: bool) -> None:
    pytest.importorskip("stormpy")
    (found,) = symcheck.compare(ROOT / model, text)
    has_answer = found.peer_value is not None or "its answer is a front" in found.explanation
    assert has_answer is answered, found.explanation


def test_cells_are_filled() -> None:
    assert len(ROWS) > 30
    assert len({feature for feature, *_ in ROWS}) == len(ROWS)
    assert all(cell for row in ROWS for cell in row)


@pytest.mark.parametrize("feature", CLAIMS)
def test_what_is_claimed_works(
    feature: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "models").symlink_to(ROOT / "models")
    monkeypatch.chdir(tmp_path)
    found = re.fullmatch(r"yes: `(.*)`", CLAIMS[feature])
    assert found, CLAIMS[feature]
    if found[1].startswith("symcheck "):
        assert main(shlex.split(found[1])[1:]) == 0, capsys.readouterr().err
        return
    if ".compare(" in found[1]:
        pytest.importorskip("stormpy")
    names: dict[str, object] = {
        "symcheck": symcheck,
        "die": symcheck.load("models/die/die.pm"),
        "stakes": symcheck.load("models/gambler/stakes.nm", strategy=True),
    }
    with ExitStack() as stack:
        if "executor=client" in found[1]:
            distributed = pytest.importorskip("distributed")
            opened = distributed.Client(processes=False, dashboard_address=":0")
            names["client"] = stack.enter_context(opened)
        assert eval(found[1], names) is not None
