"""One instance of the model: bind, simulate or build it, and check its properties."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import perf_counter

from symcheck.api.checking import PreparedModel
from symcheck.api.model import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.testing.property_tests import property_test
from symcheck.cli import exports
from symcheck.cli.check_property import (
    check_property,
    report_unbuilt_model,
    report_unparsed,
)
from symcheck.cli.output_paths import ConstantTexts
from symcheck.cli.progress import Progress
from symcheck.cli.run_state import RunState
from symcheck.constant_values import typed_value
from symcheck.errors import OutputError, ResourceError, SymcheckError, UsageError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.binding.bind import without_unused_faults
from symcheck.semantics.model import Value
from symcheck.syntax.declarations import PropertiesFile
from symcheck.tables import counted

__all__ = ["GivenTexts", "InstancesTask", "report_fault", "without_faults"]

GivenTexts = Mapping[str, Sequence[str]]
"""The values of each constant, as texts."""


@dataclass(frozen=True)
class InstancesTask:
    """What all instances share.

    indices: the properties. of_properties: the values of their constants.
    """

    model: Model
    file: PropertiesFile
    indices: Sequence[int]
    of_properties: GivenTexts

    def run(
        self, state: RunState, constants: Mapping[str, str], varying: Mapping[str, str]
    ) -> None:
        """Check one instance."""
        model = replace(self.model, given_constants=constants)  # faults are reported below
        _check_instance(state, model, self.file, self.indices, self.of_properties, varying)


def _check_instance(
    state: RunState,
    model: Model,
    file: PropertiesFile,
    indices: Sequence[int],
    of_properties: GivenTexts,
    varying: ConstantTexts,
) -> None:
    """Bind, simulate or build the model with its constants, and check the selected properties.

    varying: the constants of the model that have several values, for the names of files.
    """
    a = state.arguments
    instances, listed = model.instances(file, of_properties, indices), True
    constants = {n: str(v) for n, v in model.given_constants.items()}
    try:
        state.progress = watch = Progress(state.output)
        if a.importstrat is not None:
            model = _under_strategy(state, model, a.importstrat)
        model = _bound_model(state, model.with_observer(_observer(state, watch)))
        file = without_faults(state, file, model)
        instances = model.instances(file, of_properties, indices)
        prepared = _reduced(state, model, instances)
        model = prepared.model
        if a.simpath:
            from symcheck.cli.simulation.sampling import write_path

            write_path(a, state.output, model, varying)
        if a.step:
            from symcheck.cli.simulation.stepping import step_through

            step_through(a, state.output, model)
        plan = None
        if a.sim:
            from symcheck.cli.simulation.sampling import sampling_plan

            plan = sampling_plan(a)
        if (a.simpath or a.step) and plan is None and not instances and not a.needs_model:
            return
        if plan is None:
            if state.options.truncate is None and model.growth is not None:
                state.output.line(
                    f"Note: {model.growth.note}, and still grows: probabilities are computed on a "
                    "part of the states (without a bound on time or steps, their bounds may stay "
                    "apart); for all else, the search goes on to the states that decide a "
                    "property, and may not end"
                )
            per_property = model.builds_per_property and (instances or model.is_timed)
            needed = a.needs_model
            if model.is_timed:  # the results of properties have states of their own
                listed = _lists_states(state, model)
                needed = listed and bool(a.about_states)
            if needed or not per_property:
                _build(state, model, watch)
    except (ResourceError, OutputError):
        raise
    except SymcheckError as error:
        report_fault(state, error, instances, constants, alone=not varying)
        return
    if plan is None:
        exports.export_constants(a, state.output, model, varying)
        exports.export_model(
            a, state.output, model, file, indices, of_properties, varying, listed=listed
        )
        if listed:
            exports.report_distributions(a, state.output, model, varying)
        if prepared.shared is not None:
            state.output.line(f"Bisimulation: {prepared.shared}")
        elif state.options.bisim and len(instances) > 1:
            state.output.detail(
                "Bisimulation: no quotient that is common to the properties is half as large as "
                "the model; each gets its own"
            )
    for instance in instances:
        report_unparsed(state, instance.index)
        texts = {n: str(v) for n, v in instance.relevant.items() if len(of_properties[n]) > 1}
        name = file.properties[instance.index].name or str(instance.index + 1)
        number = {"property": name} if len(indices) > 1 else {}
        check_property(state, prepared, instance, plan, {**varying, **texts, **number})


def _under_strategy(state: RunState, model: Model, file: str) -> Model:
    """The chain that a strategy in a file induces. Raises SymcheckError."""
    from symcheck.exchange.strategies.induced_chain import induced_chain
    from symcheck.exchange.strategies.reader import load_strategy, undecided_states

    strategy = load_strategy(model, file)
    open_ = undecided_states(strategy, file)
    if open_:
        state.output.warn(
            f'"{file}" leaves out {counted(open_, "state")} with several choices that paths reach: '
            "the first choice is taken"
        )
    return induced_chain(model, strategy)


def _observer(state: RunState, watch: Progress) -> Progress | None:
    """The observer of builders.

    Counting the states of diagrams takes time: only if the progress is seen.
    """
    return watch if state.options.engine == "auto" or watch.wanted else None


def without_faults(state: RunState, file: PropertiesFile, model: Model) -> PropertiesFile:
    """The file without faulty definitions that no property uses; reports them once."""
    sound, fault = without_unused_faults(file, model.bound)
    if fault is not None and str(fault) not in state.told:
        state.output.error(fault)
        state.failures += 1
        state.told.add(str(fault))
    return sound


def _bound_model(state: RunState, model: Model) -> Model:
    """The model, bound and described in the output. Raises InputError."""
    a = state.arguments
    options = state.options
    # The options are chosen before the model is bound, because it is bound for its options.
    if a.needs_model:
        model = model.with_options(stop_at_targets=False, symmetry=False)
    elif options.symmetry is None and options.engine == "auto" and not options.bisim:
        model = model.with_options(symmetry=True)
    state.output.model(model.bound, {n: str(v) for n, v in model.given_constants.items()})
    state.output.warn_of_model(model.warnings)
    return model


def _reduced(
    state: RunState, model: Model, instances: Sequence[PropertyInstance]
) -> PreparedModel[Model]:
    """The model, reduced for the properties. Raises InputError."""
    a, options = state.arguments, state.options
    if options.symmetry and a.needs_model:
        state.output.warn("-symmetry is not used: more than values at initial states is asked")
    if options.fairness and options.reduce:
        state.output.warn("-reduce is not used: which strategies are fair depends on the states")
    all_states = bool(a.transient is not None or a.steadystate or a.simpath or a.step or a.exports)
    prepared = model.prepared_for(instances, all_states=all_states)
    smaller = prepared.model.smaller
    if smaller is not None and smaller.reduction is not None:
        state.output.line(f"Reduction:   {smaller.reduction}")
    if options.stop_at_targets and instances and not (smaller is not None and smaller.partial):
        state.output.line(
            "Note: -nostates has no effect: what is asked for may need every state of the model"
        )
    return prepared


def _lists_states(state: RunState, model: Model) -> bool:
    """Whether what switches ask of the states of a timed automaton can be told; reports why not."""
    from symcheck.semantics.timed.digital import NotDigital, require_states

    try:
        require_states(model.bound)
    except NotDigital as error:
        for switch in state.arguments.about_states:
            (fault,) = error.args
            message = f"{switch} needs states: {fault.message}"
            state.output.error(replace(fault, message=message))
            state.failures += 1
        return False
    return True


def _build(state: RunState, model: Model, watch: Progress) -> None:
    """Build the model, and print its counts. Raises ModelFault, UnsupportedError, ResourceError."""
    started = perf_counter()
    engine = model.engine
    watch.clear()
    state.build_seconds = perf_counter() - started
    partial = model.smaller is not None and model.smaller.partial
    state.output.built(engine, watch.choice, state.build_seconds, partial=partial)
    state.output.warn_of_model(model.overlaps)
    if state.options.symmetry and not state.arguments.needs_model:
        reason = _why_no_symmetry(model)
        if reason is not None:
            state.output.line(f"Note: -symmetry has no effect: {reason}")


def _why_no_symmetry(model: Model) -> str | None:
    """Why every state of a model was explored; None if it was not."""
    from symcheck.engines.capabilities import RepresentsOrbits
    from symcheck.semantics.reduction.symmetry import observed_symmetries

    explored = model.engine.capability(RepresentsOrbits)
    if explored is not None and explored.represented and explored.represented.symmetries:
        return None
    if model.bound.observed is None:
        return "the properties are not checked for values at initial states alone"
    if not observed_symmetries(model.bound):
        return "no modules are equal, or the properties tell them apart"
    if explored is None or model.options.engine not in ("auto", "explicit"):
        return f"the engine {model.engine.name} has no symmetry reduction, -ex has"
    return "the default engine uses it for large models; -ex uses it for this one"


def report_fault(
    state: RunState,
    error: SymcheckError,
    instances: Sequence[PropertyInstance],
    constants: ConstantTexts,
    *,
    alone: bool,
) -> None:
    """Report a model that cannot be bound or built. Raises the error if it ends the run.

    RESULT lines may expect it: then it is the result of every property.
    """
    tests = []
    for instance in instances if state.testing else ():
        known = {**constants, **{n: str(v) for n, v in instance.constants.items()}}
        values = {n: _plain_value(v) for n, v in known.items()}
        tests.append(property_test(instance, error, constants, values))
    if any(test.expected is not None for test in tests):
        state.output.error(error)
        for test in tests:
            state.conclude(test)
    elif alone or isinstance(error, UsageError):
        raise error
    else:
        report_unbuilt_model(state, instances, constants, error)


def _plain_value(text: str) -> Value:
    """The value of a constant for the comparison with RESULT lines, when nothing was bound."""
    value = typed_value(text)
    return float("nan") if isinstance(value, str) else value
