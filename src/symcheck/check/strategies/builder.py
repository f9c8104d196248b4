"""The choices of a strategy, state by state.

A choice that attains the maximum of the equations for reachability need not reach the target: in an
end component, staying is as good as leaving, so that the strategy may stay for ever. Therefore
states with probability 1 take choices that move nearer to the target, states with minimal
probability 0 take choices that stay among such states, and in the other states each end component
is treated as a single state with one choice that leaves it.
Source: Baier & Katoen (2008), 10.6.1.

For a long-run average, a run reaches an end component and follows an optimal policy there.
Source: Puterman (1994), chapter 9.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from symcheck.check.context import CheckLog, Context
from symcheck.check.measures.ended_reward import kept_reward
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.check.measures.total_reward import (
    greatest_total,
    reward_free_mecs,
    total_per_step,
    total_reward,
)
from symcheck.check.strategies.to_explicit import rows_engine
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, Values
from symcheck.engines.explicit.intervals import IntervalEngine
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import NumericalError, UnsupportedError
from symcheck.matrices.numbers import Numbers, is_infinite
from symcheck.matrices.rows import Bools, Int32s, Int64s, first_best, per_row, spans, starts_of
from symcheck.numerics import graph
from symcheck.numerics.game_graph import Arena
from symcheck.semantics.rewards import Reward

__all__ = ["StrategyBuilder"]


class StrategyBuilder:
    """Chooses a row for each state; -1 if every row is as good."""

    def __init__(self, context: Context, direction: Direction) -> None:
        self.explicit = explicit = rows_engine(context)
        self.context, self.direction = context, direction
        self.engine = engine = context.engine
        self.edges = graph.Incidence(explicit.matrix)
        self.rows: Int64s = np.full(engine.states, -1, dtype=np.int64)
        self.values: Numbers | None = None

    @property
    def _maximises(self) -> Bools:
        """The states in which the greatest value is chosen."""
        theirs = self.explicit.opponents
        none = np.zeros(self.engine.states, np.bool_)
        return (none if theirs is None else theirs) ^ (self.direction is Direction.MAX)

    def strategy(
        self, direction: Direction, memory: Int32s | None = None, entry: Int64s | None = None
    ) -> Strategy:
        """The strategy of the chosen rows, and of the first row in other states; of a product, its
        memory and entry are those of `Strategy`.
        """
        free, explicit = self.rows < 0, self.explicit
        rows = np.where(free, self.edges.groups[:-1], self.rows)
        if (uncertain := explicit.capability(IntervalEngine)) is not None:
            values = np.zeros(explicit.states) if self.values is None else self.values
            explicit = uncertain.with_nature(values, self.direction)
        return Strategy(explicit, rows, direction, ~free, memory, entry)

    def next(self, target: StateSet) -> None:
        """Choose rows with maximal (minimal) probability of entering the target."""
        values = self.engine.system(self.engine.all).one_step_probability(target)
        sign = np.where(self._maximises, 1, -1)
        self.rows = first_best(values * per_row(self.edges.groups, sign), self.edges.groups)

    def until(self, left: StateSet, right: StateSet) -> None:
        """Choose rows with maximal (minimal) probability of left U right."""
        questions = self.engine.graph
        yes, no = (
            questions.prob1(left, right, self.direction),
            questions.prob0(left, right, self.direction),
        )
        if self.engine.has_opponents:
            to, arena = self.engine.to_bools, Arena(self.edges, ~self._maximises)
            away = arena.into(to(~(left | right)))
            _, rows = arena.almost_surely(arena.into(to(right)), away, to(left - right))
            self._take(to(yes - right), rows)
            self._stay(to(no), to(no & (left - right)))
        elif self.direction is Direction.MAX:
            to = self.engine.to_bools
            _, rows = graph.prob1e_strategy(self.edges, to(left), to(right))
            self._take(to(yes - right), rows)
        else:
            self._stay(self.engine.to_bools(no), self.engine.to_bools(no & (left - right)))
        self._attain(~(yes | no), lambda c: until(c, left, right, self.direction))

    def accept(self, pairs: Sequence[tuple[StateSet, Sequence[StateSet]]]) -> StateSet:
        """Choose rows that satisfy one of the pairs (avoid, visits), of at most one visit.

        Returns:
            The states of accepting end components.
        """
        to, known = self.engine.to_bools, np.zeros(self.engine.states, dtype=np.bool_)
        for avoid, visits in pairs:
            good = graph.accepting_end_components(
                self.edges, [(to(avoid), [to(v) for v in visits])]
            )
            visited = good.copy()
            for visit in visits:
                visited &= to(visit)
            _, rows = graph.prob1e_strategy(self.edges, good, visited)
            mine = good & ~known
            self._take(mine & ~visited, rows)
            self._stay(good, mine & visited)
            known |= good
        return self.engine.from_bools(known)

    def reward(self, reward: Reward, target: StateSet) -> None:
        """Choose rows with maximal (minimal) expected reward until the target."""
        certain = self.engine.graph.prob1(self.engine.all, target, self.direction.dual)
        unknown = certain - target
        if is_infinite(self.engine.system(unknown).step_rewards(reward)).any():
            raise UnsupportedError(
                "strategies are not supported if a reward of a single step is infinite"
            )
        if self.engine.has_opponents:
            to, arena = self.engine.to_bools, Arena(self.edges, self._maximises)
            none = np.zeros_like(arena.into(to(target)))
            _, rows = arena.almost_surely(arena.into(to(target)), none, to(~target))
            self._take(to(~certain) & self._maximises, rows)
        elif self.direction is Direction.MAX:
            self._avoid(target)
        self._attain(unknown, lambda c: reach_reward(c, reward, target, self.direction))

    def kept(self, reward: Reward, target: StateSet) -> None:
        """Choose rows of both sides for the reward until the target, or for ever."""
        to, system = self.engine.to_bools, self.engine.system(self.engine.all)
        inside = per_row(self.edges.groups, to(~target))
        pays = np.asarray((system.step_rewards(reward) > 0) & inside, np.bool_)
        arena = Arena(self.edges, ~self._maximises, ~inside)
        some, _ = arena.attract(pays, to(~target))
        endless, rows = arena.repeatedly(pays, arena.into(to(target)))
        self._take(endless, rows)
        nothing = ~some & ~to(target)
        leaves = arena.into(some) | pays
        self._keep(np.flatnonzero(~leaves & per_row(self.edges.groups, nothing)))
        self._attain(
            self.engine.from_bools(some & ~endless),
            lambda c: kept_reward(c, reward, target, self.direction),
        )

    def total(self, reward: Reward) -> None:
        """Choose rows with maximal (minimal) expected reward over infinite runs."""
        whole, per_step = total_per_step(self.context, reward)
        if self.direction is Direction.MIN:
            free = reward_free_mecs(whole, per_step)
            self.reward(reward, self.engine.from_bools(free.of >= 0))
            self._keep(np.flatnonzero(free.rows))
            return
        parts = greatest_total(self.context, whole, per_step)
        self._attain(parts.unknown, lambda c: total_reward(c, reward, self.direction))
        # From where infinite rewards are possible, a run reaches a component that pays for ever
        # with positive probability, and stays there.
        self._approach(parts.collecting, np.zeros_like(parts.collecting))
        paying = np.flatnonzero(parts.paying)
        owners = np.zeros_like(parts.collecting)
        owners[self.edges.owner[paying]] = True
        _, rows = graph.prob1e_strategy(self.edges, parts.collecting, owners)
        self._take(parts.collecting & ~owners, rows)
        self._keep(paying)

    def average(self, rewards: Numbers) -> None:
        """Choose rows with maximal (minimal) long-run average of the rewards of rows."""
        from symcheck.check.measures.long_run_mdp import solved_averages
        from symcheck.numerics.long_run.mean_payoff import gain_policy

        options, matrix = self.context.options, self.explicit.matrix
        whole = self.engine.system(self.engine.all)
        averages = solved_averages(self.context, whole, rewards, self.direction)
        gains, optimal = averages.gains, averages.solution.strategy
        try:
            self.rows = gain_policy(matrix, rewards, self.direction, gains, options)
        except NumericalError as error:
            raise UnsupportedError(str(error)) from error
        if optimal is None:  # all end components are as good: any is reached
            settled = gains.parts.of >= 0
            _, rows = graph.prob1e_strategy(self.edges, np.ones_like(settled), settled)
            self._take(~settled, rows)
            return
        chosen = np.where(optimal >= 0, averages.origin[optimal], -1)
        leaving = np.zeros(self.engine.states, np.bool_)
        leaving[self.edges.owner[chosen[chosen >= 0]]] = True
        # Within a component that a run leaves, it goes to the state of the row that leaves.
        inner = np.flatnonzero(gains.parts.rows)
        counts = np.bincount(self.edges.owner[inner], minlength=self.engine.states)
        inside = matrix.choose(inner, starts_of(counts))
        left = chosen[averages.state] >= 0
        _, rows = graph.prob1e_strategy(inside, left, leaving)
        self._take(left & ~leaving, np.where(rows >= 0, inner[rows], -1))
        self._keep(chosen[chosen >= 0])

    def discounted(self, reward: Reward, discount: Fraction) -> None:
        """Choose rows with maximal (minimal) discounted reward over all steps."""
        from symcheck.check.measures.discounted import solved_discounted

        system = self.engine.system(self.engine.all, self.direction)
        rewards = system.step_rewards(reward)
        solution = solved_discounted(self.context, system, rewards, discount, self.direction)
        assert solution.strategy is not None
        self.rows = solution.strategy

    def _take(self, where: Bools, rows: Int64s) -> None:
        """Set the rows of some states; -1 for none."""
        self.rows = np.where(where & (rows >= 0), rows, self.rows)

    def _keep(self, rows: Int64s) -> None:
        """Choose the first of these rows in each of their states."""
        self.rows[self.edges.owner[rows[::-1]]] = rows[::-1]

    def _stay(self, within: Bools, where: Bools) -> None:
        """In the states `where`, choose a row that stays `within` with probability 1."""
        everywhere, out = np.ones(self.engine.states, np.bool_), ~within
        leaves = self.explicit.weights.sums(everywhere, out) > 0
        self._keep(np.flatnonzero(~leaves & where[self.edges.owner]))

    def _avoid(self, target: StateSet) -> None:
        """In states that can avoid the target, choose rows that do so with positive probability."""
        to = self.engine.to_bools
        avoiding = to(self.engine.graph.prob0(self.engine.all, target, Direction.MIN))
        self._stay(avoiding, avoiding)
        self._approach(avoiding, to(target))

    def _approach(self, goal: Bools, without: Bools) -> None:
        """Outside of two sets, choose rows that reach `goal` with positive probability."""
        known, frontier, ahead = goal | without, goal, True
        while ahead:
            rows = self.edges.rows_in[
                spans(self.edges.pre[:-1][frontier], self.edges.pre[1:][frontier])
            ].astype(np.int64)
            rows = rows[~known[self.edges.owner[rows]]]
            owners = self.edges.owner[rows]
            self.rows[owners] = rows
            frontier = np.zeros_like(known)
            frontier[owners] = True
            known = known | frontier
            ahead = len(rows) > 0

    def _attain(self, unknown: StateSet, measure: Callable[[Context], Values]) -> None:
        """Choose the rows that attain the solution over the unknowns: that of the value, or where
        the value came without one, by graph analysis or step by step, that of the measure.
        """
        context = self.context
        if self.explicit.capability(IntervalEngine) is not None:  # nature answers to values
            self.values = measure(replace(context, log=CheckLog())).at(self.engine.all)[0]
        if not unknown:
            return
        if context.choices(unknown) is None:
            options = replace(context.options, method="auto")
            context = replace(context, options=options, log=CheckLog())
            measure(context)
        choices = context.choices(unknown)
        assert choices is not None
        members = self.engine.to_bools(unknown)
        rows = self.edges.groups[:-1][members] + choices
        self.rows[members] = np.where(choices < 0, -1, rows)
