"""Strategies of an MDP that attain the value of a property: a choice per state.

A choice that attains the maximum of the equations for reachability need not reach the target: in an
end component, staying is as good as leaving, so that the strategy may stay for ever. Therefore
states with probability 1 take choices that move nearer to the target, states with minimal
probability 0 take choices that stay among such states, and in the other states each end component
is treated as a single state with one choice that leaves it.
Source: Baier & Katoen (2008), 10.6.1.

Step bounds and LTL formulas need memory: the state of an automaton of the formula. The strategy is
then one of the product, which reaches an accepting end component and visits its acceptance sets in
turn.
Source: Baier & Katoen (2008), 10.6.4; de Alfaro (1997).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.path_formulas import (
    NextPath,
    RewardPath,
    StatePath,
    StatesOf,
    TemporalPath,
    UntilPath,
    negated,
    resolve,
    temporal,
)
from symcheck.check.reward_queries import discount_of, reward_of
from symcheck.check.strategies.to_explicit import to_explicit
from symcheck.direction import Direction
from symcheck.engines.base import StateSet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import is_infinite
from symcheck.matrices.rows import Bools, Int64s, first_best, spans
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import (
    DiscountedReward,
    Eventually,
    Expression,
    ModelType,
    ProbabilityOperator,
    RewardOperator,
)

__all__ = ["strategy_of"]


def strategy_of(
    context: Context, formula: Expression, states_of: Callable[[Context], StatesOf]
) -> Strategy:
    """A strategy that attains the value of a P or R formula from every state.

    Strategies for X, F, U, G, W and R without step bounds, and for rewards until states are
    reached, have no memory; those for step bounds and other LTL formulas have. The strategy of a
    bound (P>=p) is the one that decides it: the minimum for >=, the maximum for <=.

    Args:
        context: the model, and the accuracy of the value.
        formula: the formula.
        states_of: gives the states that satisfy a state formula.

    Raises:
        UnsupportedError: the model is no MDP, or the formula is of another kind.
    """
    if context.engine.model.type is not ModelType.MDP:
        kind = context.engine.model.type.name
        raise UnsupportedError(f"strategies exist only for MDPs, and this model is a {kind}")
    if context.options.fairness:
        raise UnsupportedError("strategies are not supported with -fair")
    if not isinstance(formula, ProbabilityOperator | RewardOperator):
        raise UnsupportedError(
            "strategies are supported for P and R formulas, without conditions (||)"
        )
    context = to_explicit(context)
    asked: str | None = formula.direction
    if asked is None and formula.bound is not None:
        asked = "min" if formula.bound.operator in (">", ">=") else "max"
    if asked not in ("min", "max"):
        raise UnsupportedError("a strategy needs a minimum or a maximum: Pmin, Pmax, Rmin or Rmax")
    direction = Direction(asked)
    if isinstance(formula, ProbabilityOperator):
        return _probability(context, formula, states_of(context), direction)
    return _reward(context, formula, states_of(context), direction)


def _probability(
    context: Context, formula: ProbabilityOperator, states_of: StatesOf, direction: Direction
) -> Strategy:
    path = resolve(formula.path, states_of, context.engine)
    towards = direction
    if isinstance(path, NextPath | UntilPath) and path.negative:
        path, towards = negated(path), direction.dual
    builder = _StrategyBuilder(context, towards)
    match path:
        case UntilPath(left, right, window) if window.trivial:
            builder.until(left, right)
        case NextPath(target, window) if window.trivial:
            builder.next(target)
        case RewardPath() | StatePath():
            raise UnsupportedError(
                "strategies are not supported for reward bounds and state formulas"
            )
        case UntilPath() | NextPath() | TemporalPath():
            return _with_memory(
                context, temporal(formula.path, states_of, context.engine.model), direction
            )
        case _:
            assert_never(path)
    return builder.strategy(direction)


def _with_memory(context: Context, path: TemporalPath, direction: Direction) -> Strategy:
    """A strategy of the product with an automaton; a minimum is the maximum of the negation."""
    from symcheck.automata.acceptance import degeneralize
    from symcheck.check.omega_regular.ltl import linear_product
    from symcheck.engines.explicit.product import ExplicitProduct

    product, pairs = linear_product(
        context, replace(path, negative=direction is Direction.MIN), degeneralize
    )
    assert isinstance(product, ExplicitProduct)
    inner = replace(context, engine=product.engine, relevant_states=None)
    builder = _StrategyBuilder(inner, Direction.MAX)
    builder.until(product.engine.all, builder.accept(pairs))
    found = builder.strategy(direction)
    return replace(found, memory=product.pairs.automaton, entry=product.entry)


def _reward(
    context: Context, formula: RewardOperator, states_of: StatesOf, direction: Direction
) -> Strategy:
    query = formula.query
    builder = _StrategyBuilder(context, direction)
    reward = reward_of(context, formula)
    if isinstance(query, DiscountedReward) and query.bound is None:
        builder.discounted(reward, discount_of(query.discount))
        return builder.strategy(direction)
    path = resolve(query, states_of, context.engine) if isinstance(query, Eventually) else None
    if not isinstance(path, UntilPath) or not path.window.trivial:
        raise UnsupportedError(
            "strategies for rewards are supported with R [ F states ] and R [ C discount=… ] only"
        )
    builder.reward(reward, path.right)
    return builder.strategy(direction)


class _StrategyBuilder:
    """Chooses a row for each state; -1 if every row is as good."""

    def __init__(self, context: Context, direction: Direction) -> None:
        explicit = context.engine.capability(ExplicitEngine)
        assert explicit is not None
        assert explicit.matrix.groups is not None
        self.context, self.explicit, self.direction = context, explicit, direction
        self.engine = engine = context.engine
        self.edges = graph.Incidence(explicit.matrix)
        self.rows: Int64s = np.full(engine.states, -1, dtype=np.int64)

    def strategy(self, direction: Direction) -> Strategy:
        """The strategy of the chosen rows, and of the first row in other states."""
        free = self.rows < 0
        return Strategy(
            self.explicit, np.where(free, self.edges.groups[:-1], self.rows), direction, ~free
        )

    def next(self, target: StateSet) -> None:
        """Choose rows with maximal (minimal) probability of entering the target."""
        values = self.engine.system(self.engine.all).one_step_probability(target)
        values = values if self.direction is Direction.MAX else -values
        self.rows = first_best(values, self.edges.groups)

    def until(self, left: StateSet, right: StateSet) -> None:
        """Choose rows with maximal (minimal) probability of left U right."""
        questions = self.engine.graph
        yes, no = (
            questions.prob1(left, right, self.direction),
            questions.prob0(left, right, self.direction),
        )
        if self.direction is Direction.MAX:
            to = self.engine.to_bools
            _, rows = graph.prob1e_strategy(self.edges, to(left), to(right))
            self._take(to(yes - right), rows)
        else:
            self._stay(self.engine.to_bools(no), self.engine.to_bools(no & (left - right)))
        system = self.engine.system(~(yes | no), self.direction)
        self._solve(system.states, system.reachability(yes).problem())

    def accept(self, pairs: Sequence[tuple[StateSet, Sequence[StateSet]]]) -> StateSet:
        """Choose rows that satisfy one of the pairs (avoid, visits), of at most one visit.

        Returns:
            The states of accepting end components.
        """
        to, known = self.engine.to_bools, np.zeros(self.engine.states, dtype=np.bool_)
        for avoid, visits in pairs:
            good = graph.accepting_end_components(
                self.edges, [(to(avoid), [to(v) for v in visits])]
            )
            visited = good.copy()
            for visit in visits:
                visited &= to(visit)
            _, rows = graph.prob1e_strategy(self.edges, good, visited)
            mine = good & ~known
            self._take(mine & ~visited, rows)
            self._stay(good, mine & visited)
            known |= good
        return self.engine.from_bools(known)

    def reward(self, reward: Reward, target: StateSet) -> None:
        """Choose rows with maximal (minimal) expected reward until the target."""
        everything = self.engine.all
        questions = self.engine.graph
        certain = questions.prob1(everything, target, self.direction.dual)
        system = self.engine.system(certain - target, self.direction)
        if is_infinite(system.step_rewards(reward)).any():
            raise UnsupportedError(
                "strategies are not supported if a reward of a single step is infinite"
            )
        equations = system.expected_reward(reward, infinite=~certain)
        if self.direction is Direction.MAX:
            self._avoid(target)
        usable = equations.usable_rows
        origin = None if usable is None else np.flatnonzero(usable)
        self._solve(system.states, equations.problem(), origin)

    def discounted(self, reward: Reward, discount: Fraction) -> None:
        """Choose rows with maximal (minimal) discounted reward over all steps."""
        from symcheck.check.measures.discounted import discounted_problem

        system = self.engine.system(self.engine.all, self.direction)
        rewards = system.step_rewards(reward)
        problem = discounted_problem(system, rewards, discount, self.direction)
        self._solve(self.engine.all, problem)

    def _take(self, where: Bools, rows: Int64s) -> None:
        """Set the rows of some states; -1 for none."""
        self.rows = np.where(where & (rows >= 0), rows, self.rows)

    def _stay(self, within: Bools, where: Bools) -> None:
        """In the states `where`, choose a row that stays `within` with probability 1."""
        members = self.engine.from_bools(within)
        leaves = self.engine.system(self.engine.all).one_step_probability(~members) > 0
        inside = np.flatnonzero(~leaves & where[self.edges.owner])
        self.rows[self.edges.owner[inside[::-1]]] = inside[::-1]

    def _avoid(self, target: StateSet) -> None:
        """In states that can avoid the target, choose rows that do so with positive probability."""
        to = self.engine.to_bools
        missed = to(self.engine.graph.prob0(self.engine.all, target, Direction.MIN))
        self._stay(missed, missed)
        known, frontier, ahead = missed | to(target), missed, True
        while ahead:
            rows = self.edges.rows_in[
                spans(self.edges.pre[:-1][frontier], self.edges.pre[1:][frontier])
            ].astype(np.int64)
            rows = rows[~known[self.edges.owner[rows]]]
            owners = self.edges.owner[rows]
            self.rows[owners] = rows
            frontier = np.zeros_like(known)
            frontier[owners] = True
            known = known | frontier
            ahead = len(rows) > 0

    def _solve(
        self, states: StateSet, problem: LinearProblem, origin: Int64s | None = None
    ) -> None:
        """Choose the rows of a solution.

        origin: the index of each row of the problem among the rows of `states`.
        """
        from symcheck.numerics.linear.methods import solve_linear

        members = self.engine.to_bools(states)
        if not members.any():
            return
        found = solve_linear(problem, replace(self.context.options, method="auto"))
        if found.strategy is None:
            raise UnsupportedError("this numerical method computes no strategy")
        mine = np.flatnonzero(np.repeat(members, np.diff(self.edges.groups)))
        chosen = (
            found.strategy
            if origin is None
            else np.where(found.strategy >= 0, origin[found.strategy], -1)
        )
        self.rows[members] = np.where(chosen >= 0, mine[chosen], -1)
