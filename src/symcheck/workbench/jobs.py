"""What a worker computes: each job calls the library, and gives what the browser shows."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from fractions import Fraction
from io import StringIO
from math import inf, isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, TypeVar

import numpy as np

from symcheck.api.model import Model
from symcheck.api.progress import Reporter
from symcheck.check.counterexample import Counterexample
from symcheck.check.explanation.path_search import is_explained
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result, Statistical, bounds_text, show_value
from symcheck.check.state_distributions import Distribution
from symcheck.engines.states import variable_names
from symcheck.errors import (
    Diagnostic,
    InputError,
    SymcheckError,
    SyntaxFault,
    UnsupportedError,
    UsageError,
)
from symcheck.experiments.rows import Row, constant_text, error_text
from symcheck.experiments.run import Progress, experiment
from symcheck.matrices.numbers import doubles
from symcheck.options import (
    make_options,
    read_count,
    read_fraction,
    read_number,
    read_options,
)
from symcheck.page.document import document
from symcheck.semantics.binding.bind import split_constants
from symcheck.semantics.expressions.literals import format_value
from symcheck.simulate.snapshot import snapshot
from symcheck.simulate.statistics import METHODS, Plan
from symcheck.simulate.stepper import Simulator
from symcheck.syntax.declarations import Program, PropertiesFile
from symcheck.syntax.parse import parse_model
from symcheck.syntax.properties_in_part import PropertiesInput, parse_properties_in_part
from symcheck.view.picture import Picture, Room
from symcheck.view.states import neighbourhood, paths_graph, strategy_graph
from symcheck.workbench.language import faults
from symcheck.workbench.option_fields import shown_options

__all__ = ["EXPORTS", "JOBS", "done"]

Job = Mapping[str, Any]
Answer = dict[str, Any]
Say = Callable[[Answer], None]
T = TypeVar("T")

EXPORTS = ("tra", "sta", "lab", "srew", "trew", "pexp", "dot", "drn", "jani")
"""The files that a model is written to; `symcheck.export` describes them."""

_MOST_STEPS = 10_000
"""Steps of a path that are taken at once, at most."""
_LISTED = 200
"""States of a distribution that are listed; its CSV file has all."""
_READABLE = 0.8
"""Pixels of a page for a point of a picture that fits: letters of 11 points are 9 pixels high."""


class _Session:
    """What is kept between jobs: the last model, and the path of the simulator."""

    def __init__(self) -> None:
        self._key: object = None
        self._model: Model | None = None
        self.simulator: Simulator | None = None
        self.say: Say = lambda _: None
        self.reporter = Reporter(lambda _: None)

    def model(self, job: Job, **more: object) -> tuple[Model, PropertiesFile, dict[str, str]]:
        """The model of a job with its options, those of its properties that follow the grammar, and
        the constants of these.
        """
        program, file = _program(job), _properties(job).parsed
        given = {n: v for n, v in job.get("constants", {}).items() if v}
        return self._kept(job, program, file, given, more)

    def model_alone(self, job: Job, **more: object) -> Model:
        """The model of a job that no property is about: those may have faults."""
        program, constants = _program(job), job.get("constants", {})
        given = {c.name: v for c in program.constants if (v := constants.get(c.name))}
        return self._kept(job, program, PropertiesFile(), given, more)[0]

    def _kept(
        self,
        job: Job,
        program: Program,
        file: PropertiesFile,
        given: Mapping[str, str],
        more: Mapping[str, object],
    ) -> tuple[Model, PropertiesFile, dict[str, str]]:
        """The model that is kept, or a new one in its place."""
        split = split_constants(program, file, given)
        of_properties = {n: str(v) for n, v in split.of_properties.items()}
        options = {**_options(job.get("options", {})), **more}
        key = (
            program.span.source.name,
            job["model"],
            sorted(split.of_model.items()),
            sorted(options.items(), key=str),
        )
        if key != self._key or self._model is None:
            given_options = make_options(options)
            model = Model(program, split.of_model, given_options, observer=self.reporter)
            self._model = model.checked()
            self._key = key
        return self._model, file, of_properties


def _program(job: Job) -> Program:
    return parse_model(job["model"], job.get("model_name") or "model")


def _properties(job: Job) -> PropertiesInput:
    name = job.get("properties_name") or "properties"
    return parse_properties_in_part(job.get("properties", ""), name)


_SESSION = _Session()


def _options(texts: Mapping[str, str]) -> dict[str, object]:
    known = {o.name for o in shown_options()}
    for name in texts:
        if name not in known:
            raise UsageError(f"there is no option '{name}'")
    return read_options(texts)


def _asked(job: Job, **more: object) -> tuple[Model, PropertyInstance]:
    """The model and the property that a job is about."""
    model, file, constants = _SESSION.model(job, **more)
    values = {n: (v,) for n, v in constants.items()}
    return model, model.instances(file, values, [_number(file, job["property"])])[0]


def _checked(job: Job, **more: object) -> tuple[Model, Result]:
    """The model and the result of one property."""
    model, instance = _asked(job, **more)
    prepared = model.prepared_for([instance])
    return model, prepared.check(instance, _SESSION.reporter.iteration)


def _number(file: PropertiesFile, wanted: str) -> int:
    """The number of the property with a text: that in the browser may be older than the file."""
    for i in range(len(file.properties)):
        if PropertyInstance(file, i, {}).text == wanted:
            return i
    raise UsageError(f"the properties have changed: there is no {wanted}")


# ------------------------------------------------------------------------------------------- jobs


def _build(job: Job) -> Answer:
    model = _SESSION.model_alone(job)
    started = perf_counter()
    engine = model.engine
    facts = [["type", model.type.value], ["states", f"{engine.states:,}"]]
    facts += [["choices", f"{engine.choices:,}"]] if model.type.has_choices else []
    facts += [["transitions", f"{engine.transitions:,}"]]
    facts += [[f'"{name}"', f"{len(states):,}"] for name, states in model.labels.items()]
    return {"facts": facts, "warnings": _warnings(model), "seconds": perf_counter() - started}


def _warnings(model: Model) -> list[str]:
    """What was perhaps not meant in a model: as far as its text shows it, and its states."""
    found = [*model.warnings, *model.state_warnings]
    return [*model.bound.warnings, *map(_with_line, found)]


def _with_line(found: Diagnostic) -> str:
    if not found.span.source.text:  # of no place
        return found.sentence
    return f"line {found.span.source.position(found.span.start)[0]}: {found.sentence}"


def _explore(job: Job) -> Answer:
    """Find the faults of a model that only its states show, for some seconds."""
    model = _SESSION.model_alone(job, time_limit=5.0)
    found = model.state_warnings
    return {
        "states": model.engine.states,
        "faults": faults(job["model"], [d for d in found if d.span.source.text]),
        "about": "; ".join(d.message for d in found if not d.span.source.text),
    }


def _check(job: Job) -> Answer:
    model, result = _checked(job)
    return {**_told(model, result), "explains": _explains(job, result)}


def _explains(job: Job, result: Result) -> bool:
    """Whether there is a counterexample or witness."""
    if result.witness_or_none:
        return True
    if result.explain is None or not isinstance(result.value, bool):
        return False
    model, instance = _asked(job)
    formula = instance.bind(model.bound)[0].formula
    return is_explained(formula, model.bound, model.options, holds=result.value)


def _estimate(job: Job) -> Answer:
    model, instance = _asked(job)
    plan = _plan(job["sampling"])
    result = model.estimate_instance(instance, plan, observer=_SESSION.reporter)
    return {**_told(model, result), "explains": False}


def _positive(text: str) -> float:
    value = read_number(text)
    if not 0 < value < inf:
        raise ValueError(f"'{text}' is not a positive number")
    return value


_SAMPLING: Mapping[str, Callable[[str], Any]] = {
    "method": str.lower,
    "samples": read_count,
    "error": read_fraction,
    "width": _positive,
    "most": _positive,
    "max_steps": read_count,
    "seed": read_count,
}
"""How the fields of a plan are read."""


def _field(name: str, read: Callable[[str], T], text: str) -> T:
    """The value of a field. Raises UsageError."""
    try:
        return read(text)
    except ValueError as error:
        raise UsageError(f"{name}: {error}") from None


def _plan(texts: Mapping[str, str]) -> Plan:
    """How paths are sampled. Raises UsageError."""
    given = {}
    for name, text in texts.items():
        if name not in _SAMPLING:
            raise UsageError(f"there is no setting '{name}'")
        given[name] = _field(name, _SAMPLING[name], text)
    if given.get("method", "ci") not in METHODS:
        raise UsageError(f"method: {given['method']!r} is none of {', '.join(METHODS)}")
    return Plan(**given)


def _told(model: Model, result: Result) -> Answer:
    """What the page shows of a result."""
    lines = [*map(str, result.lines[:1000]), *result.warnings, *result.notes]
    return {
        "value": show_value(result.value),
        "holds": result.value if isinstance(result.value, bool) else None,
        "accuracy": str(result.accuracy),
        "bounds": bounds_text(result),
        "about": result.explanation,
        "sampled": isinstance(result.accuracy, Statistical),
        "seconds": result.seconds,
        "lines": lines,
        "warnings": _warnings(model) if model.is_built else [],
    }


def _distribution(job: Job) -> Answer:
    """The likeliest states at a time, or in the long run (""); as CSV all of them."""
    model = _SESSION.model_alone(job)
    found = model.transient(_time(job["time"])) if job["time"] else model.steady_state()
    if job.get("all"):
        return {"csv": _csv(found)}
    values = doubles(found.values)
    positive = np.flatnonzero(values > (0 if found.exact else found.error))
    listed = positive[np.argsort(-values[positive], kind="stable")][:_LISTED]
    engine, members = found.engine, np.zeros(len(found), np.bool_)
    members[listed] = True
    states = engine.valuations(engine.from_bools(members))
    by_number = dict(zip(np.flatnonzero(members).tolist(), states, strict=True))
    if found.exact:
        accuracy = "exact"
    elif found.certified:
        accuracy = f"certified: +/- {found.error:.1E}"
    else:
        accuracy = "an estimate: their error is unknown"
    return {
        "variables": variable_names(engine.model),
        "rows": [
            [*map(format_value, (*by_number[number], probability))]
            for number, probability in zip(
                listed.tolist(), found.values[listed].tolist(), strict=True
            )
        ],
        "positive": len(positive),
        "within": 0 if found.exact else found.error,
        "states": len(found),
        "about": f"each probability is {accuracy} ({found.explanation})",
        "seconds": found.seconds,
    }


def _time(text: str) -> float:
    try:
        return float(Fraction(text))
    except (ValueError, ArithmeticError):
        raise UsageError(f"'{text}' is not a time, such as 2, 0.5 or 1/3") from None


def _csv(found: Distribution) -> str:
    """A line for each state, in the order of their numbers."""
    file = StringIO()
    writer = csv.writer(file, lineterminator="\n")
    columns = found.columns()
    writer.writerow(columns)
    values = (np.asarray(column).tolist() for column in columns.values())
    writer.writerows([*map(format_value, row)] for row in zip(*values, strict=True))
    return file.getvalue()


def _experiment(job: Job) -> Answer:
    model, file, _ = _SESSION.model({**job, "constants": {}})
    ranges = ",".join(f"{n}={v}" for n, v in job["constants"].items() if v)
    only = None if job["property"] is None else [_number(file, job["property"])]

    def tell(event: Progress) -> None:
        _SESSION.say({"progress": str(event), "rows": [_row(r) for r in event.rows]})

    found = experiment(model, file, ranges or None, only=only, progress=tell)
    return {"varying": list(found.varying), "csv": _saved(found.save, "results.csv")}


def _row(row: Row) -> Answer:
    low, high = row.bounds or (None, None)
    numbers = [None if x is None or not isfinite(x) else x for x in (row.number, low, high)]
    return {
        "property": row.name,
        "constants": {n: constant_text(v) for n, v in row.constants.items()},
        "numbers": numbers,
        "text": row.text,
        "accuracy": row.error or str(row.accuracy),
        "error": row.error or "",
    }


def _saved(save: Callable[[Path], object], name: str) -> str:
    """The text of a file that is saved."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        save(path)
        return path.read_text(encoding="utf-8")


