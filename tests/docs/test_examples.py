"""The examples in docstrings run and print what they show."""

from __future__ import annotations

import doctest
import re
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROMPT = re.compile(r"^ *>>> ", re.MULTILINE)
FILES = {
    ".".join(["symcheck", *path.relative_to(ROOT / "src" / "symcheck").with_suffix("").parts]): path
    for path in sorted((ROOT / "src" / "symcheck").rglob("*.py*"))
    if path.suffix in (".py", ".pyx") and PROMPT.search(path.read_text(encoding="utf-8"))
}


def test_modules_with_examples_are_found() -> None:
    assert {"symcheck.api.loading", "symcheck.check.result", "symcheck.simulate.stepper"} <= set(
        FILES
    )


@pytest.mark.parametrize("name", FILES)
def test_examples_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    module = import_module(name.removesuffix(".__init__"))
    found = [t for t in doctest.DocTestFinder(exclude_empty=True).find(module) if t.examples]
    written = len(PROMPT.findall(FILES[name].read_text(encoding="utf-8")))
    assert sum(len(test.examples) for test in found) == written  # none is out of doctest's sight
    output: list[str] = []
    runner = doctest.DocTestRunner(verbose=False)
    for test in found:
        runner.run(test, out=output.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(output)
