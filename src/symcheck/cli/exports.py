"""The switches that write models, and those that compute distributions over states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symcheck.api.model import Model
from symcheck.cli.output import Output
from symcheck.cli.output_paths import NO_CONSTANTS, ConstantTexts, instance_path, of_switch
from symcheck.cli.switches.arguments import Arguments
from symcheck.constant_values import combinations, parse_constants
from symcheck.errors import Diagnostic, UnsupportedError, UsageError
from symcheck.matrices.rows import Floats
from symcheck.semantics.binding.bind import BoundProperty
from symcheck.semantics.expressions.literals import format_state
from symcheck.semantics.features import class_name
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.printer import pretty

if TYPE_CHECKING:
    from symcheck.check.state_distributions import Distribution
    from symcheck.exchange.export import Target

__all__ = [
    "check_targets",
    "export_constants",
    "export_model",
    "export_program",
    "report_distributions",
]

_MOST_NODES = 100_000
"""Nodes of a diagram up to which it is drawn."""


def check_targets(a: Arguments) -> None:
    """Find faults of the export switches before anything is computed. Raises UsageError."""
    _targets(a)
    if a.transient is not None:
        list(_times(a.transient))


def _targets(a: Arguments, varying: ConstantTexts = NO_CONSTANTS) -> list[Target]:
    """The parts of the model to be written, for one combination of the constants that vary.

    Raises UsageError.
    """
    if not a.exports:
        return []
    from symcheck.exchange.export import (
        ExportOptions,
        Target,
        check_no_options,
        file_options,
        parse_target,
    )

    options = ExportOptions(
        precision=a.exportprecision,
        headers=False if a.noexportheaders else None,
        rows=a.exportrows,
        proplabels=any(e.kind == "proplab" and not e.argument for e in a.exports),
        matlab=a.exportmatlab,
    )
    targets: list[Target] = []
    for kind, argument in a.exports:
        if kind == "model":
            source = a.model or a.importmodel or a.importtrans or "model"
            with of_switch("-exportmodel"):
                targets += parse_target(argument, source, options)
        elif argument:
            path, overrides = file_options(argument, options)
            if kind == "jani":
                check_no_options(argument, path)
            if kind in ("dot", "dotstates"):
                kind, overrides = "dot", replace(overrides, states=kind == "dotstates")
            targets.append(Target(kind, path, overrides))
    for target in targets:
        where = Path(target.path)
        if not where.parent.is_dir():
            raise UsageError(f"there is no folder '{where.parent}' to write '{where.name}' to")
    return [replace(t, path=instance_path(t.path, varying)) for t in targets]


def export_program(a: Arguments, output: Output, program: Program) -> None:
    """Write the text of the model for -exportprism. Raises UsageError."""
    if a.exportprism is not None:
        _write_program(a, a.exportprism, output, program)


def export_constants(
    a: Arguments, output: Output, model: Model, varying: ConstantTexts = NO_CONSTANTS
) -> None:
    """Write the text of the model with the values of its constants for -exportprismconst.

    Raises UsageError.
    """
    if a.exportprismconst is not None:
        if a.importstrat is not None:
            raise UsageError(
                "the chain under a strategy has no text in the PRISM language; "
                "-exportmodel writes it"
            )
        path = instance_path(a.exportprismconst, varying)
        _write_program(a, path, output, model.instantiated())


def _write_program(a: Arguments, path: str, output: Output, program: Program) -> None:
    from symcheck.exchange.text import write_text

    if a.imports_model:
        raise UsageError(
            "a model read from explicit files has no text in the PRISM language; "
            "-exportmodel writes it"
        )
    write_text(path, [pretty(program)], output.out)
    output.exported(path)


def export_model(
    a: Arguments,
    output: Output,
    model: Model,
    file: PropertiesFile,
    indices: Sequence[int],
    constants: Mapping[str, Sequence[str]],
    varying: ConstantTexts = NO_CONSTANTS,
    *,
    listed: bool = True,
) -> None:
    """Write the parts of the model that switches name, and print the name of each file.

    file, constants: the properties, whose labels may be written too, with the first of the values
    of each constant. indices: those that are written to a JANI file. listed: whether the model has
    states; if not, only a JANI file is written.
    """
    if a.exportdot is not None and listed:
        _export_dot(a.exportdot, output, model, varying)
    if a.exportpage is not None and listed:
        path = instance_path(a.exportpage, varying)
        model.page(file, {n: v[0] for n, v in constants.items()}).save(path)
        output.exported(path)
    targets = [t for t in _targets(a, varying) if listed or t.kind == "jani"]
    if not targets:
        return
    from symcheck.exchange.api_io import export_targets

    given = {n: v[0] for n, v in constants.items()}
    labels = model.properties(file, given).labels
    output.line()

    def properties(exact: Model) -> list[BoundProperty]:
        bound = exact.properties(file, given).properties
        return [bound[i] for i in indices]

    def left_out(property: BoundProperty, fault: Diagnostic) -> None:
        name = f'"{property.name}"' if property.name else pretty(property.formula)
        output.warn(f"the property {name} is left out: {fault.message}")

    timed = model.bound.delays or model.bound.clocks
    if timed is not None and any(t.kind != "jani" for t in targets):
        output.line(
            "Note: what is exported is the process with digital clocks, in which steps are no "
            f'units of time: the rewards "{timed.time}" count them'
        )
    for path in export_targets(model, targets, output.out, labels, properties, left_out):
        output.exported(path)


def _export_dot(path: str, output: Output, model: Model, varying: ConstantTexts) -> None:
    """Write the diagrams of the matrix, one for each choice class.

    Raises UnsupportedError on engines without diagrams.
    """
    from symcheck.engines.symbolic.diagrams import HasDiagrams
    from symcheck.exchange.text import write_text
    from symcheck.view.diagrams import dot

    engine, options = model.engine, model.options
    symbolic = engine.capability(HasDiagrams)
    if symbolic is None:
        if options.engine in ("mtbdd", "hybrid", "sparse") and not options.exact:
            # It has built diagrams, and listed their rows; its name tells why, or its class does.
            why = f"{class_name(engine.model)} are solved on rows"
            why = why if engine.name == options.engine else engine.name
            raise UnsupportedError(f"-exportdot draws a diagram, and none is kept: {why}")
        raise UnsupportedError(
            f"-exportdot draws a diagram, and the engine {engine.name} has none",
            hint="-m, -h or -s build diagrams",
        )
    matrices = symbolic.diagrams.roots
    for i, matrix in enumerate(matrices):
        values = {**varying, **({"slot": str(i + 1)} if len(matrices) > 1 else {})}
        target = instance_path(path, values)
        write_text(
            target,
            [
                dot(
                    matrix,
                    symbolic.space.symbolic.encoding,
                    max_nodes=_MOST_NODES,
                    title="transitions",
                )
            ],
            output.out,
        )
        output.exported(target)


# --------------------------------------------------------------------------- distributions


def report_distributions(
    a: Arguments, output: Output, model: Model, varying: ConstantTexts = NO_CONSTANTS
) -> None:
    """Compute and print, or write, the distributions that -transient and -steadystate ask for."""
    if a.transient is None and not a.steadystate:
        return
    start = None if a.importinitdist is None else _read_distribution(Path(a.importinitdist))
    times = [] if a.transient is None else list(_times(a.transient))
    for text, time in times:
        output.line(f"\nComputing transient probabilities (time = {text})...")
        path = _path_for_time(a.exporttransient, text if len(times) > 1 else None)
        _report(a, output, "transient", model.transient(time, start), path, varying)
    if a.steadystate:
        output.line("\nComputing steady-state probabilities...")
        distribution = model.steady_state(start)
        _report(a, output, "steady-state", distribution, a.exportsteadystate, varying)


def _times(argument: str) -> Iterator[tuple[str, float]]:
    """The times that `2`, `1/3`, `0:5` or `0.1:0.01:0.2` denotes. Raises UsageError."""
    for choice in combinations(parse_constants([f"T={argument}"], "-transient")):
        try:
            yield choice["T"], float(Fraction(choice["T"]))
        except (ValueError, ArithmeticError):
            raise UsageError(f"-transient: '{choice['T']}' is not a time") from None


def _path_for_time(path: str | None, time: str | None) -> str | None:
    """The file of one of several times."""
    if path is None or time is None or path == "stdout":
        return path
    whole = Path(path)
    return str(whole.with_name(f"{whole.stem}_{time}{whole.suffix}"))


def _report(
    a: Arguments,
    output: Output,
    kind: str,
    distribution: Distribution,
    path: str | None,
    varying: ConstantTexts,
) -> None:
    """Print or write a distribution, its accuracy and time."""
    if path is None or path == "stdout":
        _print_distribution(output, kind, distribution, a.exportprecision)
    else:
        _write_distribution(instance_path(path, varying), output, distribution, a.exportprecision)
    output.line()
    if distribution.engine.is_rational and not distribution.exact:
        output.line(
            f"Note: -exact has no effect on {kind} probabilities of a CTMC: they are irrational"
        )
    if distribution.exact:
        output.line(f"Accuracy: each probability is exact ({distribution.explanation})")
    elif distribution.certified:
        output.line(
            f"Accuracy: each probability is certified: +/- {distribution.error:.1E} "
            f"({distribution.explanation})"
        )
    else:
        output.warn(
            "the probabilities are an estimate: their error is unknown "
            f"({distribution.explanation})"
        )
    output.line(f"Time for {kind} probability computation: {distribution.seconds:.3f} seconds.")


def _print_distribution(
    output: Output, kind: str, distribution: Distribution, precision: int
) -> None:
    """Print the states with positive probability, numbered as exported states are."""
    from symcheck.engines.transition_actions import state_order
    from symcheck.exchange.text import number_text

    output.line(f"\nPrinting {kind} probabilities in plain text format below:")
    order = state_order(distribution.engine)
    numbers = np.arange(len(distribution)) if order is None else np.argsort(order)
    for index, state, value in sorted(distribution, key=lambda entry: int(numbers[entry[0]])):
        output.line(f"{numbers[index]}:{format_state(state)}={number_text(value, precision)}")


def _write_distribution(
    path: str, output: Output, distribution: Distribution, precision: int
) -> None:
    """Write a probability per state, in the order of exported states."""
    from symcheck.engines.transition_actions import state_order
    from symcheck.exchange.text import lines, write_text

    order = state_order(distribution.engine)
    values = distribution.values if order is None else distribution.values[order]
    write_text(path, lines("%s", len(values), values, precision=precision), output.out)
    output.exported(path)


def _read_distribution(path: Path) -> Floats:
    """The distribution of a file with one probability per line. Raises UsageError, SyntaxFault."""
    from symcheck.exchange.column_reader import read_columns

    file = read_columns(path)
    out = np.zeros(len(file.rows))
    for i, row in enumerate(file.rows):
        try:
            (out[i],) = map(float, row)
        except ValueError:
            file.fault(i, "a line should hold one probability", "number")
    return out
