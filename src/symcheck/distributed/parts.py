"""The parts of a model as Dask actors, one on each worker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass
from time import monotonic, sleep
from typing import Any, Protocol, TypeVar

from symcheck.distributed import tuning
from symcheck.distributed.checkpoints import Folder
from symcheck.distributed.part import Part
from symcheck.distributed.partition import Partition
from symcheck.errors import ResourceError, SymcheckError, out_of_memory
from symcheck.parallel.dask import limit_worker
from symcheck.semantics.model import BoundModel

__all__ = ["Cluster", "PartLost", "Parts"]

R = TypeVar("R")
M = TypeVar("M")


class Cluster(Protocol):
    """What is needed of a `distributed.Client`."""

    def submit(self, function: Callable[..., object], *arguments: object, **options: object) -> Any:
        """Submit a task."""
        ...

    def nthreads(self) -> dict[str, int]:
        """The workers by address."""
        ...


class PartLost(ResourceError):
    """Workers are lost, with their parts.

    Attributes:
        numbers: of the parts.
    """

    def __init__(self, numbers: Sequence[int], why: BaseException) -> None:
        super().__init__(
            f"a worker of the cluster is lost, with its states ({why})",
            hint="run again, with a folder of checkpoints; the other workers go on",
        )
        self.numbers = tuple(numbers)


def create_part(
    model: BoundModel,
    number: int,
    partition: Partition,
    folder: Folder | None,
    check_sums: bool,
) -> Part:
    """A part within the limit of memory of its worker."""
    limit_worker()
    files = None if folder is None else folder.files(number)
    return Part(model, number, partition, files, check_sums=check_sums)


@dataclass(frozen=True)
class _Placed:
    """A part on a worker; None if the worker was lost before the part was created."""

    worker: str
    actor: Any


@dataclass(frozen=True)
class _Creation:
    """A part that is created on a worker. Dask would wait for a worker that is lost."""

    cluster: Cluster
    worker: str
    future: Any

    def result(self) -> Any:
        while not self.future.done():
            if self.worker not in self.cluster.nthreads():
                self.future.cancel()
                raise OSError(f"{self.worker} has ended")
            sleep(tuning.POLLING_SECONDS)
        return self.future.result()


class Parts:
    """A part of the model on each worker of a cluster. Methods are called on all of them at once.

    The messages of parts pass through this process.

    Args:
        workers: the address of the worker of each part.
        folder: of checkpoints.

    Raises:
        PartLost: workers are lost.
        ResourceError: a worker has not enough memory.
    """

    def __init__(
        self,
        model: BoundModel,
        cluster: Cluster,
        workers: Sequence[str],
        partition: Partition,
        folder: Folder | None,
        *,
        check_sums: bool,
    ) -> None:
        self._model, self._cluster, self._partition = model, cluster, partition
        self.folder, self._check_sums = folder, check_sums
        self._placed: list[_Placed] = []
        self.losses = 0
        created = [self._create(i, worker) for i, worker in enumerate(workers)]
        for creation in created:
            try:
                actor = self.results([creation])[0]
            except PartLost:
                actor = None
            self._placed.append(_Placed(creation.worker, actor))
        try:
            self.call(Part.is_explored)
        except PartLost as error:
            self.recover(error)

    def __len__(self) -> int:
        return self._partition.parts

    def _create(self, number: int, worker: str) -> _Creation:
        future = self._cluster.submit(
            create_part,
            self._model,
            number,
            self._partition,
            self.folder,
            self._check_sums,
            actor=True,
            workers=[worker],
            pure=False,
        )
        return _Creation(self._cluster, worker, future)

    def call(self, method: Callable[..., R], *arguments: object) -> list[R]:
        """The results of a method of `Part`, or of what it holds, with the same arguments, on each
        part.
        """
        return self.results(self._calls(method, [arguments] * len(self)))

    def exchange(
        self, method: Callable[..., R], outgoing: Sequence[Sequence[M]], *arguments: object
    ) -> list[R]:
        """Give each part what the others have for it: the results of a method of `Part`."""
        return self.results(self.begin(method, outgoing, *arguments))

    def begin(
        self, method: Callable[..., R], outgoing: Sequence[Sequence[M]], *arguments: object
    ) -> list[Any]:
        """Begin an exchange, of which `results` has the results.

        A part may make its calls in another order than that in which exchanges begin.
        """
        given = [([m[i] for m in outgoing], *arguments) for i in range(len(self))]
        return self._calls(method, given)

    def _calls(self, method: Callable[..., R], arguments: Sequence[Sequence[object]]) -> list[Any]:
        return [
            _perform(part.actor)(*method.__qualname__.split("."), *given)
            for part, given in zip(self._placed, arguments, strict=True)
        ]

    @staticmethod
    def results(calls: Sequence[Any]) -> list[Any]:
        """The results of calls, once all of them have ended."""
        results, lost, errors = [], [], []
        for i, call in enumerate(calls):
            try:
                results.append(call.result())
            except SymcheckError as error:
                errors.append(error)
            except MemoryError as error:
                errors.append(out_of_memory("more workers have more memory"))
                errors[-1].__cause__ = error
            except (OSError, CancelledError, KeyError) as error:  # KeyError: it began anew
                lost.append((i, error))
        if errors:
            raise errors[0]
        if lost:
            raise PartLost([i for i, _ in lost], lost[0][1])
        return results

    def recover(self, error: PartLost) -> None:
        """Create lost parts anew, from their checkpoints if there are some.

        Parts that are still explored must exchange all ghosts again. If only some are explored,
        they begin anew, since they cannot send their ghosts any more.

        Raises:
            ResourceError: there is no worker, or too many were lost.
        """
        while True:
            self.losses += 1
            if self.losses > tuning.MAX_LOSSES:
                raise error
            try:
                self._replace(error)
                explored = self.call(Part.is_explored)
                if any(explored) and not all(explored):
                    for number in range(len(self)):
                        self._place(number, self._placed[number].worker)
                return
            except PartLost as another:
                error = another

    def _replace(self, error: PartLost) -> None:
        living = {p.worker for i, p in enumerate(self._placed) if i not in error.numbers}
        for number in error.numbers:
            worker = self._free_worker(living, self._placed[number].worker, error)
            living.add(worker)
            self._place(number, worker)

    def _place(self, number: int, worker: str) -> None:
        """Create a part on a worker, in place of the one that there may be.

        Dask creates nothing on a worker that has filled most of its memory.
        """
        self._placed[number] = _Placed(worker, None)
        try:
            self._placed[number] = _Placed(worker, self.results([self._create(number, worker)])[0])
        except PartLost as error:
            raise PartLost([number], error) from error

    def _free_worker(self, living: set[str], lost: str, error: PartLost) -> str:
        """A worker without a part; if none comes, one that has a part."""
        end = monotonic() + tuning.RESTART_SECONDS
        while monotonic() < end:
            free = sorted(set(self._cluster.nthreads()) - living - {lost})
            if free:
                return free[0]
            sleep(0.1)
        remaining = sorted(self._cluster.nthreads())
        if not remaining:
            raise error
        free = [w for w in remaining if w not in living]
        return (free or remaining)[0]


def _perform(actor: Any) -> Callable[..., Any]:
    """`Part.perform` of an actor. An actor that is known to be lost has none: the call fails."""
    try:
        if actor is None:
            raise RuntimeError("its worker was lost")
        method: Callable[..., Any] = actor.perform
    except RuntimeError as error:
        failed: Future[object] = Future()
        failed.set_exception(OSError(str(error)))
        return lambda *_: failed
    return method
