"""Read the unified Markov binary format by the package `umbi`.

Source: https://github.com/pmc-tools/umb
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from symcheck.errors import SymcheckError, UnsupportedError, UsageError
from symcheck.exchange.column_reader import first_true
from symcheck.exchange.explicit_data import ExplicitData, ExplicitRewards, row_rewards
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.rows import Bools, Floats, Int32s, Int64s, SparseMatrix, starts_of
from symcheck.semantics.state_faults import SUM_TOLERANCE
from symcheck.syntax.ast import ModelType, Type
from symcheck.tables import optional_package

if TYPE_CHECKING:
    from umbi.umb import ExplicitUmb

__all__ = ["read_umb"]


def read_umb(path: Path, kind: ModelType | None = None, *, check_sums: bool = True) -> ExplicitData:
    """The model in a UMB file: a DTMC, CTMC or MDP over bool and int variables.

    Raises:
        UsageError: the file cannot be read, or its parts contradict each other.
        UnsupportedError: the model is of another type, has intervals, or other variables.
    """
    raw = _raw(path)
    model_type = _type(raw)
    if kind is not None and kind is not model_type:
        raise UsageError(f"'{path}' holds a {model_type.name}, but -{kind.value} was given")
    try:
        return _given(raw, model_type, path, check_sums)
    except (IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        raise UsageError(f"'{path}' contradicts itself: {type(error).__name__}: {error}") from None


def _raw(path: Path) -> ExplicitUmb:
    optional_package("umbi", "umb")
    import umbi.umb

    if not path.is_file():
        raise UsageError(f"cannot read '{path}': there is no such file")
    try:
        return umbi.umb.read(path)
    except (SymcheckError, MemoryError):  # a limit of time or memory
        raise
    except (
        Exception
    ) as error:  # the package has no errors of its own: what it meets in a wrong file is anything
        raise UsageError(f"cannot read '{path}': {str(error) or type(error).__name__}") from None


def _type(raw: ExplicitUmb) -> ModelType:
    system = raw.index.transition_system
    match str(getattr(system.time, "value", system.time)), system.num_players:
        case "discrete", (0 | 1) as players:
            return ModelType.with_properties(has_choices=players == 1)
        case "stochastic", 0:
            return ModelType.with_properties(continuous_time=True)
        case time, players:
            raise UnsupportedError(
                f"UMB models with {time} time and {players} players are not supported; "
                "DTMCs, CTMCs and MDPs are"
            )


def _given(raw: ExplicitUmb, kind: ModelType, path: Path, check_sums: bool) -> ExplicitData:
    n = int(raw.index.transition_system.num_states)
    if n == 0:
        raise UsageError(f"'{path}' has no states")
    matrix, branches = _matrix(raw, kind, n, path)
    if check_sums and not kind.continuous_time:
        _check_sums(matrix, path)
    actions, row_actions = _actions(raw, matrix, kind)
    contributions = None
    if not kind.has_choices and raw.branch_to_branch_action is not None:
        actions, codes = _named(raw.branch_to_branch_action, raw.branch_action_to_string)
        row = matrix.row_of_entry[branches.entry]
        target = matrix.indices[branches.entry].astype(np.int64)
        if actions:
            contributions = Contributions(row, target, codes[branches.number], branches.weight)
    labels = {"init": _bools(raw.state_is_initial, n, "initial states", path)}
    for name, values in _annotations(raw, "aps").items():
        if "states" in values:
            labels[name] = _bools(values["states"], n, f'label "{name}"', path)
    rewards = [
        _rewards(name, values, matrix, kind, branches, path)
        for name, values in _annotations(raw, "rewards").items()
    ]
    columns = _columns(raw, n)
    return ExplicitData(kind, columns, matrix, actions, row_actions, labels, rewards, contributions)


class _Branches(NamedTuple):
    """The branches of nonzero probability: number, entry of the matrix, probability (rate)."""

    number: Int64s
    entry: Int64s
    weight: Floats

    def means(self, values: Floats) -> Floats:
        """The mean of the values of each entry's branches, weighted with their probabilities."""
        if len(np.unique(self.entry)) == len(self.entry):
            return values
        total = np.bincount(self.entry, self.weight)
        return np.asarray(np.bincount(self.entry, self.weight * values) / total, np.float64)


