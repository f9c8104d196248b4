"""Recursive evaluation of formulas: their satisfying states, or their values at each state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.exact_twin import exact_twin
from symcheck.check.expression_values import expression_values, in_doubles
from symcheck.check.filters import AppliedFilter
from symcheck.check.omega_regular import ctl
from symcheck.check.queries.path_probabilities import qualitative
from symcheck.check.queries.values import against_nature, values
from symcheck.check.thresholds import decide
from symcheck.engines.base import StateSet, Values
from symcheck.errors import NO_SPAN, Diagnostic, InputError, UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.semantics.features import Feature, require
from symcheck.semantics.path_formulas import PathFormula, over_leaves, path_formula
from symcheck.semantics.query import PathProbability, Query, threshold_of
from symcheck.semantics.query import query_of as resolve
from symcheck.syntax.ast import (
    AnyMeasure,
    Binary,
    Bound,
    Call,
    Conditional,
    Equilibrium,
    Expression,
    Filter,
    FilterOperator,
    LabelReference,
    Literal,
    Measure,
    MultiObjective,
    Name,
    PathQuantifier,
    Quantile,
    StateFilter,
    StateOperator,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator, connect

__all__ = [
    "applied_filter",
    "is_plain",
    "modern_filter",
    "path_of",
    "query_of",
    "satisfying",
    "states_of",
    "values_of",
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
    """The states that satisfy a boolean formula; right at the `relevant` states.

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
        case Measure(_, Bound()):
            return _bounded(context, formula, relevant)
        case PathQuantifier():
            path = path_of(context, formula)
            return (ctl.forall if formula.quantifier == "A" else ctl.exists)(context, path)
        case Equilibrium(bound=Bound() as bound):
            threshold = threshold_of(bound)
            return decide(
                context,
                lambda c: _around(c, _equilibrium(c, formula, relevant)),
                threshold.operator.value,
                threshold.value,
                relevant,
                partial(_exactly, context, formula, relevant),
            )
        case Filter() | StateFilter():
            return applied_filter(context, formula, relevant).condition().per_state
        case MultiObjective():
            raise _no_multi()
        case Measure() | Equilibrium() | Quantile() | Literal() | Name():
            raise _wrong_type(formula, "a number, not a condition")
        case Unary() | Binary() | Call():
            raise _wrong_type(formula, "a number, not a condition")
        case _:
            assert_never(formula)


def values_of(context: Context, formula: Expression, relevant: StateSet) -> Values:
    """The value of a numeric formula at each state, within the requested accuracy."""
    if is_plain(formula):
        known = expression_values(context, formula)
        if known is not None:
            return known
    here = partial(values_of, context, relevant=relevant)
    context = context.relevant_at(relevant)
    match formula:
        case Unary(UnaryOperator.MINUS, operand):
            return here(operand).map(UnaryOperator.MINUS)
        case Binary(operator, left, right):
            return _applied(context, operator, [here(left), here(right)])
        case Call(function, (first, *others)):
            return _applied(context, function, [here(a) for a in (first, *others)])
        case Conditional(condition, then, otherwise):
            return here(then).choose(satisfying(context, condition, relevant), here(otherwise))
        case LabelReference():
            return values_of(context.inside(formula), context.referred(formula), relevant)
        case Measure():
            query = query_of(context, formula)
            if context.engine.model.type.partially_observed:
                from symcheck.check.beliefs.values import belief_values

                return belief_values(context, formula, query)
            found = values(context, query, partial(_rationals, context, formula))
            return _clipped(context, found) if formula.is_probability else found
        case Filter() | StateFilter():
            return applied_filter(context, formula, relevant).number().per_state
        case Equilibrium():
            return _equilibrium(context, formula, relevant)
        case Quantile():
            require(context.engine.model, Feature.QUANTILES)
            from symcheck.check.queries.quantile import quantile

            return quantile(context, formula, satisfying, relevant)
        case MultiObjective():
            raise _no_multi()
        case Literal() | Name() | Unary() | Call() | PathQuantifier():
            raise _wrong_type(formula, "a condition, not a number")
        case _:
            assert_never(formula)


_LEAST_MARGIN = 1e-9
"""Estimates decide no threshold that is nearer to them, whatever accuracy is asked for."""


def _equilibrium(context: Context, formula: Equilibrium, relevant: StateSet) -> Values:
    """The sum of the objectives of an equilibrium; logs the value of each."""
    require(context.engine.model, Feature.EQUILIBRIA)
    from symcheck.check.queries.equilibria import equilibrium_values

    queries = [query_of(context, objective) for objective in formula.objectives]
    found = equilibrium_values(context.relevant_at(relevant), formula, queries)
    context.log.objectives = tuple(found)
    return found[0].map(Operator.PLUS, found[1])


def _around(context: Context, estimates: Values) -> Values:
    """What a threshold is compared with: one that is near to an estimate is not decided."""
    engine = context.engine
    values, _ = estimates.at(engine.all)
    margin = max(context.options.epsilon, _LEAST_MARGIN) * np.maximum(1.0, np.abs(values))
    return engine.system(engine.all).lift(values - margin, values + margin)


def _applied(context: Context, operator: Operator | Function, operands: Sequence[Values]) -> Values:
    """The values of an operator or function; those that may be irrational are doubles."""
    if not (operator.is_total or operator in (Operator.DIVIDE, Function.MOD)):
        operands = [in_doubles(context.engine, v) for v in operands]
    return operands[0].map(operator, *operands[1:])


