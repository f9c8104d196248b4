"""The equations of a component: direct solution, BiCGStab and policy iteration.

All bounds are certified. Let x = opt(A x + b), let x' be any approximation, and let w > 0 be any
vector with A w < w (along all rows that could matter). Then x' ± h w are bounds if the residual of
x' is at most h (w - A w) in every row, rounding included. With w about (I - A)^-1 x the bounds are
relative: w/x is the expected number of steps to the target, under the condition that it is reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from symcheck.direction import Direction
from symcheck.kernels.chains.gth_elimination import GthElimination
from symcheck.kernels.solve.certificates import certify
from symcheck.kernels.solve.component_bounds import Block, ComponentSolver
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.rows import (
    Bools,
    Floats,
    Int32s,
    Int64s,
    SparseMatrix,
    first_best,
    starts_of,
)
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics import graph, tuning
from symcheck.numerics.linear.problem import LinearProblem, Solution
from symcheck.numerics.settings import Accuracy, Settings

if TYPE_CHECKING:
    from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix

__all__ = [
    "Bounds",
    "LocalSystem",
    "component_solver",
    "make_proper",
    "policy_iteration",
    "solve_direct",
    "solve_krylov",
]


@dataclass
class Bounds:
    """Certified bounds, float64[n] each.

    policy: int32[n], the row of each state, counted from its first, that attains one of them.
    least: values below need not have the requested accuracy.
    """

    lower: Floats
    upper: Floats
    policy: Int32s | None = None
    iterations: int = 0
    least: float = tuning.SMALLEST_DIVISOR


def component_solver(problem: LinearProblem) -> ComponentSolver:
    """The equations of a problem, as compiled methods read them."""
    m = problem.rows
    return ComponentSolver(
        *m.arrays,
        m.groups,
        problem.constant,
        problem.high,
        problem.leaving,
        problem.mode,
        error=problem.error,
    )


@dataclass(frozen=True, eq=False)
class LocalSystem:
    """x = opt(b + A x) of a block, with self-loops divided out and b between `low` and `high`.

    The arrays are those of the block. mode: the kernels' code for the direction; it differs from
    the block's if choices are kept although every state has only one.
    """

    block: Block
    mode: int

    @staticmethod
    def of(block: Block) -> LocalSystem:
        """The equations of a block."""
        return LocalSystem(block, block.mode)

    @staticmethod
    def whole(problem: LinearProblem) -> LocalSystem:
        """All equations of a problem."""
        states, values = np.arange(problem.n, dtype=np.int32), np.zeros((problem.n, 2))
        return LocalSystem(component_solver(problem).block(states, values), problem.mode)

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.block.n

    @property
    def low(self) -> Floats:
        """Lower bounds of the constants, per row."""
        return np.asarray(self.block.constant_low)[: self.block.rows]

    @property
    def high(self) -> Floats:
        """Upper bounds of the constants, per row."""
        return np.asarray(self.block.constant_high)[: self.block.rows]

    @property
    def direction(self) -> Direction | None:
        """Minimise or maximise; None without choices."""
        return (None, Direction.MIN, Direction.MAX)[self.mode]

    def policy(self, strategy: Int64s | None) -> Int32s | None:
        """The rows of a strategy, counted from the first one of each state."""
        if strategy is None:
            return None
        return (strategy - self.block.groups[:-1]).astype(np.int32)

    @cached_property
    def exit(self) -> Floats:
        """The probability of leaving, per row."""
        return self.block.exit_masses()

    @property
    def groups(self) -> Int64s | None:
        """The first row of each state; None without choices."""
        return self.block.groups if self.mode else None

    @cached_property
    def matrix(self) -> SparseMatrix:
        """A."""
        block = self.block
        indices = np.asarray(block.indices)[: block.entries]
        data = np.asarray(block.data)[: block.entries]
        return SparseMatrix(block.indptr, indices, data, block.n, self.groups)

    def chain(self, policy: Int64s) -> tuple[SparseMatrix, Floats]:
        """The chain of a policy (rows of the block): its matrix and exit probabilities."""
        return self.matrix.choose(policy), self.exit[policy]

    def problem(self, policy: Int64s, constant: Floats) -> LinearProblem:
        """The chain of a policy as a problem, with the given constants per row of the block."""
        matrix, leave = self.chain(policy)
        error = self.block.error
        return LinearProblem(constant[policy], matrix, exit=leave, probability=False, error=error)

    def rows_of(self, x: Floats, constant: Floats) -> Floats:
        """The right-hand sides constant + A x, per row."""
        return np.asarray(self.matrix.multiply(x) + constant)

    def certify(self, x: Floats, weight: Floats, policy: Int64s | None) -> tuple[float, float]:
        """Factors (low, high) such that x - low·weight and x + high·weight are proved bounds.

        A factor is infinite if nothing is proved.
        """
        rows = np.zeros(1, dtype=np.int64) if policy is None else policy
        m = self.matrix
        return certify(
            *m.arrays, m.groups, self.low, self.high, x, weight, rows, self.mode, self.block.error
        )


def _absolute_scale(x: Floats) -> Floats:
    """|x|, with zeros replaced by tiny numbers."""
    out = np.abs(x)
    out[out == 0.0] = max(float(out.max(initial=0.0)) * 1e-30, 1e-300)
    return out


def _bounds_around(x: Floats, weight: Floats, below: float, above: float) -> Bounds | None:
    """X - below·weight and x + above·weight, rounded outwards; None if a factor is infinite."""
    if not (np.isfinite(below) and np.isfinite(above)):
        return None
    rounding_error = np.abs(x) * 4.0 * tuning.UNIT_ROUNDOFF
    return Bounds(
        x - below * weight * (1 + 1e-15) - rounding_error,
        x + above * weight * (1 + 1e-15) + rounding_error,
    )


def solve_direct(local: LocalSystem, limit: int) -> Bounds | None:
    """Sparse elimination without subtraction (Grassmann, Taksar & Heyman 1985).

    None if it needs more than `limit` operations, some state never leaves, or an intermediate value
    is too small or too large for a double.
    """
    m = local.matrix
    factors = GthElimination(*m.arrays, local.exit, limit)
    if not factors.complete:
        return None
    error = factors.error + 2.0 * local.n * local.block.error
    lower = factors.solve(local.low) * (1.0 - error)
    upper = factors.solve(local.high)
    if factors.out_of_range:
        return None
    upper = np.where(upper > 0.0, upper * (1.0 + error) + UNDERFLOW_MARGIN, 0.0)
    return Bounds(lower, upper)


def solve_krylov(local: LocalSystem, goal: float) -> Bounds | None:
    """BiCGStab for a block without choices: bounds of relative width `goal`, or None.

    The weight of the certificate approximates (I - A)^-1 x. Constants that are known only between
    bounds are solved from both sides.
    """
    solver = _BiCGStab(local)
    x = solver.solve(local.low, None, goal)
    if x is None or x.min() <= 0.0:
        return None
    weight = solver.solve(x, x, tuning.WEIGHT_RESIDUAL)
    if weight is None or not weight.min() > 0.0:  # almost singular: rounding decides
        return None
    # A residual of h x is an error of at most h weight / (1 - WEIGHT_RESIDUAL) of the solution.
    share = 0.1 * goal / max(float((weight / x).max()), 1.0)
    sides = []
    for right in (local.low, local.high):
        residual = right - solver.times(x)
        if np.any(np.abs(residual) > share * x):
            change = solver.solve(residual, x, share)
            if change is None or np.any(x + change <= 0.0):
                return None
            x = x + change
        sides.append(x)
    below = _bounds_around(sides[0], weight, *local.certify(sides[0], weight, None))
    above = (
        below
        if sides[1] is sides[0]
        else _bounds_around(sides[1], weight, *local.certify(sides[1], weight, None))
    )
    if below is None or above is None:
        return None
    bounds = Bounds(np.maximum(below.lower, 0.0), above.upper, None, solver.steps)
    return bounds if np.all(bounds.upper - bounds.lower <= goal * bounds.upper) else None


@dataclass
class _BiCGStab:
    """Approximate solutions of (I - A) x = b; `steps` counts the steps of all of them."""

    local: LocalSystem
    steps: int = 0

    @cached_property
    def split(self) -> SplitMatrix:
        """I - A."""
        from symcheck.numerics.linear.preconditioned_bicgstab import SplitMatrix

        return SplitMatrix.of(self.local.matrix, np.ones(self.local.n))

    def times(self, v: Floats) -> Floats:
        """(I - A) v."""
        return np.asarray(v - self.local.matrix.multiply(v))

    def solve(self, right: Floats, scale: Floats | None, goal: float) -> Floats | None:
        """A solution with a residual of at most about goal · scale; None if it does not converge.

        scale: float64[n], positive; values count relative to it. None: 1 everywhere.
        """
        split = self.split if scale is None else self.split.relative_to(scale)
        before = split.steps
        x = split.solution(right, 0.5 * goal, tuning.BICGSTAB_PATIENCE)
        self.steps += split.steps - before
        return x


Evaluate = Callable[[LinearProblem, Settings], Solution]


def policy_iteration(
    local: LocalSystem,
    goal: float,
    evaluate: Evaluate,
    observer: Callable[[int, Floats, Int32s], None] | None = None,
) -> Bounds | None:
    """Howard's policy iteration; the result is certified against all rows.

    Every policy evaluated leaves almost surely, so its equations have a unique solution.

    Args:
        local: the equations.
        goal: the requested width.
        evaluate: solves problems with non-negative rewards, and chains.
        observer: receives the number of each policy, its values, and the row of each state, counted
            from its first.

    Returns:
        Bounds and the policy; None if no proof is found.
    """
    assert local.matrix.groups is not None
    if np.any(np.diff(local.matrix.groups) == 0):
        return None
    first = local.matrix.groups[:-1]
    policy = make_proper(local, first + np.maximum(local.block.policy, 0))
    if policy is None:
        return None
    accurate = Accuracy(epsilon=min(goal * 0.1, 1e-9))
    middle = 0.5 * (local.low + local.high)
    count = 0
    while count < tuning.POLICY_ROUNDS:
        count += 1
        x = evaluate(local.problem(policy, middle), accurate).middle
        if not np.all(np.isfinite(x)):
            return None
        if observer is not None:
            observer(count, x, (policy - first).astype(np.int32))
        rows = local.rows_of(x, middle)
        better = _improve_policy(local, policy, rows)
        if better is None:
            break
        policy = better
    values = evaluate(replace(local.problem(policy, local.low), upper=local.high[policy]), accurate)
    if _proves_optimality(local, policy, values):
        return Bounds(values.lower, values.upper, (policy - first).astype(np.int32), count)
    # Bounds relative to each value, or to the largest value if values cancel.
    for scale in (
        _absolute_scale(x),
        np.full(local.n, max(float(np.max(np.abs(x), initial=0.0)), 1e-300)),
    ):
        weights = _weights(local, policy, x, rows, scale, evaluate)
        if weights is None:
            continue
        bounds = _bounds_around(x, weights, *local.certify(x, weights, policy))
        if bounds is not None:
            return replace(bounds, policy=(policy - first).astype(np.int32), iterations=count)
    return None


def _proves_optimality(local: LocalSystem, policy: Int64s, values: Solution) -> bool:
    """Whether the bounds on a policy's values prove that no other row is better in any state."""
    groups = local.matrix.groups
    assert groups is not None
    longest = local.matrix.longest
    rounding_error = (longest + 8) * tuning.UNIT_ROUNDOFF + 2.0 * local.block.error
    if local.mode == 2:
        rows = local.rows_of(values.upper, local.high)
        worse = rows + np.abs(rows) * rounding_error <= np.repeat(values.lower, np.diff(groups))
    else:
        rows = local.rows_of(values.lower, local.low)
        worse = rows - np.abs(rows) * rounding_error >= np.repeat(values.upper, np.diff(groups))
    worse[policy] = True
    return bool(worse.all())