def _matrix(
    raw: ExplicitUmb, kind: ModelType, n: int, path: Path
) -> tuple[SparseMatrix, _Branches]:
    """The matrix, and the branches in its order.

    Branches of a chain to the same state with different actions are parts of one entry.
    """
    choices, branches = (
        np.asarray(raw.state_to_choices, np.int64),
        np.asarray(raw.choice_to_branches, np.int64),
    )
    targets = np.asarray(raw.branch_to_target, np.int64)
    values = np.array([float(p) for p in raw.branch_to_probability])
    counts = np.diff(choices)
    if (
        len(values) != len(targets)
        or not _are_starts(choices, n, len(branches) - 1)
        or not _are_starts(branches, len(branches) - 1, len(targets))
        or targets.min(initial=0) < 0
        or targets.max(initial=-1) >= n
    ):
        raise UsageError(f"'{path}' contradicts itself: its parts have different sizes")
    if not kind.has_choices and counts.max(initial=0) > 1:
        raise UsageError(f"'{path}' contradicts itself: a state of a chain has several choices")
    row = np.repeat(np.arange(len(branches) - 1), np.diff(branches))
    if kind.continuous_time:
        rates = np.array([float(r) for r in raw.state_to_exit_rate])  # per state, and per choice
        for i in first_true(~(rates >= 0) | np.isinf(rates)):
            raise UsageError(f"'{path}': {rates[i]:g} is not an exit rate (state {i})")
        values = values * np.repeat(np.repeat(rates, counts), np.diff(branches))
    rows = len(branches) - 1
    if not kind.has_choices:
        row, rows = np.flatnonzero(counts)[row], n
    for i in first_true(~(values >= 0) | np.isinf(values)):
        raise UsageError(f"'{path}': {values[i]:g} is not a probability or rate (branch {i})")
    by = np.lexsort((targets, row))
    by = by[values[by] > 0]  # a matrix holds no zeros
    keys, entry = np.unique(row[by] * n + targets[by], return_inverse=True)
    divided = not kind.has_choices and raw.branch_to_branch_action is not None
    if len(keys) < len(by) and not divided:
        raise UnsupportedError(f"'{path}' has several branches of one choice to one state")
    indptr = starts_of(np.bincount(keys // n, minlength=rows))
    groups = choices if kind.has_choices else None
    data = np.bincount(entry, values[by], len(keys)).astype(np.float64)
    matrix = SparseMatrix(indptr, (keys % n).astype(np.int32), data, n, groups)
    return matrix, _Branches(by, entry, values[by])


def _are_starts(numbers: Int64s, groups: int, entries: int) -> bool:
    """Whether they are the first entry of each group, and the number of entries at the end."""
    ends = len(numbers) == groups + 1 and numbers[0] == 0 and numbers[-1] == entries
    return bool(ends and np.all(np.diff(numbers) >= 0))


def _check_sums(matrix: SparseMatrix, path: Path) -> None:
    filled = np.flatnonzero(np.diff(matrix.indptr))
    sums = np.add.reduceat(matrix.data, matrix.indptr[:-1][filled]) if len(filled) else np.ones(0)
    for i in first_true(np.abs(sums - 1) > SUM_TOLERANCE):
        raise UsageError(
            f"'{path}': the probabilities of choice {filled[i]} sum to {sums[i]:.12g}, not to 1"
        )


def _actions(
    raw: ExplicitUmb, matrix: SparseMatrix, kind: ModelType
) -> tuple[tuple[str, ...], Int32s]:
    none = np.full(matrix.rows, -1, np.int32)
    if not kind.has_choices or raw.choice_to_choice_action is None:
        return (), none
    return _named(raw.choice_to_choice_action, raw.choice_action_to_string)


def _named(numbers: Sequence[int], texts: Sequence[str] | None) -> tuple[tuple[str, ...], Int32s]:
    """The names of actions, and the index of the name for each number, -1 for none."""
    names = texts or [f"a{i}" for i in range(int(max(numbers)) + 1)]
    kept = tuple(name for name in dict.fromkeys(names) if name)
    index = np.array([kept.index(name) if name else -1 for name in names], np.int32)
    return kept, index[np.asarray(numbers, np.int64)]


def _annotations(raw: ExplicitUmb, group: str) -> Mapping[str, Mapping[str, Any]]:
    """The annotations of a group, by alias where they have one and by name otherwise."""
    result = (raw.annotations or {}).get(group, {})
    descriptions = (raw.index.annotations or {}).get(group, {})
    return {
        getattr(descriptions.get(name), "alias", None) or name: values
        for name, values in result.items()
    }


def _bools(values: Any, n: int, what: str, path: Path) -> Bools:
    array = np.asarray(values, np.bool_)
    if array.shape != (n,):
        raise UsageError(f"'{path}' contradicts itself: {what} for {array.size} states of {n}")
    return array


def _rewards(
    name: str,
    values: Mapping[str, Any],
    matrix: SparseMatrix,
    kind: ModelType,
    branches: _Branches,
    path: Path,
) -> ExplicitRewards:
    """A reward structure. Rewards of choices and of branches are both transition rewards.

    In a CTMC, they are weighted with the rate of the transition. A transition of several branches
    has the mean of their rewards, weighted with their probabilities.
    """

    def numbers(part: str, count: int) -> Floats:
        given = [float(x) for x in values.get(part) or [0.0] * count]
        for i in first_true(~np.isfinite(given)):
            raise UsageError(f"'{path}': the reward {given[i]:g} is not finite ({part} {i})")
        return np.array(given)

    states = numbers("states", matrix.states)
    if not values.get("choices") and not values.get("branches"):
        return ExplicitRewards(name, states, np.zeros(matrix.rows))
    row_of_entry = matrix.row_of_entry
    choices = numbers("choices", matrix.rows)
    if len(choices) != matrix.rows:  # a chain's states without a choice are rows here
        filled = np.zeros(matrix.rows)
        filled[np.unique(row_of_entry)] = choices
        choices = filled
    entries = choices[row_of_entry]
    if values.get("branches"):
        entries = entries + branches.means(numbers("branches", 0)[branches.number])
    return ExplicitRewards(name, states, row_rewards(kind, matrix, entries), entries)


def _columns(raw: ExplicitUmb, n: int) -> list[tuple[str, Type, Int64s]]:
    valuations = (raw.valuations or {}).get("states")
    if not valuations or not valuations[0]:
        return [("x", Type.INT, np.arange(n))]
    columns = []
    for name in valuations[0]:
        values = [state[name] for state in valuations]
        if all(isinstance(v, bool) for v in values):
            columns.append((name, Type.BOOL, np.array(values, np.int64)))
        elif all(isinstance(v, int) for v in values):
            columns.append((name, Type.INT, np.array(values, np.int64)))
        else:
            raise UnsupportedError(f"variable {name} has values that are neither bool nor int")
    return columns
