"""Model types answer questions: code does not compare them with names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import symcheck
from symcheck.syntax.ast import ModelType

SOURCES = Path(symcheck.__file__).parent
NAMES = re.compile(r"\bModelType\.[A-Z]+\b|\bis_(dtmc|ctmc|mdp)\b")


def test_few_lines_name_a_type() -> None:
    named = [
        (path.name, line)
        for path in SOURCES.rglob("*.py*")
        if path.suffix in (".py", ".pyx", ".pxi")
        for line in path.read_text(encoding="utf-8").splitlines()
        if NAMES.search(line)
    ]
    assert 0 < len(named) <= 20
    assert len({file for file, _ in named}) <= 8


@pytest.mark.parametrize(
    ("keyword", "continuous", "choices", "uniform"),
    [("dtmc", False, False, True), ("ctmc", True, False, False), ("mdp", False, True, False)],
)
def test_properties_of_the_types(
    keyword: str, continuous: bool, choices: bool, uniform: bool
) -> None:
    kind = ModelType(keyword)
    assert (kind.continuous_time, kind.has_choices) == (continuous, choices)
    assert kind.chooses_uniformly is uniform
    found = ModelType.with_properties(continuous_time=continuous, has_choices=choices)
    assert found is kind


def test_no_type_has_clocks_and_rates() -> None:
    with pytest.raises(LookupError, match="no type of models has these properties"):
        ModelType.with_properties(continuous_time=True, has_clocks=True)


def test_a_type_with_choices_in_continuous_time() -> None:
    found = ModelType.with_properties(continuous_time=True, has_choices=True)
    assert (found.value, found.players, found.has_own_syntax) == ("ma", 1, True)
