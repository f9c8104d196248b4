"""Strategies as files in PRISM's forms: decisions of states, the induced Markov chain, or a graph.

Source: the page 'Strategies' of the PRISM manual, version 4.8.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from symcheck.engines.base import StateSet
from symcheck.engines.explicit.strategy import Strategy
from symcheck.errors import UsageError
from symcheck.exchange.explicit_data import build_imported
from symcheck.exchange.explicit_export import ExplicitExport, explicit_export
from symcheck.exchange.export import EXTENSIONS, export, parse_target
from symcheck.exchange.formats.dot import dot_file
from symcheck.exchange.formats.prism_writer import transitions_file
from symcheck.exchange.strategies.induced_chain import induced_data
from symcheck.exchange.text import write_text
from symcheck.kernels.arrays import Bools
from symcheck.options import Options
from symcheck.semantics.expressions.literals import format_state
from symcheck.whole_file import uncompressed_name

__all__ = [
    "ANY_CHOICE",
    "KINDS",
    "StrategyTarget",
    "strategy_target",
    "strategy_texts",
    "write_strategy",
    "write_strategy_files",
]

_TEXT = ("", ".txt", ".strat", ".adv", ".dat", ".res", ".log")
"""The extensions of a list of decisions."""

ANY_CHOICE = "# other states: any choice"
"""The comment of a file that leaves out reachable states whose choice is irrelevant."""

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

    Without `type`, the extension of the file says the kind; that of the induced chain may name
    several files, as `best.tra,sta,lab` or `best.all`. Without `reach`, only the induced chain
    has the states that are not reached.

    Raises:
        UsageError: an option is unknown, or there is no type and the extension names none.
    """
    path, colon, text = argument.rpartition(":")
    if not colon or "=" not in text:
        path, text = argument, ""
    name, compressed = uncompressed_name(path)
    if compressed and _parts(name):
        raise UsageError("the files of an induced chain are not compressed")
    options = dict(part.partition("=")[::2] for part in text.split(",") if part)
    # This option merges states with equal observations, and applies to POMDPs only.
    options.pop("obs", None)
    kind = options.pop("type", None) or _kind(name)
    if kind == "actions" and _parts(path):
        kind = "induced"
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
        raise UsageError(f"cannot read '{text}'", hint=known)
    return StrategyTarget(path, kind, reach == "true", mode == "restrict", states == "true")


def _kind(name: str) -> str:
    """The kind that the extension of a file names. Raises UsageError."""
    extension = Path(name).suffix.lower()
    if extension == ".dot":
        return "dot"
    if _parts(name):
        return "induced"
    if extension not in _TEXT:
        known = ", ".join(("FILE", *(f"FILE{e}" for e in _TEXT if e)))
        raise UsageError(
            f"'{name}': the extension '{extension}' names no kind of strategy file",
            hint=f"{known} write the actions, FILE.dot the graph, FILE.tra and FILE.all the "
            f"induced chain, '{name}:type=actions' the actions under any name",
        )
    return "actions"


def _parts(path: str) -> list[str]:
    """The formats that a name such as `base.tra,sta`, `base.all` or `base.umb` ends in, or []."""
    kinds = path.rpartition(".")[2].split(",")
    return kinds if set(kinds) <= {*EXTENSIONS, "all", "rew"} - {"dot"} else []


def write_strategy_files(strategy: Strategy, target: StrategyTarget, out: TextIO) -> list[str]:
    """Write the file of a strategy, or the files of the induced chain, such as `best.tra,sta,lab`.

    Args:
        strategy: the strategy.
        target: path and format.
        out: the stream that 'stdout' stands for.

    Returns:
        The names of the files.

    Raises:
        UsageError: a file cannot be written.
    """
    if target.kind == "induced" and _parts(target.path) not in ([], ["tra"]):
        parts = parse_target(target.path, "strategy")
        return list(export(_export(strategy, target), parts, out))
    write_text(target.path, strategy_texts(strategy, target), out)
    return [target.path]


def strategy_texts(strategy: Strategy, target: StrategyTarget) -> Iterator[str]:
    """The lines of the file of a strategy, as in PRISM.

    By kind: 'actions' has `(values)=action` per state, 'indices' `state=choice` with the number of
    the choice within its state; with memory, `(values),memory=action` and `state,memory=choice`. A
    random choice is `p:action+q:action`. States whose choice is irrelevant are left out; if some of
    them are reached and have several choices, a comment at the end says so. Comments
    tell how the memory changes: `# memory: 0` is its first value, and `# (values),0 -> 1` its next
    one after the choice (one for each of several, joined by `+`); without, it keeps its value.
    'induced' is the induced Markov chain as a `.tra` file (or the MDP with one choice per state),
    'dot' its graph.
    """
    match target.kind:
        case "actions":
            return _decisions(strategy, target, strategy.actions, values=target.states)
        case "indices":
            return _decisions(strategy, target, strategy.choices, values=False)
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
    strategy: Strategy, target: StrategyTarget, chosen: Sequence[str], *, values: bool
) -> Iterator[str]:
    shown = strategy.matters & strategy.reachable if target.reach else strategy.matters
    names: Iterable[object] = strategy.origin.tolist()
    if values:
        texts = map(format_state, strategy.base.valuations(strategy.base.all))
        names = np.array(list(texts), dtype=object)[strategy.origin]
    if strategy.memory is None:
        for name, choice, there in zip(names, chosen, shown.tolist(), strict=True):
            if there:
                yield f"{name}={choice}\n"
        yield from _left_out(strategy)
        return
    states = [f"{name},{m}" for name, m in zip(names, strategy.memory.tolist(), strict=True)]
    for state, choice, there in zip(states, chosen, shown.tolist(), strict=True):
        if there:
            yield f"{state}={choice}\n"
    yield from _memory(strategy, states, shown)
    yield from _left_out(strategy)


def _left_out(strategy: Strategy) -> Iterator[str]:
    if strategy.undecided.any():
        yield f"{ANY_CHOICE}\n"


def _memory(strategy: Strategy, states: Sequence[str], shown: Bools) -> Iterator[str]:
    """Comments that say how the memory changes."""
    assert strategy.memory is not None
    yield f"# memory: {strategy.memory[strategy.engine.initial.members][0]}\n"
    after, starts = strategy.following.tolist(), strategy.starts
    before = np.repeat(strategy.memory, np.diff(starts))
    changes = np.add.reduceat(strategy.following != before, starts[:-1]) > 0
    for state in np.flatnonzero(shown & changes).tolist():
        memory = "+".join(map(str, after[starts[state] : starts[state + 1]]))
        yield f"# {states[state]} -> {memory}\n"


def _export(strategy: Strategy, target: StrategyTarget) -> ExplicitExport:
    data = induced_data(strategy, reach=target.reach, restrict=target.restrict)
    engine = build_imported(data, Options(exact=strategy.engine.is_rational))
    model = engine.model

    def states(name: str) -> StateSet:
        return engine.where(model.labels[name])

    return explicit_export(engine, list(model.labels), states)
