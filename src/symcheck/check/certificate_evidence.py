"""The evidence of a certificate: vectors, strategies and ranks for both bounds of a measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from symcheck.direction import Direction
from symcheck.matrices.numbers import Rationals
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics import graph
from symcheck.numerics.inductive_bounds import Inequalities, InductiveVector, inductive

__all__ = ["Evidence", "reward_evidence", "until_evidence"]

Evidence = dict[str, InductiveVector]
"""The proof of the "lower" and of the "upper" bound; "missed": where a target may be missed."""


def until_evidence(
    matrix: SparseMatrix,
    left: Bools,
    right: Bools,
    direction: Direction | None,
    guess: Floats,
) -> Evidence:
    """Both bounds of the probability of `left U right`.

    Args:
        matrix: the probabilities, as rationals.
        left: the states that paths may go through, bool[n].
        right: the states to be reached, bool[n].
        direction: minimise or maximise; None for a chain.
        guess: values in all states, float64[n].
    """
    return {
        "lower": _until(matrix, left, right, direction, guess, upper=False),
        "upper": _until(matrix, left, right, direction, guess, upper=True),
    }


def _until(
    matrix: SparseMatrix,
    left: Bools,
    right: Bools,
    direction: Direction | None,
    guess: Floats,
    *,
    upper: bool,
) -> InductiveVector:
    problem = Inequalities(
        matrix,
        free=left & ~right,
        fixed=right.astype(np.float64),
        earned=None,
        upper=upper,
        all_rows=direction is None or (direction is Direction.MAX) is upper,
        ends=None if upper else right,
    )
    return inductive(problem, guess)


def reward_evidence(
    matrix: SparseMatrix,
    earned: Rationals,
    target: Bools,
    direction: Direction | None,
    guess: Floats,
) -> Evidence:
    """Both bounds of the expected reward until a target is reached; `guess` is infinite where the
    reward is because the target may be missed.
    """
    n = matrix.states
    dual = None if direction is None else direction.dual
    certain = graph.prob1(matrix, np.ones(n, np.bool_), target, dual)
    fixed = np.where(certain, 0.0, np.inf)
    evidence = {}
    for name, upper in (("lower", False), ("upper", True)):
        problem = Inequalities(
            matrix,
            free=certain & ~target,
            fixed=fixed,
            earned=earned,
            upper=upper,
            all_rows=direction is None or (direction is Direction.MAX) is upper,
            ends=target if upper else None,
        )
        evidence[name] = inductive(problem, guess)
    if not certain.all():
        probabilities = np.zeros(n)  # filled by the caller
        evidence["missed"] = _until(
            matrix, np.ones(n, np.bool_), target, dual, probabilities, upper=True
        )
    return evidence
