"""Beliefs as the states of an engine, so that they have values as those of other models."""

from __future__ import annotations

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.given_rows import engine_of_rows
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, SparseMatrix, starts_of
from symcheck.numerics.beliefs.exploration import Rows
from symcheck.numerics.beliefs.observed import GOAL
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.rewards import Structure

__all__ = ["engine_of", "reached", "rows_matrix"]


def engine_of(
    base: ExplicitEngine, matrix: SparseMatrix, earned: Numbers | None = None, terms: int = 1
) -> ExplicitEngine:
    """An engine over the rows of a matrix, with the rewards of rows as its one reward structure.

    terms: the most numbers of which an entry is the sum.
    """
    # Numbers are products of two quotients of whole numbers.
    error = (matrix.longest + terms + 8) * UNIT_ROUNDOFF
    return engine_of_rows(base, matrix, earned, name="beliefs", number_error=error)


def reached(
    context: Context,
    base: ExplicitEngine,
    matrix: SparseMatrix,
    goal: Bools,
    relevant: Bools,
    direction: Direction | None,
    earned: Numbers | None = None,
    left: Bools | None = None,
    terms: int = 1,
) -> tuple[Numbers, Numbers, bool]:
    """Bounds on the probability of reaching a goal in a matrix, or on what is earned on the way.

    Args:
        context: the options.
        base: the model.
        matrix: the rows of n beliefs or pairs.
        goal: bool[n].
        relevant: where bounds are asked for, bool[n].
        direction: None of a chain.
        earned: the reward of each row; None: the probability is asked for.
        left: the states that may be passed through, bool[n]; None: all.
        terms: the most numbers of which an entry is the sum.

    Returns:
        The bounds where they are relevant, and whether equal ones are rounded.
    """
    inner = context.within(engine_of(base, matrix, earned, terms), relevant)
    target, members = ArraySet(goal), ArraySet(relevant)
    if earned is None:
        through = inner.engine.all if left is None else ArraySet(left)
        values = until(inner, through, target, direction)
    else:
        values = reach_reward(inner, Structure(0), target, direction)
    return *values.at(members), values.rounded(members)


def rows_matrix(
    rows: Rows, cut: Numbers | None, *, reward: bool
) -> tuple[SparseMatrix, Numbers | None]:
    """The rows of all beliefs, and their rewards (None of probabilities).

    Args:
        rows: the rows of those that were expanded.
        cut: the value of each of the others: their probability of GOAL, or what they earn on the
            way to it (infinite: they stay for ever). None: they stay.
        reward: whether values are rewards.
    """
    n = len(rows.first)
    rational = rows.weight.dtype == object
    one = full(1, 1, rational=rational)[0]
    ends = np.flatnonzero(rows.first < 0)
    value = full(len(ends), 0, rational=rational) if cut is None else cut[ends]
    fixed = ends < 2  # GOAL and SINK
    value[fixed] = 0 * one
    if reward:
        moves = ~fixed if cut is not None else np.zeros(len(ends), np.bool_)
        moves &= np.asarray(value < np.inf, np.bool_)
        chance = np.where(moves, one, 0 * one)
        earned_at_ends = np.where(moves, value, 0 * one)
    else:
        chance = value
    stay = one - chance
    extra = len(rows.row_of_belief) + np.arange(len(ends))
    to, keep = np.flatnonzero(chance > 0), np.flatnonzero(stay > 0)
    # Probabilities go on to SINK, and rewards stay where they are.
    elsewhere = ends if reward or cut is None else np.where(fixed, ends, 1)
    row = np.concatenate((rows.row, extra[to], extra[keep]))
    target = np.concatenate((rows.target, np.full(len(to), GOAL), elsewhere[keep]))
    weight = np.concatenate((rows.weight, chance[to], stay[keep]))
    owner = np.concatenate((rows.row_of_belief, ends))
    by_belief = np.argsort(owner, kind="stable")
    place = np.empty(len(owner), np.int64)
    place[by_belief] = np.arange(len(owner))
    order = np.lexsort((target, place[row]))
    lengths = np.bincount(place[row], minlength=len(owner))
    split = SparseMatrix(
        starts_of(lengths),
        target[order].astype(np.int32),
        weight[order],
        n,
        starts_of(np.bincount(owner, minlength=n)),
    )
    matrix = split.merge(np.arange(n, dtype=np.int32), n)
    if not reward:
        return matrix, None
    return matrix, np.concatenate((rows.earned, earned_at_ends))[by_belief]
