"""Strategies as files: a list of actions, the induced Markov chain, or a graph."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UsageError
from symcheck.exchange.text import number_text
from symcheck.matrices.rows import Bools
from symcheck.semantics.expressions.literals import format_state

__all__ = ["KINDS", "StrategyTarget", "strategy_target", "strategy_texts", "write_strategy"]

KINDS = ("actions", "indices", "induced", "dot")


@dataclass(frozen=True, slots=True)
class StrategyTarget:
    """The file of a strategy, and its format.

    Attributes:
        path: the file, or 'stdout'.
        kind: one of KINDS.
        reach: write only the states that are reachable under the strategy.
        restrict: write the induced model as an MDP with one choice per state.
        states: write the values of states instead of their numbers.
    """

    path: str
    kind: str = "actions"
    reach: bool = False
    restrict: bool = False
    states: bool = True


def strategy_target(argument: str) -> StrategyTarget:
    """Parse `FILE[:type=KIND][,reach=…][,mode=restrict|reduce][,states=…]`.

    Without `type`, the extension of the file says the kind. Without `reach`, a graph has only the
    reachable states.

    Raises:
        UsageError: an option is unknown.
    """
    path, colon, text = argument.rpartition(":")
    if not colon or "=" not in text:
        path, text = argument, ""
    options = dict(part.partition("=")[::2] for part in text.split(",") if part)
    # This option merges states with equal observations, and applies to POMDPs only.
    options.pop("obs", None)
    kind = options.pop(
        "type",
        "dot" if path.endswith(".dot") else "induced" if path.endswith(".tra") else "actions",
    )
    mode = options.pop("mode", "reduce")
    reach, states = (
        options.pop("reach", "true" if kind == "dot" else "false"),
        options.pop("states", "true"),
    )
    if (
        kind not in KINDS
        or mode not in ("restrict", "reduce")
        or {reach, states} - {"true", "false"}
        or options
    ):
        known = (
            f"FILE:type={'|'.join(KINDS)},mode=restrict|reduce,reach=true|false,states=true|false"
        )
        raise UsageError(f"-exportstrat: cannot read '{text}'\n  hint: {known}")
    return StrategyTarget(path, kind, reach == "true", mode == "restrict", states == "true")


def strategy_texts(strategy: Strategy, target: StrategyTarget) -> Iterator[str]:
    """The lines of the file of a strategy.

    By kind: 'actions' has `(values):action` per state. 'indices' has `state:choice`, with the
    number of the choice within the state. 'induced' has the induced chain: `states transitions`,
    then `source target probability [action]` (as an MDP: `states choices transitions`, then `source
    0 target probability [action]`). 'dot' has the induced chain as a graph.
    """
    shown = strategy.reachable if target.reach else np.ones(strategy.engine.states, dtype=np.bool_)
    match target.kind:
        case "actions":
            return _actions(strategy, shown, target.states)
        case "indices":
            return _indices(strategy, shown)
        case "induced":
            return _induced(strategy, shown, target.restrict)
        case "dot":
            return _dot(strategy, shown, target)
        case _:
            raise UsageError(
                f"there is no strategy file of type '{target.kind}'; there are {', '.join(KINDS)}"
            )


def write_strategy(
    strategy: Strategy, out: TextIO, kind: str = "actions", *, reach: bool = True
) -> None:
    """Write `strategy_texts` to a stream."""
    out.writelines(strategy_texts(strategy, StrategyTarget("", kind, reach)))


def _actions(strategy: Strategy, shown: Bools, values: bool) -> Iterator[str]:
    states = strategy.states() if values else range(strategy.engine.states)
    for state, action, there in zip(states, strategy.actions, shown.tolist(), strict=True):
        if there:
            yield f"{format_state(state) if isinstance(state, tuple) else state}:{action}\n"


def _indices(strategy: Strategy, shown: Bools) -> Iterator[str]:
    assert strategy.engine.matrix.groups is not None
    numbers = strategy.rows - strategy.engine.matrix.groups[:-1]
    yield from (f"{s}:{numbers[s]}\n" for s in np.flatnonzero(shown).tolist())


def _entries(strategy: Strategy, shown: Bools) -> Iterator[tuple[int, int, float]]:
    chain = strategy.induced
    for s in np.flatnonzero(shown).tolist():
        span = slice(int(chain.indptr[s]), int(chain.indptr[s + 1]))
        row = sorted(zip(chain.indices[span].tolist(), chain.data[span].tolist(), strict=True))
        yield from ((s, t, p) for t, p in row)


def _induced(strategy: Strategy, shown: Bools, restrict: bool) -> Iterator[str]:
    actions, entries = strategy.actions, list(_entries(strategy, shown))
    choices, number = (f"{int(shown.sum())} ", "0 ") if restrict else ("", "")
    yield f"{strategy.engine.states} {choices}{len(entries)}\n"
    for s, t, p in entries:
        yield f"{s} {number}{t} {number_text(p)}" + (f" {actions[s]}\n" if actions[s] else "\n")


def _dot(strategy: Strategy, shown: Bools, target: StrategyTarget) -> Iterator[str]:
    actions = strategy.actions
    yield "digraph strategy {\nnode [shape=box];\n"
    for s, state in enumerate(strategy.states()):
        if shown[s]:
            values = f"\\n{format_state(state)}" if target.states else ""
            yield f'{s} [label="{s}{values}"];\n'
            if target.restrict:
                yield f'{s} -> n{s} [label="{actions[s]}",arrowhead="none"];\n'
                yield f'n{s} [shape=point,label=""];\n'
    for s, t, p in _entries(strategy, shown):
        label = f"{p:.6g}" + (f" : {actions[s]}" if actions[s] and not target.restrict else "")
        yield f'{"n" * target.restrict}{s} -> {t} [label="{label}"];\n'
    yield "}\n"