def _page(job: Job) -> Answer:
    """The state graph, the simulator, the diagrams, and the iterations of each property."""
    try:
        model, file, constants = _SESSION.model(job)
    except InputError:  # of the properties, perhaps: the model is drawn without them
        model, file, constants = _SESSION.model_alone(job), PropertiesFile(), {}
    try:
        page = model.page(file, constants, max_states=job["states"], title=job["model_name"])
    except UnsupportedError as error:  # of the class of the model: its states can be drawn
        return {"html": _first_states(job, error.message)}
    return {"html": page.html}


def _first_states(job: Job, why: str) -> str:
    """The states nearest to the initial ones, where there is no page."""
    model, most = _SESSION.model_alone(job, engine="explicit"), job["states"]
    drawn, radius = neighbourhood(model, '"init"', max_states=most, radius=most, room=_room(job))
    note = f"The states at most {radius} steps from the initial ones, which are green ({why})."
    return _picture("States", note, drawn)


def _graph(job: Job) -> Answer:
    """The states near those that satisfy a formula, with the path of the simulator."""
    model, around = _SESSION.model_alone(job, engine="explicit"), job["around"]
    drawn, radius = neighbourhood(model, around, room=_room(job))
    note = f"The states that are at most {radius} steps from these, which are green: {around}"
    return {"html": _picture("Neighbourhood", note, drawn)}


