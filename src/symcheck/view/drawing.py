"""Pictures drawn with matplotlib, placed as in their SVG."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from symcheck.view.layout import Placed, label_shares, place
from symcheck.view.picture import Edge, Node, Picture
from symcheck.view.plots import axes_of
from symcheck.view.style import STYLES

__all__ = ["draw"]

_POINTS = 72.0
_LINE = "#404040"


def draw(picture: Picture, axes: Any = None) -> Any:
    """A picture in the given axes, or in new ones of its size; returns the axes."""
    placed = place(picture)
    axes = axes_of(axes, (placed.width / _POINTS, placed.height / _POINTS))
    shares = label_shares(picture)
    for edge in picture.edges:
        _edge(axes, edge, placed, shares)
    for node in picture.nodes:
        _node(axes, node, placed)
    axes.set(xlim=(0, placed.width), ylim=(placed.height, 0))
    axes.set_title(picture.title, fontsize="medium")
    axes.set_aspect("equal")
    axes.axis("off")
    return axes


def _edge(axes: Any, edge: Edge, placed: Placed, shares: Mapping[tuple[str, str], float]) -> None:
    from matplotlib.patches import FancyArrowPatch

    (x1, y1), (x2, y2) = placed.at[edge.source], placed.at[edge.target]
    (w1, h1), (w2, h2) = placed.size[edge.source], placed.size[edge.target]
    if edge.source == edge.target:
        side = x1 + w1 / 2 - 4
        start, end, bend, label = (side, y1 - h1 / 4), (side, y1 + h1 / 4), -2.2, (side + 22, y1)
    elif y2 > y1:
        start, end, bend = (x1, y1 + h1 / 2), (x2, y2 - h2 / 2), 0.06
        share = shares[edge.source, edge.target]
        label = (start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1]))
    else:  # back to a layer above, or to a neighbour: round on the right
        start, end, bend = (x1 + w1 / 2, y1), (x2 + w2 / 2, y2), 0.5 if y2 < y1 else -0.5
        label = ((start[0] + end[0]) / 2 + abs(y1 - y2) / 4, (y1 + y2) / 2 + abs(end[0] - start[0]) / 4)
    axes.add_patch(
        FancyArrowPatch(
            start, end, connectionstyle=f"arc3,rad={bend}", arrowstyle="-|>", mutation_scale=8,
            linewidth=0.8, linestyle="--" if edge.dashed else "-", color=_LINE,
        )
    )  # fmt: skip
    if edge.label:
        box = {"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85}
        axes.text(*label, edge.label, fontsize=7, ha="center", va="center", bbox=box)


def _node(axes: Any, node: Node, placed: Placed) -> None:
    from matplotlib.patches import Ellipse, FancyBboxPatch

    (x, y), (w, h) = placed.at[node.name], placed.size[node.name]
    style = STYLES[node.kind]
    paint: dict[str, Any] = {"facecolor": style.fill, "edgecolor": style.line, "linewidth": 0.9, "zorder": 2}
    if style.shape in ("round", "point"):
        axes.add_patch(Ellipse((x, y), w, h, **paint))
    else:
        rounded = "round,pad=0,rounding_size=8" if style.shape == "pill" else "square,pad=0"
        axes.add_patch(FancyBboxPatch((x - w / 2, y - h / 2), w, h, boxstyle=rounded, **paint))
    if node.kind != "choice":
        axes.text(x, y, node.label, fontsize=8, ha="center", va="center", zorder=3)
