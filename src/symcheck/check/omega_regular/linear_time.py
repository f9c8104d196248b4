"""Path formulas with nested temporal operators, read as formulas over numbered atoms."""

from __future__ import annotations

from collections.abc import Mapping

from symcheck.automata.formula import Formula
from symcheck.automata.ltl import Formulas
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

__all__ = ["read"]

_STEPS = 2000
"""Largest bound on steps within a formula with nested operators."""


def read(
    formulas: Formulas, path: PathFormula, atoms: Mapping[Expression, Formula], *, timed: bool
) -> Formula:
    """The path formula, given what its largest state formulas are.

    Raises UnsupportedError for bounds in continuous time (`timed`) and very large ones, InputError for wrong ones.
    """

    def inner(part: PathFormula) -> Formula:
        return read(formulas, part, atoms, timed=timed)

    if path in atoms:
        return atoms[path]  # type: ignore[index]
    match path:
        case Unary("!", operand):
            return formulas.negation(inner(operand))
        case Binary("&", left, right):
            return formulas.conjunction((inner(left), inner(right)))
        case Binary("|", left, right):
            return formulas.disjunction((inner(left), inner(right)))
        case Binary("=>", left, right):
            return formulas.disjunction((formulas.negation(inner(left)), inner(right)))
        case Binary("<=>", left, right):
            return _choice(formulas, inner(left), inner(right), formulas.negation(inner(right)))
        case Conditional(condition, then, otherwise):
            return _choice(formulas, inner(condition), inner(then), inner(otherwise))
        case Next(operand, bound):
            steps = _steps(bound, timed=timed)
            possible = steps.lower <= 1 and (steps.upper is None or steps.upper >= 1)
            return formulas.next(inner(operand)) if possible else formulas.false
        case Eventually(operand, bound):
            return _until(formulas, formulas.true, inner(operand), _steps(bound, timed=timed))
        case Globally(operand, bound):
            return _release(formulas, formulas.false, inner(operand), _steps(bound, timed=timed))
        case Until(left, right, bound):
            return _until(formulas, inner(left), inner(right), _steps(bound, timed=timed))
        case Release(left, right, bound):
            return _release(formulas, inner(left), inner(right), _steps(bound, timed=timed))
        case WeakUntil(left, right, bound):
            either = formulas.disjunction((inner(left), inner(right)))
            return _release(formulas, inner(right), either, _steps(bound, timed=timed))
        case _:
            raise AssertionError(f"not a path formula: {type(path).__name__}")


def _choice(formulas: Formulas, condition: Formula, then: Formula, otherwise: Formula) -> Formula:
    yes = formulas.conjunction((condition, then))
    return formulas.disjunction(
        (yes, formulas.conjunction((formulas.negation(condition), otherwise)))
    )


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


def _until(formulas: Formulas, left: Formula, right: Formula, steps: Steps) -> Formula:
    """The formula left U[a,b] right: a steps within `left` first."""
    result = formulas.until(left, right, None if steps.upper is None else steps.upper - steps.lower)
    for _ in range(steps.lower):
        result = formulas.conjunction((left, formulas.next(result)))
    return result


def _release(formulas: Formulas, left: Formula, right: Formula, steps: Steps) -> Formula:
    return formulas.negation(
        _until(formulas, formulas.negation(left), formulas.negation(right), steps)
    )
