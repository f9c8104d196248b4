"""Simpler acceptance on the same states: one set to meet again and again, or one to leave for good, where that is enough.

A deterministic Rabin automaton whose language some deterministic Büchi automaton has, has it by a Büchi condition on its own
edges: those that lie on no rejecting cycle (Krishnan, Puri & Brayton, Deterministic omega-automata vis-a-vis deterministic
Büchi automata, 1994). Dually, where nothing but rejection for ever is to be feared, by the edges on no accepting cycle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symcheck.automata.automaton import Automaton, Pair
from symcheck.automata.reduce import good_edges, numbered, reduced, strong_components
from symcheck.matrices.rows import Bools, Int32s

__all__ = ["counted", "simplified"]

_DEEP = 6
"""Pairs that are looked at one below the other before an automaton is left as it is."""


class _TooManyError(Exception):
    """Too many combinations."""


def simplified(automaton: Automaton) -> Automaton:
    """An automaton of the same words with a single set in its acceptance, where that is enough; else the same."""
    if (
        len(automaton.pairs) == 1
        and len(automaton.pairs[0].visits) + bool(automaton.pairs[0].avoid.any()) <= 1
    ):
        return automaton
    table, pairs = automaton.table, automaton.pairs
    if not pairs:
        return automaton
    try:
        found = _buchi(automaton, table, pairs) or _co_buchi(automaton, table, pairs)
    except _TooManyError:
        return automaton
    return automaton if found is None else reduced(found)


def counted(automaton: Automaton) -> Automaton:
    """An automaton of the same words whose pairs have at most one set to visit: it counts which of several was visited last.

    So that where a run is in the product with a model says what to do next.
    """
    for i, pair in enumerate(automaton.pairs):
        if len(pair.visits) > 1:
            automaton = _counting(automaton, i)
    return numbered(automaton)


def _counting(automaton: Automaton, which: int) -> Automaton:
    """The sets of one pair replaced by the edges that end a round through all of them."""
    pair, table = automaton.pairs[which], automaton.table.astype(np.int64)
    n = len(pair.visits)
    state, count = np.divmod(np.arange(automaton.states * n), n)
    after = np.repeat(count[:, None], automaton.letters, axis=1)
    for i, visit in enumerate(pair.visits):
        after += (after == i) & visit[state]
    ended = after == n
    pairs = [Pair(p.avoid[state], tuple(v[state] for v in p.visits)) for p in automaton.pairs]
    pairs[which] = Pair(pair.avoid[state], (ended,))
    accepting = frozenset(np.flatnonzero(np.isin(state, list(automaton.accepting))).tolist())
    following = (table[state] * n + np.where(ended, 0, after)).astype(np.int32)
    return Automaton(following, automaton.initial * n, tuple(pairs), accepting)


def _buchi(automaton: Automaton, table: Int32s, pairs: tuple[Pair, ...]) -> Automaton | None:
    accepted = ~_rejecting(table, np.ones(table.shape, bool), pairs, _DEEP)
    if any(good_edges(table, Pair(p.avoid | accepted, p.visits)).any() for p in pairs):
        return None
    return replace(automaton, pairs=(Pair(np.zeros(table.shape, bool), (accepted,)),))


def _co_buchi(automaton: Automaton, table: Int32s, pairs: tuple[Pair, ...]) -> Automaton | None:
    left = np.ones(table.shape, bool)
    for pair in pairs:
        left &= ~good_edges(table, pair)
    if _rejecting(table, ~left, pairs, _DEEP).any():
        return None
    return replace(automaton, pairs=(Pair(left),))


def _rejecting(table: Int32s, edges: Bools, pairs: tuple[Pair, ...], depth: int) -> Bools:
    """Of some edges, those on a cycle among them that no pair accepts. Raises _TooManyError where that is too much to ask."""
    of, looping = strong_components(table, edges)
    inside = edges & (of[:, None] == of[table])
    found = np.zeros(table.shape, bool)
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
            found |= here
            continue
        # A smaller cycle is rejected by this pair only if it does without one of its sets.
        if depth == 0:
            raise _TooManyError
        for visit in accepted.visits:
            found |= _rejecting(table, here & ~visit, pairs, depth - 1)
    return found
