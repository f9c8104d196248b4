"""Preprocessing: deterministic-state elimination for reachability among very many states.

A state whose only choice has a single successor (probability 1) has the same value as that
successor, so it can be eliminated. In models of timed systems nearly all states are such: of the
84 856 004 states of csma with 3 stations and 6 collisions, 2 % are not. Diagrams tell which; one
product with the numbers of the states gives the successor of each, and following successors to the
end takes one pass. The rows of the other states remain (`ReducedSystem`), few enough for graph
algorithms that take linear time, where fixpoints on diagrams take as many steps as the longest path
has. Elimination preserves reachability values, but not step counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from weakref import ref

import numpy as np

from symcheck.dd.manager import Bdd
from symcheck.dd.odd import Odd
from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.base import SolvedValues
from symcheck.engines.explicit.array_values import ArrayValues
from symcheck.engines.linear_system import ExpectedReward, Query, chosen_rows, solved_values
from symcheck.engines.symbolic.eliminate_states import deterministic_states, eliminate
from symcheck.engines.symbolic.reduced_system import ReducedSet, ReducedSystem, Successors
from symcheck.engines.symbolic.sets import (
    Piece,
    RestrictableValues,
    SymbolicOwner,
    SymbolicSet,
    SymbolicValues,
    constant_piece,
)
from symcheck.kernels.graph import deterministic_states as kernel
from symcheck.machine import available_memory
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import Settings
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.rewards import Reward

__all__ = ["DeterministicElimination"]


@dataclass(eq=False)
class DeterministicElimination:
    """The preprocessing step, and the reduced system that was made last."""

    engine: SymbolicOwner = field(repr=False)
    _last: ref[ReducedSystem] | None = field(default=None, repr=False)

    @cached_property
    def possible(self) -> bool:
        """Whether the model is very large and not a CTMC, and the engine works with rows."""
        d = self.engine.diagrams
        large = d.count >= tuning.ELIMINATION_STATES and d.transition_count > tuning.FEW_TRANSITIONS
        steps = not self.engine.model.type.continuous_time
        return self.engine.rows_limit is None and steps and large

    def last(self, left: Bdd, right: Bdd, reward: Reward | None = None) -> ReducedSystem | None:
        """The system reduced last, if it is the one of this question and still in use."""
        system = None if self._last is None else self._last()
        if system is None or system.matrix is None:
            return None
        same = system.left == left and system.right == right
        return system if same and reward in (None, system.reward) else None

    def reduced(self, left: Bdd, right: Bdd, reward: Reward | None = None) -> ReducedSystem | None:
        """The system of `left U right` without its deterministic states; None where memory does not
        suffice.
        """
        if not self.possible:
            return None
        system = self.last(left, right, reward)
        if system is None:
            limit = int(tuning.ELIMINATION_MEMORY_SHARE * available_memory())
            system = eliminate(self.engine.diagrams, left, right, limit, reward)
            self._last = None if system is None else ref(system)
        return system

    def accepts(self, query: Query[SymbolicSet, SymbolicValues], settings: Settings) -> bool:
        """Whether the unknowns are those of a reduced system, or many and mostly deterministic.

        A strategy needs the rows of all unknowns.
        """
        states: SymbolicSet = query.system.states
        if settings.strategy and query.system.direction is not None:
            return False
        if isinstance(states, ReducedSet):
            return True
        if not self.possible or states.count < tuning.ELIMINATION_STATES:
            return False
        d = self.engine.diagrams
        deterministic = SymbolicSet(d, states.bdd & deterministic_states(d))
        return 2 * deterministic.count >= states.count

    def apply(
        self,
        query: Query[SymbolicSet, SymbolicValues],
        known: Sequence[tuple[SymbolicSet, float]],
        settings: Settings,
        observer: Observer | None,
    ) -> SolvedValues[SymbolicValues] | None:
        """The solution on the reduced system; None where memory does not suffice."""
        states: SymbolicSet = query.system.states
        reward = query.reward if isinstance(query, ExpectedReward) else None
        system = states.system if isinstance(states, ReducedSet) else None
        if system is None or system.matrix is None or reward != system.reward:
            system = self._system_of(query, states, reward)
        if system is None:
            return None
        return _solved(system, query, states, known, settings, observer)

    def _system_of(
        self, query: Query[SymbolicSet, SymbolicValues], states: SymbolicSet, reward: Reward | None
    ) -> ReducedSystem | None:
        if isinstance(query, ExpectedReward):
            target: SymbolicSet = ~(states | query.infinite)
        else:
            target = query.target
        return self.reduced((states | target).bdd, target.bdd, reward)


def _solved(
    system: ReducedSystem,
    query: Query[SymbolicSet, SymbolicValues],
    states: SymbolicSet,
    known: Sequence[tuple[SymbolicSet, float]],
    settings: Settings,
    observer: Observer | None,
) -> SolvedValues[SymbolicValues] | None:
    """The solution of a query on a reduced system that represents its sets."""
    n, sets = system.n, [states, _outside(query), *(where for where, _ in known)]
    chosen = [members for members in map(system.members, sets) if members is not None]
    if len(chosen) < len(sets):
        return None
    unknown, outside, values = chosen[0][: n + 2].copy(), chosen[1][: n + 2].copy(), np.zeros(n + 2)
    unknown[n:] = False
    outside[n] |= chosen[1][-1]  # the matrix has one column for `right` and for what leads to it
    for members, (_, value) in zip(chosen[2:], known, strict=True):
        values[members[: n + 2]] = value
        if members[-1]:
            values[n] = value
    problem = _problem(system, query, unknown, outside)
    unknowns = _ReducedUnknowns(system.successors, values, unknown, 1.01 * problem.constant_error)
    return solved_values(unknowns, problem, known, settings, observer)


def _outside(query: Query[SymbolicSet, SymbolicValues]) -> SymbolicSet:
    """The set of states outside of the unknowns that have a constant of their own."""
    states: SymbolicSet = query.infinite if isinstance(query, ExpectedReward) else query.target
    return states


def _problem(
    system: ReducedSystem, query: Query[SymbolicSet, SymbolicValues], unknown: Bools, outside: Bools
) -> LinearProblem:
    """The equations among the unknowns, written over the rows of the reduced system."""
    direction, full = query.system.direction, system.take_matrix()
    # Probabilities into states of one value are added.
    reward, error = None, query.system.error + full.longest * UNIT_ROUNDOFF
    if isinstance(query, ExpectedReward):
        assert system.step_reward is not None
        reward = system.step_reward[full.rows_of(unknown)]
    matrix, enter, leave = _among(full, unknown, outside, direction)
    if reward is None:
        return LinearProblem(enter, matrix, None, leave, direction, True, error=error)
    # Rewards of the states on a path without choices are added.
    constant_error = query.constant_error + len(system.successors.representative) * UNIT_ROUNDOFF
    problem = LinearProblem(
        reward,
        matrix,
        None,
        leave,
        direction,
        False,
        error=error,
        constant_error=constant_error,
    )
    usable = enter == 0.0
    if direction is Direction.MIN and not usable.all():
        problem = chosen_rows(problem, matrix, usable)
    return problem


def _among(
    m: SparseMatrix, open_: Bools, member: Bools, direction: Direction | None
) -> tuple[SparseMatrix, Floats, Floats]:
    """The matrix among some states, written over m.

    Returns:
        The matrix; per row, the probability of entering other members, and of leaving.
    """
    assert m.groups is not None
    n = int(np.count_nonzero(open_))
    number = np.full(m.columns, -1, np.int32)
    number[open_] = np.arange(n, dtype=np.int32)
    groups, into, leave, entries = kernel.restrict_in_place(
        *m.arrays, m.groups, member.view(np.uint8), number, n
    )
    rows = m.indptr[: len(into) + 1], m.indices[:entries], m.data[:entries]
    return SparseMatrix(*rows, n, None if direction is None else groups), into, leave


@dataclass(frozen=True, eq=False)
class _ReducedUnknowns:
    """The unknowns of a reduced system; lifts a solution to all states.

    known: float64[n+2], the values of the numbers that are not unknown. error: of the rewards of
      paths, relative.
    """

    successors: Successors
    known: Floats = field(repr=False)
    unknown: Bools = field(repr=False)
    error: float = 0.0

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return int(np.count_nonzero(self.unknown))

    def lift(
        self,
        lower: Floats,
        upper: Floats | None,
        rest: Sequence[tuple[SymbolicSet, float]] = (),  # noqa: ARG002 (in `known` already)
        up_to_rounding: bool = False,
    ) -> SymbolicValues:
        """Values on all states."""
        low = self.known.copy()
        low[self.unknown] = lower
        high = low
        if upper is not None and upper is not lower:
            high = self.known.copy()
            high[self.unknown] = upper
        values = ArrayValues(low, high, self.unknown if up_to_rounding else None)
        pieces = partial(_pieces, self.successors, values, self.error)
        return RestrictableValues(self.successors.diagrams, pieces, values.is_point)


def _pieces(
    successors: Successors, values: ArrayValues, error: float, states: Bdd
) -> tuple[Piece, ...]:
    """The values on some states; error: see `_ReducedUnknowns`."""
    d = successors.diagrams
    whole = states == d.states
    odd = d.odd if whole else Odd(d.manager, states, d.rows)
    if not odd.count:
        return ()
    positions = slice(None) if whole else odd.indices_in(d.odd)
    numbers = successors.representative[positions]
    low, high = values.lower[numbers], values.upper[numbers]
    computed = None if values.computed is None else values.computed[numbers]
    if successors.path_reward is not None:
        path_reward = successors.path_reward[positions]
        low, high = low + path_reward, high + path_reward
        margin = error * path_reward + UNIT_ROUNDOFF * np.abs(high)
        margin[np.isinf(high)] = 0.0
        low, high = low - margin, high + margin
        computed = None if computed is None else computed | (path_reward > 0.0)
    if values.upper is values.lower and successors.path_reward is None:
        high = low
    if (
        low.min() == low.max()
        and high.min() == high.max()
        and (computed is None or computed.all() or not computed.any())
    ):
        return (
            constant_piece(
                states, float(low[0]), float(high[0]), computed is not None and bool(computed[0])
            ),
        )
    return (Piece(states, ArrayValues(low, high, computed), odd),)
