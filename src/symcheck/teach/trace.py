"""Traces: frames that are made when they are asked for, and that play in a notebook."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Generic, TypeVar

from symcheck.page.document import JsonObject, fragment

__all__ = ["Trace"]

F = TypeVar("F")


class Trace(Generic[F]):
    """A sequence of frames. In a notebook it is a player with buttons and keys.

    Args:
        frames: the frames; each is made when it is first used, and kept.
        player: gives the data of a page (see `symcheck.page.document`) that plays all frames.
    """

    def __init__(self, frames: Iterable[F], player: Callable[[list[F]], JsonObject]) -> None:
        self._source, self._made, self._player = iter(frames), list[F](), player

    def __iter__(self) -> Iterator[F]:
        number = 0
        while number < len(self._made) or self._more():
            yield self._made[number]
            number += 1

    def _more(self) -> bool:
        for frame in self._source:
            self._made.append(frame)
            return True
        return False

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __getitem__(self, number: int) -> F:
        while self._more():
            pass
        return self._made[number]

    def __repr__(self) -> str:
        return f"<Trace of {len(self)} frames>"

    def _repr_html_(self) -> str:
        return fragment(self._player(list(self)))
