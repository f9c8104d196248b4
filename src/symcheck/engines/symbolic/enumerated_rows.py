"""From diagrams to rows without a matrix diagram, for models that diagrams explore and do not compress.

Where the states take more than half a diagram node each, a matrix as blocks or as a diagram is larger than its rows, and
takes many times as long to make. Then the rows are listed from the states and the commands' own diagrams.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.materialized import WrittenEngine, stored_states
from symcheck.engines.symbolic.sparse import SparseEngine
from symcheck.explicit.model import ExplicitModel
from symcheck.options import Options
from symcheck.symbolic.checks import check_model
from symcheck.symbolic.matrix.enumerate_rows import enumerate_rows
from symcheck.symbolic.matrix.rewards import chain_rewards, state_rewards
from symcheck.symbolic.matrix.transitions import choice_counts, transitions
from symcheck.symbolic.model import LazySequence, StateSpace
from symcheck.syntax.ast import Expression, ModelType

if TYPE_CHECKING:
    from symcheck.dd.manager import Mtbdd

__all__ = ["ListedEngine", "listed"]

_NODES = 0.5  # per state, above which diagrams compress nothing
_MANY = 200_000  # nodes, below which any form of the matrix is soon made
_STATES = 10_000_000  # whose rows are listed


@dataclass(frozen=True)
class ListedEngine(WrittenEngine):
    """States and rows as arrays. Expressions are evaluated on the states: as diagrams they may read more than the rows."""

    transitions = ExplicitEngine.transitions  # the rows are there, and no matrix to count them on
    choices = ExplicitEngine.choices

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables."""
        return ExplicitEngine.where(self, expression)


def listed(space: StateSpace, options: Options, name: str) -> ListedEngine | None:
    """An engine over listed rows, under the name `name`; None where diagrams are the better form, or rows cannot be listed.

    Raises ModelFault where a reachable state breaks a rule.
    """
    nodes = space.states.node_count
    if (
        nodes <= max(_MANY, _NODES * space.count)
        or space.count > _STATES
        or not space.symbolic.encoding.in_declaration_order
    ):
        return None
    check_model(space, options)
    matrix = enumerate_rows(space)
    if matrix is None:
        return None
    source = SparseEngine(_diagrams(space, options), space)
    odd = source.diagrams.odd
    model = space.symbolic.model
    explored = ExplicitModel(
        model,
        stored_states(source),
        matrix,
        np.full(matrix.rows, -1, np.int32),
        np.flatnonzero(odd.to_mask(space.initial)),
        np.flatnonzero(odd.to_mask(space.deadlocks)),
        [odd.to_vector(source.diagrams.state_rewards[i]) for i in range(len(model.rewards))],
        [
            odd.to_vector(source.diagrams.transition_rewards[i][0])
            for i in range(len(model.rewards))
        ],
    )
    return ListedEngine(
        explored,
        name=f"{name} ({nodes:,} nodes for {space.count:,} states: rows are listed)",
        source=source,
    )


def _diagrams(space: StateSpace, options: Options) -> Diagrams:
    """What engines share; the matrix is made when somebody asks for it after all."""
    symbolic = space.symbolic
    numbers = choice_counts(space) if symbolic.model.type is ModelType.DTMC else None
    return Diagrams(
        symbolic.manager,
        symbolic.encoding.rows,
        symbolic.encoding.columns,
        space.states,
        symbolic.initial,
        space.deadlocks,
        space.deadlocks,
        symbolic.relations,
        LazySequence([partial(_matrix, space, options)]),
        None,
        {},
        state_rewards(space),
        chain_rewards(space, numbers),
    )


def _matrix(space: StateSpace, options: Options) -> Mtbdd:
    return transitions(space, options).roots[0]
