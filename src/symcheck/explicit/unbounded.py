"""What a search says that ends early because a variable without bounds grows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from symcheck.explicit.states import Rows, StateLayout
from symcheck.semantics.expressions.evaluate import INT_MAX, INT_MIN
from symcheck.semantics.model import BoundModel

__all__ = ["Growth", "ReachedValues", "growth"]

_SHOWN = 3
_ROWS_AT_A_TIME = 1 << 16


class Growth(NamedTuple):
    """What a variable without bounds has reached, and what to do about it."""

    note: str
    hint: str


def growth(model: BoundModel, reached: Mapping[int, tuple[int, int]]) -> Growth | None:
    """Which variables without bounds grow, and how far they came; None if there are none.

    Diagrams do not help, because they need bounds.

    Args:
        model: the model.
        reached: the least and the largest value so far of each such variable, by its index.
    """
    widest = sorted(
        (i for i, (low, high) in reached.items() if low < high),
        key=lambda i: reached[i][0] - reached[i][1],
    )
    if not widest:
        return None
    parts = []
    for i in widest[:_SHOWN]:
        variable, (low, high) = model.variables[i], reached[i]
        parts.append(
            f"{variable.name} ({variable.span}) has no bounds, and has reached {low}..{high}"
        )
    name = model.variables[widest[0]].name
    hint = (
        f"give {name} a range, as in {name} : [0..100], or a guard that stops it; -nostates "
        "(stop_at_targets) leaves out what follows the states that decide all properties; "
        "probabilities and rewards within a time need a part of the states only (-truncate); "
        "-cuddmaxmem (max_memory) gives more memory"
    )
    return Growth("; ".join(parts), hint)


class ReachedValues:
    """The least and the largest value of each variable without bounds in the states of a search.

    They are noted on the way: a search that is stopped has neither time nor memory for it.
    """

    def __init__(self, layout: StateLayout) -> None:
        self.values: dict[int, tuple[int, int]] = {}
        self._layout = layout
        self._unbounded = [i for i, v in enumerate(layout.variables) if v.low is None]
        self._noted = 0

    def note(self, rows: Rows) -> None:
        """Take note of the packed states that were not there before."""
        if not self._unbounded:
            return
        while self._noted < len(rows):
            part = rows[self._noted : self._noted + _ROWS_AT_A_TIME]
            for i in self._unbounded:
                values = self._layout.column(part, i)
                low, high = self.values.get(i, (INT_MAX, INT_MIN))
                self.values[i] = min(low, int(values.min())), max(high, int(values.max()))
            self._noted += len(part)
