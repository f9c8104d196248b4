"""The construction of the transition matrix, from the guards of commands on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from symcheck.symbolic.events.commands import touched_by
from symcheck.symbolic.matrix.transitions import full_matrix, participant_matrix, transitions

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd
    from symcheck.options import Options
    from symcheck.symbolic.encoding.variables import Encoding
    from symcheck.symbolic.model import EncodedCommand, EncodedEvent, StateSpace, SymbolicModel

__all__ = ["BuildFrame", "construction"]


@dataclass(frozen=True, eq=False)
class BuildFrame:
    """A diagram that the construction of the matrix makes.

    Attributes:
        stage: 'guard' and 'update' (sets); 'command', 'module', 'event' and 'model' (functions to
            probabilities or rates).
        title: the stage, with action, command and module.
        diagram: the BDD or MTBDD.
        encoding: says which bits encode which variable.
    """

    stage: str
    title: str
    diagram: Bdd | Mtbdd = field(repr=False)
    encoding: Encoding = field(repr=False)

    @property
    def nodes(self) -> int:
        """Number of nodes of the diagram."""
        return self.diagram.node_count


def construction(space: StateSpace, options: Options) -> Iterator[BuildFrame]:
    """The diagrams from which the matrix is built, restricted to reachable states.

    Per event: guards and updates of its commands, the commands, their sum per module, and the
    product over modules. The last frames are the matrices of the model: one of a chain, one per
    choice class of an MDP.

    Raises:
        SymcheckError: as `transitions`.
    """
    symbolic = space.symbolic
    for number, event in enumerate(symbolic.events):
        if event.guard.disjoint(space.states):
            continue
        name = event.event.action or f"unlabelled {number + 1}"
        for commands in event.participants:
            for place, command in enumerate(commands):
                yield from _command(
                    space, command, f"[{name}] command {place + 1} of {_module(symbolic, command)}"
                )
            if len(commands) > 1:
                matrix = participant_matrix(symbolic, commands, touched_by(commands), space.states)
                module = _module(symbolic, commands[0])
                title = f"[{name}] module {module}: sum of {len(commands)} commands"
                yield BuildFrame("module", title, matrix, symbolic.encoding)
        yield _event(space, event, name)
    made = transitions(space, options)
    for slot, root in enumerate(made.roots):
        yield BuildFrame(
            "model",
            "matrix" if made.matrix is not None else f"choice class {slot + 1}",
            root,
            symbolic.encoding,
        )


def _command(space: StateSpace, command: EncodedCommand, title: str) -> Iterator[BuildFrame]:
    encoding = space.symbolic.encoding
    yield BuildFrame("guard", f"{title}: guard", command.guard, encoding)
    for number, update in enumerate(command.updates):
        yield BuildFrame("update", f"{title}: update {number + 1}", update.relation, encoding)
    matrix = participant_matrix(space.symbolic, [command], touched_by([command]), space.states)
    yield BuildFrame("command", title, matrix, encoding)


def _event(space: StateSpace, event: EncodedEvent, name: str) -> BuildFrame:
    matrix = full_matrix(space.symbolic, [(event, event.participants)], space.states)
    modules = " × ".join(_module(space.symbolic, commands[0]) for commands in event.participants)
    return BuildFrame(
        "event", f"[{name}] {modules}, other variables unchanged", matrix, space.symbolic.encoding
    )


def _module(symbolic: SymbolicModel, command: EncodedCommand) -> str:
    return symbolic.model.modules[command.command.module].name
