"""One run of the command line: read, bind, build, check, for every choice of constants."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.check.expected_results import judge
from symcheck.check.property_instance import Question, lumped, reduced
from symcheck.cli import exports
from symcheck.cli.check_property import Stop, answer, broken, conclude, unbuilt
from symcheck.cli.output_paths import Values
from symcheck.cli.progress import Progress
from symcheck.cli.properties_input import Texts, read_texts
from symcheck.cli.run_state import Job, options_of
from symcheck.cli.simulation import Simulation, simulation
from symcheck.constant_values import combinations, parse_constants
from symcheck.engines import registry
from symcheck.engines.base import Engine
from symcheck.errors import Diagnostic, NameFault, ResourceError, SymcheckError, UsageError
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind, bind_properties, needed_constants, split_constants
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression, ModelType
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.parse import parse_model_file

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient

__all__ = ["run"]

Given = Mapping[str, Sequence[str]]
_MODEL_ENDINGS = (".pm", ".sm", ".nm", ".prism")


def run(job: Job) -> int:
    """Carry out a job; gives the exit status. Raises SymcheckError for what concerns the run as a whole."""
    a = job.arguments
    if a.importmodel is None and a.model is not None and a.model.endswith((".all", ".umb")):
        a.model, a.properties, a.importmodel = a.properties, None, a.model
    job.imported = exports.imported(a)
    exports.targets(a)
    if job.imported is not None and a.properties is None:
        # The first file is the model's only where there is no other model.
        if a.model is not None and a.model.endswith(_MODEL_ENDINGS):
            raise UsageError(f"'{a.model}' and -import… both tell which model to read")
        a.model, a.properties = None, a.model
    if a.model is None and job.imported is None:
        raise UsageError(
            "no model file is given\n  hint: symcheck MODEL [PROPERTIES] [switches]; --help lists the switches"
        )
    _check_method(a.method)
    given = parse_constants(a.const)
    source = a.model or a.importmodel or a.importtrans
    job.report.header(
        [
            f'Reading model file "{source}"',
            *([f'Reading properties file "{a.properties}"'] if a.properties else []),
        ]
    )
    _note_unused(job)
    program = parse_model_file(a.model) if job.imported is None else job.imported.model.program
    texts = read_texts(a.properties, a.pf)
    _warn_unknown(job, program, texts.file, given)
    chosen = _chosen(texts.file, a.prop)
    exports.export_program(a, job.report, program)
    if not a.nobuild:
        _experiments(job, program, texts, chosen, given)
    job.report.end()
    return 1 if job.failures else 0


def _experiments(
    job: Job, program: Program, texts: Texts, chosen: Sequence[int], given: Given
) -> None:
    """Everything that is asked, for every choice of the model's constants."""
    of_model = {n: v for n, v in given.items() if any(c.name == n for c in program.constants)}
    of_file = {
        n: v
        for n, v in given.items()
        if n not in of_model and any(c.name == n for c in texts.file.constants)
    }
    job.fixed = tuple(n for n, values in given.items() if len(values) == 1)
    for fault in texts.declarations:
        job.report.error(fault)
        job.failures += 1
    for i in chosen:
        if i in texts.broken:
            broken(job, texts.broken[i])
    whole = [i for i in chosen if i not in texts.broken]
    models = list(combinations(of_model))
    try:
        for constants in models:
            _instance(job, program, texts.file, whole, constants, of_file, alone=len(models) == 1)
    except Stop:
        pass


def _note_unused(job: Job) -> None:
    """Tell of switches that change nothing."""
    a = job.arguments
    reasons: dict[str, list[str]] = {}
    for switch, reason in a.without_effect.items():
        reasons.setdefault(reason, []).append(switch)
    for reason, switches in reasons.items():
        job.report.line(
            f"Note: {', '.join(switches)} {'have' if len(switches) > 1 else 'has'} no effect: {reason}"
        )
    if a.exact and a.engine is not None:
        job.report.line(
            f"Note: -exact has an engine of its own (states one by one, rational numbers); -{a.engine} has no effect"
        )


def _check_method(name: str) -> None:
    """Complain about an unknown -method before the model is built. Raises UsageError."""
    if name == "auto":
        return
    from symcheck.numerics.linear.methods import METHODS

    if name not in METHODS:
        raise UsageError(
            f"-method: there is no method '{name}'\n  hint: known are auto, {', '.join(METHODS)}"
        )


