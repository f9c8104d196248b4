"""LTL formulas in games.

A co-safe formula is satisfied by reaching a good prefix in the product with its automaton, a safe
one by never reaching a bad one. Others need an automaton with one Rabin pair, for the formula or
for its negation: such a game is one of parity, in which both sides have optimal strategies without
memory (Chatterjee & Henzinger 2012). If a side fixes its strategy, end components tell what the
other one attains, so that any strategies prove bounds.

Strategies are found in a game of reachability: where the set to visit is met, a run wins with a
small probability, and where the set to avoid is met, it loses with a larger one. If they are small
enough, strategies that are optimal there are optimal (Andersson & Miltersen 2009: the principle).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from symcheck.automata.acceptance import degeneralize
from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.measures.reachability import until
from symcheck.check.omega_regular.ltl import co_safe_product, is_co_safe, labelled_automaton
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, Int64s, starts_of
from symcheck.numerics.graph import accepting_end_components
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem, largest_width
from symcheck.numerics.linear.until import until_bounds
from symcheck.semantics.path_formulas import LtlPathFormula

__all__ = ["path_probability_in_game"]


def path_probability_in_game(
    context: Context, path: LtlPathFormula[StateSet], direction: Direction | None
) -> Values | None:
    """Probability of an LTL formula at each state of a game.

    None if the negation should be asked for: it is co-safe, or the formula needs several pairs.

    Raises:
        UnsupportedError: the automaton is too large.
    """
    if is_co_safe(context, path):
        co_safe, target = co_safe_product(context, path)
        inner = context.on(co_safe.engine)
        return co_safe.project(until(inner, inner.engine.all, target, direction))
    if is_co_safe(context, replace(path, negative=not path.negative)):
        return None
    context = context.with_any_method()
    sets, automaton = labelled_automaton(context, path)
    automaton = degeneralize(automaton)
    if len(automaton.pairs) > 1:
        return None
    product = context.engine.product(sets, automaton)
    engine = product.engine
    if not automaton.pairs:
        return context.engine.constant(0)
    (pair,) = automaton.pairs
    avoid = engine.to_bools(product.edges(automaton.edges(pair.avoid)))
    visits = [engine.to_bools(product.edges(automaton.edges(v))) for v in pair.visits]
    visit = (visits[0] if visits else ~avoid) & ~avoid
    system = engine.system(engine.all, direction)
    assert system.opponents is not None
    game = _ParityGame(context, system, system.opponents ^ (direction is Direction.MAX))
    none = np.zeros_like(avoid)
    for exponent in tuning.PARITY_EXPONENTS:
        rows = game.strategies(avoid, visit, exponent, direction)
        # What the minimiser attains: the set to avoid infinitely often, or the other one finitely.
        low = 1 - game.attained(~game.maximises, rows, [(none, [avoid]), (visit, [])])
        high = game.attained(game.maximises, rows, [(avoid, [visit])])
        width = largest_width(low, high, context.options.relative)
        same = np.array_equal(low, high)
        if same or (width <= context.options.epsilon and not engine.is_rational):
            break
    else:
        if engine.is_rational:
            raise UnsupportedError(
                "the exact probability of this formula in a game is not found",
                hint="without -exact, bounds are computed",
            )
        context.warn_if_wide(width, "the strategies that were found are not optimal")
    context.log.runs.append(SolverRun("linear", "policy", system.n, 1, "a parity game"))
    exact = same and engine.is_rational
    return product.project(system.lift(low, None if same else high, up_to_rounding=exact))


@dataclass(frozen=True, eq=False)
class _ParityGame:
    """A game in which runs visit one set infinitely often, and another one finitely often.

    maximises: the states of the side that wants it, bool[n].
    """

    context: Context
    system: System
    maximises: Bools

    def strategies(
        self, avoid: Bools, visit: Bools, exponent: int, direction: Direction | None
    ) -> Int64s:
        """Rows of both sides for the game in which a visit wins with a small probability."""
        matrix = self.system.matrix
        rational = matrix.is_rational
        lose = Fraction(1, 10**exponent)
        ends = full(matrix.rows, 0, rational=rational)
        wins = ends.copy()
        for states, chance in ((avoid, lose), (visit, lose**2)):
            ends[matrix.rows_of(states)] = chance if rational else float(chance)
        wins[matrix.rows_of(visit)] = ends[matrix.rows_of(visit)]
        problem = LinearProblem(
            wins,
            replace(matrix, data=matrix.data * np.repeat(1 - ends, matrix.lengths)),
            None,
            ends,
            direction,
            True,
            opponents=self.system.opponents,
        )
        rows = solve_linear(problem, self.context.options, self.context.observer).strategy
        assert rows is not None
        return rows

    def attained(
        self, free: Bools, rows: Int64s, pairs: Sequence[tuple[Bools, Sequence[Bools]]]
    ) -> Numbers:
        """An upper bound on the probability that some states satisfy one of the pairs by their
        rows, if the others take the given ones.
        """
        matrix = self.system.matrix
        assert matrix.groups is not None
        allowed = matrix.rows_of(free)
        allowed[rows[~free]] = True
        chosen = matrix.choose(np.flatnonzero(allowed), starts_of(allowed)[matrix.groups])
        accepting = accepting_end_components(chosen, pairs)
        every = np.ones_like(free)
        options = self.context.options
        error = self.system.error
        return until_bounds(chosen, every, accepting, Direction.MAX, options, error=error)[1]
