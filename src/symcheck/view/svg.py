"""Pictures as SVG text, with a layout of our own, so that notebooks need no other program."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from symcheck.view.layout import Placed, label_shares, place
from symcheck.view.picture import Edge, Node, Picture
from symcheck.view.style import STYLES

__all__ = ["to_svg"]


def to_svg(picture: Picture) -> str:
    """A complete SVG document."""
    placed = place(picture)
    size = f'width="{placed.width:.0f}" height="{placed.height:.0f}" viewBox="0 0 {placed.width:.0f} {placed.height:.0f}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif">'
    arrow = (
        '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#404040"/></marker></defs>'
    )
    parts = [head, f"<title>{escape(picture.title)}</title>", arrow]
    shares = label_shares(picture)
    parts += [line for edge in picture.edges for line in _edge(edge, placed, shares[edge.source, edge.target])]
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


def _edge(edge: Edge, placed: Placed, share: float) -> Iterator[str]:
    (x1, y1), (x2, y2) = placed.at[edge.source], placed.at[edge.target]
    h1, h2 = placed.size[edge.source][1] / 2, placed.size[edge.target][1] / 2
    dash = ' stroke-dasharray="5,4"' if edge.dashed else ""
    if edge.source == edge.target:
        w = placed.size[edge.source][0] / 2
        path = f"M{x1 + w - 6:.1f},{y1 - 6:.1f} c26,-22 26,34 0,12"
        middle = (x1 + w + 22, y1)
    elif y2 > y1:
        path = f"M{x1:.1f},{y1 + h1:.1f} C{x1:.1f},{y1 + h1 + 28:.1f} {x2:.1f},{y2 - h2 - 28:.1f} {x2:.1f},{y2 - h2:.1f}"
        middle = (x1 + share * (x2 - x1), (y1 + h1) + share * (y2 - h2 - y1 - h1))
    else:
        bend = max(40.0, abs(y1 - y2) / 2)
        w1, w2 = placed.size[edge.source][0] / 2, placed.size[edge.target][0] / 2
        path = f"M{x1 + w1:.1f},{y1:.1f} C{x1 + w1 + bend:.1f},{y1:.1f} {x2 + w2 + bend:.1f},{y2:.1f} {x2 + w2:.1f},{y2:.1f}"
        middle = (max(x1 + w1, x2 + w2) + 0.6 * bend, (y1 + y2) / 2)
    yield f'<path d="{path}" fill="none" stroke="#404040"{dash} marker-end="url(#arrow)"/>'
    if edge.label:
        lines = edge.label.split("\n")
        for number, line in enumerate(lines):
            y = middle[1] + 11 * (number - (len(lines) - 1) / 2)
            look = 'font-size="9" text-anchor="middle" paint-order="stroke" stroke="white" stroke-width="3"'
            yield f'<text x="{middle[0]:.1f}" y="{y:.1f}" {look}>{escape(line)}</text>'
