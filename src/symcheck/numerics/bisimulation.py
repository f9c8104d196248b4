"""Strong bisimulation (lumping) on sparse matrices: the coarsest partition and its quotient.

Partition refinement by signatures: blocks are split by the rows of their states until nothing
changes. After the first round only states with a successor whose block has changed are considered.
Signatures are 128-bit hashes of sums rounded to 44 binary digits, so that the order of summation
does not separate states; states whose sums differ by less than about 6e-14 may be merged.

Sources: Kanellakis & Smolka (1990); Derisavi, Hermanns & Sanders (2003); Blom & van de Pol (2009).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symcheck.kernels.partition.row_signatures import row_signatures
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics.graph import Incidence

__all__ = ["Lumping", "distinct_rows", "lump"]


@dataclass(frozen=True, eq=False)
class Lumping:
    """A partition and its quotient.

    block: the block of each state, int32[n], numbered in the order of first members.
    first: the first member of each block, int64[blocks].
    matrix: the quotient, with the rows of the first members (`rows`, int64), summed by block.
    rounds: the number of refinement rounds.
    """

    block: Int32s
    first: Int64s
    matrix: SparseMatrix
    rows: Int64s
    rounds: int


def lump(
    matrix: SparseMatrix, colours: Sequence[NDArray[np.generic]], row_colours: Sequence[Floats] = ()
) -> Lumping:
    """The coarsest bisimulation that separates states of different colours.

    Args:
        matrix: the model.
        colours: arrays with a value per state.
        row_colours: arrays with a value per row (rewards), which are part of the signatures.
    """
    edges = Incidence(matrix)
    n = matrix.states
    block = _numbered([np.ascontiguousarray(c) for c in colours], n)
    seeds = _seeds(row_colours, matrix.rows)
    hashes = np.zeros((n, 2), dtype=np.uint64)
    known = np.zeros((int(block.max(initial=-1)) + 1, 2), dtype=np.uint64)
    dirty = np.arange(n, dtype=np.int64)
    rounds = 0
    while len(dirty):
        rounds += 1
        fresh = np.empty((len(dirty), 2), dtype=np.uint64)
        row_signatures(
            *matrix.arrays,
            edges.groups,
            seeds,
            block,
            len(known),
            dirty,
            fresh,
        )
        hashes[dirty] = fresh
        block, known, changed = _split(block, known, hashes, dirty)
        dirty = _predecessors(edges, changed)
    return _quotient(matrix, edges, block, rounds)


def distinct_rows(matrix: SparseMatrix, row_colours: Sequence[Floats] = ()) -> Int64s:
    """The numbers of the rows without those that repeat a row of the same state, ascending.

    Args:
        matrix: the model.
        row_colours: arrays with a value per row, which tell rows apart too.
    """
    hashes = np.empty((matrix.rows, 2), dtype=np.uint64)
    each, rows = (np.arange(n, dtype=np.int64) for n in (matrix.rows + 1, matrix.rows))
    states = np.arange(matrix.columns, dtype=np.int32)
    seeds = _seeds(row_colours, matrix.rows)
    row_signatures(*matrix.arrays, each, seeds, states, matrix.columns, rows, hashes)
    keys = np.column_stack((matrix.state_of_row.astype(np.uint64), hashes))
    _, first = np.unique(keys, axis=0, return_index=True)
    return np.sort(first).astype(np.int64)


def _numbered(columns: Sequence[NDArray[np.generic]], n: int) -> Int32s:
    """The number of each row of a table, equal for equal rows."""
    block = np.zeros(n, dtype=np.int64)
    for column in columns:
        _, codes = np.unique(column, return_inverse=True)
        _, block = np.unique(
            block * (int(codes.max(initial=0)) + 1) + codes.reshape(-1), return_inverse=True
        )
    return block.reshape(-1).astype(np.int32)


def _seeds(columns: Sequence[Floats], rows: int) -> NDArray[np.uint64]:
    seeds = np.zeros(rows, dtype=np.uint64)
    for column in columns:
        bits = np.ascontiguousarray(column + 0.0).view(np.uint64)
        seeds = (seeds * np.uint64(0x9E3779B97F4A7C15)) ^ (
            bits + (seeds << np.uint64(6)) + (seeds >> np.uint64(2))
        )
    return seeds


def _split(
    block: Int32s, known: NDArray[np.uint64], hashes: NDArray[np.uint64], dirty: Int64s
) -> tuple[Int32s, NDArray[np.uint64], Int64s]:
    """Split blocks by the new hashes of dirty states.

    States that are not dirty have the hash of their block. A part of the dirty states of a block
    keeps its number if it has the same hash, or, if all states of the block are dirty, if it is the
    largest part. Other parts get new numbers.

    Returns:
        The partition, the hash of each block, and the states whose block changed.
    """
    of = block[dirty]
    order = np.lexsort((hashes[dirty, 1], hashes[dirty, 0], of))
    sorted_states, sorted_blocks = dirty[order], of[order]
    keys = hashes[sorted_states]
    begins = np.ones(len(order), dtype=np.bool_)
    begins[1:] = (sorted_blocks[1:] != sorted_blocks[:-1]) | (keys[1:] != keys[:-1]).any(axis=1)
    start = np.flatnonzero(begins)
    sizes = np.diff(np.append(start, len(order)))
    owner = sorted_blocks[start]
    all_dirty = np.bincount(of, minlength=len(known)) == np.bincount(block, minlength=len(known))
    stays = (keys[start] == known[owner]).all(axis=1) & ~all_dirty[owner]
    # The largest part of a block that is dirty as a whole keeps the number.
    by_size = np.lexsort((-sizes, owner))
    leading = np.ones(len(start), dtype=np.bool_)
    leading[1:] = owner[by_size][1:] != owner[by_size][:-1]
    largest = by_size[leading]
    kept = largest[all_dirty[owner[largest]]]
    stays[kept] = True
    known = known.copy()
    known[owner[kept]] = keys[start[kept]]
    new = np.flatnonzero(~stays)
    number = owner.astype(np.int32)
    number[new] = np.arange(len(known), len(known) + len(new), dtype=np.int32)
    part = np.cumsum(begins) - 1
    block = block.copy()
    block[sorted_states] = number[part]
    return block, np.concatenate((known, keys[start[new]])), sorted_states[~stays[part]]


def _predecessors(edges: Incidence, states: Int64s) -> Int64s:
    """The predecessors of some states, ascending."""
    if not len(states):
        return states
    counts = edges.pre[states + 1] - edges.pre[states]
    offsets = np.repeat(edges.pre[states] - np.concatenate(([0], np.cumsum(counts)[:-1])), counts)
    rows = edges.rows_in[offsets + np.arange(int(counts.sum()))]
    found = np.zeros(len(edges.pre) - 1, np.bool_)
    found[edges.owner_of_rows[rows]] = True
    return np.flatnonzero(found)


def _quotient(matrix: SparseMatrix, edges: Incidence, block: Int32s, rounds: int) -> Lumping:
    """The quotient, with blocks numbered by their first members."""
    _, first, inverse = np.unique(block, return_index=True, return_inverse=True)
    order = np.argsort(first)
    renumbered = np.empty(len(order), dtype=np.int32)
    renumbered[order] = np.arange(len(order), dtype=np.int32)
    block = renumbered[inverse.reshape(-1)]
    first = first[order].astype(np.int64)
    chosen = np.zeros(matrix.states, dtype=np.bool_)
    chosen[first] = True
    rows = np.flatnonzero(chosen[edges.owner_of_rows]).astype(np.int64)
    groups = None if matrix.groups is None else starts_of(np.diff(matrix.groups)[first])
    quotient = matrix.choose(rows, groups).merge(block, len(first))
    return Lumping(block, first, quotient, rows, rounds)
