"""One run of the command line: read, bind, build, check, for every choice of constants."""

from __future__ import annotations

import argparse
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter

from symcheck.check.checker import check
from symcheck.check.options import Options
from symcheck.check.question import Question, reduced
from symcheck.check.result import Result, Statistical, show_value
from symcheck.check.resultlines import Verdict, VerdictKind, judge
from symcheck.cli import exports
from symcheck.cli.progress import Progress
from symcheck.cli.report import Report, property_text
from symcheck.cli.simulation import Simulation, simulation
from symcheck.engines import registry
from symcheck.engines.base import Engine
from symcheck.errors import Diagnostic, NameFault, ResourceError, SymcheckError, UsageError
from symcheck.experiment.constants import combinations, parse_constants
from symcheck.experiment.table import Row
from symcheck.semantics.bind import bind, bind_properties, needed_constants, split_constants
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression, ModelType, Program, PropertiesFile
from symcheck.syntax.parse import parse_model_file, parse_properties, parse_properties_file

__all__ = ["Job", "internal", "options_of", "results_file", "run", "sorted_rows"]

Values = Mapping[str, str]


@dataclass
class Job:
    """A run in progress: what was asked, where it is reported, and what has come out so far."""

    arguments: argparse.Namespace
    report: Report
    rows: list[Row] = field(default_factory=list)
    imported: Engine | None = None
    failures: int = 0

    @property
    def testing(self) -> bool:
        """Whether results are compared with RESULT lines."""
        return bool(self.arguments.test or self.arguments.testall)


class _Stop(Exception):
    """A test has failed and -test was asked for."""


def options_of(arguments: argparse.Namespace) -> Options:
    """The options of a check that the switches ask for."""
    return Options(
        engine=arguments.engine or "auto",
        method=arguments.method,
        epsilon=arguments.epsilon,
        relative=arguments.relative,
        certify=not arguments.estimate,
        max_iterations=arguments.maxiters,
        exact=arguments.exact,
        max_memory=arguments.cuddmaxmem,
        time_limit=arguments.timeout,
        fix_deadlocks=arguments.fix_deadlocks,
        check_sums=arguments.check_sums,
        fairness=arguments.fairness,
        reduce=arguments.reduce,
        bisim=arguments.bisim,
        strategy=arguments.exportstrat is not None,
        ltl2da=arguments.ltl2datool,
        ltl2da_syntax=arguments.ltl2dasyntax,
    )


def run(job: Job) -> int:
    """Carry out a job; gives the exit status. Raises SymcheckError for what concerns the run as a whole."""
    a = job.arguments
    job.imported = exports.imported(a)
    exports.targets(a)
    if job.imported is not None and a.properties is None:
        # The first file is the model's only where there is no other model.
        a.model, a.properties = None, a.model
    if a.model is None and job.imported is None:
        raise UsageError("no model file is given\n  hint: symcheck MODEL [PROPERTIES] [switches]; --help lists the switches")
    _check_method(a.method)
    given = parse_constants(a.const)
    source = a.model or a.importmodel or a.importtrans
    job.report.header([f'Reading model file "{source}"', *([f'Reading properties file "{a.properties}"'] if a.properties else [])])
    program = parse_model_file(a.model) if job.imported is None else job.imported.model.program
    files = [*([parse_properties_file(a.properties)] if a.properties else []), *(parse_properties(t, "-pf") for t in a.pf)]
    file = _joined(files)
    _warn_unknown(job, program, file, given)
    chosen = _chosen(file, a.prop)
    of_model = {n: v for n, v in given.items() if any(c.name == n for c in program.constants)}
    of_file = {n: v for n, v in given.items() if n not in of_model and any(c.name == n for c in file.constants)}
    try:
        for constants in combinations(of_model):
            _instance(job, program, file, chosen, constants, of_file)
    except _Stop:
        pass
    job.report.end()
    return 1 if job.failures else 0


def _check_method(name: str) -> None:
    """Complain about an unknown -method before the model is built. Raises UsageError."""
    if name == "auto":
        return
    from symcheck.numerics.methods import METHODS

    if name not in METHODS:
        raise UsageError(f"-method: there is no method '{name}'\n  hint: known are auto, {', '.join(METHODS)}")


