"""Automata of the formulas that people write: patterns of specification, responses, fairness, GR(1). How large they are, and
that they accept the right words.

The patterns are those of Dwyer, Avrunin & Corbett, Patterns in property specifications for finite-state verification (1999).
"""

from __future__ import annotations

from functools import reduce
from random import Random

import numpy as np
import pytest

from automata.words import holds, made, random_word
from symcheck.automata.acceptance import degeneralize, simplify_acceptance
from symcheck.automata.automaton import Automaton, RabinPair
from symcheck.automata.ltl import LtlFactory
from symcheck.automata.translate import translate

P, S, Q, R = (("p", i) for i in range(4))


def no(t):
    return ("!", t)


def both(*parts):
    return reduce(lambda a, b: ("&", a, b), parts)


def either(*parts):
    return reduce(lambda a, b: ("|", a, b), parts)


def implies(a, b):
    return ("|", no(a), b)


def pairs(make, n):
    return [make(("p", 2 * i), ("p", 2 * i + 1)) for i in range(n)]


def often(t):
    return ("G", ("F", t))


def response(a, b):
    return ("G", implies(a, ("F", b)))


def streett(a, b):
    return implies(often(a), often(b))


# name: atoms, formula, states, pairs
PATTERNS = {
    "absence": (1, ("G", no(P)), 2, 1),
    "absence before": (4, implies(("F", R), ("U", no(P), R)), 4, 1),
    "absence after": (4, ("G", implies(Q, ("G", no(P)))), 3, 1),
    "absence between": (4, ("G", implies(both(Q, no(R), ("F", R)), ("U", no(P), R))), 4, 1),
    "absence after until": (4, ("G", implies(both(Q, no(R)), ("W", no(P), R))), 3, 1),
    "existence": (1, ("F", P), 2, 1),
    "existence before": (4, ("W", no(R), both(P, no(R))), 3, 1),
    "existence after": (4, ("|", ("G", no(Q)), ("F", both(Q, ("F", P)))), 3, 1),
    "existence after until": (4, ("G", implies(both(Q, no(R)), ("U", no(R), both(P, no(R))))), 3, 1),
    "universality between": (4, ("G", implies(both(Q, no(R), ("F", R)), ("U", P, R))), 4, 1),
    "precedence": (2, ("W", no(P), S), 3, 1),
    "precedence before": (4, implies(("F", R), ("U", no(P), either(S, R))), 5, 1),
    "response": (2, response(P, S), 2, 1),
    "response before": (4, implies(("F", R), ("U", implies(P, ("U", no(R), both(S, no(R)))), R)), 4, 1),
    "response after": (4, ("G", implies(Q, response(P, S))), 3, 1),
    "response after until": (
        4, ("G", implies(both(Q, no(R)), ("W", implies(P, ("U", no(R), both(S, no(R)))), R))), 4, 1
    ),
    "response chain": (4, ("G", implies(P, ("F", both(S, ("X", ("F", Q)))))), 6, 1),  # there are 3 kinds of futures
    "two responses": (4, both(*pairs(response, 2)), 4, 1),
    "three responses": (6, both(*pairs(response, 3)), 8, 1),
    "four responses": (8, both(*pairs(response, 4)), 16, 1),
    "not three responses": (6, no(both(*pairs(response, 3))), 8, 3),
    "a fair response": (3, implies(often(Q), response(P, S)), 2, 2),
    "one Streett pair": (2, streett(P, S), 1, 2),
    "four Streett pairs": (8, both(*pairs(streett, 4)), 1, 16),
    "four Rabin pairs": (8, no(both(*pairs(streett, 4))), 1, 4),
    "GR(1) 3/3": (6, implies(both(*map(often, [P, S, Q])), both(*map(often, [R, ("p", 4), ("p", 5)]))), 1, 4),
    "GR(1) 4/4": (
        8, implies(both(*(often(("p", i)) for i in range(4))), both(*(often(("p", i)) for i in range(4, 8)))), 1, 5
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PATTERNS)
def test_patterns(name):
    atoms, tree, states, count = PATTERNS[name]
    formulas = LtlFactory()
    automaton = translate(formulas, made(formulas, tree), range(1 << atoms))
    assert (automaton.states, len(automaton.pairs)) == (states, count)
    random = Random(name)
    for _ in range(150):
        word = random_word(random, 1 << atoms)
        assert automaton.accepts(*word) == holds(tree, *word), word


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_words_that_a_conjunction_of_responses_accepts_by_a_hair(n):
    formulas = LtlFactory()
    tree = both(*pairs(response, n))
    automaton = translate(formulas, made(formulas, tree), range(1 << 2 * n))
    asked, given = [1 << 2 * i for i in range(n)], [2 << 2 * i for i in range(n)]
    for missing in range(n + 1):
        period = asked + [g for i, g in enumerate(given) if i != missing]
        assert automaton.accepts([], period) == holds(tree, [], period) == (missing == n)


def test_many_responses_are_translated():
    formulas = LtlFactory()
    automaton = translate(formulas, made(formulas, both(*pairs(response, 5))), range(1 << 10))
    assert (automaton.states, len(automaton.pairs), len(automaton.pairs[0].visits)) == (32, 1, 5)


def random_automaton(random):
    states, letters = random.randint(1, 4), random.randint(1, 3)
    rng = np.random.default_rng(random.randrange(2**32))
    table = rng.integers(0, states, (states, letters)).astype(np.int32)

    def edges():
        return rng.random((states, letters)) < rng.random()

    found = tuple(
        RabinPair(edges(), tuple(edges() for _ in range(random.randrange(3))))
        for _ in range(random.randint(1, 3))
    )
    return Automaton(table, 0, found)


def test_simpler_acceptance_accepts_the_same_words():
    random = Random(5)
    simpler = 0
    for _ in range(400):
        automaton = random_automaton(random)
        found = simplify_acceptance(automaton)
        simpler += found is not automaton
        for _ in range(25):
            word = random_word(random, automaton.letters)
            assert found.accepts(*word) == automaton.accepts(*word)
    assert simpler > 50


def test_counting_visits_accepts_the_same_words():
    random = Random(6)
    for _ in range(200):
        automaton = random_automaton(random)
        found = degeneralize(automaton)
        assert all(len(p.visits) <= 1 for p in found.pairs)
        for _ in range(25):
            word = random_word(random, automaton.letters)
            assert found.accepts(*word) == automaton.accepts(*word)
