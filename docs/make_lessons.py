"""Make the notebooks of the lessons from their sources in `lessons/`.

    .venv/bin/python docs/make_lessons.py                  the notebooks, without results
    .venv/bin/python docs/make_lessons.py build/site       pages with results, into its lessons/

A source is a Python file in jupytext's percent format. A cell with the tag `solution` belongs to
the exercise above it. `notebooks/` has the lessons with an empty cell in place of each solution,
and `notebooks/solutions/` has them with the solutions.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from functools import partial
from itertools import groupby
from pathlib import Path

import jupytext
import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

ROOT = Path(__file__).resolve().parents[1]
SOURCES = sorted((ROOT / "lessons").glob("[0-9]*.py"))
STUDENTS = ROOT / "notebooks"
SOLUTIONS = STUDENTS / "solutions"

ANSWER = "# Your answer"
KERNEL = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}
PAGE = """\
{%- extends "lab/index.html.j2" -%}
{%- block html_head_js -%}{%- endblock -%}
{%- block html_head_js_mathjax -%}{%- endblock -%}
{%- block html_head_js_mermaidjs -%}{%- endblock -%}
{%- block body_header -%}
{{ super() }}<a style="font: 1rem sans-serif; margin: 5rem" href="index.html">All lessons</a>
{%- endblock -%}
{%- block any_cell -%}
{%- if cell.metadata.first -%}
<details><summary style="font: 1rem sans-serif; padding: 0.5rem 5rem">Solution</summary>
{%- endif -%}
{{ super() }}
{%- if cell.metadata.last -%}</details>{%- endif -%}
{%- endblock -%}
"""


def student(source: Path) -> NotebookNode:
    """The lesson with an empty cell in place of each run of cells with a solution."""
    return _notebook(
        cell
        for solved, run in groupby(_cells(source.read_text()), _is_solution)
        for cell in ([new_code_cell(ANSWER)] if solved else run)
    )


def solutions(source: Path) -> NotebookNode:
    """The whole lesson. It stands one folder deeper, which its relative paths say."""
    text = source.read_text().replace('"../', '"../../')
    return _notebook(_cells(text))


def text_of(notebook: NotebookNode) -> str:
    """The file of a notebook."""
    return str(nbformat.writes(notebook)) + "\n"


def page(notebook: NotebookNode, title: str) -> str:
    """The HTML page of a notebook with its results; solutions are folded.

    It loads nothing from elsewhere: formulas are MathML.
    """
    from jinja2 import DictLoader
    from nbconvert import HTMLExporter

    for solved, run in groupby(notebook.cells, _is_solution):
        cells = list(run)
        cells[0].metadata.first = cells[-1].metadata.last = solved
    exporter = HTMLExporter(extra_loaders=[DictLoader({"page": PAGE})], template_file="page")
    exporter.register_filter("markdown2html", _html)
    text, _ = exporter.from_notebook_node(notebook, {"metadata": {"name": title}})
    return str(text)


def executed(notebook: NotebookNode) -> NotebookNode:
    """The notebook of the solutions with what its cells give.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell fails that is not expected to.
    """
    from nbclient import NotebookClient

    resources = {"metadata": {"path": str(SOLUTIONS)}}
    return NotebookClient(notebook, timeout=600, resources=resources).execute()


def write_notebooks() -> None:
    """Both notebooks of every lesson."""
    SOLUTIONS.mkdir(exist_ok=True)
    for source in SOURCES:
        name = source.with_suffix(".ipynb").name
        (STUDENTS / name).write_text(text_of(student(source)))
        (SOLUTIONS / name).write_text(text_of(solutions(source)))


def write_pages(site: Path) -> None:
    """The page of every lesson, in the folder `lessons` of the site."""
    for source in SOURCES:
        text = page(executed(solutions(source)), _title(source))
        (site / "lessons" / source.with_suffix(".html").name).write_text(text)


def _cells(text: str) -> list[NotebookNode]:
    """The cells of a source, in order."""
    read = jupytext.reads(text, fmt="py:percent").cells
    return [
        (new_code_cell if cell.cell_type == "code" else new_markdown_cell)(
            _uncommented(cell.source), metadata=cell.metadata
        )
        for cell in read
    ]


def _uncommented(source: str) -> str:
    """A cell such as `%%prism`, whose lines are comments in the source as they are no Python."""
    return re.sub("^# ?", "", source, flags=re.MULTILINE) if source.startswith("%%") else source


def _is_solution(cell: NotebookNode) -> bool:
    return "solution" in cell.metadata.get("tags", ())


def _notebook(cells: Iterator[NotebookNode] | list[NotebookNode]) -> NotebookNode:
    """The notebook of these cells, whose ids tell their places."""
    made = new_notebook(cells=list(cells), metadata=KERNEL)
    for number, cell in enumerate(made.cells):
        cell.id = f"cell-{number}"
    return made


def _title(source: Path) -> str:
    found = re.search(r"^# # (.*)$", source.read_text(), re.MULTILINE)
    assert found is not None
    return found[1]


def _html(source: str) -> str:
    """Markdown as HTML, and its formulas as MathML."""
    from latex2mathml.converter import convert
    from nbconvert.filters.markdown_mistune import IPythonRenderer, MarkdownWithMath

    renderer = IPythonRenderer(escape=False)
    renderer.inline_math, renderer.block_math = convert, partial(convert, display="block")
    return str(MarkdownWithMath(renderer=renderer).render(source))


if __name__ == "__main__":
    if sys.argv[1:]:
        write_pages(Path(sys.argv[1]))
    else:
        write_notebooks()
