"""Anatomy of the hybrid engine: the numbers in an ODD, and the blocks of a matrix with the places where they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from symcheck.matrices.blocks import blocks, quad_dag
from symcheck.matrices.rows import Int64s

if TYPE_CHECKING:
    from symcheck.symbolic.model import Transitions

__all__ = ["Anatomy", "Level", "anatomy"]


@dataclass(frozen=True, slots=True)
class Level:
    """A bit of the ODD. `offsets`: of each node that reads it, how many members are on its low branch (those on the high
    branch are numbered from there on); `counts`: how many members are below the node.
    """

    bit: str
    offsets: tuple[int, ...]
    counts: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Anatomy:
    """levels: the ODD of the reachable states. nodes, triples: of the quad-DAG.

    blocks: int64[blocks, 3], rows, columns and runs. places: int64[places, 4], matrix (choice slot), block, row, column of its
    corner. statistics: as BlockMatrix has them. nbytes: memory of the blocks and places.
    """

    levels: tuple[Level, ...] = field(repr=False)
    nodes: int
    triples: int
    blocks: Int64s = field(repr=False)
    places: Int64s = field(repr=False)
    statistics: Mapping[str, int]
    nbytes: int


def anatomy(made: Transitions, budget: int = 60_000) -> Anatomy:
    """The reachable states' ODD, and the matrix as blocks of `budget` runs in all (small budgets cut small models too)."""
    odd, encoding = made.space.odd, made.space.symbolic.encoding
    quad = quad_dag(made.roots, odd, odd, encoding.columns)
    matrix = blocks(quad, budget=budget)
    shapes, places = matrix.stamps.listing()
    return Anatomy(
        _levels(made),
        quad.nodes,
        quad.triples,
        shapes,
        np.unique(places, axis=0),
        matrix.statistics,
        matrix.nbytes,
    )


def _levels(made: Transitions) -> tuple[Level, ...]:
    odd = made.space.odd
    depth, low, _, count, _ = odd.table
    levels = []
    for number, bit in enumerate(odd.rows):
        here = np.flatnonzero(depth == number)
        levels.append(Level(bit, tuple(count[low[here]].tolist()), tuple(count[here].tolist())))
    return tuple(levels)