def _room(job: Job) -> Room:
    """The room that the page has for a picture."""
    width, height = job["room"]
    return Room(width / _READABLE, height / _READABLE)


def _picture(name: str, note: str, drawn: Picture) -> str:
    show = {"name": name, "note": note, "panes": [0], "frames": [{}]}
    return document({"title": name, "graphs": [drawn.svg], "shows": [show], "embedded": True})


def _explain(job: Job) -> Answer:
    """The counterexample or witness of a bound, in words and on the graph."""
    model, result = _checked(job, engine="explicit")
    found = result.witness_or_none or result.counterexample()
    if isinstance(found, Counterexample):
        text = str(found)
    else:
        text = "\n".join(f"{number}: {_state(state)}" for number, state in enumerate(found))
    answer = {"text": text}
    try:
        if isinstance(found, Counterexample) and not found.paths:
            return answer
        drawn, count = paths_graph(model, found, room=_room(job))
        note = "The path is red."
        if isinstance(found, Counterexample) and len(found.paths) > 1:
            note = (
                f"{count} of {len(found.paths)} paths are red" if count > 1 else "One path is red"
            )
            together = float(sum(path.probability for path in found.paths[:count]))
            note += f", none of the others likelier: probability {together:.6g}."
        answer["html"] = _picture("Counterexample", f"{note} Other states are left out.", drawn)
    except UnsupportedError as error:
        answer["text"] += f"\n{error.message}"
    return answer


