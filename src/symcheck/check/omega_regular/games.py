"""LTL formulas in games: those that finite prefixes of runs decide.

A co-safe formula is satisfied by reaching a good prefix in the product with its automaton, a safe
one by never reaching a bad one.
"""

from __future__ import annotations

from dataclasses import replace

from symcheck.check.context import Context
from symcheck.check.measures.reachability import until
from symcheck.check.omega_regular.ltl import co_safe_product, is_co_safe
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.errors import UnsupportedError
from symcheck.semantics.path_formulas import LtlPathFormula

__all__ = ["path_probability_in_game"]


def path_probability_in_game(
    context: Context, path: LtlPathFormula[StateSet], direction: Direction | None
) -> Values:
    """Probability of an LTL formula at each state of a game.

    Raises:
        UnsupportedError: no finite prefixes decide the formula, or its automaton is too large.
    """
    from symcheck.check.queries.path_probabilities import complement_of

    if is_co_safe(context, path):
        product, target = co_safe_product(context, path)
        inner = replace(context, engine=product.engine, relevant_states=None)
        return product.project(until(inner, inner.engine.all, target, direction))
    opposite = replace(path, negative=not path.negative)
    if is_co_safe(context, opposite):
        dual = direction and direction.dual
        return complement_of(context, lambda c: path_probability_in_game(c, opposite, dual))
    raise UnsupportedError(
        "LTL formulas of games are supported if finite prefixes of runs decide them: co-safe ones "
        "(F, U, X) and safe ones (G, W, R, X); in this one, they are nested"
    )
