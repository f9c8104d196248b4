"""Beliefs as convex combinations of the points of a grid.

Source: Lovejoy (1991), 'Computationally feasible bounds for partially observed Markov decision
processes' (the triangulation of Freudenthal); Norman, Parker & Zou (2017), 'Verification and
control of partially observable probabilistic systems'.
"""

from __future__ import annotations

import numpy as np

from symcheck.matrices.rows import Int64s, spans, starts_of
from symcheck.numerics.beliefs.observed import Whole

__all__ = ["reduced", "totals", "triangulate"]


def totals(starts: Int64s, values: Whole) -> Whole:
    """The sum of each belief; none of them is empty."""
    return np.asarray(np.add.reduceat(values, starts[:-1]))


def reduced(starts: Int64s, values: Whole) -> Whole:
    """The beliefs divided by the greatest common divisor of each."""
    return np.asarray(values // np.repeat(np.gcd.reduceat(values, starts[:-1]), np.diff(starts)))


def triangulate(
    starts: Int64s, states: Int64s, values: Whole, resolution: int
) -> tuple[Int64s, Whole, Int64s, Int64s, Whole]:
    """The corners of the simplices of the grid in which beliefs lie, and their shares, exactly.

    Args:
        starts: where each belief begins in the other arrays, and where the last ends.
        states: the states that a belief holds possible.
        values: whole numbers in proportion to their probabilities.
        resolution: the coordinates of the grid are multiples of 1/resolution.

    Returns:
        The belief of each corner; its share, times the total of the belief; and the corners as
        beliefs: starts, states, values.
    """
    sizes = np.diff(starts)
    owner = np.repeat(np.arange(len(sizes)), sizes)
    whole = totals(starts, values)
    running = np.cumsum(values)
    scaled = resolution * (running[starts[1:] - 1][owner] - running + values)
    floor = scaled // whole[owner]
    rest = scaled - floor * whole[owner]
    if rest.dtype == object:
        keys = zip(owner.tolist(), (-rest).tolist(), strict=True)
        order = np.array([i for *_, i in sorted((*k, i) for i, k in enumerate(keys))])
    else:
        order = np.lexsort((np.arange(len(rest)), -rest, owner))
    place = np.empty(len(order), np.int64)
    place[order] = np.arange(len(order)) - np.repeat(starts[:-1], sizes)
    ordered = rest[order]
    before = np.concatenate((ordered[:1], ordered[:-1]))
    before[starts[:-1]] = whole
    share = before - ordered
    corner = np.flatnonzero(share > 0)
    of, step = owner[corner], corner - starts[:-1][owner[corner]]
    entries = spans(starts[:-1][of], starts[1:][of])
    lengths = sizes[of]
    height = floor[entries] + (place[entries] < np.repeat(step, lengths))
    following = np.concatenate((height[1:], height[:1] * 0))
    following[starts_of(lengths)[1:] - 1] = 0
    point = height - following
    kept = point > 0
    ends = starts_of(kept)[starts_of(lengths)]
    point = point[kept].astype(np.int64)
    return of, share[corner], ends, states[entries[kept]], reduced(ends, point)
