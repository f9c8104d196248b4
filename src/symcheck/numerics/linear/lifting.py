"""Parameter lifting: each state chooses parameters of its own, among the corners of a box.

What a row gives is monotone in each of its parameters where its entries are multilinear over one
denominator. So the best choice is a corner, and the values of the MDP of corners bound the values
at every point of the box. They are computed in rationals.
Source: Quatmann, Dehnert, Jansen, Junges & Katoen (ATVA 2016), 'Parameter synthesis for Markov
models: faster than ever'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import pairwise, product

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import rationals
from symcheck.matrices.rational_functions import RationalFunction
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix, starts_of
from symcheck.numerics.linear.problem import LinearProblem

__all__ = ["lifted"]


def lifted(
    problem: LinearProblem,
    policy: Int64s | None,
    box: Mapping[str, tuple[Fraction, Fraction]],
    direction: Direction,
) -> LinearProblem:
    """The problem of the corners of a box, whose values bound those at its points.

    Args:
        problem: equations over functions.
        policy: the row of each state; None: all of them, which the same direction chooses among.
        box: the ranges of the parameters.
        direction: minimise for lower bounds, maximise for upper ones.

    Raises:
        UnsupportedError: a row is not multilinear.
    """
    matrix = problem.rows
    groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups
    rows_of = [range(a, b) for a, b in pairwise(groups.tolist())]
    if policy is not None:
        rows_of = [range(r, r + 1) for r in policy.tolist()]
    columns: list[Int32s] = []
    data: list[Fraction] = []
    constant: list[Fraction] = []
    lengths, counts = list[int](), list[int]()
    for rows in rows_of:
        before = len(constant)
        for r in rows:
            part = slice(matrix.indptr[r], matrix.indptr[r + 1])
            entries = [*matrix.data[part], problem.constant[r]]
            functions = [f for f in entries if isinstance(f, RationalFunction)]
            used = _parameters(functions)
            for corner in product(*(box[n] for n in used)):
                point = {
                    **{n: low for n, (low, _) in box.items()},
                    **dict(zip(used, corner, strict=True)),
                }
                *values, last = (
                    f(**point) if isinstance(f, RationalFunction) else f for f in entries
                )
                # A corner on a border of the ranges has no transitions of probability 0.
                kept = [i for i, value in enumerate(values) if value]
                columns.append(matrix.indices[part][kept])
                data += [values[i] for i in kept]
                lengths.append(len(kept))
                constant.append(last)
        counts.append(len(constant) - before)
    corners = SparseMatrix(
        starts_of(lengths),
        np.concatenate(columns),
        rationals(data),
        matrix.columns,
        starts_of(counts),
    )
    return LinearProblem(
        rationals(constant), corners, direction=direction, probability=problem.probability
    )


def _parameters(functions: Sequence[RationalFunction]) -> list[str]:
    """The parameters of a row. Raises UnsupportedError unless it is multilinear in them."""
    if not functions:
        return []
    field = functions[0].field
    common: dict[int, int] = {}
    for f in functions:
        for i, n in f.bottom:
            common[i] = max(n, common.get(i, 0))
    below = RationalFunction(field, field.product(common.items()), ())
    degrees = np.max([below.top.degrees(), *((f * below).top.degrees() for f in functions)], axis=0)
    if degrees.max() > 1:
        one = next((f for f in functions if max((f * below).top.degrees()) > 1), below)
        raise UnsupportedError(
            "parameter lifting needs probabilities and rewards that are linear in each parameter, "
            f"and one of them is {one!s:.60}",
            hint="without -lifting, regions are decided by functions",
        )
    return [name for name, degree in zip(field.names, degrees, strict=True) if degree]
