"""The operators and functions of expressions: one table of what other packages ask of them.

The truth table of a logical operator defines it for evaluators, diagrams, sets of states and LTL.
The other operators and the functions have one meaning each in
`symcheck.semantics.expressions.evaluate` (exact), and one in `operations` beside it (instructions,
which serve columns, code and values with bounds).
"""

from __future__ import annotations

import operator as python
from collections.abc import Callable, Iterable, Mapping
from enum import Enum, StrEnum
from typing import Any, TypeVar

__all__ = [
    "CTL_HINTS",
    "FUNCTION_BY_NAME",
    "FUNCTION_IN_JANI",
    "OPERATOR_BY_TOKEN",
    "OPERATOR_IN_JANI",
    "Function",
    "Operation",
    "Operator",
    "Signature",
    "UnaryOperator",
    "complete",
    "connect",
    "function_hint",
]

K = TypeVar("K")
T = TypeVar("T")


class Signature(Enum):
    """The types of the operands and of the result."""

    LOGICAL = "bools -> bool"
    EQUALITY = "any, the same -> bool"
    ORDER = "numbers -> bool"
    ARITHMETIC = "numbers -> int for ints, else double"
    DIVISION = "numbers -> double"
    INTEGER = "ints -> int"
    ROUNDING = "number -> int"


_CONDITIONS = (Signature.LOGICAL, Signature.EQUALITY, Signature.ORDER)
"""The types of what has a bool as its value."""


def complete(table: Mapping[K, T], needed: Iterable[K]) -> Mapping[K, T]:
    """A table of meanings that has an entry for each member that needs one.

    Raises:
        TypeError: entries are missing, when the module is imported.
    """
    missing = [str(member) for member in needed if member not in table]
    if missing:
        raise TypeError(f"this table has no meaning for {', '.join(missing)}")
    return table


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

    jani: the operator of JANI that has its value; None: there is none, and the writer spells it.
    precedence: how tightly it binds, from 1; equal ones associate to the left, `=>` to the right.
    truth: of a logical operator, its value for the operands ff, ft, tf and tt.
    compare: of a comparison, its value for two numbers, or arrays of them element by element.
    """

    jani: str | None
    precedence: int
    signature: Signature
    truth: tuple[bool, bool, bool, bool] | None
    compare: Callable[[Any, Any], Any]

    def __new__(
        cls,
        token: str,
        jani: str | None,
        precedence: int,
        signature: Signature,
        meaning: str | Callable[[Any, Any], Any] | None = None,
    ) -> Operator:
        """A member of the table."""
        self = str.__new__(cls, token)
        self._value_ = token
        self.jani, self.precedence, self.signature = jani, precedence, signature
        assert self.is_boolean is (meaning is not None), f"the meaning of {token}"
        self.truth = None
        if isinstance(meaning, str):
            ff, ft, tf, tt = (t == "t" for t in meaning)
            self.truth = ff, ft, tf, tt
        elif meaning is not None:
            self.compare = meaning
        return self

    # In JANI, the last one of several with the same name is read.
    IMPLIES = "=>", "⇒", 1, Signature.LOGICAL, "ttft"
    IFF = "<=>", "=", 2, Signature.LOGICAL, "tfft"
    OR = "|", "∨", 3, Signature.LOGICAL, "fttt"
    AND = "&", "∧", 4, Signature.LOGICAL, "ffft"
    EQ = "=", "=", 6, Signature.EQUALITY, python.eq
    NE = "!=", "≠", 6, Signature.EQUALITY, python.ne
    LT = "<", "<", 7, Signature.ORDER, python.lt
    LE = "<=", "≤", 7, Signature.ORDER, python.le
    GT = ">", ">", 7, Signature.ORDER, python.gt
    GE = ">=", "≥", 7, Signature.ORDER, python.ge
    PLUS = "+", "+", 8, Signature.ARITHMETIC
    MINUS = "-", "-", 8, Signature.ARITHMETIC
    TIMES = "*", "*", 9, Signature.ARITHMETIC
    DIVIDE = "/", "/", 9, Signature.DIVISION
    POWER = "^", "pow", 10, Signature.ARITHMETIC

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
        return self.signature in _CONDITIONS

    @property
    def is_total(self) -> bool:
        """As `Function.is_total`."""
        return self.is_boolean or self in (Operator.PLUS, Operator.MINUS, Operator.TIMES)

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
    """A function with a number as its value. The value of a member is its name.

    jani: the operator of JANI that has its value; None: there is none, and the writer spells it.
    arity: how many arguments it takes; None: one or more, from the left: `min(a, b, c)` is
        `min(min(a, b), c)`.
    is_total: whether it has a finite value wherever its arguments have one, apart from ints beyond
        64 bits.
    """

    jani: str | None
    arity: int | None
    signature: Signature
    is_total: bool

    def __new__(
        cls,
        name: str,
        jani: str | None,
        arity: int | None,
        signature: Signature,
        is_total: bool = False,
    ) -> Function:
        """A member of the table."""
        self = str.__new__(cls, name)
        self._value_ = name
        self.jani, self.arity, self.signature, self.is_total = jani, arity, signature, is_total
        assert signature not in _CONDITIONS, f"{name} is no number"
        assert arity == 1 or signature is not Signature.ROUNDING, f"{name} rounds one number"
        return self

    MIN = "min", "min", None, Signature.ARITHMETIC, True
    MAX = "max", "max", None, Signature.ARITHMETIC, True
    FLOOR = "floor", "floor", 1, Signature.ROUNDING, True
    CEIL = "ceil", "ceil", 1, Signature.ROUNDING, True
    ROUND = "round", None, 1, Signature.ROUNDING, True
    POW = "pow", "pow", 2, Signature.ARITHMETIC
    MOD = "mod", "%", 2, Signature.INTEGER
    LOG = "log", "log", 2, Signature.DIVISION

    __repr__ = str.__repr__


Operation = UnaryOperator | Operator | Function
OPERATOR_BY_TOKEN: Mapping[str, Operator] = {o.value: o for o in Operator}
FUNCTION_BY_NAME: Mapping[str, Function] = {f.value: f for f in Function}
OPERATOR_IN_JANI: Mapping[str | None, Operator] = {o.jani: o for o in Operator}
FUNCTION_IN_JANI: Mapping[str | None, Function] = {f.jani: f for f in Function}


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


_FUNCTION_HINTS = {
    "abs": "write max(x, -x)",
    "sqrt": "write pow(x, 0.5)",
    "exp": "write pow(2.718281828459045, x)",
    "ceiling": "did you mean ceil?",
    "power": "did you mean pow?",
    "next": "the next value is written in an update: (x'=…)",
    "pr": "write P=? [ … ]",
    "prob": "write P=? [ … ]",
} | {str(f): f"did you mean {f}?" for f in Function}
"""What to write instead of functions of other languages, by their names in lower case."""


def function_hint(name: str) -> str:
    """The hint for a name that stands like a function and is none."""
    return (
        CTL_HINTS.get(name)
        or _FUNCTION_HINTS.get(name.lower())
        or f"the functions are {', '.join(FUNCTION_BY_NAME)}"
    )
