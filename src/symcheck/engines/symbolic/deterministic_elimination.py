"""Reachability among very many states that mostly have one way on: rows of the other states only, in terms of each other.

A state with one choice that leads to one state for certain has that state's probability. In models of timed systems nearly
all states are such: of the 84 856 004 states of csma with 3 stations and 6 collisions, 2 % are not. Diagrams say which, and
one product with the numbers of the states says where each of them leads; following that to the end takes one pass. What is
left are the rows of the others (`Shorter`), small enough for graph algorithms that take linear time, where fixpoints on diagrams
take as many steps as the longest path is long. Nothing is lost but how many steps a path takes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from symcheck.dd.manager import Bdd, Mtbdd
from symcheck.dd.odd import Odd
from symcheck.direction import Direction
from symcheck.engines.explicit.array_values import ArrayValues
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import (
    LazyValues,
    Piece,
    SymbolicSet,
    SymbolicValues,
    constant_piece,
)
from symcheck.kernels.blocks.block_matrix import Blocks
from symcheck.kernels.graph import deterministic_states as kernel
from symcheck.kernels.rows import sparse
from symcheck.kernels.rows.submatrix import take_rows
from symcheck.matrices.blocks import BUDGET, RowLayout, flatten, quad_dag
from symcheck.matrices.rows import Bools, Floats, Int32s, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.semantics.rewards import Reward

__all__ = ["Shorter", "ShorterReward", "ShorterUntil", "Ways", "forced_states", "shorter"]


def forced_states(d: Diagrams) -> Bdd:
    """States with one choice, which leads to one state for certain (not of a CTMC: its entries are rates)."""
    seen = twice = d.manager.false
    for guard in d.slot_guards:
        twice = twice | (seen & guard)
        seen = seen | guard
    certain = [root.equal(1.0).exists(d.column_cube) for root in d.roots]
    return d.union(certain) & (d.states - twice)


@dataclass(frozen=True, eq=False)
class Ways:
    """Where states lead: place, int32[states] (see `Shorter`), and what is earned on the way, float64[states] (None: nothing is asked)."""

    diagrams: Diagrams = field(repr=False)
    place: Int32s = field(repr=False)
    along: Floats | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)
class Shorter:
    """left U right among the states that are left when forced ones are passed over.

    These are numbered 0 .. n-1 as `kept` has them; n stands for `right`, n+1 for all states from where it is missed for certain.
    ways: for each reachable state the number of where it leads. matrix: the choices of the n states, and n+2 columns; the two last
    states have no row. earned: per row, the expected reward of a step and of the ways that it leads to, float64[rows] or None.
    """

    ways: Ways
    kept: Odd = field(repr=False)
    matrix: SparseMatrix
    earned: Floats | None = field(default=None, repr=False)

    @property
    def diagrams(self) -> Diagrams:
        """Of the model."""
        return self.ways.diagrams

    @property
    def place(self) -> Int32s:
        """The number of where each state leads: int32[states]."""
        return self.ways.place

    @property
    def n(self) -> int:
        """Number of states that are left."""
        return self.kept.count

    @cached_property
    def _edges(self) -> graph.Incidence:
        return graph.Incidence(self.matrix)

    def forget(self) -> None:
        """Give back what graph questions have made; they make it again."""
        vars(self).pop("_edges", None)

    @cached_property
    def _ends(self) -> tuple[Bools, Bools]:
        left, right = np.ones(self.n + 2, bool), np.zeros(self.n + 2, bool)
        left[self.n :] = False
        right[self.n] = True
        return left, right

    def prob0(self, direction: Direction | None) -> Bools:
        """Which of the n+2 have (least or greatest) probability 0."""
        return graph.prob0(self._edges, *self._ends, direction)

    def prob1(self, direction: Direction | None) -> Bools:
        """Which of the n+2 have (least or greatest) probability 1."""
        return graph.prob1(self._edges, *self._ends, direction)

    def states(self, members: Bools) -> Bdd:
        """All states that lead to these (bool[n+2])."""
        if members.all():
            return self.diagrams.states
        return (
            self.diagrams.odd.from_mask(members[self.place])
            if members.any()
            else self.diagrams.manager.false
        )


def shorter(
    d: Diagrams, left: Bdd, right: Bdd, limit: int, reward: Reward | None = None
) -> Shorter | None:
    """The problem left U right without its forced states, and with a reward structure if one is given.

    None where it would take more than `limit` bytes, or some reward is negative or infinite.
    """
    if reward is not None and not _plain(d, reward):
        return None
    between = left - right
    forced = between & forced_states(d)
    kept = Odd(d.manager, between - forced, d.rows)
    if d.count >= 2**31 - 2 or _bytes(d, kept.states, reward) > limit:
        return None
    ways = _ways(d, kept, forced, right, reward)
    layout = (
        None
        if d.guards is None
        else RowLayout.of([kept.to_mask(guard) for guard in d.guards], kept.count)
    )
    indptr, indices, data = flatten(
        quad_dag([root.times_bdd(kept.states) for root in d.roots], kept, d.odd, d.columns), layout
    )
    earned = None
    if reward is not None:
        assert ways.along is not None
        earned = np.empty(len(indptr) - 1)
        sparse.multiply(indptr, indices, data, ways.along, earned)
        _add_step(d, kept, layout, reward, earned)
    entries = sparse.merge_columns_in_place(indptr, indices, data, ways.place, kept.count + 2)
    groups = np.arange(len(indptr), dtype=np.int64) if layout is None else layout.groups
    padded = np.append(groups, [groups[-1], groups[-1]])
    return Shorter(
        ways,
        kept,
        SparseMatrix(indptr, indices[:entries], data[:entries], kept.count + 2, padded),
        earned,
    )


def _plain(d: Diagrams, reward: Reward) -> bool:
    states, transitions = d.rewards(reward)
    functions = (states, *transitions)
    return all(f.minimum_leaf >= 0.0 and f.maximum_leaf < np.inf for f in functions)


def _bytes(d: Diagrams, kept: Bdd, reward: Reward | None) -> int:
    """What `shorter` takes at most, graph questions included."""
    both = d.manager.cube([*d.rows, *d.columns])
    entries = sum(d.manager.count(relation & kept, both) for relation in d.slot_relations)
    rows = sum(d.manager.count(guard & kept, d.row_cube) for guard in d.slot_guards)
    return 20 * (d.count + entries) + 16 * rows + (0 if reward is None else 8 * (d.count + rows))


def _ways(d: Diagrams, kept: Odd, forced: Bdd, right: Bdd, reward: Reward | None) -> Ways:
    n, along = kept.count, None
    place = np.empty(d.count, np.int32)
    if forced:
        # Rows with a single 1: where each leads. Rows are numbered as all states, so that nothing else is as long as they are many.
        moves = d.manager.sum([root.times_bdd(forced) for root in d.roots])
        Blocks(quad_dag([moves], d.odd, d.odd, d.columns), BUDGET).columns_of(0, place)
        np.invert(place, out=place)  # -1 - successor
    place[d.odd.to_mask(d.states - forced - kept.states - right)] = n + 1
    place[d.odd.to_mask(right)] = n
    place[d.odd.to_mask(kept.states)] = np.arange(n, dtype=np.int32)
    if reward is not None:
        steps = [
            f.times_bdd(guard & forced)
            for f, guard in zip(_step_rewards(d, reward), d.slot_guards, strict=True)
        ]
        along = d.odd.to_vector(d.manager.sum(steps))
    kernel.resolve_representatives(place, n + 1, along)
    return Ways(d, place, along)


def _step_rewards(d: Diagrams, reward: Reward) -> list[Mtbdd]:
    """Per slot: what a step earns."""
    states, transitions = d.rewards(reward)
    return [states + each for each in transitions]


def _add_step(
    d: Diagrams, kept: Odd, layout: RowLayout | None, reward: Reward, out: Floats
) -> None:
    """Add to each row what its step earns."""
    functions = _step_rewards(d, reward)
    if layout is None:
        out += kept.to_vector(functions[0])
        return
    for function, (present, rows) in zip(functions, layout.each(), strict=True):
        out[rows] += kept.to_vector(function)[present]


@dataclass(frozen=True, eq=False)
class ShorterUntil:
    """The probability of left U right as equations over the states that are left and neither 0 nor 1 (see `Shorter`)."""

    parts: Shorter
    no: Bools = field(repr=False)
    yes: Bools = field(repr=False)
    direction: Direction | None

    @staticmethod
    def of(parts: Shorter, direction: Direction | None) -> ShorterUntil:
        """Graph analysis first."""
        found = ShorterUntil(parts, parts.prob0(direction), parts.prob1(direction), direction)
        parts.forget()
        return found

    @cached_property
    def open(self) -> Bools:
        """Which of the n+2 are unknowns."""
        return ~(self.no | self.yes)

    @cached_property
    def n(self) -> int:
        """Number of unknowns."""
        return int(np.count_nonzero(self.open))

    def problem(self) -> LinearProblem:
        """The equations. They are written over the rows of `parts`, which take much memory: to be asked for once."""
        matrix, into, leave = _among(self.parts.matrix, self.open, self.yes, self.direction)
        return LinearProblem(into, matrix, None, leave, self.direction, True)

    def lift(
        self,
        lower: Floats,
        upper: Floats | None,
        rest: Sequence[tuple[SymbolicSet, float]] = (),
        exact: bool = False,
    ) -> SymbolicValues:
        """Values on all states. `rest` must be empty: what is 0 and 1 is known here."""
        return _lifted(
            self.parts.ways, self.yes.astype(np.float64), self.open, (lower, upper, rest, exact)
        )


@dataclass(frozen=True, eq=False)
class ShorterReward:
    """The expected reward until `right` is reached, as equations over the states that are left and where it is finite."""

    parts: Shorter
    certain: Bools = field(repr=False)
    direction: Direction | None

    @staticmethod
    def of(parts: Shorter, direction: Direction | None) -> ShorterReward:
        """Graph analysis first: the least reward is finite where some strategy reaches almost surely, the greatest where all do."""
        found = ShorterReward(parts, parts.prob1(direction and direction.dual), direction)
        parts.forget()
        return found

    @cached_property
    def open(self) -> Bools:
        """Which of the n+2 are unknowns."""
        members = self.certain.copy()
        members[self.parts.n :] = False
        return members

    @cached_property
    def n(self) -> int:
        """Number of unknowns."""
        return int(np.count_nonzero(self.open))

    def problem(self) -> tuple[LinearProblem, Bools]:
        """The equations, and which of their rows surely stay where the reward is finite. As in `ShorterUntil`, to be asked for once."""
        assert self.parts.earned is not None
        assert self.parts.matrix.groups is not None
        earned = take_rows(self.parts.earned, self.parts.matrix.groups, self.open.view(np.uint8))
        matrix, into, leave = _among(self.parts.matrix, self.open, ~self.certain, self.direction)
        return LinearProblem(earned, matrix, None, leave, self.direction, False), into == 0.0

    def lift(
        self,
        lower: Floats,
        upper: Floats | None,
        rest: Sequence[tuple[SymbolicSet, float]] = (),
        exact: bool = False,
    ) -> SymbolicValues:
        """Values on all states. `rest` must be empty: what is 0 and infinite is known here."""
        return _lifted(
            self.parts.ways,
            np.where(self.certain, 0.0, np.inf),
            self.open,
            (lower, upper, rest, exact),
        )


def _among(
    m: SparseMatrix, open_: Bools, member: Bools, direction: Direction | None
) -> tuple[SparseMatrix, Floats, Floats]:
    """The matrix among some states, written over m; per row, what enters members that are not among them, and what leaves."""
    assert m.groups is not None
    n = int(np.count_nonzero(open_))
    place = np.full(m.columns, -1, np.int32)
    place[open_] = np.arange(n, dtype=np.int32)
    groups, into, leave, entries = kernel.restrict_in_place(
        m.indptr, m.indices, m.data, m.groups, member.view(np.uint8), place, n
    )
    rows = m.indptr[: len(into) + 1], m.indices[:entries], m.data[:entries]
    return SparseMatrix(*rows, n, None if direction is None else groups), into, leave


_Lift = tuple[Floats, Floats | None, Sequence[tuple[SymbolicSet, float]], bool]


def _lifted(ways: Ways, known: Floats, open_: Bools, found: _Lift) -> SymbolicValues:
    lower, upper, rest, exact = found
    if rest:
        raise ValueError("constants on sets are not asked for here")
    low = known.copy()
    low[open_] = lower
    high = low
    if upper is not None and upper is not lower:
        high = known.copy()
        high[open_] = upper
    return _Values(ways, ArrayValues(low, high, open_ if exact else None))


class _Values(LazyValues):
    """Values by where a state leads; written out for all states only if somebody asks for that."""

    def __init__(self, ways: Ways, values: ArrayValues) -> None:
        super().__init__(ways.diagrams, partial(_pieces, ways, values, ways.diagrams.states))
        vars(self).update(_parts_of=partial(_pieces, ways, values), _exact=values.exact)

    @cached_property
    def exact(self) -> bool:
        """Whether lower and upper are the same everywhere."""
        return bool(vars(self)["_exact"])

    def _parts(self, states: SymbolicSet) -> Iterator[tuple[Bdd, ArrayValues]]:
        for piece in vars(self)["_parts_of"](states.bdd):
            yield piece.states, piece.values


def _pieces(ways: Ways, values: ArrayValues, states: Bdd) -> tuple[Piece, ...]:
    """The values on some states."""
    d = ways.diagrams
    whole = states == d.states
    odd = d.odd if whole else Odd(d.manager, states, d.rows)
    if not odd.count:
        return ()
    places = slice(None) if whole else odd.indices_in(d.odd)
    place = ways.place[places]
    low, high = values.lower[place], values.upper[place]
    computed = None if values.computed is None else values.computed[place]
    if ways.along is not None:
        along = ways.along[places]
        low, high = low + along, high + along
        computed = None if computed is None else computed | (along > 0.0)
    if values.upper is values.lower:
        high = low
    if (
        low.min() == low.max()
        and high.min() == high.max()
        and (computed is None or computed.all() or not computed.any())
    ):
        return (
            constant_piece(
                states, float(low[0]), float(high[0]), computed is not None and bool(computed[0])
            ),
        )
    return (Piece(states, ArrayValues(low, high, computed), odd),)
