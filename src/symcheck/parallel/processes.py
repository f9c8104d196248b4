"""A pool of processes on this machine."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from threading import Thread
from types import FrameType, ModuleType
from typing import ParamSpec, TypeVar

from symcheck.errors import ResourceError
from symcheck.machine import available_memory, limit_memory
from symcheck.whole_file import remove_unfinished

__all__ = ["ProcessPool"]

P = ParamSpec("P")
R = TypeVar("R")

_PATIENCE = 0.1  # seconds in which a worker removes its temporary files


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
            raise ResourceError(f"no processes can be started: {error.strerror}") from None
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
        for worker in workers:  # a compiled loop does not notice
            worker.join(_PATIENCE)
            worker.kill()
        self.shutdown(cancel_futures=True)


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
