"""The encoding of model variables by diagram variables ("bits").

A variable with values low..high is encoded by ceil(log2(high - low + 1)) bits that hold value -
low, most significant bit first. Each bit exists twice: a row bit for the current state (`s.2`,
where 2 is the exponent of the bit) and a column bit for the next state (`s.2'`), next to each other
in the order. With rows and columns interleaved, the relations "unchanged" and "plus one" are small.

Source: Hermanns, Kwiatkowska, Norman, Parker and Siegle (2003), On the use of MTBDDs for
performability analysis and verification of stochastic systems.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import UnsupportedError
from symcheck.semantics.expressions.vectorised import Column
from symcheck.semantics.model import BoundModel, Value, Variable
from symcheck.syntax.ast import Type

__all__ = ["EncodedVariable", "Encoding", "decode", "encode"]

MAX_BITS = 62


@dataclass(frozen=True)
class EncodedVariable:
    """A model variable and its bits, most significant first; `index` is its position in the
    declarations.
    """

    variable: Variable
    index: int
    low: int
    high: int
    rows: tuple[str, ...]
    columns: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name in the model."""
        return self.variable.name

    @property
    def width(self) -> int:
        """Number of bits; 0 for a variable with a single value."""
        return len(self.rows)

    @property
    def is_bool(self) -> bool:
        """Whether the variable is boolean."""
        return self.variable.type is Type.BOOL

    def code(self, value: Value) -> int:
        """The code of a value: the number that its bits hold. Raises ValueError for a value out of
        range.
        """
        code = int(value) - self.low
        if not 0 <= code <= self.high - self.low:
            raise ValueError(f"{self.name}={value} is not within {self.low}..{self.high}")
        return code

    def value(self, code: int) -> int | bool:
        """The value of a code."""
        return bool(code) if self.is_bool else self.low + code

    def column(self, *, padded: bool = True) -> NDArray[np.int64] | NDArray[np.bool_]:
        """The values by code. `padded`: 2**width entries, where codes above the range have the
        highest value.
        """
        codes = np.arange(1 << self.width if padded else self.high - self.low + 1, dtype=np.int64)
        return (
            codes.astype(np.bool_)
            if self.is_bool
            else self.low + np.minimum(codes, self.high - self.low)
        )

    def __repr__(self) -> str:
        return f"{self.name}: {self.low}..{self.high} as {' '.join(self.rows) or '(constant)'}"


@dataclass(frozen=True, eq=False)
class Encoding:
    """The bits of all variables.

    Nondeterminism needs no bits: an MDP has one matrix per choice class.

    Attributes:
        variables: in declaration order.
        order: indices into `variables`, from the top of the diagrams down.
    """

    variables: tuple[EncodedVariable, ...]
    order: tuple[int, ...]

    @cached_property
    def ordered(self) -> tuple[EncodedVariable, ...]:
        """The variables from the top of the diagrams down."""
        return tuple(self.variables[i] for i in self.order)

    @cached_property
    def rows(self) -> tuple[str, ...]:
        """All row bits in diagram order."""
        return tuple(bit for v in self.ordered for bit in v.rows)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """All column bits in diagram order."""
        return tuple(bit for v in self.ordered for bit in v.columns)

    @cached_property
    def bits(self) -> tuple[str, ...]:
        """Row and column bits interleaved, from the top down, as the manager declares them."""
        return tuple(bit for pair in zip(self.rows, self.columns, strict=True) for bit in pair)

    @property
    def in_declaration_order(self) -> bool:
        """Whether an ODD over the row bits numbers the states lexicographically in declaration
        order.
        """
        return self.order == tuple(range(len(self.order)))

    @cached_property
    def by_name(self) -> Mapping[str, EncodedVariable]:
        """Variables by their name in the model."""
        return {v.name: v for v in self.variables}

    @cached_property
    def rank(self) -> Mapping[str, int]:
        """Position of each variable (by name) in the order, from the top."""
        return {v.name: i for i, v in enumerate(self.ordered)}

    def sorted(self, names: Iterable[str]) -> tuple[EncodedVariable, ...]:
        """The named variables from the top of the diagrams down."""
        return tuple(self.by_name[n] for n in sorted(names, key=self.rank.__getitem__))

    def decode(self, bits: NDArray[np.uint8]) -> list[Column]:
        """The values of each variable, in declaration order: n numbers or truth values.

        Args:
            bits: uint8[n, k], row bits of n states in diagram order.
        """
        columns = decode(self.ordered, bits)
        return [columns[v.name] for v in self.variables]

    def valuations(self, bits: NDArray[np.uint8]) -> Iterator[tuple[bool | int, ...]]:
        """The values of the variables in each state, from its bits as in `decode`."""
        columns = [column.tolist() for column in self.decode(bits)]
        return zip(*columns, strict=True) if columns else iter([()] * len(bits))

    def __repr__(self) -> str:
        lines = [f"Encoding: {len(self.variables)} variables, {len(self.rows)} row bits"]
        return "\n  ".join([*lines, *map(repr, self.ordered)])


def decode(variables: Sequence[EncodedVariable], bits: NDArray[np.uint8]) -> dict[str, Column]:
    """A column of values per variable, from its bits: uint8[n, bits of the variables together]."""
    columns: dict[str, Column] = {}
    start = 0
    for v in variables:
        code = np.zeros(bits.shape[0], dtype=np.int64)
        for position in range(start, start + v.width):
            code = 2 * code + bits[:, position]
        columns[v.name] = code.astype(np.bool_) if v.is_bool else v.low + code
        start += v.width
    return columns


def encode(model: BoundModel, order: Sequence[str] | None = None) -> Encoding:
    """The encoding of a model's variables.

    Args:
        model: the model.
        order: names from the top of the diagrams down; others follow in declaration order. None:
            declaration order.

    Raises:
        UnsupportedError: an integer without bounds, or a range of more than 2**62 values.
        KeyError: an unknown name in `order`.
    """
    variables = tuple(_encode(variable, index) for index, variable in enumerate(model.variables))
    index = {v.name: v.index for v in variables}
    first = [index[name] for name in dict.fromkeys(order or ())]
    rest = [i for i in range(len(variables)) if i not in set(first)]
    return Encoding(variables, (*first, *rest))


def _encode(variable: Variable, index: int) -> EncodedVariable:
    low, high = (0, 1) if variable.type is Type.BOOL else (variable.low, variable.high)
    if low is None or high is None:
        raise UnsupportedError(
            f"variable {variable.name} has no bounds ({variable.span}), and diagrams need bounds: "
            "give it a range, or use the explicit engine (-ex), which only needs that finitely "
            "many "
            "values are reachable"
        )
    width = max(high - low, 0).bit_length()
    if width > MAX_BITS:
        raise UnsupportedError(
            f"variable {variable.name} needs {width} bits, and diagrams take {MAX_BITS}: "
            "use the explicit engine (-ex)"
        )
    rows = tuple(f"{variable.name}.{e}" for e in range(width - 1, -1, -1))
    return EncodedVariable(variable, index, low, high, rows, tuple(f"{row}'" for row in rows))
