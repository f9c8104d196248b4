"""Which files an export is asked to write, and writing them: `-exportmodel FILES[:options]` and the single switches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TextIO

from symcheck.errors import UsageError
from symcheck.exchange import components
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.formats import dot, drn, matlab, prism_writer, umb_writer
from symcheck.exchange.text import FULL_PRECISION, write_text

__all__ = ["EXTENSIONS", "ExportOptions", "Target", "export", "file_options", "parse_target"]

EXTENSIONS = ("tra", "sta", "lab", "srew", "trew", "dot", "drn", "umb")
_ALL = ("tra", "sta", "lab", "srew", "trew")
_SWITCHES = ("actions", "headers", "states", "proplabels", "rows", "rewards", "labels", "matlab")
_IGNORED = ("obs", "zip")
_FORMATS = ("explicit", "matlab", "dot", "drn", "umb")


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """precision: significant digits. actions, headers: whether they are written. rows: matrices with a line per row.
    states: nodes of a graph show their values. proplabels: the labels of the properties file are written as well.
    rewards, labels: whether a file of the whole model has them. matlab: matrices, rewards, states and labels for Matlab.
    """

    precision: int = FULL_PRECISION
    actions: bool = True
    headers: bool = True
    rows: bool = False
    states: bool = True
    proplabels: bool = False
    rewards: bool = True
    labels: bool = True
    matlab: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """One part of the model, and the file it goes to ('stdout': the standard output).

    kind: an extension, 'proplab' (the labels of the properties file alone), or one of `components.KINDS`.
    """

    kind: str
    path: str
    options: ExportOptions = field(default_factory=ExportOptions)


def parse_target(argument: str, model: str, options: ExportOptions | None = None) -> list[Target]:
    """`out.tra,sta:actions=false` and the like, taken apart; `model` is the name where none is given. Raises UsageError."""
    names, options, layout = _options(argument, options or ExportOptions())
    base, dotted, listed = names.rpartition(".")
    if layout in ("dot", "drn", "umb"):
        return [Target(layout, names, options)]
    if listed == "m":
        options = replace(options, matlab=True)
    if options.matlab and (
        not dotted or (listed not in (*EXTENSIONS, "all", "rew") and "," not in listed)
    ):
        return [Target("tra", names, options)]
    known = f"\n  hint: known are .{', .'.join((*EXTENSIONS, 'rew', 'all'))}"
    if not dotted:
        raise UsageError(
            f"-exportmodel: '{argument}' has no ending that tells what to write{known}"
        )
    kinds: list[str] = []
    for kind in listed.split(","):
        if kind not in (*EXTENSIONS, "all", "rew"):
            raise UsageError(f"-exportmodel: unknown ending '.{kind}'{known}")
        kinds += {"all": _ALL, "rew": ("srew", "trew")}.get(kind, (kind,))
    base = base or str(Path(model).with_suffix(""))
    dropped = {"srew", "trew"} if not options.rewards else set()
    dropped |= {"lab"} if not options.labels else set()
    return [
        Target(k, "stdout" if base == "stdout" else f"{base}.{k}", options)
        for k in dict.fromkeys(kinds)
        if k not in dropped
    ]


def file_options(argument: str, options: ExportOptions) -> tuple[str, ExportOptions]:
    """`FILE[:options]` of a switch that writes one file. Raises UsageError for unknown options."""
    return _options(argument, options)[:2]


def _options(argument: str, options: ExportOptions) -> tuple[str, ExportOptions, str]:
    names, colon, listed = argument.rpartition(":")
    layout = "explicit"
    if not colon or "/" in listed or "\\" in listed:
        return argument, options, layout
    for option in listed.split(","):
        name, _, value = option.partition("=")
        if name in _SWITCHES and value in ("", "true", "false"):
            options = replace(options, **{name: value != "false"})
        elif name == "precision" and value.isdigit() and int(value) > 0:
            options = replace(options, precision=int(value))
        elif name == "format" and value in _FORMATS:
            options, layout = replace(options, matlab=value == "matlab"), value
        elif name == "text":
            options = replace(options, rows=False)
        elif name not in _IGNORED:
            known = ", ".join(
                (
                    *(f"{s}=true|false" for s in _SWITCHES),
                    f"format={'|'.join(_FORMATS)}",
                    "precision=N",
                    "text",
                )
            )
            raise UsageError(f"-exportmodel: unknown option '{option}'\n  hint: known are {known}")
    return names, options, layout


def export(model: ExplicitExport, targets: Sequence[Target], out: TextIO) -> Iterator[str]:
    """Write the targets, one after the other; gives the name of each file that is complete. Raises UsageError, UnsupportedError."""
    for target in targets:
        if target.kind == "umb":
            if target.path == "stdout":
                raise UsageError("a UMB file is not text: give it a name")
            umb_writer.write_umb(_part(model, target.options), target.path)
            yield target.path
            continue
        for path, chunks in _texts(model, target):
            write_text(path, chunks, out)
            yield path


def _part(model: ExplicitExport, options: ExportOptions) -> ExplicitExport:
    """The model as a file of the whole of it is to have it."""
    kept = {
        name: members for name, members in model.labels.items() if name in _shown(model, options)
    }
    return replace(model, rewards=model.rewards if options.rewards else [], labels=kept)


def _shown(model: ExplicitExport, options: ExportOptions) -> list[str]:
    """The names of the labels that are to be written."""
    if not options.labels:
        return ["init"]
    return [
        name for name in model.labels if options.proplabels or name not in model.property_labels
    ]


def _texts(model: ExplicitExport, target: Target) -> Iterator[tuple[str, Iterable[str]]]:
    o, path = target.options, target.path
    match target.kind:
        case "tra" if o.matlab:
            yield path, matlab.transitions(model, precision=o.precision)
        case "tra":
            yield (
                path,
                prism_writer.transitions_file(
                    model, precision=o.precision, actions=o.actions, rows=o.rows, headers=o.headers
                ),
            )
        case "sta":
            yield path, matlab.states(model) if o.matlab else prism_writer.states_file(model)
        case "lab" | "proplab":
            names = (
                _shown(model, o)
                if target.kind == "lab"
                else [name for name in model.labels if name in model.property_labels]
            )
            yield (
                path,
                matlab.labels(model, names) if o.matlab else prism_writer.labels_file(model, names),
            )
        case "dot":
            yield path, dot.dot_file(model, states=o.states, precision=o.precision)
        case "drn":
            yield path, drn.drn_file(_part(model, o), precision=o.precision)
        case "srew" | "trew":
            yield from _each(model, path, lambda i: _rewards(model, target.kind, i, o))
        case kind if kind in components.KINDS:
            yield path, components.components_file(model, kind)
        case _:
            raise UsageError(f"there is no format '.{target.kind}'")


def _rewards(model: ExplicitExport, kind: str, number: int, o: ExportOptions) -> Iterable[str]:
    if kind == "srew":
        if o.matlab:
            return matlab.state_rewards(model, number, precision=o.precision)
        return prism_writer.state_rewards_file(
            model, model.rewards[number], precision=o.precision, headers=o.headers
        )
    if o.matlab:
        return matlab.transition_rewards(model, number, precision=o.precision)
    return prism_writer.transition_rewards_file(
        model, number, precision=o.precision, headers=o.headers, rows=o.rows
    )


def _each(
    model: ExplicitExport, path: str, text: Callable[[int], Iterable[str]]
) -> Iterator[tuple[str, Iterable[str]]]:
    """A file per reward structure; numbered from 1 where there are several."""
    several = len(model.rewards) > 1 and path != "stdout"
    whole = Path(path)
    for i in range(len(model.rewards)):
        yield (
            (str(whole.with_name(f"{whole.stem}{i + 1}{whole.suffix}")) if several else path),
            text(i),
        )
