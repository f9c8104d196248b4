"""LTL formulas in positive normal form: negation at atoms only.

The operators are literals, and, or, X, U and R. The others are abbreviations: F a = true U a,
G a = false R a, a W b = b R (a | b). U and R may have a bound: a U<=k b requires b within k steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import assert_never

__all__ = ["Kind", "LtlFormula"]


class Kind(Enum):
    """The operator at the root of a formula."""

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
class LtlFormula:
    """A formula, made by `symcheck.automata.ltl.LtlFactory` only: equal formulas are one object.

    number: in order of creation, so subformulas have lower numbers.
    atom: the number of a literal's atom.
    bound: the largest number of steps of U and R; None without a bound.
    now: the atoms, as bits, whose values in the first letter matter.
    co_safe, safe: without unbounded R, without unbounded U.
    eventual, universal: pure eventuality and purely universal formula (Etessami & Holzmann 2000):
      if it holds at some time, it holds at all earlier (later) times, as F a (G a) does.
    """

    number: int
    kind: Kind
    parts: tuple[LtlFormula, ...] = ()
    atom: int = -1
    bound: int | None = None
    now: int = 0
    co_safe: bool = True
    safe: bool = True
    eventual: bool = False
    universal: bool = False

    @property
    def suspendable(self) -> bool:
        """Whether it has the same value at all times, as G F a has (Babiak et al. 2013)."""
        return self.eventual and self.universal

    @property
    def fixpoint(self) -> bool:
        """Whether this is an unbounded U or R."""
        return self.bound is None and self.kind in (Kind.UNTIL, Kind.RELEASE)

    @property
    def eventually(self) -> LtlFormula | None:
        """The operand a if this is F a, else None."""
        return (
            self.parts[1]
            if self.fixpoint and self.kind is Kind.UNTIL and self.parts[0].kind is Kind.TRUE
            else None
        )

    @property
    def always(self) -> LtlFormula | None:
        """The operand a if this is G a, else None."""
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
            case Kind.UNTIL | Kind.RELEASE:
                bound = "" if self.bound is None else f"<={self.bound}"
                left, right = self.parts
                if self.kind is Kind.UNTIL and left.kind is Kind.TRUE:
                    return f"F{bound} {right}"
                if self.kind is Kind.RELEASE and left.kind is Kind.FALSE:
                    return f"G{bound} {right}"
                return f"({left} {self.kind.value}{bound} {right})"
            case _:
                assert_never(self.kind)

    def subformulas(self) -> list[LtlFormula]:
        """The subformulas, operands first and itself last; iterative, as formulas may be deep."""
        result: dict[int, LtlFormula] = {self.number: self}
        todo = [self]
        while todo:
            for part in todo.pop().parts:
                if part.number not in result:
                    result[part.number] = part
                    todo.append(part)
        return [result[number] for number in sorted(result)]
