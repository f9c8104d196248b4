"""Check a model for many values of its constants, with a journal of finished instances.

    instance = Instance.read("model.pm", "model.pctl")
    for finished in sweep(instance, {"N": ("2", "3")}, journal=Path("sweep.jsonl")):
        print(finished.constants, finished.rows)

Each instance has a process of its own, whose memory is measured and returned to the system. The
journal is a file of JSON lines, one for each finished instance; a sweep that was stopped and is
started again checks only the missing instances.
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
from typing import TYPE_CHECKING

from symcheck import __version__
from symcheck.api import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.result import show_value
from symcheck.constant_values import combinations
from symcheck.errors import SymcheckError
from symcheck.experiment.table import Row
from symcheck.options import Options
from symcheck.syntax.parse import parse_model, parse_properties

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient

__all__ = ["Finished", "Instance", "check_instance", "read_journal", "sweep"]

_DEFAULT = Options()
_BYTES = 1 if sys.platform == "darwin" else 1024  # unit of ru_maxrss


@dataclass(frozen=True, slots=True)
class Instance:
    """The task of one process.

    Args:
        model, properties: texts.
        constants: one value for each constant that the model leaves open.
        varying: values of the constants of the properties; a property is checked for each
            combination of those on which it depends.
        options: how the model is built and checked.
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
        """A hash of the task and of the version of the program."""
        task = [
            __version__,
            self.model,
            self.properties,
            dict(self.constants),
            {n: list(v) for n, v in self.varying.items()},
        ]
        return hashlib.sha256(
            json.dumps([*task, asdict(self.options)], sort_keys=True).encode()
        ).hexdigest()[:20]


@dataclass(frozen=True, slots=True)
class Finished:
    """The results of an instance.

    Attributes:
        key: that of the instance.
        constants: those of the model.
        states, transitions: size of the built model.
        rows: one for each property and combination of its constants.
        seconds, cpu_seconds: elapsed time and processor time of its process.
        memory: largest memory of its process, in bytes.
        error: why there are no rows; None if there are.
    """

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
        """The numeric value of a property; true is 1. Raises KeyError if there is no such row."""
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
    """Build and check an instance in this process. A fault becomes an error or a row."""
    started, used = perf_counter(), process_time()
    finished = Finished(instance.key, instance.constants)
    try:
        whole = Model(parse_model(instance.model), instance.constants, instance.options)
        properties = whole.instances(parse_properties(instance.properties), instance.varying)
        model = whole.reduced_for(properties)
        shared = model.shared_quotient(properties)
        rows = [_row(model, p, shared) for p in properties]
        finished = replace(
            finished,
            states=model.engine.states,
            transitions=model.engine.transitions,
            rows=tuple(rows),
        )
    except SymcheckError as error:
        finished = replace(finished, error=str(error))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _BYTES
    return replace(
        finished, seconds=perf_counter() - started, cpu_seconds=process_time() - used, memory=memory
    )


def _row(model: Model, property: PropertyInstance, shared: SharedQuotient | None) -> Row:
    """The answer to a property, or the first line of its error."""
    constants = {n: str(v) for n, v in {**model.given_constants, **property.relevant}.items()}
    try:
        result = model.check_instance(property, shared=shared)
    except SymcheckError as error:
        return Row(property.title, constants, "Error", str(error).splitlines()[0])
    return Row(property.title, constants, show_value(result.value), str(result.accuracy))


def sweep(
    instance: Instance,
    constants: Mapping[str, Sequence[str]],
    *,
    varying: Mapping[str, Sequence[str]] | None = None,
    workers: int = 2,
    journal: Path | None = None,
) -> Iterator[Finished]:
    """Check every combination of constants; results come in the order in which they are finished.

    Results that the journal holds come first. An instance with an error is a result too; the next
    sweep tries it again.

    Args:
        instance: the model, its properties and options.
        constants: values for each constant of the model, besides those of `instance`.
        varying: values for each constant of the properties.
        workers: number of processes at a time.
        journal: a file of finished instances, read at first and appended to.

    Raises:
        OSError: the journal cannot be written.
        BrokenProcessPool: a process was killed.
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
    # Spawned processes: a forked one would share the memory of this one, and count it as its own.
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
    """The finished instances by key; an incomplete last line is ignored."""
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
    """Append one line in one write and flush it; an incomplete last line is ended first."""
    line = json.dumps({**asdict(done), "constants": dict(done.constants)}).encode() + b"\n"
    descriptor = os.open(journal, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        size = os.fstat(descriptor).st_size
        torn = size > 0 and os.pread(descriptor, 1, size - 1) != b"\n"
        os.write(descriptor, b"\n" + line if torn else line)
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
