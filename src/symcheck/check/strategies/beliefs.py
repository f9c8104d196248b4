"""Strategies of partially observed models, with finite memory, and their values as chains.

The memory is the choice that was made last, and the belief (or the set of states) in which it was
made. What is done depends on it and on the observation.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import cast

import numpy as np

from symcheck.check.beliefs.engine import engine_of, reached, rows_matrix
from symcheck.check.beliefs.search import Found, Plan, Problem
from symcheck.check.context import Context
from symcheck.check.result import SolverRun
from symcheck.check.strategies.builder import StrategyBuilder
from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.finite_memory import Decisions, finite_memory_strategy
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.numbers import Numbers, doubles, rationals
from symcheck.matrices.rows import Int64s, spans, starts_of
from symcheck.numerics.beliefs.exploration import Beliefs, Rows
from symcheck.numerics.beliefs.observed import GOAL, SINK
from symcheck.semantics.rewards import Structure

__all__ = ["belief_strategy"]


@dataclass(frozen=True, eq=False)
class _Part:
    """Memory values of a strategy: their rows, and the share of each row."""

    beliefs: Beliefs = field(repr=False)
    rows: Rows = field(repr=False)
    shares: Numbers = field(repr=False)


def belief_strategy(context: Context) -> Strategy:
    """A strategy that attains the bound on the value that was found last, checked as a chain.

    Raises:
        UnsupportedError: there is none, as the value is infinite or needs no memory of this kind.
        NumericalError: the chain does not have the value.
    """
    for known, value in reversed(context.log.kept):
        if known == ("beliefs", id(context.engine)):
            problem, found, states = cast(tuple[Problem, Found, Int64s], value)
            return _strategy(context, problem, found, states)
    raise UnsupportedError(
        "strategies of partially observed models are supported for F and U without bounds"
    )


def _strategy(context: Context, problem: Problem, found: Found, states: Int64s) -> Strategy:
    if found.plan is None:
        infinite = np.isinf(doubles(found.lower)).any()
        what = "an infinite reward" if infinite else "a value that every strategy has"
        raise UnsupportedError(f"no strategy is built for {what}")
    if len(states) != 1:
        raise UnsupportedError("a strategy of a partially observed model is built for one state")
    decisions = _decisions(context, problem, found.plan)
    strategy = finite_memory_strategy(problem.model.engine, decisions, 0)
    strategy = replace(strategy, direction=problem.direction)
    _verify(context, problem, found, strategy)
    return strategy


def _parts(context: Context, problem: Problem, plan: Plan) -> list[_Part]:
    """The memory of a plan: beliefs, and then that of each policy which is used beyond them."""
    parts = []
    used = np.zeros(1, np.int64)
    if plan.beliefs is not None:
        beliefs, rows, cut = plan.beliefs.beliefs, plan.beliefs.rows(), None
        after = np.arange(len(beliefs))
        if plan.policies is not None:
            ends = plan.beliefs.pending
            cut = np.zeros(len(beliefs))
            cut[ends], pick = plan.policies.bounds(beliefs, ends)
            used, of = np.unique(pick, return_inverse=True)
            first = len(beliefs) + of * len(plan.policies.memory.beliefs)
            after[ends] = first + plan.policies.memory_of(beliefs, ends)
        shares = _choices(context, problem, rows, cut)
        parts.append(_Part(beliefs, replace(rows, target=after[rows.target]), shares))
    if plan.policies is not None:
        inner = plan.policies.memory
        for i in used:
            shift = sum(len(p.beliefs) for p in parts)
            target = inner.rows.target + np.where(inner.rows.target > SINK, shift, 0)
            shares = plan.policies.found[i].shares
            parts.append(_Part(inner.beliefs, replace(inner.rows, target=target), shares))
    return parts


def _choices(context: Context, problem: Problem, rows: Rows, cut: Numbers | None) -> Numbers:
    """1 for the best row of each belief."""
    reward = problem.reward is not None
    matrix, earned = rows_matrix(rows, cut, reward=reward)
    engine = engine_of(problem.model.engine, matrix, earned)
    inner = context.within(engine, np.ones(matrix.states, np.bool_), strategy=True)
    builder = StrategyBuilder(inner, problem.direction)
    goal = np.zeros(matrix.states, np.bool_)
    goal[GOAL] = True
    if reward:
        builder.reward(Structure(0), ArraySet(goal))
    else:
        builder.until(inner.engine.all, ArraySet(goal))
    chosen = builder.strategy(problem.direction).rows
    assert matrix.groups is not None
    expanded = np.flatnonzero(rows.first >= 0)
    shares = np.zeros(len(rows.row_of_belief))
    shares[rows.first[expanded] + chosen[expanded] - matrix.groups[:-1][expanded]] = 1.0
    return shares


def _decisions(context: Context, problem: Problem, plan: Plan) -> Decisions:
    """What is decided in each state with each memory: 0, or 1 + the row that was taken last."""
    parts = _parts(context, problem, plan)
    arrays = problem.model.arrays
    shift_row = starts_of([len(p.rows.row_of_belief) for p in parts])
    first_row = np.concatenate(
        [
            np.where(p.rows.first < 0, -1, p.rows.first + r)
            for p, r in zip(parts, shift_row, strict=False)
        ]
    )
    counts = np.concatenate(
        [np.bincount(p.rows.row_of_belief, minlength=len(p.beliefs)) for p in parts]
    )
    sizes = np.concatenate([np.diff(p.beliefs.starts) for p in parts])
    starts = starts_of(sizes)[:-1]
    states = np.concatenate([p.beliefs.states for p in parts])
    shares = np.concatenate([p.shares for p in parts])
    entry_rows = np.concatenate([p.rows.row + r for p, r in zip(parts, shift_row, strict=False)])
    targets = np.concatenate([p.rows.target for p in parts])
    first_entry = np.searchsorted(entry_rows, np.arange(len(shares) + 1))

    def decided(before: Int64s, memory: Int64s) -> tuple[Int64s, ...]:
        """Decisions in memory values that are entered after some rows (-1: at the beginning)."""
        rows = spans(first_row[memory], first_row[memory] + counts[memory])
        of = np.repeat(np.arange(len(memory)), counts[memory])
        taken = shares[rows] > 0
        rows, of = rows[taken], of[taken]
        slot = rows - first_row[memory[of]]
        inside = spans(starts[memory[of]], starts[memory[of]] + sizes[memory[of]])
        each = np.repeat(np.arange(len(rows)), sizes[memory[of]])
        state = states[inside]
        row = problem.model.rows[arrays.groups[state] + slot[each]]
        return state, before[of[each]] + 1, row, shares[rows[each]], rows[each] + 1

    free = plan.points > SINK
    found = [decided(np.full(int(free.sum()), -1), plan.points[free])]
    seen = np.zeros(len(shares), np.bool_)
    fresh = np.unique(found[0][4]) - 1
    while len(fresh):
        seen[fresh] = True
        entries = spans(first_entry[fresh], first_entry[fresh + 1])
        before = np.repeat(fresh, first_entry[fresh + 1] - first_entry[fresh])
        on = targets[entries] > SINK
        found.append(decided(before[on], targets[entries][on]))
        after = np.unique(found[-1][4]) - 1
        fresh = after[~seen[after]]
    state, memory, row, share, following = (np.concatenate(c) for c in zip(*found, strict=True))
    used = np.unique(np.concatenate((np.zeros(1, np.int64), memory, following)))
    if context.engine.is_rational:
        share = rationals(Fraction(x).limit_denominator(1000) for x in share.tolist())
    return Decisions(
        state, np.searchsorted(used, memory), row, share, np.searchsorted(used, following)
    )


def _verify(context: Context, problem: Problem, found: Found, strategy: Strategy) -> None:
    """Compute the value of the chain that a strategy induces; it is as good as was claimed."""
    product, origin = strategy.engine, strategy.origin
    earned = None
    if problem.reward is not None:
        at_states, at_rows = product.rewards(problem.reward)
        each = at_rows[strategy.taken] * strategy.shares
        earned = at_states + np.add.reduceat(each, strategy.starts[:-1])
    low, high, _ = reached(
        context,
        problem.model.engine,
        strategy.induced,
        problem.right[origin],
        product.initial.members,
        None,
        earned,
        problem.left[origin],
    )
    text = f"the strategy is a chain of {product.states:,} states"
    context.log.runs.append(SolverRun("linear", "chain", product.states, 1, text))
    maximum = problem.direction is Direction.MAX
    value, claimed = (high[0], found.lower[0]) if maximum else (low[0], found.upper[0])
    missing = claimed - value if maximum else value - claimed
    if missing > 1e-9 * max(1, abs(claimed)):
        raise NumericalError(
            f"the strategy attains {float(value):.9g}, and {float(claimed):.9g} was claimed"
        )
