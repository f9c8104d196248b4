"""Several objectives of an MDP at once: linear programs over expected numbers of visits.

The variables of a program are how often a strategy is expected to take each row before it settles
in an end component, and the probability with which it settles at each state. They satisfy linear
equations: what flows into a state flows out or settles. With long-run averages there are also the
frequencies of the rows after settling: in each end component, what flows into a state flows out,
and all frequencies together are the probability of settling there. Expected values of objectives
are linear in the variables. So the set of achievable values is convex, and linear programs find its
vertices. Every objective is maximised: costs are negative rewards. Programs over doubles are solved
by HiGHS, programs over rationals are solved exactly.

Sources: Etessami, Kwiatkowska, Vardi & Yannakakis (2007), 'Multi-objective model checking of Markov
decision processes'; Forejt, Kwiatkowska, Norman, Parker & Qu (2011), 'Quantitative multi-objective
verification for probabilistic systems'; Brazdil, Brozek, Chatterjee, Forejt & Kucera (2014),
'Markov decision processes with multiple long-run average objectives'.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers, full, is_infinite, numbers
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, spans
from symcheck.numerics import graph
from symcheck.numerics.multi_objective.exact_lp import Optimum, Program, solve_program

__all__ = ["TOLERANCE", "Flow", "Outcome", "Stay", "settling"]

TOLERANCE = 1e-8
"""Accuracy of sums over a solution; HiGHS meets feasibility and optimality within 1e-10."""

Acceptance = Sequence[tuple[Bools, Sequence[Bools]]]
"""Pairs (avoid, visits), one of which is to be met: see `graph.accepting_end_components`."""


@dataclass(frozen=True, eq=False)
class Stay:
    """States at which a run may settle for ever, bool[n], and gains per objective, float64.

    accepted: a run gains these if it meets one of these pairs for ever. parts: the end components
    that these states form; None if no long-run average is asked for.
    """

    states: Bools
    gains: Floats
    accepted: Acceptance
    parts: graph.EndComponents | None = None


@dataclass(frozen=True, eq=False)
class Outcome:
    """The optimum of a linear program.

    Args:
        value: the optimal value; inf if the program is unbounded.
        gains: the value of each objective at the optimum; NaN if the program is unbounded.
        gap: distance to the bound of the dual program; 0 for rationals.
        x: the variables of the flow at the optimum; None if the program is unbounded.
    """

    value: float | Fraction
    gains: Numbers
    gap: float = 0.0
    x: Numbers | None = None


def settling(
    source: graph.Source,
    costless: Bools,
    acceptances: Sequence[Acceptance | None],
    *,
    averages: bool = False,
) -> list[Stay]:
    """Where a run may settle, and which objectives that satisfies.

    Args:
        source: the matrix of the MDP.
        costless: bool[rows]; other rows are not taken in an end component.
        acceptances: per objective, its acceptance condition, which gains 1; None for a reward.
        averages: whether there are long-run averages, for which the end components matter.

    Returns:
        End components for each subset of the objectives with a condition, so exponentially many.
        Without averages, states that satisfy more objectives are not repeated for fewer.
    """
    chosen = [i for i, a in enumerate(acceptances) if a is not None]
    edges = source if isinstance(source, graph.Incidence) else graph.Incidence(source)
    n = edges.matrix.states
    stays: list[Stay] = []
    for subset in sorted(range(1 << len(chosen)), key=lambda s: -s.bit_count()):
        members = [i for j, i in enumerate(chosen) if subset >> j & 1]
        pairs = _conjunction([acceptances[i] or [] for i in members], n)
        gains = np.zeros(len(acceptances))
        gains[members] = 1.0
        if averages:
            # An end component that satisfies less may be larger, and have a better average.
            stays += _components(edges, costless, pairs, gains)
            continue
        states = graph.accepting_end_components(edges, pairs, costless)
        for other in stays:
            if all(other.gains[i] for i in members):
                states &= ~other.states
        if states.any():
            stays.append(Stay(states, gains, pairs))
    return stays


def _components(
    edges: graph.Incidence,
    costless: Bools,
    pairs: Sequence[tuple[Bools, Sequence[Bools]]],
    gains: Floats,
) -> list[Stay]:
    """A stay with its end components for each pair."""
    stays: list[Stay] = []
    for avoid, visits in pairs:
        parts = graph.maximal_end_components(edges, ~avoid, costless)
        states = parts.meeting(visits)
        if states.any():
            of = np.where(states, parts.of, -1).astype(np.int32)
            rows = parts.rows & states[edges.owner_of_rows]
            components = graph.EndComponents(of, rows, parts.count)
            stays.append(Stay(states, gains, [(avoid, visits)], components))
    return stays


def _conjunction(acceptances: Sequence[Acceptance], n: int) -> list[tuple[Bools, list[Bools]]]:
    result: list[tuple[Bools, list[Bools]]] = [(np.zeros(n, dtype=np.bool_), [])]
    for pairs in acceptances:
        result = [(avoid | a, [*visits, *v]) for avoid, visits in result for a, v in pairs]
    return result


@dataclass(frozen=True, eq=False)
class Flow:
    """The linear equations of an MDP's flow from one initial state.

    Args:
        matrix: the MDP; its entries and the rewards are float64, or all of them rationals.
        initial: the number of the initial state.
        rewards: [objectives, rows], what each row gains for each objective.
        averages: [objectives, rows], what each row gains for a long-run average.
        stays: where runs may settle.
        costless: bool[rows], the rows that may be taken after settling.
        banned: bool[states], states that must not be entered; None for none.
    """

    matrix: SparseMatrix
    initial: int
    rewards: Numbers = field(repr=False)
    averages: Numbers = field(repr=False)
    stays: Sequence[Stay] = field(repr=False)
    costless: Bools = field(repr=False)
    banned: Bools | None = field(default=None, repr=False)

    @property
    def is_rational(self) -> bool:
        """Whether the numbers are rationals."""
        return self.matrix.is_rational

    @property
    def tolerance(self) -> float | Fraction:
        """What the linear programs leave open: nothing for rationals."""
        return Fraction(0) if self.is_rational else TOLERANCE

    @property
    def objectives(self) -> int:
        """Number of objectives."""
        return len(self.rewards)

    @cached_property
    def edges(self) -> graph.Incidence:
        """The matrix seen from its columns."""
        return graph.Incidence(self.matrix)

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
            usable &= self._row_sums(self.banned) == 0
        return np.flatnonzero(usable)

    @cached_property
    def settling_states(self) -> list[Int64s]:
        """Per stay: the states where it may be taken."""
        return [np.flatnonzero(s.states & self.live) for s in self.stays]

    @cached_property
    def lasting(self) -> list[Int64s]:
        """Per stay: the rows whose frequencies after settling are variables."""
        live = self.live[self.edges.owner_of_rows]
        return [
            np.flatnonzero(live & s.parts.rows) if s.parts is not None else self.usable[:0]
            for s in self.stays
        ]

    def _row_sums(self, states: Bools) -> Numbers:
        """Per row of all states: the probability of entering some states."""
        return self.matrix.sums(np.ones(self.matrix.states, np.bool_), states)

    def _full(self, n: int, value: float) -> Numbers:
        return full(n, value, rational=self.is_rational)

    def _zeros(self, rows: int, columns: int) -> Numbers:
        return self._full(rows * columns, 0).reshape(rows, columns)

    @cached_property
    def _balance(self) -> tuple[Int64s, Int64s, Numbers]:
        """Rows, columns and entries: outflow + settling - inflow = begin, per live state."""
        m, number, rows = self.matrix, np.cumsum(self.live) - 1, self.usable
        entries = spans(m.indptr[:-1][rows], m.indptr[1:][rows])
        source = np.repeat(np.arange(len(rows)), m.lengths[rows])
        inside = self.live[m.indices[entries]]
        settled = np.concatenate(
            [number[:0], *(number[settling_states] for settling_states in self.settling_states)]
        )
        equations = (
            number[self.edges.owner_of_rows[rows]],
            number[m.indices[entries[inside]]],
            settled,
        )
        variables = (
            np.arange(len(rows)),
            source[inside],
            np.arange(len(rows), len(rows) + len(settled)),
        )
        values = (
            self._full(len(rows), 1),
            -m.data[entries[inside]],
            self._full(len(settled), 1),
        )
        return np.concatenate(equations), np.concatenate(variables), np.concatenate(values)

    @cached_property
    def _recurrence(self) -> tuple[Int64s, Int64s, Numbers, int]:
        """Rows, columns and entries of the equations of frequencies, and their number.

        Per end component of a stay: settling - frequencies = 0; per state: outflow - inflow = 0.
        """
        m = self.matrix
        equations, variables = [self.usable[:0]], [self.usable[:0]]
        values = [self._full(0, 0)]
        settled = len(self.usable)
        frequency = settled + sum(map(len, self.settling_states))
        count = 0
        for stay, settling_states, rows in zip(
            self.stays, self.settling_states, self.lasting, strict=True
        ):
            if stay.parts is not None:
                of, owner = stay.parts.of, self.edges.owner_of_rows[rows]
                components = np.unique(of[settling_states])
                states = count + len(components)
                entries = spans(m.indptr[:-1][rows], m.indptr[1:][rows])
                columns = frequency + np.arange(len(rows))
                equations += [
                    count + np.searchsorted(components, of[settling_states]),
                    count + np.searchsorted(components, of[owner]),
                    states + np.searchsorted(settling_states, owner),
                    states + np.searchsorted(settling_states, m.indices[entries]),
                ]
                variables += [
                    settled + np.arange(len(settling_states)),
                    columns,
                    columns,
                    np.repeat(columns, m.lengths[rows]),
                ]
                values += [
                    self._full(len(settling_states), 1),
                    self._full(len(rows), -1),
                    self._full(len(rows), 1),
                    -m.data[entries],
                ]
                count = states + len(settling_states)
                frequency += len(rows)
            settled += len(settling_states)
        return (
            np.concatenate(equations),
            np.concatenate(variables),
            np.concatenate(values),
            count,
        )

    @cached_property
    def _right(self) -> Numbers:
        """The right sides of all equations: 1 for the initial state, 0 for all others."""
        right = self._full(int(self.live.sum()) + self._recurrence[3], 0)
        if self.live[self.initial]:
            right[int(self.live[: self.initial].sum())] = self._full(1, 1)[0]
        return right

    @property
    def equations(self) -> int:
        """The number of equations, without those of bounds."""
        return len(self._right)

    @cached_property
    def gains(self) -> Numbers:
        """What each variable of the program gives each objective: [objectives, variables]."""
        parts = [self.rewards[:, self.usable]]
        parts += [
            np.tile(numbers(stay.gains, rational=self.is_rational)[:, None], len(settling_states))
            for stay, settling_states in zip(self.stays, self.settling_states, strict=True)
        ]
        parts += [self.averages[:, rows] for rows in self.lasting]
        return np.concatenate(parts, axis=1)

    def best(self, weights: Numbers, least: Numbers) -> Outcome | None:
        """The greatest weighted sum of objectives that are at least `least`; None if infeasible."""
        bounded = np.flatnonzero(~is_infinite(least))
        optimum = self._solve(self.gains.T @ weights, -self.gains[bounded], -least[bounded])
        if optimum is None:
            return None
        unbounded = optimum.x is None
        gains = np.full(self.objectives, np.nan) if unbounded else self.gains @ optimum.x
        return Outcome(optimum.value, gains, optimum.gap, optimum.x)

    def margin(self, least: Numbers) -> Outcome | None:
        """By how much all of `least` can be exceeded, at most 1; negative if it cannot be met."""
        bounded = np.flatnonzero(~is_infinite(least))
        one = self._full(len(bounded), 1)
        # The last variable is what is missing to a margin of 1.
        objective = np.append(self._full(self.gains.shape[1], 0), self._full(1, -1))
        above = np.concatenate((-self.gains[bounded], -one[:, None]), axis=1)
        optimum = self._solve(objective, above, -least[bounded] - one)
        if optimum is None:
            return None
        if optimum.x is None:
            raise NumericalError("a linear program that its solver takes for unbounded is not")
        x = optimum.x[:-1]
        return Outcome(1 + optimum.value, self.gains @ x, optimum.gap, x)

    def _solve(self, objective: Numbers, above: Numbers, limit: Numbers) -> Optimum | None:
        """Maximise; above x <= limit, and no variable is negative. None if infeasible."""
        if not self.live[self.initial]:
            return None
        rows, columns, values = self._balance
        more, variables, entries, _ = self._recurrence
        n, k, size = self.equations, len(limit), len(objective)
        settling_states = np.nonzero(above != 0)
        slack = np.arange(k)
        program = Program(
            np.concatenate((rows, int(self.live.sum()) + more, n + settling_states[0], n + slack)),
            np.concatenate((columns, variables, settling_states[1], size + slack)),
            np.concatenate((values, entries, above[settling_states], self._full(k, 1))),
            np.concatenate((self._right, limit)),
            np.concatenate((objective, self._full(k, 0))),
        )
        optimum = solve_program(program)
        if optimum is None or optimum.x is None:
            return optimum
        return replace(optimum, x=optimum.x[:size])

    def connected(self, least: Numbers) -> Flow:
        """The flow without circulation that never comes from the initial state.

        Circulation in an end component with a positive reward has a value. It stands for strategies
        only if a strategy that meets `least` enters the component. Components that no such strategy
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
        """End components with a positive reward of some objective and without the initial state."""
        allowed = np.zeros(self.matrix.rows, dtype=np.bool_)
        allowed[self.usable] = True
        parts = graph.maximal_end_components(self.edges, self.live, allowed)
        positive = parts.rows & (self.rewards > 0).any(axis=0)
        numbers = np.unique(parts.of[self.edges.owner_of_rows[positive]])
        return [parts.of == c for c in numbers.tolist() if c >= 0 and parts.of[self.initial] != c]

    def _never_entered(self, components: Sequence[Bools], least: Numbers) -> list[Bools]:
        """The components that no flow with at least `least` enters; none without such a flow."""
        left = list(components)
        while left:
            amounts = self._entered(left, least)
            if amounts is None:
                return []
            # One flow need not enter all that some flow enters: ask again for the others.
            entered = amounts > 10 * self.tolerance
            if not entered.any():
                break
            left = [c for c, yes in zip(left, entered.tolist(), strict=True) if not yes]
        return left

    def _entering(self, components: Sequence[Bools]) -> Numbers:
        """How much of each variable enters each component: [components, variables]."""
        owner = self.edges.owner_of_rows[self.usable]
        out = self._zeros(len(components), self.gains.shape[1])
        for i, states in enumerate(components):
            outside = np.flatnonzero(~states[owner])
            out[i, outside] = self._row_sums(states)[self.usable[outside]]
        return out

    def _entered(self, components: Sequence[Bools], least: Numbers) -> Numbers | None:
        """How much the flow enters each, up to 1, where the sum is greatest; None if infeasible."""
        bounded = np.flatnonzero(~is_infinite(least))
        k, size = len(components), self.gains.shape[1]
        unit = numbers(np.eye(k).ravel(), rational=self.is_rational).reshape(k, k)
        above = np.concatenate(
            (
                np.concatenate((-self._entering(components), unit), axis=1),
                np.concatenate((self._zeros(k, size), unit), axis=1),
                np.concatenate((-self.gains[bounded], self._zeros(len(bounded), k)), axis=1),
            )
        )
        slack = 0 if self.is_rational else TOLERANCE / 100
        zeros, ones = self._full(k, 0), self._full(k, 1)
        limit = np.concatenate((zeros, ones, -least[bounded] + slack))
        objective = np.concatenate((self._full(size, 0), ones))
        optimum = self._solve(objective, above, limit)
        if optimum is None:
            return None
        return zeros if optimum.x is None else optimum.x[size:]
