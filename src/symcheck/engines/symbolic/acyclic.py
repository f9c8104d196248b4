"""Chains without cycles among very many states: solved on diagrams, without an array and without numbering a state.

The states whose longest path has k steps are solved by one product from those with fewer, so that the only error is the
rounding of as many steps as there are levels. What values have in common stays in common: in egl with N=10, L=2, the values
of 66 million states are a diagram of some 30 000 nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from symcheck.dd.manager import Bdd, Mtbdd
from symcheck.dd.odd import Odd
from symcheck.engines.base import SolvedValues
from symcheck.engines.linear_system import ExpectedReward, Query, Reachability
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import (
    FEW_LEAVES,
    MANY_STATES,
    Piece,
    RestrictableValues,
    SymbolicSet,
    SymbolicValues,
    array_piece,
    constant_piece,
    constants_on,
    merged,
)
from symcheck.matrices.rows import Floats
from symcheck.numerics.linear.problem import Observer
from symcheck.numerics.settings import Settings
from symcheck.semantics.rewards import Reward

__all__ = ["Acyclic", "AcyclicSolution", "solve_acyclic"]

LARGE = 2_000_000  # unknowns from which on arrays are worth avoiding
BUDGET = 30_000_000  # nodes that products may go over, in all, where arrays are a way out
PER_STATE = 0.25  # and of these for each state: where it works at all it takes a tenth, and arrays take less than five times as long
SHARE = 0.02  # nodes per unknown above which the values have little in common
TINY = 1e-300


@dataclass(frozen=True)
class Acyclic:
    """The solution, the steps that it took, and the relative rounding error that they may have made."""

    values: SymbolicValues
    steps: int
    error: float


def solve_acyclic(
    d: Diagrams,
    states: SymbolicSet,
    target: SymbolicSet | None,
    reward: Reward | None,
    rest: Sequence[tuple[SymbolicSet, float]],
) -> Acyclic | None:
    """Solve x = A x + b over `states` of a DTMC, b the probability of entering `target` next, or a reward structure's reward of a step.

    d: the diagrams of a chain. rest: constants on other sets, 0 elsewhere. None where the states are few, run in circles, or
    their values are no small diagrams; and for rewards that are negative or infinite.
    """
    if states.count < LARGE:
        return None
    budget = min(BUDGET * min(100, 1 + states.count // 100_000_000), int(PER_STATE * states.count))
    allowed = int(min(SHARE * states.count, budget))
    levels = _levels(d, d.roots[0].to_bdd(), states.bdd, allowed, budget)
    constant = None if levels is None else _constant(d, states.bdd, target, reward)
    if levels is None or constant is None:
        return None
    x, spent = d.manager.constant(0.0), 0
    for level in levels:
        here = d.roots[0].times_bdd(level)
        x = x + here.multiply_sum(x.rename(d.to_columns), d.column_cube) + constant.times_bdd(level)
        nodes = x.node_count
        spent += nodes
        if nodes > allowed or spent > budget:
            return None
    # A sum over the column bits is a tree of that depth.
    error = 1.01 * len(levels) * (len(d.columns) + 4) * 2.0**-53
    make = partial(_pieces, d, x, states.bdd, error, rest)
    return Acyclic(RestrictableValues(d, make, exact=False), len(levels), error)


@dataclass(frozen=True, eq=False)
class AcyclicSolution:
    """The preprocessing step for chains: the solution itself, where there are no cycles."""

    diagrams: Diagrams = field(repr=False)

    def accepts(self, query: Query, settings: Settings) -> bool:
        """Whether very many states of a DTMC are unknown, and no other method was asked for."""
        system, auto = query.system, settings.method == "auto"
        is_dtmc = self.diagrams.guards is None and not system.is_ctmc
        return auto and is_dtmc and bool(system.states.count >= LARGE)

    def apply(
        self,
        query: Query,
        known: Sequence[tuple[SymbolicSet, float]],
        settings: Settings,  # noqa: ARG002
        observer: Observer | None,  # noqa: ARG002
    ) -> SolvedValues | None:
        """The solution; None where there is a cycle, or the values are no small diagrams."""
        reward = query.reward if isinstance(query, ExpectedReward) else None
        target = query.target if isinstance(query, Reachability) else None
        states: SymbolicSet = query.system.states
        found = solve_acyclic(self.diagrams, states, target, reward, known)
        if found is None:
            return None
        note = f"no cycles: {found.steps} steps on diagrams"
        return SolvedValues(found.values, "topological", states.count, found.steps, note)


def _levels(d: Diagrams, relation: Bdd, states: Bdd, allowed: int, budget: int) -> list[Bdd] | None:
    """The states by the length of their longest path among the states; None where there is none, or it is too hard to find."""
    left, spent = states, 0
    levels = []
    while left:
        after = left & relation.and_exists(left.rename(d.to_columns), d.column_cube)
        nodes = after.node_count
        spent += nodes
        if after == left or spent > budget or nodes > allowed:
            return None
        levels.append(left - after)
        left = after
    return levels


def _constant(
    d: Diagrams, states: Bdd, target: SymbolicSet | None, reward: Reward | None
) -> Mtbdd | None:
    """The constants b as a function of the row bits, on the states; None where it is negative or infinite somewhere."""
    if target is not None:
        return (
            d.roots[0]
            .multiply_sum(target.bdd.rename(d.to_columns).to_mtbdd(), d.column_cube)
            .times_bdd(states)
        )
    assert reward is not None
    earned, (transitions, *_) = d.rewards(reward)
    found = (earned + transitions).times_bdd(states)
    return found if found.minimum_leaf >= 0.0 and found.maximum_leaf < np.inf else None


def _pieces(
    d: Diagrams,
    function: Mtbdd,
    on: Bdd,
    error: float,
    rest: Sequence[tuple[SymbolicSet, float]],
    states: Bdd,
) -> tuple[Piece, ...]:
    """Of `states`: the function of the row bits `on` some, up to a relative error; constants on the `rest`, 0 elsewhere."""
    pieces = list(constants_on(states - on, rest))
    here = states & on
    if here:
        pieces.extend(_spread_out(d, function.times_bdd(here), here, error))
    return merged(d, pieces)


def _spread_out(d: Diagrams, function: Mtbdd, states: Bdd, error: float) -> Iterator[Piece]:
    """Constants where values are few (or states too many), else an array."""
    leaves = function.leaves
    if len(leaves) > FEW_LEAVES and d.manager.count(states, d.row_cube) <= MANY_STATES:
        odd = Odd(d.manager, states, d.rows)
        values = odd.to_vector(function)
        yield array_piece(states, odd, values * (1.0 - error), _above(values, error), False)
        return
    for leaf in leaves.tolist():
        here = function.equal(leaf) & states
        if here:
            yield constant_piece(here, leaf * (1.0 - error), float(_above(np.array(leaf), error)))


def _above(values: Floats, error: float) -> Floats:
    return np.where(values > 0.0, values * (1.0 + error) + TINY, 0.0)
