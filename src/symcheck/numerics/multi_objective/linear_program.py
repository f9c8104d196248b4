"""Several objectives of an MDP at once: linear programs over expected numbers of visits.

A strategy is described by how often it is expected to take each row before it settles in an end component, and by the
probability with which it settles at each state. These numbers satisfy linear equations (what flows into a state flows out
or settles), and expected values of objectives are linear in them, so that what strategies achieve is a convex set; its
corners are found by linear programs. Sources: Etessami, Kwiatkowska, Vardi & Yannakakis (2007); Forejt, Kwiatkowska,
Norman, Parker & Qu (2011).

Every objective is written so that more of it is better: costs are negative rewards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix
from symcheck.numerics import graph

__all__ = ["TOLERANCE", "Flow", "Outcome", "Stay", "corners", "settling"]

TOLERANCE = 1e-8
"""What the linear programs leave open: feasibility and optimality are met within 1e-10 of their scale, sums within this."""

_SETTINGS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}

Acceptance = Sequence[tuple[Bools, Sequence[Bools]]]
"""Pairs (avoid, visits), one of which is to be met: see `graph.accepting_end_components`."""


@dataclass(frozen=True, eq=False)
class Stay:
    """States at which a run may settle for good, and what each objective gains by that: bool[n], float64[objectives]."""

    states: Bools
    gains: Floats


@dataclass(frozen=True, eq=False)
class Outcome:
    """The optimum of a linear program: its value (inf where unbounded), and what each objective has there.

    gap: between the value and the bound that the dual program proves up to rounding.
    """

    value: float
    gains: Floats
    iterations: int = 0
    gap: float = 0.0


def settling(
    source: graph.Source, costless: Bools, acceptances: Sequence[Acceptance | None]
) -> list[Stay]:
    """Where a run may settle, and which objectives that satisfies; each acceptance is of one objective (None: no such).

    Rows with costs (outside of `costless`, bool[rows]) are not taken in the end component; an objective with acceptance
    gains 1. For every subset of these objectives the end components that satisfy all of them are found: exponential in
    their number. States that satisfy more are not listed with less.
    """
    chosen = [i for i, a in enumerate(acceptances) if a is not None]
    n = (source.matrix if isinstance(source, graph.Incidence) else source).states
    stays: list[Stay] = []
    for subset in sorted(range(1 << len(chosen)), key=lambda s: -s.bit_count()):
        members = [i for j, i in enumerate(chosen) if subset >> j & 1]
        found = np.zeros(n, dtype=np.bool_)
        for avoid, visits in _conjunction([acceptances[i] or [] for i in members], n):
            found |= _accepting(source, avoid, visits, costless)
        for other in stays:
            if all(other.gains[i] for i in members):
                found &= ~other.states
        if found.any():
            gains = np.zeros(len(acceptances))
            gains[members] = 1.0
            stays.append(Stay(found, gains))
    return stays


def _conjunction(acceptances: Sequence[Acceptance], n: int) -> list[tuple[Bools, list[Bools]]]:
    result: list[tuple[Bools, list[Bools]]] = [(np.zeros(n, dtype=np.bool_), [])]
    for pairs in acceptances:
        result = [(avoid | a, [*visits, *v]) for avoid, visits in result for a, v in pairs]
    return result


def _accepting(source: graph.Source, avoid: Bools, visits: Sequence[Bools], rows: Bools) -> Bools:
    parts = graph.maximal_end_components(source, ~avoid, rows)
    inside = parts.of >= 0
    good = np.ones(parts.count, dtype=np.bool_)
    for visit in visits:
        met = np.zeros(parts.count, dtype=np.bool_)
        met[parts.of[visit & inside]] = True
        good &= met
    found = np.zeros(len(inside), dtype=np.bool_)
    found[inside] = good[parts.of[inside]]
    return found


@dataclass(frozen=True, eq=False)
class Flow:
    """The linear equations of an MDP's flow from one initial state.

    rewards: float64[objectives, rows], what each row gives each objective. banned: states that are not to be entered.
    """

    matrix: SparseMatrix
    initial: int
    rewards: Floats = field(repr=False)
    stays: Sequence[Stay] = field(repr=False)
    banned: Bools | None = field(default=None, repr=False)

    @property
    def objectives(self) -> int:
        """Number of objectives."""
        return len(self.rewards)

    @cached_property
    def edges(self) -> graph.Incidence:
        """The matrix seen from its columns."""
        return graph.Incidence(self.matrix)

    @cached_property
    def _csr(self) -> Any:
        from scipy.sparse import csr_array

        m = self.matrix
        return csr_array((m.data, m.indices, m.indptr), shape=(m.rows, m.states))

    @cached_property
    def live(self) -> Bools:
        """States that can be reached without entering a banned one."""
        start = np.zeros(self.matrix.states, dtype=np.bool_)
        start[self.initial] = True
        if self.banned is None:
            return graph.forward_reachable(self.edges, start)
        return (
            graph.forward_reachable(self.edges, start & ~self.banned, ~self.banned) & ~self.banned
        )

    @cached_property
    def usable(self) -> Int64s:
        """Rows that may be taken."""
        usable = self.live[self.edges.owner_of_rows]
        if self.banned is not None:
            usable &= (self._csr @ self.banned.astype(np.float64)) == 0.0
        return np.flatnonzero(usable)

    @cached_property
    def places(self) -> list[Int64s]:
        """Per stay: the states where it may be taken."""
        return [np.flatnonzero(s.states & self.live) for s in self.stays]

    @cached_property
    def _balance(self) -> tuple[Any, Floats]:
        """The equations: per live state, outflow + settling - inflow = what begins there."""
        from scipy.sparse import coo_array, csr_array, hstack

        number = np.cumsum(self.live) - 1
        n, rows = int(self.live.sum()), self.usable
        out = csr_array(
            (np.ones(len(rows)), (number[self.edges.owner_of_rows[rows]], np.arange(len(rows)))),
            shape=(n, len(rows)),
        )
        inner = self._csr[rows].T.tocsr()[np.flatnonzero(self.live)]
        parts = [out - inner]
        for places in self.places:
            shape = (n, len(places))
            parts.append(
                coo_array(
                    (np.ones(len(places)), (number[places], np.arange(len(places)))), shape=shape
                )
            )
        begin = np.zeros(n)
        if self.live[self.initial]:
            begin[number[self.initial]] = 1.0
        return hstack(parts, format="csr"), begin

    @cached_property
    def gains(self) -> Floats:
        """What each variable of the program gives each objective: float64[objectives, variables]."""
        parts = [self.rewards[:, self.usable]]
        parts += [
            np.tile(stay.gains[:, None], len(places))
            for stay, places in zip(self.stays, self.places, strict=True)
        ]
        return np.concatenate(parts, axis=1)

    def best(self, weights: Floats, least: Floats) -> Outcome | None:
        """The greatest weighted sum of objectives where each has at least `least` (-inf: any); None where none have."""
        bounded = np.flatnonzero(np.isfinite(least))
        found = self._solve(self.gains.T @ weights, -self.gains[bounded], -least[bounded])
        if found is None:
            return None
        x, value, iterations, gap = found
        gains = np.full(self.objectives, np.nan) if x is None else self.gains @ x
        return Outcome(value, gains, iterations, gap)

    def margin(self, least: Floats) -> Outcome | None:
        """By how much all of `least` can be exceeded at once (at most 1; negative where they cannot be had)."""
        from scipy.sparse import csr_array, hstack

        bounded = np.flatnonzero(np.isfinite(least))
        extra = np.ones((len(bounded), 1))
        objective = np.concatenate((np.zeros(self.gains.shape[1]), [1.0]))
        above = hstack((csr_array(-self.gains[bounded]), csr_array(extra)), format="csr")
        found = self._solve(objective, above, -least[bounded], extra=[(None, 1.0)])
        if found is None:
            return None
        x, value, iterations, gap = found
        assert x is not None
        return Outcome(value, self.gains @ x[:-1], iterations, gap)

    def _solve(
        self,
        objective: Floats,
        above: Any,
        limit: Floats,
        extra: Sequence[tuple[float | None, float | None]] = (),
    ) -> tuple[Floats | None, float, int, float] | None:
        """Maximise; columns beyond those of the flow have the bounds `extra`. None: infeasible; no point: unbounded."""
        from scipy.optimize import linprog
        from scipy.sparse import csr_array, hstack

        if not self.live[self.initial]:
            return None
        balance, begin = self._balance
        if extra:
            balance = hstack((balance, csr_array((balance.shape[0], len(extra)))), format="csr")
        bounds = [(0.0, None)] * (len(objective) - len(extra)) + list(extra)
        inequalities = (above, limit) if len(limit) else (None, None)
        answer = linprog(
            -objective, *inequalities, balance, begin, bounds, method="highs", options=_SETTINGS
        )
        if (
            answer.status == 4
        ):  # numerical difficulties: the other algorithm, without simplification
            answer = linprog(
                -objective,
                *inequalities,
                balance,
                begin,
                bounds,
                method="highs-ds",
                options={"presolve": False},
            )
        match answer.status:
            case 0:
                dual = float(begin @ answer.eqlin.marginals) + float(
                    limit @ answer.ineqlin.marginals if len(limit) else 0.0
                )
                dual += float(
                    sum(
                        b[1] * m
                        for b, m in zip(bounds[::-1], answer.upper.marginals[::-1], strict=True)
                        if b[1] is not None
                    )
                )
                return answer.x, -answer.fun, answer.nit, abs(dual - answer.fun)
            case 2:
                return None
            case 3:
                return None, np.inf, answer.nit, 0.0
            case _:
                raise NumericalError(f"the linear program was not solved: {answer.message}")

    def connected(self, least: Floats) -> Flow:
        """The same without end components where flow could circulate that never comes from the initial state.

        In an end component where some row has a positive reward, circulation is worth something; it stands for strategies
        (for their limit) only if some strategy that has `least` of the objectives enters the component. Those that none
        enters are banned.
        """
        flow = self
        while True:
            paying = flow.paying()
            if not paying:
                return flow
            idle = flow._never_entered(paying, least)
            if not idle:
                return flow
            banned = (
                np.zeros(self.matrix.states, dtype=np.bool_)
                if flow.banned is None
                else flow.banned.copy()
            )
            for states in idle:
                banned |= states
            flow = replace(flow, banned=banned)

    def paying(self) -> list[Bools]:
        """End components with a positive reward of some objective, other than those that hold the initial state."""
        allowed = np.zeros(self.matrix.rows, dtype=np.bool_)
        allowed[self.usable] = True
        parts = graph.maximal_end_components(self.edges, self.live, allowed)
        positive = parts.rows & (self.rewards > 0.0).any(axis=0)
        numbers = np.unique(parts.of[self.edges.owner_of_rows[positive]])
        return [parts.of == c for c in numbers.tolist() if c >= 0 and parts.of[self.initial] != c]

    def _never_entered(self, components: Sequence[Bools], least: Floats) -> list[Bools]:
        """Those that no flow enters which has at least `least`; none where there is no such flow."""
        left = list(components)
        while left:
            amounts = self._entered(left, least)
            if amounts is None:
                return []
            # One flow need not enter all that some flow enters: ask again for the others.
            entered = amounts > 10 * TOLERANCE
            if not entered.any():
                break
            left = [c for c, yes in zip(left, entered.tolist(), strict=True) if not yes]
        return left

    def entering(self, components: Sequence[Bools]) -> Floats:
        """How much of each variable enters each component: float64[components, variables]."""
        owner = self.edges.owner_of_rows[self.usable]
        out = np.zeros((len(components), self.gains.shape[1]))
        for i, states in enumerate(components):
            out[i, : len(self.usable)] = np.where(
                states[owner], 0.0, self._csr[self.usable] @ states.astype(np.float64)
            )
        return out

    def _entered(self, components: Sequence[Bools], least: Floats) -> Floats | None:
        """How much (at most 1) a flow enters each that enters them most in sum; None where no flow has `least`."""
        from scipy.sparse import csr_array, eye_array, hstack, vstack

        bounded = np.flatnonzero(np.isfinite(least))
        k = len(components)
        objective = np.concatenate((np.zeros(self.gains.shape[1]), np.ones(k)))
        above = hstack((csr_array(-self.entering(components)), eye_array(k)), format="csr")
        floor = hstack(
            (csr_array(-self.gains[bounded]), csr_array((len(bounded), k))), format="csr"
        )
        limit = np.concatenate((np.zeros(k), -least[bounded] + TOLERANCE / 100))
        found = self._solve(
            objective, vstack((above, floor), format="csr"), limit, extra=[(0.0, 1.0)] * k
        )
        if found is None:
            return None
        return np.zeros(k) if found[0] is None else np.asarray(found[0][-k:])


def corners(flow: Flow, first: int, second: int, least: Floats) -> list[tuple[float, float]] | None:
    """The corners of the Pareto curve of two objectives, by falling value of the first; None where `least` cannot be had.

    Weighted sums are maximised: first those of one objective (ties broken by the other), then those that are constant on
    the line between two neighbours, until nothing lies beyond it. Raises NumericalError where an objective is unbounded.
    """

    def at(weights: tuple[float, float], floor: Floats) -> Floats | None:
        w = np.zeros(flow.objectives)
        w[first], w[second] = weights
        found = flow.best(w, floor)
        if found is None:
            return None
        if not np.isfinite(found.value):
            raise NumericalError(
                "a reward of this Pareto query has no bound: some strategy collects it for ever"
            )
        return found.gains[[first, second]]

    def extreme(main: int, other: int) -> Floats | None:
        weights = ((1.0, 0.0), (0.0, 1.0))
        best = at(weights[main], least)
        if best is None:
            return None
        floor = least.copy()
        index = (first, second)[main]
        floor[index] = max(floor[index], best[main] - 1e-10 * max(1.0, abs(best[main])))
        return at(weights[other], floor)

    ends = extreme(0, 1), extreme(1, 0)
    if ends[0] is None or ends[1] is None:
        return None
    points = [ends[0], ends[1]]
    done = False
    while not done:
        done = True
        for i, (p, q) in enumerate(pairwise(points)):
            normal = np.array([p[1] - q[1], q[0] - p[0]])
            normal = np.abs(normal) / max(np.abs(normal).max(), 1e-300)
            found = at((float(normal[0]), float(normal[1])), least) if _apart(p, q) else None
            if found is not None and normal @ found > normal @ p + TOLERANCE * max(
                1.0, np.abs(p).max()
            ):
                points.insert(i + 1, found)
                done = False
                break
    kept = [p for i, p in enumerate(points) if i == 0 or _apart(p, points[i - 1])]
    return [(float(x), float(y)) for x, y in kept]


def _apart(p: Floats, q: Floats) -> bool:
    return bool(np.abs(p - q).max() > 100 * TOLERANCE * max(1.0, np.abs(p).max()))
