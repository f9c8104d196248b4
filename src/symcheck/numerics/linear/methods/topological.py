"""The default: strong components in reverse topological order, each by the cheapest means that certify it.

A state that is a component of its own takes one pass over its rows. A component without choices is eliminated without
subtraction, if that takes no more than some sweeps would, or solved by BiCGStab, with a proof. Others are swept from both
sides (interval iteration for probabilities, optimistic value iteration for rewards) as long as that converges, and handed
to a longer elimination or to policy iteration where it does not.
Sources: Dai, Mausam, Weld & Goldsmith (2011); Baier, Klein, Leuschner, Parker & Wunderlich (2017).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.certificates import levels
from symcheck.kernels.solve.component_bounds import System
from symcheck.kernels.solve.sweeps import Block
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s
from symcheck.numerics import graph
from symcheck.numerics.linear.extrapolation import accelerated
from symcheck.numerics.linear.masked_problem import Embedded
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.methods import policy
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution, Step
from symcheck.numerics.linear.subsystem import (
    Bounds,
    LocalSystem,
    policy_iteration,
    solve_direct,
    solve_krylov,
)
from symcheck.numerics.settings import Settings

__all__ = ["solve", "solve_embedded"]

SMALL = 64  # states without choices that are eliminated in a full matrix
SPARSE = 250_000  # states beyond which elimination is not tried at length
OPERATIONS = 4_000_000_000  # of a sparse elimination, before it is given up
MANY = 5_000_000  # entries beyond which it is not tried at all
LARGE = 20_000  # states from which on sweeping pays even where it is slow
SLICE = 32  # sweeps between looks at the rate
TINY = 1e-290  # below, bounds that are rounded outwards come apart
CHEAP = 20_000_000  # entries that sweeps go over in some hundredths of a second


class _TooSlow(Exception):
    """A chain is not solved by quick means."""


@dataclass(eq=False)
class _Run:
    """The arrays of a solution in the making. point: whether constants are known exactly."""

    system: System
    probability: bool
    point: bool
    x: Floats
    strategy: Int64s
    settings: Settings
    observer: Observer | None
    counters: Int64s = field(default_factory=lambda: np.zeros(6, dtype=np.int64))
    notes: dict[str, int] = field(default_factory=dict)
    quick: bool = False
    failed: int = 0
    iterations: int = 0


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Bounds that are certified; as near as asked unless the explanation says otherwise."""
    if problem.signed:
        return _signed(problem, settings, observer)
    smaller = collapse(problem)
    if smaller is not None:
        return smaller.expand(solve(smaller.problem, settings, observer))
    return _solve(problem, settings, observer)


def solve_embedded(
    problem: Embedded, settings: Settings, observer: Observer | None = None
) -> Solution:
    """The like for a problem whose rows stay among those of other states. No strategy comes of it."""
    if problem.signed or problem.collapsible():
        return solve(problem.alone(), settings, observer)
    m, constant = problem.matrix, problem.constant
    unknown = problem.unknown.view(np.uint8)
    system = System(
        m.indptr,
        m.indices,
        m.data,
        m.groups,
        constant,
        constant,
        None,
        problem.mode,
        unknown,
        problem.rates,
    )
    nobody = np.empty(0, dtype=np.int64)
    run = _Run(system, problem.probability, True, problem.start(), nobody, settings, observer)
    return _found(run, graph.Incidence(m), problem.unknown, problem.n)


def _solve(
    problem: LinearProblem, settings: Settings, observer: Observer | None, quick: bool = False
) -> Solution:
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
    point = problem.upper is None or bool(np.array_equal(problem.constant, problem.upper))
    strategy = np.full(problem.n if problem.mode else 0, -1, dtype=np.int64)
    run = _Run(
        system, problem.probability, point, np.zeros((problem.n, 2)), strategy, settings, observer
    )
    run.quick = quick
    return _found(run, graph.Incidence(m), None, problem.n)


