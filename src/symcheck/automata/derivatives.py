"""What remains to be satisfied after a letter, and formulas under a guess of what holds for ever.

Source: Esparza, Kretinsky & Sickert, 'A unified translation of linear temporal logic to omega-automata', J. ACM 67 (2020).
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import permutations

from symcheck.automata.boolean import FALSE, TRUE, Booleans
from symcheck.automata.formula import Formula, Kind
from symcheck.automata.ltl import Formulas

__all__ = ["After", "release_kept", "until_kept"]

_SUPPORT = 24
"""Combinations of more formulas than this are not searched for formulas that follow from others."""


class After:
    """Combinations of formulas, and their derivatives by letters. A letter is a valuation: atom i holds where bit i is set."""

    def __init__(self, formulas: Formulas) -> None:
        self.formulas = formulas
        self.booleans = Booleans()
        self._formula: dict[int, Formula] = {}
        self._steps: dict[tuple[int, int], int] = {}
        self._after: dict[tuple[int, int], int] = {}
        self._simplified: dict[int, int] = {}
        self._known: dict[frozenset[int], tuple[int, int]] = {}

    def of(self, f: Formula) -> int:
        """A formula as a combination of literals and temporal formulas."""
        table = self.booleans
        match f.kind:
            case Kind.TRUE:
                return TRUE
            case Kind.FALSE:
                return FALSE
            case Kind.AND:
                return self._all(self.of(p) for p in f.parts)
            case Kind.OR:
                return self._any(self.of(p) for p in f.parts)
            case Kind.NEGATIVE:
                return table.negation(self.of(self.formulas.literal(f.atom)))
            case _:
                self._formula[f.number] = f
                return table.variable(f.number)

    def _all(self, parts: Iterable[int]) -> int:
        result = TRUE
        for part in parts:
            result = self.booleans.conjunction(result, part)
        return result

    def _any(self, parts: Iterable[int]) -> int:
        result = FALSE
        for part in parts:
            result = self.booleans.disjunction(result, part)
        return result

    def formulas_in(self, state: int) -> list[Formula]:
        """The formulas that a combination is made of, in order of their numbers."""
        return [self._formula[n] for n in sorted(self.booleans.support(state))]

    def atoms(self, state: int) -> int:
        """The atoms (as bits) on which the derivatives of a combination depend."""
        bits = 0
        for f in self.formulas_in(state):
            bits |= f.now
        return bits

    def after(self, state: int, letter: int) -> int:
        """What a word must satisfy after a letter so that with it the word satisfies `state`."""
        key = (state, letter & self.atoms(state))
        found = self._after.get(key)
        if found is None:
            raw = self.booleans.substitute(state, lambda n: self._step(self._formula[n], letter))
            found = self.simplified(raw)
            self._after[key] = found
        return found

    def _step(self, f: Formula, letter: int) -> int:
        key = (f.number, letter & f.now)
        found = self._steps.get(key)
        if found is None:
            found = self._stepped(f, letter)
            self._steps[key] = found
        return found

    def _stepped(self, f: Formula, letter: int) -> int:
        table = self.booleans
        match f.kind:
            case Kind.TRUE | Kind.FALSE:
                return self.of(f)
            case Kind.POSITIVE:
                return TRUE if letter >> f.atom & 1 else FALSE
            case Kind.NEGATIVE:
                return FALSE if letter >> f.atom & 1 else TRUE
            case Kind.AND:
                return self._all(self._step(p, letter) for p in f.parts)
            case Kind.OR:
                return self._any(self._step(p, letter) for p in f.parts)
            case Kind.NEXT:
                return self.of(f.parts[0])
        left, right = (self._step(p, letter) for p in f.parts)
        if f.kind is Kind.UNTIL:
            return table.disjunction(right, table.conjunction(left, self.of(self._shorter(f))))
        return table.conjunction(right, table.disjunction(left, self.of(self._shorter(f))))

    def _shorter(self, f: Formula) -> Formula:
        if f.bound is None:
            return f
        left, right = f.parts
        make = self.formulas.until if f.kind is Kind.UNTIL else self.formulas.release
        return make(left, right, f.bound - 1)

    def simplified(self, state: int) -> int:
        """An equivalent combination without formulas that do not matter, given which of the formulas imply which."""
        found = self._simplified.get(state)
        if found is None:
            found = self._reduced(state)
            self._simplified[state] = found
        return found

    def _reduced(self, state: int) -> int:
        """Drops formulas one by one while the combination stays the same, given the implications.

        Exclusions serve to find what is false or true altogether, and not to drop formulas: dropping may then put off for
        ever the moment when a safety formula that is violated becomes false (implications never put it off).
        """
        table = self.booleans
        support = table.support(state)
        if not 1 < len(support) <= _SUPPORT:
            return state
        implications, exclusions = self._facts(support)
        known = table.conjunction(implications, exclusions)
        if table.conjunction(state, known) == FALSE:
            return FALSE
        if table.ite(known, state, TRUE) == TRUE:
            return TRUE
        if implications == TRUE:
            return state
        wanted = table.conjunction(state, implications)
        for number in sorted(support, reverse=True):
            for value in (True, False):
                smaller = table.assign(state, number, value)
                if smaller != state and table.conjunction(smaller, implications) == wanted:
                    state = smaller
                    break
        return state

    def _facts(self, support: frozenset[int]) -> tuple[int, int]:
        """Which of some formulas imply which, and which exclude or exhaust each other."""
        if support not in self._known:
            table, implies, negation = self.booleans, self.formulas.implies, self.formulas.negation
            formulas = [self._formula[n] for n in sorted(support)]
            implications = exclusions = TRUE
            for f, g in permutations(formulas, 2):
                v, w = self.of(f), self.of(g)
                if implies(f, g):
                    implications = table.conjunction(implications, table.ite(v, w, TRUE))
                if f.number < g.number and implies(f, negation(g)):
                    exclusions = table.conjunction(
                        exclusions, table.ite(v, table.negation(w), TRUE)
                    )
                if f.number < g.number and implies(negation(f), g):
                    exclusions = table.conjunction(exclusions, table.disjunction(v, w))
            self._known[support] = implications, exclusions
        return self._known[support]

    def rewritten(self, state: int, by: dict[int, Formula]) -> int:
        """A combination with formulas (by number) replaced by others."""
        return self.simplified(
            self.booleans.substitute(state, lambda n: self.of(by.get(n, self._formula[n])))
        )


def release_kept(formulas: Formulas, f: Formula, often: frozenset[int]) -> dict[int, Formula]:
    """Every part of f, by number, where what is not satisfied infinitely often (numbers of U formulas) never is.

    Unbounded U formulas in `often` become weak, others false, so that only safety remains.
    """
    result: dict[int, Formula] = {}
    for part in f.below():
        parts = [result[p.number] for p in part.parts]
        if part.kind is Kind.UNTIL and part.bound is None:
            result[part.number] = (
                formulas.weak_until(*parts) if part.number in often else formulas.false
            )
        else:
            result[part.number] = _rebuilt(formulas, part, parts)
    return result


def until_kept(formulas: Formulas, f: Formula, stable: frozenset[int]) -> dict[int, Formula]:
    """Every part of f, by number, where the R formulas in `stable` (numbers) are true.

    Other unbounded R formulas become strong, so that only co-safety remains.
    """
    result: dict[int, Formula] = {}
    for part in f.below():
        parts = [result[p.number] for p in part.parts]
        if part.kind is Kind.RELEASE and part.bound is None:
            left, right = parts
            strong = formulas.until(right, formulas.conjunction((left, right)))
            result[part.number] = formulas.true if part.number in stable else strong
        else:
            result[part.number] = _rebuilt(formulas, part, parts)
    return result


def _rebuilt(formulas: Formulas, f: Formula, parts: list[Formula]) -> Formula:
    match f.kind:
        case Kind.AND:
            return formulas.conjunction(parts)
        case Kind.OR:
            return formulas.disjunction(parts)
        case Kind.NEXT:
            return formulas.next(parts[0])
        case Kind.UNTIL:
            return formulas.until(parts[0], parts[1], f.bound)
        case Kind.RELEASE:
            return formulas.release(parts[0], parts[1], f.bound)
        case _:
            return f
