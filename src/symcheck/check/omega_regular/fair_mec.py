"""End components in which a fair strategy can stay, in a product with an automaton."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symcheck.check.context import Context
from symcheck.engines.base import StateSet
from symcheck.engines.product import Product
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

    `context` is the product with the automaton, `base` the model.

    A strategy is fair if each choice of a state that is visited infinitely often is taken
    infinitely often. What counts is the model's state: in a component, each of its choices must be
    possible with some state of the automaton. A state of which this is not so is left out, and the
    rest looked at again. Source: Baier (1998), section 9.4.
    """
    engine = context.engine
    matrix = engine.system(engine.all).matrix
    assert matrix.groups is not None
    edges = Incidence(matrix)
    states = _base_states(base, product, context)
    # The choices of (s, q) are those of s, in the same order.
    row_in_state = np.arange(matrix.rows) - matrix.groups[edges.owner]
    found = np.zeros(engine.states, dtype=bool)
    for avoid, visits in pairs:
        within = ~engine.to_bools(avoid)
        while True:
            parts = maximal_end_components(edges, within)
            unfair = _unfair(edges, parts, states, row_in_state)
            if not unfair.any():
                break
            within = (parts.of >= 0) & ~unfair
        good = np.ones(parts.count, dtype=bool)
        for visit in visits:
            met = parts.of[engine.to_bools(visit) & (parts.of >= 0)]
            good &= np.isin(np.arange(parts.count), met)
        inside = parts.of >= 0
        found[inside] |= good[parts.of[inside]]
    return engine.from_bools(found)


def _base_states(base: Context, product: Product, context: Context) -> Int64s:
    """For each state of the product, the index of its state of the model, found bit by bit."""
    numbers = np.arange(base.engine.states, dtype=np.int64)
    result = np.zeros(context.engine.states, dtype=np.int64)
    for bit in range(int(base.engine.states - 1).bit_length()):
        members = base.engine.from_bools((numbers >> bit & 1).astype(bool))
        result |= context.engine.to_bools(product.lift(members)).astype(np.int64) << bit
    return result


def _unfair(edges: Incidence, parts: EndComponents, states: Int64s, row_in_state: Int64s) -> Bools:
    """Pairs in an end component in which some choice of the model's state is never possible."""
    result = np.zeros(len(states), dtype=bool)
    inside = np.flatnonzero(parts.of >= 0)
    if len(inside) == 0:
        return result
    places, place = np.unique(
        np.stack((parts.of[inside].astype(np.int64), states[inside])), axis=1, return_inverse=True
    )
    place_of = np.full(len(states), -1, dtype=np.int64)
    place_of[inside] = place.reshape(-1)
    rows = np.flatnonzero(parts.rows & (place_of[edges.owner] >= 0))
    taken = np.unique(
        place_of[edges.owner[rows]] * (int(row_in_state.max()) + 1) + row_in_state[rows]
    )
    count = np.bincount(taken // (int(row_in_state.max()) + 1), minlength=places.shape[1])
    result[inside] = count[place_of[inside]] < np.diff(edges.groups)[inside]
    return result