def _found(run: _Run, source: graph.Incidence, unknown: Bools | None, n: int) -> Solution:
    """Solve the equations of the unknowns (None: all states), component by component unless there are no cycles."""
    indices = source.matrix.indices
    shape = sparse.triangular_order(
        source.edges, indices, None if unknown is None else unknown.view(np.uint8)
    )
    if shape != 0:
        run.system.sweep_acyclic(run.x, run.strategy, shape > 0)
        return _finish(run, f"{n} states, acyclic: one pass", True, unknown)
    parts = graph.sccs(source, unknown)
    # A component may use up its share of the width: what its successors brought in is part of what it is left with.
    deep = levels(
        source.edges,
        indices,
        parts.of,
        parts.order,
        parts.start,
        SMALL if run.system.mode == 0 else 1,
    )
    components, order, start = (
        f"{parts.count} SCCs, largest {parts.largest} states",
        parts.order,
        parts.start,
    )
    del parts, source  # what is solved now may need the memory
    _components(run, order, start, deep)
    explanation = _explain(run, components)
    del order, start, deep
    exact = run.counters[2] == 0 and set(run.notes) <= {"elimination"} and not run.failed
    return _finish(run, explanation, exact, unknown)


def _components(run: _Run, order: Int32s, start: Int64s, deep: Int32s) -> None:
    """Solve all components (see graph.Components); the kernel stops at each that needs more than its cheap means."""
    np.maximum(deep, 1, out=deep)
    share = run.settings.epsilon * 0.9 / int(deep.max(initial=1))
    component = 0
    while True:
        component = run.system.advance(
            order, start, component, run.x, run.strategy, deep, share, run.settings.relative,
            run.probability, SMALL, run.counters,
        )  # fmt: skip
        if component >= len(start) - 1:
            return
        _hard(run, order[start[component] : start[component + 1]], float(deep[component]) * share)
        component += 1


def _hard(run: _Run, states: Int32s, goal: float) -> None:
    """A component that is large or converges slowly: sweep a little, and decide by the rate what comes next."""
    block = run.system.block(states, run.x)
    if not block.open_:
        _closed(block)
    elif not _directly(run, block, goal):
        if run.quick:
            raise _TooSlow
        done = _accelerate(run, block, goal)
        if not done:
            done, ahead = _sweep(run, block, goal, True)
        if not done and block.n <= SPARSE:
            limit = int(min(OPERATIONS, max(10 * CHEAP, 0.5 * ahead * block.entries)))
            done = (
                _again(run, block, goal)
                or _eliminate(run, block, goal, limit)
                or _improve(run, block, goal)
            )
        if not done:
            loose = block.mode != 0 and _loosely(run, block, goal)
            done = not loose and _sweep(run, block, goal, False)[0]
            run.failed += not done
    run.system.store(block, run.x, run.strategy)


def _accelerate(run: _Run, block: Block, goal: float) -> bool:
    """Policies, evaluated by extrapolated sweeps, and a proof."""
    answer, sweeps = accelerated(block, goal, run.settings.relative, run.probability, run.observer)
    run.iterations += sweeps
    return answer is not None and _accept(run, block, goal, answer, "accelerated sweeps")


def _loosely(run: _Run, block: Block, goal: float) -> bool:
    """Bounds further apart than wanted, where rounding forbids to prove nearer ones: sweeps would go on for ever."""
    return any(_accelerate(run, block, goal * factor) for factor in (10.0, 100.0, 1000.0, 10_000.0))


def _closed(block: Block) -> None:
    """Nothing leaves: the value is 0, or infinite where a reward is met again and again."""
    block.x[:] = np.inf if np.any(np.asarray(block.bh)[: block.rows] > 0.0) else 0.0


