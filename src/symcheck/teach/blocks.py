"""The hybrid engine from the inside: the offsets of an ODD, and the blocks of a matrix.

Source: Parker (2002), Implementation of symbolic model checking for probabilistic systems, ch. 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from symcheck.matrices.blocks import blocks, quad_dag
from symcheck.matrices.rows import Int64s
from symcheck.teach.source import matrices
from symcheck.view.choice_graph import GivenModel

if TYPE_CHECKING:
    from symcheck.dd.odd import Odd
    from symcheck.symbolic.model import Transitions

__all__ = ["BlockStructure", "Level", "block_structure"]


@dataclass(frozen=True, slots=True)
class Level:
    """A level of an ODD.

    Attributes:
        bit: the bit that the nodes of the level test.
        offsets: per node, the number of states on its 0 branch. States on the 1 branch are
            numbered from there on.
        counts: per node, the number of states below it.
    """

    bit: str
    offsets: tuple[int, ...]
    counts: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class BlockStructure:
    """The ODD of the reachable states, and the matrix as distinct blocks.

    Attributes:
        levels: the ODD.
        nodes, triples: the size of the quad-DAG.
        blocks: int64[blocks, 3]: rows, columns and diagonal runs of each distinct block.
        occurrences: int64[occurrences, 4]: matrix (choice class), block, first row, first column.
        statistics: the statistics of the BlockMatrix.
        nbytes: the memory of blocks and occurrences, in bytes.
    """

    levels: tuple[Level, ...] = field(repr=False)
    nodes: int
    triples: int
    blocks: Int64s = field(repr=False)
    occurrences: Int64s = field(repr=False)
    statistics: Mapping[str, int]
    nbytes: int


def block_structure(model: GivenModel | Transitions, budget: int = 60_000) -> BlockStructure:
    """The ODD of the reachable states, and the blocks of the matrix.

    Args:
        model: the model, or its transitions.
        budget: the most diagonal runs that all distinct blocks may have together. A small budget
            partitions the matrix of a small model too.
    """
    space, roots = matrices(model)
    odd, encoding = space.odd, space.symbolic.encoding
    quad = quad_dag(roots, odd, odd, encoding.columns)
    matrix = blocks(quad, budget=budget)
    shapes, places = matrix.operations.describe()
    return BlockStructure(
        _levels(odd),
        quad.nodes,
        quad.triples,
        shapes,
        np.unique(places, axis=0),
        matrix.statistics,
        matrix.nbytes,
    )


def _levels(odd: Odd) -> tuple[Level, ...]:
    depth, low, _, count, _ = odd.table
    levels = []
    for number, bit in enumerate(odd.rows):
        here = np.flatnonzero(depth == number)
        levels.append(Level(bit, tuple(count[low[here]].tolist()), tuple(count[here].tolist())))
    return tuple(levels)
