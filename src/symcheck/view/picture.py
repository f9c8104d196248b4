"""Pictures: layered graphs in the DOT language, which Graphviz lays out and draws."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from html import escape
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, get_args

from symcheck.errors import UnsupportedError, UsageError
from symcheck.page.document import fragment
from symcheck.tables import optional_package
from symcheck.whole_file import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["WINDOW", "Edge", "Emphasis", "Kind", "Node", "Picture", "Room"]

Kind = Literal["row", "column", "pair", "leaf", "root", "state", "initial", "marked", "choice"]
Emphasis = Literal["", "chosen", "other", "path"]
Format = Literal["svg", "png", "pdf"]

_MOST_LABELS_WITHIN_LAYERS = 150
"""With more of them, Graphviz would take minutes to rank the nodes, and nobody could read them."""
_MOST_LAYERED = 100
"""Edges up to which layers are tried where a picture has to fit; `dot` takes seconds for more."""
_MOST_LABELS = 250
"""Edges up to which they have labels in a picture without layers; more would cover each other."""
_SMALL = 0.65
"""A share of the size that fits, below which letters cannot be read when all is seen."""
_LAYERS_COUNT = 1.25
"""So much larger a picture without layers has to be than one with layers, which shows the steps."""


class Room(NamedTuple):
    """The room for a picture, in the points (1/72 inch) of its labels' sizes."""

    width: float
    height: float


WINDOW = Room(1060, 580)
"""Where a picture fits, its labels can be read in a pane of a page: a window of 1280 x 720 pixels
leaves 850 x 460, on which letters of 11 points are then 9 pixels high."""

_STATE = 'shape=box, style="rounded,filled", margin="0.09,0.04", width=0.4, height=0.3'
_STYLES: dict[Kind, str] = {
    "row": 'shape=ellipse, style=filled, fillcolor="#dce9f7"',
    "column": 'shape=ellipse, style=filled, fillcolor="#fde3c8"',
    "pair": 'shape=box, style="rounded,filled", fillcolor="#ece2f3"',
    "leaf": 'shape=box, style=filled, fillcolor="#f4f4f4"',
    "root": "shape=plaintext",
    "state": f'{_STATE}, fillcolor="#f4f4f4"',
    "initial": f'{_STATE}, fillcolor="#dce9f7", color="#1f4e8c", penwidth=2',
    "marked": f'{_STATE}, fillcolor="#d7efd9", color="#2b7a33"',
    "choice": "shape=point, width=0.07",
}
_EMPHASES: dict[Emphasis, str] = {
    "": "",
    "chosen": 'color="#1f4e8c", penwidth=2.2',
    "other": 'color="#b8b8b8", fontcolor="#707070"',
    "path": 'color="#b3261e", penwidth=2.2',
}


