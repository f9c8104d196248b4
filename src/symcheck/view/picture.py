"""Pictures: layered graphs that write themselves as DOT and SVG."""

from __future__ import annotations

from dataclasses import dataclass

from symcheck.view.dot import to_dot
from symcheck.view.graph import Layered
from symcheck.view.svg import to_svg

__all__ = ["Picture"]


@dataclass(frozen=True, eq=False, repr=False)
class Picture(Layered):
    """A layered graph, shown as a drawing in Jupyter."""

    @property
    def dot(self) -> str:
        """In the DOT language of Graphviz."""
        return to_dot(self)

    @property
    def svg(self) -> str:
        """As SVG, placed by symcheck itself (Graphviz is not needed)."""
        return to_svg(self)

    def __repr__(self) -> str:
        return f"Picture({self.title!r}: {len(self.nodes)} nodes, {len(self.edges)} edges)"

    def _repr_svg_(self) -> str:
        return self.svg
