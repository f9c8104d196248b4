"""Expressions of JANI as expressions of the PRISM language."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from symcheck.errors import Span
from symcheck.syntax.ast import (
    Binary,
    Call,
    Conditional,
    Expression,
    LabelReference,
    Literal,
    Measure,
    Name,
    Type,
    Unary,
)
from symcheck.syntax.jani.json_tree import Json
from symcheck.syntax.operators import (
    FUNCTION_IN_JANI,
    OPERATOR_IN_JANI,
    Function,
    Operator,
    UnaryOperator,
)
from symcheck.syntax.traversal import Tree, transform

__all__ = [
    "MOST_CELLS",
    "ONE",
    "TRUE",
    "ZERO",
    "Cells",
    "ExpressionReader",
    "FunctionDefinition",
    "at_index",
    "conjunction",
    "is_boolean",
    "is_literal",
    "negation",
    "simplified",
]

TRUE = Literal(True, Type.BOOL)
ZERO = Literal(0, Type.INT)
ONE = Literal(1, Type.INT)
_LARGEST_INT = 2**63 - 1

_CONSTANTS = {"π": math.pi, "e": math.e}
_MISSING = {
    **dict.fromkeys(("ac", "av"), "arrays as values of expressions"),
    **dict.fromkeys(("da", "dv"), "datatypes"),
    "nondet": "nondeterministic selections of values",
    "der": "derivatives of continuous variables",
}


MOST_CELLS = 16
"""Cells of an array whose length is a constant without a value, and values of a choice."""


@dataclass(frozen=True)
class Cells:
    """An array: its cells; `length` None: it has all of them, else as many as the constant says."""

    cells: tuple[Expression, ...]
    length: Expression | None = None

    def has(self, i: int) -> Expression:
        """Whether it has a cell with this number."""
        if self.length is None:
            return TRUE
        return Binary(Operator.GT, self.length, Literal(i, Type.INT))


@dataclass(frozen=True)
class FunctionDefinition:
    """A function of a model: its parameters and its body."""

    parameters: Sequence[str]
    body: Json


@dataclass(frozen=True)
class ExpressionReader:
    """Reads expressions.

    Attributes:
        names: what each identifier stands for.
        functions: the functions of the model or automaton.
        calls: the functions whose bodies are being read.
        outside: within a function, the names outside of it.
        arrays: the arrays by identifier.
        selected: the value of nondeterministic selections; None: they are refused.
        drawn: the values of random numbers by their places; others are refused.
    """

    names: Mapping[str, Expression]
    functions: Mapping[str, FunctionDefinition] = field(default_factory=dict)
    calls: tuple[str, ...] = ()
    outside: Mapping[str, Expression] | None = None
    arrays: Mapping[str, Cells] = field(default_factory=dict)
    selected: int | None = None
    drawn: Mapping[Span, Expression] = field(default_factory=dict)

    def with_name(self, name: str, value: Expression) -> ExpressionReader:
        """A reader for the scope of a bound variable."""
        return replace(self, names={**self.names, name: value})

    def array(self, node: Json) -> Cells:
        """The array of a value. Raises SyntaxFault, UnsupportedError."""
        if isinstance(node.value, str):
            if node.text not in self.arrays:
                raise node.fault(f"there is no array '{node.text}'")
            return self.arrays[node.text]
        operator = node["op"].text if isinstance(node.value, Mapping) else ""
        if operator == "av":
            return Cells(tuple(map(self.read, node["elements"].items)))
        if operator == "ac":
            length, name = self.read(node["length"]), node["var"].text
            known = length.value if isinstance(length, Literal) else None
            numbers = range(int(known) if isinstance(known, int) else MOST_CELLS)
            cells = (self.with_name(name, Literal(i, Type.INT)).read(node["exp"]) for i in numbers)
            return Cells(tuple(cells), None if isinstance(known, int) else length)
        raise node.unsupported("an array is a name, a list (av) or a comprehension (ac)")

    def _cell(self, node: Json) -> Expression:
        """The cell of an array at an index, which is in its range."""
        array, index = self.array(node["exp"]), self.read(node["index"])
        if isinstance(index, Literal) and isinstance(index.value, int):
            if 0 <= index.value < len(array.cells):
                return array.cells[index.value]
            if array.length is None:
                raise node["index"].fault(f"the array has {len(array.cells)} cells")
        *cells, result = array.cells
        for i in range(len(cells) - 1, -1, -1):
            result = Conditional(at_index(index, i), cells[i], result)
        return result

    def read(self, node: Json) -> Expression:
        """The expression of a value. Raises SyntaxFault, UnsupportedError."""
        match node.value:
            case bool() as value:
                return Literal(value, Type.BOOL, span=node.span)
            case int() as value:
                if abs(value) > _LARGEST_INT:
                    raise node.fault(f"integers end at {_LARGEST_INT}")
                return Literal(value, Type.INT, span=node.span)
            case Fraction() as value:
                return Literal(value, Type.DOUBLE, span=node.span)
            case str() as name:
                return self._name(node, name)
            case Mapping():
                return self._compound(node)
            case _:
                raise node.fault("an expression is expected here")

    def _name(self, node: Json, name: str) -> Expression:
        variable = self.names.get(name)
        if variable is None:
            raise node.fault(f"there is no variable or constant '{name}'")
        return replace(variable, span=node.span)

    def _compound(self, node: Json) -> Expression:
        constant = node.get("constant")
        if constant is not None:
            if constant.text not in _CONSTANTS:
                raise constant.fault(f"the constants are {' and '.join(_CONSTANTS)}")
            value = Fraction(_CONSTANTS[constant.text])
            return Literal(value, Type.DOUBLE, span=node.span)
        if (distribution := node.get("distribution")) is not None:
            if node.span in self.drawn:
                return self.drawn[node.span]
            known = "DiscreteUniform and Bernoulli are, in assignments of edges and destinations"
            raise node.unsupported(
                f"random numbers of the distribution '{distribution.text}' are not supported here",
                known,
            )
        operator = node["op"]
        return self.operation(node, operator.text)

    def operation(self, node: Json, operator: str) -> Expression:
        """The expression of an object with an "op". Raises SyntaxFault, UnsupportedError."""
        if operator in FUNCTION_IN_JANI:
            function = FUNCTION_IN_JANI[operator]
            keys = ("exp",) if function.arity == 1 else ("left", "right")
            return Call(function, tuple(self.read(node[k]) for k in keys), span=node.span)
        if operator in OPERATOR_IN_JANI:
            left, right = self.read(node["left"]), self.read(node["right"])
            return Binary(OPERATOR_IN_JANI[operator], left, right, span=node.span)
        match operator:
            case "¬":
                return Unary(UnaryOperator.NOT, self.read(node["exp"]), span=node.span)
            case "ite":
                parts = (self.read(node[key]) for key in ("if", "then", "else"))
                return Conditional(*parts, span=node.span)
            case "abs":
                value = self.read(node["exp"])
                return Call(Function.MAX, (value, _minus(value)), span=node.span)
            case "sgn":
                value = self.read(node["exp"])
                negative = Conditional(Binary(Operator.LT, value, ZERO), _minus(ONE), ZERO)
                positive = Binary(Operator.GT, value, ZERO)
                return Conditional(positive, ONE, negative, span=node.span)
            case "trc":
                value = self.read(node["exp"])
                parts = (Call(f, (value,)) for f in (Function.FLOOR, Function.CEIL))
                return Conditional(Binary(Operator.GE, value, ZERO), *parts, span=node.span)
            case "call":
                return self._call(node)
            case "aa":
                return self._cell(node)
            case "nondet" if self.selected is not None:
                return Literal(self.selected, Type.INT)
            case _ if operator in _MISSING:
                raise node["op"].unsupported(
                    f"{_MISSING[operator]} ('{operator}') are not supported"
                )
            case _:
                raise node["op"].unsupported(f"the operator '{operator}' is not supported")

    def _call(self, node: Json) -> Expression:
        name, given = node["function"].text, node.each("args")
        function = self.functions.get(name)
        if function is None:
            raise node["function"].fault(f"there is no function '{name}'")
        if name in self.calls:
            raise node.unsupported(
                f"the function '{name}' calls itself: recursion is not supported"
            )
        if len(given) != len(function.parameters):
            raise node.fault(
                f"'{name}' takes {len(function.parameters)} arguments, not {len(given)}"
            )
        arguments = dict(zip(function.parameters, map(self.read, given), strict=True))
        outside = self.names if self.outside is None else self.outside
        inner = replace(
            self, names={**outside, **arguments}, calls=(*self.calls, name), outside=outside
        )
        return inner.read(function.body)


def at_index(index: Expression, i: int) -> Expression:
    """Whether an index is a number."""
    return Binary(Operator.EQ, index, Literal(i, Type.INT))


def _minus(value: Expression) -> Expression:
    return Unary(UnaryOperator.MINUS, value)


def negation(condition: Expression) -> Expression:
    """The negation of a condition."""
    return Unary(UnaryOperator.NOT, condition)


def conjunction(left: Expression, right: Expression) -> Expression:
    """The conjunction of two conditions; one that is always true is left out."""
    if is_literal(left, True):
        return right
    return left if is_literal(right, True) else Binary(Operator.AND, left, right, span=left.span)


def is_literal(expression: Expression, value: float) -> bool:
    """Whether an expression is a number or truth value written down: for 0 also 0.0."""
    return (
        isinstance(expression, Literal)
        and isinstance(expression.value, bool) is isinstance(value, bool)
        and expression.value == value
    )


def simplified(expression: Expression) -> Expression:
    """An expression of the same value, without `+ 0`, `- 0` and `c ? true : false`."""

    def step(node: Tree) -> Tree:
        match node:
            case Binary(Operator.PLUS | Operator.MINUS, left, right) if is_literal(right, 0):
                return left
            case Binary(Operator.PLUS, left, right) if is_literal(left, 0):
                return right
            case Conditional(condition, then, otherwise) if is_literal(then, True) and is_literal(
                otherwise, False
            ):
                return condition
            case _:
                return node

    return transform(expression, step)


def is_boolean(expression: Expression, types: Mapping[str, Type]) -> bool:
    """Whether an expression of the right types is a condition."""
    match expression:
        case Literal(type=kind):
            return kind is Type.BOOL
        case Name(name):
            return types.get(name) is Type.BOOL
        case Unary(operator):
            return operator is UnaryOperator.NOT
        case Binary(operator):
            return operator.is_boolean
        case Conditional(_, then, _):
            return is_boolean(then, types)
        case LabelReference():
            return True
        case Measure(bound=bound):
            return bound is not None
        case _:
            return False
