"""Transient values of stiff chains in a rational Krylov subspace, with a proved bound on the error.

x(t) solves x' = Q x + reward_rate from x(0) = start. The first vector of the orthonormal basis V is
Q start + reward_rate divided by its norm β; v_(j+1) is orthogonalised from (I - Q/ξ_j)^-1 v_j,
where ξ_j > 0 is a pole, the same for all vectors or one of several in turn. Such a space
approximates slow and fast components equally well, however large the rates are.

Let V s_j approximate (I - Q/ξ_j)^-1 v_j with the residual f_j = ξ_j (V s_j - v_j) - Q V s_j. With
the unit vectors e_j, S has the columns s_j, F the columns f_j, A the columns ξ_j (s_j - e_j), and b
= β e_1. Then the defect of u = start + V S g is

    u' - Q u - reward_rate = V (S g' - A g - b) + F g

for any function g(t) with g(0) = 0, which is chosen so that S g' is about A g + b. With m vectors,
s_m has a component in v_(m+1): S is cut to m rows, and that component goes into f_m. The error of u
is at most the integral of the maximum norm of the defect if exp(Q t) is a contraction in this norm,
and otherwise at most that times a bound on the norm of exp(Q t). g is a polynomial on each interval
of time, so that every term can be bounded.

The coefficients g of later vectors are typically small, so that looser residuals suffice, which
take fewer steps of BiCGStab.

Sources: Moret & Novati (2004); van den Eshof & Hochbruck (2006); for several poles, Güttel (2013);
for inexact solutions, Simoncini & Szyld (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
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

    Memory: a vector per vector of the subspace, and those of BiCGStab.

    Args:
        rates: the rates among the n states; rows may sum to a little more than their exit rates (if
            values were divided by weights).
        exit_rates: the exit rate of each state, float64[n].
        start: the values at time 0, float64[n].
        reward_rate: rewards per unit of time, float64[n]; None: no rewards.
        time: the horizon.
        interest: at least one state.
        settings: the accuracy.
        observer: receives the progress.
        poles: those of the rational functions of Q, times `time`; used in turn.

    Returns:
        The values, which are less accurate than requested where rounding, or the sizes of the
        subspace, do not allow for more; None if the subspace does not converge.
    """
    system = _System.of(
        rates, exit_rates, tuple(p / time for p in poles), tuning.ELIMINATION_POLE / time
    )
    speed = system.generator(start) + (0.0 if reward_rate is None else reward_rate)
    rounding_error = (system.longest + 6) * tuning.UNIT_ROUNDOFF * 2.0 * system.fastest * time
    # A rounded entry of Q v has at most longest + 6 roundings of 2 fastest |v|: products, sums, the
    # exit rate as a sum, and the difference. So rounded rows of Q may sum to more than 0, and
    # `speed`, which acts all the time, has this error and a few roundings more.
    greatest = float(np.max(np.abs(start)))
    fixed = rounding_error * greatest + 6.0 * tuning.UNIT_ROUNDOFF * time * float(
        np.max(np.abs(speed))
    )
    growth = _exponential(rounding_error + system.excess * time)
    if math.isinf(growth):
        return None
    space = _Space.of(system, speed, max(tuning.SUBSPACE_SIZES + tuning.LARGER_SUBSPACE_SIZES))
    history: list[tuple[int, float]] = []
    goal, allowed = math.inf, 0.0
    larger = () if system.factors is None else tuning.LARGER_SUBSPACE_SIZES
    sizes = (*tuning.SUBSPACE_SIZES, *larger)
    best: KrylovValues | None = None
    for size in sizes:
        if not space.extend(size, allowed):
            return best
        try:
            projection = space.projection(size)
            path = _path(projection, time, 3e-3 * goal / (growth * tuning.SAMPLING_FACTOR))
        except (np.linalg.LinAlgError, OverflowError):  # singular, or not finite
            return best
        end, rounded = projection.at_end(path)
        error = (_defect(projection, path) + rounded + fixed) * growth * (1.0 + 1e-6)
        # The sum with the start is rounded too.
        error += 4.0 * tuning.UNIT_ROUNDOFF * (greatest + float(np.abs(end) @ projection.greatest))
        at_interest = [vector[interest] for vector in space.basis]
        least = float((start[interest] + _combination(end, at_interest)).min())
        width = 2.0 * error
        if observer is not None:
            observer(Progress("rational krylov", space.steps, width, len(start)))
        if not math.isfinite(width) or (
            history and width > tuning.SPURIOUS_GROWTH * history[-1][1]
        ):
            continue  # probably a Ritz value in the right half-plane; most projections have none
        history.append((size, width))
        goal = settings.epsilon * (least if settings.relative else 1.0)
        if width <= goal or width <= tuning.MISSED_WIDTH * least or len(history) == 1:
            values = start + _combination(end, space.basis)
            found = KrylovValues(values, error, size, space.steps)
            if width <= goal:
                return found
            if float(values.max()) > tuning.MAX_VALUE_RANGE * least:
                return best
            if width <= tuning.MISSED_WIDTH * least:
                stalls = size in larger and best is not None and error > tuning.STALLED * best.error
                best = found if best is None or error < best.error else best
                if stalls:
                    return best  # rounding
        if not (least > 0.0 and _converges(history, goal, sizes[-1])):
            return best
        if width < least:  # otherwise the goal is a guess
            weight = time * growth * float(np.max(np.abs(path.nodes[:, -1])))
            allowed = tuning.VECTOR_SHARE * goal / weight if weight > 0.0 else 0.0
    return best


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


