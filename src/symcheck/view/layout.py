"""Where to put the nodes of a layered graph: order in layers by barycentres (Sugiyama, Tagawa & Toda 1981).

Meant for pictures that a person reads, of some hundred nodes: plain loops over nodes and edges.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from symcheck.view.picture import Node, Picture

__all__ = ["Placed", "label_shares", "place"]

_SWEEPS = 8
_LINE = 15.0  # height of a line of text
_LETTER = 6.6  # width of a letter
_GAP = 26.0  # between the nodes of a layer
_BETWEEN = 56.0  # between layers


@dataclass(frozen=True, slots=True)
class Placed:
    """Middle and size of each node, by name, in points; size of the whole."""

    at: Mapping[str, tuple[float, float]]
    size: Mapping[str, tuple[float, float]]
    width: float
    height: float


def place(picture: Picture) -> Placed:
    """Layers from the top down; each node near the middle of its neighbours."""
    layers: dict[int, list[Node]] = {}
    for node in picture.nodes:
        layers.setdefault(node.layer, []).append(node)
    size = {node.name: _size(node) for node in picture.nodes}
    x = {n.name: float(i) for layer in layers.values() for i, n in enumerate(layer)}
    up, down = _neighbours(picture)
    for sweep in range(_SWEEPS):
        towards, order = (up, sorted(layers)) if sweep % 2 == 0 else (down, sorted(layers, reverse=True))
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


def label_shares(picture: Picture) -> dict[tuple[str, str], float]:
    """How far along an edge its label stands: towards the end that fewer edges share."""
    out = Counter(e.source for e in picture.edges)
    into = Counter(e.target for e in picture.edges)
    return {(e.source, e.target): 0.3 if into[e.target] > out[e.source] else 0.62 for e in picture.edges}


def _tall(picture: Picture) -> dict[int, int]:
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


def _neighbours(picture: Picture) -> tuple[dict[str, list[str]], dict[str, list[str]]]:
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


def _spread(layer: list[Node], x: dict[str, float], size: Mapping[str, tuple[float, float]], towards: Mapping[str, list[str]]) -> None:
    """Put the nodes of a layer, in their order, as near to their neighbours as they fit."""
    wish = [_middle(x, towards[n.name], x[n.name]) for n in layer]
    half = [size[n.name][0] / 2 for n in layer]
    spot, edge = [], float("-inf")
    for w, h in zip(wish, half, strict=True):
        spot.append(max(w, edge + h + _GAP))
        edge = spot[-1] + h
    shift = sum(w - s for w, s in zip(wish, spot, strict=True)) / max(1, len(layer))
    x.update({n.name: s + shift for n, s in zip(layer, spot, strict=True)})
