"""Randomised strategies of multi-objective queries, with the memory that the objectives need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symcheck.check.context import Context
from symcheck.check.multi_objective.query import check_supported, solve_query
from symcheck.check.strategies.to_explicit import rows_engine, to_explicit
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.finite_memory import Decisions, finite_memory_strategy
from symcheck.engines.explicit.less_memory import without_idle_memory
from symcheck.engines.explicit.product import ProductModel
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Int64s
from symcheck.numerics.multi_objective.randomised import ModeDecisions, strategy_of_flow
from symcheck.syntax.ast import MultiObjective

__all__ = ["multi_strategies"]


def multi_strategies(context: Context, formula: MultiObjective) -> tuple[Strategy, ...]:
    """Strategies that attain the result of a multi-objective query from the initial state.

    They choose at random, and remember what the objectives need: states of automata, numbers of
    steps, and whether a run has settled, as far as decisions depend on it.

    Returns:
        One strategy, or one for each vertex of a Pareto front, in their order.

    Raises:
        UnsupportedError: no strategy with finite memory attains the result.
    """
    check_supported(context, formula)
    context = to_explicit(context)
    query = solve_query(context, formula).query
    assert query is not None
    solutions = list(query.solutions())
    if query.connected is None or not solutions:
        raise UnsupportedError("no strategy satisfies the bounds, or some rewards are infinite")
    base = rows_engine(context)
    pairs = _Pairs(rows_engine(replace(context, engine=query.engine)))
    flow = query.connected
    return tuple(pairs.strategy(base, strategy_of_flow(flow, x), flow.initial) for x in solutions)


class _Pairs:
    """The states of a product of products, as pairs of a state of the model and a memory.

    state, rows: what each state and each row of the product comes from. automata: the states of the
    automata, int64[states, products].
    """

    def __init__(self, product: ExplicitEngine) -> None:
        self.matrix = product.matrix
        self.state: Int64s = np.arange(self.matrix.states)
        self.rows: Int64s = np.arange(self.matrix.rows)
        automata, explored = [], product.explored
        while isinstance(explored, ProductModel):
            automata.append(explored.automaton[self.state])
            self.rows = explored.rows[self.rows].astype(np.int64)
            self.state = explored.state[self.state].astype(np.int64)
            explored = explored.base.explored
        shape = len(automata), self.matrix.states
        self.automata = np.array(automata, np.int64).reshape(shape).T

    def strategy(self, base: ExplicitEngine, modes: ModeDecisions, initial: int) -> Strategy:
        """The strategy on the model, with a memory for automata and mode."""
        after = self.matrix.indices[self.matrix.indptr[modes.row]]
        keys = np.concatenate(
            (
                np.column_stack((self.automata[[initial]], [0])),
                np.column_stack((self.automata[modes.state], modes.mode)),
                np.column_stack((self.automata[after], modes.following)),
            )
        )
        _, memory = np.unique(keys, axis=0, return_inverse=True)
        memory = memory.ravel()
        # The memory begins with 0.
        memory = np.where(memory == memory[0], 0, np.where(memory == 0, memory[0], memory))
        count = len(modes.state)
        decisions = Decisions(
            self.state[modes.state],
            memory[1 : 1 + count],
            self.rows[modes.row],
            modes.share,
            memory[1 + count :],
        )
        return without_idle_memory(finite_memory_strategy(base, decisions, 0))
