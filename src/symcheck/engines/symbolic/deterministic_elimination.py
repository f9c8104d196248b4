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

from symcheck.dd.manager import Bdd, Mtbdd
from symcheck.dd.odd import Odd
from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.base import SolvedValues
from symcheck.engines.explicit.array_values import ArrayValues
from symcheck.engines.linear_system import ExpectedReward, Query, chosen_rows, solved_values
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import (
    Piece,
    RestrictableValues,
    SymbolicOwner,
    SymbolicSet,
    SymbolicValues,
    constant_piece,
)
from symcheck.kernels.blocks.block_matrix import BlockOperations
from symcheck.kernels.graph import deterministic_states as kernel
from symcheck.kernels.rows import sparse
from symcheck.machine import available_memory
from symcheck.matrices import tuning as matrix_tuning
from symcheck.matrices.blocks import RowLayout, flatten, quad_dag
from symcheck.matrices.rows import Bools, Floats, Int32s, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import Settings
from symcheck.semantics.rewards import Reward

__all__ = [
    "DeterministicElimination",
    "ReducedSet",
    "ReducedSystem",
    "Successors",
    "deterministic_states",
    "eliminate",
]


def deterministic_states(d: Diagrams) -> Bdd:
    """States whose only choice has a single successor with probability 1 (not in a CTMC)."""
    seen = twice = d.manager.false
    for guard in d.slot_guards:
        twice = twice | (seen & guard)
        seen = seen | guard
    certain = [root.equal(1.0).exists(d.column_cube) for root in d.roots]
    return d.union(certain) & (d.states - twice)


@dataclass(frozen=True, eq=False)
class Successors:
    """The first state after each state that is not eliminated.

    representative: int32[states] (see `ReducedSystem`). path_reward: the reward of the eliminated
    states on the way to it, float64[states]; None where no reward is asked for.
    """

    diagrams: Diagrams = field(repr=False)
    representative: Int32s = field(repr=False)
    path_reward: Floats | None = field(default=None, repr=False)


@dataclass(eq=False)
class ReducedSystem:
    """The system of `left U right` without its deterministic states.

    The n states that remain are numbered as `kept` has them; n stands for `right`, n+1 for all
    states from which the until formula can no longer be satisfied.

    Args:
        successors: for each reachable state the number that represents it.
        matrix: the choices of the n states, and n+2 columns; the last two states have no row. None
            after the equations have been written over it.
        step_reward: per row, the expected reward of a step and of the eliminated path after it,
            float64[rows]; None without a reward.
    """

    left: Bdd = field(repr=False)
    right: Bdd = field(repr=False)
    successors: Successors
    kept: Odd = field(repr=False)
    matrix: SparseMatrix | None
    reward: Reward | None = None
    step_reward: Floats | None = field(default=None, repr=False)

    @property
    def diagrams(self) -> Diagrams:
        """The diagrams of the model."""
        return self.successors.diagrams

    @property
    def representative(self) -> Int32s:
        """The number that represents each state: int32[states]."""
        return self.successors.representative

    @property
    def n(self) -> int:
        """Number of states that remain."""
        return self.kept.count

    @cached_property
    def _edges(self) -> graph.Incidence:
        assert self.matrix is not None
        return graph.Incidence(self.matrix)

    @cached_property
    def _path(self) -> tuple[Bools, Bools]:
        left, right = np.ones(self.n + 2, bool), np.zeros(self.n + 2, bool)
        left[self.n :] = False
        right[self.n] = True
        return left, right

    def prob0(self, direction: Direction | None) -> ReducedSet:
        """States whose (min/max) probability is 0."""
        return self._set(graph.prob0(self._edges, *self._path, direction))

    def prob1(self, direction: Direction | None) -> ReducedSet:
        """States whose (min/max) probability is 1."""
        return self._set(graph.prob1(self._edges, *self._path, direction))

    def _set(self, members: Bools) -> ReducedSet:
        return ReducedSet(self, np.append(members, members[self.n]))

    def take_matrix(self) -> SparseMatrix:
        """The matrix, which the caller may overwrite; no graph question can follow."""
        matrix, self.matrix = self.matrix, None
        vars(self).pop("_edges", None)
        assert matrix is not None
        return matrix

    @cached_property
    def right_count(self) -> int:
        """Number of states of `right`."""
        return SymbolicSet(self.diagrams, self.right).count

    def members(self, states: SymbolicSet) -> Bools | None:
        """A set as `ReducedSet.chosen`; None if it divides the states of one representative."""
        if isinstance(states, ReducedSet) and states.system is self:
            return states.chosen
        members = np.zeros(self.n + 3, bool)
        here = states.bdd & self.right
        if here and here != self.right:
            return None
        members[-1] = bool(here)
        if states.bdd != here:
            inside = self.diagrams.odd.to_mask(states.bdd - here)
            members[self.representative[inside]] = True
            count = np.count_nonzero(members[self.representative])
            if count - members[self.n] * self.right_count != np.count_nonzero(inside):
                return None
        return members


