"""What a worker computes: each job calls the library, and gives what the browser shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

from symcheck.api.model import Model
from symcheck.api.progress import Reporter
from symcheck.check.counterexample import Counterexample
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import Result, bounds_text, show_value
from symcheck.engines.base import erased
from symcheck.errors import Diagnostic, InputError, SymcheckError, UnsupportedError, UsageError
from symcheck.experiments.rows import Row, constant_text, error_text
from symcheck.experiments.run import Progress, experiment
from symcheck.options import OPTIONS, Option, make_options, read_options
from symcheck.page.document import document
from symcheck.semantics.binding.bind import split_constants
from symcheck.simulate.snapshot import snapshot
from symcheck.simulate.stepper import Simulator
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import parse_model, parse_properties
from symcheck.view.choice_graph import ChoiceGraph
from symcheck.view.picture import Picture
from symcheck.view.states import neighbourhood, state_graph
from symcheck.workbench.language import faults

__all__ = ["EXPORTS", "JOBS", "done", "shown_options"]

Job = Mapping[str, Any]
Answer = dict[str, Any]
Say = Callable[[Answer], None]

EXPORTS = ("tra", "sta", "lab", "srew", "trew", "pexp", "dot", "drn", "jani")
"""The files that a model is written to; `symcheck.export` describes them."""

_WITHOUT_FIELD = (
    *("strategy", "everywhere"),  # jobs set them
    *("regions", "lifting"),  # of parameters, which have no field
    *("ltl2da", "ltl2da_syntax", "workdir"),  # programs and folders: not from a browser
)
_MOST_STEPS = 10_000
"""Steps of a path that are taken at once."""
_DRAWN = 120
"""States of a neighbourhood that are drawn; Graphviz takes a second."""


def shown_options() -> list[Option]:
    """The options with a field."""
    return [o for o in OPTIONS if o.name not in _WITHOUT_FIELD]


class _Session:
    """What is kept between jobs: the last model, and the path of the simulator."""

    def __init__(self) -> None:
        self._key: object = None
        self._model: Model | None = None
        self.simulator: Simulator | None = None
        self.say: Say = lambda _: None
        self.reporter = Reporter(lambda _: None)

    def model(self, job: Job, **more: object) -> tuple[Model, PropertiesFile, dict[str, str]]:
        """The model of a job with its options, its properties, and the constants of these."""
        program = parse_model(job["model"], job.get("model_name") or "model")
        file = PropertiesFile()
        if job.get("properties"):
            file = parse_properties(job["properties"], job.get("properties_name") or "properties")
        given = {n: v for n, v in job.get("constants", {}).items() if v}
        split = split_constants(program, file, given)
        of_properties = {n: str(v) for n, v in split.of_properties.items()}
        options = {**_options(job.get("options", {})), **more}
        key = (job["model"], sorted(split.of_model.items()), sorted(options.items(), key=str))
        if key != self._key or self._model is None:
            given_options = make_options(options)
            model = Model(program, split.of_model, given_options, observer=self.reporter)
            self._model = model.checked()
            self._key = key
        return self._model, file, of_properties


_SESSION = _Session()


def _options(texts: Mapping[str, str]) -> dict[str, object]:
    known = {o.name for o in shown_options()}
    for name in texts:
        if name not in known:
            raise UsageError(f"there is no option '{name}'")
    return read_options(texts)


def _checked(job: Job, **more: object) -> tuple[Model, Result]:
    """The model and the result of one property."""
    model, file, constants = _SESSION.model(job, **more)
    values = {n: (v,) for n, v in constants.items()}
    instances = model.instances(file, values, [_number(file, job["property"])])
    prepared = model.prepared_for(instances)
    return model, prepared.check(instances[0], _SESSION.reporter.iteration)


def _number(file: PropertiesFile, wanted: str) -> int:
    """The number of the property with a text: that in the browser may be older than the file."""
    for i in range(len(file.properties)):
        if PropertyInstance(file, i, {}).text == wanted:
            return i
    raise UsageError(f"the properties have changed: there is no {wanted}")


# ------------------------------------------------------------------------------------------- jobs


def _build(job: Job) -> Answer:
    model, _, _ = _SESSION.model(job)
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
    model, _, _ = _SESSION.model(job, time_limit=5.0)
    found = model.state_warnings
    return {
        "states": model.engine.states,
        "faults": faults(job["model"], [d for d in found if d.span.source.text]),
        "about": "; ".join(d.message for d in found if not d.span.source.text),
    }


def _check(job: Job) -> Answer:
    model, result = _checked(job)
    lines = [*map(str, result.lines[:1000]), *result.warnings, *result.notes]
    return {
        "value": show_value(result.value),
        "holds": result.value if isinstance(result.value, bool) else None,
        "accuracy": str(result.accuracy),
        "bounds": bounds_text(result),
        "about": result.explanation,
        "seconds": result.seconds,
        "lines": lines,
        "warnings": _warnings(model) if model.is_built else [],
        "chooses": model.type.has_choices,
    }


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
    }


def _saved(save: Callable[[Path], object], name: str) -> str:
    """The text of a file that is saved."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        save(path)
        return path.read_text(encoding="utf-8")


