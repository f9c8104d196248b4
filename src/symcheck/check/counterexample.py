"""Counterexamples and witnesses as values: paths with their probabilities, and commands."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import overload

from symcheck.engines.states import State
from symcheck.semantics.expressions.literals import format_value
from symcheck.syntax.printer import pretty_number
from symcheck.tables import SHOWN_ROWS, Table
from symcheck.whole_file import extension_of, write_whole

__all__ = ["CommandSet", "Counterexample", "LikelyPath", "counterexample_extension"]

_MANY_VARIABLES = 6
"""With more variables than this, a step of a path shows only those that it changes."""
_SHOWN_STATES = 12
"""States of a path that are printed."""


@dataclass(frozen=True, repr=False)
class LikelyPath(Sequence[State]):
    """A path: a sequence of states, from an initial one.

    Attributes:
        states: mappings from variables to values.
        actions: the action of each step, "" for none; those of a chain's transition are joined by
            commas.
        probability: the product of the probabilities of the steps; a Fraction in rational
            arithmetic. With a bound on time, that of taking these steps in time, from below.
        reward: what the path earns, for a bound on an expected reward or time; otherwise None.
        steps: the probability of each step.
    """

    states: tuple[State, ...]
    actions: tuple[str, ...]
    probability: float | Fraction
    reward: float | Fraction | None = None
    steps: tuple[float | Fraction, ...] = ()

    @overload
    def __getitem__(self, index: int) -> State: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[State, ...]: ...
    def __getitem__(self, index: int | slice) -> State | tuple[State, ...]:
        return self.states[index]

    def __len__(self) -> int:
        return len(self.states)

    def __repr__(self) -> str:
        return f"<LikelyPath: {len(self.actions)} steps, probability {_number(self.probability)}>"

    def _parts(self) -> list[str]:
        """The first state, and each step; with many variables, only those that it changes."""
        parts = [repr(self.states[0])]
        for action, (before, after) in zip(self.actions, pairwise(self.states), strict=True):
            text = repr(after) if len(after) <= _MANY_VARIABLES else _changes(before, after)
            parts.append(f"-{f'[{action}]-' if action else ''}> {text}")
        return parts

    def __str__(self) -> str:
        return " ".join(self._parts())

    @property
    def short(self) -> str:
        """The text without the middle of a long path."""
        parts, ends = self._parts(), _SHOWN_STATES // 2
        left = len(parts) - 2 * ends
        if left <= 0:
            return str(self)
        return " ".join([*parts[:ends], f"… {left} more states …", *parts[-ends:]])


@dataclass(frozen=True)
class CommandSet:
    """Commands that suffice for a bound, whatever follows the first step by another command.

    For a probability: the paths that use no others have the required probability. For an expected
    reward: before a run uses another command, the required reward is earned, in expectation. As
    rewards are not negative, the whole model cannot earn less. A step of a chain with several
    enabled commands counts for each of them with its share.

    Attributes:
        commands: their texts.
        of: how many commands the paths could use.
        smallest: whether it is proved that no smaller set suffices (for a lower bound on an MDP, no
            smaller one for the strategy of the paths). Otherwise no single command can be left out.
        any_strategy: whether they suffice under some strategy, which need not be that of the paths.
        of_reward: whether the bound is on a reward.
    """

    commands: tuple[str, ...]
    of: int
    smallest: bool
    any_strategy: bool = False
    of_reward: bool = False

    def __str__(self) -> str:
        kind = "a smallest set" if self.smallest else "a small set, maybe not a smallest one"
        kind += ", for some strategy, maybe not that of the paths" if self.any_strategy else ""
        verb = "suffice"
        if self.of_reward:
            verb = "earn enough before a run uses another one"
        if len(self.commands) == 1:
            verb = verb.replace("suffice", "suffices").replace("earn ", "earns ")
        return f"{len(self.commands)} of {self.of} commands {verb} ({kind}):"


@dataclass(frozen=True, eq=False, repr=False)
class Counterexample:
    """Paths that show together that a bound does not hold, or that it holds.

    They do so by the sum of their probabilities, or for a bound on an expected reward (time) by the
    sum of probability times reward.

    Attributes:
        formula: the text of the property.
        refutes: whether they show that the property is false; otherwise that it is true.
        satisfies: whether the paths satisfy the path formula of the property; otherwise they
            violate it.
        threshold: what the sum has to reach, or with `strict` to exceed.
        paths: in the order of decreasing probability.
        probability: the sum of their probabilities, a Fraction in rational arithmetic, otherwise
            exact up to rounding.
        reward: the sum of probability times reward; None for a bound on a probability.
        complete: whether the sum is proved to reach the threshold.
        commands: commands that suffice; None if they were not asked for or not found.
        note: why the counterexample is not complete, or has no commands.
    """

    formula: str
    refutes: bool
    satisfies: bool
    threshold: Fraction
    strict: bool
    paths: tuple[LikelyPath, ...] = field(repr=False)
    probability: float | Fraction
    complete: bool
    commands: CommandSet | None = None
    reward: float | Fraction | None = None
    note: str = ""

    def __repr__(self) -> str:
        return f"<Counterexample: {self.summary}>"

    @property
    def steps(self) -> tuple[tuple[State, State], ...]:
        """The transitions of all paths, each once, as pairs of states."""
        pairs = {(a.number, b.number): (a, b) for path in self.paths for a, b in pairwise(path)}
        return tuple(pairs.values())

    @property
    def summary(self) -> str:
        """How many paths there are, their probability, and whether this decides the property."""
        n = len(self.paths)
        paths = "1 path" if n == 1 else f"{n} paths"
        verb = "satisfy" if self.satisfies else "violate"
        verb = {"satisfy": "satisfies", "violate": "violates"}[verb] if n == 1 else verb
        relation = "more than" if self.strict else "at least"
        digits = pretty_number(self.threshold)
        whole = "/" in digits or self.threshold.denominator == 1
        bound = f"{relation} {self.threshold if whole else digits}"
        shows = f"so the property is {'false' if self.refutes else 'true'}"
        missing = self.threshold - Fraction(
            self.probability if self.reward is None else self.reward
        )
        told = f", {float(missing):.6g} is missing" if missing > 0 else ""  # else rounding errors
        outcome = f"{bound}, {shows}" if self.complete else f"not yet {bound}{told}"
        if self.reward is not None:
            earn = "earns" if n == 1 else "earn"
            text = f"{paths} with probability {_number(self.probability)}, which {earn}"
            return f"{text} {_number(self.reward)} by probability times reward: {outcome}"
        text = f"{paths} that {verb} the path formula, with probability"
        return f"{text} {_number(self.probability)}: {outcome}"

    def _shown(self, count: int) -> Iterator[str]:
        yield self.summary
        for path in self.paths[:count]:
            shown = str(path) if count == len(self.paths) else path.short
            earned = "" if path.reward is None else f" (earns {_number(path.reward)})"
            yield f"  {_number(path.probability)}{earned}: {shown}"
        if len(self.paths) > count:
            yield f"  {self._others(count)}"
        if self.commands is not None:
            yield str(self.commands)
            yield from (f"  {command}" for command in self.commands.commands)
        if self.note:
            yield self.note

    def _others(self, count: int) -> str:
        """What is told of the paths after the first ones."""
        others = sum(path.probability for path in self.paths[count:])
        return (
            f"… and {len(self.paths) - count} more, none likelier: "
            f"together they have probability {float(others):.6g}"
        )

    def __str__(self) -> str:
        return "\n".join(self._shown(SHOWN_ROWS))

    def _repr_html_(self) -> str:
        rows = [(p.probability, p.short) for p in self.paths[:SHOWN_ROWS]]
        note = self._others(SHOWN_ROWS) if len(self.paths) > SHOWN_ROWS else ""
        table = Table.of(("probability", "path"), rows, note)._repr_html_()
        texts = [] if self.commands is None else [str(self.commands), *self.commands.commands]
        texts += [self.note] if self.note else []
        below = "".join(f"<div>{escape(text)}</div>" for text in texts)
        return f"<div>{escape(self.summary)}</div>{table}{below}"

    def save(self, path: str | Path) -> None:
        """Write a text with all paths (.txt), JSON (.json), or their graph (.dot).

        Raises UsageError: the extension is another one, or the file cannot be written.
        """
        extension = counterexample_extension(path)
        match extension:
            case ".txt":
                text = "\n".join([self.formula, *self._shown(len(self.paths))]) + "\n"
            case ".json":
                text = json.dumps(self._plain(), indent=1, ensure_ascii=False, default=str) + "\n"
            case _:
                text = self._dot()
        write_whole(path, partial(_write, text))

    def _plain(self) -> Mapping[str, object]:
        commands = self.commands
        return {
            "property": self.formula,
            "shows": not self.refutes,
            "paths satisfy the path formula": self.satisfies,
            "threshold": str(self.threshold),
            "strict": self.strict,
            "probability": self.probability,
            "reward": self.reward,
            "complete": self.complete,
            "paths": [
                {
                    "probability": p.probability,
                    **({} if p.reward is None else {"reward": p.reward}),
                    "states": [dict(state) for state in p.states],
                    "actions": p.actions,
                    "steps": p.steps,
                }
                for p in self.paths
            ],
            "commands": None if commands is None else commands.commands,
            "smallest": None if commands is None else commands.smallest,
            "note": self.note,
        }

    def _dot(self) -> str:
        """The transitions of the paths, in the language of Graphviz."""
        states = {s.number: s for path in self.paths for s in path}
        first = {path[0].number for path in self.paths}
        last = {path[-1].number for path in self.paths}
        # Of many variables, only those are shown that differ.
        names = list(next(iter(states.values()), ()))
        if len(names) > _MANY_VARIABLES and len(states) > 1:
            values = [tuple(state.values()) for state in states.values()]
            columns = zip(names, zip(*values, strict=True), strict=True)
            names = [name for name, column in columns if len(set(column)) > 1]
        legend = f"{self.summary}\nbold: the first state; two lines: the last one"
        lines = [
            "digraph counterexample {",
            f'  label="{_quoted(legend)}"; fontname="sans-serif"; fontsize=10;',
            '  node [shape=box, style=rounded, fontname="sans-serif", fontsize=11];',
            '  edge [fontname="sans-serif", fontsize=9];',
        ]
        for number, state in sorted(states.items()):
            shape = ", peripheries=2" if number in last else ""
            shape += ", penwidth=2" if number in first else ""
            text = ", ".join(f"{name}={format_value(state[name])}" for name in names)
            lines.append(f'  {number} [label="{_quoted(f"({text})")}"{shape}];')
        edges = {
            (a.number, b.number, f"{action} {float(p):.4g}".strip())
            for path in self.paths
            for (a, b), action, p in zip(pairwise(path), path.actions, path.steps, strict=True)
        }
        lines += [f'  {a} -> {b} [label=" {_quoted(text)} "];' for a, b, text in sorted(edges)]
        return "\n".join([*lines, "}", ""])

    def with_commands(self, commands: CommandSet | None, note: str) -> Counterexample:
        """The same paths with commands, or a note why there are none."""
        both = "; ".join(filter(None, (self.note, note)))
        return replace(self, commands=commands, note=both)


def counterexample_extension(path: str | Path) -> str:
    """'.txt', '.json' or '.dot'. Raises UsageError."""
    return extension_of(path, (".txt", ".json", ".dot"), "what is written")


def _number(value: float | Fraction) -> str:
    """Twelve digits of a number; a rational with a short text as it is."""
    text = str(value)
    return text if isinstance(value, Fraction) and len(text) <= 24 else f"{float(value):.12g}"


def _changes(before: State, after: State) -> str:
    changed = (f"{n}={format_value(x)}" for n, x in after.items() if before[n] != x)
    return f"({', '.join(changed)})"


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _write(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")
