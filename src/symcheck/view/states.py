"""State graphs as pictures: layers by distance from the initial states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools
from symcheck.view.picture import Edge, Kind, Node, Picture

if TYPE_CHECKING:
    from symcheck.explicit.model import ExplicitModel

__all__ = ["state_graph"]


def state_graph(
    model: ExplicitModel,
    *,
    marked: Bools | None = None,
    max_states: int = 150,
    title: str = "states",
) -> Picture:
    """The state graph of a model: transitions carry probabilities (rates); choices are points.

    Args:
        model: an explicitly explored model.
        marked: states that are drawn in green, bool[n].
        max_states: the most states that are drawn.
        title: the caption.

    Raises:
        UnsupportedError: the model has more than `max_states` states.
    """
    n = len(model.states)
    if n > max_states:
        raise UnsupportedError(
            f"the model has {n:,} states, and at most {max_states} are drawn\n"
            "  hint: draw a smaller model, or raise max_states"
        )
    distance = _distances(model)
    spread = 1 if model.matrix.groups is None else 2
    initial = set(model.initial.tolist())
    nodes = [
        Node(f"s{s}", _state_text(model, s), spread * distance[s], _kind(s, initial, marked))
        for s in range(n)
    ]
    edges = _edges(model) if model.matrix.groups is None else _choices(model, distance, nodes)
    layers = spread * max(distance, default=0) + spread
    return Picture(title, tuple(nodes), tuple(edges), ("",) * layers)


def _kind(state: int, initial: set[int], marked: Bools | None) -> Kind:
    if marked is not None and marked[state]:
        return "marked"
    return "initial" if state in initial else "state"


def _state_text(model: ExplicitModel, state: int) -> str:
    pairs = zip(model.model.variables, model.states.row(state), strict=True)
    texts = [
        v.name if value is True else f"!{v.name}" if value is False else f"{v.name}={value}"
        for v, value in pairs
    ]
    return "\n".join(", ".join(texts[i : i + 3]) for i in range(0, len(texts), 3))


def _rows(model: ExplicitModel, state: int) -> range:
    groups = model.matrix.groups
    return (
        range(state, state + 1)
        if groups is None
        else range(int(groups[state]), int(groups[state + 1]))
    )


def _entries(model: ExplicitModel, row: int) -> list[tuple[int, float]]:
    m = model.matrix
    part = slice(int(m.indptr[row]), int(m.indptr[row + 1]))
    return list(zip(m.indices[part].tolist(), m.data[part].tolist(), strict=True))


def _distances(model: ExplicitModel) -> list[int]:
    """The distance of each state from the initial states, in steps."""
    distance = np.full(len(model.states), -1)
    layer, number = model.initial.tolist(), 0
    while layer:
        distance[layer] = number
        number += 1
        after = {t for s in layer for row in _rows(model, s) for t, _ in _entries(model, row)}
        layer = sorted(t for t in after if distance[t] < 0)
    return [int(d) for d in distance]


def _edges(model: ExplicitModel) -> list[Edge]:
    return [
        Edge(f"s{s}", f"s{t}", f"{p:.6g}")
        for s in range(len(model.states))
        for t, p in _entries(model, s)
    ]


def _choices(model: ExplicitModel, distance: list[int], nodes: list[Node]) -> list[Edge]:
    """The edges of an MDP. A choice with several successors adds a point to `nodes`."""
    edges: list[Edge] = []
    for s in range(len(model.states)):
        for number, row in enumerate(_rows(model, s)):
            action = int(model.choice_actions[row])
            name = model.model.actions[action] if action >= 0 else ""
            successors = _entries(model, row)
            if len(successors) == 1:
                edges.append(Edge(f"s{s}", f"s{successors[0][0]}", name))
                continue
            point = f"c{s}_{number}"
            nodes.append(Node(point, "", 2 * distance[s] + 1, "choice"))
            edges.append(Edge(f"s{s}", point, name))
            edges += [Edge(point, f"s{t}", f"{p:.6g}") for t, p in successors]
    return edges
