"""Progress of a run: one line on a terminal. With -v, each step of building has a line."""

from __future__ import annotations

import sys
from functools import cache
from math import inf
from time import perf_counter
from typing import TYPE_CHECKING

from symcheck.cli.output import Output
from symcheck.engines.selection import Choice

if TYPE_CHECKING:
    from symcheck.numerics.linear.problem import Progress as Iteration
    from symcheck.simulate.check import SampledSoFar

__all__ = ["Progress"]

_INTERVAL = 0.2  # seconds between two versions of the line


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
        self.choice: Choice | None = None
        self.sampled: SampledSoFar | None = None
        self._shown = perf_counter()
        self._visible = False

    def __call__(self, event: object) -> None:
        """Take note of an event of a builder."""
        if isinstance(event, Choice):
            self.choice = event
            return
        self.output.detail(str(event))
        if not self.output.verbose and self._is_due():
            self._show(str(event).splitlines()[0])

    def iteration(self, event: Iteration) -> None:
        """Take note of an iteration of a numerical method."""
        if not self._is_due():
            return
        what = "last change" if event.method in _estimates() else "bounds apart by"
        width = f", {what} {event.width:.1E}" if 0 < event.width < inf else ""
        self._show(f"{event.method}: iteration {event.iteration:,}{width}, {event.states:,} states")

    def samples(self, event: SampledSoFar) -> None:
        """Take note of samples."""
        self.sampled = event
        if not self._is_due():
            return
        accuracy = event.accuracy
        if accuracy is None:
            estimate = f"mean {event.mean:.6g}"
        else:
            half = max(accuracy.upper - event.mean, event.mean - accuracy.lower)
            estimate = f"{event.mean:.6g} +/- {half:.1E}"
        target = "" if event.target is None else f" of {event.target:,}"
        self._show(f"{event.samples:,}{target} samples: {estimate}")

    def _is_due(self) -> bool:
        """Whether the line may change."""
        return self.terminal and perf_counter() - self._shown > _INTERVAL

    def _show(self, text: str) -> None:
        self._shown, self._visible = perf_counter(), True
        print(f"\r\x1b[2K{text[:100]}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Remove the line."""
        if self._visible:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)
            self._visible = False
