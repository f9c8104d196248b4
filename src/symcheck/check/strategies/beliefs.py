"""Strategies of partially observed models, with finite memory, and their values as chains.

The memory is the choice that was made last, and the belief (or the set of states) in which it was
made. What is done depends on it and on the observation.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from symcheck.check.beliefs.engine import engine_of, rows_matrix
from symcheck.check.beliefs.model import ObservedModel, kept
from symcheck.check.beliefs.search import Found, Plan, Problem
from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward
from symcheck.check.measures.reward_scaling import ScaledBound
from symcheck.check.queries.path_probabilities import probability
from symcheck.check.result import SolverRun
from symcheck.check.strategies.builder import StrategyBuilder
from symcheck.check.strategies.counters import counter_product
from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.finite_memory import Decisions, finite_memory_strategy
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, doubles, rationals
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import graph
from symcheck.numerics.beliefs.memory import Memory
from symcheck.numerics.beliefs.observed import SINK
from symcheck.semantics.rewards import Structure

__all__ = ["belief_strategy"]


@dataclass(frozen=True, eq=False)
class _Memory:
    """Memory values of a strategy; the absorbing beliefs GOAL (reached) and SINK have no states.

    Attributes:
        sizes, states: how many states are possible with each, and which.
        owner, slot, share: of each row that is taken, its memory value, its number there, and its
            probability.
        lengths, targets: how many memory values may follow each of these rows, and which.
    """

    sizes: Int64s = field(repr=False)
    states: Int64s = field(repr=False)
    owner: Int64s = field(repr=False)
    slot: Int64s = field(repr=False)
    share: Numbers = field(repr=False)
    lengths: Int64s = field(repr=False)
    targets: Int64s = field(repr=False)

    @classmethod
    def of(cls, memory: Memory, shares: Floats) -> _Memory:
        """The memory of a policy, given the share of each of its rows."""
        rows, taken = memory.rows, np.flatnonzero(shares > 0)
        owner = rows.row_of_belief[taken]
        begin, end = np.searchsorted(rows.row, (taken, taken + 1))
        return cls(
            np.diff(memory.beliefs.starts),
            memory.beliefs.states,
            owner,
            taken - rows.first[owner],
            shares[taken],
            end - begin,
            rows.target[spans(begin, end)],
        )

    def with_next(self, other: _Memory) -> _Memory:
        """These memory values, and then those of a policy, whose successors stay within it."""
        shift = len(self.sizes)
        targets = other.targets + np.where(other.targets > SINK, shift, 0)
        moved = replace(other, owner=other.owner + shift, targets=targets)
        pairs = zip(vars(self).values(), vars(moved).values(), strict=True)
        return _Memory(*map(np.concatenate, pairs))


def belief_strategy(context: Context) -> Strategy:
    """A strategy that attains the bound on the value that was found last, checked as a chain.

    Raises UnsupportedError: the value is infinite, every strategy attains it, or the chain does not
    attain the bound.
    """
    found = kept(context, "beliefs")
    if not isinstance(found, Found):
        raise UnsupportedError(
            "strategies of partially observed models are supported for paths and rewards until "
            "states are reached"
        )
    plan = found.plan
    if plan is None:
        infinite = np.isinf(doubles(found.lower)).any()
        what = "an infinite reward" if infinite else "a value that every strategy has"
        raise UnsupportedError(f"no strategy is built for {what}")
    if len(found.lower) != 1:
        raise UnsupportedError("a strategy of a partially observed model is built for one state")
    problem = plan.problem
    decisions = _decisions(problem.model, *_memory(context, plan))
    strategy = finite_memory_strategy(problem.model.engine, decisions, 0)
    strategy = replace(strategy, direction=problem.direction)
    _verify(context, problem, found, strategy)
    return strategy


def _memory(context: Context, plan: Plan) -> tuple[_Memory, Int64s]:
    """The memory of a plan, and its values at the beginning.

    They are beliefs, with a number of steps if that matters, and then those of each policy which is
    used beyond them.
    """
    problem, policies, exact = plan.problem, plan.policies, plan.beliefs
    if exact is None:
        assert policies is not None
        (policy,) = policies.found
        return _Memory.of(policies.memory, policy.shares), plan.points
    beliefs, rows, ends = exact.beliefs, exact.rows(), exact.pending
    cut = None
    if policies is not None:
        cut = np.zeros(len(beliefs))
        cut[ends], pick, first = policies.bounds(beliefs, ends)
    matrix, earned = rows_matrix(rows, cut, reward=problem.reward is not None)
    steps, each = problem.window.steps(), np.ones(matrix.rows, np.int64)
    unbounded = problem.window.is_unbounded
    product = counter_product(
        engine_of(problem.model.engine, matrix, earned),
        [] if unbounded else [ScaledBound(each, steps.lower, steps.upper)],
    )
    pairs, groups = product.engine.matrix, product.engine.matrix.groups
    assert groups is not None
    path = problem.path(lambda states: beliefs.within(states)[product.state])
    inner = context.within(product.engine, np.ones(pairs.states, np.bool_), strategy=True)
    builder = StrategyBuilder(inner, problem.towards)
    if problem.reward is None:
        builder.until(path.left & ArraySet(product.within), path.right & ArraySet(product.met))
    else:
        builder.reward(Structure(0), path.right)
    goes_on = (rows.first[product.state] >= 0) & (product.code < (steps.upper or 1))
    owner = np.flatnonzero(goes_on)
    taken = builder.strategy(problem.towards).rows[owner]
    follows = pairs.choose(taken)
    sizes, begin = np.diff(beliefs.starts)[product.state], beliefs.starts[product.state]
    memory = _Memory(
        sizes,
        beliefs.states[spans(begin, begin + sizes)],
        owner,
        taken - groups[owner],
        np.ones(len(owner)),
        follows.lengths,
        follows.indices.astype(np.int64),
    )
    points = product.entry[plan.points]
    if policies is not None:
        used, of = np.unique(pick, return_inverse=True)
        after = np.arange(pairs.states)
        after[ends] = pairs.states + of * len(policies.memory.beliefs) + first
        memory, points = replace(memory, targets=after[memory.targets]), after[points]
        for i in used:
            memory = memory.with_next(_Memory.of(policies.memory, policies.found[i].shares))
    return memory, points


def _decisions(model: ObservedModel, memory: _Memory, points: Int64s) -> Decisions:
    """What is decided in each state with each memory: 0, or 1 + the row that was taken last."""
    m = memory
    starts, after = starts_of(m.sizes), starts_of(m.lengths)
    of_memory = np.searchsorted(m.owner, np.arange(len(m.sizes) + 1))
    follows = SparseMatrix(
        after[of_memory], m.targets.astype(np.int32), np.ones(len(m.targets)), len(m.sizes)
    )
    first = np.zeros(len(m.sizes), np.bool_)
    first[points] = True
    rows = np.flatnonzero(graph.forward_reachable(follows, first)[m.owner])
    # Where memory values are entered: at the beginning, and after each of these rows.
    before = np.concatenate((0 * points, np.repeat(rows + 1, m.lengths[rows])))
    entered = np.concatenate((points, m.targets[spans(after[rows], after[rows + 1])]))
    begin, end = of_memory[entered], of_memory[entered + 1]
    taken = spans(begin, end)
    owner = m.owner[taken]
    sizes, state = m.sizes[owner], m.states[spans(starts[owner], starts[owner + 1])]
    before, taken = np.repeat(np.repeat(before, end - begin), sizes), np.repeat(taken, sizes)
    share = m.share[taken]
    if model.engine.is_rational:
        share = rationals(Fraction(x).limit_denominator() for x in share.tolist())
    used = np.unique(np.concatenate(([0], before, taken + 1)))
    return Decisions(
        state,
        np.searchsorted(used, before),
        model.rows[model.arrays.groups[state] + m.slot[taken]],
        share,
        np.searchsorted(used, taken + 1),
    )


def _verify(context: Context, problem: Problem, found: Found, strategy: Strategy) -> None:
    """Require that the chain of a strategy attains the bound. Raises UnsupportedError."""
    product, origin = strategy.engine, strategy.origin
    earned = None
    if problem.reward is not None:
        at_states, at_rows = product.rewards(problem.reward)
        each = at_rows[strategy.taken] * strategy.shares
        earned = at_states + np.add.reduceat(each, strategy.starts[:-1])
    chain = engine_of(problem.model.engine, strategy.induced, earned)
    inner = context.within(chain, product.initial.members)
    path = problem.path(lambda s: s[origin])
    values = (
        probability(inner, path, None)
        if earned is None
        else reach_reward(inner, Structure(0), path.right, None)
    )
    low, high = values.at(product.initial)
    text = f"the strategy is a chain of {product.states:,} states"
    context.log.runs.append(SolverRun("linear", "chain", product.states, 1, text))
    maximum = strategy.direction is Direction.MAX
    value, claimed = (high[0], found.lower[0]) if maximum else (low[0], found.upper[0])
    missing = claimed - value if maximum else value - claimed
    if value != claimed and not missing <= 1e-9 * max(1, min(abs(claimed), abs(value))):
        raise UnsupportedError(
            f"the strategy attains {float(value):.9g}, and {float(claimed):.9g} was claimed"
        )
