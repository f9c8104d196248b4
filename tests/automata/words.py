"""The meaning of formulas of linear time on words u v^omega, by brute force, and random formulas and words."""

from __future__ import annotations

from random import Random

from symcheck.automata.formula import LtlFormula
from symcheck.automata.ltl import LtlFactory

# A tree is ("p", i), ("!", t), ("&" | "|" | "U" | "R" | "W", t, t), ("X" | "F" | "G", t); U, R, F, G may have a bound at the end.


def holds(tree, prefix, period) -> bool:
    """Whether the word prefix period^omega satisfies a formula; letters are sets of atoms as bits."""
    word = [*prefix, *period]
    size, start = len(word), len(prefix)
    return _values(tree, word, [i + 1 if i + 1 < size else start for i in range(size)])[0]


def _values(tree, word, after) -> list[bool]:
    def inner(t):
        return _values(t, word, after)

    every = range(len(word))
    match tree:
        case ("p", i):
            return [bool(a >> i & 1) for a in word]
        case ("!", t):
            return [not v for v in inner(t)]
        case ("&", t, u):
            return [v and w for v, w in zip(inner(t), inner(u), strict=True)]
        case ("|", t, u):
            return [v or w for v, w in zip(inner(t), inner(u), strict=True)]
        case ("X", t):
            v = inner(t)
            return [v[after[i]] for i in every]
        case ("F", t, *bound):
            return _until([True] * len(word), inner(t), after, *bound)
        case ("G", t, *bound):
            return [
                not v for v in _until([True] * len(word), [not v for v in inner(t)], after, *bound)
            ]
        case ("U", t, u, *bound):
            return _until(inner(t), inner(u), after, *bound)
        case ("R", t, u, *bound):
            return [
                not v
                for v in _until([not v for v in inner(t)], [not v for v in inner(u)], after, *bound)
            ]
        case ("W", t, u):
            left, right = inner(t), inner(u)
            for_ever = _until([True] * len(word), [not v for v in left], after)
            return [u or not f for u, f in zip(_until(left, right, after), for_ever, strict=True)]
    raise AssertionError(tree)


def _until(left, right, after, bound=None):
    result = []
    for i in range(len(left)):
        steps, value = 0, False
        # Without a bound, what does not come within as many steps as the word has letters never comes.
        while steps <= (len(left) if bound is None else bound):
            if right[i]:
                value = True
                break
            if not left[i]:
                break
            i, steps = after[i], steps + 1
        result.append(value)
    return result


def made(formulas: LtlFactory, tree) -> LtlFormula:
    """The tree as a formula."""
    match tree:
        case ("p", i):
            return formulas.literal(i)
        case ("!", t):
            return formulas.negation(made(formulas, t))
        case ("&", *parts):
            return formulas.conjunction([made(formulas, t) for t in parts])
        case ("|", *parts):
            return formulas.disjunction([made(formulas, t) for t in parts])
        case ("X", t):
            return formulas.next(made(formulas, t))
        case ("F", t, *bound):
            return formulas.eventually(made(formulas, t), *bound)
        case ("G", t, *bound):
            return formulas.always(made(formulas, t), *bound)
        case ("U", t, u, *bound):
            return formulas.until(made(formulas, t), made(formulas, u), *bound)
        case ("R", t, u, *bound):
            return formulas.release(made(formulas, t), made(formulas, u), *bound)
        case ("W", t, u):
            return formulas.weak_until(made(formulas, t), made(formulas, u))
    raise AssertionError(tree)


def random_tree(random: Random, atoms: int, size: int):
    """A formula with about `size` operators."""
    if size <= 0:
        return ("p", random.randrange(atoms))
    kind = random.choice(["!", "&", "|", "X", "F", "G", "U", "R", "W", "&", "|", "F", "G"])
    if kind in "!XFG":
        bound = [random.randrange(4)] if kind in "FG" and random.random() < 0.1 else []
        return (kind, random_tree(random, atoms, size - 1), *bound)
    first = random.randrange(size)
    bound = [random.randrange(4)] if kind in "UR" and random.random() < 0.1 else []
    return (
        kind,
        random_tree(random, atoms, first),
        random_tree(random, atoms, size - 1 - first),
        *bound,
    )


def random_word(random: Random, letters: int) -> tuple[list[int], list[int]]:
    """A prefix and a period."""
    prefix = [random.randrange(letters) for _ in range(random.randrange(5))]
    return prefix, [random.randrange(letters) for _ in range(random.randint(1, 5))]


def tree_of(formula: LtlFormula):
    """A formula as a tree."""
    match formula.kind.name:
        case "TRUE":
            return ("|", ("p", 0), ("!", ("p", 0)))
        case "FALSE":
            return ("&", ("p", 0), ("!", ("p", 0)))
        case "POSITIVE":
            return ("p", formula.atom)
        case "NEGATIVE":
            return ("!", ("p", formula.atom))
        case "AND" | "OR":
            first, *rest = map(tree_of, formula.parts)
            for part in rest:
                first = (formula.kind.value, first, part)
            return first
        case "NEXT":
            return ("X", tree_of(formula.parts[0]))
        case name:
            bound = [] if formula.bound is None else [formula.bound]
            return (name[0], *map(tree_of, formula.parts), *bound)
