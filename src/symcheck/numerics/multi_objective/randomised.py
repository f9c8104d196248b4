"""The randomised strategy of a solution of the linear programs of a multi-objective query.

Before it settles, the strategy takes each row of a state in proportion to the expected number of
times that the solution says, and settles in proportion to its probability of doing so. After
settling without long-run averages, it takes all rows of an accepting end component with the same
probability, so that it visits each state again and again. With long-run averages it takes rows in
proportion to their frequencies; if these fall into several classes, it chooses one of them when it
settles.

Sources: Etessami, Kwiatkowska, Vardi & Yannakakis (2007), theorem 3.2; Brazdil, Brozek, Chatterjee,
Forejt & Kucera (2014), section 4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import graph
from symcheck.numerics.multi_objective.linear_program import Flow, Stay

__all__ = ["ModeDecisions", "strategy_of_flow"]

_NOTHING = 1e-12
"""Variables of a solution in doubles up to this are 0: HiGHS meets equations within 1e-10."""
_LOST = 1e-6
"""A flow of this size in states that the strategy does not reach is no rounding error."""
_RARE = 1e-9
"""In doubles, a class of rows with this part of the frequencies of its component is rounding."""


@dataclass(frozen=True, eq=False)
class ModeDecisions:
    """What a strategy with modes decides; mode 0 is that of runs that have not settled.

    Attributes:
        state, mode: where a row is taken, int64[k].
        row: a row of the flow's matrix, int64[k].
        share: its probability, float64[k] or Fractions.
        following: the mode after it, int64[k].
    """

    state: Int64s
    mode: Int64s
    row: Int64s
    share: Numbers
    following: Int64s


@dataclass(frozen=True, eq=False)
class _Mode:
    """How a strategy goes on after settling.

    rows, shares: the rows that it takes, ascending by state, and the probability of each in its
    state. settling_states, amounts: where it settles in this mode, and with which probability.
    """

    rows: Int64s
    shares: Numbers
    settling_states: Int64s
    amounts: Numbers


def strategy_of_flow(flow: Flow, x: Numbers) -> ModeDecisions:
    """The strategy of a solution.

    Args:
        flow: the equations.
        x: a solution, float64[variables] or Fractions.

    Raises:
        UnsupportedError: no strategy with finite memory attains the values of the solution.
    """
    return _Solution(flow, x if flow.is_rational else np.where(x > _NOTHING, x, 0.0)).decisions()


@dataclass(frozen=True, eq=False)
class _Solution:
    """A solution of the equations of a flow."""

    flow: Flow
    x: Numbers
    owner: Int64s = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "owner", self.flow.edges.owner_of_rows.astype(np.int64))

    def decisions(self) -> ModeDecisions:
        flow, n = self.flow, self.flow.matrix.states
        modes = list(self._modes())
        usable = flow.usable
        amount = self.x[: len(usable)]
        rows, weights = usable[amount > 0], amount[amount > 0]
        total = full(n, 0, rational=flow.is_rational)
        np.add.at(total, self.owner[rows], weights)
        for settled in modes:
            np.add.at(total, settled.settling_states, settled.amounts)
        lost, detour = self._stuck(rows, modes, np.asarray(total > 0))
        kept = ~lost[self.owner[rows]]
        rows, weights = rows[kept], weights[kept] / total[self.owner[rows[kept]]]
        one = full(len(detour), 1, rational=flow.is_rational)
        zeros = np.zeros(len(rows) + len(detour), np.int64)
        rows = np.concatenate((rows, detour))
        parts = [(self.owner[rows], zeros, rows, np.concatenate((weights, one)), zeros)]
        for number, settled in enumerate(modes, 1):
            states, settling_states = self.owner[settled.rows], settled.settling_states
            there = np.full(len(states), number)
            parts.append((states, there, settled.rows, settled.shares, there))
            # Settling takes the first row of the mode at once.
            begin, end = (
                np.searchsorted(states, settling_states, side) for side in ("left", "right")
            )
            taken = spans(begin, end)
            settling = np.repeat(settled.amounts / total[settling_states], end - begin)
            share, after = settling * settled.shares[taken], np.full(len(taken), number)
            parts.append((states[taken], 0 * after, settled.rows[taken], share, after))
        state, mode, row, share, following = map(np.concatenate, zip(*parts, strict=True))
        sums = full(n * (len(modes) + 1), 0, rational=flow.is_rational)
        np.add.at(sums, state + mode * n, share)
        result = ModeDecisions(state, mode, row, share / sums[state + mode * n], following)
        self._check_reached(result, total)
        return result

    def _check_reached(self, decisions: ModeDecisions, total: Numbers) -> None:
        """Check that the strategy reaches what flows. Raises UnsupportedError."""
        flow = self.flow
        before = np.flatnonzero(decisions.following == 0)
        chain = _graph(flow.matrix, self.owner, decisions.row[before])
        start = np.zeros(flow.matrix.states, np.bool_)
        start[flow.initial] = True
        missed = total[~graph.forward_reachable(chain, start)]
        if (missed > (0 if flow.is_rational else _LOST * max(1.0, total.max()))).any():
            raise UnsupportedError(
                "no strategy attains this value: strategies only come as close to it as desired"
            )

    def _stuck(self, rows: Int64s, modes: list[_Mode], flowing: Bools) -> tuple[Bools, Int64s]:
        """States from which the rows of the solution do not lead to settling, and other rows there.

        The solution enters them by rounding only.
        """
        flow = self.flow
        settled = np.zeros(flow.matrix.states, np.bool_)
        for mode in modes:
            settled[mode.settling_states] = True
        chain = _graph(flow.matrix, self.owner, rows)
        stuck = ~graph.backward_reachable(chain, settled, flowing) & flow.live
        _, ahead = graph.prob1e_strategy(flow.edges, flow.live, settled)
        return stuck, ahead[stuck & (ahead >= 0)]

    # ------------------------------------------------------------------------------- settling

    def _modes(self) -> Iterator[_Mode]:
        """The modes in which the solution settles."""
        flow = self.flow
        begin = len(flow.usable)
        frequency = begin + sum(map(len, flow.settling_states))
        for stay, settling_states, lasting in zip(
            flow.stays, flow.settling_states, flow.lasting, strict=True
        ):
            amounts = self.x[begin : begin + len(settling_states)]
            often = self.x[frequency : frequency + len(lasting)]
            begin, frequency = begin + len(settling_states), frequency + len(lasting)
            some = np.asarray(amounts > 0)
            if not some.any():
                continue
            if stay.parts is None:
                rows = self._staying(stay)
                yield _Mode(rows, self._uniform(rows), settling_states[some], amounts[some])
            else:
                yield from self._averaging(
                    stay, settling_states[some], amounts[some], lasting, often
                )

    def _uniform(self, rows: Int64s) -> Numbers:
        counts = np.bincount(self.owner[rows], minlength=self.flow.matrix.states)
        return full(len(rows), 1, rational=self.flow.is_rational) / counts[self.owner[rows]]

    def _staying(self, stay: Stay) -> Int64s:
        """The rows of the accepting end components; each state keeps to its first pair."""
        edges = self.flow.edges
        chosen = np.zeros(self.flow.matrix.rows, np.bool_)
        known = np.zeros(self.flow.matrix.states, np.bool_)
        for avoid, visits in stay.accepted:
            parts = graph.maximal_end_components(edges, ~avoid, self.flow.costless)
            states = parts.meeting(visits) & ~known
            chosen |= parts.rows & states[self.owner]
            known |= states
        return np.flatnonzero(chosen)

    def _averaging(
        self, stay: Stay, settling_states: Int64s, amounts: Numbers, lasting: Int64s, often: Numbers
    ) -> Iterator[_Mode]:
        """A mode for each class of rows that are taken again and again."""
        assert stay.parts is not None
        matrix, n = self.flow.matrix, self.flow.matrix.states
        rows, often = lasting[often > 0], often[often > 0]
        frequency = full(n, 0, rational=self.flow.is_rational)
        np.add.at(frequency, self.owner[rows], often)
        within = np.asarray(frequency > 0)
        component = full(stay.parts.count, 0, rational=self.flow.is_rational)
        np.add.at(component, stay.parts.of[self.owner[rows]], often)
        for states in graph.bsccs(_graph(matrix, self.owner, rows), within):
            inside = np.zeros(n, np.bool_)
            inside[states] = True
            number = stay.parts.of[states[0]]
            part = frequency[states].sum() / component[number]
            if not self.flow.is_rational and part <= _RARE:
                continue
            ((_, visits),) = stay.accepted
            if not all((inside & visit).any() for visit in visits):
                raise UnsupportedError(
                    "no strategy with finite memory attains these long-run averages: the optimal "
                    "one visits the states of another objective ever more rarely"
                )
            taken = inside[self.owner[rows]]
            owners = self.owner[rows[taken]]
            inner = stay.parts.rows & (stay.parts.of == number)[self.owner]
            _, ahead = graph.prob1e_strategy(
                _graph(matrix, self.owner, np.flatnonzero(inner)), stay.parts.of == number, inside
            )
            towards = np.flatnonzero(inner)[ahead[ahead >= 0]]
            all_rows = np.concatenate((rows[taken], towards))
            one = full(len(towards), 1, rational=self.flow.is_rational)
            shares = np.concatenate((often[taken] / frequency[owners], one))
            order = np.argsort(all_rows)
            here = stay.parts.of[settling_states] == number
            yield _Mode(all_rows[order], shares[order], settling_states[here], amounts[here] * part)


def _graph(matrix: SparseMatrix, owner: Int64s, rows: Int64s) -> SparseMatrix:
    """The transitions of some rows; the states keep their numbers."""
    rows = np.unique(rows)
    counts = np.bincount(owner[rows], minlength=matrix.states)
    return matrix.choose(rows, starts_of(counts))
