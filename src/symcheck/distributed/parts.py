"""The parts of a model as Dask actors, one on each worker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError
from typing import Any, Protocol, TypeVar

from symcheck.distributed.part import Messages, Part
from symcheck.errors import ResourceError, SymcheckError, UsageError, out_of_memory
from symcheck.parallel.dask import limit_worker
from symcheck.semantics.model import BoundModel

__all__ = ["Cluster", "Parts"]

R = TypeVar("R")


class Cluster(Protocol):
    """What is needed of a `distributed.Client`."""

    def submit(self, function: Callable[..., object], *arguments: object, **options: object) -> Any:
        """Submit a task."""
        ...

    def nthreads(self) -> dict[str, int]:
        """The workers by address."""
        ...


class LimitedPart(Part):
    """A part within the limit of memory of its worker."""

    def __init__(self, model: BoundModel, number: int, parts: int) -> None:
        limit_worker()
        super().__init__(model, number, parts)


class Parts:
    """A part of the model on each worker of a cluster. Methods are called on all of them at once.

    The messages of parts pass through this process.

    Raises:
        UsageError: the cluster has no workers.
        ResourceError: a worker is lost, or has not enough memory.
    """

    def __init__(self, model: BoundModel, cluster: Cluster) -> None:
        workers = sorted(cluster.nthreads())
        if not workers:
            raise UsageError("the cluster has no workers\n  hint: dask worker tcp://HOST:8786")
        created = [
            cluster.submit(
                LimitedPart, model, i, len(workers), actor=True, workers=[worker], pure=False
            )
            for i, worker in enumerate(workers)
        ]
        self._actors = [self._wait(future) for future in created]

    def __len__(self) -> int:
        return len(self._actors)

    def call(self, method: Callable[..., R], *arguments: object) -> list[R]:
        """The results of a method of `Part`, with the same arguments, on each part."""
        return self._call(method, [arguments] * len(self))

    def exchange(self, method: Callable[..., R], outgoing: Sequence[Messages]) -> list[R]:
        """Give each part what the others have for it: the results of a method of `Part`."""
        return self._call(method, [([m[i] for m in outgoing],) for i in range(len(self))])

    def _call(self, method: Callable[..., R], arguments: Sequence[Sequence[object]]) -> list[R]:
        calls = [
            getattr(actor, method.__name__)(*given)
            for actor, given in zip(self._actors, arguments, strict=True)
        ]
        return [self._wait(call) for call in calls]

    @staticmethod
    def _wait(call: Any) -> Any:
        """The result of a call."""
        try:
            return call.result()
        except SymcheckError:
            raise
        except MemoryError as error:
            raise out_of_memory("more workers have more memory") from error
        except (OSError, CancelledError, KeyError) as error:  # KeyError: the worker began anew
            raise ResourceError(
                f"a worker of the cluster is lost, with its states ({error})"
                "\n  hint: run again; the other workers go on"
            ) from error
