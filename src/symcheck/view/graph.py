"""What is drawn: nodes in layers and edges between them, before anything is said of DOT, SVG or matplotlib."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Edge", "Layered", "Node"]


@dataclass(frozen=True, slots=True)
class Node:
    """`layer` counts from the top. `label` may have several lines.

    kind: 'row', 'column' or 'pair' (what a decision reads), 'leaf', 'root', 'state', 'initial', 'marked' or 'choice'.
    """

    name: str
    label: str
    layer: int
    kind: str


@dataclass(frozen=True, slots=True)
class Edge:
    """From node to node (by name); `dashed` for the decision 0, and for what is less usual."""

    source: str
    target: str
    label: str = ""
    dashed: bool = False


@dataclass(frozen=True, eq=False)
class Layered:
    """A layered graph. `layers` names the layers from the top ("" where a layer has no name)."""

    title: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    layers: tuple[str, ...]
