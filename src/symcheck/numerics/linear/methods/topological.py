"""The default method: strong components in reverse topological order.

Each component is solved by the cheapest means that prove the requested accuracy. A single state
takes one pass over its rows. A component without choices is eliminated without subtraction if that
costs no more than some sweeps, or solved by BiCGStab. Other components are solved by extrapolated
sweeps or by optimistic value iteration, and where this converges slowly by a longer elimination.

Sources: Dai, Mausam, Weld & Goldsmith (2011) for the order; Hartmanns & Kaminski (2020) for
optimistic value iteration.
"""

from __future__ import annotations

from dataclasses import field, replace

import numpy as np

from symcheck.direction import Direction
from symcheck.errors import NumericalError
from symcheck.kernels.rows import sparse
from symcheck.kernels.solve.certificates import component_depths
from symcheck.kernels.solve.component_bounds import Block, ComponentSolver
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import doubles, rationals, sum_segments
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s
from symcheck.matrices.tuning import UNDERFLOW_MARGIN
from symcheck.numerics import graph, rational_limits, tuning
from symcheck.numerics.linear.extrapolation import solve_extrapolated
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.linear.methods import policy, rational
from symcheck.numerics.linear.problem import (
    LinearProblem,
    Observer,
    Progress,
    Solution,
    largest_width,
)
from symcheck.numerics.linear.subsystem import (
    Bounds,
    LocalSystem,
    component_solver,
    solve_direct,
    solve_krylov,
)
from symcheck.numerics.settings import Accuracy, Settings
from symcheck.tables import counted

__all__ = ["TopologicalRun", "solve", "solve_in_order", "solve_masked"]


_COUNTERS = ("single", "eliminated", "swept", "sweeps", "largest_eliminated", "largest_swept")


@dataclass(eq=False)
class TopologicalRun:
    """The state of a solution.

    known_exactly: whether the constants are. values: lower and upper values, float64[states, 2].
    counters: those of the kernel (see `_COUNTERS`).
    methods: the largest component that each method solved. unfinished: components without the
    requested accuracy. may_add: whether constants may be made larger.
    """

    system: ComponentSolver
    probability: bool
    known_exactly: bool
    values: Floats
    strategy: Int64s
    settings: Settings
    observer: Observer | None
    counters: Int64s = field(default_factory=lambda: np.zeros(len(_COUNTERS), dtype=np.int64))
    methods: dict[str, int] = field(default_factory=dict)
    unfinished: int = 0
    iterations: int = 0
    may_add: bool = True

    def note(self, method: str, states: int) -> None:
        """Record that a method solved a component."""
        self.methods[method] = max(self.methods.get(method, 0), states)


def solve(problem: LinearProblem, settings: Settings, observer: Observer | None = None) -> Solution:
    """Certified bounds, as close as requested unless the explanation says otherwise.

    End components are collapsed before (`symcheck.numerics.linear.mec_quotient`).
    """
    if problem.signed:
        return _signed(problem, settings, observer)
    return _solve_rows(problem, settings, observer)


def solve_masked(
    problem: MaskedProblem, settings: Settings, observer: Observer | None = None
) -> Solution:
    """As `solve`, for a problem whose rows stay among those of other states; without a strategy.

    Its constants are not negative, and end components need not be collapsed.
    """
    m, constant = problem.matrix, problem.constant
    unknown = problem.unknown.view(np.uint8)
    system = ComponentSolver(
        *m.arrays,
        m.groups,
        constant,
        constant,
        None,
        problem.mode,
        unknown,
        problem.rates,
        problem.error,
    )
    no_strategy = np.empty(0, dtype=np.int64)
    values = problem.initial_values()
    run = TopologicalRun(system, problem.probability, True, values, no_strategy, settings, observer)
    return _solve_components(run, graph.Incidence(m), problem.unknown, problem.n)


def _solve_rows(
    problem: LinearProblem, settings: Settings, observer: Observer | None, *, may_add: bool = True
) -> Solution:
    """Solve a problem with non-negative constants, whose end components are collapsed."""
    system = component_solver(problem)
    width = largest_width(problem.constant, problem.high, relative=True)
    known_exactly = width <= tuning.CONSTANT_WIDTH
    strategy = np.full(problem.n if problem.mode else 0, -1, dtype=np.int64)
    values = np.zeros((problem.n, 2))
    run = TopologicalRun(
        system,
        problem.probability,
        known_exactly,
        values,
        strategy,
        settings,
        observer,
        may_add=may_add,
    )
    return _solve_components(run, graph.Incidence(problem.rows), None, problem.n)


