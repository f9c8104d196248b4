"""Evaluation of bounds on steps, time and rewards in properties (`<=k`, `[a,b]`, `>k`, `=k`)."""

from __future__ import annotations

from fractions import Fraction
from math import ceil, floor, isfinite

from symcheck.errors import NO_SPAN, Diagnostic, InputError, Span
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.expressions.evaluate import evaluate_constant
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, bounded_reward
from symcheck.syntax.ast import Expression, Limits, RewardBound, RewardBounds, TimeBound

__all__ = ["RewardWindow", "StepRange", "Window", "bound_value", "counts", "window"]


@dataclass(frozen=True, slots=True)
class Window:
    """The interval from `lower` to `upper` (None: unbounded); a strict bound excludes its end."""

    lower: Fraction = Fraction(0)
    upper: Fraction | None = None
    lower_strict: bool = False
    upper_strict: bool = False
    span: Span = NO_SPAN

    @property
    def is_unbounded(self) -> bool:
        """Whether the interval contains all times."""
        return self.lower == 0 and self.upper is None and not self.lower_strict

    def steps(self) -> StepRange:
        """The interval in steps. Raises InputError if a bound is not an integer or it is empty."""
        lower = _whole(self.lower, self.span) + self.lower_strict
        upper = None if self.upper is None else _whole(self.upper, self.span) - self.upper_strict
        if upper is not None and upper < lower:
            raise InputError(_empty(self.span))
        return StepRange(lower, upper)

    @property
    def contains_zero(self) -> bool:
        """Whether time 0 is in the interval."""
        return self.lower == 0 and not self.lower_strict

    def times(self) -> tuple[float, float | None]:
        """The interval in continuous time.

        Strictness does not matter, because a single instant has probability 0.
        """
        return float(self.lower), None if self.upper is None else float(self.upper)


@dataclass(frozen=True, slots=True)
class StepRange:
    """Step numbers from `lower` to `upper` (None: unbounded), both included."""

    lower: int
    upper: int | None


@dataclass(frozen=True, slots=True)
class RewardWindow:
    """The interval in which an accumulated reward must be."""

    reward: Reward
    window: Window


def bound_value(expression: Expression) -> Fraction:
    """The exact value of a bound. Raises InputError if it is negative or not finite."""
    value = evaluate_constant(expression)
    if not isfinite(value) or value < 0:
        raise InputError(
            Diagnostic(
                f"a bound on steps or time cannot be {_show(value)}", expression.span, "bound"
            )
        )
    return Fraction(value)


def window(bound: TimeBound | None) -> Window:
    """The times that a bound allows. Raises InputError if it is negative or allows no time."""
    return Window() if bound is None else _extent(bound)


def counts(bound: RewardBound | RewardBounds, model: BoundModel) -> tuple[RewardWindow, ...]:
    """The rewards that a bound allows. Raises InputError if it is negative or allows no reward."""
    parts = bound.parts if isinstance(bound, RewardBounds) else (bound,)
    return tuple(RewardWindow(bounded_reward(p, model), _extent(p)) for p in parts)


def _extent(bound: Limits) -> Window:
    lower = Fraction(0) if bound.lower is None else bound_value(bound.lower)
    upper = None if bound.upper is None else bound_value(bound.upper)
    result = Window(
        lower, upper, bound.lower_strict, bound.upper_strict and upper is not None, bound.span
    )
    empty_point = result.lower_strict or result.upper_strict
    if upper is not None and (upper < lower or (upper == lower and empty_point)):
        raise InputError(_empty(bound.span))
    return result


def _empty(span: Span) -> Diagnostic:
    return Diagnostic(
        "no time satisfies this bound",
        span,
        "bound",
        "the upper bound must not be below the lower one",
    )


def _whole(value: Fraction, span: Span) -> int:
    if value.denominator != 1:
        hint = f"use {floor(value)} or {ceil(value)}; only a ctmc has real-valued time"
        raise InputError(
            Diagnostic(
                f"a number of steps must be an integer, not {_show(value)}", span, "bound", hint
            )
        )
    return int(value)


def _show(value: object) -> str:
    return (
        str(float(value)) if isinstance(value, Fraction) and value.denominator != 1 else str(value)
    )
