"""Descriptions of random paths, such as `10`, `time=7.5,vars=(x,y)` or `deadlock,repeat=100`, taken
apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from symcheck.errors import UsageError
from symcheck.simulate.path import Layout

__all__ = ["Request", "parse_request"]

_SEPARATORS = {"space": " ", "comma": ",", "tab": "\t"}
_OPTIONS = "vars=(x,…), sep=space|comma|tab, rewards=, probs=, changes=, loopcheck= (true or false), snapshot=TIME, repeat=N"


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A description of a path, such as `10`, `time=7.5` or `deadlock,repeat=100`, taken apart."""

    steps: int | None = None
    time: float | None = None
    deadlock: bool = False
    loop_check: bool = True
    repeat: int = 1
    layout: Layout = field(default_factory=Layout)


def parse_request(text: str) -> Request:
    """Read the first argument of -simpath. Raises UsageError."""
    request, changes = Request(), None
    for item in _items(text):
        name, equals, value = (x.strip() for x in item.partition("="))
        match name:
            case "deadlock" if not equals:
                request = replace(request, deadlock=True)
            case "time":
                request = replace(request, time=_number(item, value))
            case "repeat":
                request = replace(request, repeat=int(_number(item, value)))
            case "loopcheck":
                request = replace(request, loop_check=_flag(item, value))
            case "changes":
                changes = _flag(item, value)
            case _ if not equals and name.isdigit():
                request = replace(request, steps=int(name))
            case _:
                request = replace(request, layout=_layout(request.layout, item, name, value))
    if sum((request.steps is not None, request.time is not None, request.deadlock)) != 1:
        raise UsageError(
            f"-simpath: '{text}' must say how long the path is: a number of steps, time=T or deadlock"
        )
    shown = request.layout.variables is not None if changes is None else changes
    return replace(request, layout=replace(request.layout, changes=shown))


def _layout(layout: Layout, item: str, name: str, value: str) -> Layout:
    match name:
        case "vars":
            return replace(
                layout,
                variables=tuple(v.strip() for v in value.strip("()").split(",") if v.strip()),
            )
        case "sep" if value in _SEPARATORS:
            return replace(layout, separator=_SEPARATORS[value])
        case "rewards":
            return replace(layout, rewards=_flag(item, value))
        case "probs":
            return replace(layout, probabilities=_flag(item, value))
        case "snapshot":
            step = _number(item, value)
            if step == 0:
                raise UsageError("-simpath: snapshot needs a time step above 0")
            return replace(layout, snapshot=step)
        case _:
            raise UsageError(
                f"-simpath: '{item}' is not understood\n  hint: N, time=T or deadlock, and then {_OPTIONS}"
            )


def _items(text: str) -> list[str]:
    """Split at commas outside of parentheses."""
    items, depth = [""], 0
    for character in text:
        depth += (character == "(") - (character == ")")
        if character == "," and depth == 0:
            items.append("")
        else:
            items[-1] += character
    return [i.strip() for i in items]


def _flag(item: str, value: str) -> bool:
    if value not in ("true", "false"):
        raise UsageError(f"-simpath: '{item}' must be true or false")
    return value == "true"


def _number(item: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise UsageError(f"-simpath: '{item}' needs a number, not below 0")
    return number
