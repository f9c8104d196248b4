"""Construction of LTL formulas: one object per formula, simplified when it is made.

Sources of the rules: Etessami & Holzmann (CONCUR 2000), Somenzi & Bloem (CAV 2000), Babiak et al.
(TACAS 2012).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import assert_never

from symcheck.automata.formula import Kind, LtlFormula

__all__ = ["LtlFactory"]

_MAX_PARTS = 24
"""Conjunctions and disjunctions of at most this many parts are searched for redundant parts (the
search is quadratic)."""
_MAX_DEPTH = 60
"""Depth to which the rules for implications are applied (they are recursive)."""

_DUAL = {
    Kind.TRUE: Kind.FALSE,
    Kind.FALSE: Kind.TRUE,
    Kind.POSITIVE: Kind.NEGATIVE,
    Kind.NEGATIVE: Kind.POSITIVE,
    Kind.AND: Kind.OR,
    Kind.OR: Kind.AND,
    Kind.NEXT: Kind.NEXT,
    Kind.UNTIL: Kind.RELEASE,
    Kind.RELEASE: Kind.UNTIL,
}


class LtlFactory:
    """Makes and simplifies LTL formulas.

    Args:
        step: an atom that is true in every letter. X true is then kept as X step, so that it
            requires one more letter. This matters for rewards accumulated until a formula is
            satisfied. None: X true is true.

    Examples:
        >>> factory = LtlFactory()
        >>> a = factory.literal(0)
        >>> str(factory.eventually(factory.eventually(a)))
        'F p0'
    """

    def __init__(self, *, step: int | None = None) -> None:
        self._known: dict[tuple[Kind, tuple[int, ...], int, int | None], LtlFormula] = {}
        self._negations: dict[int, LtlFormula] = {}
        self._implications: dict[tuple[int, int], bool] = {}
        self.true = self._node(Kind.TRUE)
        self.false = self._node(Kind.FALSE)
        self._step = None if step is None else self.literal(step)

    def _node(
        self,
        kind: Kind,
        parts: tuple[LtlFormula, ...] = (),
        *,
        atom: int = -1,
        bound: int | None = None,
    ) -> LtlFormula:
        key = (kind, tuple(p.number for p in parts), atom, bound)
        if key not in self._known:
            now = 1 << atom if atom >= 0 else 0
            for part in parts if kind is not Kind.NEXT else ():
                now |= part.now
            fixpoint = kind if bound is None else None
            co_safe = fixpoint is not Kind.RELEASE and all(p.co_safe for p in parts)
            safe = fixpoint is not Kind.UNTIL and all(p.safe for p in parts)
            eventual, universal = _persistence(kind, parts, bound)
            self._known[key] = LtlFormula(
                len(self._known), kind, parts, atom, bound, now, co_safe, safe, eventual, universal
            )
        return self._known[key]

    def literal(self, atom: int, positive: bool = True) -> LtlFormula:
        """An atom or its negation."""
        return self._node(Kind.POSITIVE if positive else Kind.NEGATIVE, atom=atom)

    def negation(self, f: LtlFormula) -> LtlFormula:
        """The negation of f, in positive normal form."""
        for part in f.subformulas() if f.number not in self._negations else ():
            if part.number not in self._negations:
                parts = tuple(self._negations[p.number] for p in part.parts)
                negated = self._negated(part, parts)
                self._negations[part.number] = negated
                self._negations.setdefault(negated.number, part)
        return self._negations[f.number]

    def _negated(self, f: LtlFormula, parts: tuple[LtlFormula, ...]) -> LtlFormula:
        match f.kind:
            case Kind.AND | Kind.OR:
                return self._combine(_DUAL[f.kind], parts)
            case Kind.NEXT:
                return self.next(parts[0])
            case Kind.UNTIL | Kind.RELEASE | Kind.POSITIVE | Kind.NEGATIVE | Kind.TRUE | Kind.FALSE:
                return self._node(_DUAL[f.kind], parts, atom=f.atom, bound=f.bound)
            case _:
                assert_never(f.kind)

    # -------------------------------------------------------------------------------------- and, or

    def conjunction(self, parts: Iterable[LtlFormula]) -> LtlFormula:
        """The conjunction of the formulas."""
        return self._combine(Kind.AND, parts)

    def disjunction(self, parts: Iterable[LtlFormula]) -> LtlFormula:
        """The disjunction of the formulas."""
        return self._combine(Kind.OR, parts)

    def _combine(self, kind: Kind, parts: Iterable[LtlFormula]) -> LtlFormula:
        conjunctive = kind is Kind.AND
        neutral, absorbing = (self.true, self.false) if conjunctive else (self.false, self.true)
        kept = _flat(kind, parts, neutral)
        if absorbing in kept:
            return absorbing
        if len(kept) <= _MAX_PARTS:
            kept = self._irredundant(kept, conjunctive=conjunctive)
        if len(kept) < 2:
            return kept[0] if kept else neutral
        return self._node(kind, tuple(kept))

    def _irredundant(self, parts: list[LtlFormula], *, conjunctive: bool) -> list[LtlFormula]:
        """The parts of a conjunction (disjunction) that no other part implies (that imply none)."""
        kept: list[LtlFormula] = []
        for i, part in enumerate(parts):
            others = kept + parts[i + 1 :]
            if not any(
                self.implies(o, part) if conjunctive else self.implies(part, o) for o in others
            ):
                kept.append(part)
        return kept

    # -------------------------------------------------------------------------------- X, F, G, U, R

    def next(self, f: LtlFormula) -> LtlFormula:
        """X f."""
        if self._step is not None and f in (self.true, self.false):
            f = self._step if f is self.true else self.negation(self._step)
        return f if f.suspendable else self._node(Kind.NEXT, (f,))

    def eventually(self, f: LtlFormula, bound: int | None = None) -> LtlFormula:
        """F f."""
        return self.until(self.true, f, bound)

    def always(self, f: LtlFormula, bound: int | None = None) -> LtlFormula:
        """G f."""
        return self.release(self.false, f, bound)

    def release(self, left: LtlFormula, right: LtlFormula, bound: int | None = None) -> LtlFormula:
        """`left R right`: right holds until and including the time when left holds.

        Without such a time, right holds forever, or for `bound` steps.
        """
        return self.negation(self.until(self.negation(left), self.negation(right), bound))

    def weak_until(self, left: LtlFormula, right: LtlFormula) -> LtlFormula:
        """`left W right`: `left U right`, or left forever."""
        return self.release(right, self.disjunction((left, right)))

    def until(self, left: LtlFormula, right: LtlFormula, bound: int | None = None) -> LtlFormula:
        """`left U right`, within `bound` steps if a bound is given."""
        if bound == 0 or left is self.false or right.eventual or self.implies(left, right):
            return right
        if bound is not None:
            return self._node(Kind.UNTIL, (left, right), bound=bound)
        if left is self.true and right.kind is Kind.NEXT:
            return self.next(self.eventually(right.parts[0]))
        if left is self.true and right.fixpoint and right.kind is Kind.UNTIL:
            return self.eventually(right.parts[1])
        if right.fixpoint and right.kind is Kind.UNTIL:
            first, second = right.parts
            if self.implies(left, first):
                return right
            if self.implies(first, left):
                return self.until(left, second)
        if left.fixpoint and left.kind is Kind.UNTIL and left.parts[1] is right:
            return left
        return self._node(Kind.UNTIL, (left, right))

    # ---------------------------------------------------------------------------------- implication

    def implies(self, f: LtlFormula, g: LtlFormula, depth: int = 0) -> bool:
        """Whether the rules show that f implies g (sound, not complete)."""
        if f is g or f is self.false or g is self.true:
            return True
        if f is self.true or g is self.false or depth > _MAX_DEPTH:
            return False
        key = (f.number, g.number)
        known = self._implications.get(key)
        if known is None:
            known = self._implied(f, g, depth + 1)
            self._implications[key] = known
        return known

    def _implied(self, f: LtlFormula, g: LtlFormula, depth: int) -> bool:
        def implies(a: LtlFormula, b: LtlFormula) -> bool:
            return self.implies(a, b, depth)

        if f.kind is Kind.OR:
            return all(implies(p, g) for p in f.parts)
        if g.kind is Kind.AND:
            return all(implies(f, p) for p in g.parts)
        if f.kind is Kind.AND and any(implies(p, g) for p in f.parts):
            return True
        if g.kind is Kind.OR and any(implies(f, p) for p in g.parts):
            return True
        if f.kind is g.kind and f.kind in _TEMPORAL and self._monotone(f, g, depth):
            return True
        if g.kind is Kind.UNTIL and implies(f, g.parts[1]):
            return True
        if f.kind is Kind.RELEASE and implies(f.parts[1], g):
            return True
        if f.kind is Kind.UNTIL and implies(f.parts[0], g) and implies(f.parts[1], g):
            return True
        if g.kind is Kind.RELEASE and implies(f, g.parts[0]) and implies(f, g.parts[1]):
            return True
        if f.kind is Kind.NEXT and g.eventual and implies(f.parts[0], g):
            return True
        return g.kind is Kind.NEXT and f.universal and implies(f, g.parts[0])

    def _monotone(self, f: LtlFormula, g: LtlFormula, depth: int) -> bool:
        if f.kind in (Kind.UNTIL, Kind.RELEASE):
            smaller, longer = (f.bound, g.bound) if f.kind is Kind.UNTIL else (g.bound, f.bound)
            if longer is not None and (smaller is None or smaller > longer):
                return False
        return all(self.implies(a, b, depth) for a, b in zip(f.parts, g.parts, strict=True))


_TEMPORAL = frozenset({Kind.NEXT, Kind.UNTIL, Kind.RELEASE})


def _persistence(kind: Kind, parts: tuple[LtlFormula, ...], bound: int | None) -> tuple[bool, bool]:
    """Whether a formula is eventual, and whether it is universal (see LtlFormula)."""
    match kind:
        case Kind.TRUE | Kind.FALSE:
            return True, True
        case Kind.POSITIVE | Kind.NEGATIVE:
            return False, False
        case Kind.AND | Kind.OR | Kind.NEXT:
            return all(p.eventual for p in parts), all(p.universal for p in parts)
        case Kind.UNTIL:
            is_eventually = bound is None and parts[0].kind is Kind.TRUE
            return parts[1].eventual or is_eventually, parts[1].universal
        case Kind.RELEASE:
            is_always = bound is None and parts[0].kind is Kind.FALSE
            return parts[1].eventual, parts[1].universal or is_always


def _flat(kind: Kind, parts: Iterable[LtlFormula], neutral: LtlFormula) -> list[LtlFormula]:
    """The operands of nested operators of one kind, each once, in order of their numbers."""
    flat = {p.number: p for part in parts for p in (part.parts if part.kind is kind else (part,))}
    flat.pop(neutral.number, None)
    return [flat[number] for number in sorted(flat)]
