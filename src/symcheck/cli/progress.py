"""Progress of a run: one line on a terminal. With -v, each step of building has a line."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from math import inf
from threading import Event, Lock, Thread
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.cli.output import Output
from symcheck.engines.selection import EngineChoice

if TYPE_CHECKING:
    from symcheck.numerics.linear.problem import Progress as Iteration
    from symcheck.simulate.check import SampledSoFar

__all__ = ["Progress"]

_INTERVAL = 0.2  # seconds between two versions of the line
_PATIENCE = 1.0  # seconds after which the line changes also if nothing is reported


@cache
def _estimates() -> frozenset[str]:
    """The methods that prove no bounds."""
    from symcheck.numerics.linear.methods import METHODS

    return frozenset(name for name, method in METHODS.items() if not method.sound)


class Progress:
    """An observer of builders, numerical methods and sampling.

    On a terminal it updates one line on standard error, some times a second.

    Attributes:
        sampled: the samples of the current property.
    """

    def __init__(self, output: Output) -> None:
        self.output = output
        self.terminal = output.out is sys.stdout and sys.stderr.isatty()
        self.wanted = self.terminal or output.verbose
        self.choice: EngineChoice | None = None
        self.sampled: SampledSoFar | None = None
        self._shown = perf_counter()
        self._visible = False
        self._lock = Lock()

    def __call__(self, event: object) -> None:
        """Take note of an event of a builder."""
        if isinstance(event, EngineChoice):
            self.choice = event
            return
        self.output.detail(str(event))
        if not self.output.verbose and self._is_due():
            self._show(str(event).splitlines()[0])

    @contextmanager
    def checking(self) -> Iterator[None]:
        """A context that checks a property: the line shows its time, and vanishes at the end."""
        self.sampled = None
        if not self.terminal:
            yield
            return
        over = Event()
        self._text, self._started, self._shown = "checking", perf_counter(), perf_counter()
        Thread(target=self._tick, args=(over,), daemon=True).start()
        try:
            yield
        finally:
            over.set()
            self.clear()
        self.sampled = None

    def _tick(self, over: Event) -> None:
        """Show the time while a computation reports nothing."""
        while not over.wait(_PATIENCE):
            if perf_counter() - self._shown >= _PATIENCE:
                with self._lock:
                    if not over.is_set():
                        self._show(f"{self._text} ({perf_counter() - self._started:.0f} s)")

    def iteration(self, event: Iteration) -> None:
        """Take note of an iteration of a numerical method."""
        if not self._is_due():
            return
        what = "last change" if event.method in _estimates() else "bounds apart by"
        width = f", {what} {event.width:.1E}" if 0 < event.width < inf else ""
        self._text = (
            f"{event.method}: iteration {event.iteration:,}{width}, {event.states:,} states"
        )
        self._show(self._text)

    def samples(self, event: SampledSoFar) -> None:
        """Take note of samples."""
        self.sampled = event
        if not self._is_due():
            return
        self._text = str(event)
        self._show(self._text)

    def _is_due(self) -> bool:
        """Whether the line may change."""
        return self.terminal and perf_counter() - self._shown > _INTERVAL

    def _show(self, text: str) -> None:
        self._shown, self._visible = perf_counter(), True
        print(f"\r\x1b[2K{text[:100]}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the line."""
        with self._lock:
            if self._visible:
                print("\r\x1b[2K", end="", file=sys.stderr, flush=True)
                self._visible = False
