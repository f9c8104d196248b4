"""Products of automata for the intersection and the union of their languages.

Conjunctions such as `G (a => F b) & G (c => F d)` are translated part by part: the guesses of the
master theorem about independent parts would multiply.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

import numpy as np

from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.automata.reduce import reduced, restrict_to_reachable
from symcheck.errors import UnsupportedError

__all__ = ["intersection", "union"]

_MAX_EDGES = 8_000_000
"""Edges (states times letters) of a product before it is reduced."""
_MAX_PAIRS = 512
"""Rabin pairs of an intersection, which has the product of the numbers of pairs."""


def intersection(parts: Sequence[Automaton]) -> Automaton:
    """The automaton of the words that all parts accept.

    Raises:
        UnsupportedError: the product would be too large.
    """
    return reduce(lambda a, b: _synchronous_product(a, b, conjunctive=True), parts)


def union(parts: Sequence[Automaton]) -> Automaton:
    """The automaton of the words that some part accepts.

    Raises:
        UnsupportedError: the product would be too large.
    """
    return reduce(lambda a, b: _synchronous_product(a, b, conjunctive=False), parts)


def _synchronous_product(a: Automaton, b: Automaton, *, conjunctive: bool) -> Automaton:
    states = a.states * b.states
    if states * a.letters > _MAX_EDGES or (
        conjunctive and len(a.pairs) * len(b.pairs) > _MAX_PAIRS
    ):
        raise UnsupportedError(
            f"the automaton of this LTL formula would have {states:,} states, "
            f"or more than {_MAX_PAIRS} Rabin pairs",
            hint="simplify the formula or use an external translator (-ltl2datool)",
        )
    first, second = np.divmod(np.arange(states), b.states)
    table = (a.table[first].astype(np.int64) * b.states + b.table[second]).astype(np.int32)
    left = [RabinPair(p.avoid[first], tuple(v[first] for v in p.visits)) for p in a.pairs]
    right = [RabinPair(p.avoid[second], tuple(v[second] for v in p.visits)) for p in b.pairs]
    if conjunctive:
        pairs = [RabinPair(p.avoid | q.avoid, (*p.visits, *q.visits)) for p in left for q in right]
    else:
        pairs = left + right
    of_a, of_b = np.isin(first, list(a.accepting)), np.isin(second, list(b.accepting))
    accepting = frozenset(np.flatnonzero(of_a & of_b if conjunctive else of_a | of_b).tolist())
    whole = Automaton(table, a.initial * b.states + b.initial, tuple(pairs), accepting)
    return reduced(restrict_to_reachable(whole))
