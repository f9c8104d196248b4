"""Problems x = opt(best expectation of x + b) over intervals of probabilities.

A player chooses a row in each state, and then nature a distribution of the row, to minimise or
maximise as well. Both need no memory, so that strategy iteration over the rationals ends with the
value; in doubles, bounds are iterated.

Sources: Givan, Leach & Dean (2000); Nilim & El Ghaoui (2005); Hoffman & Karp (1966).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NeedsRationalsError
from symcheck.kernels.solve.intervals import Iteration
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.interval_rows import IntervalRows
from symcheck.matrices.numbers import Numbers, doubles, full, is_rational, numbers
from symcheck.matrices.rows import Int64s, SparseMatrix, first_best
from symcheck.numerics import graph
from symcheck.numerics.linear.mec_quotient import MecQuotient, collapse
from symcheck.numerics.linear.problem import LinearProblem, Observer, Progress, Solution
from symcheck.numerics.settings import Settings
from symcheck.tables import counted

__all__ = ["IntervalProblem", "require_signs", "solve_intervals"]

_WORK = 1 << 20
"""Updates of states between two reports to the observer."""
_FINER = 64.0
"""Each component aims at a width that is smaller by this factor, as widths add up."""
_ROUNDS = 5
_QUICK = 500
"""Sweeps of a component before its values count as slow."""
_POLICIES = 50
_SOLVED_STATES = 50_000
"""The most states whose policies are evaluated by a direct method, which takes much memory."""
_PATIENCE = 2000
"""Steps of BiCGStab within which the residual must fall by a factor of ten."""
_CORRECTION = 1e-6
"""What a correction by BiCGStab has to leave of the residual."""
_ACCURATE = 1e-12
"""The residual of a solution, relative to its greatest value, that suffices as a candidate."""
_GAIN = 1e-14
"""The relative gain of a policy that is more than rounding."""


@dataclass(frozen=True, eq=False)
class IntervalProblem:
    """x_s = opt over the rows r of s of (constant[r] + best expectation of x by r).

    Attributes:
        rows: their first columns are the n unknown states, whose groups are the choices.
        known: the values of the other columns.
        constant: per row.
        direction: the player minimises or maximises over the rows.
        probability: whether the solution consists of probabilities; else of expected rewards.
        constant_error: the relative error of constants.
    """

    rows: IntervalRows
    known: Numbers
    constant: Numbers
    direction: Direction
    probability: bool
    constant_error: float = 0.0

    @property
    def n(self) -> int:
        """Number of unknown states."""
        return self.rows.lower.states

    def against(self, matrix: SparseMatrix) -> LinearProblem:
        """The problem in which nature has chosen `matrix` (with all columns)."""
        outside = np.arange(matrix.columns) >= self.n
        index = np.where(outside, -1, np.arange(matrix.columns)).astype(np.int32)
        inner = matrix.select(np.arange(matrix.rows), index, self.n, matrix.groups)
        values = np.concatenate([full(self.n, 0, rational=matrix.is_rational), self.known])
        flat, everywhere = replace(matrix, groups=None), np.ones(matrix.rows, np.bool_)
        return LinearProblem(
            self.constant + flat.sums(everywhere, outside, values),
            inner,
            None,
            flat.sums(everywhere, outside),
            self.direction,
            self.probability,
        )


def solve_intervals(
    problem: IntervalProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """Solve a problem over intervals, by strategy iteration over the rationals or by bounds.

    Args:
        problem: the equations; all lower ends are positive, so that nature cannot change the graph.
        settings: accuracy and limits.
        observer: receives the progress.

    Raises:
        UnsupportedError: a reward is negative, in doubles.
    """
    if problem.rows.is_rational:
        return _strategy_iteration(problem, settings, observer)
    require_signs(problem.constant)
    structure = problem.against(problem.rows.lower)
    quotient = collapse(structure)
    if quotient is None:
        return _bounds(problem, graph.sccs(structure.rows), settings, observer)
    parts = graph.sccs(quotient.problem.rows)
    return quotient.expand(_bounds(_on_quotient(problem, quotient), parts, settings, observer))


def require_signs(*values: Numbers) -> None:
    """Refuse negative rewards, whose expectations are no bounds in doubles.

    Raises:
        UnsupportedError: a number is negative, and not rational.
    """
    if any(len(v) and not is_rational(v) and v.min() < 0 for v in values):
        raise NeedsRationalsError(
            "negative rewards with intervals of probabilities are not supported in floating point"
        )


def _on_quotient(problem: IntervalProblem, quotient: MecQuotient) -> IntervalProblem:
    """The problem in which each end component is one state."""
    n, groups = quotient.problem.n, quotient.problem.rows.groups
    assert groups is not None
    column_of = np.concatenate([quotient.index, n + np.arange(len(problem.known))])
    return replace(
        problem,
        rows=problem.rows.choose(
            quotient.kept,
            groups,
            column_of.astype(np.int32),
            n + len(problem.known),
        ),
        constant=problem.constant[quotient.kept],
    )


def _bounds(
    problem: IntervalProblem,
    parts: graph.Components,
    settings: Settings,
    observer: Observer | None,
) -> Solution:
    """Bounds by optimistic value iteration, component by component."""
    n = problem.n
    limit = 1.0 if problem.probability else np.inf
    values = np.zeros(n + len(problem.known)), np.full(n + len(problem.known), limit)
    for bounds in values:
        bounds[n:] = problem.known
    rows, groups = problem.rows.compiled, problem.rows.lower.groups
    assert groups is not None
    constants = [problem.constant * (1.0 + side * problem.constant_error) for side in (-1, 1)]
    epsilon, sweeps, most = settings.epsilon / _FINER, 0, min(_QUICK, settings.max_iterations)
    candidate, width = np.empty(0), np.inf
    for _ in range(_ROUNDS):
        relative = epsilon if settings.relative else epsilon / max(1.0, float(values[0].max()))
        iteration = Iteration(
            rows,
            groups,
            constants[0],
            constants[1],
            parts.order,
            parts.start,
            values[0],
            values[1],
            candidate,
            problem.direction is Direction.MAX,
            limit,
            max(relative, 1e-15),
            most,
        )
        while not iteration.run(_WORK):
            if observer is not None:
                observer(Progress("optimistic", sweeps + iteration.total, np.inf, n, values[0][:n]))
        sweeps += iteration.total
        size = f"{counted(n, 'state')}, {counted(parts.count, 'component')}"
        note = f"{size}: optimistic, {sweeps} sweeps"
        policy = iteration.policy()
        lower = values[0][:n].copy()
        upper = np.maximum(lower, values[1][:n])
        solution = Solution(lower, upper, "optimistic", iterations=sweeps, explanation=note)
        solution = replace(solution, strategy=policy)
        if iteration.failed and most < settings.max_iterations:  # the values converge slowly
            candidate, most = (
                _candidate(problem, values[0], policy),
                settings.max_iterations,
            )
            continue
        before, width = width, solution.width(settings.relative)
        if iteration.failed or width <= settings.epsilon or width > 0.5 * before:
            break
        epsilon /= _FINER
    return solution


def _candidate(problem: IntervalProblem, values: Numbers, policy: Int64s) -> Numbers:
    """Approximate values of all columns: player and nature improve from a policy and values.

    Empty where that does not end: the two may go round in circles (Condon 1990).
    """
    rows, compiled, n = problem.rows, problem.rows.compiled, problem.n
    groups, owner = rows.lower.groups, rows.lower.state_of_row
    assert groups is not None
    sign = 1 if problem.direction is Direction.MAX else -1
    for _ in range(_POLICIES):
        chosen = replace(rows.lower, data=compiled.chosen(values))
        taken = problem.against(chosen)
        chain, constant = taken.rows.choose(policy), taken.constant[policy]
        solved = _evaluated(chain, constant, values[:n])
        if solved is None or not np.isfinite(solved).all() or solved.min() < 0.0:
            break
        values = np.concatenate([solved, problem.known])
        gains = sign * (compiled.multiply(values, False) + problem.constant - values[owner])
        best = first_best(gains, groups)
        better = gains[best] > gains[policy] + _GAIN * values[:n]
        before = chosen.multiply(values)
        natural = np.abs(compiled.multiply(values, False) - before) > _GAIN * before
        if not (better.any() or natural[policy].any()):
            return values
        policy = np.where(better, best, policy)
    return np.empty(0)


def _evaluated(chain: SparseMatrix, constant: Numbers, guess: Numbers) -> Numbers | None:
    """About the solution of x = chain x + constant; None if there is none, or it is not found."""
    n = chain.states
    if n <= _SOLVED_STATES:
        from scipy.sparse import csc_array, identity
        from scipy.sparse.linalg import splu

        matrix = csc_array((chain.data, chain.indices, chain.indptr), shape=(n, n)).T
        try:
            solver = splu(csc_array(identity(n) - matrix), diag_pivot_thresh=0.0)
        except RuntimeError:  # some states are never left
            return None
        return np.asarray(solver.solve(constant))
    from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix

    loops = chain.row_of_entry == chain.indices
    stays = np.bincount(chain.row_of_entry[loops], chain.data[loops], n)
    if stays.max() >= 1.0:
        return None
    scale = np.asarray(1.0 / (1.0 - stays), np.float64)
    split, x, before = SplitMatrix.of(chain, scale), guess, np.inf
    while True:
        rest = (constant - (x - chain.multiply(x))) * scale
        error = float(np.abs(rest).max())
        if error == 0.0 or not error < 0.5 * before:  # as good as rounding lets it be
            return x
        change = split.solution(rest, _CORRECTION * error, _PATIENCE)
        if change is None:
            return x if error <= _ACCURATE * float(x.max()) else None
        x, before = x + change, error


def _strategy_iteration(
    problem: IntervalProblem, settings: Settings, observer: Observer | None
) -> Solution:
    """Nature improves its choice against the best answers of the player, until no row is better."""
    from symcheck.numerics.linear.methods import solve_linear

    rows, sign = problem.rows, 1 if problem.rows.nature is Direction.MAX else -1
    values = numbers(_guess(problem, settings, observer), rational=True)
    chosen, rounds = rows.chosen(np.concatenate([values, problem.known])), 0
    while True:
        solution = solve_linear(problem.against(chosen), settings, observer)
        values, rounds = np.concatenate([solution.lower, problem.known]), rounds + 1
        better = rows.chosen(values)
        improved = sign * (better.multiply(values) - chosen.multiply(values)) > 0
        if not improved.any():
            note = f"{solution.explanation}; {counted(rounds, 'choice')} of nature"
            return replace(solution, explanation=note, iterations=rounds)
        entries = improved.astype(np.bool_)[rows.lower.row_of_entry]
        chosen = replace(chosen, data=np.where(entries, better.data, chosen.data))


def _guess(problem: IntervalProblem, settings: Settings, observer: Observer | None) -> Numbers:
    """Values in doubles, for a good first choice of nature."""
    known: Sequence[Numbers] = (problem.known, problem.constant)
    if any(np.any(doubles(v) < 0) for v in known):
        return np.zeros(problem.n)
    rounded = replace(
        problem,
        rows=problem.rows.doubles(),
        known=doubles(problem.known),
        constant=doubles(problem.constant),
    )
    found = solve_intervals(rounded, settings, observer).lower
    return np.where(np.isfinite(found), found, 0.0)
