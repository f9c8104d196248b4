"""Step-bounded values over many more steps than can be made.

Small chains are squared (see `symcheck.numerics.transient.squaring`). Otherwise steps are made
until the rest is bounded closely enough. With T the step, x the values after k of N steps, and d
and D the least and the greatest change T x - x:

- T is monotone and T (x + c) <= T x + c for c >= 0, so the values after N steps are at most
  x + (N - k) D if D >= 0, and at least x + (N - k) d if d <= 0; if no step leaves the states,
  whatever the signs are;
- if nothing is earned on the way, they lie between the least value or 0 and the greatest or 0;
- probabilities of reaching a target only grow, and do not exceed those without a bound;
- the values u without a bound are a fixed point of T. If A w <= r w for a vector w >= |u - x| that
  is positive, the matrix A of every choice of rows and a factor r < 1, the values after N steps are
  at most r^(N - k) w from u (Collatz, 1942; Wielandt, 1950); they are at most w from u in any case,
  because they only grow, or only fall.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from functools import cached_property

import numpy as np

from symcheck.check.context import Context
from symcheck.check.result import SolverRun
from symcheck.direction import Direction
from symcheck.engines.base import System, Values
from symcheck.errors import UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Floats, best_of_rows
from symcheck.numerics import tuning
from symcheck.numerics.linear.problem import largest_width
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.expressions.literals import LEAST

__all__ = ["RestOfSteps", "squared_steps"]


def squared_steps(
    context: Context,
    system: System,
    sides: list[Floats],
    steps: int,
    add: Numbers | int,
    slack: Floats | float = 0.0,
) -> tuple[Floats, Floats] | None:
    """Bounds after some steps of a small chain by squaring; None if steps are quicker.

    sides: the values before, or their lower and their upper bounds. add: what each step adds.
    slack: a bound on the absolute error of that, beside the relative one.
    """
    if (
        steps <= tuning.SQUARING_STEPS
        or context.engine.is_rational
        or system.n > tuning.SQUARING_STATES
        or not system.has_rows
        or system.matrix.rows > system.n
    ):
        return None
    from symcheck.numerics.transient.squaring import IntervalChain, squaring_entries

    matrix = system.matrix
    # A step costs as much as some thousand entries, whatever the number of its own.
    if squaring_entries(system.n, steps) > steps * max(matrix.entries, tuning.STEP_ENTRIES):
        return None
    error = 8.0 * UNIT_ROUNDOFF + system.error + matrix.longest * UNIT_ROUNDOFF
    chain = IntervalChain.of_steps(matrix, system.one_step_probability(~system.states), error)
    if chain is None:
        return None
    added = np.zeros(system.n) + np.asarray(add, np.float64)
    lower, upper, squarings = np.zeros(system.n), np.zeros(system.n), 0
    for sign in (1.0, -1.0):
        parts = [np.maximum(sign * side, 0.0) for side in sides]
        least, paid = (np.maximum(sign * added + error, 0.0) for error in (-slack, slack))
        if not (paid.any() or any(part.any() for part in parts)):
            continue
        low, high = min(parts, key=np.sum), max(parts, key=np.sum)
        earned = (least * (1.0 - error), paid * (1.0 + error)) if paid.any() else None
        found = chain.values(steps, (low, high), earned)
        squarings = found.squarings
        best, worst = (found.lower, found.upper) if sign > 0 else (-found.upper, -found.lower)
        lower, upper = lower + best, upper + worst
    lower, upper = (
        lower - 2.0 * UNIT_ROUNDOFF * np.abs(lower),
        upper + 2.0 * UNIT_ROUNDOFF * np.abs(upper),
    )
    text = f"{squarings} squarings of a matrix"
    context.log.runs.append(SolverRun("steps", "squaring", system.n, squarings, text))
    return lower, upper


@dataclass(eq=False)
class RestOfSteps:
    """The steps that remain, of a computation that makes them one by one.

    Attributes:
        context, system: what is computed.
        steps: all of them.
        earns: whether steps add something.
        grows: whether values only grow (or, if False, fall) with the steps; None: neither is known.
        unbounded: computes the values without a bound on the steps, if `grows` is not None.
        loss: 1 minus the factor of the values after a step.
        outward: whether values are bounds, to which the rounding of each step was added.
    """

    context: Context
    system: System
    steps: int
    earns: bool
    grows: bool | None = None
    unbounded: Callable[[], Values] | None = None
    loss: float = 0.0
    outward: bool = False
    _next_check: int = field(default=0, init=False)
    _bits: int = field(default=0, init=False)
    _widths: list[tuple[int, float]] = field(default_factory=list, init=False)

    def is_known(self, taken: int, before: list[Numbers], after: list[Numbers]) -> bool:
        """Whether no more steps should be made: their values are known closely enough, or there
        would be too many.

        Args:
            taken: the steps made.
            before: the values before the last step.
            after: the values after it.

        Raises:
            UnsupportedError: the numbers of exact values become too large.
        """
        first = tuning.FIRST_STEP_CHECK // (8 if self.context.engine.is_rational else 1)
        if taken < max(self._next_check, first) or taken >= self.steps:
            return False
        self._next_check = taken + max(taken // 2, 1)
        if self.context.engine.is_rational:
            self._refuse_large_numbers(taken, after)
            return False
        if self.steps - taken < tuning.LIMIT_STEPS:
            return False
        lower, upper = self.bounds(taken, before, after)
        relevant = self.context.relevant_states
        if relevant is not None:
            members = self.system.restrict(relevant) > 0
            lower, upper = lower[members], upper[members]
        options = self.context.options
        width = largest_width(lower, upper, options.relative)
        return width <= options.epsilon or self._is_hopeless(taken, width)

    def _is_hopeless(self, taken: int, width: float) -> bool:
        """Whether all steps are too many, and the bounds will not be close enough before long."""
        work = max(self._entries, tuning.STEP_ENTRIES)
        self._widths.append((taken, width))
        if work * self.steps <= tuning.LONG_SERIES_ENTRIES:
            return False
        affordable = tuning.SERIES_ENTRIES / work
        if taken > affordable:
            return True
        if len(self._widths) < tuning.STEP_CHECKS:
            return False
        (first, wide), epsilon = self._widths[-tuning.STEP_CHECKS], self.context.options.epsilon
        shrinks = math.log(wide / width) if 0.0 < width < wide < math.inf else 0.0
        needed = math.log(width / epsilon) * (taken - first) if math.isfinite(width) else math.inf
        return needed > shrinks * affordable

    def bounds(
        self, taken: int, before: list[Numbers], after: list[Numbers]
    ) -> tuple[Floats, Floats]:
        """Bounds on the values after all steps: float64[n] each (see `is_known`)."""
        rest, longest = self.steps - taken, self.system.operator.longest
        step = (longest + 4) * UNIT_ROUNDOFF + self.system.error
        relative = min(1.01 * taken * step, 1.0)
        if self.outward:
            return self._outward_bounds(before, after, rest)
        low, high = after[0], after[-1]
        greatest = max(float(np.abs(side).max(initial=0.0)) for side in after)
        step_error = step * greatest
        error = relative * greatest
        # `before` is a vector like any other, from which T^(rest + 1) is made.
        falls = float((after[0] - before[0]).min(initial=0.0 if self._leaves else np.inf))
        rises = float((after[-1] - before[-1]).max(initial=0.0 if self._leaves else -np.inf))
        lower = low + rest * (falls - step_error) - error
        upper = high + rest * (rises + step_error) + error
        if not self.earns:
            least = float(low.min(initial=0.0 if self._leaves else np.inf))
            most = float(high.max(initial=0.0 if self._leaves else -np.inf))
            lower = np.maximum(lower, least - error)
            upper = np.minimum(upper, most + error)
        if self.grows is not None:
            known = self._limits
            if self.grows:
                low = low * (1.0 - relative)
                away = self._contracted(known[1] - low, rest)
                lower = np.maximum(lower, np.maximum(low, known[0] - away))
                upper = np.minimum(upper, known[1])
            else:
                high = high * (1.0 + relative)
                away = self._contracted(high - known[0], rest)
                upper = np.minimum(upper, np.minimum(high, known[1] + away))
                lower = np.maximum(lower, known[0])
        lower = lower - 4.0 * UNIT_ROUNDOFF * np.abs(lower)
        return lower, np.maximum(upper + 4.0 * UNIT_ROUNDOFF * np.abs(upper), lower)

    def _contracted(self, away: Floats, steps: int) -> Floats:
        """How far values are at most from those without a bound after some more steps.

        away: how far they are at most now, float64[n], not above 1; it may be rounded.
        """
        operator, groups = self.system.operator, self.system.groups
        least = max(UNIT_ROUNDOFF * float(away.max(initial=0.0)), LEAST)  # no ratio is 0 / 0
        vector: Floats = np.maximum(away, least)
        rows = operator.multiply(vector) + (operator.longest + 6) * LEAST
        ratio = float((best_of_rows(rows, groups, Direction.MAX) / vector).max(initial=0.0))
        ratio *= 1.0 + (operator.longest + 8) * UNIT_ROUNDOFF + self.system.error
        # The hundredth is more than all roundings, that of `away` among them, whatever the ratio.
        factor = 1.01 * math.exp(steps * math.log(min(max(ratio, LEAST), 1.0)))
        return factor * vector + 4.0 * LEAST

    def _outward_bounds(
        self, before: list[Numbers], after: list[Numbers], rest: int
    ) -> tuple[Floats, Floats]:
        """Bounds of values that may have both signs: after <= T before, and the reverse above."""
        leaves, count = self._leaves, float(rest + 1)
        if self.loss > 0.0:  # the sum of the factors
            count = -math.expm1(count * math.log1p(-self.loss)) / self.loss
        low, high = before[0], before[-1]
        falls = float((after[0] - low).min(initial=0.0 if leaves else np.inf))
        rises = float((after[-1] - high).max(initial=0.0 if leaves else -np.inf))
        unit = 32.0 * UNIT_ROUNDOFF
        lower = low + count * falls - unit * (np.abs(low) + count * abs(falls))
        upper = high + count * rises + unit * (np.abs(high) + count * abs(rises))
        if not self.earns:
            least = float(after[0].min(initial=0.0 if leaves else np.inf))
            most = float(after[-1].max(initial=0.0 if leaves else -np.inf))
            lower, upper = np.maximum(lower, least), np.minimum(upper, most)
        return lower, np.maximum(upper, lower)

    @cached_property
    def _limits(self) -> tuple[Floats, Floats]:
        assert self.unbounded is not None
        low, high = self.unbounded().at(self.system.states)
        return low, high

    @cached_property
    def _leaves(self) -> bool:
        """Whether some step leaves the states."""
        return bool(np.any(self.system.one_step_probability(~self.system.states)))

    @cached_property
    def _entries(self) -> int:
        return self.system.n * max(1, self.system.operator.longest // 2)

    def _refuse_large_numbers(self, taken: int, values: list[Numbers]) -> None:
        bits = max(max(v.numerator.bit_length(), v.denominator.bit_length()) for v in values[0])
        grown, self._bits = bits - self._bits, bits
        digits = 0.3 * grown / max(taken // 3, 1) * self.steps
        if grown > 0 and bits > tuning.EXACT_BITS and digits > tuning.EXACT_DIGITS:
            raise UnsupportedError(
                f"the exact value after {self.steps:,} steps is a fraction of about "
                f"{digits:.0e} digits",
                hint="without -exact, bounds on the value are computed",
            )
