"""Where to put the nodes of a layered graph: order in layers by barycentres (Sugiyama, Tagawa & Toda 1981).

Meant for pictures that a person reads, of some hundred nodes: plain loops over nodes and edges.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from symcheck.view.graph import Edge, Layered, Node

__all__ = ["Placed", "Route", "place", "routes"]

_SWEEPS = 8
_LINE = 15.0  # height of a line of text
_LETTER = 6.6  # width of a letter
_GAP = 26.0  # between the nodes of a layer
_BETWEEN = 56.0  # between layers
_LOOP = 16.0  # how far a loop goes out


@dataclass(frozen=True, slots=True)
class Placed:
    """Middle and size of each node, by name, in points; size of the whole."""

    at: Mapping[str, tuple[float, float]]
    size: Mapping[str, tuple[float, float]]
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Route:
    """The way of an edge: the four points of a cubic Bézier curve, and the middle of its label (beside: its left end)."""

    points: tuple[
        tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]
    ]
    label: tuple[float, float]
    beside: bool = False


def place(picture: Layered) -> Placed:
    """Layers from the top down; each node near the middle of its neighbours."""
    layers: dict[int, list[Node]] = {}
    for node in picture.nodes:
        layers.setdefault(node.layer, []).append(node)
    size = {node.name: _size(node) for node in picture.nodes}
    x = {n.name: float(i) for layer in layers.values() for i, n in enumerate(layer)}
    up, down = _neighbours(picture)
    for sweep in range(_SWEEPS):
        towards, order = (
            (up, sorted(layers)) if sweep % 2 == 0 else (down, sorted(layers, reverse=True))
        )
        for number in order:
            layers[number].sort(key=lambda n: _middle(x, towards[n.name], x[n.name]))
            _spread(layers[number], x, size, towards)
    left = min((x[n] - size[n][0] / 2 for n in x), default=0.0)
    width = max((x[n] + size[n][0] / 2 for n in x), default=0.0) - left + 2 * _GAP
    at: dict[str, tuple[float, float]] = {}
    top, last, tall = _GAP, max(layers, default=0), _tall(picture)
    for number in sorted(layers):
        height = max(size[n.name][1] for n in layers[number])
        at.update({n.name: (x[n.name] - left + _GAP, top + height / 2) for n in layers[number]})
        top += height + _BETWEEN + _LINE * tall.get(number, 0)
    return Placed(at, size, width, top - _BETWEEN - _LINE * tall.get(last, 0) + _GAP)


def routes(picture: Layered, placed: Placed) -> list[tuple[Edge, Route]]:
    """The edges with their ways: down from layer to layer, or back round the outside of what stands between."""
    out = Counter(e.source for e in picture.edges)
    into = Counter(e.target for e in picture.edges)
    layer, there = (
        {n.name: n.layer for n in picture.nodes},
        {(e.source, e.target) for e in picture.edges},
    )
    found = []
    for edge in picture.edges:
        above = layer[edge.source] - layer[edge.target]
        if edge.source == edge.target:
            way = _loop(placed, edge)
        elif above < 0 or (above == 1 and (edge.target, edge.source) not in there):
            # The label stands towards the end that fewer edges share.
            way = _straight(placed, edge, 0.3 if into[edge.target] > out[edge.source] else 0.62)
        elif above == 0:
            way = _over(placed, edge)
        else:
            between = [
                n.name for n in picture.nodes if layer[edge.target] < n.layer < layer[edge.source]
            ]
            way = _back(
                placed, edge, between, {n for n in (*between, edge.target) if (n, n) in there}
            )
        found.append((edge, way))
    return found


def _loop(placed: Placed, edge: Edge) -> Route:
    (x, y), (w, h) = placed.at[edge.source], placed.size[edge.source]
    side = x + w / 2 - 4
    points = (
        (side, y - h / 4),
        (side + 20, y - h / 4 - 8),
        (side + 20, y + h / 4 + 8),
        (side, y + h / 4),
    )
    return Route(points, (side + 18, y), beside=True)


def _straight(placed: Placed, edge: Edge, share: float) -> Route:
    (x1, y1), (x2, y2) = placed.at[edge.source], placed.at[edge.target]
    way = 1 if y2 > y1 else -1
    start, end = (
        y1 + way * placed.size[edge.source][1] / 2,
        y2 - way * placed.size[edge.target][1] / 2,
    )
    bow = way * min(20.0, abs(end - start) / 3)
    label = (x1 + share * (x2 - x1), start + share * (end - start))
    return Route(((x1, start), (x1, start + bow), (x2, end - bow), (x2, end)), label)


def _over(placed: Placed, edge: Edge) -> Route:
    (x1, y1), (x2, y2) = placed.at[edge.source], placed.at[edge.target]
    start, end = y1 - placed.size[edge.source][1] / 2, y2 - placed.size[edge.target][1] / 2
    top = min(start, end) - _BETWEEN / 2
    return Route(
        ((x1, start), (x1, top), (x2, top), (x2, end)), ((x1 + x2) / 2, top + _BETWEEN / 8)
    )


def _back(placed: Placed, edge: Edge, between: list[str], loops: set[str]) -> Route:
    """Round on the left where the target stands right of the source, else on the right, where the loops are."""
    (x1, y1), (x2, y2) = placed.at[edge.source], placed.at[edge.target]
    side = -1 if x1 < x2 + (_GAP if edge.target in loops else -1.0) else 1
    start, end = (
        x1 + side * placed.size[edge.source][0] / 2,
        x2 + side * placed.size[edge.target][0] / 2,
    )
    edges = [
        placed.at[n][0] + side * placed.size[n][0] / 2 + (_LOOP if n in loops and side > 0 else 0.0)
        for n in between
    ]
    outermost = side * max(side * e for e in (start, end, *edges)) + side * 14.0
    # A cubic curve goes three quarters of the way to its inner points.
    inner = (start + end) / 2 + (outermost - (start + end) / 2) / 0.75
    return Route(((start, y1), (inner, y1), (inner, y2), (end, y2)), (outermost, (y1 + y2) / 2))


def _tall(picture: Layered) -> dict[int, int]:
    """Lines of the tallest label on an edge that leaves a layer, beyond the first."""
    layer, lines = {n.name: n.layer for n in picture.nodes}, dict[int, int]()
    for edge in picture.edges:
        number = layer[edge.source]
        lines[number] = max(lines.get(number, 0), edge.label.count("\n"))
    return lines


def _size(node: Node) -> tuple[float, float]:
    if node.kind == "choice":
        return 8.0, 8.0
    lines = node.label.split("\n")
    return max(34.0, _LETTER * max(map(len, lines)) + 14.0), _LINE * len(lines) + 10.0


def _neighbours(picture: Layered) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
    """Names of neighbours in layers above, and in layers below."""
    layer = {n.name: n.layer for n in picture.nodes}
    up: dict[str, list[str]] = {n.name: [] for n in picture.nodes}
    down: dict[str, list[str]] = {n.name: [] for n in picture.nodes}
    for edge in picture.edges:
        first, second = sorted((edge.source, edge.target), key=layer.__getitem__)
        if layer[first] < layer[second]:
            down[first].append(second)
            up[second].append(first)
    return up, down


def _middle(x: Mapping[str, float], names: list[str], otherwise: float) -> float:
    return sum(x[n] for n in names) / len(names) if names else otherwise


def _spread(
    layer: list[Node],
    x: dict[str, float],
    size: Mapping[str, tuple[float, float]],
    towards: Mapping[str, list[str]],
) -> None:
    """Put the nodes of a layer, in their order, as near to their neighbours as they fit."""
    wish = [_middle(x, towards[n.name], x[n.name]) for n in layer]
    half = [size[n.name][0] / 2 for n in layer]
    spot, edge = [], float("-inf")
    for w, h in zip(wish, half, strict=True):
        spot.append(max(w, edge + h + _GAP))
        edge = spot[-1] + h
    shift = sum(w - s for w, s in zip(wish, spot, strict=True)) / max(1, len(layer))
    x.update({n.name: s + shift for n, s in zip(layer, spot, strict=True)})
