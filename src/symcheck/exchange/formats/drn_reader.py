"""Read Storm's DRN format: one text holds the whole model (see drn.py)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path

import numpy as np

from symcheck.errors import Diagnostic, Source, Span, SyntaxFault
from symcheck.exchange.column_reader import first_true, read_file, real
from symcheck.exchange.explicit_data import (
    OBSERVATION,
    ExplicitData,
    ExplicitRewards,
    interval_fault,
    interval_sums_fault,
)
from symcheck.explicit.explored import RACE
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.semantics.state_faults import SUM_TOLERANCE
from symcheck.syntax.ast import ModelType, Type

__all__ = ["read_drn"]

_STATE = re.compile(
    r"state\s+(?P<number>\d+)(?:\s+!(?P<rate>\S+))?(?P<player>\s+<\S*>)?(?:\s+\{(?P<observation>.*?)\})?"
    r"(?:\s+\[(?P<rewards>[^]]*)\])?(?P<labels>(?!\s*\[).*)"
)
_ACTION = re.compile(r"action\s+(?P<name>[^[]*?)(?:\s+\[(?P<rewards>[^]]*)\])?")
_VALUE = r"([^\[\],\s]+)"
_TRANSITION = re.compile(rf"(\d+)\s*:\s*(?:{_VALUE}|\[\s*{_VALUE}\s*,\s*{_VALUE}\s*\])")
_LABEL = re.compile(r'"([^"]*)"|(\S+)')
_NONE = "__NOLABEL__"
_TYPES = {kind.name: kind for kind in ModelType} | {"Markov Automaton": ModelType.MA}


@dataclass
class _Parts:
    """What the lines of states, actions and transitions say.

    state_lines: the line of each state, and lines that of each row. rates: per state, NaN where
    none is told. first_rows: per state. first_entries: per row. in_action: the targets in the last
    row.
    """

    state_lines: list[int] = field(default_factory=list)
    rates: list[float] = field(default_factory=list)
    first_rows: list[int] = field(default_factory=list)
    first_entries: list[int] = field(default_factory=list)
    actions: list[str] = field(default_factory=list)
    targets: list[int] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    in_action: set[int] = field(default_factory=set)
    labels: dict[str, list[int]] = field(default_factory=dict)
    state_rewards: list[list[float]] = field(default_factory=list)
    row_rewards: list[list[float]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    observations: list[int] = field(default_factory=list)
    first_observed: int = 0


def read_drn(path: Path, kind: ModelType | None = None, *, check_sums: bool = True) -> ExplicitData:
    """The model in a file. Characters of labels that names do not have become underscores.

    Args:
        path: the file.
        kind: the model type that the file should have; None for any.
        check_sums: check that probabilities sum to 1.

    Raises:
        UsageError: the file cannot be read.
        SyntaxFault: the file is faulty; the error points at the place.

    Source: https://www.stormchecker.org/documentation/background/drn.html
    """
    return _Reader(Source(str(path), read_file(path))).model(kind, check_sums)


class _Reader:
    def __init__(self, source: Source) -> None:
        self.source = source
        self.lines = source.text.split("\n")
        self.at = 0
        self.kind = ModelType.DTMC

    def fault(self, line: int, message: str, hint: str | None = None) -> SyntaxFault:
        """The error for a line, from 0."""
        start = sum(len(text) + 1 for text in self.lines[:line])
        text = self.lines[line] if line < len(self.lines) else ""
        lead = len(text) - len(text.lstrip())
        span = Span(self.source, start + lead, start + max(len(text), 1))
        return SyntaxFault(Diagnostic(message, span, "drn", hint))

    def model(self, kind: ModelType | None, check_sums: bool) -> ExplicitData:
        model_type, names, n = self._header(kind)
        self.kind = model_type
        parts = self._parts(n)
        rows = len(parts.first_entries)
        lengths = np.diff([*parts.first_entries, len(parts.targets)])
        groups = np.array([*parts.first_rows, rows], np.int64)
        counts = np.diff(groups)
        values = np.array(parts.values, np.float64)
        targets = np.array(parts.targets, np.int32)
        if not model_type.has_choices:
            for i in first_true(counts > 1):
                row = int(groups[i]) + 1
                raise self.fault(parts.lines[row], f"a state of a {model_type.name} has one action")
            row_lengths = np.zeros(n, np.int64)
            row_lengths[np.flatnonzero(counts)] = lengths
        else:
            row_lengths = lengths
        indptr = starts_of(row_lengths)
        row_of = np.repeat(np.arange(rows), lengths)
        intervals = parts.lower != parts.values
        if intervals:
            lower = np.array(parts.lower)
            for i, message, hint in interval_sums_fault(row_of, lower, values, rows):
                raise self.fault(parts.lines[i], message, hint)
        elif model_type.has_probabilities and check_sums:
            self._check_sums(parts, values, row_of)
        matrix = self._matrix(indptr, targets, values, n, groups, model_type, parts)
        actions, codes = self._actions(parts, groups)
        contributions = None
        row_actions = codes if model_type.has_choices else np.full(n, -1, np.int32)
        if not model_type.has_choices and actions:
            state_of_row = np.flatnonzero(counts)
            contributions = Contributions(
                state_of_row[row_of], targets.astype(np.int64), codes[row_of], values
            )
        rewards = self._rewards(names, parts, model_type, matrix, counts)
        if model_type.immediate_choices:
            matrix, row_actions, rewards = _with_rates(parts, matrix, row_actions, rewards)
        columns = [("x", Type.INT, np.arange(n))]
        if parts.observations and not model_type.partially_observed:
            message = f"states of a {model_type.name} have no observations"
            raise self.fault(parts.first_observed, message)
        if model_type.partially_observed:
            if len(parts.observations) != n:
                raise self.fault(
                    0, f"{len(parts.observations)} of the {n} states of a POMDP have an observation"
                )
            columns.append((OBSERVATION, Type.INT, np.array(parts.observations, np.int64)))
        return ExplicitData(
            model_type,
            columns,
            matrix,
            actions,
            row_actions,
            {name: _members(states, n) for name, states in parts.labels.items()},
            rewards,
            None if intervals else contributions,
            lower=self._sorted(indptr, targets, parts.lower) if intervals else None,
        )

    def _check_sums(self, parts: _Parts, values: Floats, row_of: Int64s) -> None:
        """Check that the probabilities of each action sum to 1."""
        sums = np.bincount(row_of, values, len(parts.lines))
        for i in first_true(np.abs(sums - 1) > SUM_TOLERANCE):
            message = f"the probabilities of this action sum to {sums[i]:.12g}, not to 1"
            raise self.fault(parts.lines[i], message)

    def _sorted(self, indptr: Int64s, targets: Int32s, values: list[float]) -> Floats:
        """Values of the transitions in the order of the matrix."""
        row = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        return np.array(values)[np.lexsort((targets, row))]

    # ------------------------------------------------------------------------------------- header

    def _header(self, kind: ModelType | None) -> tuple[ModelType, list[str], int]:
        """The model type, the names of the rewards, and the number of states."""
        model_type: ModelType | None = None
        names: list[str] = []
        n = 0
        for line, text in self._significant():
            word, _, rest = text.partition(":") if text.startswith("@type") else (text, "", "")
            rest = rest.strip()
            match word.strip():
                case "@type":
                    if rest not in _TYPES:
                        raise self.fault(line, f"a model of type {rest} is not supported", _hint())
                    model_type = _TYPES[rest]
                    if kind is not None and kind is not model_type:
                        raise self.fault(
                            line, f"the file holds a {rest}, and a {kind.name} is asked for"
                        )
                case "@parameters":
                    if self._next_line():
                        raise self.fault(self.at - 1, "parametric models are not supported")
                case "@reward_models":
                    names = self._next_line().split()
                case "@nr_states":
                    n = self._count("the number of states")
                case "@nr_choices":
                    self._count("the number of choices")
                case "@model":
                    if model_type is None or not n:
                        raise self.fault(line, "@type and @nr_states stand before @model")
                    return model_type, names, n
                case other if other.startswith("@value_type"):
                    if "parametric" in other:
                        raise self.fault(line, "values that are no numbers are not supported")
                case "@placeholders":
                    if self._next_line():
                        raise self.fault(self.at - 1, "placeholders are not supported")
                case _:
                    raise self.fault(line, "a line of the header starts with @", _hint())
        raise self.fault(len(self.lines) - 1, "the file has no @model", _hint())

    def _significant(self) -> Iterator[tuple[int, str]]:
        """The lines from the current one on that are not empty and no comments."""
        while self.at < len(self.lines):
            line, text = self.at, self.lines[self.at].strip()
            self.at += 1
            if text and not text.startswith("//"):
                yield line, text

    def _next_line(self) -> str:
        """The line that belongs to the one before; it may be empty."""
        if self.at >= len(self.lines) or self.lines[self.at].lstrip().startswith("@"):
            return ""
        self.at += 1
        return self.lines[self.at - 1].strip()

    def _count(self, what: str) -> int:
        text = self._next_line()
        if not text.isdigit():
            raise self.fault(self.at - 1, f"{what} is expected here")
        return int(text)

    # ------------------------------------------------------------------------------------- states

    def _parts(self, n: int) -> _Parts:
        parts = _Parts()
        for line, text in self._significant():
            if text.startswith("state"):
                self._state(parts, line, text, n)
            elif text.startswith("action"):
                self._action(parts, line, text)
            else:
                self._transition(parts, line, text, n)
        if len(parts.first_rows) != n:
            raise self.fault(
                len(self.lines) - 1,
                f"the header announces {n} states, but {len(parts.first_rows)} follow",
            )
        return parts

    def _state(self, parts: _Parts, line: int, text: str, n: int) -> None:
        match = _STATE.fullmatch(text)
        if match is None:
            raise self.fault(line, "a state is written as: state NUMBER [rewards] labels")
        if match["player"] is not None:
            raise self.fault(line, "players are not supported", _hint())
        observation = match["observation"]
        if observation is not None:
            if not observation.strip().isdigit():
                raise self.fault(line, f"the observation '{observation}' is not a whole number")
            if not parts.observations:
                parts.first_observed = line
            parts.observations.append(int(observation))
        number = len(parts.first_rows)
        if int(match["number"]) != number or number >= n:
            raise self.fault(
                line, f"state {number} is expected here" if number < n else "one state more"
            )
        parts.state_lines.append(line)
        parts.first_rows.append(len(parts.first_entries))
        rate = np.nan if match["rate"] is None else self._number(line, match["rate"])
        if match["rate"] is not None and not self.kind.continuous_time:
            raise self.fault(line, f"states of {self.kind.one} have no exit rates")
        if rate < 0:
            raise self.fault(line, "an exit rate must not be negative")
        parts.rates.append(rate)
        parts.state_rewards.append(self._numbers(line, match["rewards"]))
        for quoted, plain in _LABEL.findall(match["labels"]):
            label = re.sub(r"\W", "_", quoted or plain)  # a name that properties can refer to
            parts.labels.setdefault(label, []).append(number)

    def _action(self, parts: _Parts, line: int, text: str) -> None:
        match = _ACTION.fullmatch(text)
        if match is None or not parts.first_rows:
            raise self.fault(
                line, "an action is written as: action NAME [rewards], after its state"
            )
        parts.first_entries.append(len(parts.targets))
        parts.in_action.clear()
        parts.lines.append(line)
        parts.actions.append(match["name"])
        parts.row_rewards.append(self._numbers(line, match["rewards"]))

    def _transition(self, parts: _Parts, line: int, text: str, n: int) -> None:
        match = _TRANSITION.fullmatch(text)
        if match is None:
            raise self.fault(line, "a transition is written as: STATE : PROBABILITY")
        if not parts.first_entries or parts.first_rows[-1] == len(parts.first_entries):
            raise self.fault(line, "an action is expected before this transition")
        target, value = int(match[1]), self._number(line, match[2] or match[4])
        lower = value if match[3] is None else self._number(line, match[3])
        if target >= n:
            raise self.fault(line, f"state {target} does not exist: there are {n}, numbered from 0")
        if lower != value:
            if self.kind.continuous_time:
                raise self.fault(line, "intervals of rates are not supported")
            message, hint = interval_fault(lower, value)
            if message:
                raise self.fault(line, message, hint)
        if value < 0:
            raise self.fault(line, "a probability or rate must be finite and not negative")
        if value > 0:
            if target in parts.in_action:
                raise self.fault(line, "this transition is in the action already")
            parts.in_action.add(target)
            parts.targets.append(target)
            parts.values.append(value)
            parts.lower.append(lower)

    def _numbers(self, line: int, text: str | None) -> list[float]:
        return [self._number(line, part.strip()) for part in text.split(",")] if text else []

    def _number(self, line: int, text: str) -> float:
        try:
            number = real(text)
        except (ValueError, ArithmeticError):
            raise self.fault(line, f"'{text}' is not a number") from None
        if not isfinite(number):
            raise self.fault(line, f"'{text}' is not a finite number")
        return number

    # -------------------------------------------------------------------------------------- parts

    def _matrix(
        self,
        indptr: Int64s,
        targets: Int32s,
        values: Floats,
        n: int,
        groups: Int64s,
        type: ModelType,
        parts: _Parts,
    ) -> SparseMatrix:
        row = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        order = np.lexsort((targets, row))
        matrix = SparseMatrix(
            indptr,
            targets[order],
            values[order],
            n,
            groups if type.has_choices else None,
        )
        if not type.has_probabilities:
            rates, sums = np.array(parts.rates), np.bincount(row, values, n)
            differ = np.abs(rates - sums) > 1e-6 * np.maximum(rates, sums)
            for i in first_true(differ):
                message = f"the rates of state {i} sum to {sums[i]:g}, not to {rates[i]:g}"
                raise self.fault(parts.state_lines[i], message)
        return matrix

    def _actions(self, parts: _Parts, groups: Int64s) -> tuple[tuple[str, ...], Int32s]:
        """The names of the actions, and the index of that of each row. A number is no name."""
        index_in_state = np.arange(len(parts.actions)) - np.repeat(groups[:-1], np.diff(groups))
        actions = [
            "" if name in (_NONE, str(i)) else name
            for name, i in zip(parts.actions, index_in_state.tolist(), strict=True)
        ]
        names = tuple(dict.fromkeys(name for name in actions if name))
        index = {"": -1} | {name: i for i, name in enumerate(names)}
        return names, np.array([index[name] for name in actions], np.int32)

    def _rewards(
        self,
        names: list[str],
        parts: _Parts,
        type: ModelType,
        matrix: SparseMatrix,
        counts: Int64s,
    ) -> list[ExplicitRewards]:
        """The reward structures. In a CTMC those of actions are earned by each transition."""
        count = max((len(r) for r in (*parts.state_rewards, *parts.row_rewards)), default=0)
        if len(names) > count:
            count = len(names)
        names = [*[""] * (count - len(names)), *names]
        states, rows = np.zeros((count, matrix.states)), np.zeros((count, matrix.rows))
        for i, rewards in enumerate(parts.state_rewards):
            states[: len(rewards), i] = rewards
        earning_rows = np.arange(matrix.rows) if type.has_choices else np.flatnonzero(counts)
        for i, rewards in zip(earning_rows.tolist(), parts.row_rewards, strict=True):
            rows[: len(rewards), i] = rewards
        if not type.has_probabilities:
            rows *= np.bincount(
                np.repeat(np.arange(matrix.rows), np.diff(matrix.indptr)), matrix.data, matrix.rows
            )
        return [
            ExplicitRewards(name or None, s, r)
            for name, s, r in zip(names, states, rows, strict=True)
        ]


def _with_rates(
    parts: _Parts, matrix: SparseMatrix, actions: Int32s, rewards: list[ExplicitRewards]
) -> tuple[SparseMatrix, Int32s, list[ExplicitRewards]]:
    """The rows of a Markov automaton: a state with a rate begins with the row of its successors.

    If it has others, this row never happens (maximal progress).
    """
    groups = matrix.groups
    assert groups is not None
    rates, counts = np.nan_to_num(np.array(parts.rates)), np.diff(groups)
    timed = np.zeros(matrix.rows, np.bool_)
    timed[groups[:-1][(rates > 0) & (counts > 0)]] = True
    of = matrix.state_of_row
    factor = np.where(timed, rates[of], 1.0)
    kept = np.flatnonzero(~timed | (counts[of] == 1))
    scaled = replace(matrix, data=matrix.data * factor[matrix.row_of_entry])
    return (
        scaled.choose(kept, starts_of(np.bincount(of[kept], minlength=matrix.states))),
        np.where(timed, RACE, actions)[kept].astype(np.int32),
        [r._replace(rows=(r.rows * factor)[kept]) for r in rewards],
    )


def _members(states: list[int], n: int) -> Bools:
    members = np.zeros(n, bool)
    members[states] = True
    return members


def _hint() -> str:
    return "DTMCs, CTMCs, MDPs, POMDPs and Markov automata are supported"
