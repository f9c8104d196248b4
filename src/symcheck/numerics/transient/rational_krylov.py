"""Transient values of stiff chains: a small space that holds the solution at all times, and a proof of how well it does.

x(t) solves x' = Q x + gain from x(0) = start. In the space V of (I - γ Q)^-1 and its powers, applied to Q start + gain, slow
and fast parts are found alike, however large the rates are (Moret & Novati 2004; van den Eshof & Hochbruck 2006). With any
V, H and any function p(t) with p(0) = 0 the candidate u = start + V p errs by at most the integral of its defect,

    |x(t) - u(t)| <= integral of |V (p' - H p - b) + (V H - Q V) p + (V b - Q start - gain)|,    greatest entries,

as exp(Q t) does not enlarge the greatest entry. p is a polynomial per interval of time, so that every term is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.kernels.chains.gth_elimination import Elimination
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix, relative_solution
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.settings import Settings

__all__ = ["Implicit", "excess", "implicit_values", "importance"]

ROUND = 2.0**-53
SIZES = (8, 12, 18, 24, 30, 36, 44, 52, 60)  # of the space, at which the defect is measured
MORE = (75, 90, 110, 130, 160, 200)  # where vectors are cheap
MILD = 1.0  # a of the weights
STEPS = 400  # of BiCGStab, per vector
POLE = 10.0  # with elimination there is one only
DIRECT, OPERATIONS = (
    50_000,
    1500,
)  # states up to which elimination is tried instead, and operations that it may need per entry
QUICK = 1500  # operations per entry, likewise, for weights
ROUGH = 1e-8  # residual of weights, in terms of a guess
SOLVED = 1e-12  # residual of a vector, relative
EARLY = 3  # sizes that are not judged by
EASE = 1e3  # at most: what is left of a vector is worth so much less, at the end, than of the first
DEGREE = 10  # of the polynomials in time
SLICE = 65_536  # states at a time, where all at once would take a copy of the space
INTERVALS = 150  # at most
SAMPLES = (
    4 * DEGREE
)  # angles, at which bounds are looked for: with nodes at cosines, a maximum is at most an angle of pi/2N away
LEBESGUE = (
    1.0 / math.cos(0.5 * math.pi * DEGREE / SAMPLES) * (1 + 1e-9)
)  # and so much greater at most (Ehlich & Zeller 1964)
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
    poles: tuple[float, ...] = (15.0,),
) -> Implicit | None:
    """x(time) of x' = Q x + gain, x(0) = start, near enough at the states of interest; None where that is not found.

    rates, exit_rates: as in `transient_values`, but rows may sum to somewhat more than their exit rate (where values were divided
    by weights). interest: at least one. poles: γ is the time over these, in turn. Memory: two vectors per vector of the space.
    """
    system = _System.of(rates, exit_rates, tuple(time / p for p in poles), time / POLE)
    speed = system.generator(start) + (0.0 if gain is None else gain)
    slip = (system.longest + 6) * ROUND * 2.0 * system.fastest * time
    # Roundings in `speed` act for all the time; rows of Q may sum to a little more than 0.
    fixed = slip * float(np.max(np.abs(start))) + 4.0 * ROUND * time * float(np.max(np.abs(speed)))
    growth = math.exp(slip + excess(rates, exit_rates) * time)
    space = _Space.of(system, speed, max(SIZES + MORE))
    widths: list[float] = []
    goal = math.inf
    sizes = SIZES if system.factors is None else SIZES + MORE
    for size in sizes:
        if not space.extend(size, _ease(widths)):
            return None
        try:
            basis, matrix, first = space.projected(size)
            greatest = _greatest(basis)
            path = _path(matrix, first, time, greatest, 3e-3 * goal / (growth * LEBESGUE))
            defect = _defect(system, basis, matrix, first, speed, path)
        except (np.linalg.LinAlgError, OverflowError):  # singular, or not finite
            return None
        values = start + path.end @ basis
        error = (defect + fixed) * growth * (1.0 + 1e-6)
        error += 1e-13 * float(np.max(np.abs(values)))
        least = float(values[interest].min())
        widths.append(2.0 * error)
        if observer is not None:
            observer(Progress("implicit", space.steps, widths[-1], len(start)))
        goal = settings.epsilon * (least if settings.relative else 1.0)
        if widths[-1] <= goal:
            return Implicit(values, error, size, space.steps)
        if (
            not least > 0.0
            or float(values.max()) > HOPELESS * least
            or not _converges(widths, goal, sizes)
        ):
            return None
    return None


def importance(
    rates: SparseMatrix, exit_rates: Floats, gain: Floats, time: float, guess: Floats
) -> Floats | None:
    """(a/T - Q)^-1 gain: weights in terms of which the values at up to that time differ less; None where they are not found.

    Divided by them, rows of Q sum to at most about a/T, so that exp(Q t) still enlarges the greatest entry by exp(a) only.
    guess: positive, about as large as they are, to within some orders of magnitude.
    """
    rest = MILD / time
    scale = 1.0 / (exit_rates + rest)
    if rates.states <= DIRECT:
        data = rates.data * np.repeat(scale, np.diff(rates.indptr))
        leaves = np.maximum(exit_rates - sparse.row_sums(rates.indptr, rates.data), 0.0) + rest
        factors = Elimination(
            rates.indptr, rates.indices, data, leaves * scale, QUICK * rates.entries
        )
        found = factors.solve(gain * scale) if factors.complete else None
        if found is not None:
            return found if bool(np.all(found > 0.0)) else None
    scale = 1.0 / (
        exit_rates + rest - ssor_eisenstat.loops(rates.indptr, rates.indices, rates.data)
    )
    return relative_solution(rates, scale, gain, guess, ROUGH)


def excess(rates: SparseMatrix, exit_rates: Floats) -> float:
    """By how much the sum of a row exceeds its exit rate, at most."""
    return max(0.0, float(np.max(sparse.row_sums(rates.indptr, rates.data) - exit_rates)))


def _ease(widths: list[float]) -> float:
    """How much less well the next vectors may be solved for than the first, as the solution has less of them."""
    return min(max(widths[0] / widths[-1], 1.0), EASE) if widths else 1.0


def _converges(widths: list[float], goal: float, sizes: tuple[int, ...]) -> bool:
    """Whether the greatest space will do, going by how the widths fell from size to size."""
    if not np.isfinite(widths[-1]):
        return False
    made = len(widths) - 1
    if made < EARLY:
        return True
    # Going by the whole way, or by its last part, whichever promises more.
    rate = min((widths[-1] / widths[i]) ** (1.0 / (sizes[made] - sizes[i])) for i in (1, made - 1))
    return bool(widths[-1] * rate ** (sizes[-1] - sizes[made]) <= goal)


@dataclass(frozen=True, eq=False)
class _System:
    """Q, and I - γ Q with rows divided by their diagonal: I - A with A non-negative. Either factors or the split is there."""

    rates: SparseMatrix
    exit_rates: Floats
    poles: tuple[float, ...]
    fastest: float
    longest: int
    factors: Elimination | None
    diagonal: Floats
    split: SplitMatrix | None

    @staticmethod
    def of(
        rates: SparseMatrix, exit_rates: Floats, poles: tuple[float, ...], single: float
    ) -> _System:
        diagonal = exit_rates - ssor_eisenstat.loops(rates.indptr, rates.indices, rates.data)
        factors = (
            _factors(rates, single / (1.0 + single * diagonal)) if rates.states <= DIRECT else None
        )
        split = None if factors is not None else SplitMatrix.of(rates, diagonal)
        longest = int(np.max(np.diff(rates.indptr), initial=0))
        poles = (single,) if split is None else poles
        return _System(
            rates,
            exit_rates,
            poles,
            float(np.max(exit_rates, initial=0.0)),
            longest,
            factors,
            diagonal,
            split,
        )

    def pole(self, j: int) -> float:
        """The pole of vector j."""
        return self.poles[j % len(self.poles)]

    def generator(self, v: Floats) -> Floats:
        """Q v."""
        out = np.empty(len(v))
        sparse.multiply(self.rates.indptr, self.rates.indices, self.rates.data, v, out)
        out -= self.exit_rates * v
        return out

    def flow(self, v: Floats) -> Floats:
        """|Q| v."""
        out = np.empty(len(v))
        sparse.multiply(self.rates.indptr, self.rates.indices, self.rates.data, v, out)
        out += self.exit_rates * v
        return out


def _factors(rates: SparseMatrix, scale: Floats) -> Elimination | None:
    owner = np.repeat(np.arange(rates.states, dtype=np.int32), np.diff(rates.indptr))
    data = rates.data * scale[owner]
    data[rates.indices == owner] = 0.0
    leaves = 1.0 - sparse.row_sums(rates.indptr, data)
    if not leaves.min(initial=1.0) > 0.0:
        return None
    factors = Elimination(rates.indptr, rates.indices, data, leaves, OPERATIONS * rates.entries)
    return factors if factors.complete else None


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

    def extend(self, size: int, ease: float = 1.0) -> bool:
        """Up to so many vectors; False where the equations are not solved soon, or nothing new comes up."""
        while self.made < size:
            j = self.made
            found = self._inverse(self.basis[j], self.system.pole(j), ease)
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

    def _inverse(self, v: Floats, pole: float, ease: float) -> Floats | None:
        """(I - γ Q)^-1 v."""
        scale = 1.0 / (1.0 + pole * self.system.diagonal)
        right = v * scale
        if self.system.factors is not None:
            return self.system.factors.solve(right)
        assert self.system.split is not None
        scale *= pole
        split = replace(self.system.split, scale=scale, steps=0)
        goal = SOLVED * ease * float(np.max(np.abs(right)))
        for x, rest in split.solve(right):
            self.steps += 1
            if rest <= goal:
                return split.solve_upper(x)
            if split.steps > STEPS:
                break
        return None

    def projected(self, size: int) -> tuple[Floats, Floats, Floats]:
        """V (a row per vector), H (Q in the space, about) and b (the first vector's length along itself)."""
        inverse = np.linalg.inv(self.inverse[:size, :size])
        first = np.zeros(size)
        first[0] = self.length
        slow = 1.0 / np.array([self.system.pole(j) for j in range(size)])
        return (
            self.basis[:size],
            (self.inverse[:size, :size] - np.eye(size)) * slow @ inverse,
            first,
        )


@dataclass(frozen=True, eq=False)
class _Path:
    """p as polynomials: per interval its length and its values at the nodes, float64[nodes, size], the first node its start."""

    lengths: list[float]
    nodes: list[Floats]

    @property
    def end(self) -> Floats:
        """The last value."""
        return np.asarray(self.nodes[-1][-1])


def _path(matrix: Floats, first: Floats, time: float, greatest: Floats, tolerance: float) -> _Path:
    """P' = H p + b from 0, by collocation at Chebyshev's points, on intervals that grow with the time.

    Intervals are halved until what they leave, times `greatest`, is at most `tolerance`, or rounding.
    """
    size, slope = len(first), _differentiation()
    stages, modes = np.linalg.eig(slope[1:, 1:])
    back = np.linalg.inv(modes)
    norm = float(np.linalg.norm(matrix, 1))
    halvings = max(0, math.ceil(math.log2(max(1.0, time * norm)))) + 1
    ends = time * 0.5 ** np.arange(halvings, -1, -1.0)
    cuts = np.concatenate(([0.0], ends[:1], *(np.linspace(a, b, 3)[1:] for a, b in pairwise(ends))))
    path = _Path([], [])
    value = np.zeros(size)
    ahead = list(reversed(np.diff(cuts).tolist()))
    while ahead:
        length = ahead.pop()
        half = 0.5 * length
        # The equations at the nodes come apart along the eigenvectors of the slopes.
        right = back @ (half * first - np.outer(slope[1:, 0], value))
        parts = np.linalg.solve(
            stages[:, None, None] * np.eye(size) - half * matrix, right[:, :, None]
        )
        nodes = np.vstack((value, np.asarray((modes @ parts[:, :, 0]).real)))
        leaves = float(np.abs(slope[0] @ nodes / half - nodes[0] @ matrix.T - first) @ greatest)
        rounding = DEGREE**2 * ROUND * float(np.max(np.abs(nodes) @ greatest)) * (1.0 / half + norm)
        if (
            leaves * length > tolerance
            and leaves > rounding
            and len(path.lengths) + len(ahead) < INTERVALS
        ):
            ahead += [half, half]
            continue
        path.lengths.append(length)
        path.nodes.append(nodes)
        value = nodes[-1]
    return path


def _differentiation() -> Floats:
    """The slopes at Chebyshev's points, from -1 to 1, of a polynomial given by its values there (Trefethen 2000)."""
    k = np.arange(DEGREE + 1)
    x = -np.cos(np.pi * k / DEGREE)
    c = np.where((k == 0) | (k == DEGREE), 2.0, 1.0) * (-1.0) ** k
    difference = x[:, None] - x[None, :] + np.eye(DEGREE + 1)
    slope = np.outer(c, 1.0 / c) / difference
    return np.asarray(slope - np.diag(slope.sum(axis=1)))


def _defect(
    system: _System, basis: Floats, matrix: Floats, first: Floats, speed: Floats, path: _Path
) -> float:
    """An upper bound on the integral over time of the greatest entry of the defect, roundings counted in."""
    size = len(first)
    along, width, others, rounding = _rest(system, basis, matrix)
    greatest = _greatest(basis)
    norm = np.abs(matrix)
    constant = float(np.max(np.abs(first @ basis - speed)))
    slope, finer = _differentiation(), _samples()
    total = 0.0
    for length, nodes in zip(path.lengths, path.nodes, strict=True):
        derivative = slope @ nodes * (2.0 / length)
        leaves = np.abs(finer @ (derivative - nodes @ matrix.T - first))
        summed = (
            np.abs(slope) @ np.abs(nodes) * (2.0 / length) + np.abs(nodes) @ norm.T + np.abs(first)
        )
        leaves += (size + 4 * DEGREE) * ROUND * np.max(summed, axis=0)
        fine = np.abs(finer @ nodes)
        most = np.max(fine, axis=0) * (1.0 + 1e-9)
        moved = np.abs(finer @ (nodes @ along)) + (size + 4 * DEGREE) * ROUND * float(
            np.max(np.abs(nodes) @ np.abs(along))
        )
        sampled = (
            float(np.max(moved * width + fine @ others * (1.0 + 1e-9) + leaves @ greatest))
            + constant
        )
        total += length * LEBESGUE * (sampled + float(np.max(most @ rounding)))
    return total


def _samples() -> Floats:
    """Values at many points from -1 to 1 of a polynomial given by its values at Chebyshev's points."""
    nodes = np.pi * np.arange(DEGREE, -1, -1.0) / DEGREE
    angles = np.pi * np.arange(SAMPLES, -1, -1.0) / SAMPLES
    k = np.arange(DEGREE + 1.0)
    return np.asarray(
        np.linalg.solve(np.cos(np.outer(nodes, k)).T, np.cos(np.outer(angles, k)).T).T
    )


def _greatest(rows: Floats) -> Floats:
    """The greatest entry of each row, in absolute terms, without a copy of them all."""
    return np.array([max(float(row.max()), -float(row.min())) for row in rows])


def _rest(system: _System, basis: Floats, matrix: Floats) -> tuple[Floats, float, Floats, Floats]:
    """V H - Q V as one vector times coefficients, and what the solver left: (coefficients, greatest entry, others, roundings).

    others: greatest entries, per vector. roundings: bounds on theirs, per vector and state (one for all states where these are many).
    """
    size = len(basis)
    chunk = math.ceil(math.sqrt(size))  # sums of sums: fewer roundings in a row
    rest = np.empty_like(basis)
    for j in range(size):
        np.negative(system.generator(basis[j]), out=rest[j])
    for at in range(0, basis.shape[1], SLICE):
        part = slice(at, at + SLICE)
        rest[:, part] += sum(
            matrix[j : j + chunk].T @ basis[j : j + chunk, part] for j in range(0, size, chunk)
        )
    _, vectors = np.linalg.eigh(rest @ rest.T)
    along = vectors[:, -1]
    single = np.einsum("i,ij->j", along, rest)
    width = float(np.max(np.abs(single)))
    for weight, row in zip(along.tolist(), rest, strict=True):
        row -= weight * single
    others = _greatest(rest)
    norm, terms = np.abs(matrix).T, np.abs(along)
    inner, outer = (2 * chunk + 4) * ROUND, (system.longest + 6) * ROUND
    if system.factors is None:
        greatest = _greatest(basis)
        bound = inner * (norm @ greatest + terms * width) + outer * 2.0 * system.fastest * greatest
        return along, width, others, bound[:, None]
    rounding = inner * (norm @ np.abs(basis) + np.outer(terms, np.abs(single)))
    for j in range(size):
        rounding[j] += outer * system.flow(np.abs(basis[j]))
    return along, width, others, rounding
