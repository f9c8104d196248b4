"""The engines of a model that was read state by state: explicit, rational, or with diagrams."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, assert_never

import numpy as np
from numpy.typing import NDArray

from symcheck.dd.manager import DiagramManager
from symcheck.dd.odd import Odd
from symcheck.engines.base import Engine, erased
from symcheck.errors import UnsupportedError
from symcheck.exchange.explicit_data import ExplicitData, ImportedEngine, imported_engine
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Int64s
from symcheck.options import Options
from symcheck.symbolic.encoding.translate import Translator
from symcheck.symbolic.encoding.variables import encode
from symcheck.symbolic.model import (
    ChoiceClass,
    Relation,
    StateSpace,
    SymbolicModel,
    Transitions,
)
from symcheck.symbolic.ordering.order import is_sifted, variable_order

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

__all__ = ["build_imported"]


def build_imported(given: ExplicitData, options: Options) -> Engine:
    """The engine that the options name; 'auto' is the explicit one.

    Raises:
        ModelFault: there is a deadlock, and `options.fix_deadlocks` is False.
        UnsupportedError: two states have the same values, and the engine has diagrams; or the
            engine is rational, and the probabilities do not sum to 1 exactly.
        ResourceError: a limit of memory or time was reached.
    """
    engine = imported_engine(given, partial(build_imported, given), options.fix_deadlocks)
    if options.exact:
        return engine.rational()
    match options.engine:
        case "auto" | "explicit" | "exact":
            return erased(engine)
        case "sparse":
            from symcheck.engines.symbolic.sparse import SparseEngine

            return erased(SparseEngine.of(_transitions(engine, options)))
        case "hybrid":
            from symcheck.engines.symbolic.hybrid import HybridEngine

            return erased(HybridEngine.of(_transitions(engine, options)))
        case "mtbdd":
            from symcheck.engines.symbolic.mtbdd import MtbddEngine

            return erased(MtbddEngine.of(_transitions(engine, options)))
        case _:
            assert_never(options.engine)


def _transitions(source: ImportedEngine, options: Options) -> Transitions:
    """The states and matrix of a model as diagrams.

    Choice class j of an MDP has the j-th choice of each state.

    Raises:
        UnsupportedError: two states have the same values, or the order asks for sifting.
        ResourceError: a limit of memory or time was reached.
    """
    model, explored = source.model, source.explored
    if is_sifted(model, options.order):
        raise UnsupportedError("-order sift needs a model in the PRISM language")
    encoding = encode(model, variable_order(model, options.order))
    manager = DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)
    manager.add_variables(encoding.bits)
    bits = np.empty((source.states, 0), np.uint8)
    for v in encoding.ordered:
        codes = explored.states.column(v.index) - v.low
        shifts = np.arange(v.width - 1, -1, -1)
        bits = np.hstack([bits, (codes[:, None] >> shifts & 1).astype(np.uint8)])
    order = _order(bits)
    if (np.diff(bits[order].astype(np.int8), axis=0) == 0).all(axis=1).any():
        raise UnsupportedError(
            "two states have the same values of the variables, and diagrams cannot tell them "
            "apart: use the explicit engine"
        )
    states = manager.bdd_from_rows(encoding.rows, bits[order])
    odd = Odd(manager, states, encoding.rows)

    def subset(members: Bools) -> Bdd:
        return odd.from_mask(members[order])

    def among(numbers: Int64s) -> Bdd:
        return subset(np.isin(np.arange(source.states), numbers))

    def function(values: Numbers) -> Mtbdd:
        return odd.from_vector(values[order])

    matrix, actions = explored.matrix, explored.choice_actions
    counts = np.ones(source.states, np.int64) if matrix.groups is None else np.diff(matrix.groups)
    owner = np.repeat(np.arange(source.states), counts)
    number = np.arange(matrix.rows) - np.repeat(np.cumsum(counts) - counts, counts)
    row = np.repeat(np.arange(matrix.rows), np.diff(matrix.indptr))
    pairs = np.stack([bits[owner[row]], bits[matrix.indices]], axis=2).reshape(len(row), -1)

    def part(entries: Bools) -> Mtbdd:
        chosen = pairs[entries]
        by = _order(chosen)
        return manager.mtbdd_from_rows(encoding.bits, chosen[by], matrix.data[entries][by])

    def per_class(rewards: Numbers) -> tuple[Mtbdd, ...]:
        spread = np.zeros((int(counts.max()), source.states))
        spread[number, owner] = rewards
        return tuple(map(function, spread))

    classes = range(int(counts.max()))
    choices = tuple(ChoiceClass(part(number[row] == j), subset(counts > j)) for j in classes)
    names = (*model.actions, None)
    sets = {
        (j, names[a]): among(owner[(number == j) & (actions == a)])
        for j in classes
        for a in np.unique(actions[number == j]).tolist()
    }
    deadlocks = among(explored.deadlocks)
    steps = manager.disjunction([c.matrix.to_bdd() for c in choices]) - deadlocks
    everything = tuple(range(len(encoding.variables)))
    transition = manager.transition(encoding.rows, encoding.columns)
    translator = Translator(manager, encoding)
    for mark, members in source.members.items():
        translator.define(mark, subset(members))
    symbolic = SymbolicModel(
        model,
        manager,
        encoding,
        translator,
        among(explored.initial),
        (),
        (Relation(steps, transition, 0, (), everything),),
    )
    chain = matrix.groups is None
    return Transitions(
        StateSpace(symbolic, states, deadlocks, source.states, "imported", 0.0, ()),
        choices[0].matrix if chain else None,
        () if chain else choices,
        {} if chain else sets,
        [function(r) for r in explored.state_rewards],
        [per_class(r) for r in explored.choice_rewards],
        deadlocks,
    )


def _order(bits: NDArray[np.uint8]) -> Int64s:
    """The permutation that sorts rows of bits lexicographically."""
    keys = [bits[:, i] for i in reversed(range(bits.shape[1]))]
    return np.lexsort(keys) if keys else np.arange(len(bits))
