"""Evaluation of an expression at one state, in floating point or exactly.

It defines the semantics of expressions, and is the oracle for the faster evaluators:

- `+ - * min max pow ^` of ints give an int (beyond 64 bits is an error, PRISM's limit is 32),
  otherwise a double; `/` always gives a double; `floor ceil round` give an int; `c ? a : b` is a
  double if either branch is one.
- Doubles stand for real numbers, besides infinities and NaN: `1/0` is infinite, `0/0` is NaN, and
  `min` and `max` of anything and NaN are NaN (IEEE 754, 2019). Zero has no sign: `1 / (0 / -3)` is
  Infinity. In exact arithmetic they are Fractions.
- **Conditions never depend on rounding**: comparisons, `floor`, `ceil` and `round` are decided in
  exact arithmetic, in which decimals are the fractions that they denote (`0.1+0.2=0.3` is true),
  and with enclosures of irrational numbers, also where values are computed in floating point. A
  double that cancels (`0.3-3*0.1`) is the one nearest to the exact value.
- `round(x)` is floor(x + 1/2) without rounding error. `floor ceil round` of NaN, an infinity or a
  number beyond 64 bits are errors.
- `pow` of ints with a negative exponent is an error, because its type would not be int. In exact
  arithmetic, an irrational value is an error; a condition on it is none if enclosures decide it.
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
from sys import float_info
from typing import Any, TypeVar, assert_never, cast

from symcheck.errors import Diagnostic, InputError, ModelFault, NameFault, UnsupportedError
from symcheck.semantics.expressions import rounding_notes
from symcheck.semantics.expressions.deep_recursion import with_deep_recursion
from symcheck.semantics.expressions.irrational import (
    Irrational,
    Real,
    exponential,
    extreme,
    logarithm,
)
from symcheck.semantics.expressions.literals import (
    LEAST,
    convert,
    format_value,
    to_signed_float,
    type_of_value,
)
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
from symcheck.syntax.operators import (
    Function,
    Operator,
    Signature,
    UnaryOperator,
    complete,
)

__all__ = [
    "INT_MAX",
    "INT_MIN",
    "KEPT_ERROR",
    "apply_exactly",
    "evaluate",
    "evaluate_closely",
    "evaluate_constant",
    "is_int64",
    "is_rounding",
]

INT_MIN, INT_MAX = -(2**63), 2**63 - 1
_EXPONENT_LIMIT = 1 << 20
_EXACT_BITS = 1 << 24
_FEW_BITS = 1 << 12
"""The size from which on an enclosure of a power is asked for before its fraction."""
_LARGEST_ROOT = 64
KEPT_ERROR = 2.0**-42
"""The relative error up to which a double is kept, and not the one nearest to the exact value."""

Exactness = bool | int
"""Whether arithmetic is exact; an int: it is, but powers of more bits are enclosed."""

Meaning = Callable[..., Any]
"""Computes an operator or function: whether exactly, the node for errors, and the values."""

_Number = Any
"""A value, or an irrational number within an exact evaluation."""


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
    value = _evaluate(expression, valuation, exact)
    if isinstance(value, Irrational):
        raise ModelFault(value.why)
    # Literals and names are as they are; other doubles may have lost their digits.
    if isinstance(value, float) and not exact and isinstance(expression, _COMPOUND):
        return _accurate(value, expression, valuation)
    return cast("Value", value)


def evaluate_constant(expression: Expression) -> Value:
    """The exact value of an expression without names; a double beside it if it is irrational.

    Raises:
        ModelFault: the expression has no value, or an irrational one that no normal double is near.
    """
    return _rational(_evaluate(expression, {}, True))


def evaluate_closely(expression: Expression, valuation: Mapping[str, Value]) -> Value:
    """The exact value of an expression, or a number within 30 digits of its operands' size where it
    is irrational or has powers of many bits.

    Raises:
        ModelFault: the expression has no value.
    """
    return _rational(_evaluate(expression, valuation, _FEW_BITS))


def _rational(value: _Number) -> Value:
    """A value, or the double beside an irrational number. Raises ModelFault if none is near."""
    if not isinstance(value, Irrational):
        return cast("Value", value)
    nearest = float(value)
    if not float_info.min <= abs(nearest) < math.inf:
        raise ModelFault(value.why)
    return Fraction(nearest)


_COMPOUND = Unary | Binary | Call | Conditional


def is_rounding(expression: Expression) -> bool:
    """Whether an expression turns a number into an int or a bool, which rounding may change."""
    match expression:
        case Binary(operator):
            return operator.is_comparison
        case Call(function):
            return function.signature is Signature.ROUNDING
        case _:
            return False


def _accurate(value: float, expression: Expression, valuation: Mapping[str, Value]) -> float:
    """A double, or the one nearest to the exact value where that differs much."""

    def nearest_double(exact: _Number) -> float:
        if isinstance(exact, float):  # an infinity or NaN
            return exact
        if isinstance(exact, Irrational):
            nearest = float(exact)
            return nearest or (LEAST if exact > 0 else -LEAST)
        return to_signed_float(cast("Value", exact))

    nearest = _with_few_bits(lambda bits: nearest_double(_evaluate(expression, valuation, bits)))
    if not math.isfinite(nearest):
        return nearest
    if (value > 0, value < 0) != (nearest > 0, nearest < 0):
        rounding_notes.note(expression)
    return value if abs(value - nearest) <= KEPT_ERROR * abs(nearest) < math.inf else nearest


_T = TypeVar("_T")


def _with_few_bits(compute: Callable[[int], _T]) -> _T:
    """What is computed with enclosures of large powers, or with their fractions if it has to be.

    Sums of fractions of a million bits take seconds.
    """
    try:
        return compute(_FEW_BITS)
    except ModelFault as fault:
        if all(d.code != "undecided" for d in fault.diagnostics):
            raise
        return compute(True)


def _decided(
    expression: Binary | Call, valuation: Mapping[str, Value], exact: Exactness
) -> _Number:
    """A comparison, or a rounding to an int: in exact arithmetic."""
    parts = (
        (expression.left, expression.right)
        if isinstance(expression, Binary)
        else expression.arguments
    )

    def decide(exact: Exactness) -> tuple[list[_Number], _Number]:
        values = [_evaluate(part, valuation, exact) for part in parts]
        return values, _apply(expression, values, exact)

    values, result = decide(True) if exact is True else _with_few_bits(decide)
    if not exact and not all(isinstance(v, int) for v in values):
        _note_rounding(expression, parts, result, valuation)
    return result


def _note_rounding(
    expression: Binary | Call,
    parts: Sequence[Expression],
    result: _Number,
    valuation: Mapping[str, Value],
) -> None:
    """Note a condition that doubles decide differently."""
    try:
        rounded = _apply(expression, [_evaluate(p, valuation, False) for p in parts], False)
    except InputError:
        rounded = None
    if rounded != result:
        rounding_notes.note(expression)


def _apply(expression: Binary | Call, values: Sequence[_Number], exact: Exactness) -> _Number:
    operation = expression.operator if isinstance(expression, Binary) else expression.function
    return _MEANINGS[operation](exact, expression, *values)


_OPERANDS = Name("the operands")
"""Stands for an expression in errors about values."""


def apply_exactly(operation: Operator | Function, *values: Value) -> Value:
    """The exact value of an operator that is not logical, or of a function.

    Raises:
        ModelFault: there is none, or an irrational one.
    """
    value = _MEANINGS[operation](True, _OPERANDS, *values)
    if isinstance(value, Irrational):
        raise ModelFault(value.why)
    return cast("Value", value)


def _evaluate(expression: Expression, valuation: Mapping[str, Value], exact: Exactness) -> _Number:
    match expression:
        case Literal(value, kind):
            return convert(_checked(value, expression), kind, bool(exact))
        case Name(name):
            if name not in valuation:
                raise NameFault(Diagnostic(f"{name} has no value", expression.span, "unknown-name"))
            given = valuation[name]
            return (
                convert(given, Type.DOUBLE, bool(exact))
                if isinstance(given, float | Fraction)
                else given
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
        case Binary() | Call() if is_rounding(expression):
            return _decided(expression, valuation, exact)
        case Binary(_, left, right):
            operands = [_evaluate(left, valuation, exact), _evaluate(right, valuation, exact)]
            return _apply(expression, operands, exact)
        case Conditional():
            return _conditional(expression, valuation, exact)
        case Call(_, arguments):
            return _apply(expression, [_evaluate(a, valuation, exact) for a in arguments], exact)
        case LabelReference() | StateOperator():
            raise UnsupportedError(
                f"{_describe(expression)} cannot be evaluated at a single state: check it on the "
                "model"
            )
        case _:
            assert_never(expression)


def _describe(node: Node) -> str:
    return f'"{node.name}"' if isinstance(node, LabelReference) else f"a {type(node).__name__}"


def _conditional(
    expression: Conditional, valuation: Mapping[str, Value], exact: Exactness
) -> _Number:
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
        return convert(value, Type.DOUBLE, bool(exact))
    return value


_REAL = Fraction | Irrational


def _double(value: Any, exact: Exactness) -> Any:
    return value if isinstance(value, Irrational) else convert(value, Type.DOUBLE, bool(exact))


def _both_int(a: Value, b: Value) -> bool:
    return isinstance(a, int) and isinstance(b, int)


def _comparison(compare: Callable[[Value, Value], bool]) -> Meaning:
    def apply(exact: Exactness, node: Node, a: Value, b: Value) -> bool:  # noqa: ARG001
        if not _both_int(a, b):
            a, b = _double(a, exact), _double(b, exact)
        return compare(a, b)

    return apply


def _arithmetic(operation: Callable[[Value, Value], Value]) -> Meaning:
    def apply(exact: Exactness, node: Node, a: Value, b: Value) -> Value:
        if _both_int(a, b):
            return _checked(operation(a, b), node)
        a, b = _double(a, exact), _double(b, exact)
        if isinstance(a, _REAL) and isinstance(b, _REAL):
            return operation(a, b)
        # In exact arithmetic one operand is infinite or NaN here: only the other's sign matters.
        return operation(_sign_if_exact(a), _sign_if_exact(b))

    return apply


def _sign_if_exact(value: Any) -> float:
    return float((value > 0) - (value < 0)) if isinstance(value, _REAL) else float(value)


def _divide(exact: Exactness, node: Node, a: Value, b: Value) -> Value:  # noqa: ARG001
    a, b = _double(a, exact), _double(b, exact)
    if isinstance(a, _REAL) and isinstance(b, _REAL) and b != 0:
        return cast("Value", a / b)
    x, y = _sign_if_exact(a), _sign_if_exact(b)
    if y != 0:
        quotient = x / y
    elif x == 0 or math.isnan(x):
        quotient = math.nan
    else:
        quotient = math.copysign(math.inf, x)
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


def _power(exact: Exactness, node: Node, a: Value, b: Value) -> Value | Irrational:
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
    x, y = _double(a, exact), _double(b, exact)
    if isinstance(x, _REAL) and isinstance(y, _REAL):
        return _exact_power(x, y, node, _EXACT_BITS if exact is True else exact)
    if isinstance(x, _REAL):  # of the base it matters on which side of -1, 0 and 1 it lies
        x = _sign_if_exact(x) * (2 if x > 1 or x < -1 else 1 if x in (-1, 1) else 0.5)
    if isinstance(y, _REAL):  # of the exponent, whether it is odd, even, or no whole number
        size = 0.5
        if isinstance(y, Fraction) and y.denominator == 1:
            size = 1 if y % 2 else 2
        y = _sign_if_exact(y) * size
    return _finite_exact(_float_power(float(x), float(y)), exact)


def _finite_exact(value: float, exact: Exactness) -> Value:
    return Fraction(value) if exact and math.isfinite(value) else value


def _exact_power(a: Real, b: Real, node: Node, most: int) -> Value | Irrational:
    is_whole = isinstance(b, Fraction) and b.denominator == 1
    if a == 0 or a == 1 or b == 0:
        return math.inf if a == 0 and b < 0 else Fraction(a != 0 or b == 0)
    if is_whole and isinstance(a, Fraction) and isinstance(b, Fraction):
        bits = a.numerator.bit_length() + a.denominator.bit_length()
        if abs(a) == 1 or (abs(b) <= _EXPONENT_LIMIT and bits * abs(b) <= most):
            return Fraction(a ** int(b))
    if a < 0:
        if not isinstance(b, Fraction) or not is_whole:
            return math.nan
        power = _exact_power(-a, b, node, most)
        return -power if int(b) % 2 else power
    if isinstance(a, Fraction) and isinstance(b, Fraction) and b.denominator <= _LARGEST_ROOT:
        top, bottom = (_root(n, b.denominator) for n in (a.numerator, a.denominator))
        if not is_whole and top is not None and bottom is not None:
            return _exact_power(Fraction(top, bottom), Fraction(b.numerator), node, most)
    kind = "exponent" if is_whole else "fractional exponent"
    fate = "is too large for exact arithmetic" if is_whole else "has no exact value"
    message = f"a power with {kind} {b if isinstance(b, Fraction) else float(b)} {fate}"
    why = Diagnostic(message, node.span, "exact-power", "run without exact arithmetic")
    exponent = logarithm(a, why) * b
    return exponential(exponent, why)


def _root(x: int, n: int) -> int | None:
    """The int whose n-th power is x; None if there is none."""
    low, high = 0, 1 << (x.bit_length() // n + 1)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if middle**n < x else (low, middle)
    return low if low**n == x else None


def _float_power(a: float, b: float) -> float:
    """C's pow: overflow and negative powers of 0 are infinite, roots of negative numbers NaN."""
    try:
        return math.pow(a + 0.0, b)  # a zero without sign
    except OverflowError:
        return -math.inf if a < 0 and b % 2 == 1 else math.inf
    except ValueError:
        return math.nan if a != 0 else math.inf


