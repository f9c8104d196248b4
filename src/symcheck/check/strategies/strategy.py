"""Strategies of an MDP that attain the value of a property: a choice per state.

A choice that maximises the equations of reachability need not reach anything: where going round in an end component is as
good as leaving it, it may go round for ever. So states with probability 1 take choices that move nearer to the target,
states with least probability 0 take choices that stay among such states, and of the other ones end components are made
single states, out of which a way is chosen, and then walked to. Source: Baier & Katoen (2008), 10.6.1.

Bounds on steps and formulas of linear time need memory: the state of an automaton of the formula. There the strategy is one of
the product with it, which goes to components where a pair of the automaton can be met for ever, and stays there going round from
visit to visit (10.6.4; de Alfaro 1997).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

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
from symcheck.check.reward_queries import reward_of
from symcheck.check.strategies.to_explicit import listed
from symcheck.direction import Direction
from symcheck.engines.base import OwnSet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, spans
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import (
    Eventually,
    Expression,
    ModelType,
    ProbabilityOperator,
    RewardOperator,
)

__all__ = ["Strategy", "strategy_of"]


@dataclass(frozen=True, eq=False)
class Strategy:
    """A row of the engine's matrix for each state, int64[states]. `matters`: where not every row would do, bool[states].

    memory: where the strategy remembers something, the engine is the product of the model with an automaton; this is the
    state of the automaton, int32[states]. entry: then, per state of the model, the state of the product to begin with.
    """

    engine: ExplicitEngine = field(repr=False)
    rows: Int64s = field(repr=False)
    direction: Direction
    matters: Bools = field(repr=False)
    memory: Int32s | None = field(default=None, repr=False)
    entry: Int64s | None = field(default=None, repr=False)

    @cached_property
    def induced(self) -> SparseMatrix:
        """The Markov chain that the strategy leaves, on all states."""
        m = self.engine.matrix
        part = sparse.select(
            m.indptr, m.indices, m.data, self.rows, np.arange(m.columns, dtype=np.int32)
        )
        return SparseMatrix(*part, m.columns)

    @cached_property
    def reachable(self) -> Bools:
        """States that the strategy reaches from the initial ones."""
        return graph.forward_reachable(self.induced, self.engine.initial.members)

    @property
    def actions(self) -> list[str]:
        """The action of each state's choice, '' where it has none."""
        names = self.engine.model.actions
        return [
            names[a] if a >= 0 else ""
            for a in self.engine.explored.choice_actions[self.rows].tolist()
        ]

    def states(self) -> Iterator[tuple[bool | int, ...]]:
        """The variable values of all states, in index order; followed by the memory where there is one."""
        values = self.engine.valuations(self.engine.all)
        if self.memory is None:
            return values
        return ((*state, m) for state, m in zip(values, self.memory.tolist(), strict=True))


def strategy_of(
    context: Context, formula: Expression, states_of: Callable[[Context], StatesOf]
) -> Strategy:
    """A strategy that attains the value of a P or R formula (within the accuracy of its computation), from every state.

    Over X, F, U, G, W and R without bounds on steps, and for rewards until states are reached, strategies need no memory;
    with bounds on steps, and for any other formula of linear time, they have some. A bound (P>=p) has the strategy that is
    best for it or, without a direction, worst. Raises UnsupportedError for other formulas.
    """
    if context.engine.model.type is not ModelType.MDP:
        kind = context.engine.model.type.name
        raise UnsupportedError(f"strategies exist only for MDPs, and this model is a {kind}")
    if context.engine.exact or context.options.fairness:
        raise UnsupportedError("strategies are not supported with -exact or -fair")
    if not isinstance(formula, ProbabilityOperator | RewardOperator):
        raise UnsupportedError("a strategy belongs to a P or an R formula")
    context = listed(context)
    asked: str | None = formula.direction
    if asked is None and formula.bound is not None:
        asked = "min" if formula.bound.operator in (">", ">=") else "max"
    if asked not in ("min", "max"):
        raise UnsupportedError("a strategy is for a minimum or a maximum")
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
    chooser = _Chooser(context, towards)
    match path:
        case UntilPath(left, right, window) if window.trivial:
            chooser.until(left, right)
        case NextPath(target, window) if window.trivial:
            chooser.next(target)
        case RewardPath() | StatePath():
            raise UnsupportedError(
                "strategies are not supported for bounds on rewards, and for formulas of states"
            )
        case _:
            return _remembering(
                context, temporal(formula.path, states_of, context.engine.model), direction
            )
    return chooser.strategy(direction)


def _remembering(context: Context, path: TemporalPath, direction: Direction) -> Strategy:
    """A strategy of the product with an automaton. The least probability is missed with the greatest."""
    from symcheck.automata.acceptance import degeneralize
    from symcheck.check.omega_regular.ltl import linear_product
    from symcheck.engines.explicit.product import ExplicitProduct

    product, pairs = linear_product(
        context, replace(path, negative=direction == Direction.MIN), degeneralize
    )
    assert isinstance(product, ExplicitProduct)
    chooser = _Chooser(replace(context, engine=product.engine, relevant_states=None), Direction.MAX)
    chooser.until(product.engine.all, chooser.for_ever(pairs))
    found = chooser.strategy(direction)
    return replace(found, memory=product.pairs.automaton, entry=product.entry)


