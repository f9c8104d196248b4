"""Bounds on the reward of a path, without which no interval of its mean holds.

A small chain is explored completely, and the greatest reward of a path found by dynamic
programming. Otherwise the ranges of variables bound the reward of a step, and the number of steps
that of a path.
"""

from __future__ import annotations

from math import ceil, inf

import numpy as np

from symcheck.errors import ModelFault
from symcheck.matrices.rows import Bools, Floats
from symcheck.numerics.graph import backward_reachable, forward_reachable
from symcheck.simulate import tuning
from symcheck.simulate.intervals import UNKNOWN, Range
from symcheck.simulate.lazy_chain import LazyChain

__all__ = ["StepRewards"]


class StepRewards:
    """The rewards of a chain, from which those of paths follow.

    Args:
        chain: knows the initial state, number 0; it is explored if it is small.
    """

    def __init__(self, chain: LazyChain) -> None:
        self.chain = chain
        try:
            chain.explore(tuning.MAX_EXPLORED_STATES)
        except ModelFault:  # in a state that perhaps no sampled path reaches
            self._complete = False
        else:
            self._complete = chain.is_complete

    def of_states(self) -> Range:
        """Bounds on the reward of a state."""
        if not self._complete:
            return self.chain.source.reward_ranges()[0]
        states = self._states
        return Range(float(states.min()), float(states.max()))

    def until(self, time: float) -> Range:
        """Bounds on the reward of a path until a time."""
        if self.chain.continuous:
            states, jumps = _times(self.of_states(), time), self._of_transitions()
            return Range(states.low + jumps.low, states.high + jumps.high)
        steps = ceil(time)
        if not self._complete:
            states, jumps = self.chain.source.reward_ranges()
            return _times(Range(states.low + jumps.low, states.high + jumps.high), steps)
        of_steps = self._of_steps()
        found = self._of_paths(of_steps, None, steps)
        one = Range(float(of_steps.min()), float(of_steps.max()))
        return found or _times(one, steps)

    def before(self, target: int) -> Range:
        """Bounds on the reward of a path before it reaches the states of atom `target`.

        Both are infinite if a path that never reaches them has a positive probability.
        """
        if not self._complete:
            least = min(r.low for r in self.chain.source.reward_ranges())
            return Range(0.0 if least >= 0 else -inf, inf)
        reached = self.chain.satisfies(target, np.arange(len(self.chain), dtype=np.int32))
        if self._can_miss(reached):
            return Range(inf, inf)
        rewards = self.chain.earned() if self.chain.continuous else self._of_steps()
        found = self._of_paths(rewards, reached, None) or Range(
            0.0 if rewards.min() >= 0 else -inf, inf
        )
        if self.chain.continuous:  # a state is left after any time
            states = self._states[~reached]
            found = Range(
                found.low if states.min(initial=0.0) >= 0 else -inf,
                found.high if states.max(initial=0.0) <= 0 else inf,
            )
        return found

    def _can_miss(self, target: Bools) -> bool:
        """Whether a path from the first state enters one from which the target is unreachable."""
        matrix, _ = self.chain.graph()
        first = np.arange(matrix.states) == 0
        entered = forward_reachable(matrix, first, ~target)
        return not backward_reachable(matrix, target)[entered].all()

    @property
    def _states(self) -> Floats:
        return self.chain.reward(np.arange(len(self.chain), dtype=np.int32))

    def _of_steps(self) -> Floats:
        """The reward of each transition, with that of the state before it."""
        matrix, _ = self.chain.graph()
        return np.repeat(self._states, np.diff(matrix.indptr)) + self.chain.earned()

    def _of_transitions(self) -> Range:
        """Bounds on the rewards of all transitions of a path of a CTMC together."""
        if self._complete:
            return self._of_paths(self.chain.earned(), None, None) or UNKNOWN
        jumps = self.chain.source.reward_ranges()[1]
        return jumps if jumps == Range(0.0, 0.0) else UNKNOWN

    def _of_paths(self, rewards: Floats, target: Bools | None, steps: int | None) -> Range | None:
        """Bounds on the rewards of paths of so many steps, or of any number, from the first state.

        None if too much work does not give them, such as on a cycle with a reward.
        """
        matrix, _ = self.chain.graph()
        starts, targets = matrix.indptr[:-1], matrix.indices
        rounds = min(
            matrix.states + 1 if steps is None else steps,
            tuning.MAX_RANGE_ROUNDS,
            tuning.MAX_RANGE_WORK // max(1, len(targets)),
        )
        low, high = np.zeros(matrix.states), np.zeros(matrix.states)
        for step in range(rounds + 1):
            if step == steps:
                break
            lower = np.minimum.reduceat(rewards + low[targets], starts)
            upper = np.maximum.reduceat(rewards + high[targets], starts)
            if target is not None:
                lower[target] = upper[target] = 0.0
            if np.array_equal(low, lower) and np.array_equal(high, upper):
                break
            low, high = lower, upper
        else:
            return None
        return Range(float(low[0]), float(high[0]))


def _times(one: Range, factor: float) -> Range:
    """Bounds on a multiple; nothing is unknown of nothing."""
    return Range(one.low * factor, one.high * factor) if factor else Range(0.0, 0.0)
