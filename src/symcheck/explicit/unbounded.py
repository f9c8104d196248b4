"""What a search says that ends early because a variable without bounds grows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from symcheck.explicit.states import Rows, StateLayout
from symcheck.semantics.expressions.evaluate import INT_MAX, INT_MIN
from symcheck.semantics.model import BoundModel

__all__ = ["Growth", "growth", "reached"]

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
        "-cuddmaxmem (max_memory) gives more memory"
    )
    return Growth("; ".join(parts), hint)


def reached(layout: StateLayout, rows: Rows) -> dict[int, tuple[int, int]]:
    """The least and the largest value of each variable without bounds in packed states."""
    result: dict[int, tuple[int, int]] = {}
    for i, variable in enumerate(layout.variables):
        if variable.low is not None or not len(rows):
            continue
        low, high = INT_MAX, INT_MIN
        for begin in range(0, len(rows), _ROWS_AT_A_TIME):  # memory is short
            values = layout.column(rows[begin : begin + _ROWS_AT_A_TIME], i)
            low, high = min(low, int(values.min())), max(high, int(values.max()))
        result[i] = low, high
    return result