def _page(job: Job) -> Answer:
    """The state graph, the simulator, the diagrams, and the iterations of each property."""
    model, file, constants = _SESSION.model(job)
    page = model.page(file, constants, max_states=job["states"], title=job["model_name"])
    return {"html": page.html}


def _graph(job: Job) -> Answer:
    """The states near those that satisfy a formula, with the path of the simulator."""
    model, around = _SESSION.model(job, engine="explicit")[0], job["around"]
    drawn, radius = neighbourhood(model, around)
    note = f"The states that are at most {radius} steps from these, which are green: {around}"
    return {"html": _picture("Neighbourhood", note, drawn)}


def _picture(name: str, note: str, drawn: Picture) -> str:
    show = {"name": name, "note": note, "panes": [0], "frames": [{}]}
    return document({"title": name, "graphs": [drawn.svg], "shows": [show], "embedded": True})


def _explain(job: Job) -> Answer:
    """The counterexample or witness of a bound, in words and on the graph."""
    model, result = _checked(job, engine="explicit")
    found = result.witness_or_none or result.counterexample(100)
    text = str(found) if isinstance(found, Counterexample) else "\n".join(map(str, found))
    answer = {"text": text}
    try:
        if isinstance(found, Counterexample):
            around = sorted({s.number for path in found.paths for s in path})
        else:
            numbers = ChoiceGraph(model.engine)
            around = sorted({numbers.number(tuple(s.values())) for s in found})
        drawn = state_graph(
            model, path=found, around=around, radius=0, max_states=_DRAWN, title="counterexample"
        )
        answer["html"] = _picture("Counterexample", "The paths are red.", drawn)
    except UnsupportedError as error:
        answer["text"] += f"\n{error.message}"
    return answer


def _strategy(job: Job) -> Answer:
    """The choices of the strategy of a property, as a table and on the graph."""
    result = _checked(job, engine="explicit", strategy=True)[1]
    strategy = result.strategy
    answer = {"text": str(strategy)}
    try:
        drawn = state_graph(
            erased(strategy.engine), strategy=strategy, max_states=_DRAWN, title="strategy"
        )
        answer["html"] = _picture("Strategy", str(result), drawn)
    except UnsupportedError as error:
        answer["text"] += f"\n{error.message}"
    return answer


def _export(job: Job) -> Answer:
    """The text of a file of the model."""
    from symcheck.exchange.api_io import export

    kind = job["kind"]
    if kind not in EXPORTS:
        raise UsageError(f"there is no export '{kind}'", hint=", ".join(EXPORTS))
    model, file, constants = _SESSION.model(job)
    with TemporaryDirectory() as folder:
        target = str(Path(folder) / f"model.{kind}")
        export(model, target, file if kind == "jani" else None, constants)
        found = {p.name: p.read_text(encoding="utf-8") for p in sorted(Path(folder).iterdir())}
    return {"files": found}


# -------------------------------------------------------------------------------------- simulator


def _start(job: Job) -> Answer:
    model = _SESSION.model(job)[0]
    seed = job.get("seed")
    _SESSION.simulator = model.simulator(int(seed) if seed else None)
    return {**snapshot(_SESSION.simulator), "seed": _SESSION.simulator.seed}


def _move(job: Job) -> Answer:
    """A step, some steps, or steps back."""
    simulator = _simulator()
    known = len(simulator.path)
    match job["move"]:
        case "step":
            simulator.step(job.get("choice"), job.get("branch"))
        case "run":
            simulator.run(min(int(job["steps"]), _MOST_STEPS))
        case "follow":
            strategy = _checked(job, engine="explicit", strategy=True)[1].strategy
            simulator.run(min(int(job["steps"]), _MOST_STEPS), strategy)
        case "back":
            for _ in range(min(int(job.get("steps", 1)), known)):
                simulator.back()
        case "restart":
            simulator.restart()
        case other:
            raise UsageError(f"there is no move '{other}'")
    return snapshot(simulator, known + 1)


def _simulator() -> Simulator:
    if _SESSION.simulator is None:
        raise UsageError("there is no path any more", hint="start a new one")
    return _SESSION.simulator


JOBS: Mapping[str, Callable[[Job], Answer]] = {
    "build": _build,
    "explore": _explore,
    "check": _check,
    "experiment": _experiment,
    "page": _page,
    "graph": _graph,
    "explain": _explain,
    "strategy": _strategy,
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
