"""Which files an export is asked to write, and writing them: `-exportmodel FILES[:options]` and the single switches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TextIO

from symcheck.errors import UsageError
from symcheck.exchange import dot, drn, prism, umb
from symcheck.exchange.snapshot import Snapshot
from symcheck.exchange.text import FULL_PRECISION, write_text

__all__ = ["EXTENSIONS", "ExportOptions", "Target", "export", "parse_target"]

EXTENSIONS = ("tra", "sta", "lab", "srew", "trew", "dot", "drn", "umb")
_ALL = ("tra", "sta", "lab", "srew", "trew")
_SWITCHES = ("actions", "headers", "states", "proplabels", "rows")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """precision: significant digits. actions, headers: whether they are written. rows: matrices with a line per row.
    states: nodes of a graph show their values. proplabels: the labels of the properties file are written as well.
    """

    precision: int = FULL_PRECISION
    actions: bool = True
    headers: bool = True
    rows: bool = False
    states: bool = True
    proplabels: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """One part of the model (`kind`: an extension), and the file it goes to ('stdout': the standard output).

    only: the numbers of reward structures, None for all.
    """

    kind: str
    path: str
    options: ExportOptions = field(default_factory=ExportOptions)


def parse_target(argument: str, model: str, options: ExportOptions | None = None) -> list[Target]:
    """`out.tra,sta:actions=false` and the like, taken apart; `model` is the name where none is given. Raises UsageError."""
    names, options = _options(argument, options or ExportOptions())
    base, dotted, listed = names.rpartition(".")
    known = f"\n  hint: known are .{', .'.join((*EXTENSIONS, 'rew', 'all'))}"
    if not dotted:
        raise UsageError(f"-exportmodel: '{argument}' has no ending that tells what to write{known}")
    kinds: list[str] = []
    for kind in listed.split(","):
        if kind not in (*EXTENSIONS, "all", "rew"):
            raise UsageError(f"-exportmodel: unknown ending '.{kind}'{known}")
        kinds += {"all": _ALL, "rew": ("srew", "trew")}.get(kind, (kind,))
    base = base or str(Path(model).with_suffix(""))
    return [Target(k, "stdout" if base == "stdout" else f"{base}.{k}", options) for k in dict.fromkeys(kinds)]


def _options(argument: str, options: ExportOptions) -> tuple[str, ExportOptions]:
    names, colon, listed = argument.rpartition(":")
    if not colon or "/" in listed or "\\" in listed:
        return argument, options
    for option in listed.split(","):
        name, _, value = option.partition("=")
        if name in _SWITCHES and value in ("", "true", "false"):
            options = replace(options, **{name: value != "false"})
        elif name == "precision" and value.isdigit() and int(value) > 0:
            options = replace(options, precision=int(value))
        elif name == "text":
            options = replace(options, rows=False)
        else:
            known = ", ".join((*(f"{s}=true|false" for s in _SWITCHES), "precision=N", "text"))
            raise UsageError(f"-exportmodel: unknown option '{option}'\n  hint: known are {known}")
    return names, options


def export(model: Snapshot, targets: Sequence[Target], out: TextIO) -> Iterator[str]:
    """Write the targets, one after the other; gives the name of each file that is complete. Raises UsageError."""
    for target in targets:
        if target.kind == "umb":
            if target.path == "stdout":
                raise UsageError("a UMB file is not text: give it a name")
            umb.write_umb(model, target.path)
            yield target.path
            continue
        for path, chunks in _texts(model, target):
            write_text(path, chunks, out)
            yield path


def _texts(model: Snapshot, target: Target) -> Iterator[tuple[str, Iterable[str]]]:
    o = target.options
    match target.kind:
        case "tra":
            yield target.path, prism.transitions_file(model, precision=o.precision, actions=o.actions, rows=o.rows)
        case "sta":
            yield target.path, prism.states_file(model)
        case "lab":
            yield target.path, prism.labels_file(model)
        case "dot":
            yield target.path, dot.dot_file(model, states=o.states, precision=o.precision)
        case "drn":
            yield target.path, drn.drn_file(model, precision=o.precision)
        case "srew":
            yield from _each(
                model, target.path, lambda i: prism.state_rewards_file(model, model.rewards[i], precision=o.precision, headers=o.headers)
            )
        case "trew":
            yield from _each(
                model,
                target.path,
                lambda i: prism.transition_rewards_file(model, model.rewards[i], precision=o.precision, headers=o.headers, rows=o.rows),
            )
        case _:
            raise UsageError(f"there is no format '.{target.kind}'")


def _each(model: Snapshot, path: str, text: Callable[[int], Iterable[str]]) -> Iterator[tuple[str, Iterable[str]]]:
    """A file per reward structure; numbered from 1 where there are several."""
    several = len(model.rewards) > 1 and path != "stdout"
    whole = Path(path)
    for i in range(len(model.rewards)):
        yield (str(whole.with_name(f"{whole.stem}{i + 1}{whole.suffix}")) if several else path), text(i)