def _solve_components(
    run: TopologicalRun, source: graph.Incidence, unknown: Bools | None, n: int
) -> Solution:
    """Solve the equations of the unknown states (None: all); in one pass if there are no cycles."""
    indices = source.matrix.indices
    mask = None if unknown is None else unknown.view(np.uint8)
    shape = sparse.triangular_order(source.edges, indices, mask)
    if shape != 0:
        run.system.sweep_acyclic(run.values, run.strategy, shape > 0)
        return _solution(run, f"{counted(n, 'state')}, acyclic: one pass", True, unknown)
    parts = graph.sccs(source, unknown)
    if run.system.mode == 0:
        _sort_large_components(parts)
    # Each component may use its share of the width, since the bounds of its successors add to it.
    small = tuning.SMALL_COMPONENT_STATES if run.system.mode == 0 else 1
    depths = component_depths(source.edges, indices, parts.of, parts.order, parts.start, small)
    summary = f"{counted(parts.count, 'SCC')}, largest {counted(parts.largest, 'state')}"
    order, start = parts.order, parts.start
    del parts, source  # their memory may be needed for the solution
    share = run.settings.epsilon * 0.9 / int(depths.max(initial=1))
    solve_in_order(run, order, start, depths, share)
    exact = run.counters[2] == 0 and set(run.methods) <= {"elimination"} and not run.unfinished
    return _solution(run, _explain(run, summary), exact, unknown)


def _sort_large_components(parts: graph.Components) -> None:
    """Put the states of large components into the order of their indices.

    States are numbered in the order of their variables' values: neighbours are near in memory, and
    BiCGStab takes down to a third of the steps that it takes in the order of Tarjan's search.
    """
    for component in np.flatnonzero(np.diff(parts.start) > tuning.LARGE_COMPONENT_STATES):
        parts.order[parts.start[component] : parts.start[component + 1]].sort()


def solve_in_order(
    run: TopologicalRun, order: Int32s, start: Int64s, depths: Int32s, share: float
) -> None:
    """Solve components one after the other; the kernel returns those too hard for it.

    Args:
        run: the system, its values and its settings.
        order: the states by component, successors first, int32[n] (see graph.Components).
        start: where each component begins in `order`, and the end, int64[components + 1].
        depths: int32[components]; the bounds of component c may be depths[c] * share apart.
        share: the width of the bounds per unit of depth.
    """
    np.maximum(depths, 1, out=depths)
    component = 0
    while True:
        component = run.system.advance(
            order,
            start,
            component,
            run.values,
            run.strategy,
            depths,
            share,
            run.settings.relative,
            run.probability,
            tuning.SMALL_COMPONENT_STATES,
            run.counters,
        )
        if component >= len(start) - 1:
            return
        states = order[start[component] : start[component + 1]]
        _solve_large_scc(run, states, float(depths[component]) * share)
        component += 1


def _solve_large_scc(run: TopologicalRun, states: Int32s, goal: float) -> None:
    """Solve a component that is large or converges slowly, by the first method that succeeds."""
    block = run.system.block(states, run.values)
    if not block.has_exit:
        _solve_closed(block)
    elif not (
        _try_cheap_methods(run, block, goal)
        or _try_iterative_methods(run, block, goal)
        or _try_rationals(run, block, goal)
        or _try_from_above(run, block, goal)
    ):
        relaxed = block.mode != 0 and _relax_tolerance(run, block, goal)
        done = not relaxed and _sweep(run, block, goal, give_up=False)
        run.unfinished += not done
    run.system.store(block, run.values, run.strategy)


def _solve_closed(block: Block) -> None:
    """Nothing leaves: the value is 0, or infinite if a reward is collected again and again."""
    block.x[:] = np.inf if np.any(np.asarray(block.constant_high)[: block.rows] > 0.0) else 0.0


def _try_cheap_methods(run: TopologicalRun, block: Block, goal: float) -> bool:
    """An elimination that costs no more than some sweeps, and BiCGStab."""
    if block.n <= tuning.LARGE_COMPONENT_STATES:
        limit = tuning.EARLY_OPERATIONS_PER_ENTRY * block.entries
        return _eliminate(run, block, goal, limit) or _try_krylov(run, block, goal)
    limit = tuning.EARLY_OPERATIONS_PER_ENTRY_LARGE * block.entries
    return _try_krylov(run, block, goal) or _eliminate(run, block, goal, limit)


def _try_iterative_methods(run: TopologicalRun, block: Block, goal: float) -> bool:
    """Extrapolated sweeps, plain sweeps while they converge, and a long elimination."""
    if _extrapolate(run, block, goal):
        return True
    if _sweep(run, block, goal, give_up=True):
        return True
    return block.n <= tuning.ELIMINATION_STATES and _eliminate(
        run, block, goal, tuning.ELIMINATION_OPERATIONS
    )


