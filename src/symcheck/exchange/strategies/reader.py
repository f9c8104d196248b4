"""Read a strategy from a file of decisions (see `files.py`): actions or indices."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from symcheck.api import Model
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.strategy import Strategy
from symcheck.engines.registry import build
from symcheck.errors import UnsupportedError
from symcheck.exchange.column_reader import Columns, read_columns
from symcheck.matrices.rows import Int64s
from symcheck.semantics.expressions.literals import format_state
from symcheck.syntax.ast import ModelType

__all__ = ["load_strategy"]

_LINE = re.compile(r"(\([^()]*\)|\d+)(,\d+)?[=:](.*)")


def load_strategy(model: Model, file: str | Path) -> Strategy:
    """Read a strategy without memory: lines `(values)=action`, `state=action` or `state=choice`.

    States that the file leaves out take their first choice. `symcheck.induced_chain` gives the
    chain that the strategy induces.

    Args:
        model: the MDP.
        file: as `-exportstrat FILE` writes it, of type `actions` or `indices`.

    Raises:
        SyntaxFault: the file is faulty; the error names the place.
        UsageError: the file cannot be read.
        UnsupportedError: the model is no MDP, or the strategy has memory.

    Examples:
        >>> import symcheck
        >>> model = symcheck.load("models/gambler/stakes.nm")  # doctest: +SKIP
        >>> best = symcheck.load_strategy(model, "best.txt")  # doctest: +SKIP
        >>> symcheck.induced_chain(model, best).check('P=? [ F "rich" ]')  # doctest: +SKIP
    """
    kind = model.bound.type
    if kind is not ModelType.MDP:
        raise UnsupportedError(f"strategies exist only for MDPs, and this model is a {kind.name}")
    engine = build(model.bound, replace(model.options, engine="explicit"))
    explicit = engine.capability(ExplicitEngine)
    assert explicit is not None
    groups = explicit.matrix.groups
    assert groups is not None
    rows: Int64s = np.full(engine.states, -1, np.int64)
    _Decisions(explicit, read_columns(Path(file)), groups).read(rows)
    decided = rows >= 0
    return Strategy(explicit, np.where(decided, rows, groups[:-1]), None, decided)


class _Decisions:
    """The lines of a file, which choose rows of an engine."""

    def __init__(self, engine: ExplicitEngine, file: Columns, groups: Int64s) -> None:
        self.engine, self.file, self.groups = engine, file, groups
        names = (*engine.model.actions, "")
        self.actions = [names[a] for a in engine.explored.choice_actions.tolist()]
        self.numbers: dict[str, int] = {}

    def read(self, rows: Int64s) -> None:
        """Set the row of each state in the file."""
        indices = all(re.fullmatch(r".*[=:]\d+", "".join(words)) for words in self.file.rows)
        for i, words in enumerate(self.file.rows):
            match = _LINE.fullmatch("".join(words))
            if match is None:
                expected = "a line should hold a state, '=', and an action or the index of a choice"
                self.file.fault(i, expected, "fields", None, "such as (0,true)=go, 3=go or 3=0")
            state, memory, choice = match.groups()
            if memory:
                raise UnsupportedError(
                    f"'{self.file.source.name}' is a strategy with memory, and its file does not "
                    "say how the memory changes\n  hint: -exportstrat FILE.all writes the chain "
                    "that it induces, and -importmodel FILE.all reads it"
                )
            number = self._number(i, state)
            if rows[number] >= 0:
                self.file.fault(i, f"state {state} is in the file already", "repeated")
            rows[number] = self._row(i, number, choice, index=indices)

    def _number(self, line: int, state: str) -> int:
        engine = self.engine
        if state[0] != "(":
            if int(state) < engine.states:
                return int(state)
            message = f"state {state} does not exist: there are {engine.states}, numbered from 0"
            self.file.fault(line, message, "index")
        if not self.numbers:
            states = engine.valuations(engine.all)
            self.numbers = {format_state(values): n for n, values in enumerate(states)}
        if state not in self.numbers:
            names = ",".join(v.name for v in engine.model.variables)
            message = f"{state} is not a reachable state of the model, whose states are ({names})"
            self.file.fault(line, message, "index")
        return self.numbers[state]

    def _row(self, line: int, state: int, choice: str, *, index: bool) -> int:
        start, stop = self.groups[state : state + 2].tolist()
        if index:
            if int(choice) < stop - start:
                return int(start + int(choice))
            message = f"the state has no choice {choice}: it has {stop - start}, numbered from 0"
            self.file.fault(line, message, "index")
        own = self.actions[start:stop]
        if choice not in own:
            known = ", ".join(f"'{a}'" for a in dict.fromkeys(own))
            message = f"the state has no choice with action '{choice}': it has {known}"
            self.file.fault(line, message, "action")
        if own.count(choice) > 1:
            self.file.fault(
                line,
                f"the state has {own.count(choice)} choices with action '{choice}'",
                "action",
                None,
                "-exportstrat FILE:type=indices tells them apart",
            )
        return int(start + own.index(choice))
