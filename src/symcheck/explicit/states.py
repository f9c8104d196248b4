"""States as packed rows of 64-bit words, and tables of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import Int32s, Int64s
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Type

__all__ = ["UNBOUNDED_BITS", "Rows", "StateLayout", "StateTable"]

Rows = NDArray[np.uint64]
UNBOUNDED_BITS = 32


@dataclass(frozen=True, eq=False)
class StateLayout:
    """The position of each variable in a packed state.

    Rows that are compared word by word are in lexicographic order of the variables. A value is
    stored as value - low; a variable without bounds gets 32 bits, from -2**31 on.

    Attributes:
        words: 64-bit words per state.
        fields: int32[variables, 4]: index of the variable, word, shift and number of bits.
        lows: int64[variables], lower bounds.
        ranges: uint64[variables], high - low.
    """

    variables: tuple[Variable, ...]
    words: int
    fields: NDArray[np.int32] = field(repr=False)
    lows: Int64s = field(repr=False)
    ranges: NDArray[np.uint64] = field(repr=False)

    @staticmethod
    def of(variables: tuple[Variable, ...]) -> StateLayout:
        """The layout of these variables. Raises OverflowError for 2**63 values or more of one."""
        bounds = [_bounds(v) for v in variables]
        fields: list[tuple[int, int, int, int]] = []
        word, left = 0, 64
        for i, (low, high) in enumerate(bounds):
            bits = (high - low).bit_length()
            if bits > 63:
                raise OverflowError(f"the range of {variables[i].name} has more than 2**63 values")
            if bits > left:
                word, left = word + 1, 64
            left -= bits
            fields.append((i, word, min(left, 63), bits))
        return StateLayout(
            variables,
            word + 1,
            np.array(fields, np.int32).reshape(-1, 4),
            np.array([low for low, _ in bounds], np.int64),
            np.array([high - low for low, high in bounds], np.uint64),
        )

    @property
    def bits(self) -> int:
        """Number of bits of a state."""
        return int(self.fields[:, 3].sum())

    def pack(self, columns: Sequence[Int64s]) -> Rows:
        """Packed states (uint64[n, words]) from values in range, an int64[n] per variable."""
        n = len(columns[0]) if columns else 1
        rows = np.zeros((n, self.words), np.uint64)
        for (i, word, shift, _), low in zip(self.fields.tolist(), self.lows, strict=True):
            rows[:, word] |= (np.asarray(columns[i], np.int64) - low).astype(
                np.uint64
            ) << np.uint64(shift)
        return rows

    def column(self, rows: Rows, variable: int) -> Int64s:
        """The values of a variable in packed states: int64[n]."""
        _, word, shift, bits = self.fields[variable].tolist()
        values: Int64s = ((rows[:, word] >> np.uint64(shift)) & np.uint64((1 << bits) - 1)).astype(
            np.int64
        )
        values += self.lows[variable]
        return values

    def valuations(self, rows: Rows) -> Iterator[tuple[bool | int, ...]]:
        """The values of the variables in each of some packed states."""
        columns = [
            _plain(self.column(rows, i), variable.type) for i, variable in enumerate(self.variables)
        ]
        return zip(*columns, strict=True) if columns else iter([()] * len(rows))

    def unpack(self, row: NDArray[np.uint64]) -> tuple[bool | int, ...]:
        """The values of the variables in one packed state."""
        return next(self.valuations(row[None]))


def _bounds(variable: Variable) -> tuple[int, int]:
    half = 1 << (UNBOUNDED_BITS - 1)
    low, high = variable.low, variable.high
    if low is None and high is None:
        return -half, half - 1
    if low is None or high is None:
        raise ValueError(f"{variable.name} has one bound only")
    return low, high


def _plain(column: Int64s, type: Type) -> list[bool | int]:
    values: list[bool | int] = (column.astype(bool) if type is Type.BOOL else column).tolist()
    return values


@dataclass(frozen=True, eq=False)
class StateTable:
    """Packed states, by default sorted lexicographically by the variables in declaration order."""

    layout: StateLayout
    rows: Rows = field(repr=False)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[tuple[bool | int, ...]]:
        return self.layout.valuations(self.rows)

    def __repr__(self) -> str:
        names = ", ".join(v.name for v in self.layout.variables)
        return f"StateTable({len(self)} states of ({names}), {self.layout.bits} bits each)"

    def column(self, variable: int) -> Int64s:
        """Values of a variable (by index): int64[n]; of a bool, 0 and 1."""
        return self.layout.column(self.rows, variable)

    def take(self, indices: Int64s | Int32s) -> StateTable:
        """Some of the states, in the order of `indices`."""
        return StateTable(self.layout, self.rows[indices])

    def valuations(self, indices: Int64s) -> Iterator[tuple[bool | int, ...]]:
        """The values of the variables in some states."""
        return self.layout.valuations(self.rows[indices])

    def row(self, index: int) -> tuple[bool | int, ...]:
        """The values of state `index`, in declaration order."""
        return self.layout.unpack(self.rows[index])