def _state(values: Mapping[str, int | bool]) -> str:
    return ", ".join(f"{name}={format_value(value)}" for name, value in values.items())


def _strategy(job: Job) -> Answer:
    """The choices of the strategy of a property, as a table and on the graph."""
    result = _checked(job, engine="explicit", strategy=True)[1]
    strategy = result.strategy
    answer = {"text": str(strategy)}
    try:
        drawn, count = strategy_graph(strategy, room=_room(job))
        note = str(job.get("value") or result)
        if count < strategy.engine.states:
            note += (
                f". The {count} states nearest to the initial ones, of {strategy.engine.states:,}"
            )
        answer["html"] = _picture("Strategy", note, drawn)
    except UnsupportedError as error:
        answer["text"] += f"\n{error.message}"
    return answer


def _export(job: Job) -> Answer:
    """The text of a file of the model."""
    from symcheck.exchange.api_io import export

    kind = job["kind"]
    if kind not in EXPORTS:
        raise UsageError(f"there is no export '{kind}'", hint=", ".join(EXPORTS))
    file: PropertiesFile | None
    if kind == "jani":
        if faulty := _properties(job).diagnostics:  # a file has all properties, or there is none
            raise SyntaxFault(*faulty)
        model, file, constants = _SESSION.model(job)
    else:
        model, file, constants = _SESSION.model_alone(job), None, {}
    with TemporaryDirectory() as folder:
        target = str(Path(folder) / f"model.{kind}")
        export(model, target, file, constants)
        return {"files": _texts_in(Path(folder))}


