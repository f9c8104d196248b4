"""BiCGStab, preconditioned from the right (van der Vorst 1992): candidates for what is then certified elsewhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from symcheck.matrices.rows import Floats

__all__ = ["bicgstab"]

Map = Callable[[Floats], Floats]
LOST = 1e-11  # of the greatest residual so far: what is smaller may be its rounding


def bicgstab(
    times: Map, precondition: Map, right: Floats, scale: Floats
) -> Iterator[tuple[Floats, Floats]]:
    """Yield, step by step, a solution of times(x) = right and what it leaves of `right`; stops where the method breaks down.

    scale: positive, float64[n]; residuals are measured relative to it, so that small entries count as much as great ones.
    Residuals that have grown lose digits: when they have come down again the method starts anew from the true one.
    The arrays are the method's own: look, do not write. Memory: 9 vectors.
    """
    with np.errstate(over="ignore"):  # what cannot be measured is not solved
        square = 1.0 / scale
        square *= square
    x, r = np.zeros_like(right), right.copy()
    while True:
        greatest = size = _size(r, square)
        if not 0.0 < size < math.inf:
            return
        shadow, p, v = square * r, np.zeros_like(right), np.zeros_like(right)
        rho = alpha = omega = 1.0
        while size > LOST * greatest:
            before, rho = rho, _dot(shadow, r)
            beta = rho * alpha / (before * omega)
            p = r + beta * (p - omega * v)
            ahead = precondition(p)
            v = times(ahead)
            along = _dot(shadow, v)
            if not (abs(rho) > 0.0 and abs(along) > 0.0 and np.isfinite(along)):
                return
            alpha = rho / along
            x += alpha * ahead
            r -= alpha * v
            ahead = precondition(r)
            t = times(ahead)
            weighted = square * t
            spread = _dot(weighted, t)
            omega = _dot(weighted, r) / spread if spread > 0.0 else 0.0
            x += omega * ahead
            r -= omega * t
            yield x, r
            size = _size(r, square)
            greatest = max(greatest, size)
            if omega == 0.0 or not np.isfinite(omega * size):
                return
        r = right - times(x)


def _size(r: Floats, square: Floats) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return math.sqrt(float(np.einsum("i,i,i->", square, r, r)))


def _dot(a: Floats, b: Floats) -> float:
    """Inner product, in one thread: those of a BLAS wait for each other longer than they work, and change the last digits."""
    return float(np.einsum("i,i->", a, b))
