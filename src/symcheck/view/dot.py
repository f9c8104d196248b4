"""Pictures in the DOT language, and as SVG or PDF by Graphviz's `dot` where it is installed."""

from __future__ import annotations

import shutil
import subprocess

from symcheck.errors import UnsupportedError
from symcheck.view.graph import Layered
from symcheck.view.style import STYLES

__all__ = ["graphviz", "to_dot"]

_SECONDS = 60.0


def to_dot(picture: Layered) -> str:
    """The text of a digraph: one rank for each layer, variables and states by name."""
    lines = [f"digraph {_quoted(picture.title)} {{", '  node [fontname="sans-serif", fontsize=11];']
    lines.append('  edge [fontname="sans-serif", fontsize=9];')
    for node in picture.nodes:
        style = STYLES[node.kind]
        shape = {
            "box": "box",
            "round": "ellipse",
            "pill": 'box, style="rounded,filled"',
            "point": "point",
        }[style.shape]
        filled = "" if style.shape == "pill" else ", style=filled"
        lines.append(
            f'  {_quoted(node.name)} [label={_quoted(node.label)}, shape={shape}{filled}, fillcolor="{style.fill}"];'
        )
    for number, name in enumerate(picture.layers):
        members = " ".join(f"{_quoted(n.name)};" for n in picture.nodes if n.layer == number)
        if members:
            lines.append(f"  {{ rank=same; {members} }}" + (f" // {name}" if name else ""))
    for edge in picture.edges:
        label = f"label={_quoted(edge.label)}" if edge.label else ""
        dashed = "style=dashed" if edge.dashed else ""
        options = ", ".join(filter(None, (label, dashed)))
        lines.append(
            f"  {_quoted(edge.source)} -> {_quoted(edge.target)}"
            + (f" [{options}];" if options else ";")
        )
    return "\n".join([*lines, "}"]) + "\n"


def graphviz(picture: Layered, format: str = "svg") -> bytes:
    """The picture as Graphviz draws it. Raises UnsupportedError where `dot` is not installed, or fails."""
    program = shutil.which("dot")
    if program is None:
        raise UnsupportedError(
            "Graphviz's program dot is not installed: take Picture.svg, or install Graphviz"
        )
    run = subprocess.run(
        [program, f"-T{format}"],
        input=to_dot(picture).encode(),
        capture_output=True,
        timeout=_SECONDS,
        check=False,
    )
    if run.returncode:
        raise UnsupportedError(
            f"Graphviz could not draw this: {run.stderr.decode(errors='replace').strip()}"
        )
    return run.stdout


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
