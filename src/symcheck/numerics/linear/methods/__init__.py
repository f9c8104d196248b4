"""Methods for x = opt(A x + b): a function and an entry of METHODS each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from symcheck.errors import NeedsRationalsError, UnsupportedError
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.methods import (
    bounds,
    policy,
    power,
    rational,
    topological,
)
from symcheck.numerics.linear.methods.method import Method
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["METHODS", "Method", "solve_linear"]


def solve_linear(
    problem: LinearProblem | MaskedProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Solve a linear problem with the method that the settings name.

    Args:
        problem: the equations. 'topological' returns no policy for a masked problem.
        settings: accuracy, limits and the method. 'auto' is 'topological', or without rows
            'interval' (probabilities of chains) or 'optimistic'. Problems over the rationals are
            always solved by 'rational'. If they ask for a strategy, estimates collapse end
            components, in which it could stay for ever.
        observer: receives the progress.

    Returns:
        Values of the unknown states, in their order.

    Raises:
        UnsupportedError: the method is unknown or does not solve this problem.
    """
    if isinstance(problem, MaskedProblem):
        in_place = settings.method in ("auto", "topological") and problem.n > 0
        if in_place and not (problem.signed or problem.collapsible()):
            found = topological.solve_masked(problem, settings, observer)
            return found.widened(1.01 * problem.constant_error)
        problem = problem.extract()
    # Signs are asked for last: in a comparison of functions, they would be a condition.
    if problem.constant_error and not problem.is_rational and problem.signed:
        error = problem.constant_error * np.abs(problem.constant)
        bounds = problem.constant - error, problem.high + error
        problem = replace(problem.with_constant(*bounds), constant_error=0.0)
    method = _select(problem, settings.method)
    if problem.opponents is not None and problem.n > 0 and (method.sound or not problem.least):
        if not method.sound:
            raise UnsupportedError(f"method '{method.name}' does not solve such rewards of games")
        from symcheck.numerics.linear import games

        return games.solve(problem, settings, observer, solve_linear)
    if problem.n == 0:
        none = problem.constant[:0]
        return Solution(
            none, none, method.name, up_to_rounding=True, explanation="nothing to solve"
        )
    quotient = None
    if (
        (method.sound or settings.strategy)
        and problem.matrix is not None
        and not problem.is_rational
    ):
        quotient = collapse(problem)
    if quotient is None:
        solution = method.solve(problem, settings, observer)
    else:
        solution = quotient.expand(method.solve(quotient.problem, settings, observer))
    return replace(solution.widened(1.01 * problem.constant_error), method=method.name)


def _select(problem: LinearProblem, name: str) -> Method:
    """The method of this name, once its requirements are checked."""
    if problem.is_rational:
        name = "rational"
    if name == "auto":
        simple = problem.mode == 0 and problem.probability
        has_rows = problem.matrix is not None
        name = "topological" if has_rows else "interval" if simple else "optimistic"
    method = METHODS.get(name)
    if method is None:
        raise UnsupportedError(f"there is no method '{name}'; there are {', '.join(METHODS)}")
    if method.is_rational and not problem.is_rational:
        raise NeedsRationalsError(f"method '{name}' solves over the rationals")
    if method.requires == "rows" and problem.matrix is None:
        others = ", ".join(m.name for m in METHODS.values() if m.requires == "products")
        raise UnsupportedError(
            f"method '{name}' needs the rows of the matrix; with this engine use one of {others}"
        )
    if not (method.rewards or problem.probability):
        raise UnsupportedError(f"method '{name}' does not solve reward problems")
    return method


METHODS: Mapping[str, Method] = {
    method.name: method
    for method in (
        Method(
            "topological",
            topological.solve,
            "rows",
            True,
            "strong components in order, each by the cheapest certified means",
        ),
        Method(
            "policy",
            partial(policy.solve, chains=topological.solve),
            "rows",
            True,
            "policy iteration; for values that converge slowly",
        ),
        Method(
            "interval",
            bounds.interval,
            "products",
            True,
            "lower and upper bounds from both sides",
            rewards=False,
        ),
        Method(
            "optimistic",
            bounds.optimistic,
            "products",
            True,
            "lower bounds, then a guessed and verified upper bound",
        ),
        Method(
            "power",
            power.solve,
            "products",
            False,
            "products until the change is small: an estimate",
        ),
        Method(
            "rational",
            partial(rational.solve, chooser=solve_linear),
            "rows",
            True,
            "elimination and policy iteration over the rationals",
            is_rational=True,
        ),
    )
}
"""All methods by name, as the option -method has them."""
