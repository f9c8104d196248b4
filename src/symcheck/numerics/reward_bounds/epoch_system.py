"""The equations of one budget (see `symcheck.numerics.reward_bounds.epochs`): put in order once, solved for each budget."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem

__all__ = ["Epochs", "Layer", "layer_of"]

_DENSE = 1_500
"""States of a cycle without choices up to which its equations are inverted."""
_SLOW = 30.0
"""Steps on a cycle from which on that pays."""
_INVERSES = 512 << 20
"""Bytes for such inverses."""
_UNIT = 2.0**-53


@dataclass(frozen=True, eq=False)
class Epochs:
    """`left U right` with a reward from `lower` to `upper` (None: no end) when `right` holds; rewards are whole numbers.

    matrix: probabilities among n states. exit: per row, what leads elsewhere, to failure (float64[rows]). rewards: int64[rows],
    what a step by the row adds. direction: None, 'min' or 'max'.
    """

    matrix: SparseMatrix
    exit: Numbers = field(repr=False)
    rewards: Int64s = field(repr=False)
    left: Bools = field(repr=False)
    right: Bools = field(repr=False)
    lower: int
    upper: int | None
    direction: Direction | None

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


def layer_of(problem: Epochs, unknown: Bools) -> Layer:
    """The equations of a level over the states `unknown`; those that are not among `Layer.members` have value 0."""
    lead = _Leaders.of(problem, unknown)
    m, zero = problem.matrix, problem.rewards == 0
    lengths = np.diff(m.indptr)[lead.rows]
    entry = spans(m.indptr[:-1][lead.rows], m.indptr[1:][lead.rows])
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
    ptr = starts_of(count)
    outside = count - np.bincount(position[row[keep[own[keep]]]], minlength=len(order))
    rows_of = np.bincount(rank[lead.of_row], minlength=lead.count)
    row_ptr = starts_of(rows_of)
    sizes = np.diff(lead.member_ptr)[parts.order]
    layer = Layer(
        block=parts.start.astype(np.int64),
        state=lead.state[parts.order],
        row_ptr=row_ptr,
        member_ptr=starts_of(sizes),
        members=lead.members[
            spans(lead.member_ptr[:-1][parts.order], lead.member_ptr[1:][parts.order])
        ],
        ptr=ptr,
        mid=ptr[:-1] + outside,
        idx=column[keep].astype(np.int32),
        val=value[keep],
        reward=problem.rewards[lead.rows][order],
        # A row with one successor and nothing missing copies a value, which rounds nothing.
        slack=np.where(
            (lengths[order] == 1) & (problem.exit[lead.rows][order] <= 0.0),
            0.0,
            (2.0 * lengths[order] + 12.0) * _UNIT,
        ),
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
        if (
            not plain
            or n > _DENSE
            or layer.steps[begin:end].max() < _SLOW
            or (total + n * n) * 8 > _INVERSES
        ):
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
        if problem.direction == Direction.MAX:
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
        pointers = starts_of(sizes)
        return cls(
            state.astype(np.int32),
            number,
            members.astype(np.int32),
            pointers,
            rows,
            number[owner[rows]],
        )


def _followed(
    problem: Epochs, source: graph.Incidence, place: Int64s, active: Bools, rows: Int64s
) -> tuple[Int64s, Bools]:
    """Leaders whose only row is a step to one state, without reward, follow that state's leader; and which rows these are."""
    m, owner = problem.matrix, source.owner_of_rows
    if not m.entries:
        return place, np.zeros(len(rows), np.bool_)
    of = place[owner[rows]]
    alone = np.bincount(of, minlength=len(place))[of] == 1
    copies = (
        alone
        & (np.diff(m.indptr)[rows] == 1)
        & (problem.rewards[rows] == 0)
        & (problem.exit[rows] <= 0.0)
    )
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
    indptr = starts_of(np.bincount(source, minlength=n))
    return graph.sccs(SparseMatrix(indptr, target.astype(np.int32), np.ones(len(target)), n))


def _steps(layer: Layer) -> Floats:
    """Per place, h >= 1 + A h for every choice of rows on its cycle: the greatest expected number of steps within it, or more."""
    from symcheck.numerics.linear.methods import solve_linear
    from symcheck.numerics.settings import Accuracy

    n = len(layer.state)
    place = np.full(int(layer.state.max()) + 1, -1, np.int64)
    place[layer.state] = np.arange(n)
    count, others = layer.ptr[1:] - layer.mid, layer.mid - layer.ptr[:-1]
    entries, outside = spans(layer.mid, layer.ptr[1:]), spans(layer.ptr[:-1], layer.mid)
    indptr = starts_of(count)
    data, numbers = layer.val[entries], np.arange(len(count))
    sums = np.bincount(np.repeat(numbers, count), data, len(count))
    # What leaves the cycle: all that goes elsewhere, and the rest to 1 (rows with a reward leave for certain).
    elsewhere = np.bincount(np.repeat(numbers, others), layer.val[outside], len(count))
    leave = np.where(layer.full, elsewhere, np.maximum(1.0 - sums, elsewhere))
    matrix = SparseMatrix(
        indptr, place[layer.idx[entries]].astype(np.int32), data, n, layer.row_ptr
    )
    found = solve_linear(
        LinearProblem(np.ones(len(count)), matrix, None, leave, Direction.MAX, False),
        Accuracy(epsilon=1e-6),
    )
    h = found.upper
    own = np.repeat(h, np.diff(layer.row_ptr))
    rest = own - np.bincount(np.repeat(numbers, count), data * h[matrix.indices], len(count))
    # h - A h is 1 but for rounding, which counts where h is large; made at least 1, with room for the rounding of the kernel.
    least = float((rest - (2.0 * count + 6.0) * _UNIT * own).min()) * (1.0 - 1e-9)
    if not least > 1e-3:
        raise NumericalError(
            "cycles without reward are left too slowly for proved bounds\n  hint: -exact needs none"
        )
    return np.asarray(h / least)
