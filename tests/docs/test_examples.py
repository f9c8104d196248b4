"""The examples in docstrings run and print what they show."""

from __future__ import annotations

import doctest
from importlib import import_module
from pathlib import Path

import pytest

MODULES = (
    "symcheck.api",
    "symcheck.check.result",
    "symcheck.dd.cudd.extension",
    "symcheck.dd.manager",
    "symcheck.engines.states",
    "symcheck.engines.transition_table",
    "symcheck.exchange.python.from_function",
    "symcheck.exchange.python.from_matrix",
    "symcheck.explicit.build",
    "symcheck.simulate.stepper",
    "symcheck.symbolic.build",
    "symcheck.symbolic.reachability.search",
)


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
