"""Exploration in rational arithmetic by the compiled search, where weights are whole numbers.

If all probabilities or rates are constants, they are multiplied by a common denominator. Doubles
add and multiply whole numbers without error where the result is below 2**53, so the compiled search
finds each row exactly; dividing by the sum of the row in discrete time, and by the factor in
continuous time, gives the rationals. It is enough to look at the sums of rows: weights are not
negative and rounding is monotone, so that a number from 2**53 on is never rounded below it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import lcm
from typing import NamedTuple

import numpy as np

from symcheck.engines.rational.explore import RationalModel
from symcheck.errors import ModelFault, UnsupportedError
from symcheck.explicit.build import explore
from symcheck.explicit.model import ExplicitModel, evaluate_states
from symcheck.explicit.states import StateTable
from symcheck.matrices.numbers import (
    Numbers,
    Rationals,
    distinct_integers,
    full,
    of_pairs,
    rationals,
    sum_segments,
)
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix, per_row
from symcheck.options import Options
from symcheck.semantics.expressions.types import type_of
from symcheck.semantics.interpreter import value
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, Event
from symcheck.syntax.ast import Expression, Literal, ModelType, Type

__all__ = ["CompiledModel", "commands_in_whole_numbers", "explore_in_whole_numbers"]

_WHOLE = 2.0**53


@dataclass(frozen=True, eq=False)
class CompiledModel(RationalModel):
    """A model whose states are packed, as the compiled search finds them."""

    def evaluate(self, expression: Expression) -> Numbers:
        """The value of an expression in each state; conditions are exact in compiled code."""
        kinds = {v.name: v.type for v in self.model.variables}
        if type_of(expression, kinds) is not Type.BOOL:
            return super().evaluate(expression)
        assert isinstance(self.states, StateTable)
        return evaluate_states(self.model, self.states, expression).astype(object)


def explore_in_whole_numbers(model: BoundModel, options: Options) -> RationalModel | None:
    """The reachable states, and their rows as rationals.

    Args:
        model: a model that was bound with `exact`.
        options: limits of the search.

    Returns:
        None if this is left to the interpreter: a probability or rate is no constant, or negative;
        those of a command do not sum to 1; a factor, a weight or the sum of a row is 2**53 or more;
        or a reward has no finite value where its guard holds, and perhaps no step earns it.

    Raises:
        ModelFault, ResourceError: see `symcheck.explicit.build.explore`.
    """
    searched = _search(model, options)
    if searched is None:
        return None
    found, factor, of_states, earned = searched
    matrix, actions = found.matrix, found.choice_actions
    choices = None if model.type.has_choices else matrix.groups
    if choices is not None:
        matrix, actions = _merged(found)
    sums = matrix.row_sums()
    if not (sums < _WHOLE).all():
        return None
    divisors = np.full(matrix.rows, factor, np.int64)
    if not model.type.continuous_time:
        divisors = sums.astype(np.int64)
    else:  # the loop of a deadlock has the rate 1
        first = np.arange(matrix.rows) if matrix.groups is None else matrix.groups
        divisors[first[found.deadlocks]] = 1
    if choices is not None:
        weights = found.matrix.row_sums().astype(np.int64)
        shares = _quotients(weights, per_row(choices, divisors))
        earned = [sum_segments(shares * rewards, choices) for rewards in earned]
    each = np.repeat(divisors, matrix.lengths)
    return CompiledModel(
        model,
        found.states,
        replace(matrix, data=_quotients(matrix.data.astype(np.int64), each)),
        actions,
        found.initial,
        found.deadlocks,
        of_states,
        earned,
    )


def commands_in_whole_numbers(
    model: BoundModel, options: Options
) -> tuple[ExplicitModel, list[Rationals]] | None:
    """The commands of a chain as choices with whole weights, and their rewards per structure.

    Args:
        model: a chain that was bound with `exact` and has transition rewards, so that each command
            is a choice.
        options: limits of the search.

    Returns:
        None as for `explore_in_whole_numbers`.

    Raises:
        ModelFault, ResourceError: see `symcheck.explicit.build.explore`.
    """
    searched = _search(model, options)
    if searched is None or not (searched.model.matrix.row_sums() < _WHOLE).all():
        return None
    return searched.model, searched.choice_rewards


def _quotients(tops: Int64s, bottoms: Int64s) -> Rationals:
    """Whole numbers divided by others; equal pairs share one rational."""
    above, below = distinct_integers(tops), distinct_integers(bottoms)
    return of_pairs(
        lambda i, j: Fraction(int(above[i]), int(below[j])),
        np.searchsorted(above, tops),
        np.searchsorted(below, bottoms),
        len(below),
    )


class _Searched(NamedTuple):
    """What the search in whole numbers finds, and the rewards as rationals.

    Attributes:
        model: its weights are those of the text multiplied by `factor`.
        state_rewards, choice_rewards: per structure; the second are 0 in a chain whose commands
            are merged, because it has no transition rewards.
    """

    model: ExplicitModel
    factor: int
    state_rewards: list[Rationals]
    choice_rewards: list[Rationals]


def _search(model: BoundModel, options: Options) -> _Searched | None:
    scaled = _with_whole_weights(model)
    if scaled is None:
        return None
    whole, factor = scaled
    found = explore(whole, replace(options, check_sums=False))
    on_states = [[item for item in r.items if item.on_states] for r in model.rewards]
    try:
        of_states = [_rewards(model, found, items) for items in on_states]
        of_choices = [_choice_rewards(model, found, r.items) for r in model.rewards]
    except (ModelFault, UnsupportedError):
        return None
    return _Searched(found, factor, of_states, of_choices)


def _merged(found: ExplicitModel) -> tuple[SparseMatrix, Int32s]:
    """One row for each state in place of its choices, and the action that all of them have; -1 if
    they differ, or have none.
    """
    matrix, groups = found.matrix, found.matrix.groups
    assert groups is not None
    rows = SparseMatrix(matrix.indptr[groups], matrix.indices, matrix.data, matrix.columns)
    order = np.lexsort((rows.indices, rows.row_of_entry))
    rows = replace(rows, indices=rows.indices[order], data=rows.data[order])
    least, most = (f.reduceat(found.choice_actions, groups[:-1]) for f in (np.minimum, np.maximum))
    columns = np.arange(matrix.columns, dtype=np.int32)
    return rows.merge(columns, matrix.columns), np.where(least == most, least, -1).astype(np.int32)


def _earns_by_transitions(model: BoundModel) -> bool:
    return any(not item.on_states for r in model.rewards for item in r.items)


def _with_whole_weights(model: BoundModel) -> tuple[BoundModel, int] | None:
    """The model with all weights multiplied by one factor, and the factor; None if there is none.

    A chain is searched as a CTMC, in which the weights of commands add up, or as an MDP if their
    transitions earn rewards.
    """
    weights = [
        update.probability
        for event in model.events
        for commands in event.participants
        for command in commands
        for update in command.updates
    ]
    if not all(isinstance(w, Literal) and isinstance(w.value, int | Fraction) for w in weights):
        return None
    values = [Fraction(w.value) for w in weights if isinstance(w, Literal)]
    unit = lcm(*(v.denominator for v in values))
    most = max((len(e.participants) for e in model.events), default=1)
    factor = unit**most
    if any(v < 0 for v in values) or max((factor, *(v * factor for v in values))) >= _WHOLE:
        return None
    kind = model.type
    with_probabilities = [
        e
        for e in model.events
        if not (e.is_markovian if kind.immediate_choices else kind.continuous_time)
    ]
    if not all(map(_sums_to_one, with_probabilities)):
        return None
    events = tuple(_whole(event, unit, most) for event in model.events)
    if not kind.has_choices:
        apart = _earns_by_transitions(model)
        kind = ModelType.with_properties(continuous_time=not apart, has_choices=apart)
    return replace(model, type=kind, events=events, is_rational=False, rewards=()), factor


def _sums_to_one(event: Event) -> bool:
    return all(
        sum(Fraction(u.probability.value) for u in c.updates if isinstance(u.probability, Literal))
        == 1
        for commands in event.participants
        for c in commands
    )


def _whole(event: Event, unit: int, most: int) -> Event:
    """The event with weights times unit**most: each participant is multiplied by `unit`, and the
    first also by what is missing.
    """
    more = unit ** (most - len(event.participants) + 1)
    first, *others = event.participants
    scaled = [tuple(_times(c, more) for c in first)]
    scaled += [tuple(_times(c, unit) for c in commands) for commands in others]
    return replace(event, participants=tuple(scaled))


def _times(command: BoundCommand, factor: int) -> BoundCommand:
    updates = []
    for update in command.updates:
        assert isinstance(update.probability, Literal)
        weight = Fraction(update.probability.value) * factor
        probability = replace(update.probability, value=weight, type=Type.DOUBLE)
        updates.append(replace(update, probability=probability))
    return replace(command, updates=tuple(updates))


def _rewards(model: BoundModel, found: ExplicitModel, items: Sequence[BoundReward]) -> Rationals:
    """The sum of the items whose guards hold, in each state."""
    unit = _unit(items)
    whole, total = np.zeros(len(found.states), np.int64), None
    for item in items:
        there = np.flatnonzero(evaluate_states(model, found.states, item.guard))
        if unit is not None and isinstance(item.value, Literal):
            whole[there] += int(Fraction(item.value.value) * unit)
            continue
        total = full(len(found.states), 0, rational=True) if total is None else total
        states = found.states.valuations(there)
        total[there] += rationals(_number(value(model, s, item.value)) for s in states)
    of_literals = _divided(whole, unit or 1)
    return of_literals if total is None else total + of_literals


def _unit(items: Sequence[BoundReward]) -> int | None:
    """A common denominator of the constants; None if a sum over it may reach 2**53."""
    constants = [Fraction(i.value.value) for i in items if isinstance(i.value, Literal)]
    unit = lcm(*(c.denominator for c in constants))
    return unit if sum(abs(c) for c in constants) * unit < _WHOLE else None


def _divided(whole: Int64s, unit: int) -> Rationals:
    """Whole numbers divided by `unit`, as rationals."""
    values = whole.tolist()
    quotient = {v: Fraction(v, unit) for v in set(values)}  # np.unique would import numpy.ma
    out = np.empty(len(whole), object)
    out[:] = [quotient[v] for v in values]
    return out


def _number(found: bool | int | float | Fraction) -> Fraction:
    if isinstance(found, float) and not np.isfinite(found):
        raise UnsupportedError("a reward is infinite")
    return Fraction(found)


def _choice_rewards(
    model: BoundModel, found: ExplicitModel, items: Sequence[BoundReward]
) -> Rationals:
    """The transition reward of each choice."""
    rows: Rationals | None = None
    owner = found.matrix.state_of_row
    loops = np.zeros(len(found.states), np.bool_)
    loops[found.deadlocks] = True
    actions = (None, *model.actions)
    items = [item for item in items if not item.on_states]
    for action in dict.fromkeys(item.action for item in items):
        mine = found.choice_actions == actions.index(action) - 1
        mine &= ~loops[owner]
        earned = _rewards(model, found, [item for item in items if item.action == action])
        rows = full(found.matrix.rows, 0, rational=True) if rows is None else rows
        rows[mine] = earned[owner[mine]]
    return full(found.matrix.rows, 0, rational=True) if rows is None else rows
