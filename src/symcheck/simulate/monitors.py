"""Monitors: they read the states that sampled paths enter and decide a property on each path.

A path occupies its current state from `time` to `leave` (one step in discrete time).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools, Floats, Int32s
from symcheck.numerics.graph import backward_reachable
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_formulas import (
    LtlPathFormula,
    NextPath,
    PathFormula,
    RewardPath,
    StatePath,
    UntilPath,
)
from symcheck.semantics.path_normal_form import reward_bound_refused
from symcheck.semantics.query import (
    CoSafeReward,
    CumulativeReward,
    InstantaneousReward,
    LongRunReward,
    PathProbability,
    Quantity,
    ReachReward,
    TotalReward,
)
from symcheck.semantics.time_bounds import Window
from symcheck.simulate import tuning
from symcheck.simulate.intervals import Range
from symcheck.simulate.lazy_chain import LazyChain
from symcheck.simulate.reward_range import StepRewards
from symcheck.syntax.ast import Expression

__all__ = ["Decision", "Goal", "Monitor", "Paths", "monitor_of"]


@dataclass(frozen=True, eq=False)
class Paths:
    """Undecided paths after the same number of steps.

    Attributes:
        step: number of steps so far.
        ids: int32[n], current states.
        time, leave: float64[n], times at which the current states are entered and left.
        total: float64[n], rewards accumulated until `time`.
    """

    step: int
    ids: Int32s
    time: Floats
    leave: Floats
    total: Floats


Decision = tuple[Bools, Floats]
"""Which paths are decided (bool[n]), and their values (float64[n], undefined where undecided)."""


class Monitor(ABC):
    """A property that is decided state by state along sampled paths."""

    @property
    def atoms(self) -> tuple[Expression, ...]:
        """The state formulas that the monitor reads; the chain numbers them in this order."""
        return ()

    @property
    def goal(self) -> Goal | None:
        """The states that an unbounded path must reach to be decided; None if every path is decided
        after finitely many steps.
        """
        return None

    def range_of(self, rewards: StepRewards) -> Range:  # noqa: ARG002
        """Bounds on the value of a path."""
        return Range(0.0, 1.0)

    @abstractmethod
    def decide(self, chain: LazyChain, paths: Paths) -> Decision:
        """Decide the paths whose value the current states determine."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A reachability goal: states of atom `right`, through states of atom `left` (None: any state).

    A path that can no longer reach the goal has the value `value_if_missed`.
    """

    right: int
    left: int | None
    value_if_missed: float

    def absorbed_outside(self, chain: LazyChain, ids: Int32s) -> Bools:
        """Which paths are in an absorbing state outside the target."""
        absorbed_outside = chain.absorbing(ids)
        where = np.flatnonzero(absorbed_outside)
        absorbed_outside[where] = ~chain.satisfies(self.right, ids[where])
        return absorbed_outside

    def unreachable(self, chain: LazyChain, ids: Int32s) -> Bools:
        """Which paths are in a state that cannot reach the target.

        A small chain is explored completely first. States that are not expanded count as targets.
        """
        chain.explore(tuning.MAX_EXPLORED_STATES)
        matrix, expanded = chain.graph()
        everything = np.arange(matrix.states, dtype=np.int32)
        target = ~expanded | chain.satisfies(self.right, everything)
        through = (
            expanded if self.left is None else expanded & chain.satisfies(self.left, everything)
        )
        return ~backward_reachable(matrix, target, through)[ids]


@dataclass(frozen=True)
class _StepMonitor(Monitor):
    """Whether the state after `step` steps satisfies a formula and is entered within an interval of
    time.
    """

    target: Expression
    step: int
    lower: float
    upper: float | None
    negative: bool

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return (self.target,)

    def decide(self, chain: LazyChain, paths: Paths) -> Decision:
        decided = np.full(len(paths.ids), paths.step == self.step)
        upper = np.inf if self.upper is None else self.upper
        holds = chain.satisfies(0, paths.ids) & (paths.time >= self.lower) & (paths.time <= upper)
        return decided, (holds ^ self.negative).astype(np.float64)


@dataclass(frozen=True)
class _UntilMonitor(Monitor):
    """Whether `right` holds at some time of an interval, and `left` at all times before."""

    left: Expression
    right: Expression
    lower: float
    upper: float | None
    negative: bool = False

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return self.left, self.right

    def decide(self, chain: LazyChain, paths: Paths) -> Decision:
        left, right = chain.satisfies(0, paths.ids), chain.satisfies(1, paths.ids)
        upper = np.inf if self.upper is None else self.upper
        late_enough = paths.time >= self.lower
        if chain.continuous:
            hit = right & (late_enough | (left & (paths.leave >= self.lower)))
            failed = ~left | (paths.leave > upper)
        else:
            hit = right & late_enough
            failed = ~left | (paths.time >= upper)
        return hit | failed, (hit ^ self.negative).astype(np.float64)

    @property
    def goal(self) -> Goal | None:
        return Goal(1, 0, float(self.negative)) if self.upper is None else None


@dataclass(frozen=True)
class _CumulativeMonitor(Monitor):
    """The reward accumulated until a time."""

    time: float

    def decide(self, chain: LazyChain, paths: Paths) -> Decision:
        if not chain.continuous:
            return paths.time >= self.time, paths.total
        rest = np.maximum(self.time - paths.time, 0.0)
        return paths.leave >= self.time, paths.total + chain.reward(paths.ids) * rest

    def range_of(self, rewards: StepRewards) -> Range:
        """Bounds on the reward until the time."""
        return rewards.until(self.time)


@dataclass(frozen=True)
class _InstantaneousMonitor(Monitor):
    """The state reward at a time."""

    time: float

    def decide(self, chain: LazyChain, paths: Paths) -> Decision:
        occupied = paths.leave > self.time if chain.continuous else paths.time >= self.time
        return occupied, chain.reward(paths.ids)

    def range_of(self, rewards: StepRewards) -> Range:
        """Bounds on the rewards of states."""
        return rewards.of_states()


@dataclass(frozen=True)
class _ReachabilityMonitor(Monitor):
    """The reward accumulated before `target` is reached; infinite if it is never reached."""

    target: Expression

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return (self.target,)

    def decide(self, chain: LazyChain, paths: Paths) -> Decision:
        return chain.satisfies(0, paths.ids), paths.total

    @property
    def goal(self) -> Goal | None:
        return Goal(0, None, np.inf)

    def range_of(self, rewards: StepRewards) -> Range:
        """Bounds on the rewards of paths to the target."""
        return rewards.before(0)


# ---------------------------------------------------------------------------------- reading queries


def monitor_of(quantity: Quantity[Expression], model: BoundModel) -> Monitor:
    """The monitor of a quantity.

    Raises:
        UnsupportedError: paths do not decide it: it depends on infinite paths, or on another path
            formula than one of one temporal operator without rewards.
        InputError: a bound on steps is not an integer.
    """
    match quantity:
        case PathProbability(path):
            return _path_monitor(path, model)
        case CumulativeReward(_, times):
            _, upper = _time_bounds(times, model)
            assert upper is not None
            return _CumulativeMonitor(upper)
        case InstantaneousReward(_, time):
            return _InstantaneousMonitor(_time_bounds(Window(time, time), model)[0])
        case ReachReward(_, target):
            return _ReachabilityMonitor(target)
        case LongRunReward() | TotalReward():
            raise UnsupportedError(
                "sampling does not estimate R [ "
                f"{'S' if isinstance(quantity, LongRunReward) else 'C'} ], which depends on "
                "infinite paths; C<=k or I=k with a large k approximates it, and without sampling "
                "it is computed numerically"
            )
        case CoSafeReward():
            raise UnsupportedError(
                "sampling estimates expectations with C<=k, with I=k and until states are reached "
                "(F states); without it, those until a path formula is satisfied are computed "
                "numerically"
            )
        case _:
            raise UnsupportedError(
                f"sampling does not estimate {quantity.called}; without sampling they are computed "
                "numerically"
            )


def _path_monitor(path: PathFormula[Expression], model: BoundModel) -> Monitor:
    match path:
        case StatePath(states, negative):
            return _StepMonitor(states, 0, 0.0, None, negative)
        case NextPath(target, window, negative):
            return _StepMonitor(target, 1, *_time_bounds(window, model), negative)
        case UntilPath(left, right, window, negative):
            return _UntilMonitor(left, right, *_time_bounds(window, model), negative)
        case RewardPath():
            raise reward_bound_refused()
        case LtlPathFormula():
            raise UnsupportedError(
                "sampling does not support path formulas with several temporal operators (general "
                "LTL); it supports X, F, G, U, W and R over state formulas, with or without "
                "bounds; without sampling the formula is checked numerically"
            )
        case _:
            assert_never(path)


def _time_bounds(times: Window, model: BoundModel) -> tuple[float, float | None]:
    if model.type.continuous_time:
        return times.times()
    steps = times.steps()
    return float(steps.lower), None if steps.upper is None else float(steps.upper)