def _logarithm(exact: Exactness, node: Node, x: Value, b: Value) -> Value | Irrational:
    x, b = _double(x, exact), _double(b, exact)
    if not (b > 0 and b != 1 and b != math.inf) or not x >= 0:
        return math.nan
    if x == 0 or x == math.inf:
        return math.inf if (x > 1) == (b > 1) else -math.inf
    if isinstance(x, _REAL) and isinstance(b, _REAL):
        return _exact_logarithm(x, b, node)
    return math.log(x) / math.log(b)


def _exact_logarithm(x: Real, b: Real, node: Node) -> Value | Irrational:
    if x == 1:
        return Fraction(0)
    if isinstance(x, Fraction) and isinstance(b, Fraction):
        guess = Fraction(_ln(x) / _ln(b)).limit_denominator(_LARGEST_ROOT)
        bits = x.numerator.bit_length() + x.denominator.bit_length()
        is_small = 0 < abs(guess) < _EXPONENT_LIMIT and bits * guess.denominator <= _EXACT_BITS
        if is_small and b**guess.numerator == x**guess.denominator:
            return guess
    message = f"log({_text(x)}, {_text(b)}) has no exact value"
    why = Diagnostic(message, node.span, "exact-log", "run without exact arithmetic")
    return logarithm(x, why) / logarithm(b, why)


