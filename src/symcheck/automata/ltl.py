"""Construction of LTL formulas: one object per formula, simplified when it is made.

Sources of the rules: Etessami & Holzmann (CONCUR 2000), Somenzi & Bloem (CAV 2000), Babiak et al.
(TACAS 2012).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

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

    Example:
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
        found = self._known.get(key)
        if found is None:
            now = 1 << atom if atom >= 0 else 0
            for part in parts if kind is not Kind.NEXT else ():
                now |= part.now
            fixpoint = kind if bound is None else None
            co_safe = fixpoint is not Kind.RELEASE and all(p.co_safe for p in parts)
            safe = fixpoint is not Kind.UNTIL and all(p.safe for p in parts)
            eventual, universal = _persistence(kind, parts, bound)
            found = LtlFormula(
                len(self._known), kind, parts, atom, bound, now, co_safe, safe, eventual, universal
            )
            self._known[key] = found
        return found

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
            case _:
                return self._node(_DUAL[f.kind], parts, atom=f.atom, bound=f.bound)

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
        kept = self._merged(kind, _flat(kind, parts, neutral))
        if absorbing in kept:
            return absorbing
        if 1 < len(kept) <= _MAX_PARTS:
            if self._contradict(kept, conjunctive=conjunctive):
                return absorbing
            kept = self._irredundant(kept, conjunctive=conjunctive)
        if len(kept) < 2:
            return kept[0] if kept else neutral
        return self._node(kind, tuple(kept))

    def _merged(self, kind: Kind, parts: list[LtlFormula]) -> list[LtlFormula]:
        """Join parts with the same temporal operators, as G a & G b to G (a & b)."""
        groups: dict[str, list[LtlFormula]] = {}
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

    def _contradict(self, parts: list[LtlFormula], *, conjunctive: bool) -> bool:
        """Whether two parts of a conjunction (disjunction) exclude (exhaust) each other."""
        for i, part in enumerate(parts):
            negated = self.negation(part)
            if any(
                self.implies(p, negated) if conjunctive else self.implies(negated, p)
                for p in parts[:i]
            ):
                return True
        return False

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
        lasting, rest = _split(right, Kind.AND, lambda p: p.suspendable)
        if lasting:
            return self.conjunction((*lasting, self.until(left, self.conjunction(rest))))
        eventual, rest = _split(right, Kind.OR, lambda p: p.eventual)
        if eventual:
            return self.disjunction((*eventual, self.until(left, self.disjunction(rest))))
        if left.suspendable:
            return self.disjunction((right, self.conjunction((left, self._eventually(right)))))
        return self._node(Kind.UNTIL, (left, right))

    def _eventually(self, f: LtlFormula) -> LtlFormula:
        if f.eventual:
            return f
        if f.kind is Kind.NEXT:
            return self.next(self._eventually(f.parts[0]))
        if f.kind is Kind.UNTIL and f.bound is None:
            return self._eventually(f.parts[1])
        if f.always is not None:
            return self._eventually_always(f, f.always)
        lasting, rest = _split(f, Kind.AND, lambda p: p.suspendable)
        if lasting:
            return self.conjunction((*lasting, self._eventually(self.conjunction(rest))))
        eventual, rest = _split(f, Kind.OR, lambda p: p.eventual)
        if eventual:
            return self.disjunction((*eventual, self._eventually(self.disjunction(rest))))
        return self._node(Kind.UNTIL, (self.true, f))

    def _eventually_always(self, always: LtlFormula, f: LtlFormula) -> LtlFormula:
        """F G f, where `always` is G f. Only the long-run behaviour of f matters."""

        def fg(g: LtlFormula) -> LtlFormula:
            return self.eventually(self.always(g))

        match f.kind:
            case Kind.NEXT:
                return fg(f.parts[0])
            case Kind.RELEASE if f.bound is None:
                return fg(f.parts[1])
            case Kind.UNTIL if f.bound is None:
                return self.conjunction(
                    (fg(self.disjunction(f.parts)), self.always(self.eventually(f.parts[1])))
                )
            case Kind.AND if any(_fg_simplifies(p) for p in f.parts):
                return self.conjunction([fg(p) for p in f.parts])
            case Kind.OR if _fg_simplifies(f):
                split, rest = _split(f, Kind.OR, lambda p: p.eventual or p.universal)
                return self.disjunction((fg(self.disjunction(rest)), *(fg(p) for p in split)))
            case _:
                return self._node(Kind.UNTIL, (self.true, always))

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
        if g.kind is Kind.NEXT and f.universal and implies(f, g.parts[0]):
            return True
        fg, gf = _inner(f, "FG"), _inner(g, "GF")
        return fg is not None and gf is not None and implies(fg, gf)

    def _monotone(self, f: LtlFormula, g: LtlFormula, depth: int) -> bool:
        if f.kind in (Kind.UNTIL, Kind.RELEASE):
            shorter, longer = (f.bound, g.bound) if f.kind is Kind.UNTIL else (g.bound, f.bound)
            if longer is not None and (shorter is None or shorter > longer):
                return False
        return all(self.implies(a, b, depth) for a, b in zip(f.parts, g.parts, strict=True))


_TEMPORAL = frozenset({Kind.NEXT, Kind.UNTIL, Kind.RELEASE})
_MERGING = {Kind.AND: frozenset({"X", "G", "FG"}), Kind.OR: frozenset({"X", "F", "GF"})}


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
            return parts[1].eventual or (bound is None and parts[0].kind is Kind.TRUE), parts[
                1
            ].universal
        case Kind.RELEASE:
            return parts[1].eventual, parts[1].universal or (
                bound is None and parts[0].kind is Kind.FALSE
            )


def _flat(kind: Kind, parts: Iterable[LtlFormula], neutral: LtlFormula) -> list[LtlFormula]:
    """The operands of nested operators of one kind, each once, in order of their numbers."""
    flat = {p.number: p for part in parts for p in (part.parts if part.kind is kind else (part,))}
    flat.pop(neutral.number, None)
    return [flat[number] for number in sorted(flat)]


def _split(
    f: LtlFormula, kind: Kind, test: Callable[[LtlFormula], bool]
) -> tuple[list[LtlFormula], list[LtlFormula]]:
    """The operands that pass the test, and the others; none and f itself for another kind."""
    if f.kind is not kind:
        return [], [f]
    chosen = [p for p in f.parts if test(p)]
    return chosen, [p for p in f.parts if p not in chosen]


def _shape(f: LtlFormula) -> str:
    """The leading temporal operators of a formula: X, F, G, FG or GF; '' for others."""
    if f.kind is Kind.NEXT:
        return "X"
    for shape in ("GF", "FG", "F", "G"):
        if _inner(f, shape) is not None:
            return shape
    return ""


def _inner(f: LtlFormula, shape: str) -> LtlFormula | None:
    """The operand behind the leading operators F and G of a shape, or None."""
    inner: LtlFormula | None = f
    for symbol in shape:
        inner = None if inner is None else inner.eventually if symbol == "F" else inner.always
    return inner


def _inside(f: LtlFormula, depth: int) -> LtlFormula:
    for _ in range(depth):
        f = f.parts[-1]
    return f


def _fg_simplifies(f: LtlFormula) -> bool:
    """Whether F G f has a simpler form."""
    if f.kind is Kind.OR:
        return any(p.eventual or p.universal for p in f.parts)
    return f.kind is Kind.NEXT or f.fixpoint or f.suspendable
