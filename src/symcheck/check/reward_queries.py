"""Expected rewards: which structure a formula means, and which measure answers its query."""

from __future__ import annotations

from symcheck.check.context import Context
from symcheck.check.measure_selection import measures
from symcheck.check.path_formulas import StatesOf, UntilPath, resolve, temporal
from symcheck.check.time_bounds import bound_value, window
from symcheck.direction import Direction
from symcheck.engines.base import Values
from symcheck.errors import UnsupportedError
from symcheck.semantics.binding.bound_conditions import reward_index
from symcheck.syntax.ast import (
    CumulativeReward,
    Eventually,
    InstantaneousReward,
    PathFormula,
    RewardOperator,
    SteadyStateReward,
    TotalReward,
)

__all__ = ["reward_values", "structure_number"]


def structure_number(context: Context, formula: RewardOperator) -> int:
    """The number (from 0) of the reward structure that a formula names, by name or number (from 1), or the first."""
    return reward_index(formula.structure, context.engine.model)


def reward_values(
    context: Context,
    formula: RewardOperator,
    structure: int,
    states_of: StatesOf,
    direction: Direction | None,
) -> Values:
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
            if (
                direction == Direction.MIN
            ):  # waiting for free for ever is not fair; the greatest is that of all strategies
                _refuse_fairness(context)
            return who.total_reward(context, structure, direction)
        case InstantaneousReward(time_of):
            return who.instantaneous_reward(context, structure, bound_value(time_of), direction)
        case SteadyStateReward():
            return who.steady_reward(context, structure, direction)
        case Eventually():
            target = resolve(query, states_of, context.engine.all)
            if isinstance(target, UntilPath) and target.window.trivial:
                _refuse_fairness(context)
                return who.reach_reward(context, structure, target.right, direction)
            return _until_shown(context, structure, query, states_of, direction)
        case _:
            return _until_shown(context, structure, query, states_of, direction)


def _until_shown(
    context: Context,
    structure: int,
    path: PathFormula,
    states_of: StatesOf,
    direction: Direction | None,
) -> Values:
    """The expected reward until a run shows that it satisfies a path formula."""
    from symcheck.check.omega_regular.ltl import co_safe_reward

    _refuse_fairness(context)
    return co_safe_reward(context, structure, temporal(path, states_of), direction)


def _refuse_fairness(context: Context) -> None:
    if context.options.fairness:
        raise UnsupportedError(
            "expected rewards over fair strategies are not supported; probabilities are"
        )
