"""A model checked for many choices of constants: one process per instance, finished ones kept in a journal.

    for done in sweep(Instance.read("model.pm", "model.pctl"), {"N": ("2", "3")}, journal=Path("sweep.jsonl")):
        print(done.constants, done.rows)

An instance has a process of its own, so that its memory is its own and is given back. The journal is a file of JSON
lines, one for each finished instance; a sweep that was stopped and is started again does only what is missing.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field, replace
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter, process_time

from symcheck import __version__
from symcheck.check.checker import check
from symcheck.check.property_instance import Question, lumped, reduced
from symcheck.check.result import show_value
from symcheck.constant_values import combinations
from symcheck.engines import registry
from symcheck.errors import SymcheckError
from symcheck.experiment.table import Row
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind, needed_constants
from symcheck.syntax.parse import parse_model, parse_properties

__all__ = ["Finished", "Instance", "check_instance", "read_journal", "sweep"]

_DEFAULT = Options()
_BYTES = 1 if sys.platform == "darwin" else 1024  # unit of ru_maxrss


@dataclass(frozen=True, slots=True)
class Instance:
    """What one process is asked to do: model and properties as texts, all constants, and the options.

    varying: values of constants of the properties; a property is checked for each choice of those that it needs.
    """

    model: str = field(repr=False)
    properties: str = field(repr=False)
    constants: Mapping[str, str] = field(default_factory=dict)
    varying: Mapping[str, Sequence[str]] = field(default_factory=dict)
    options: Options = _DEFAULT

    @classmethod
    def read(
        cls, model: str | Path, properties: str | Path, options: Options = _DEFAULT
    ) -> Instance:
        """The texts of two files. Raises OSError."""
        return cls(Path(model).read_text(), Path(properties).read_text(), options=options)

    @property
    def key(self) -> str:
        """The same for the same task under the same version of the program."""
        told = [
            __version__,
            self.model,
            self.properties,
            dict(self.constants),
            {n: list(v) for n, v in self.varying.items()},
        ]
        return hashlib.sha256(
            json.dumps([*told, asdict(self.options)], sort_keys=True).encode()
        ).hexdigest()[:20]


@dataclass(frozen=True, slots=True)
class Finished:
    """A checked instance. Times in seconds (of its own process), peak memory in bytes; `error`: why there are no rows."""

    key: str
    constants: Mapping[str, str]
    states: int = 0
    transitions: int = 0
    rows: tuple[Row, ...] = ()
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    memory: int = 0
    error: str | None = None

    def value(self, property: str, **constants: str) -> float:
        """The numeric value of a property (true is 1). Raises KeyError where there is none."""
        for row in self.rows:
            if row.property == property and all(
                row.constants.get(n) == v for n, v in constants.items()
            ):
                return (
                    float(row.value == "true")
                    if row.value in ("true", "false")
                    else float(row.value)
                )
        raise KeyError(property)


def check_instance(instance: Instance) -> Finished:
    """Build and check an instance in this process. A model or property at fault gives an `error` or a row that says so."""
    started, used = perf_counter(), process_time()
    found = Finished(instance.key, instance.constants)
    try:
        program, file = parse_model(instance.model), parse_properties(instance.properties)
        model = bind(program, instance.constants, exact=instance.options.exact)
        needed = needed_constants(program, file)
        asked = [
            (
                Question(file, i, {**{n: v[0] for n, v in instance.varying.items()}, **choice}),
                choice,
            )
            for i in range(len(file.properties))
            for choice in combinations(
                {n: v for n, v in instance.varying.items() if n in needed[i]}
            )
        ]
        # Which strategies are fair depends on the states: the reduced model would answer another question.
        if instance.options.reduce and not instance.options.fairness:
            model = reduced(model, [q for q, _ in asked], steps=False).model
        engine = registry.build(model, instance.options)
        shared = lumped(engine, [q for q, _ in asked], instance.options)
        rows = []
        for question, choice in asked:
            bound, labels = question.bind(model)
            name = bound.name or " ".join(bound.span.text.split())
            given = {**instance.constants, **choice}
            try:
                result = check(
                    engine,
                    bound.formula,
                    instance.options,
                    labels=labels,
                    rebind=question.formula,
                    shared=shared,
                )
                rows.append(Row(name, given, show_value(result.value), str(result.accuracy)))
            except SymcheckError as error:
                rows.append(Row(name, given, "Error", str(error).splitlines()[0]))
        found = replace(
            found, states=engine.states, transitions=engine.transitions, rows=tuple(rows)
        )
    except SymcheckError as error:
        found = replace(found, error=str(error))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _BYTES
    return replace(
        found, seconds=perf_counter() - started, cpu_seconds=process_time() - used, memory=memory
    )


def sweep(
    instance: Instance,
    constants: Mapping[str, Sequence[str]],
    *,
    varying: Mapping[str, Sequence[str]] | None = None,
    workers: int = 2,
    journal: Path | None = None,
) -> Iterator[Finished]:
    """Every choice of constants, as each is finished; those that the journal has come first.

    constants: values for each constant of the model (added to those of `instance`); varying: of the properties.
    workers: processes at a time. Instances at fault are among the results, and are tried again by the next sweep.
    Raises OSError where the journal cannot be written, and what breaks a process (BrokenProcessPool).
    """
    tasks = [
        replace(instance, constants={**instance.constants, **c}, varying=varying or {})
        for c in combinations(constants)
    ]
    kept = {} if journal is None else read_journal(journal)
    yield from (kept[t.key] for t in tasks if t.key in kept)
    missing = [t for t in tasks if t.key not in kept]
    if not missing:
        return
    # Fresh processes: a forked one would share what this one holds, and count it as its own memory.
    with ProcessPoolExecutor(
        min(workers, len(missing)), mp_context=get_context("spawn"), max_tasks_per_child=1
    ) as pool:
        try:
            for future in as_completed([pool.submit(check_instance, t) for t in missing]):
                done = future.result()
                if journal is not None and done.error is None:
                    _append(journal, done)
                yield done
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def read_journal(journal: Path) -> dict[str, Finished]:
    """The finished instances by key. A last line that was not written to its end is passed over."""
    if not journal.exists():
        return {}
    found = {}
    for line in journal.read_text().splitlines():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        rows = tuple(
            Row(r["property"], r["constants"], r["value"], r["accuracy"]) for r in entry.pop("rows")
        )
        found[entry["key"]] = Finished(**entry, rows=rows)
    return found


def _append(journal: Path, done: Finished) -> None:
    """One line in one write, on the disk when this returns; after a torn line it begins a new one."""
    line = json.dumps({**asdict(done), "constants": dict(done.constants)}).encode() + b"\n"
    descriptor = os.open(journal, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(descriptor).st_size
        torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
        os.write(descriptor, b"\n" + line if torn else line)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
