"""Strong bisimulation on diagrams: a partition of 10¹² states is a diagram whose leaves are the
blocks.

Partition refinement by signatures (Wimmer, Derisavi & Hermanns, Symbolic partition refinement with
automatic balancing of time and space, 2010). There block numbers are bits below the states' bits;
here they are leaves, and the signature of a state is a leaf too: a sparse vector from blocks to
sums of entries, kept once. Sums are exact, so that the many orders in which diagrams add give one
vector; they are compared when rounded to 44 binary digits, as in `symcheck.numerics.bisimulation`,
and the quotient has them rounded to doubles only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import frexp
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.export import NodeTable
from symcheck.dd.odd import levels_of
from symcheck.engines import tuning
from symcheck.engines.explicit.array_values import ArrayValues
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import (
    LazyValues,
    Piece,
    SymbolicSet,
    SymbolicValues,
)
from symcheck.errors import UnsupportedError
from symcheck.kernels.partition.refinement import Partition, largest_row_sum
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

__all__ = ["LumpedDiagrams", "Round", "lump_diagrams"]


@dataclass(frozen=True, slots=True)
class Round:
    """A round of refinement: blocks after it, nodes and signatures that are kept, seconds since the
    first.
    """

    number: int
    blocks: int
    nodes: int
    seconds: float


@dataclass(frozen=True, eq=False)
class LumpedDiagrams:
    """The coarsest bisimulation of a model on diagrams.

    members: uint8[blocks, bits], the first state of each block (by row bits), in ascending order;
    so blocks are numbered. matrix: the quotient; equal choices of an MDP are one row. rewards: per
    structure (those asked for), a transition reward per row. rounds: of refinement, the last of
    which split nothing. nodes: kept at the end.
    """

    diagrams: Diagrams = field(repr=False)
    members: NDArray[np.uint8] = field(repr=False)
    matrix: SparseMatrix
    rewards: Mapping[int, Floats] = field(repr=False)
    rounds: int
    nodes: int
    seconds: float
    _partition: Partition = field(repr=False)
    _order: Int64s = field(repr=False)

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.members)

    @cached_property
    def _table(self) -> tuple[Int32s, Int32s, Int32s, int]:
        return self._partition.diagram()

    def function(self, values: Floats) -> Mtbdd:
        """The function of the row bits that has a value (float64[blocks]) per block, and 0 where no
        state is.
        """
        manager, (position, low, high, root) = self.diagrams.manager, self._table
        bottom = manager.size
        level = np.append(levels_of(manager, self.diagrams.rows), bottom).astype(np.int32)[position]
        leaves = np.zeros(self.blocks + 1)
        leaves[self._order] = values
        return manager.import_mtbdd(
            NodeTable(bottom, level, low, high, leaves, np.array([root], np.int32))
        )[0]

    def lift(self, values: ArrayValues) -> SymbolicValues:
        """Values of blocks as values of states, made on first use.

        That use raises UnsupportedError if there are too many states and different values.
        """
        return LazyValues(self.diagrams, partial(self._pieces, values))

    def _pieces(self, values: ArrayValues) -> tuple[Piece, ...]:
        """Constants on sets of states, or an array over all states."""
        d = self.diagrams
        columns = [values.lower, values.upper]
        if values.computed is not None:
            columns.append(values.computed.astype(np.float64))
        _, first, kind = np.unique(
            np.column_stack(columns), axis=0, return_index=True, return_inverse=True
        )
        if len(first) > tuning.FEW_LEAVES and d.count <= tuning.MANY_STATES:
            return (Piece(d.states, values.gather(self.block_of_states()), d.odd),)
        if len(first) > tuning.CONSTANT_PIECES:
            raise UnsupportedError(
                f"{len(first):,} different values on {d.count:,} states are too many "
                "to be told state by state"
            )
        function = self.function((kind.reshape(-1) + 1).astype(np.float64))
        return tuple(
            Piece(function.equal(i + 1.0), values.gather(first[i : i + 1]), None)
            for i in range(len(first))
        )

    def lift_set(self, blocks: Bools) -> SymbolicSet:
        """A set of blocks (bool[blocks]) as a set of states."""
        return SymbolicSet(self.diagrams, self.function(blocks.astype(np.float64)).to_bdd())

    def block_of_states(self) -> Int64s:
        """The block of each state in the order of the states: int64[states]."""
        numbers = self.diagrams.odd.to_vector(self.function(np.arange(1.0, self.blocks + 1.0)))
        return numbers.astype(np.int64) - 1

    def at_members(self, function: Mtbdd) -> Floats:
        """The value of a function of the row bits at the first state of each block."""
        manager = self.diagrams.manager
        bits = np.zeros((self.blocks, manager.size), np.uint8)
        bits[:, [manager.index_of(name) for name in self.diagrams.rows]] = self.members
        return np.asarray(function.evaluate(bits), np.float64)

    def meeting(self, states: Bdd) -> Int64s:
        """The blocks with a state in a set, ascending."""
        blocks = self._partition.blocks_meeting(
            *_rows_only(self.diagrams, states.to_mtbdd(), np.array([0.0, 1.0]))
        )
        number = np.zeros(self.blocks + 1, np.int64)
        number[self._order] = np.arange(self.blocks)
        return np.sort(number[blocks])


def lump_diagrams(
    diagrams: Diagrams,
    colours: Iterable[Bdd | Mtbdd],
    structures: Sequence[int] = (),
    observer: Callable[[Round], None] | None = None,
    limit: int = tuning.LUMPING_MEMORY,
    most: int | None = None,
    budget: int | None = None,
) -> LumpedDiagrams:
    """The coarsest bisimulation that separates states with different colours or rewards.

    Args:
        diagrams: the model.
        colours: sets, or functions of the row bits, whose values are kept apart.
        structures: reward structures that are kept apart, by number.
        observer: receives each round of refinement.
        limit: bytes that the partition may take.
        most: greatest number of blocks; None for any number.
        budget: operations on nodes; None for any number.

    Raises:
        UnsupportedError: a limit was reached. Few states are then equivalent, and refinement on
            enumerated states is cheaper.
    """
    from symcheck.dd.manager import Bdd

    started = perf_counter()
    partition = _matrices(diagrams, limit)
    if budget is not None:
        partition.budget = budget
    try:
        partition.start(*_rows_only(diagrams, diagrams.states.to_mtbdd(), np.array([0.0, 1.0])))
        for colour in [*colours, *(diagrams.state_rewards[i] for i in structures)]:
            partition.separate(
                *_rows_only(diagrams, colour.to_mtbdd() if isinstance(colour, Bdd) else colour)
            )
        for i in structures:
            for choice, reward in enumerate(diagrams.transition_rewards[i]):
                level, low, high, values, root = _row_table(diagrams, reward)
                partition.separate_rows(choice, i, level, low, high, values, root)
        going = partition.blocks > 0
        while going:
            going = partition.step()
            if observer is not None:
                observer(
                    Round(
                        partition.rounds, partition.blocks, partition.size, perf_counter() - started
                    )
                )
            if most is not None and partition.blocks > most:
                raise UnsupportedError(f"few states are alike: there are more than {most:,} blocks")
        return _finished(diagrams, partition, structures, started)
    except (MemoryError, OverflowError) as error:
        progress = f"{partition.blocks:,} blocks after {partition.rounds} rounds"
        memory = isinstance(error, MemoryError)
        bound = f"{limit / 2**20:,.0f} MiB" if memory else f"{budget:,} operations"
        raise UnsupportedError(
            f"the partition by bisimulation outgrows {bound} ({progress}): few states are alike"
        ) from None


def _finished(
    diagrams: Diagrams, partition: Partition, structures: Sequence[int], started: float
) -> LumpedDiagrams:
    order, members = partition.first_members()
    groups, indptr, keys, values = partition.rows(order)
    number = np.zeros(partition.blocks + 1, np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    row_of = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
    entries = keys > 0
    rewards = {}
    for i in structures:
        rewards[i] = np.zeros(len(indptr) - 1)
        here = keys == -1 - i
        rewards[i][row_of[here]] = values[here]
    rows, columns, data = row_of[entries], number[keys[entries]], values[entries]
    sort = np.lexsort((columns, rows))
    starts = starts_of(np.bincount(rows, minlength=len(indptr) - 1))
    matrix = SparseMatrix(
        starts, columns[sort], data[sort], len(order), None if diagrams.guards is None else groups
    )
    seconds = perf_counter() - started
    return LumpedDiagrams(
        diagrams,
        members,
        matrix,
        rewards,
        partition.rounds,
        partition.size,
        seconds,
        partition,
        order,
    )


def _matrices(diagrams: Diagrams, limit: int) -> Partition:
    manager, bits = diagrams.manager, len(diagrams.rows)
    pairs = [bit for pair in zip(diagrams.rows, diagrams.columns, strict=True) for bit in pair]
    table = manager.export_mtbdd(diagrams.roots)
    position = np.full(table.levels + 1, 2 * bits, np.int32)
    position[levels_of(manager, pairs)] = np.arange(2 * bits)
    exponent = _lowest_digit(table.values)
    shape = (
        position[table.level],
        table.low,
        table.high,
        np.ascontiguousarray(table.values),
        table.roots,
    )
    if frexp(largest_row_sum(*shape))[1] + exponent > 125:
        raise UnsupportedError(
            "probabilities or rates are of too many orders of magnitude "
            "to be added exactly on diagrams"
        )
    return Partition(bits, *shape, diagrams.guards is not None, exponent, limit)


def _lowest_digit(values: Floats) -> int:
    """The least k such that all values are multiples of 2 ** -k."""
    parts, exponents = np.frexp(values[values != 0.0])
    mantissas = np.ldexp(parts, 53).astype(np.int64)
    zeros = np.frexp((mantissas & -mantissas).astype(np.float64))[1] - 1
    return int((53 - exponents - zeros).max(initial=0))


def _shortened(values: Floats) -> Floats:
    """Values rounded to 44 binary digits."""
    parts, exponents = np.frexp(values)
    rounded: Floats = np.ldexp(np.floor(np.ldexp(parts, 44) + 0.5), exponents - 44)
    return rounded


def _row_table(diagrams: Diagrams, function: Mtbdd) -> tuple[Int32s, Int32s, Int32s, Floats, int]:
    """A function of the row bits as arrays; the levels are positions of row bits."""
    table = diagrams.manager.export_mtbdd(function)
    bits = len(diagrams.rows)
    position = np.full(table.levels + 1, bits, np.int32)
    position[levels_of(diagrams.manager, diagrams.rows)] = np.arange(bits)
    return position[table.level], table.low, table.high, table.values, table.root


def _rows_only(
    diagrams: Diagrams, function: Mtbdd, known: Floats | None = None
) -> tuple[Int32s, Int32s, Int32s, Int32s, int]:
    """The same, with leaves as numbers.

    They are indices in `known`, or numbers that separate leaves up to rounding.
    """
    level, low, high, values, root = _row_table(diagrams, function)
    numbers = (
        np.unique(_shortened(values), return_inverse=True)[1]
        if known is None
        else np.searchsorted(known, values)
    )
    return level, low, high, numbers.astype(np.int32), root
