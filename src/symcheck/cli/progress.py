"""Progress of building a model: one line on a terminal, and every step with -v."""

from __future__ import annotations

import sys
from time import perf_counter

from symcheck.cli.output import Output
from symcheck.engines.selection import Choice

__all__ = ["Progress"]

_INTERVAL = 0.2  # seconds between two versions of the line


class Progress:
    """An observer of builders. On a terminal it updates one line on standard error."""

    def __init__(self, output: Output) -> None:
        self.output = output
        self.terminal = output.out is sys.stdout and sys.stderr.isatty()
        self.wanted = self.terminal or output.verbose
        self.choice: Choice | None = None
        self._shown = perf_counter()
        self._visible = False

    def __call__(self, event: object) -> None:
        """Take note of an event of a builder."""
        if isinstance(event, Choice):
            self.choice = event
            return
        self.output.detail(str(event))
        now = perf_counter()
        if self.terminal and not self.output.verbose and now - self._shown > _INTERVAL:
            self._shown, self._visible = now, True
            print(
                f"\r\x1b[2K{str(event).splitlines()[0][:100]}", end="", file=sys.stderr, flush=True
            )

    def clear(self) -> None:
        """Remove the line."""
        if self._visible:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)
            self._visible = False
