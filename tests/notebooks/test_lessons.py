"""Each lesson runs from a clean kernel, without errors, and is stored without results."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from without_cudd import HIDE_CUDD

ROOT = Path(__file__).resolve().parents[2]
LESSONS = sorted((ROOT / "notebooks").glob("*.ipynb"))
NEED_CUDD = {"08_hybrid_engine"}
SETS = ("01_decision_diagrams", "02_reachability", "03_until")


def execute(notebook: nbformat.NotebookNode) -> None:
    resources = {"metadata": {"path": str(ROOT / "notebooks")}}
    NotebookClient(notebook, timeout=600, resources=resources).execute()


@pytest.mark.parametrize("path", LESSONS, ids=lambda p: p.stem)
def test_a_lesson_runs(path: Path) -> None:
    """Solutions of the exercises included; an error in a cell raises CellExecutionError."""
    notebook = nbformat.read(path, 4)
    execute(notebook)
    ran = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in ran)
    assert len(ran) > 5


@pytest.mark.parametrize("name", SETS)
def test_a_lesson_about_sets_runs_without_cudd(name: str) -> None:
    notebook = nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", 4)
    hidden = "\nfrom symcheck.dd.cudd_import import available\nassert not available()"
    notebook.cells.insert(0, nbformat.v4.new_code_cell(HIDE_CUDD + hidden))
    execute(notebook)


@pytest.mark.parametrize("path", LESSONS, ids=lambda p: p.stem)
def test_a_lesson_says_at_its_top_whether_it_needs_cudd(path: Path) -> None:
    top = nbformat.read(path, 4).cells[0].source
    assert ("It needs CUDD" in top) == (path.stem in NEED_CUDD)


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
    assert len(LESSONS) == 10
