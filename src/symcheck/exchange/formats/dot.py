"""The graph of a model in the DOT language of Graphviz."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symcheck.exchange.explicit_export import ExplicitExport
from symcheck.exchange.text import FULL_PRECISION, lines, number_texts

__all__ = ["dot_file"]


def dot_file(
    model: ExplicitExport, *, states: bool = False, precision: int = FULL_PRECISION
) -> Iterator[str]:
    """The state graph as text chunks in DOT.

    Nodes are states. In an MDP, a point between a state and its successors stands for a choice. In
    a chain, a transition has an edge for each action that contributes to it.

    Args:
        model: the exported model.
        states: write the values of the variables into the nodes.
        precision: significant digits of probabilities and rates.
    """
    yield 'digraph M {\nnode [label="",shape="box"];\n'
    described = model.state_texts if states else None
    m = model.matrix
    for start in range(0, model.n, 4096):
        stop = min(start + 4096, model.n)
        names = described(start, stop) if described else []
        states_here = np.arange(start, stop)
        labels = [str(s) for s in range(start, stop)]
        if described:
            labels = [f"{s}\\n{text}" for s, text in zip(labels, names, strict=True)]
        yield from lines('%d [label="%s"];', stop - start, states_here, labels)
    if m.groups is None:
        parts = model.parts
        actions = [f":{name}" if name else "" for name in parts.texts(model.actions)]
        yield from lines(
            '%d -> %d [label="%s%s"];',
            len(parts.entry),
            model.row_of_entry[parts.entry],
            m.indices[parts.entry],
            parts.values,
            actions,
            precision=precision,
        )
    else:
        yield from _choices(model, precision)
    yield "}\n"


def _choices(model: ExplicitExport, precision: int) -> Iterator[str]:
    m = model.matrix
    points = [
        f"n{s}_{c}"
        for s, c in zip(model.state_of_row.tolist(), model.choice_of_row.tolist(), strict=True)
    ]
    names = [
        f"{c}:{a}" if a else str(c)
        for c, a in zip(model.choice_of_row.tolist(), model.action_texts(), strict=True)
    ]
    yield from lines(
        '%d -> %s [label="%s",arrowhead="none"];', m.rows, model.state_of_row, points, names
    )
    yield from lines('%s [shape=point,width=0.1,height=0.1,label=""];', m.rows, points)
    of = model.row_of_entry
    yield from lines(
        '%s -> %d [label="%s"];',
        m.entries,
        lambda a, b: [points[r] for r in of[a:b]],
        m.indices,
        lambda a, b: number_texts(model.values[a:b], precision),
    )
