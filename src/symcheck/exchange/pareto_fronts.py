"""Pareto fronts as files: a table of the vertices, or vertices and half-spaces in JSON."""

from __future__ import annotations

import csv
import json
from io import StringIO

from symcheck.check.pareto_front import ParetoFront
from symcheck.exchange.text import table_extension
from symcheck.semantics.expressions.literals import format_value

__all__ = ["front_extension", "front_text"]


def front_extension(path: str) -> str:
    """'.csv', also for 'stdout', or '.json'. Raises UsageError."""
    return table_extension(path, "how a Pareto front is written")


def front_text(front: ParetoFront, extension: str) -> str:
    """The text of a file.

    Args:
        front: the front.
        extension: '.csv': a column per objective and a line per vertex. '.json': an object with
            `objectives`, `vertices` and `halfspaces` (weights · x <= bound); a rational is a text.
    """
    if extension == ".csv":
        out = StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(front.objectives)
        writer.writerows([format_value(v) for v in point] for point in front.vertices)
        return out.getvalue()
    whole = {
        "objectives": front.objectives,
        "vertices": front.vertices,
        "halfspaces": [{"weights": h.weights, "bound": h.bound} for h in front.halfspaces],
    }
    return json.dumps(whole, indent=1, ensure_ascii=False, default=str) + "\n"
