"""The results of several properties: one after the other, by index, and by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import cast

from symcheck.check.result import Result
from symcheck.engines.states import Named
from symcheck.semantics.binding.bind import BoundProperty

__all__ = ["PropertyResults", "position"]


class PropertyResults(Iterator[tuple[BoundProperty, Result]]):
    """Properties with their results. Each is checked when it is asked for.

    Iteration gives each property with its result, once, and keeps none. `results["six"]` is the
    result of the property with this name, and `results[0]` that of the first one; these are kept.
    """

    def __init__(
        self,
        names: Sequence[str | None],
        check: Callable[[int], tuple[BoundProperty, Result]],
    ) -> None:
        self._names, self._check = names, check
        self._found: dict[int, tuple[BoundProperty, Result]] = {}
        self._next = 0

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name is not None and name in self._names

    def __getitem__(self, key: int | str) -> Result:
        index = position(self._names, key)
        if index not in self._found:
            self._found[index] = self._check(index)
        return self._found[index][1]

    def __next__(self) -> tuple[BoundProperty, Result]:
        if self._next == len(self):
            raise StopIteration
        index, self._next = self._next, self._next + 1
        return self._found[index] if index in self._found else self._check(index)

    def __repr__(self) -> str:
        names = (name or str(i) for i, name in enumerate(self._names))
        return f"<PropertyResults: {', '.join(names)}>"


def position(names: Sequence[str | None], key: int | str) -> int:
    """The index of a result: of the property with a name, or of a number, also from the end.

    Raises KeyError, IndexError, TypeError.
    """
    if isinstance(key, str):
        return Named((name, i) for i, name in enumerate(names) if name is not None)[key]
    if not isinstance(cast(object, key), int):
        raise TypeError(f"a result has a number or a name, not {key!r}")
    if not -len(names) <= key < len(names):
        raise IndexError(f"result {key} of {len(names)}, which have the numbers from 0")
    return key % len(names)
