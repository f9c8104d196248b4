from __future__ import annotations

from functools import reduce
from random import Random

import pytest

from automata.words import holds, made, random_tree, random_word
from symcheck.automata import translate as module
from symcheck.automata.ltl import LtlFactory
from symcheck.automata.translate import translate
from symcheck.errors import UnsupportedError


@pytest.mark.parametrize("block", range(20))
def test_automata_accept_exactly_the_words_that_satisfy_the_formula(block):
    random = Random(block)
    atoms = 2 + block % 2
    for _ in range(25):
        tree = random_tree(random, atoms, random.randint(1, 14))
        formulas = LtlFactory()
        formula = made(formulas, tree)
        automaton = translate(formulas, formula, range(1 << atoms))
        for _ in range(60):
            word = random_word(random, 1 << atoms)
            assert automaton.accepts(*word) == holds(tree, *word), (tree, str(formula), word)


def test_only_the_letters_that_occur_are_read():
    random = Random(7)
    for _ in range(60):
        tree = random_tree(random, 3, 8)
        letters = random.sample(range(8), random.randint(1, 4))
        formulas = LtlFactory()
        automaton = translate(formulas, made(formulas, tree), letters)
        assert automaton.letters == len(letters)
        wide = automaton.relabel(letters, 8)
        for _ in range(30):
            prefix, period = random_word(random, len(letters))
            expected = holds(tree, [letters[i] for i in prefix], [letters[i] for i in period])
            assert automaton.accepts(prefix, period) == expected
            assert (
                wide.accepts([letters[i] for i in prefix], [letters[i] for i in period]) == expected
            )


def test_a_good_prefix_of_a_co_safe_formula_ends_in_an_accepting_state():
    formulas = LtlFactory()
    a, b = formulas.literal(0), formulas.literal(1)
    automaton = translate(
        formulas, formulas.eventually(formulas.conjunction((a, formulas.next(b)))), range(4)
    )
    state = automaton.initial
    seen = []
    for letter in (0, 2, 1, 1, 2, 0):
        state = int(automaton.table[state, letter])
        seen.append(state in automaton.accepting)
    assert seen == [False, False, False, False, True, True]
    assert automaton.entering(automaton.accepting) > {
        (int(q), a) for q in automaton.accepting for a in range(4)
    }


def _chain(make, parts):
    return reduce(lambda right, left: make(left, right), reversed(parts))


def _responses(f, p):
    pairs = zip(p[::2], p[1::2], strict=True)
    return f.conjunction(
        [f.always(f.disjunction((f.negation(a), f.eventually(b)))) for a, b in pairs]
    )


def _streett(f, p):
    pairs = zip(p[::2], p[1::2], strict=True)
    return f.conjunction(
        [
            f.disjunction((f.negation(f.always(f.eventually(a))), f.always(f.eventually(b))))
            for a, b in pairs
        ]
    )


SIZES = {
    "GFa": (1, lambda f, p: f.always(f.eventually(p[0])), 1),
    "FGa": (1, lambda f, p: f.eventually(f.always(p[0])), 1),
    "a U b": (2, lambda f, p: f.until(*p), 3),
    "G(a -> F b)": (2, _responses, 2),
    "two responses": (4, _responses, 4),
    "three responses": (6, _responses, 8),
    "GFa -> GFb": (2, _streett, 1),
    "three Streett pairs": (6, _streett, 1),
    "five times GF": (5, lambda f, p: f.conjunction([f.always(f.eventually(x)) for x in p]), 1),
    "nested U": (5, lambda f, p: _chain(f.until, p), 6),
    "F and F and F and F": (4, lambda f, p: f.conjunction([f.eventually(x) for x in p]), 16),
    "G(a -> F<=20 b)": (2, lambda f, p: f.always(f.disjunction((f.negation(p[0]), f.eventually(p[1], 20)))), 22),
    "GF(a -> XX b)": (
        2, lambda f, p: f.always(f.eventually(f.disjunction((f.negation(p[0]), f.next(f.next(p[1])))))), 3
    ),
    "(GFa) U (Gb)": (2, lambda f, p: f.until(f.always(f.eventually(p[0])), f.always(p[1])), 3),
    "G(a -> X(!a U b))": (
        2, lambda f, p: f.always(f.disjunction((f.negation(p[0]), f.next(f.until(f.negation(p[0]), p[1]))))), 3
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SIZES)
def test_automata_are_small(name):
    atoms, make, states = SIZES[name]
    formulas = LtlFactory()
    automaton = translate(
        formulas, make(formulas, [formulas.literal(i) for i in range(atoms)]), range(1 << atoms)
    )
    assert automaton.states == states


@pytest.mark.parametrize("value", [True, False])
def test_constants(value):
    formulas = LtlFactory()
    automaton = translate(formulas, formulas.true if value else formulas.false, range(2))
    assert (automaton.states, len(automaton.pairs)) == (1, int(value))
    assert automaton.accepts([], [0]) == value


def test_what_becomes_too_large_is_refused(monkeypatch):
    monkeypatch.setattr(module, "_MAX_EDGES", 1000)
    formulas = LtlFactory()
    f = formulas.conjunction([formulas.eventually(formulas.literal(i)) for i in range(6)])
    with pytest.raises(UnsupportedError, match=r"more than .* states"):
        translate(formulas, f, range(64))
