"""The actions of the transitions of a chain, found by exploring each command for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import cast

import numpy as np

from symcheck.engines.base import Engine
from symcheck.engines.capabilities import HasBlocks, HasExploredModel, HasImportedStates
from symcheck.explicit.build import explore
from symcheck.explicit.model import ExplicitModel
from symcheck.matrices.contributions import Contributions, TransitionParts
from symcheck.matrices.numbers import rationals
from symcheck.matrices.rows import Int64s
from symcheck.options import Options
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import ModelType

__all__ = [
    "commands_apart",
    "contributions",
    "state_columns",
    "state_order",
    "transition_parts",
]


def state_columns(engine: Engine) -> list[Int64s]:
    """The values of each variable, int64[states] each, in the engine's order of states."""
    explicit = engine.capability(HasExploredModel)
    count = len(engine.model.variables)
    if explicit is not None:
        return [explicit.explored.states.column(i) for i in range(count)]
    flat = np.fromiter(
        (int(x) for state in engine.valuations(engine.all) for x in state),
        np.int64,
        engine.states * count,
    )
    return list(flat.reshape(engine.states, count).T)


def state_order(engine: Engine, columns: Sequence[Int64s] | None = None) -> Int64s | None:
    """The permutation that orders the states lexicographically; None if they are ordered.

    A model that was read keeps the order of its files.
    """
    if engine.capability(HasImportedStates) is not None:
        return None
    order = _sorted(engine, columns)
    return None if np.array_equal(order, np.arange(engine.states)) else order


def _sorted(engine: Engine, columns: Sequence[Int64s] | None = None) -> Int64s:
    columns = state_columns(engine) if columns is None else columns
    return np.lexsort(_packed(columns)[::-1]) if columns else np.arange(engine.states)


def _packed(columns: Sequence[Int64s]) -> list[Int64s]:
    """Fewer columns that order the states likewise: several are one number where that is small."""
    packed, room = list[Int64s](), 0
    for column in columns:
        low = int(column.min(initial=0))
        size = int(column.max(initial=0)) - low + 1
        if 0 < room * size < 1 << 62:
            packed[-1], room = packed[-1] * size + (column - low), room * size
        else:
            packed, room = [*packed, column], 0 if low < 0 else size
    return packed


def commands_apart(model: BoundModel) -> ExplicitModel:
    """The model explored as an MDP in which each command is a choice of its own.

    States are in lexicographic order.

    Raises:
        ModelFault: the model is faulty.
        ResourceError: a limit of time or memory was reached.
    """
    apart = replace(model, type=ModelType.with_properties(has_choices=True))
    return explore(apart, Options(check_sums=False))


def contributions(engine: Engine) -> Contributions | None:
    """What each action contributes to the transitions of a chain; None if no transition has one.

    States are numbered lexicographically; those of a model that was read, as in its files. The
    commands of a text are explored again, each for itself.

    Raises:
        ModelFault: the model is faulty.
        ResourceError: a limit of time or memory was reached.
    """
    model = engine.model
    if model.type.has_choices or not model.actions:
        return None
    imported = engine.capability(HasImportedStates)
    if imported is not None:
        return imported.contributions
    if model.builder is not None:
        return contributions(_as_read(model))
    return _rational(engine) if engine.is_rational else _doubles(model)


def _as_read(model: BoundModel) -> Engine:
    """The explicit engine of a model that was read."""
    assert model.builder is not None
    return cast(Engine, model.builder(Options(engine="explicit")))


def _doubles(model: BoundModel) -> Contributions:
    apart = commands_apart(model)
    matrix = apart.matrix
    assert matrix.groups is not None
    row = np.repeat(np.arange(matrix.rows), matrix.lengths)
    counts = np.diff(matrix.groups)
    state = np.repeat(np.arange(matrix.states), counts)[row]
    share = counts[state] if model.type.chooses_uniformly else 1
    return Contributions(
        state, matrix.indices.astype(np.int64), apart.choice_actions[row], matrix.data / share
    )


def _rational(engine: Engine) -> Contributions:
    from symcheck.semantics.interpreter import choices

    model, states = engine.model, list(engine.valuations(engine.all))
    number = {state: i for i, state in enumerate(states)}
    names = {name: i for i, name in enumerate(model.actions)}
    entries = [
        (i, number[target], names.get(choice.action or "", -1), Fraction(weight) / share)
        for i, state in enumerate(states)
        for enabled in [choices(model, state, check_sums=False)]
        for share in [len(enabled) if model.type.chooses_uniformly else 1]
        for choice in enabled
        for weight, target in choice.branches
    ]
    source, target, action, weight = zip(*entries, strict=True) if entries else ((), (), (), ())
    return Contributions(
        np.array(source, np.int64),
        np.array(target, np.int64),
        np.array(action, np.int32),
        rationals(weight),
    )


def transition_parts(engine: Engine) -> TransitionParts | None:
    """The transitions of a chain divided among their actions; None if no transition has one.

    Entries are those of the matrix of all states. A quotient and a product with an automaton have
    no actions.

    Raises:
        ModelFault: the model is faulty.
        ResourceError: a limit of time or memory was reached.
    """
    if engine.capability(HasBlocks) is not None:
        return None
    weights = contributions(engine)
    matrix = engine.system(engine.all).weights
    if weights is None:
        return None
    if engine.capability(HasImportedStates) is None:
        number = np.empty(engine.states, np.int64)
        builder = engine.model.builder
        order = slice(None) if builder is None else _sorted(_as_read(engine.model))
        number[order] = _sorted(engine)
        if len(weights.source) and weights.source.max() >= engine.states:
            return None
        weights = weights.renumbered(number)
    return TransitionParts.of(matrix, weights, engine.model.actions)
