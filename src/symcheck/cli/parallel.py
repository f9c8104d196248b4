"""-jobs and -scheduler: instances of the model on workers; the output is that of one process."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from functools import lru_cache, partial
from io import StringIO

from symcheck.check.testing.property_tests import PropertyTest
from symcheck.cli.check_property import report_unbuilt_model
from symcheck.cli.instance import InstancesTask
from symcheck.cli.output import Output
from symcheck.cli.output_paths import NO_CONSTANTS
from symcheck.cli.progress import Progress
from symcheck.cli.resuming import FinishedResults
from symcheck.cli.run_state import RunState, TestFailed
from symcheck.cli.switches.arguments import Arguments
from symcheck.errors import ResourceError, SymcheckError
from symcheck.experiments.rows import Row
from symcheck.parallel.dask import connect
from symcheck.parallel.workers import Lost, Workers

__all__ = ["check_in_parallel"]


@dataclass
class _Outcome:
    """What an instance has added to the state of the run, and the error that ends the run."""

    text: str
    rows: list[Row] = field(default_factory=list)
    tests: list[PropertyTest] = field(default_factory=list)
    failures: int = 0
    warnings: int = 0
    error: Exception | None = None


def _check(work: bytes, constants: Mapping[str, str]) -> _Outcome:
    """Check one instance on a worker."""
    arguments, task = _unpickled(work)
    out = StringIO()
    state = RunState(arguments, Output(out, arguments.verbose))
    error = None
    try:
        task.run(state, constants, constants)
    except (SymcheckError, TestFailed, MemoryError) as found:
        error = found
    counts = state.failures, state.output.warnings
    return _Outcome(out.getvalue(), state.rows, state.tests, *counts, error)


@lru_cache(maxsize=1)
def _unpickled(work: bytes) -> tuple[Arguments, InstancesTask]:
    pair: tuple[Arguments, InstancesTask] = pickle.loads(work)
    return pair


def check_in_parallel(
    state: RunState,
    task: InstancesTask,
    choices: Sequence[Mapping[str, str]],
    finished: FinishedResults | None = None,
) -> None:
    """Check an instance for each choice of constants on the workers that the switches name.

    The paths of a single instance are sampled by all of them.
    finished: to which new rows are added.

    Raises as `InstancesTask.run`; UsageError if there is no scheduler.
    """
    a = state.arguments
    with ExitStack() as stack:
        client = None if a.scheduler is None else stack.enter_context(connect(a.scheduler))
        workers = stack.enter_context(Workers(a.jobs, client))
        if a.sim and len(choices) == 1:
            state.workers = workers
            task.run(state, choices[0], NO_CONSTANTS)
        else:
            _check_on_workers(state, task, choices, workers, finished)


def _check_on_workers(
    state: RunState,
    task: InstancesTask,
    choices: Sequence[Mapping[str, str]],
    workers: Workers,
    earlier: FinishedResults | None,
) -> None:
    """Check an instance for each choice of constants, and report them in this order.

    Raises as `InstancesTask.run`. If a limit or the user ends the run, all finished instances are
    reported.
    """
    work = pickle.dumps((state.arguments, task))
    watch = Progress(state.output)
    finished: dict[int, _Outcome | Lost] = {}
    reported = 0
    with closing(workers.completed(partial(_check, work), choices)) as outcomes:
        try:
            for i, outcome in outcomes:
                finished[i] = outcome
                if earlier is not None and isinstance(outcome, _Outcome):
                    earlier.write(choices[i], outcome.rows)
                if not state.output.verbose:  # the lines of -v are those of the instances
                    watch(f"{reported + len(finished)} of {len(choices)} instances")
                while reported in finished:
                    watch.clear()
                    _report(state, task, choices[reported], finished.pop(reported))
                    reported += 1
        except (ResourceError, KeyboardInterrupt):
            for _, outcome in sorted(finished.items(), key=lambda item: item[0]):
                if isinstance(outcome, _Outcome):
                    _add(state, outcome)
            raise


def _report(
    state: RunState,
    task: InstancesTask,
    constants: Mapping[str, str],
    outcome: _Outcome | Lost,
) -> None:
    if isinstance(outcome, Lost):
        given = ",".join(f"{n}={v}" for n, v in constants.items())
        instances = task.model.instances(task.file, task.of_properties, task.indices)
        report_unbuilt_model(state, instances, constants, SymcheckError(f"{given}: {outcome}"))
        state.lost += 1
        return
    _add(state, outcome)
    if outcome.error is not None:
        raise outcome.error


def _add(state: RunState, outcome: _Outcome) -> None:
    state.rows += outcome.rows  # first: Ctrl-C may come while the text is printed
    state.tests += outcome.tests
    state.failures += outcome.failures
    state.output.warnings += outcome.warnings
    print(outcome.text, end="", file=state.output.out, flush=True)
