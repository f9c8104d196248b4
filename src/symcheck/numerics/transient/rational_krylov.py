"""Transient values of stiff chains in a rational Krylov subspace, with a proved bound on the error.

x(t) solves x' = Q x + reward_rate from x(0) = start. The space V of (I - γ Q)^-1 and its powers,
applied to Q start + reward_rate, approximates slow and fast components alike, however large the
rates are. For any V, H and any function p(t) with p(0) = 0, the error of u = start + V p is at most
the integral of its defect (maximum norm):

    |x(t) - u(t)| <= integral of |V (p' - H p - b) + (V H - Q V) p + (V b - Q start - reward_rate)|,

since exp(Q t) does not enlarge the largest entry. p is a polynomial on each interval of time, so
that every term can be bounded.

Sources: Moret & Novati (2004); van den Eshof & Hochbruck (2006).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from symcheck.kernels.chains import ssor_eisenstat
from symcheck.kernels.chains.gth_elimination import GthElimination
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.numerics import tuning
from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix, relative_solution
from symcheck.numerics.linear.problem import Observer, Progress
from symcheck.numerics.settings import Settings
from symcheck.parallel.threads import on_threads, thread_count

__all__ = ["KrylovValues", "importance", "krylov_values", "largest_growth"]

Found = TypeVar("Found")


@dataclass(frozen=True, eq=False)
class KrylovValues:
    """Values at the end of the time, float64[n], with an absolute error of at most `error`.

    vectors: the dimension of the subspace. steps: BiCGStab steps in all.
    """

    values: Floats
    error: float
    vectors: int
    steps: int


def krylov_values(
    rates: SparseMatrix,
    exit_rates: Floats,
    start: Floats,
    reward_rate: Floats | None,
    time: float,
    interest: Int64s,
    settings: Settings,
    observer: Observer | None = None,
    poles: tuple[float, ...] = tuning.POLES,
) -> KrylovValues | None:
    """Solve x' = Q x + reward_rate, x(0) = start, as accurately as requested at `interest`.

    Memory: two vectors per vector of the subspace.

    Args:
        rates, exit_rates: as in `transient_values`, but rows may sum to a little more than their
            exit rates (if values were divided by weights).
        start, reward_rate: float64[n].
        time: the horizon.
        interest: at least one state.
        settings: the accuracy.
        observer: receives the progress.
        poles: γ is the time divided by these numbers, in turn.

    Returns:
        None if the subspace does not converge.
    """
    system = _System.of(
        rates, exit_rates, tuple(time / p for p in poles), time / tuning.ELIMINATION_POLE
    )
    speed = system.generator(start) + (0.0 if reward_rate is None else reward_rate)
    rounding_error = (system.longest + 6) * tuning.UNIT_ROUNDOFF * 2.0 * system.fastest * time
    # Rounding of `speed` acts all the time; rows of Q may sum to a little more than 0.
    fixed = rounding_error * float(
        np.max(np.abs(start))
    ) + 4.0 * tuning.UNIT_ROUNDOFF * time * float(np.max(np.abs(speed)))
    growth = largest_growth(rates, exit_rates, time, rounding_error)
    if math.isinf(growth):
        return None
    space = _Space.of(system, speed, max(tuning.SUBSPACE_SIZES + tuning.LARGER_SUBSPACE_SIZES))
    widths: list[float] = []
    goal = math.inf
    larger = () if system.factors is None else tuning.LARGER_SUBSPACE_SIZES
    sizes = (*tuning.SUBSPACE_SIZES, *larger)
    for size in sizes:
        if not space.extend(size):
            return None
        try:
            matrix, first = space.projected(size)
            greatest = np.array(space.greatest[:size])
            path = _path(
                matrix, first, time, greatest, 3e-3 * goal / (growth * tuning.SAMPLING_FACTOR)
            )
            defect = _defect(space, matrix, first, speed, path)
        except (np.linalg.LinAlgError, OverflowError):  # singular, or not finite
            return None
        values = start + _combination(path.end, space.basis[:size])
        error = (defect + fixed) * growth * (1.0 + 1e-6)
        error += 1e-13 * float(np.max(np.abs(values)))
        least = float(values[interest].min())
        widths.append(2.0 * error)
        if observer is not None:
            observer(Progress("rational krylov", space.steps, widths[-1], len(start)))
        goal = settings.epsilon * (least if settings.relative else 1.0)
        if widths[-1] <= goal:
            return KrylovValues(values, error, size, space.steps)
        if (
            not least > 0.0
            or float(values.max()) > tuning.MAX_VALUE_RANGE * least
            or not _converges(widths, goal, sizes)
        ):
            return None
    return None


def importance(
    rates: SparseMatrix, exit_rates: Floats, reward_rate: Floats, time: float, guess: Floats
) -> Floats | None:
    """The weights (a/T - Q)^-1 reward_rate, relative to which values differ less, or None.

    Divided by them, rows of Q sum to at most about a/T, so exp(Q t) enlarges the largest entry by
    at most exp(a). guess: the weights to within some orders of magnitude, positive.
    """
    rest = tuning.IMPORTANCE_SHIFT / time
    scale = 1.0 / (exit_rates + rest)
    if rates.states <= tuning.KRYLOV_ELIMINATION_STATES:
        data = rates.data * np.repeat(scale, rates.lengths)
        leaves = np.maximum(exit_rates - rates.row_sums(), 0.0) + rest
        factors = GthElimination(
            rates.indptr,
            rates.indices,
            data,
            leaves * scale,
            tuning.WEIGHT_ELIMINATION_OPERATIONS * rates.entries,
        )
        solution = factors.solve(reward_rate * scale) if factors.complete else None
        if solution is not None:
            return solution if bool(np.all(solution > 0.0)) else None
    scale = 1.0 / (exit_rates + rest - ssor_eisenstat.diagonal(*rates.arrays))
    return relative_solution(rates, scale, reward_rate, guess, tuning.IMPORTANCE_RESIDUAL)


def largest_growth(
    rates: SparseMatrix, exit_rates: Floats, time: float, rounding_error: float = 0.0
) -> float:
    """A bound on the factor by which exp(Q t) enlarges the largest entry; may be infinite.

    It follows from the largest excess of the sum of a row over its exit rate.
    """
    excess = max(0.0, float(np.max(rates.row_sums() - exit_rates)))
    with np.errstate(over="ignore"):
        return float(np.exp(rounding_error + excess * time))


def _converges(widths: list[float], goal: float, sizes: tuple[int, ...]) -> bool:
    """Whether the largest subspace will suffice, extrapolated from the widths so far."""
    if not np.isfinite(widths[-1]):
        return False
    made = len(widths) - 1
    if made < tuning.SIZES_BEFORE_JUDGEMENT:
        return True
    # The better rate of the whole sequence and of its last step.
    rate = min((widths[-1] / widths[i]) ** (1.0 / (sizes[made] - sizes[i])) for i in (1, made - 1))
    return bool(widths[-1] * rate ** (sizes[-1] - sizes[made]) <= goal)


@dataclass(frozen=True, eq=False)
class _System:
    """Q, and I - γ Q with rows divided by their diagonal, factorised or split for BiCGStab."""

    rates: SparseMatrix
    exit_rates: Floats
    poles: tuple[float, ...]
    fastest: float
    longest: int
    factors: GthElimination | None
    diagonal: Floats
    split: SplitMatrix | None

    @staticmethod
    def of(
        rates: SparseMatrix, exit_rates: Floats, poles: tuple[float, ...], single: float
    ) -> _System:
        diagonal = exit_rates - ssor_eisenstat.diagonal(*rates.arrays)
        factors = (
            _factors(rates, single / (1.0 + single * diagonal))
            if rates.states <= tuning.KRYLOV_ELIMINATION_STATES
            else None
        )
        split = None if factors is not None else SplitMatrix.of(rates, diagonal)
        longest = rates.longest
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
        return np.asarray(self.rates.multiply(v) - self.exit_rates * v)


def _factors(rates: SparseMatrix, scale: Floats) -> GthElimination | None:
    owner = rates.row_of_entry
    data = rates.data * scale[owner]
    data[rates.indices == owner] = 0.0
    leaves = 1.0 - sparse.row_sums(rates.indptr, data)
    if not leaves.min(initial=1.0) > 0.0:
        return None
    factors = GthElimination(
        rates.indptr,
        rates.indices,
        data,
        leaves,
        tuning.KRYLOV_ELIMINATION_OPERATIONS * rates.entries,
    )
    return factors if factors.complete else None


@dataclass(eq=False)
class _Space:
    """An orthonormal basis of the subspace, and (I - γ Q)^-1 in that basis.

    images: Q v for each vector v of the basis but the last. greatest: its largest absolute entry.
    """

    system: _System
    inverse: Floats
    length: float
    basis: list[Floats] = field(default_factory=list)
    images: list[Floats] = field(default_factory=list)
    greatest: list[float] = field(default_factory=list)
    steps: int = 0

    @staticmethod
    def of(system: _System, first: Floats, most: int) -> _Space:
        length = math.sqrt(_dot(first, first))
        space = _Space(system, np.zeros((most + 1, most)), length)
        space._append(first / length if length else np.zeros_like(first))
        return space

    def _append(self, vector: Floats) -> None:
        """Make a vector the next of the basis."""
        self.basis.append(vector)
        self.greatest.append(_largest(vector))

    def extend(self, size: int) -> bool:
        """Extend the basis to `size` vectors; False if BiCGStab or the orthogonalisation fails."""
        for j in range(len(self.images), size):
            vector = self._inverse(self.basis[j], self.system.pole(j))
            if vector is None:
                return False
            self.images.append(self.system.generator(self.basis[j]))
            for _ in range(2):  # twice is enough, once is not
                part = _project(self.basis, vector)
                self.inverse[: j + 1, j] += part
                vector -= _combination(part, self.basis)
            length = math.sqrt(_dot(vector, vector))
            if not length > 0.0:
                return False
            self.inverse[j + 1, j] = length
            vector /= length
            self._append(vector)
        return True

    def _inverse(self, v: Floats, pole: float) -> Floats | None:
        """(I - γ Q)^-1 v."""
        scale = pole * self.system.diagonal  # in place: new memory takes longer than arithmetic
        scale += 1.0
        np.divide(1.0, scale, out=scale)
        right = v * scale
        if self.system.factors is not None:
            return self.system.factors.solve(right)
        assert self.system.split is not None
        scale *= pole
        split = replace(self.system.split, scale=scale, steps=0)
        goal = tuning.VECTOR_RESIDUAL * _largest(right)
        for x, rest in split.solve(right):
            self.steps += 1
            if rest <= goal:
                return split.solve_upper(x)
            if split.steps > tuning.KRYLOV_BICGSTAB_STEPS:
                break
        return None

    def projected(self, size: int) -> tuple[Floats, Floats]:
        """H (an approximation of Q in the basis) and b (the initial direction)."""
        inverse = np.linalg.inv(self.inverse[:size, :size])
        first = np.zeros(size)
        first[0] = self.length
        slow = 1.0 / np.array([self.system.pole(j) for j in range(size)])
        return (
            (self.inverse[:size, :size] - np.eye(size)) * slow @ inverse,
            first,
        )


def _on_slices(n: int, work: Callable[[slice], Found]) -> list[Found]:
    """What a function returns for slices of n states, in order, on threads."""
    size, found = tuning.KRYLOV_SLICE_STATES, dict[int, Found]()

    def share(first: int, end: int) -> None:
        for i in range(first, end):
            found[i] = work(slice(i * size, (i + 1) * size))

    count = -(-n // size)
    threads = min(thread_count(), -(-n // tuning.TWO_THREADS_STATES))
    on_threads(share, [count * i // threads for i in range(threads + 1)])
    return [found[i] for i in range(count)]


def _largest(x: Floats) -> float:
    """The largest absolute entry."""
    return max(float(x.max()), -float(x.min()))


def _dot(x: Floats, y: Floats) -> float:
    """The inner product."""
    return sum(_on_slices(len(x), lambda part: float(np.einsum("i,i->", x[part], y[part]))))


def _rows(vectors: list[Floats], part: slice) -> Floats:
    """A part of each vector, as a row."""
    return np.array([vector[part] for vector in vectors])


def _project(basis: list[Floats], vector: Floats) -> Floats:
    """The inner products of the vectors of a basis and a vector."""

    def work(part: slice) -> Floats:
        return np.array([np.einsum("i,i->", each[part], vector[part]) for each in basis])

    return np.asarray(np.sum(_on_slices(len(vector), work), axis=0))


def _combination(weights: Floats, basis: list[Floats]) -> Floats:
    """The sum of the vectors of a basis with these weights."""
    out = np.empty_like(basis[0])

    def work(part: slice) -> None:
        out[part] = np.einsum("i,ij->j", weights, _rows(basis[: len(weights)], part))

    _on_slices(len(out), work)
    return out


@dataclass(frozen=True, eq=False)
class _Path:
    """p as polynomials: the length of each interval, and the values at its nodes, float64[nodes,
    size].
    """

    lengths: list[float]
    nodes: list[Floats]

    @property
    def end(self) -> Floats:
        """The last value."""
        return np.asarray(self.nodes[-1][-1])


def _path(matrix: Floats, first: Floats, time: float, greatest: Floats, tolerance: float) -> _Path:
    """P' = H p + b from 0, by collocation at Chebyshev points, on intervals that grow with the
    time.

    Intervals are halved until the defect, weighted by `greatest`, is at most `tolerance` or due to
    rounding.
    """
    size, (slope, _) = len(first), _chebyshev()
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
        # The eigenvectors of the differentiation matrix decouple the equations at the nodes.
        right = back @ (half * first - np.outer(slope[1:, 0], value))
        parts = np.linalg.solve(
            stages[:, None, None] * np.eye(size) - half * matrix, right[:, :, None]
        )
        nodes = np.vstack((value, np.asarray((modes @ parts[:, :, 0]).real)))
        leaves = float(np.abs(slope[0] @ nodes / half - nodes[0] @ matrix.T - first) @ greatest)
        rounding = (
            tuning.COLLOCATION_DEGREE**2
            * tuning.UNIT_ROUNDOFF
            * float(np.max(np.abs(nodes) @ greatest))
            * (1.0 / half + norm)
        )
        if (
            leaves * length > tolerance
            and leaves > rounding
            and len(path.lengths) + len(ahead) < tuning.COLLOCATION_INTERVALS
        ):
            ahead += [half, half]
            continue
        path.lengths.append(length)
        path.nodes.append(nodes)
        value = nodes[-1]
    return path


def _chebyshev() -> tuple[Floats, Floats]:
    """Matrices for a polynomial that is given at the Chebyshev points of [-1, 1].

    Returns:
        Its derivative at these points, and its values at `tuning.SAMPLES` + 1 points.
    """
    from numpy.polynomial.chebyshev import chebder, chebpts2, chebvander

    degree = tuning.COLLOCATION_DEGREE
    nodes = chebpts2(degree + 1)
    coefficients = np.linalg.inv(chebvander(nodes, degree))
    return (
        np.asarray(chebvander(nodes, degree - 1) @ chebder(coefficients)),
        np.asarray(chebvander(chebpts2(tuning.SAMPLES + 1), degree) @ coefficients),
    )


def _defect(space: _Space, matrix: Floats, first: Floats, speed: Floats, path: _Path) -> float:
    """An upper bound on the integral of the maximum norm of the defect, rounding included."""
    size = len(first)
    along, width, others, rounding = _projection_residual(space, matrix)
    basis, greatest = space.basis[:size], np.array(space.greatest[:size])
    norm = np.abs(matrix)

    def start_defect(part: slice) -> float:
        return float(np.max(np.abs(first @ _rows(basis, part) - speed[part])))

    constant = max(_on_slices(len(speed), start_defect))
    slope, finer = _chebyshev()
    total = 0.0
    for length, nodes in zip(path.lengths, path.nodes, strict=True):
        derivative = slope @ nodes * (2.0 / length)
        leaves = np.abs(finer @ (derivative - nodes @ matrix.T - first))
        summed = (
            np.abs(slope) @ np.abs(nodes) * (2.0 / length) + np.abs(nodes) @ norm.T + np.abs(first)
        )
        leaves += (
            (size + 4 * tuning.COLLOCATION_DEGREE) * tuning.UNIT_ROUNDOFF * np.max(summed, axis=0)
        )
        fine = np.abs(finer @ nodes)
        most = np.max(fine, axis=0) * (1.0 + 1e-9)
        moved = np.abs(finer @ (nodes @ along)) + (
            size + 4 * tuning.COLLOCATION_DEGREE
        ) * tuning.UNIT_ROUNDOFF * float(np.max(np.abs(nodes) @ np.abs(along)))
        sampled = (
            float(np.max(moved * width + fine @ others * (1.0 + 1e-9) + leaves @ greatest))
            + constant
        )
        total += length * tuning.SAMPLING_FACTOR * (sampled + float(most @ rounding))
    return total


def _projection_residual(space: _Space, matrix: Floats) -> tuple[Floats, float, Floats, Floats]:
    """The residual V H - Q V as one vector times coefficients, plus a remainder.

    Returns:
        The coefficients; the largest entry of the vector; the largest entry of the remainder per
        vector of the basis; and a bound on rounding errors per vector.
    """
    size = len(matrix)
    basis, images = space.basis[:size], space.images[:size]
    greatest = np.array(space.greatest[:size])
    chunk = math.ceil(math.sqrt(size))  # sums of sums accumulate fewer rounding errors

    def residual(part: slice) -> Floats:
        rows, rest = _rows(basis, part), -_rows(images, part)
        rest += sum(matrix[j : j + chunk].T @ rows[j : j + chunk] for j in range(0, size, chunk))
        return rest

    def gram(part: slice) -> Floats:
        rest = residual(part)
        return rest @ rest.T

    n = len(basis[0])
    _, vectors = np.linalg.eigh(np.sum(_on_slices(n, gram), axis=0))
    along = vectors[:, -1]

    def sizes(part: slice) -> tuple[float, Floats]:
        rest = residual(part)
        single = np.einsum("i,ij->j", along, rest)
        rest -= np.outer(along, single)
        return float(np.max(np.abs(single))), np.max(np.abs(rest), axis=1)

    found = _on_slices(n, sizes)
    width, others = max(width for width, _ in found), np.max([most for _, most in found], axis=0)
    # Bounds on the rounding errors of the sums above, the same for all states.
    inner = (2 * chunk + 4) * tuning.UNIT_ROUNDOFF
    outer = (space.system.longest + 6) * tuning.UNIT_ROUNDOFF * 2.0 * space.system.fastest
    rounding = inner * (np.abs(matrix).T @ greatest + np.abs(along) * width) + outer * greatest
    return along, width, others, rounding
