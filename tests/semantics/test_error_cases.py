"""Every fault is found where it is, in the right words."""

from __future__ import annotations

from pathlib import Path

import pytest

from semantics.cases import FOLDER, outcome, read


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.case")), ids=lambda p: p.stem)
def test_case(path: Path) -> None:
    sections = read(path)
    assert outcome(sections) == sections["error"]
    assert sections["error"] != "no error\n"