def _joined(files: Sequence[PropertiesFile]) -> PropertiesFile:
    def all_of(part: str) -> tuple:  # type: ignore[type-arg]
        return tuple(x for f in files for x in getattr(f, part))

    return PropertiesFile(*(all_of(part) for part in ("constants", "formulas", "labels", "properties")))


def _warn_unknown(job: Job, program: Program, file: PropertiesFile, given: Mapping[str, Sequence[str]]) -> None:
    """Warn of values for constants that do not exist. No error: scripts give one list to many models."""
    for diagnostic in split_constants(program, file, dict.fromkeys(given, "0")).warnings:
        hint = f" ({diagnostic.hint})" if diagnostic.hint else ""
        job.report.warn(f"-const: {diagnostic.message}{hint}")


def _chosen(file: PropertiesFile, which: str | None) -> list[int]:
    """Indices of the properties to check, in the order of the file."""
    if which is None:
        return list(range(len(file.properties)))
    chosen: set[int] = set()
    for item in (part.strip() for part in which.split(",")):
        found = _named(file, item)
        if not found:
            names = ", ".join(p.name for p in file.properties if p.name)
            count = len(file.properties)
            hint = f"there {'is' if count == 1 else 'are'} {count or 'none'}" + (f", among them {names}" if names else "")
            raise NameFault(Diagnostic(f"-prop: there is no property '{item}'", code="unknown-property", hint=hint))
        chosen.update(found)
    return sorted(chosen)


def _named(file: PropertiesFile, item: str) -> list[int]:
    """Indices of the properties that NAME, N or N-N means; none where one of them does not exist."""
    by_name = [i for i, p in enumerate(file.properties) if p.name == item]
    low, dash, high = item.partition("-")
    if by_name or not (low.isdecimal() and (high.isdecimal() or not dash)):
        return by_name
    first, last = int(low), int(high) if dash else int(low)
    return list(range(first - 1, last)) if 1 <= first <= last <= len(file.properties) else []


def _instance(
    job: Job, program: Program, file: PropertiesFile, chosen: Sequence[int], constants: Values, others: Mapping[str, Sequence[str]]
) -> None:
    """Bind and build the model with these constants, and check the chosen properties on it."""
    options = options_of(job.arguments)
    kind = ModelType(job.arguments.model_type) if job.arguments.model_type else None
    try:
        read = None if job.imported is None else job.imported.model
        model = read or bind(program, constants, model_type=kind, exact=options.exact)
        job.report.model(model, constants)
        asked = list(_asked(program, file, chosen, others))
        if options.reduce and read is None:
            model = _reduced(job, model, [question for question, _ in asked])
        simulated = simulation(job.arguments, job.report, model)
        if job.arguments.simpath and simulated is None and not asked:
            return
        subject = simulated or _build(job, model, options)
    except ResourceError:
        raise
    except SymcheckError as error:
        if not job.testing:
            raise
        # An error is a result that RESULT lines may expect, of every property.
        job.report.error(error)
        for i in chosen:
            known = {n: _plain(v) for n, v in {**constants, **{n: v[0] for n, v in others.items()}}.items()}
            _conclude(job, judge(file.properties[i].comments, error, known, exact=options.exact))
        return
    if not isinstance(subject, Simulation):
        engine = subject
        exports.export_model(job.arguments, job.report, engine, options, lambda: _labels(engine, file, others))
        exports.report_distributions(job.arguments, job.report, engine, options)
    for question, choice in asked:
        _check(job, subject, question, options, constants, choice)


def _labels(engine: Engine, file: PropertiesFile, others: Mapping[str, Sequence[str]]) -> Mapping[str, Expression]:
    """The labels of the model and of the properties (with the first of the values that a constant has)."""
    return bind_properties(file, engine.model, {n: v[0] for n, v in others.items()}).labels


def _asked(
    program: Program, file: PropertiesFile, chosen: Sequence[int], others: Mapping[str, Sequence[str]]
) -> Iterator[tuple[Question, Values]]:
    """The chosen properties with every choice of the constants that each needs."""
    needed = needed_constants(program, file)
    for i in chosen:
        for choice in combinations({n: v for n, v in others.items() if n in needed[i]}):
            yield Question(file, i, {**{n: v[0] for n, v in others.items()}, **choice}), choice


