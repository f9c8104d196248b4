"""The Markov chain that a strategy induces, as a model of its own."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np

from symcheck.api.model import Model
from symcheck.check.result import Result
from symcheck.engines.base import erased
from symcheck.engines.explicit.intervals import IntervalEngine
from symcheck.engines.explicit.strategy import Strategy
from symcheck.engines.transition_actions import state_columns
from symcheck.errors import UnsupportedError, UsageError
from symcheck.exchange.api_io import explicit_model
from symcheck.exchange.explicit_data import ExplicitData, ExplicitRewards
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Int64s, spans, starts_of
from symcheck.semantics.features import class_name
from symcheck.semantics.model import BoundModel, Delays
from symcheck.syntax.ast import ModelType, Type, Weights
from symcheck.syntax.traversal import names

__all__ = ["induced_chain", "induced_data"]


def induced_chain(model: Model, strategy: Strategy | Result, *, reach: bool = True) -> Model:
    """The Markov chain of a model under a strategy: a DTMC with its variables, labels and rewards.

    The memory of a strategy is a further variable, `memory`. Where a strategy chooses at random,
    the transitions of its choices are added, and a transition reward is their mean. States in which
    the strategy does not matter take the choice that it has there. The chain is checked, sampled,
    drawn and exported as every model.

    A strategy from a file leaves the intervals of a model to nature: its chain has them. Steps of
    the chain of a timed automaton are delays, and what counts them as time is refused.

    Args:
        model: the MDP.
        strategy: a strategy of this model, or a result that has one.
        reach: only the states that are reached; otherwise all states, which have their numbers.

    Raises:
        NoStrategyError: the result has no strategy, or several.
        UsageError: it is no strategy.

    Examples:
        >>> import symcheck
        >>> text = "mdp module m x:[0..2]; [a] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [b] x=0 -> (x'=2);"
        >>> model = symcheck.loads(text + " endmodule", strategy=True)
        >>> best = model.check("Pmax=? [ F x=1 ]").strategy
        >>> symcheck.induced_chain(model, best).check("P=? [ F x=2 ]").value
        0.5
    """
    chosen = strategy.strategy if isinstance(strategy, Result) else strategy
    if not isinstance(cast(object, chosen), Strategy):
        raise UsageError(
            f"a strategy is expected, or a result that has one, not {chosen!r}",
            hint="model.check(…, with the option strategy=True).strategy",
        )
    data = replace(induced_data(chosen, reach=reach), names=model.instantiated())
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
    if model.type.continuous_time or model.weights is Weights.PARAMETERS:
        raise UnsupportedError(
            f"the chains of strategies are not available for {class_name(model)}"
        )
    intervals = engine.capability(IntervalEngine)  # of nature, unless it has chosen
    if intervals is not None and strategy.weights is not None:
        raise UnsupportedError(
            "the chain of a strategy that chooses at random is not available for models with "
            "intervals of probabilities"
        )
    kept = np.flatnonzero(strategy.reachable) if reach else np.arange(engine.states)
    origin, n = strategy.origin[kept], len(kept)
    number = np.full(engine.states, -1, np.int32)
    number[kept] = np.arange(n, dtype=np.int32)
    groups = np.arange(n + 1) if restrict else None
    matrix = strategy.induced.select(kept, number, n, groups)
    lower: Numbers | None = None
    if intervals is not None:
        ends = replace(engine.weights, data=intervals.lower).choose(strategy.taken)
        lower = ends.select(kept, number, n, groups).data
    counts = np.diff(strategy.starts)[kept]
    taken = spans(strategy.starts[:-1][kept], strategy.starts[1:][kept])
    rows, shares = strategy.taken[taken], strategy.shares[taken]
    parts = engine.matrix.choose(rows)
    columns = [
        (v.name, v.type, column[origin])
        for v, column in zip(model.variables, state_columns(erased(base)), strict=True)
    ]
    if strategy.memory is not None:
        name = "memory"
        while any(name == known for known, _, _ in columns):
            name += "_"
        columns.append((name, Type.INT, strategy.memory[kept].astype(np.int64)))
    delays, capped = _delays(model)
    labels = {
        name: base.to_bools(base.where(expression))[origin]
        for name, expression in model.labels.items()
        if not names(expression) & capped
    }
    labels |= {
        "init": engine.to_bools(engine.initial)[kept],
        "deadlock": engine.to_bools(engine.deadlocks)[kept],
    }
    actions = explored.choice_actions[rows].astype(np.int32)
    source = np.repeat(np.repeat(np.arange(n), counts), parts.lengths)
    weights = parts.data * np.repeat(shares, parts.lengths)
    target = number[parts.indices].astype(np.int64)
    of_actions = Contributions(source, target, np.repeat(actions, parts.lengths), weights)
    first = starts_of(counts)[:-1]
    common = np.minimum.reduceat(actions, first) == np.maximum.reduceat(actions, first)
    rewards = []
    for structure, states, choices in zip(
        model.rewards, explored.state_rewards, explored.choice_rewards, strict=True
    ):
        paid = mean = choices[rows]
        entries: Numbers | None = None
        if strategy.weights is not None:
            mean = _sums(paid * shares, starts_of(counts))
            if (paid != np.repeat(mean, counts)).any():
                earned = of_actions._replace(weight=weights * np.repeat(paid, parts.lengths))
                entries = earned.totals(matrix) / matrix.data
        rewards.append(ExplicitRewards(structure.name, states[kept], mean, entries))
    return ExplicitData(
        ModelType.with_properties(has_choices=restrict),
        columns,
        matrix,
        model.actions,
        np.where(common, actions[first], -1).astype(np.int32),
        labels,
        rewards,
        None if restrict or intervals is not None else of_actions,
        lower=lower,
        delays=delays,
    )


def _delays(model: BoundModel) -> tuple[Delays | None, frozenset[str]]:
    """What steps are, and the clocks that labels may not compare: a property has limited them."""
    if model.clocks is None or model.clocks.time is None:
        return None, frozenset()
    clocks = frozenset(v.name for v in model.clocks.automaton.variables if v.clock)
    limited = clocks if model.clocks.for_property else frozenset[str]()
    return Delays(model.clocks.time, clocks), limited


def _sums(values: Numbers, starts: Int64s) -> Numbers:
    """The sum of each segment, none of which is empty."""
    return np.asarray(np.add.reduceat(values, starts[:-1]))
