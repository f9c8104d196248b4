"""Transient values of stiff chains: a small space that holds the solution at all times, and a proof of how well it does.

x(t) solves x' = Q x + gain from x(0) = start. In the space V of (I - γ Q)^-1 and its powers, applied to Q start + gain, slow
and fast parts are found alike, however large the rates are (Moret & Novati 2004; van den Eshof & Hochbruck 2006). With any
V, H and any function p(t) with p(0) = 0 the candidate u = start + V p errs by at most the integral of its defect,

    |x(t) - u(t)| <= integral of |V (p' - H p - b) + (V H - Q V) p + (V b - Q start - gain)|,    greatest entries,

as exp(Q t) does not enlarge the greatest entry. p is a polynomial per interval of time, so that every term is known.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from symcheck.kernels import sparse, stationary
from symcheck.numerics.krylov import bicgstab
from symcheck.numerics.matrix import Floats, Int64s, SparseMatrix
from symcheck.numerics.problem import Observer, Step
from symcheck.numerics.settings import Settings
from symcheck.records import dataclass

__all__ = ["Implicit", "implicit_values"]

ROUND = 2.0**-53
SIZES = (8, 12, 18, 24, 30, 36, 44, 52, 60)  # of the space, at which the defect is measured
POLE = 10.0  # γ is the time over this
SWEEPS = 3  # Gauss-Seidel sweeps, to and fro, in a preconditioner
STEPS = 200  # of BiCGStab, per vector
SOLVED = 1e-12  # residual of a vector, relative
DEGREE = 10  # of the polynomials in time
LEBESGUE = 2.6  # a polynomial of that degree is at most so many times its greatest value at the nodes
HOPELESS = 300.0  # greatest value, in terms of the least of interest, from which on the greatest entry's error is no use


@dataclass(frozen=True, eq=False)
class Implicit:
    """Values float64[n] at the time asked for, within `error` of the true ones everywhere; vectors in the space, and solver steps."""

    values: Floats
    error: float
    vectors: int
    steps: int


def implicit_values(
    rates: SparseMatrix,
    exit_rates: Floats,
    start: Floats,
    gain: Floats | None,
    time: float,
    interest: Int64s,
    settings: Settings,
    observer: Observer | None = None,
) -> Implicit | None:
    """x(time) of x' = Q x + gain, x(0) = start, near enough at the states of interest; None where that is not found.

    rates, exit_rates: as in `transient_values`. interest: at least one. Memory: two vectors per vector of the space.
    """
    system = _System.of(rates, exit_rates, time / POLE)
    speed = system.generator(start) + (0.0 if gain is None else gain)
    slip = (system.longest + 6) * ROUND * 2.0 * system.fastest * time
    # Roundings in `speed` act for all the time; rows of Q may sum to a little more than 0.
    fixed = slip * float(np.max(np.abs(start))) + 4.0 * ROUND * time * float(np.max(np.abs(speed)))
    growth = math.exp(slip)
    space = _Space.of(system, speed, max(SIZES))
    widths: list[float] = []
    for size in SIZES:
        if not space.extend(size):
            return None
        try:
            basis, matrix, first = space.projected(size)
            path = _path(matrix, first, time)
            defect = _defect(system, basis, matrix, first, speed, path)
        except (np.linalg.LinAlgError, OverflowError):  # singular, or not finite
            return None
        values = start + path.end @ basis
        error = (defect + fixed) * growth * (1.0 + 1e-6)
        error += 1e-13 * float(np.max(np.abs(values)))
        least = float(values[interest].min())
        widths.append(2.0 * error)
        if observer is not None:
            observer(Step("implicit", space.steps, widths[-1], len(start)))
        goal = settings.epsilon * (least if settings.relative else 1.0)
        if widths[-1] <= goal:
            return Implicit(values, error, size, space.steps)
        if not least > 0.0 or float(values.max()) > HOPELESS * least or not _converges(widths, goal):
            return None
    return None


def _converges(widths: list[float], goal: float) -> bool:
    """Whether the greatest space will do, going by how the widths fell from size to size."""
    if not np.isfinite(widths[-1]):
        return False
    made = len(widths) - 1
    # The first size is too early to judge by.
    rate = (widths[-1] / widths[1]) ** (1.0 / (SIZES[made] - SIZES[1])) if made > 1 else 0.0
    return widths[-1] * rate ** (SIZES[-1] - SIZES[made]) <= goal


@dataclass(frozen=True, eq=False)
class _System:
    """Q, and I - γ Q with rows divided by their diagonal: I - A with A non-negative."""

    rates: SparseMatrix
    exit_rates: Floats
    pole: float
    data: Floats
    scale: Floats
    fastest: float
    longest: int

    @staticmethod
    def of(rates: SparseMatrix, exit_rates: Floats, pole: float) -> _System:
        lengths = np.diff(rates.indptr)
        owner = np.repeat(np.arange(rates.states, dtype=np.int32), lengths)
        loops = rates.indices == owner
        diagonal = 1.0 + pole * exit_rates
        np.subtract.at(diagonal, owner[loops], pole * rates.data[loops])
        data = pole * rates.data / diagonal[owner]
        data[loops] = 0.0
        fastest = float(np.max(exit_rates, initial=0.0))
        return _System(rates, exit_rates, pole, data, 1.0 / diagonal, fastest, int(np.max(lengths, initial=0)))

    def generator(self, v: Floats) -> Floats:
        """Q v."""
        out = np.empty(len(v))
        sparse.multiply(self.rates.indptr, self.rates.indices, self.rates.data, v, out)
        out -= self.exit_rates * v
        return out

    def times(self, v: Floats) -> Floats:
        """(I - A) v."""
        out = np.empty(len(v))
        stationary.less_product(self.rates.indptr, self.rates.indices, self.data, v, out)
        return out

    def precondition(self, v: Floats) -> Floats:
        """About (I - A)^-1 v."""
        out = np.empty(len(v))
        stationary.symmetric_sweeps(self.rates.indptr, self.rates.indices, self.data, v, out, SWEEPS)
        return out


@dataclass(eq=False)
class _Space:
    """An orthonormal basis of the space, row by row, and what (I - γ Q)^-1 does to it."""

    system: _System
    basis: Floats
    inverse: Floats
    length: float
    made: int = 0
    steps: int = 0

    @staticmethod
    def of(system: _System, first: Floats, most: int) -> _Space:
        length = float(np.sqrt(np.einsum("i,i->", first, first)))
        basis = np.empty((most + 1, len(first)))
        basis[0] = first / length if length else 0.0
        return _Space(system, basis, np.zeros((most + 1, most)), length)

    def extend(self, size: int) -> bool:
        """Up to so many vectors; False where the equations are not solved soon, or nothing new comes up."""
        while self.made < size:
            j = self.made
            found = self._inverse(self.basis[j] * self.system.scale)
            if found is None:
                return False
            for _ in range(2):  # orthogonalised twice: once is not enough
                part = np.einsum("ij,j->i", self.basis[: j + 1], found)
                self.inverse[: j + 1, j] += part
                found = found - np.einsum("i,ij->j", part, self.basis[: j + 1])
            length = float(np.sqrt(np.einsum("i,i->", found, found)))
            if not length > 0.0:
                return False
            self.inverse[j + 1, j] = length
            np.divide(found, length, out=self.basis[j + 1])
            self.made += 1
        return True

    def _inverse(self, right: Floats) -> Floats | None:
        goal = SOLVED * float(np.max(np.abs(right)))
        for count, (x, rest) in enumerate(bicgstab(self.system.times, self.system.precondition, right, np.ones(len(right)))):
            self.steps += 1
            if float(np.max(np.abs(rest))) <= goal:
                return x
            if count > STEPS:
                break
        return None

    def projected(self, size: int) -> tuple[Floats, Floats, Floats]:
        """V (a row per vector), H (Q in the space, about) and b (the first vector's length along itself)."""
        inverse = np.linalg.inv(self.inverse[:size, :size])
        first = np.zeros(size)
        first[0] = self.length
        return self.basis[:size], (np.eye(size) - inverse) / self.system.pole, first


@dataclass(frozen=True, eq=False)
class _Path:
    """p as polynomials: per interval its length and its values at the nodes, float64[nodes, size], the first node its start."""

    lengths: list[float]
    nodes: list[Floats]

    @property
    def end(self) -> Floats:
        """The last value."""
        return np.asarray(self.nodes[-1][-1])


def _path(matrix: Floats, first: Floats, time: float) -> _Path:
    """P' = H p + b from 0, by collocation at Chebyshev's points, on intervals that grow with the time."""
    size, slope = len(first), _differentiation()
    halvings = max(0, math.ceil(math.log2(max(1.0, time * float(np.linalg.norm(matrix, 1)))))) + 1
    ends = time * 0.5 ** np.arange(halvings, -1, -1.0)
    cuts = np.concatenate(([0.0], ends[:1], *(np.linspace(a, b, 3)[1:] for a, b in pairwise(ends))))
    path = _Path([], [])
    value = np.zeros(size)
    for length in np.diff(cuts):
        half = 0.5 * float(length)
        system = np.kron(slope[1:, 1:], np.eye(size)) - half * np.kron(np.eye(DEGREE), matrix)
        right = half * np.tile(first, DEGREE) - np.kron(slope[1:, 0], value)
        inner = np.linalg.solve(system, right).reshape(DEGREE, size)
        path.lengths.append(float(length))
        path.nodes.append(np.vstack((value, inner)))
        value = inner[-1]
    return path


def _differentiation() -> Floats:
    """The slopes at Chebyshev's points, from -1 to 1, of a polynomial given by its values there (Trefethen 2000)."""
    k = np.arange(DEGREE + 1)
    x = -np.cos(np.pi * k / DEGREE)
    c = np.where((k == 0) | (k == DEGREE), 2.0, 1.0) * (-1.0) ** k
    difference = x[:, None] - x[None, :] + np.eye(DEGREE + 1)
    slope = np.outer(c, 1.0 / c) / difference
    return np.asarray(slope - np.diag(slope.sum(axis=1)))


def _defect(system: _System, basis: Floats, matrix: Floats, first: Floats, speed: Floats, path: _Path) -> float:
    """An upper bound on the integral over time of the greatest entry of the defect, roundings counted in."""
    size = len(first)
    rest = matrix.T @ basis
    for j in range(size):
        rest[j] -= system.generator(basis[j])
    # V H - Q V is one vector times coefficients, but for what the solver left.
    _, vectors = np.linalg.eigh(rest @ rest.T)
    along = vectors[:, -1]
    single = np.einsum("i,ij->j", along, rest)
    width = float(np.max(np.abs(single)))
    rest -= np.outer(along, single)
    others = np.max(np.abs(rest), axis=1)
    greatest = np.max(np.abs(basis), axis=1)
    # Roundings of the products above, per unit of each coordinate.
    norm = np.abs(matrix)
    others += (size + system.longest + 8) * ROUND * (norm.T @ greatest + 2.0 * system.fastest * greatest + np.abs(along) * width)
    constant = float(np.max(np.abs(first @ basis - speed)))
    slope = _differentiation()
    total = 0.0
    for length, nodes in zip(path.lengths, path.nodes, strict=True):
        derivative = slope @ nodes * (2.0 / length)
        leaves = np.abs(derivative - nodes @ matrix.T - first)
        leaves += (size + DEGREE) * ROUND * (np.abs(slope) @ np.abs(nodes) * (2.0 / length) + np.abs(nodes) @ norm.T + np.abs(first))
        moved = np.abs(nodes @ along) + size * ROUND * (np.abs(nodes) @ np.abs(along))
        most = moved * width + np.abs(nodes) @ others + leaves @ greatest + constant
        total += length * LEBESGUE * float(most.max())
    return total