def _reduced(job: Job, model: BoundModel, questions: Sequence[Question]) -> BoundModel:
    """The model with dead variables reset, for these questions, unless that is refused with a warning."""
    if job.arguments.fairness:
        job.report.warn("-reduce is not used: which strategies are fair depends on the states")
        return model
    reduction = reduced(model, questions)
    job.report.line(f"Reduction:   {reduction}")
    return reduction.model


def internal(error: Exception) -> SymcheckError:
    """A defect of symcheck, as an error that can be reported."""
    where = traceback.extract_tb(error.__traceback__)[-1]
    return SymcheckError(
        f"internal error: {type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})\n"
        "  hint: this is a defect of symcheck; please report it with the model"
    )


def _plain(text: str) -> bool | int | float:
    """A constant's value for the comparison with RESULT lines where nothing could be bound."""
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text)
    except ValueError:
        try:
            return float(text)
        except ValueError:
            return float("nan")


def _build(job: Job, model: BoundModel, options: Options) -> Engine:
    started = perf_counter()
    watch = Progress(job.report)
    # Watching a diagram grow costs time (states are counted on the way): only where somebody looks.
    engine = job.imported or registry.build(model, options, watch if options.engine == "auto" or watch.wanted else None)
    watch.clear()
    job.report.built(engine, watch.choice, perf_counter() - started)
    return engine


def _check(job: Job, subject: Engine | Simulation, question: Question, options: Options, constants: Values, choice: Values) -> None:
    bound, labels = question.bind(subject.model)
    text = property_text(bound)
    job.report.property(text, bound.name, constants, choice)
    outcome: Result | SymcheckError
    try:
        if isinstance(subject, Simulation):
            outcome = subject.check(bound.formula, labels)
        else:
            outcome = check(subject, bound.formula, options, labels=labels, rebind=question.formula)
        job.report.result(outcome)
        if outcome.strategy is not None:
            _export_strategy(job, outcome)
        job.rows.append(Row(bound.name or text, {**constants, **choice}, show_value(outcome.value), str(outcome.accuracy)))
    except ResourceError:
        raise
    except Exception as error:  # a defect in one property must not take the others along
        outcome = error if isinstance(error, SymcheckError) else internal(error)
        job.report.error(outcome)
        job.failures += not job.testing
        job.rows.append(Row(bound.name or text, {**constants, **choice}, "Error", str(outcome).splitlines()[0]))
    if job.testing and isinstance(outcome, Result) and isinstance(outcome.accuracy, Statistical):
        _conclude(job, Verdict(VerdictKind.NOT_TESTED, "the result is an estimate"))
    elif job.testing:
        _conclude(job, judge(bound.comments, outcome, bound.constants, exact=options.exact))


def _export_strategy(job: Job, outcome: Result) -> None:
    """Write the strategy; "stdout" is no file. Of several properties the last one's is left in the file."""
    from symcheck.exchange.strategies import strategy_target, write_strategy

    path, kind, reach = strategy_target(job.arguments.exportstrat)
    if path == "stdout":
        write_strategy(outcome.strategy, job.report.out, kind, reach=reach)
        return
    with open(path, "w", encoding="utf-8") as file:
        write_strategy(outcome.strategy, file, kind, reach=reach)
    job.report.line(f'Strategy written to "{path}" ({kind})')


def _conclude(job: Job, verdict: object) -> None:
    job.report.verdict(verdict)
    kind = getattr(verdict, "kind", None)
    if kind in (VerdictKind.FAIL, VerdictKind.UNSUPPORTED):
        job.failures += 1
        if job.arguments.test and kind is VerdictKind.FAIL:
            raise _Stop


def results_file(argument: str) -> tuple[Path, list[str]]:
    """`FILE:KIND,KIND` taken apart; a colon that belongs to the file's name is left in it."""
    path, colon, kinds = argument.rpartition(":")
    if not colon:
        return Path(argument), ["text"]
    return Path(path), kinds.split(",")


def sorted_rows(rows: Sequence[Row]) -> Iterator[Row]:
    """Rows of the same property together, in the order of its first row."""
    order = {name: i for i, name in enumerate(dict.fromkeys(r.property for r in rows))}
    return iter(sorted(rows, key=lambda r: order[r.property]))
