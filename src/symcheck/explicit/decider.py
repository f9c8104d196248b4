"""Decisions that the bounds on rounding errors leave open, made in exact arithmetic."""

from __future__ import annotations

from collections.abc import Sequence

from symcheck.errors import InputError
from symcheck.explicit import tuning
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import Variable
from symcheck.syntax.ast import Expression, Type
from symcheck.syntax.traversal import names

__all__ = ["Decider"]


class Decider:
    """Evaluates comparisons, roundings and doubles at states, each once per valuation.

    Attributes:
        reads: for each decision, the indices of the variables that it reads.
        interruption: what has ended a decision and is none of `faults`, such as Ctrl-C.
    """

    faults = InputError

    def __init__(self, variables: Sequence[Variable]) -> None:
        self._variables = variables
        self._numbers: dict[Expression, int] = {}
        self._expressions: list[Expression] = []
        self._answers: list[dict[tuple[int, ...], int | float]] = []
        self.reads: list[tuple[int, ...]] = []
        self.interruption: BaseException | None = None

    def number(self, expression: Expression) -> int:
        """The number of the decision on an expression."""
        if expression not in self._numbers:
            self._numbers[expression] = len(self._expressions)
            self._expressions.append(expression)
            self._answers.append({})
            read = names(expression)
            self.reads.append(tuple(i for i, v in enumerate(self._variables) if v.name in read))
        return self._numbers[expression]

    def decide(self, number: int, values: tuple[int, ...]) -> int | float:
        """The value of the expression of a decision; a bool is 0 or 1.

        Args:
            number: the number of the decision (see `number`).
            values: those of the variables that it reads.

        Raises:
            ModelFault: it has no value.
        """
        answers = self._answers[number]
        known = answers.get(values)
        if known is not None:
            return known
        variables = [self._variables[i] for i in self.reads[number]]
        valuation = {
            v.name: bool(value) if v.type is Type.BOOL else value
            for v, value in zip(variables, values, strict=True)
        }
        value = evaluate(self._expressions[number], valuation)
        answer = value if isinstance(value, float) else int(value)
        if len(answers) >= tuning.MOST_ANSWERS:
            answers.clear()
        answers[values] = answer
        return answer
