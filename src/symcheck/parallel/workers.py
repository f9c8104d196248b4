"""Tasks on workers; a task whose worker is killed is repeated, and then lost if it fails again."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import TypeVar

from symcheck.errors import ResourceError, UsageError
from symcheck.parallel.dask import Cluster, do_on_cluster
from symcheck.parallel.deferral import deferred_signals
from symcheck.parallel.processes import ProcessPool

__all__ = ["Lost", "Workers"]

T = TypeVar("T")
R = TypeVar("R")

_PATIENCE = 0.1  # seconds until an interrupted thread notices


@dataclass(frozen=True, slots=True)
class Lost:
    """The outcome of a task whose worker was killed, again and again."""

    def __str__(self) -> str:
        return "its process was killed, for example because memory was exhausted"


class Workers:
    """What does independent tasks; a context manager that ends the processes that it started.

    Args:
        jobs: number of processes on this machine; with 1, this process does the tasks.
        executor: does the tasks instead: an executor of `concurrent.futures`, or a Dask cluster.
    """

    def __init__(self, jobs: int = 1, executor: Executor | Cluster | None = None) -> None:
        self.jobs = jobs
        self._cluster = executor is not None and not isinstance(executor, Executor)
        self._executor: Executor | None
        if executor is None or isinstance(executor, Executor):
            self._executor = executor
        else:
            self._executor = executor.get_executor(pure=False)
        self._pool: ProcessPool | None = None

    @property
    def here(self) -> bool:
        """Whether this process does the tasks."""
        return self._executor is None and self.jobs == 1

    def completed(
        self, function: Callable[[T], R], tasks: Sequence[T]
    ) -> Generator[tuple[int, R | Lost]]:
        """Index and result of each task, in the order in which they are finished.

        When a process of this machine is killed, the tasks at work are repeated, each in a process
        of its own, and the others follow in a new pool. A Dask cluster repeats them itself; those
        that it gives up are repeated one after another, because a task that only waited on a
        killed worker counts as a failure there too. To close the generator abandons the other
        tasks.

        Args:
            function: of a module, because processes look it up by its name.
            tasks: its arguments.

        Raises:
            ResourceError: no processes can be started, or the connection to a cluster is lost.
            UsageError: the workers of a cluster lack symcheck, or have another version.
        """
        if self._executor is not None and self._cluster:
            yield from _on_cluster(self._executor, partial(do_on_cluster, function), tasks)
        elif self._executor is not None:
            yield from _submitted(
                self._executor, function, tasks, range(len(tasks)), max(len(tasks), 1)
            )
        elif self.jobs == 1 or len(tasks) < 2:
            yield from ((i, function(task)) for i, task in enumerate(tasks))
        else:
            try:
                yield from self._in_processes(function, tasks)
            except BaseException:
                self._kill()
                raise

    def _in_processes(
        self, function: Callable[[T], R], tasks: Sequence[T]
    ) -> Generator[tuple[int, R | Lost]]:
        left = dict.fromkeys(range(len(tasks)))
        while left:
            lost = []
            self._pool = self._pool or ProcessPool(self.jobs)
            for i, result in _submitted(self._pool, function, tasks, list(left), 2 * self.jobs):
                if isinstance(result, Lost):
                    lost.append(i)
                    continue
                del left[i]
                yield i, result
            for i in lost:
                self._end()
                self._pool = ProcessPool(1)
                yield from _submitted(self._pool, function, tasks, [i], 1)
                del left[i]
            if lost:
                self._end()

    def _end(self) -> None:
        with deferred_signals():
            if self._pool is not None:
                self._pool.shutdown()
                self._pool = None

    def _kill(self) -> None:
        with deferred_signals():
            if self._pool is not None:
                self._pool.kill()
                self._pool = None

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._end()
        else:
            self._kill()


def _on_cluster(
    executor: Executor, function: Callable[[T], R], tasks: Sequence[T]
) -> Generator[tuple[int, R | Lost]]:
    lost = []
    for i, result in _submitted(executor, function, tasks, range(len(tasks)), max(len(tasks), 1)):
        if isinstance(result, Lost):
            lost.append(i)
        else:
            yield i, result
    yield from _submitted(executor, function, tasks, lost, 1)


def _submitted(
    executor: Executor,
    function: Callable[[T], R],
    tasks: Sequence[T],
    indices: Sequence[int],
    window: int,
) -> Generator[tuple[int, R | Lost]]:
    """Submit tasks, at most `window` at a time, until the executor is broken.

    A signal interrupts the wait for the next result, and not the code of the executor.
    """
    waiting = iter(indices)
    pending: dict[Future[R], int] = {}
    finished: SimpleQueue[Future[R]] = SimpleQueue()
    broken = False
    try:
        while True:
            while not broken and len(pending) < window and (i := next(waiting, None)) is not None:
                try:
                    with deferred_signals():
                        future = executor.submit(function, tasks[i])
                        pending[future] = i
                        future.add_done_callback(finished.put)
                except BrokenExecutor:
                    broken = True
                    yield i, Lost()
            if not pending:
                break
            future = _next(finished)
            with deferred_signals():
                i = pending.pop(future)
                outcome = _outcome(future)
                broken = broken or isinstance(future.exception(), BrokenExecutor)
            yield i, outcome
    finally:
        if not isinstance(executor, ProcessPool):  # that one is ended
            with deferred_signals():
                for future in pending:
                    future.cancel()


def _next(finished: SimpleQueue[R]) -> R:
    """The next element; only the main thread would be interrupted while it waits without end."""
    while True:
        with suppress(Empty):
            return finished.get(timeout=_PATIENCE)


def _outcome(future: Future[R]) -> R | Lost:
    """The result of a finished task; see `Workers.completed`."""
    try:
        return future.result()
    except BrokenExecutor:
        return Lost()
    except _killed_worker():
        return Lost()
    except CancelledError:
        raise ResourceError("the connection to the scheduler is lost") from None
    except ModuleNotFoundError as error:
        raise UsageError(
            f"a worker cannot do its task: {error}",
            hint="install the same version of symcheck on all workers",
        ) from None


def _killed_worker() -> tuple[type[Exception], ...]:
    """The error of Dask for a task on which several workers died."""
    if "distributed" not in sys.modules:
        return ()
    from distributed.scheduler import KilledWorker

    return (KilledWorker,)
