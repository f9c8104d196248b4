"""How kinds of nodes look, in DOT, SVG and matplotlib alike."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

__all__ = ["STYLES", "Style"]


@dataclass(frozen=True, slots=True)
class Style:
    """shape: 'box', 'round' (an ellipse), 'pill' (a box with round corners) or 'point'. Colours as #rrggbb."""

    shape: str
    fill: str
    line: str = "#404040"


STYLES: Mapping[str, Style] = {
    "row": Style("round", "#dce9f7"),
    "column": Style("round", "#fde3c8"),
    "pair": Style("pill", "#ece2f3"),
    "leaf": Style("box", "#f4f4f4"),
    "root": Style("box", "#ffffff", "#ffffff"),
    "state": Style("round", "#f4f4f4"),
    "initial": Style("round", "#dce9f7", "#1f4e8c"),
    "marked": Style("round", "#d7efd9", "#2b7a33"),
    "choice": Style("point", "#404040"),
}
