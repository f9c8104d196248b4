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
from symcheck.engines.explicit.intervals import IntervalEngine
from symcheck.engines.rational.explore import RationalModel
from symcheck.errors import Diagnostic, ModelFault, NeedsRationalsError, UnsupportedError
from symcheck.explicit.explored import ExploredModel
from symcheck.explicit.model import ExplicitModel
from symcheck.explicit.states import StateTable
from symcheck.matrices.numbers import Numbers
from symcheck.options import Options
from symcheck.semantics.binding.bind import exactly_bound
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.model import BoundCommand, BoundModel, BoundUpdate
from symcheck.semantics.state_faults import POSITIVE_ENDS, describe_state
from symcheck.syntax.ast import Binary, Expression, Literal, Type, Weights
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import names

__all__ = ["build_intervals"]

BuildRows = Callable[[BoundModel, Options], ExplicitEngine]
"""Builds the rows of a model without intervals, by the engine that the options name."""

_ZERO, _ONE = (Literal(Fraction(v), Type.DOUBLE) for v in (0, 1))


def build_intervals(model: BoundModel, options: Options, build: BuildRows) -> Engine:
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
        return build(_mapped(model, of), inner)

    high = rows(_upper)
    _check(high, model)
    least = rows(_lower)
    low, error = least.weights, max(least.entry_error, high.entry_error)
    if not np.array_equal(low.indptr, high.weights.indptr) or not np.array_equal(
        low.indices, high.weights.indices
    ):
        raise NeedsRationalsError("products of intervals underflow")
    rewards = _rewards(model, high.explored, rows)
    exact = replace(options, exact=True)
    return erased(
        IntervalEngine(
            _listed(high.explored, model, rewards),
            high.name,
            lower=low.data,
            source=replace(high, number_error=error),
            number_error=error,
            twin=lambda: build_intervals(exactly_bound(model), exact, build),
        )
    )


def _listed(
    found: ExploredModel, model: BoundModel, rewards: Sequence[Numbers]
) -> ExplicitModel | RationalModel:
    """What was found, as arrays, with the model and the rewards of rows."""
    if isinstance(found, RationalModel):
        return replace(found, model=model, choice_rewards=rewards)
    states = found.states
    assert isinstance(states, StateTable)
    return ExplicitModel(
        *(model, states, found.matrix, found.choice_actions, found.initial, found.deadlocks),
        *(list(found.state_rewards), list(rewards)),
    )


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
        raise UnsupportedError(f"{update.span}: {message}{state}", hint=POSITIVE_ENDS)


def _example(engine: ExplicitEngine, command: BoundCommand, condition: Expression) -> str | None:
    """The text of a reachable state in which a command has a fault; None if there is none."""
    if not names(condition) and not evaluate(condition, {}, exact=True):
        return None
    states = engine.where(Binary(Operator.AND, command.guard, condition))
    if not states:
        return None
    values = next(iter(engine.valuations(engine.first(states))))
    return f", for example in state {describe_state(engine.model.variables, values)}"
