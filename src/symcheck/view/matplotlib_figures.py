"""Pictures drawn with matplotlib, placed as in their SVG."""

from __future__ import annotations

from typing import Any

from symcheck.view.graph import Edge, Layered, Node
from symcheck.view.layout import Placed, Route, place, routes
from symcheck.view.plots import axes_of
from symcheck.view.style import STYLES

__all__ = ["draw"]

_POINTS = 72.0
_LINE = "#404040"


def draw(picture: Layered, axes: Any = None) -> Any:
    """A picture in the given axes, or in new ones of its size; returns the axes."""
    placed = place(picture)
    axes = axes_of(axes, (placed.width / _POINTS, placed.height / _POINTS))
    for edge, route in routes(picture, placed):
        _edge(axes, edge, route)
    for node in picture.nodes:
        _node(axes, node, placed)
    axes.set(xlim=(0, placed.width), ylim=(placed.height, 0))
    axes.set_title(picture.title, fontsize="medium", pad=0)
    axes.set_aspect("equal", anchor="N")  # titles of pictures side by side stand in one line
    axes.axis("off")
    return axes


def _edge(axes: Any, edge: Edge, route: Route) -> None:
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.path import Path

    way = Path(route.points, [Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4])
    dashes = "--" if edge.dashed else "-"
    axes.add_patch(
        FancyArrowPatch(
            path=way,
            arrowstyle="-|>",
            mutation_scale=8,
            linewidth=0.8,
            linestyle=dashes,
            color=_LINE,
        )
    )
    if edge.label:
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
        axes.text(
            *route.label,
            edge.label,
            fontsize=7,
            ha="left" if route.beside else "center",
            va="center",
            bbox=box,
        )


def _node(axes: Any, node: Node, placed: Placed) -> None:
    from matplotlib.patches import Ellipse, FancyBboxPatch

    (x, y), (w, h) = placed.at[node.name], placed.size[node.name]
    style = STYLES[node.kind]
    paint: dict[str, Any] = {
        "facecolor": style.fill,
        "edgecolor": style.line,
        "linewidth": 0.9,
        "zorder": 2,
    }
    if style.shape in ("round", "point"):
        axes.add_patch(Ellipse((x, y), w, h, **paint))
    else:
        rounded = "round,pad=0,rounding_size=8" if style.shape == "pill" else "square,pad=0"
        axes.add_patch(FancyBboxPatch((x - w / 2, y - h / 2), w, h, boxstyle=rounded, **paint))
    if node.kind != "choice":
        axes.text(x, y, node.label, fontsize=8, ha="center", va="center", zorder=3)
