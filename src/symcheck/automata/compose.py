"""Automata of conjunctions and disjunctions from those of the parts.

The parts of `G (a => F b) & G (c => F d) & …` have nothing to say to each other; taken together, their automata would be guessed
about in all combinations. Each is made by itself, with the simplest acceptance that it has, and they run side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce as fold

import numpy as np

from symcheck.automata.automaton import Automaton, Pair
from symcheck.automata.reduce import numbered, reduced
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools

__all__ = ["all_of", "any_of", "size"]

_LARGEST = 8_000_000
_PAIRS = 512


def all_of(parts: Sequence[Automaton]) -> Automaton:
    """The automaton of the words that all parts accept. Raises UnsupportedError where it would be too large."""
    return fold(lambda a, b: _beside(a, b, both=True), parts)


def any_of(parts: Sequence[Automaton]) -> Automaton:
    """The automaton of the words that some part accepts. Raises UnsupportedError where it would be too large."""
    return fold(lambda a, b: _beside(a, b, both=False), parts)


def size(automaton: Automaton) -> tuple[int, int]:
    """What makes one automaton better than another: states, then sets of edges to look at."""
    return automaton.states, sum(1 + len(p.visits) for p in automaton.pairs)


def _beside(a: Automaton, b: Automaton, *, both: bool) -> Automaton:
    states = a.states * b.states
    if states * a.letters > _LARGEST or (both and len(a.pairs) * len(b.pairs) > _PAIRS):
        raise UnsupportedError(
            f"the automaton of this formula of linear time has more than {states:,} states or {_PAIRS} pairs; "
            "a simpler formula, or an external translator (-ltl2datool), may do"
        )
    first, second = np.divmod(np.arange(states), b.states)
    table = (a.table[first].astype(np.int64) * b.states + b.table[second]).astype(np.int32)
    left = [Pair(p.avoid[first], tuple(v[first] for v in p.visits)) for p in a.pairs]
    right = [Pair(p.avoid[second], tuple(v[second] for v in p.visits)) for p in b.pairs]
    if both:
        pairs = [
            Pair(p.avoid | q.avoid, _distinct([*p.visits, *q.visits])) for p in left for q in right
        ]
    else:
        pairs = left + right
    of_a, of_b = np.isin(first, list(a.accepting)), np.isin(second, list(b.accepting))
    accepting = frozenset(np.flatnonzero(of_a & of_b if both else of_a | of_b).tolist())
    whole = Automaton(table, a.initial * b.states + b.initial, tuple(pairs), accepting)
    return reduced(numbered(whole))


def _distinct(sets: Sequence[Bools]) -> tuple[Bools, ...]:
    """The sets without those that contain another."""
    return tuple(
        v
        for i, v in enumerate(sets)
        if not any(
            not (w & ~v).any() and (i > j or (v & ~w).any()) for j, w in enumerate(sets) if j != i
        )
    )