def _sweep(run: _Run, block: Block, goal: float, eager: bool) -> tuple[bool, float]:
    """Sweep; if `eager`, give up where that looks expensive. Returns whether the goal was reached, and sweeps still ahead."""
    done, ahead = (_probabilities if run.probability else _rewards)(run, block, goal, eager)
    if done:
        _note(
            run, "interval iteration" if run.probability else "optimistic value iteration", block.n
        )
    return done, ahead


def _probabilities(run: _Run, block: Block, goal: float, eager: bool) -> tuple[bool, float]:
    """Interval iteration, in slices that show the rate and keep the observer informed."""
    used, slow, before, ahead = 0, 0, 1.0, math.inf
    while used < run.settings.max_iterations:
        done, sweeps, width = block.interval(goal, run.settings.relative, SLICE)
        used += sweeps
        run.iterations += sweeps
        if run.observer is not None:
            run.observer(Step("interval iteration", run.iterations, width, block.n))
        if done:
            return True, 0.0
        if used > SLICE:
            ahead = (
                sweeps * math.log(goal / width) / math.log(width / before)
                if width < before
                else math.inf
            )
            slow = slow + 1 if ahead * block.entries > CHEAP else 0
            tried = used * block.entries > CHEAP // 20
            if (eager and tried and slow >= 3) or (width >= before and used > 100 * SLICE):
                break
        before = width
    return False, ahead


