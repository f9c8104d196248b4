"""The rewards that operators and bounds refer to: a reward structure, steps, or time."""

from __future__ import annotations

from fractions import Fraction
from typing import assert_never, cast

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundModel, BoundReward
from symcheck.syntax.ast import Expression, Literal, RewardBound, RewardOperator, Type

__all__ = [
    "Reward",
    "Steps",
    "Structure",
    "Time",
    "bounded_reward",
    "operator_reward",
    "reward_items",
]


_ALWAYS = Literal(True, Type.BOOL)
_ONE = Literal(Fraction(1), Type.DOUBLE)


@dataclass(frozen=True, slots=True)
class Structure:
    """The reward structure with index `index` (from 0) of the model."""

    index: int


@dataclass(frozen=True, slots=True)
class Steps:
    """A reward of 1 for each transition."""


@dataclass(frozen=True, slots=True)
class Time:
    """A reward of 1 for each unit of time; in discrete time a transition takes one unit."""


Reward = Structure | Steps | Time


def operator_reward(formula: RewardOperator, model: BoundModel) -> Reward:
    """The reward of an R operator: its named or numbered structure, by default the first one."""
    return Structure(0) if formula.structure is None else _structure(formula.structure, model)


def bounded_reward(bound: RewardBound, model: BoundModel) -> Reward:
    """The reward of a bound within a path formula: its structure, by default steps."""
    return Steps() if bound.structure is None else _structure(bound.structure, model)


def reward_items(reward: Reward, model: BoundModel) -> tuple[BoundReward, ...]:
    """The items of a reward structure that describe a reward."""
    match reward:
        case Structure(index):
            return model.rewards[index].items
        case Time() if model.type.continuous_time:
            return (BoundReward(True, None, _ALWAYS, _ONE),)
        case Steps() | Time():
            return tuple(BoundReward(False, a, _ALWAYS, _ONE) for a in (None, *model.actions))
        case _:
            assert_never(reward)


def _structure(structure: str | Expression, model: BoundModel) -> Structure:
    """The structure with a name or a number (from 1), which binding has checked to exist."""
    if isinstance(structure, str):
        return Structure([r.name for r in model.rewards].index(structure))
    return Structure(cast(int, evaluate(structure, {})) - 1)
