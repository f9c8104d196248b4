"""Plots of rows over a constant, with matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symcheck.charts import axes_of, save_chart
from symcheck.errors import UsageError
from symcheck.experiments.rows import Row, constant_names, constant_text
from symcheck.numerics.tuning import ROUNDING_WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot", "save_plot"]

_FEW = 30
"""Up to so many points, bounds are bars; bars of more points cover each other."""


def save_plot(rows: Sequence[Row], varying: Sequence[str], path: Path, kind: str) -> None:
    """Write the plot of rows over the first constant with several values, as png, svg or pdf."""
    save_chart(lambda axes: plot(rows, varying, None, None, axes), path, kind)


def plot(
    rows: Sequence[Row],
    varying: Sequence[str],
    x: str | None,
    by: Sequence[str] | None,
    axes: Axes | None,
) -> Axes:
    """Plot rows into axes (None for new ones), and return them; see `Experiment.plot`."""
    present = {
        n: list(dict.fromkeys(r.constants[n] for r in rows if n in r.constants)) for n in varying
    }
    several = [n for n in varying if len(present[n]) > 1]
    if x is None and several:
        x = several[0]
    for name in (x, *(by or ())):
        if name is not None and not any(name in r.constants for r in rows):
            known = ", ".join(constant_names(rows)) or "none"
            raise UsageError(f"plot: there is no constant '{name}'; the constants are {known}")
    others = [n for n in several if n != x] if by is None else list(by)
    unnamed = [n for n in several if n != x and n not in others]
    if unnamed:
        raise UsageError(
            f"plot: {unnamed[0]} has several values too",
            hint=f"name it in by=, or choose one value with select({unnamed[0]}=...)",
        )
    new_axes = axes is None
    axes = axes_of(axes)
    lines: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        if row.number is not None and (x is None or x in row.constants):
            texts = (f"{n}={constant_text(row.constants[n])}" for n in others if n in row.constants)
            lines.setdefault((row.name, *texts), []).append(row)
    one_property = len({name for name, *_ in lines}) == 1
    measured = [_is_expectation(points[0]) for points in lines.values()]
    right = axes.twinx() if any(measured) and not all(measured) else axes
    first = len(axes.lines)  # in axes that have lines already
    for i, ((name, *values), points) in enumerate(lines.items()):
        label = ", ".join(values if one_property else (name, *values))
        positions = [r.name if x is None else r.constants[x] for r in points]
        _draw(right if measured[i] else axes, positions, points, label, f"C{(first + i) % 10}")
    if new_axes and x is not None and all(isinstance(value, int) for value in present[x]):
        axes.locator_params(axis="x", integer=True)
    axes.set_xlabel(x or "property")
    axes.set_ylabel(next(iter(lines))[0] if one_property else "value")
    if right is not axes:
        axes.set_ylabel("probability")
        right.set_ylabel("expected reward or time")
    if len(lines) > 1:
        both = [axes] if right is axes else [axes, right]
        handles = [handle for one in both for handle in one.get_legend_handles_labels()[0]]
        below: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14)}
        # matplotlib finds a free place among the lines of one pair of axes only.
        right.legend(handles=handles, **(below if new_axes and right is not axes else {}))
    return axes


def _is_expectation(row: Row) -> bool:
    """Whether a property asks for a reward or a time, which have an axis of their own."""
    return row.formula.startswith(("R", "T"))


def _draw(axes: Any, positions: Sequence[Any], rows: Sequence[Row], label: str, color: str) -> None:
    """One line, its points in order, with the bounds of its values."""
    if all(isinstance(p, str | bool) for p in positions):
        positions = [constant_text(p) for p in positions]
        order = list(range(len(rows)))
    else:
        positions = [float(p) for p in positions]
        order = sorted(range(len(rows)), key=lambda i: positions[i])
    across = [positions[i] for i in order]
    values = [rows[i].number for i in order]
    bounds = [rows[i].bounds or (rows[i].number, rows[i].number) for i in order]
    (line,) = axes.plot(across, values, marker="o", markersize=3.5, label=label, color=color)
    known = [(low, high) for low, high in bounds if low is not None and high is not None]
    if all(high - low <= ROUNDING_WIDTH * abs(high) for low, high in known):
        return
    lower, upper = zip(*bounds, strict=True)
    if len(order) > _FEW:
        axes.fill_between(across, lower, upper, color=line.get_color(), alpha=0.2, linewidth=0)
    else:
        lengths = [
            [abs(v - low) for v, low in zip(values, lower, strict=True)],
            [abs(high - v) for v, high in zip(values, upper, strict=True)],
        ]
        axes.errorbar(across, values, lengths, color=line.get_color(), capsize=2, linestyle="none")
