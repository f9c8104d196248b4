"""A Dask cluster as the executor of tasks."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from functools import lru_cache
from threading import Lock
from typing import Any, Protocol, TypeVar

from symcheck.errors import UsageError
from symcheck.machine import limit_memory, used_data
from symcheck.parallel import tuning

__all__ = ["Client", "Cluster", "connect", "do_on_cluster", "limit_worker"]

T = TypeVar("T")
R = TypeVar("R")

_ONE_TASK = Lock()


class Cluster(Protocol):
    """What is needed of a `distributed.Client`."""

    def get_executor(self, *, pure: bool) -> Executor:
        """The cluster with the interface of `concurrent.futures`.

        Args:
            pure: whether equal tasks are one task, which is cancelled and fails once for all.
        """
        ...


class Client(Cluster, AbstractContextManager["Client"], Protocol):
    """A client that ends its connection when its context ends."""

    def submit(self, function: Callable[..., object], *arguments: object, **options: object) -> Any:
        """Submit a task."""
        ...

    def nthreads(self) -> dict[str, int]:
        """The workers by address."""
        ...


def connect(address: str) -> Client:
    """A client of the Dask cluster with this scheduler, such as "tcp://host:8786".

    Raises:
        UsageError: Dask is not installed, or there is no scheduler.
    """
    try:
        from distributed import Client as DaskClient
    except ModuleNotFoundError:
        raise UsageError("-scheduler needs Dask", hint="pip install 'symcheck[dask]'") from None
    open_client: Callable[..., Any] = DaskClient
    # Dask logs that workers restart or connections end; what matters is an outcome or an error.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client: Client = open_client(address, timeout=tuning.CONNECT_SECONDS)
    except (OSError, ValueError) as error:
        reason = str(error).partition("\n")[0]
        raise UsageError(
            f"there is no Dask scheduler at '{address}': {reason}",
            hint="'dask scheduler' prints its address, such as tcp://192.168.1.2:8786",
        ) from None
    return client


def do_on_cluster(function: Callable[[T], R], task: T) -> R:
    """Do a task on a worker, within its limit of memory.

    A worker with several threads does one task at a time: the loops of Python do not run in
    parallel, and a limit of memory is that of a process.
    """
    limit_worker()
    with _ONE_TASK:
        return function(task)


@lru_cache(maxsize=1)
def limit_worker() -> None:
    """Let an allocation beyond the limit of the worker fail, before Dask kills the process.

    The error is then a row, and the worker goes on with other tasks.
    """
    from distributed import get_worker

    limit: int | None = get_worker().memory_manager.memory_limit
    if limit:
        limit_memory(max(0, int(tuning.MEMORY_SHARE * limit) - used_data()))
