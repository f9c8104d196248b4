"""Translation of path formulas with nested temporal operators to LTL formulas over atoms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never

from symcheck.automata.formula import LtlFormula
from symcheck.automata.ltl import LtlFactory
from symcheck.check import tuning
from symcheck.errors import UnsupportedError
from symcheck.semantics.path_normal_form import (
    Connected,
    Extent,
    Negated,
    NextState,
    NormalForm,
    StateFormula,
    UntilReached,
    reward_bound_refused,
)
from symcheck.semantics.time_bounds import StepRange, Window
from symcheck.syntax.operators import connect

__all__ = ["read"]


def read(
    factory: LtlFactory,
    form: NormalForm[int],
    atoms: Sequence[LtlFormula],
    *,
    timed: bool,
) -> LtlFormula:
    """The LTL formula of a normal form.

    Args:
        factory: makes the formulas.
        form: the normal form, over the numbers of atoms.
        atoms: their LTL formulas.
        timed: bounds are in continuous time.

    Raises:
        UnsupportedError: there are bounds on rewards, in continuous time, or on too many steps.
        InputError: a bound on steps is not an integer.
    """

    def inner(part: NormalForm[int]) -> LtlFormula:
        return read(factory, part, atoms, timed=timed)

    match form:
        case StateFormula(number):
            return atoms[number]
        case Negated(operand):
            return factory.negation(inner(operand))
        case Connected(operator, left, right):
            return connect(
                operator,
                inner(left),
                inner(right),
                conjunction=lambda a, b: factory.conjunction((a, b)),
                disjunction=lambda a, b: factory.disjunction((a, b)),
                negation=factory.negation,
            )
        case NextState(operand, extent):
            steps = _steps(extent, timed=timed)
            possible = steps.lower <= 1 and (steps.upper is None or steps.upper >= 1)
            return factory.next(inner(operand)) if possible else factory.false
        case UntilReached(left, right, extent):
            return _until(factory, inner(left), inner(right), _steps(extent, timed=timed))
        case _:
            assert_never(form)


def _steps(extent: Extent, *, timed: bool) -> StepRange:
    if not isinstance(extent, Window):
        raise reward_bound_refused()
    if timed and not extent.is_unbounded:
        raise UnsupportedError(
            "bounds on time in a path formula with nested or combined temporal operators are not "
            "supported in continuous time; "
            "P=? [ F<=t a ] and alike, over state formulas, are"
        )
    steps = extent.steps()
    if max(steps.lower, steps.upper or 0) > tuning.NESTED_STEPS:
        raise UnsupportedError(
            f"a bound of more than {tuning.NESTED_STEPS} steps in a path formula with nested "
            "operators is not supported"
        )
    return steps


def _until(
    factory: LtlFactory, left: LtlFormula, right: LtlFormula, steps: StepRange
) -> LtlFormula:
    """The formula `left U[a,b] right`: a steps in `left`, then `left U<=b-a right`."""
    result = factory.until(left, right, None if steps.upper is None else steps.upper - steps.lower)
    for _ in range(steps.lower):
        result = factory.conjunction((left, factory.next(result)))
    return result
