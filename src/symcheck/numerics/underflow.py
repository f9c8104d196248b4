"""Products with a matrix of probabilities whose terms underflow: bounds take the place of values.

A product of normal doubles that is below the least normal double has lost digits, and may be 0
although both factors are positive. Above `UNDERFLOW_MARGIN` a sum of such terms is as accurate as
any other; below it, only the bounds 0 and `UNDERFLOW_MARGIN` are known. Whether a number is 0
follows from the graph.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from symcheck.matrices.numbers import Numbers, is_rational
from symcheck.matrices.tuning import UNDERFLOW_MARGIN

__all__ = ["enclosed", "may_underflow"]


def may_underflow(values: Numbers, least_entry: float) -> bool:
    """Whether a product of a non-zero value and an entry of a matrix may be below the margin.

    Args:
        values: float64, or rationals, of which no product underflows.
        least_entry: the least positive entry, or less.

    Examples:
        >>> import numpy as np
        >>> may_underflow(np.array([0.0, 1e-200]), 1e-200), may_underflow(np.array([0.5]), 0.5)
        (True, False)
    """
    if is_rational(values) or len(values) == 0:
        return False
    # Doubles without a sign are ordered as their bits; minus 1, those of 0 become the largest.
    bits = np.ascontiguousarray(values).view(np.uint64) << np.uint64(1)
    least = (int(np.min(bits - np.uint64(1))) + 1) // 2
    return float(np.uint64(least).view(np.float64)) * least_entry < UNDERFLOW_MARGIN


def enclosed(
    bounds: Sequence[Numbers], positive: Callable[[], Numbers], *, signed: bool = False
) -> list[Numbers]:
    """Bounds of sums of products that may have underflowed.

    Args:
        bounds: the numbers, or their lower and their upper bounds, rounded to nearest.
        positive: the numbers with 1 in place of each positive term, or any other that are 0 where
            these are; asked for if some seem to be 0.
        signed: whether terms may be negative, so that a 0 does not follow from the graph.

    Returns:
        The same numbers where nothing is lost; else lower and upper bounds, of which the upper
        ones are 0 only where the numbers are.

    Examples:
        >>> import numpy as np
        >>> low, high = enclosed([np.array([0.5, 1e-310, 0, 0])], lambda: np.array([1, 1, 1, 0]))
        >>> print(low, high)
        [0.5 0.  0.  0. ] [5.e-001 1.e-307 1.e-307 0.e+000]
    """
    low, high = bounds[0], bounds[-1]
    if is_rational(low) or not np.any(np.abs(low) < UNDERFLOW_MARGIN):
        return list(bounds)
    some = (high != 0) | signed
    if not some.all():
        some |= positive() != 0
    lost = (np.abs(low) < UNDERFLOW_MARGIN) & some
    if not lost.any():
        return list(bounds)
    least = -UNDERFLOW_MARGIN if signed else 0.0
    return [
        np.where(lost, least, low),
        np.where((np.abs(high) < UNDERFLOW_MARGIN) & some, UNDERFLOW_MARGIN, high),
    ]
