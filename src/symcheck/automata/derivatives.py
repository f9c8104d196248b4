"""Derivatives of LTL formulas by letters, and formulas under the assumptions of the master theorem.

Source: Esparza, Křetínský & Sickert, "A unified translation of linear temporal logic to
ω-automata", J. ACM 67 (2020): the function `af`, f[X]ν and f[Y]μ.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache, reduce
from itertools import permutations
from operator import or_
from typing import assert_never

from symcheck.automata.boolean import FALSE, TRUE, BooleanFunctions
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.automata.ltl import LtlFactory

__all__ = ["Derivatives", "cosafety_part", "safety_part"]

_MAX_SUPPORT = 24
"""Redundant formulas are sought in combinations of at most this many formulas, because the
search is quadratic in their number."""


class Derivatives:
    """Boolean combinations of LTL formulas, and their derivatives by letters.

    A combination is a number of `booleans`, whose variables are formula numbers. A letter is a
    valuation of the atoms: atom i is true if bit i is set.
    """

    def __init__(self, factory: LtlFactory) -> None:
        self.factory = factory
        self.booleans = BooleanFunctions()
        self._formula: dict[int, LtlFormula] = {}
        self._derivative = cache(self._compute_derivative)
        self._derivative_of_temporal = cache(self._compute_derivative_of_formula)
        self.simplify = cache(self._drop_redundant)
        self._implications = cache(self._compute_implications)

    def encode(self, f: LtlFormula) -> int:
        """The formula as a Boolean combination of literals and temporal formulas."""
        table = self.booleans
        match f.kind:
            case Kind.TRUE:
                return TRUE
            case Kind.FALSE:
                return FALSE
            case Kind.AND:
                return self._all(self.encode(p) for p in f.parts)
            case Kind.OR:
                return self._any(self.encode(p) for p in f.parts)
            case Kind.NEGATIVE:
                return table.negation(self.encode(self.factory.literal(f.atom)))
            case Kind.POSITIVE | Kind.NEXT | Kind.UNTIL | Kind.RELEASE:
                self._formula[f.number] = f
                return table.variable(f.number)
            case _:
                assert_never(f.kind)

    def _all(self, parts: Iterable[int]) -> int:
        return reduce(self.booleans.conjunction, parts, TRUE)

    def _any(self, parts: Iterable[int]) -> int:
        return reduce(self.booleans.disjunction, parts, FALSE)

    def formulas_of(self, state: int) -> list[LtlFormula]:
        """The formulas that a combination depends on, in order of their numbers."""
        return [self._formula[n] for n in sorted(self.booleans.support(state))]

    def atoms(self, state: int) -> int:
        """The atoms (as bits) that the derivatives of a combination depend on."""
        return reduce(or_, (f.now for f in self.formulas_of(state)), 0)

    def derivative(self, state: int, letter: int) -> int:
        """The derivative af(state, letter).

        A word w satisfies it if and only if `letter` followed by w satisfies `state`.
        """
        return self._derivative(state, letter & self.atoms(state))

    def _compute_derivative(self, state: int, letter: int) -> int:
        def derivative(number: int) -> int:
            return self._derivative_of_formula(self._formula[number], letter)

        return self.simplify(self.booleans.substitute(state, derivative))

    def _derivative_of_formula(self, f: LtlFormula, letter: int) -> int:
        return self._derivative_of_temporal(f, letter & f.now)

    def _compute_derivative_of_formula(self, f: LtlFormula, letter: int) -> int:
        table = self.booleans
        match f.kind:
            case Kind.TRUE | Kind.FALSE:
                return self.encode(f)
            case Kind.POSITIVE:
                return TRUE if letter >> f.atom & 1 else FALSE
            case Kind.NEGATIVE:
                return FALSE if letter >> f.atom & 1 else TRUE
            case Kind.AND:
                return self._all(self._derivative_of_formula(p, letter) for p in f.parts)
            case Kind.OR:
                return self._any(self._derivative_of_formula(p, letter) for p in f.parts)
            case Kind.NEXT:
                return self.encode(f.parts[0])
            case Kind.UNTIL | Kind.RELEASE:
                left, right = (self._derivative_of_formula(p, letter) for p in f.parts)
                next_step = self.encode(self._with_smaller_bound(f))
                if f.kind is Kind.UNTIL:
                    return table.disjunction(right, table.conjunction(left, next_step))
                return table.conjunction(right, table.disjunction(left, next_step))

    def _with_smaller_bound(self, f: LtlFormula) -> LtlFormula:
        if f.bound is None:
            return f
        left, right = f.parts
        make = self.factory.until if f.kind is Kind.UNTIL else self.factory.release
        return make(left, right, f.bound - 1)

    def _drop_redundant(self, state: int) -> int:
        """Drop formulas while the combination stays equivalent under the implications."""
        table, support = self.booleans, self.booleans.support(state)
        if not 1 < len(support) <= _MAX_SUPPORT:
            return state
        implications = self._implications(support)
        context = table.conjunction(state, implications)
        if implications == TRUE or context == FALSE:
            return context
        if table.ite(implications, state, TRUE) == TRUE:
            return TRUE
        for number in sorted(support, reverse=True):
            for value in (True, False):
                smaller = table.cofactor(state, number, value)
                if smaller != state and table.conjunction(smaller, implications) == context:
                    state = smaller
                    break
        return state

    def _compute_implications(self, support: frozenset[int]) -> int:
        """The implications between some formulas, as a combination of them."""
        formulas = [self._formula[n] for n in sorted(support)]
        return self._all(
            self.booleans.ite(self.encode(f), self.encode(g), TRUE)
            for f, g in permutations(formulas, 2)
            if self.factory.implies(f, g)
        )

    def substitute(self, state: int, by: dict[int, LtlFormula]) -> int:
        """The combination with some formulas (given by number) replaced by others."""
        return self.simplify(
            self.booleans.substitute(state, lambda n: self.encode(by.get(n, self._formula[n])))
        )


def safety_part(
    factory: LtlFactory, formula: LtlFormula, gf_set: frozenset[int]
) -> dict[int, LtlFormula]:
    """The safety formula f[X]ν of every subformula, by number.

    Args:
        factory: makes the new formulas.
        formula: the formula f.
        gf_set: X, numbers of U formulas that are assumed to hold infinitely often.

    Returns:
        Each subformula with unbounded U formulas of X made weak (W) and all others false.
    """

    def weak(part: LtlFormula, parts: list[LtlFormula]) -> LtlFormula:
        return factory.weak_until(*parts) if part.number in gf_set else factory.false

    return _substituted(factory, formula, Kind.UNTIL, weak)


def cosafety_part(
    factory: LtlFactory, formula: LtlFormula, fg_set: frozenset[int]
) -> dict[int, LtlFormula]:
    """The co-safety formula f[Y]μ of every subformula, by number.

    Args:
        factory: makes the new formulas.
        formula: the formula f.
        fg_set: Y, numbers of R formulas that are assumed to hold forever from some time on.

    Returns:
        Each subformula with R formulas of Y true and all other unbounded R made strong (M).
    """

    def strong(part: LtlFormula, parts: list[LtlFormula]) -> LtlFormula:
        left, right = parts
        both = factory.conjunction((left, right))
        return factory.true if part.number in fg_set else factory.until(right, both)

    return _substituted(factory, formula, Kind.RELEASE, strong)


def _substituted(
    factory: LtlFactory,
    formula: LtlFormula,
    kind: Kind,
    other: Callable[[LtlFormula, list[LtlFormula]], LtlFormula],
) -> dict[int, LtlFormula]:
    """Every subformula, by number, with the unbounded ones of a kind replaced.

    Args:
        factory: makes the new formulas.
        formula: the formula.
        kind: the kind of the subformulas that are replaced.
        other: what replaces a formula, from it and its replaced parts.
    """
    result: dict[int, LtlFormula] = {}
    for part in formula.subformulas():
        parts = [result[p.number] for p in part.parts]
        replaced = part.kind is kind and part.bound is None
        result[part.number] = other(part, parts) if replaced else _with_parts(factory, part, parts)
    return result


def _with_parts(factory: LtlFactory, formula: LtlFormula, parts: list[LtlFormula]) -> LtlFormula:
    """The formula with other operands."""
    match formula.kind:
        case Kind.AND:
            return factory.conjunction(parts)
        case Kind.OR:
            return factory.disjunction(parts)
        case Kind.NEXT:
            return factory.next(parts[0])
        case Kind.UNTIL:
            return factory.until(parts[0], parts[1], formula.bound)
        case Kind.RELEASE:
            return factory.release(parts[0], parts[1], formula.bound)
        case Kind.TRUE | Kind.FALSE | Kind.POSITIVE | Kind.NEGATIVE:
            return formula
        case _:
            assert_never(formula.kind)
