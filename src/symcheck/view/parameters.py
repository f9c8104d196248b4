"""Plots of functions and regions of one or two parameters, by matplotlib (extra `plot`)."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from textwrap import shorten
from typing import TYPE_CHECKING

import numpy as np

from symcheck.charts import axes_of
from symcheck.errors import UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from symcheck.check.regions import Regions
    from symcheck.matrices.rational_functions import RationalFunction
    from symcheck.numerics.bernstein import Box

__all__ = ["plot_function", "plot_regions"]

_COLOURS = {"true": "#7fb58a", "false": "#d98880", "no model": "#9a9a9a", "undecided": "white"}
_OTHERS = ("#8aa8cf", "#e0b070", "#b09cc8", "#9cc8c0")


def _labelled(box: Box, axes: Axes | None) -> Axes:
    """Axes with the names and ranges of one or two parameters."""
    if len(box) > 2:
        raise UsageError(f"a plot has one or two parameters, and there are {len(box)}")
    axes = axes_of(axes)
    set_label, set_range = (axes.set_xlabel, axes.set_ylabel), (axes.set_xlim, axes.set_ylim)
    for i, (name, (low, high)) in enumerate(box.items()):
        set_label[i](name)
        set_range[i](float(low), float(high))
    return axes


def plot_regions(regions: Regions, axes: Axes | None = None) -> Axes:
    """The boxes of each outcome in a colour; undecided ones are white.

    Raises:
        UsageError: there are more than two parameters.
        UnsupportedError: matplotlib is not installed.
    """
    axes = _labelled(regions.box, axes)
    from matplotlib.patches import Patch, Rectangle

    if len(regions.box) == 1:
        axes.set_yticks([])
    shown = []
    for i, (text, boxes) in enumerate(regions.outcomes):
        colour = _COLOURS.get(text, _OTHERS[i % len(_OTHERS)])
        label = f"{shorten(text, 30)} ({float(regions.share_of(boxes)):.2%})"
        shown.append(Patch(facecolor=colour, edgecolor="#606060", label=label))
        for box in boxes:
            (x, right), (y, top) = [*box.values(), (Fraction(0), Fraction(1))][:2]
            size = float(right - x), float(top - y)
            axes.add_patch(Rectangle((float(x), float(y)), *size, color=colour, linewidth=0.5))
    axes.legend(handles=shown, loc="lower center", bbox_to_anchor=(0.5, 1), ncols=2, frameon=False)
    return axes


def plot_function(
    function: RationalFunction, box: Box, axes: Axes | None = None, points: int = 50
) -> Axes:
    """A function of one parameter as a line, of two as a map of colours, over their ranges."""
    axes = _labelled(box, axes)
    steps = [Fraction(2 * i + 1, 2 * points) for i in range(points)]
    grid = [[low + (high - low) * step for step in steps] for low, high in box.values()]
    found = [float(function(**dict(zip(box, p, strict=True)))) for p in product(*grid)]
    places, values = np.array(grid, float), np.array(found)
    if len(box) == 1:
        axes.plot(places[0], values)
    else:
        image = axes.pcolormesh(places[0], places[1], values.reshape(points, points).T)
        axes.figure.colorbar(image, ax=axes)
    return axes
