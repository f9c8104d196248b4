"""Equations over rational functions of parameters.

States that satisfy the same equations are merged first: a partition that is found in doubles at the
sample point is verified over the functions. The quotient is eliminated, component by component.
Sources: Daws (2004); Hahn, Hermanns & Zhang (2011), 'Probabilistic reachability for parametric
Markov models'.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from symcheck.matrices.function_table import FunctionTable
from symcheck.matrices.numbers import at_sample, doubles
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.matrices.rows import Int64s, SparseMatrix, starts_of
from symcheck.numerics.bisimulation import lump
from symcheck.numerics.linear.rational import Row, least_solution

__all__ = ["least_functions"]

_FEW = 10
"""Equations that are solved as they are."""


def least_functions(matrix: SparseMatrix, constant: Sequence[RationalFunction]) -> list[Any]:
    """The least solution of x = A x + b over the functions, where every row is a state."""
    table = FunctionTable()
    weights = table.numbers(matrix.data)
    block = _blocks(matrix, weights, table.numbers(constant), table)
    rows = np.unique(block, return_index=True)[1]
    merged, starts = _merged(matrix, weights, block, table)
    quotient: list[Row[RationalFunction]] = [
        {int(merged[0, i]): table.functions[merged[1, i]] for i in range(starts[r], starts[r + 1])}
        for r in rows.tolist()
    ]
    x = least_solution(quotient, [constant[r] for r in rows.tolist()])
    return [x[b] for b in block.tolist()]


def _blocks(
    matrix: SparseMatrix, weights: Int64s, constants: Int64s, table: FunctionTable
) -> Int64s:
    """Blocks of states that satisfy the same equations; each state alone where that is not so."""
    alone = np.arange(matrix.rows)
    if matrix.rows <= _FEW:
        return alone
    block = lump(
        SparseMatrix(
            matrix.indptr, matrix.indices, doubles(at_sample(matrix.data)), matrix.columns
        ),
        [constants],
    ).block.astype(np.int64)
    (columns, numbers), starts = _merged(matrix, weights, block, table)
    first = np.unique(block, return_index=True)[1][block]
    lengths = np.diff(starts)
    if not (lengths == lengths[first]).all() or not (constants == constants[first]).all():
        return alone
    mine = np.arange(len(columns))
    others = mine + np.repeat(starts[first] - starts[:-1], lengths)
    same = (columns == columns[others]) & (numbers == numbers[others])
    return block if same.all() else alone


def _merged(
    matrix: SparseMatrix, weights: Int64s, block: Int64s, table: FunctionTable
) -> tuple[Int64s, Int64s]:
    """The entries summed by blocks of columns: block and number of each, and starts of rows."""
    row, column, numbers = table.merged(matrix.row_of_entry, block[matrix.indices], weights)
    return np.stack([column, numbers]), starts_of(np.bincount(row, minlength=matrix.rows))
