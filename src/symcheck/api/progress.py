"""Words on the progress of building and solving, some times a second."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Protocol

__all__ = ["Reporter"]

_PAUSE = 0.1
"""Seconds between two words."""


class _Iteration(Protocol):
    @property
    def method(self) -> str: ...
    @property
    def iteration(self) -> int: ...
    @property
    def states(self) -> int: ...


class Reporter:
    """An observer that tells what happens in a line, but not too often.

    Args:
        say: takes a line.

    Attributes:
        say: likewise; it may be replaced.
    """

    def __init__(self, say: Callable[[str], object]) -> None:
        self.say = say
        self._told = 0.0

    def __call__(self, event: object) -> None:
        """Tell an event of building, or of an experiment."""
        if perf_counter() - self._told > _PAUSE:
            self._told = perf_counter()
            self.say(str(event).splitlines()[0])

    def iteration(self, event: _Iteration) -> None:
        """Tell an iteration of a numerical method."""
        self(f"{event.method}: iteration {event.iteration:,}, {event.states:,} states")
