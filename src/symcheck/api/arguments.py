"""What users give: options as keywords, the name of a model type, properties as text or file."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import fields
from inspect import Parameter, signature
from os.path import isfile
from pathlib import Path
from typing import Literal, TypeVar

from symcheck.errors import UsageError
from symcheck.options import Options
from symcheck.semantics.diagnostics import suggest
from symcheck.syntax.ast import ModelType
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import parse_properties, parse_properties_file

__all__ = [
    "ModelTypeName",
    "is_file",
    "model_type",
    "properties_file",
    "single_property",
    "takes_options",
]

F = TypeVar("F", bound=Callable[..., object])
ModelTypeName = Literal["dtmc", "ctmc", "mdp"]


def takes_options(function: F) -> F:
    """A decorator: `help` and completion show the options as keyword parameters."""
    declared = signature(function)
    kept = [p for p in declared.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
    options = [
        Parameter(f.name, Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type)
        for f in fields(Options)
    ]
    function.__signature__ = declared.replace(parameters=[*kept, *options])  # type: ignore[attr-defined]
    return function


def model_type(given: ModelType | str | None) -> ModelType | None:
    """The model type of a name such as "mdp". Raises UsageError."""
    try:
        return given if given is None or isinstance(given, ModelType) else ModelType(given)
    except ValueError:
        names = [t.value for t in ModelType]
        message = f"type={given!r}: expected one of {', '.join(names)}"
        raise UsageError(message, hint=suggest(str(given), names)) from None


def is_file(text: str | Path) -> bool:
    """Whether it is a file and no text: there is one, or it looks like the name of one.

    A name without a dot is a text: a file beside a model may have the name of a variable.
    """
    return (
        isinstance(text, Path)
        or ("." in text and isfile(text))
        or re.fullmatch(r"[^\s\[\]()\"=<>?;]+\.[A-Za-z]\w*", text) is not None
    )


def properties_file(properties: str | Path | PropertiesFile) -> PropertiesFile:
    """A file (a Path, or its name), a text, or parsed ones. Raises UsageError, SyntaxFault."""
    match properties:
        case PropertiesFile():
            return properties
        case str() | Path() if is_file(properties):
            return parse_properties_file(properties)
        case str():
            return parse_properties(properties)
        case _:
            raise UsageError(
                f"properties are a text or a file, not {properties!r}",
                hint='a text has several, with ; between them: "six": P=? [ F d=6 ]; x=1',
            )


def single_property(formula: str) -> PropertiesFile:
    """A text with one property, parsed. Raises UsageError, SyntaxFault."""
    if not isinstance(formula, str):
        raise UsageError(
            f"a property is a text such as 'P=? [ F x=1 ]', not {formula!r}",
            hint="check_all takes a file, or a text with several properties",
        )
    if is_file(formula):
        raise UsageError(
            "one property is expected here, not a file", hint=f"check_all({formula!r})"
        )
    file = parse_properties(formula)
    if len(file.properties) != 1:
        raise UsageError(
            f"one property is expected here, not {len(file.properties)}; check_all takes several"
        )
    return file
