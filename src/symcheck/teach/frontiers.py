"""The reachability search, iteration by iteration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING

from symcheck.symbolic.encoding.enumerate_states import enumerate_states
from symcheck.symbolic.reachability.search import search
from symcheck.tables import counted
from symcheck.teach.board import Board, Show, left_out, played, shown
from symcheck.teach.source import encoded
from symcheck.teach.trace import Trace
from symcheck.view.choice_graph import GivenModel

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager
    from symcheck.symbolic.encoding.variables import Encoding
    from symcheck.symbolic.model import Iteration, SymbolicModel

__all__ = ["SearchFrame", "frontiers", "search_show"]


@dataclass(frozen=True, eq=False)
class SearchFrame:
    """The reachability search after an iteration.

    Attributes:
        iteration: counts of the iteration.
        states: the states reached so far.
        frontier: the states that this iteration found.
        new_states: the first of these, as values in declaration order.
        encoding: says which bits encode which variable.
        manager: of the diagrams.
    """

    iteration: Iteration
    states: Bdd = field(repr=False)
    frontier: Bdd = field(repr=False)
    new_states: tuple[tuple[bool | int, ...], ...]
    encoding: Encoding = field(repr=False)
    manager: DiagramManager = field(repr=False)

    def __str__(self) -> str:
        return f"{self.iteration.number}: {self.summary}"

    @property
    def summary(self) -> str:
        """Counts of the states and nodes, and the first new states."""
        i = self.iteration
        shown = " ".join("(" + ",".join(map(_text, s)) + ")" for s in self.new_states)
        more = (
            f" … {i.frontier} in all"
            if i.frontier is not None and i.frontier > len(self.new_states)
            else ""
        )
        states = counted(i.states or 0, "state")
        return f"{states} in {i.nodes} nodes; new: {shown or 'nothing'}{more}"


def frontiers(
    model: GivenModel | SymbolicModel,
    schedule: str = "frontier",
    *,
    limit: int = 8,
    frames: int | None = None,
) -> Trace[SearchFrame]:
    """A frame per iteration of the reachability search.

    Args:
        model: the model, or the encoded model.
        schedule: 'frontier' (breadth first), 'chaining' or 'saturation'.
        limit: the most new states that a frame lists.
        frames: the most frames. None: no limit.

    Examples:
        >>> for frame in teach.frontiers(model):  # doctest: +SKIP
        ...     print(frame)
    """
    return Trace(
        _frontiers(encoded(model), schedule, limit, frames),
        lambda made: played(board := Board.of(model), search_show(made, board)),
    )


def _frontiers(
    symbolic: SymbolicModel, schedule: str, limit: int, frames: int | None
) -> Iterator[SearchFrame]:
    encoding = symbolic.encoding
    for iteration in islice(search(symbolic, schedule), frames):
        states = enumerate_states(iteration.symbolic.manager, encoding, iteration.frontier)
        values = tuple(islice(states, limit))
        yield SearchFrame(
            iteration.iteration,
            iteration.states,
            iteration.frontier,
            values,
            encoding,
            symbolic.manager,
        )


def search_show(frames: Sequence[SearchFrame], board: Board) -> Show:
    """The search on the state graph, and on one diagram of the reached sets of all frames."""
    diagram = board.diagram([f.states for f in shown(frames)], frames[0].encoding)
    reached: list[str] = []
    entries = []
    for number, frame in enumerate(shown(frames)):
        nodes = board.nodes(frame.frontier, frame.manager, frame.encoding)
        entries.append(
            {
                "title": f"Iteration {frame.iteration.number}",
                "note": frame.summary,
                "marks": [
                    *board.marks("in", reached),
                    *board.marks("new", nodes),
                    *diagram.marks(number),
                ],
            }
        )
        reached = [*reached, *nodes]
    return {
        "name": "Reachability, frontier by frontier",
        "note": "Each iteration adds the successors of the states that the one before it found."
        + left_out(frames),
        "panes": [*board.panes, *diagram.panes],
        "frames": entries,
        "keys": [["in", "reached before"], ["new", "new, or changed in the diagram"]],
    }


def _text(value: bool | int) -> str:
    return str(value).lower()