def _try_rationals(run: TopologicalRun, block: Block, goal: float) -> bool:
    """Rational arithmetic for a small block, where the rounding of sums decides."""
    if block.n > rational_limits.COMPONENT_STATES:
        return False
    bounds = solve_rationally(LocalSystem.of(block), run.probability)
    return bounds is not None and _accept(run, block, goal, bounds, "rational arithmetic")


def _try_from_above(run: TopologicalRun, block: Block, goal: float) -> bool:
    """Bounds where values of some states are below the range of doubles, and others are not.

    A small number is added to each constant, which keeps all values within the range. It adds no
    more to them than its product with the greatest expected number of steps.
    """
    local = LocalSystem.of(block)
    largest = float(local.high.max(initial=0.0))
    if not (run.may_add and 0.0 < largest < np.inf):
        return False
    settings = Accuracy(
        epsilon=goal / 2,
        max_iterations=run.settings.max_iterations,
        strategy=run.settings.strategy,
    )

    def solved(constants: tuple[Floats, Floats], direction: Direction | None) -> Solution:
        low, high = (
            (side / largest + tuning.ADDED_CONSTANT) * (1.0 + sign * 4.0 * tuning.UNIT_ROUNDOFF)
            for side, sign in zip(constants, (-1, 1), strict=True)
        )
        problem = LinearProblem(
            low,
            local.matrix,
            high,
            local.exit,
            direction,
            probability=False,
            error=block.error,
        )
        found = _solve_rows(problem, settings, run.observer, may_add=False)
        run.iterations += found.iterations
        return found

    values = solved((local.low, local.high), local.direction)
    nothing = np.zeros(len(local.low))
    more = solved((nothing, nothing), None if local.mode == 0 else Direction.MAX).upper
    lower = largest * (values.lower - more)
    bounds = Bounds(
        np.where(lower < UNDERFLOW_MARGIN, 0.0, np.nextafter(lower, 0.0)),
        np.nextafter(largest * values.upper, np.inf),
        local.policy(values.strategy),
        least=largest * tuning.LEAST_ACCURATE,
    )
    return _accept(run, block, goal, bounds, "values from above")


def solve_rationally(local: LocalSystem, probability: bool) -> Bounds | None:
    """Bounds from the exact solution of the equations that the doubles denote.

    A row and what leaves it are divided by their sum, so that the probability of staying, which
    doubles hold worst, follows from the others. These are rounded, each relatively, and then so is
    the solution: it is a quotient of sums of products of at most n of them (O'Cinneide 1993).
    None if a value is infinite or beyond the doubles.
    """
    m, constants = local.matrix, (local.low, local.high)
    if not all(np.isfinite(c).all() for c in constants):
        return None
    entries, leave = rationals(m.data.tolist()), rationals(local.exit.tolist())
    total = sum_segments(entries, m.indptr) + leave
    matrix = replace(m, data=np.asarray(entries / np.repeat(total, m.lengths)))
    sides = []
    try:
        for constant in constants[: 1 if np.array_equal(*constants) else 2]:
            exact = rationals(constant.tolist()) / total
            problem = LinearProblem(
                exact,
                matrix,
                exit=leave / total,
                direction=local.direction,
                probability=probability,
            )
            sides.append(rational.solve(problem, Accuracy(), None, chooser=_no_chooser))
        lower, upper = doubles(sides[0].lower), doubles(sides[-1].upper)
    except (NumericalError, OverflowError, ZeroDivisionError):
        return None
    error = local.n * (4.0 * (m.longest + 8) * tuning.UNIT_ROUNDOFF + 2.0 * local.block.error)
    attained = sides[0 if local.mode == 2 else -1].strategy
    return Bounds(
        lower * (1.0 - error),
        np.where(upper > 0.0, upper * (1.0 + error) + UNDERFLOW_MARGIN, 0.0),
        local.policy(attained),
    )


def _no_chooser(_problem: LinearProblem, _settings: Settings) -> Solution:
    raise NumericalError("doubles have failed")


def _extrapolate(run: TopologicalRun, block: Block, goal: float) -> bool:
    """Extrapolated sweeps with a proof."""
    bounds, sweeps = solve_extrapolated(
        block, goal, run.settings.relative, run.probability, run.observer
    )
    run.iterations += sweeps
    return bounds is not None and _accept(run, block, goal, bounds, "extrapolated sweeps")


def _relax_tolerance(run: TopologicalRun, block: Block, goal: float) -> bool:
    """Prove wider bounds where rounding prevents the proof of closer ones and sweeps never end."""
    return any(_extrapolate(run, block, goal * factor) for factor in tuning.RELAXED_TOLERANCES)


