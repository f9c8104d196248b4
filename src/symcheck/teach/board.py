"""What the pictures of a page share: the graphs, and the names of the nodes for states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from symcheck.engines.base import Engine
from symcheck.errors import SymcheckError, UnsupportedError
from symcheck.matrices.rows import Bools, Int64s
from symcheck.page.document import JsonObject, JsonValue
from symcheck.semantics.rewards import Structure
from symcheck.symbolic.encoding.enumerate_states import enumerate_states
from symcheck.view.choice_graph import ChoiceGraph, GivenModel
from symcheck.view.diagrams import shared_picture
from symcheck.view.picture import Picture
from symcheck.view.states import draw_states, nearest_that_fit

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd
    from symcheck.symbolic.encoding.variables import Encoding

__all__ = [
    "MOST_FRAMES",
    "Board",
    "Marks",
    "SharedDiagram",
    "Show",
    "left_out",
    "played",
    "shown",
]

F = TypeVar("F")
Show = JsonObject
"""A sequence of frames, as `symcheck.page.document` describes it."""
Marks = list[list[JsonValue]]

_MOST_EDGES = 2500
"""Transitions of a state graph; Graphviz takes some seconds for more."""
_MOST_DRAWN = 60
"""States of a model that is drawn as a whole; in more, nobody finds anything."""
_NEAREST = 24
"""States of a larger model that are drawn at most, as many as fit a window."""
_MOST_LISTED = 500
"""States that a simulator knows, at least as many as are drawn."""
MOST_FRAMES = 150
"""Frames of a player; of more, those in the middle are left out."""
_MOST_NODES = 120
"""Nodes of a diagram on a page."""
_MOST_STATES = 100_000
"""States of a model of which a part is drawn."""


@dataclass(frozen=True, eq=False)
class SharedDiagram:
    """A picture of several diagrams: its number on the board, and the nodes of each diagram."""

    graph: int | None
    nodes: tuple[frozenset[str], ...] = ()

    @property
    def panes(self) -> list[int]:
        """The picture, if it was not too large."""
        return [] if self.graph is None else [self.graph]

    def marks(self, number: int) -> Marks:
        """Marks for one diagram: nodes of others are dim, nodes that the last one lacks are new."""
        if self.graph is None:
            return []
        here = self.nodes[number]
        new = here - self.nodes[number - 1] if number else frozenset()
        others = frozenset[str]().union(*self.nodes) - here
        return [[self.graph, "dim", sorted(others)], [self.graph, "new", sorted(new)]]


@dataclass(frozen=True, eq=False)
class Board:
    """The pictures of a page.

    Attributes:
        engine: whose states are drawn; None for none.
        max_states: the most states that are drawn: those nearest to the initial states. None: all
            states up to 60, and of more as many as fit a window, up to 24.
        numbers: a text in each state that leaves room for values; '' for no values.
        graphs: the pictures as SVG.
    """

    engine: Engine | None
    max_states: int | None = None
    numbers: str = ""
    graphs: list[str] = field(default_factory=list)

    @staticmethod
    def of(source: object) -> Board:
        """The pictures of a model; without states if it has too many, or is another stage."""
        engine = source.engine if isinstance(source, GivenModel) else None
        return Board(engine if engine is not None and engine.states <= _MOST_STATES else None)

    @cached_property
    def graph(self) -> ChoiceGraph:
        """The states, choices and transitions."""
        assert self.engine is not None
        return ChoiceGraph(self.engine)

    @cached_property
    def _distances(self) -> Int64s:
        return self.graph.distances(self.graph.initial, None, 1 << 62, back=False)

    @property
    def drawn(self) -> Int64s:
        """The numbers of the states that are drawn, ascending."""
        return self._states[0]

    @cached_property
    def _states(self) -> tuple[Int64s, Picture]:
        """The numbers of the states that are drawn, and their picture."""
        if self.max_states is None and len(self._distances) > _MOST_DRAWN:
            return nearest_that_fit(self._order, self._draw, _NEAREST)
        most = _MOST_DRAWN if self.max_states is None else self.max_states
        drawn = self._nearest(most)
        return drawn, self._draw(drawn).fitted()

    def _draw(self, drawn: Int64s) -> Picture:
        numbers = [self.numbers] * self.graph.engine.states if self.numbers else None
        return draw_states(self.graph, drawn, self._distances, numbers=numbers)

    @cached_property
    def _order(self) -> Int64s:
        """The numbers of all states, the nearest to the initial ones first."""
        return np.argsort(self._distances, kind="stable")

    @cached_property
    def listed(self) -> Int64s:
        """The numbers of the states that have values and transitions, ascending."""
        return self._nearest(max(self.max_states or 0, _MOST_LISTED))

    def _nearest(self, most: int) -> Int64s:
        nearest = self._order[:most]
        entries = np.cumsum(self.graph.successor_counts[nearest])
        return np.sort(nearest[: max(1, int((entries <= _MOST_EDGES).sum()))])

    @cached_property
    def panes(self) -> list[int]:
        """The number of the state graph, drawn when it is first used; none without states."""
        if self.engine is None:
            return []
        self.graphs.append(self._states[1].svg)
        return [len(self.graphs) - 1]

    def nodes(self, states: Bdd, manager: DiagramManager, encoding: Encoding) -> list[str]:
        """The nodes of a set of reachable states, over row bits."""
        if self.engine is None:
            return []
        numbers = map(self.graph.number, enumerate_states(manager, encoding, states))
        return [f"s{s}" for s in numbers if s in self._drawn]

    @cached_property
    def _drawn(self) -> frozenset[int]:
        return frozenset(self.drawn.tolist())

    def names(self, members: Bools) -> list[str]:
        """The nodes of a set of states, bool[states]."""
        return [f"s{s}" for s in self.drawn[members[self.drawn]].tolist()]

    def marks(self, name: str, nodes: Sequence[str]) -> Marks:
        """A mark of the state graph."""
        return [[pane, name, list(nodes)] for pane in self.panes]

    def diagram(
        self,
        diagrams: Sequence[Bdd | Mtbdd],
        encoding: Encoding,
        *,
        bits: bool = False,
        title: str = "diagram",
    ) -> SharedDiagram:
        """Draw diagrams on one picture, unless it is too large."""
        try:
            picture, roots = shared_picture(
                diagrams, encoding, max_nodes=_MOST_NODES, bits=bits, title=title
            )
        except UnsupportedError:
            return SharedDiagram(None)
        self.graphs.append(picture.svg)
        children: dict[str, list[str]] = {}
        for edge in picture.edges:
            children.setdefault(edge.source, []).append(edge.target)
        nodes = []
        for root in roots:
            seen, todo = {root}, [root]
            while todo:
                new = set(children.get(todo.pop(), ())) - seen
                seen |= new
                todo += new
            nodes.append(frozenset(seen))
        return SharedDiagram(len(self.graphs) - 1, tuple(nodes))

    def _labels(self) -> list[list[str]]:
        """The labels of each listed state."""
        names = list(self.graph.engine.model.labels)
        holds = [self.graph.members(f'"{name}"')[self.listed].tolist() for name in names]
        rows = zip(*holds, strict=True) if holds else [()] * len(self.listed)
        return [[n for n, is_in in zip(names, row, strict=True) if is_in] for row in rows]

    def _rewards(self) -> list[tuple[str, list[float]]]:
        """The name of each reward structure, and the rewards of the listed states."""
        engine = self.graph.engine
        system = engine.system(engine.all)
        found: list[tuple[str, list[float]]] = []
        for number, structure in enumerate(engine.model.rewards):
            try:
                rewards = system.rewards(Structure(number))[0]
            except SymcheckError:  # a reward that is no number: properties tell it
                continue
            found.append((structure.name or "", [float(r) for r in rewards[self.listed]]))
        return found

    def data(self) -> JsonObject:
        """The graphs, and the states that are listed, for `symcheck.page.document`."""
        if self.engine is None:
            return {"graphs": self.graphs}
        index = {s: i for i, s in enumerate(self.listed.tolist())}
        of_chain = {s: self.graph.actions_to(s) for s in index} if self.graph.is_chain else {}

        def named(source: int, target: int) -> list[str]:
            """The action of a chain's transition, if it has one."""
            return list(filter(None, [of_chain.get(source, {}).get(target)]))

        rows = [
            [
                [
                    c.row,
                    c.action,
                    [[index.get(t, -1), float(p), *named(s, t)] for t, p in c.successors],
                ]
                for c in self.graph.choices(s)
            ]
            for s in index
        ]
        states = [
            self.graph.text(self.graph.valuations[s], named=True, width=1 << 30) for s in index
        ]
        model = {
            "kind": self.engine.model.type.name,
            "ids": list(index),
            "states": states,
            "rows": rows,
            "labels": self._labels(),
            "rewards": self._rewards(),
            "initial": [
                index[s] for s in np.flatnonzero(self.graph.initial).tolist() if s in index
            ],
            "strategies": [],
        }
        (pane,) = self.panes
        return {"graphs": self.graphs, "states": pane, "valued": bool(self.numbers), "model": model}


def shown(frames: Sequence[F]) -> Sequence[F]:
    """The frames of a player: all, or the first and the last ones."""
    half = MOST_FRAMES // 2
    return frames if len(frames) <= MOST_FRAMES else [*frames[:half], *frames[-half:]]


def left_out(frames: Sequence[object]) -> str:
    """A sentence on the frames that are not shown; '' if all are."""
    more = len(frames) - MOST_FRAMES
    return f" {more:,} frames in the middle are left out." if more > 0 else ""


def played(board: Board, show: Show) -> JsonObject:
    """The data of a page with one sequence of frames."""
    return {"title": show["name"], "shows": [show], **board.data()}
