"""Exports of a model: parse `-exportmodel FILES[:options]` and single switches, write the files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TextIO

import numpy as np

from symcheck.errors import UnsupportedError, UsageError
from symcheck.exchange import components
from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.formats import combined_file, dot, drn, matlab, prism_writer, umb_writer
from symcheck.exchange.text import FULL_PRECISION, write_text
from symcheck.whole_file import uncompressed_name

__all__ = [
    "EXTENSIONS",
    "ExportOptions",
    "Target",
    "check_no_options",
    "export",
    "file_options",
    "parse_target",
]

EXTENSIONS = ("tra", "sta", "lab", "srew", "trew", "pexp", "dot", "drn", "umb", "umbt", "jani")
_ALL = ("tra", "sta", "lab", "srew", "trew")
_SWITCHES = ("actions", "headers", "states", "proplabels", "rows", "rewards", "labels", "matlab")
_WHOLE = ("pexp", "dot", "drn", "umb", "umbt", "jani")
_FORMATS = ("explicit", "matlab", *_WHOLE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Options of an export.

    Attributes:
        precision: significant digits.
        actions: write action names.
        headers: write header comments; None: those that a reader needs.
        rows: write one line per row of a matrix.
        states: show the values of states in the nodes of a graph.
        proplabels: write the labels of the properties file too.
        rewards, labels: include them in a file of the whole model.
        matlab: write matrices, rewards, states and labels for Matlab.
    """

    precision: int = FULL_PRECISION
    actions: bool = True
    headers: bool | None = None
    rows: bool = False
    states: bool = True
    proplabels: bool = False
    rewards: bool = True
    labels: bool = True
    matlab: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """A part of the model, and its file.

    Attributes:
        kind: an extension, 'proplab' (only labels of the properties file), or one of
            `components.KINDS`.
        path: the file, or 'stdout'.
        options: the options of this export.
    """

    kind: str
    path: str
    options: ExportOptions = field(default_factory=ExportOptions)


def parse_target(argument: str, model: str, options: ExportOptions | None = None) -> list[Target]:
    """Parse an argument such as `out.tra,sta:actions=false`.

    Args:
        argument: files and options.
        model: the base name of files that the argument does not name.
        options: the options that the argument changes.

    Raises:
        UsageError: an extension or an option is unknown.
    """
    names, options, layout = _options(argument, options or ExportOptions())
    plain, packed = uncompressed_name(names)
    base, dotted, listed = plain.rpartition(".")
    if layout == "jani" or "jani" in listed.split(","):
        check_no_options(argument, names)
    if layout in _WHOLE:
        return [Target(layout, names, options)]
    if listed == "m":
        options = replace(options, matlab=True)
    if options.matlab and (
        not dotted or (listed not in (*EXTENSIONS, "all", "rew") and "," not in listed)
    ):
        return [Target("tra", names, options)]
    known = f"known are .{', .'.join((*EXTENSIONS, 'rew', 'all'))}"
    if not dotted:
        raise UsageError(f"'{argument}' has no extension that names a format", hint=known)
    kinds: list[str] = []
    for kind in listed.split(","):
        if kind not in (*EXTENSIONS, "all", "rew"):
            raise UsageError(f"unknown extension '.{kind}'", hint=known)
        kinds += {"all": _ALL, "rew": ("srew", "trew")}.get(kind, (kind,))
    base = base or str(Path(model).with_suffix(""))
    dropped = {"srew", "trew"} if not options.rewards else set()
    dropped |= {"lab"} if not options.labels else set()
    return [
        Target(k, "stdout" if base == "stdout" else f"{base}.{k}{packed}", options)
        for k in dict.fromkeys(kinds)
        if k not in dropped
    ]


def file_options(argument: str, options: ExportOptions) -> tuple[str, ExportOptions]:
    """Parse `FILE[:options]` of a switch that writes one file. Raises UsageError."""
    return _options(argument, options)[:2]


