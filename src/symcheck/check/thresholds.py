"""Comparison of computed values with a threshold: the verdict is proved or an error.

If the certified interval of a relevant state contains the threshold, the values are computed again
with higher accuracy, and finally in rational arithmetic. A comparison that remains undecided raises
NumericalError.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.engines.base import Engine, StateSet, Values
from symcheck.errors import NumericalError, SymcheckError, UnsupportedError
from symcheck.numerics import rational_limits
from symcheck.semantics.features import Feature, offers

__all__ = ["by_rationals", "decide"]


def decide(
    context: Context,
    compute: Callable[[Context], Values],
    operator: str,
    threshold: Fraction | float,
    relevant: StateSet,
    exactly: Callable[[], StateSet],
) -> StateSet:
    """The states in which `value operator threshold` holds.

    Args:
        context: the requested accuracy.
        compute: gives the values, at the accuracy of its context.
        operator: <, <=, >, >=, = or !=.
        threshold: a rational, or a double that is infinite.
        relevant: the states at which the verdict has to be proved; at others, an undecided
            comparison counts as false.
        exactly: gives the states that satisfy the comparison, by rational arithmetic; may raise
            SymcheckError.

    Raises:
        NumericalError: the comparison is undecided in a relevant state.
    """
    options = context.options
    finer = tuning.REFINED_ACCURACIES if options.certify else ()
    tighter = [e for e in finer if e < options.epsilon]
    failure: SymcheckError | None = None
    sure, undecided = context.engine.none, relevant
    for epsilon in (options.epsilon, *tighter):
        try:
            values = compute(context.with_epsilon(epsilon))
        except (NumericalError, UnsupportedError) as error:
            # The method does not reach this accuracy, or what it adds up for it is beyond doubles:
            # rational arithmetic may still decide.
            failure = error
            break
        if context.engine.model.parameters:  # each comparison of functions is a condition
            values = values.choose(relevant, context.engine.constant(0))
        sure, undecided = values.compare(operator, threshold)
        if not undecided & relevant:
            return sure
        if values.rounded(undecided & relevant):  # a smaller epsilon changes nothing
            break
    if failure is not None and undecided is relevant:
        raise failure
    exact = by_rationals(context.engine, exactly)
    if isinstance(exact, SymcheckError):
        raise _undecided(context, operator, threshold, undecided & relevant, failure or exact)
    context.log.warn(
        "a threshold was too close to the value for floating point: decided by rational arithmetic"
    )
    return (sure - undecided) | (exact & undecided)


def by_rationals(engine: Engine, exactly: Callable[[], StateSet]) -> StateSet | SymcheckError:
    """The states that satisfy the comparison by rational arithmetic, or the reason why not."""
    if engine.is_rational:
        return NumericalError("the value is not a number")
    if engine.states > rational_limits.STATES:
        return NumericalError(
            f"rational arithmetic is tried up to {rational_limits.STATES:,} states, "
            f"and this model has {engine.states:,}"
        )
    try:
        return exactly()
    except SymcheckError as error:
        return error


def _undecided(
    context: Context,
    operator: str,
    threshold: Fraction | float,
    states: StateSet,
    reason: SymcheckError,
) -> NumericalError:
    engine = context.engine
    untried = engine.states > rational_limits.STATES and not engine.is_rational
    if untried and offers(engine.model, Feature.RATIONALS):
        hint = "-exact computes with rational numbers"
    else:
        hint = "=? in place of the bound gives the value with its accuracy"
    return NumericalError(
        f"cannot decide whether the value is {operator} {float(threshold)!r}, for example in state "
        f"{context.example(states)}: the two are too close for the accuracy reached "
        f"({reason.message})",
        hint=hint,
    )
