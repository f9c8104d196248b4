"""A component's equations as a problem of their own: direct solution and policy iteration, with certified bounds.

The certificate: for x = opt(A x + b) let x' be any approximation and w > 0 any vector with A w < w (along all rows that
could matter). Then x' ± h w are bounds as soon as the residual of x' is at most h (w - A w), row by row, roundings counted.
With w about (I - A)^-1 x this is relative accuracy: w/x is the expected number of steps to the target, given that it is reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from symcheck.kernels.chains import gauss_seidel
from symcheck.kernels.chains.gth_elimination import Elimination
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.certificates import certify
from symcheck.kernels.solve.component_bounds import System
from symcheck.kernels.solve.sweeps import Block
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.krylov import bicgstab
from symcheck.numerics.linear.problem import LinearProblem, Solution
from symcheck.numerics.settings import Accuracy, Settings

__all__ = ["Bounds", "LocalSystem", "policy_iteration", "proper", "solve_direct", "solve_krylov"]

SWEEPS = 3  # Gauss-Seidel sweeps, to and fro, in a preconditioner
PATIENCE = 25  # steps within which the residual must have become a tenth
WEIGHT = 0.3  # what the weight of a certificate may be off by


@dataclass
class Bounds:
    """Certified bounds, and the policy that attains one of them: int32[n], a row per state, counted among the state's."""

    lower: Floats
    upper: Floats
    policy: Int32s | None = None
    iterations: int = 0


@dataclass(frozen=True, eq=False)
class LocalSystem:
    """x = opt(b + A x) of a block: self-loops divided out, b between `low` and `high`. The arrays are the block's own.

    mode: as the kernels say it; the block's, unless choices are to be kept where every state has only one.
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
        m = problem.rows
        system = System(
            m.indptr,
            m.indices,
            m.data,
            m.groups,
            problem.constant,
            problem.high,
            problem.leaving,
            problem.mode,
        )
        return LocalSystem(
            system.block(np.arange(problem.n, dtype=np.int32), np.zeros((problem.n, 2))),
            problem.mode,
        )

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.block.n

    @property
    def low(self) -> Floats:
        """Lower bounds of the constants, per row."""
        return np.asarray(self.block.bl)[: self.block.rows]

    @property
    def high(self) -> Floats:
        """Upper bounds of the constants, per row."""
        return np.asarray(self.block.bh)[: self.block.rows]

    @cached_property
    def exit(self) -> Floats:
        """The mass that leaves, per row."""
        return self.block.leaving()

    @property
    def groups(self) -> Int32s | Int64s | None:
        """Where the rows of each state begin; None without choices."""
        return self.block.group if self.mode else None

    @cached_property
    def matrix(self) -> SparseMatrix:
        """A, with the starts that other kernels expect: a copy of these where the block's are shorter numbers."""
        block = self.block
        starts, groups = block.row_ptr.astype(np.int64, copy=False), self.groups
        entries = np.asarray(block.idx)[: block.entries], np.asarray(block.val)[: block.entries]
        return SparseMatrix(
            starts,
            *entries,
            block.n,
            None if groups is None else groups.astype(np.int64, copy=False),
        )

    def chain(self, policy: Int64s) -> tuple[SparseMatrix, Floats]:
        """The chain that a policy (rows of the block) leaves: its rows, and what leaves them."""
        everywhere = np.arange(self.n, dtype=np.int32)
        part = sparse.select(
            self.matrix.indptr, self.matrix.indices, self.matrix.data, policy, everywhere
        )
        return SparseMatrix(*part, self.n), self.exit[policy]

    def problem(self, policy: Int64s, constant: Floats, probability: bool = False) -> LinearProblem:
        """The chain of a policy as a problem of its own, with these constants."""
        matrix, leave = self.chain(policy)
        return LinearProblem(
            constant=constant[policy], matrix=matrix, exit=leave, probability=probability
        )

    def rows_of(self, x: Floats, constant: Floats) -> Floats:
        """The right-hand sides constant + A x, per row."""
        out = np.empty(self.matrix.rows)
        sparse.multiply(self.matrix.indptr, self.matrix.indices, self.matrix.data, x, out)
        return out + constant

    def certify(self, x: Floats, weight: Floats, policy: Int64s | None) -> tuple[float, float]:
        """Factors (low, high) such that x - low·weight and x + high·weight are proved bounds; infinity where not."""
        rows = np.zeros(1, dtype=np.int64) if policy is None else policy
        m = self.matrix
        return certify(
            m.indptr, m.indices, m.data, m.groups, self.low, self.high, x, weight, rows, self.mode
        )


