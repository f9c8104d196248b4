"""Strategies as files in PRISM's forms: decisions of states, the induced Markov chain, or a graph.

Source: the page 'Strategies' of the PRISM manual, version 4.8.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TextIO

import numpy as np

from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UsageError
from symcheck.exchange.explicit_data import build_imported
from symcheck.exchange.explicit_export import ExplicitExport, explicit_export
from symcheck.exchange.formats.dot import dot_file
from symcheck.exchange.formats.prism_writer import transitions_file
from symcheck.exchange.induced import induced_data
from symcheck.options import Options
from symcheck.semantics.expressions.literals import format_state

__all__ = ["KINDS", "StrategyTarget", "strategy_target", "strategy_texts", "write_strategy"]

KINDS = ("actions", "indices", "induced", "dot")


@dataclass(frozen=True, slots=True)
class StrategyTarget:
    """The file of a strategy, and its format.

    Attributes:
        path: the file, or 'stdout'.
        kind: one of KINDS.
        reach: write only the states that are reachable under the strategy; the induced chain then
            numbers them anew.
        restrict: write the induced model as an MDP with one choice per state.
        states: write the values of states instead of their numbers.
    """

    path: str
    kind: str = "actions"
    reach: bool = True
    restrict: bool = False
    states: bool = True


def strategy_target(argument: str) -> StrategyTarget:
    """Parse `FILE[:type=KIND][,reach=…][,mode=restrict|reduce][,states=…]`.

    Without `type`, the extension of the file says the kind. Without `reach`, only the induced chain
    has the states that are not reached.

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
    reach = options.pop("reach", "false" if kind == "induced" else "true")
    states = options.pop("states", "true")
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
    """The lines of the file of a strategy, as in PRISM.

    By kind: 'actions' has `(values)=action` per state, 'indices' `state=choice` with the number of
    the choice within its state; with memory, `(values),memory=action` and `state,memory=choice`.
    States whose choice is irrelevant are left out. 'induced' is the induced Markov chain as a
    `.tra` file (or the MDP with one choice per state), 'dot' its graph.
    """
    match target.kind:
        case "actions":
            return _decisions(strategy, target, strategy.actions, values=target.states)
        case "indices":
            return _decisions(strategy, target, strategy.choices.tolist(), values=False)
        case "induced":
            return transitions_file(_export(strategy, target))
        case "dot":
            return dot_file(_export(strategy, target), states=target.states)
        case _:
            raise UsageError(
                f"there is no strategy file of type '{target.kind}'; there are {', '.join(KINDS)}"
            )


def write_strategy(
    strategy: Strategy, out: TextIO, kind: str = "actions", *, reach: bool | None = None
) -> None:
    """Write `strategy_texts` to a stream; reach=None: as `strategy_target` without `reach`."""
    reach = kind != "induced" if reach is None else reach
    out.writelines(strategy_texts(strategy, StrategyTarget("", kind, reach)))


def _decisions(
    strategy: Strategy, target: StrategyTarget, chosen: Sequence[object], *, values: bool
) -> Iterator[str]:
    shown = strategy.matters & strategy.reachable if target.reach else strategy.matters
    states: Iterable[object] = strategy.origin.tolist()
    if values:
        states = map(format_state, strategy.base.valuations(strategy.base.all))
        states = np.array(list(states), dtype=object)[strategy.origin]
    memory = (
        [""] * len(shown)
        if strategy.memory is None
        else [f",{m}" for m in strategy.memory.tolist()]
    )
    for state, m, choice, there in zip(states, memory, chosen, shown.tolist(), strict=True):
        if there:
            yield f"{state}{m}={choice}\n"


def _export(strategy: Strategy, target: StrategyTarget) -> ExplicitExport:
    data = induced_data(strategy, reach=target.reach, restrict=target.restrict)
    return explicit_export(build_imported(data, Options()))
