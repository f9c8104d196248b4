"""A pool of processes on this machine."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process, spawn
from threading import Thread
from time import monotonic
from types import FrameType, ModuleType
from typing import ParamSpec, TypeVar

from symcheck.errors import ResourceError
from symcheck.machine import available_memory, limit_memory
from symcheck.operating_system import interrupt_blocked
from symcheck.whole_file import remove_unfinished

__all__ = ["ProcessPool"]

P = ParamSpec("P")
R = TypeVar("R")

_PATIENCE = 0.1  # seconds in which workers remove their temporary files

_command_line = spawn.get_command_line


class ProcessPool(ProcessPoolExecutor):
    """Spawned processes, each with its share of the memory.

    A forked process would copy locks that threads hold, and the memory of this process.

    Args:
        processes: their number; each starts when there is a task for it.

    Raises:
        ResourceError: no processes can be started.
    """

    def __init__(self, processes: int) -> None:
        # The process that removes the semaphores of the others says so, if they were stopped.
        sys.warnoptions.append("ignore:resource_tracker")
        try:
            super().__init__(processes, get_context("spawn"), _start_worker, (processes,))
        except OSError as error:
            raise ResourceError(
                "no processes can be started: the system has no semaphore for them "
                f"({error.strerror})",
                hint="-jobs 1 needs none",
            ) from None
        finally:
            sys.warnoptions.remove("ignore:resource_tracker")

    def submit(self, fn: Callable[P, R], /, *arguments: P.args, **keywords: P.kwargs) -> Future[R]:
        """Give a task to a process; see `concurrent.futures.Executor.submit`."""
        with _clean_start():
            return super().submit(fn, *arguments, **keywords)

    def kill(self) -> None:
        """End the processes; their tasks are abandoned."""
        workers = list((self._processes or {}).values())
        for worker in workers:
            worker.terminate()
        end = monotonic() + _PATIENCE
        for worker in workers:  # a compiled loop does not notice
            worker.join(max(0.0, end - monotonic()))
            worker.kill()
        # A message that a worker was sending has no end: the thread of the pool would wait for it.
        self._result_queue._writer.close()  # type: ignore[attr-defined]
        self.shutdown(cancel_futures=True)


@contextmanager
def _clean_start() -> Iterator[None]:
    """New processes import what their tasks need, and not the script that started them.

    So the script needs no `if __name__ == "__main__"`. Matrices are small for a BLAS: its threads
    would compete with the processes; numpy reads the variable when it is imported. They inherit
    that Ctrl-C is blocked, and leave it to this process from the first moment on. They have no
    standard error: if this process ends while they start, that is no fault to be shown.
    """
    main, threads = sys.modules["__main__"], os.environ.get("OPENBLAS_NUM_THREADS")
    sys.modules["__main__"] = ModuleType("__main__")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    setattr(spawn, "get_command_line", _silent_command_line)  # noqa: B010
    try:
        with interrupt_blocked():
            yield
    finally:
        setattr(spawn, "get_command_line", _command_line)  # noqa: B010
        sys.modules["__main__"] = main
        if threads is None:
            del os.environ["OPENBLAS_NUM_THREADS"]


def _silent_command_line(**descriptors: object) -> list[str]:
    """The command that starts a process of a pool, without a standard error."""
    words = _command_line(**descriptors)
    program = words.index("-c") + 1
    words[program] = f"import os, sys; sys.stderr = open(os.devnull, 'w'); {words[program]}"
    return words


def _end_worker(_: int, __: FrameType | None) -> None:
    remove_unfinished()
    os._exit(1)


def _start_worker(processes: int) -> None:
    """Each of several workers has its share of the memory; without a parent it ends."""
    limit_memory(available_memory() // processes)
    signal.signal(signal.SIGTERM, _end_worker)
    parent = parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    Thread(target=follow, daemon=True).start()