def largest_growth(rates: SparseMatrix, exit_rates: Floats, time: float) -> float:
    """A bound on the factor by which exp(Q t) enlarges the largest entry; may be infinite.

    It follows from the largest excess of the sum of a row over its exit rate.
    """
    return _exponential(_excess(rates, exit_rates) * time)


def _exponential(x: float) -> float:
    with np.errstate(over="ignore"):
        return float(np.exp(x))


def _excess(rates: SparseMatrix, exit_rates: Floats) -> float:
    """The largest excess of the sum of a row over its exit rate; at least 0."""
    return float(np.max(rates.row_sums() - exit_rates, initial=0.0))


def _converges(history: list[tuple[int, float]], goal: float, largest: int) -> bool:
    """Whether the largest subspace will suffice, extrapolated from the widths so far.

    history: sizes and widths.
    """
    size, width = history[-1]
    if size < tuning.VECTORS_BEFORE_JUDGEMENT or len(history) == 1:
        return True
    # The better rate of the whole sequence and of the last vectors.
    recent = [pair for pair in history if pair[0] <= size - tuning.RECENT_VECTORS][-1:]
    rate = min((width / w) ** (1.0 / (size - m)) for m, w in (history[0], *recent))
    return bool(width * rate ** (largest - size) <= goal)


@dataclass(frozen=True, eq=False)
class _System:
    """Q, and I - Q/ξ with rows divided by their diagonal, factorised or split for BiCGStab.

    excess: by how much rows of rates may exceed their exit rates.
    """

    rates: SparseMatrix
    exit_rates: Floats
    poles: tuple[float, ...]
    fastest: float
    excess: float
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
            _factors(rates, 1.0 / (single + diagonal))
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
            _excess(rates, exit_rates),
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

    def enlargement(self, j: int) -> float:
        """A bound on the factor by which ξ - Q enlarges the largest entry, for vector j."""
        return self.pole(j) + 2.0 * self.fastest + self.excess

    def residual(self, x: Floats, j: int, v: Floats | None = None) -> float:
        """A bound on the largest entry of ξ (x - v) - Q x, for vector j, rounding included.

        v: None for zeros.
        """
        product, exit_rates, pole = self.rates.multiply(x), self.exit_rates, self.pole(j)

        def largest(part: slice) -> float:
            change = x[part] if v is None else x[part] - v[part]
            return _largest(product[part] - exit_rates[part] * x[part] - change * pole)

        rounding = (self.longest + 6) * self.enlargement(j) * _largest(x)
        rounding += 0.0 if v is None else 4.0 * _largest(v) * pole
        rounding *= tuning.UNIT_ROUNDOFF
        return (float(np.max(_on_slices(len(x), largest))) + rounding) * (1.0 + 1e-9)


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


