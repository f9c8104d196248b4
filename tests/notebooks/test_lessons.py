"""Each lesson runs from a clean kernel, without errors, and is stored without results."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[2]
LESSONS = sorted((ROOT / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", LESSONS, ids=lambda p: p.stem)
def test_a_lesson_runs(path: Path) -> None:
    """Solutions of the exercises included; an error in a cell raises CellExecutionError."""
    notebook = nbformat.read(path, 4)
    client = NotebookClient(
        notebook, timeout=600, resources={"metadata": {"path": str(ROOT / "notebooks")}}
    )
    client.execute()
    ran = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in ran)
    assert len(ran) > 5


@pytest.mark.parametrize("path", LESSONS, ids=lambda p: p.stem)
def test_a_lesson_says_what_one_learns_and_has_exercises(path: Path) -> None:
    notebook = nbformat.read(path, 4)
    texts = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    assert "After this lesson you can" in texts[0]
    exercises = next(t for t in texts if "## Exercises" in t)
    assert len(re.findall(r"^\d\. ", exercises, re.MULTILINE)) >= 3
    assert any(t.startswith("## Solutions") for t in texts)


@pytest.mark.parametrize("path", LESSONS, ids=lambda p: p.stem)
def test_a_lesson_is_stored_without_results(path: Path) -> None:
    notebook = nbformat.read(path, 4)
    assert all(not cell.outputs for cell in notebook.cells if cell.cell_type == "code")


def test_the_index_names_every_lesson() -> None:
    page = (ROOT / "docs" / "lessons.md").read_text()
    assert set(re.findall(r"`(\w+\.ipynb)`", page)) == {p.name for p in LESSONS}
    assert len(LESSONS) == 9
