"""Likeliest paths against all paths that are likely enough, enumerated by brute force."""

from __future__ import annotations

from fractions import Fraction
from itertools import islice, takewhile
from random import Random

import numpy as np
import pytest

from symcheck.matrices.numbers import rationals
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics.likeliest_paths import StepProblem, WalkProblem, likeliest_paths


def random_chain(rng, n=6, exact=True):
    """A chain whose states have two or three successors, so that no cycle has probability 1."""
    indptr, indices, data = [0], [], []
    for _ in range(n):
        successors = rng.sample(range(n), rng.choice((2, 3)))
        weights = [rng.randint(1, 4) for _ in successors]
        indices += successors
        data += [Fraction(w, sum(weights)) for w in weights]
        indptr.append(len(indices))
    numbers = rationals(data) if exact else np.array(data, dtype=np.float64)
    return SparseMatrix(np.array(indptr, np.int64), np.array(indices, np.int32), numbers, n)


def successors(matrix, state):
    part = slice(matrix.indptr[state], matrix.indptr[state + 1])
    return list(zip(matrix.indices[part].tolist(), matrix.data[part].tolist(), strict=True))


def all_walks(matrix, through, target, least, initial=0):
    """Every walk to the target with at least this probability."""
    found, stack = {}, [((initial,), Fraction(1))]
    while stack:
        walk, p = stack.pop()
        if target[walk[-1]]:
            found[walk] = p
        elif through[walk[-1]]:
            stack += [
                ((*walk, t), p * q) for t, q in successors(matrix, walk[-1]) if p * q >= least
            ]
    return found


@pytest.mark.parametrize("seed", range(60))
def test_all_likely_walks_come_first(seed):
    rng = Random(seed)
    matrix = random_chain(rng)
    through = np.array([rng.random() < 0.8 for _ in range(6)])
    target = np.array([rng.random() < 0.3 for _ in range(6)])
    least = Fraction(1, 500)
    wanted = all_walks(matrix, through, target, least)
    found = list(
        takewhile(
            lambda p: p.probability >= least,
            likeliest_paths(WalkProblem(matrix, through, target), 0),
        )
    )
    assert {p.states: p.probability for p in found} == wanted
    assert len(found) == len(wanted)  # none twice
    probabilities = [p.probability for p in found]
    assert probabilities == sorted(probabilities, reverse=True)


@pytest.mark.parametrize("seed", range(40))
def test_walks_of_few_steps(seed):
    rng = Random(seed)
    matrix, steps = random_chain(rng), rng.randint(0, 5)
    through, target, end = (np.array([rng.random() < x for _ in range(6)]) for x in (0.8, 0.2, 0.3))
    wanted, stack = {}, [((0,), Fraction(1))]
    while stack:
        walk, p = stack.pop()
        if target[walk[-1]] or (len(walk) == steps + 1 and end[walk[-1]]):
            wanted[walk] = p
        elif len(walk) <= steps and through[walk[-1]]:
            stack += [((*walk, t), p * q) for t, q in successors(matrix, walk[-1])]
    found = list(likeliest_paths(StepProblem(matrix, through, target, end, steps), 0))
    assert {p.states: p.probability for p in found} == wanted
    assert len(found) == len(wanted)
    probabilities = [p.probability for p in found]
    assert probabilities == sorted(probabilities, reverse=True)


@pytest.mark.parametrize("seed", range(20))
def test_doubles_find_the_same_walks(seed):
    rng = Random(seed)
    matrix, target = random_chain(rng), np.arange(6) == 5
    doubles = SparseMatrix(matrix.indptr, matrix.indices, matrix.doubles().data, 6)
    everywhere = np.ones(6, bool)
    exact, rounded = (
        list(islice(likeliest_paths(WalkProblem(m, everywhere, target), 0), 100))
        for m in (matrix, doubles)
    )
    assert [float(p.probability) for p in rounded] == pytest.approx(
        [float(p.probability) for p in exact]
    )


def test_many_walks_of_the_same_probability_take_few_steps():
    """60 fair coins: 2 ** 60 walks of equal probability, of which a thousand are found at once."""
    n = 60
    indices = np.array(
        [[2 * i + 2, 2 * i + 3] for i in range(n) for _ in range(2)] + [[2 * n, 2 * n + 1]] * 2
    )
    indices = np.minimum(indices, 2 * n + 1).ravel()
    matrix = SparseMatrix(
        np.arange(0, 4 * n + 5, 2, dtype=np.int64),
        indices.astype(np.int32),
        np.full(4 * n + 4, 0.5),
        2 * n + 2,
    )
    target = np.arange(2 * n + 2) >= 2 * n
    problem = WalkProblem(matrix, np.ones(2 * n + 2, bool), target)
    found = list(islice(likeliest_paths(problem, 0), 1000))
    assert {p.probability for p in found} == {2.0**-n}
    assert len({p.states for p in found}) == 1000


def test_certain_steps_have_no_length():
    matrix = SparseMatrix(
        np.arange(5, dtype=np.int64), np.array([1, 2, 3, 3], np.int32), np.ones(4), 4
    )
    (only,) = likeliest_paths(WalkProblem(matrix, np.ones(4, bool), np.arange(4) == 3), 0)
    assert (only.states, only.rows, only.probability) == ((0, 1, 2, 3), (0, 1, 2), 1.0)


def test_no_step_is_left():
    nothing = np.zeros(6, bool)
    (only,) = likeliest_paths(
        StepProblem(random_chain(Random(1)), ~nothing, nothing, ~nothing, 0), 0
    )
    assert (only.states, only.rows, only.probability) == ((0,), (), 1)


def test_no_walk():
    matrix = random_chain(Random(1))
    nothing = np.zeros(6, bool)
    assert list(likeliest_paths(WalkProblem(matrix, ~nothing, nothing), 0)) == []
    assert list(likeliest_paths(StepProblem(matrix, nothing, nothing, ~nothing, 3), 0)) == []
