"""Pictures as SVG text, with a layout of our own, so that notebooks need no other program."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from symcheck.view.graph import Edge, Layered, Node
from symcheck.view.layout import Placed, Route, place, routes
from symcheck.view.style import STYLES

__all__ = ["to_svg"]


def to_svg(picture: Layered) -> str:
    """A complete SVG document."""
    placed = place(picture)
    size = f'width="{placed.width:.0f}" height="{placed.height:.0f}" viewBox="0 0 {placed.width:.0f} {placed.height:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
    arrow = (
        '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#404040"/></marker></defs>'
    )
    parts = [head, f"<title>{escape(picture.title)}</title>", arrow]
    parts += [line for edge, route in routes(picture, placed) for line in _edge(edge, route)]
    parts += [line for node in picture.nodes for line in _node(node, placed)]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _node(node: Node, placed: Placed) -> Iterator[str]:
    (x, y), (w, h) = placed.at[node.name], placed.size[node.name]
    style = STYLES[node.kind]
    paint = f'fill="{style.fill}" stroke="{style.line}"'
    if style.shape in ("round", "point"):
        yield f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{w / 2:.1f}" ry="{h / 2:.1f}" {paint}/>'
    else:
        corner = 10 if style.shape == "pill" else 2
        yield f'<rect x="{x - w / 2:.1f}" y="{y - h / 2:.1f}" width="{w:.1f}" height="{h:.1f}" rx="{corner}" {paint}/>'
    lines = node.label.split("\n") if node.kind != "choice" else []
    for number, line in enumerate(lines):
        base = y + 4 + 15 * (number - (len(lines) - 1) / 2)
        yield f'<text x="{x:.1f}" y="{base:.1f}" text-anchor="middle" font-size="11">{escape(line)}</text>'


def _edge(edge: Edge, route: Route) -> Iterator[str]:
    start, *rest = (f"{x:.1f},{y:.1f}" for x, y in route.points)
    dash = ' stroke-dasharray="5,4"' if edge.dashed else ""
    yield f'<path d="M{start} C{" ".join(rest)}" fill="none" stroke="#404040"{dash} marker-end="url(#arrow)"/>'
    if edge.label:
        lines, (x, middle) = edge.label.split("\n"), route.label
        anchor = "start" if route.beside else "middle"
        for number, line in enumerate(lines):
            y = middle + 3 + 11 * (number - (len(lines) - 1) / 2)
            look = f'font-size="9" text-anchor="{anchor}" paint-order="stroke" stroke="white" stroke-width="3"'
            yield f'<text x="{x:.1f}" y="{y:.1f}" {look}>{escape(line)}</text>'
