"""Properties of expressions that the translation to diagrams needs: variables, operands, numbers of
values.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from symcheck.semantics.expressions.vectorised import Column
from symcheck.symbolic.encoding.variables import EncodedVariable
from symcheck.syntax.ast import Expression
from symcheck.syntax.traversal import names, nodes

__all__ = ["contains", "leaf_bound", "mesh", "support"]


def support(expression: Expression) -> frozenset[str]:
    """Names of the variables that occur in an arithmetic expression."""
    return frozenset(names(expression))


def mesh(variables: Sequence[EncodedVariable]) -> dict[str, Column]:
    """The values of each variable along an axis of its own, as for numpy.ogrid."""
    columns: dict[str, Column] = {}
    for axis, v in enumerate(variables):
        shape = [1] * len(variables)
        shape[axis] = 1 << v.width
        columns[v.name] = v.column().reshape(shape)
    return columns


def leaf_bound(operator: str, x: NDArray[np.float64], y: NDArray[np.float64]) -> int:
    """An upper bound on the number of distinct values of x op y."""
    pairs = len(x) * len(y)
    if operator == "*" or not (np.all(x == np.floor(x)) and np.all(y == np.floor(y))):
        return pairs
    span = float(x.max() - x.min() + y.max() - y.min()) + 1
    return int(min(pairs, span)) if np.isfinite(span) else pairs


def contains(expression: Expression, part: Expression) -> bool:
    """Whether `part` occurs strictly inside `expression`."""
    return any(node == part for node in islice(nodes(expression), 1, None))