def _scale(x: Floats) -> Floats:
    """|x|, without zeros."""
    out = np.abs(x)
    out[out == 0.0] = max(float(out.max(initial=0.0)) * 1e-30, 1e-300)
    return out


def _around(x: Floats, weight: Floats, below: float, above: float) -> Bounds | None:
    """The bounds x - below·weight and x + above·weight, rounded outwards; None where a factor is infinite."""
    if not (np.isfinite(below) and np.isfinite(above)):
        return None
    slip = np.abs(x) * 2.0**-51
    return Bounds(x - below * weight * (1 + 1e-15) - slip, x + above * weight * (1 + 1e-15) + slip)


def solve_direct(local: LocalSystem, limit: int) -> Bounds | None:
    """Sparse elimination without subtraction.

    None where it needs more than `limit` operations, some state never leaves, or doubles are too small or too large for it.
    """
    m = local.matrix
    factors = Elimination(m.indptr, m.indices, m.data, local.exit, limit)
    if not factors.complete:
        return None
    lower = factors.solve(local.low) * (1.0 - factors.error)
    upper = factors.solve(local.high)
    if factors.lost:
        return None
    upper = np.where(upper > 0.0, upper * (1.0 + factors.error) + 1e-307, 0.0)
    return Bounds(lower, upper)


def solve_krylov(local: LocalSystem, goal: float, scale: Floats) -> Bounds | None:
    """BiCGStab over Gauss-Seidel sweeps, for a block without choices: bounds that are `goal` apart, relative to them, or None.

    scale: positive, about as large as the solution, to within some orders of magnitude.
    The weight of the certificate solves (I - A) w = x, roughly. Constants known between bounds only are solved from both sides.
    """
    solver = _Krylov(local)
    x = solver.solve(local.low, scale, goal)
    if x is None or x.min() <= 0.0:
        return None
    weight = solver.solve(x, x, WEIGHT)
    if weight is None:
        return None
    # An error of h x in the residual is one of at most h weight / (1 - WEIGHT) in the solution.
    share = 0.1 * goal / max(float((weight / x).max()), 1.0)
    sides = []
    for right in (local.low, local.high):
        rest = right - solver.times(x)
        if np.any(np.abs(rest) > share * x):
            change = solver.solve(rest, x, share)
            if change is None or np.any(x + change <= 0.0):
                return None
            x = x + change
        sides.append(x)
    below = _around(sides[0], weight, *local.certify(sides[0], weight, None))
    above = (
        below
        if sides[1] is sides[0]
        else _around(sides[1], weight, *local.certify(sides[1], weight, None))
    )
    if below is None or above is None:
        return None
    found = Bounds(np.maximum(below.lower, 0.0), above.upper, None, solver.steps)
    return found if np.all(found.upper - found.lower <= goal * found.upper) else None


@dataclass
class _Krylov:
    """(I - A)^-1, approximately; `steps` counts those made."""

    local: LocalSystem
    steps: int = 0

    def times(self, v: Floats) -> Floats:
        """(I - A) v."""
        m, out = self.local.matrix, np.empty(self.local.n)
        gauss_seidel.less_product(m.indptr, m.indices, m.data, v, out)
        return out

    def precondition(self, v: Floats) -> Floats:
        """About (I - A)^-1 v."""
        m, out = self.local.matrix, np.empty(self.local.n)
        gauss_seidel.symmetric_sweeps(m.indptr, m.indices, m.data, v, out, SWEEPS)
        return out

    def solve(self, right: Floats, scale: Floats, goal: float) -> Floats | None:
        """(I - A)^-1 right up to a residual of goal · scale everywhere; None where that is not reached soon."""
        best, last = np.inf, 0
        for count, (x, rest) in enumerate(bicgstab(self.times, self.precondition, right, scale)):
            self.steps += 1
            size = float(np.max(np.abs(rest) / scale))
            if size <= goal:
                return x
            if size < 0.1 * best:
                best, last = size, count
            if not np.isfinite(size) or count - last > PATIENCE:
                break
        return None


Evaluate = Callable[[LinearProblem, Settings], Solution]