def _reward(
    context: Context, formula: RewardOperator, states_of: StatesOf, direction: Direction
) -> Strategy:
    query = formula.query
    path = resolve(query, states_of, context.engine) if isinstance(query, Eventually) else None
    if not isinstance(path, UntilPath) or not path.window.trivial:
        raise UnsupportedError("strategies for rewards are supported with R [ F states ] only")
    chooser = _Chooser(context, direction)
    chooser.reward(reward_of(context, formula), path.right)
    return chooser.strategy(direction)


class _Chooser:
    """Collects rows, state by state: -1 where any will do."""

    def __init__(self, context: Context, direction: Direction) -> None:
        engine = context.engine.capability(ExplicitEngine)
        assert engine is not None
        assert engine.matrix.groups is not None
        self.context, self.engine, self.direction = context, engine, direction
        self.edges = graph.Incidence(engine.matrix)
        self.rows: Int64s = np.full(engine.states, -1, dtype=np.int64)

    def strategy(self, direction: Direction) -> Strategy:
        """What was chosen, and the first row elsewhere."""
        free = self.rows < 0
        return Strategy(
            self.engine, np.where(free, self.edges.groups[:-1], self.rows), direction, ~free
        )

    def next(self, target: OwnSet) -> None:
        """The rows that most (least) probably enter the target."""
        values = self.engine.system(self.engine.all).one_step_probability(target)
        values = values if self.direction == Direction.MAX else -values
        best = np.maximum.reduceat(values, self.edges.groups[:-1])
        first = np.flatnonzero(values == np.repeat(best, np.diff(self.edges.groups)))
        self.rows[self.edges.owner[first[::-1]]] = first[::-1]

    def until(self, left: OwnSet, right: OwnSet) -> None:
        """Rows for the greatest (least) probability of left U right."""
        questions = self.engine.graph
        yes, no = (
            questions.prob1(left, right, self.direction),
            questions.prob0(left, right, self.direction),
        )
        if self.direction == Direction.MAX:
            to = self.engine.to_bools
            _, rows = graph.prob1e_strategy(self.edges, to(left), to(right))
            self._take(to(yes - right), rows)
        else:
            self._stay(self.engine.to_bools(no), self.engine.to_bools(no & (left - right)))
        system = self.engine.system(~(yes | no), self.direction)
        self._solve(system.states, system.reachability(yes).problem())

    def for_ever(self, pairs: Sequence[tuple[OwnSet, Sequence[OwnSet]]]) -> OwnSet:
        """Rows that meet one of the pairs (avoid, visits; at most one of these) for ever: the states where that is possible."""
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

    def reward(self, reward: Reward, target: OwnSet) -> None:
        """Rows for the greatest (least) expected reward until the target."""
        everything = self.engine.all
        questions = self.engine.graph
        certain = questions.prob1(everything, target, self.direction.dual)
        system = self.engine.system(certain - target, self.direction)
        if np.isinf(system.step_rewards(reward)).any():
            raise UnsupportedError(
                "strategies where some reward of a single step is infinite are not supported"
            )
        equations = system.expected_reward(reward, infinite=~certain)
        if self.direction is Direction.MAX:
            self._miss(target)
        usable = equations.usable_rows
        origin = None if usable is None else np.flatnonzero(usable)
        self._solve(system.states, equations.problem(), origin)

    def _take(self, where: Bools, rows: Int64s) -> None:
        """Take over rows (-1: none) in some states."""
        self.rows = np.where(where & (rows >= 0), rows, self.rows)

    def _stay(self, within: Bools, where: Bools) -> None:
        """In the states `where`, a row that stays `within` for certain."""
        members = self.engine.from_bools(within)
        leaves = self.engine.system(self.engine.all).one_step_probability(~members) > 0
        inside = np.flatnonzero(~leaves & where[self.edges.owner])
        self.rows[self.edges.owner[inside[::-1]]] = inside[::-1]

    def _miss(self, target: OwnSet) -> None:
        """Where the target can be missed: stay where it is missed for certain, else move there with positive probability."""
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

    def _solve(self, states: OwnSet, problem: LinearProblem, origin: Int64s | None = None) -> None:
        """The rows of the solution. origin: numbers, within the states' rows, of the problem's rows."""
        from symcheck.numerics.linear.methods import solve_linear

        members = self.engine.to_bools(states)
        if not members.any():
            return
        found = solve_linear(problem, replace(self.context.options, method="auto"))
        if found.strategy is None:
            raise UnsupportedError("the numerical method gives no strategy")
        mine = np.flatnonzero(np.repeat(members, np.diff(self.edges.groups)))
        chosen = (
            found.strategy
            if origin is None
            else np.where(found.strategy >= 0, origin[found.strategy], -1)
        )
        self.rows[members] = np.where(chosen >= 0, mine[chosen], -1)
