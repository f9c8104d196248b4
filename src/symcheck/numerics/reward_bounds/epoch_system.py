"""The equations of one epoch (see `symcheck.numerics.reward_bounds.epochs`).

They are ordered once and solved for each budget.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.problem import LinearProblem

__all__ = ["EpochSystem", "RewardBoundedReachability", "epoch_system"]


@dataclass(frozen=True, eq=False)
class RewardBoundedReachability:
    """`left U right` with an accumulated reward within bounds when `right` holds.

    matrix: probabilities among n states. exit: the probability of leaving to states where the
    formula fails, per row. rewards: whole numbers that a step by the row earns, int64[rows].
    lower, upper: the bounds on the reward, inclusive; `upper` None: no upper bound.
    direction: minimise or maximise; None without choices. error: of probabilities, relative.
    """

    matrix: SparseMatrix
    exit: Numbers = field(repr=False)
    rewards: Int64s = field(repr=False)
    left: Bools = field(repr=False)
    right: Bools = field(repr=False)
    lower: int
    upper: int | None
    direction: Direction | None
    error: float = tuning.ENTRY_ERROR

    @property
    def groups(self) -> Int64s:
        """Rows of each state: int64[n+1]."""
        groups = self.matrix.groups
        return np.arange(self.matrix.rows + 1, dtype=np.int64) if groups is None else groups

    @property
    def levels(self) -> int:
        """The number of epochs that are solved one after the other."""
        return self.lower if self.upper is None else self.upper + 1


@dataclass(frozen=True, eq=False)
class EpochSystem:
    """The equations of one epoch, in the order of evaluation.

    block: states `block[b]` to `block[b+1]` of the order are strongly connected.
    state: the state at each place of the order.
    row_ptr: the place i has the rows `row_ptr[i]` to `row_ptr[i+1]`.
    member_ptr, members: the value of place i is that of `members[member_ptr[i]:member_ptr[i+1]]`.
    ptr, mid, idx, val: row r has the entries `ptr[r]` to `ptr[r+1]`, of which those from `mid[r]`
      on lead to its own block. Self-loops are divided out.
    reward: the reward of each row. slack: bound on the relative rounding error of each row.
    full: whether no probability of a row is missing.
    steps: h with h >= 1 + A h on cycles.
    inverse, inverse_at: the entries of (I - A)^-1 in floating point, of block b from
      `inverse_at[b]` on (-1: there is no inverse).
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
    steps: Floats
    inverse: Floats
    inverse_at: Int64s

    @property
    def cycle(self) -> int:
        """The number of states of the largest block (1: there are no cycles)."""
        return int(np.diff(self.block).max(initial=0))


def epoch_system(problem: RewardBoundedReachability, unknown: Bools) -> EpochSystem:
    """The equations of an epoch over the unknown states; states that are no member have value 0."""
    lead = _Representatives.of(problem, unknown)
    entries = _Entries.of(problem, lead)
    blocks = _edge_components(
        lead.of_row[entries.row[entries.edge]], entries.target[entries.edge], lead.count
    )
    system = _ordered(problem, lead, entries, blocks)
    if system.cycle <= 1:
        return system
    return _with_inverses(replace(system, steps=_expected_steps(system)))


@dataclass(frozen=True, eq=False)
class _Entries:
    """The entries of the rows of representatives.

    row: the row of each entry, counted among those of the representatives. index: the entry of the
    matrix. target: the representative of the successor, -1 for none. edge: whether the entry leads
    to another representative in the same epoch. loop: whether it is a self-loop.
    """

    row: Int64s
    index: Int64s
    target: Int64s
    edge: Bools
    loop: Bools

    @staticmethod
    def of(problem: RewardBoundedReachability, lead: _Representatives) -> _Entries:
        m = problem.matrix
        index = spans(m.indptr[:-1][lead.rows], m.indptr[1:][lead.rows])
        row = np.repeat(np.arange(len(lead.rows)), m.lengths[lead.rows])
        target = lead.number[m.indices[index]]
        same_epoch = (problem.rewards == 0)[lead.rows][row] & (target >= 0)
        edge = same_epoch & (target != lead.of_row[row])
        return _Entries(row, index, target, edge, same_epoch & ~edge)

    def values(self, problem: RewardBoundedReachability, lead: _Representatives) -> Floats:
        """The probabilities, with self-loops divided out; exactly 1 for deterministic rows."""
        m, rows = problem.matrix, lead.rows
        deterministic = (m.lengths[rows] == 1) & (problem.exit[rows] <= 0.0)
        value = np.where(deterministic[self.row], 1.0, m.data[self.index])
        looping = np.bincount(self.row[self.loop], minlength=len(rows)) > 0
        rest = np.bincount(self.row[~self.loop], value[~self.loop], len(rows)) + problem.exit[rows]
        return np.asarray(value / np.where(looping, np.maximum(rest, 1e-300), 1.0)[self.row])