@dataclass(frozen=True, eq=False)
class _Projection:
    """The equation that the coefficients g of u = start + V S g obey, but for the residuals.

    u' - Q u - reward_rate = V (S g' - A g - b) + F g, where F has the columns of residuals.

    solutions, images: S and A, float64[m, m]. first: b, float64[m]. greatest, residuals: the
    largest absolute entry of each vector of V, and a bound on it for each column of F, float64[m].
    """

    solutions: Floats
    images: Floats
    first: Floats
    greatest: Floats
    residuals: Floats

    def at_end(self, path: _Path) -> tuple[Floats, float]:
        """The weights S g of the basis at the end, and a bound on the rounding of V S g."""
        last = path.nodes[-1]
        terms = float(np.abs(self.solutions) @ np.abs(last) @ self.greatest)
        return self.solutions @ last, (2 * len(last) + 8) * tuning.UNIT_ROUNDOFF * terms


@dataclass(eq=False)
class _Space:
    """An orthonormal basis of the subspace, and the solutions for it in that basis.

    solutions: float64[m+1, m]; (I - Q/ξ) x = v has the solution x = V s for vector v of the basis,
    where s is its column. residuals: a bound on the largest entry of ξ (x - v) - Q x. greatest:
    the largest absolute entry of each vector of the basis. amplification: the residual of the last
    solution, divided by what BiCGStab takes for it. steps: BiCGStab steps made.
    """

    system: _System
    solutions: Floats
    length: float
    basis: list[Floats] = field(default_factory=list)
    residuals: list[float] = field(default_factory=list)
    greatest: list[float] = field(default_factory=list)
    amplification: float = math.inf
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

    def extend(self, size: int, allowed: float) -> bool:
        """Extend the basis to `size` vectors; False if BiCGStab or the orthogonalisation fails.

        allowed: a residual that is small enough; 0 if none is known.
        """
        for j in range(len(self.residuals), size):
            solved = self._solve(j, allowed)
            if solved is None:
                return False
            vector, residual = solved
            largest = _largest(vector)
            first, second = _orthogonalise(vector, self.basis)
            length = math.sqrt(_dot(vector, vector))
            if not length > 0.0:
                return False
            self.solutions[: j + 1, j] = first + second
            self.solutions[j + 1, j] = length
            vector /= length
            self._append(vector)
            summed = float((np.abs(first) + np.abs(second)) @ self.greatest[:-1])
            summed += largest + length * self.greatest[-1]
            rounding = (j + 8) * tuning.UNIT_ROUNDOFF * summed
            self.residuals.append(residual + self.system.enlargement(j) * rounding)
        return True

    def _solve(self, j: int, allowed: float) -> tuple[Floats, float] | None:
        """(I - Q/ξ)^-1 v for a vector of the basis, and a bound on its residual."""
        v, pole = self.basis[j], self.system.pole(j)
        scale = self.system.diagonal / pole  # in place: new memory takes longer than arithmetic
        scale += 1.0
        np.divide(1.0, scale, out=scale)
        right = v * scale
        if self.system.factors is not None:
            solution = self.system.factors.solve(right)
            return solution, self.system.residual(solution, j, v)
        assert self.system.split is not None
        scale /= pole
        split = replace(self.system.split, scale=scale, steps=0)
        goal = tuning.VECTOR_RESIDUAL * _largest(right)
        for x, rest in split.solve(right):
            self.steps += 1
            if rest <= goal or rest * self.amplification <= allowed:
                solution = split.solve_upper(x)
                residual = self.system.residual(solution, j, v)
                if rest > 0.0:
                    self.amplification = residual / rest
                if rest <= goal or residual <= allowed:
                    return solution, residual
            if split.steps > tuning.KRYLOV_BICGSTAB_STEPS:
                break
        return None

    def projection(self, size: int) -> _Projection:
        """The equation for the coefficients of the first vectors."""
        solutions = self.solutions[:size, :size]
        poles = np.array([self.system.pole(j) for j in range(size)])
        first = np.zeros(size)
        first[0] = self.length
        # The solution of the last vector has a part in the next one, v. Without it, x - s v
        # remains, and the residual changes by s (ξ v - Q v).
        outside = self.system.residual(self.basis[size], size - 1)
        missing = self.residuals[size - 1] + self.solutions[size, size - 1] * outside
        return _Projection(
            solutions,
            (solutions - np.eye(size)) * poles,
            first,
            np.array(self.greatest[:size]),
            np.array([*self.residuals[: size - 1], missing]),
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


def _orthogonalise(vector: Floats, basis: list[Floats]) -> tuple[Floats, Floats]:
    """Subtract from a vector its part in a subspace, twice, since once is not enough.

    Returns:
        The weights of the basis in what was subtracted first, and then.
    """

    def project(part: slice) -> Floats:
        return np.asarray(np.einsum("ij,j->i", _rows(basis, part), vector[part]))

    def subtract(weights: Floats, part: slice) -> Floats:
        rows = _rows(basis, part)
        vector[part] -= np.einsum("i,ij->j", weights, rows)
        return np.asarray(np.einsum("ij,j->i", rows, vector[part]))

    first = np.sum(_on_slices(len(vector), project), axis=0)
    second = np.sum(_on_slices(len(vector), partial(subtract, first)), axis=0)
    _on_slices(len(vector), partial(subtract, second))
    return first, second


def _combination(weights: Floats, basis: list[Floats]) -> Floats:
    """The sum of the vectors of a basis with these weights."""
    out = np.empty_like(basis[0])

    def work(part: slice) -> None:
        out[part] = np.einsum("i,ij->j", weights, _rows(basis[: len(weights)], part))

    _on_slices(len(out), work)
    return out


@dataclass(frozen=True, eq=False)
class _Path:
    """g as polynomials: the length of each interval, and the values at its nodes, of which
    neighbours share one: float64[intervals * degree + 1, m].
    """

    lengths: list[float]
    nodes: Floats


def _path(projection: _Projection, time: float, tolerance: float) -> _Path:
    """S g' = A g + b from 0, by collocation at Chebyshev points, on intervals that grow with the
    time.

    Intervals are halved until the defect, weighted by `greatest`, is at most `tolerance` or due to
    rounding.
    """
    first, greatest = projection.first, projection.greatest
    inverse = np.linalg.inv(projection.solutions)
    matrix = projection.images @ inverse  # p' = H p + b for p = S g
    size, (slope, _) = len(first), _chebyshev()
    stages, modes = np.linalg.eig(slope[1:, 1:])
    back = np.linalg.inv(modes)
    norm = float(np.linalg.norm(matrix, 1))
    halvings = max(0, math.ceil(math.log2(max(1.0, time * norm)))) + 1
    ends = time * 0.5 ** np.arange(halvings, -1, -1.0)
    cuts = np.concatenate(([0.0], ends[:1], *(np.linspace(a, b, 3)[1:] for a, b in pairwise(ends))))
    lengths, values = list[float](), [np.zeros((1, size))]
    ahead = list(reversed(np.diff(cuts).tolist()))
    while ahead:
        length = ahead.pop()
        half = 0.5 * length
        value = values[-1][-1]
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
            and len(lengths) + len(ahead) < tuning.COLLOCATION_INTERVALS
        ):
            ahead += [half, half]
            continue
        lengths.append(length)
        values.append(nodes[1:])
    return _Path(lengths, np.vstack(values) @ inverse.T)


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


