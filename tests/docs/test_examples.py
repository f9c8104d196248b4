"""The examples in docstrings run and print what they show."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import symcheck

SOURCES = Path(symcheck.__file__).parent
MODULES = sorted(
    ".".join(("symcheck", *path.relative_to(SOURCES).with_suffix("").parts))
    for path in (*SOURCES.rglob("*.py"), *SOURCES.rglob("*.pyx"))
    if ">>> " in path.read_text("utf-8")
)


def test_modules_with_examples_are_found() -> None:
    assert len(MODULES) > 12


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[2])
    module = import_module(name)
    examples = [t for t in doctest.DocTestFinder(exclude_empty=True).find(module) if t.examples]
    assert examples
    output: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    for example in examples:
        runner.run(example, out=output.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(output)
