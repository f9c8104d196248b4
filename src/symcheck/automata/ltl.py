"""Makes formulas of linear temporal logic: one object per formula, simplified as it is made.

Sources of the rules: Etessami & Holzmann (CONCUR 2000), Somenzi & Bloem (CAV 2000), Babiak et al. (TACAS 2012).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from symcheck.automata.formula import Formula, Kind

__all__ = ["Formulas"]

_PAIRS = 24
"""With more parts than this, conjunctions and disjunctions are not searched for parts that follow from others."""
_DEPTH = 60
"""Implications are not looked for deeper than this."""

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


class Formulas:
    """Makes formulas.

    `step`: an atom that holds in every letter; X true is then kept as X step, so that it asks for one letter more (which
    matters for rewards up to the moment when a formula is satisfied).
    """

    def __init__(self, *, step: int | None = None) -> None:
        self._known: dict[tuple[Kind, tuple[int, ...], int, int | None], Formula] = {}
        self._negations: dict[int, Formula] = {}
        self._implications: dict[tuple[int, int], bool] = {}
        self.true = self._node(Kind.TRUE)
        self.false = self._node(Kind.FALSE)
        self._step = None if step is None else self.literal(step)

    def _node(
        self,
        kind: Kind,
        parts: tuple[Formula, ...] = (),
        *,
        atom: int = -1,
        bound: int | None = None,
    ) -> Formula:
        key = (kind, tuple(p.number for p in parts), atom, bound)
        found = self._known.get(key)
        if found is None:
            now = 1 << atom if atom >= 0 else 0
            for part in parts if kind is not Kind.NEXT else ():
                now |= part.now
            fixpoint = kind if bound is None else None
            co_safe = fixpoint is not Kind.RELEASE and all(p.co_safe for p in parts)
            safe = fixpoint is not Kind.UNTIL and all(p.safe for p in parts)
            eventual, universal = _persistence(kind, parts, bound)
            found = Formula(
                len(self._known), kind, parts, atom, bound, now, co_safe, safe, eventual, universal
            )
            self._known[key] = found
        return found

    def literal(self, atom: int, positive: bool = True) -> Formula:
        """An atom or its negation."""
        return self._node(Kind.POSITIVE if positive else Kind.NEGATIVE, atom=atom)

    def negation(self, f: Formula) -> Formula:
        """The negation of f, in positive normal form."""
        for part in f.below() if f.number not in self._negations else ():
            if part.number not in self._negations:
                parts = tuple(self._negations[p.number] for p in part.parts)
                negated = self._negated(part, parts)
                self._negations[part.number] = negated
                self._negations.setdefault(negated.number, part)
        return self._negations[f.number]

    def _negated(self, f: Formula, parts: tuple[Formula, ...]) -> Formula:
        match f.kind:
            case Kind.AND | Kind.OR:
                return self._combine(_DUAL[f.kind], parts)
            case Kind.NEXT:
                return self.next(parts[0])
            case _:
                return self._node(_DUAL[f.kind], parts, atom=f.atom, bound=f.bound)

    # ------------------------------------------------------------------------------------------- and, or

    def conjunction(self, parts: Iterable[Formula]) -> Formula:
        """All of the formulas."""
        return self._combine(Kind.AND, parts)

    def disjunction(self, parts: Iterable[Formula]) -> Formula:
        """One of the formulas."""
        return self._combine(Kind.OR, parts)

    def _combine(self, kind: Kind, parts: Iterable[Formula]) -> Formula:
        conjunctive = kind is Kind.AND
        neutral, absorbing = (self.true, self.false) if conjunctive else (self.false, self.true)
        kept = self._merged(kind, _flat(kind, parts, neutral))
        if absorbing in kept:
            return absorbing
        if 1 < len(kept) <= _PAIRS:
            if self._contradict(kept, conjunctive=conjunctive):
                return absorbing
            kept = self._irredundant(kept, conjunctive=conjunctive)
        if len(kept) < 2:
            return kept[0] if kept else neutral
        return self._node(kind, tuple(kept))

    def _merged(self, kind: Kind, parts: list[Formula]) -> list[Formula]:
        """G a & G b as G (a & b), F a | F b as F (a | b), F G a & F G b, G F a | G F b, and X a & X b, X a | X b."""
        groups: dict[str, list[Formula]] = {}
        for part in parts:
            shape = _shape(part)
            groups.setdefault(shape if shape in _MERGING[kind] else "", []).append(part)
        rest = groups.pop("", [])
        if all(len(group) == 1 for group in groups.values()):
            return parts
        for shape, group in groups.items():
            if len(group) == 1:
                rest += group
                continue
            inner = self._combine(kind, [_inside(p, len(shape)) for p in group])
            for symbol in reversed(shape):
                inner = {"X": self.next, "F": self.eventually, "G": self.always}[symbol](inner)
            rest.append(inner)
        return _flat(kind, rest, self.true if kind is Kind.AND else self.false)

    def _contradict(self, parts: list[Formula], *, conjunctive: bool) -> bool:
        """Whether two parts exclude (of alternatives: exhaust) each other."""
        for i, part in enumerate(parts):
            negated = self.negation(part)
            if any(
                self.implies(p, negated) if conjunctive else self.implies(negated, p)
                for p in parts[:i]
            ):
                return True
        return False

    def _irredundant(self, parts: list[Formula], *, conjunctive: bool) -> list[Formula]:
        """The parts without those that others imply (of alternatives: that imply others)."""
        kept: list[Formula] = []
        for i, part in enumerate(parts):
            others = kept + parts[i + 1 :]
            if not any(
                self.implies(o, part) if conjunctive else self.implies(part, o) for o in others
            ):
                kept.append(part)
        return kept

    # ------------------------------------------------------------------------------------------- X, F, G, U, R

    def next(self, f: Formula) -> Formula:
        """X f."""
        if self._step is not None and f in (self.true, self.false):
            f = self._step if f is self.true else self.negation(self._step)
        return f if f.lasting else self._node(Kind.NEXT, (f,))

    def eventually(self, f: Formula, bound: int | None = None) -> Formula:
        """F f."""
        return self.until(self.true, f, bound)

    def always(self, f: Formula, bound: int | None = None) -> Formula:
        """G f."""
        return self.release(self.false, f, bound)

    def release(self, left: Formula, right: Formula, bound: int | None = None) -> Formula:
        """`left R right`: right holds up to and with the time when left does (or for ever, or for `bound` steps)."""
        return self.negation(self.until(self.negation(left), self.negation(right), bound))

    def weak_until(self, left: Formula, right: Formula) -> Formula:
        """`left W right`: until, or left for ever."""
        return self.release(right, self.disjunction((left, right)))

    def until(self, left: Formula, right: Formula, bound: int | None = None) -> Formula:
        """`left U right`, within `bound` steps where it is given."""
        if bound == 0 or left is self.false or right.eventual or self.implies(left, right):
            return right
        if bound is not None:
            return self._node(Kind.UNTIL, (left, right), bound=bound)
        if left is self.true:
            return self._eventually(right)
        if right.kind is Kind.UNTIL and right.bound is None:
            first, second = right.parts
            if self.implies(left, first):
                return right
            if self.implies(first, left):
                return self.until(left, second)
        if left.fixpoint and left.kind is Kind.UNTIL and left.parts[1] is right:
            return left
        if self.implies(self.negation(right), left):
            return self._eventually(right)
        lasting, rest = _split(right, Kind.AND, lambda p: p.lasting)
        if lasting:
            return self.conjunction((*lasting, self.until(left, self.conjunction(rest))))
        eventual, rest = _split(right, Kind.OR, lambda p: p.eventual)
        if eventual:
            return self.disjunction((*eventual, self.until(left, self.disjunction(rest))))
        if left.lasting:
            return self.disjunction((right, self.conjunction((left, self._eventually(right)))))
        return self._node(Kind.UNTIL, (left, right))

    def _eventually(self, f: Formula) -> Formula:
        if f.eventual:
            return f
        if f.kind is Kind.NEXT:
            return self.next(self._eventually(f.parts[0]))
        if f.kind is Kind.UNTIL and f.bound is None:
            return self._eventually(f.parts[1])
        if f.always is not None:
            return self._stable(f, f.always)
        lasting, rest = _split(f, Kind.AND, lambda p: p.lasting)
        if lasting:
            return self.conjunction((*lasting, self._eventually(self.conjunction(rest))))
        eventual, rest = _split(f, Kind.OR, lambda p: p.eventual)
        if eventual:
            return self.disjunction((*eventual, self._eventually(self.disjunction(rest))))
        return self._node(Kind.UNTIL, (self.true, f))

    def _stable(self, always: Formula, f: Formula) -> Formula:
        """F G f, where `always` is G f: what is inside matters in the long run only."""

        def again(g: Formula) -> Formula:
            return self.eventually(self.always(g))

        match f.kind:
            case Kind.NEXT:
                return again(f.parts[0])
            case Kind.RELEASE if f.bound is None:
                return again(f.parts[1])
            case Kind.UNTIL if f.bound is None:
                return self.conjunction(
                    (again(self.disjunction(f.parts)), self.always(self.eventually(f.parts[1])))
                )
            case Kind.AND if any(_changes(p) for p in f.parts):
                return self.conjunction([again(p) for p in f.parts])
            case Kind.OR if _changes(f):
                split, rest = _split(f, Kind.OR, lambda p: p.eventual or p.universal)
                return self.disjunction((again(self.disjunction(rest)), *(again(p) for p in split)))
            case _:
                return self._node(Kind.UNTIL, (self.true, always))

    # ------------------------------------------------------------------------------------------- implication

    def implies(self, f: Formula, g: Formula, depth: int = 0) -> bool:
        """Whether f implies g, as far as some rules tell (True is certain, False is not)."""
        if f is g or f is self.false or g is self.true:
            return True
        if f is self.true or g is self.false or depth > _DEPTH:
            return False
        key = (f.number, g.number)
        known = self._implications.get(key)
        if known is None:
            known = self._implied(f, g, depth + 1)
            self._implications[key] = known
        return known

    def _implied(self, f: Formula, g: Formula, depth: int) -> bool:
        def implies(a: Formula, b: Formula) -> bool:
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
        if g.kind is Kind.NEXT and f.universal and implies(f, g.parts[0]):
            return True
        stable, often = _inner(f, "FG"), _inner(g, "GF")
        return stable is not None and often is not None and implies(stable, often)

    def _monotone(self, f: Formula, g: Formula, depth: int) -> bool:
        if f.kind in (Kind.UNTIL, Kind.RELEASE):
            shorter, longer = (f.bound, g.bound) if f.kind is Kind.UNTIL else (g.bound, f.bound)
            if longer is not None and (shorter is None or shorter > longer):
                return False
        return all(self.implies(a, b, depth) for a, b in zip(f.parts, g.parts, strict=True))


_TEMPORAL = frozenset({Kind.NEXT, Kind.UNTIL, Kind.RELEASE})
_MERGING = {Kind.AND: frozenset({"X", "G", "FG"}), Kind.OR: frozenset({"X", "F", "GF"})}


def _persistence(kind: Kind, parts: tuple[Formula, ...], bound: int | None) -> tuple[bool, bool]:
    """Whether a formula is eventual, and universal (see Formula)."""
    match kind:
        case Kind.TRUE | Kind.FALSE:
            return True, True
        case Kind.POSITIVE | Kind.NEGATIVE:
            return False, False
        case Kind.AND | Kind.OR | Kind.NEXT:
            return all(p.eventual for p in parts), all(p.universal for p in parts)
        case Kind.UNTIL:
            return parts[1].eventual or (bound is None and parts[0].kind is Kind.TRUE), parts[
                1
            ].universal
        case Kind.RELEASE:
            return parts[1].eventual, parts[1].universal or (
                bound is None and parts[0].kind is Kind.FALSE
            )


def _flat(kind: Kind, parts: Iterable[Formula], neutral: Formula) -> list[Formula]:
    """The parts, with those of the same kind taken apart, each once and in order."""
    flat = {p.number: p for part in parts for p in (part.parts if part.kind is kind else (part,))}
    flat.pop(neutral.number, None)
    return [flat[number] for number in sorted(flat)]


def _split(
    f: Formula, kind: Kind, test: Callable[[Formula], bool]
) -> tuple[list[Formula], list[Formula]]:
    """The parts that pass the test, and the others; nothing where f is not of this kind."""
    if f.kind is not kind:
        return [], [f]
    chosen = [p for p in f.parts if test(p)]
    return chosen, [p for p in f.parts if p not in chosen]


def _shape(f: Formula) -> str:
    """The temporal operators that a formula begins with, of X, F, G, FG, GF; '' for others."""
    if f.kind is Kind.NEXT:
        return "X"
    for shape in ("GF", "FG", "F", "G"):
        if _inner(f, shape) is not None:
            return shape
    return ""


def _inner(f: Formula, shape: str) -> Formula | None:
    """What stands behind the operators F and G of a shape."""
    inner: Formula | None = f
    for symbol in shape:
        inner = None if inner is None else inner.eventually if symbol == "F" else inner.always
    return inner


def _inside(f: Formula, depth: int) -> Formula:
    for _ in range(depth):
        f = f.parts[-1]
    return f


def _changes(f: Formula) -> bool:
    """Whether F G f has a simpler form."""
    if f.kind is Kind.OR:
        return any(p.eventual or p.universal for p in f.parts)
    return f.kind is Kind.NEXT or f.fixpoint or f.lasting
