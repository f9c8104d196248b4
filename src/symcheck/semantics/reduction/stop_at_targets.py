"""States beyond which no property needs the model: they get a self-loop in place of their steps.

A path from a state of `right` satisfies `left U right`, whatever follows, and a path from a state
outside `left` and `right` does not. Rewards and times until a target end at the target. Values in
the initial states are therefore the same if exploration stops there; states behind are not reached.
Source: C. Baier, J.-P. Katoen: Principles of Model Checking (2008), 10.1.1 and 10.1.2 (absorbing
states); Storm builds models this way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from fractions import Fraction

from symcheck.errors import UnsupportedError
from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate, Event
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.query import PathProbability, Query, ReachReward, query_of
from symcheck.semantics.reduction.control_locations import simplified
from symcheck.semantics.reduction.reset_dead_variables import expanded
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    BinaryTemporal,
    Expression,
    Literal,
    Name,
    StateOperator,
    Type,
    Unary,
    UnaryTemporal,
)
from symcheck.syntax.operators import Operator, UnaryOperator
from symcheck.syntax.traversal import nodes

__all__ = ["deciding_states", "stop_at"]

_FALSE, _ONE = Literal(False, Type.BOOL), Literal(Fraction(1), Type.DOUBLE)


def deciding_states(
    model: BoundModel, formulas: Iterable[tuple[Expression, Mapping[str, Expression]]]
) -> Expression | None:
    """The states whose successors none of the properties needs.

    Args:
        model: the bound model.
        formulas: properties of the initial states, each with the labels that it may use.

    Returns:
        A state expression; None if some property may need every state.
    """
    types = {v.name: v.type for v in model.variables}
    stop: Expression | None = None
    for formula, labels in formulas:
        own = _decided(formula, model)
        whole = None if own is None else expanded(own, {**model.labels, **labels})
        if whole is None or any(_is_no_state_expression(node) for node in nodes(whole)):
            return None
        stop = whole if stop is None else Binary(Operator.AND, stop, whole)
    if stop is None:
        return None
    stop = simplified(stop, types)
    return None if stop == _FALSE else stop


def stop_at(model: BoundModel, states: Expression) -> BoundModel:
    """The model with a self-loop (of rate 1 in a CTMC) in place of the steps of these states."""
    going_on = Unary(UnaryOperator.NOT, states)

    def restricted(event: Event) -> Event:
        first, *others = event.participants
        commands = (replace(c, guard=Binary(Operator.AND, c.guard, going_on)) for c in first)
        return replace(event, participants=(tuple(commands), *others))

    loop = BoundCommand(0, None, states, (BoundUpdate(_ONE, ()),))
    events = (*map(restricted, model.events), Event(None, ((loop,),)))
    return replace(model, events=events)


def _is_no_state_expression(node: object) -> bool:
    """Whether the node speaks of paths (also `F (a & X b)` does), or is the label "deadlock"."""
    return isinstance(node, StateOperator | UnaryTemporal | BinaryTemporal) or (
        isinstance(node, Name) and node.name[0] == '"'
    )


def _decided(formula: Expression, model: BoundModel) -> Expression | None:
    """The states from which all paths give a formula the same value, or none counts any more."""
    try:
        query = query_of(formula, model) if isinstance(formula, AnyMeasure) else None
    except UnsupportedError:  # told when the formula is checked
        return None
    match query:
        case Query(PathProbability(UntilPath(left, right, window))) if window.contains_zero:
            return Binary(Operator.OR, right, Unary(UnaryOperator.NOT, left))
        case Query(ReachReward(_, target)):
            return target
        case _:
            return None
