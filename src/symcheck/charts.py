"""Plots of numbers by matplotlib (extra `plot`): into the given axes, or into new ones.

They raise UnsupportedError if matplotlib is not installed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symcheck.tables import optional_package

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

__all__ = ["BLUE", "axes_of", "plot_bars", "plot_front", "pyplot", "save_chart"]

BLUE = "#1f4e8c"
"""The colour of what stands alone."""
_LIGHT = "#8fb0d8"
_SIZE = (6.4, 4.0)  # inches
_BAR = 0.28
"""Inches that a bar takes."""


def axes_of(axes: Axes | None, size: tuple[float, float] = _SIZE) -> Axes:
    """The given axes, or new ones of a size in inches."""
    if axes is not None:
        return axes
    new: Axes = pyplot().subplots(figsize=size, layout="constrained")[1]
    return new


def save_chart(draw: Callable[[Axes], object], path: Path, kind: str) -> None:
    """Write what is drawn into new axes, as png, svg or pdf.

    The figure is made without pyplot, whose window system may be missing.
    """
    optional_package("matplotlib", "plot")
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, layout="constrained")
    FigureCanvasAgg(figure)
    draw(figure.subplots())
    figure.savefig(path, format=kind, dpi=150)


def pyplot() -> Any:
    """The module `matplotlib.pyplot`. Raises UnsupportedError if it is not installed."""
    optional_package("matplotlib", "plot")
    return import_module("matplotlib.pyplot")


def plot_bars(
    names: Sequence[str],
    values: ArrayLike,
    bounds: tuple[ArrayLike, ArrayLike] | None,
    what: str,
    axes: Axes | None,
) -> Axes:
    """A bar for each name, from the top down, with its bounds as a line.

    Args:
        names: what the bars stand for.
        values: float64[names].
        bounds: lower and upper ones, float64[names] each; None: the values have none.
        what: the name of the axis of the values.
        axes: where to draw.
    """
    axes = axes_of(axes, (6.4, 1.2 + _BAR * max(len(names), 3)))
    places = range(len(names))
    axes.barh(places, values, color=_LIGHT, edgecolor=BLUE)
    if bounds is not None:
        axes.hlines(places, *bounds, color=BLUE, linewidth=2)
    axes.set_yticks(places, names)
    axes.invert_yaxis()
    axes.set_xlabel(what)
    return axes


def plot_front(
    points: Sequence[tuple[float, float]], names: tuple[str, str], axes: Axes | None
) -> Axes:
    """The points of a front and the lines between them, sorted by their first coordinate."""
    axes = axes_of(axes)
    axes.plot(*zip(*points, strict=True), color=BLUE, marker="o")
    axes.set_xlabel(names[0])
    axes.set_ylabel(names[1])
    axes.grid(alpha=0.3)
    return axes
