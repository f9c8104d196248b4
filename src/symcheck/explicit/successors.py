"""The compiled successor function on its own: branches of given states, for sampling paths without
exploring the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from symcheck.explicit.compile import Code, compile_expression
from symcheck.explicit.faults import raise_model_fault
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.tables import compile_model, total_reward
from symcheck.kernels.explore.breadth_first import Expander
from symcheck.matrices.rows import Bools, Floats, Int64s
from symcheck.semantics.expressions.literals import LEAST
from symcheck.semantics.interpreter import state_rewards
from symcheck.semantics.model import BoundModel, BoundReward
from symcheck.semantics.rewards import Reward, reward_items

__all__ = ["Choices", "SuccessorGenerator", "Successors"]


@dataclass(frozen=True, eq=False)
class Choices:
    """The choices of n states and their branches, in the order of the model.

    Attributes:
        ends: int64[n], the end of the choices of each state.
        branch_ends: int64[choices], the end of the branches of each choice.
        weights: float64[branches]; rates in a CTMC, else probabilities within the choice.
        targets: uint64[branches, words], packed states.
        rewards: float64[choices], the transition reward of each choice.
        deadlocks: int64[d], which states have only a loop of weight 1 without a reward.
    """

    ends: Int64s
    branch_ends: Int64s
    weights: Floats
    targets: Rows
    rewards: Floats
    deadlocks: Int64s


@dataclass(frozen=True, eq=False)
class Successors:
    """Branches of n states; those of state i have the numbers offsets[i] to offsets[i+1] - 1, in
    the order of the model.

    Attributes:
        offsets: int64[n+1].
        weights: float64[m]; rates in a CTMC, else probabilities (the choices of an MDP are equally
            likely).
        targets: uint64[m, words], packed states.
        rewards: float64[m], the transition reward of each branch.
        deadlocks: bool[n]; a deadlock state has one branch, a loop of weight 1 without a reward.
    """

    offsets: Int64s
    weights: Floats
    targets: Rows
    rewards: Floats
    deadlocks: Bools


class SuccessorGenerator:
    """Successors of packed states.

    Args:
        layout: how states are packed.
        reward: the reward that is computed; None: rewards are 0.
    """

    def __init__(
        self, model: BoundModel, layout: StateLayout, reward: Reward | None = None
    ) -> None:
        self._model, self._layout = model, layout
        self._expander = Expander(
            compile_model(replace(model, rewards=()), layout, separate_choices=True)
        )
        items = () if reward is None else reward_items(reward, model)
        self._state_reward = self._sum([i for i in items if i.on_states])
        self._action_rewards = {
            number: code
            for number, action in enumerate((None, *model.actions), -1)
            if (code := self._sum([i for i in items if not i.on_states and i.action == action]))
        }

    def _sum(self, items: Sequence[BoundReward]) -> Code | None:
        return compile_expression(total_reward(items), self._model) if items else None

    def state_rewards(self, rows: Rows) -> Floats:
        """State rewards of packed states (uint64[n, words]): float64[n]. Raises ModelFault where
        one is not finite.
        """
        if self._state_reward is None:
            return np.zeros(len(rows))
        rewards = self._state_reward.run_packed(self._layout, rows)
        for i in np.flatnonzero(~np.isfinite(rewards)):
            state_rewards(self._model, self._layout.unpack(rows[i]))
        return rewards

    def choices(self, rows: Rows) -> Choices:
        """The choices of packed states (uint64[n, words]).

        Raises:
            ModelFault: the model breaks a rule in one of the states.
        """
        status, fault, arrays = self._expander.successors(np.ascontiguousarray(rows))
        if arrays is None:
            self._raise_fault(rows, fault, status)
        choice_ends, branch_ends, actions, weights, targets, dead = arrays
        choices = np.diff(choice_ends, prepend=0)
        rewards = np.zeros(len(branch_ends))
        rewarded = np.ones(len(branch_ends), np.bool_)
        rewarded[choice_ends[dead] - 1] = False
        for action, code in self._action_rewards.items():
            chosen = np.flatnonzero(rewarded & (actions == action))
            states = np.repeat(np.arange(len(rows)), choices)[chosen]
            rewards[chosen] = code.run_packed(self._layout, rows[states])
            for i in states[~np.isfinite(rewards[chosen])]:
                self._raise_fault(rows, i, 0)
        return Choices(choice_ends, branch_ends, weights, targets, rewards, dead)

    def successors(self, rows: Rows) -> Successors:
        """All branches of packed states (uint64[n, words]).

        Raises:
            ModelFault: the model breaks a rule in one of the states.
        """
        found = self.choices(rows)
        offsets = np.append(np.int64(0), found.branch_ends[found.ends - 1])
        weights = found.weights
        if not self._model.type.continuous_time:
            choices = np.repeat(np.diff(found.ends, prepend=0), np.diff(offsets))
            # As in the kernel, an edge whose probability underflows is kept.
            weights = np.where(weights > choices * LEAST, weights / choices, weights)
        deadlocks = np.zeros(len(rows), np.bool_)
        deadlocks[found.deadlocks] = True
        rewards = np.repeat(found.rewards, np.diff(found.branch_ends, prepend=0))
        return Successors(offsets, weights, found.targets, rewards, deadlocks)

    def _raise_fault(self, rows: Rows, state: int, status: int) -> NoReturn:
        raise_model_fault(self._model, self._layout.unpack(rows[state]), status)