def _sweep(run: TopologicalRun, block: Block, goal: float, *, give_up: bool) -> bool:
    """Optimistic value iteration; whether the goal was reached.

    give_up: stop if convergence looks expensive.
    """
    budget = run.settings.max_iterations
    if give_up:
        # A large block fills in when it is eliminated, so more sweeps are worth their time.
        large = block.n >= tuning.LARGE_COMPONENT_STATES
        entries = 100 * tuning.CHEAP_ENTRIES if large else tuning.CHEAP_ENTRIES
        budget = min(budget, max(200, entries // (block.entries + block.n + 1)))
    relative = run.settings.relative
    done, sweeps, width = block.optimistic_value_iteration(goal, relative, budget, give_up)
    run.iterations += sweeps
    if run.observer is not None:
        run.observer(Progress("optimistic value iteration", run.iterations, width, block.n))
    if done:
        run.note("optimistic value iteration", block.n)
    else:
        block.x[:, 1] = 1.0 if run.probability else np.inf
    return done


def _eliminate(run: TopologicalRun, block: Block, goal: float, limit: int) -> bool:
    """Elimination of a block without choices, within a number of operations."""
    if block.mode != 0 or block.entries > tuning.ELIMINATION_ENTRIES:
        return False
    bounds = solve_direct(LocalSystem.of(block), limit)
    return bounds is not None and _accept(run, block, goal, bounds, "elimination")


def _try_krylov(run: TopologicalRun, block: Block, goal: float) -> bool:
    """BiCGStab with a proof, for a block without choices."""
    if block.mode != 0:
        return False
    bounds = solve_krylov(LocalSystem.of(block), goal)
    if bounds is None:
        return False
    run.iterations += bounds.iterations
    return _accept(run, block, goal, bounds, "BiCGStab")


def _accept(run: TopologicalRun, block: Block, goal: float, bounds: Bounds, name: str) -> bool:
    """Store proved bounds (for probabilities, where they are closer); whether they are close
    enough.
    """
    x = block.x
    if run.probability:
        x[:, 0] = np.maximum(x[:, 0], bounds.lower)
        x[:, 1] = np.minimum(x[:, 1], bounds.upper)
    else:
        x[:, 0] = bounds.lower
        x[:, 1] = bounds.upper
    if bounds.policy is not None:
        block.policy[:] = bounds.policy
    # Where a successor has no upper bound, no method finds one.
    bounded = np.isfinite(np.asarray(block.constant_high)[: block.rows]).all()
    if bounded and largest_width(x[:, 0], x[:, 1], run.settings.relative, bounds.least) > goal:
        return False
    run.note(name, block.n)
    return True


def _signed(problem: LinearProblem, settings: Settings, observer: Observer | None) -> Solution:
    """Negative constants: a difference of two solutions without choices, else policy iteration."""
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
    lower = np.nextafter(plus.lower - minus.upper, -np.inf)
    upper = np.nextafter(plus.upper - minus.lower, np.inf)
    note = f"positive and negative rewards separately: {plus.explanation}"
    return Solution(
        lower,
        upper,
        "topological",
        plus.up_to_rounding and minus.up_to_rounding and _keeps_digits(plus, minus),
        True,
        plus.iterations + minus.iterations,
        note,
    )


def _keeps_digits(plus: Solution, minus: Solution) -> bool:
    """Whether no difference is much smaller than its operands: it has the error of these."""
    size = plus.upper + minus.upper
    return bool((size <= tuning.CANCELLATION * np.abs(plus.middle - minus.middle)).all())


def _solution(
    run: TopologicalRun, explanation: str, exact: bool, unknown: Bools | None
) -> Solution:
    """The solution of a finished run."""
    lower, upper = (
        run.values[:, side].copy() if unknown is None else run.values[unknown, side]
        for side in (0, 1)
    )
    if run.probability:
        for bound in (lower, upper):
            np.clip(bound, 0.0, 1.0, out=bound)
    exact = (
        exact
        and run.known_exactly
        and largest_width(lower, upper, relative=True) <= tuning.ROUNDING_WIDTH
    )
    return Solution(
        lower,
        upper,
        "topological",
        exact,
        True,
        int(run.counters[_COUNTERS.index("sweeps")]) + run.iterations,
        explanation,
        run.strategy if len(run.strategy) else None,
    )


def _explain(run: TopologicalRun, summary: str) -> str:
    """One line for users: the components, and how they were solved."""
    single, eliminated, swept, _, largest_eliminated, largest_swept = (int(c) for c in run.counters)
    done = [f"{single} single"] if single else []
    if eliminated:
        done.append(f"{eliminated} eliminated (up to {counted(largest_eliminated, 'state')})")
    if swept:
        done.append(f"{swept} swept (up to {counted(largest_swept, 'state')})")
    done += [f"{name} (up to {counted(states, 'state')})" for name, states in run.methods.items()]
    if run.unfinished:
        done.append(f"{run.unfinished} without the requested accuracy")
    return f"{summary}: topological, " + ", ".join(done)
