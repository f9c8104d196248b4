"""Read a strategy from a file of decisions (see `files.py`): actions or indices."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from symcheck.api.model import Model
from symcheck.check.strategies.to_explicit import check_rows_fit
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.finite_memory import Decisions, finite_memory_strategy
from symcheck.engines.explicit.strategy import Strategy
from symcheck.engines.registry import on_rows
from symcheck.errors import UnsupportedError
from symcheck.exchange.column_reader import Columns, read_columns
from symcheck.exchange.strategies.files import ANY_CHOICE
from symcheck.matrices.numbers import numbers
from symcheck.matrices.rows import Int64s
from symcheck.semantics.expressions.literals import format_state
from symcheck.syntax.ast import Weights

__all__ = ["load_strategy", "undecided_states"]

_NUMBER = r"\d{1,18}"
_LINE = re.compile(rf"(\([^()]*\)|{_NUMBER})(?:,({_NUMBER}))?[=:](.*)")
_FIRST = re.compile(rf"#memory:({_NUMBER})")
_CHANGE = re.compile(rf"#(\([^()]*\)|{_NUMBER}),({_NUMBER})->({_NUMBER}(?:\+{_NUMBER})*)")
_SHARE = r"(?:\d{1,400}/0*[1-9]\d{0,400}|\d{1,400}(?:\.\d{0,400})?(?:[eE]-?\d{1,3})?)"
_MIXED = re.compile(rf"{_SHARE}:\w*(?:\+{_SHARE}:\w*)*")
_INDICES = re.compile(rf"[^=:]*(?:[=:]{_NUMBER}|={_SHARE}:{_NUMBER}(\+{_SHARE}:{_NUMBER})*)")
_SUM = Fraction(1, 10**9)
"""Probabilities that sum to 1 up to this are taken for rounded; they are divided by their sum."""

Pair = tuple[int, int]


def load_strategy(model: Model, file: str | Path) -> Strategy:
    """Read a strategy: lines `(values)=action`, `state=action` or `state=choice`.

    A random choice is `(values)=0.5:action+0.5:action`. With memory, lines are
    `(values),memory=action`, and comments say how it changes (`exchange.strategies`). States that
    the file leaves out take their first choice and keep the memory. `symcheck.induced_chain` gives
    the chain that the strategy induces.

    Args:
        model: the MDP.
        file: as `-exportstrat FILE` writes it, of type `actions` or `indices`.

    Raises:
        SyntaxFault: the file is faulty; the error names the place.
        UsageError: the file cannot be read.
        UnsupportedError: the model is no MDP, its rows do not fit into memory, or the file does not
            say how the memory changes.

    Examples:
        >>> import symcheck
        >>> model = symcheck.load("models/gambler/stakes.nm")  # doctest: +SKIP
        >>> best = symcheck.load_strategy(model, "best.txt")  # doctest: +SKIP
        >>> symcheck.induced_chain(model, best).check('P=? [ F "rich" ]')  # doctest: +SKIP
    """
    kind = model.bound.type
    if not kind.has_choices:
        if model.bound.weights is Weights.INTERVALS:
            raise UnsupportedError(
                f"a {kind.name} with intervals has no strategy to read: nature alone chooses in it",
                hint="-exportstrat FILE.tra writes the chain that nature chooses",
            )
        raise UnsupportedError(f"strategies exist only for MDPs, and this model is a {kind.name}")
    # Diagrams count the states quickly, so that a model whose rows do not fit is refused at once.
    check_rows_fit(model.engine, "a strategy from a file needs")
    explicit = on_rows(model.engine, model.options)
    groups = explicit.matrix.groups
    assert groups is not None
    return _File(explicit, read_columns(Path(file)), groups).strategy()


def undecided_states(strategy: Strategy, file: str | Path) -> int:
    """The number of reached states with several choices that a file leaves out without saying so.

    Args:
        strategy: what was read from the file.
        file: the file.
    """
    if ANY_CHOICE in read_columns(Path(file)).source.text.splitlines():
        return 0
    return int(strategy.undecided.sum())


@dataclass
class _Decision:
    """The rows of a line, their probabilities, and the memory after each; line: its index."""

    line: int
    rows: list[int]
    shares: list[Fraction]
    following: list[int] = field(default_factory=list)


class _File:
    """The lines of a file, which choose rows of an engine."""

    def __init__(self, engine: ExplicitEngine, file: Columns, groups: Int64s) -> None:
        self.engine, self.file, self.groups = engine, file, groups
        names = (*engine.model.actions, "", "")  # the last two for none and for rates
        self.actions = [names[a] for a in engine.explored.choice_actions.tolist()]
        self.numbers: dict[str, int] = {}

    def strategy(self) -> Strategy:
        """The strategy of the file."""
        decisions, remembers = self._decisions()
        first = self._changes(decisions) if remembers else 0
        if remembers and first is None:
            raise UnsupportedError(
                f"'{self.file.source.name}' is a strategy with memory, and its file does not "
                "say how the memory changes",
                hint="symcheck writes it in "
                "comments, such as '# memory: 0' and '# (0,true),0 -> 1'",
            )
        counts = [len(d.rows) for d in decisions.values()]
        pairs = np.array(list(decisions), np.int64).reshape(-1, 2).repeat(counts, axis=0)
        exact = [s for d in decisions.values() for s in d.shares]
        read = Decisions(
            pairs[:, 0],
            pairs[:, 1],
            np.array([r for d in decisions.values() for r in d.rows], np.int64),
            numbers(np.array(exact, dtype=object), rational=self.engine.is_rational),
            np.array([m for d in decisions.values() for m in d.following], np.int64),
        )
        if remembers:
            return finite_memory_strategy(self.engine, read, first or 0)
        rows = self.groups[:-1].copy()
        decided = np.zeros(self.engine.states, np.bool_)
        decided[read.state] = True
        best = np.lexsort((read.row, read.share))  # a likeliest row of a state comes last
        rows[read.state[best]] = read.row[best]
        strategy = Strategy(self.engine, rows, None, decided)
        if len(read.row) == len(decisions):
            return strategy
        weights = numbers(np.zeros(self.engine.matrix.rows), rational=self.engine.is_rational)
        weights[rows[~decided]] = numbers(np.ones(1), rational=self.engine.is_rational)[0]
        np.add.at(weights, read.row, read.share)
        return replace(strategy, weights=weights)

    def _decisions(self) -> tuple[dict[Pair, _Decision], bool]:
        """The decision of each pair of a state and a memory value, and whether there is memory."""
        decisions: dict[Pair, _Decision] = {}
        lines = ["".join(words) for words in self.file.rows]
        indices = all(_INDICES.fullmatch(line) for line in lines)
        kinds = set()
        for i, line in enumerate(lines):
            match = _LINE.fullmatch(line)
            if match is None:
                expected = "a line should hold a state, '=', and an action or the index of a choice"
                self.file.fault(i, expected, "fields", None, "such as (0,true)=go, 3=go or 3=0")
            state, memory, choice = match.groups()
            kinds.add(memory is not None)
            if len(kinds) > 1:
                self.file.fault(i, "some lines have a memory value, and others have none", "fields")
            pair = self._number(i, state), int(memory or 0)
            if pair in decisions:
                self.file.fault(i, f"state {state} is in the file already", "repeated")
            decisions[pair] = self._decision(i, pair, choice, index=indices)
        return decisions, True in kinds

    def _decision(self, line: int, pair: Pair, text: str, *, index: bool) -> _Decision:
        if not _MIXED.fullmatch(text):
            row = self._row(line, pair[0], text, index=index)
            return _Decision(line, [row], [Fraction(1)], [pair[1]])
        parts = [part.split(":") for part in text.split("+")]
        shares = [Fraction(share) for share, _ in parts]
        total = sum(shares, Fraction(0))
        if abs(total - 1) > _SUM:
            shown = f"{float(total):g}" if total < 1000 else "more than 1000"
            message = f"the probabilities of the choices sum to {shown}, not 1"
            self.file.fault(line, message, "sum")
        rows = [self._row(line, pair[0], choice, index=index) for _, choice in parts]
        return _Decision(line, rows, [s / total for s in shares], [pair[1]] * len(rows))

    def _changes(self, decisions: dict[Pair, _Decision]) -> int | None:
        """Read from comments how the memory changes; its first value, None if there are none."""
        first = None
        for line in self.file.source.text.split("\n"):
            text = "".join(line.split())
            if match := _FIRST.fullmatch(text):
                first = int(match[1])
            elif match := _CHANGE.fullmatch(text):
                pair = self._number(0, match[1]), int(match[2])
                after = [int(m) for m in match[3].split("+")]
                decision = decisions.get(pair)
                if decision is None or len(after) != len(decision.rows):
                    self.file.fault(
                        0 if decision is None else decision.line,
                        f"the comment '{line.strip()}' belongs to no choice of this file",
                        "memory",
                    )
                decision.following = after
        return first

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
        actions = self.actions[start:stop]
        if choice not in actions:
            known = ", ".join(f"'{a}'" for a in dict.fromkeys(actions))
            message = f"the state has no choice with action '{choice}': it has {known}"
            self.file.fault(line, message, "action")
        if actions.count(choice) > 1:
            self.file.fault(
                line,
                f"the state has {actions.count(choice)} choices with action '{choice}'",
                "action",
                None,
                "a file of type indices tells them apart",
            )
        return int(start + actions.index(choice))