def _text(x: Real) -> str:
    return format_value(x if isinstance(x, Fraction) else float(x))


def _ln(x: Fraction) -> float:
    return math.log(x.numerator) - math.log(x.denominator)  # works beyond the range of doubles


# ---------------------------------------------------------------------------------------- functions


def _extreme(better: Callable[[Any, Any], bool]) -> Meaning:
    """The best of the values; NaN if a value is NaN."""

    def apply(exact: Exactness, node: Node, *values: Value) -> Value:  # noqa: ARG001
        if not all(isinstance(v, int) for v in values):
            values = tuple(_double(v, exact) for v in values)
        best = values[0]
        for value in values[1:]:
            a, b = cast("tuple[_Number, _Number]", (value, best))
            reals = isinstance(a, _REAL) and isinstance(b, _REAL)
            if reals and Irrational in (type(a), type(b)):
                best = cast("Value", extreme(a, b, better))
            elif value != value or better(value, best):
                best = value
        return best

    return apply


def _rounding(function: Function, rounded: Callable[[float | Fraction], int]) -> Meaning:
    def apply(exact: Exactness, node: Node, x: Value) -> Value:  # noqa: ARG001
        if isinstance(x, int):
            return x
        if isinstance(x, float) and not math.isfinite(x):
            raise _fault(node, "not-integer", f"{function} of {format_value(x)} is not an integer")
        return _checked(rounded(x), node)

    return apply


