"""The operators and functions of expressions: one table of what other packages ask of them.

The truth table of a logical operator defines it for evaluators, diagrams, sets of states and LTL.
The other operators and the functions have one entry each in the tables of the evaluators;
`tests/syntax/test_operators.py` names missing entries.
"""

from __future__ import annotations

import operator as python
from collections.abc import Callable, Mapping
from enum import Enum, StrEnum
from typing import Any, TypeVar

__all__ = [
    "CTL_HINTS",
    "FUNCTION_BY_NAME",
    "OPERATOR_BY_TOKEN",
    "Function",
    "Operator",
    "Signature",
    "UnaryOperator",
    "connect",
    "function_hint",
]

T = TypeVar("T")


class Signature(Enum):
    """The types of the operands and of the result."""

    LOGICAL = "bool x bool -> bool"
    EQUALITY = "any x the same -> bool"
    ORDER = "number x number -> bool"
    ARITHMETIC = "number x number -> int for ints, else double"
    DIVISION = "number x number -> double"


class UnaryOperator(StrEnum):
    """`!x` and `-x`. The value is the token; for the precedence see `Operator`."""

    precedence: int

    def __new__(cls, token: str, precedence: int) -> UnaryOperator:
        """A member of the table."""
        self = str.__new__(cls, token)
        self._value_ = token
        self.precedence = precedence
        return self

    NOT = "!", 5
    MINUS = "-", 11

    __repr__ = str.__repr__


class Operator(StrEnum):
    """A binary operator. The value is the token.

    precedence: how tightly it binds, from 1; equal ones associate to the left, `=>` to the right.
    truth: of a logical operator, its value for the operands ff, ft, tf and tt.
    """

    precedence: int
    signature: Signature
    truth: tuple[bool, bool, bool, bool] | None

    def __new__(
        cls, token: str, precedence: int, signature: Signature, truth: str | None = None
    ) -> Operator:
        """A member of the table."""
        self = str.__new__(cls, token)
        self._value_ = token
        self.precedence, self.signature = precedence, signature
        if truth is not None:
            ff, ft, tf, tt = (t == "t" for t in truth)
            self.truth = ff, ft, tf, tt
        else:
            self.truth = None
        return self

    IMPLIES = "=>", 1, Signature.LOGICAL, "ttft"
    IFF = "<=>", 2, Signature.LOGICAL, "tfft"
    OR = "|", 3, Signature.LOGICAL, "fttt"
    AND = "&", 4, Signature.LOGICAL, "ffft"
    EQ = "=", 6, Signature.EQUALITY
    NE = "!=", 6, Signature.EQUALITY
    LT = "<", 7, Signature.ORDER
    LE = "<=", 7, Signature.ORDER
    GT = ">", 7, Signature.ORDER
    GE = ">=", 7, Signature.ORDER
    PLUS = "+", 8, Signature.ARITHMETIC
    MINUS = "-", 8, Signature.ARITHMETIC
    TIMES = "*", 9, Signature.ARITHMETIC
    DIVIDE = "/", 9, Signature.DIVISION
    POWER = "^", 10, Signature.ARITHMETIC

    __repr__ = str.__repr__

    @property
    def is_logical(self) -> bool:
        """Whether the operands are bools, or formulas of linear time."""
        return self.signature is Signature.LOGICAL

    @property
    def is_comparison(self) -> bool:
        """Whether two values are compared."""
        return self.signature in (Signature.EQUALITY, Signature.ORDER)

    @property
    def is_boolean(self) -> bool:
        """Whether the result is a bool."""
        return self.is_logical or self.is_comparison

    @property
    def is_associative(self) -> bool:
        """Whether long chains may be balanced: `&`, `|`, and up to rounding `+` and `*`."""
        return self in (Operator.AND, Operator.OR, Operator.PLUS, Operator.TIMES)

    @property
    def is_lower_bound(self) -> bool:
        """Whether `x op k` bounds x from below: `>` and `>=`."""
        return self in (Operator.GT, Operator.GE)

    @property
    def mirrored(self) -> Operator:
        """The comparison with its operands exchanged: `x < y` is `y > x`."""
        return _MIRRORED.get(self, self)

    def decided(self, left: bool) -> bool | None:
        """The value of a logical operator if the left operand alone decides it; else None."""
        assert self.truth is not None
        one, other = self.truth[2:] if left else self.truth[:2]
        return one if one is other else None

    @property
    def distinguished(self) -> tuple[bool, bool, bool] | None:
        """The operands and the value that occur once in the truth table.

        For example, `&` is true for (true, true) only.
        """
        if self.truth is None or sum(self.truth) not in (1, 3):
            return None
        value = sum(self.truth) == 1
        row = self.truth.index(value)
        return row >= 2, row % 2 == 1, value

    def apply(self, left: bool, right: bool) -> bool:
        """The value of a logical operator."""
        assert self.truth is not None
        return self.truth[2 * left + right]


_MIRRORED = {
    Operator.LT: Operator.GT,
    Operator.LE: Operator.GE,
    Operator.GT: Operator.LT,
    Operator.GE: Operator.LE,
}


class Function(StrEnum):
    """A function. The value is its name.

    arity: how many arguments it takes; None: one or more.
    """

    arity: int | None

    def __new__(cls, name: str, arity: int | None) -> Function:
        """A member of the table."""
        self = str.__new__(cls, name)
        self._value_ = name
        self.arity = arity
        return self

    MIN = "min", None
    MAX = "max", None
    FLOOR = "floor", 1
    CEIL = "ceil", 1
    ROUND = "round", 1
    POW = "pow", 2
    MOD = "mod", 2
    LOG = "log", 2

    __repr__ = str.__repr__


OPERATOR_BY_TOKEN: Mapping[str, Operator] = {o.value: o for o in Operator}
FUNCTION_BY_NAME: Mapping[str, Function] = {f.value: f for f in Function}


def connect(
    operator: Operator,
    left: T,
    right: T,
    *,
    conjunction: Callable[[T, T], T] = python.and_,
    disjunction: Callable[[T, T], T] = python.or_,
    negation: Callable[[Any], Any] = python.invert,
) -> T:
    """A logical operator on a boolean algebra: sets of states, diagrams, bool arrays, formulas."""
    when, unless = operator.decided(True), operator.decided(False)
    assert when is None or unless is None, "an operator that does not depend on its right operand"
    if when is True:
        return disjunction(left, _restricted(operator, False, right, negation))
    if unless is True:
        return disjunction(negation(left), _restricted(operator, True, right, negation))
    if when is False:
        return conjunction(negation(left), _restricted(operator, False, right, negation))
    if unless is False:
        return conjunction(left, _restricted(operator, True, right, negation))
    return disjunction(
        conjunction(left, _restricted(operator, True, right, negation)),
        conjunction(negation(left), _restricted(operator, False, right, negation)),
    )


def _restricted(operator: Operator, left: bool, right: T, negation: Callable[[T], T]) -> T:
    """The operator for an undecided left operand: the right operand or its negation."""
    return right if operator.apply(left, True) else negation(right)


CTL_HINTS = {
    f"{quantifier}{path}": f"write {quantifier} [ {path} … ]"
    for quantifier in "AE"
    for path in "FGX"
}
"""What to write instead of the names that other tools give to pairs of a quantifier and a path."""


def function_hint(name: str) -> str:
    """The hint for a name that stands like a function and is none."""
    return CTL_HINTS.get(name) or f"the functions are {', '.join(FUNCTION_BY_NAME)}"
