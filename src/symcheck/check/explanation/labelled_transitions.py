"""The transitions that paths of a counterexample may take, with their commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import cast

import numpy as np

from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.kernels.arrays import Bools, Int64s
from symcheck.matrices.numbers import Numbers, rationals
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics import graph
from symcheck.semantics.interpreter import Choice, State, choices
from symcheck.semantics.model import BoundCommand
from symcheck.semantics.rewards import Reward, Structure

__all__ = ["LabelledTransitions", "labelled_transitions"]


@dataclass(frozen=True, eq=False)
class LabelledTransitions:
    """Transitions with sets of commands, among n states and to the target.

    For a reward, the weights of the transitions to the target are what the steps earn instead: the
    sum of probability times weight over all walks to the target is the expected reward.

    Attributes:
        states: n, without the target, which is state n.
        initial: the number of the first state.
        of_reward: whether the target stands for what is earned.
        owner: int64[rows], ascending, the state of each row: a choice of an MDP, else a state.
        several: whether a state may have several rows.
        row, target: int64[parts], ascending by row.
        weight: probability of each part, float64[parts] or rationals.
        label: int64[parts], index into `labels`.
        labels: bool[labels, commands], the commands that a transition needs.
        commands: the commands.
    """

    states: int
    initial: int
    of_reward: bool
    owner: Int64s
    several: bool
    row: Int64s
    target: Int64s
    weight: Numbers
    label: Int64s
    labels: Bools
    commands: tuple[BoundCommand, ...]

    def restricted(self, chosen: Bools) -> SparseMatrix:
        """The matrix of the transitions whose commands are all chosen, on n + 1 states.

        A choice of an MDP is there as a whole or not at all.
        """
        missing: Bools = np.asarray(self.labels[:, ~chosen].any(axis=1))
        kept = ~missing[self.label]
        row, target, weight = self.row[kept], self.target[kept], self.weight[kept]
        rows = np.unique(row) if self.several else np.arange(len(self.owner))
        indptr = np.append(np.searchsorted(row, rows), len(row)).astype(np.int64)
        indices = np.arange(len(row), dtype=np.int32)
        whole = SparseMatrix(indptr, indices, weight, len(row))
        merged = whole.merge(target.astype(np.int32), self.states + 1)
        if not self.several:
            return merged
        groups = np.searchsorted(self.owner[rows], np.arange(self.states + 2))
        return replace(merged, groups=groups.astype(np.int64))


def labelled_transitions(
    engine: ExplicitEngine,
    matrix: SparseMatrix,
    rows: Int64s | None,
    through: Bools,
    target: Bools,
    initial: int,
    reward: Reward | None = None,
) -> LabelledTransitions | None:
    """The transitions that paths from the initial state to the target may take.

    The interpreter gives the commands of each state again.

    Args:
        engine: the model, which has commands.
        matrix: its matrix, or that of a strategy.
        rows: the rows of the strategy, int64[n]; None without one.
        through: where paths may pass, bool[n].
        target: where they end, bool[n].
        initial: the number of the initial state, which is no target.
        reward: what steps earn, also on paths that miss the target; None for probabilities.

    Returns:
        None if a row of the strategy is not found among the choices of its state, or if no path
        reaches the target (earns anything).
    """
    edges = graph.Incidence(matrix)
    inner = through & ~target
    start = np.zeros(matrix.states, np.bool_)
    start[initial] = True
    relevant = inner & graph.forward_reachable(edges, start, inner)
    if reward is None:
        relevant &= graph.backward_reachable(edges, target, inner)
    in_state = None if reward is None else engine.rewards(reward)[0].tolist()
    index = np.full(matrix.states, -1)
    index[relevant] = np.arange(np.count_nonzero(relevant))
    index[target] = n = int(np.count_nonzero(relevant))
    states = cast("list[State]", list(engine.explored.states))
    numbers = {state: int(index[i]) for i, state in enumerate(states)}
    one: float | Fraction = Fraction(1) if engine.is_rational else 1.0
    parts: list[tuple[int, int, float | Fraction, int]] = []
    commands: dict[int, BoundCommand] = {}
    labels: dict[frozenset[int], int] = {}
    owner: list[int] = []
    several = engine.model.type.has_choices
    for s in np.flatnonzero(relevant).tolist():
        enabled: Sequence[Choice] = choices(engine.model, states[s], check_sums=False)
        if rows is not None:
            action = int(engine.explored.choice_actions[rows[s]])
            name = None if action < 0 else engine.model.actions[action]
            taken = _row(matrix, s, states)
            enabled = [c for c in enabled if c.action == name and _same(c, taken)][:1]
            if not enabled:
                return None
        elif not enabled:  # the step of a deadlock needs no command
            enabled = [Choice(None, (), ((one, states[s]),), (0,) * len(engine.model.rewards))]
        share = one if several else one / len(enabled)
        for i, choice in enumerate(enabled):
            if several or i == 0:
                owner.append(numbers[states[s]])
            commands |= {id(c): c for c in choice.commands}
            label = labels.setdefault(frozenset(map(id, choice.commands)), len(labels))
            parts += [
                (len(owner) - 1, numbers[t], share * cast("float | Fraction", p), label)
                for p, t in choice.branches
                if 0 <= numbers.get(t, -1) < (n + 1 if in_state is None else n)
            ]
            if in_state is not None:
                of_step = choice.rewards[reward.index] if isinstance(reward, Structure) else 1
                earned = share * (in_state[s] + cast("float | Fraction", of_step))
                parts += [(len(owner) - 1, n, earned, label)] if earned else []
    if not parts:
        return None
    row, goal, weight, label_of = zip(*parts, strict=True)
    order = np.lexsort((goal, row))
    needed = np.array([[command in label for command in commands] for label in labels], np.bool_)
    weights = rationals(weight) if engine.is_rational else np.array(weight, np.float64)
    return LabelledTransitions(
        n,
        int(index[initial]),
        reward is not None,
        np.array([*owner, n], np.int64),
        several,
        np.array(row, np.int64)[order],
        np.array(goal, np.int64)[order],
        weights[order],
        np.array(label_of, np.int64)[order],
        needed,
        tuple(commands.values()),
    )


def _row(chain: SparseMatrix, state: int, states: Sequence[State]) -> dict[State, float]:
    part = slice(chain.indptr[state], chain.indptr[state + 1])
    targets = (states[t] for t in chain.indices[part].tolist())
    return dict(zip(targets, map(float, chain.data[part].tolist()), strict=True))


def _same(choice: Choice, row: dict[State, float]) -> bool:
    """Whether a choice has the distribution of a row, up to rounding."""
    left = dict(row)
    for probability, state in choice.branches:
        left[state] = left.get(state, 0.0) - float(probability)
    return all(abs(value) < 1e-12 for value in left.values())
