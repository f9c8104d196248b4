"""The system of an until formula without deterministic states, and sets by its numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from symcheck.dd.manager import Bdd
from symcheck.dd.odd import Odd
from symcheck.direction import Direction
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import SymbolicSet
from symcheck.matrices.rows import Bools, Floats, Int32s, SparseMatrix
from symcheck.numerics import graph
from symcheck.semantics.rewards import Reward

__all__ = ["ReducedSet", "ReducedSystem", "Successors"]


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
