"""Comparing computed values with a threshold, so that no verdict is ever wrong.

Where the certified interval holds the threshold at a state that matters, the values are computed again with more
accuracy, and at last in rational arithmetic. A comparison that stays open raises NumericalError.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from symcheck.check.context import Context
from symcheck.engines.base import Engine, StateSet, Values
from symcheck.errors import NumericalError, SymcheckError

__all__ = ["EXACT_LIMIT", "decide"]

EXACT_LIMIT = 20_000
"""Models with more states are not explored again in rational arithmetic to settle a comparison."""

_REFINEMENTS = (1e-9, 1e-12)


def decide(
    context: Context,
    compute: Callable[[Context], Values],
    operator: str,
    threshold: Fraction | float,
    matter: StateSet,
    exactly: Callable[[], StateSet],
) -> StateSet:
    """The states at which `value operator threshold` holds; right at the states that matter, elsewhere where decided.

    `compute` gives the values at the accuracy of the context that it gets; `exactly` checks the comparison itself in rational
    arithmetic, if need be, and may raise SymcheckError.
    """
    tighter = (
        [e for e in _REFINEMENTS if e < context.options.epsilon] if context.options.certify else []
    )
    failure: SymcheckError | None = None
    sure, undecided = context.engine.none, matter
    for epsilon in (context.options.epsilon, *tighter):
        try:
            values = compute(context.with_epsilon(epsilon))
        except NumericalError as error:
            # More accuracy than the method reaches: rational arithmetic may still decide.
            failure = error
            break
        sure, undecided = values.compare(operator, threshold)
        if not undecided & matter:
            return sure
        if values.exact:
            break
    if failure is not None and undecided is matter:
        raise failure
    exact = _by_rationals(context.engine, exactly)
    if isinstance(exact, SymcheckError):
        raise _undecided(context, operator, threshold, undecided & matter, failure or exact)
    context.log.warn(
        "a threshold was too close to the value for floating point: decided by rational arithmetic"
    )
    return (sure - undecided) | (exact & undecided)


def _by_rationals(engine: Engine, exactly: Callable[[], StateSet]) -> StateSet | SymcheckError:
    """The states that satisfy the comparison, in rational arithmetic; or why it cannot be had."""
    if engine.exact:
        return NumericalError("the value is not a number")
    if engine.states > EXACT_LIMIT:
        return NumericalError(
            f"rational arithmetic is tried up to {EXACT_LIMIT:,} states, and this model has {engine.states:,}"
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
    return NumericalError(
        f"cannot tell whether the value is {operator} {float(threshold)!r}, for example in state {context.example(states)}: "
        f"the two are too close for the accuracy reached ({reason}); a method that is exact (-exact) may decide it"
    )
