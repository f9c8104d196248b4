"""What may surprise a reader of a result: a path formula without operators, and Infinity."""

from __future__ import annotations

from math import inf

from symcheck.check.result import Answer
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import (
    BinaryTemporal,
    ExpectedTime,
    Expression,
    ExpressionNode,
    LabelReference,
    Measure,
    Name,
    PathQuantifier,
    ProbabilityOperator,
    RewardOperator,
    TotalReward,
    UnaryTemporal,
    Weights,
)
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import nodes

__all__ = ["property_notes"]


def property_notes(model: BoundModel, formula: Expression, value: Answer) -> tuple[str, ...]:
    """One sentence for each surprise.

    Args:
        model: that which was checked.
        formula: a bound formula; only a measure, A or E as the outermost operator is looked at.
        value: its value.

    Examples:
        >>> import symcheck
        >>> model = symcheck.loads("dtmc module m x : [0..3]; [] x=0 -> (x'=1); endmodule")
        >>> model.check("P=? [ x=1 ]").notes
        ('x=1 without a path operator is about the first state, F x=1 about some, G x=1 about all',)
        >>> model.check("T=? [ F x=3 ]").notes
        ('Infinity: the probability of F x=3 is less than 1',)
    """
    reason = _reason(model, formula) if value == inf else ()
    match formula:
        case ProbabilityOperator(path=path) | PathQuantifier(path=path):
            others = "F {0} about some, G {0} about all"
        case ExpectedTime(path=path) | RewardOperator(query=ExpressionNode() as path):
            others = "F {0} about some"
        case _:
            return reason
    parts = tuple(nodes(path))
    if any(isinstance(node, UnaryTemporal | BinaryTemporal) for node in parts) or not any(
        isinstance(node, Name | LabelReference) for node in parts
    ):
        return reason
    text = pretty(path)
    about = f"is about the first state, {others.format(text)}"
    return (f"{text} without a path operator {about}",)


def _reason(model: BoundModel, formula: Expression) -> tuple[str, ...]:
    """Why the value of a reward or of a time is infinite, if one sentence tells."""
    kind = model.type
    if kind.players > 1 or kind.partially_observed or model.weights is Weights.INTERVALS:
        return ()
    match formula:
        case RewardOperator(query=TotalReward()):
            return (f"Infinity: rewards are earned for ever{_under(formula)}",)
        case (
            RewardOperator(query=(UnaryTemporal() | BinaryTemporal()) as path)
            | ExpectedTime(path=path)
        ):
            return (f"Infinity: the probability of {pretty(path)} is less than 1{_under(formula)}",)
        case _:
            return ()


def _under(formula: Measure) -> str:
    """Under which strategies the target is missed."""
    return {"min": " under every strategy", "max": " under some strategy"}.get(
        formula.direction or "", ""
    )
