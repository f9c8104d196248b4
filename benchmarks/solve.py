"""Throughput of the numerical methods on generated systems: run `python benchmarks/solve.py`.

It prints CPU seconds and the explanation of each method. The systems are: acyclic in index order
and permuted, random walks on grids with small exit probabilities, a long random walk, a queue, and
a system with failures over a long horizon.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import graph
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.long_run.stationary import long_run_average
from symcheck.numerics.settings import Accuracy
from symcheck.numerics.transient.values import transient_values


def measure(name: str, run: Callable[[], str]) -> None:
    """Print the CPU time and the explanation of a run."""
    start = time.process_time()
    note = run()
    print(f"{name:28s} {time.process_time() - start:7.2f} s  {note}", flush=True)


def solve(problem: LinearProblem) -> str:
    """Solve by default settings."""
    solution = solve_linear(problem, Accuracy())
    return f"width {solution.width():.0e}: {solution.explanation}"


def acyclic(n: int, shuffled: bool) -> LinearProblem:
    """An acyclic system: each state has three later successors, and exits with 1e-4."""
    rng = np.random.default_rng(1)
    ahead = np.minimum(np.arange(n)[:, None] + rng.integers(1, 2000, (n, 3)), n - 1).astype(
        np.int32
    )
    data = np.full((n, 3), 0.3333)
    data[ahead == n - 1] = 0.0
    if shuffled:
        place = (np.arange(n) // 2000 * 2000 + rng.permutation(2000)[np.arange(n) % 2000]).astype(
            np.int32
        )
        ahead = place[ahead[np.argsort(place)]]
    matrix = SparseMatrix(np.arange(n + 1, dtype=np.int64) * 3, ahead.ravel(), data.ravel(), n)
    return LinearProblem(constant=np.full(n, 5e-5), matrix=matrix, exit=np.full(n, 1e-4))


def grid(m: int, leak: float, probability: bool = True) -> LinearProblem:
    """A random walk on an m × m grid that exits with probability `leak` in each step."""
    n = m * m
    s = np.arange(n)
    r, c = s // m, s % m
    near = [
        np.where(r > 0, s - m, s),
        np.where(c > 0, s - 1, s),
        np.where(c < m - 1, s + 1, s),
        np.where(r < m - 1, s + m, s),
    ]
    indices = np.stack(near, 1).astype(np.int32).ravel()
    arrays = sparse.merge_columns(
        np.arange(n + 1, dtype=np.int64) * 4,
        indices,
        np.full(4 * n, (1 - leak) / 4),
        s.astype(np.int32),
        n,
    )
    constant = np.where(s % 7 == 0, leak, 0.0) if probability else np.ones(n)
    return LinearProblem(
        constant=constant,
        matrix=SparseMatrix(*arrays, n),
        exit=np.full(n, leak),
        probability=probability,
    )


def line(n: int, up: float, down: float) -> SparseMatrix:
    """A birth-death chain of n states."""
    rows = np.concatenate((np.arange(n - 1), np.arange(1, n)))
    columns = np.concatenate((np.arange(1, n), np.arange(n - 1)))
    order = np.lexsort((columns, rows))
    indptr = np.concatenate(([0], np.cumsum(np.bincount(rows, minlength=n)))).astype(np.int64)
    data = np.concatenate((np.full(n - 1, up), np.full(n - 1, down)))[order]
    return SparseMatrix(indptr, columns[order].astype(np.int32), data, n)


def walk(n: int) -> LinearProblem:
    """Gambler's ruin with a fair coin."""
    ends = np.zeros(n)
    ends[[0, -1]] = 0.5
    return LinearProblem(
        constant=np.where(np.arange(n) == n - 1, 0.5, 0.0), matrix=line(n, 0.5, 0.5), exit=ends
    )


def main() -> None:
    """All measurements."""
    big = acyclic(4_000_000, False)
    measure("components, 12 M edges", lambda: f"{graph.sccs(big.rows).count} components")
    measure("acyclic, 12 M entries", lambda: solve(big))
    measure("the same, shuffled", lambda: solve(acyclic(4_000_000, True)))
    for m, leak in ((1000, 0.1), (1000, 0.01), (300, 1e-3), (300, 1e-5)):
        measure(f"grid {m} x {m}, leak {leak:g}", lambda m=m, leak=leak: solve(grid(m, leak)))  # type: ignore[misc]
    measure("the same, steps", lambda: solve(grid(300, 1e-5, False)))
    measure("walk of 100 000", lambda: solve(walk(100_000)))
    queue = line(200_000, 1.0, 1.5)
    measure(
        "queue of 200 000, length",
        lambda: str(long_run_average(queue, np.arange(200_000.0), Accuracy())),
    )
    rates = line(20_000, 1.0, 3.0)
    leave = sparse.row_sums(rates.indptr, rates.data)
    leave[30:] += 1e-6
    reward_rate = np.where(np.arange(20_000) >= 30, 1e-6, 0.0)
    start = np.zeros(1, dtype=np.int64)
    measure(
        "failure in 1e6 hours",
        lambda: (
            transient_values(
                TransitionKernel(rates, leave),
                1e6,
                Accuracy(),
                reward_rate=reward_rate,
                interest=start,
            ).explanation
        ),
    )


if __name__ == "__main__":
    main()
