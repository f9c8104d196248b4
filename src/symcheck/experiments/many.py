"""`symcheck.check_many`: many models, each with its properties, constants and options."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, Unpack, cast

from symcheck.api.arguments import is_file, takes_options
from symcheck.api.model import Model
from symcheck.constant_values import GivenValues
from symcheck.errors import SymcheckError, SyntaxFault, UsageError
from symcheck.experiments.properties_input import read_properties
from symcheck.experiments.rows import Row, error_text
from symcheck.experiments.run import experiment
from symcheck.experiments.table import Experiment
from symcheck.options import OptionValues, make_options
from symcheck.parallel.dask import Cluster
from symcheck.parallel.workers import Lost, Workers
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.properties_in_part import PropertiesInput

__all__ = ["Check", "check_many"]


class Check(NamedTuple):
    """A task of `check_many`: the arguments of `experiment`.

    Attributes:
        model: a file, a text, or a loaded model.
        properties: a file, a text, or parsed properties.
        constants: values of the constants of model and properties, as for `experiment`.
        options: options of this task, which replace those of all tasks.
    """

    model: Model | str | Path
    properties: PropertiesFile | str | Path
    constants: GivenValues | None = None
    options: OptionValues = OptionValues()


Task = (
    Check
    | tuple[Model | str | Path, PropertiesFile | str | Path]
    | tuple[Model | str | Path, PropertiesFile | str | Path, GivenValues | None]
    | tuple[Model | str | Path, PropertiesFile | str | Path, GivenValues | None, OptionValues]
)
"""A task, or its parts."""


@takes_options
def check_many(
    checks: Iterable[Task],
    *,
    jobs: int = 1,
    executor: Executor | Cluster | None = None,
    **options: Unpack[OptionValues],
) -> Iterator[Experiment]:
    """Check the properties of many models, one task after the other.

    Tasks are read when they are done, and neither models nor results are kept: the iterable may be
    endless. A faulty task, such as a file that cannot be read, has one row with an error, and the
    others go on. So has a property that does not follow the grammar, after the other rows of its
    task.

    Args:
        checks: the tasks: `Check`, or tuples of model, properties, constants and options, of which
            the last two may be missing.
        jobs: number of processes that do tasks at the same time. With several, the tasks are read
            before the first result.
        executor: does the tasks instead: an executor of `concurrent.futures`, or a Dask cluster.
        options: see `symcheck.Options`; they hold for each task.

    Yields:
        An experiment for each task, in the order of the tasks.

    Raises:
        UsageError: an option of all tasks is wrong, or a task has another form.

    Examples:
        >>> import symcheck
        >>> coin = "dtmc module m x : [0..2]; [] x=0 -> 1/2 : (x'=1) + 1/2 : (x'=2); endmodule"
        >>> tasks = [(coin, "P=? [ F x=1 ]"), ("missing.pm", "P=? [ F x=1 ]")]
        >>> for results in symcheck.check_many(tasks):
        ...     for row in results:
        ...         print(row.name, row.value, row.error)
        P=? [ F x=1 ] 0.5 None
        P=? [ F x=1 ] None cannot read missing.pm: No such file or directory
    """
    if jobs < 1:
        raise UsageError(f"jobs={jobs}: expected a number of processes from 1")
    make_options(options)
    return _results(map(_task, checks), partial(_experiment, options), jobs, executor)


def _results(
    tasks: Iterable[Check],
    function: Callable[[Check], Experiment],
    jobs: int,
    executor: Executor | Cluster | None,
) -> Iterator[Experiment]:
    if jobs == 1 and executor is None:
        for task in tasks:
            yield (results := function(task))
            if not results.complete:  # Ctrl-C
                return
        return
    listed = list(tasks)
    waiting: dict[int, Experiment] = {}
    due = 0
    with Workers(jobs, executor) as workers, closing(workers.completed(function, listed)) as done:
        for number, outcome in done:
            if isinstance(outcome, Lost):
                outcome = _failed(listed[number], str(outcome))
            waiting[number] = outcome
            while due in waiting:
                yield waiting.pop(due)
                due += 1


def _task(given: Task) -> Check:
    """The task of a tuple. Raises UsageError."""
    if not isinstance(cast(object, given), tuple) or not 2 <= len(given) <= 4:
        raise UsageError(
            "a task of check_many is a tuple (model, properties, constants, options), not "
            f"{given!r:.80}",
            hint="constants and options may be missing",
        )
    return given if isinstance(given, Check) else Check(*given)


def _experiment(options: OptionValues, task: Check) -> Experiment:
    """The rows of a task; a fault of the task as a whole is a row."""
    merged = cast(OptionValues, {**options, **task.options})
    try:
        try:
            return experiment(task.model, task.properties, task.constants, **merged)
        except SyntaxFault:
            given = _parsed_in_part(task.properties)
            if not given.unparsed or given.declarations:
                raise
        faulty = given.unparsed
        results = experiment(task.model, given.parsed, task.constants, **merged)
    except SymcheckError as error:
        return _failed(task, error_text(error))
    errors = (Row(f.text, {}, error=error_text(f.fault), formula=f.text) for f in faulty.values())
    return replace(results, rows=(*results.rows, *errors))


def _parsed_in_part(properties: PropertiesFile | str | Path) -> PropertiesInput:
    """The properties of a task, and those that do not follow the grammar. Raises SymcheckError."""
    if isinstance(properties, PropertiesFile):
        return PropertiesInput(properties)
    if is_file(properties):
        return read_properties(properties, [])
    return read_properties(None, [str(properties)])


def _failed(task: Check, error: str) -> Experiment:
    """One row with an error, in the place of the rows of a task."""
    text = " ".join(str(task.properties).split())
    return Experiment((Row(text, {}, error=error, formula=text),))
