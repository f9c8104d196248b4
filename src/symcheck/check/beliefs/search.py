"""Bounds on values of partially observed models, from both sides.

What strategies attain is bounded from one side by those that follow beliefs as far as these were
explored, and then a strategy with little memory. From the other side, beliefs beyond those that
are kept exactly are replaced by convex combinations of points of a grid, and where the grid ends,
states are assumed to be seen: what is known more can only help. No round makes bounds worse.
Whether they meet is undecidable.

Sources: Lovejoy (1991); Norman, Parker & Zou (2017), 'Verification and control of partially
observable probabilistic systems'; Bork, Katoen & Quatmann (2022), 'Under-approximating expected
total rewards in POMDPs'; Madani, Hanks & Condon (2003), 'On the undecidability of probabilistic
planning and related stochastic optimization problems'.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf

import numpy as np

from symcheck.check import tuning
from symcheck.check.beliefs.engine import reached, rows_matrix
from symcheck.check.beliefs.model import ObservedModel
from symcheck.check.beliefs.policies import Policies, Policy
from symcheck.check.context import Context
from symcheck.check.measures.reachability import reach_reward, until
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers, doubles, full
from symcheck.matrices.rows import Bools, Floats, Int64s
from symcheck.numerics import graph
from symcheck.numerics.beliefs.exploration import Exploration
from symcheck.numerics.beliefs.memory import Memory
from symcheck.numerics.beliefs.observed import GOAL, SINK, Observed
from symcheck.semantics.path_formulas import UntilPath
from symcheck.semantics.rewards import Reward
from symcheck.semantics.time_bounds import Window

__all__ = ["Found", "Problem", "search"]


@dataclass(frozen=True, eq=False)
class Problem:
    """Reaching observable states through others, or what is earned on the way.

    Attributes:
        model: the model.
        left, right: the states to go through, and those to be reached; bool[states].
        reward: None: the probability is asked for.
        direction: whether the value should be small or large.
        window: the steps at which the states are to be reached.
        negative: whether the value is 1 minus this probability.
    """

    model: ObservedModel = field(repr=False)
    left: Bools = field(repr=False)
    right: Bools = field(repr=False)
    reward: Reward | None
    direction: Direction
    window: Window = field(default_factory=Window)
    negative: bool = False

    @property
    def towards(self) -> Direction:
        """Whether the probability or the reward should be small or large."""
        return self.direction.dual if self.negative else self.direction

    def path(self, over: Callable[[Bools], Bools]) -> UntilPath[StateSet]:
        """The path formula over other states; `over`: which of these a set of the model's means."""
        left, right = ArraySet(over(self.left)), ArraySet(over(self.right))
        return UntilPath(left, right, self.window, self.negative)


@dataclass(frozen=True, eq=False)
class Found:
    """Bounds on the values of some states that are known to be the current one.

    Attributes:
        lower, upper: per state, float64 or Fractions.
        rounded: whether bounds differ by rounding alone.
        text: what was explored.
        beliefs: their number.
        plan: what a strategy that attains the value is made of; None if there is none.
    """

    lower: Numbers = field(repr=False)
    upper: Numbers = field(repr=False)
    rounded: bool
    text: str
    beliefs: int
    plan: Plan | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Plan:
    """What a strategy does: it follows beliefs, or one with little memory.

    Attributes:
        problem: what is asked for.
        points: the beliefs (or memory values, if there are no beliefs) at the beginning.
        beliefs: those that are kept exactly; None: there are none.
        policies: what is done beyond them, and on which memory; None: they have no end.
    """

    problem: Problem = field(repr=False)
    points: Int64s = field(repr=False)
    beliefs: Exploration | None = field(repr=False)
    policies: Policies | None = field(repr=False)


Enough = Callable[[Floats, Floats], bool]
"""Whether bounds, each float64[k], are close enough."""


def search(context: Context, problem: Problem, starts: Int64s, enough: Enough) -> Found:
    """Bounds on the values from some states, each of which is known at the beginning.

    Args:
        context: the engine, the options and the log.
        problem: what is asked for.
        starts: the states.
        enough: ends the search.
    """
    return _Search(context, problem, starts).run(enough)