def _warn_unknown(job: Job, program: Program, file: PropertiesFile, given: Given) -> None:
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
            hint = f"there {'is' if count == 1 else 'are'} {count or 'none'}" + (
                f", among them {names}" if names else ""
            )
            raise NameFault(
                Diagnostic(
                    f"-prop: there is no property '{item}'", code="unknown-property", hint=hint
                )
            )
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
    job: Job,
    program: Program,
    file: PropertiesFile,
    chosen: Sequence[int],
    constants: Values,
    others: Given,
    *,
    alone: bool,
) -> None:
    """Bind and build the model with these constants, and check the chosen properties on it. alone: there is no other choice."""
    options = options_of(job.arguments)
    asked = list(_asked(program, file, chosen, others))
    varying: Values = {} if alone else constants
    try:
        subject = _subject(job, program, [question for question, _ in asked], constants, varying)
    except ResourceError:
        raise
    except SymcheckError as error:
        if job.testing:
            # An error is a result that RESULT lines may expect, of every property.
            job.report.error(error)
            for i in chosen:
                known = {
                    n: _plain(v)
                    for n, v in {**constants, **{n: v[0] for n, v in others.items()}}.items()
                }
                conclude(job, judge(file.properties[i].comments, error, known, exact=options.exact))
        elif alone or isinstance(error, UsageError):
            raise
        else:
            unbuilt(
                job,
                [(_title(file, question.index), choice) for question, choice in asked],
                constants,
                error,
            )
        return
    if subject is None:
        return
    if not isinstance(subject, Simulation):
        engine = subject
        exports.export_constants(job.arguments, job.report, engine.model, varying)
        exports.export_model(
            job.arguments,
            job.report,
            engine,
            options,
            lambda: _labels(engine, file, others),
            varying,
        )
        exports.report_distributions(job.arguments, job.report, engine, options, varying)
    shared = (
        None
        if isinstance(subject, Simulation)
        else _shared(job, subject, [question for question, _ in asked], options)
    )
    for question, choice in asked:
        number = {"property": _file_name(file, question.index)} if len(chosen) > 1 else {}
        answer(
            job,
            subject,
            question,
            options,
            constants,
            choice,
            {**varying, **_varied(choice, others), **number},
            shared,
        )


def _subject(
    job: Job, program: Program, questions: Sequence[Question], constants: Values, varying: Values
) -> Engine | Simulation | None:
    """What the questions are put to: a built model, or random paths; None where nothing is left to be asked."""
    options = options_of(job.arguments)
    kind = ModelType(job.arguments.model_type) if job.arguments.model_type else None
    read = None if job.imported is None else job.imported.model
    model = read or bind(program, constants, model_type=kind, exact=options.exact)
    job.report.model(model, constants)
    if options.reduce and read is None:
        model = _reduced(job, model, questions)
    simulated = simulation(job.arguments, job.report, model, varying)
    if (
        job.arguments.simpath
        and simulated is None
        and not questions
        and not exports.wanted(job.arguments)
    ):
        return None
    return simulated or _build(job, model, options)


def _title(file: PropertiesFile, number: int) -> str:
    """The name of a property, or its text on one line."""
    given = file.properties[number]
    return given.name or " ".join(given.span.text.strip().rstrip(";").split())


def _file_name(file: PropertiesFile, number: int) -> str:
    """The name of a property, or its number from 1, for the names of files."""
    return file.properties[number].name or str(number + 1)


def _varied(choice: Values, others: Given) -> Values:
    """The constants of a property that have several values."""
    return {n: v for n, v in choice.items() if len(others[n]) > 1}


def _labels(engine: Engine, file: PropertiesFile, others: Given) -> Mapping[str, Expression]:
    """The labels of the model and of the properties (with the first of the values that a constant has)."""
    return bind_properties(file, engine.model, {n: v[0] for n, v in others.items()}).labels


def _asked(
    program: Program, file: PropertiesFile, chosen: Sequence[int], others: Given
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
    a = job.arguments
    shown = a.transient is not None or a.steadystate or a.simpath or exports.targets(a)
    reduction = reduced(model, questions, steps=bool(shown))
    job.report.line(f"Reduction:   {reduction}")
    return reduction.model


def _shared(
    job: Job, engine: Engine, questions: Sequence[Question], options: Options
) -> SharedQuotient | None:
    """One quotient by bisimulation for all questions, where that is asked for and a gain."""
    shared = lumped(engine, questions, options)
    if shared is not None:
        job.report.line(f"Bisimulation: {shared}")
    elif options.bisim and len(questions) > 1:
        job.report.detail(
            "Bisimulation: no quotient that is common to the properties is half as large as the model; each gets its own"
        )
    return shared


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
    engine = job.imported or registry.build(
        model, options, watch if options.engine == "auto" or watch.wanted else None
    )
    watch.clear()
    job.report.built(engine, watch.choice, perf_counter() - started)
    return engine