class ReducedSet(SymbolicSet):
    """A set of states by the numbers that represent them; its diagram is built on first use.

    chosen: bool[n+3]; number n stands for the eliminated states that lead to `right`, n+2 for
    `right` itself.
    """

    system: ReducedSystem
    chosen: Bools

    def __init__(self, system: ReducedSystem, chosen: Bools) -> None:
        object.__setattr__(self, "diagrams", system.diagrams)
        object.__setattr__(self, "system", system)
        object.__setattr__(self, "chosen", chosen)

    @cached_property
    def bdd(self) -> Bdd:
        """The set as a diagram."""
        system, last = self.system, bool(self.chosen[-1])
        if self.chosen.all():
            return self.diagrams.states
        if not self.chosen[:-1].any():
            return system.right if last else self.diagrams.manager.false
        bdd = self.diagrams.odd.from_mask(self.chosen[system.representative])
        return bdd | system.right if last else bdd - system.right

    @cached_property
    def count(self) -> int:
        """Number of states in the set."""
        system = self.system
        count = int(np.count_nonzero(self.chosen[system.representative]))
        return count + (int(self.chosen[-1]) - int(self.chosen[system.n])) * system.right_count

    def __bool__(self) -> bool:
        return bool(self.chosen[: self.system.n].any()) or self.count > 0

    def _members(self, other: SymbolicSet) -> Bools | None:
        """The other set as numbers; None where the operation is one of diagrams."""
        return None if "bdd" in vars(self) else self.system.members(other)

    def __and__(self, other: SymbolicSet, /) -> SymbolicSet:
        members = self._members(other)
        return super().__and__(other) if members is None else self._of(self.chosen & members)

    __rand__ = __and__

    def __or__(self, other: SymbolicSet, /) -> SymbolicSet:
        members = self._members(other)
        return super().__or__(other) if members is None else self._of(self.chosen | members)

    __ror__ = __or__

    def __sub__(self, other: SymbolicSet, /) -> SymbolicSet:
        members = self._members(other)
        return super().__sub__(other) if members is None else self._of(self.chosen & ~members)

    def __invert__(self) -> SymbolicSet:
        return super().__invert__() if "bdd" in vars(self) else self._of(~self.chosen)

    def _of(self, chosen: Bools) -> ReducedSet:
        return ReducedSet(self.system, chosen)


def eliminate(
    d: Diagrams, left: Bdd, right: Bdd, limit: int, reward: Reward | None = None
) -> ReducedSystem | None:
    """Build the system of `left U right` without its deterministic states.

    Args:
        d: the diagrams of the model.
        left, right: sets of states.
        limit: bytes that the result and graph questions on it may take.
        reward: the reward to accumulate; None for probabilities.

    Returns:
        The reduced system; None if it would take more memory than `limit`, or some reward is
        negative or infinite.
    """
    if reward is not None and not _finite_rewards(d, reward):
        return None
    between = left - right
    deterministic = between & deterministic_states(d)
    kept = Odd(d.manager, between - deterministic, d.rows)
    if d.count >= 2**31 - 2 or _bytes(d, kept.states, reward) > limit:
        return None
    successors = _successors(d, kept, deterministic, right, reward)
    layout = (
        None
        if d.guards is None
        else RowLayout.of([kept.to_mask(guard) for guard in d.guards], kept.count)
    )
    indptr, indices, data = flatten(
        quad_dag([root.times_bdd(kept.states) for root in d.roots], kept, d.odd, d.columns), layout
    )
    step_reward = None
    if reward is not None:
        assert successors.path_reward is not None
        step_reward = np.empty(len(indptr) - 1)
        sparse.multiply(indptr, indices, data, successors.path_reward, step_reward)
        _add_step(d, kept, layout, reward, step_reward)
    entries = sparse.merge_columns_in_place(
        indptr, indices, data, successors.representative, kept.count + 2
    )
    groups = np.arange(len(indptr), dtype=np.int64) if layout is None else layout.groups
    padded = np.append(groups, [groups[-1], groups[-1]])
    matrix = SparseMatrix(indptr, indices[:entries], data[:entries], kept.count + 2, padded)
    return ReducedSystem(left, right, successors, kept, matrix, reward, step_reward)


