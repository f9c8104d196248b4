"""Expected rewards: which structure a formula means, and which measure answers its query."""

from __future__ import annotations

from fractions import Fraction
from typing import assert_never

from symcheck.check.context import Context
from symcheck.check.measures import measures
from symcheck.check.paths import StatesOf, UntilPath, resolve
from symcheck.check.window import bound_value, window
from symcheck.engines.base import Values
from symcheck.errors import Diagnostic, InputError, NameFault, UnsupportedError
from symcheck.semantics.evaluate import evaluate
from symcheck.syntax.ast import (
    CumulativeReward,
    Eventually,
    InstantaneousReward,
    RewardOperator,
    SteadyStateReward,
    TotalReward,
)

__all__ = ["reward_values", "structure_number"]


def structure_number(context: Context, formula: RewardOperator) -> int:
    """The number (from 0) of the reward structure that a formula names, by name or number (from 1), or the first.

    Raises NameFault for an unknown name and InputError for a number that is out of range.
    """
    known = context.engine.model.rewards
    if not known:
        raise InputError(Diagnostic("the model has no reward structure", formula.span, "reward-structure"))
    if formula.structure is None:
        return 0
    if isinstance(formula.structure, str):
        names = [r.name for r in known]
        if formula.structure in names:
            return names.index(formula.structure)
        hint = "known are " + ", ".join(f'"{n}"' for n in names if n)
        raise NameFault(Diagnostic(f'unknown reward structure "{formula.structure}"', formula.span, "reward-structure", hint))
    number = evaluate(formula.structure, {})
    if not isinstance(number, int) or not 1 <= number <= len(known):
        raise InputError(Diagnostic(f"there is no reward structure number {number} (1 to {len(known)})", formula.span, "reward-structure"))
    return number - 1


def reward_values(context: Context, formula: RewardOperator, structure: int, states_of: StatesOf, direction: str | None) -> Values:
    """The expected reward that a formula asks for, at each state."""
    who = measures(context)
    query = formula.query
    match query:
        case CumulativeReward(bound):
            time = window(bound)
            if time.upper is None or time.lower or time.lower_strict:
                raise UnsupportedError("a cumulative reward has an upper bound only: C<=k")
            return who.cumulative_reward(context, structure, time, direction)
        case TotalReward():
            return who.total_reward(context, structure, direction)
        case InstantaneousReward(time_of):
            return who.instantaneous_reward(context, structure, Fraction(bound_value(time_of)), direction)
        case SteadyStateReward():
            return who.steady_reward(context, structure)
        case Eventually():
            target = resolve(query, states_of, context.engine.all)
            if isinstance(target, UntilPath) and target.window.trivial:
                _refuse_fairness(context)
                return who.reach_reward(context, structure, target.right, direction)
            raise UnsupportedError("an expected reward until a bounded or nested path formula is not supported; F over states is")
        case _:
            raise UnsupportedError("an expected reward until a formula of linear time is not supported yet; F, C, I and S are")


def _refuse_fairness(context: Context) -> None:
    if context.options.fairness:
        raise UnsupportedError("expected rewards over fair strategies are not supported; probabilities are")
