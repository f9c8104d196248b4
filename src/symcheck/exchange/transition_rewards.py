"""Rewards of single transitions of a chain.

Several commands with different rewards may contribute to one transition. Its reward is then their
mean, weighted with their probabilities (rates): the expected reward of the row stays the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

import numpy as np

from symcheck.engines.base import Engine
from symcheck.engines.rational.whole_numbers import commands_in_whole_numbers
from symcheck.engines.transition_actions import commands_apart
from symcheck.matrices.numbers import Numbers, Rationals, full
from symcheck.matrices.rows import Floats, Int64s, SparseMatrix
from symcheck.options import Options
from symcheck.semantics.interpreter import State, choices
from symcheck.semantics.model import BoundModel, Value

__all__ = ["transition_rewards"]


def transition_rewards(engine: Engine, matrix: SparseMatrix) -> list[Numbers]:
    """The reward of each transition of a chain, per structure: float64[entries], or rationals.

    The model is explored again as an MDP, in which each command is a choice of its own.

    Args:
        engine: the engine of the chain.
        matrix: its matrix, with states in lexicographic order and the entries of a row by column.

    Raises:
        ModelFault: the model is faulty.
        ResourceError: a limit of time or memory was reached.
    """
    return _rational(engine, matrix) if engine.is_rational else _doubles(engine.model, matrix)


def _doubles(model: BoundModel, matrix: SparseMatrix) -> list[Numbers]:
    from symcheck.explicit.model import evaluate_states
    from symcheck.explicit.tables import total_reward

    apart = commands_apart(model)
    commands = apart.matrix
    assert commands.groups is not None
    row, state = commands.row_of_entry, commands.state_of_row
    entry, _ = matrix.find(state[row], commands.indices)
    result: list[Numbers] = []
    for structure in model.rewards:
        rewards = np.zeros(commands.rows)
        for number, action in enumerate((*model.actions, None)):
            items = [i for i in structure.items if not i.on_states and i.action == action]
            rows = np.flatnonzero(apart.choice_actions == (number if action is not None else -1))
            if items and len(rows):
                rewards[rows] = evaluate_states(model, apart.states, total_reward(items))[
                    state[rows]
                ]
        rewards[commands.groups[:-1][apart.deadlocks]] = (
            0  # the loop that a deadlock is given earns nothing
        )
        result.append(_means(entry, commands.data, rewards[row], matrix.entries))
    return result


def _means(entry: Int64s, weights: Floats, rewards: Floats, entries: int) -> Floats:
    """The weighted mean of the rewards per entry; without rounding if all rewards are equal."""
    least, most = np.full(entries, np.inf), np.full(entries, -np.inf)
    np.minimum.at(least, entry, rewards)
    np.maximum.at(most, entry, rewards)
    mean = np.bincount(entry, weights * rewards, entries) / np.bincount(entry, weights, entries)
    return np.asarray(np.where(least == most, least, np.clip(mean, least, most)), np.float64)


def _rational(engine: Engine, matrix: SparseMatrix) -> list[Numbers]:
    found = commands_in_whole_numbers(engine.model, Options())
    if found is None or len(found[0].states) != engine.states:
        return _interpreted(engine, matrix)
    commands, rewards = found[0].matrix, found[1]
    row = commands.row_of_entry
    entry, _ = matrix.find(commands.state_of_row[row], commands.indices)
    weights = commands.data.astype(np.int64).astype(object)
    return [_rational_means(entry, weights, r[row], matrix.entries) for r in rewards]


def _rational_means(entry: Int64s, weights: Rationals, rewards: Rationals, entries: int) -> Numbers:
    """The weighted mean of the rewards per entry; only those of commands that earn are summed."""
    mean = full(entries, 0, rational=True)
    earning = np.zeros(entries, np.bool_)
    earning[entry[rewards != 0]] = True
    mine = earning[entry]
    totals = full(entries, 0, rational=True)
    np.add.at(totals, entry[mine], weights[mine])
    np.add.at(mean, entry[mine], weights[mine] * rewards[mine])
    mean[earning] = mean[earning] / totals[earning]
    return mean


def _interpreted(engine: Engine, matrix: SparseMatrix) -> list[Numbers]:
    states = {state: i for i, state in enumerate(engine.valuations(engine.all))}
    result = [np.full(matrix.entries, Fraction(0), dtype=object) for _ in engine.model.rewards]
    for i, means in enumerate(_means_of_states(engine.model, tuple(states))):
        start = int(matrix.indptr[i])
        targets = matrix.indices[start : int(matrix.indptr[i + 1])].tolist()
        by_target = {states[state]: rewards for state, rewards in means.items()}
        for j, target in enumerate(targets):
            for structure, value in zip(result, by_target.get(target, ()), strict=False):
                structure[start + j] = value
    return result


def _means_of_states(
    model: BoundModel, states: Sequence[State]
) -> Iterator[dict[State, list[Value]]]:
    for state in states:
        total: dict[State, Value] = {}
        weighted: dict[State, list[Value]] = {}
        for choice in choices(model, state, check_sums=False):
            for weight, target in choice.branches:
                total[target] = total.get(target, 0) + weight
                before = weighted.get(target, [0] * len(choice.rewards))
                weighted[target] = [
                    b + weight * r for b, r in zip(before, choice.rewards, strict=True)
                ]
        yield {target: [w / total[target] for w in rewards] for target, rewards in weighted.items()}
