"""Acyclic chains with very many states: solved on diagrams, without arrays and state numbers.

The states whose longest path has k steps are solved by one product from those with shorter paths.
The only error is the rounding of as many steps as there are levels. Equal values share nodes: in
egl with N=10, L=2, the values of 66 million states are a diagram of some 30 000 nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from symcheck.dd.manager import Bdd, Mtbdd
from symcheck.engines import tuning
from symcheck.engines.base import SolvedValues
from symcheck.engines.linear_system import ExpectedReward, Query, Reachability
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.sets import (
    Piece,
    RestrictableValues,
    SymbolicSet,
    SymbolicValues,
    constants_on,
    function_pieces,
    merged,
)
from symcheck.numerics.linear.problem import Observer
from symcheck.numerics.settings import Settings
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.rewards import Reward

__all__ = ["Acyclic", "AcyclicSolution", "solve_acyclic"]


@dataclass(frozen=True)
class Acyclic:
    """The solution, the number of steps, and a bound of their relative rounding error."""

    values: SymbolicValues
    steps: int
    error: float


def solve_acyclic(
    d: Diagrams,
    states: SymbolicSet,
    target: SymbolicSet | None,
    reward: Reward | None,
    known: Sequence[tuple[SymbolicSet, float]],
    error: float = 0.0,
    constant_error: float = 0.0,
) -> Acyclic | None:
    """Solve x = A x + b over `states` of a DTMC, level by level.

    Args:
        d: the diagrams of a DTMC.
        states: the unknowns.
        target: b is the one-step probability of entering it; None for rewards.
        reward: b is its expected reward of a step; None for probabilities.
        known: constants on other sets, 0 elsewhere.
        error: the relative error of probabilities.
        constant_error: the relative error of rewards.

    Returns:
        The solution; None if the states are few or have a cycle, if the diagrams of the values are
        large, if some reward is negative or infinite, or if numbers underflow.
    """
    if states.count < tuning.ACYCLIC_STATES:
        return None
    budget = min(
        tuning.ACYCLIC_NODES * min(100, 1 + states.count // 100_000_000),
        int(tuning.ACYCLIC_NODES_PER_STATE * states.count),
    )
    allowed = int(min(tuning.ACYCLIC_NODE_SHARE * states.count, budget))
    levels = _levels(d, d.roots[0].to_bdd(), states.bdd, allowed, budget)
    constant = None if levels is None else _constant(d, states.bdd, target, reward)
    if levels is None or constant is None:
        return None
    x, spent = d.manager.constant(0.0), 0
    for level in levels:
        covered = d.roots[0].times_bdd(level)
        x = (
            x
            + covered.multiply_sum(x.rename(d.to_columns), d.column_cube)
            + constant.times_bdd(level)
        )
        nodes = x.node_count
        spent += nodes
        if nodes > allowed or spent > budget:
            return None
    leaves = x.leaves
    least = float(leaves[leaves > 0.0].min(initial=np.inf))
    if d.entry_range[0] * least < np.finfo(np.float64).tiny:
        return None  # products that underflow have no relative error
    # The sum over the column bits is a tree with one level per bit.
    error = 1.01 * (len(levels) * ((len(d.columns) + 4) * UNIT_ROUNDOFF + error) + constant_error)
    make = partial(_pieces, d, x, states.bdd, error, known)
    return Acyclic(RestrictableValues(d, make, is_point=False), len(levels), error)


@dataclass(frozen=True, eq=False)
class AcyclicSolution:
    """The preprocessing step that solves acyclic chains."""

    diagrams: Diagrams = field(repr=False)

    def accepts(self, query: Query[SymbolicSet, SymbolicValues], settings: Settings) -> bool:
        """Whether very many states of a DTMC are unknown, and no other method was requested."""
        system, auto = query.system, settings.method == "auto"
        is_discrete_chain = self.diagrams.guards is None and not system.continuous_time
        return auto and is_discrete_chain and bool(system.states.count >= tuning.ACYCLIC_STATES)

    def apply(
        self,
        query: Query[SymbolicSet, SymbolicValues],
        known: Sequence[tuple[SymbolicSet, float]],
        settings: Settings,  # noqa: ARG002
        observer: Observer | None,  # noqa: ARG002
    ) -> SolvedValues[SymbolicValues] | None:
        """The solution; None if there is a cycle, or the diagrams of the values are large."""
        reward = query.reward if isinstance(query, ExpectedReward) else None
        target = query.target if isinstance(query, Reachability) else None
        states: SymbolicSet = query.system.states
        errors = query.system.error, query.constant_error
        solution = solve_acyclic(self.diagrams, states, target, reward, known, *errors)
        if solution is None:
            return None
        note = f"no cycles: {solution.steps} steps on diagrams"
        return SolvedValues(solution.values, "topological", states.count, solution.steps, note)


def _levels(d: Diagrams, relation: Bdd, states: Bdd, allowed: int, budget: int) -> list[Bdd] | None:
    """The states by the length of their longest path; None if there is a cycle or no budget."""
    remaining, spent = states, 0
    levels = []
    while remaining:
        deeper = remaining & relation.and_exists(remaining.rename(d.to_columns), d.column_cube)
        nodes = deeper.node_count
        spent += nodes
        if deeper == remaining or spent > budget or nodes > allowed:
            return None
        levels.append(remaining - deeper)
        remaining = deeper
    return levels


def _constant(
    d: Diagrams, states: Bdd, target: SymbolicSet | None, reward: Reward | None
) -> Mtbdd | None:
    """The constants b on the states, a function of the row bits.

    None if some constant is negative or infinite.
    """
    if target is not None:
        return (
            d.roots[0]
            .multiply_sum(target.bdd.rename(d.to_columns).to_mtbdd(), d.column_cube)
            .times_bdd(states)
        )
    assert reward is not None
    earned, (transitions, *_) = d.rewards(reward)
    solution = (earned + transitions).times_bdd(states)
    return solution if solution.minimum_leaf >= 0.0 and solution.maximum_leaf < np.inf else None


def _pieces(
    d: Diagrams,
    function: Mtbdd,
    domain: Bdd,
    error: float,
    known: Sequence[tuple[SymbolicSet, float]],
    states: Bdd,
) -> tuple[Piece, ...]:
    """The values on `states`.

    Args:
        d: the diagrams.
        function: the values on `domain`, a function of the row bits.
        domain: the states that were solved.
        error: the relative error of the function.
        known: constants on other sets, 0 elsewhere.
        states: a set that is not empty.
    """
    pieces = list(constants_on(states - domain, known))
    covered = states & domain
    if covered:
        pieces.extend(function_pieces(d, function.times_bdd(covered), covered, error))
    return merged(d, pieces)
