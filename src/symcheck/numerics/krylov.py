"""Restarted GMRES, preconditioned from the right (Saad & Schultz 1986): candidates for what is then certified elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from symcheck.numerics.matrix import Floats

__all__ = ["gmres"]


def gmres(times: Callable[[Floats], Floats], precondition: Callable[[Floats], Floats], right: Floats, size: int = 10) -> Iterator[Floats]:
    """Yield, per restart, an improved correction d with times(d) about `right`, for as long as asked; stops when it stalls.

    The caller measures what is left, in the norm that counts, and stops asking. Memory: size + 5 vectors.
    """
    solution = np.zeros_like(right)
    residual = right.copy()
    norm = float(np.linalg.norm(residual))
    basis = np.empty((size + 1, len(right)))
    while norm > 0.0:
        step = _cycle(times, precondition, residual, norm, basis)
        solution = solution + step
        residual = right - times(solution)
        before, norm = norm, float(np.linalg.norm(residual))
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
            part = basis[: j + 1] @ w
            hessenberg[: j + 1, j] += part
            w -= part @ basis[: j + 1]
        made = j + 1
        hessenberg[made, j] = np.linalg.norm(w)
        if hessenberg[made, j] <= 1e-14 * norm:
            break
        np.divide(w, hessenberg[made, j], out=basis[made])
    target = np.zeros(made + 1)
    target[0] = norm
    weights = np.linalg.lstsq(hessenberg[: made + 1, :made], target, rcond=None)[0]
    return precondition(weights @ basis[:made])
