"""Rewards of JANI properties: values of expressions that are accumulated, or read in states."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from symcheck.syntax.ast import Binary, Expression, Literal, Name, Unary
from symcheck.syntax.jani.expressions import ONE, is_literal, simplified
from symcheck.syntax.jani.network import Edge, Network, RawAssignment, assigned_values
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names, substitute

__all__ = [
    "CommonRewards",
    "RewardRequest",
    "edge_reward",
    "has_branching_rewards",
    "is_additive",
    "state_reward",
]


@dataclass(frozen=True)
class RewardRequest:
    """A reward structure that a property needs.

    Attributes:
        expression: over variables and transient variables.
        states: its value in each state (per unit of time in a CTMC).
        exits: its value in each state, earned by each transition from it. (In discrete time that is
            the reward of the state.)
        steps: its value on each transition.
        assigned_only: with `steps`, transitions earn what their assignments add to the value
            without them, and nothing where they assign nothing.
    """

    expression: Expression
    states: bool
    exits: bool
    steps: bool
    assigned_only: bool = False


@dataclass(frozen=True)
class CommonRewards:
    """The rewards of states, and those of all transitions, from a state; they add up."""

    states: tuple[Expression, ...]
    transitions: tuple[Expression, ...]


def state_reward(request: RewardRequest, network: Network) -> CommonRewards:
    """The rewards of a request that do not depend on the edge."""
    value = simplified(network.in_states(request.expression))
    has_value = not is_literal(value, 0)
    start = simplified(substitute(request.expression, _initial_values(network)))
    on_all_steps = request.steps and not request.assigned_only
    return CommonRewards(
        (value,) if request.states and has_value else (),
        (
            *((value,) if request.exits and has_value else ()),
            *((start,) if on_all_steps and not is_literal(start, 0) else ()),
        ),
    )


def edge_reward(request: RewardRequest, edge: Edge, network: Network) -> Expression | None:
    """What an edge adds to the reward of all transitions: an expected value over its branches."""
    if not request.steps:
        return None
    values = [_value(request, branch.assignments, network) for branch in edge.branches]
    first = values[0] if values else None
    if all(v == first for v in values):
        return first
    total: Expression | None = None
    for branch, value in zip(edge.branches, values, strict=True):
        if value is not None:
            weight = branch.probability or ONE
            part = Binary(Operator.TIMES, weight, value)
            total = part if total is None else Binary(Operator.PLUS, total, part)
    return total


def has_branching_rewards(request: RewardRequest, network: Network) -> bool:
    """Whether the reward of a transition depends on its destination, not only on its edge."""
    return request.steps and any(
        len({_value(request, branch.assignments, network) for branch in edge.branches}) > 1
        for element in network.elements
        for edge in element.edges
    )


def _value(
    request: RewardRequest, assignments: Iterable[RawAssignment], network: Network
) -> Expression | None:
    """What the assignments of a branch add to the value without them; None: nothing."""
    _, assigned = assigned_values(assignments, network.transients)
    read = names(request.expression) & assigned.keys()
    if not read:
        return None
    start = _initial_values(network)
    value = simplified(substitute(request.expression, {**start, **assigned}))
    before = simplified(substitute(request.expression, start))
    if is_literal(value, 0) and is_literal(before, 0):
        return None
    return value if is_literal(before, 0) else Binary(Operator.MINUS, value, before)


def is_additive(expression: Expression, transients: set[str]) -> bool:
    """Whether the effects of several transient variables on the value add up."""
    match expression:
        case Name() | Literal():
            return True
        case Unary(_, operand):
            return is_additive(operand, transients)
        case Binary(Operator.PLUS | Operator.MINUS, left, right):
            return is_additive(left, transients) and is_additive(right, transients)
        case Binary(Operator.TIMES, left, right):
            one, other = (names(side) & transients for side in (left, right))
            return (not one and is_additive(right, transients)) or (
                not other and is_additive(left, transients)
            )
        case Binary(Operator.DIVIDE, left, right):
            return not names(right) & transients and is_additive(left, transients)
        case _:
            return not names(expression) & transients


def _initial_values(network: Network) -> dict[str, Expression]:
    return {name: t.initial for name, t in network.transients.items()}
