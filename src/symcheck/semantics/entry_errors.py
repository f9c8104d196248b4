"""How far the doubles of a matrix are from the numbers that the text of a model denotes.

Each literal and each operation of an expression without cancellation is rounded once, relatively;
other expressions are computed so closely that a fixed bound holds. Products of several modules and
sums of what leads to one state are rounded too.

Source: Higham (2002), Accuracy and stability of numerical algorithms, section 3.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from math import inf, prod

from symcheck.errors import InputError
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import LARGEST_WHOLE, to_float
from symcheck.semantics.expressions.running_errors import is_never_negative, is_normal
from symcheck.semantics.expressions.types import static_type
from symcheck.semantics.model import BoundCommand, BoundModel, Event, Variable
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    Literal,
    Type,
    Unary,
)
from symcheck.syntax.operators import Function, Operator
from symcheck.syntax.traversal import names

__all__ = ["CLOSE", "entry_error", "expression_error"]

UNIT = 2.0**-53
CLOSE = 2.0**-43
"""The relative error of an expression that may cancel: see `NUMBER` in the register machine."""
ROUGH = 2.0**-30
"""Likewise of one that diagrams compute operator by operator, as its valuations are many."""


def entry_error(
    model: BoundModel,
    terms: int | None = None,
    *,
    shares: bool = True,
    table_bits: int | None = None,
    variables: Sequence[Variable] | None = None,
) -> float:
    """A bound on the relative error of any sum of entries of a row.

    Args:
        model: the model; one without commands has numbers that were read, of one rounding.
        terms: the most transitions of a row before those to the same state are added; None: as
            many as the commands permit.
        shares: whether choices of a DTMC may share its probability, other than by powers of 2.
        table_bits: the bits of the variables up to which expressions are tabulated; None: they are
            computed one valuation after the other.
        variables: those of the model, with bounds between which all their values are; None: as
            they are declared.

    Examples:
        >>> import symcheck
        >>> die = symcheck.load("models/die/die.pm").bound
        >>> entry_error(die, terms=2) / UNIT
        0.0
    """
    chain = not model.type.has_choices
    if not model.events:
        return ((terms or 1) + 3) * UNIT
    if terms is None:
        added = chain or model.type.continuous_time  # rates of a Markov automaton race
        counts = [_combinations(e, chain=added) for e in model.events]
        terms = sum(counts) if added else max(counts)
    of = partial(expression_error, variables=variables or model.variables, table_bits=table_bits)
    known: dict[int, tuple[float, int, bool]] = {}

    def of_command(command: BoundCommand) -> tuple[float, int, bool]:
        """The error of its probabilities, their bits, and whether they are powers of 2."""
        if id(command) not in known:
            numbers = [u.probability for u in command.updates]
            error = max(map(of, numbers), default=0.0)
            known[id(command)] = (
                error,
                max(map(_bits, numbers), default=0),
                all(map(_is_power, numbers)),
            )
        return known[id(command)]

    error, bits = 0.0, 0
    for event in model.events:
        parts = [[of_command(c) for c in p] for p in event.participants]
        factors = sum(not all(power for _, _, power in p) for p in parts)
        inexact = sum(max((e for e, _, _ in p), default=0.0) for p in parts)
        error = max(error, inexact + max(factors - 1, 0) * UNIT)
        bits = max(bits, sum(max((b for _, b, _ in p), default=0) for p in parts))
    shares = shares and chain and not model.type.continuous_time and terms > 2
    if not shares and bits + terms.bit_length() <= _BITS and (error == 0.0 or bits < _BITS):
        return 0.0  # all sums and products are doubles
    return (error + (terms - 1 + 2 * shares) * UNIT) * (1.0 + 1e-9)


_BITS = 52


def _combinations(event: Event, *, chain: bool) -> int:
    """The most transitions of an event in a state: of all its choices in a chain, else of one."""
    gather = sum if chain else max
    return prod(gather(len(c.updates) for c in part) for part in event.participants)


def _constant(expression: Expression) -> Fraction | None:
    """The value of an expression without names; None if it has none, or is irrational."""
    if isinstance(expression, Literal):
        return Fraction(expression.value)
    if names(expression):
        return None
    try:
        value = evaluate(expression, {}, exact=True)
    except InputError:  # a fault only if a state has it
        return None
    return None if isinstance(value, float) else Fraction(value)


def _bits(expression: Expression) -> int:
    """How many binary digits a number needs; of one that no double is, too many are said."""
    value = _constant(expression)
    if value is None or value.denominator & (value.denominator - 1):
        return 10 * _BITS
    return value.numerator.bit_length() + value.denominator.bit_length()


def _is_power(expression: Expression) -> bool:
    """Whether an expression is a power of 2, by which products are not rounded."""
    value = _constant(expression)
    if value is None:
        return False
    return value > 0 and not any(v & (v - 1) for v in (value.numerator, value.denominator))


def expression_error(
    expression: Expression, variables: Sequence[Variable], table_bits: int | None = None
) -> float:
    """A bound on the relative error of an expression in doubles.

    Args:
        expression: the expression.
        variables: those of the model.
        table_bits: as for `entry_error`.
    """
    types = {v.name: v.type for v in variables}

    def type_of(node: Expression) -> Type:
        return static_type(node, types.__getitem__)

    def largest(node: Expression) -> float:
        """A bound on the size of an int; a bool counts as one."""
        if isinstance(node, Literal):
            return abs(int(node.value))
        from symcheck.semantics.reduction.live_variables import int_bounds

        return max(map(abs, int_bounds(node, variables)))

    def is_natural(name: str) -> bool:
        return any(v.name == name and v.low is not None and v.low >= 0 for v in variables)

    def close() -> float:
        read = names(expression)
        domains = [v.domain for v in variables if v.name in read]
        bits = sum(inf if d is None else len(d).bit_length() for d in domains)
        return CLOSE if table_bits is None or bits <= table_bits else ROUGH

    def error(node: Expression) -> float:
        if type_of(node) is not Type.DOUBLE:
            return 0.0 if largest(node) <= LARGEST_WHOLE else UNIT
        if not names(node) and not isinstance(node, Literal):
            return _constant_error(node)
        match node:
            case Literal(value):
                return 0.0 if to_float(value) == value else UNIT
            case Unary(_, operand):
                return error(operand)
            case Conditional(_, x, y):
                return max(error(x), error(y))
            case Binary(Operator.TIMES | Operator.DIVIDE as operator, x, y):
                power = _is_power(y) or (operator is Operator.TIMES and _is_power(x))
                return error(x) + error(y) + (0.0 if power else UNIT)
            case Binary(Operator.PLUS, x, y) if natural(x) and natural(y):
                return max(error(x), error(y)) + UNIT
            case Call(Function.MIN | Function.MAX, arguments):
                return max(map(error, arguments))
            case _:
                return inf

    def natural(node: Expression) -> bool:
        return is_never_negative(node, is_natural, is_natural_constant)

    def is_natural_constant(node: Expression) -> bool:
        value = _constant(node)
        return value is not None and value >= 0

    found = error(expression)
    if type_of(expression) is not Type.DOUBLE or found == 0.0:
        return found
    if found < CLOSE and is_normal(expression, type_of):
        return found
    return close()


def _constant_error(expression: Expression) -> float:
    """A bound on the relative error of an expression without names; infinite if none is known."""

    def enclosed(node: Expression) -> tuple[Fraction, Fraction] | None:
        """The value and a bound on the absolute error of its double."""
        value = _constant(node)
        if value is None:
            return None
        rounding = Fraction(0) if Fraction(to_float(value)) == value else abs(value) * _UNIT
        match node:
            case Literal():
                return value, rounding
            case Unary(_, operand):
                return None if (x := enclosed(operand)) is None else (value, x[1])
            case Binary(operator, left, right):
                x, y = enclosed(left), enclosed(right)
                if x is None or y is None:
                    return None
                match operator:
                    case Operator.PLUS | Operator.MINUS:
                        error = x[1] + y[1]
                    case Operator.TIMES:
                        error = abs(x[0]) * y[1] + abs(y[0]) * x[1] + x[1] * y[1]
                    case Operator.DIVIDE if abs(y[0]) > y[1]:
                        error = (x[1] + abs(value) * y[1]) / (abs(y[0]) - y[1])
                    case _:
                        return None
                return value, error + ((abs(value) + error) * _UNIT if error else rounding)
            case _:
                return None

    found = enclosed(expression)
    if found is None:
        return inf
    value, error = found
    return to_float(error / abs(value)) * (1.0 + 1e-9) if value else (inf if error else 0.0)


_UNIT = Fraction(1, 2**53)
