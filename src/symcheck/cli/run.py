"""One run of the command line: read, then build and check for every choice of constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from symcheck.api.model import Model
from symcheck.cli import exports
from symcheck.cli.check_property import report_unparsed
from symcheck.cli.input.model import STANDARD_INPUT, choose_model_file, read_model
from symcheck.cli.instance import GivenTexts, InstancesTask
from symcheck.cli.output_paths import NO_CONSTANTS, of_switch
from symcheck.cli.run_state import RunState, TestFailed
from symcheck.cli.switches.arguments import Arguments
from symcheck.cli.switches.needs import BUILT, MDP, PROPERTY, VALUES, unmet_needs
from symcheck.constant_values import combinations, parameter_ranges, parse_constants
from symcheck.errors import Diagnostic, NameFault, UsageError
from symcheck.experiments.properties_input import read_properties
from symcheck.semantics.binding.bind import split_constants
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.properties_in_part import PropertiesInput

if TYPE_CHECKING:
    from symcheck.cli.resuming import FinishedResults
    from symcheck.peers.programs import Peer

__all__ = ["run"]


def run(state: RunState) -> int:
    """Carry out a run; gives the exit status.

    Raises SymcheckError for faults of the run as a whole.
    """
    a = state.arguments
    if a.importresults is not None:
        return _import_results(state, a.importresults)
    source = choose_model_file(a)
    exports.check_targets(a)
    peer = None
    if a.peer is not None:
        from symcheck.peers.programs import find_peer

        peer = find_peer(a.peer)
    given = parse_constants(a.const)
    ranges = parameter_ranges(",".join(a.param), "-param") if a.param else {}
    files = [
        "Reading the model from the standard input"
        if source == STANDARD_INPUT
        else f'Reading model file "{source}"'
    ]
    if a.properties:
        files.append(f'Reading properties file "{a.properties}"')
    state.output.header(files)
    model = read_model(a)
    if ranges:
        model = replace(model, parameters=ranges)
    properties = read_properties(a.properties, a.pf, "-pf", refuses=not state.testing)
    split = split_constants(model.program, properties.file, dict.fromkeys(given, ""))
    for warning in split.warnings:
        # No error: scripts give one list of constants to many models.
        hint = f" ({warning.hint})" if warning.hint else ""
        state.output.warn(f"-const: {warning.message}{hint}")
    if (a.properties or a.pf) and not (properties.file.properties or properties.unparsed):
        state.output.warn(f"{a.properties or '-pf'} has no property")
    of_model = {n: given[n] for n in split.of_model}
    _note_unused_switches(state, _facts(a, model, properties, of_model))
    indices = _selected_properties(properties.file, a.prop)
    exports.export_program(a, state.output, model.program)
    if not a.nobuild:
        of_properties = {n: given[n] for n in split.of_properties}
        state.varying = tuple(n for n, values in given.items() if len(values) > 1)
        _check_instances(state, model, properties, indices, of_model, of_properties, peer)
        if state.testing:
            state.output.tests(state.report())
    state.output.end()
    return 3 if state.lost else 1 if state.failures else 0


_WITH_IMPORTED_RESULTS = ("-importresults", "-exportresults", "-mainlog", "-v", "-timeout")


def _import_results(state: RunState, file: str) -> int:
    """Read the results of another run; they are written as those of this run, or printed.

    Raises UsageError.
    """
    a = state.arguments
    others = [given.written for n, given in a.given.items() if n not in _WITH_IMPORTED_RESULTS]
    others = [*filter(None, (a.model, a.properties)), *others]
    if others:
        raise UsageError(
            f"{others[0]} has no effect: -importresults reads finished results, and checks nothing"
        )
    from symcheck.experiments.table import Experiment

    state.output.header([f'Reading results file "{file}"'])
    with of_switch("-importresults"):
        experiment = Experiment.load(file)
    state.rows, state.varying = list(experiment), experiment.varying
    if not state.rows:
        state.output.warn(f"{file} has no results")
    elif a.exportresults is None:
        from symcheck.experiments.prism_tables import render

        state.output.line()
        state.output.line(render(state.rows, state.varying, ["text"]).rstrip())
    state.output.end()
    return 0


def _check_instances(
    state: RunState,
    model: Model,
    properties: PropertiesInput,
    indices: Sequence[int],
    of_model: GivenTexts,
    of_properties: GivenTexts,
    peer: Peer | None,
) -> None:
    """Check the properties for every combination of the constants."""
    for fault in properties.declarations:
        state.output.error(fault)
        state.failures += 1
    parsed = [i for i in indices if i not in properties.unparsed]
    task = InstancesTask(model, properties.file, parsed, of_properties)
    choices = list(combinations(of_model))
    try:
        state.unparsed = {i: properties.unparsed[i] for i in indices if i in properties.unparsed}
        if peer is not None or len(choices) > 1 or not parsed:
            report_unparsed(state)
        if peer is not None:
            from symcheck.cli.comparing import compare_answers

            compare_answers(state, task, choices, peer)
            return
        if state.arguments.resume is None:
            _check_choices(state, task, choices)
        else:
            from symcheck.cli.resuming import finished_results

            report_unparsed(state)
            with finished_results(state, task) as finished:
                _check_choices(state, task, choices, finished)
        report_unparsed(state)
    except TestFailed:
        pass


def _check_choices(
    state: RunState,
    task: InstancesTask,
    choices: Sequence[Mapping[str, str]],
    finished: FinishedResults | None = None,
) -> None:
    """Check an instance for each choice of constants that has no finished results."""
    a, several = state.arguments, len(choices) > 1
    if a.distributed:
        from symcheck.cli.partitioned import check_partitioned

        check_partitioned(state, task, choices)
        return
    if finished is not None:
        choices = finished.open(choices)
    if not a.step and (a.scheduler is not None or (a.jobs > 1 and (len(choices) > 1 or a.sim))):
        from symcheck.cli.parallel import check_in_parallel

        check_in_parallel(state, task, choices, finished)
        return
    for constants in choices:
        before = len(state.rows)
        task.run(state, constants, constants if several else NO_CONSTANTS)
        if finished is not None:
            finished.write(constants, state.rows[before:])


def _facts(
    a: Arguments, model: Model, properties: PropertiesInput, of_model: GivenTexts
) -> dict[str, bool]:
    """What the run has that switches may need."""
    checks = bool(properties.file.properties or properties.unparsed)
    return {
        PROPERTY: checks,
        BUILT: checks or a.needs_model or not (a.simpath or a.step),
        MDP: model.type.has_choices and a.importstrat is None,
        VALUES: any(len(values) > 1 for values in of_model.values()),
    }


def _note_unused_switches(state: RunState, facts: Mapping[str, bool]) -> None:
    """Print which switches have no effect, and why.

    Raises UsageError if one of them asks for what the run cannot do.
    """
    a = state.arguments
    reasons: dict[str, list[str]] = {}
    for switch, reason in a.without_effect.items():
        reasons.setdefault(f": {reason}", []).append(switch)
    for unmet in unmet_needs(a.given, facts):
        if not unmet.note:
            raise unmet.error
        reasons.setdefault(unmet.reason, []).append(unmet.switch)
    for reason, switches in reasons.items():
        verb = "have" if len(switches) > 1 else "has"
        state.output.line(f"Note: {', '.join(switches)} {verb} no effect{reason}")
    engine = state.options.engine
    if a.draws_diagram and "engine" not in a.settings and not state.options.exact:
        state.output.line(f"Note: -exportdot needs diagrams: the engine is {engine}")
    if state.options.exact and engine not in ("auto", "exact"):
        state.output.line(
            "Note: -exact has an engine of its own (states one by one, rational numbers); "
            f"-{engine} has no effect"
        )


def _selected_properties(file: PropertiesFile, selection: str | None) -> list[int]:
    """Indices of the properties that -prop selects, in the order of the file. Raises NameFault."""
    if selection is None:
        return list(range(len(file.properties)))
    selected: set[int] = set()
    for item in (part.strip() for part in selection.split(",")):
        indices = _indices(file, item)
        if not indices:
            names = ", ".join(p.name for p in file.properties if p.name)
            count = len(file.properties)
            hint = f"there {'is' if count == 1 else 'are'} {count or 'none'}"
            hint += f", among them {names}" if names else ""
            message = f"-prop: there is no property '{item}'"
            if "[" in item:
                hint = "-pf TEXT checks the properties of a text"
            raise NameFault(Diagnostic(message, code="unknown-property", hint=hint))
        selected.update(indices)
    return sorted(selected)


def _indices(file: PropertiesFile, item: str) -> list[int]:
    """Indices of the properties that NAME, N or N-N selects; none if one of them does not exist."""
    by_name = [i for i, p in enumerate(file.properties) if p.name == item]
    low, dash, high = item.partition("-")
    if by_name or not (low.isdecimal() and (high.isdecimal() or not dash)):
        return by_name
    first, last = int(low), int(high) if dash else int(low)
    return list(range(first - 1, last)) if 1 <= first <= last <= len(file.properties) else []
