"""Rational arithmetic: elimination for chains, policy iteration for MDPs.

Policy iteration starts from the best policy in floating point. It ends after finitely many steps,
and its comparisons are exact. So the result does not depend on floating point; a good first policy
only saves steps.
Sources: Howard (1960); Bertsekas & Tsitsiklis (1991) for least expected rewards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.matrices.numbers import at_sample, doubles, rationals
from symcheck.matrices.rational_functions import FunctionField, RationalFunction
from symcheck.matrices.rows import Floats, Int64s
from symcheck.matrices.weights import O
from symcheck.numerics import graph
from symcheck.numerics.linear.functions import least_functions
from symcheck.numerics.linear.lifting import lifted
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress, Solution
from symcheck.numerics.linear.rational import (
    Number,
    Row,
    fractions,
    least_solution,
    number_form,
    number_rows,
    restrict_rows,
)
from symcheck.numerics.settings import Accuracy, Settings
from symcheck.tables import counted

__all__ = ["solve"]

_POLICIES = 10_000
_LARGE = 1e300
"""Constants up to this are doubles, and so are sums of some millions of them."""

Chooser = Callable[[LinearProblem, Settings], Solution]
"""A method in floating point that gives a strategy."""


def solve(
    problem: LinearProblem,
    settings: Settings,
    observer: Observer | None,
    *,
    chooser: Chooser,
) -> Solution:
    """The exact least solution. Raises NumericalError where it is not unique or not finite."""
    field = _parameters(problem)
    if field is not None and field.lifting is not None:
        from symcheck.numerics.linear.methods import solve_linear

        box, direction = field.lifting
        opposed = problem.mode and problem.direction is not direction
        policy = _first_policy(_sampled(problem), chooser) if opposed else None
        return solve_linear(lifted(problem, policy, box, direction), settings, observer)
    if field is not None:
        return _solve_functions(problem, observer, chooser)
    form = number_form(problem.n)
    rows, constant = number_rows(problem.rows, form), [form(c) for c in problem.constant]
    if problem.mode == 0:
        x, policy, rounds = least_solution(rows, constant), None, 1
        note = f"{counted(problem.n, 'state')}: rational elimination"
    else:
        policy = _first_policy(problem, chooser)
        x, rounds = _policy_iteration(problem, rows, constant, policy, observer)
        note = f"{counted(problem.n, 'state')}: rational policy iteration, {rounds} policies"
    values = fractions(x)
    return Solution(values, values, "rational", True, True, rounds, note, strategy=policy)


def _parameters(problem: LinearProblem) -> FunctionField | None:
    """The field of the functions of a problem; None if it has none."""
    numbers = (*problem.rows.data, *problem.constant)
    return next((v.field for v in numbers if isinstance(v, RationalFunction)), None)


def _sampled(problem: LinearProblem) -> LinearProblem:
    """The problem at the sample point."""
    matrix = replace(problem.rows, data=at_sample(problem.rows.data))
    return replace(problem, matrix=matrix, constant=at_sample(problem.constant), exit=None)


def _solve_functions(
    problem: LinearProblem, observer: Observer | None, chooser: Chooser
) -> Solution:
    """The solution over functions of parameters; comparisons are those at the sample point."""
    constant: list[Number] = problem.constant.tolist()
    policy: Int64s | None = None
    if problem.mode == 0:
        rounds = 1
        values = rationals(least_functions(problem.rows, constant))
    else:
        rows: list[Row[Number]] = number_rows(problem.rows, lambda function: function)
        policy = _first_policy(_sampled(problem), chooser)
        x, rounds = _policy_iteration(problem, rows, constant, policy, observer)
        values = rationals(x)
    note = f"{counted(problem.n, 'state')}: elimination over functions"
    return Solution(values, values, "rational", True, True, rounds, note, strategy=policy)


def _policy_iteration(
    problem: LinearProblem,
    rows: Sequence[Row[O]],
    constant: Sequence[O],
    policy: Int64s,
    observer: Observer | None,
) -> tuple[list[O | int], int]:
    """Per component, evaluate the policy exactly and take better rows, until no row is better.

    Returns:
        The solution, and the largest number of policies of a component.
    """
    groups = problem.choices
    assert groups is not None
    starts = groups.tolist()
    sign = 1 if problem.direction is Direction.MAX else -1
    x: list[O | int] = [0] * problem.n
    parts = graph.sccs(problem.rows)
    most = 0
    for c in range(parts.count):
        members = parts.members(c).tolist()
        choices = [range(starts[s], starts[s + 1]) for s in members]
        chosen = [r for group in choices for r in group]
        restricted, constants = restrict_rows(rows, constant, chosen, members, x)
        inner = dict(zip(chosen, restricted, strict=True))
        outer = dict(zip(chosen, constants, strict=True))
        for rounds in range(1, _POLICIES):
            taken = policy[members].tolist()
            values = least_solution([inner[r] for r in taken], [outer[r] for r in taken])
            most = max(most, rounds)
            if observer is not None:
                observer(Progress("policy iteration", rounds, 0.0, problem.n))
            changed = False
            for s, best, group in zip(members, values, choices, strict=True):
                for r in group:
                    value = sum((a * values[t] for t, a in inner[r].items()), outer[r])
                    if sign * (value - best) > 0:
                        best, policy[s], changed = value, r, True
            if not changed:
                break
        else:
            raise NumericalError("policy iteration in rational arithmetic did not end")
        for s, best in zip(members, values, strict=True):
            x[s] = best
    return x, most


def _first_policy(problem: LinearProblem, chooser: Chooser) -> Int64s:
    """The best policy in floating point; for least rewards, a policy that leaves almost surely."""
    groups = problem.choices
    assert groups is not None
    # Beyond doubles, constants are divided by the largest one: the best policy is the same.
    largest = np.abs(problem.constant).max(initial=0)
    scale = largest if _LARGE < largest < inf else 1
    rounded = replace(
        problem,
        matrix=problem.rows.doubles(),
        constant=doubles(problem.constant / scale),
        upper=None,
        exit=_rounded_exits(problem),
    )
    try:
        chosen = chooser(rounded, Accuracy(epsilon=1e-9)).strategy
    except NumericalError:
        chosen = None
    policy = groups[:-1].copy() if chosen is None else np.where(chosen >= 0, chosen, groups[:-1])
    if problem.probability or problem.direction is not Direction.MIN:
        return policy
    leaving = np.asarray(problem.leaving > 0, dtype=np.bool_)
    if graph.backward_reachable(problem.rows.choose(policy), leaving[policy]).all():
        return policy
    exits = graph.exit_policy(problem.rows, leaving)
    if exits is None:
        raise NumericalError("the expected reward is infinite")
    return exits


def _rounded_exits(problem: LinearProblem) -> Floats:
    """The probabilities of leaving as doubles, which are positive where the rationals are."""
    rounded = doubles(problem.leaving)
    return np.where((rounded == 0.0) & (problem.leaving > 0), 1e-300, rounded)
