"""Threads within one computation, for compiled loops that release the lock of the interpreter.

A row of a product, and the successors of a state, are computed by one thread in one order of
additions, so that no digit depends on the number of threads.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.operating_system import processors
from symcheck.parallel import tuning

if TYPE_CHECKING:
    from concurrent.futures import Executor

__all__ = ["even_shares", "helpers", "on_team", "on_threads", "thread_count", "use_threads"]


class _Team:
    """The thread of a computation and those that help it, which start when they are first used."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.pool: Executor | None = None

    def helpers(self) -> Executor:
        """The pool of the other count - 1 threads."""
        from concurrent.futures import ThreadPoolExecutor

        self.pool = self.pool or ThreadPoolExecutor(self.count - 1)
        return self.pool

    def end(self) -> None:
        """Wait for the tasks that run, and cancel those that do not yet."""
        if self.pool is not None:
            self.pool.shutdown(cancel_futures=True)


_TEAM: ContextVar[_Team | None] = ContextVar("team", default=None)


@contextmanager
def use_threads(count: int | None = None) -> Iterator[None]:
    """A context whose computations use `count` threads.

    Args:
        count: None: as many as the context around it or, without one, as there are processors, up
            to `tuning.MAX_THREADS`. In a worker process, and in another thread than the main one,
            it is 1: others compute at the same time.
    """
    team = _TEAM.get()
    if team is not None and count in (None, team.count):
        yield
        return
    team = _Team(_default_count() if count is None else count)
    token = _TEAM.set(team)
    try:
        yield
    finally:
        _TEAM.reset(token)
        team.end()


def thread_count() -> int:
    """How many threads a computation uses, with the one that calls this; outside of `use_threads`,
    this one only.
    """
    team = _TEAM.get()
    return 1 if team is None else team.count


def helpers() -> Executor:
    """The other threads of this computation, where `thread_count` is above 1."""
    team = _TEAM.get()
    assert team is not None
    return team.helpers()


def _default_count() -> int:
    if threading.current_thread() is not threading.main_thread() or _is_worker():
        return 1
    return min(processors(), tuning.MAX_THREADS)


def _is_worker() -> bool:
    """Whether another process of Python has started this one."""
    process = sys.modules.get("multiprocessing.process")
    return process is not None and process.parent_process() is not None


def even_shares(work: NDArray[np.int64], count: int) -> list[int]:
    """Where shares of consecutive items with about the same work begin, and the number of items.

    Args:
        work: int64[n + 1], the work before each of n items, and that of all.
        count: the most shares.
    """
    items = len(work) - 1
    if count == 1:
        return [0, items]
    cuts = np.searchsorted(work, work[-1] * np.arange(1, count) // count)
    ends: list[int] = np.unique([0, *cuts, items]).tolist()
    return ends


def on_threads(part: Callable[[int, int], object], ends: Sequence[int]) -> None:
    """Call part(first, end) for each pair of neighbours in `ends`, and wait for all.

    The first pair is computed by this thread, the others by the pool.
    """
    if len(ends) == 2:
        part(ends[0], ends[1])
        return
    waiting = [helpers().submit(part, *share) for share in pairwise(ends[1:])]
    part(ends[0], ends[1])
    for each in waiting:
        each.result()


def on_team(work: Callable[[], object], most: int) -> None:
    """Call work() on at most so many threads at the same time, each of which does what is left.

    This thread goes on when nothing is left, whether or not the others have been free to begin.
    """
    count = min(thread_count(), most)
    waiting = [helpers().submit(work) for _ in range(count - 1)]
    work()
    for each in waiting:
        if not each.cancel():
            each.result()