def policy_iteration(
    local: LocalSystem, goal: float, evaluate: Evaluate, rounds: int = 500
) -> Bounds | None:
    """Howard's policy iteration, each policy's chain solved by `evaluate`; the result is certified against all rows.

    None where no proof is found. Every policy on the way leaves almost surely, so that its equations have one solution.
    """
    assert local.matrix.groups is not None
    if np.any(np.diff(local.matrix.groups) == 0):
        return None
    first = local.matrix.groups[:-1]
    policy = proper(local, first + np.maximum(local.block.choice, 0))
    if policy is None:
        return None
    fine = Accuracy(epsilon=min(goal * 0.1, 1e-9))
    middle = 0.5 * (local.low + local.high)
    count = 0
    while count < rounds:
        count += 1
        x = evaluate(local.problem(policy, middle), fine).middle
        if not np.all(np.isfinite(x)):
            return None
        rows = local.rows_of(x, middle)
        better = _improve(local, policy, rows, local.mode)
        if better is None:
            break
        policy = better
    own = evaluate(replace(local.problem(policy, local.low), upper=local.high[policy]), fine)
    if _clearly_best(local, policy, own):
        return Bounds(own.lower, own.upper, (policy - first).astype(np.int32), count)
    # A bound relative to each value, or, where values cancel, relative to the greatest.
    for scale in (_scale(x), np.full(local.n, max(float(np.max(np.abs(x), initial=0.0)), 1e-300))):
        weights = _weights(local, policy, x, rows, scale, evaluate)
        found = None if weights is None else _around(x, weights, *local.certify(x, weights, policy))
        if found is not None:
            return replace(found, policy=(policy - first).astype(np.int32), iterations=count)
    return None


def _clearly_best(local: LocalSystem, policy: Int64s, own: Solution) -> bool:
    """Whether the bounds on the policy's values prove that no other row is better anywhere: then they are optimal."""
    groups = local.matrix.groups
    assert groups is not None
    slip = (int(np.max(np.diff(local.matrix.indptr), initial=0)) + 8) * 2.0**-53
    if local.mode == 2:
        rows = local.rows_of(own.upper, local.high)
        worse = rows + np.abs(rows) * slip <= np.repeat(own.lower, np.diff(groups))
    else:
        rows = local.rows_of(own.lower, local.low)
        worse = rows - np.abs(rows) * slip >= np.repeat(own.upper, np.diff(groups))
    worse[policy] = True
    return bool(worse.all())


def proper(local: LocalSystem, policy: Int64s) -> Int64s | None:
    """The policy, mended where it does not leave almost surely; None where no policy does."""
    groups = local.matrix.groups
    assert groups is not None
    leaves = _leaves(local, policy)
    if leaves.all():
        return policy
    # Every policy row towards a state that has a row out; take those rows out where they are.
    owner = np.repeat(np.arange(local.n), np.diff(groups))
    out = np.flatnonzero(local.exit > 0.0)
    door = np.zeros(local.n, dtype=np.bool_)
    door[owner[out]] = True
    sure, rows = graph.prob1e_strategy(local.matrix, np.ones(local.n, dtype=np.bool_), door)
    if not sure.all():
        return None
    mended = np.where(rows >= 0, rows, 0)
    mended[owner[out]] = out
    mended = np.where(leaves, policy, mended)
    return mended if _leaves(local, mended).all() else np.where(door, mended, rows)


def _leaves(local: LocalSystem, policy: Int64s) -> Bools:
    """From where the chain of a policy may leave."""
    matrix, leave = local.chain(policy)
    return graph.backward_reachable(matrix, leave > 0.0)


def _improve(
    local: LocalSystem, policy: Int64s, rows: Floats, mode: int, allowed: Bools | None = None
) -> Int64s | None:
    """The best row wherever it is clearly better than the policy's; None where it is nowhere so."""
    groups = local.matrix.groups
    assert groups is not None
    sign = 1.0 if mode == 2 else -1.0
    values = sign * rows if allowed is None else np.where(allowed, sign * rows, -np.inf)
    best = np.maximum.reduceat(values, groups[:-1])
    current = values[policy]
    change = best > current + 1e-13 * np.abs(current) + 1e-300
    if not change.any():
        return None
    first = np.flatnonzero(values == np.repeat(best, np.diff(groups)))
    owner = np.searchsorted(groups, first, side="right") - 1
    out = policy.copy()
    pick = change[owner]
    out[owner[pick]] = first[pick]
    return out


def _weights(
    local: LocalSystem, policy: Int64s, x: Floats, rows: Floats, scale: Floats, evaluate: Evaluate
) -> Floats | None:
    """Weights w with A_r w + scale at most about w, along the rows that are as good as the policy's: the greatest such reward."""
    groups = local.matrix.groups
    assert groups is not None
    ties = np.abs(rows - np.repeat(x, np.diff(groups))) <= 1e-7 * np.repeat(scale, np.diff(groups))
    ties[policy] = True
    constant = np.repeat(scale, np.diff(groups))
    rough = Accuracy(epsilon=1e-3)
    for _ in range(100):
        found = evaluate(local.problem(policy, constant, probability=False), rough)
        weight = found.upper
        if not np.all(np.isfinite(weight)):
            return None
        better = _improve(local, policy, local.rows_of(weight, constant), 2, ties)
        if better is None:
            break
        policy = better
    return weight
