"""A partially observed model as the exploration of beliefs reads it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import reduce
from operator import or_

import numpy as np

from symcheck.check.context import Context
from symcheck.check.exact_twin import exact_twin
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import Diagnostic, InputError, ModelFault, UnsupportedError
from symcheck.matrices.numbers import Rationals, doubles, rationals
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix, per_row
from symcheck.numerics.beliefs.observed import Observed, aligned_rows
from symcheck.semantics.features import class_name
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import Expression
from symcheck.syntax.traversal import nodes

__all__ = ["ObservedModel", "kept", "observations", "observed_model", "require_observable"]


@dataclass(frozen=True, eq=False)
class ObservedModel:
    """A model with its observations.

    Attributes:
        engine: the rows of the model. rows: those of each state in the order of the actions of its
            observation, int64[rows].
        arrays: the model for the exploration of beliefs.
        numbers: an engine with the same states that has rationals, if there is one.
    """

    engine: ExplicitEngine = field(repr=False)
    rows: Int64s = field(repr=False)
    arrays: Observed = field(repr=False)
    numbers: ExplicitEngine = field(repr=False)

    def earned(self, reward: Reward) -> Rationals:
        """What each row of `arrays` earns, in expectation.

        Raises UnsupportedError if that is negative or infinite.
        """
        states, rows = self.numbers.rewards(reward)
        total = (per_row(self.numbers.matrix.groups, states) + rows)[self.arrays.origin]
        if len(total) and not (total.min() >= 0 and total.max() < np.inf):
            raise UnsupportedError(
                "negative and infinite rewards are not supported for "
                f"{class_name(self.engine.model)}"
            )
        return rationals(total.tolist())


def kept(context: Context, what: str) -> object:
    """What the log of a check has last kept for an engine under a name; None: nothing."""
    found = (v for key, v in reversed(context.log.kept) if key == (what, id(context.engine)))
    return next(found, None)


def observations(engine: ExplicitEngine) -> Int32s:
    """The number of the observation of each state, int32[states], from 0."""
    n = engine.states
    columns = [
        np.broadcast_to(np.asarray(engine.explored.evaluate(e)), n)
        for e in engine.model.observables
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
    known = kept(context, "observed")
    if isinstance(known, ObservedModel):
        return known
    engine = context.engine.capability(ExplicitEngine)
    assert engine is not None, "only explicit engines are built for these models"
    matrix, seen = engine.matrix, observations(engine)
    assert matrix.groups is not None
    rows, differing = aligned_rows(matrix.groups, seen, engine.explored.choice_actions)
    if differing is not None:
        raise _different_actions(engine, *differing)
    numbers, aligned = engine, rows
    if not engine.is_rational:
        twin = _twin(context)
        exact = replace(matrix, data=rationals(matrix.data.tolist()))
        if twin is not None and twin.matrix.groups is not None:
            order, _ = aligned_rows(twin.matrix.groups, seen, twin.explored.choice_actions)
            if _are_alike(twin.matrix.choose(order), matrix.choose(rows)):
                numbers, aligned, exact = twin, order, twin.matrix
        matrix = exact
    found = ObservedModel(engine, rows, Observed.of(matrix, aligned, seen), numbers)
    context.log.kept.append((("observed", id(context.engine)), found))
    return found


def _twin(context: Context) -> ExplicitEngine | None:
    """The model in rational arithmetic; None where that is not possible."""
    try:
        return exact_twin(context).engine.capability(ExplicitEngine)
    except UnsupportedError:
        return None


def _are_alike(exact: SparseMatrix, rounded: SparseMatrix) -> bool:
    """Whether the rows of two matrices are the same, up to rounding."""
    return (
        np.array_equal(exact.indptr, rounded.indptr)
        and np.array_equal(exact.indices, rounded.indices)
        and np.allclose(doubles(exact.data), rounded.data, rtol=1e-9, atol=0.0)
    )


def _different_actions(engine: ExplicitEngine, one: int, other: int) -> ModelFault:
    groups, names = engine.matrix.groups, (*engine.model.actions, "")
    assert groups is not None
    actions = engine.explored.choice_actions
    texts = []
    for state in (one, other):
        listed = sorted(
            f"[{names[a]}]" for a in actions[groups[state] : groups[state + 1]].tolist()
        )
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


def require_observable(model: ObservedModel, formula: Expression, members: Bools) -> None:
    """Require that observations tell the states of a formula, bool[states], from the others.

    Raises InputError if they do not.
    """
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
                reduce(or_, (node.span for node in nodes(formula))),
                "observable",
                "ask about what is observed; if a strategy sees this, the model declares it: "
                'observable "name" = condition;',
            )
        )
