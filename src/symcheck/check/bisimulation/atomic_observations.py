"""Atomic observations: the expressions and rewards by which a formula distinguishes states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.state_formulas import is_plain
from symcheck.errors import UnsupportedError
from symcheck.semantics.rewards import (
    Reward,
    Steps,
    Structure,
    Time,
    bounded_reward,
    operator_reward,
)
from symcheck.syntax.ast import (
    Binary,
    Expression,
    Filter,
    LabelReference,
    MultiObjective,
    Name,
    PathQuantifier,
    RewardBound,
    RewardOperator,
    StateFilter,
    StateOperator,
    Unary,
)
from symcheck.syntax.operators import UnaryOperator
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import Tree, children, names

__all__ = ["AtomicObservations", "atomic_observations", "union"]


@dataclass(frozen=True)
class AtomicObservations:
    """The atomic observations of a formula.

    Attributes:
        expressions: maximal expressions over variables, by their text, with labels expanded. A
            condition of several parts is one expression, so that the quotient stays small.
        names: "init" and "deadlock", if the formula refers to them.
        structures: the indices of reward structures.
    """

    expressions: Mapping[str, Expression] = field(default_factory=dict)
    names: frozenset[str] = frozenset()
    structures: frozenset[int] = frozenset()

    def __le__(self, other: AtomicObservations) -> bool:
        """Whether the other observations include these."""
        return (
            self.expressions.keys() <= other.expressions.keys()
            and self.names <= other.names
            and self.structures <= other.structures
        )


def union(all: Iterable[AtomicObservations]) -> AtomicObservations:
    """The union of the observations of several formulas."""
    every = list(all)
    expressions = {text: part for one in every for text, part in one.expressions.items()}
    return AtomicObservations(
        expressions,
        frozenset().union(*(o.names for o in every)),
        frozenset().union(*(o.structures for o in every)),
    )


def atomic_observations(context: Context, formula: Expression) -> AtomicObservations:
    """The atomic observations of a formula.

    For a filter as the outermost operator: those of its formula, and of its condition unless that
    is an expression over variables.

    Raises:
        UnsupportedError: the formula contains a filter, A, E or multi(...).
        NameFault: a label is unknown.
    """
    parts: tuple[Expression | None, ...] = (formula,)
    if isinstance(formula, Filter | StateFilter):
        condition = formula.states
        looked_up = (
            condition is None or is_plain(condition) or isinstance(condition, LabelReference)
        )
        parts = (formula.formula, None if looked_up else condition)
    return union(o for part in parts if part is not None for o in _parts(context, part))


def _parts(context: Context, formula: Tree) -> Iterator[AtomicObservations]:
    """Maximal expressions over variables, initial and deadlock states, and reward structures."""
    condition = _condition(context, formula)
    if condition is not None:
        # Constants, such as thresholds, are the same in every state.
        if names(condition):
            yield AtomicObservations({pretty(condition): condition})
        return
    match formula:
        case Filter() | StateFilter() | MultiObjective() | PathQuantifier():
            raise UnsupportedError(
                "-bisim does not support filters within a formula, A and E, and multi(...)"
            )
        case LabelReference("init" | "deadlock"):
            yield AtomicObservations(names=frozenset([formula.name]))
            return
        case LabelReference():
            yield from _parts(context.inside(formula), context.referred(formula))
            return
        case RewardOperator():
            yield _reward_observations(operator_reward(formula, context.engine.model))
        case StateOperator() if not formula.is_bisimulation_invariant:
            raise UnsupportedError(
                f"-bisim does not support '{pretty(formula)}': bisimilar states may differ in it"
            )
        case StateOperator() if formula.reads_rewards:
            every = range(len(context.engine.model.rewards))
            yield AtomicObservations(structures=frozenset(every))
        case RewardBound():
            yield _reward_observations(bounded_reward(formula, context.engine.model))
        case _:
            pass
    for child in children(formula):
        yield from _parts(context, child)


def _reward_observations(reward: Reward) -> AtomicObservations:
    """The observations of a reward; steps and time are the same in every state."""
    match reward:
        case Structure(index):
            return AtomicObservations(structures=frozenset([index]))
        case Steps() | Time():
            return AtomicObservations()
        case _:
            assert_never(reward)


def _condition(context: Context, formula: Tree) -> Expression | None:
    """The formula with labels expanded if it is over variables only; None otherwise."""
    match formula:
        case LabelReference("init" | "deadlock"):
            return None
        case LabelReference():
            named = context.referred(formula)
            if isinstance(named, Name) and named.name.startswith('"'):
                return None  # a label of a model without commands: a set of states
            return _condition(context.inside(formula), named)
        case Unary(UnaryOperator.NOT, operand):
            inner = _condition(context, operand)
            return None if inner is None else replace(formula, operand=inner)
        case Binary(operator, left, right) if operator.is_logical:
            one, other = _condition(context, left), _condition(context, right)
            return None if one is None or other is None else replace(formula, left=one, right=other)
        case _:  # also the path formulas and bounds below an operator
            return formula if isinstance(formula, Expression) and is_plain(formula) else None
