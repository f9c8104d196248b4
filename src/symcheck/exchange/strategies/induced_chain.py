"""The Markov chain that a strategy induces, as a model of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symcheck.api import Model
from symcheck.check.result import Result
from symcheck.engines.base import erased
from symcheck.engines.explicit.strategy import Strategy
from symcheck.engines.transition_actions import state_columns
from symcheck.errors import UsageError
from symcheck.exchange.api_io import explicit_model
from symcheck.exchange.explicit_data import ExplicitData, ExplicitRewards
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.rows import SparseMatrix, spans, starts_of
from symcheck.syntax.ast import ModelType, Type

__all__ = ["induced_chain", "induced_data"]


def induced_chain(model: Model, strategy: Strategy | Result, *, reach: bool = True) -> Model:
    """The Markov chain of a model under a strategy: a DTMC with its variables, labels and rewards.

    The memory of a strategy is a further variable, `memory`. States in which the strategy does not
    matter take the choice that it has there. The chain is checked, sampled, drawn and exported as
    every model.

    Args:
        model: the MDP.
        strategy: a strategy of this model, or a result that has one.
        reach: only the states that are reached; otherwise all states, which have their numbers.

    Raises:
        UsageError: the result has no strategy.

    Examples:
        >>> import symcheck
        >>> text = "mdp module m x:[0..2]; [a] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [b] x=0 -> (x'=2);"
        >>> model = symcheck.loads(text + " endmodule", strategy=True)
        >>> best = model.check("Pmax=? [ F x=1 ]").strategy
        >>> symcheck.induced_chain(model, best).check("P=? [ F x=2 ]").value
        0.5
    """
    found = strategy.strategy if isinstance(strategy, Result) else strategy
    if found is None:
        raise UsageError(
            "the result has no strategy\n"
            "  hint: check Pmin, Pmax, Rmin or Rmax of an MDP with the option strategy=True"
        )
    data = replace(induced_data(found, reach=reach), names=model.instantiated())
    chain = explicit_model(data, replace(model.options, strategy=False, fairness=False))
    return replace(chain, given_constants=model.given_constants)


def induced_data(
    strategy: Strategy, *, reach: bool = False, restrict: bool = False
) -> ExplicitData:
    """The arrays of the induced chain.

    Args:
        strategy: the strategy; its states become those of the chain.
        reach: only the states that are reached, numbered anew.
        restrict: an MDP with one choice per state instead of a DTMC.
    """
    engine, base = strategy.engine, strategy.base
    explored, model = engine.explored, engine.model
    kept = np.flatnonzero(strategy.reachable) if reach else np.arange(engine.states)
    origin, n = strategy.origin[kept], len(kept)
    rows = strategy.rows[kept]
    whole = engine.matrix
    place = np.full(engine.states, -1, np.int32)
    place[kept] = np.arange(n, dtype=np.int32)
    entries = spans(whole.indptr[:-1][rows], whole.indptr[1:][rows])
    matrix = SparseMatrix(
        starts_of(whole.lengths[rows]),
        place[whole.indices[entries]],
        whole.data[entries],
        n,
        np.arange(n + 1) if restrict else None,
    )
    columns = [
        (v.name, v.type, column[origin])
        for v, column in zip(model.variables, state_columns(erased(base)), strict=True)
    ]
    if strategy.memory is not None:
        name = "memory"
        while any(name == known for known, _, _ in columns):
            name += "_"
        columns.append((name, Type.INT, strategy.memory[kept].astype(np.int64)))
    labels = {
        name: base.to_bools(base.where(expression))[origin]
        for name, expression in model.labels.items()
    }
    labels |= {
        "init": engine.to_bools(engine.initial)[kept],
        "deadlock": engine.to_bools(engine.deadlocks)[kept],
    }
    actions = explored.choice_actions[rows].astype(np.int32)
    source = np.repeat(np.arange(n), matrix.lengths)
    target = matrix.indices.astype(np.int64)
    of_actions = Contributions(source, target, actions[source], matrix.data)
    return ExplicitData(
        ModelType.MDP if restrict else ModelType.DTMC,
        columns,
        matrix,
        model.actions,
        actions,
        labels,
        [
            ExplicitRewards(structure.name, states[kept], choices[rows])
            for structure, states, choices in zip(
                model.rewards, explored.state_rewards, explored.choice_rewards, strict=True
            )
        ],
        None if restrict else of_actions,
    )