def _clipped(context: Context, values: Values) -> Values:
    """Probabilities with bounds limited to [0, 1]; if rounded, from 0, so that 1 is a middle."""
    if context.engine.model.parameters:
        return values
    if values.minimum(context.engine.all)[0] < 0:
        values = values.map(Function.MAX, 0)
    if values.maximum(context.engine.all)[1] <= 1 or values.rounded(context.engine.all):
        return values
    return values.map(Function.MIN, 1)


def states_of(context: Context) -> Callable[[Expression], StateSet]:
    """A function from formulas to their states, for formulas within an operator.

    Each formula is evaluated once, and operators that the normal form of a path formula adds are
    operations on sets.
    """
    known: dict[Expression, StateSet] = {}

    def find(formula: Expression) -> StateSet:
        if formula not in known:
            match formula:
                case Unary(UnaryOperator.NOT, operand):
                    known[formula] = ~find(operand)
                case Binary(operator, left, right) if (
                    operator.is_logical and formula.span is NO_SPAN
                ):
                    known[formula] = connect(operator, find(left), find(right))
                case _:
                    known[formula] = satisfying(context, formula, context.engine.all)
        return known[formula]

    return find


def path_of(context: Context, formula: PathQuantifier) -> PathFormula[StateSet]:
    """The path formula of A or E over the sets of the engine."""
    require(context.engine.model, Feature.SOME_OR_ALL_PATHS)
    return over_leaves(path_formula(formula.path, context.engine.model), states_of(context))


def applied_filter(
    context: Context, formula: Filter | StateFilter, relevant: StateSet
) -> AppliedFilter:
    """A filter on the states of the engine; its formula is also right at relevant states."""
    node = formula if isinstance(formula, Filter) else modern_filter(formula)
    states = context.engine.all if node.states is None else states_of(context)(node.states)
    also = states | relevant if node.operator in ("print", "printall") else states
    return AppliedFilter(
        context,
        node,
        states,
        lambda f: satisfying(context, f, also),
        lambda f: values_of(context, f, also),
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
    threshold = Fraction(right.value if isinstance(right, Literal) else 0)

    def compared(c: Context) -> Values:
        found = values_of(c, left, relevant)
        if isinstance(right, Literal):
            return found
        return found.map(Operator.MINUS, values_of(c, right, relevant))

    exactly = partial(_exactly, context, formula, relevant)
    return decide(context, compared, formula.operator.value, threshold, relevant, exactly)


def query_of(context: Context, formula: AnyMeasure) -> Query[StateSet]:
    """What a measure asks for, over the sets of the engine.

    Raises:
        InputError, UnsupportedError: see `symcheck.semantics.query.query_of`.
        UnsupportedError: the quantity is not defined over fair strategies, which are asked for.
    """
    query = resolve(formula, context.engine.model)
    quantity, direction = query.quantity, query.direction
    if context.options.fairness:
        require(context.engine.model, Feature.FAIRNESS)
    if context.options.fairness and direction not in (None, *quantity.fair_directions):
        raise UnsupportedError(
            f"{quantity.called} over fair strategies only are not supported; without -fair they are"
        )
    return context.once((formula,), lambda: query.over(states_of(context.without_strategy())))


def _bounded(context: Context, formula: AnyMeasure, relevant: StateSet) -> StateSet:
    """The states that satisfy a measure with a bound, by graph analysis where it decides."""
    query = query_of(context, formula)
    threshold = query.threshold
    assert threshold is not None
    context = context.relevant_at(relevant)
    if context.engine.model.type.partially_observed:
        from symcheck.check.beliefs.values import decided_by_beliefs

        return decided_by_beliefs(context, formula, query, relevant)
    quantity = query.quantity
    if isinstance(quantity, PathProbability) and context.concurrent_game(query) is None:
        inner, towards = against_nature(context, query)
        playing, direction = inner.playing(towards)
        by_graph = qualitative(playing, quantity.path, threshold, direction)
        if by_graph is not None:
            return by_graph
    return decide(
        context,
        lambda c: values(c, query, partial(_rationals, c, formula)),
        threshold.operator.value,
        threshold.value,
        relevant,
        partial(_exactly, context, formula, relevant),
    )


def _exactly(context: Context, formula: Expression, relevant: StateSet) -> StateSet:
    """The states that satisfy a part of the checked formula in rational arithmetic.

    It is right at the relevant states.

    Raises UnsupportedError where the formula cannot be evaluated exactly.
    """
    exact = exact_twin(context)
    states = exact.engine.from_bools(context.engine.to_bools(relevant))
    return context.engine.from_bools(exact.engine.to_bools(satisfying(exact, formula, states)))


def _rationals(context: Context, formula: AnyMeasure, states: StateSet) -> Numbers:
    """The values of a measure at some states in rational arithmetic, in their order.

    Raises UnsupportedError where the formula cannot be evaluated exactly.
    """
    exact = exact_twin(context)
    members = exact.engine.from_bools(context.engine.to_bools(states))
    return values(exact.relevant_at(members), query_of(exact, formula)).at(members)[0]


def _wrong_type(formula: Expression, actual: str) -> InputError:
    return InputError(Diagnostic(f"this formula is {actual}", formula.span, "type"))


def _no_multi() -> UnsupportedError:
    return UnsupportedError(
        "multi(...) is supported as a property of its own, not within a formula or a filter"
    )
