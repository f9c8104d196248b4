"""Paths as text, in the layout that PRISM's -simpath writes and other tools read.

One line per state: the transition that led there, its probability or rate (probs), the number of the step, the time
(in a CTMC), the values of the variables, and the rewards (rewards): per structure, of the state and of the transition.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from symcheck.errors import UsageError
from symcheck.semantics.literals import format_value
from symcheck.simulate.path import Path, Step
from symcheck.syntax.ast import ModelType

__all__ = ["Layout", "Request", "parse_request", "rows", "table"]

_SEPARATORS = {"space": " ", "comma": ",", "tab": "\t"}
_OPTIONS = "vars=(x,…), sep=space|comma|tab, rewards=, probs=, changes=, loopcheck= (true or false), snapshot=TIME, repeat=N"


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What a table shows. `variables` None: all; `changes`: only states in which one of them (or a reward) is new."""

    variables: tuple[str, ...] | None = None
    separator: str = " "
    rewards: bool = False
    probabilities: bool = False
    changes: bool = False
    snapshot: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A description of a path, such as `10`, `time=7.5` or `deadlock,repeat=100`, taken apart."""

    steps: int | None = None
    time: float | None = None
    deadlock: bool = False
    loop_check: bool = True
    repeat: int = 1
    layout: Layout = Layout()


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
        raise UsageError(f"-simpath: '{text}' must say how long the path is: a number of steps, time=T or deadlock")
    shown = request.layout.variables is not None if changes is None else changes
    return replace(request, layout=replace(request.layout, changes=shown))


def _layout(layout: Layout, item: str, name: str, value: str) -> Layout:
    match name:
        case "vars":
            return replace(layout, variables=tuple(v.strip() for v in value.strip("()").split(",") if v.strip()))
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
            raise UsageError(f"-simpath: '{item}' is not understood\n  hint: N, time=T or deadlock, and then {_OPTIONS}")


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


def table(path: Path, layout: Layout | None = None) -> str:
    """The path as text: a line of titles, then a line per state. Raises NameFault for an unknown variable."""
    layout = layout or Layout()
    return "\n".join(layout.separator.join(row) for row in rows(path, layout)) + "\n"


def rows(path: Path, layout: Layout | None = None) -> list[list[str]]:
    """The cells of the table, titles first."""
    layout = layout or Layout()
    names = path.variables if layout.variables is None else layout.variables
    for name in names:
        path.values(name)  # complains about an unknown one
    chosen = [path.variables.index(n) for n in names]
    timed = path.model.type is ModelType.CTMC
    snapshot = layout.snapshot is not None
    titles = [] if snapshot else ["action", *(["probability"] if layout.probabilities else [])]
    titles += ["step", *(["time"] if timed else []), *names, *(_reward_titles(len(path.model.rewards)) if layout.rewards else [])]
    found, last = [titles], None
    for number, time, step in _shown(path, layout):
        cells = [format_value(step.state[i]) for i in chosen]
        if layout.rewards:
            cells += [repr(x) for pair in _rewards(step, len(path.model.rewards)) for x in pair]
        if layout.changes and cells == last:
            continue
        last = cells
        lead = [] if snapshot else [step.transition, *([_probability(step)] if layout.probabilities else [])]
        found.append([*lead, str(number), *([repr(time)] if timed else []), *cells])
    return found


def _shown(path: Path, layout: Layout) -> Iterator[tuple[int, float, Step]]:
    """Number, time and step of the lines: all steps, or who is there at the multiples of the snapshot's time."""
    if layout.snapshot is None:
        yield from ((i, s.time, s) for i, s in enumerate(path.steps))
        return
    tick = 0
    for number, (step, following) in enumerate(zip(path.steps, [*path.steps[1:], None], strict=True)):
        while tick * layout.snapshot < following.time if following else tick * layout.snapshot <= step.time:
            yield number, tick * layout.snapshot, step
            tick += 1


def _reward_titles(count: int) -> Sequence[str]:
    return [f"{kind}_reward{i + 1}" for i in range(count) for kind in ("state", "transition")]


def _rewards(step: Step, count: int) -> list[tuple[float, float]]:
    return list(zip(step.rewards, step.earned or (0.0,) * count, strict=True))


def _probability(step: Step) -> str:
    return "-" if step.probability is None else repr(step.probability)
