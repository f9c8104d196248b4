"""The lessons are made from one source each: they run, explain themselves, and are on the site."""

from __future__ import annotations

import re
import runpy
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from without_cudd import HIDE_CUDD

ROOT = Path(__file__).resolve().parents[2]
MADE = runpy.run_path(str(ROOT / "docs" / "make_lessons.py"))
LESSONS = MADE["SOURCES"]
NEED_CUDD = {"08_hybrid_engine"}
SETS = ("01_decision_diagrams", "02_reachability", "03_until")
WORDS_PER_MINUTE = 25
LONG_CELL = 15  # lines of code that no sentence in front of them would leave alone

each_lesson = pytest.mark.parametrize("source", LESSONS, ids=lambda p: p.stem)


@cache
def executed(source: Path) -> nbformat.NotebookNode:
    """The notebook with solutions, with what its cells give."""
    return MADE["executed"](MADE["solutions"](source))


def texts(notebook: nbformat.NotebookNode) -> list[str]:
    return [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]


def exercises(notebook: nbformat.NotebookNode) -> list[int]:
    """The places of the exercises."""
    return [n for n, cell in enumerate(notebook.cells) if cell.source.startswith("**Exercise ")]


def tagged(cell: Any, tag: str) -> bool:
    return tag in cell.metadata.get("tags", ())


def test_there_are_eleven_lessons() -> None:
    assert [source.stem[:2] for source in LESSONS] == [f"{n:02}" for n in range(11)]


@each_lesson
@pytest.mark.parametrize("version", ["student", "solutions"])
def test_a_notebook_is_what_its_source_gives(source: Path, version: str) -> None:
    """Otherwise run docs/make_lessons.py. What is made has no results."""
    folder = MADE["STUDENTS" if version == "student" else "SOLUTIONS"]
    made = MADE["text_of"](MADE[version](source))
    assert (folder / f"{source.stem}.ipynb").read_text() == made
    assert '"output_type"' not in made


def test_no_notebook_is_without_a_source() -> None:
    for folder in (MADE["STUDENTS"], MADE["SOLUTIONS"]):
        assert {p.stem for p in folder.glob("*.ipynb")} == {p.stem for p in LESSONS}


@each_lesson
def test_a_source_begins_with_its_title(source: Path) -> None:
    """No header of jupytext names versions and kernels."""
    number = int(source.stem[:2])
    assert source.read_text().startswith(f"# %% [markdown]\n# # Lesson {number}: ")


@each_lesson
def test_every_exercise_of_a_student_has_an_empty_answer_and_no_solution(source: Path) -> None:
    notebook = MADE["student"](source)
    places = exercises(notebook)
    assert len(places) >= 3
    assert [n + 1 for n in places] == [
        n for n, cell in enumerate(notebook.cells) if cell.source == "# Your answer"
    ]
    assert not any(tagged(cell, "solution") for cell in notebook.cells)
    assert "## Solutions" not in "\n".join(texts(notebook))


@each_lesson
def test_every_exercise_has_a_number_and_a_solution(source: Path) -> None:
    """It stands below the heading, and its solution right below it; after it comes no more text."""
    notebook = MADE["solutions"](source)
    cells = notebook.cells
    heading = next(n for n, cell in enumerate(cells) if "## Exercises" in cell.source)
    places = exercises(notebook)
    assert heading < places[0]
    for number, (place, end) in enumerate(pairwise([*places, len(cells)]), 1):
        assert cells[place].source.startswith(f"**Exercise {number}.**")
        assert [tagged(cell, "solution") for cell in cells[place:end]] == [
            False,
            *[True] * (end - place - 1),
        ]
        assert end - place > 1


@each_lesson
def test_a_lesson_runs_with_its_solutions(source: Path) -> None:
    """An error in a cell raises CellExecutionError, unless the cell shows a mistake on purpose."""
    code = [cell for cell in executed(source).cells if cell.cell_type == "code"]
    assert len(code) > 5
    for cell in code:
        assert cell.execution_count
        mistaken = any(output.output_type == "error" for output in cell.outputs)
        assert mistaken == tagged(cell, "raises-exception"), cell.source


