"""Evaluation of an expression at one state, in floating point or exactly.

It defines the semantics of expressions, and is the oracle for the faster evaluators:

- `+ - * min max pow ^` of ints give an int (beyond 64 bits is an error, PRISM's limit is 32),
  otherwise a double; `/` always gives a double; `floor ceil round` give an int; `c ? a : b` is a
  double if either branch is one.
- Doubles follow IEEE 754 (2019): `1/0` is infinite, `0/0` is NaN, and `min` and `max` of anything
  and NaN are NaN. Zero has a sign, which only a division, a power or a logarithm shows: `0 / -3`
  is -0.0, and `min` and `max` take -0.0 as less than 0.0 (its operations minimum and maximum, and
  Java's). In exact arithmetic, doubles are Fractions except infinities and NaN, and zero has no
  sign. An int zero has none either.
- `round(x)` is floor(x + 1/2) without rounding error. `floor ceil round` of NaN, an infinity or a
  number beyond 64 bits are errors.
- `pow` of ints with a negative exponent is an error, because its type would not be int. In exact
  arithmetic, an exponent that is not integral is an error (such powers are irrational in general),
  and so is a logarithm that is not rational.
- `mod(i, j)` is the non-negative remainder for j > 0; for j < 0 it is the remainder of the division
  that rounds towards zero, plus j if that is negative (as in PRISM). j = 0 is an error.
- `log(x, b)` is ln x / ln b, and NaN if the base is not a positive number other than 1.
- `& | => ?:` are evaluated from left to right, and do not evaluate operands that do not matter.
"""

from __future__ import annotations

import math
import operator as op
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import assert_never

from symcheck.errors import Diagnostic, InputError, ModelFault, NameFault, UnsupportedError
from symcheck.semantics.expressions.deep_recursion import with_deep_recursion
from symcheck.semantics.expressions.literals import convert, format_value, to_float, type_of_value
from symcheck.semantics.expressions.types import static_type
from symcheck.semantics.model import Value
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    LabelReference,
    Literal,
    Name,
    Node,
    StateOperator,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator, UnaryOperator

__all__ = [
    "BINARY",
    "FUNCTIONS",
    "INT_MAX",
    "INT_MIN",
    "IRRATIONAL",
    "evaluate",
    "evaluate_constant",
    "is_int64",
]

INT_MIN, INT_MAX = -(2**63), 2**63 - 1
_EXPONENT_LIMIT = 1 << 20
IRRATIONAL = frozenset({"exact-power", "exact-log"})
"""The codes of the faults of values that no rational is, or that would be too long."""

Meaning = Callable[[Value, Value, bool, Node], Value]
"""The function of an operator: two values, whether arithmetic is exact, and the node for errors."""

FunctionMeaning = Callable[[Sequence[Value], bool, Node], Value]


@with_deep_recursion
def evaluate(
    expression: Expression, valuation: Mapping[str, Value], *, exact: bool = False
) -> Value:
    """The value of an expression under a valuation of its names.

    Args:
        expression: a well-typed expression without labels and temporal operators.
        valuation: values by name.
        exact: compute with fractions.

    Returns:
        A bool, an int, a float, or (exact) a Fraction.

    Raises:
        ModelFault: the expression has no value (see the module's docstring).
        NameFault: a name has no value.
    """
    return _evaluate(expression, valuation, exact)


def evaluate_constant(expression: Expression) -> Value:
    """The value of an expression without names: rational, or the nearest double where it is not.

    Raises ModelFault as `evaluate`.
    """
    try:
        return evaluate(expression, {}, exact=True)
    except ModelFault as fault:
        if not IRRATIONAL.issuperset(d.code for d in fault.diagnostics):
            raise
        return evaluate(expression, {})


def _evaluate(expression: Expression, valuation: Mapping[str, Value], exact: bool) -> Value:
    match expression:
        case Literal(value, kind):
            return convert(_checked(value, expression), kind, exact)
        case Name(name):
            if name not in valuation:
                raise NameFault(Diagnostic(f"{name} has no value", expression.span, "unknown-name"))
            given = valuation[name]
            return (
                convert(given, Type.DOUBLE, exact) if isinstance(given, float | Fraction) else given
            )
        case Unary(UnaryOperator.NOT, operand):
            return not _evaluate(operand, valuation, exact)
        case Unary(_, operand):
            return _checked(-_evaluate(operand, valuation, exact), expression)
        case Binary(operator, left, right) if operator.is_logical:
            first = bool(_evaluate(left, valuation, exact))
            decided = operator.decided(first)
            if decided is not None:
                return decided
            return operator.apply(first, bool(_evaluate(right, valuation, exact)))
        case Binary(operator, left, right):
            a, b = _evaluate(left, valuation, exact), _evaluate(right, valuation, exact)
            return BINARY[operator](a, b, exact, expression)
        case Conditional():
            return _conditional(expression, valuation, exact)
        case Call(function, arguments):
            values = [_evaluate(a, valuation, exact) for a in arguments]
            return FUNCTIONS[function](values, exact, expression)
        case LabelReference() | StateOperator():
            raise UnsupportedError(
                f"{_describe(expression)} cannot be evaluated at a single state: check it on the "
                "model"
            )
        case _:
            assert_never(expression)


