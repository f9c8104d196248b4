"""Building the system of an until formula without deterministic states, from diagrams."""

from __future__ import annotations

import numpy as np

from symcheck.dd.manager import Bdd, Mtbdd
from symcheck.dd.odd import Odd
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.engines.symbolic.reduced_system import ReducedSystem, Successors
from symcheck.kernels.blocks.block_matrix import BlockOperations
from symcheck.kernels.graph import deterministic_states as kernel
from symcheck.kernels.rows import sparse
from symcheck.matrices import tuning as matrix_tuning
from symcheck.matrices.blocks import RowLayout, flatten, quad_dag
from symcheck.matrices.rows import Floats, SparseMatrix
from symcheck.semantics.rewards import Reward

__all__ = ["deterministic_states", "eliminate"]


def deterministic_states(d: Diagrams) -> Bdd:
    """States whose only choice has a single successor with probability 1 (not in a CTMC)."""
    seen = twice = d.manager.false
    for guard in d.class_guards:
        twice = twice | (seen & guard)
        seen = seen | guard
    certain = [root.equal(1.0).exists(d.column_cube) for root in d.roots]
    return d.union(certain) & (d.states - twice)


def eliminate(
    d: Diagrams, left: Bdd, right: Bdd, limit: int, reward: Reward | None = None
) -> ReducedSystem | None:
    """Build the system of `left U right` without its deterministic states.

    Args:
        d: the diagrams of the model.
        left: the states in which a path may go on.
        right: the states in which it ends.
        limit: bytes that the result and graph questions on it may take.
        reward: the reward to accumulate; None for probabilities.

    Returns:
        The reduced system; None if it would take more memory than `limit`, or some reward is
        negative or infinite.
    """
    if reward is not None and not _finite_rewards(d, reward):
        return None
    between = left - right
    deterministic = between & deterministic_states(d)
    kept = Odd(d.manager, between - deterministic, d.rows)
    if d.count >= 2**31 - 2 or _bytes(d, kept.states, reward) > limit:
        return None
    successors = _successors(d, kept, deterministic, right, reward)
    layout = (
        None
        if d.guards is None
        else RowLayout.of([kept.to_mask(guard) for guard in d.guards], kept.count)
    )
    indptr, indices, data = flatten(
        quad_dag([root.times_bdd(kept.states) for root in d.roots], kept, d.odd, d.columns), layout
    )
    step_reward = None
    if reward is not None:
        assert successors.path_reward is not None
        step_reward = np.empty(len(indptr) - 1)
        sparse.multiply(indptr, indices, data, successors.path_reward, step_reward)
        _add_step(d, kept, layout, reward, step_reward)
    entries = sparse.merge_columns_in_place(
        indptr, indices, data, successors.representative, kept.count + 2
    )
    groups = np.arange(len(indptr), dtype=np.int64) if layout is None else layout.groups
    padded = np.append(groups, [groups[-1], groups[-1]])
    matrix = SparseMatrix(indptr, indices[:entries], data[:entries], kept.count + 2, padded)
    return ReducedSystem(left, right, successors, kept, matrix, reward, step_reward)


def _finite_rewards(d: Diagrams, reward: Reward) -> bool:
    states, transitions = d.rewards(reward)
    functions = (states, *transitions)
    return all(f.minimum_leaf >= 0.0 and f.maximum_leaf < np.inf for f in functions)


def _bytes(d: Diagrams, kept: Bdd, reward: Reward | None) -> int:
    """The memory that `eliminate` takes at most, graph questions included."""
    both = d.manager.cube([*d.rows, *d.columns])
    entries = sum(d.manager.count(relation & kept, both) for relation in d.class_relations)
    rows = sum(d.manager.count(guard & kept, d.row_cube) for guard in d.class_guards)
    return 20 * (d.count + entries) + 16 * rows + (0 if reward is None else 8 * (d.count + rows))


def _successors(
    d: Diagrams, kept: Odd, deterministic: Bdd, right: Bdd, reward: Reward | None
) -> Successors:
    n, path_reward = kept.count, None
    representative = np.empty(d.count, np.int32)
    if deterministic:
        # Each row has a single 1. Rows are numbered as all states, so that no other array is as
        # long.
        successor = d.manager.sum([root.times_bdd(deterministic) for root in d.roots])
        BlockOperations(
            quad_dag([successor], d.odd, d.odd, d.columns), matrix_tuning.MAX_BLOCK_RUNS
        ).single_columns(0, representative)
        np.invert(representative, out=representative)  # -1 - successor
    representative[d.odd.to_mask(d.states - deterministic - kept.states - right)] = n + 1
    representative[d.odd.to_mask(right)] = n
    representative[d.odd.to_mask(kept.states)] = np.arange(n, dtype=np.int32)
    if reward is not None:
        steps = [
            f.times_bdd(guard & deterministic)
            for f, guard in zip(_step_rewards(d, reward), d.class_guards, strict=True)
        ]
        path_reward = d.odd.to_vector(d.manager.sum(steps))
    kernel.resolve_representatives(representative, n + 1, path_reward)
    return Successors(d, representative, path_reward)


def _step_rewards(d: Diagrams, reward: Reward) -> list[Mtbdd]:
    """Per choice class: the reward of a step."""
    states, transitions = d.rewards(reward)
    return [states + each for each in transitions]


def _add_step(
    d: Diagrams, kept: Odd, layout: RowLayout | None, reward: Reward, out: Floats
) -> None:
    """Add to each row the reward of its step."""
    functions = _step_rewards(d, reward)
    if layout is None:
        out += kept.to_vector(functions[0])
        return
    for function, (present, rows) in zip(functions, layout.each(), strict=True):
        out[rows] += kept.to_vector(function)[present]
