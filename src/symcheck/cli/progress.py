"""What is seen of a model while it is being built: a line on a terminal, and every step with -v."""

from __future__ import annotations

import sys
from time import perf_counter

from symcheck.cli.report import Report
from symcheck.engines.selection import Choice

__all__ = ["Progress"]

_INTERVAL = 0.2  # seconds between two versions of the line


class Progress:
    """An observer of builders. On a terminal it keeps one line on standard error up to date."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self.terminal = sys.stderr.isatty()
        self.wanted = self.terminal or report.verbose
        self.choice: Choice | None = None
        self._shown = perf_counter()
        self._visible = False

    def __call__(self, news: object) -> None:
        """Take note of what a builder tells."""
        if isinstance(news, Choice):
            self.choice = news
            return
        self.report.detail(str(news))
        now = perf_counter()
        if self.terminal and not self.report.verbose and now - self._shown > _INTERVAL:
            self._shown, self._visible = now, True
            print(
                f"\r\x1b[2K{str(news).splitlines()[0][:100]}", end="", file=sys.stderr, flush=True
            )

    def clear(self) -> None:
        """Take the line away again."""
        if self._visible:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)
            self._visible = False