def _ordered(
    problem: RewardBoundedReachability,
    lead: _Representatives,
    entries: _Entries,
    blocks: graph.Components,
) -> EpochSystem:
    """The equations in block order, with the entries within the block last in each row."""
    m, row, target = problem.matrix, entries.row, entries.target
    rank = np.empty(lead.count, np.int64)
    rank[blocks.order] = np.arange(lead.count)
    order = np.argsort(rank[lead.of_row], kind="stable")
    position = np.empty(len(order), np.int64)
    position[order] = np.arange(len(order))
    inner = entries.edge & (blocks.of[np.maximum(target, 0)] == blocks.of[lead.of_row[row]])
    column = np.where(inner, lead.state[np.maximum(target, 0)], m.indices[entries.index])
    keep = np.flatnonzero(~entries.loop)
    keep = keep[np.lexsort((inner[keep], position[row[keep]]))]
    count = np.bincount(position[row[keep]], minlength=len(order))
    outside = count - np.bincount(position[row[keep[inner[keep]]]], minlength=len(order))
    ptr = starts_of(count)
    rows = lead.rows[order]
    lengths, full = m.lengths[rows], problem.exit[rows] <= 0.0
    first, last = lead.member_ptr[:-1][blocks.order], lead.member_ptr[1:][blocks.order]
    return EpochSystem(
        block=blocks.start.astype(np.int64),
        state=lead.state[blocks.order],
        row_ptr=starts_of(np.bincount(rank[lead.of_row], minlength=lead.count)),
        member_ptr=starts_of(last - first),
        members=lead.members[spans(first, last)],
        ptr=ptr,
        mid=ptr[:-1] + outside,
        idx=column[keep].astype(np.int32),
        val=entries.values(problem, lead)[keep],
        reward=problem.rewards[rows],
        # A deterministic row copies a value, which rounds nothing.
        slack=np.where(
            (lengths == 1) & full,
            0.0,
            (lengths + 6.0) * tuning.UNIT_ROUNDOFF + 2.0 * problem.error,
        ),
        full=full,
        steps=np.ones(lead.count),
        inverse=np.zeros(0),
        inverse_at=np.full(blocks.count, -1, np.int64),
    )


def _with_inverses(system: EpochSystem) -> EpochSystem:
    """Add the inverses of blocks without choices on which sweeps would converge slowly."""
    result: list[Floats] = []
    at, total = system.inverse_at.copy(), 0
    index = np.full(int(system.state.max()) + 1, -1, np.int64)
    index[system.state] = np.arange(len(system.state))
    for b in np.flatnonzero(np.diff(system.block) > 1).tolist():
        begin, end = int(system.block[b]), int(system.block[b + 1])
        n = end - begin
        plain = system.row_ptr[end] - system.row_ptr[begin] == n
        if (
            not plain
            or n > tuning.INVERSE_STATES
            or system.steps[begin:end].max() < tuning.INVERSE_MIN_STEPS
            or (total + n * n) * 8 > tuning.INVERSE_BYTES
        ):
            continue
        a = np.eye(n)
        for i in range(n):
            r = int(system.row_ptr[begin + i])
            inside = slice(int(system.mid[r]), int(system.ptr[r + 1]))
            np.subtract.at(a[i], index[system.idx[inside]] - begin, system.val[inside])
        result.append(np.maximum(np.linalg.inv(a), 0.0).ravel())
        at[b], total = total, total + n * n
    return replace(system, inverse=np.concatenate(result), inverse_at=at) if result else system


