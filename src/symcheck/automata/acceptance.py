"""Simpler acceptance conditions on the same automaton: Büchi or co-Büchi where that suffices.

If some deterministic Büchi automaton accepts the language of a deterministic Rabin automaton, the
Rabin automaton itself does, with the Büchi set of all edges that lie on no rejecting cycle
(Krishnan, Puri & Brayton, "Deterministic ω-automata vis-a-vis deterministic Büchi automata", ISAAC
1994). Dually, for co-Büchi acceptance the edges on no accepting cycle are avoided.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.automata.reduce import (
    accepting_edges,
    reduced,
    restrict_to_reachable,
    strong_components,
)
from symcheck.matrices.rows import Bools, Int32s

__all__ = ["degeneralize", "simplify_acceptance"]

_MAX_PAIR_DEPTH = 6
"""Nesting of accepting components in the search for rejecting cycles, which is exponential in it;
beyond, the acceptance condition is not simplified."""


class _TooDeepError(Exception):
    """The search for rejecting cycles exceeds _MAX_PAIR_DEPTH."""


def simplify_acceptance(automaton: Automaton) -> Automaton:
    """An automaton of the same language, with Büchi or co-Büchi acceptance if possible."""
    table, pairs = automaton.table, automaton.pairs
    if len(pairs) < 2 and all(len(p.visits) + bool(p.avoid.any()) <= 1 for p in pairs):
        return automaton
    try:
        simpler = _as_buchi(automaton, table, pairs) or _as_co_buchi(automaton, table, pairs)
    except _TooDeepError:
        return automaton
    return automaton if simpler is None else reduced(simpler)


def degeneralize(automaton: Automaton) -> Automaton:
    """A Rabin automaton of the same language: every pair has at most one set to visit.

    A counter in the state tells which set of a pair must be visited next. A strategy on the product
    with a model is then memoryless.
    """
    for i, pair in enumerate(automaton.pairs):
        if len(pair.visits) > 1:
            automaton = _degeneralize_pair(automaton, i)
    return restrict_to_reachable(automaton)


def _degeneralize_pair(automaton: Automaton, which: int) -> Automaton:
    """Replace the sets to visit of one pair by the edges that complete a round through them."""
    pair, table = automaton.pairs[which], automaton.table.astype(np.int64)
    n = len(pair.visits)
    state, count = np.divmod(np.arange(automaton.states * n), n)
    after = np.repeat(count[:, None], automaton.letters, axis=1)
    for i, visit in enumerate(pair.visits):
        after += (after == i) & visit[state]
    ended = after == n
    pairs = [RabinPair(p.avoid[state], tuple(v[state] for v in p.visits)) for p in automaton.pairs]
    pairs[which] = RabinPair(pair.avoid[state], (ended,))
    accepting = frozenset(np.flatnonzero(np.isin(state, list(automaton.accepting))).tolist())
    following = (table[state] * n + np.where(ended, 0, after)).astype(np.int32)
    return Automaton(following, automaton.initial * n, tuple(pairs), accepting)


def _as_buchi(
    automaton: Automaton, table: Int32s, pairs: tuple[RabinPair, ...]
) -> Automaton | None:
    accepted = ~_edges_on_rejecting_cycles(
        table, np.ones(table.shape, bool), pairs, _MAX_PAIR_DEPTH
    )
    if any(accepting_edges(table, RabinPair(p.avoid | accepted, p.visits)).any() for p in pairs):
        return None
    return replace(automaton, pairs=(RabinPair(np.zeros(table.shape, bool), (accepted,)),))


def _as_co_buchi(
    automaton: Automaton, table: Int32s, pairs: tuple[RabinPair, ...]
) -> Automaton | None:
    left = np.ones(table.shape, bool)
    for pair in pairs:
        left &= ~accepting_edges(table, pair)
    if _edges_on_rejecting_cycles(table, ~left, pairs, _MAX_PAIR_DEPTH).any():
        return None
    return replace(automaton, pairs=(RabinPair(left),))


def _edges_on_rejecting_cycles(
    table: Int32s, edges: Bools, pairs: tuple[RabinPair, ...], depth: int
) -> Bools:
    """Edges (of the given ones) on a cycle among them that no pair accepts.

    Raises:
        _TooDeepError: the components are nested too deeply.
    """
    of, looping = strong_components(table, edges)
    inside = edges & (of[:, None] == of[table])
    result = np.zeros(table.shape, bool)
    for component in np.flatnonzero(looping):
        here = inside & (of == component)[:, None]
        accepted = next(
            (
                p
                for p in pairs
                if not (p.avoid & here).any() and all((v & here).any() for v in p.visits)
            ),
            None,
        )
        if accepted is None:
            result |= here
            continue
        # A smaller cycle is rejected by this pair only if it misses one of its sets.
        if depth == 0:
            raise _TooDeepError
        for visit in accepted.visits:
            result |= _edges_on_rejecting_cycles(table, here & ~visit, pairs, depth - 1)
    return result
