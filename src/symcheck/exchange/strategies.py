"""Strategies as files: a list of actions, the induced Markov chain, or a drawing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TextIO

import numpy as np

from symcheck.check.strategy import Strategy
from symcheck.errors import UsageError
from symcheck.numerics.matrix import Bools
from symcheck.semantics.literals import format_state

__all__ = ["KINDS", "strategy_target", "strategy_texts", "write_strategy"]

KINDS = ("actions", "indices", "induced", "dot")


def strategy_target(argument: str) -> tuple[str, str, bool]:
    """`FILE[:type=KIND][,reach=true|false]` taken apart: the file, the kind (default: actions), and whether `reach`.

    Raises UsageError for unknown options.
    """
    path, colon, text = argument.rpartition(":")
    if not colon or "=" not in text:
        path, text = argument, ""
    options = dict(part.partition("=")[::2] for part in text.split(",") if part)
    # Of PRISM's further options: chains are always the restricted ones, and states are shown by their values.
    for known in ("mode", "states", "obs"):
        options.pop(known, None)
    kind = options.pop("type", "dot" if path.endswith(".dot") else "induced" if path.endswith(".tra") else "actions")
    reach = options.pop("reach", "true")
    if kind not in KINDS or reach not in ("true", "false") or options:
        raise UsageError(f"-exportstrat: cannot read '{text}'\n  hint: FILE:type={'|'.join(KINDS)},reach=true|false")
    return path, kind, reach == "true"


def strategy_texts(strategy: Strategy, kind: str = "actions", *, reach: bool = True) -> Iterator[str]:
    """The lines of a strategy's file; with `reach` only for the states that it reaches.

    actions: `(values):action` per state; indices: `state:choice` with the choice's number within the state; induced: the
    Markov chain as `states transitions`, then `from to probability [action]`; dot: a drawing of it. Raises UsageError.
    """
    shown = strategy.reachable if reach else np.ones(strategy.engine.states, dtype=np.bool_)
    match kind:
        case "actions":
            return _actions(strategy, shown)
        case "indices":
            return _indices(strategy, shown)
        case "induced":
            return _induced(strategy, shown)
        case "dot":
            return _dot(strategy, shown)
        case _:
            raise UsageError(f"there is no strategy file of type '{kind}'; there are {', '.join(KINDS)}")


def write_strategy(strategy: Strategy, out: TextIO, kind: str = "actions", *, reach: bool = True) -> None:
    """Write `strategy_texts` to a stream."""
    out.writelines(strategy_texts(strategy, kind, reach=reach))


def _actions(strategy: Strategy, shown: Bools) -> Iterator[str]:
    for state, action, there in zip(strategy.states(), strategy.actions, shown.tolist(), strict=True):
        if there:
            yield f"{format_state(state)}:{action}\n"


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


def _induced(strategy: Strategy, shown: Bools) -> Iterator[str]:
    actions, entries = strategy.actions, list(_entries(strategy, shown))
    yield f"{strategy.engine.states} {len(entries)}\n"
    for s, t, p in entries:
        yield f"{s} {t} {p!r}" + (f" {actions[s]}\n" if actions[s] else "\n")


def _dot(strategy: Strategy, shown: Bools) -> Iterator[str]:
    actions = strategy.actions
    yield "digraph strategy {\nnode [shape=box];\n"
    for s, state in enumerate(strategy.states()):
        if shown[s]:
            yield f'{s} [label="{s}\\n{format_state(state)}"];\n'
    for s, t, p in _entries(strategy, shown):
        label = f"{p:.6g}" + (f" : {actions[s]}" if actions[s] else "")
        yield f'{s} -> {t} [label="{label}"];\n'
    yield "}\n"