def check_no_options(argument: str, names: str) -> None:
    """Raise UsageError if an argument for a JANI file has options; `names` is it without them."""
    for option in argument.removeprefix(names).lstrip(":").split(","):
        if option and not option.startswith("format="):
            raise UsageError(f"'{option}' is no option of a JANI file: it has none")


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
        else:
            known = ", ".join(
                (
                    *(f"{s}=true|false" for s in _SWITCHES),
                    f"format={'|'.join(_FORMATS)}",
                    "precision=N",
                    "text",
                )
            )
            raise UsageError(f"unknown option '{option}'", hint=f"known are {known}")
    return names, options, layout


def export(model: ExplicitExport, targets: Sequence[Target], out: TextIO) -> Iterator[str]:
    """Write the targets in turn, and yield the name of each complete file.

    Raises:
        UsageError: a file cannot be written.
        UnsupportedError: a format cannot hold the model.
    """
    whole = model
    for target in targets:
        model = whole if target.options.actions else whole.without_actions()
        if np.iscomplexobj(model.values) and not _holds_intervals(target):
            kind = "Matlab" if target.options.matlab else f".{target.kind}"
            hint = ".tra, .pexp, .drn and .dot files, without Matlab, hold them"
            raise UnsupportedError(f"{kind} files cannot hold intervals", hint=hint)
        _check_held(model, target.kind)
        if target.kind == "umb":
            if target.path == "stdout":
                raise UsageError("a UMB file is binary and cannot go to the standard output")
            if uncompressed_name(target.path)[1]:
                raise UsageError("a UMB file is compressed already: write it without .gz or .xz")
            umb_writer.write_umb(_part(model, target.options), target.path)
            yield target.path
            continue
        for path, chunks in _texts(model, target):
            write_text(path, chunks, out)
            yield path


def _holds_intervals(target: Target) -> bool:
    """Whether a format has intervals, or no probabilities at all."""
    kinds = ("sta", "lab", "proplab", "srew", *components.KINDS)
    written = () if target.options.matlab else ("tra", "trew", "pexp", "drn", "dot")
    return target.kind in (*kinds, *written)


def _check_held(model: ExplicitExport, kind: str) -> None:
    """Refuse a format that does not tell rates and probabilities of a Markov automaton apart, or
    that would hold a model without its observations.
    """
    parts = ("sta", "lab", "proplab", "srew", *components.KINDS)
    lost = ""
    if model.timed is not None and kind not in ("drn", *parts):
        lost = "Markov automata"
    if model.observations is not None and kind in ("pexp", "umb", "umbt"):
        lost = "observations"
    if lost:
        raise UnsupportedError(f"files of the kind {kind} cannot hold {lost}", hint="DRN files can")


def _part(model: ExplicitExport, options: ExportOptions) -> ExplicitExport:
    """The model with the rewards and labels that the options include."""
    kept = {
        name: members for name, members in model.labels.items() if name in _shown(model, options)
    }
    return replace(model, rewards=model.rewards if options.rewards else [], labels=kept)


def _shown(model: ExplicitExport, options: ExportOptions) -> list[str]:
    """The names of the labels that the options include."""
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
                    model, precision=o.precision, rows=o.rows, headers=o.headers
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
        case "pexp":
            text = combined_file.combined_file(
                model, _shown(model, o), precision=o.precision, rewards=o.rewards
            )
            yield path, text
        case "umbt":
            yield path, umb_writer.umb_text(_part(model, o))
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
            model, model.rewards[number], precision=o.precision, headers=o.headers is not False
        )
    if o.matlab:
        return matlab.transition_rewards(model, number, precision=o.precision)
    return prism_writer.transition_rewards_file(
        model, number, precision=o.precision, headers=o.headers is not False, rows=o.rows
    )


def _each(
    model: ExplicitExport, path: str, text: Callable[[int], Iterable[str]]
) -> Iterator[tuple[str, Iterable[str]]]:
    """One file per reward structure, numbered from 1 if there are several."""
    several = len(model.rewards) > 1 and path != "stdout"
    name, packed = uncompressed_name(path)
    whole = Path(name)
    for i in range(len(model.rewards)):
        yield (
            (
                str(whole.with_name(f"{whole.stem}{i + 1}{whole.suffix}{packed}"))
                if several
                else path
            ),
            text(i),
        )
