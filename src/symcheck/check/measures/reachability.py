"""Reachability, for all types of model: which states are certain by graph analysis, and equations for the others.

A CTMC is solved as its embedded DTMC: rates divided by the exit rate of their state. Sources: Baier & Katoen (2008),
10.1.1 and 10.6.1; for rewards, Forejt, Kwiatkowska, Norman & Parker (2011), 'Automated verification techniques'.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from symcheck.check.context import Context
from symcheck.check.measures.step_bounded import best, per_row
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Bools, Floats, Int64s, SparseMatrix, starts_of
from symcheck.numerics.linear.masked_problem import Embedded
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import ModelType

__all__ = [
    "Equations",
    "boundary_values",
    "chosen_rows",
    "equations",
    "reach_reward",
    "step_rewards",
    "until",
]

_MOST = 3
"""Times the unknowns that there may be states, for equations to be solved among the rows of all of them."""


@dataclass(frozen=True)
class Scaled:
    """An operator whose rows are divided by a factor each."""

    operator: Any
    factor: Floats

    def multiply(self, x: Floats, /) -> Floats:
        """The product with a vector: a value per row."""
        return np.asarray(self.operator.multiply(x) / self.factor)

    def __getattr__(self, name: str) -> Any:
        """What else the operator has: the length of its longest row, and sweeps, which are told to divide too."""
        found = getattr(self.operator, name)
        return partial(found, divisor=self.factor) if name == "sweep" else found


@dataclass(frozen=True)
class Equations:
    """One-step probabilities among some states, in the form that the engine prefers, and how to divide rates."""

    context: Context
    system: System
    rates: Floats | None = field(repr=False)

    def scaled(self, rows: Floats) -> Floats:
        """A rate per row as a probability per row (the value itself where there are no rates)."""
        return rows if self.rates is None else rows / self.rates

    def one_step_probability(self, target: StateSet) -> Floats:
        """Per row: the probability of entering `target` with the next step."""
        return self.scaled(self.system.one_step_probability(target))

    def problem(
        self,
        constant: Floats,
        upper: Floats | None,
        direction: Direction | None,
        *,
        probability: bool,
    ) -> LinearProblem:
        """The equations x = A x + constant (bounds: up to `upper`)."""
        leave = self.one_step_probability(~self.system.states)
        if self.system.has_rows or self._end_components_matter(direction, probability):
            return LinearProblem(constant, self._matrix(), upper, leave, direction, probability)
        operator = (
            self.system.operator if self.rates is None else Scaled(self.system.operator, self.rates)
        )
        return LinearProblem(
            constant, None, upper, leave, direction, probability, operator, self.system.groups
        )

    def _end_components_matter(self, direction: Direction | None, probability: bool) -> bool:
        """Whether bounds from above would stay where they are in an end component, which only rows can be cleared of."""
        if direction is None or probability != (direction == Direction.MAX):
            return False
        return next(self.context.engine.graph.end_components(self.system.states), None) is not None

    def _matrix(self) -> SparseMatrix:
        matrix = self.system.matrix
        if self.rates is None:
            return matrix
        return replace(matrix, data=matrix.data / np.repeat(self.rates, np.diff(matrix.indptr)))

    def among_all(
        self,
        known: list[tuple[StateSet, float]],
        direction: Direction | None,
        *,
        reward: Reward | None = None,
    ) -> Embedded | None:
        """The same equations among the rows of all states, where the engine has these at hand and most of them are needed.

        reward: of rewards, which are finite; None for probabilities. Values outside are those that are `known`, else 0.
        """
        engine = self.context.engine
        matrix = getattr(engine, "matrix", None)
        if (
            engine.exact
            or not isinstance(matrix, SparseMatrix)
            or _MOST * self.system.n < engine.states
        ):
            return None
        constant = None
        if reward is not None:
            whole = engine.system(engine.all)
            states, rows = whole.rewards(reward)
            constant = per_row(whole, states) + rows
        outside = [(engine.to_bools(where), value) for where, value in known]
        unknown = engine.to_bools(self.system.states)
        return Embedded(
            matrix, unknown, outside, constant, direction, reward is None, self.rates is not None
        )

    def solve(
        self,
        problem: LinearProblem | Embedded,
        rest: list[tuple[StateSet, float]],
        *,
        allow_stay: bool = False,
    ) -> Values:
        """The solution, lifted to all states with constants on the sets in `rest`.

        `allow_stay`: a strategy may stay for ever where that costs and earns nothing, with value 0 (greatest rewards); or it
        must not (least probabilities of what is met outside).
        """
        from symcheck.numerics.linear.methods import solve_linear

        if self.system.n == 0:
            return self.system.lift(np.empty(0), None, rest)
        started, options, observer = perf_counter(), self.context.options, self.context.observer
        # End components without reward are made single states, as for least rewards; rewards are not negative, so
        # that waiting is never better than leaving and need not be among the choices of these states.
        against = Direction.MAX if problem.probability else Direction.MIN
        smaller = None
        if allow_stay and not isinstance(problem, Embedded):
            smaller = collapse(replace(problem, matrix=self._matrix(), direction=against))
        if smaller is None:
            found = solve_linear(problem, options, observer)
        else:
            found = smaller.expand(
                solve_linear(
                    replace(smaller.problem, direction=problem.direction), options, observer
                )
            )
        seconds = perf_counter() - started
        width = found.width(self.context.options.relative)
        if found.certified and width > self.context.options.epsilon:
            self.context.log.warn(
                f"the bounds are {width:.1E} apart, further than asked for: {found.explanation}"
            )
        point = found.exact or not found.certified
        self.context.log.runs.append(
            SolverRun(
                "linear",
                found.method,
                self.system.n,
                found.iterations,
                seconds,
                found.explanation,
                found.certified,
            )
        )
        return self.system.lift(
            found.middle if point else found.lower,
            None if point else found.upper,
            rest,
            exact=point,
        )


def equations(context: Context, states: StateSet) -> Equations:
    """The equations over some states."""
    system = context.engine.system(states)
    rates = system.row_sums() if context.engine.model.type is ModelType.CTMC else None
    return Equations(context, system, rates)


def until(context: Context, left: StateSet, right: StateSet, direction: Direction | None) -> Values:
    """Probability of left U right from each state; 0 and 1 exactly where graph analysis finds them."""
    graph = context.engine.graph
    shorter = _shorter(context, left, right, direction)
    if shorter is not None:
        return shorter
    no = graph.prob0(left, right, direction)
    yes = graph.prob1(left, right, direction)
    found = _acyclic(context, ~(no | yes), yes, None, [(yes, 1.0)])
    if found is not None:
        return found
    part = equations(context, ~(no | yes))
    if part.system.n == 0:
        return context.engine.indicator(yes)
    problem = part.among_all([(yes, 1.0)], direction) or part.problem(
        part.one_step_probability(yes), None, direction, probability=True
    )
    return part.solve(problem, [(yes, 1.0)])


def _shorter(
    context: Context, left: StateSet, right: StateSet, direction: Direction | None
) -> Values | None:
    """The probabilities among very many states that mostly have one way on, where the engine passes over these."""
    find = getattr(context.engine, "shorter_until", None)
    found = None if find is None else find(left, right, direction)
    return None if found is None else Equations(context, found, None).solve(found.problem(), [])


def _shorter_reward(
    context: Context, reward: Reward, target: StateSet, direction: Direction | None
) -> Values | None:
    """The same for expected rewards."""
    find = getattr(context.engine, "shorter_reward", None)
    found = None if find is None else find(reward, target, direction)
    if found is None:
        return None
    problem, allowed = found.problem()
    if direction == Direction.MIN and not allowed.all():
        problem = chosen_rows(problem, problem.matrix, allowed)
    return Equations(context, found, None).solve(problem, [])


def boundary_values(context: Context, states: StateSet, outside: Values) -> Values:
    """The expected value of `outside` where a run leaves `states`, which it must do almost surely (DTMC, CTMC)."""
    part = equations(context, states)
    low, high = (part.scaled(v) for v in part.system.one_step_values(outside))
    exact = outside.exact
    inner = part.solve(part.problem(low, None if exact else high, None, probability=False), [])
    return inner.choose(states, outside)


def reach_reward(
    context: Context, reward: Reward, target: StateSet, direction: Direction | None
) -> Values:
    """Expected reward until `target` is reached.

    Infinite where the target is missed with positive probability ('max': under some strategy; 'min': under all), and
    where an infinite reward is met before.
    """
    engine = context.engine
    shorter = _shorter_reward(context, reward, target, direction)
    if shorter is not None:
        return shorter
    # The least expected reward is finite where some strategy reaches almost surely, the greatest where all do.
    certain = engine.graph.prob1(engine.all, target, direction and direction.dual)
    found = _acyclic(context, certain - target, None, reward, [(~certain, np.inf)])
    if found is not None:
        return found
    part = equations(context, certain - target)
    per_step = step_rewards(part, reward)
    if np.isinf(per_step).any():
        certain = certain - _meets_infinity(context, part, per_step, target, direction)
        part = equations(context, certain - target)
        per_step = step_rewards(part, reward)
    # A choice that may lead to where the reward is infinite is never best.
    allowed = (
        part.system.one_step_probability(~certain) == 0 if direction == Direction.MIN else None
    )
    everything = allowed is None or bool(allowed.all())
    embedded = part.among_all([], direction, reward=reward) if everything else None
    if embedded is not None:
        del per_step, allowed
        return part.solve(embedded, [(~certain, np.inf)])
    problem = part.problem(per_step, None, direction, probability=False)
    if allowed is not None and not everything:
        problem = chosen_rows(problem, part.system.matrix, allowed)
    return part.solve(problem, [(~certain, np.inf)])


def _acyclic(
    context: Context,
    states: StateSet,
    target: StateSet | None,
    reward: Reward | None,
    rest: list[tuple[StateSet, float]],
) -> Values | None:
    """The solution over very many states without cycles, where the engine can find it without an array."""
    solve, started = getattr(context.engine, "solve_acyclic", None), perf_counter()
    if solve is None or context.options.method != "auto":
        return None
    found = solve(states, target, reward, rest)
    if found is None:
        return None
    note = f"no cycles: {found.steps} steps on diagrams"
    context.log.runs.append(
        SolverRun(
            "linear", "topological", states.count, found.steps, perf_counter() - started, note, True
        )
    )
    values: Values = found.values
    return values


def step_rewards(part: Equations, reward: Reward) -> Floats:
    """Per row: the expected reward of a step (state rewards of a CTMC are earned per unit of time)."""
    states, rows = part.system.rewards(reward)
    return part.scaled(per_row(part.system, states) + rows)


def _meets_infinity(
    context: Context, part: Equations, reward: Floats, target: StateSet, direction: Direction | None
) -> StateSet:
    """States from which an infinite reward of one step is met, with positive probability, before `target`."""
    if direction == Direction.MIN:
        raise UnsupportedError(
            "least expected rewards where some reward of a single step is infinite are not supported"
        )
    here = best(np.isinf(reward).astype(np.float64), part.system, Direction.MAX)
    source, _ = part.system.lift(here, None).compare(">", 0)
    return context.engine.graph.exists_until(~target, source)


def chosen_rows(problem: LinearProblem, matrix: SparseMatrix, allowed: Bools) -> LinearProblem:
    """The problem with some choices only (bool[rows]; every state keeps one)."""
    matrix = problem.matrix if problem.matrix is not None else matrix
    assert matrix.groups is not None
    assert problem.exit is not None
    rows: Int64s = np.flatnonzero(allowed)
    parts = sparse.select(
        matrix.indptr, matrix.indices, matrix.data, rows, np.arange(matrix.columns, dtype=np.int32)
    )
    before: Int64s = starts_of(allowed)
    chosen = SparseMatrix(*parts, matrix.columns, before[matrix.groups])
    upper = None if problem.upper is None else problem.upper[rows]
    return LinearProblem(
        problem.constant[rows],
        chosen,
        upper,
        problem.exit[rows],
        problem.direction,
        problem.probability,
    )
