"""`symcheck.experiment`: a model is checked for every combination of values of its constants."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Unpack

from symcheck.api.arguments import is_file, properties_file, takes_options
from symcheck.api.model import Model
from symcheck.check.property_instance import PropertyInstance
from symcheck.constant_values import GivenValues, combinations, value_lists
from symcheck.errors import Interrupted, NameFault, UsageError
from symcheck.experiments.instances import Instance, check_instance, check_pickled
from symcheck.experiments.journal import opened
from symcheck.experiments.rows import Row, constant_text, row_of
from symcheck.experiments.table import Experiment
from symcheck.options import OptionValues, make_options
from symcheck.parallel.dask import Cluster
from symcheck.parallel.deferral import deferred_signals
from symcheck.parallel.workers import Lost, Workers
from symcheck.semantics.binding.bind import needed_constants, split_constants
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.parse import parse_model, parse_model_file
from symcheck.syntax.printer import pretty
from symcheck.version import __version__

__all__ = [
    "Progress",
    "experiment",
    "experiment_description",
    "given_model",
    "row_key",
]


@dataclass(frozen=True, slots=True)
class Progress:
    """What an observer of an experiment is told when an instance of the model is finished.

    Attributes:
        finished: number of finished rows.
        total: number of rows of the experiment.
        rows: the new ones.
    """

    finished: int
    total: int
    rows: tuple[Row, ...]

    def __str__(self) -> str:
        return f"{self.finished} of {self.total} results"


@takes_options
def experiment(
    model: Model | str | Path,
    properties: PropertiesFile | str | Path,
    constants: GivenValues | None = None,
    *,
    only: Sequence[int] | None = None,
    jobs: int = 1,
    executor: Executor | Cluster | None = None,
    resume: str | Path | None = None,
    progress: Callable[[Progress], object] | None = None,
    **options: Unpack[OptionValues],
) -> Experiment:
    """Check properties of a model for every combination of values of the constants.

    An instance of the model is built once for all of its properties. A fault of an instance or of a
    property is a row with an error; the others go on. After Ctrl-C, the result has the finished
    rows, and its attribute `complete` is False.

    Args:
        model: a file, a text, or a loaded model.
        properties: a file, a text, or parsed properties.
        constants: values of the constants of model and properties: a text such as "N=3:6,p=0.5",
            or for each constant a value, a text such as "1:2:9", a range, a list or an array.
        only: the properties that are checked, counted from 0; None for all.
        jobs: number of processes that check instances at the same time.
        executor: does the work instead: an executor of `concurrent.futures`, or with its interface,
            or a `distributed.Client` of a Dask cluster.
        resume: a file to which finished rows are written. If it has rows of this experiment, they
            are not computed again; values of constants may be added.
        progress: is called with each finished instance.
        options: see `symcheck.Options`; of a loaded model, its own options are the defaults.

    Returns:
        One row for each property and combination of the constants on which it depends, in an order
        that does not depend on the number of jobs or workers.

    Raises:
        InputError: a text is faulty.
        UsageError: a file cannot be read, a constant has no value, an option is wrong, or `resume`
            belongs to another experiment.

    Examples:
        >>> import symcheck
        >>> rows = symcheck.experiment(
        ...     "dtmc const int N; module m x : [0..9]; [] x<9 -> (x'=min(x+N,9)); endmodule",
        ...     "P=? [ F x=6 ]",
        ...     {"N": range(1, 5)},
        ... )
        >>> [(row.constants["N"], row.value) for row in rows]
        [(1, 1.0), (2, 1.0), (3, 1.0), (4, 0.0)]
    """
    if jobs < 1:
        raise UsageError(f"jobs={jobs}: expected a number of processes from 1")
    whole = given_model(model, options)
    file = properties_file(properties)
    values = value_lists(constants)
    split = split_constants(whole.program, file, dict.fromkeys(values, ""))
    if split.warnings:
        raise NameFault(*(replace(w, severity="error") for w in split.warnings))
    indices = range(len(file.properties)) if only is None else only
    _require_values(whole, file, values, indices)
    instances = whole.instances(file, {n: values[n] for n in split.of_properties}, indices)
    choices = [
        {**whole.given_constants, **choice}
        for choice in combinations({n: values[n] for n in split.of_model})
    ]
    rows = {
        (c, i): row_of(instance, choice)
        for c, choice in enumerate(choices)
        for i, instance in enumerate(instances)
    }
    keys = {index: row_key(row, instances[index[1]].index) for index, row in rows.items()}
    finished: dict[tuple[int, int], Row] = {}
    varying = tuple(n for n, given in values.items() if len(given) > 1)
    complete = True

    def tell(new: Mapping[tuple[int, int], Row]) -> None:
        if progress is not None and new:
            progress(Progress(len(finished), len(rows), tuple(new.values())))

    with ExitStack() as stack:
        journal = None
        if resume is not None:
            journal = stack.enter_context(opened(resume, experiment_description(whole, file)))
            finished |= {p: journal.rows[k] for p, k in keys.items() if k in journal.rows}
            tell(finished)
        tasks = []
        for c, choice in enumerate(choices):
            indices = tuple(i for i in range(len(instances)) if (c, i) not in finished)
            if indices:
                tasks.append((c, Instance(choice, indices)))
        here = executor is None and (jobs == 1 or len(tasks) == 1)
        workers = stack.enter_context(Workers(jobs, executor))
        results = workers.completed(
            _checker(whole, instances, here=here), [instance for _, instance in tasks]
        )
        stack.enter_context(closing(results))
        try:
            for t, result in results:
                c, instance = tasks[t]
                pairs = [(c, i) for i in instance.properties]
                if isinstance(result, Lost):  # no fault of the instance: not in the file
                    new = {p: replace(rows[p], error=str(result)) for p in pairs}
                    finished |= new
                else:
                    new = dict(zip(pairs, result, strict=True))
                    with deferred_signals():  # the result has what the file has
                        if journal is not None:
                            journal.append({keys[p]: row for p, row in new.items()})
                        finished |= new
                tell(new)
        except (KeyboardInterrupt, Interrupted):
            complete = False
    return Experiment(tuple(finished[p] for p in rows if p in finished), varying, complete)


def given_model(model: Model | str | Path, options: OptionValues) -> Model:
    """A loaded model with options, a file, or a text. Raises SyntaxFault, UsageError."""
    if isinstance(model, Model):
        return replace(model, options=make_options(options, model.options), observer=None)
    program = parse_model_file(model) if is_file(model) else parse_model(str(model))
    return Model(program, {}, make_options(options))


def _require_values(
    model: Model, file: PropertiesFile, values: Iterable[str], indices: Sequence[int]
) -> None:
    given = {*model.given_constants, *values}
    of_each = needed_constants(model.program, file)
    needed = dict.fromkeys(n for i in indices for n in of_each[i])
    missing = [n for n in needed if n not in given]
    if missing:
        raise UsageError(
            f"constants: no value is given for {', '.join(missing)}",
            hint=f"constants={{'{missing[0]}': ...}}",
        )


def row_key(row: Row, index: int) -> str:
    """The key of a row in a journal: its property and its constants."""
    return json.dumps([index, {n: constant_text(v) for n, v in sorted(row.constants.items())}])


def experiment_description(model: Model, file: PropertiesFile) -> dict[str, str]:
    """What the rows depend on, besides the constants, as hashes."""
    parts = {
        "model": [str(model.type), pretty(model.program)],
        "set of properties": pretty(file),
        "set of options": asdict(model.options),
        "version of symcheck": __version__,
    }
    if type(model) is not Model:  # read from explicit files, for example
        parts["model"] = sha256(_pickled(model, "resume")).hexdigest()
    return {n: sha256(json.dumps(x).encode()).hexdigest()[:16] for n, x in parts.items()}


def _checker(
    model: Model, properties: Sequence[PropertyInstance], *, here: bool
) -> Callable[[Instance], list[Row]]:
    """The function that checks an instance, in this process or in others."""
    if here:
        return partial(check_instance, model, properties)
    return partial(check_pickled, _pickled((model, properties), "jobs"))


def _pickled(value: object, argument: str) -> bytes:
    try:
        return pickle.dumps(value)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise UsageError(
            f"{argument}: the model cannot be written down for other processes: {error}",
            hint=f"leave {argument}= out",
        ) from None
