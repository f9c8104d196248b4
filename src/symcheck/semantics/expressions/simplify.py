"""Simplification of expressions: constant folding, and logical operators with constant operands."""

from __future__ import annotations

from collections.abc import Mapping

from symcheck.errors import InputError, UnsupportedError
from symcheck.semantics.diagnostics import DiagnosticCollector
from symcheck.semantics.expressions.deep_recursion import with_deep_recursion
from symcheck.semantics.expressions.evaluate import evaluate, is_rounding
from symcheck.semantics.expressions.literals import as_expression, type_of_value
from symcheck.semantics.expressions.types import Typer
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import UnaryOperator
from symcheck.syntax.traversal import Tree, children, transform

__all__ = ["simplify", "simplify_node"]

_MOST_BITS = 4096
"""Bits of the numerator and denominator of a fraction up to which it becomes a literal."""


@with_deep_recursion
def simplify(expression: Expression, *, types: Mapping[str, Type] | None = None) -> Expression:
    """Simplify an expression.

    The result has the same type, and the same exact value at every state where the expression has
    one. Values that no literal can hold (infinities, NaN, irrational numbers), fractions of many
    digits, and undefined subexpressions (`mod(1, 0)`) are unchanged.

    Args:
        expression: an expression whose types are right.
        types: types of names; they allow more simplification of `?:` with a constant condition.
    """
    return transform(expression, lambda node: simplify_node(node, types or {}))


def simplify_node(node: Tree, types: Mapping[str, Type]) -> Tree:
    """Simplify a node with simplified operands."""
    if isinstance(node, Binary) and not (
        isinstance(node.left, Literal) or isinstance(node.right, Literal)
    ):
        return node  # as most are
    match node:
        case Unary() | Binary() | Call() | Conditional() if all(
            isinstance(x, Literal) for x in children(node)
        ):
            return _constant(node)
        case Binary(operator, Literal(bool() as value), other) if operator.is_logical:
            values = operator.apply(value, False), operator.apply(value, True)
            return _with_one_operand(node, other, *values)
        case Binary(operator, other, Literal(bool() as value)) if operator.is_logical:
            values = operator.apply(False, value), operator.apply(True, value)
            return _with_one_operand(node, other, *values)
        case Conditional(Literal(holds), then, otherwise):
            chosen, other = (then, otherwise) if holds else (otherwise, then)
            return chosen if _same_type(chosen, other, types) else node
        case _:
            return node


def _with_one_operand(
    node: Binary, operand: Expression, when_false: bool, when_true: bool
) -> Expression:
    """A logical operation with one constant operand, given its values for the other operand."""
    if when_false is when_true:
        return Literal(when_true, Type.BOOL, span=node.span)
    return operand if when_true else Unary(UnaryOperator.NOT, operand, span=node.span)


def _constant(node: Unary | Binary | Call | Conditional) -> Expression:
    try:
        value = evaluate(node, {}, exact=not is_rounding(node))  # which notes what doubles decide
    except (InputError, UnsupportedError):
        return node  # it may never be evaluated
    if isinstance(value, float):  # an infinity or NaN
        return node
    if value == 0:
        evaluate(node, {})  # which notes that doubles may give another sign
    if max(value.numerator.bit_length(), value.denominator.bit_length()) > _MOST_BITS:
        return node
    return as_expression(value, type_of_value(value), node.span)


def _same_type(chosen: Expression, other: Expression, types: Mapping[str, Type]) -> bool:
    """Whether `chosen` has the type of the choice between `chosen` and `other`."""

    def name(node: Name) -> Type | None:
        return types.get(node.name)

    typer = Typer(DiagnosticCollector(), name, None)
    a, b = typer.state(chosen), typer.state(other)
    return a is not None and (a is Type.DOUBLE or a is Type.BOOL or a is b)
