"""A cluster whose workers are this process, with the calls of a `distributed.Client`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Call:
    """The future of a call that has ended, or waits for ever for a worker that is lost."""

    value: Any = None
    error: BaseException | None = None
    waits: bool = False

    def done(self) -> bool:
        return not self.waits

    def cancel(self) -> None:
        assert self.waits

    def result(self) -> Any:
        assert not self.waits
        if self.error is not None:
            raise self.error
        return self.value


@dataclass
class Actor:
    """A value whose methods return futures, while its worker lives."""

    value: Any
    worker: str
    cluster: InProcessCluster

    def __getattr__(self, name: str) -> Callable[..., Call]:
        if self.worker not in self.cluster.workers:
            raise RuntimeError("Worker holding Actor was lost.  Status: error")
        return lambda *arguments: self.cluster.do(self.worker, getattr(self.value, name), arguments)


@dataclass
class InProcessCluster:
    """Workers by name.

    killed: for each call of an actor that is still to come, whether a worker dies before it, one
        after the other; another one takes its place.
    """

    workers: list[str]
    killed: Iterator[bool] = field(default_factory=lambda: iter(()))
    deaths: int = 0

    def nthreads(self) -> dict[str, int]:
        return dict.fromkeys(self.workers, 1)

    def submit(self, function: Callable[..., Any], *arguments: Any, **options: Any) -> Call:
        (worker,) = options["workers"]
        if worker not in self.workers:
            return Call(waits=True)
        return Call(Actor(function(*arguments), worker, self))

    def do(self, worker: str, method: Callable[..., Any], arguments: Sequence[Any]) -> Call:
        if worker in self.workers and next(self.killed, False):
            victim = self.workers.pop(self.deaths % len(self.workers))
            self.deaths += 1
            self.workers.append(f"{victim.partition('-')[0]}-{self.deaths}")
        if worker not in self.workers:
            return Call(error=OSError("connection lost"))
        try:
            return Call(method(*arguments))
        except Exception as error:
            return Call(error=error)


def cluster(workers: int, killed: Iterator[bool] = iter(())) -> InProcessCluster:  # noqa: B008
    return InProcessCluster([f"w{i}" for i in range(workers)], killed)
