"""Builds models with intervals of probabilities: a model of the lower ends and one of the upper
ends, which have the same states and transitions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import reduce

import numpy as np

from symcheck.engines.base import Engine, erased
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.intervals import IntervalEngine, IntervalModel
from symcheck.errors import Diagnostic, ModelFault, UnsupportedError
from symcheck.explicit.explored import ExploredModel
from symcheck.matrices.numbers import Numbers
from symcheck.options import Options
from symcheck.semantics.binding.bind import exactly_bound
from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate
from symcheck.semantics.state_faults import describe_state
from symcheck.syntax.ast import Binary, Expression, Literal, Type, Weights
from symcheck.syntax.operators import Operator

__all__ = ["build_intervals"]

BuildEngine = Callable[[BoundModel, Options], Engine]
"""Builds a model without intervals on the engine that the options name."""

_ZERO, _ONE = (Literal(Fraction(v), Type.DOUBLE) for v in (0, 1))


def build_intervals(model: BoundModel, options: Options, build: BuildEngine) -> Engine:
    """Build a model with intervals: explicit rows, which diagrams write if the engine has them.

    Args:
        model: the bound model.
        options: the engine ('auto' is 'explicit') and limits.
        build: builds the models of both ends.

    Raises:
        ModelFault: an interval is empty, or the intervals of a command hold no distribution, in
            some state.
        UnsupportedError: a lower end is 0 in some state.
    """
    inner = replace(options, check_sums=False, order=None, bisim=False)

    def rows(of: Callable[[BoundCommand], BoundCommand]) -> ExplicitEngine:
        return _on_rows(build(_mapped(model, of), inner), inner)

    high = rows(_upper)
    _check(high, model)
    low = rows(_lower)
    source, lower = high.explored, low.weights
    if not np.array_equal(lower.indptr, high.weights.indptr) or not np.array_equal(
        lower.indices, high.weights.indices
    ):
        raise UnsupportedError("products of intervals underflow", hint="use -exact")
    explored = IntervalModel(
        source, lower.data, model, _rewards(model, source, rows), high.weights.groups
    )
    exact = replace(options, exact=True)
    return erased(
        IntervalEngine(
            explored,
            high.name,
            twin=lambda: build_intervals(exactly_bound(model), exact, build),
        )
    )


def _on_rows(engine: Engine, options: Options) -> ExplicitEngine:
    from symcheck.engines.registry import on_rows

    return on_rows(engine, options)


def _mapped(model: BoundModel, of: Callable[[BoundCommand], BoundCommand]) -> BoundModel:
    """The model with other commands, and numbers as probabilities."""
    done: dict[int, BoundCommand] = {}

    def once(command: BoundCommand) -> BoundCommand:
        return done.setdefault(id(command), of(command))

    modules = tuple(replace(m, commands=tuple(map(once, m.commands))) for m in model.modules)
    events = tuple(
        replace(e, participants=tuple(tuple(map(once, p)) for p in e.participants))
        for e in model.events
    )
    return replace(model, modules=modules, events=events, weights=Weights.NUMBERS, observed=None)


def _lower(command: BoundCommand) -> BoundCommand:
    return replace(command, updates=tuple(replace(u, upper=None) for u in command.updates))


def _upper(command: BoundCommand) -> BoundCommand:
    return replace(
        command,
        updates=tuple(
            replace(u, probability=u.upper or u.probability, upper=None) for u in command.updates
        ),
    )


def _middle(command: BoundCommand) -> BoundCommand:
    """Some distribution: the lower ends divided by their sum."""
    total = _sum(u.probability for u in command.updates)
    return replace(
        command,
        updates=tuple(
            replace(u, probability=Binary(Operator.DIVIDE, u.probability, total), upper=None)
            for u in command.updates
        ),
    )


def _sum(terms: Iterator[Expression]) -> Expression:
    return reduce(lambda a, b: Binary(Operator.PLUS, a, b), terms)


def _rewards(
    model: BoundModel,
    source: ExploredModel,
    rows: Callable[[Callable[[BoundCommand], BoundCommand]], ExplicitEngine],
) -> Sequence[Numbers]:
    """Per structure, the transition reward of each row, which no distribution changes."""
    if all(item.on_states for structure in model.rewards for item in structure.items):
        return source.choice_rewards
    return rows(_middle).explored.choice_rewards


# ------------------------------------------------------------------------------------------ checks


def _check(engine: ExplicitEngine, model: BoundModel) -> None:
    """Raise ModelFault or UnsupportedError, with an example state, for intervals that cannot be."""
    for command in dict.fromkeys(c for m in model.modules for c in m.commands):
        if all(u.upper is None for u in command.updates):
            continue
        for update in command.updates:
            if update.upper is not None:
                _check_update(engine, command, update)
        lower = _sum(u.probability for u in command.updates)
        upper = _sum(u.upper or u.probability for u in command.updates)
        for side, total, operator in (
            ("lower", lower, Operator.GT),
            ("upper", upper, Operator.LT),
        ):
            state = _example(engine, command, Binary(operator, total, _ONE))
            if state is not None:
                comparison = "more" if operator is Operator.GT else "less"
                message = f"the {side} ends of these intervals sum to {comparison} than 1"
                hint = "some distribution must lie within the intervals"
                span = command.span
                raise ModelFault(Diagnostic(message + state, span, "interval-sum", hint))


def _check_update(engine: ExplicitEngine, command: BoundCommand, update: BoundUpdate) -> None:
    lower, upper = update.probability, update.upper
    assert upper is not None
    for left, right, operator, message in (
        (lower, upper, Operator.GT, "this interval is empty: its lower end is above its upper end"),
        (lower, _ZERO, Operator.LT, "the lower end of this interval is negative"),
        (upper, _ONE, Operator.GT, "the upper end of this interval is more than 1"),
    ):
        state = _example(engine, command, Binary(operator, left, right))
        if state is not None:
            raise ModelFault(Diagnostic(message + state, update.span, "interval"))
    state = _example(engine, command, Binary(Operator.EQ, lower, _ZERO))
    if state is not None:
        message = "an interval with the lower end 0 is not supported"
        hint = "nature could remove this transition; use a small positive lower end"
        raise UnsupportedError(f"{update.span}: {message}{state}", hint=hint)


def _example(engine: ExplicitEngine, command: BoundCommand, condition: Expression) -> str | None:
    """The text of a reachable state in which a command has a fault; None if there is none."""
    guard = command.guard
    states = engine.where(Binary(Operator.AND, guard, condition))
    if not states:
        return None
    values = next(iter(engine.valuations(engine.first(states))))
    return f", for example in state {describe_state(engine.model.variables, values)}"