def make_proper(local: LocalSystem, policy: Int64s) -> Int64s | None:
    """The policy, changed where it does not leave almost surely; None if no policy does."""
    leaving = _leaves(local, policy)
    if leaving.all():
        return policy
    exits = graph.exit_policy(local.matrix, local.exit > 0.0)
    return None if exits is None else np.where(leaving, policy, exits)


def _leaves(local: LocalSystem, policy: Int64s) -> Bools:
    """The states from which the chain of a policy can leave."""
    matrix, leave = local.chain(policy)
    return graph.backward_reachable(matrix, leave > 0.0)


def _improve_policy(local: LocalSystem, policy: Int64s, rows: Floats) -> Int64s | None:
    """The policy with clearly better rows where there are some; None if there are none."""
    assert local.matrix.groups is not None
    values = rows if local.mode == 2 else -rows
    best, current = first_best(values, local.matrix.groups), values[policy]
    change = values[best] > current + 1e-13 * np.abs(current) + 1e-300
    return np.where(change, best, policy) if change.any() else None


def _weights(
    local: LocalSystem, policy: Int64s, x: Floats, rows: Floats, scale: Floats, evaluate: Evaluate
) -> Floats | None:
    """Weights w with A w + scale about w or less, along all rows that are as good as the policy's.

    They are the maximal expected rewards `scale` per step over these rows; None if some are
    infinite.
    """
    groups = local.matrix.groups
    assert groups is not None
    owner = local.matrix.state_of_row
    ties = np.abs(rows - x[owner]) <= 1e-7 * scale[owner]
    ties[policy] = True
    chosen = np.flatnonzero(ties)
    matrix, leave = local.matrix.choose(chosen, starts_of(ties)[groups]), local.exit[chosen]
    if graph.maximal_end_components(matrix, np.ones(local.n, np.bool_), leave <= 0.0).count:
        return None
    tied = LinearProblem(scale[owner[chosen]], matrix, None, leave, Direction.MAX, False)
    return evaluate(tied, Accuracy(epsilon=1e-3)).upper
