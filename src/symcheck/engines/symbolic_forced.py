"""Reachability among very many states that mostly have one way on: rows of the other states only, in terms of each other.

A state with one choice that leads to one state for certain has that state's probability. In models of timed systems nearly
all states are such: of the 84 856 004 states of csma with 3 stations and 6 collisions, 2 % are not. Diagrams say which, and
one product with the numbers of the states says where each of them leads; following that to the end takes one pass. What is
left are the rows of the others (`Shorter`), small enough for graph algorithms that take linear time, where fixpoints on diagrams
take as many steps as the longest path is long. Nothing is lost but how many steps a path takes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property, partial

import numpy as np

from symcheck.dd.manager import Bdd
from symcheck.dd.odd import Odd
from symcheck.dd.quad import BUDGET, RowLayout, flatten, quad_dag
from symcheck.engines.arrays import ArrayValues
from symcheck.engines.diagrams import Diagrams
from symcheck.engines.symbolic_sets import LazyValues, Piece, SymbolicSet, SymbolicValues, constant_piece, merged
from symcheck.kernels import forced as kernel
from symcheck.kernels.blocks import Blocks
from symcheck.kernels.rows import groups_among, select_states, sum_among
from symcheck.numerics import graph
from symcheck.numerics.matrix import Bools, Floats, Int32s, SparseMatrix
from symcheck.numerics.problem import LinearProblem
from symcheck.records import dataclass, field

__all__ = ["Shorter", "ShorterUntil", "forced_states", "shorter"]


def forced_states(d: Diagrams) -> Bdd:
    """States with one choice, which leads to one state for certain (not of a CTMC: its entries are rates)."""
    guards = d.guards if d.guards is not None else (d.states,)
    seen = twice = d.manager.false
    for guard in guards:
        twice = twice | (seen & guard)
        seen = seen | guard
    certain = [root.equal(1.0).exists(d.column_cube) for root in d.roots]
    return d.union(certain) & (d.states - twice)


@dataclass(frozen=True, eq=False)
class Shorter:
    """left U right among the states that are left when forced ones are passed over.

    These are numbered 0 .. n-1 as `kept` has them; n stands for `right`, n+1 for all states from where it is missed for certain.
    place: int32[states], the number of where each reachable state leads. matrix: the choices of the n states, and n+2 columns;
    the two last states have no row.
    """

    diagrams: Diagrams = field(repr=False)
    kept: Odd = field(repr=False)
    place: Int32s = field(repr=False)
    matrix: SparseMatrix

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

    def prob0(self, direction: str | None) -> Bools:
        """Which of the n+2 have (least or greatest) probability 0."""
        return graph.prob0(self._edges, *self._ends, direction)

    def prob1(self, direction: str | None) -> Bools:
        """Which of the n+2 have (least or greatest) probability 1."""
        return graph.prob1(self._edges, *self._ends, direction)

    def states(self, members: Bools) -> Bdd:
        """All states that lead to these (bool[n+2])."""
        if members.all():
            return self.diagrams.states
        return self.diagrams.odd.collapse(members[self.place]) if members.any() else self.diagrams.manager.false


def shorter(d: Diagrams, left: Bdd, right: Bdd, limit: int) -> Shorter | None:
    """The problem left U right without its forced states; None where it would take more than `limit` bytes."""
    between = left - right
    forced = between & forced_states(d)
    kept, both = between - forced, d.manager.cube([*d.rows, *d.columns])
    entries = sum(d.manager.count(relation & kept, both) for relation in d.slot_relations)
    rows = sum(d.manager.count(guard & kept, d.row_cube) for guard in d.guards or (d.states,))
    if d.count >= 2**31 - 2 or 20 * d.count + 20 * entries + 16 * rows > limit:
        return None
    odd = Odd(d.manager, kept, d.rows)
    place = _followed(d, odd, forced, right, odd.count)
    layout = None if d.guards is None else RowLayout.of([odd.expand(guard) for guard in d.guards], odd.count)
    dag = quad_dag([root.times_bdd(kept) for root in d.roots], odd, d.odd, d.columns)
    indptr, indices, data = flatten(dag, layout)
    left_over = kernel.merge(indptr, indices, data, place, odd.count + 2)
    groups = np.arange(len(indptr), dtype=np.int64) if layout is None else layout.groups
    padded = np.append(groups, [groups[-1], groups[-1]])
    return Shorter(d, odd, place, SparseMatrix(indptr, indices[:left_over], data[:left_over], odd.count + 2, padded))


def _followed(d: Diagrams, kept: Odd, forced: Bdd, right: Bdd, n: int) -> Int32s:
    """See `Shorter.place`."""
    place = np.empty(d.count, np.int32)
    if forced:
        # Rows with a single 1: where each leads. Rows are numbered as all states, so that nothing else is as long as they are many.
        moves = d.manager.sum([root.times_bdd(forced) for root in d.roots])
        Blocks(quad_dag([moves], d.odd, d.odd, d.columns), BUDGET).columns_of(0, place)
        np.invert(place, out=place)  # -1 - successor
    place[d.odd.expand(d.states - forced - kept.states - right)] = n + 1
    place[d.odd.expand(right)] = n
    place[d.odd.expand(kept.states)] = np.arange(n, dtype=np.int32)
    kernel.follow(place, n + 1)
    return place


@dataclass(frozen=True, eq=False)
class ShorterUntil:
    """The probability of left U right as equations over the states that are left and neither 0 nor 1 (see `Shorter`)."""

    parts: Shorter
    no: Bools = field(repr=False)
    yes: Bools = field(repr=False)
    direction: str | None

    @staticmethod
    def of(parts: Shorter, direction: str | None) -> ShorterUntil:
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
        """The equations."""
        m = self.parts.matrix
        chosen, entries = self.open.view(np.uint8), (m.indptr, m.indices, m.data, m.groups)
        constant = sum_among(*entries, chosen, self.yes.view(np.uint8), None)
        leave = sum_among(*entries, chosen, (~self.open).view(np.uint8), None)
        assert m.groups is not None
        groups = None if self.direction is None else groups_among(m.groups, chosen)
        own = SparseMatrix(*select_states(*entries, chosen), self.n, groups)
        return LinearProblem(constant, own, None, leave, self.direction, True)

    def lift(
        self, lower: Floats, upper: Floats | None, rest: Sequence[tuple[SymbolicSet, float]] = (), exact: bool = False
    ) -> SymbolicValues:
        """Values on all states. `rest` must be empty: what is 0 and 1 is known here."""
        if rest:
            raise ValueError("constants on sets are not asked for here")
        values = ArrayValues(*self._spread(lower, lower if upper is None else upper), self.open if exact else None)
        return _Values(self.parts, values)

    def _spread(self, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
        low = self.yes.astype(np.float64)
        high = low.copy()
        low[self.open], high[self.open] = lower, upper
        return (low, low) if lower is upper else (low, high)


class _Values(LazyValues):
    """Values by where a state leads; written out for all states only if somebody asks for that."""

    def __init__(self, parts: Shorter, values: ArrayValues) -> None:
        super().__init__(parts.diagrams, partial(_pieces, parts, values, parts.diagrams.states))
        vars(self).update(_parts_of=partial(_pieces, parts, values), _exact=values.exact)

    @cached_property
    def exact(self) -> bool:
        """Whether lower and upper are the same everywhere."""
        return bool(vars(self)["_exact"])

    def _parts(self, states: SymbolicSet) -> Iterator[tuple[Bdd, ArrayValues]]:
        for piece in vars(self)["_parts_of"](states.bdd):
            yield piece.states, piece.values


def _pieces(parts: Shorter, values: ArrayValues, states: Bdd) -> tuple[Piece, ...]:
    """The values on some states."""
    d = parts.diagrams
    odd = d.odd if states == d.states else Odd(d.manager, states, d.rows)
    if not odd.count:
        return ()
    place = parts.place if states == d.states else parts.place[odd.places(d.odd)]
    low = values.lower[place]
    high = low if values.upper is values.lower else values.upper[place]
    computed = None if values.computed is None else values.computed[place]
    if low.min() == low.max() and high.min() == high.max() and (computed is None or computed.all() or not computed.any()):
        piece = constant_piece(states, float(low[0]), float(high[0]), computed is not None and bool(computed[0]))
        return merged(d, [piece])
    return (Piece(states, ArrayValues(low, high, computed), odd),)
