"""An engine over rows that are enumerated from diagrams without a diagram of the matrix.

It is for models that diagrams can explore but do not compress. With more than half a diagram node
per state, a matrix as blocks or as a diagram is larger than its rows, and takes many times as long
to make. The rows are then enumerated from the states and the diagrams of the commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from symcheck.engines import tuning
from symcheck.engines.explicit.array_values import ArraySet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.forms import SparseEngine
from symcheck.engines.symbolic.materialized import MaterializedEngine, stored_states
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

__all__ = ["EnumeratedEngine", "enumerated_engine"]


@dataclass(frozen=True)
class EnumeratedEngine(MaterializedEngine):
    """States and rows as arrays; expressions are evaluated on the states.

    The diagram of an expression may be larger than the rows.
    """

    transitions = ExplicitEngine.transitions  # counted on the rows: there is no matrix diagram
    choices = ExplicitEngine.choices

    def where(self, expression: Expression) -> ArraySet:
        """The states that satisfy a boolean expression over the variables."""
        return ExplicitEngine.where(self, expression)


def enumerated_engine(space: StateSpace, options: Options, name: str) -> EnumeratedEngine | None:
    """An engine over enumerated rows.

    Args:
        space: the reachable states.
        options: limits, and the treatment of deadlocks.
        name: the first word of the engine's name.

    Returns:
        The engine; None if the diagrams compress the states, or the rows cannot be enumerated.

    Raises:
        ModelFault: the model has a fault in some reachable state.
    """
    nodes = space.states.node_count
    if (
        nodes <= max(tuning.SMALL_DIAGRAM_NODES, tuning.MAX_NODES_PER_STATE * space.count)
        or space.count > tuning.ENUMERATED_STATES
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
    return EnumeratedEngine(
        explored,
        name=f"{name} ({nodes:,} nodes for {space.count:,} states: rows are enumerated)",
        source=source,
    )


def _diagrams(space: StateSpace, options: Options) -> Diagrams:
    """The model as diagrams; the matrix is built on first use only."""
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
