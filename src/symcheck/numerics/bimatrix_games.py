"""Equilibria of bimatrix games, in which both sides optimise payoffs of their own.

In a Nash equilibrium, no side gains by another mixed strategy. Those that are vertices of the
polytopes of best responses are enumerated, for many games at once: a vertex is the solution of
linear equations, and a pair of vertices is an equilibrium if each action is unused or a best
response. All other Nash equilibria are mixtures of these. In a correlated equilibrium, a signal
proposes actions to both sides, and neither gains by another action; these are the solutions of a
linear program.

Sources: Mangasarian (1964), Equilibrium points of bimatrix games; Avis, Rosenberg, Savani & von
Stengel (2010), Enumeration of Nash equilibria for two-player games; Aumann (1974), Subjectivity and
correlation in randomized strategies; Kwiatkowska, Norman, Parker & Santos (2022), Correlated
equilibria and fairness in concurrent stochastic games.
"""

from __future__ import annotations

from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from symcheck.errors import NumericalError, UnsupportedError
from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.rows import Bools, Floats, Int64s, spans

__all__ = ["correlated_values", "nash_values"]

_SYSTEMS = 20_000
"""The most systems of equations for a game, which has a vertex for some of them: 8 actions of each
side have 12,869."""
_ENTRIES = 2_000_000
"""The most numbers in the systems that are solved at once."""
_TOLERANCES = (1e-10, 1e-8, 1e-6)
"""What counts as 0 where payoffs are scaled to the range from 1 to 2: the first one with which a
game has an equilibrium."""
_SINGULAR = 1e-13
"""Determinants below this, of systems of scaled payoffs, count as 0."""
_FEASIBLE = (1e-10, 1e-8, 1e-6)
"""By how much solutions of linear programs may violate inequalities: the first one with which they
are solved."""
_TIE = 1e-9
"""Criteria that differ by less, relative to the greatest payoff, are equal."""


class _Vertices(NamedTuple):
    """Vertices of polytopes, grouped by games.

    game: int64[vertices]. strategy: float64[vertices, actions]. zero, best: the actions that it
    does not use, and those of the other side that are best responses, bool[vertices, …].
    """

    game: Int64s
    strategy: Floats
    zero: Bools
    best: Bools


