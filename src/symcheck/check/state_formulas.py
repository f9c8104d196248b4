"""Recursive evaluation of formulas: their satisfying states, or their values at each state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.expression_values import expression_values, in_doubles
from symcheck.check.filters import AppliedFilter
from symcheck.check.omega_regular import ctl
from symcheck.check.path_formulas import StatesOf, resolve
from symcheck.check.queries.path_probabilities import probability, qualitative
from symcheck.check.queries.rewards import expected_time, reward_of, reward_values
from symcheck.check.queries.steady_state import steady_values
from symcheck.check.rebind_exact import exact_twin
from symcheck.check.thresholds import decide
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.errors import Diagnostic, InputError, UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.semantics.expressions.evaluate import evaluate_constant
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    Bound,
    Call,
    Conditional,
    ConditionalProbability,
    ExpectedTime,
    Expression,
    Filter,
    FilterOperator,
    LabelReference,
    Literal,
    Measure,
    MultiObjective,
    Name,
    PathQuantifier,
    ProbabilityOperator,
    Quantile,
    RewardOperator,
    StateFilter,
    StateOperator,
    SteadyState,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator, connect

__all__ = [
    "applied_filter",
    "is_plain",
    "modern_filter",
    "numbers",
    "satisfying",
    "states_of",
    "threshold_of",
]


def is_plain(expression: Expression) -> bool:
    """Whether a formula is an expression over variables only, which an engine can evaluate."""
    match expression:
        case Literal() | Name():
            return True
        case Unary(_, operand):
            return is_plain(operand)
        case Binary(_, left, right):
            return is_plain(left) and is_plain(right)
        case Conditional(condition, then, otherwise):
            return is_plain(condition) and is_plain(then) and is_plain(otherwise)
        case Call(_, arguments):
            return all(is_plain(a) for a in arguments)
        case LabelReference() | StateOperator():
            return False
        case _:
            assert_never(expression)


def satisfying(context: Context, formula: Expression, relevant: StateSet) -> StateSet:
    """The states that satisfy a boolean formula; right at the states that `matter`.

    Raises NumericalError where a comparison cannot be decided at such a state, UnsupportedError and
    InputError.
    """
    if is_plain(formula):
        return context.engine.where(formula)
    here = partial(satisfying, context, relevant=relevant)
    match formula:
        case Unary(UnaryOperator.NOT, operand):
            return ~here(operand)
        case Binary(operator, left, right) if operator.is_logical:
            return connect(operator, here(left), here(right))
        case Binary() if formula.operator.is_comparison:
            return _comparison(context, formula, relevant)
        case Conditional(condition, then, otherwise):
            chosen = here(condition)
            return (chosen & here(then)) | (here(otherwise) - chosen)
        case LabelReference():
            return _reference(context, formula, relevant)
        case Measure(_, Bound() as bound):
            return _bounded(context, formula, bound, relevant)
        case PathQuantifier(quantifier, path):
            read = resolve(path, states_of(context), context.engine)
            return ctl.forall(context, read) if quantifier == "A" else ctl.exists(context, read)
        case Filter() | StateFilter():
            return applied_filter(context, formula, relevant).condition().per_state
        case MultiObjective():
            raise _no_multi()
        case Literal() | Name() | Unary() | Binary() | Call() | Measure() | Quantile():
            raise _wrong_type(formula, "a number, not a condition")
        case _:
            assert_never(formula)


def numbers(context: Context, formula: Expression, relevant: StateSet) -> Values:
    """The value of a numeric formula at each state, within the requested accuracy."""
    if is_plain(formula):
        known = expression_values(context, formula)
        if known is not None:
            return known
    here = partial(numbers, context, relevant=relevant)
    context = context.relevant_at(relevant)
    match formula:
        case Unary(UnaryOperator.MINUS, operand):
            return here(operand).map("-")
        case Binary(operator, left, right):
            return _applied(context, operator, [here(left), here(right)])
        case Call(function, (first, *others)):
            return _applied(context, function, [here(a) for a in (first, *others)])
        case Conditional(condition, then, otherwise):
            return here(then).choose(satisfying(context, condition, relevant), here(otherwise))
        case LabelReference():
            return numbers(context.inside(formula), context.referred(formula), relevant)
        case Measure():
            values = _measured(context, formula, _direction(context, formula, None))(context)
            return _clipped(context, values) if formula.is_probability else values
        case Filter() | StateFilter():
            return applied_filter(context, formula, relevant).number().per_state
        case Quantile():
            from symcheck.check.queries.quantile import quantile

            return quantile(context, formula, satisfying, relevant)
        case MultiObjective():
            raise _no_multi()
        case Literal() | Name() | Unary() | Call() | PathQuantifier():
            raise _wrong_type(formula, "a condition, not a number")
        case _:
            assert_never(formula)


def _applied(context: Context, operator: Operator | Function, operands: Sequence[Values]) -> Values:
    """The values of an operator or function; those that may be irrational are doubles."""
    if operator in (Operator.POWER, Function.POW, Function.LOG):
        operands = [in_doubles(context.engine, v) for v in operands]
    return operands[0].map(operator, *operands[1:])


def _clipped(context: Context, values: Values) -> Values:
    """Probabilities with bounds limited to [0, 1]."""
    if values.minimum(context.engine.all)[0] < 0:
        values = values.map("max", 0)
    return values.map("min", 1) if values.maximum(context.engine.all)[1] > 1 else values


def states_of(context: Context) -> StatesOf:
    """A function from formulas to their states, for formulas within an operator."""
    inner = context.without_strategy()

    def find(formula: Expression) -> StateSet:
        return context.once((formula,), lambda: satisfying(inner, formula, inner.engine.all))

    return find


def applied_filter(
    context: Context, formula: Filter | StateFilter, relevant: StateSet
) -> AppliedFilter:
    """A filter on the states of the engine; its formula is also right at the states that matter."""
    node = formula if isinstance(formula, Filter) else modern_filter(formula)
    states = context.engine.all if node.states is None else states_of(context)(node.states)
    also = states | relevant if node.operator in ("print", "printall") else states
    return AppliedFilter(
        context,
        node,
        states,
        lambda f: satisfying(context, f, also),
        lambda f: numbers(context, f, also),
        partial(_exactly, context, formula, also),
    )


def modern_filter(formula: StateFilter) -> Filter:
    """The newer form of `P=? [ path {states}{min}{max} ]`."""
    operators = formula.operators
    operator: FilterOperator = (
        "range" if len(set(operators)) == 2 else next(iter(operators), "state")
    )
    return Filter(operator, formula.formula, formula.states, span=formula.span)


def _reference(context: Context, reference: LabelReference, relevant: StateSet) -> StateSet:
    if reference.name == "init":
        return context.engine.initial
    if reference.name == "deadlock":
        return context.engine.deadlocks
    return satisfying(context.inside(reference), context.referred(reference), relevant)


def _comparison(context: Context, formula: Binary, relevant: StateSet) -> StateSet:
    left, right = formula.left, formula.right
    if context.type(left) is Type.BOOL:
        both = satisfying(context, left, relevant), satisfying(context, right, relevant)
        same = connect(Operator.IFF, *both)
        return same if formula.operator is Operator.EQ else ~same
    if isinstance(right, Literal):
        threshold = Fraction(right.value)
        return decide(
            context,
            lambda c: numbers(c, left, relevant),
            formula.operator.value,
            threshold,
            relevant,
            partial(_exactly, context, formula, relevant),
        )

    def difference(c: Context) -> Values:
        return numbers(c, left, relevant).map("-", numbers(c, right, relevant))

    return decide(
        context,
        difference,
        formula.operator.value,
        0,
        relevant,
        partial(_exactly, context, formula, relevant),
    )


def _bounded(context: Context, formula: AnyMeasure, bound: Bound, relevant: StateSet) -> StateSet:
    """The states that satisfy a measure with a bound, by graph analysis where it decides."""
    operator, threshold = bound.operator.value, threshold_of(bound)
    direction = _direction(context, formula, operator)
    compute: Callable[[Context], Values]
    if isinstance(formula, ProbabilityOperator):
        path = resolve(formula.path, states_of(context), context.engine)
        by_graph = qualitative(context.relevant_at(relevant), path, operator, threshold, direction)
        if by_graph is not None:
            return by_graph
        compute = partial(probability, path=path, direction=direction)
    else:
        compute = _measured(context, formula, direction)
    exactly = partial(_exactly, context, formula, relevant)
    return decide(context.relevant_at(relevant), compute, operator, threshold, relevant, exactly)


def _measured(
    context: Context, formula: AnyMeasure, direction: Direction | None
) -> Callable[[Context], Values]:
    """How to compute the values of a measure, with the accuracy of a context."""
    match formula:
        case ProbabilityOperator(_, _, path):
            read = resolve(path, states_of(context), context.engine)
            return lambda c: probability(c, read, direction)
        case ConditionalProbability():
            from symcheck.check.queries.conditional import conditional_probability

            return lambda c: conditional_probability(
                c, formula, states_of(c), direction, partial(_by_rationals, c, formula, direction)
            )
        case ExpectedTime(_, _, path):
            return lambda c: expected_time(c, path, states_of(c), direction)
        case RewardOperator():
            reward = reward_of(context, formula)
            return lambda c: reward_values(c, formula, reward, states_of(c), direction)
        case SteadyState(_, _, inner):
            states = states_of(context)(inner)
            return lambda c: steady_values(c, states, direction)
        case _:
            assert_never(formula)


def _exactly(context: Context, formula: Expression, relevant: StateSet) -> StateSet:
    """The states that satisfy a part of the checked formula in rational arithmetic.

    It is right at the states that matter.

    Raises UnsupportedError where the formula cannot be evaluated exactly.
    """
    exact, twin = exact_twin(context, formula)
    states = exact.engine.from_bools(context.engine.to_bools(relevant))
    return context.engine.from_bools(exact.engine.to_bools(satisfying(exact, twin, states)))


def _by_rationals(
    context: Context,
    formula: ConditionalProbability,
    direction: Direction | None,
    states: StateSet,
) -> Numbers:
    """A conditional probability at some states in rational arithmetic, in their order.

    Raises UnsupportedError where the formula cannot be evaluated exactly.
    """
    from symcheck.check.queries.conditional import conditional_probability

    exact, twin = exact_twin(context, formula)
    members = exact.engine.from_bools(context.engine.to_bools(states))
    assert isinstance(twin, ConditionalProbability)
    values = conditional_probability(exact.relevant_at(members), twin, states_of(exact), direction)
    return values.at(members)[0]


def threshold_of(bound: Bound) -> Fraction:
    """The threshold of a bound. Raises InputError if it is infinite."""
    value = evaluate_constant(bound.threshold)
    if isinstance(value, float):
        raise InputError(
            Diagnostic("a threshold must be a finite number", bound.threshold.span, "threshold")
        )
    return Fraction(value)


def _direction(context: Context, formula: Measure, operator: str | None) -> Direction | None:
    """The direction of an operator; None if the model has no choices.

    A bound without a direction must hold under all strategies.
    """
    if not context.engine.model.type.has_choices:
        return None
    given, letter = formula.direction, formula.letter
    if given in ("min", "max"):
        return Direction(given)
    if given is not None:
        raise UnsupportedError(
            f"{letter}{given} is not supported on an mdp; {letter}min and {letter}max are"
        )
    if operator is None:
        message = f"{letter}=? has no single value in an mdp"
        raise InputError(
            Diagnostic(message, formula.span, "direction", f"use {letter}min=? or {letter}max=?")
        )
    return Direction.MIN if operator in (">", ">=") else Direction.MAX


def _wrong_type(formula: Expression, actual: str) -> InputError:
    return InputError(Diagnostic(f"this formula is {actual}", formula.span, "type"))


def _no_multi() -> UnsupportedError:
    return UnsupportedError(
        "multi(...) is supported as a property of its own, not within a formula or a filter"
    )
