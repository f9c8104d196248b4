"""Probabilities of `left U right` where the reward gathered until then is within bounds.

With whole-number rewards, the values for a budget of l depend on those for smaller budgets, through rows with a reward, and on
each other, through rows without. So the budgets ("epochs") are solved one after the other, each by reachability along the
rows without reward, whose structure is the same each time and is analysed once. Source: Hartmanns, Junges, Katoen & Quatmann
(2018), 'Multi-cost bounded reachability in MDP'.

End components without reward have value 0 where a strategy that minimises may stay ('min', and chains), and are single
states for 'max'; what remains leaves its cycles almost surely, so that the equations of a level have one solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import MemoryLimitError
from symcheck.kernels.solve.reward_epochs import Levels
from symcheck.matrices.numbers import Numbers, numbers
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress
from symcheck.numerics.reward_bounds.epoch_system import Epochs, Layer, layer_of
from symcheck.numerics.reward_bounds.rational_epochs import rational_epochs
from symcheck.numerics.settings import ROUNDING, Settings

__all__ = ["Found", "solve_epochs", "unfold"]

_MEMORY = 4 << 30
"""Bytes that the values of the levels that are kept may take."""
_SWEEPS = 200_000
"""Sweeps over a cycle at one level; fewer as a rule, as each level begins with the values of the one before."""
_CHUNK = 50_000_000
"""Entries that are visited before the observer is asked."""


@dataclass(frozen=True, eq=False)
class Found:
    """Bounds on the probability, float64[n] each; levels that were computed, sweeps over cycles, and the largest cycle."""

    lower: Numbers
    upper: Numbers
    levels: int
    sweeps: int
    cycle: int


def solve_epochs(problem: Epochs, settings: Settings, observer: Observer | None = None) -> Found:
    """Bounds on the probabilities at every state, proved, rounding included.

    Raises MemoryLimitError where the levels that are kept at a time do not fit.
    """
    n = problem.matrix.states
    if problem.upper is not None and problem.upper < problem.lower:
        nothing = numbers(np.zeros(n, np.bool_), exact=problem.matrix.exact)
        return Found(nothing, nothing, 0, 0, 0)
    reach = problem.upper if problem.upper is not None else problem.lower
    # More than the last level is as good as that: it leads below the lowest level, or to where nothing is wanted any more.
    rewards = np.minimum(problem.rewards, reach + (problem.upper is not None))
    slots = int(rewards[rewards <= reach].max(initial=0)) + 1
    problem = replace(problem, rewards=rewards)
    if problem.matrix.exact:
        unbounded = None if problem.upper is not None else _unbounded(problem, settings)[0]
        values, levels = rational_epochs(problem, unbounded)
        return Found(values, values, levels, 0, 0)
    if problem.upper is not None and problem.lower == 0:
        return _upper_only(problem, problem.upper, slots, settings, observer)
    if slots * n * 16 > _MEMORY:
        raise MemoryLimitError(
            f"rewards of up to {slots - 1} steps of the budget over {n:,} states need more than 4 GB of memory"
        )
    x = np.zeros((slots, n, 2))
    run = _Run(problem, settings, observer, x)
    if problem.upper is None:
        assert not (problem.exit > 0.0).any(), "reachability without limits is for all states"
        run.begin(*_unbounded(problem, settings))
        last = 0
    else:
        x[:, problem.right, :] = 1.0
        unknown = problem.left & ~problem.right
        last = run.phase(layer_of(problem, unknown), unknown, 0, problem.upper - problem.lower + 1)
    if problem.lower > 0:
        last = run.phase(
            layer_of(problem, problem.left), np.ones(n, np.bool_), last + 1, problem.lower
        )
    return run.found(x[last % slots])


def _upper_only(
    problem: Epochs, upper: int, slots: int, settings: Settings, observer: Observer | None
) -> Found:
    """With a bound from above alone, a ring holds a value per place of the layer, in its order, and not one per state."""
    layer = layer_of(problem, problem.left & ~problem.right)
    count = len(layer.state)
    if slots * (count + 2) * 16 > _MEMORY:
        raise MemoryLimitError(
            f"rewards of up to {slots - 1} steps of the budget over {count:,} states need more than 4 GB of memory"
        )
    place = np.full(problem.matrix.states, count + 1, np.int32)  # value 0
    place[problem.right] = count
    place[layer.members] = np.repeat(np.arange(count, dtype=np.int32), np.diff(layer.member_ptr))
    own = np.arange(count + 1, dtype=np.int64)
    compact = replace(
        layer,
        idx=place[layer.idx],
        state=own[:-1].astype(np.int32),
        members=own[:-1].astype(np.int32),
        member_ptr=own,
    )
    x = np.zeros((slots, count + 2, 2))
    x[:, count, :] = 1.0
    run = _Run(problem, settings, observer, x)
    last = run.phase(compact, np.zeros(0, np.bool_), 0, upper + 1)
    return run.found(x[last % slots][place])


class _Run:
    """The levels that are kept, `x` (float64[slots, n, 2]), and what was done to them."""

    def __init__(
        self, problem: Epochs, settings: Settings, observer: Observer | None, x: Floats
    ) -> None:
        self.problem, self.settings, self.observer, self.x = problem, settings, observer, x
        self.levels = self.sweeps = self.cycle = 0

    def begin(self, lower: Floats, upper: Floats) -> None:
        """All levels so far have these values."""
        self.x[:, :, 0] = lower
        self.x[:, :, 1] = upper

    def found(self, values: Floats) -> Found:
        """The result, given the last level (float64[n, 2])."""
        return Found(values[:, 0].copy(), values[:, 1].copy(), self.levels, self.sweeps, self.cycle)

    def phase(self, layer: Layer, clear: Bools, first: int, count: int) -> int:
        """Compute `count` levels from number `first` on; the number of the last. Of `clear`, what has no equation has value 0."""
        problem, slots = self.problem, len(self.x)
        mode = 0 if problem.direction is None else 1 if problem.direction == Direction.MIN else 2
        dead = clear.copy()
        if len(dead):
            dead[layer.members] = False
        tolerance = max(1e-16, self.settings.epsilon / (8.0 * max(1, problem.levels)))
        floor = 0 if problem.upper is not None else -slots
        kernel = Levels(
            _masked(layer), mode, floor, np.flatnonzero(dead).astype(np.int32), tolerance, _SWEEPS
        )
        self.cycle = max(self.cycle, layer.cycle)
        step = max(1, _CHUNK // max(1, len(layer.idx)))
        level, stop, same = first, first + count, 0
        while level < stop:
            following = min(stop, level + step)
            equal = kernel.advance(self.x, level, following)
            same = same + equal if equal == following - level else equal
            level = following
            if self.observer is not None:
                self.observer(Progress("budget by budget", level, 0.0, len(layer.state)))
            if same > slots and level - first > 2 * slots:
                break  # as many levels as matter are alike, and so are all that follow
        self.levels += level - first
        self.sweeps += kernel.sweeps
        return level - 1


def _masked(layer: Layer) -> Layer:
    return replace(layer, full=layer.full.view(np.uint8))


def _unbounded(problem: Epochs, settings: Settings) -> tuple[Numbers, Numbers]:
    """Bounds on the probability of `left U right` (no mass may be missing)."""
    from symcheck.numerics.linear.methods import solve_linear

    source = graph.Incidence(problem.matrix)
    yes = graph.prob1(source, problem.left, problem.right, problem.direction)
    no = graph.prob0(source, problem.left, problem.right, problem.direction)
    exact = problem.matrix.exact
    low = numbers(yes, exact=exact)
    high = low.copy()
    unknown = ~(yes | no)
    if unknown.any():
        enter, leave = (problem.matrix.sums(unknown, target) for target in (yes, ~unknown))
        part = problem.matrix.among(unknown, _groups_among(problem, unknown))
        found = solve_linear(
            LinearProblem(enter, part, None, leave, problem.direction, True), settings
        )
        slip = ROUNDING if found.exact and not exact else 0
        low[unknown], high[unknown] = (
            found.lower * (1 - slip),
            np.minimum(found.upper * (1 + slip), 1),
        )
    return low, high


def _groups_among(problem: Epochs, states: Bools) -> Int64s | None:
    """Where the rows of each of some states begin, counted among theirs; None without choices."""
    if problem.matrix.groups is None:
        return None
    return starts_of(np.diff(problem.groups)[states])


def unfold(
    problem: Epochs, rewards: Int64s, lower: int, upper: int | None
) -> tuple[Epochs, Int64s]:
    """The same with a second bound, whose reward (int64[rows]) is counted in the state: state s with count c is s * counts + c.
    With it, the row that each row comes from.

    Counts run up to `upper`, beyond which a run has failed, or up to `lower`, which is enough. Raises MemoryLimitError.
    """
    counts = (lower if upper is None else upper) + 1
    m = problem.matrix
    if max(m.entries, m.states) * counts > 200_000_000:
        raise MemoryLimitError(
            f"a second bound unfolds {m.states:,} states into {counts:,} copies each\n  hint: round the rewards"
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
    lengths = np.where(fails, 0, np.diff(m.indptr)[rows])
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
