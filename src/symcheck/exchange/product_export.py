"""The product of a model with the automaton of an LTL property, as arrays for export."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from symcheck.check.context import Context
from symcheck.check.omega_regular.ltl import labelled_automaton
from symcheck.check.state_formulas import query_of
from symcheck.check.strategies.to_explicit import to_explicit
from symcheck.direction import Direction
from symcheck.engines.base import Engine
from symcheck.engines.transition_actions import state_columns, state_order
from symcheck.errors import UnsupportedError
from symcheck.exchange.explicit_export import ExplicitExport, explicit_export
from symcheck.matrices.rows import Int32s, Int64s, SparseMatrix, spans, starts_of
from symcheck.options import Options
from symcheck.semantics.model import Variable
from symcheck.semantics.path_formulas import LtlPathFormula
from symcheck.semantics.query import PathProbability, Query
from symcheck.syntax.ast import AnyMeasure, Expression, Type

__all__ = ["product_export"]

_AUTOMATON = "_da"
"""The variable of the automaton's state, as PRISM calls it."""


def product_export(
    engine: Engine, formula: Expression, options: Options, labels: Mapping[str, Expression]
) -> ExplicitExport:
    """The product of a model with the automaton of a property.

    A state (q, s) says that the automaton has read the labels of the path up to s, that of s
    included. The states are those that are reached from the initial states, ordered by automaton
    state first.

    Args:
        engine: the engine of the model; the rows of diagrams are listed.
        formula: the bound property.
        options: those of the model.
        labels: those that the property may refer to.

    Raises:
        UnsupportedError: the property is checked without an automaton.
    """
    context = to_explicit(Context(engine, options, labels, {}))
    match query_of(context, formula) if isinstance(formula, AnyMeasure) else None:
        case Query(PathProbability(LtlPathFormula() as path), direction):
            # The least probability is that of the negation, subtracted from 1.
            path = replace(path, negative=path.negative is not (direction is Direction.MIN))
        case _:
            raise UnsupportedError(
                "this property is checked without an automaton, so there is no product",
                hint="P=? [ G F a ], for example, has one",
            )
    sets, automaton = labelled_automaton(context, path)
    letters = np.zeros(context.engine.states, np.int64)
    for i, states in enumerate(sets):
        letters[context.engine.to_bools(states)] |= 1 << i
    whole = explicit_export(context.engine)
    following = np.asarray(automaton.table, np.int64)
    order = _order(context.engine)
    return _product(whole, following, letters[order], automaton.initial)


def _product(
    model: ExplicitExport, following: Int64s, letters: Int64s, start: int
) -> ExplicitExport:
    """The reachable part of the product. following: the next automaton state, [states, letters]."""
    n, m = model.n, model.matrix
    entry_of_state = m.indptr if m.groups is None else m.indptr[m.groups]
    after = following[:, letters]  # [automaton states, model states]
    initial = np.flatnonzero(model.labels["init"])
    frontier = after[start, initial] * n + initial
    seen = np.zeros(len(following) * n, bool)
    seen[frontier] = True
    while len(frontier):
        second, first = np.divmod(frontier, n)
        counts = entry_of_state[first + 1] - entry_of_state[first]
        targets = m.indices[spans(entry_of_state[first], entry_of_state[first + 1])]
        pairs = np.unique(after[np.repeat(second, counts), targets] * n + targets)
        frontier = pairs[~seen[pairs]]
        seen[frontier] = True
    pairs = np.flatnonzero(seen)
    second, first = np.divmod(pairs, n)
    number = np.full(len(seen), -1, np.int32)
    number[pairs] = np.arange(len(pairs), dtype=np.int32)
    groups = np.arange(n + 1) if m.groups is None else m.groups
    rows = spans(groups[first], groups[first + 1])
    sizes = groups[first + 1] - groups[first]
    lengths = m.lengths[rows]
    entries = spans(m.indptr[rows], m.indptr[rows + 1])
    targets = m.indices[entries]
    automaton = np.repeat(np.repeat(second, sizes), lengths)
    matrix = SparseMatrix(
        starts_of(lengths),
        number[after[automaton, targets] * n + targets],
        m.data[entries],
        len(pairs),
        None if m.groups is None else starts_of(sizes),
    )
    last = len(following) - 1
    name = _AUTOMATON
    while any(v.name == name for v in model.variables):
        name = f"_{name}"
    variable = Variable(name, Type.INT, 0, last, None, None)
    initial_pairs = np.zeros(len(seen), bool)
    initial_pairs[after[start, initial] * n + initial] = True
    row_actions: Int32s | None = None if model.row_actions is None else model.row_actions[rows]
    return ExplicitExport(
        model.type,
        (variable, *model.variables),
        [second, *(c[first] for c in model.columns)],
        matrix,
        model.values[entries],
        model.actions if model.type.has_choices else (),
        row_actions,
        {"init": initial_pairs[pairs], "deadlock": model.labels["deadlock"][first]},
        [],
    )


def _order(engine: Engine) -> Int64s:
    """The states of the engine in the order of an export."""
    order = state_order(engine, state_columns(engine))
    return np.arange(engine.states) if order is None else order
