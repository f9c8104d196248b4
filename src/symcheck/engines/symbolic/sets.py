"""Sets of states as BDDs, and values as pieces: constants on sets, or arrays.

The values of a model with 66 million states are seldom 66 million numbers: most are 0 or 1 by the
precomputation of prob0 and prob1. Only the remaining states need an array, numbered by an ODD of
their own. `ArrayValues` does the arithmetic of each piece, so that all engines agree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, partial
from typing import Protocol

import numpy as np

from symcheck.dd.manager import Bdd, Mtbdd
from symcheck.dd.odd import Odd
from symcheck.engines import tuning
from symcheck.engines.base import EngineOf, Number
from symcheck.engines.explicit.array_values import ArraySet, ArrayValues, total_of
from symcheck.engines.explicit.base import Numeric
from symcheck.engines.explicit.rational_values import RationalValues, in_doubles
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.matrices.rows import Bools, Floats
from symcheck.syntax.operators import Operation, Operator

__all__ = [
    "LazyValues",
    "Piece",
    "RestrictableValues",
    "SymbolicOwner",
    "SymbolicSet",
    "SymbolicValues",
    "array_piece",
    "constant_piece",
    "constants_on",
    "function_pieces",
    "merged",
    "values_of",
]


TINY = 1e-300
"""Absolute margin of upper bounds, for values so small that a relative margin underflows."""


@dataclass(frozen=True, eq=False)
class SymbolicSet:
    """A set of reachable states as a BDD over row bits."""

    diagrams: Diagrams = field(repr=False)
    bdd: Bdd = field(repr=False)

    @cached_property
    def count(self) -> int:
        """Number of states in the set."""
        return self.diagrams.manager.count(self.bdd, self.diagrams.row_cube)

    @cached_property
    def odd(self) -> Odd:
        """Numbers of the states."""
        return (
            self.diagrams.odd
            if self.bdd == self.diagrams.states
            else Odd(self.diagrams.manager, self.bdd, self.diagrams.rows)
        )

    def _with(self, bdd: Bdd) -> SymbolicSet:
        return SymbolicSet(self.diagrams, bdd)

    def __and__(self, other: SymbolicSet, /) -> SymbolicSet:
        return self._with(self.bdd & other.bdd)

    def __or__(self, other: SymbolicSet, /) -> SymbolicSet:
        return self._with(self.bdd | other.bdd)

    def __sub__(self, other: SymbolicSet, /) -> SymbolicSet:
        return self._with(self.bdd - other.bdd)

    def __invert__(self) -> SymbolicSet:
        return self._with(self.diagrams.states - self.bdd)

    def __bool__(self) -> bool:
        return bool(self.bdd)

    def __eq__(self, other: object, /) -> bool:
        return isinstance(other, SymbolicSet) and self.bdd == other.bdd

    def __hash__(self) -> int:
        return hash(self.bdd)

    def __le__(self, other: SymbolicSet, /) -> bool:
        return self.bdd <= other.bdd

    def __repr__(self) -> str:
        count, nodes = self.diagrams.count, self.bdd.node_count
        return f"<SymbolicSet of {self.count:,} of {count:,} states, {nodes} nodes>"


@dataclass(frozen=True, eq=False)
class Piece:
    """Values on a set that is not empty: one for all its states (arrays of length 1, `odd` None) or
    one for each.
    """

    states: Bdd = field(repr=False)
    values: Numeric
    odd: Odd | None

    @property
    def constant(self) -> bool:
        """Whether all states have the same value."""
        return self.odd is None

    def over(self, states: Bdd, odd: Odd) -> Numeric:
        """The values on a subset, one for each state."""
        v, n = self.values, odd.count
        if self.odd is None:
            if isinstance(v, RationalValues):
                return RationalValues(np.broadcast_to(v.array, (n,)))
            low = np.broadcast_to(v.lower, (n,))
            high = low if v.upper is v.lower else np.broadcast_to(v.upper, (n,))
            return ArrayValues(
                low,
                high,
                None if v.computed is None else np.broadcast_to(v.computed, (n,)),
            )
        if states == self.states:
            return v
        return v.gather(odd.indices_in(self.odd))


def constant_piece(
    states: Bdd, lower: Number, upper: Number | None = None, computed: bool = False
) -> Piece:
    """One value (or bounds of it) on a set."""
    low = np.array([float(lower)])
    high = low if upper is None or upper == lower else np.array([float(upper)])
    return Piece(states, ArrayValues(low, high, np.ones(1, bool) if computed else None), None)


def constants_on(states: Bdd, parts: Sequence[tuple[SymbolicSet, float]]) -> Iterator[Piece]:
    """Pieces that cover `states`: the value of the last part that a state is in, 0 elsewhere."""
    for part, value in reversed(parts):
        if part.bdd & states:
            yield constant_piece(part.bdd & states, value)
            states = states - part.bdd
    if states:
        yield constant_piece(states, 0.0)


def _everywhere(values: Numeric) -> ArraySet:
    return ArraySet(np.ones(len(values.lower), bool))


def _joined(parts: Sequence[Numeric]) -> Numeric:
    """The values of all parts, without error if those of each part are."""
    if all(isinstance(v, RationalValues) for v in parts):
        return RationalValues(np.concatenate([v.lower for v in parts]))
    doubles = [in_doubles(v) for v in parts]
    return ArrayValues(
        np.concatenate([v.lower for v in doubles]), np.concatenate([v.upper for v in doubles])
    )


@dataclass(frozen=True, eq=False)
class SymbolicValues:
    """A number per reachable state (see `symcheck.engines.base.Values`). The pieces are disjoint
    and cover all states.
    """

    diagrams: Diagrams = field(repr=False)
    pieces: tuple[Piece, ...] = field(repr=False)

    def __repr__(self) -> str:
        numbers = sum(len(p.values.lower) for p in self.pieces)
        kind = "exact" if self.is_point else "certified"
        return f"<SymbolicValues: {len(self.pieces)} pieces with {numbers:,} numbers, {kind}>"

    @cached_property
    def is_point(self) -> bool:
        """Whether lower and upper are the same everywhere."""
        return all(p.values.is_point for p in self.pieces)

    def rounded(self, states: SymbolicSet) -> bool:
        """Whether some value over the set was rounded, and all bounds differ by that alone."""
        parts = self._values(states)
        rounded = [v.rounded(_everywhere(v)) for v in parts]
        return any(rounded) and all(r or v.is_point for r, v in zip(rounded, parts, strict=True))

    def _parts(self, states: SymbolicSet) -> Iterator[tuple[Bdd, Numeric]]:
        """The values on a set: for each piece that meets it, the common states and their values
        (one if constant).
        """
        for piece in self.pieces:
            common = piece.states & states.bdd
            if not common:
                continue
            if piece.odd is None or common == piece.states:
                yield common, piece.values
            else:
                yield (
                    common,
                    piece.over(common, Odd(self.diagrams.manager, common, self.diagrams.rows)),
                )

    def at(self, states: SymbolicSet) -> tuple[Floats, Floats]:
        """Lower and upper values over the set, in index order."""
        known = all(isinstance(p.values, RationalValues) for p in self.pieces)
        kind = object if known else np.float64
        low, high = np.empty(states.odd.count, kind), np.empty(states.odd.count, kind)
        for common, values in self._parts(states):
            where = slice(None) if common == states.bdd else states.odd.to_mask(common)
            if not known:
                values = in_doubles(values)
            low[where] = values.lower
            high[where] = values.upper
        return low, low if self.is_point else high

    def minimum(self, states: SymbolicSet) -> tuple[Number, Number]:
        """Bounds of the least value over the set."""
        whole = _joined(self._values(states))
        return whole.minimum(_everywhere(whole))

    def maximum(self, states: SymbolicSet) -> tuple[Number, Number]:
        """Bounds of the largest value over the set."""
        whole = _joined(self._values(states))
        return whole.maximum(_everywhere(whole))

    def _values(self, states: SymbolicSet) -> list[Numeric]:
        return [values for _, values in self._parts(states)]

    def total(self, states: SymbolicSet) -> tuple[Number, Number]:
        """Bounds of the sum over the set."""
        count = self.diagrams.manager.count
        parts = [
            (v, count(s, self.diagrams.row_cube) if len(v.lower) == 1 else 1)
            for s, v in self._parts(states)
        ]
        known = _joined([v.map(Operator.TIMES, Fraction(n)) for v, n in parts])
        if isinstance(known, RationalValues):
            return known.total(_everywhere(known))
        return total_of([(in_doubles(v), n) for v, n in parts])

    def compare(
        self, operator: str, threshold: float | Fraction
    ) -> tuple[SymbolicSet, SymbolicSet]:
        """The states that surely satisfy the comparison, and those where it is undecided."""
        sure, open_ = [], []
        for piece in self.pieces:
            yes, undecided = piece.values.compare(operator, threshold)
            sure.append(self._states(piece, yes))
            open_.append(self._states(piece, undecided))
        return SymbolicSet(self.diagrams, self.diagrams.union(sure)), SymbolicSet(
            self.diagrams, self.diagrams.union(open_)
        )

    def _states(self, piece: Piece, members: ArraySet) -> Bdd:
        if piece.odd is not None:
            return piece.odd.from_mask(members.members)
        return piece.states if members else self.diagrams.manager.false

    def map(self, operation: Operation, *others: SymbolicValues | float) -> SymbolicValues:
        """Interval arithmetic with an operator or function of the expression language."""
        numbers = [o for o in others if not isinstance(o, SymbolicValues)]
        operands = [self, *(o for o in others if isinstance(o, SymbolicValues))]
        pieces = []
        for states, parts in self._common(operands):
            if all(p.constant for p in parts):
                odd, arrays = None, [p.values for p in parts]
            else:
                odd = next((p.odd for p in parts if p.odd is not None and p.states == states), None)
                odd = odd or Odd(self.diagrams.manager, states, self.diagrams.rows)
                arrays = [p.over(states, odd) for p in parts]
            rest = iter(arrays[1:])
            known = iter(numbers)
            arguments = [
                next(rest) if isinstance(o, SymbolicValues) else next(known) for o in others
            ]
            pieces.append(Piece(states, arrays[0].map(operation, *arguments), odd))
        return SymbolicValues(self.diagrams, merged(self.diagrams, pieces))

    def _common(self, operands: list[SymbolicValues]) -> list[tuple[Bdd, list[Piece]]]:
        """The coarsest common refinement: sets with one piece of each operand."""
        cells: list[tuple[Bdd, list[Piece]]] = [(p.states, [p]) for p in operands[0].pieces]
        for operand in operands[1:]:
            finer = []
            for states, parts in cells:
                rest = states
                for piece in operand.pieces:
                    common = rest & piece.states
                    if common:
                        finer.append((common, [*parts, piece]))
                        rest = rest - common
                    if not rest:
                        break
            cells = finer
        return cells

    def choose(self, states: SymbolicSet, other: SymbolicValues) -> SymbolicValues:
        """These values on the set, the other ones elsewhere."""
        inside = [self._piece(common, v) for common, v in self._parts(states)]
        outside = [self._piece(common, v) for common, v in other._parts(~states)]
        return SymbolicValues(self.diagrams, merged(self.diagrams, [*inside, *outside]))

    def _piece(self, states: Bdd, values: Numeric) -> Piece:
        odd = Odd(self.diagrams.manager, states, self.diagrams.rows)
        return Piece(states, values, odd if len(values.lower) == odd.count else None)


class SymbolicOwner(EngineOf[SymbolicSet, SymbolicValues], Protocol):
    """An engine on diagrams, as its parts see it."""

    @property
    def diagrams(self) -> Diagrams:
        """States and matrices."""
        ...

    @property
    def rows_limit(self) -> int | None:
        """Entries up to which the rows of a system are written out to solve equations on them;
        None: always.
        """
        ...


class LazyValues(SymbolicValues):
    """Values whose pieces are made on first use: often one state only is needed."""

    _make: Callable[[], tuple[Piece, ...]]

    def __init__(self, diagrams: Diagrams, make: Callable[[], tuple[Piece, ...]]) -> None:
        object.__setattr__(self, "diagrams", diagrams)
        object.__setattr__(self, "_make", make)

    @cached_property
    def pieces(self) -> tuple[Piece, ...]:
        """All values."""
        return self._make()


class RestrictableValues(LazyValues):
    """Values that can be computed on any set of states: the initial state needs no others.

    make: gives the values on a set that is not empty. is_point: whether lower and upper are equal.
    """

    _make_on: Callable[[Bdd], tuple[Piece, ...]]
    _is_point: bool

    def __init__(
        self, diagrams: Diagrams, make: Callable[[Bdd], tuple[Piece, ...]], is_point: bool
    ) -> None:
        super().__init__(diagrams, partial(make, diagrams.states))
        object.__setattr__(self, "_make_on", make)
        object.__setattr__(self, "_is_point", is_point)

    @property
    def is_point(self) -> bool:
        """Whether lower and upper are the same everywhere."""
        return self._is_point

    def _parts(self, states: SymbolicSet) -> Iterator[tuple[Bdd, Numeric]]:
        for piece in self._make_on(states.bdd):
            yield piece.states, piece.values


def merged(diagrams: Diagrams, pieces: Iterable[Piece]) -> tuple[Piece, ...]:
    """The pieces with constants of the same value joined."""
    result: list[Piece] = []
    groups: dict[tuple[object, ...], list[Piece]] = {}
    for piece in pieces:
        v = piece.values
        if piece.odd is not None:
            result.append(piece)
        elif isinstance(v, RationalValues):
            groups.setdefault((v.array[0],), []).append(piece)
        else:
            computed = v.computed is not None and bool(v.computed[0])
            key = v.lower.tobytes(), v.upper.tobytes(), computed
            groups.setdefault(key, []).append(piece)
    joined = (
        g[0] if len(g) == 1 else Piece(diagrams.union([p.states for p in g]), g[0].values, None)
        for g in groups.values()
    )
    return (*result, *joined)


def array_piece(
    states: Bdd, odd: Odd, lower: Floats, upper: Floats | None, computed: bool
) -> Piece:
    """A value for each state of a set."""
    mask: Bools | None = np.ones(len(lower), bool) if computed else None
    return Piece(states, ArrayValues(lower, lower if upper is None else upper, mask), odd)


def values_of(diagrams: Diagrams, function: Mtbdd, undefined: Bdd | None = None) -> SymbolicValues:
    """A function of the row bits on the reachable states, taken as exact; NaN on `undefined`."""
    states, pieces = diagrams.states, []
    if undefined is not None and undefined & states:
        pieces.append(constant_piece(undefined & states, float("nan")))
        states = states - undefined
    pieces.extend(function_pieces(diagrams, function, states))
    return SymbolicValues(diagrams, tuple(pieces))


def function_pieces(
    d: Diagrams, function: Mtbdd, states: Bdd, error: float = 0.0
) -> Iterator[Piece]:
    """A function of the row bits on some states, with a relative error.

    These are constants if there are few values (or too many states), else an array.
    """
    leaves = function.leaves
    many = len(leaves) > tuning.FEW_LEAVES
    if many and states and d.manager.count(states, d.row_cube) <= tuning.MANY_STATES:
        odd = Odd(d.manager, states, d.rows)
        values = odd.to_vector(function)
        yield array_piece(states, odd, *_enclosed(values, error), False)
        return
    for leaf in leaves:
        here = function.equal(float(leaf)) & states
        if here:
            low, high = _enclosed(leaf, error)
            yield constant_piece(here, float(low), None if high is None else float(high))


def _enclosed(values: Floats, error: float) -> tuple[Floats, Floats | None]:
    """Lower and upper bounds of values with a relative error; None without an error."""
    if error == 0.0:
        return values, None
    return values * (1.0 - error), np.where(values > 0.0, values * (1.0 + error) + TINY, 0.0)
