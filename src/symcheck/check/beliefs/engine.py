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
from symcheck.matrices.rows import Int64s, SparseMatrix
from symcheck.numerics.beliefs.exploration import Rows
from symcheck.numerics.beliefs.observed import GOAL, SINK, gathered
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
    goal: int,
    points: Int64s,
    direction: Direction | None,
    earned: Numbers | None = None,
    terms: int = 1,
) -> tuple[Numbers, Numbers, bool]:
    """Bounds on the probability of reaching a goal in a matrix, or on what is earned on the way.

    Args:
        context: the options.
        base: the model.
        matrix: the rows of n beliefs or pairs.
        goal: which of them.
        points: where bounds are asked for, int64[k].
        direction: None of a chain.
        earned: the reward of each row; None: the probability is asked for.
        terms: the most numbers of which an entry is the sum.

    Returns:
        The bounds at these points, and whether equal ones are rounded.
    """
    number = np.arange(matrix.states)
    target, members = ArraySet(number == goal), ArraySet(np.isin(number, points))
    inner = context.within(engine_of(base, matrix, earned, terms), members.members)
    if earned is None:
        values = until(inner, inner.engine.all, target, direction)
    else:
        values = reach_reward(inner, Structure(0), target, direction)
    low, high = values.at(inner.engine.all)
    return low[points], high[points], values.rounded(members)


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
    ends = np.flatnonzero(rows.first < 0)  # GOAL, SINK, and those that were not expanded
    chance, gained = full(2 * len(ends), 0, rational=rows.weight.dtype == object).reshape(2, -1)
    elsewhere = ends.copy()
    if cut is not None and reward:
        value = cut[ends[2:]]
        chance[2:] = value < np.inf
        gained[2:] = np.where(value < np.inf, value, 0)
    elif cut is not None:
        chance[2:], elsewhere[2:] = cut[ends[2:]], SINK
    extra = len(rows.row_of_belief) + np.arange(len(ends))
    to, keep = np.flatnonzero(chance > 0), np.flatnonzero(chance < 1)
    row = np.concatenate((rows.row, extra[to], extra[keep]))
    target = np.concatenate((rows.target, np.full(len(to), GOAL), elsewhere[keep]))
    weight = np.concatenate((rows.weight, chance[to], 1 - chance[keep]))
    owner = np.concatenate((rows.row_of_belief, ends))
    by_belief = np.argsort(owner, kind="stable")
    place = np.argsort(by_belief)
    matrix = gathered(place[row], target, weight, owner[by_belief], len(rows.first))
    if not reward:
        return matrix, None
    return matrix, np.concatenate((rows.earned, gained))[by_belief]
