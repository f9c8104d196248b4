"""The library reference, which is made from docstrings."""

from __future__ import annotations

from pathlib import Path

import pytest

from symcheck.options import OPTIONS

griffe = pytest.importorskip("griffe", reason="the extra check is not installed")
ROOT = Path(__file__).parents[2]


def test_options_of_a_function_have_their_sentence_and_default() -> None:
    names = ("unpack_typeddict", str(ROOT / "docs" / "option_parameters.py"))
    extensions = griffe.load_extensions(*names)
    module = griffe.load(
        "symcheck.api.loading",
        search_paths=[ROOT / "src"],
        extensions=extensions,
        docstring_parser="google",
    )
    signature = {p.name: p.default for p in module["load"].parameters}
    (section,) = [s for s in module["load"].docstring.parsed if s.kind.value == "parameters"]
    described = {p.name: (p.value, p.description) for p in section.value}
    for option in OPTIONS:
        assert signature[option.name] == repr(option.default)
        assert described[option.name] == (repr(option.default), option.sentence)
