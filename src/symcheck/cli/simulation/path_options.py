"""Parser of path options such as `10`, `time=7.5,vars=(x,y)` or `deadlock,repeat=100`."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace

from symcheck.errors import UsageError
from symcheck.simulate.path import PathFormat

__all__ = ["PathOptions", "parse_path_options"]

_COMMA = r",(?![^(]*\))"
"""A comma outside of parentheses."""
_SEPARATORS = {"space": " ", "comma": ",", "tab": "\t"}
_OPTIONS = (
    "vars=(x,…), sep=space|comma|tab, rewards=, probs=, changes=, loopcheck= (true or false), "
    "snapshot=TIME, repeat=N"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathOptions:
    """The options of a path.

    Attributes:
        steps, time, deadlock: when the path ends; exactly one of them is given.
        loop_check: end a path that can only repeat itself.
        repeat: number of attempts to reach a deadlock.
    """

    steps: int | None = None
    time: float | None = None
    deadlock: bool = False
    loop_check: bool = True
    repeat: int = 1
    path_format: PathFormat = field(default_factory=PathFormat)


def parse_path_options(text: str) -> PathOptions:
    """Parse what is asked of a path, such as `time=10,sep=comma`. Raises UsageError."""
    options, changes = PathOptions(), None
    for item in map(str.strip, re.split(_COMMA, text)):
        name, equals, value = (x.strip() for x in item.partition("="))
        match name:
            case "deadlock" if not equals:
                options = replace(options, deadlock=True)
            case "time":
                options = replace(options, time=_number(item, value))
            case "repeat":
                options = replace(options, repeat=int(_number(item, value)))
            case "loopcheck":
                options = replace(options, loop_check=_flag(item, value))
            case "changes":
                changes = _flag(item, value)
            case _ if not equals and name.isdigit():
                options = replace(options, steps=int(name))
            case _:
                options = replace(
                    options, path_format=_format_option(options.path_format, item, name, value)
                )
    if sum((options.steps is not None, options.time is not None, options.deadlock)) != 1:
        raise UsageError(
            f"'{text}' must give the length of the path: a number of steps, time=T or deadlock"
        )
    shown = options.path_format.variables is not None if changes is None else changes
    return replace(options, path_format=replace(options.path_format, changes=shown))


def _format_option(path_format: PathFormat, item: str, name: str, value: str) -> PathFormat:
    match name:
        case "vars":
            return replace(
                path_format,
                variables=tuple(v.strip() for v in value.strip("()").split(",") if v.strip()),
            )
        case "sep" if value in _SEPARATORS:
            return replace(path_format, separator=_SEPARATORS[value])
        case "rewards":
            return replace(path_format, rewards=_flag(item, value))
        case "probs":
            return replace(path_format, probabilities=_flag(item, value))
        case "snapshot":
            step = _number(item, value)
            if step == 0:
                raise UsageError("snapshot needs a time step above 0")
            return replace(path_format, snapshot=step)
        case _:
            raise UsageError(
                f"unknown option '{item}'", hint=f"N, time=T or deadlock, and then {_OPTIONS}"
            )


def _flag(item: str, value: str) -> bool:
    if value not in ("true", "false"):
        raise UsageError(f"'{item}' must be true or false")
    return value == "true"


def _number(item: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise UsageError(f"'{item}' needs a non-negative number")
    return number
