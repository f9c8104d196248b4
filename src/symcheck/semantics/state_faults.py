"""Diagnostics about states: faults of a model that occur at a reachable state.

All engines use them, so that the messages do not depend on the engine. Each function returns a
diagnostic with an example state, to be raised as `ModelFault(diagnostic, …)`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

from symcheck.errors import NO_SPAN, Diagnostic, InputError, ModelFault, Span
from symcheck.semantics.expressions.literals import format_value, to_float
from symcheck.semantics.model import BoundCommand, BoundReward, BoundUpdate, Value, Variable
from symcheck.syntax.ast import Literal, ModelType
from symcheck.tables import counted

__all__ = [
    "POSITIVE_ENDS",
    "SUM_TOLERANCE",
    "AlmostOne",
    "almost_one",
    "at_state",
    "deadlocks",
    "deadlocks_mended",
    "describe_state",
    "function_sum",
    "negative_update",
    "no_initial_state",
    "reward_not_finite",
    "rounded_sum",
    "sum_tolerance",
    "sums_to_one",
    "update_not_finite",
    "update_range",
    "update_sum",
    "weight_name",
]

SUM_TOLERANCE = 1e-5 * (1 + 1e-9)
"""Largest difference from 1 of a sum of probabilities in floating point: 1e-5, which is rounded."""

POSITIVE_ENDS = "nature could remove this transition; use a small positive lower end"
"""The hint for an interval of probabilities whose lower end is 0."""

_UNCHECKED_TOLERANCE = 2.0**-40
"""Likewise where it is not known that the sums of all valuations are 1 but for rounding."""

_SHOWN = 3
_MAX_VARIABLES = 10  # shown of an example state
_MOST_CHARACTERS = 60  # of updates that are written anew in a hint


class AlmostOne(ModelFault):
    """The probabilities of a command sum to almost 1 in some state.

    Attributes:
        command: the command.
        warning: what is said if they are divided by their sum.
    """

    def __init__(self, command: BoundCommand, total: Value, state: str) -> None:
        super().__init__(update_sum(command, total, state))
        self.command, self.warning = command, almost_one(command, total, state)
        self._arguments = command, total, state

    def __reduce__(self) -> tuple[type[AlmostOne], tuple[object, ...]]:
        return AlmostOne, self._arguments  # of a worker


def almost_one(command: BoundCommand, total: Value, state: str) -> str:
    """The warning that probabilities are divided by their sum.

    state: an example; empty if none is known.
    """
    where = f", for example in state {state}" if state else ""
    return (
        f"{command.span}: the probabilities sum to {to_float(total):.15g}, not 1{where}: they are "
        "divided by their sum"
    )


def sum_tolerance(unchecked: bool) -> float:
    """How much a sum of probabilities in floating point may differ from 1.

    Args:
        unchecked: whether sums that are almost 1 are looked for.
    """
    return _UNCHECKED_TOLERANCE if unchecked else SUM_TOLERANCE


def rounded_sum(total: Any, terms: Any) -> Any:
    """Whether sums (a number, or an array of them) of so many probabilities are 1 but for rounding.

    Each term and each partial sum is rounded, to half a unit in the last place of 1 at most.
    """
    return abs(total - 1) <= (terms + 4) * 2.0**-52


def sums_to_one(total: Value) -> bool:
    """Whether a sum of probabilities is 1 (a Fraction exactly, a float up to SUM_TOLERANCE)."""
    return total == 1 if isinstance(total, Fraction) else abs(total - 1) <= SUM_TOLERANCE


def deadlocks_mended(count: int, example: str) -> str:
    """The warning of deadlocks that were given self-loops. example: the text of one of them."""
    return f"deadlocks were given self-loops in {counted(count, 'state')}, such as {example}"


def describe_state(variables: Sequence[Variable], values: Sequence[Value]) -> str:
    """The text of a state: `(s=0,b=true)`. Values of bools may be 0 and 1.

    If there are many variables, only the first ones that are not 0 or false are shown.
    """
    pairs = list(zip(variables, values, strict=True))
    kept = (
        pairs
        if len(pairs) <= _MAX_VARIABLES
        else [(v, x) for v, x in pairs if x][:_MAX_VARIABLES] or pairs[:_MAX_VARIABLES]
    )
    shown = [f"{v.name}={format_value(bool(x) if v.type.value == 'bool' else x)}" for v, x in kept]
    left = [f"… {len(pairs) - len(kept)} more"] if len(kept) < len(pairs) else []
    return f"({','.join(shown + left)})"


def update_sum(
    command: BoundCommand, total: Value, state: str, completed_by: BoundCommand | None = None
) -> Diagnostic:
    """The probabilities of the updates of a command do not sum to 1.

    completed_by: another command that is enabled in this state, and has the missing probability.
    """
    span = _updates_span(command)
    message = f"probabilities sum to {_short(total)}, not 1, for example in state {state}"
    if isinstance(total, float) and not math.isfinite(total):
        return Diagnostic(message, span, "update-sum")
    missing = 1 - total
    if completed_by is not None:
        joined = " + ".join(_updates_span(c).text for c in (command, completed_by))
        shown = f": {joined}" if len(joined) <= _MOST_CHARACTERS and "\n" not in joined else ""
        hint = f"join the two commands by +{shown}"
    elif missing > 0:
        hint = f"add the missing {_short(missing)}"
    elif any(
        isinstance(u.probability, Literal) and u.probability.value > 1 for u in command.updates
    ):
        hint = "probabilities are at most 1; rates belong to a ctmc"
    else:
        hint = f"{_short(-missing)} is too much"
    return Diagnostic(message, span, "update-sum", hint)


def function_sum(command: BoundCommand, total: str, state: str) -> Diagnostic:
    """The probabilities of the updates of a command sum to another function than 1."""
    message = f"probabilities sum to {total}, not 1, for example in state {state}"
    return Diagnostic(message, _updates_span(command), "update-sum")


def negative_update(
    command: BoundCommand, update: BoundUpdate, value: Value, state: str, kind: ModelType
) -> Diagnostic:
    """A probability or rate is below 0."""
    message = f"{weight_name(kind)} {_short(value)} is negative, for example in state {state}"
    return Diagnostic(message, _probability_span(command, update), "update-negative")


def update_not_finite(
    command: BoundCommand, update: BoundUpdate, value: Value, state: str, kind: ModelType
) -> Diagnostic:
    """A probability or rate is NaN or infinite."""
    message = f"{weight_name(kind)} is {_short(value)}, for example in state {state}"
    hint = "is something divided by zero?"
    return Diagnostic(message, _probability_span(command, update), "update-not-finite", hint)


def update_range(
    command: BoundCommand, update: BoundUpdate, variable: Variable, value: Value, state: str
) -> Diagnostic:
    """An update gives a variable a value outside of its range."""
    range_ = f"[{variable.low}..{variable.high}]"
    message = f"{variable.name} would become {format_value(value)}, outside of {range_}, "
    hint = f"exclude these states in the guard, or widen the range of {variable.name}"
    return Diagnostic(
        message + f"for example in state {state}",
        _span(update.span, command.span),
        "update-range",
        hint,
    )


def reward_not_finite(item: BoundReward, value: Value, what: str, state: str) -> Diagnostic:
    """A reward, or a number that is computed from it, is NaN or infinite."""
    return Diagnostic(
        f"{what} is {_short(value)}, for example in state {state}",
        item.span,
        "reward-not-finite",
    )


def deadlocks(states: Iterable[str], count: int) -> Diagnostic:
    """States without a transition; `states` are examples of the `count` deadlocks."""
    shown = list(states)[:_SHOWN]
    noun = "1 state has" if count == 1 else f"{count} states have"
    message = f"{noun} no transition (a deadlock), for example {' and '.join(shown)}"
    return Diagnostic(message, NO_SPAN, "deadlock", "-fixdl gives such states a loop to themselves")


def no_initial_state(span: Span = NO_SPAN) -> Diagnostic:
    """No state satisfies the condition on initial states."""
    return Diagnostic(
        "no state satisfies the condition on initial states", span, "no-initial-state"
    )


def at_state(fault: InputError, state: str) -> ModelFault:
    """An evaluation fault with the state at which it occurs."""
    result = (
        Diagnostic(f"{d.message}, for example in state {state}", d.span, d.code, d.hint, d.severity)
        for d in fault.diagnostics
    )
    return ModelFault(*result)


def weight_name(kind: ModelType) -> str:
    """What the weights of updates are in a model of this type."""
    return "rate" if kind.continuous_time else "probability"


def _span(*spans: Span) -> Span:
    """The first span that has a text."""
    return next((s for s in spans if s.source.text), NO_SPAN)


def _probability_span(command: BoundCommand, update: BoundUpdate) -> Span:
    return _span(update.probability.span, update.span, command.span)


def _updates_span(command: BoundCommand) -> Span:
    span = NO_SPAN
    for update in command.updates:
        span = span | update.span if span.source.text else update.span
    return _span(span, command.span)


def _short(value: Value) -> str:
    """A number with ten significant digits, which hides rounding errors."""
    if isinstance(value, Fraction) or not math.isfinite(value):
        return format_value(value)
    return f"{value:.10g}" if abs(value) > 1e-3 else f"{value:.6g}"