def _texts_in(folder: Path) -> dict[str, str]:
    """The texts of the files of a folder."""
    return {p.name: p.read_text(encoding="utf-8") for p in sorted(folder.iterdir())}


def _strategy_files(job: Job) -> Answer:
    """The strategy of a property as files, which `symcheck -exportstrat` writes too."""
    from symcheck.exchange.strategies.files import KINDS, strategy_target, write_strategy_files

    kind = job["kind"]
    if kind not in KINDS:
        raise UsageError(f"there is no kind '{kind}' of strategy files", hint=", ".join(KINDS))
    strategy = _checked(job, engine="explicit", strategy=True)[1].strategy
    with TemporaryDirectory() as folder:
        ending = {"induced": "all", "dot": "dot"}.get(kind, "txt")
        target = strategy_target(f"{folder}/model_strategy_{kind}.{ending}:type={kind}")
        write_strategy_files(strategy, target, StringIO())
        return {"files": _texts_in(Path(folder))}


# -------------------------------------------------------------------------------------- simulator


def _start(job: Job) -> Answer:
    model = _SESSION.model_alone(job)
    seed = _field("seed", read_count, job["seed"]) if job.get("seed") else None
    _SESSION.simulator = model.simulator(seed, job.get("from") or None)
    return {**snapshot(_SESSION.simulator), "seed": _SESSION.simulator.seed}


def _move(job: Job) -> Answer:
    """A step, some steps, or steps back."""
    simulator = _simulator()
    known, note = len(simulator.path), ""
    match job["move"]:
        case "step":
            simulator.step(job.get("choice"), job.get("branch"))
        case "run":
            strategy = None
            if "property" in job:
                strategy = _checked(job, engine="explicit", strategy=True)[1].strategy
            time, now = _time(job["time"]) if "time" in job else inf, simulator.path[-1].time
            if time <= now:
                raise UsageError(f"the path is at time {now:.6g} already", hint="a later time")
            steps = _MOST_STEPS
            if "steps" in job:
                steps = min(_field("steps", read_count, job["steps"]), _MOST_STEPS)
            simulator.run(steps, strategy, time=time)
            if len(simulator.path) - known == _MOST_STEPS:
                note = f"stopped after {_MOST_STEPS:,} steps: Run goes on"
        case "back":
            if (steps := known - job.get("to", known - 1)) > 0:  # else it is there already
                simulator.back(steps)
        case "restart":
            simulator.restart()
        case other:
            raise UsageError(f"there is no move '{other}'")
    return {**snapshot(simulator, known + 1), "note": note}


def _simulator() -> Simulator:
    if _SESSION.simulator is None:
        raise UsageError("there is no path any more", hint="start a new one")
    return _SESSION.simulator


JOBS: Mapping[str, Callable[[Job], Answer]] = {
    "build": _build,
    "explore": _explore,
    "check": _check,
    "estimate": _estimate,
    "distribution": _distribution,
    "experiment": _experiment,
    "page": _page,
    "graph": _graph,
    "explain": _explain,
    "strategy": _strategy,
    "strategy files": _strategy_files,
    "export": _export,
    "start": _start,
    "move": _move,
}


def done(job: Job, say: Say) -> Answer:
    """Do a job: its `result`, or an `error` with the faults of the texts."""
    _SESSION.reporter.say = lambda text: say({"progress": text})
    _SESSION.say = say
    try:
        return {"result": JOBS[job["do"]](job)}
    except SymcheckError as error:
        answer: Answer = {"message": str(error)}
        if isinstance(error, InputError):
            answer["message"] = "\n".join(map(str, error.diagnostics))
            answer["faults"] = {
                part: faults(
                    job.get(part, ""),
                    [d for d in error.diagnostics if d.span.source.name == job.get(f"{part}_name")],
                )
                for part in ("model", "properties")
            }
        return {"error": answer}
    except (Exception, MemoryError) as error:  # a defect, or a wrong question: the worker goes on
        return {"error": {"message": error_text(error)}}
