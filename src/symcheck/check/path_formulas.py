"""Path formulas over sets of states: next, until with bounds, and LTL formulas for automata."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import assert_never

from symcheck.engines.base import Engine, StateSet
from symcheck.errors import NO_SPAN, Span
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_normal_form import (
    Connected,
    Extent,
    Negated,
    NextState,
    NormalForm,
    StateFormula,
    UntilReached,
    normal_form,
    state_formulas,
)
from symcheck.semantics.time_bounds import RewardWindow, Window
from symcheck.syntax.ast import (
    Binary,
    Expression,
    ExpressionNode,
    PathFormula,
    Unary,
)
from symcheck.syntax.operators import UnaryOperator, connect

__all__ = [
    "NextPath",
    "Path",
    "RewardPath",
    "StatePath",
    "StatesOf",
    "TemporalPath",
    "UntilPath",
    "negated",
    "resolve",
    "temporal",
]

StatesOf = Callable[[Expression], StateSet]


@dataclass(frozen=True, slots=True)
class StatePath:
    """A formula about the first state only."""

    states: StateSet
    negative: bool = False


@dataclass(frozen=True, slots=True)
class NextPath:
    """The second state is in `target`, and the step is in the window."""

    target: StateSet
    window: Window = field(default_factory=Window)
    negative: bool = False


@dataclass(frozen=True, slots=True)
class UntilPath:
    """`left U right` within the window."""

    left: StateSet
    right: StateSet
    window: Window = field(default_factory=Window)
    negative: bool = False


@dataclass(frozen=True, slots=True)
class TemporalPath:
    """Any other LTL formula, and the sets of its state formulas."""

    form: NormalForm
    sets: tuple[tuple[Expression, StateSet], ...] = ()
    negative: bool = False
    span: Span = NO_SPAN


@dataclass(frozen=True, slots=True)
class RewardPath:
    """A path formula without time bounds, with bounds on the rewards that are earned.

    See `symcheck.check.measures.reward_bounded_until`.
    """

    path: NextPath | UntilPath
    counts: tuple[RewardWindow, ...]
    negative: bool = False


Path = StatePath | NextPath | UntilPath | TemporalPath | RewardPath
"""A path formula over sets of states; `negative` stands for its negation."""


def negated(path: Path) -> Path:
    """The negation."""
    return replace(path, negative=not path.negative)


def temporal(path: PathFormula, states_of: StatesOf, model: BoundModel) -> TemporalPath:
    """A path formula of any form as an LTL formula, with the sets of its state formulas."""
    return _temporal(normal_form(path, model), _once(states_of), path.span)


def resolve(path: PathFormula, states_of: StatesOf, engine: Engine) -> Path:
    """A path formula over sets of states; `states_of` gives those of its state formulas."""
    return _over_sets(normal_form(path, engine.model), _once(states_of), path.span)


def _over_sets(form: NormalForm, states_of: StatesOf, span: Span) -> Path:
    match form:
        case StateFormula(formula):
            return StatePath(states_of(formula))
        case Negated(operand):
            return negated(_over_sets(operand, states_of, span))
        case NextState(StateFormula(target), extent):
            return _within(NextPath(states_of(target)), extent)
        case UntilReached(StateFormula(left), StateFormula(right), extent):
            return _within(UntilPath(states_of(left), states_of(right)), extent)
        case Connected() | NextState() | UntilReached():
            return _temporal(form, states_of, span)
        case _:
            assert_never(form)


def _within(path: NextPath | UntilPath, extent: Extent) -> Path:
    if isinstance(extent, Window):
        return replace(path, window=extent)
    return RewardPath(path, extent)


def _temporal(form: NormalForm, states_of: StatesOf, span: Span) -> TemporalPath:
    formulas = dict.fromkeys(state_formulas(form))
    return TemporalPath(form, tuple((f, states_of(f)) for f in formulas), span=span)


def _once(states_of: StatesOf) -> StatesOf:
    """A cache of `states_of`.

    Operators that the normal form adds are evaluated as operations on sets.
    """
    known: dict[Expression, StateSet] = {}

    def find(formula: Expression) -> StateSet:
        if formula not in known:
            match formula:
                case Unary(UnaryOperator.NOT, operand):
                    known[formula] = ~find(operand)
                case Binary(operator, left, right) if operator.is_logical and _is_added(formula):
                    known[formula] = connect(operator, find(left), find(right))
                case ExpressionNode():
                    known[formula] = states_of(formula)
                case _:
                    assert_never(formula)
        return known[formula]

    return find


def _is_added(formula: Expression) -> bool:
    return formula.span is NO_SPAN
