"""Plots of functions and regions of one or two parameters, by matplotlib (extra `plot`)."""

from __future__ import annotations

from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np

from symcheck.errors import UsageError
from symcheck.view.plots import axes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symcheck.check.regions import Regions
    from symcheck.matrices.rational_functions import RationalFunction
    from symcheck.numerics.bernstein import Box

__all__ = ["plot_function", "plot_regions"]

_COLOURS = {"True": "#7fb58a", "False": "#d98880"}
_OTHERS = ("#8aa8cf", "#e0b070", "#b09cc8", "#9cc8c0")


def _names(box: Box) -> list[str]:
    if len(box) > 2:
        raise UsageError(f"a plot has one or two parameters, and there are {len(box)}")
    return list(box)


def plot_regions(regions: Regions, axes: Axes | None = None) -> Axes:
    """The boxes of each value in a colour; undecided ones stay white."""
    from matplotlib.patches import Patch, Rectangle

    axes, names = axes_of(axes), _names(regions.box)
    colours: dict[str, str] = {}
    for case in regions.cases:
        text = str(case.value)
        colour = _COLOURS.get(text, _OTHERS[len(colours) % len(_OTHERS)])
        colour = colours.setdefault(text, colour)
        for box in case.boxes:
            (x, right), *rest = (box[n] for n in names)
            y, top = rest[0] if rest else (0, 1)
            size = float(right - x), float(top - y)
            axes.add_patch(Rectangle((float(x), float(y)), *size, color=colour))
    axes.set_xlim(*map(float, regions.box[names[0]]))
    axes.set_xlabel(names[0])
    if names[1:]:
        axes.set_ylim(*map(float, regions.box[names[1]]))
        axes.set_ylabel(names[1])
    axes.legend(handles=[Patch(color=c, label=shorten(t, 30)) for t, c in colours.items()])
    return axes


def plot_function(
    function: RationalFunction, box: Box, axes: Axes | None = None, points: int = 50
) -> Axes:
    """A function of one parameter as a line, of two as a map of colours, over their ranges."""
    axes, names = axes_of(axes), _names(box)
    grid = [
        [low + (high - low) * (2 * i + 1) / (2 * points) for i in range(points)]
        for low, high in box.values()
    ]
    if not names[1:]:
        axes.plot([*map(float, grid[0])], [float(function(**{names[0]: x})) for x in grid[0]])
    else:
        values = [[float(function(**{names[0]: x, names[1]: y})) for x in grid[0]] for y in grid[1]]
        image = axes.pcolormesh(
            np.array(grid[0], float), np.array(grid[1], float), np.array(values)
        )
        axes.figure.colorbar(image, ax=axes)
        axes.set_ylabel(names[1])
    axes.set_xlabel(names[0])
    return axes
