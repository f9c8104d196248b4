"""Parameter lifting of a DTMC as an MDP without parameters, which every engine builds.

Each command is replaced by its copies at the corners of a box of its parameters. Its probabilities
are linear in each parameter, so that those at a point of the box are a mixture of those at corners:
the chain at the point is what a randomised strategy of the MDP induces. So the least and greatest
values of the MDP bound those at all points of the box.
Source: Quatmann, Dehnert, Jansen, Junges & Katoen (ATVA 2016), 'Parameter synthesis for Markov
models: faster than ever'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.parameters import Ranges
from symcheck.semantics.model import BoundCommand, BoundModel, Event
from symcheck.syntax.ast import (
    Binary,
    Conditional,
    Expression,
    Literal,
    ModelType,
    Name,
    Type,
    Unary,
    Weights,
)
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import names, operands, substitute

__all__ = ["corners"]

_ROWS = "without -m, -h and -s, lifting is done on rows"


def corners(model: BoundModel, box: Ranges) -> BoundModel:
    """The MDP whose values bound those of a DTMC at the points of a closed box.

    Args:
        model: a model that was bound with parameters.
        box: the ranges of all of them.

    Raises:
        UnsupportedError: the model is no DTMC, or a probability is not linear in each parameter,
            or rewards depend on parameters.
    """
    if model.type is not ModelType.DTMC:
        raise UnsupportedError(
            f"{model.type.called} with parameters are not available on decision diagrams",
            hint=_ROWS,
        )
    for item in (i for r in model.rewards for i in r.items):
        if not box.keys().isdisjoint(names(item.value)):
            raise UnsupportedError(
                "parameter lifting on decision diagrams has no parameters in rewards", hint=_ROWS
            )
    done: dict[int, tuple[BoundCommand, ...]] = {}  # events share commands, by identity

    def copies(command: BoundCommand) -> tuple[BoundCommand, ...]:
        if id(command) not in done:
            done[id(command)] = _at_corners(command, box)
        return done[id(command)]

    def all_of(commands: Sequence[BoundCommand]) -> tuple[BoundCommand, ...]:
        return tuple(c for command in commands for c in copies(command))

    events: list[Event] = []
    for event in model.events:
        participants = tuple(map(all_of, event.participants))
        if event.action is None and len(participants) == 1:
            events += (replace(event, participants=((c,),)) for c in participants[0])
        else:
            events.append(replace(event, participants=participants))
    return replace(
        model,
        type=ModelType.MDP,
        modules=tuple(replace(m, commands=all_of(m.commands)) for m in model.modules),
        events=tuple(events),
        observed=None,
        parameters={},
        weights=Weights.NUMBERS,
    )


def _at_corners(command: BoundCommand, box: Ranges) -> tuple[BoundCommand, ...]:
    """The copies of a command at the corners of the parameters that it has."""
    weights = [update.probability for update in command.updates]
    used = [name for name in box if any(name in names(weight) for weight in weights)]
    for name in used:
        for weight in weights:
            _check_linear(weight, name)
    found = []
    for corner in product(*(dict.fromkeys(box[name]) for name in used)):
        values = {n: Literal(v, Type.DOUBLE) for n, v in zip(used, corner, strict=True)}
        updates = (
            replace(u, probability=substitute(u.probability, values)) for u in command.updates
        )
        found.append(replace(command, updates=tuple(updates)))
    return tuple(found)


def _check_linear(weight: Expression, name: str) -> None:
    """Raises UnsupportedError unless a probability is linear in a parameter, as it is written."""
    if _degree(weight, name) > 1:
        raise UnsupportedError(
            f"parameter lifting needs probabilities that are linear in each parameter, and in one "
            f"of them {name} is multiplied by itself, or divides",
            hint=_ROWS,
        )


def _degree(weight: Expression, name: str) -> int:
    """A bound of the degree in a parameter; 2 for what is no polynomial."""
    if name not in names(weight):
        return 0
    match weight:
        case Name():
            return 1
        case Unary(UnaryOperator.MINUS, operand):
            return _degree(operand, name)
        case Binary(Operator.TIMES, left, right):
            return _degree(left, name) + _degree(right, name)
        case Binary(Operator.DIVIDE, left, right) if name not in names(right):
            return _degree(left, name)
        case Binary(Operator.PLUS | Operator.MINUS):
            return max(_degree(part, name) for part in operands(weight))
        case Conditional(condition, then, otherwise) if name not in names(condition):
            return max(_degree(then, name), _degree(otherwise, name))
        case _:  # powers, min and max, and what chooses by the parameter
            return 2