@dataclass(frozen=True, slots=True)
class Node:
    """A node of a picture.

    Attributes:
        name: identifies the node.
        label: the text in the node, of one or more lines.
        layer: the layer, counted from 0 at the top.
        kind: what the node stands for, which decides how it looks. 'row' and 'column' are
            decisions on a variable's value before and after a step, 'pair' is one on both.
        fill: the colour of the node, such as '#d7efd9'; '' for that of its kind.
    """

    name: str
    label: str
    layer: int
    kind: Kind
    fill: str = ""


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge between two nodes, given by name; dashed for the decision 0 of a bit.

    Attributes:
        emphasis: 'chosen' by a strategy, an 'other' choice than that, or on a 'path'.
        classes: the CSS classes of the edge in SVG.
    """

    source: str
    target: str
    label: str = ""
    dashed: bool = False
    emphasis: Emphasis = ""
    classes: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """A layered graph that draws itself in a notebook.

    Attributes:
        title: the caption above the picture.
        nodes, edges: the graph.
        layers: the name of each layer from the top ('' where it has none).
        legend: what nodes and edges mean, written below the picture.
        keys: colours and what they stand for, drawn above the legend.
        sideways: layers go from left to right instead of from top to bottom.
        free: nodes have no layers: edges are springs (Graphviz' `sfdp`).
    """

    title: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    layers: tuple[str, ...]
    legend: str = ""
    keys: tuple[tuple[str, str], ...] = ()
    sideways: bool = False
    free: bool = False

    def fitted(self, room: Room = WINDOW) -> Picture:
        """The picture as it fits best: with layers downwards or to the right, or without layers.

        Without Graphviz, it is the picture itself.
        """
        try:
            return self.sized(room)[0]
        except UnsupportedError:
            return self

    def sized(self, room: Room = WINDOW) -> tuple[Picture, float]:
        """The picture as it fits best, and how many times larger it may be drawn: it fits from 1.

        Raises UnsupportedError without pygraphviz.
        """
        best, most = self, -1.0
        layered = len(self.edges) <= _MOST_LAYERED
        for sideways in (False, True) if layered else ():
            turned = replace(self, sideways=sideways, free=False)
            share = turned._share(room)
            if share > most:
                best, most = turned, share
        if most < _SMALL:
            free = replace(self, sideways=False, free=True)
            share = free._share(room)
            if share > most * _LAYERS_COUNT:
                best, most = free, share
        return best, most

    def _share(self, room: Room) -> float:
        """How many times larger the picture may be drawn."""
        _, _, width, height = self._drawn("plain").split(maxsplit=4)[:4]
        return min(room.width / (72 * float(width)), room.height / (72 * float(height)))

    @property
    def dot(self) -> str:
        """The picture in Graphviz' DOT language: one rank per layer."""
        lines = [
            f"digraph {_quoted(self.title)} {{",
            '  node [fontname="sans-serif", fontsize=11];',
            '  edge [fontname="sans-serif", fontsize=9, color="#404040"];',
        ]
        if self.free:
            roomy = " K=1.1; splines=true;" if len(self.edges) <= _MOST_LABELS else ""
            lines.append(f"  layout=sfdp; overlap=prism;{roomy}")
        elif self.sideways:
            lines.append("  rankdir=LR; nodesep=0.12;")
        if self.legend or self.keys:
            lines.append(f'  label={self._label}; fontname="sans-serif"; fontsize=9;')
        # Graphviz takes an edge for one that leads back depending on the order of the nodes.
        for n in sorted(self.nodes, key=lambda n: n.layer if n.layer >= 0 else len(self.layers)):
            fill = f', fillcolor="{n.fill}"' if n.fill else ""
            lines.append(
                f"  {_quoted(n.name)} [label={_quoted(n.label)}, {_STYLES[n.kind]}{fill}];"
            )
        layer = {n.name: n.layer for n in self.nodes}
        # An edge with a label needs room along its length, and has none within a rank.
        within = {
            e
            for e in self.edges
            if e.label and e.source != e.target and layer[e.source] == layer[e.target]
        }
        crowded = within if len(within) > _MOST_LABELS_WITHIN_LAYERS else set[Edge]()
        if self.free:
            crowded = set(self.edges) if len(self.edges) > _MOST_LABELS else set()
        loose = {layer[e.source] for e in within - crowded}
        for number, name in enumerate(() if self.free else self.layers):
            members = " ".join(f"{_quoted(n.name)};" for n in self.nodes if n.layer == number)
            if members and number not in loose:
                lines.append(f"  {{ rank=same; {members} }}" + (f" // {name}" if name else ""))
        for edge in self.edges:
            labelled = edge.label and edge not in crowded
            label = f"label={_quoted(_padded(edge.label))}" if labelled else ""
            classes = f"class={_quoted(edge.classes)}" if edge.classes else ""
            dashed = "style=dashed" if edge.dashed else ""
            parts = (label, dashed, _EMPHASES[edge.emphasis], classes)
            options = ", ".join(filter(None, parts))
            ends = f"  {_quoted(edge.source)} -> {_quoted(edge.target)}"
            lines.append(f"{ends} [{options}];" if options else f"{ends};")
        return "\n".join([*lines, "}"]) + "\n"

    @property
    def _label(self) -> str:
        """Colours and legend as a label of the graph: a table if there are colours."""
        if not self.keys:
            return _quoted(self.legend)
        cells = "".join(
            f'<TD BGCOLOR="{colour}" WIDTH="22"></TD><TD>{escape(text)}  </TD>'
            for colour, text in self.keys
        )
        row = '<TR><TD><TABLE BORDER="0" CELLSPACING="4"><TR>{}</TR></TABLE></TD></TR>'
        text = escape(self.legend).replace("\n", "<BR/>")
        below = f"<TR><TD>{text}</TD></TR>" if text else ""
        return f'<<TABLE BORDER="0">{row.format(cells)}{below}</TABLE>>'

    def render(self, format: Format = "svg") -> bytes:
        """The picture as Graphviz draws it, in the format 'svg', 'png' or 'pdf'.

        Raises:
            UsageError: the format is another one.
            UnsupportedError: the package pygraphviz is not installed.
        """
        if format not in get_args(Format):
            raise UsageError(
                f"format={format!r}: expected one of {', '.join(get_args(Format))}",
                hint="save(path) writes a file, and its extension names the format",
            )
        return self._drawn(format)

    def _drawn(self, format: str) -> bytes:
        """What Graphviz draws. Raises UnsupportedError without pygraphviz."""
        graph = optional_package("pygraphviz", "view").AGraph(string=self.dot)
        with _silent_standard_error():
            drawn: bytes = graph.draw(format=format, prog="sfdp" if self.free else "dot")
        return drawn

    @property
    def svg(self) -> str:
        """The picture as an SVG document. Raises UnsupportedError without pygraphviz."""
        return self.render("svg").decode()

    def save(self, path: str | Path) -> None:
        """Write the picture to a file, in the format of its extension (.svg, .png, .pdf, .dot).

        Raises:
            UsageError: the extension is another one.
            UnsupportedError: the package pygraphviz is not installed.
        """
        path = Path(path)
        match path.suffix:
            case ".svg":
                content = self.render("svg")
            case ".png":
                content = self.render("png")
            case ".pdf":
                content = self.render("pdf")
            case ".dot":
                content = self.dot.encode()
            case other:
                raise UsageError(
                    f"a picture cannot be saved as '{other}'", hint="use .svg, .png, .pdf or .dot"
                )
        write_whole(path, lambda temporary: temporary.write_bytes(content))

    def draw(self, axes: Axes | None = None) -> Axes:
        """Draw the picture into matplotlib axes, or into new ones of its size.

        Returns:
            The axes.

        Raises:
            UnsupportedError: matplotlib or pygraphviz is not installed.
        """
        from symcheck.charts import axes_of
        from symcheck.view.plots import read_image

        image = read_image(BytesIO(self.render("png")))
        height, width = image.shape[:2]
        axes = axes_of(axes, (width / 96, height / 96))
        axes.imshow(image, interpolation="lanczos")
        axes.set_title(self.title, fontsize="medium")
        axes.set_anchor("N")  # titles of adjacent pictures are then on one line
        axes.axis("off")
        return axes

    def __repr__(self) -> str:
        return f"Picture({self.title!r}: {len(self.nodes)} nodes, {len(self.edges)} edges)"

    def _repr_svg_(self) -> str:
        return self.svg

    def _repr_html_(self) -> str:
        """The picture with zoom and pan, for notebooks."""
        show = {"name": self.title, "panes": [0], "frames": [{"title": self.title}]}
        return fragment({"title": self.title, "graphs": [self.svg], "shows": [show]}, height=460)


@contextmanager
def _silent_standard_error() -> Iterator[None]:
    """Graphviz and its libraries write to it what no user can mend, such as faults of fonts."""
    try:
        kept = os.dup(2)
    except OSError:  # the process has none
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nothing:
            os.dup2(nothing.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _padded(label: str) -> str:
    """The label with a space on both sides, so that it does not touch its edge."""
    return "\n".join(f" {line} " for line in label.split("\n"))


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
