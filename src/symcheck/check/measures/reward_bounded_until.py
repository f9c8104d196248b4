"""Path formulas with bounds on rewards: `F^{rew{"r"}<=k} a`, and the same for U, G, W, R and X.

A run satisfies `a U^{rew{"r"}<=k} b` if `b` holds in some state, `a` holds in all states before it,
and the reward of these states and of the transitions up to it is at most k. So the reward of the
state in which `b` holds is not counted, but that of the step into it is. Storm and the quantitative
verification benchmarks use the same definition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.reward_scaling import ScaledBound, dimension_order, scale_bound
from symcheck.check.measures.step_bounded import best
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import ROUNDING, StateSet, System, Values
from symcheck.engines.capabilities import HasBlocks, HasImportedStates, HasMatrix
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, per_row
from symcheck.numerics.linear.problem import largest_width
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.model import BoundReward
from symcheck.semantics.rewards import Reward, Steps, Structure, reward_items
from symcheck.semantics.time_bounds import RewardWindow
from symcheck.syntax.ast import Binary, Conditional, Expression, Literal, Type
from symcheck.syntax.operators import Operator

if TYPE_CHECKING:
    from symcheck.numerics.reward_bounds.epoch_system import RewardBoundedReachability
    from symcheck.numerics.reward_bounds.epochs import EpochValues

__all__ = ["check_uniform_rewards", "reward_bounded_next", "reward_bounded_until"]


def reward_bounded_until(
    context: Context,
    left: StateSet,
    right: StateSet,
    counts: Sequence[RewardWindow],
    direction: Direction | None,
) -> Values:
    """Probability of `left U right` with every reward within its bounds when `right` is reached.

    Strategies may depend on the rewards so far. All bounds but one are unfolded into the states.

    Args:
        context: the engine, the options and the log.
        left: the states in which a path may go on.
        right: the states in which it ends.
        counts: the bounded rewards: non-negative multiples of a common step; for a CTMC, rewards of
            transitions only.
        direction: minimise or maximise over strategies; None for a chain.

    Returns:
        Values in [0, 1], certified, rounding included.

    Raises:
        UnsupportedError: a reward is not a non-negative multiple of a common step, or a CTMC has
            state rewards.
        MemoryLimitError: the epochs or the unfolded model do not fit into memory.

    """
    engine = context.engine
    unbounded = [c for c in counts if c.window.is_unbounded]
    counts = [c for c in counts if c not in unbounded]
    if not counts:
        from symcheck.check.measures.reachability import until

        return until(context, left, right, direction)
    from symcheck.numerics.reward_bounds.epochs import (  # few runs need it
        solve_epochs,
        unfold_reward_dimension,
    )

    bounded = any(c.window.upper is not None for c in counts)
    system = engine.system(engine.graph.exists_until(left, right) if bounded else engine.all)
    if system.n == 0:
        return engine.constant(0)
    bounds = [scale_bound(context, system, row_rewards(context, system, c), c) for c in counts]
    if any(bound.empty for bound in bounds):
        return engine.constant(0)
    bounds.sort(key=dimension_order)
    problem = _problem(context, system, left, right, bounds[0], direction)
    n = problem.matrix.states
    for i, bound in enumerate(bounds[1:], 1):
        problem, rows = unfold_reward_dimension(problem, bound.rewards, bound.lower, bound.upper)
        bounds[i + 1 :] = [replace(later, rewards=later.rewards[rows]) for later in bounds[i + 1 :]]
    epochs = solve_epochs(problem, context.options, context.observer)
    first = slice(None, None, problem.matrix.states // n)
    _note(context, epochs, problem)
    return _lift(context, system, epochs.lower[first], epochs.upper[first])


def reward_bounded_next(
    context: Context, target: StateSet, counts: Sequence[RewardWindow], direction: Direction | None
) -> Values:
    """Probability that the next state is in `target` and the reward of the step in its bounds."""
    engine = context.engine
    system = engine.system(engine.all)
    allowed = np.ones(system.rows, np.bool_)
    for count in counts:
        bound = scale_bound(context, system, row_rewards(context, system, count), count)
        allowed &= bound.rewards >= bound.lower
        if bound.upper is not None:
            allowed &= bound.rewards <= bound.upper
    chances = system.one_step_probability(target)
    sure = per_row(system.groups, engine.to_bools(engine.graph.all_successors_in(target)))
    if not engine.is_rational:  # a sum that is rounded to 1 is not known to be 1
        chances = np.minimum(chances, np.nextafter(1.0, 0.0))
    chances[sure] = Fraction(1)
    chances[~allowed] = Fraction(0)
    values = best(chances, system, direction)
    context.log.runs.append(SolverRun("steps", "one step", system.n, 1))
    if engine.is_rational:
        return system.lift(values, None)
    unit = 1.01 * (system.error + UNIT_ROUNDOFF)
    rounding_error = unit * np.where((values == 0) | (values == 1), 0.0, values)
    return _lift(context, system, values - rounding_error, np.minimum(values + rounding_error, 1.0))


def row_rewards(context: Context, system: System, count: RewardWindow) -> Numbers:
    """The reward of a step by each row: float64[rows]."""
    if isinstance(count.reward, Steps):
        return np.ones(system.rows)
    states, rows = system.rewards(count.reward)
    if system.exit_rates is not None and states.any():
        raise UnsupportedError(
            "a bound on state rewards in continuous time, which are earned per unit of time, is "
            "not supported; a bound on transition rewards is"
        )
    check_uniform_rewards(context, count.reward, paying=bool(rows.any()))
    return system.step_rewards(count.reward)


def check_uniform_rewards(context: Context, reward: Reward, *, paying: bool) -> None:
    """Check that the transitions of each row have the same reward, as only their mean is stored.

    In a chain, the commands of all actions of a state are one row.

    Args:
        context: the engine.
        reward: the reward.
        paying: whether some row has a transition reward.

    Raises:
        UnsupportedError: the rewards of a row differ, or it is not known whether they do.
    """
    model = context.engine.model
    items = [i for i in reward_items(reward, model) if not i.on_states]
    if not items:
        if paying and not _uniform_as_read(context, reward):
            raise UnsupportedError(
                "a bound on the transition rewards of a model without commands is not supported "
                "where they differ within a choice; the explicit engine knows where they do not"
            )
        return
    if model.type.has_choices:
        return
    if context.engine.capability(HasBlocks) is not None:
        raise UnsupportedError(
            "bounds on transition rewards of a chain are not checked on a quotient"
        )
    uneven = _uneven(context, items)
    if uneven:
        where = context.example(uneven)
        raise UnsupportedError(
            "a bound on a reward that differs between the transitions of one state is not "
            f"supported, as in {where}"
        )


def _uniform_as_read(context: Context, reward: Reward) -> bool:
    """Whether the transitions of each row of a model that was read are known to share a reward."""
    imported = context.engine.capability(HasImportedStates)
    rows = context.engine.capability(HasMatrix)
    if imported is None or rows is None or not isinstance(reward, Structure):
        return False
    entries = imported.entry_rewards[reward.index]
    if entries is None:
        return True
    first = entries[rows.matrix.indptr[:-1]]
    return bool(np.array_equal(np.repeat(first, rows.matrix.lengths), entries))


def _uneven(context: Context, items: Sequence[BoundReward]) -> StateSet:
    """States in which two actions with different transition rewards are possible."""
    engine = context.engine
    zero: Expression = Literal(0, Type.INT)
    groups: dict[tuple[Expression, ...], list[Expression]] = {}
    for event in engine.model.events:
        terms: tuple[Expression, ...] = tuple(
            Conditional(i.guard, i.value, zero) for i in items if i.action == event.action
        )
        guards = [reduce(_or, [c.guard for c in part]) for part in event.participants]
        groups.setdefault(terms, []).append(reduce(lambda a, b: Binary(Operator.AND, a, b), guards))
    known: list[tuple[StateSet, Values]] = []
    result = engine.none
    for terms, guards in groups.items():
        where = engine.where(reduce(_or, guards))
        values = engine.values(
            reduce(lambda a, b: Binary(Operator.PLUS, a, b), terms, zero), Type.DOUBLE
        )
        for other, rewards in known:
            if where & other:
                equal, _ = values.map(Operator.MINUS, rewards).compare("=", 0)
                result = result | ((where & other) - equal)
        known.append((where, values))
    return result


def _or(a: Expression, b: Expression) -> Expression:
    return Binary(Operator.OR, a, b)


def _problem(
    context: Context,
    system: System,
    left: StateSet,
    right: StateSet,
    bound: ScaledBound,
    direction: Direction | None,
) -> RewardBoundedReachability:
    from symcheck.numerics.reward_bounds.epoch_system import RewardBoundedReachability

    def members(states: StateSet) -> Bools:
        return np.asarray(system.restrict(states) > 0)

    return RewardBoundedReachability(
        system.matrix,
        system.one_step_probability(~system.states),
        bound.rewards,
        members(left),
        members(right),
        bound.lower,
        bound.upper,
        direction,
        system.error,
    )


def _note(context: Context, epochs: EpochValues, problem: RewardBoundedReachability) -> None:
    cycles = f", cycles without reward of up to {epochs.cycle} states" if epochs.cycle > 1 else ""
    about = f"{epochs.levels} levels of the budget{cycles}"
    context.log.runs.append(
        SolverRun(
            "epochs",
            "budget by budget",
            problem.matrix.states,
            epochs.levels + epochs.sweeps,
            about,
        )
    )


def _lift(context: Context, system: System, lower: Numbers, upper: Numbers) -> Values:
    """Bounds as values: exact if only rounding separates them; warn if wider than requested."""
    if context.engine.is_rational:
        return system.lift(lower, None)
    width = largest_width(lower, upper, context.options.relative)
    context.warn_if_wide(width, "reward bounds")
    if largest_width(lower, upper, relative=True) > ROUNDING:
        return system.lift(lower, upper)
    values = system.lift(lower, upper, up_to_rounding=True)
    # Bounds of 0 and 1 are exact without rounding.
    ones = context.engine.from_bools(_spread(context, system, lower == 1.0))
    zeros = context.engine.from_bools(_spread(context, system, upper == 0.0))
    return values.choose(~(ones | zeros), context.engine.indicator(ones))


def _spread(context: Context, system: System, of_system: Bools) -> Bools:
    """A set of states of the system as a set of all states: bool[system.n] -> bool[n]."""
    members = np.zeros(context.engine.states, np.bool_)
    members[np.flatnonzero(context.engine.to_bools(system.states))[of_system]] = True
    return members