class _Search:
    def __init__(self, context: Context, problem: Problem, starts: Int64s) -> None:
        self.context, self.problem, self.starts = context, problem, starts
        self.maximum = problem.towards is Direction.MAX
        self.base = problem.model.engine
        self.rational = self.base.is_rational
        goal, sink = self._settled()
        self.arrays: Observed = problem.model.arrays.settled(goal, sink)
        reward = problem.reward
        self.earned = None if reward is None else problem.model.earned(reward)
        self.exact = Exploration(self.arrays, self.earned, rational=self.rational)
        self.points = self.exact.points(starts)
        self.lower = np.zeros(len(starts))
        self.upper = np.full(len(starts), 1.0 if reward is None else inf)

    def _settled(self) -> tuple[Bools, Bools]:
        """The states whose value does not depend on the strategy: 1 (nothing more), and 0 (never).

        That is so whatever a strategy may see.
        """
        p = self.problem
        edges = graph.Incidence(self.base.matrix)
        if p.reward is None:
            sure = graph.prob1(edges, p.left, p.right, Direction.MIN)
            return sure, graph.prob0(edges, p.left, p.right, Direction.MAX)
        every = np.ones(len(p.right), np.bool_)
        return p.right, ~graph.prob1(edges, every, p.right, Direction.MAX)

    # --------------------------------------------------------------------------------------- rounds

    def run(self, enough: Enough) -> Found:
        by_sets = self._by_supports()
        if by_sets is not None:
            return by_sets
        most = self.context.options.beliefs or tuning.BELIEFS[-1]
        for limit in [*(n for n in tuning.BELIEFS if n < most), most]:
            self.exact.run(limit)
            if not len(self.exact.pending):
                return self._complete()
            if self.rational:
                continue
            self._observed()
            self._inner()
            grid = self._outer(tuning.GRID_BELIEFS * limit + 1000)
            if enough(*self._answer(self.lower, self.upper)):
                break
        text = f"{len(self.exact):,} beliefs"
        if self.rational:
            raise NumericalError(
                f"more than {text}: only finitely many beliefs have exact values",
                hint="without -exact there are bounds; -beliefs explores more",
            )
        text += f", and {grid}"
        plan = Plan(self.problem, self.points, self.exact, self.policies)
        bounds = self._answer(self.lower, self.upper)
        return Found(*bounds, False, text, len(self.exact), plan)

    def _answer(self, lower: Numbers, upper: Numbers) -> tuple[Numbers, Numbers]:
        """Bounds on the value, given those on the probability or the reward."""
        if not self.problem.negative:
            return lower, upper
        lower, upper = 1 - upper, 1 - lower
        if not self.rational:  # differences are rounded, but for those that are 0 and 1
            lower = np.where(lower % 1 > 0, np.nextafter(lower, 0), lower)
            upper = np.where(upper % 1 > 0, np.nextafter(upper, 1), upper)
        return lower, upper

    def _complete(self) -> Found:
        """The values, as all beliefs are known."""
        lower, upper, rounded = self._values(self.exact, None)
        text = f"all {len(self.exact):,} beliefs"
        plan = Plan(self.problem, self.points, self.exact, None)
        return Found(*self._answer(lower, upper), rounded, text, len(self.exact), plan)

    def _values(self, found: Exploration, cut: Numbers | None) -> tuple[Numbers, Numbers, bool]:
        """Bounds at the beginning, where beliefs that were not expanded have the values `cut`, and
        whether they differ by rounding alone.
        """
        matrix, earned = rows_matrix(found.rows(), cut, reward=self.earned is not None)
        direction = self.problem.towards
        return reached(self.context, self.base, matrix, GOAL, self.points, direction, earned)

    def _narrow(self, lower: Floats, upper: Floats, *, attained: bool) -> None:
        """Take bounds on what a strategy attains, or else on what no strategy exceeds.

        Bounds never become worse, and rounding does not exclude the value.
        """
        if attained is self.maximum:
            self.lower = np.maximum(self.lower, lower * (1 - ROUNDING))
        else:
            self.upper = np.minimum(self.upper, upper * (1 + ROUNDING))
        self.lower = np.minimum(self.lower, self.upper)

    # ------------------------------------------------------------------------------ from both sides

    def _observed(self) -> None:
        """The values with full observation, which bound all others, once."""
        if self.policies.found:
            return
        p, base = self.problem, self.base
        everywhere = np.ones(base.states, np.bool_)
        inner = self.context.within(base, everywhere)
        if p.reward is None:
            values = until(inner, ArraySet(p.left), ArraySet(p.right), p.towards)
        else:
            values = reach_reward(inner, p.reward, ArraySet(p.right), p.towards)
        low, high = values.at(inner.engine.all)
        self.seen: Floats = high * (1 + ROUNDING) if self.maximum else low * (1 - ROUNDING)
        self._narrow(self.seen[self.starts], self.seen[self.starts], attained=False)
        points = self.points[self.points > SINK]
        memory = self.policies.search.memory_of(self.exact.beliefs, points)
        self.policies.improve(self.context, memory, self.seen)

    def _inner(self) -> None:
        """What a strategy attains that follows the beliefs that are kept exactly."""
        beliefs = self.exact.beliefs
        cut = np.zeros(len(beliefs))
        ends = self.exact.pending
        cut[ends] = self.policies.bounds(beliefs, ends)[0]
        low, high, _ = self._values(self.exact, cut)
        self._narrow(low, high, attained=True)

    def _outer(self, most: int) -> str:
        """What beliefs are worth at best. Returns which grid was used.

        It is the finest one that has few points, or the first, even if it has too many.
        """
        given, resolution = self.context.options.grid_resolution, tuning.GRID_RESOLUTION
        best, closed, used = self.exact, True, given or resolution
        while closed and 3 * (len(best) - len(self.exact)) < most:
            wider = self.exact.clone()
            closed = wider.run(len(self.exact) + most, given or resolution, upper=self.maximum)
            if closed or best is self.exact:
                best, used = wider, given or resolution
            if given or resolution == tuning.FINEST_GRID:
                break
            resolution *= 2
        low, high, _ = self._values(best, best.beliefs.mean(self.seen))
        self._narrow(low, high, attained=False)
        return f"{len(best) - len(self.exact):,} points of a grid with resolution {used}"

    # ------------------------------------------------------------------------------ sets of states

    def _explored_supports(self, starts: Int64s) -> tuple[Exploration, Int64s] | None:
        found = Exploration(self.arrays, supports=True)
        points = found.points(starts)
        found.run(tuning.SUPPORTS)
        few = len(found.beliefs.states) <= tuning.SUPPORT_PAIRS and not len(found.pending)
        return (found, points) if few else None

    def _by_supports(self) -> Found | None:
        """The value where the sets of possible states decide it: 0, 1 or infinite."""
        p, rewards = self.problem, self.problem.reward is not None
        known = self._explored_supports(self.starts)
        if known is not None:
            found, points = known
        else:
            found, points = Exploration(self.arrays, supports=True), self.points[:0]
            found.by_observation()
            found.run(len(found))
        memory = Memory(self.arrays, found.beliefs, found.rows())
        sure, rows = memory.almost_surely()
        safe, safe_rows = memory.surely_safe()
        usable = rows if rewards and not self.maximum else np.ones_like(rows)
        earned = None if self.earned is None else doubles(self.earned)
        self.policies = Policies(self.base, found, memory, usable, earned, p.towards)
        if known is not None:
            if not rewards and self.maximum and sure[points].all():
                return self._decided(1.0, self._plan(rows, points))
            if rewards and not self.maximum and not sure[points].any():
                return self._decided(inf)
            if not rewards and not self.maximum and safe[points].all():
                return self._decided(0.0, self._plan(safe_rows, points))
        if self.maximum is rewards:
            misses = self._may_miss()
            if misses is rewards:
                return self._decided(inf if rewards else 1.0)
        return None

    def _may_miss(self) -> bool | None:
        """Whether some strategy may miss the target, if that is known.

        If so, it goes to a state from which it surely misses it, betting that it is there.
        """
        edges = graph.Incidence(self.base.matrix)
        sources = np.zeros(self.base.states, np.bool_)
        sources[self.starts] = True
        classes = self.arrays.classes
        reached = graph.forward_reachable(edges, sources, classes > SINK)
        if (reached & (classes == SINK)).any():
            return True
        singles = np.flatnonzero(reached & (classes > SINK))
        known = self._explored_supports(singles)
        if known is None:
            return None
        found, points = known
        safe, _ = Memory(self.arrays, found.beliefs, found.rows()).surely_safe()
        return bool(safe[points].any())

    def _decided(self, value: float, plan: Plan | None = None) -> Found:
        text = "sets of possible states decide"
        array = full(len(self.starts), value, rational=self.rational)
        return Found(*self._answer(array, array), False, text, 0, plan)

    def _plan(self, rows: Bools, points: Int64s) -> Plan:
        """A strategy that takes each of some rows with the same probability."""
        policy = Policy(self.policies.uniform(rows), np.zeros(0))
        return Plan(self.problem, points, None, replace(self.policies, found=[policy]))
