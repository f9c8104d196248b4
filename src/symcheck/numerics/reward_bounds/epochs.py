"""Reward-bounded reachability: `left U right` with an accumulated reward within bounds.

Rewards are whole numbers. The values for a budget depend on those for smaller budgets, by rows with
a reward, and on each other, by rows without. So the budgets (epochs) are solved one after the
other, each by reachability along the rows without reward. The structure of these equations is the
same in each epoch and is analysed once.

End components without reward have value 0 if a minimising strategy may stay ('min', and chains),
and are single states for 'max'. All other states leave their cycles almost surely, so the equations
of an epoch have a unique solution.

Source: Hartmanns, Junges, Katoen & Quatmann (2018), Multi-cost bounded reachability in MDP.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import MemoryLimitError
from symcheck.kernels.solve.reward_epochs import EpochSolver
from symcheck.matrices.numbers import Numbers, numbers
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.linear.until import until_bounds
from symcheck.numerics.reward_bounds.epoch_system import (
    EpochSystem,
    RewardBoundedReachability,
    epoch_system,
)
from symcheck.numerics.settings import Settings

__all__ = ["EpochValues", "solve_epochs", "unfold_reward_dimension"]


@dataclass(frozen=True, eq=False)
class EpochValues:
    """The result of solving the epochs.

    Attributes:
        lower, upper: bounds on the probabilities, float64[n] or rationals.
        levels: the number of epochs that were solved.
        sweeps: the number of sweeps over cycles.
        cycle: the number of states of the largest cycle.
    """

    lower: Numbers
    upper: Numbers
    levels: int
    sweeps: int
    cycle: int


def solve_epochs(
    problem: RewardBoundedReachability, settings: Settings, observer: Observer | None = None
) -> EpochValues:
    """Proved bounds on the probabilities of all states, rounding included.

    Raises:
        MemoryLimitError: the epochs that are kept at a time do not fit into EPOCH_BYTES.
    """
    n = problem.matrix.states
    if problem.upper is not None and problem.upper < problem.lower:
        nothing = numbers(np.zeros(n, np.bool_), rational=problem.matrix.is_rational)
        return EpochValues(nothing, nothing, 0, 0, 0)
    reach = problem.upper if problem.upper is not None else problem.lower
    # Larger rewards have the same effect as the number of epochs: the budget is exhausted.
    rewards = np.minimum(problem.rewards, reach + (problem.upper is not None))
    slots = int(rewards[rewards <= reach].max(initial=0)) + 1
    problem = replace(problem, rewards=rewards)
    if problem.matrix.is_rational:
        # Rationals are slow compared with graph analysis, which the epochs save.
        copies, _ = unfold_reward_dimension(problem, rewards, problem.lower, problem.upper)
        values, _ = _unbounded(copies, settings)
        values = values[:: copies.matrix.states // n]
        return EpochValues(values, values, reach + 1, 0, 0)
    if slots * n * 16 > tuning.EPOCH_BYTES:
        raise MemoryLimitError(
            f"rewards of up to {slots - 1} steps of the budget over {n:,} states need more "
            "than 4 GB of memory"
        )
    x = np.zeros((slots, n, 2))
    run = _EpochRun(problem, settings, observer, x)
    if problem.upper is None:
        assert not (problem.exit > 0.0).any(), "reachability without limits is for all states"
        run.begin(*_unbounded(problem, settings))
        last = 0
    else:
        x[:, problem.right, :] = 1.0
        unknown = problem.left & ~problem.right
        last = run.phase(
            epoch_system(problem, unknown), unknown, 0, problem.upper - problem.lower + 1
        )
    if problem.lower > 0:
        last = run.phase(
            epoch_system(problem, problem.left), np.ones(n, np.bool_), last + 1, problem.lower
        )
    return run.found(x[last % slots])


class _EpochRun:
    """The values of the epochs that are kept, `x` (float64[slots, n, 2]), and the statistics."""

    def __init__(
        self,
        problem: RewardBoundedReachability,
        settings: Settings,
        observer: Observer | None,
        x: Floats,
    ) -> None:
        self.problem, self.settings, self.observer, self.x = problem, settings, observer, x
        self.levels = self.sweeps = self.cycle = 0

    def begin(self, lower: Floats, upper: Floats) -> None:
        """Set the values of all epochs before the first."""
        self.x[:, :, 0] = lower
        self.x[:, :, 1] = upper

    def found(self, values: Floats) -> EpochValues:
        """The result, given the values of the last epoch (float64[n, 2])."""
        return EpochValues(
            values[:, 0].copy(), values[:, 1].copy(), self.levels, self.sweeps, self.cycle
        )

    def phase(self, system: EpochSystem, clear: Bools, first: int, count: int) -> int:
        """Solve `count` epochs from number `first` on; the number of the last one is returned.

        States of `clear` without an equation have value 0.
        """
        problem, slots = self.problem, len(self.x)
        mode = 0 if problem.direction is None else 1 if problem.direction == Direction.MIN else 2
        dead = clear.copy()
        if len(dead):
            dead[system.members] = False
        tolerance = max(1e-16, self.settings.epsilon / (8.0 * max(1, problem.levels)))
        floor = 0 if problem.upper is not None else -slots
        kernel = EpochSolver(
            _masked(system),
            mode,
            floor,
            np.flatnonzero(dead).astype(np.int32),
            tolerance,
            tuning.EPOCH_SWEEPS,
        )
        self.cycle = max(self.cycle, system.cycle)
        step = max(1, tuning.EPOCH_ENTRIES_PER_CALL // max(1, len(system.idx)))
        level, stop, same = first, first + count, 0
        while level < stop:
            following = min(stop, level + step)
            equal = kernel.advance(self.x, level, following)
            same = same + equal if equal == following - level else equal
            level = following
            if self.observer is not None:
                self.observer(Progress("budget by budget", level, 0.0, len(system.state)))
            if same > slots and level - first > 2 * slots:
                break  # all epochs that matter are equal, and so are all that follow
        self.levels += level - first
        self.sweeps += kernel.sweeps
        return level - 1


def _masked(system: EpochSystem) -> EpochSystem:
    return replace(system, full=system.full.view(np.uint8))


def _unbounded(problem: RewardBoundedReachability, settings: Settings) -> tuple[Numbers, Numbers]:
    """Bounds on the probability of `left U right` without bounds on rewards."""
    return until_bounds(
        problem.matrix,
        problem.left,
        problem.right,
        problem.direction,
        settings,
        closed=not (problem.exit > 0).any(),
        error=problem.error,
    )


def unfold_reward_dimension(
    problem: RewardBoundedReachability, rewards: Int64s, lower: int, upper: int | None
) -> tuple[RewardBoundedReachability, Int64s]:
    """Encode a second reward bound in the states: state s with count c becomes s * counts + c.

    Counts run up to `upper`, beyond which a run has failed, or up to `lower`, which suffices.

    Args:
        problem: the problem with its first bound.
        rewards: the rewards of the second bound, int64[rows].
        lower: the lower bound on the count.
        upper: the upper bound; None: there is none.

    Returns:
        The unfolded problem, and the original row of each row.

    Raises:
        MemoryLimitError: there are too many copies.
    """
    counts = (lower if upper is None else upper) + 1
    m = problem.matrix
    if max(m.entries, m.states) * counts > tuning.UNFOLDED_ENTRIES:
        raise MemoryLimitError(
            f"a second bound unfolds {m.states:,} states into {counts:,} copies each",
            hint="round the rewards",
        )
    c = np.arange(counts)
    groups = problem.groups
    of_state = np.repeat(np.arange(m.states), counts)
    count_of = np.tile(c, m.states)
    rows = spans(groups[of_state], groups[of_state + 1])
    per_pair = (groups[1:] - groups[:-1])[of_state]
    after = np.repeat(count_of, per_pair) + np.minimum(rewards[rows], counts)
    fails = after >= counts if upper is not None else np.zeros(len(rows), np.bool_)
    after = np.minimum(after, counts - 1)
    lengths = np.where(fails, 0, m.lengths[rows])
    entries = spans(m.indptr[rows], m.indptr[rows] + lengths)
    columns = m.indices[entries].astype(np.int64) * counts + np.repeat(after, lengths)
    matrix = SparseMatrix(
        starts_of(lengths),
        columns.astype(np.int32),
        m.data[entries],
        m.states * counts,
        None if m.groups is None else starts_of(per_pair),
    )
    unfolded = replace(
        problem,
        matrix=matrix,
        exit=np.where(fails, 1, problem.exit[rows]),
        rewards=problem.rewards[rows],
        left=problem.left[of_state],
        right=problem.right[of_state] & (count_of >= lower),
    )
    return unfolded, rows
