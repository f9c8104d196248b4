"""Probabilities of `left U right` where the reward gathered until then is within bounds.

With whole-number rewards, the values for a budget of l depend on those for smaller budgets, through rows with a reward, and on
each other, through rows without. So the budgets ("epochs") are solved one after the other, each by reachability along the
rows without reward, whose structure is the same each time and is analysed once. Source: Hartmanns, Junges, Katoen & Quatmann
(2018), 'Multi-cost bounded reachability in MDP'.

End components without reward have value 0 where a strategy that minimises may stay ('min', and chains), and are single
states for 'max'; what remains leaves its cycles almost surely, so that the equations of a level have one solution.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from symcheck.errors import MemoryLimitError
from symcheck.kernels.epochs import Levels
from symcheck.numerics import graph
from symcheck.numerics.matrix import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics.problem import LinearProblem, Observer, Step
from symcheck.numerics.settings import Settings

__all__ = ["Epochs", "Found", "Layer", "layer_of", "solve_epochs", "unfold"]

_MEMORY = 4 << 30
"""Bytes that the values of the levels that are kept may take."""
_SWEEPS = 200_000
"""Sweeps over a cycle at one level; fewer as a rule, as each level begins with the values of the one before."""
_DENSE = 1_500
"""States of a cycle without choices up to which its equations are inverted."""
_SLOW = 30.0
"""Steps on a cycle from which on that pays."""
_CHUNK = 50_000_000
"""Entries that are visited before the observer is asked."""
_UNIT = 2.0**-53


@dataclass(frozen=True, eq=False)
class Epochs:
    """`left U right` with a reward from `lower` to `upper` (None: no end) when `right` holds; rewards are whole numbers.

    matrix: probabilities among n states. exit: per row, what leads elsewhere, to failure (float64[rows]). rewards: int64[rows],
    what a step by the row adds. direction: None, 'min' or 'max'.
    """

    matrix: SparseMatrix
    exit: Floats = field(repr=False)
    rewards: Int64s = field(repr=False)
    left: Bools = field(repr=False)
    right: Bools = field(repr=False)
    lower: int
    upper: int | None
    direction: str | None

    @property
    def groups(self) -> Int64s:
        """Rows of each state: int64[n+1]."""
        groups = self.matrix.groups
        return np.arange(self.matrix.rows + 1, dtype=np.int64) if groups is None else groups

    @property
    def levels(self) -> int:
        """How many levels are computed one after the other."""
        return self.lower if self.upper is None else self.upper + 1


@dataclass(frozen=True, eq=False)
class Found:
    """Bounds on the probability, float64[n] each; levels that were computed, sweeps over cycles, and the largest cycle."""

    lower: Floats
    upper: Floats
    levels: int
    sweeps: int
    cycle: int


@dataclass(frozen=True, eq=False)
class Layer:
    """The equations of one level, in order of evaluation.

    Place i (`block[b]` to `block[b+1]` are on a cycle with each other) is state `state[i]`, and has rows `row_ptr[i]` to
    `row_ptr[i+1]`; its value is that of `members[member_ptr[i]:member_ptr[i+1]]`. Row r has entries `ptr[r]` to `ptr[r+1]`
    (`idx`, `val`), from `mid[r]` on those on its own cycle; `reward`, and `full` where no mass is missing. `row_id`: the row of
    the matrix, whose entries were divided by what a self-loop, which is left out, leaves. steps: h >= 1 + A h on cycles.
    inverse: the entries of (I - A)^-1, in floating point, of block b from `inverse_at[b]` on (-1: none).
    """

    block: Int64s
    state: Int32s
    row_ptr: Int64s
    member_ptr: Int64s
    members: Int32s
    ptr: Int64s
    mid: Int64s
    idx: Int32s
    val: Floats
    reward: Int64s
    slack: Floats
    full: Bools
    row_id: Int64s
    steps: Floats
    inverse: Floats
    inverse_at: Int64s

    @property
    def cycle(self) -> int:
        """States on the largest cycle (1: there is none)."""
        return int(np.diff(self.block).max(initial=0))


def solve_epochs(problem: Epochs, settings: Settings, observer: Observer | None = None) -> Found:
    """Bounds on the probabilities at every state, proved, rounding included.

    Raises MemoryLimitError where the levels that are kept at a time do not fit.
    """
    n = problem.matrix.states
    if problem.upper is not None and problem.upper < problem.lower:
        return Found(np.zeros(n), np.zeros(n), 0, 0, 0)
    reach = problem.upper if problem.upper is not None else problem.lower
    # More than the last level is as good as that: it leads below the lowest level, or to where nothing is wanted any more.
    rewards = np.minimum(problem.rewards, reach + (problem.upper is not None))
    slots = int(rewards[rewards <= reach].max(initial=0)) + 1
    problem = replace(problem, rewards=rewards)
    if problem.upper is not None and problem.lower == 0:
        return _upper_only(problem, problem.upper, slots, settings, observer)
    if slots * n * 16 > _MEMORY:
        raise MemoryLimitError(f"rewards of up to {slots - 1} steps of the budget over {n:,} states need more than 4 GB of memory")
    x = np.zeros((slots, n, 2))
    run = _Run(problem, settings, observer, x)
    if problem.upper is None:
        run.begin(*_unbounded(problem, settings))
        last = 0
    else:
        x[:, problem.right, :] = 1.0
        unknown = problem.left & ~problem.right
        last = run.phase(layer_of(problem, unknown), unknown, 0, problem.upper - problem.lower + 1)
    if problem.lower > 0:
        last = run.phase(layer_of(problem, problem.left), np.ones(n, np.bool_), last + 1, problem.lower)
    return run.found(x[last % slots])


def _upper_only(problem: Epochs, upper: int, slots: int, settings: Settings, observer: Observer | None) -> Found:
    """With a bound from above alone, a ring holds a value per place of the layer, in its order, and not one per state."""
    layer = layer_of(problem, problem.left & ~problem.right)
    count = len(layer.state)
    if slots * (count + 2) * 16 > _MEMORY:
        raise MemoryLimitError(f"rewards of up to {slots - 1} steps of the budget over {count:,} states need more than 4 GB of memory")
    place = np.full(problem.matrix.states, count + 1, np.int32)  # value 0
    place[problem.right] = count
    place[layer.members] = np.repeat(np.arange(count, dtype=np.int32), np.diff(layer.member_ptr))
    own = np.arange(count + 1, dtype=np.int64)
    compact = replace(layer, idx=place[layer.idx], state=own[:-1].astype(np.int32), members=own[:-1].astype(np.int32), member_ptr=own)
    x = np.zeros((slots, count + 2, 2))
    x[:, count, :] = 1.0
    run = _Run(problem, settings, observer, x)
    last = run.phase(compact, np.zeros(0, np.bool_), 0, upper + 1)
    return run.found(x[last % slots][place])


class _Run:
    """The levels that are kept, `x` (float64[slots, n, 2]), and what was done to them."""

    def __init__(self, problem: Epochs, settings: Settings, observer: Observer | None, x: Floats) -> None:
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
        mode = 0 if problem.direction is None else 1 if problem.direction == "min" else 2
        dead = clear.copy()
        if len(dead):
            dead[layer.members] = False
        tolerance = max(1e-16, self.settings.epsilon / (8.0 * max(1, problem.levels)))
        floor = 0 if problem.upper is not None else -slots
        kernel = Levels(_masked(layer), mode, floor, np.flatnonzero(dead).astype(np.int32), tolerance, _SWEEPS)
        self.cycle = max(self.cycle, layer.cycle)
        step = max(1, _CHUNK // max(1, len(layer.idx)))
        level, stop, same = first, first + count, 0
        while level < stop:
            following = min(stop, level + step)
            equal = kernel.advance(self.x, level, following)
            same = same + equal if equal == following - level else equal
            level = following
            if self.observer is not None:
                self.observer(Step("budget by budget", level, 0.0, len(layer.state)))
            if same > slots and level - first > 2 * slots:
                break  # as many levels as matter are alike, and so are all that follow
        self.levels += level - first
        self.sweeps += kernel.sweeps
        return level - 1


def _masked(layer: Layer) -> Layer:
    return replace(layer, full=layer.full.view(np.uint8))


def _unbounded(problem: Epochs, settings: Settings) -> tuple[Floats, Floats]:
    """Bounds on the probability of `left U right` (no mass may be missing)."""
    from symcheck.numerics.methods import solve_linear

    source = graph.Incidence(problem.matrix)
    yes = graph.prob1(source, problem.left, problem.right, problem.direction)
    no = graph.prob0(source, problem.left, problem.right, problem.direction)
    low = yes.astype(np.float64)
    high = low.copy()
    unknown = ~(yes | no)
    if unknown.any():
        part, rows = _among(problem, unknown)
        weights = _weights(problem.matrix, rows, yes)
        leave = _weights(problem.matrix, rows, ~unknown)
        found = solve_linear(LinearProblem(weights, part, None, leave, problem.direction, True), settings)
        low[unknown], high[unknown] = found.lower, found.upper
        if found.exact:
            slip = 1e-12
            low[unknown], high[unknown] = found.lower * (1 - slip), np.minimum(found.upper * (1 + slip), 1.0)
    return low, high


def _among(problem: Epochs, states: Bools) -> tuple[SparseMatrix, Int64s]:
    """The matrix among some states, and the rows that it has."""
    from symcheck.kernels import sparse

    m, groups = problem.matrix, problem.groups
    chosen = np.flatnonzero(states)
    rows = _spans(groups[:-1][chosen], groups[1:][chosen])
    place = np.full(m.columns, -1, np.int32)
    place[chosen] = np.arange(len(chosen), dtype=np.int32)
    parts = sparse.select(m.indptr, m.indices, m.data, rows, place)
    own = None if m.groups is None else np.concatenate(([0], np.cumsum(np.diff(groups)[chosen]))).astype(np.int64)
    return SparseMatrix(*parts, len(chosen), own), rows


def _weights(matrix: SparseMatrix, rows: Int64s, target: Bools) -> Floats:
    from symcheck.kernels.rows import sum_into

    out = np.empty(len(rows))
    sum_into(matrix.indptr, matrix.indices, matrix.data, rows, target.view(np.uint8), out)
    return out


def _spans(starts: Int64s, ends: Int64s) -> Int64s:
    """The numbers from each start up to each end, one after the other."""
    lengths = ends - starts
    shift = np.repeat(starts - np.concatenate(([0], np.cumsum(lengths[:-1]))), lengths)
    return np.asarray(np.arange(int(lengths.sum()), dtype=np.int64) + shift)


def layer_of(problem: Epochs, unknown: Bools) -> Layer:
    """The equations of a level over the states `unknown`; those that are not among `Layer.members` have value 0."""
    lead = _Leaders.of(problem, unknown)
    m, zero = problem.matrix, problem.rewards == 0
    lengths = np.diff(m.indptr)[lead.rows]
    entry = _spans(m.indptr[:-1][lead.rows], m.indptr[1:][lead.rows])
    row = np.repeat(np.arange(len(lead.rows)), lengths)
    target = lead.number[m.indices[entry]]
    same_level = zero[lead.rows][row] & (target >= 0)
    edge = same_level & (target != lead.of_row[row])
    parts = _components(lead.of_row[row[edge]], target[edge], lead.count)
    rank = np.empty(lead.count, np.int64)
    rank[parts.order] = np.arange(lead.count)
    # Rows in the order of their leaders, entries on the own cycle last in each.
    order = np.argsort(rank[lead.of_row], kind="stable")
    position = np.empty(len(order), np.int64)
    position[order] = np.arange(len(order))
    loop = same_level & ~edge
    own = edge & (parts.of[np.maximum(target, 0)] == parts.of[lead.of_row[row]])
    value = np.where((lengths == 1) & (problem.exit[lead.rows] <= 0.0), 1.0, 0.0)[row]
    value = np.where(value > 0.0, value, m.data[entry])
    looping = np.bincount(row[loop], minlength=len(lead.rows)) > 0
    rest = np.bincount(row[~loop], value[~loop], len(lead.rows)) + problem.exit[lead.rows]
    value /= np.where(looping, np.maximum(rest, 1e-300), 1.0)[row]
    column = np.where(own, lead.state[np.maximum(target, 0)], m.indices[entry])
    keep = np.flatnonzero(~loop)
    keep = keep[np.lexsort((own[keep], position[row[keep]]))]
    count = np.bincount(position[row[keep]], minlength=len(order))
    ptr = np.concatenate(([0], np.cumsum(count))).astype(np.int64)
    outside = count - np.bincount(position[row[keep[own[keep]]]], minlength=len(order))
    rows_of = np.bincount(rank[lead.of_row], minlength=lead.count)
    row_ptr = np.concatenate(([0], np.cumsum(rows_of))).astype(np.int64)
    sizes = np.diff(lead.member_ptr)[parts.order]
    layer = Layer(
        block=parts.start.astype(np.int64),
        state=lead.state[parts.order],
        row_ptr=row_ptr,
        member_ptr=np.concatenate(([0], np.cumsum(sizes))).astype(np.int64),
        members=lead.members[_spans(lead.member_ptr[:-1][parts.order], lead.member_ptr[1:][parts.order])],
        ptr=ptr,
        mid=ptr[:-1] + outside,
        idx=column[keep].astype(np.int32),
        val=value[keep],
        reward=problem.rewards[lead.rows][order],
        # A row with one successor and nothing missing copies a value, which rounds nothing.
        slack=np.where((lengths[order] == 1) & (problem.exit[lead.rows][order] <= 0.0), 0.0, (2.0 * lengths[order] + 12.0) * _UNIT),
        full=problem.exit[lead.rows][order] <= 0.0,
        row_id=lead.rows[order],
        steps=np.ones(lead.count),
        inverse=np.zeros(0),
        inverse_at=np.full(parts.count, -1, np.int64),
    )
    return _with_inverses(replace(layer, steps=_steps(layer))) if layer.cycle > 1 else layer


def _with_inverses(layer: Layer) -> Layer:
    """With the inverses of cycles without choices that are left slowly: there, sweeps would go on for long."""
    found: list[Floats] = []
    at, total = layer.inverse_at.copy(), 0
    place = np.full(int(layer.state.max()) + 1, -1, np.int64)
    place[layer.state] = np.arange(len(layer.state))
    for b in np.flatnonzero(np.diff(layer.block) > 1).tolist():
        begin, end = int(layer.block[b]), int(layer.block[b + 1])
        n = end - begin
        plain = layer.row_ptr[end] - layer.row_ptr[begin] == n
        if not plain or n > _DENSE or layer.steps[begin:end].max() < _SLOW or (total + n * n) * 8 > _MEMORY // 8:
            continue
        a = np.eye(n)
        for i in range(n):
            r = int(layer.row_ptr[begin + i])
            inside = slice(int(layer.mid[r]), int(layer.ptr[r + 1]))
            np.subtract.at(a[i], place[layer.idx[inside]] - begin, layer.val[inside])
        found.append(np.maximum(np.linalg.inv(a), 0.0).ravel())
        at[b], total = total, total + n * n
    return replace(layer, inverse=np.concatenate(found), inverse_at=at) if found else layer


@dataclass(frozen=True, eq=False)
class _Leaders:
    """States that have equations of their own, with the states that share their value.

    state: int32[count]. number: a state's leader, -1 for none. members: states by leader. rows: rows of the matrix, in the
    order of their leaders (`of_row`).
    """

    state: Int32s
    number: Int64s
    members: Int32s
    member_ptr: Int64s
    rows: Int64s
    of_row: Int64s

    @property
    def count(self) -> int:
        return len(self.state)

    @classmethod
    def of(cls, problem: Epochs, unknown: Bools) -> _Leaders:
        source = graph.Incidence(problem.matrix)
        owner = source.owner_of_rows
        free = (problem.rewards == 0) & (problem.exit <= 0.0)
        parts = graph.maximal_end_components(source, unknown, free)
        inside = parts.of >= 0
        place = np.arange(problem.matrix.states)
        if problem.direction == "max":
            leader = np.full(parts.count, len(place))
            np.minimum.at(leader, parts.of[inside], np.flatnonzero(inside))
            place[inside] = leader[parts.of[inside]]
            rows = np.flatnonzero(unknown[owner] & ~parts.rows)
            leaving = np.zeros(len(place), np.bool_)
            leaving[place[owner[rows]]] = True
            active = unknown & leaving[place]
        else:
            active = unknown & ~inside
            rows = np.flatnonzero(active[owner])
        place, copies = _followed(problem, source, place, active, rows)
        rows = rows[~copies]
        members = np.flatnonzero(active)
        members = members[np.argsort(place[members], kind="stable")]
        state, sizes = np.unique(place[members], return_counts=True)
        number = np.full(len(place), -1, np.int64)
        number[members] = np.repeat(np.arange(len(state)), sizes)
        rows = rows[np.argsort(number[owner[rows]], kind="stable")]
        pointers = np.concatenate(([0], np.cumsum(sizes))).astype(np.int64)
        return cls(state.astype(np.int32), number, members.astype(np.int32), pointers, rows, number[owner[rows]])


def _followed(problem: Epochs, source: graph.Incidence, place: Int64s, active: Bools, rows: Int64s) -> tuple[Int64s, Bools]:
    """Leaders whose only row is a step to one state, without reward, follow that state's leader; and which rows these are."""
    m, owner = problem.matrix, source.owner_of_rows
    if not m.entries:
        return place, np.zeros(len(rows), np.bool_)
    of = place[owner[rows]]
    alone = np.bincount(of, minlength=len(place))[of] == 1
    copies = alone & (np.diff(m.indptr)[rows] == 1) & (problem.rewards[rows] == 0) & (problem.exit[rows] <= 0.0)
    target = m.indices[np.minimum(m.indptr[rows], m.entries - 1)]
    copies &= active[target]
    copies &= place[target] != of
    follow = np.arange(len(place))
    follow[of[copies]] = place[target[copies]]
    while True:
        further = follow[follow]
        if np.array_equal(further, follow):
            return follow[place], copies
        follow = further


