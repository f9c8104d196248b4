"""Conditional reachability of MDPs, P(F a | F b), by the reset method.

A run is decided when it first meets `a` or `b`: from there, an unconditional probability is known
to be best. A run that fails to meet `b` starts again in the state that is asked for, which is what
conditioning does, and a strategy may start again wherever it can avoid `b` for ever. So the
greatest conditional probability is one of reachability in the MDP with these resets.

The least one is 1 minus the greatest probability of never meeting `a` under the same condition.

Source: Baier, Klein, Klüppelholz & Märcker (2014), Computing Conditional Probabilities in Markovian
Models Efficiently, section 4.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.measures.reachability import one_step_bounds, until
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, System, Values
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Numbers, full
from symcheck.matrices.rows import Bools, SparseMatrix, starts_of
from symcheck.numerics.linear.until import until_bounds
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.syntax.operators import Operator
from symcheck.tables import counted

__all__ = ["conditional_reachability"]


def conditional_reachability(
    context: Context, target: StateSet, condition: StateSet, direction: Direction
) -> Values:
    """The least or greatest probability of reaching `target`, given that `condition` is reached.

    Strategies that reach the condition with probability 0 are left out.

    Args:
        context: the engine, the options and the log; values are computed at its relevant states.
        target: the states to be reached.
        condition: the states of the condition.
        direction: minimise or maximise over strategies.

    Returns:
        Values in [0, 1], certified; NaN where no strategy reaches the condition.

    Raises:
        UnsupportedError: there are too many relevant states.
    """
    engine, graph = context.engine, context.engine.graph
    undefined = graph.prob0(engine.all, condition, Direction.MAX)
    unknown = ~(target | condition | undefined)
    # After the condition, nothing but the target matters. Met first, the target settles it.
    after = until(context, engine.all, target, direction)
    decided = after.choose(condition, engine.constant(1))
    decided = decided.choose(~undefined, engine.constant(np.nan))
    relevant = unknown if context.relevant_states is None else unknown & context.relevant_states
    if not relevant:
        return decided
    if relevant.count > tuning.CONDITIONAL_STATES:
        raise UnsupportedError(
            "conditional probabilities of an MDP are computed for one state at a time, and "
            f"{relevant.count:,} are asked for",
            hint="filter(state, …) asks for one",
        )
    system = engine.system(unknown, Direction.MAX)
    reset = _Reset.of(context, system, after, target, condition, undefined, direction)
    lower, upper = system.full(0), system.full(1)
    indices = np.flatnonzero(engine.to_bools(relevant)[engine.to_bools(unknown)])
    for index in indices.tolist():
        low, high = reset.solve(context, index)
        if direction is Direction.MIN:
            violation = low, high
            least, greatest = 1 - high, 1 - low
            # Outwards, unless the differences are exact.
            low = least if 1 - least == violation[1] else np.nextafter(least, 0)
            high = greatest if 1 - greatest == violation[0] else np.nextafter(greatest, 1)
        lower[index], upper[index] = low, high
    note = f"{counted(len(indices), 'state')} with resets"
    context.log.runs.append(SolverRun("linear", "reset", system.n, len(indices), note))
    if engine.is_rational:
        # Rationals have no bounds: what is not asked for is not a number.
        absent = np.setdiff1d(np.arange(system.n), indices)
        lower[absent] = np.nan
        return system.lift(lower, None).choose(unknown, decided)
    return system.lift(lower, upper).choose(unknown, decided)


@dataclass(frozen=True, eq=False)
class _Reset:
    """The MDP with resets over n states: state n is success, n+1 is a violation, n+2 the reset.

    lower, upper: the matrix whose greatest probability of success is a lower (an upper) bound; the
    same one if the values after a decision are known.
    """

    n: int
    lower: SparseMatrix = field(repr=False)
    upper: SparseMatrix = field(repr=False)
    error: float

    @staticmethod
    def of(
        context: Context,
        system: System,
        after: Values,
        target: StateSet,
        condition: StateSet,
        undefined: StateSet,
        direction: Direction,
    ) -> _Reset:
        """`after`: the least or greatest probability of reaching the target."""
        engine = context.engine
        one, nothing = engine.constant(1), engine.constant(0)
        meets = until(context, engine.all, condition, direction)
        only_target = target - condition
        # On the states where a run is decided: what follows by the target or without it.
        given = after.choose(condition, nothing)
        without = one.map(Operator.MINUS, after).choose(condition, nothing)
        meets_later = meets.choose(only_target, nothing)
        misses_later = one.map(Operator.MINUS, meets).choose(only_target, nothing)
        greatest = direction is Direction.MAX
        known = {
            "success": (meets if greatest else nothing).choose(
                only_target, given if greatest else without
            ),
            "violation": (nothing if greatest else meets_later).choose(
                only_target, without if greatest else given
            ),
            "reset": one.choose(undefined, misses_later),
        }
        bounds = {name: one_step_bounds(system, values) for name, values in known.items()}
        avoiding = system.restrict(engine.graph.prob0(engine.all, condition, Direction.MIN)) > 0

        def matrix(success: int) -> SparseMatrix:
            """The matrix with the lower (0) or upper (1) bounds of success."""
            reset = 1 - success if greatest else success
            chances = (
                bounds["success"][success],
                bounds["violation"][1 - success],
                bounds["reset"][reset],
            )
            return _with_ends(system, chances, avoiding)

        lower = matrix(0)
        same = all(low is high or np.array_equal(low, high) for low, high in bounds.values())
        error = system.error + (lower.longest + 3) * UNIT_ROUNDOFF
        return _Reset(system.n, lower, lower if same else matrix(1), error)

    def solve(self, context: Context, index: int) -> tuple[Numbers, Numbers]:
        """Bounds on the greatest conditional probability of the state with this number."""
        merged = np.arange(self.n + 3, dtype=np.int32)
        merged[self.n + 2] = index
        goal = np.zeros(self.n + 2, np.bool_)
        goal[self.n] = True
        bounds = []
        for matrix in (self.lower,) if self.upper is self.lower else (self.lower, self.upper):
            closed = matrix.merge(merged, self.n + 2)
            bounds.append(
                until_bounds(
                    closed,
                    np.ones(self.n + 2, np.bool_),
                    goal,
                    Direction.MAX,
                    context.options,
                    observer=context.observer,
                    error=self.error,
                )
            )
        return bounds[0][0][index], bounds[-1][1][index]


def _with_ends(
    system: System, chances: tuple[Numbers, Numbers, Numbers], avoiding: Bools
) -> SparseMatrix:
    """The rows of a system with further columns, a reset for some states, and two absorbing states.

    Args:
        system: n states of an MDP.
        chances: per row, the probabilities of success, of a violation, and of a reset.
        avoiding: the states with a choice that resets for certain, bool[n].
    """
    matrix, n = system.matrix, system.n
    assert matrix.groups is not None
    rows, owner = matrix.row_of_entry, matrix.state_of_row
    extra = np.flatnonzero(avoiding)
    own_rows = [rows, *(np.flatnonzero(c > 0) for c in chances)]
    columns = [matrix.indices, *(np.full(len(r), n + i) for i, r in enumerate(own_rows[1:]))]
    data = [matrix.data, *(c[c > 0] for c in chances)]
    # Then the resets, and the loops of success and violation.
    first = matrix.rows
    own_rows.append(np.arange(first, first + len(extra) + 2))
    columns.append(np.concatenate([np.full(len(extra), n + 2), [n, n + 1]]))
    data.append(full(len(extra) + 2, 1, rational=matrix.is_rational))
    owners = np.concatenate([owner, extra, [n, n + 1]])
    order = np.argsort(owners, kind="stable")
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    placed = rank[np.concatenate(own_rows)]
    entries = np.argsort(placed, kind="stable")
    return SparseMatrix(
        starts_of(np.bincount(placed, minlength=len(order))),
        np.concatenate(columns)[entries].astype(np.int32),
        np.concatenate(data)[entries],
        n + 3,
        starts_of(np.bincount(owners, minlength=n + 2)),
    )
