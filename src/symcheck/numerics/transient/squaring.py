"""Powers of small chains by repeated squaring, between bounds on each entry.

A horizon of N steps takes log2 N squarings, so that any number of steps is possible. A matrix P is
known by bounds on its entries, and its rows sum to 1: a state outside of the chain receives what
leaves it. A product bounds each entry by the least and the greatest value that rows with the sum 1
attain. The bounds therefore stay close over any number of squarings: once the chain has mixed, all
rows of P are nearly equal, and whatever the rows by which they are multiplied, so is the product.
The rounding of each squaring is added outwards. Entries of P have a relative error, and what stays
in a state is 1 minus the others: probabilities that are nearly 1 have no other error.

For a CTMC, P = exp(Q h) with h = time / 2^s is the sum of a few terms of uniformisation, all of
them positive.

Sources: Kozine & Utkin (2002), 'Interval-valued finite Markov chains', for products of intervals
with sums of 1; Xue & Ye (2013), 'Computing exponentials of essentially non-negative matrices
entrywise to high relative accuracy', for the sum without differences.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from symcheck.kernels.chains.interval_matrices import interval_product
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.expressions.literals import LEAST

__all__ = ["IntervalChain", "Powers", "squaring_entries"]


def squaring_entries(states: int, steps: float) -> float:
    """The multiplications that a horizon of so many steps takes by squaring."""
    squarings = math.log2(max(steps, 2.0)) + 2 * tuning.SQUARING_TERMS
    return 4.0 * (states + 1.0) ** 3 * squarings


@dataclass(frozen=True, eq=False)
class _Bounds:
    """Bounds on a matrix or on columns: float64[r, n] each, not negative."""

    lower: Floats
    upper: Floats

    def scaled(self, error: float, roundings: int, possible: Bools) -> _Bounds:
        """The bounds, moved outwards by a relative error and by that of small numbers.

        roundings: of small numbers. possible: the entries that are not known to be 0.
        """
        lost = roundings * LEAST
        return _Bounds(
            np.maximum(self.lower * (1.0 - error) - lost, 0.0),
            np.where(possible, self.upper * (1.0 + error) + lost, 0.0),
        )

    def plus(self, other: _Bounds) -> _Bounds:
        """The sum, rounded outwards."""
        return _Bounds(
            (self.lower + other.lower) * (1.0 - 2.0 * UNIT_ROUNDOFF),
            (self.upper + other.upper) * (1.0 + 2.0 * UNIT_ROUNDOFF),
        )


@dataclass(frozen=True, eq=False)
class Powers:
    """Values after many steps, float64[n] each, and the squarings made."""

    lower: Floats
    upper: Floats
    squarings: int


@dataclass(frozen=True, eq=False)
class IntervalChain:
    """Bounds on the matrix of a chain: the last state is outside of it, and keeps what it gets.

    matrix: float64[n + 1, n + 1]. possible: whether a path leads from one state to another.
    """

    matrix: _Bounds
    possible: Floats

    @staticmethod
    def of_steps(matrix: SparseMatrix, leave: Floats, error: float) -> IntervalChain | None:
        """A chain of probabilities.

        Args:
            matrix: probabilities among the n states.
            leave: those of leaving them, float64[n].
            error: the relative error of probabilities.

        Returns:
            None if the sum of a row is not 1, for any probabilities with this error.
        """
        entries = _dense(matrix, leave)
        if np.any(np.abs(entries.sum(1) - 1.0) > error + len(entries) * UNIT_ROUNDOFF):
            return None
        bounds = _Bounds(entries * (1.0 - error), entries * (1.0 + error))
        return IntervalChain(_with_sum_one(bounds), _closure(entries > 0.0))

    @staticmethod
    def of_rates(
        rates: SparseMatrix, leave: Floats, time: float, reward_rate: Floats, error: float
    ) -> tuple[IntervalChain, _Bounds, int]:
        """The chain of a part of a time, which is halved until little happens.

        Args:
            rates: rates among the n states; self-loops do not matter.
            leave: rates of leaving them, float64[n].
            time: the time, positive.
            reward_rate: rewards per unit of time, float64[n], not negative.
            error: the relative error of rates.

        Returns:
            The chain, bounds on the reward of a part of the time for each state, and how often
            the time was halved.
        """
        entries = _dense(rates, leave)
        np.fill_diagonal(entries, 0.0)
        fastest = float(entries.sum(1).max()) or 1.0
        halvings = math.ceil(math.log2(fastest) + math.log2(time) - tuning.SQUARING_EXPONENT) + 1
        halvings = max(halvings, 0)
        step = math.ldexp(time, -halvings)
        mean = 2.0**tuning.SQUARING_EXPONENT  # jumps of the uniformised chain
        jumps = entries * step / mean
        error += 4.0 * UNIT_ROUNDOFF
        bounds = _Bounds(jumps * (1.0 - error), jumps * (1.0 + error))
        np.fill_diagonal(bounds.upper, 1.0)
        once = IntervalChain(_with_sum_one(bounds), _closure(entries > 0.0))
        # The rest of the sum is small relative to the least jump.
        least = min(1.0, float(entries.min(initial=np.inf, where=entries > 0.0)) * step)
        terms, weights = 1, [math.exp(-mean), math.exp(-mean) * mean]
        while weights[-1] > tuning.SQUARING_REST * least * mean:
            terms += 1
            weights.append(weights[-1] * mean / terms)
        beyond = 2.0 * weights[-1] * mean / terms
        tails = [math.fsum(weights[k + 1 :]) for k in range(terms)]
        error = (terms + 8) * 4.0 * UNIT_ROUNDOFF
        rewards = _column(reward_rate)
        power, earned = _identity(len(entries)), _Bounds(rewards * step, rewards * step)
        total, reward = _times(power, weights[0]), _times(earned, tails[0] / mean)
        for k in range(1, terms + 1):
            power, earned = once.multiply(power), once.multiply(earned)
            total = total.plus(_times(power, weights[k]))
            if k < terms:
                reward = reward.plus(_times(earned, tails[k] / mean))
        most = (terms + 2) * beyond / mean * step * float(reward_rate.max(initial=0.0))
        paid = once.possible @ (rewards > 0.0) > 0.0
        within = once.possible > 0.0
        total, reward = total.scaled(error, terms, within), reward.scaled(error, terms, paid)
        total = _Bounds(total.lower, total.upper + np.where(within, beyond, 0.0))
        reward = _Bounds(reward.lower, reward.upper + np.where(paid, most, 0.0))
        return replace(once, matrix=_with_sum_one(total)), reward, halvings

    def multiply(self, columns: _Bounds) -> _Bounds:
        """The product with columns, of which the state outside has entries too."""
        possible = self.possible @ (columns.upper > 0.0) > 0.0
        return _product(self.matrix, columns, possible)

    def squared(self) -> IntervalChain:
        """Twice as many steps."""
        product = _product(self.matrix, self.matrix, self.possible > 0.0)
        return replace(self, matrix=_with_sum_one(product))

    def values(
        self,
        steps: int,
        terminal: tuple[Floats, Floats] | None = None,
        reward: _Bounds | tuple[Floats, Floats] | None = None,
    ) -> Powers:
        """The values after some steps: the terminal ones there, and rewards on the way.

        Args:
            steps: their number, of any size.
            terminal: bounds on the values at the end, float64[n] each; None: 0.
            reward: bounds on what a step earns in each state, as columns or float64[n] each.
        """
        n, chain, squarings = len(self.possible), self, 0
        x = _Bounds(*map(_column, terminal)) if terminal is not None else None
        if isinstance(reward, tuple):
            reward = _Bounds(*map(_column, reward))
        while steps:
            if steps & 1:
                moved = None if x is None else chain.multiply(x)
                x = moved if reward is None else reward if moved is None else reward.plus(moved)
            steps >>= 1
            if steps:
                if reward is not None:
                    reward = reward.plus(chain.multiply(reward))
                chain = chain.squared()
                squarings += 1
        if x is None:
            x = _Bounds(np.zeros((n, 1)), np.zeros((n, 1)))
        return Powers(x.lower[:-1, 0], x.upper[:-1, 0], squarings)

    def distribution(self, steps: int, start: Floats) -> Powers:
        """The distribution after some steps, from one with the sum 1: float64[n]."""
        error = 2.0 * UNIT_ROUNDOFF
        row = np.append(start, 0.0)[None, :]
        p = _with_sum_one(_Bounds(row * (1.0 - error), row * (1.0 + error)))
        chain, squarings = self, 0
        while steps:
            if steps & 1:
                possible = (p.upper > 0.0).astype(np.float64) @ chain.possible > 0.0
                p = _with_sum_one(_product(p, chain.matrix, possible))
            steps >>= 1
            if steps:
                chain = chain.squared()
                squarings += 1
        return Powers(p.lower[0, :-1], p.upper[0, :-1], squarings)


def _dense(matrix: SparseMatrix, leave: Floats) -> Floats:
    """The matrix with the state outside, float64[n + 1, n + 1]."""
    n = matrix.states
    out = np.zeros((n + 1, n + 1))
    np.add.at(out, (matrix.row_of_entry, matrix.indices), matrix.data)
    out[:n, n], out[n, n] = leave, 1.0
    return out


def _closure(edges: Bools) -> Floats:
    """Whether a path of any length, 0 included, leads from one state to another: 0.0 or 1.0."""
    reached = np.asarray(edges | np.eye(len(edges), dtype=bool), np.float64)
    for _ in range(max(1, len(edges).bit_length())):
        reached = np.minimum(reached @ reached, 1.0)  # counts, without rounding
    return reached


def _identity(n: int) -> _Bounds:
    return _Bounds(np.eye(n), np.eye(n))


def _column(values: Floats) -> Floats:
    """Values of the states as a column, with 0 for the state outside: float64[n + 1, 1]."""
    return np.append(values, 0.0)[:, None]


def _times(bounds: _Bounds, factor: float) -> _Bounds:
    return _Bounds(bounds.lower * factor, bounds.upper * factor)


def _with_sum_one(bounds: _Bounds) -> _Bounds:
    """Closer bounds on the greatest entry of each row, which is 1 minus the others."""
    lower, upper = bounds.lower.copy(), np.minimum(bounds.upper, 1.0)
    rows = np.arange(len(lower))
    greatest = np.argmax(upper, 1)
    error = len(lower[0]) * UNIT_ROUNDOFF

    def others(values: Floats) -> Floats:
        values = values.copy()
        values[rows, greatest] = 0.0
        return np.asarray(values.sum(1))

    most, least = others(upper) * (1.0 + error), others(lower) * (1.0 - error)
    at_least = np.where(most > 0.0, (1.0 - most) - 2.0 * UNIT_ROUNDOFF, 1.0)
    at_most = np.where(most > 0.0, (1.0 - least) + 2.0 * UNIT_ROUNDOFF, 1.0)
    lower[rows, greatest] = np.maximum(lower[rows, greatest], at_least)
    upper[rows, greatest] = np.minimum(np.minimum(upper[rows, greatest], at_most), 1.0)
    return _Bounds(lower, upper)


def _product(rows: _Bounds, columns: _Bounds, possible: Bools) -> _Bounds:
    """Bounds on a product of rows with the sum 1, rounding included.

    possible: the entries of the product that are not known to be 0.
    """
    n = rows.lower.shape[1]
    error = (n + 8) * UNIT_ROUNDOFF * 1.01
    sums = rows.lower.sum(1)
    low, high = np.ascontiguousarray(columns.lower.T), np.ascontiguousarray(columns.upper.T)
    shape = (len(rows.lower), len(low))
    out = _Bounds(np.empty(shape), np.empty(shape))
    interval_product(
        np.ascontiguousarray(rows.lower),
        (rows.upper - rows.lower) * (1.0 + 2.0 * UNIT_ROUNDOFF),
        np.maximum(1.0 - sums * (1.0 + error), 0.0) * (1.0 - 2.0 * UNIT_ROUNDOFF),
        np.maximum(1.0 - sums * (1.0 - error), 0.0) * (1.0 + 2.0 * UNIT_ROUNDOFF),
        low,
        np.argsort(low, 1).astype(np.int32),
        high,
        np.argsort(-high, 1).astype(np.int32),
        out.lower,
        out.upper,
    )
    return out.scaled(error, 4 * n, possible)
