"""The fixpoints of prob0 and prob1 (Baier & Katoen 2008, 10.1.1 and 10.6.1), set by set."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, assert_never

from symcheck.direction import Direction
from symcheck.engines.base import erased
from symcheck.engines.symbolic.graph import SymbolicGraph
from symcheck.tables import counted
from symcheck.teach.board import Board, Show, left_out, played, shown
from symcheck.teach.source import direction_of, graph_engine
from symcheck.teach.trace import Trace
from symcheck.view.choice_graph import GivenModel, set_of

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.engines.symbolic.sets import SymbolicSet

__all__ = ["SetFrame", "fixpoint_show", "prob0", "prob1"]


@dataclass(frozen=True, eq=False)
class SetFrame:
    """An iterate of a fixpoint.

    Attributes:
        number: the number of the frame, from 0.
        stage: 'closure' (backward reachability, growing), 'every strategy reaches' (prob0 for the
            minimum), 'candidates' and 'sure' (prob1 for the maximum: outer and inner fixpoint), or
            'result'.
        states: the set.
        count: its number of states.
        nodes: its number of BDD nodes.
    """

    number: int
    stage: str
    states: SymbolicSet = field(repr=False)
    count: int
    nodes: int

    @property
    def bdd(self) -> Bdd:
        """The BDD of the set."""
        return self.states.bdd

    def __str__(self) -> str:
        return f"{self.number}: {self.stage}, {counted(self.count, 'state')} in {self.nodes} nodes"


def prob0(
    model: GivenModel | SymbolicEngine,
    left: str | SymbolicSet,
    right: str | SymbolicSet,
    direction: Direction | None = None,
) -> Trace[SetFrame]:
    """The iterates of prob0; the last frame holds the states with probability 0.

    Args:
        model: a model, or an engine with diagrams.
        left: the states before those of `right` on the path of `left U right`: a formula such as
            "true", or a set of the engine.
        right: the states that it ends in: a formula such as "d=6", or a set of the engine.
        direction: minimise or maximise over strategies, "min" or "max"; None for a chain.

    Raises:
        UsageError: the direction is missing, of an MDP, or is no direction.
    """
    return _trace(model, "prob0", left, right, direction)


def prob1(
    model: GivenModel | SymbolicEngine,
    left: str | SymbolicSet,
    right: str | SymbolicSet,
    direction: Direction | None = None,
) -> Trace[SetFrame]:
    """The iterates of prob1; the last frame holds the states with probability 1. See `prob0`."""
    return _trace(model, "prob1", left, right, direction)


def _trace(
    model: GivenModel | SymbolicEngine,
    question: Literal["prob0", "prob1"],
    left: str | SymbolicSet,
    right: str | SymbolicSet,
    direction: Direction | None,
) -> Trace[SetFrame]:
    engine = graph_engine(model)
    direction = direction_of(engine, direction)
    sets = set_of(engine, left), set_of(engine, right)

    def play(made: Sequence[SetFrame]) -> Show:
        board = Board.of(model) if isinstance(model, GivenModel) else Board(erased(engine))
        return played(board, fixpoint_show(question, made, engine, board))

    return Trace(_frames(engine, question, *sets, direction), play)


def _frames(
    engine: SymbolicEngine,
    question: Literal["prob0", "prob1"],
    left: SymbolicSet,
    right: SymbolicSet,
    direction: Direction | None,
) -> Iterator[SetFrame]:
    from symcheck.engines.symbolic.sets import SymbolicSet

    seen: list[tuple[str, Bdd]] = []
    graph = SymbolicGraph(engine, observer=lambda what, states: seen.append((what, states)))
    match question:
        case "prob0":
            result = graph.prob0(left, right, direction)
        case "prob1":
            result = graph.prob1(left, right, direction)
        case _:
            assert_never(question)
    for number, (what, bdd) in enumerate([*seen, ("result", result.bdd)]):
        states = SymbolicSet(engine.diagrams, bdd)
        yield SetFrame(number, what, states, states.count, bdd.node_count)


def fixpoint_show(
    name: str, frames: Sequence[SetFrame], engine: SymbolicEngine, board: Board
) -> Show:
    """A fixpoint on the state graph, and on one diagram of all its sets."""
    symbolic = engine.space.symbolic
    diagram = board.diagram([f.bdd for f in shown(frames)], symbolic.encoding)
    result, before = [], set[str]()
    for number, frame in enumerate(shown(frames)):
        here = set(board.nodes(frame.bdd, symbolic.manager, symbolic.encoding))
        marks = (("in", here & before), ("new", here - before), ("gone", before - here))
        result.append(
            {
                "title": f"{frame.number}: {frame.stage}",
                "note": f"{counted(frame.count, 'state')} in {frame.nodes} nodes",
                "marks": [
                    *(m for kind, nodes in marks for m in board.marks(kind, sorted(nodes))),
                    *diagram.marks(number),
                ],
            }
        )
        before = here
    return {
        "name": name,
        "note": "Each frame is a set of states on the way to the fixpoint; the last is the result."
        + left_out(frames),
        "panes": [*board.panes, *diagram.panes],
        "frames": result,
        "keys": [
            ["in", "in the set"],
            ["new", "new, or changed in the diagram"],
            ["gone", "no longer in the set"],
        ],
    }
