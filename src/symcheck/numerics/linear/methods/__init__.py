"""Methods for x = A x + b: a table, and `solve_linear`, which picks one and runs it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from symcheck.errors import UnsupportedError
from symcheck.numerics.linear.masked_problem import Embedded
from symcheck.numerics.linear.methods import (
    interval,
    optimistic,
    policy,
    rational,
    topological,
    value_iteration,
)
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["METHODS", "Method", "solve_linear"]


@dataclass(frozen=True, slots=True)
class Method:
    """A way to solve linear problems.

    requires: 'rows' (a SparseMatrix) or 'product' (an operator is enough). sound: its bounds are proved.
    kinds: some of 'chain' and 'mdp', 'probability' and 'reward'. about: a line for people. exact: whether the numbers
    that it takes are rationals; else they are doubles.
    """

    name: str
    solve: Callable[[LinearProblem, Settings, Observer | None], Solution]
    requires: str
    sound: bool
    kinds: frozenset[str]
    about: str
    exact: bool = False


_by_policies = partial(policy.solve, chains=topological.solve)
_ALL = frozenset(("chain", "mdp", "probability", "reward"))

METHODS: Mapping[str, Method] = {
    m.name: m
    for m in (
        Method(
            "topological",
            topological.solve,
            "rows",
            True,
            _ALL,
            "strong components in order, each by the cheapest certified means",
        ),
        Method(
            "policy",
            _by_policies,
            "rows",
            True,
            _ALL,
            "policy iteration; for values that converge slowly",
        ),
        Method(
            "interval",
            interval.solve,
            "product",
            True,
            _ALL - {"reward"},
            "lower and upper bounds from both sides",
        ),
        Method(
            "optimistic",
            optimistic.solve,
            "product",
            True,
            _ALL,
            "lower bounds, then a guessed and verified upper bound",
        ),
        Method(
            "gauss-seidel",
            value_iteration.gauss_seidel,
            "rows",
            False,
            _ALL,
            "sweeps until the change is small: an estimate",
        ),
        Method(
            "jacobi",
            value_iteration.jacobi,
            "rows",
            False,
            _ALL,
            "products, self-loops divided out, until the change is small: an estimate",
        ),
        Method(
            "power",
            value_iteration.power,
            "product",
            False,
            _ALL,
            "products until the change is small: an estimate",
        ),
        Method(
            "rational",
            partial(rational.solve, chooser=topological.solve),
            "rows",
            True,
            _ALL,
            "elimination and policy iteration over the rationals",
            exact=True,
        ),
    )
}


def solve_linear(
    problem: LinearProblem | Embedded, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Solve by `settings.method`; over the rationals there is one method, 'rational'. 'auto' takes 'topological', or without rows 'interval' (probabilities) or 'optimistic'.

    Values are those of the unknowns, in their order. Of an embedded problem 'topological' gives no strategy.

    Raises UnsupportedError for an unknown method, and for one that cannot treat this problem.
    """
    name = settings.method
    if isinstance(problem, Embedded):
        if name in ("auto", "topological") and problem.n:
            return topological.solve_embedded(problem, settings, observer)
        problem = problem.alone()
    if problem.exact:
        name = "rational"
    if name == "auto":
        plain_chain = problem.mode == 0 and problem.probability
        name = (
            "topological"
            if problem.matrix is not None
            else "interval"
            if plain_chain
            else "optimistic"
        )
    method = METHODS.get(name)
    if method is None:
        raise UnsupportedError(f"there is no method '{name}'; there are {', '.join(METHODS)}")
    if method.exact and not problem.exact:
        raise UnsupportedError(f"method '{name}' takes rationals, which only -exact gives")
    if method.requires == "rows" and problem.matrix is None:
        others = ", ".join(m.name for m in METHODS.values() if m.requires == "product")
        raise UnsupportedError(
            f"method '{name}' needs the rows of the matrix; with this engine use one of {others}"
        )
    kinds = {"mdp" if problem.mode else "chain", "probability" if problem.probability else "reward"}
    if not kinds <= method.kinds:
        raise UnsupportedError(
            f"method '{name}' does not solve {' '.join(sorted(kinds - method.kinds))} problems"
        )
    if problem.n == 0:
        return Solution(
            problem.constant[:0],
            problem.constant[:0],
            name,
            exact=True,
            explanation="nothing to solve",
        )
    return replace(method.solve(problem, settings, observer), method=name)