@dataclass(frozen=True, eq=False)
class _Representatives:
    """Representatives: the states that have equations of their own.

    state: the representatives, int32[count]. number: the representative of each state, -1 for none.
    members: states sorted by representative. rows: rows of the matrix, sorted by representative
    (`of_row`).
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
    def of(cls, problem: RewardBoundedReachability, unknown: Bools) -> _Representatives:
        source = graph.Incidence(problem.matrix)
        owner = source.owner_of_rows
        free = (problem.rewards == 0) & (problem.exit <= 0.0)
        parts = graph.maximal_end_components(source, unknown, free)
        inside = parts.of >= 0
        representative = np.arange(problem.matrix.states)
        if problem.direction == Direction.MAX:
            representative = parts.representatives()
            rows = np.flatnonzero(unknown[owner] & ~parts.rows)
            leaving = np.zeros(len(representative), np.bool_)
            leaving[representative[owner[rows]]] = True
            active = unknown & leaving[representative]
        else:
            active = unknown & ~inside
            rows = np.flatnonzero(active[owner])
        members = np.flatnonzero(active)
        members = members[np.argsort(representative[members], kind="stable")]
        state, sizes = np.unique(representative[members], return_counts=True)
        number = np.full(len(representative), -1, np.int64)
        number[members] = np.repeat(np.arange(len(state)), sizes)
        rows = rows[np.argsort(number[owner[rows]], kind="stable")]
        pointers = starts_of(sizes)
        return cls(
            state.astype(np.int32),
            number,
            members.astype(np.int32),
            pointers,
            rows,
            number[owner[rows]],
        )


def _edge_components(source: Int64s, target: Int64s, n: int) -> graph.Components:
    """Strong components, successors first, of a graph given by its edges, sorted by source."""
    indptr = starts_of(np.bincount(source, minlength=n))
    return graph.sccs(SparseMatrix(indptr, target.astype(np.int32), np.ones(len(target)), n))


def _expected_steps(system: EpochSystem) -> Floats:
    """Upper bounds h >= 1 + A h on the expected steps within the own block, for all choices."""
    from symcheck.numerics.linear.methods import solve_linear
    from symcheck.numerics.settings import Accuracy

    n = len(system.state)
    index = np.full(int(system.state.max()) + 1, -1, np.int64)
    index[system.state] = np.arange(n)
    count, others = system.ptr[1:] - system.mid, system.mid - system.ptr[:-1]
    entries, outside = spans(system.mid, system.ptr[1:]), spans(system.ptr[:-1], system.mid)
    indptr = starts_of(count)
    data, numbers = system.val[entries], np.arange(len(count))
    sums = np.bincount(np.repeat(numbers, count), data, len(count))
    # The probability of leaving the block; rows with a reward leave it for certain.
    elsewhere = np.bincount(np.repeat(numbers, others), system.val[outside], len(count))
    leave = np.where(system.full, elsewhere, np.maximum(1.0 - sums, elsewhere))
    matrix = SparseMatrix(
        indptr, index[system.idx[entries]].astype(np.int32), data, n, system.row_ptr
    )
    solution = solve_linear(
        LinearProblem(np.ones(len(count)), matrix, None, leave, Direction.MAX, False),
        Accuracy(epsilon=1e-6),
    )
    h = solution.upper
    state_of_row = np.repeat(h, np.diff(system.row_ptr))
    # h - A h is 1 up to rounding, which matters if h is large. It is made at least 1, with room for
    # the rounding of the kernel.
    with np.errstate(invalid="ignore"):  # h may be infinite
        rest = state_of_row - np.bincount(
            np.repeat(numbers, count), data * h[matrix.indices], len(count)
        )
        rest -= ((2.0 * count + 6.0) * tuning.UNIT_ROUNDOFF + system.slack) * state_of_row
    least = float(rest.min()) * (1.0 - 1e-9)
    if not least > 1e-3:
        raise NumericalError(
            "cycles without reward are left too slowly for proved bounds", hint="use -exact"
        )
    return np.asarray(h / least)
