"""The switches that read models state by state, write models, and compute distributions over states."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from symcheck.check.context import Context
from symcheck.cli.output_paths import NOTHING, Values, own_file
from symcheck.cli.report import Report
from symcheck.constant_values import combinations, parse_constants
from symcheck.engines.base import Engine, StateSet
from symcheck.errors import UnsupportedError, UsageError
from symcheck.options import Options
from symcheck.semantics.expressions.literals import format_state
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression, LabelReference, ModelType
from symcheck.syntax.declarations import Program

__all__ = [
    "MODEL_EXPORTS",
    "export_constants",
    "export_model",
    "export_program",
    "imported",
    "report_distributions",
    "targets",
    "wanted",
]

_IMPORTS = ("importstates", "importlabels", "importstaterewards", "importtransrewards")
_SINGLE = {
    "exporttrans": "tra",
    "exportstates": "sta",
    "exportlabels": "lab",
    "exportproplabels": "proplab",
    "exportstaterewards": "srew",
    "exporttransrewards": "trew",
    "exporttransdot": "dot",
    "exporttransdotstates": "dot",
    "exportsccs": "sccs",
    "exportbsccs": "bsccs",
    "exportmecs": "mecs",
}
MODEL_EXPORTS = (
    *_SINGLE,
    "exportmodel",
    "exportrewards",
    "exportdot",
    "transient",
    "steadystate",
    "exporttransient",
    "exportsteadystate",
)
"""Switches that need the built model."""
_MOST_NODES = 100_000
"""Nodes of a diagram up to which it is drawn."""
_FLAG = ""
"""The value of -exportproplabels without a file: the labels of the properties join those of the model."""


def imported(a: argparse.Namespace) -> Engine | None:
    """The model that the -import switches tell to read, None where there are none. Raises InputError, UsageError."""
    if a.importmodel is None and a.importtrans is None:
        alone = next((s for s in _IMPORTS if getattr(a, s) is not None), None)
        if alone is not None:
            raise UsageError(f"-{alone} needs -importtrans: the transitions are the model")
        return None
    from symcheck.exchange.explicit_data import imported_engine
    from symcheck.exchange.formats.prism_reader import ModelFiles, read_files, read_model

    if a.importmodel is not None and a.importtrans is not None:
        raise UsageError("-importmodel and -importtrans both tell which model to read")
    kind = ModelType(a.model_type) if a.model_type else None
    if a.engine not in (None, "explicit"):
        raise UsageError(
            f"a model that is read state by state is checked by the explicit engine, not by {a.engine}"
        )
    if a.importmodel is not None:
        given = read_files(a.importmodel, kind, check_sums=a.check_sums)
    else:
        states, labels, state_rewards, rewards = (
            Path(x) if x else None for x in (getattr(a, s) for s in _IMPORTS)
        )
        pairs = ((state_rewards, rewards),) if state_rewards or rewards else ()
        given = read_model(
            ModelFiles(Path(a.importtrans), states, labels, pairs), kind, check_sums=a.check_sums
        )
    engine = imported_engine(given, fix_deadlocks=a.fix_deadlocks)
    return engine.rational() if a.exact else engine


def targets(a: argparse.Namespace, varying: Values = NOTHING) -> list:  # type: ignore[type-arg]
    """What the export switches ask to be written, for one choice of the constants that vary.

    Raises UsageError for what cannot be understood.
    """
    if (
        not any(getattr(a, s) is not None for s in (*_SINGLE, "exportrewards"))
        and not a.exportmodel
    ):
        return []
    from dataclasses import replace

    from symcheck.exchange.export import ExportOptions, Target, file_options, parse_target

    options = ExportOptions(
        precision=a.exportprecision,
        headers=not a.noexportheaders,
        rows=a.exportrows,
        proplabels=a.exportproplabels == _FLAG,
        matlab=a.exportmatlab,
    )
    found = [
        t
        for text in a.exportmodel
        for t in parse_target(text, a.model or a.importmodel or a.importtrans, options)
    ]
    for switch, kind in _SINGLE.items():
        if getattr(a, switch):
            path, own = file_options(getattr(a, switch), options)
            found.append(Target(kind, path, replace(own, states=switch == "exporttransdotstates")))
    if a.exportrewards:
        found += [
            Target(kind, path, options)
            for kind, path in zip(("srew", "trew"), a.exportrewards, strict=True)
        ]
    for target in found:
        if not Path(target.path).parent.is_dir():
            raise UsageError(
                f"there is no folder '{Path(target.path).parent}' to write '{Path(target.path).name}' to"
            )
    return [replace(t, path=own_file(t.path, varying)) for t in found]


def wanted(a: argparse.Namespace) -> bool:
    """Whether some switch needs the built model, beside properties."""
    return any(getattr(a, s) not in (None, False, []) for s in MODEL_EXPORTS)


def export_program(a: argparse.Namespace, report: Report, program: Program) -> None:
    """Write the text of the model for -exportprism."""
    if a.exportprism is not None:
        _write_program(a.exportprism, report, program)


def export_constants(
    a: argparse.Namespace, report: Report, model: BoundModel, varying: Values = NOTHING
) -> None:
    """Write the text of the model with the values of its constants for -exportprismconst."""
    if a.exportprismconst is None:
        return
    from dataclasses import replace

    from symcheck.semantics.expressions.literals import as_expression

    constants = tuple(
        replace(c, value=as_expression(model.constants[c.name], c.type, c.span))
        for c in model.program.constants
    )
    _write_program(
        own_file(a.exportprismconst, varying), report, replace(model.program, constants=constants)
    )


def _write_program(path: str, report: Report, program: Program) -> None:
    from symcheck.exchange.text import write_text
    from symcheck.syntax.printer import pretty

    if not any(getattr(m, "commands", True) for m in program.modules):
        raise UsageError(
            "a model that is read state by state has no text in the PRISM language; -exportmodel writes it"
        )
    write_text(path, [pretty(program)], report.out)
    if path != "stdout":
        report.line(f"Exported to '{path}'")


Labels = Mapping[str, Expression]


def export_model(
    a: argparse.Namespace,
    report: Report,
    engine: Engine,
    options: Options,
    bound: Callable[[], Labels],
    varying: Values = NOTHING,
) -> None:
    """Write what the switches ask for, and tell of each file. `bound` gives the labels of the model and of the properties."""
    if a.exportdot is not None:
        _export_dot(a.exportdot, report, engine, varying)
    files = targets(a, varying)
    if not files:
        return
    labels = bound()
    from symcheck.check.state_formulas import satisfying
    from symcheck.exchange.explicit_export import explicit_export
    from symcheck.exchange.export import export

    context = Context(engine, options, labels)

    def states(name: str) -> StateSet:
        return satisfying(context, LabelReference(name), engine.all)

    every = any(t.options.proplabels or t.kind == "proplab" for t in files)
    own = [n for n in engine.model.labels if n not in ("init", "deadlock")]
    others = [n for n in labels if n not in (*own, "init", "deadlock")] if every else []
    report.line()
    for path in export(
        explicit_export(engine, own, states, property_labels=others), files, report.out
    ):
        if path != "stdout":
            report.line(f"Exported to '{path}'")


def _export_dot(path: str, report: Report, engine: Engine, varying: Values) -> None:
    """Write the diagrams of the matrix, one for each choice slot. Raises UnsupportedError on engines without diagrams."""
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.exchange.text import write_text
    from symcheck.view.diagrams import dot

    if not isinstance(engine, SymbolicEngine):
        raise UnsupportedError(
            f"-exportdot draws a diagram, and the engine {engine.name} has none\n  hint: -m, -h or -s build diagrams"
        )
    matrices = engine.diagrams.roots
    for i, matrix in enumerate(matrices):
        own = {**varying, **({"slot": str(i + 1)} if len(matrices) > 1 else {})}
        target = own_file(path, own)
        write_text(
            target,
            [
                dot(
                    matrix,
                    engine.space.symbolic.encoding,
                    max_nodes=_MOST_NODES,
                    title="transitions",
                )
            ],
            report.out,
        )
        if target != "stdout":
            report.line(f"Exported to '{target}'")


# ----------------------------------------------------------------------------------------------------------- distributions


def report_distributions(
    a: argparse.Namespace,
    report: Report,
    engine: Engine,
    options: Options,
    varying: Values = NOTHING,
) -> None:
    """Compute and print, or write, the distributions that -transient and -steadystate ask for."""
    if a.transient is None and not a.steadystate:
        if a.exporttransient or a.exportsteadystate:
            raise UsageError(
                "-exporttransient goes with -transient TIME, and -exportsteadystate with -steadystate"
            )
        return
    from symcheck.check.state_distributions import Distribution, steady_state, transient

    def tell(kind: str, found: Distribution, path: str | None) -> None:
        _tell(
            report,
            kind,
            found,
            None if path is None else own_file(path, varying),
            a.exportprecision,
        )

    start = None if a.importinitdist is None else _read_distribution(Path(a.importinitdist))
    times = list(_times(a.transient)) if a.transient is not None else []
    for text, time in times:
        report.line(f"\nComputing transient probabilities (time = {text})...")
        tell(
            "transient",
            transient(engine, time, options, start),
            _named(a.exporttransient, text if len(times) > 1 else None),
        )
    if a.steadystate:
        report.line("\nComputing steady-state probabilities...")
        tell("steady-state", steady_state(engine, options, start), a.exportsteadystate)


def _times(argument: str) -> Iterator[tuple[str, float]]:
    """The times that `2`, `0:5` or `0.1:0.01:0.2` means."""
    for choice in combinations(parse_constants([f"T={argument}"])):
        try:
            yield choice["T"], float(choice["T"])
        except ValueError:
            raise UsageError(f"-transient: '{choice['T']}' is not a time") from None


def _named(path: str | None, time: str | None) -> str | None:
    """The file of one of several times."""
    if path is None or time is None or path == "stdout":
        return path
    whole = Path(path)
    return str(whole.with_name(f"{whole.stem}_{time}{whole.suffix}"))


def _tell(report: Report, kind: str, found: object, path: str | None, precision: int) -> None:
    from symcheck.check.state_distributions import Distribution
    from symcheck.exchange.explicit_export import state_order
    from symcheck.exchange.text import lines, number_text, write_text

    assert isinstance(found, Distribution)
    # The numbers are those of the exported states, whatever the order of the variables in diagrams.
    order = state_order(found.engine)
    if path is None or path == "stdout":
        report.line(f"\nPrinting {kind} probabilities in plain text format below:")
        place = np.arange(len(found)) if order is None else np.argsort(order)
        for own, state, value in (
            found if order is None else sorted(found, key=lambda entry: int(place[entry[0]]))
        ):
            number = place[own]
            report.line(f"{number}:{format_state(state)}={number_text(value, precision)}")
    else:
        write_text(
            path,
            lines(
                "%s",
                len(found),
                found.values if order is None else found.values[order],
                precision=precision,
            ),
            report.out,
        )
        report.line(f"Exported to '{path}'")
    report.line()
    if found.certified:
        report.line(
            f"Accuracy: each probability is certified: +/- {found.error:.1E} ({found.explanation})"
        )
    else:
        report.warn(
            f"the probabilities are an estimate: their error is unknown ({found.explanation})"
        )
    report.line(f"Time for {kind} probability computation: {found.seconds:.3f} seconds.")


def _read_distribution(path: Path) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """A probability per line. Raises UsageError, SyntaxFault."""
    from symcheck.exchange.column_reader import read_columns

    file = read_columns(path)
    out = np.zeros(len(file.rows))
    for i, row in enumerate(file.rows):
        try:
            (out[i],) = map(float, row)
        except ValueError:
            file.fault(i, "a line should hold one probability", "number")
    return out