def _describe(node: Node) -> str:
    return f'"{node.name}"' if isinstance(node, LabelReference) else f"a {type(node).__name__}"


def _conditional(expression: Conditional, valuation: Mapping[str, Value], exact: bool) -> Value:
    holds = _evaluate(expression.condition, valuation, exact)
    chosen, other = (
        (expression.then, expression.otherwise)
        if holds
        else (expression.otherwise, expression.then)
    )
    value = _evaluate(chosen, valuation, exact)
    # The type of an expression is static: an int becomes a double if the other branch is a double.
    if (
        isinstance(value, int)
        and not isinstance(value, bool)
        and static_type(other, lambda name: type_of_value(valuation[name])) is Type.DOUBLE
    ):
        return convert(value, Type.DOUBLE, exact)
    return value


def _both_int(a: Value, b: Value) -> bool:
    return isinstance(a, int) and isinstance(b, int)


def _comparison(compare: Callable[[Value, Value], bool]) -> Meaning:
    def apply(a: Value, b: Value, exact: bool, node: Node) -> bool:  # noqa: ARG001
        if not _both_int(a, b):
            a, b = convert(a, Type.DOUBLE, exact), convert(b, Type.DOUBLE, exact)
        return compare(a, b)

    return apply


def _arithmetic(operation: Callable[[Value, Value], Value]) -> Meaning:
    def apply(a: Value, b: Value, exact: bool, node: Node) -> Value:
        if _both_int(a, b):
            return _checked(operation(a, b), node)
        a, b = convert(a, Type.DOUBLE, exact), convert(b, Type.DOUBLE, exact)
        if isinstance(a, Fraction) and isinstance(b, Fraction):
            return operation(a, b)
        # In exact arithmetic one operand is infinite or NaN here: only the other's sign matters.
        return operation(_sign_if_exact(a), _sign_if_exact(b))

    return apply


def _sign_if_exact(value: Value) -> float:
    return float((value > 0) - (value < 0)) if isinstance(value, Fraction) else float(value)


def _divide(a: Value, b: Value, exact: bool, node: Node) -> Value:  # noqa: ARG001
    a, b = convert(a, Type.DOUBLE, exact), convert(b, Type.DOUBLE, exact)
    if isinstance(a, Fraction) and isinstance(b, Fraction) and b != 0:
        return a / b
    x, y = _sign_if_exact(a), _sign_if_exact(b)
    if y != 0:
        quotient = x / y
    elif x == 0 or math.isnan(x):
        quotient = math.nan
    else:
        quotient = math.copysign(math.inf, x) * math.copysign(1.0, y)
    return Fraction(quotient) if exact and math.isfinite(quotient) else quotient


def is_int64(value: int | Fraction) -> bool:
    """Whether an int fits into 64 bits."""
    return INT_MIN <= value <= INT_MAX


def _checked(value: Value, node: Node) -> Value:
    if isinstance(value, int) and not is_int64(value):
        raise _overflow(node)
    return value


def _overflow(node: Node) -> InputError:
    hint = "write one of the operands as a double, such as 2.0"
    return _fault(node, "int-overflow", "an int beyond 64 bits", hint)


def _fault(node: Node, code: str, message: str, hint: str | None = None) -> InputError:
    return ModelFault(Diagnostic(message, node.span, code, hint))


# ---------------------------------------------------------------------------- powers and logarithms


def _power(a: Value, b: Value, exact: bool, node: Node) -> Value:
    if isinstance(a, int) and isinstance(b, int):
        if b < 0:
            raise _fault(
                node,
                "pow-negative",
                f"negative exponent {b} of a power of ints",
                f"make the base a double: {a}.0",
            )
        if abs(a) > 1 and b > 63:
            raise _overflow(node)
        return _checked(a**b, node)
    a, b = convert(a, Type.DOUBLE, exact), convert(b, Type.DOUBLE, exact)
    if isinstance(a, Fraction) and isinstance(b, Fraction):
        return _exact_power(a, b, node)
    return _finite_exact(_float_power(to_float(a), to_float(b)), exact)


def _finite_exact(value: float, exact: bool) -> Value:
    return Fraction(value) if exact and math.isfinite(value) else value


def _exact_power(a: Fraction, b: Fraction, node: Node) -> Value:
    if b.denominator != 1:
        raise _fault(
            node,
            "exact-power",
            f"a power with fractional exponent {b} has no exact value",
            "run without exact arithmetic",
        )
    if abs(a) != 1 and a != 0 and abs(b) > _EXPONENT_LIMIT:
        raise _fault(
            node, "exact-power", f"a power with exponent {b} is too large for exact arithmetic"
        )
    if a == 0 and b < 0:
        return math.inf
    return a ** int(b)


