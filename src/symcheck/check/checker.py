"""Check a property: its value in the initial states, its accuracy, and how it was computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import compress
from math import inf, isinf
from time import perf_counter
from typing import TYPE_CHECKING, assert_never

import numpy as np

from symcheck.check.context import CheckLog, Context
from symcheck.check.filters import AppliedFilter, Bounds, Condition, Numeric
from symcheck.check.omega_regular import ctl
from symcheck.check.property_notes import property_notes
from symcheck.check.result import (
    Accuracy,
    Answer,
    Certified,
    Estimate,
    Exact,
    Number,
    Result,
    SolverRun,
    Statistical,
    nearest_double,
)
from symcheck.check.state_formulas import applied_filter, path_of, satisfying, values_of
from symcheck.engines.base import Engine, StateSet, Values
from symcheck.engines.capabilities import RepresentsOrbits
from symcheck.engines.states import States, StateValues
from symcheck.errors import NumericalError, UnsupportedError, converts_memory_error
from symcheck.numerics.linear.problem import Observer, largest_width
from symcheck.numerics.tuning import ROUNDING_WIDTH
from symcheck.options import Options
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.expressions.rounding_notes import notes_about
from symcheck.semantics.model import BoundModel
from symcheck.semantics.model_warnings import property_warnings
from symcheck.semantics.path_formulas import negated
from symcheck.syntax.ast import (
    Equilibrium,
    Expression,
    Filter,
    MultiObjective,
    PathQuantifier,
    StateFilter,
    StateOperator,
    Type,
)
from symcheck.syntax.declarations import Property
from symcheck.tables import counted

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient
    from symcheck.check.bisimulation.quotient import Quotient
    from symcheck.check.certificate import Certificate
    from symcheck.check.counterexample import Counterexample
    from symcheck.engines.explicit.strategy import Strategy

__all__ = ["check"]


@converts_memory_error()
def check(
    engine: Engine,
    formula: Expression | Property,
    options: Options | None = None,
    *,
    labels: Mapping[str, Expression] | None = None,
    properties: Mapping[str, Expression] | None = None,
    observer: Observer | None = None,
    shared: SharedQuotient | None = None,
) -> Result:
    """Check a bound formula (names resolved, constants folded) on a built model.

    The result is the value in the initial state. If there are several, a bool is true if it is true
    in all of them, and a number is the pair of the lowest and the highest value. A filter as the
    outermost operator computes the result itself.

    Args:
        engine: the built model.
        formula: the formula, or a property whose formula is bound.
        options: how it is checked.
        labels: those of the properties file.
        properties: the named properties to which the formula may refer.
        observer: is told of each iteration of a numerical method, and may raise to end it.
        shared: a quotient for several formulas (`bisimulation.on_quotient.shared_quotient`), used
            with the option `bisim` if it preserves this formula.

    Raises:
        InputError: the formula refers to an unknown label, or a filter selects no state.
        UnsupportedError: the engine or method does not support the formula.
        NumericalError: the requested accuracy was not reached.
        ResourceError: a limit was reached.
    """
    started = perf_counter()
    if isinstance(formula, Property):
        formula = formula.formula
    log = CheckLog(warnings=list(engine.model.warnings))
    options = options or Options()
    if options.fairness and not engine.model.type.has_choices:  # only nature chooses, if any
        options = replace(options, fairness=False)
    context = Context(
        engine,
        options,
        labels or {},
        properties or {},
        log,
        formula,
        observer=observer,
    )
    kind = context.type(formula)
    if options.warn_unsatisfiable:
        for text in property_warnings(engine.model, formula):
            log.warn(text)
    if options.strategy and engine.model.type.has_choices:
        from symcheck.check.strategies.to_explicit import check_rows_fit, to_explicit

        check_rows_fit(
            engine,
            "a strategy, which has a choice for every state, needs",
            "without -exportstrat (strategy=True) the value is computed",
        )
        context = to_explicit(context)
        if options.bisim:
            log.warn("checked without -bisim: a strategy has a choice for every state")
            options = replace(options, bisim=False)
    lifted = _check_on_quotient(context, formula, kind, shared) if options.bisim else None
    if lifted is not None:
        result = lifted
    elif isinstance(formula, Filter | StateFilter):
        applied = applied_filter(context, formula, context.engine.initial)
        result = _filter_result(context, formula, applied, kind)
    elif isinstance(formula, MultiObjective):
        from symcheck.check.multi_objective.query import check_multi

        result = check_multi(context, formula)
    elif kind is Type.BOOL:
        result = _boolean(context, formula)
    else:
        result = _numeric(context, formula, kind)
    if isinstance(formula, Equilibrium):
        result = _with_objectives(context, result)
    if context.engine is not engine:
        result, engine = _lift_from_rows(result, context.engine, engine)
    if isinstance(formula, Filter | StateFilter) or not isinstance(formula, StateOperator):
        _warn_of_amplified_errors(context, result.accuracy)
    strategies = _strategies(context, formula) if options.strategy else ()
    return replace(
        result,
        strategies=strategies,
        no_strategy=log.no_strategy,
        lines=tuple(log.lines),
        runs=tuple(log.runs),
        warnings=tuple(log.warnings),
        witness_or_none=log.witness,
        notes=(
            *property_notes(engine.model, formula, result.value),
            *_rounding_notes(engine.model, formula),
        ),
        seconds=perf_counter() - started,
        engine=engine,
        explain=partial(_explanation, replace(context, log=CheckLog()), formula),
        certify=partial(_certificate, replace(context, log=CheckLog()), formula),
    )


def _rounding_notes(model: BoundModel, formula: Expression) -> tuple[str, ...]:
    """What rounding would change in the texts of a model and of a formula, so far as is known."""
    if model.is_rational:  # who asks for rationals does not compare with doubles
        return ()
    sources = {id(s): s for s in (model.program.span.source, formula.span.source)}
    return tuple(note for s in sources.values() for note in notes_about(s))


def _explanation(context: Context, formula: Expression, paths: int | None) -> Counterexample:
    from symcheck.check.explanation.find import find_counterexample

    return find_counterexample(context, formula, paths)


def _certificate(context: Context, formula: Expression) -> Certificate:
    from symcheck.check.certification import certify

    return certify(context, formula)


def _check_on_quotient(
    context: Context, formula: Expression, kind: Type, shared: SharedQuotient | None
) -> Result | None:
    """The result on the quotient, lifted to all states; None, with a warning, if there is none.

    A and E are checked without quotient: their search costs no more than a partition, and their
    witness is a path of the states of the model.
    """
    if isinstance(formula, PathQuantifier):
        return None
    from symcheck.check.bisimulation import on_quotient

    try:
        smaller = on_quotient.quotient(context, formula, shared)
        inner = context.on(smaller.engine)
        if isinstance(formula, Filter | StateFilter):
            applied = on_quotient.applied_filter(context, smaller, formula)
            result = _filter_result(context, formula, applied, kind)
        else:
            result = (
                _boolean(inner, formula) if kind is Type.BOOL else _numeric(inner, formula, kind)
            )
            result = _lift_result(result, smaller, context.engine)
    except (UnsupportedError, NumericalError) as error:
        context.log.warn(f"checked without -bisim: {error}")
        return None
    size = f"{counted(context.engine.states, 'state')} -> {smaller.engine.states}"
    text = f"bisimulation: {size}, {smaller.cost}"
    context.log.runs.insert(
        0, SolverRun("graph", "bisimulation", context.engine.states, smaller.rounds, text)
    )
    return replace(result, explanation=f"{result.explanation}; {size} by bisimulation")


def _lift_from_rows(result: Result, rows: Engine, engine: Engine) -> tuple[Result, Engine]:
    """A result on rows for the engine that they are those of, and this engine.

    Rows of a model that was built anew are not in its order, and keep the result.
    """
    from symcheck.check.bisimulation.quotient import Quotient
    from symcheck.engines.explicit.engine import ExplicitEngine
    from symcheck.engines.symbolic.engine import SymbolicEngine

    explicit, source = rows.capability(ExplicitEngine), rows.capability(SymbolicEngine)
    if explicit is None or source is None:
        return result, rows
    return _lift_states(result, Quotient.of_rows(explicit, source), engine), engine


def _lift_states(result: Result, smaller: Quotient, engine: Engine) -> Result:
    """A result with the values and sets of the quotient lifted to the states of the model."""
    if result.values_or_none is not None:
        lifted = StateValues(engine, smaller.lift(result.values.of_engine))
        result = replace(result, values_or_none=lifted)
    if result.satisfying_or_none is not None:
        satisfied = smaller.lift_set(result.satisfying.members)
        result = replace(result, satisfying_or_none=States(engine, satisfied))
    return result


def _lift_result(result: Result, smaller: Quotient, engine: Engine) -> Result:
    """A result on the quotient, lifted to the states of the model."""
    result = _lift_states(result, smaller, engine)
    if _initial_count(engine, engine.all) == 1:
        return result
    if result.satisfying_or_none is not None:
        return replace(result, explanation=_satisfied(engine, result.satisfying.members))
    value: Answer = result.value
    if isinstance(value, int | float | Fraction):
        value = value, value
    return replace(result, value=value, explanation=_range_over(engine))


def _warn_of_amplified_errors(context: Context, accuracy: Accuracy) -> None:
    """Warn if operators, such as a difference, have lost the accuracy of their operands."""
    if isinstance(accuracy, Certified) and not context.log.wide:
        lower, upper = np.array([accuracy.lower]), np.array([accuracy.upper])
        width = largest_width(lower, upper, context.options.relative)
        context.warn_if_wide(width, "the formula is less accurate than its operands")


def _strategies(context: Context, formula: Expression) -> tuple[Strategy, ...]:
    """Strategies that attain the value; none, with a warning, if they are not supported."""
    try:
        if isinstance(formula, MultiObjective):
            from symcheck.check.multi_objective.strategies import multi_strategies

            return multi_strategies(context, formula)
        from symcheck.check.strategies.strategy import strategy_of

        return (strategy_of(context, formula),)
    except UnsupportedError as error:
        context.log.no_strategy = str(error)
        context.log.warn(f"no strategy: {error}")
        return ()


def _boolean(context: Context, formula: Expression) -> Result:
    initial = context.engine.initial
    states = satisfying(
        context, formula, context.engine.all if context.options.everywhere else initial
    )
    result = _satisfied_result(context, states)
    if isinstance(formula, PathQuantifier):
        _explain(context, formula, initial <= states)
    return result


def _with_objectives(context: Context, result: Result) -> Result:
    """The result of an equilibrium, with the values of its objectives."""
    engine, found = context.engine, context.log.objectives
    text = result.explanation
    if _initial_count(engine, engine.all) == 1:
        text += ": " + " + ".join(format_value(v.minimum(engine.initial)[0]) for v in found)
    values = tuple(StateValues(engine, v) for v in found)
    return replace(result, objectives_or_none=values, explanation=text)


def _explain(context: Context, formula: PathQuantifier, value: bool) -> None:
    """Look for a path that shows why E holds, or why A does not."""
    if value == (formula.quantifier == "E"):
        path = path_of(context, formula)
        context.log.witness = ctl.witness(context, path if value else negated(path))


def _numeric(context: Context, formula: Expression, type: Type) -> Result:
    return _initially(context, values_of(context, formula, context.engine.initial), type)


def _initially(context: Context, values: Values, type: Type) -> Result:
    """The value in the initial state, or the range over several initial states."""
    initial, state_values = context.engine.initial, StateValues(context.engine, values)
    if _initial_count(context.engine, initial) == 1:
        single, accuracy = _answer(context, values.minimum(initial), values.rounded(initial), type)
        return Result(single, accuracy, "value in the initial state", values_or_none=state_values)
    value, accuracy = _range(
        context, (values.minimum(initial), values.maximum(initial)), values.rounded(initial), type
    )
    return Result(value, accuracy, _range_over(context.engine), values_or_none=state_values)


def _filter_result(
    context: Context, formula: Filter | StateFilter, applied: AppliedFilter, type: Type
) -> Result:
    """The result of a filter; that of the initial states if it has no single value (argmin)."""
    about = formula.operator if isinstance(formula, Filter) else "+".join(formula.operators)
    about = about or "state"  # P=? [ path {states} ]
    if type is Type.BOOL:
        condition = applied.condition()
        if condition.value is None:
            return _satisfied_result(context, condition.per_state)
        value, accuracy = _outcome(context, condition, type)
        return Result(
            value,
            accuracy,
            f"filter '{about}'",
            satisfying_or_none=States(context.engine, condition.per_state),
        )
    number = applied.number()
    if number.value is None:
        return _initially(context, number.per_state, type)
    value, accuracy = _outcome(context, number, type)
    values = StateValues(context.engine, number.per_state)
    return Result(value, accuracy, f"filter '{about}'", values_or_none=values)


def _satisfied_result(context: Context, states: StateSet) -> Result:
    """Whether the initial states satisfy a formula."""
    text = _satisfied(context.engine, states)
    satisfying = States(context.engine, states)
    return Result(context.engine.initial <= states, Exact(), text, satisfying_or_none=satisfying)


def _outcome(context: Context, outcome: Condition | Numeric, type: Type) -> tuple[Answer, Accuracy]:
    value = outcome.value
    if value is None or isinstance(value, bool):
        return value, Exact()
    if isinstance(value[0], tuple):
        return _range(context, value, outcome.rounded, type)
    return _answer(context, value, outcome.rounded, type)


def _range(
    context: Context,
    bounds: tuple[Bounds, Bounds],
    rounded: bool,
    type: Type,
) -> tuple[Answer, Accuracy]:
    ends = [_answer(context, b, rounded, type) for b in bounds]
    (low, first), (high, last) = ends
    accuracy = max(first, last, key=_weakness)
    if isinstance(accuracy, Exact) and accuracy.rounding:
        (lower, _), (_, upper) = (Result(*end).bounds for end in ends)
        accuracy = Exact(True, float(lower), float(upper))
    elif isinstance(accuracy, Certified):  # the other end may be further from the truth
        widest = max((Result(*end).bounds for end in ends), key=lambda b: b[1] - b[0])
        accuracy = Certified(*map(float, widest))
    return (low, high), accuracy


def _weakness(accuracy: Accuracy) -> float:
    """Less for a stronger statement."""
    match accuracy:
        case Exact(rounding):
            return -1.0 if rounding else -2.0
        case Certified():
            return accuracy.epsilon
        case Estimate() | Statistical():
            return inf
        case _:
            assert_never(accuracy)


def _answer(context: Context, bounds: Bounds, rounded: bool, type: Type) -> tuple[Number, Accuracy]:
    """A number between the bounds, and how accurate it is."""
    low, high = bounds
    if isinstance(low, Fraction) and type is not Type.INT and not context.engine.is_rational:
        return nearest_double(low)
    if low != low or high != high:  # NaN
        return float(low), Exact(rounding=rounded)
    if not all(r.certified for r in context.log.runs):
        return _middle(low, high), Estimate()
    if low != high:
        value = _middle(low, high)
        lower, upper = float(low), float(high)
        near = rounded and upper - lower <= ROUNDING_WIDTH * abs(float(value)) < inf
        return value, Exact(True, lower, upper) if near else Certified(lower, upper)
    if type is Type.INT and not isinf(low):
        return int(low), Exact()
    return float(low) if isinstance(low, int) else low, Exact()


def _middle(low: Number, high: Number) -> Number:
    if isinf(low) or isinf(high):
        return high if isinf(low) and not isinf(high) else low
    return low + (high - low) / 2


def _initial_count(engine: Engine, states: StateSet) -> int:
    """How many initial states are in a set, counting all that a representative stands for."""
    represents = engine.capability(RepresentsOrbits)
    whole = None if represents is None else represents.represented
    if whole is None:
        return (states & engine.initial).count
    members = engine.to_bools(states)[engine.to_bools(engine.initial)].tolist()
    return sum(compress(whole.initial_orbits, members))


def _range_over(engine: Engine) -> str:
    return f"range of values over {_initial_count(engine, engine.all)} initial states"


def _satisfied(engine: Engine, states: StateSet) -> str:
    """In how many of the initial states a formula holds."""
    count, initial = _initial_count(engine, states), _initial_count(engine, engine.all)
    if initial == 1:
        return "satisfied in the initial state" if count else "not satisfied in the initial state"
    share = "all" if count == initial else count or "none"
    return f"satisfied in {share} of {initial} initial states"