def _defect(projection: _Projection, path: _Path) -> float:
    """An upper bound on the integral of the maximum norm of the defect, rounding included."""
    solutions, images, first = projection.solutions, projection.images, projection.first
    degree = tuning.COLLOCATION_DEGREE
    slope, finer = _chebyshev()
    total = 0.0
    for i, length in enumerate(path.lengths):
        nodes = path.nodes[i * degree : (i + 1) * degree + 1]
        sizes = np.abs(nodes)
        derivative = slope @ nodes * (2.0 / length)
        leaves = np.abs(finer @ (derivative @ solutions.T - nodes @ images.T - first))
        summed = np.abs(slope) @ sizes * (2.0 / length) @ np.abs(solutions).T
        summed += sizes @ np.abs(images).T + np.abs(first)
        # With m vectors and degree 10, an entry at a node has at most m + 19 roundings and an error
        # of `slope` of 20 u; a sample has 11 roundings more. It is at most 2.42 times as large as
        # the nodes (the Lebesgue constant), and `finer` has errors of 21 u: 2.42 m + 142 in all.
        rounding = (3 * len(first) + 14 * degree) * tuning.UNIT_ROUNDOFF
        leaves += rounding * np.max(summed, axis=0)
        moved = np.abs(finer @ nodes) + rounding * np.max(sizes, axis=0)
        sampled = float(np.max(moved @ projection.residuals + leaves @ projection.greatest))
        total += length * tuning.SAMPLING_FACTOR * sampled * (1.0 + 1e-9)
    return total
