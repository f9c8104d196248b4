"""Properties as Storm writes them: its grammar has fewer operators than PRISM's and ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

from symcheck.errors import UnsupportedError
from symcheck.syntax.ast import (
    Binary,
    BinaryTemporal,
    Bound,
    Eventually,
    Expression,
    Filter,
    FilterOperator,
    Globally,
    Literal,
    Measure,
    PathFormula,
    PathQuantifier,
    ProbabilityOperator,
    Quantile,
    Release,
    RewardOperator,
    StateFilter,
    StateOperator,
    Type,
    Unary,
    UnaryTemporal,
    Until,
    WeakUntil,
)
from symcheck.syntax.operators import Operator, Signature, UnaryOperator
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = ["Spelling", "storm_spelling"]

_FILTERS: tuple[FilterOperator, ...] = (
    "min", "max", "sum", "avg", "count", "range", "forall", "exists", "state",
)  # fmt: skip


@dataclass(frozen=True)
class Spelling:
    """A property as Storm reads it.

    Attributes:
        text: the property; of a filter, the formula whose values are filtered.
        complement: whether the answer is 1 minus the value of the text.
        filter: the operator of a filter, and the text of its states.
    """

    text: str
    complement: bool = False
    filter: tuple[FilterOperator, str] | None = None

    @property
    def whole_text(self) -> str:
        """The text with the filter around it."""
        if self.filter is None:
            return self.text
        operator, states = self.filter
        return f"filter({operator}, {self.text}, {states})"


def storm_spelling(formula: Expression, text: str, structures: Sequence[str | None]) -> Spelling:
    """Write a property for Storm.

    Args:
        formula: the property.
        text: its text, which is kept if Storm reads it as it is.
        structures: the names of the reward structures of the model.

    Raises:
        UnsupportedError: Storm has no such property.
    """
    if isinstance(formula, Filter):
        if formula.operator not in _FILTERS:
            raise UnsupportedError(f"only its filters {', '.join(_FILTERS)} have one answer")
        inner = storm_spelling(formula.formula, pretty(formula.formula), structures)
        if inner.complement:
            raise UnsupportedError("it has no bounds at G, W and R within other formulas")
        states = formula.states or Literal(True, Type.BOOL)
        of_states = storm_spelling(states, pretty(states), structures).text
        return replace(inner, filter=(formula.operator, of_states))
    spelled = transform(formula, lambda node: _spelled(node, structures))
    complement = False
    if isinstance(spelled, ProbabilityOperator) and (inside := _negated(spelled.path)):
        spelled = replace(spelled, direction=_opposite(spelled.direction), path=inside)
        complement = True
    _refuse(spelled)
    words = text if spelled is formula else pretty(spelled)
    return Spelling(words.replace("C discount=", "Cdiscount="), complement)


def _refuse(formula: Expression) -> None:
    """Raise UnsupportedError if there is an operator that Storm does not have."""
    for node in nodes(formula):
        match node:
            case PathQuantifier(quantifier):
                raise UnsupportedError(f"it has no CTL operator {quantifier}")
            case StateFilter():
                raise UnsupportedError("it has no filters in braces, such as {s=1}")
            case Filter():
                raise UnsupportedError("it has no filter within another formula")
            case Quantile() if node is not formula:
                raise UnsupportedError("it has no quantile within another formula")
            case Binary(left=left, right=right) | BinaryTemporal(left=left, right=right) if (
                _is_query(left) or _is_query(right)
            ):
                raise UnsupportedError("it has no arithmetic with values of operators")
            case Unary(operand=operand) if _is_query(operand):
                raise UnsupportedError("it has no arithmetic with values of operators")
            case Unary(operand=operand) if _is_bounded(operand):
                raise UnsupportedError("it has no bounds at G, W and R within other formulas")
            case _:
                pass


def _is_bounded(path: PathFormula) -> bool:
    return isinstance(path, UnaryTemporal | BinaryTemporal) and path.bound is not None


def _is_query(node: PathFormula) -> bool:
    return isinstance(node, Quantile) or (isinstance(node, Measure) and node.bound is None)


def _spelled(node: Tree, structures: Sequence[str | None]) -> Tree:
    """A node without operators that Storm does not have; its children have none already."""
    match node:
        case Binary(Operator.IMPLIES, left, right):
            return _either(_not(left), right)
        case Binary(Operator.IFF, left, right):
            return _either(_both(left, right), _both(_not(left), _not(right)))
        case Binary(operator, left, right) if operator.signature is Signature.ORDER:
            return (
                _bounded(node, left, operator, right)
                or _bounded(node, right, operator.mirrored, left)
                or node
            )
        case Globally(operand, bound) if bound is not None:
            return _not(Eventually(_not(operand), bound))
        case WeakUntil(left, right, bound):
            return _not(Until(_both(left, _not(right)), _both(_not(left), _not(right)), bound))
        case Release(left, right, bound):
            return _not(Until(_not(left), _not(right), bound))
        case ProbabilityOperator(direction, Bound(operator, threshold), path) if inside := _negated(
            path
        ):
            rest = Binary(Operator.MINUS, Literal(1, Type.INT), threshold)
            mirrored = Bound(operator.mirrored, rest)
            return ProbabilityOperator(_opposite(direction), mirrored, inside, span=node.span)
        case RewardOperator(structure=structure) if isinstance(structure, Literal):
            index = int(structure.value) - 1
            if 0 <= index < len(structures) and (structures[index] or index == 0):
                return replace(node, structure=structures[index])
            return node
        case _:
            return node


def _bounded(
    node: Binary, value: PathFormula, operator: Operator, threshold: PathFormula
) -> Expression | None:
    """`P=? [ … ] > 0.1` as `P>0.1 [ … ]`; None for other comparisons."""
    if not isinstance(value, Measure) or value.bound is not None:
        return None
    if not isinstance(threshold, Expression) or any(
        isinstance(n, StateOperator) for n in nodes(threshold)
    ):
        return None
    return replace(value, bound=Bound(operator, threshold, span=node.span))


def _negated(path: PathFormula) -> PathFormula | None:
    """The formula behind a negation that Storm does not read before a temporal operator."""
    match path:
        case Unary(UnaryOperator.NOT, operand) if isinstance(
            operand, UnaryTemporal | BinaryTemporal
        ):
            return operand
        case _:
            return None


def _not(operand: PathFormula) -> Expression:
    """The negation of a formula. Nodes of the tree hold path formulas as if they were states'."""
    match operand:
        case Unary(UnaryOperator.NOT, inner):
            return inner
        case _:
            return Unary(UnaryOperator.NOT, cast(Expression, operand))


def _both(left: PathFormula, right: PathFormula) -> Expression:
    return Binary(Operator.AND, cast(Expression, left), cast(Expression, right))


def _either(left: PathFormula, right: PathFormula) -> Expression:
    return Binary(Operator.OR, cast(Expression, left), cast(Expression, right))


def _opposite(direction: str | None) -> str | None:
    return {"min": "max", "max": "min"}.get(direction or "", direction)
