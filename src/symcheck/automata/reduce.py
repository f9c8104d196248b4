"""Reduction: rejecting states become one, equivalent states are merged, redundant pairs dropped."""

from __future__ import annotations

import numpy as np

from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.matrices.rows import Bools, Int32s, SparseMatrix
from symcheck.numerics.graph import Incidence, backward_reachable, forward_reachable, sccs

__all__ = ["accepting_edges", "reduced", "restrict_to_reachable", "strong_components"]


def _graph(delta: Int32s, edges: Bools | None = None) -> Incidence:
    """The graph of the automaton (or of some of its edges) on the states."""
    states, letters = delta.shape
    kept = np.ones(delta.shape, dtype=bool) if edges is None else edges
    pairs = np.unique(
        np.repeat(np.arange(states, dtype=np.int64), letters)[kept.ravel()] * states
        + delta.ravel()[kept.ravel()]
    )
    indptr = np.searchsorted(pairs, np.arange(states + 1, dtype=np.int64) * states).astype(np.int64)
    return Incidence(
        SparseMatrix(indptr, (pairs % states).astype(np.int32), np.ones(len(pairs)), states)
    )


def strong_components(delta: Int32s, edges: Bools | None = None) -> tuple[Int32s, Bools]:
    """Strong components of an automaton.

    Returns:
        The component of each state (int32[states]), and whether each component has an inner edge
        (bool[components]).
    """
    parts = sccs(_graph(delta, edges))
    inside = parts.of[:, None] == parts.of[delta]
    if edges is not None:
        inside &= edges
    looping = np.zeros(parts.count, dtype=bool)
    looping[parts.of[inside.any(axis=1)]] = True
    return parts.of, looping


def reduced(automaton: Automaton) -> Automaton:
    """An automaton of the same language with one rejecting sink and without equivalent states."""
    pairs = _normalise_pairs(automaton)
    dead = ~backward_reachable(_graph(automaton.table), _on_accepted_cycles(automaton.table, pairs))
    delta = automaton.table.copy()
    if dead.any():
        delta[dead] = np.flatnonzero(dead)[0]
        pairs = tuple(
            RabinPair(p.avoid | dead[:, None], tuple(v & ~dead[:, None] for v in p.visits))
            for p in pairs
        )
    return restrict_to_reachable(
        _merge_equivalent_states(Automaton(delta, automaton.initial, pairs, automaton.accepting))
    )


def _normalise_pairs(automaton: Automaton) -> tuple[RabinPair, ...]:
    """The pairs in a normal form, without those that accept nothing or less than another one.

    Edges that no accepted run takes infinitely often are all in `avoid` and in no set of `visits`.
    """
    kept = []
    of, _ = strong_components(automaton.table)
    inside = of[:, None] == of[automaton.table]
    for pair in automaton.pairs:
        good = accepting_edges(automaton.table, pair)
        if good.any():
            # In a component that accepts nothing, every edge is avoided.
            useful = np.zeros(int(of.max()) + 1, dtype=bool)
            useful[of[good.any(axis=1)]] = True
            here = inside & useful[of][:, None]
            visits = tuple(v & here & ~pair.avoid for v in pair.visits)
            kept.append(RabinPair(np.where(here, pair.avoid, inside), visits))
    return tuple(
        p
        for i, p in enumerate(kept)
        if not any(_subsumes(o, p, strictly=j > i) for j, o in enumerate(kept) if j != i)
    )


def _subsumes(pair: RabinPair, other: RabinPair, *, strictly: bool) -> bool:
    """Whether the sets show that a pair accepts all runs of another (`strictly`: and more)."""
    if strictly and _subsumes(other, pair, strictly=False):
        return False
    if np.any(pair.avoid & ~other.avoid):
        return False
    return all(any(not np.any(w & ~v) for w in other.visits) for v in pair.visits)


def accepting_edges(delta: Int32s, pair: RabinPair) -> Bools:
    """Edges in components, without the edges to avoid, that contain edges of every set to visit."""
    usable = ~pair.avoid
    of, looping = strong_components(delta, usable)
    inside = usable & (of[:, None] == of[delta])
    good = looping.copy()
    for visit in pair.visits:
        met = np.zeros(len(looping), dtype=bool)
        met[of[(visit & inside).any(axis=1)]] = True
        good &= met
    result: Bools = inside & good[of][:, None]
    return result


def _on_accepted_cycles(delta: Int32s, pairs: tuple[RabinPair, ...]) -> Bools:
    """States on a cycle that some pair accepts."""
    alive = np.zeros(len(delta), dtype=bool)
    for pair in pairs:
        alive |= accepting_edges(delta, pair).any(axis=1)
    return alive


def _merge_equivalent_states(automaton: Automaton) -> Automaton:
    """Merge states with the same acceptance and successors (Moore's partition refinement)."""
    delta, pairs = automaton.table, automaton.pairs
    sets = [s for p in pairs for s in (p.avoid, *p.visits)]
    accepting = np.isin(np.arange(len(delta)), list(automaton.accepting))
    signature = np.concatenate([accepting[:, None], *sets], axis=1) if sets else accepting[:, None]
    _, block = np.unique(signature, axis=0, return_inverse=True)
    block = block.reshape(-1)
    while True:
        _, finer = np.unique(np.column_stack([block, block[delta]]), axis=0, return_inverse=True)
        finer = finer.reshape(-1)
        if finer.max() == block.max():
            break
        block = finer
    _, chosen = np.unique(block, return_index=True)
    smaller = tuple(RabinPair(p.avoid[chosen], tuple(v[chosen] for v in p.visits)) for p in pairs)
    states = frozenset(int(block[q]) for q in automaton.accepting)
    return Automaton(
        block[delta[chosen]].astype(np.int32), int(block[automaton.initial]), smaller, states
    )


def restrict_to_reachable(automaton: Automaton) -> Automaton:
    """The automaton on its reachable states, with the initial state first."""
    start = np.zeros(automaton.states, dtype=bool)
    start[automaton.initial] = True
    reached = forward_reachable(_graph(automaton.table), start)
    order = np.concatenate(([automaton.initial], np.flatnonzero(reached & ~start)))
    number = np.full(automaton.states, -1, dtype=np.int32)
    number[order] = np.arange(len(order), dtype=np.int32)
    pairs = tuple(
        RabinPair(p.avoid[order], tuple(v[order] for v in p.visits)) for p in automaton.pairs
    )
    accepting = frozenset(int(number[q]) for q in automaton.accepting if reached[q])
    return Automaton(number[automaton.table[order]], 0, pairs, accepting)