@each_lesson
def test_paths_of_both_versions_exist(source: Path) -> None:
    for folder, version in (("STUDENTS", "student"), ("SOLUTIONS", "solutions")):
        text = "\n".join(cell.source for cell in MADE[version](source).cells)
        for path in re.findall(r"\"((?:\.\./)+[^\"\n{]*)", text):
            assert (MADE[folder] / path).exists(), path


@pytest.mark.parametrize("name", SETS)
def test_a_lesson_about_sets_runs_without_cudd(name: str) -> None:
    notebook = MADE["solutions"](ROOT / "lessons" / f"{name}.py")
    hidden = "\nfrom symcheck.dd.cudd_import import available\nassert not available()"
    notebook.cells.insert(0, nbformat.v4.new_code_cell(HIDE_CUDD + hidden))
    resources = {"metadata": {"path": str(MADE["SOLUTIONS"])}}
    NotebookClient(notebook, timeout=600, resources=resources).execute()


@each_lesson
def test_a_lesson_says_at_its_top_what_one_learns_and_needs(source: Path) -> None:
    top = texts(MADE["student"](source))[0]
    assert "After this lesson you can" in top
    assert re.search(r"Time: \d+ minutes\. You need", top)
    assert ("It needs CUDD" in top) == (source.stem in NEED_CUDD)


@each_lesson
def test_a_lesson_has_as_much_text_as_its_time_needs(source: Path) -> None:
    notebook = MADE["student"](source)
    words = sum(len(re.sub(r"\$[^$]*\$", "", text).split()) for text in texts(notebook))
    assert words >= WORDS_PER_MINUTE * minutes(source)
    assert any("## Summary" in text for text in texts(notebook))


@each_lesson
def test_text_stands_before_every_long_cell(source: Path) -> None:
    for before, cell in pairwise(MADE["student"](source).cells):
        if cell.cell_type == "code" and len(cell.source.splitlines()) > LONG_CELL:
            assert before.cell_type == "markdown", cell.source


def test_the_page_of_a_lesson_shows_pictures_formulas_and_folded_solutions() -> None:
    pytest.importorskip("nbconvert", reason="the extra docs is not installed")
    source = ROOT / "lessons" / "02_reachability.py"
    notebook = executed(source)
    page = MADE["page"](notebook, "Reachable states")
    assert "<title>Reachable states</title>" in page
    assert "data:image/png;base64," in page
    assert page.count("<iframe") == 2  # a graph of states, and a player
    assert "Iteration 0" in page
    assert "<math" in page
    assert page.count("<details>") == page.count("</details>") == len(exercises(notebook))


def test_a_page_loads_nothing_from_elsewhere() -> None:
    """A notebook without results is enough to see it."""
    pytest.importorskip("nbconvert", reason="the extra docs is not installed")
    page = MADE["page"](MADE["student"](LESSONS[1]), "Decision diagrams")
    assert re.findall(r"<(?:script|link|img)[^>]* (?:src|href)=\"(?!data:)[^>]*>", page) == []
    assert "import(" not in page
    assert "@import" not in page


def test_the_index_has_every_lesson_with_its_time_and_its_page() -> None:
    index = (ROOT / "docs" / "lessons.md").read_text()
    rows = re.findall(r"^\| `(\w+)` \|.*\| (\d+) \|[^|]*\|$", index, re.MULTILINE)
    assert rows == [(source.stem, str(minutes(source))) for source in LESSONS]
    pages = re.findall(r"^\[\d+\]: lessons/(\w+)\.html$", index, re.MULTILINE)
    assert pages == [source.stem for source in LESSONS]


def minutes(source: Path) -> int:
    found = re.search(r"Time: (\d+) minutes", source.read_text())
    assert found is not None
    return int(found[1])