def _finite_rewards(d: Diagrams, reward: Reward) -> bool:
    states, transitions = d.rewards(reward)
    functions = (states, *transitions)
    return all(f.minimum_leaf >= 0.0 and f.maximum_leaf < np.inf for f in functions)


def _bytes(d: Diagrams, kept: Bdd, reward: Reward | None) -> int:
    """The memory that `eliminate` takes at most, graph questions included."""
    both = d.manager.cube([*d.rows, *d.columns])
    entries = sum(d.manager.count(relation & kept, both) for relation in d.slot_relations)
    rows = sum(d.manager.count(guard & kept, d.row_cube) for guard in d.slot_guards)
    return 20 * (d.count + entries) + 16 * rows + (0 if reward is None else 8 * (d.count + rows))


def _successors(
    d: Diagrams, kept: Odd, deterministic: Bdd, right: Bdd, reward: Reward | None
) -> Successors:
    n, path_reward = kept.count, None
    representative = np.empty(d.count, np.int32)
    if deterministic:
        # Each row has a single 1. Rows are numbered as all states, so that no other array is as
        # long.
        successor = d.manager.sum([root.times_bdd(deterministic) for root in d.roots])
        BlockOperations(
            quad_dag([successor], d.odd, d.odd, d.columns), matrix_tuning.MAX_BLOCK_RUNS
        ).single_columns(0, representative)
        np.invert(representative, out=representative)  # -1 - successor
    representative[d.odd.to_mask(d.states - deterministic - kept.states - right)] = n + 1
    representative[d.odd.to_mask(right)] = n
    representative[d.odd.to_mask(kept.states)] = np.arange(n, dtype=np.int32)
    if reward is not None:
        steps = [
            f.times_bdd(guard & deterministic)
            for f, guard in zip(_step_rewards(d, reward), d.slot_guards, strict=True)
        ]
        path_reward = d.odd.to_vector(d.manager.sum(steps))
    kernel.resolve_representatives(representative, n + 1, path_reward)
    return Successors(d, representative, path_reward)


def _step_rewards(d: Diagrams, reward: Reward) -> list[Mtbdd]:
    """Per choice class: the reward of a step."""
    states, transitions = d.rewards(reward)
    return [states + each for each in transitions]


def _add_step(
    d: Diagrams, kept: Odd, layout: RowLayout | None, reward: Reward, out: Floats
) -> None:
    """Add to each row the reward of its step."""
    functions = _step_rewards(d, reward)
    if layout is None:
        out += kept.to_vector(functions[0])
        return
    for function, (present, rows) in zip(functions, layout.each(), strict=True):
        out[rows] += kept.to_vector(function)[present]


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


def _lifted(
    successors: Successors,
    known: Floats,
    unknown: Bools,
    lower: Floats,
    upper: Floats | None,
    exact: bool,
) -> SymbolicValues:
    """Values on all states. known: float64[n+2], the values of the numbers that are not unknown."""
    low = known.copy()
    low[unknown] = lower
    high = low
    if upper is not None and upper is not lower:
        high = known.copy()
        high[unknown] = upper
    values = ArrayValues(low, high, unknown if exact else None)
    return RestrictableValues(
        successors.diagrams, partial(_pieces, successors, values), values.exact
    )


@dataclass(frozen=True, eq=False)
class _ReducedUnknowns:
    """The unknowns of a reduced system; lifts a solution to all states."""

    successors: Successors
    known: Floats = field(repr=False)
    unknown: Bools = field(repr=False)

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return int(np.count_nonzero(self.unknown))

    def lift(
        self,
        lower: Floats,
        upper: Floats | None,
        rest: Sequence[tuple[SymbolicSet, float]] = (),  # noqa: ARG002 (in `known` already)
        exact: bool = False,
    ) -> SymbolicValues:
        """Values on all states."""
        return _lifted(self.successors, self.known, self.unknown, lower, upper, exact)


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
    unknowns = _ReducedUnknowns(system.successors, values, unknown)
    problem = _problem(system, query, unknown, outside)
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
    reward = None
    if isinstance(query, ExpectedReward):
        assert system.step_reward is not None
        reward = system.step_reward[full.rows_of(unknown)]
    matrix, enter, leave = _among(full, unknown, outside, direction)
    if reward is None:
        return LinearProblem(enter, matrix, None, leave, direction, True)
    problem = LinearProblem(reward, matrix, None, leave, direction, False)
    usable = enter == 0.0
    if direction is Direction.MIN and not usable.all():
        problem = chosen_rows(problem, matrix, usable)
    return problem


def _pieces(successors: Successors, values: ArrayValues, states: Bdd) -> tuple[Piece, ...]:
    """The values on some states."""
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
        computed = None if computed is None else computed | (path_reward > 0.0)
    if values.upper is values.lower:
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
