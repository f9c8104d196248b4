"""Read PRISM's explicit files: .tra .sta .lab .srew .trew, and .pexp, which holds them all."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count, takewhile
from pathlib import Path

import numpy as np

from symcheck.errors import MemoryLimitError, Source, UnsupportedError, UsageError
from symcheck.exchange.column_reader import Columns, columns_of, first_true, read_source
from symcheck.exchange.explicit_data import (
    ExplicitData,
    ExplicitRewards,
    interval_fault,
    interval_sums_fault,
    row_rewards,
)
from symcheck.exchange.formats.combined_file import ModelParts, parts_of
from symcheck.machine import available_memory
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.semantics.state_faults import SUM_TOLERANCE
from symcheck.syntax.ast import ModelType, Type
from symcheck.tables import counted
from symcheck.whole_file import uncompressed_name

__all__ = ["ModelFiles", "model_files", "read_files", "read_model"]

_INT_LIMIT = 1 << 62
_STATE_BYTES = 24
"""The least memory of a state: the start of its row, its variable, and a temporary array. Linux
promises more memory than there is, and kills a process that uses it."""
_KINDS = ("tra", "sta", "lab", "srew", "trew")
_IN_DRN_FILES = "DRN files hold Markov automata and partially observable models"
_INTERVAL = re.compile(r"\[([^\[\],]+),([^\[\],]+)\]")
_CHAIN_WORDS = "source, target, probability or rate"


ModelFiles = ModelParts[Path]
"""The files of one model."""


@dataclass(frozen=True, eq=False)
class _Transitions:
    """What a .tra file holds: the matrix, and the action of each row, or of parts of a chain; of
    intervals, the lower ends too.
    """

    type: ModelType
    matrix: SparseMatrix
    actions: tuple[str, ...]
    row_actions: Int32s
    contributions: Contributions | None = None
    lower: Floats | None = None


def model_files(argument: str) -> ModelFiles:
    """The files that `base.all` or `base.tra,sta,…` name.

    `.all` takes the files that exist, `.all.gz` and `.all.xz` compressed ones. Rewards are in
    `base.srew` and `base.trew`, or, for several structures, in `base1.srew`, `base2.srew`, ….

    Raises:
        UsageError: an extension is unknown, or a file is missing.
    """
    named, packed = uncompressed_name(argument)
    base, dot, listed = named.rpartition(".")
    kinds = set(listed.split(","))
    if not dot or not kinds <= {*_KINDS, "rew", "all"}:
        raise UsageError(
            f"'{argument}' does not end in .all, .pexp, .umb, .drn, or some of .{',.'.join(_KINDS)}"
        )
    everything = "all" in kinds
    if everything or "rew" in kinds:
        kinds |= {"srew", "trew"}

    def one(kind: str) -> Path | None:
        path = Path(f"{base}.{kind}{packed}")
        return path if kind in kinds or (everything and path.is_file()) else None

    def pair(number: object) -> tuple[Path | None, Path | None]:
        paths = {k: Path(f"{base}{number}.{k}{packed}") for k in ("srew", "trew") if k in kinds}
        existing = {kind: path for kind, path in paths.items() if path.is_file()}
        return existing.get("srew"), existing.get("trew")

    rewards = [*filter(any, [pair("")]), *takewhile(any, map(pair, count(1)))]
    if not rewards and not everything and kinds & {"srew", "trew"}:
        raise UsageError(
            f"there is no reward file '{base}.srew', '{base}1.srew', or the same with .trew"
        )
    return ModelFiles(Path(f"{base}.tra{packed}"), one("sta"), one("lab"), tuple(rewards))


def read_files(
    argument: str, kind: ModelType | None = None, *, check_sums: bool = True
) -> ExplicitData:
    """The model that `-importmodel` names.

    That is `base.all` (see `model_files`), `file.pexp`, `file.umb` or `file.drn`.

    Raises:
        UsageError: a file is missing or cannot be read.
        SyntaxFault: a file is faulty; the error points at the place.
        UnsupportedError: the model is of another type than DTMC, CTMC or MDP.
    """
    names, _, options = argument.rpartition(":")
    if options == "format=umb" or argument.endswith(".umb"):
        from symcheck.exchange.formats.umb_reader import read_umb

        return read_umb(
            Path(names if options == "format=umb" else argument), kind, check_sums=check_sums
        )
    if options == "format=drn" or uncompressed_name(argument)[0].endswith(".drn"):
        from symcheck.exchange.formats.drn_reader import read_drn

        path = Path(names if options == "format=drn" else argument)
        return read_drn(path, kind, check_sums=check_sums)
    if options == "format=pexp" or uncompressed_name(argument)[0].endswith(".pexp"):
        path = Path(names if options == "format=pexp" else argument)
        return _model(parts_of(read_source(path)), kind, check_sums)
    files = model_files(names if options == "format=explicit" else argument)
    return read_model(files, kind, check_sums=check_sums)


def read_model(
    files: ModelFiles, kind: ModelType | None = None, *, check_sums: bool = True
) -> ExplicitData:
    """The model in the given files.

    Args:
        files: where the parts of the model are.
        kind: the model type. None: as a comment of the transitions file says; without a comment,
            an MDP if transitions have choices, a DTMC if all rows sum to 1, else a CTMC.
        check_sums: check that probabilities sum to 1.

    Raises:
        SyntaxFault: a file is faulty; the error points at the place.
    """

    def text(path: Path | None) -> Source | None:
        return None if path is None else read_source(path)

    texts = ModelParts(
        read_source(files.transitions),
        text(files.states),
        text(files.labels),
        tuple((text(states), text(transitions)) for states, transitions in files.rewards),
    )
    return _model(texts, kind, check_sums)


def _model(texts: ModelParts[Source], kind: ModelType | None, check_sums: bool) -> ExplicitData:
    if kind is not None and kind.has_own_syntax:
        raise UnsupportedError(
            f"{texts.transitions.name} cannot hold {kind.called}", hint=_IN_DRN_FILES
        )
    result = _read_transitions(texts.transitions, kind, check_sums)
    n = result.matrix.states
    columns = _read_states(texts.states, n) if texts.states else [("x", Type.INT, np.arange(n))]
    labels = _read_labels(texts.labels, n) if texts.labels else {}
    rewards = [_read_rewards(pair, result) for pair in texts.rewards]
    return ExplicitData(
        result.type,
        columns,
        result.matrix,
        result.actions,
        result.row_actions,
        labels,
        rewards,
        result.contributions,
        lower=result.lower,
    )


# ------------------------------------------------------------------------------------- transitions


def _read_transitions(part: Source, kind: ModelType | None, check_sums: bool) -> _Transitions:
    file = columns_of(part)
    size = file.header(
        (2, 3), "the numbers of states and transitions, or of states, choices and transitions"
    )
    has_choices = len(size) == 3
    if size[0] == 0:
        file.fault(0, "a model has at least one state", "count", 0)
    if size[0] >= 2**31:
        file.fault(0, "an explicit model has at most 2**31 - 1 states", "count", 0)
    if kind is not None and kind.has_choices != has_choices:
        holds = (
            "an MDP has states, choices and transitions"
            if kind.has_choices
            else f"a {kind.name} has states and transitions"
        )
        file.fault(
            0, f"{holds} in the first line", "header", None, f"the switch -{kind.value} requires it"
        )
    file.expect(size[-1], "transitions")
    first = 2 if has_choices else 1  # the word of the target
    action = first + 1 if has_choices and _is_lts(file) else first + 2
    words = "source, choice, target, probability" if has_choices else _CHAIN_WORDS
    if action == 3 and has_choices:
        words = "source, choice, target"
    file.widths((action, action + 1), f"{words}, and perhaps an action")
    n = size[0]
    if n > available_memory() // _STATE_BYTES:
        raise MemoryLimitError(f"{part.name}: {n:,} states take more than the free memory")
    source, target = file.integers(0, n, "state"), file.integers(first, n, "state")
    lower: Floats | None = None
    if action == first + 1:
        weights = np.ones(len(source))
    elif _has_intervals(file, first + 1):
        lower, weights = _intervals(file, first + 1)
    else:
        weights = _weights(file, first + 1)
    choice = file.integers(1, _INT_LIMIT, "choice") if has_choices else np.zeros_like(source)
    order = np.lexsort((target, choice, source))
    # A chain with actions may have several lines for a pair of states, one per action.
    contributions: Contributions | None = None
    actions: tuple[str, ...] = ()
    if has_choices or file.table is not None:
        _unique(file, order, source, choice, target)
    else:
        actions, codes = _action_codes(file, 3)
        by = np.lexsort((codes, target, source))
        _unique(file, by, source, target, codes.astype(np.int64))
        if actions and lower is None:
            contributions = Contributions(source, target, codes, weights)
    source, target, values = source[order], target[order], weights[order]
    row, rows, groups = source, n, None
    row_actions: Int32s = np.full(n, -1, np.int32)
    if has_choices:
        rows = size[1]
        row, groups = _choices(file, order, source, choice[order], n, rows)
        actions, row_actions = _read_actions(file, order, row, rows, action)
    sums: Floats = np.bincount(row, values, rows).astype(np.float64)
    of_choices = ModelType.with_properties(has_choices=True)
    told = kind or _told_type(file)
    model_type = of_choices if has_choices else told
    if lower is not None:
        lower, model_type = lower[order], model_type or ModelType.DTMC
        if model_type.continuous_time:
            file.fault(0, "intervals of rates are not supported", "interval")
        for i, message, hint in interval_sums_fault(row, lower, values, rows):
            line = int(order[np.searchsorted(row, i)]) + 1
            file.fault(line, message, "interval-sum", None, hint)
    is_one = np.abs(sums - 1) <= SUM_TOLERANCE
    if model_type is None:
        are_rates = not np.all(is_one | (sums == 0))
        model_type = ModelType.with_properties(continuous_time=are_rates)
    if not model_type.continuous_time and check_sums and lower is None:
        for i in first_true(~is_one & (has_choices | (sums != 0))):
            at = int(np.searchsorted(row, i))
            what = f"probabilities {'of a choice' if has_choices else 'out'} of state {source[at]}"
            message = f"the {what} sum to {sums[i]:.12g}, not to 1"
            file.fault(int(order[at]) + 1, message, "update-sum")
    keep = values > 0
    entries, index = np.unique(row[keep] * n + target[keep], return_inverse=True)
    indptr = starts_of(np.bincount(entries // n, minlength=rows))
    total: Floats = np.bincount(index, values[keep], len(entries)).astype(np.float64)
    matrix = SparseMatrix(indptr, (entries % n).astype(np.int32), total, n, groups)
    if lower is not None:
        lower = np.bincount(index, lower[keep], len(entries)).astype(np.float64)
    return _Transitions(model_type, matrix, actions, row_actions, contributions, lower)


def _choices(
    file: Columns, order: Int64s, source: Int64s, choice: Int64s, n: int, rows: int
) -> tuple[Int64s, Int64s]:
    """The row of each transition of an MDP, and the first row of each state."""
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(source) != 0) | (np.diff(choice) != 0)
    starts = np.flatnonzero(new)
    if len(starts) != rows:
        message = f"the first line announces {rows} choices, but {len(starts)} follow"
        file.fault(0, message, "count", 1)
    groups = starts_of(np.bincount(source[starts], minlength=n))
    expected = np.arange(rows) - groups[source[starts]]
    for i in first_true(choice[starts] != expected):
        missing = f"choice {expected[i]} of state {source[starts[i]]}"
        message = f"{missing} is missing before this one"
        file.fault(int(order[starts[i]]) + 1, message, "choice", 1)
    return np.cumsum(new) - 1, groups


def _weights(file: Columns, word: int) -> Floats:
    values = file.reals(word)
    for i in first_true(~(values >= 0) | np.isinf(values)):
        file.fault(i + 1, "a probability or rate must be finite and not negative", "negative", word)
    return values


def _has_intervals(file: Columns, word: int) -> bool:
    return file.table is None and any(row[word].startswith("[") for row in file.rows[1:])


def _intervals(file: Columns, word: int) -> tuple[Floats, Floats]:
    """The lower and the upper end of each line; those of a number coincide."""
    ends = np.empty((2, len(file.rows) - 1))
    for i, row in enumerate(file.rows[1:], 1):
        match = _INTERVAL.fullmatch(row[word])
        low, high = (
            file.real(i, text, word)
            for text in ((match[1], match[2]) if match else (row[word], row[word]))
        )
        message, hint = interval_fault(low, high)
        if message:
            file.fault(i, message, "interval", word, hint)
        ends[:, i - 1] = low, high
    return ends[0], ends[1]


def _unique(file: Columns, order: Int64s, *keys: Int64s) -> None:
    same = np.ones(max(len(order) - 1, 0), bool)
    for key in keys:
        same &= np.diff(key[order]) == 0
    for i in first_true(same):
        file.fault(
            max(int(order[i]), int(order[i + 1])) + 1,
            "this transition is in the file already",
            "repeated",
        )


def _read_actions(
    file: Columns, order: Int64s, row: Int64s, rows: int, word: int
) -> tuple[tuple[str, ...], Int32s]:
    """The actions in order of appearance, and the action of each row (its lines must agree).

    word: the place of the action in a line.
    """
    names, codes = _action_codes(file, word)
    codes = codes[order]
    first = np.searchsorted(row, np.arange(rows))
    result: Int32s = codes[first]
    for i in first_true(codes != result[row]):
        file.fault(
            int(order[i]) + 1, "the transitions of one choice have different actions", "action"
        )
    return names, result


def _action_codes(file: Columns, word: int) -> tuple[tuple[str, ...], Int32s]:
    """The actions in order of appearance, and the index of that of each line, -1 for none.

    word: the place of the action in a line.
    """
    texts = [r[word] if len(r) > word else "" for r in file.rows[1:]]
    names = tuple(dict.fromkeys(t for t in texts if t))
    number = {"": -1} | {name: i for i, name in enumerate(names)}
    return names, np.array([number[t] for t in texts], np.int32)


def _is_lts(file: Columns) -> bool:
    """Whether choices have no probabilities: a labelled transition system, which is an MDP here."""
    if "Transitions (LTS)" in file.comments:
        return True
    if file.table is not None:
        return bool(file.table.shape[1] == 3)
    first = file.rows[1] if len(file.rows) > 1 else []
    return len(first) == 3 or (len(first) == 4 and not re.match(r"[-+.\d[]", first[3]))


def _told_type(file: Columns) -> ModelType | None:
    """The model type that a comment such as `Transitions (CTMC)` states."""
    for comment in file.comments:
        if match := re.fullmatch(r"Transitions \(([A-Z]+)\)", comment):
            if match[1] in ("DTMC", "CTMC", "MDP"):
                return ModelType(match[1].lower())
            if match[1] != "LTS":
                message = f"a comment calls this a {match[1]}, and the file lacks a part of it"
                file.fault(0, message, "header", None, _IN_DRN_FILES)
    return None


# ------------------------------------------------------------------------------- states and labels


def _read_states(part: Source, n: int) -> list[tuple[str, Type, Int64s]]:
    file = columns_of(part)
    text = "".join(file.first)
    match = re.fullmatch(r"\(([^()]*)\)", text)
    if match is None:
        file.fault(0, "the first line should hold the names of the variables, as (x,y)", "header")
    names = [x for x in match[1].split(",") if x]
    if len(set(names)) < len(names):
        file.fault(0, "two variables have the same name", "repeated")
    if len(file.rows) - 1 != n:
        file.fault(
            len(file.rows) - 1,
            f"the transitions file has {counted(n, 'state')}, "
            f"but this file has {len(file.rows) - 1}",
            "count",
        )
    values: list[list[str]] = [[""] * len(names) for _ in range(n)]
    for i, words in enumerate(file.rows[1:], 1):
        result = re.fullmatch(r"(\d+):\(([^()]*)\)", "".join(words))
        cells = [x for x in result[2].split(",") if x] if result else []
        if result is None or len(cells) != len(names):
            file.fault(i, f"a state is written as number:({','.join(names)})", "fields")
        number = int(result[1])
        if number >= n:
            file.fault(i, f"state {number} does not exist: there are {n}, numbered from 0", "index")
        if names and values[number][0]:
            file.fault(i, f"state {number} is in the file already", "repeated")
        values[number] = cells
    return [_column(file, name, [v[j] for v in values]) for j, name in enumerate(names)] or [
        ("x", Type.INT, np.arange(n))
    ]


def _column(file: Columns, name: str, texts: list[str]) -> tuple[str, Type, Int64s]:
    if all(t in ("true", "false") for t in texts):
        return name, Type.BOOL, np.array([t == "true" for t in texts], np.int64)
    try:
        return name, Type.INT, np.array(list(map(int, texts)), np.int64)
    except (ValueError, OverflowError):
        bad = next(t for t in texts if not re.fullmatch(r"-?\d{1,18}", t))
        line = next(
            i for i, row in enumerate(file.rows[1:], 1) if bad in re.split(r"[(),:]", "".join(row))
        )
        file.fault(line, f"'{bad}' is not a value of the variable {name}", "number")


def _read_labels(part: Source, n: int) -> dict[str, Bools]:
    file = columns_of(part)
    declared = re.findall(r'(\d+)="([^"]*)"', " ".join(file.first))
    if not declared:
        file.fault(0, 'the first line should hold the labels, as 0="init" 1="deadlock"', "header")
    names = {int(i): name for i, name in declared}
    members = {name: np.zeros(n, bool) for name in names.values()}
    for i, words in enumerate(file.rows[1:], 1):
        state, colon, rest = " ".join(words).partition(":")
        numbers = rest.split()
        if not colon or not all(map(str.isdigit, (state.strip(), *numbers))):
            file.fault(i, "a line should hold a state, a colon, and numbers of labels", "fields")
        if int(state) >= n:
            file.fault(
                i, f"state {state} does not exist: there are {n}, numbered from 0", "index", 0
            )
        for number in map(int, numbers):
            if number not in names:
                file.fault(i, f"label {number} is not in the first line", "index")
            members[names[number]][int(state)] = True
    if "init" in members and not members["init"].any():
        file.fault(0, 'no state has the label "init"', "initial")
    return members


# ----------------------------------------------------------------------------------------- rewards


def _read_rewards(
    pair: tuple[Source | None, Source | None], model: _Transitions
) -> ExplicitRewards:
    m = model.matrix
    result = ExplicitRewards(None, np.zeros(m.states), np.zeros(m.rows))
    if pair[0] is not None:
        file = columns_of(pair[0])
        size = file.header((2,), "the numbers of states and of rewards")
        _same_size(file, size[:1], (m.states,))
        file.expect(size[1], "rewards")
        file.widths((2,), "a state and a reward")
        result.states[file.integers(0, m.states, "state")] = _finite(file, 1)
        result = result._replace(name=_reward_name(file))
    if pair[1] is not None:
        file = columns_of(pair[1])
        entries = _transition_rewards(file, model)
        result = result._replace(
            name=result.name or _reward_name(file),
            rows=row_rewards(model.type, m, entries),
            entries=entries,
        )
    return result


def _finite(file: Columns, word: int) -> Floats:
    rewards = file.reals(word)
    for i in first_true(~np.isfinite(rewards)):
        file.fault(i + 1, "a reward must be finite", "number", word)
    return rewards


def _reward_name(file: Columns) -> str | None:
    for comment in file.comments:
        if match := re.fullmatch(r'Reward structure:? "([^"]*)"', comment):
            return match[1]
    return None


def _same_size(file: Columns, actual: Sequence[int], expected: Sequence[int]) -> None:
    for i, (a, b, what) in enumerate(zip(actual, expected, ("states", "choices"), strict=False)):
        if a != b:
            file.fault(
                0, f"the transitions file has {b} {what}, but this file announces {a}", "count", i
            )


def _transition_rewards(file: Columns, model: _Transitions) -> Floats:
    """The reward of each transition of the model."""
    m = model.matrix
    chain = m.groups is None
    size = file.header(
        (2,) if chain else (2, 3),
        "the numbers of states" + ("" if chain else ", of choices") + " and of rewards",
    )
    _same_size(file, size[:-1], (m.states, m.rows))
    file.expect(size[-1], "rewards")
    file.widths((3,) if chain else (4,), "a transition and its reward")
    source, target = (
        file.integers(0, m.states, "state"),
        file.integers(1 if chain else 2, m.states, "state"),
    )
    rewards = _finite(file, 2 if chain else 3)
    row = source
    if m.groups is not None:
        choice = file.integers(1, _INT_LIMIT, "choice")
        for i in first_true(choice >= np.diff(m.groups)[source]):
            file.fault(i + 1, f"state {source[i]} has no choice {choice[i]}", "index", 1)
        row = m.groups[source] + choice
    entry, known = m.find(row, target)
    for i in first_true(~known):
        file.fault(i + 1, "there is no such transition", "index")
    result = np.zeros(m.entries)
    result[entry] = rewards
    return result
