"""The construction of the transition matrix, from the guards of commands on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from symcheck.options import Options
from symcheck.symbolic.events.commands import touched_by
from symcheck.symbolic.matrix.transitions import full_matrix, participant_matrix, transitions
from symcheck.teach.board import Board, Show, left_out, played, shown
from symcheck.teach.source import bound_of, state_space
from symcheck.teach.trace import Trace
from symcheck.view.choice_graph import GivenModel

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, DiagramManager, Mtbdd
    from symcheck.symbolic.encoding.variables import Encoding
    from symcheck.symbolic.model import EncodedCommand, EncodedEvent, StateSpace, SymbolicModel

__all__ = ["BuildFrame", "construction", "construction_show"]


@dataclass(frozen=True, eq=False)
class BuildFrame:
    """A diagram that the construction of the matrix makes.

    Attributes:
        stage: 'guard' and 'update' (sets); 'command', 'module', 'event' and 'model' (functions to
            probabilities or rates). Without CUDD, 'relation' (a set) takes the place of functions.
        title: the stage, with action, command and module.
        diagram: the BDD or MTBDD.
        encoding: says which bits encode which variable.
        states: the reachable states in which the command, the event or the model has a transition.
        manager: of the diagrams.
    """

    stage: str
    title: str
    diagram: Bdd | Mtbdd = field(repr=False)
    encoding: Encoding = field(repr=False)
    states: Bdd = field(repr=False)
    manager: DiagramManager = field(repr=False)

    @property
    def nodes(self) -> int:
        """Number of nodes of the diagram."""
        return self.diagram.node_count


def construction(
    model: GivenModel | StateSpace, options: Options | None = None
) -> Trace[BuildFrame]:
    """The diagrams from which the matrix is built, restricted to reachable states.

    Per event: guards and updates of its commands, the commands, their sum per module, and the
    product over modules. The last frames are the matrices of the model: one of a chain, one per
    choice class of an MDP. Without CUDD there are guards, updates and the transition relation of
    each event over the variables that it changes.

    Args:
        model: the model, or its reachable states.
        options: limits of time and memory.

    Raises:
        SymcheckError: as `transitions`.
    """
    if isinstance(model, GivenModel):
        bound_of(model)  # raises an error where there are no commands
    return Trace(
        _construction(state_space(model), options or Options()),
        lambda made: played(board := Board.of(model), construction_show(made, board)),
    )


def _construction(space: StateSpace, options: Options) -> Iterator[BuildFrame]:
    symbolic, has_mtbdds = space.symbolic, space.symbolic.manager.has_mtbdds
    for number, event in enumerate(symbolic.events):
        if event.guard.disjoint(space.states):
            continue
        name = event.event.action or f"unlabelled {number + 1}"
        for commands in event.participants:
            for index, command in enumerate(commands):
                yield from _command(
                    space, command, f"[{name}] command {index + 1} of {_module(symbolic, command)}"
                )
            if len(commands) > 1 and has_mtbdds:
                matrix = participant_matrix(symbolic, commands, touched_by(commands), space.states)
                module = _module(symbolic, commands[0])
                title = f"[{name}] module {module}: sum of {len(commands)} commands"
                yield _frame(space, "module", title, matrix, event.guard)
        yield _event(space, event, name)
    if not has_mtbdds:
        return
    made = transitions(space, options)
    for slot, root in enumerate(made.roots):
        title = "matrix" if made.matrix is not None else f"choice class {slot + 1}"
        enabled = space.states if made.matrix is not None else made.choices[slot].guard
        yield _frame(space, "model", title, root, enabled)


def _command(space: StateSpace, command: EncodedCommand, title: str) -> Iterator[BuildFrame]:
    yield _frame(space, "guard", f"{title}: guard", command.guard, command.guard)
    for number, update in enumerate(command.updates):
        name = f"{title}: update {number + 1}"
        yield _frame(space, "update", name, update.relation, command.guard)
    if space.symbolic.manager.has_mtbdds:
        matrix = participant_matrix(space.symbolic, [command], touched_by([command]), space.states)
        yield _frame(space, "command", title, matrix, command.guard)


def _event(space: StateSpace, event: EncodedEvent, name: str) -> BuildFrame:
    modules = " × ".join(_module(space.symbolic, commands[0]) for commands in event.participants)
    if not space.symbolic.manager.has_mtbdds:
        return _frame(space, "relation", f"[{name}] {modules}", event.relation, event.guard)
    matrix = full_matrix(space.symbolic, [(event, event.participants)], space.states)
    return _frame(
        space, "event", f"[{name}] {modules}, other variables unchanged", matrix, event.guard
    )


def _frame(
    space: StateSpace, stage: str, title: str, diagram: Bdd | Mtbdd, enabled: Bdd
) -> BuildFrame:
    symbolic = space.symbolic
    states = enabled & space.states
    return BuildFrame(stage, title, diagram, symbolic.encoding, states, symbolic.manager)


def _module(symbolic: SymbolicModel, command: EncodedCommand) -> str:
    return symbolic.model.modules[command.command.module].name


def construction_show(frames: Sequence[BuildFrame], board: Board) -> Show:
    """A diagram for each frame; guards and commands also on the state graph."""
    result = []
    for frame in shown(frames):
        drawn = board.diagram([frame.diagram], frame.encoding, title=frame.title)
        enabled = board.nodes(frame.states, frame.manager, frame.encoding)
        result.append(
            {
                "title": frame.title,
                "note": f"{frame.nodes} nodes" + ("" if drawn.panes else ", too many to be drawn"),
                "panes": [*board.panes, *drawn.panes],
                "marks": board.marks("in", enabled),
            }
        )
    return {
        "name": "Construction of the matrix, guard by guard",
        "note": "Guards and updates become commands, modules, events, and finally the matrix."
        + left_out(frames),
        "frames": result,
        "keys": [["in", "states in which it is enabled"]],
    }