def _float_power(a: float, b: float) -> float:
    """C's pow: overflow and negative powers of 0 are infinite, roots of negative numbers NaN."""
    try:
        return math.pow(a, b)
    except OverflowError:
        return -math.inf if a < 0 and b % 2 == 1 else math.inf
    except ValueError:
        if a != 0:
            return math.nan
        return math.copysign(math.inf, a) if b % 2 == 1 else math.inf


def _logarithm(x: Value, b: Value, exact: bool, node: Node) -> Value:
    x, b = convert(x, Type.DOUBLE, exact), convert(b, Type.DOUBLE, exact)
    if not (b > 0 and b != 1 and b != math.inf) or not x >= 0:
        return math.nan
    if x == 0 or x == math.inf:
        return math.inf if (x > 1) == (b > 1) else -math.inf
    if isinstance(x, Fraction) and isinstance(b, Fraction):
        return _exact_logarithm(x, b, node)
    return math.log(x) / math.log(b)


def _exact_logarithm(x: Fraction, b: Fraction, node: Node) -> Value:
    if x == 1:
        return Fraction(0)
    ratio = _ln(x) / _ln(b)
    for inverse in (False, True):
        guess = round(1 / ratio if inverse else ratio)
        base, power = (x, b) if inverse else (b, x)
        if guess != 0 and abs(guess) < _EXPONENT_LIMIT and base**guess == power:
            return Fraction(1, guess) if inverse else Fraction(guess)
    raise _fault(
        node,
        "exact-log",
        f"log({format_value(x)}, {format_value(b)}) has no exact value",
        "run without exact arithmetic",
    )


def _ln(x: Fraction) -> float:
    return math.log(x.numerator) - math.log(x.denominator)  # works beyond the range of doubles


# ---------------------------------------------------------------------------------------- functions


def _extreme(better: Callable[[Value, Value], bool]) -> FunctionMeaning:
    """The best of the values; NaN if a value is NaN."""

    def apply(values: Sequence[Value], exact: bool, node: Node) -> Value:  # noqa: ARG001
        if not all(isinstance(v, int) for v in values):
            values = [convert(v, Type.DOUBLE, exact) for v in values]
        best = values[0]
        for value in values[1:]:
            if value != value or better(value, best):
                best = value
        return best

    return apply


def _rounding(function: Function, rounded: Callable[[float | Fraction], int]) -> FunctionMeaning:
    def apply(values: Sequence[Value], exact: bool, node: Node) -> Value:  # noqa: ARG001
        (x,) = values
        if isinstance(x, int):
            return x
        if isinstance(x, float) and not math.isfinite(x):
            raise _fault(node, "not-integer", f"{function} of {format_value(x)} is not an integer")
        return _checked(rounded(x), node)

    return apply


def _less(a: Value, b: Value) -> bool:
    """Whether a is less than b; -0.0 is less than 0.0."""
    return a < b or (a == b == 0 and math.copysign(1.0, a) < math.copysign(1.0, b))


def _round(x: float | Fraction) -> int:
    return math.floor(Fraction(x) + Fraction(1, 2))


def _modulo(i: Value, j: Value, exact: bool, node: Node) -> Value:  # noqa: ARG001
    assert isinstance(i, int)
    assert isinstance(j, int)
    if j == 0:
        raise _fault(node, "mod-zero", f"mod({i}, 0) has no value")
    remainder = abs(i) % abs(j) * (1 if i >= 0 else -1)
    return _checked(remainder + j if remainder < 0 else remainder, node)


def _of_two(meaning: Meaning) -> FunctionMeaning:
    def apply(values: Sequence[Value], exact: bool, node: Node) -> Value:
        a, b = values
        return meaning(a, b, exact, node)

    return apply


BINARY: Mapping[Operator, Meaning] = {
    Operator.EQ: _comparison(op.eq),
    Operator.NE: _comparison(op.ne),
    Operator.LT: _comparison(op.lt),
    Operator.LE: _comparison(op.le),
    Operator.GT: _comparison(op.gt),
    Operator.GE: _comparison(op.ge),
    Operator.PLUS: _arithmetic(op.add),
    Operator.MINUS: _arithmetic(op.sub),
    Operator.TIMES: _arithmetic(op.mul),
    Operator.DIVIDE: _divide,
    Operator.POWER: _power,
}
"""The function of each operator that is not logical."""

FUNCTIONS: Mapping[Function, FunctionMeaning] = {
    Function.MIN: _extreme(_less),
    Function.MAX: _extreme(lambda a, b: _less(b, a)),
    Function.FLOOR: _rounding(Function.FLOOR, math.floor),
    Function.CEIL: _rounding(Function.CEIL, math.ceil),
    Function.ROUND: _rounding(Function.ROUND, _round),
    Function.POW: _of_two(_power),
    Function.MOD: _of_two(_modulo),
    Function.LOG: _of_two(_logarithm),
}
"""The Python function of each function of the language."""