def _round(x: Any) -> int:
    return math.floor((x if isinstance(x, Irrational) else Fraction(x)) + Fraction(1, 2))


def _modulo(exact: Exactness, node: Node, i: Value, j: Value) -> Value:  # noqa: ARG001
    assert isinstance(i, int)
    assert isinstance(j, int)
    if j == 0:
        raise _fault(node, "mod-zero", f"mod({i}, 0) has no value")
    remainder = abs(i) % abs(j) * (1 if i >= 0 else -1)
    return _checked(remainder + j if remainder < 0 else remainder, node)


_MEANINGS: Mapping[Operator | Function, Meaning] = complete(
    {
        **{o: _comparison(o.compare) for o in Operator if o.is_comparison},
        Operator.PLUS: _arithmetic(op.add),
        Operator.MINUS: _arithmetic(op.sub),
        Operator.TIMES: _arithmetic(op.mul),
        Operator.DIVIDE: _divide,
        Operator.POWER: _power,
        Function.MIN: _extreme(op.lt),
        Function.MAX: _extreme(op.gt),
        Function.FLOOR: _rounding(Function.FLOOR, math.floor),
        Function.CEIL: _rounding(Function.CEIL, math.ceil),
        Function.ROUND: _rounding(Function.ROUND, _round),
        Function.POW: _power,
        Function.MOD: _modulo,
        Function.LOG: _logarithm,
    },
    [*(o for o in Operator if not o.is_logical), *Function],
)
