"""End components of a distributed model, as single states with the choices that leave them.

For rewards, an end component has choices without a reward only. Within an end component, some
strategy goes from each state to each other one almost surely. So all of its states have the same
value, which is the greatest
probability, or the least reward among the strategies that reach the target almost surely. This is
the best value of a choice that leaves the component. If d is the probability that a choice stays in
the component, its value is (reward + sum over the other successors of p x) / (1 - d).

In the quotient, each component is a state with these choices. Choices that only lead back to their
state are left out (by the sweeps, too). The unknown states are those that precomputation does not
decide. For probabilities, no end component of them is left in the quotient: otherwise, the
components in it would not be maximal. So no strategy stays among them for ever, the equations have
one solution, and sweeps from above converge to it. For rewards, each one that is left has a choice
with a positive reward, so that a strategy that stays in it for ever has an infinite reward. If x is
finite and F(x) <= x for the Bellman operator F of the quotient, the strategy that is greedy for x
has an expected reward of at most x. So it reaches the target almost surely, and x is an upper bound
of the least reward.

Sources: L. de Alfaro: Computing minimum and maximum reachability times in probabilistic systems
(CONCUR 1999), for least rewards; S. Haddad, B. Monmege: Interval iteration algorithm for MDPs and
IMDPs (Theoretical Computer Science 735, 2018), for probabilities; deflation of upper bounds by the
best leaving choice is that of J. Eisentraut, E. Kelmendi, J. Křetínský, M. Weininger: Value
iteration for simple stochastic games (Information and Computation 285, 2022).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symcheck.kernels.arrays import Masks
from symcheck.kernels.graph.mdp_graph import maximal_end_components
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.matrices.tuning import UNDERFLOW_MARGIN

__all__ = ["CollapsedComponents", "StayingRows", "end_components"]


class StayingRows(NamedTuple):
    """The choices of a part that may be taken for ever, between states that are numbered through
    all parts.

    Attributes:
        choices: int64[states], the number of choices of each state of the part.
        lengths: int64[rows], the number of successors of each choice.
        successors: int32.
    """

    choices: Int64s
    lengths: Int64s
    successors: Int32s


def end_components(parts: Sequence[StayingRows]) -> tuple[list[Int32s], int]:
    """The maximal end components with more than one state.

    Returns:
        For each part, the component of each state (int32, -1 for none); the number of components.
    """
    choices = np.concatenate([p.choices for p in parts])
    groups, n = starts_of(choices), len(choices)
    indptr = starts_of(np.concatenate([p.lengths for p in parts]))
    indices = np.concatenate([p.successors for p in parts])
    component, _, count = maximal_end_components(
        indptr,
        indices,
        groups,
        *sparse.transpose(indptr, indices, n),
        np.repeat(np.arange(n, dtype=np.int32), choices),
        np.ones(n, np.uint8),
        None,
    )
    # A choice that only leads back to its state is left out by the sweeps.
    large = np.bincount(component[component >= 0], minlength=count) > 1
    number = np.append(np.where(large, np.cumsum(large) - 1, -1), -1).astype(np.int32)
    ends = np.cumsum([len(p.choices) for p in parts])
    return np.split(number[component], ends[:-1]), int(large.sum())


class CollapsedComponents:
    """The components of a part of a model, whose values come from all parts.

    Args:
        matrix: the rows of the part.
        row_state: int32[rows].
        component: int32[states], -1 for none.
        count: the number of components.
        constant: float64[rows], rewards, with which the least value is the best one; None for
            probabilities, of which the greatest one is the best.
    """

    def __init__(
        self,
        matrix: SparseMatrix,
        row_state: Int32s,
        component: Int32s,
        count: int,
        constant: Floats | None,
    ) -> None:
        self._count, self._is_reward = count, constant is not None
        self._states = np.flatnonzero(component >= 0).astype(np.int32)
        self._component = component[self._states]
        rows = np.flatnonzero(component[row_state] >= 0)
        rows = rows[np.argsort(component[row_state[rows]], kind="stable")]
        inside = matrix.choose(rows)
        home = component[row_state[rows]]
        leaves = component[inside.indices] != np.repeat(home, inside.lengths)
        indptr = starts_of(leaves)[inside.indptr]
        outside = SparseMatrix(indptr, inside.indices[leaves], inside.data[leaves], matrix.states)
        chosen = np.flatnonzero(outside.lengths)  # the others stay in the component for ever
        self._rows = outside.choose(chosen)
        self._leaving = self._rows.row_sums()
        self._constant = 0.0 if constant is None else constant[rows[chosen]]
        self._present, self._starts = np.unique(home[chosen], return_index=True)

    def best_values(self, x: Floats, *, upwards: bool) -> Floats:
        """The best value of a choice of this part that leaves each component, rounded.

        Args:
            x: the values of the states, float64[states].
            upwards: round up, else down.

        Returns:
            float64[components]; for a component without such a choice here, 0 or infinite.
        """
        found = np.full(self._count, np.inf if self._is_reward else 0.0)
        if len(self._present):
            values = (self._constant + self._rows.multiply(x)) / self._leaving
            best = np.minimum if self._is_reward else np.maximum
            found[self._present] = best.reduceat(values, self._starts)
        error = 2 * (self._rows.longest + 8) * np.finfo(np.float64).eps
        if upwards:
            return found * (1 + error) + np.where(found > 0, UNDERFLOW_MARGIN, 0.0)
        return np.maximum(found * (1 - error) - UNDERFLOW_MARGIN, 0.0)

    def raise_lower(self, x: Floats, values: Floats) -> Int32s:
        """Raise lower bounds to values of components; the states whose bounds have risen."""
        new = values[self._component]
        higher = new > x[self._states]
        x[self._states[higher]] = new[higher]
        return self._states[higher]

    def lower_upper(self, x: Floats, violated: Masks, values: Floats) -> Int32s:
        """Lower candidates for upper bounds to values of components, as
        `symcheck.kernels.solve.part_sweeps.PartSweeps.lower_upper` does; the states whose
        candidates have fallen.

        violated: uint8[states], 0 once a step does not raise the candidate of a state. Candidates
            are bounds when all of them are 0.
        """
        new = values[self._component]
        proved = new <= x[self._states]
        violated[self._states[proved]] = 0
        lower = new < x[self._states]
        x[self._states[lower]] = new[lower]
        return self._states[lower]
