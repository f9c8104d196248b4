from __future__ import annotations

from random import Random

import pytest

from automata.words import holds, made, random_tree, random_word, tree_of
from symcheck.automata.formula import Kind
from symcheck.automata.ltl import LtlFactory

SEEDS = range(50)


@pytest.mark.parametrize("seed", SEEDS)
def test_simplification_keeps_the_meaning(seed):
    random = Random(seed)
    tree = random_tree(random, 2, random.randint(1, 12))
    formulas = LtlFactory()
    formula = made(formulas, tree)
    negation = formulas.negation(formula)
    for _ in range(40):
        word = random_word(random, 4)
        assert holds(tree_of(formula), *word) == holds(tree, *word), (tree, str(formula), word)
        assert holds(tree_of(negation), *word) != holds(tree, *word), (tree, str(negation), word)


@pytest.mark.parametrize("seed", SEEDS)
def test_implication_is_sound(seed):
    random = Random(seed)
    formulas = LtlFactory()
    made_ones = [made(formulas, random_tree(random, 2, random.randint(0, 5))) for _ in range(12)]
    words = [random_word(random, 4) for _ in range(25)]
    values = {f: [holds(tree_of(f), *w) for w in words] for f in made_ones}
    for f in made_ones:
        for g in made_ones:
            if formulas.implies(f, g):
                assert all(w for v, w in zip(values[f], values[g], strict=True) if v), (
                    str(f),
                    str(g),
                )


@pytest.mark.parametrize("seed", SEEDS)
def test_persistence_and_classes_are_what_they_say(seed):
    random = Random(seed)
    formulas = LtlFactory()
    f = made(formulas, random_tree(random, 2, random.randint(1, 9)))
    for _ in range(20):
        prefix, period = random_word(random, 4)
        now, later = (
            holds(tree_of(f), prefix, period),
            [holds(tree_of(f), prefix[i:], period) for i in range(len(prefix) + 1)],
        )
        assert not (f.universal and now) or all(later)
        assert not (f.eventual and any(later)) or now


def _cases():
    f = LtlFactory()
    a, b = (f.literal(i) for i in range(2))
    often, stable = f.always(f.eventually(a)), f.eventually(f.always(a))
    return [
        (f.eventually(f.eventually(a)), f.eventually(a)),
        (f.always(often), often),
        (f.next(often), often),
        (f.until(b, often), often),
        (f.eventually(f.until(a, b)), f.eventually(b)),

        (f.always(f.eventually(f.next(a))), often),
        (f.until(a, f.until(a, b)), f.until(a, b)),
        (f.until(f.until(a, b), b), f.until(a, b)),
        (f.until(a, b, 0), b),
        (f.eventually(f.always(f.next(f.release(b, a)))), stable),
        (f.disjunction((f.eventually(a), f.eventually(b, 3), f.eventually(b, 5), f.eventually(a, 2))),
         f.disjunction((f.eventually(a), f.eventually(b, 5)))),
        (f.negation(f.weak_until(a, b)), f.until(f.negation(b), f.conjunction((f.negation(a), f.negation(b))))),
    ]  # fmt: skip


@pytest.mark.parametrize("case", range(len(_cases())))
def test_rules(case):
    formula, simple = _cases()[case]
    assert formula is simple, f"{formula} is not {simple}"


def test_next_of_true_can_ask_for_a_step():
    f = LtlFactory(step=1)
    assert f.next(f.true).kind is Kind.NEXT
    assert f.negation(f.next(f.false)) is f.next(f.true)
    assert LtlFactory().next(LtlFactory().true).kind is Kind.TRUE


def test_long_bounds_need_no_recursion():
    f = LtlFactory()
    chain = f.literal(0)
    for _ in range(5000):
        chain = f.disjunction((f.literal(1), f.next(chain)))
    assert f.negation(f.negation(chain)) is chain