def _components(source: Int64s, target: Int64s, n: int) -> graph.Components:
    """Strong components of a graph given by its edges, sorted by source; successors first."""
    indptr = np.concatenate(([0], np.cumsum(np.bincount(source, minlength=n)))).astype(np.int64)
    return graph.sccs(SparseMatrix(indptr, target.astype(np.int32), np.ones(len(target)), n))


def _steps(layer: Layer) -> Floats:
    """Per place, h >= 1 + A h for every choice of rows on its cycle: the greatest expected number of steps within it, or more."""
    from symcheck.numerics.methods import solve_linear
    from symcheck.numerics.settings import Accuracy

    n = len(layer.state)
    place = np.full(int(layer.state.max()) + 1, -1, np.int64)
    place[layer.state] = np.arange(n)
    count, others = layer.ptr[1:] - layer.mid, layer.mid - layer.ptr[:-1]
    entries, outside = _spans(layer.mid, layer.ptr[1:]), _spans(layer.ptr[:-1], layer.mid)
    indptr = np.concatenate(([0], np.cumsum(count))).astype(np.int64)
    data, numbers = layer.val[entries], np.arange(len(count))
    sums = np.bincount(np.repeat(numbers, count), data, len(count))
    # What leaves the cycle: all that goes elsewhere, and the rest to 1 (rows with a reward leave for certain).
    elsewhere = np.bincount(np.repeat(numbers, others), layer.val[outside], len(count))
    leave = np.where(layer.full, elsewhere, np.maximum(1.0 - sums, elsewhere))
    matrix = SparseMatrix(indptr, place[layer.idx[entries]].astype(np.int32), data, n, layer.row_ptr)
    found = solve_linear(LinearProblem(np.ones(len(count)), matrix, None, leave, "max", False), Accuracy(epsilon=1e-6))
    h = found.upper
    rest = np.repeat(h, np.diff(layer.row_ptr)) - np.bincount(np.repeat(numbers, count), data * h[matrix.indices], len(count))
    # h - A h is 1 but for rounding; made at least 1, with room for the rounding of the kernel.
    least = float(rest.min()) * (1.0 - 1e-9)
    if not least > 1e-3:
        from symcheck.errors import NumericalError

        raise NumericalError("cycles without reward that are left too slowly for bounds on their values")
    return np.asarray(h / least)


