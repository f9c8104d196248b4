"""Beliefs as the states of an engine, so that they have values as those of other models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from symcheck.check.context import CheckLog, Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.direction import Direction
from symcheck.engines.base import erased
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.explicit.explored import States
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics.beliefs.exploration import Rows
from symcheck.numerics.beliefs.observed import GOAL
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.model import BoundModel, BoundRewards
from symcheck.semantics.rewards import Structure
from symcheck.syntax.ast import Expression

__all__ = ["belief_context", "engine_of", "reached", "rows_matrix"]


@dataclass(frozen=True, eq=False)
class _BeliefModel:
    """A matrix over beliefs or pairs, with one reward structure, as an explored model."""

    model: BoundModel = field(repr=False)
    matrix: SparseMatrix
    state_rewards: Sequence[Numbers]
    choice_rewards: Sequence[Numbers]

    @property
    def choice_actions(self) -> Int32s:
        """No action is known."""
        return np.full(self.matrix.rows, -1, np.int32)

    @property
    def initial(self) -> Int64s:
        """None: values are asked for where they are relevant."""
        return np.zeros(0, np.int64)

    @property
    def deadlocks(self) -> Int64s:
        """None."""
        return np.zeros(0, np.int64)

    @property
    def states(self) -> States:
        """Beliefs have no variables."""
        raise UnsupportedError("beliefs have no variables")

    def evaluate(self, _: Expression) -> Numbers:
        """Beliefs have no variables."""
        raise UnsupportedError("beliefs have no variables")


def engine_of(
    base: ExplicitEngine, matrix: SparseMatrix, earned: Numbers | None = None, terms: int = 1
) -> ExplicitEngine:
    """An engine over the rows of a matrix, with the rewards of rows as its one reward structure.

    terms: the most numbers of which an entry is the sum.
    """
    rational = matrix.is_rational
    states = full(matrix.states, 0, rational=rational)
    rows = full(matrix.rows, 0, rational=rational) if earned is None else earned
    model = replace(base.model, rewards=(BoundRewards(None, ()),))
    # Numbers are products of two quotients of whole numbers.
    error = (matrix.longest + terms + 8) * UNIT_ROUNDOFF
    beliefs = _BeliefModel(model, matrix, [states], [rows])
    return ExplicitEngine(beliefs, "beliefs", number_error=error)


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
    inner = belief_context(context, engine_of(base, matrix, earned, terms), relevant)
    target, members = ArraySet(goal), ArraySet(relevant)
    if earned is None:
        through = inner.engine.all if left is None else ArraySet(left)
        values = until(inner, through, target, direction)
    else:
        values = reach_reward(inner, Structure(0), target, direction)
    return *values.at(members), values.rounded(members)


def belief_context(
    context: Context, engine: ExplicitEngine, relevant: Bools, *, strategy: bool = False
) -> Context:
    """The context in which values of beliefs are computed: bounds at the relevant ones."""
    options = replace(
        context.options, certify=True, bisim=False, everywhere=False, strategy=strategy
    )
    return replace(
        context,
        engine=erased(engine),
        options=options,
        log=CheckLog(),
        relevant_states=ArraySet(relevant),
    )


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
