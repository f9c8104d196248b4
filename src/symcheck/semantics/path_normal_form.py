"""The normal form of path formulas: state formulas, negation, logical operators, next and until.

Checking, automata and simulation read this form. The dualities are applied only here: F a = true U
a, G a = !(true U !a), a R b = !(!a U !b), a W b = !((a & !b) U (!a & !b)), each with its bound.
Source: Baier & Katoen (2008), 5.1.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import assert_never

from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundModel
from symcheck.semantics.time_bounds import RewardWindow, Window, counts, window
from symcheck.syntax.ast import (
    Binary,
    Conditional,
    Eventually,
    Expression,
    ExpressionNode,
    Globally,
    Literal,
    Next,
    PathBound,
    PathFormula,
    Release,
    RewardBound,
    RewardBounds,
    TimeBound,
    Type,
    Unary,
    Until,
    WeakUntil,
)
from symcheck.syntax.operators import Operator, UnaryOperator

__all__ = [
    "Connected",
    "Extent",
    "Negated",
    "NextState",
    "NormalForm",
    "StateFormula",
    "UntilReached",
    "normal_form",
    "only_window",
    "state_formulas",
]

Extent = Window | tuple[RewardWindow, ...]
"""The times at which a target must be reached, or the rewards that may accumulate until then."""


@dataclass(frozen=True, slots=True)
class StateFormula:
    """The first state satisfies a formula."""

    formula: Expression


@dataclass(frozen=True, slots=True)
class Negated:
    """The path does not satisfy `operand`."""

    operand: NormalForm


@dataclass(frozen=True, slots=True)
class Connected:
    """A logical operator between path formulas."""

    operator: Operator
    left: NormalForm
    right: NormalForm


@dataclass(frozen=True, slots=True)
class NextState:
    """The suffix from the second state satisfies `operand`, and the step is within the extent."""

    operand: NormalForm
    extent: Extent


@dataclass(frozen=True, slots=True)
class UntilReached:
    """`right` holds at a time within the extent, and `left` at all times before."""

    left: NormalForm
    right: NormalForm
    extent: Extent


NormalForm = StateFormula | Negated | Connected | NextState | UntilReached


def normal_form(path: PathFormula, model: BoundModel) -> NormalForm:
    """The normal form of a bound path formula.

    Raises:
        InputError: a bound is negative or cannot be satisfied.

    Source: Baier & Katoen (2008), 5.1.
    """

    def inner(part: PathFormula) -> NormalForm:
        return normal_form(part, model)

    match path:
        case Next(operand, bound):
            return NextState(inner(operand), _extent(bound, model))
        case Eventually(operand, bound):
            return UntilReached(_TRUE, inner(operand), _extent(bound, model))
        case Globally(operand, bound):
            return Negated(UntilReached(_TRUE, _negation(inner(operand)), _extent(bound, model)))
        case Until(left, right, bound):
            return UntilReached(inner(left), inner(right), _extent(bound, model))
        case Release(left, right, bound):
            parts = _negation(inner(left)), _negation(inner(right))
            return Negated(UntilReached(*parts, _extent(bound, model)))
        case WeakUntil(left, right, bound):
            extent, a, not_b = _extent(bound, model), inner(left), _negation(inner(right))
            neither = _conjunction(_negation(a), not_b)
            # Without a lower bound, !b U (!a & !b) is equivalent, and its automaton is smaller.
            at_once = isinstance(extent, Window) and extent.at_once
            before = not_b if at_once else _conjunction(a, not_b)
            return Negated(UntilReached(before, neither, extent))
        case Unary(UnaryOperator.NOT, operand):
            form = inner(operand)
            return StateFormula(path) if isinstance(form, StateFormula) else _negation(form)
        case Binary(operator, left, right) if operator.is_logical:
            one, other = inner(left), inner(right)
            if isinstance(one, StateFormula) and isinstance(other, StateFormula):
                return StateFormula(path)
            return Connected(operator, one, other)
        case Conditional(condition, then, otherwise):
            chosen, yes, no = inner(condition), inner(then), inner(otherwise)
            if all(isinstance(form, StateFormula) for form in (chosen, yes, no)):
                return StateFormula(path)
            return Connected(
                Operator.AND,
                Connected(Operator.IMPLIES, chosen, yes),
                Connected(Operator.OR, chosen, no),
            )
        case ExpressionNode():  # all other formulas are about one state
            return StateFormula(path)
        case _:
            assert_never(path)


def state_formulas(form: NormalForm) -> Iterator[Expression]:
    """The state formulas of a normal form, from left to right."""
    match form:
        case StateFormula(formula):
            yield formula
        case Negated(operand) | NextState(operand):
            yield from state_formulas(operand)
        case Connected(_, left, right) | UntilReached(left, right):
            yield from state_formulas(left)
            yield from state_formulas(right)
        case _:
            assert_never(form)


def only_window(extent: Extent) -> Window:
    """The extent as a time interval. Raises UnsupportedError for a bound on a reward."""
    if isinstance(extent, Window):
        return extent
    raise UnsupportedError(
        "a bound on a reward is supported for X, F, G, U, W and R over state formulas, checked "
        "numerically; not in formulas with several temporal operators, in A and E, or by simulation"
    )


_TRUE = StateFormula(Literal(True, Type.BOOL))


def _negation(form: NormalForm) -> NormalForm:
    match form:
        case Negated(operand):
            return operand
        case StateFormula(formula):
            return StateFormula(Unary(UnaryOperator.NOT, formula))
        case Connected() | NextState() | UntilReached():
            return Negated(form)
        case _:
            assert_never(form)


def _conjunction(left: NormalForm, right: NormalForm) -> NormalForm:
    if isinstance(left, StateFormula) and isinstance(right, StateFormula):
        return StateFormula(Binary(Operator.AND, left.formula, right.formula))
    return Connected(Operator.AND, left, right)


def _extent(bound: PathBound | None, model: BoundModel) -> Extent:
    match bound:
        case None | TimeBound():
            return window(bound)
        case RewardBound() | RewardBounds():
            return counts(bound, model)
        case _:
            assert_never(bound)
