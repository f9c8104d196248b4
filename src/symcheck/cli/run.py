"""One run of the command line: read, then build and check for every choice of constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from time import perf_counter

from symcheck.api import Model, ReducedModel
from symcheck.check.expected_results import judge
from symcheck.check.property_instance import PropertyInstance
from symcheck.cli import exports
from symcheck.cli.check_property import check_property, report_unbuilt_model, report_unparsed
from symcheck.cli.model_input import choose_model_file, read_model
from symcheck.cli.output_paths import NO_CONSTANTS, ConstantTexts
from symcheck.cli.progress import Progress
from symcheck.cli.properties_input import PropertiesInput, read_properties
from symcheck.cli.run_state import RunState, TestFailed
from symcheck.cli.simulation import sampling_plan, write_path
from symcheck.constant_values import combinations, parse_constants
from symcheck.errors import Diagnostic, NameFault, ResourceError, SymcheckError, UsageError
from symcheck.semantics.binding.bind import split_constants
from symcheck.syntax.declarations import PropertiesFile

__all__ = ["run"]

GivenValues = Mapping[str, Sequence[str]]


def run(state: RunState) -> int:
    """Carry out a run; gives the exit status.

    Raises SymcheckError for faults of the run as a whole.
    """
    a = state.arguments
    source = choose_model_file(a)
    exports.check_targets(a)
    given = parse_constants(a.const)
    files = [f'Reading model file "{source}"']
    if a.properties:
        files.append(f'Reading properties file "{a.properties}"')
    state.output.header(files)
    _note_unused_switches(state)
    model = read_model(a)
    properties = read_properties(a.properties, a.pf)
    split = split_constants(model.program, properties.file, dict.fromkeys(given, ""))
    for warning in split.warnings:
        # No error: scripts give one list of constants to many models.
        hint = f" ({warning.hint})" if warning.hint else ""
        state.output.warn(f"-const: {warning.message}{hint}")
    indices = _selected_properties(properties.file, a.prop)
    exports.export_program(a, state.output, model.program)
    if not a.nobuild:
        of_model = {n: given[n] for n in split.of_model}
        of_properties = {n: given[n] for n in split.of_properties}
        state.fixed = tuple(n for n, values in given.items() if len(values) == 1)
        _check_instances(state, model, properties, indices, of_model, of_properties)
    state.output.end()
    return 1 if state.failures else 0


def _check_instances(
    state: RunState,
    model: Model,
    properties: PropertiesInput,
    indices: Sequence[int],
    of_model: GivenValues,
    of_properties: GivenValues,
) -> None:
    """Check the properties for every combination of the constants."""
    for fault in properties.declarations:
        state.output.error(fault)
        state.failures += 1
    for i in indices:
        if i in properties.unparsed:
            report_unparsed(state, properties.unparsed[i])
    parsed = [i for i in indices if i not in properties.unparsed]
    choices = list(combinations(of_model))
    try:
        for constants in choices:
            instance = model.with_constants(constants)
            varying = constants if len(choices) > 1 else NO_CONSTANTS
            _check_instance(state, instance, properties.file, parsed, of_properties, varying)
    except TestFailed:
        pass


def _note_unused_switches(state: RunState) -> None:
    """Print which switches have no effect, and why."""
    a = state.arguments
    reasons: dict[str, list[str]] = {}
    for switch, reason in a.without_effect.items():
        reasons.setdefault(reason, []).append(switch)
    for reason, switches in reasons.items():
        verb = "have" if len(switches) > 1 else "has"
        state.output.line(f"Note: {', '.join(switches)} {verb} no effect: {reason}")
    engine = state.options.engine
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


def _check_instance(
    state: RunState,
    model: Model,
    file: PropertiesFile,
    indices: Sequence[int],
    of_properties: GivenValues,
    varying: ConstantTexts,
) -> None:
    """Bind, simulate or build the model with its constants, and check the selected properties.

    varying: the constants of the model that have several values, for the names of files.
    """
    a = state.arguments
    asked = model.instances(file, of_properties, indices)
    constants = {n: str(v) for n, v in model.given_constants.items()}
    try:
        watch = Progress(state.output)
        model = _bound_model(state, model.with_observer(_observer(state, watch)), asked)
        if a.simpath:
            write_path(a, state.output, model, varying)
        if a.step:
            from symcheck.cli.stepping import step_through

            step_through(a, state.output, model)
        plan = sampling_plan(a) if a.sim else None
        if (a.simpath or a.step) and plan is None and not asked and not a.needs_model:
            return
        if plan is None:
            _build(state, model, watch)
    except ResourceError:
        raise
    except SymcheckError as error:
        _report_fault(state, error, asked, constants, of_properties, alone=not varying)
        return
    shared = None
    if plan is None:
        exports.export_constants(a, state.output, model, varying)
        exports.export_model(a, state.output, model, file, of_properties, varying)
        exports.report_distributions(a, state.output, model, varying)
        shared = model.shared_quotient(asked)
        if shared is not None:
            state.output.line(f"Bisimulation: {shared}")
        elif state.options.bisim and len(asked) > 1:
            state.output.detail(
                "Bisimulation: no quotient that is common to the properties is half as large as "
                "the model; each gets its own"
            )
    for instance in asked:
        own = {n: str(v) for n, v in instance.relevant.items() if len(of_properties[n]) > 1}
        name = file.properties[instance.index].name or str(instance.index + 1)
        number = {"property": name} if len(indices) > 1 else {}
        check_property(state, model, instance, plan, shared, {**varying, **own, **number})


def _observer(state: RunState, watch: Progress) -> Progress | None:
    """The observer of builders.

    Counting the states of diagrams takes time: only if the progress is seen.
    """
    return watch if state.options.engine == "auto" or watch.wanted else None


def _bound_model(state: RunState, model: Model, asked: Sequence[PropertyInstance]) -> Model:
    """The model, bound and reduced for the properties, and described in the output.

    Raises InputError.
    """
    a = state.arguments
    state.output.model(model.bound, {n: str(v) for n, v in model.given_constants.items()})
    if not state.options.reduce or a.imports_model:
        return model
    if state.options.fairness:
        state.output.warn("-reduce is not used: which strategies are fair depends on the states")
    keep_steps = bool(a.transient is not None or a.steadystate or a.simpath or a.step or a.exports)
    model = model.reduced_for(asked, keep_steps=keep_steps)
    if isinstance(model, ReducedModel):
        state.output.line(f"Reduction:   {model.reduction}")
    return model


def _build(state: RunState, model: Model, watch: Progress) -> None:
    """Build the model, and print its counts. Raises ModelFault, UnsupportedError, ResourceError."""
    started = perf_counter()
    engine = model.engine
    watch.clear()
    state.output.built(engine, watch.choice, perf_counter() - started)


def _report_fault(
    state: RunState,
    error: SymcheckError,
    asked: Sequence[PropertyInstance],
    constants: ConstantTexts,
    of_properties: GivenValues,
    *,
    alone: bool,
) -> None:
    """Report a model that cannot be bound or built. Raises the error if it ends the run."""
    if state.testing:
        # RESULT lines may expect an error; it is the result of every property.
        state.output.error(error)
        known = {**constants, **{n: v[0] for n, v in of_properties.items()}}
        values = {n: _plain_value(v) for n, v in known.items()}
        for i in dict.fromkeys(instance.index for instance in asked):
            comments = asked[0].file.properties[i].comments
            state.conclude(judge(comments, error, values, exact=state.options.exact))
    elif alone or isinstance(error, UsageError):
        raise error
    else:
        report_unbuilt_model(state, asked, constants, error)


def _plain_value(text: str) -> bool | int | float:
    """The value of a constant for the comparison with RESULT lines, when nothing was bound."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return float("nan")
