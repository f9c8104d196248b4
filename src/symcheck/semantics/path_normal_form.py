"""The normal form of path formulas: state formulas, negation, logical operators, next and until.

A normal form is generic in its leaves: state formulas, or numbers of them. The dualities are
applied only here: F a = true U a, G a = !(true U !a), a R b = !(!a U !b),
a W b = !((a & !b) U (!a & !b)), each with its bound.
Source: Baier & Katoen (2008), 5.1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Generic, TypeVar, assert_never

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
    "reward_bound_refused",
    "state_formulas",
    "with_leaves",
]

L = TypeVar("L")
M = TypeVar("M")

Extent = Window | tuple[RewardWindow, ...]
"""The times at which a target must be reached, or the rewards that may accumulate until then."""


@dataclass(frozen=True, slots=True)
class StateFormula(Generic[L]):
    """The first state satisfies a formula."""

    formula: L


@dataclass(frozen=True, slots=True)
class Negated(Generic[L]):
    """The path does not satisfy `operand`."""

    operand: NormalForm[L]


@dataclass(frozen=True, slots=True)
class Connected(Generic[L]):
    """A logical operator between path formulas."""

    operator: Operator
    left: NormalForm[L]
    right: NormalForm[L]


@dataclass(frozen=True, slots=True)
class NextState(Generic[L]):
    """The suffix from the second state satisfies `operand`, and the step is within the extent."""

    operand: NormalForm[L]
    extent: Extent


@dataclass(frozen=True, slots=True)
class UntilReached(Generic[L]):
    """`right` holds at a time within the extent, and `left` at all times before."""

    left: NormalForm[L]
    right: NormalForm[L]
    extent: Extent


NormalForm = StateFormula[L] | Negated[L] | Connected[L] | NextState[L] | UntilReached[L]


def normal_form(path: PathFormula, model: BoundModel) -> NormalForm[Expression]:
    """The normal form of a bound path formula.

    Raises:
        InputError: a bound is negative or cannot be satisfied.

    Source: Baier & Katoen (2008), 5.1.
    """

    def inner(part: PathFormula) -> NormalForm[Expression]:
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
            contains_zero = isinstance(extent, Window) and extent.contains_zero
            before = not_b if contains_zero else _conjunction(a, not_b)
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


def state_formulas(form: NormalForm[L]) -> Iterator[L]:
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


def with_leaves(form: NormalForm[L], leaf: Callable[[L], M]) -> NormalForm[M]:
    """The normal form with `leaf` of each state formula in its place."""
    match form:
        case StateFormula(formula):
            return StateFormula(leaf(formula))
        case Negated(operand):
            return Negated(with_leaves(operand, leaf))
        case Connected(operator, left, right):
            return Connected(operator, with_leaves(left, leaf), with_leaves(right, leaf))
        case NextState(operand, extent):
            return NextState(with_leaves(operand, leaf), extent)
        case UntilReached(left, right, extent):
            return UntilReached(with_leaves(left, leaf), with_leaves(right, leaf), extent)
        case _:
            assert_never(form)


def reward_bound_refused() -> UnsupportedError:
    """The error of a bound on a reward where only bounds on time are supported."""
    return UnsupportedError(
        "a bound on a reward is supported for X, F, G, U, W and R over state formulas, checked "
        "numerically; not in formulas with several temporal operators, in A and E, or by simulation"
    )


_TRUE: StateFormula[Expression] = StateFormula(Literal(True, Type.BOOL))


def _negation(form: NormalForm[Expression]) -> NormalForm[Expression]:
    match form:
        case Negated(operand):
            return operand
        case StateFormula(formula):
            return StateFormula(Unary(UnaryOperator.NOT, formula))
        case Connected() | NextState() | UntilReached():
            return Negated(form)
        case _:
            assert_never(form)


def _conjunction(
    left: NormalForm[Expression], right: NormalForm[Expression]
) -> NormalForm[Expression]:
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
