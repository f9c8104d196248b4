"""Strategies with little memory, whose values bound what beliefs are worth.

A strategy remembers the last observation, or which states are possible. Its values are those of a
chain; better choices are those that are best in expectation over the runs of the strategy.

Sources: Bork, Katoen & Quatmann (2022), 'Under-approximating expected total rewards in POMDPs';
Littman, Cassandra & Kaelbling (1995) for the first choices (QMDP).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

import numpy as np

from symcheck.check import tuning
from symcheck.check.beliefs.engine import reached
from symcheck.check.context import Context
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.matrices.rows import Bools, Floats, Int64s, first_best, spans
from symcheck.numerics.beliefs.exploration import Beliefs, Exploration
from symcheck.numerics.beliefs.memory import Memory

__all__ = ["Policies", "Policy"]


@dataclass(frozen=True, eq=False)
class Policy:
    """A strategy on a memory: the share of each of its rows, and a bound on its value per pair.

    The value is no less (for the greatest value: no more) than what the strategy attains.
    """

    shares: Floats = field(repr=False)
    values: Floats = field(repr=False)


@dataclass(frozen=True, eq=False)
class Policies:
    """Strategies on one memory.

    Attributes:
        search: the memory values, as supports of beliefs or one for each observation.
        memory: the same, with its product.
        usable: the rows that strategies may take.
        earned: the reward of each row of the model, float64; None for probabilities.
        direction: whether values are to be large or small.
    """

    base: ExplicitEngine = field(repr=False)
    search: Exploration = field(repr=False)
    memory: Memory = field(repr=False)
    usable: Bools = field(repr=False)
    earned: Floats | None = field(repr=False)
    direction: Direction
    found: list[Policy] = field(default_factory=list, repr=False)

    def uniform(self, usable: Bools) -> Floats:
        """Each of some rows with the same probability."""
        owner = self.memory.rows.row_of_belief
        counts = np.bincount(owner[usable], minlength=len(self.memory.beliefs))[owner]
        with np.errstate(divide="ignore"):
            shares = np.where(usable, 1.0 / counts, 0.0)
        lost = counts == 0  # whatever is done there
        shares[lost] = (np.diff(owner, prepend=-1) != 0)[lost]
        return shares

    def improve(self, context: Context, starts: Int64s, of_states: Floats) -> None:
        """Find strategies, the later ones better at some memory values with one state each.

        of_states: the values with full observation, float64[states].
        """
        pairs = self.memory.beliefs.starts[:-1][starts]
        sign = 1.0 if self.direction is Direction.MAX else -1.0
        uniform = self._evaluated(context, self.uniform(self.usable))
        self.found.append(uniform)
        full_values = np.append(of_states[self.memory.beliefs.states], self._ends())
        best, tried = uniform, full_values
        for _ in range(tuning.POLICY_ROUNDS):
            shares = self._greedy(best.shares, tried, pairs)
            policy = self._evaluated(context, shares)
            self.found.append(policy)
            before, after = sign * best.values[pairs], sign * policy.values[pairs]
            if tried is full_values:  # the first one competes with chance
                best = policy if after.sum() > before.sum() else best
            elif not after.sum() > before.sum():
                break
            else:
                best = policy
            tried = np.append(best.values, self._ends())

    def _ends(self) -> Floats:
        """The values of GOAL and SINK."""
        return np.array([1.0, 0.0] if self.earned is None else [0.0, inf])

    def _evaluated(self, context: Context, shares: Floats) -> Policy:
        memory, n = self.memory, self.memory.pairs
        earned, owner = None, memory.matrix.state_of_row
        if self.earned is not None:
            share = shares[memory.row_of_memory] * self.earned[memory.row_of_model]
            earned = np.bincount(owner, share, n + 2)
        terms, points = int(np.bincount(owner).max(initial=1)), np.arange(n)
        chain = memory.chain(shares)
        lower, upper, _ = reached(context, self.base, chain, n, points, None, earned, terms)
        if self.direction is Direction.MAX:
            return Policy(shares, lower * (1 - ROUNDING))
        return Policy(shares, upper * (1 + ROUNDING))

    def _greedy(self, shares: Floats, values: Floats, pairs: Int64s) -> Floats:
        """The best rows for these values, in expectation over the runs of a strategy."""
        memory = self.memory
        chain, weight = memory.chain(shares), np.zeros(memory.pairs + 2)
        np.add.at(weight, pairs, 1.0)
        visits = weight.copy()
        for _ in range(tuning.POLICY_STEPS):
            weight = tuning.POLICY_DISCOUNT * chain.multiply_left(weight)
            visits += weight
        bounded = np.minimum(values, 1e300)
        each = memory.matrix.multiply(bounded)
        if self.earned is not None:
            each = each + self.earned[memory.row_of_model]
        score = np.bincount(
            memory.row_of_memory,
            visits[memory.matrix.state_of_row] * np.minimum(each, 1e290),
            len(shares),
        )
        if self.direction is Direction.MIN:
            score = -score
        score[~self.usable & (shares == 0)] = -inf
        row_of = memory.rows.row_of_belief
        out = np.zeros(len(shares))
        out[first_best(score, np.flatnonzero(np.diff(row_of, prepend=-1, append=-1)))] = 1.0
        seen = np.bincount(memory.beliefs.owner, visits[:-2], len(memory.beliefs)) > 0
        return np.where(seen[row_of], out, shares)

    def bounds(self, beliefs: Beliefs, numbers: Int64s) -> tuple[Floats, Int64s, Int64s]:
        """The best value of a strategy from each of some beliefs, this strategy's number, and the
        memory with which it begins.
        """
        memory = self.search.memory_of(beliefs, numbers)
        begin, end = beliefs.starts[numbers], beliefs.starts[numbers + 1]
        entries = spans(begin, end)
        pair = self.memory.pair(np.repeat(memory, end - begin), beliefs.states[entries])
        share = beliefs.shares[entries]
        starts = np.cumsum(end - begin) - (end - begin)
        each = np.array([np.add.reduceat(share * p.values[pair], starts) for p in self.found])
        pick = each.argmax(axis=0) if self.direction is Direction.MAX else each.argmin(axis=0)
        return each[pick, np.arange(len(numbers))], pick, memory
