"""Pictures: layered graphs in the DOT language, which Graphviz lays out and draws."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from symcheck.errors import UnsupportedError, UsageError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Edge", "Kind", "Node", "Picture"]

Kind = Literal["row", "column", "pair", "leaf", "root", "state", "initial", "marked", "choice"]
Format = Literal["svg", "png", "pdf"]

_STYLES: dict[Kind, str] = {
    "row": 'shape=ellipse, style=filled, fillcolor="#dce9f7"',
    "column": 'shape=ellipse, style=filled, fillcolor="#fde3c8"',
    "pair": 'shape=box, style="rounded,filled", fillcolor="#ece2f3"',
    "leaf": 'shape=box, style=filled, fillcolor="#f4f4f4"',
    "root": "shape=plaintext",
    "state": 'shape=ellipse, style=filled, fillcolor="#f4f4f4"',
    "initial": 'shape=ellipse, style=filled, fillcolor="#dce9f7", color="#1f4e8c"',
    "marked": 'shape=ellipse, style=filled, fillcolor="#d7efd9", color="#2b7a33"',
    "choice": "shape=point",
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
    """

    name: str
    label: str
    layer: int
    kind: Kind


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge between two nodes, given by name; dashed for the decision 0 of a bit."""

    source: str
    target: str
    label: str = ""
    dashed: bool = False


@dataclass(frozen=True, eq=False, repr=False)
class Picture:
    """A layered graph that draws itself in a notebook.

    Attributes:
        title: the caption above the picture.
        nodes, edges: the graph.
        layers: the name of each layer from the top ('' where it has none).
        legend: what the edges mean, written below the picture.
    """

    title: str
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    layers: tuple[str, ...]
    legend: str = ""

    @property
    def dot(self) -> str:
        """The picture in Graphviz' DOT language: one rank per layer."""
        lines = [
            f"digraph {_quoted(self.title)} {{",
            '  node [fontname="sans-serif", fontsize=11];',
            '  edge [fontname="sans-serif", fontsize=9, color="#404040"];',
        ]
        if self.legend:
            lines.append(f'  label={_quoted(self.legend)}; fontname="sans-serif"; fontsize=9;')
        lines += [
            f"  {_quoted(n.name)} [label={_quoted(n.label)}, {_STYLES[n.kind]}];"
            for n in self.nodes
        ]
        for number, name in enumerate(self.layers):
            members = " ".join(f"{_quoted(n.name)};" for n in self.nodes if n.layer == number)
            if members:
                lines.append(f"  {{ rank=same; {members} }}" + (f" // {name}" if name else ""))
        for edge in self.edges:
            label = f"label={_quoted(_padded(edge.label))}" if edge.label else ""
            options = ", ".join(filter(None, (label, "style=dashed" if edge.dashed else "")))
            ends = f"  {_quoted(edge.source)} -> {_quoted(edge.target)}"
            lines.append(f"{ends} [{options}];" if options else f"{ends};")
        return "\n".join([*lines, "}"]) + "\n"

    def render(self, format: Format = "svg") -> bytes:
        """The picture as Graphviz draws it, in the format 'svg', 'png' or 'pdf'.

        Raises:
            UnsupportedError: the package pygraphviz is not installed.
        """
        try:
            from pygraphviz import AGraph
        except ImportError:
            raise UnsupportedError(
                "pictures need pygraphviz: pip install 'symcheck[view]'"
            ) from None
        drawn: bytes = AGraph(string=self.dot).draw(format=format, prog="dot")
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
                path.write_bytes(self.render("svg"))
            case ".png":
                path.write_bytes(self.render("png"))
            case ".pdf":
                path.write_bytes(self.render("pdf"))
            case ".dot":
                path.write_text(self.dot, encoding="utf-8")
            case other:
                raise UsageError(
                    f"a picture cannot be saved as '{other}'\n  hint: use .svg, .png, .pdf or .dot"
                )

    def draw(self, axes: Axes | None = None) -> Axes:
        """Draw the picture into matplotlib axes, or into new ones of its size.

        Returns:
            The axes.

        Raises:
            UnsupportedError: matplotlib or pygraphviz is not installed.
        """
        from symcheck.view.plots import axes_of, read_image

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


def _padded(label: str) -> str:
    """The label with a space on both sides, so that it does not touch its edge."""
    return "\n".join(f" {line} " for line in label.split("\n"))


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