def nash_values(first: Floats, second: Floats, *, fair: bool = False) -> tuple[Floats, Floats]:
    """The payoffs of both sides in the Nash equilibrium that is chosen of those of each game.

    It is one with the greatest sum of payoffs, or, if `fair`, one with the least difference, and of
    these with the greatest sum. If several are left, that of the first side is greatest.

    Args:
        first: the payoffs of who chooses rows, finite, float64[games, rows, columns].
        second: those of who chooses columns.
        fair: which equilibrium is chosen.

    Returns:
        The payoff of each side, float64[games].

    Raises:
        UnsupportedError: the games have too many actions.
        NumericalError: rounding hides all equilibria of a game.

    Examples:
        >>> import numpy as np
        >>> first = np.array([[[3.0, 0.0], [0.0, 2.0]]])
        >>> second = np.array([[[2.0, 0.0], [0.0, 3.0]]])
        >>> [payoff.round(12).tolist() for payoff in nash_values(first, second)]
        [[3.0], [2.0]]
        >>> [payoff.round(12).tolist() for payoff in nash_values(first, second, fair=True)]
        [[1.2], [1.2]]
    """
    games, k, m = first.shape
    systems = comb(k + m, k) - 1
    if systems > _SYSTEMS:
        raise UnsupportedError(
            f"Nash equilibria are found by enumeration, which {k} and {m} joint actions of the two "
            "coalitions in a state are too many for"
        )
    values = np.stack((first[:, 0, 0], second[:, 0, 0]))
    if k * m == 1:
        return values[0], values[1]
    size = max(1, _ENTRIES // (systems * min(k, m) ** 2))
    for begin in range(0, games, size):
        left = np.arange(begin, min(begin + size, games))
        for tolerance in _TOLERANCES:
            found, *chosen = _chosen_nash(first[left], second[left], fair, tolerance)
            values[:, left[found]] = chosen
            left = np.delete(left, found)
            if not len(left):
                break
        else:
            raise NumericalError("rounding hides the Nash equilibria of a state")
    return values[0], values[1]


def _chosen_nash(
    first: Floats, second: Floats, fair: bool, tolerance: float
) -> tuple[Int64s, Floats, Floats]:
    """The games in which equilibria are found, and the payoffs of both sides in the chosen one."""
    x = _vertices(_scaled(second).swapaxes(1, 2), tolerance)
    y = _vertices(_scaled(first), tolerance)
    begin = np.searchsorted(y.game, x.game)
    end = np.searchsorted(y.game, x.game, "right")
    i, j = np.repeat(np.arange(len(x.game)), end - begin), spans(begin, end)
    is_nash = (x.zero[i] | y.best[j]).all(axis=1) & (x.best[i] | y.zero[j]).all(axis=1)
    i, j = i[is_nash], j[is_nash]
    game = x.game[i]
    one, other = (
        np.einsum("gi,gij,gj->g", x.strategy[i], payoffs[game], y.strategy[j])
        for payoffs in (first, second)
    )
    if fair:
        # All that is best against y has one payoff; that of the other side is anything between.
        near_one, near_other = _between(other, one, i), _between(one, other, j)
        game = np.tile(game, 2)
        one, other = np.append(near_one, one), np.append(other, near_other)
    scale = np.maximum(np.abs(first), np.abs(second)).max(axis=(1, 2))[game]
    criteria = [one + other, one]
    if fair:
        criteria.insert(0, -np.abs(one - other))
    kept = np.ones(len(game), np.bool_)
    for criterion in criteria:
        best = np.full(len(first), -np.inf)
        np.maximum.at(best, game[kept], criterion[kept])
        kept &= criterion >= best[game] - _TIE * scale
    found, place = np.unique(game[kept], return_index=True)
    return found, one[kept][place], other[kept][place]


def _between(wanted: Floats, numbers: Floats, group: Int64s) -> Floats:
    """The number nearest to the wanted one between the least and the greatest of its group."""
    ends = np.zeros((2, int(group.max(initial=0)) + 1))
    ends[0], ends[1] = np.inf, -np.inf
    np.minimum.at(ends[0], group, numbers)
    np.maximum.at(ends[1], group, numbers)
    nearest: Floats = np.clip(wanted, ends[0][group], ends[1][group])
    return nearest


def _scaled(payoffs: Floats) -> Floats:
    """Payoffs from 1 to 2 with the same best responses; rounding errors alone do not differ."""
    low, high = payoffs.min(axis=(1, 2), keepdims=True), payoffs.max(axis=(1, 2), keepdims=True)
    size = np.maximum(np.abs(low), np.abs(high))
    differ = high - low > 1e-13 * size
    scaled: Floats = 1.0 + np.where(differ, payoffs - low, 0.0) / np.where(differ, high - low, 1.0)
    return scaled


def _vertices(payoffs: Floats, tolerance: float) -> _Vertices:
    """The vertices z != 0 of z >= 0, payoffs z <= 1 for each game, as strategies.

    payoffs: above 0, those of the other side: float64[games, actions of it, actions].
    """
    _, n, d = payoffs.shape
    parts = []
    for size in range(1, min(n, d) + 1):
        used = np.array(list(combinations(range(d), size)))
        tight = np.array(list(combinations(range(n), size)))
        systems = payoffs[:, tight[:, None, :, None], used[None, :, None, :]]
        singular = np.abs(np.linalg.det(systems)) < _SINGULAR
        systems[singular] = np.eye(size)
        solutions = np.linalg.solve(systems, np.ones((*systems.shape[:-1], 1)))[..., 0]
        game, _, place = of = np.nonzero(~singular & (solutions > -tolerance).all(axis=-1))
        z = np.zeros((len(game), d))
        np.put_along_axis(z, used[place], solutions[of], axis=1)
        parts.append((game, z))
    game = np.concatenate([g for g, _ in parts])
    z = np.concatenate([p for _, p in parts])
    worth = np.einsum("vnd,vd->vn", payoffs[game], z)
    inside = (worth <= 1.0 + tolerance).all(axis=1) & (z.max(axis=1) > 0.0)
    game, z, worth = game[inside], z[inside], worth[inside]
    zero, best = z <= tolerance, worth >= 1.0 - tolerance
    # The inequalities that are tight tell a vertex from others.
    bits = np.packbits(np.append(zero, best, axis=1), axis=1)
    _, once = np.unique(np.column_stack((game, bits)), axis=0, return_index=True)
    weights = np.where(zero, 0.0, z)[once]
    strategy = weights / weights.sum(axis=1, keepdims=True)
    return _Vertices(game[once], strategy, zero[once], best[once])


def correlated_values(
    first: Floats, second: Floats, *, fair: bool = False
) -> tuple[Floats, Floats]:
    """The payoffs of both sides in the correlated equilibrium that is chosen; see `nash_values`.

    Raises:
        NumericalError: the linear program is not solved.

    Examples:
        >>> import numpy as np
        >>> first = np.array([[[5.0, 2.0], [6.0, 0.0]]])
        >>> second = np.array([[[5.0, 6.0], [2.0, 1.0]]])
        >>> round(sum(float(payoff[0]) for payoff in correlated_values(first, second)), 6)
        8.8
    """
    if 1 in first.shape[1:]:  # a signal tells nothing to who has one action
        return nash_values(first, second, fair=fair)
    require_memory_for_scipy()
    games, same = np.unique(np.stack((first, second), axis=1), axis=0, return_inverse=True)
    values = np.array([_chosen_correlated(a, b, fair) for a, b in games])[same.ravel()]
    return values[:, 0], values[:, 1]


def _chosen_correlated(first: Floats, second: Floats, fair: bool) -> tuple[float, float]:
    """The payoffs in one game."""
    k, m = first.shape
    one, other = _scaled(first[None])[0], _scaled(second[None])[0].T
    gains = np.zeros((k, k, k, m))  # [a, b]: by b where a is proposed, per joint action
    gains[np.arange(k), :, np.arange(k), :] = one[None] - one[:, None]
    others = np.zeros((m, m, k, m))
    others[np.arange(m), :, :, np.arange(m)] = other[None] - other[:, None]
    obedience = np.concatenate((gains.reshape(-1, k * m), others.reshape(-1, k * m)))
    obedience[np.abs(obedience) < _TOLERANCES[0]] = 0.0
    largest = np.abs(obedience).max(axis=1)
    obedience = obedience[largest > 0.0] / largest[largest > 0.0, None]
    scale = float(max(np.abs(first).max(), np.abs(second).max())) or 1.0
    mine, theirs = first.ravel() / scale, second.ravel() / scale
    # The last variable is the difference.
    differences = np.array([[*(mine - theirs), -1.0], [*(theirs - mine), -1.0]])
    rows = np.concatenate((np.pad(obedience, ((0, 0), (0, 1))), differences))
    costs = [np.append(-mine - theirs, 0.0), np.append(-mine, 0.0)]
    if fair:
        costs.insert(0, np.append(np.zeros(k * m), 1.0))
    for feasible in _FEASIBLE:
        if (weights := _least(costs, rows, feasible)) is not None:
            return float(weights @ first.ravel()), float(weights @ second.ravel())
    raise NumericalError("no correlated equilibrium of a state is found by linear programming")


def _least(costs: list[Floats], rows: Floats, feasible: float) -> Floats | None:
    """A distribution with the least first cost, of these with the least second one, and so on."""
    from scipy.optimize import linprog

    total = np.append(np.ones(rows.shape[1] - 1), 0.0)[None]
    limits = np.zeros(len(rows))
    options = dict.fromkeys(
        ("primal_feasibility_tolerance", "dual_feasibility_tolerance"), feasible
    )
    for cost in costs:
        answer = linprog(cost, rows, limits, total, [1.0], method="highs", options=options)
        if answer.status:
            return None
        rows, limits = np.vstack((rows, cost)), np.append(limits, answer.fun + 10 * feasible)
    weights = np.maximum(answer.x[:-1], 0.0)
    shares: Floats = weights / weights.sum()
    return shares