def _rewards(run: _Run, block: Block, goal: float, eager: bool) -> tuple[bool, float]:
    """Optimistic value iteration."""
    most = run.settings.max_iterations
    # Elimination of a large block fills in: sweep for seconds before that is tried.
    worth = CHEAP if block.n < LARGE else 100 * CHEAP
    budget = min(most, max(200, worth // (block.entries + block.n + 1))) if eager else most
    done, sweeps, width = block.optimistic(goal, run.settings.relative, budget, eager)
    run.iterations += sweeps
    if run.observer is not None:
        run.observer(Step("optimistic value iteration", run.iterations, width, block.n))
    if not done:
        block.x[:, 1] = np.inf
    return done, math.inf


def _eliminate(run: _Run, block: Block, goal: float, limit: int) -> bool:
    """Elimination, for blocks without choices, within a number of operations."""
    # The lists that elimination works on take several times the memory of the rows.
    fits = block.mode == 0 and block.entries <= MANY
    answer = solve_direct(LocalSystem.of(block), limit) if fits else None
    return answer is not None and _accept(run, block, goal, answer, "elimination")


def _directly(run: _Run, block: Block, goal: float) -> bool:
    """An elimination that costs no more than some sweeps, or BiCGStab; large blocks fill in, and try that last."""
    if block.n <= LARGE:
        return _eliminate(run, block, goal, 200 * block.entries) or _krylov(
            run, block, goal, np.ones(block.n)
        )
    return _krylov(run, block, goal, np.ones(block.n)) or _eliminate(
        run, block, goal, 20 * block.entries
    )


def _krylov(run: _Run, block: Block, goal: float, scale: Floats) -> bool:
    """BiCGStab, for blocks without choices, with a proof: sweeps that converge slowly are good at preconditioning it."""
    if block.mode != 0:
        return False
    answer = solve_krylov(LocalSystem.of(block), goal, scale)
    if answer is None:
        return False
    run.iterations += answer.iterations
    return _accept(run, block, goal, answer, "BiCGStab")


def _again(run: _Run, block: Block, goal: float) -> bool:
    """BiCGStab once more, where sweeps have shown how large the values are, if these are of different orders of magnitude."""
    lower = block.x[:, 0]
    if not lower.min(initial=np.inf) > 0.0 or lower.min() > 1e-3 * lower.max():
        return False
    return _krylov(run, block, goal, lower.copy())


def _improve(run: _Run, block: Block, goal: float) -> bool:
    """Policy iteration, for blocks with choices, as long as the policies' chains are solved by quick means."""
    if block.mode == 0:
        return False
    try:
        answer = policy_iteration(LocalSystem.of(block), goal, _quickly)
    except _TooSlow:
        return False
    return answer is not None and _accept(run, block, goal, answer, "policy iteration")


def _quickly(problem: LinearProblem, settings: Settings) -> Solution:
    if problem.signed:
        return _signed(problem, settings, None)
    return _solve(problem, settings, None, quick=True)


def _accept(run: _Run, block: Block, goal: float, answer: Bounds, name: str) -> bool:
    """Take over bounds (where they are nearer, for probabilities); whether they are near enough."""
    x = block.x
    if run.probability:
        x[:, 0] = np.maximum(x[:, 0], answer.lower)
        x[:, 1] = np.minimum(x[:, 1], answer.upper)
    else:
        x[:, 0] = answer.lower
        x[:, 1] = answer.upper
    if answer.policy is not None:
        block.choice[:] = answer.policy
    width = x[:, 1] - x[:, 0]
    if run.settings.relative:
        width = width / np.maximum(np.abs(x[:, 1]), 1e-300)
    if float(width.max()) > goal:
        return False
    _note(run, name, block.n)
    return True


def _note(run: _Run, name: str, states: int) -> None:
    run.notes[name] = max(run.notes.get(name, 0), states)


def _signed(problem: LinearProblem, settings: Settings, observer: Observer | None) -> Solution:
    """Negative constants: without choices the solution is a difference of two; with choices, policy iteration decides."""
    if problem.mode != 0:
        return policy.solve(problem, settings, observer, chains=solve)
    parts = [
        solve(
            problem.with_constant(np.maximum(sign * low, 0.0), np.maximum(sign * high, 0.0)),
            settings,
            observer,
        )
        for sign, low, high in (
            (1.0, problem.constant, problem.high),
            (-1.0, problem.high, problem.constant),
        )
    ]
    plus, minus = parts
    lower, upper = plus.lower - minus.upper, plus.upper - minus.lower
    note = f"gains and losses apart: {plus.explanation}"
    return Solution(
        lower,
        upper,
        "topological",
        plus.exact and minus.exact,
        True,
        plus.iterations + minus.iterations,
        note,
    )


def _finish(run: _Run, explanation: str, exact: bool, unknown: Bools | None) -> Solution:
    lower, upper = (
        run.x[:, side].copy() if unknown is None else run.x[unknown, side] for side in (0, 1)
    )
    if run.probability:
        for bound in (lower, upper):
            np.clip(bound, 0.0, 1.0, out=bound)
    exact = exact and run.point and not _below_doubles(lower, upper)
    names = ("single", "eliminated", "swept", "sweeps", "largest_eliminated", "largest_swept")
    statistics = {name: int(c) for name, c in zip(names, run.counters, strict=True)} | {
        "unfinished": run.failed
    }
    return Solution(
        lower, upper, "topological", exact, True, int(run.counters[3]) + run.iterations, explanation, statistics,
        run.strategy if len(run.strategy) else None,
    )  # fmt: skip


def _below_doubles(lower: Floats, upper: Floats) -> bool:
    """Whether some value is so small that the bounds are apart, though no step of the solution was inexact by itself."""
    small = np.flatnonzero(lower < TINY)
    return bool(np.any(upper[small] - lower[small] > 1e-9 * upper[small]))


def _explain(run: _Run, components: str) -> str:
    """For people: how many components, the largest, and what was done."""
    single, eliminated, swept, _, largest_eliminated, largest_swept = (int(c) for c in run.counters)
    done = [f"{single} single"] if single else []
    if eliminated:
        done.append(f"{eliminated} eliminated (up to {largest_eliminated} states)")
    if swept:
        done.append(f"{swept} swept (up to {largest_swept} states)")
    done += [f"{name} (up to {states} states)" for name, states in run.notes.items()]
    if run.failed:
        done.append(f"{run.failed} did not reach the accuracy wanted")
    return f"{components}: topological, " + ", ".join(done)
