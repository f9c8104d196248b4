"""The conditions of the master theorem for the languages of LTL formulas.

A word w satisfies f if and only if there are a set X of U formulas (the GF-set) and a set Y of R
formulas (the FG-set) of f such that

1. for some i, the suffix of w from i on satisfies af(f, w[:i])[X]ν, a safety formula,
2. for each g in X, w satisfies G F g[Y]μ, where g[Y]μ is a co-safety formula,
3. for each g in Y, w satisfies F G g[X]ν, where g[X]ν is a safety formula.

Pairs (X, Y) are enumerated by a search that decides only formulas on which a condition depends, so
few pairs are generated in practice.

Source: Esparza, Křetínský & Sickert, "A unified translation of linear temporal logic to
ω-automata", J. ACM 67 (2020), the Master Theorem.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from symcheck.automata.boolean import FALSE, TRUE
from symcheck.automata.derivatives import Derivatives, cosafety_part, safety_part
from symcheck.automata.formula import Kind, LtlFormula
from symcheck.errors import UnsupportedError

__all__ = [
    "Condition",
    "FGCondition",
    "GFCondition",
    "Guess",
    "SafetyCondition",
    "conditions",
    "guesses",
]

_MAX_GUESSES = 4096
"""Pairs (X, Y) per component of the main automaton; with more, the automaton would be too large."""


@dataclass(frozen=True, slots=True)
class Guess:
    """A pair (X, Y): numbers of the U formulas in X and of the R formulas in Y."""

    gf_set: frozenset[int] = frozenset()
    fg_set: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class GFCondition:
    """Condition 2: the co-safety combination F g[Y]μ is satisfied infinitely often."""

    formula: int


@dataclass(frozen=True, slots=True)
class FGCondition:
    """Condition 3: the safety combination G g[X]ν is violated finitely often.

    Its automaton is restarted after each violation.
    """

    formula: int


@dataclass(frozen=True, slots=True)
class SafetyCondition:
    """Condition 1: from some time on, the safety part of the remaining formula is not violated.

    formulas: pairs (state, combination) for each state of a component of the main automaton.
    """

    formulas: tuple[tuple[int, int], ...]


Condition = GFCondition | FGCondition | SafetyCondition


@dataclass(frozen=True, slots=True)
class _Search:
    """A partial guess.

    decided: formula numbers with True (in X or Y) or False. pending: formulas still to be examined,
    with True where their safety part is needed (it depends on X) and False where their co-safety
    part is needed (it depends on Y). seen: pairs of `pending` that were examined.
    """

    decided: frozenset[tuple[int, bool]] = frozenset()
    seen: frozenset[tuple[int, bool]] = frozenset()
    pending: tuple[tuple[LtlFormula, bool], ...] = ()

    def with_parts(self, parts: Sequence[LtlFormula], *, as_safety: bool) -> _Search:
        return replace(self, pending=self.pending + tuple((p, as_safety) for p in parts))

    @property
    def rejected(self) -> frozenset[int]:
        """Numbers of the formulas that were decided to be in neither set."""
        return frozenset(n for n, value in self.decided if not value)

    def deciding(self, f: LtlFormula, value: bool) -> _Search:
        return replace(self, decided=self.decided | {(f.number, value)})


def guesses(derivatives: Derivatives, states: Sequence[int]) -> Iterator[Guess]:
    """All pairs (X, Y) that are relevant for some states of the main automaton.

    Raises:
        UnsupportedError: there are more than _MAX_GUESSES.
    """
    formulas = {f.number: f for s in states for f in derivatives.formulas_of(s)}
    kinds = {g.number: g.kind for f in formulas.values() for g in f.subformulas()}
    todo = [_Search(pending=tuple((f, True) for f in formulas.values()))]
    count = 0
    while todo:
        search = todo.pop()
        if search.pending:
            todo.extend(
                s
                for s in _examine(search)
                if s.decided == search.decided or _possible(derivatives, states, s.rejected)
            )
            continue
        count += 1
        if count > _MAX_GUESSES:
            raise UnsupportedError(
                "this LTL formula has too many nested temporal operators",
                hint="try an external translator (-ltl2datool)",
            )
        accepted = frozenset(n for n, value in search.decided if value)
        gf_set = frozenset(n for n in accepted if kinds[n] is Kind.UNTIL)
        yield Guess(gf_set, accepted - gf_set)


def _possible(derivatives: Derivatives, states: Sequence[int], rejected: frozenset[int]) -> bool:
    """Whether condition 1 can hold in some state if X contains all but the rejected formulas."""
    known = {g.number for s in states for f in derivatives.formulas_of(s) for g in f.subformulas()}
    return any(
        _as_safety(derivatives, s, Guess(frozenset(known - rejected))) != FALSE for s in states
    )


def _examine(search: _Search) -> Iterator[_Search]:
    """The searches that result from examining the next pending formula."""
    (f, as_safety), rest = search.pending[-1], search.pending[:-1]
    search = replace(search, pending=rest)
    key = (f.number, as_safety)
    if key in search.seen or (f.safe if as_safety else f.co_safe):
        yield search
        return
    search = replace(search, seen=search.seen | {key})
    guessed = Kind.UNTIL if as_safety else Kind.RELEASE
    if not f.fixpoint or f.kind is not guessed:
        yield search.with_parts(f.parts, as_safety=as_safety)
        return
    # In the set: a U becomes weak, so its operands are examined as before, and an R becomes true;
    # condition 2 or 3 then needs the other part of the right operand. Not in the set: a U becomes
    # false, and an R strong. The operands of F a and G a need not be examined twice.
    included = search.deciding(f, True).with_parts(f.parts[1:], as_safety=not as_safety)
    excluded = search.deciding(f, False)
    if as_safety and f.eventually is None:
        included = included.with_parts(f.parts, as_safety=True)
    if not as_safety and f.always is None:
        excluded = excluded.with_parts(f.parts, as_safety=False)
    yield included
    yield excluded


def conditions(
    derivatives: Derivatives, states: Sequence[int], guess: Guess
) -> frozenset[Condition] | None:
    """The conditions on words whose run stays among some states of the main automaton.

    Returns:
        The conditions of the guess that are not trivially true; None if one of them is false.
    """
    result: set[Condition] = set()
    factory = derivatives.factory
    known = {
        f.number: f for s in states for g in derivatives.formulas_of(s) for f in g.subformulas()
    }

    def encoded(formula: LtlFormula) -> int:
        return derivatives.simplify(derivatives.encode(formula))

    def candidates() -> Iterator[GFCondition | FGCondition]:
        for n in guess.gf_set:
            part = cosafety_part(factory, known[n], guess.fg_set)[n]
            yield GFCondition(encoded(factory.eventually(part)))
        for n in guess.fg_set:
            part = safety_part(factory, known[n], guess.gf_set)[n]
            yield FGCondition(encoded(factory.always(part)))

    for condition in candidates():
        if condition.formula == FALSE:
            return None
        if condition.formula != TRUE:
            result.add(condition)
    remaining = [(s, _as_safety(derivatives, s, guess)) for s in states]
    if all(f == FALSE for _, f in remaining):
        return None
    if any(f != TRUE for _, f in remaining):
        result.add(SafetyCondition(tuple(remaining)))
    return frozenset(result)


def _as_safety(derivatives: Derivatives, state: int, guess: Guess) -> int:
    """The combination state[X]ν."""
    parts: dict[int, LtlFormula] = {}
    for f in derivatives.formulas_of(state):
        parts[f.number] = safety_part(derivatives.factory, f, guess.gf_set)[f.number]
    return derivatives.substitute(state, parts)
