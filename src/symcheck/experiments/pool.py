"""Tasks in several processes; a process that is killed loses its task, and no other."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from threading import Thread
from types import FrameType, ModuleType
from typing import TypeVar

from symcheck.errors import ResourceError
from symcheck.machine import available_memory, limit_memory
from symcheck.whole_file import remove_unfinished

__all__ = ["LOST", "completed"]

T = TypeVar("T")
R = TypeVar("R")

_PATIENCE = 0.1  # seconds in which a worker removes its temporary files

LOST = "its process was killed, for example because memory was exhausted"
"""What a BrokenExecutor means for a task."""


def completed(
    function: Callable[[T], R], tasks: Sequence[T], jobs: int, executor: Executor | None = None
) -> Generator[tuple[int, R | BrokenExecutor]]:
    """Index and result of each task, in the order in which they are finished.

    The result is a BrokenExecutor if the process was killed that did the task. When a process of
    our own pool is killed, the tasks at work are repeated, each in a process of its own, and the
    others follow in a new pool.

    Args:
        function: of a module, because processes look it up by its name.
        tasks: its arguments.
        jobs: number of processes. One job without an executor is done in this process.
        executor: does the tasks instead of our own pool.
    """
    if executor is not None:
        yield from _submitted(executor, function, tasks, range(len(tasks)), len(tasks))
        return
    if jobs == 1 or len(tasks) < 2:
        yield from ((i, function(task)) for i, task in enumerate(tasks))
        return
    left = dict.fromkeys(range(len(tasks)))
    while left:
        lost = []
        with _pool(min(jobs, len(left))) as pool:
            for i, result in _submitted(pool, function, tasks, list(left), 2 * jobs):
                if isinstance(result, BrokenExecutor):
                    lost.append(i)
                    continue
                del left[i]
                yield i, result
        for i in lost:
            with _pool(1) as alone:
                yield from _submitted(alone, function, tasks, [i], 1)
            del left[i]


def _submitted(
    executor: Executor,
    function: Callable[[T], R],
    tasks: Sequence[T],
    indices: Sequence[int],
    window: int,
) -> Generator[tuple[int, R | BrokenExecutor]]:
    """Submit tasks, at most `window` at a time, until the executor is broken."""
    waiting = iter(indices)
    pending: dict[Future[R], int] = {}
    broken = False
    try:
        while True:
            while not broken and len(pending) < window and (i := next(waiting, None)) is not None:
                try:
                    with _clean_start():
                        pending[executor.submit(function, tasks[i])] = i
                except BrokenExecutor as error:
                    broken = True
                    yield i, error
            if not pending:
                break
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                i = pending.pop(future)
                try:
                    result = future.result()
                except BrokenExecutor as error:
                    broken = True
                    yield i, error
                else:
                    yield i, result
    finally:
        for future in pending:
            future.cancel()


@contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of spawned processes, which are ended if the tasks are abandoned.

    A forked process would copy locks that threads hold, and the memory of this process.
    """
    # The process that removes the semaphores of the others says so, if they were stopped.
    sys.warnoptions.append("ignore:resource_tracker")
    try:
        pool = ProcessPoolExecutor(jobs, get_context("spawn"), _start_worker, (jobs,))
    except OSError as error:
        raise ResourceError(f"no processes can be started: {error.strerror}") from None
    finally:
        sys.warnoptions.remove("ignore:resource_tracker")
    try:
        yield pool
    except BaseException:
        workers = list((pool._processes or {}).values())
        for worker in workers:
            worker.terminate()
        for worker in workers:  # a compiled loop does not notice
            worker.join(_PATIENCE)
            worker.kill()
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


@contextmanager
def _clean_start() -> Iterator[None]:
    """New processes import what their tasks need, and not the script that started them.

    So the script needs no `if __name__ == "__main__"`. Matrices are small for a BLAS: its threads
    would compete with the processes; numpy reads the variable when it is imported. They inherit
    that Ctrl-C is blocked, and leave it to this process from the first moment on.
    """
    main, threads = sys.modules["__main__"], os.environ.get("OPENBLAS_NUM_THREADS")
    sys.modules["__main__"] = ModuleType("__main__")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        sys.modules["__main__"] = main
        if threads is None:
            del os.environ["OPENBLAS_NUM_THREADS"]


def _end_worker(_: int, __: FrameType | None) -> None:
    remove_unfinished()
    os._exit(1)


def _start_worker(jobs: int) -> None:
    """Each of several workers has its share of the memory; without a parent it ends."""
    limit_memory(available_memory() // jobs)
    signal.signal(signal.SIGTERM, _end_worker)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    Thread(target=follow, daemon=True).start()
