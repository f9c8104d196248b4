"""A partially observed model as the exploration of beliefs reads it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from symcheck.check.context import Context
from symcheck.check.exact_twin import exact_twin
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import Diagnostic, InputError, ModelFault, UnsupportedError
from symcheck.matrices.numbers import Numbers, rationals
from symcheck.matrices.rows import Bools, Int32s, Int64s, per_row
from symcheck.numerics.beliefs.observed import Observed, aligned_rows
from symcheck.semantics.rewards import Reward

__all__ = ["ObservedModel", "observations", "observed_model", "require_observable"]


@dataclass(frozen=True, eq=False)
class ObservedModel:
    """A model with its observations.

    Attributes:
        engine: the rows of the model.
        arrays: the model for the exploration of beliefs.
        numbers: an engine with the same states that has rationals, if there is one.
    """

    engine: ExplicitEngine = field(repr=False)
    arrays: Observed = field(repr=False)
    numbers: ExplicitEngine = field(repr=False)

    def earned(self, reward: Reward) -> Numbers:
        """What each row of `arrays` earns, in expectation.

        Raises UnsupportedError if that is negative or infinite.
        """
        states, rows = self.numbers.rewards(reward)
        total = (per_row(self.numbers.matrix.groups, states) + rows)[self.arrays.origin]
        if len(total) and not (total.min() >= 0 and total.max() < np.inf):
            raise UnsupportedError(
                f"negative and infinite rewards are not supported for {self.engine.model.type.called}"
            )
        return rationals(total.tolist())


def observations(engine: ExplicitEngine) -> Int32s:
    """The number of the observation of each state, int32[states], from 0."""
    n = engine.states
    columns = [
        np.broadcast_to(np.asarray(engine.explored.evaluate(e)), n) for e in engine.model.observables
    ]
    codes = np.zeros(n, np.int64)
    for column in columns:
        _, code = np.unique(column, return_inverse=True)
        _, codes = np.unique(codes * n + code, return_inverse=True)
    return codes.astype(np.int32)


def observed_model(context: Context) -> ObservedModel:
    """The model of a context, with its observations.

    Raises:
        ModelFault: two states with the same observation do not have the same actions.
    """
    for known, value in context.log.kept:
        if known == ("observed", id(context.engine)):
            assert isinstance(value, ObservedModel)
            return value
    engine = context.engine.capability(ExplicitEngine)
    assert engine is not None, "only explicit engines are built for these models"
    numbers = engine
    if not engine.is_rational:
        try:
            twin = exact_twin(context).engine.capability(ExplicitEngine)
        except UnsupportedError:  # its doubles are taken as they are
            twin = None
        numbers = twin or engine
    matrix = numbers.matrix
    if not matrix.is_rational:
        matrix = type(matrix)(
            matrix.indptr, matrix.indices, rationals(matrix.data.tolist()), matrix.columns, matrix.groups
        )
    assert matrix.groups is not None
    seen = observations(engine)
    rows, differing = aligned_rows(matrix.groups, seen, numbers.explored.choice_actions)
    if differing is not None:
        raise _different_actions(numbers, *differing)
    found = ObservedModel(engine, Observed.of(matrix, rows, seen), numbers)
    context.log.kept.append((("observed", id(context.engine)), found))
    return found


def _different_actions(engine: ExplicitEngine, one: int, other: int) -> ModelFault:
    groups, names = engine.matrix.groups, (*engine.model.actions, "")
    assert groups is not None
    actions = engine.explored.choice_actions
    texts = []
    for state in (one, other):
        listed = sorted(f"[{names[a]}]" for a in actions[groups[state] : groups[state + 1]].tolist())
        texts.append(f"{_shown(engine, state)} has {' '.join(listed)}")
    return ModelFault(
        Diagnostic(
            "two states with the same observation have different actions: " + ", ".join(texts),
            code="observed-actions",
            hint="a strategy chooses by the observation: make the difference observable, or give "
            "both states the same actions",
        )
    )


def _shown(engine: ExplicitEngine, state: int) -> str:
    from symcheck.semantics.state_faults import describe_state

    values = next(engine.explored.states.valuations(np.array([state])))
    return describe_state(engine.model.variables, values)


def require_observable(model: ObservedModel, states: StateSet, engine: Engine) -> Bools:
    """A set of states that observations tell from the others, bool[states].

    Raises InputError if they do not.
    """
    members = engine.to_bools(states)
    seen = model.arrays.observation
    inside = np.zeros(int(seen.max(initial=0)) + 1, np.bool_)
    inside[seen[members]] = True
    mixed: Int64s = np.flatnonzero(inside[seen] & ~members)
    if len(mixed):
        other = int(mixed[0])
        one = int(np.flatnonzero(members & (seen == seen[other]))[0])
        raise InputError(
            Diagnostic(
                "the states that a property refers to must be observable: "
                f"{_shown(model.engine, one)} is among them, {_shown(model.engine, other)} is not, "
                "and they have the same observation",
                code="observable",
            )
        )
    return members
