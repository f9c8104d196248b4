"""Checking one property, and reporting its result: output, table, files, verdict of a test."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symcheck.api.checking import PreparedModel
from symcheck.api.model import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result
from symcheck.check.testing.expected_results import Verdict, VerdictKind, expected_value, judge
from symcheck.check.testing.property_tests import PropertyTest, property_test
from symcheck.cli.output import Output
from symcheck.cli.output_paths import ConstantTexts, instance_path
from symcheck.cli.run_state import RunState
from symcheck.cli.switches.arguments import Arguments
from symcheck.errors import (
    InputError,
    InternalError,
    NumericalError,
    OutputError,
    ResourceError,
    SymcheckError,
    UnsupportedError,
)
from symcheck.experiments.rows import Row, answered, error_text, row_of
from symcheck.machine import memory_ended
from symcheck.syntax.properties_in_part import UnparsedProperty
from symcheck.tables import counted
from symcheck.whole_file import is_output_fault

if TYPE_CHECKING:
    from symcheck.cli.progress import Progress
    from symcheck.engines.explicit.strategy import Strategy
    from symcheck.exchange.iterations import IterationLog
    from symcheck.numerics.linear.problem import Observer
    from symcheck.numerics.linear.problem import Progress as Iteration
    from symcheck.semantics.model import BoundModel
    from symcheck.simulate.statistics import Plan

__all__ = ["check_property", "internal_error", "report_unbuilt_model", "report_unparsed"]


def check_property(
    state: RunState,
    prepared: PreparedModel[Model],
    instance: PropertyInstance,
    plan: Plan | None,
    varying: ConstantTexts,
    *,
    sizes: tuple[int, int] | None = None,
) -> None:
    """Check a property, or estimate it with a plan, and report the result.

    A fault of the property does not stop the others.

    prepared: the model, reduced and maybe with a quotient. varying: the constants in the names of
    files. sizes: the numbers of states and transitions of a model without an engine here.

    Raises:
        ResourceError, MemoryError: a limit was reached.
        UsageError, OutputError: a file cannot be written.
        TestFailed: a test failed, and -test ends the run.
    """
    model = prepared.model
    bound, _ = instance.bind(model.bound)
    of_model = {n: str(v) for n, v in model.given_constants.items()}
    of_property = {n: str(v) for n, v in instance.relevant.items()}
    state.output.property(instance.text, bound.name, of_model, of_property)
    row = row_of(instance, of_model)
    outcome: Result | SymcheckError
    iterations, progress = _iteration_log(state.arguments), state.progress
    try:
        with nullcontext() if progress is None else progress.checking():
            if plan is not None:
                from symcheck.cli.simulation.sampling import with_switches

                samples = None if progress is None else progress.samples
                outcome = model.estimate_instance(instance, plan, state.workers, samples)
                warnings = tuple(map(with_switches, outcome.warnings))
                outcome = replace(outcome, warnings=warnings)
            else:
                observer = _observers(iterations, progress)
                outcome = prepared.check(instance, observer)
    except (ResourceError, OutputError, MemoryError):
        raise
    except Exception as error:  # a defect in one property must not stop the others
        if memory_ended(error) or (isinstance(error, OSError) and is_output_fault(error)):
            raise
        outcome = error if isinstance(error, SymcheckError) else internal_error(error)
        if plan is not None:
            from symcheck.cli.simulation.sampling import in_switches

            outcome = in_switches(outcome)
        row = replace(row, error=error_text(outcome))
    else:
        row = answered(row, outcome)
    if state.options.truncate and isinstance(outcome, Result) and plan is None:
        if model.decided(instance) is None and not model.has_region(instance):
            state.output.line("Note: -truncate has no effect: this property needs every state")
    if model.builds_per_property and isinstance(outcome, Result):
        engine = outcome.engine
        assert engine is not None
        sizes = engine.states, engine.transitions
        clocks = f" ({engine.model.clocks})" if model.is_timed else ""
        state.output.line(f"States:      {engine.states}{clocks}")
    if plan is None and (sizes or not model.builds_per_property):
        states, transitions = sizes or (model.engine.states, model.engine.transitions)
        row = replace(
            row,
            states=states,
            transitions=transitions,
            build_seconds=state.build_seconds,
        )
    state.rows.append(row)  # first: a signal may come while the text is printed
    if isinstance(outcome, Result):
        state.output.result(outcome, state.options.method)
    else:
        state.output.error(outcome)
        state.failures += not state.testing
    if iterations is not None:
        _write_iterations(state, iterations, outcome, varying)
    if isinstance(outcome, Result):
        _write_files(state.arguments, state.output, outcome, varying, model.bound)
        _write_product(state, model, instance, varying)
    if state.testing:
        exact = state.options.exact
        state.conclude(property_test(instance, outcome, of_model, bound.constants, exact=exact))


def report_unparsed(state: RunState, index: int | None = None) -> None:
    """Report the properties before an index (all) that do not follow the grammar.

    Each is reported once. Raises TestFailed as `check_property`.
    """
    for i in sorted(state.unparsed):
        if index is None or i < index:
            _report_unparsed(state, state.unparsed.pop(i))


def _report_unparsed(state: RunState, property: UnparsedProperty) -> None:
    """Report a property that does not follow the grammar.

    A test of it fails, unless its RESULT line expects an error. What is only refused is judged as
    other properties that are.
    """
    state.output.property(property.text, None, {}, {})
    state.output.error(property.fault)
    message = error_text(property.fault)
    state.rows.append(Row(property.text, {}, error=message))
    if not state.testing:
        state.failures += 1
        return
    fault = property.fault
    if isinstance(fault, InputError) and {d.code for d in fault.diagnostics} == {"model-type"}:
        fault = UnsupportedError(message)
    refused = isinstance(fault, UnsupportedError)
    verdict = judge(property.comments, fault, {})
    if verdict.kind is not VerdictKind.PASS and not refused:
        verdict = Verdict(VerdictKind.FAIL, message)
    expected = expected_value(property.comments, {})
    span = property.span
    line = span.source.position(span.start)[0]
    state.conclude(
        PropertyTest(property.text, {}, expected, message, verdict, 0.0, span.source.name, line)
    )


def report_unbuilt_model(
    state: RunState,
    instances: Sequence[PropertyInstance],
    constants: ConstantTexts,
    error: SymcheckError,
) -> None:
    """Report that one of several models cannot be built; its properties have no results."""
    state.output.error(error)
    state.failures += 1
    for instance in instances:
        row = row_of(instance, constants)
        state.rows.append(replace(row, error=error_text(error)))


def internal_error(error: Exception) -> InternalError:
    """A defect of symcheck, as an error that can be reported."""
    import traceback

    where = traceback.extract_tb(error.__traceback__)[-1]
    hint = "this is a defect of symcheck; please report it with the model"
    if isinstance(error, ImportError) and (error.name or "").startswith("symcheck."):
        hint = (
            "sources and compiled modules are of different versions: build again "
            "(pip install -e ., or make demo in a checkout)"
        )
    return InternalError(
        f"internal error: {type(error).__name__}: {error} "
        f"({Path(where.filename).name}:{where.lineno})",
        hint=hint,
    )


# ----------------------------------------------------------------------------------- files


def _write_files(
    a: Arguments, output: Output, result: Result, varying: ConstantTexts, shown: BoundModel
) -> None:
    if a.exportstrat is not None:
        for i, strategy in enumerate(result.strategies, 1):
            point = {"point": str(i)} if len(result.strategies) > 1 else {}
            _write_strategy(a.exportstrat, output, strategy, {**varying, **point})
    if a.counterexample or a.exportcounterexample is not None:
        _explain(a, output, result, varying)
    for file in a.exportvector:
        path = instance_path(file, varying)
        _write_vector(path, output, result, a.exportprecision, shown)
    if a.exportpareto is not None:
        _write_front(instance_path(a.exportpareto, varying), output, result)
    if a.exportregions is not None:
        _write_regions(instance_path(a.exportregions, varying), output, result)
    if a.exportcertificate is not None:
        _write_certificate(instance_path(a.exportcertificate, varying), output, result)


def _write_certificate(path: str, output: Output, result: Result) -> None:
    from symcheck.exchange.certificates import save_certificate

    try:
        proof = result.certificate()
    except (UnsupportedError, NumericalError) as error:
        output.warn(f"no certificate: {error}")
        return
    for file in save_certificate(proof, path):
        output.exported(file)


def _write_front(path: str, output: Output, result: Result) -> None:
    from symcheck.exchange.pareto_fronts import front_extension, front_text
    from symcheck.exchange.text import write_text

    if result.front_or_none is None:
        output.warn("-exportpareto: this property has no Pareto front")
        return
    write_text(path, [front_text(result.front, front_extension(path))], output.out)
    output.exported(path)


def _write_regions(path: str, output: Output, result: Result) -> None:
    from symcheck.exchange.region_files import save_regions

    save_regions(result.regions, path, output.out)
    output.exported(path)


def _iteration_log(a: Arguments) -> IterationLog | None:
    """What receives the iterations of a property, if they are to be written."""
    if a.exportiterations is None:
        return None
    from symcheck.exchange.iterations import IterationLog

    return IterationLog()


def _observers(log: IterationLog | None, progress: Progress | None) -> Observer | None:
    """What is told of iterations, if anything wants to know of them."""
    if progress is None or not progress.terminal:
        return log
    if log is None:
        return progress.iteration

    def both(event: Iteration) -> None:
        log(event)
        progress.iteration(event)

    return both


def _write_iterations(
    state: RunState,
    log: IterationLog,
    outcome: Result | SymcheckError,
    varying: ConstantTexts,
) -> None:
    """Write the iterations of a property, also of one that ended with an error."""
    from symcheck.exchange.iterations import iterations_extension, iterations_text
    from symcheck.exchange.text import write_text

    if not log.rows:
        runs = outcome.runs if isinstance(outcome, Result) else ()
        unseen = [r.method for r in runs if r.kind != "graph" and r.iterations]
        reason = "this property was checked without iterations"
        if unseen:
            reason = f"the method {unseen[0]} tells of its iterations only if there are many"
        state.output.warn(f"-exportiterations: {reason}")
        return
    path = instance_path(state.arguments.exportiterations or "", varying)
    write_text(path, [iterations_text(log.rows, iterations_extension(path))], state.output.out)
    state.output.exported(path)


def _explain(a: Arguments, output: Output, result: Result, varying: ConstantTexts) -> None:
    """Print and write a counterexample."""
    try:
        counterexample = result.counterexample(a.counterexamplepaths)
    except UnsupportedError as error:
        output.warn(f"no counterexample: {error}")
        return
    if a.counterexample:
        output.line()
        output.line(str(counterexample))
    if a.exportcounterexample is not None:
        path = instance_path(a.exportcounterexample, varying)
        counterexample.save(path)
        output.exported(path)


def _write_product(
    state: RunState, model: Model, instance: PropertyInstance, varying: ConstantTexts
) -> None:
    """Write the product of the model with the automaton of a property, if switches ask for it."""
    a = state.arguments
    files = {"tra": a.exportprodtrans, "sta": a.exportprodstates}
    if not any(files.values()):
        return
    from symcheck.exchange.api_io import product_targets

    targets = {
        kind: instance_path(path, varying) for kind, path in files.items() if path is not None
    }
    try:
        for path in product_targets(model, instance, targets, a.exportprecision, state.output.out):
            state.output.exported(path)
    except UnsupportedError as error:
        state.output.warn(f"-exportprod…: {error}")


def _write_strategy(
    argument: str, output: Output, strategy: Strategy, varying: ConstantTexts
) -> None:
    from symcheck.exchange.strategies.files import strategy_target, write_strategy_files

    target = strategy_target(argument)
    target = replace(target, path=instance_path(target.path, varying))
    if target.path == "stdout" and "point" in varying:
        output.line(f"# point {varying['point']}")
    for path in write_strategy_files(strategy, target, output.out):
        if path != "stdout":
            output.line(f'Strategy written to "{path}" ({target.kind})')


def _write_vector(
    path: str, output: Output, result: Result, precision: int, shown: BoundModel
) -> None:
    """Write the value (a number or bool) in each state, in the order of exported states.

    shown: the model whose states are exported.
    """
    from symcheck.engines.transition_actions import state_order
    from symcheck.exchange.text import lines, write_text
    from symcheck.semantics.timed.properties import has_states_of

    engine = result.engine
    if engine is not None and not has_states_of(engine.model, shown):
        output.warn(
            "-exportvector: the values are not those of the states of -exportstates: this property "
            f"is checked on {counted(engine.states, 'state')} of its own ({engine.model.clocks})"
        )
        return
    if engine is None or (result.values_or_none is None and result.satisfying_or_none is None):
        output.warn("-exportvector: this property has no value in each state")
        return
    order = state_order(engine)
    if result.values_or_none is not None:
        values = result.values.midpoints(engine.all)
        column = values if order is None else values[order]
        text = lines("%s", len(column), column, precision=precision)
    elif result.satisfying_or_none is not None:
        members = engine.to_bools(result.satisfying.members)
        names = np.where(members if order is None else members[order], "true", "false").tolist()
        text = lines("%s", len(names), names)
    write_text(path, text, output.out)
    output.exported(path)
