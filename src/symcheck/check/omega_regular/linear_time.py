"""Path formulas with nested temporal operators, read as formulas over numbered atoms."""

from __future__ import annotations

from collections.abc import Mapping

from symcheck.automata.formula import LtlFormula
from symcheck.automata.ltl import LtlFactory
from symcheck.check.time_bounds import Steps, window
from symcheck.errors import UnsupportedError
from symcheck.syntax.ast import (
    Binary,
    Conditional,
    Eventually,
    Expression,
    Globally,
    Next,
    PathBound,
    PathFormula,
    Release,
    Unary,
    Until,
    WeakUntil,
)
from symcheck.syntax.operators import UnaryOperator, connect

__all__ = ["read"]

_STEPS = 2000
"""Largest bound on steps within a formula with nested operators."""


def read(
    factory: LtlFactory, path: PathFormula, atoms: Mapping[Expression, LtlFormula], *, timed: bool
) -> LtlFormula:
    """The path formula, given what its largest state formulas are.

    Raises UnsupportedError for bounds in continuous time (`timed`) and very large ones, InputError for wrong ones.
    """

    def inner(part: PathFormula) -> LtlFormula:
        return read(factory, part, atoms, timed=timed)

    if path in atoms:
        return atoms[path]  # type: ignore[index]
    match path:
        case Unary(UnaryOperator.NOT, operand):
            return factory.negation(inner(operand))
        case Binary(operator, left, right) if operator.is_logical:
            return connect(
                operator,
                inner(left),
                inner(right),
                conjunction=lambda a, b: factory.conjunction((a, b)),
                disjunction=lambda a, b: factory.disjunction((a, b)),
                negation=factory.negation,
            )
        case Conditional(condition, then, otherwise):
            return _choice(factory, inner(condition), inner(then), inner(otherwise))
        case Next(operand, bound):
            steps = _steps(bound, timed=timed)
            possible = steps.lower <= 1 and (steps.upper is None or steps.upper >= 1)
            return factory.next(inner(operand)) if possible else factory.false
        case Eventually(operand, bound):
            return _until(factory, factory.true, inner(operand), _steps(bound, timed=timed))
        case Globally(operand, bound):
            return _release(factory, factory.false, inner(operand), _steps(bound, timed=timed))
        case Until(left, right, bound):
            return _until(factory, inner(left), inner(right), _steps(bound, timed=timed))
        case Release(left, right, bound):
            return _release(factory, inner(left), inner(right), _steps(bound, timed=timed))
        case WeakUntil(left, right, bound):
            either = factory.disjunction((inner(left), inner(right)))
            return _release(factory, inner(right), either, _steps(bound, timed=timed))
        case _:
            raise AssertionError(f"not a path formula: {type(path).__name__}")


def _choice(
    factory: LtlFactory, condition: LtlFormula, then: LtlFormula, otherwise: LtlFormula
) -> LtlFormula:
    yes = factory.conjunction((condition, then))
    return factory.disjunction((yes, factory.conjunction((factory.negation(condition), otherwise))))


def _steps(bound: PathBound | None, *, timed: bool) -> Steps:
    times = window(bound)
    if timed and not times.trivial:
        raise UnsupportedError(
            "bounds on time in a path formula with nested or combined temporal operators are not supported in a ctmc; "
            "P=? [ F<=t a ] and alike, over state formulas, are"
        )
    steps = times.steps()
    if max(steps.lower, steps.upper or 0) > _STEPS:
        raise UnsupportedError(
            f"a bound of more than {_STEPS} steps in a path formula with nested operators is not supported"
        )
    return steps


def _until(factory: LtlFactory, left: LtlFormula, right: LtlFormula, steps: Steps) -> LtlFormula:
    """The formula left U[a,b] right: a steps within `left` first."""
    result = factory.until(left, right, None if steps.upper is None else steps.upper - steps.lower)
    for _ in range(steps.lower):
        result = factory.conjunction((left, factory.next(result)))
    return result


def _release(factory: LtlFactory, left: LtlFormula, right: LtlFormula, steps: Steps) -> LtlFormula:
    return factory.negation(_until(factory, factory.negation(left), factory.negation(right), steps))
