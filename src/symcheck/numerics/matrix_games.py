"""Zero-sum matrix games: optimal mixed strategies of both sides, of many games at once.

Games without a saddle point of pure strategies are solved by the simplex method, on an array of
tableaux. What it finds is as good as rounding allows, and proves nothing: a strategy of each side
bounds the value from its side.

Source: Dantzig (1951), A proof of the equivalence of the programming problem and the game problem;
Bland (1977), New finite pivoting rules for the simplex method.
"""

from __future__ import annotations

import numpy as np

from symcheck.matrices.rows import Floats, Int64s

__all__ = ["optimal_strategies"]

_TOLERANCE = 1e-12
"""Reduced costs and pivots below count as 0; payoffs are scaled to the range from 1 to 2."""
_GREEDY_PIVOTS = 4
_MOST_PIVOTS = 50
"""Pivots per row and column: by the steepest cost, then by Bland's rule, which does not cycle. Most
games take fewer than one. After the last, strategies are what they are."""


def optimal_strategies(payoffs: Floats) -> tuple[Floats, Floats]:
    """Strategies that maximise and minimise what is paid, whatever the other side does.

    Args:
        payoffs: finite, float64[games, rows, columns]; who chooses rows maximises.

    Returns:
        The probability of each row, float64[games, rows], and of each column, float64[games,
        columns].

    Examples:
        >>> import numpy as np
        >>> rows, columns = optimal_strategies(np.array([[[3.0, 0.0], [0.0, 1.0]]]))
        >>> rows.round(12).tolist(), columns.round(12).tolist()
        ([[0.25, 0.75]], [[0.25, 0.75]])
    """
    games, k, m = payoffs.shape
    worst, best = payoffs.min(axis=2), payoffs.max(axis=1)
    row, column = worst.argmax(axis=1), best.argmin(axis=1)
    rows, columns = np.zeros((games, k)), np.zeros((games, m))
    every = np.arange(games)
    rows[every, row] = columns[every, column] = 1.0
    mixed = np.flatnonzero(worst[every, row] < best[every, column])
    if len(mixed):
        rows[mixed], columns[mixed] = _by_simplex(payoffs[mixed])
    return rows, columns


def _by_simplex(payoffs: Floats) -> tuple[Floats, Floats]:
    """Strategies in games without saddle points.

    With payoffs above 0, columns y that maximise sum(y) subject to payoffs y <= 1 are optimal up to
    a factor, and so are the dual variables, the reduced costs of the slacks.
    """
    games, k, m = payoffs.shape
    low = payoffs.min(axis=(1, 2), keepdims=True)
    table = np.zeros((games, k + 1, m + k + 1))
    table[:, :k, :m] = 1.0 + (payoffs - low) / (payoffs.max(axis=(1, 2), keepdims=True) - low)
    table[:, :k, m : m + k] = np.eye(k)
    table[:, :k, -1] = 1.0
    table[:, k, :m] = -1.0
    basis = np.tile(np.arange(m, m + k), (games, 1))
    left = np.arange(games)
    for pivots in range(_MOST_PIVOTS * (k + m)):
        cost = table[left, k, :-1]
        left = left[cost.min(axis=1) < -_TOLERANCE]
        if not len(left):
            break
        cost = table[left, k, :-1]
        greedy = pivots < _GREEDY_PIVOTS * (k + m)
        entering = cost.argmin(axis=1) if greedy else (cost < -_TOLERANCE).argmax(axis=1)
        _pivot(table, basis, left, entering)
    values = np.zeros((games, m + k))
    np.put_along_axis(values, basis, table[:, :k, -1], axis=1)
    return _distributions(table[:, k, m:-1]), _distributions(values[:, :m])


def _pivot(table: Floats, basis: Int64s, games: Int64s, entering: Int64s) -> None:
    """Exchange a variable of the basis of each of some games for another one."""
    k = basis.shape[1]
    part, every = table[games], np.arange(len(games))
    column = part[every, :, entering]
    usable = column[:, :k] > _TOLERANCE
    ratio = np.full(usable.shape, np.inf)
    np.divide(part[:, :k, -1], column[:, :k], out=ratio, where=usable)
    ties = ratio <= ratio.min(axis=1, keepdims=True)
    leaving = np.where(ties, basis[games], basis.max() + 1).argmin(axis=1)
    row = part[every, leaving] / column[every, leaving][:, None]
    part -= column[:, :, None] * row[:, None, :]
    part[every, leaving] = row
    table[games] = part
    basis[games, leaving] = entering


def _distributions(weights: Floats) -> Floats:
    """Weights per game, without traces of rounding, as probabilities."""
    weights = np.where(weights > _TOLERANCE * weights.max(axis=1, keepdims=True), weights, 0.0)
    total = weights.sum(axis=1, keepdims=True)
    shares: Floats = np.where(total > 0.0, weights / np.where(total > 0.0, total, 1.0), 0.0)
    shares[(total <= 0.0)[:, 0]] = 1.0 / weights.shape[1]
    return shares
