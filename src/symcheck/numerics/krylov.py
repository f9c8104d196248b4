"""Krylov methods, preconditioned from the right: restarted GMRES (Saad & Schultz 1986) and BiCGStab (van der Vorst 1992).

They give candidates, which are then certified elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from symcheck.numerics.matrix import Floats

__all__ = ["bicgstab", "gmres"]

Map = Callable[[Floats], Floats]


def gmres(times: Callable[[Floats], Floats], precondition: Callable[[Floats], Floats], right: Floats, size: int = 10) -> Iterator[Floats]:
    """Yield, per restart, an improved correction d with times(d) about `right`, for as long as asked; stops when it stalls.

    The caller measures what is left, in the norm that counts, and stops asking. Memory: size + 5 vectors.
    """
    solution = np.zeros_like(right)
    residual = right.copy()
    norm = float(np.sqrt(_dot(residual, residual)))
    basis = np.empty((size + 1, len(right)))
    while norm > 0.0:
        step = _cycle(times, precondition, residual, norm, basis)
        solution = solution + step
        residual = right - times(solution)
        before, norm = norm, float(np.sqrt(_dot(residual, residual)))
        if not np.isfinite(norm):
            return
        yield solution
        if norm > 0.99 * before:
            return


def _cycle(
    times: Callable[[Floats], Floats], precondition: Callable[[Floats], Floats], residual: Floats, norm: float, basis: Floats
) -> Floats:
    """The correction that is best in the Krylov space of this residual."""
    size = len(basis) - 1
    hessenberg = np.zeros((size + 1, size))
    np.divide(residual, norm, out=basis[0])
    made = 0
    for j in range(size):
        w = times(precondition(basis[j]))
        for _ in range(2):  # orthogonalised twice: once is not enough
            part = np.einsum("ij,j->i", basis[: j + 1], w)
            hessenberg[: j + 1, j] += part
            w -= np.einsum("i,ij->j", part, basis[: j + 1])
        made = j + 1
        hessenberg[made, j] = np.sqrt(_dot(w, w))
        if hessenberg[made, j] <= 1e-14 * norm:
            break
        np.divide(w, hessenberg[made, j], out=basis[made])
    target = np.zeros(made + 1)
    target[0] = norm
    weights = np.linalg.lstsq(hessenberg[: made + 1, :made], target, rcond=None)[0]
    return precondition(np.einsum("i,ij->j", weights, basis[:made]))


def bicgstab(times: Map, precondition: Map, right: Floats, scale: Floats) -> Iterator[tuple[Floats, Floats]]:
    """Yield, step by step, a solution of times(x) = right and what it leaves of `right`; stops where the method breaks down.

    scale: positive, float64[n]; residuals are measured relative to it, so that small entries count as much as great ones.
    The arrays are the method's own: look, do not write. Memory: 9 vectors.
    """
    square = 1.0 / scale
    square *= square
    x, r = np.zeros_like(right), right.copy()
    shadow = square * r
    p, v = np.zeros_like(right), np.zeros_like(right)
    rho = alpha = omega = 1.0
    while True:
        before, rho = rho, _dot(shadow, r)
        beta = rho * alpha / (before * omega) if before * omega else 0.0
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
        size = _dot(weighted, t)
        omega = _dot(weighted, r) / size if size > 0.0 else 0.0
        x += omega * ahead
        r -= omega * t
        yield x, r
        if omega == 0.0 or not np.isfinite(omega):
            return


def _dot(a: Floats, b: Floats) -> float:
    """Inner product, in one thread: those of a BLAS wait for each other longer than they work, and change the last digits."""
    return float(np.einsum("i,i->", a, b))