def unfold(problem: Epochs, rewards: Int64s, lower: int, upper: int | None) -> tuple[Epochs, Int64s]:
    """The same with a second bound, whose reward (int64[rows]) is counted in the state: state s with count c is s * counts + c.
    With it, the row that each row comes from.

    Counts run up to `upper`, beyond which a run has failed, or up to `lower`, which is enough. Raises MemoryLimitError.
    """
    counts = (lower if upper is None else upper) + 1
    m = problem.matrix
    if m.entries * counts > 200_000_000:
        raise MemoryLimitError(f"a second bound unfolds {m.states:,} states into {counts:,} copies each, which is too much")
    c = np.arange(counts)
    groups = problem.groups
    of_state = np.repeat(np.arange(m.states), counts)
    count_of = np.tile(c, m.states)
    rows = _spans(groups[of_state], groups[of_state + 1])
    per_pair = (groups[1:] - groups[:-1])[of_state]
    after = np.repeat(count_of, per_pair) + np.minimum(rewards[rows], counts)
    fails = after >= counts if upper is not None else np.zeros(len(rows), np.bool_)
    after = np.minimum(after, counts - 1)
    lengths = np.where(fails, 0, np.diff(m.indptr)[rows])
    entries = _spans(m.indptr[rows], m.indptr[rows] + lengths)
    columns = m.indices[entries].astype(np.int64) * counts + np.repeat(after, lengths)
    matrix = SparseMatrix(
        np.concatenate(([0], np.cumsum(lengths))).astype(np.int64),
        columns.astype(np.int32),
        m.data[entries],
        m.states * counts,
        None if m.groups is None else np.concatenate(([0], np.cumsum(per_pair))).astype(np.int64),
    )
    unfolded = replace(
        problem,
        matrix=matrix,
        exit=np.where(fails, 1.0, problem.exit[rows]),
        rewards=problem.rewards[rows],
        left=problem.left[of_state],
        right=problem.right[of_state] & (count_of >= lower),
    )
    return unfolded, rows
