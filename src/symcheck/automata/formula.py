"""Formulas of linear temporal logic in positive normal form, over atoms that are numbered from 0.

The operators are literals, and, or, X, U and R; the others are written with them: F a = true U a, G a = false R a,
a W b = b R (a | b). U and R may have a bound on steps: `a U<=k b` asks for b within k steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

__all__ = ["Formula", "Kind"]


class Kind(Enum):
    """What stands at the root of a formula."""

    TRUE = "true"
    FALSE = "false"
    POSITIVE = "atom"
    NEGATIVE = "negated atom"
    AND = "&"
    OR = "|"
    NEXT = "X"
    UNTIL = "U"
    RELEASE = "R"


@dataclass(frozen=True, slots=True, eq=False)
class Formula:
    """A formula, made by `symcheck.automata.ltl.Formulas` only: there is one object per formula, so that `is` compares.

    number: in order of creation, so that parts have lower numbers. atom: of a literal. bound: steps of U and R (None: no bound).
    now: the atoms, as bits, that the first letter is asked for. co_safe, safe: no unbounded R, no unbounded U.
    eventual (universal): where it holds at some time, it does so at all times before (after), as F a (G a) does.
    """

    number: int
    kind: Kind
    parts: tuple[Formula, ...] = ()
    atom: int = -1
    bound: int | None = None
    now: int = 0
    co_safe: bool = True
    safe: bool = True
    eventual: bool = False
    universal: bool = False

    @property
    def lasting(self) -> bool:
        """Whether it has the same value at all times, as G F a has."""
        return self.eventual and self.universal

    @property
    def fixpoint(self) -> bool:
        """Whether this is an unbounded U or R."""
        return self.bound is None and self.kind in (Kind.UNTIL, Kind.RELEASE)

    @property
    def eventually(self) -> Formula | None:
        """a, where this is F a."""
        return (
            self.parts[1]
            if self.fixpoint and self.kind is Kind.UNTIL and self.parts[0].kind is Kind.TRUE
            else None
        )

    @property
    def always(self) -> Formula | None:
        """a, where this is G a."""
        return (
            self.parts[1]
            if self.fixpoint and self.kind is Kind.RELEASE and self.parts[0].kind is Kind.FALSE
            else None
        )

    def __str__(self) -> str:
        match self.kind:
            case Kind.TRUE | Kind.FALSE:
                return str(self.kind.value)
            case Kind.POSITIVE:
                return f"p{self.atom}"
            case Kind.NEGATIVE:
                return f"!p{self.atom}"
            case Kind.NEXT:
                return f"X {self.parts[0]}"
            case Kind.AND | Kind.OR:
                return "(" + f" {self.kind.value} ".join(map(str, self.parts)) + ")"
            case _:
                bound = "" if self.bound is None else f"<={self.bound}"
                left, right = self.parts
                names: dict[tuple[Kind, Kind], str] = {
                    (Kind.UNTIL, Kind.TRUE): "F",
                    (Kind.RELEASE, Kind.FALSE): "G",
                }
                short = names.get((self.kind, left.kind))
                return (
                    f"({left} {self.kind.value}{bound} {right})"
                    if short is None
                    else f"{short}{bound} {right}"
                )

    def below(self) -> list[Formula]:
        """All parts of the formula and itself, parts first. Not recursive: bounds make deep formulas."""
        found: dict[int, Formula] = {self.number: self}
        todo = [self]
        while todo:
            for part in todo.pop().parts:
                if part.number not in found:
                    found[part.number] = part
                    todo.append(part)
        return [found[number] for number in sorted(found)]
