"""Hints and notes are fields of an error, which are printed below its message."""

from __future__ import annotations

import ast
import pickle
from pathlib import Path

import pytest

import symcheck
from symcheck.errors import ResourceError, SymcheckError, UnsupportedError, UsageError

SOURCE = Path(symcheck.__file__).parent

BEFORE_IMPORTS = {"cli/__init__.py"}
"""A process that has no memory for its imports ends without the class of an error."""


def test_a_hint_is_a_field() -> None:
    error = UnsupportedError("the value is too large", hint="use -exact")
    assert (error.message, error.hint, error.note) == ("the value is too large", "use -exact", None)
    assert str(error) == "the value is too large\n  hint: use -exact"


def test_a_note_comes_before_the_hint() -> None:
    error = ResourceError("the search was stopped", hint="bound x", note="x grows")
    assert str(error) == "the search was stopped\n  note: x grows\n  hint: bound x"


def test_an_error_without_hint_is_its_message() -> None:
    assert str(SymcheckError("no", hint=None)) == str(SymcheckError("no", hint="")) == "no"


def test_another_process_sees_the_hint() -> None:
    error = pickle.loads(pickle.dumps(UsageError("no", hint="yes", note="perhaps")))
    assert (error.message, error.hint, error.note) == ("no", "yes", "perhaps")


def test_a_wrong_argument_has_its_hint_in_the_field() -> None:
    with pytest.raises(UsageError) as caught:
        symcheck.load("dtmc module m endmodule")
    assert caught.value.hint == "symcheck.loads takes a text"
    assert "hint" not in caught.value.message


def test_no_message_contains_its_hint() -> None:
    places = [
        f"{path.relative_to(SOURCE)}:{node.lineno}"
        for path in SOURCE.rglob("*.py")
        if path.relative_to(SOURCE).as_posix() not in BEFORE_IMPORTS
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and ("\n  hint: " in node.value or "\n  note: " in node.value)
    ]
    # The command line adds how many results are finished.
    assert [place.split(":")[0] for place in places] == ["cli/output.py"]
