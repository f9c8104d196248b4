"""A model that was read state by state as diagrams, for the symbolic engines."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from symcheck.dd.manager import DiagramManager
from symcheck.dd.odd import Odd
from symcheck.engines.base import Engine, erased
from symcheck.engines.symbolic.engine import SymbolicEngine
from symcheck.engines.symbolic.forms import HybridEngine, MtbddEngine, SparseEngine
from symcheck.errors import UnsupportedError
from symcheck.explicit.explored import RACE, ExploredModel
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools
from symcheck.options import Options
from symcheck.symbolic.encoding.translate import Translator
from symcheck.symbolic.encoding.variables import encode
from symcheck.symbolic.model import ChoiceClass, Relation, StateSpace, SymbolicModel, Transitions
from symcheck.symbolic.ordering.order import is_sifted, variable_order
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd, Mtbdd

__all__ = ["symbolic_engine"]

_ENGINES: Mapping[str, type[SymbolicEngine]] = {
    "sparse": SparseEngine,
    "hybrid": HybridEngine,
    "mtbdd": MtbddEngine,
}


def symbolic_engine(
    explored: ExploredModel, labels: Mapping[Expression, Bools], options: Options
) -> Engine:
    """The symbolic engine that the options name.

    Choice class j of an MDP has the j-th choice of each state.

    Args:
        explored: states and rows.
        labels: expressions that stand for sets of states, bool[states] each.
        options: the engine, limits, and the order of the variables.

    Raises:
        UnsupportedError: two states have the same values, or the order asks for sifting.
        ResourceError: a limit of memory or time was reached.
    """
    model, matrix, n = explored.model, explored.matrix, len(explored.states)
    if is_sifted(model, options.order):
        raise UnsupportedError("-order sift needs a model in the PRISM language")
    encoding = encode(model, variable_order(model, options.order))
    manager = DiagramManager(max_memory=options.max_memory, time_limit=options.time_limit)
    manager.add_variables(encoding.bits)
    columns = [
        explored.states.column(v.index) - v.low >> exponent & 1
        for v in encoding.ordered
        for exponent in range(v.width - 1, -1, -1)
    ]
    bits = np.array(columns, np.uint8).reshape(-1, n).T
    order = np.lexsort([np.zeros(n), *bits.T[::-1]])
    ordered = bits[order]
    if (ordered[1:] == ordered[:-1]).all(axis=1).any():
        raise UnsupportedError(
            "two states have the same values of the variables, and diagrams cannot tell them "
            "apart: use the explicit engine"
        )
    states = manager.bdd_from_rows(encoding.rows, ordered)
    odd = Odd(manager, states, encoding.rows)

    def subset(members: Bools) -> Bdd:
        return odd.from_mask(members[order])

    def among(numbers: Numbers) -> Bdd:
        return subset(np.isin(np.arange(n), numbers))

    def function(values: Numbers) -> Mtbdd:
        return odd.from_vector(values[order])

    groups = np.arange(n + 1) if matrix.groups is None else matrix.groups
    owner, row = matrix.state_of_row, matrix.row_of_entry
    number = np.arange(matrix.rows) - groups[owner]
    if model.type.immediate_choices:  # the first class has the rates
        number = np.where(explored.choice_actions == RACE, 0, number + 1)
    pairs = np.stack([bits[owner[row]], bits[matrix.indices]], axis=2).reshape(len(row), -1)
    by = np.lexsort([row, *pairs.T[::-1]])
    classes = []
    for j in range(int(number.max()) + 1):
        chosen = by[number[row[by]] == j]
        part = manager.mtbdd_from_rows(encoding.bits, pairs[chosen], matrix.data[chosen])
        classes.append(ChoiceClass(part, among(owner[number == j])))
    actions = {
        (j, (*model.actions, None)[max(a, -1)]): among(
            owner[(number == j) & (explored.choice_actions == a)]
        )
        for j, a in set(zip(number.tolist(), explored.choice_actions.tolist(), strict=True))
    }

    def per_class(rewards: Numbers) -> tuple[Mtbdd, ...]:
        spread = np.zeros((len(classes), n))
        spread[number, owner] = rewards
        return tuple(map(function, spread))

    deadlocks = among(explored.deadlocks)
    translator = Translator(manager, encoding)
    for label, members in labels.items():
        translator.define(label, subset(members))
    relation = Relation(
        manager.disjunction([c.matrix.to_bdd() for c in classes]) - deadlocks,
        manager.transition(encoding.rows, encoding.columns),
        0,
        (),
        tuple(range(len(encoding.variables))),
    )
    initial = among(explored.initial)
    symbolic = SymbolicModel(model, manager, encoding, translator, initial, (), (relation,))
    chain = matrix.groups is None
    return erased(
        _ENGINES[options.engine].of(
            Transitions(
                StateSpace(symbolic, states, deadlocks, n, "imported", 0.0, ()),
                classes[0].matrix if chain else None,
                () if chain else tuple(classes),
                {} if chain else actions,
                [function(r) for r in explored.state_rewards],
                [per_class(r) for r in explored.choice_rewards],
                deadlocks,
            )
        )
    )
