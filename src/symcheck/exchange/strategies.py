"""Strategies as files: a list of actions, the induced Markov chain, or a drawing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from symcheck.check.strategies.strategy import Strategy
from symcheck.errors import UsageError
from symcheck.exchange.text import number_text
from symcheck.matrices.rows import Bools
from symcheck.semantics.expressions.literals import format_state

__all__ = ["KINDS", "StrategyTarget", "strategy_target", "strategy_texts", "write_strategy"]

KINDS = ("actions", "indices", "induced", "dot")


@dataclass(frozen=True, slots=True)
class StrategyTarget:
    """A file for a strategy ('stdout': the standard output), and what is written.

    kind: one of KINDS. reach: only the states that it reaches. restrict: an induced model is an MDP with one choice in each
    state, instead of a Markov chain. states: states are shown by their values, instead of their numbers.
    """

    path: str
    kind: str = "actions"
    reach: bool = False
    restrict: bool = False
    states: bool = True


def strategy_target(argument: str) -> StrategyTarget:
    """`FILE[:type=KIND][,reach=…][,mode=restrict|reduce][,states=…]` taken apart. Raises UsageError for unknown options.

    The ending of the file tells the kind if nothing else does; drawings show the states that are reached, if not told otherwise.
    """
    path, colon, text = argument.rpartition(":")
    if not colon or "=" not in text:
        path, text = argument, ""
    options = dict(part.partition("=")[::2] for part in text.split(",") if part)
    # Whether states that look alike are shown as one: this is of partially observable models.
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
    """The lines of a strategy's file.

    actions: `(values):action` per state; indices: `state:choice` with the choice's number within the state; induced: the
    Markov chain as `states transitions`, then `from to probability [action]`, or the MDP as `states choices transitions`, then
    `from 0 to probability [action]`; dot: a drawing of it.
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
                yield f'{s} -> n{s} [label="{actions[s]}",arrowhead="none"];\nn{s} [shape=point,label=""];\n'
    for s, t, p in _entries(strategy, shown):
        label = f"{p:.6g}" + (f" : {actions[s]}" if actions[s] and not target.restrict else "")
        yield f'{"n" * target.restrict}{s} -> {t} [label="{label}"];\n'
    yield "}\n"
