"""Accepting end components of a product in which a fair strategy can stay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.check.context import Context
from symcheck.engines.base import Product, StateSet
from symcheck.matrices.rows import Bools, Int64s
from symcheck.numerics.graph import EndComponents, Incidence, maximal_end_components

__all__ = ["fair_end_components"]


def fair_end_components(
    context: Context,
    base: Context,
    product: Product,
    pairs: Sequence[tuple[StateSet, Sequence[StateSet]]],
) -> StateSet:
    """States of the accepting end components in which a fair strategy can stay.

    A strategy is fair if each choice of a state that is visited infinitely often is taken
    infinitely often. Fairness concerns states of the model: in a component, each choice of a model
    state must be possible in combination with some state of the automaton. States that violate this
    are removed, and the components of the remaining states are computed again.

    Args:
        context: the product with the automaton.
        base: the model.
        product: the relation between both.
        pairs: the acceptance pairs (avoid, visits).

    Source: Baier (1998), section 9.4.
    """
    engine = context.engine
    matrix = engine.system(engine.all).matrix
    assert matrix.groups is not None
    edges = Incidence(matrix)
    states = _base_states(base, product, context)
    # The choices of (s, q) are those of s, in the same order.
    row_in_state = np.arange(matrix.rows) - matrix.groups[edges.owner]
    accepting = np.zeros(engine.states, dtype=bool)
    for avoid, visits in pairs:
        within = ~engine.to_bools(avoid)
        while True:
            parts = maximal_end_components(edges, within)
            unfair = _unfair(edges, parts, states, row_in_state)
            if not unfair.any():
                break
            within = (parts.of >= 0) & ~unfair
        accepting |= parts.meeting([engine.to_bools(visit) for visit in visits])
    return engine.from_bools(accepting)


def _base_states(base: Context, product: Product, context: Context) -> Int64s:
    """The index of the model state of each product state, computed bit by bit."""
    numbers = np.arange(base.engine.states, dtype=np.int64)
    result = np.zeros(context.engine.states, dtype=np.int64)
    for bit in range(int(base.engine.states - 1).bit_length()):
        members = base.engine.from_bools((numbers >> bit & 1).astype(bool))
        result |= context.engine.to_bools(product.lift(members)).astype(np.int64) << bit
    return result


def _unfair(edges: Incidence, parts: EndComponents, states: Int64s, row_in_state: Int64s) -> Bools:
    """Product states in a component where some choice of the model state is never possible."""
    result = np.zeros(len(states), dtype=bool)
    inside = np.flatnonzero(parts.of >= 0)
    if len(inside) == 0:
        return result
    keys, index = np.unique(
        np.stack((parts.of[inside].astype(np.int64), states[inside])), axis=1, return_inverse=True
    )
    index_of = np.full(len(states), -1, dtype=np.int64)
    index_of[inside] = index.reshape(-1)
    rows = np.flatnonzero(parts.rows & (index_of[edges.owner] >= 0))
    taken = np.unique(
        index_of[edges.owner[rows]] * (int(row_in_state.max()) + 1) + row_in_state[rows]
    )
    count = np.bincount(taken // (int(row_in_state.max()) + 1), minlength=keys.shape[1])
    result[inside] = count[index_of[inside]] < np.diff(edges.groups)[inside]
    return result
