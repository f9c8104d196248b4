"""Distributions over all states of a chain: at a time, and in the long run. From a distribution
over the initial states.

Where there are several initial states and nothing else is said, each has the same probability.
Sources: Stewart (1994), 'Introduction to the Numerical Solution of Markov Chains'; Baier & Katoen
(2008), 10.1.2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from symcheck.check.context import Context
from symcheck.engines.base import ROUNDING, Engine
from symcheck.errors import NumericalError, UnsupportedError, UsageError, converts_memory_error
from symcheck.kernels.rows import sparse
from symcheck.matrices.rows import Bools, Floats, Int32s, SparseMatrix
from symcheck.numerics import graph
from symcheck.options import Options
from symcheck.syntax.ast import ModelType

__all__ = ["Distribution", "initial_distribution", "steady_state", "transient"]

_UNIT = 2.0**-53


@dataclass(frozen=True, eq=False)
class Distribution:
    """A probability per state, float64[n] in index order, between `lower` and `upper` (certified
    unless it says otherwise).
    """

    engine: Engine = field(repr=False)
    lower: Floats = field(repr=False)
    upper: Floats = field(repr=False)
    certified: bool = True
    explanation: str = ""
    seconds: float = 0.0

    @property
    def values(self) -> Floats:
        """The middle between the bounds."""
        return 0.5 * (self.lower + self.upper)

    @property
    def error(self) -> float:
        """The largest distance of a value from the true probability."""
        return 0.5 * float(np.max(self.upper - self.lower, initial=0.0))

    def __len__(self) -> int:
        return len(self.lower)

    def __iter__(self) -> Iterator[tuple[int, tuple[bool | int, ...], float]]:
        """Number, variable values and probability of each state whose probability is not 0."""
        values = self.values
        some = values > 0
        states = self.engine.valuations(self.engine.from_bools(some))
        return zip(np.flatnonzero(some).tolist(), states, values[some].tolist(), strict=True)


def initial_distribution(engine: Engine) -> Floats:
    """The same probability for every initial state: float64[n]."""
    members = engine.to_bools(engine.initial).astype(np.float64)
    return np.asarray(members / members.sum())


@converts_memory_error()
def transient(
    engine: Engine, time: float, options: Options | None = None, start: Floats | None = None
) -> Distribution:
    """The distribution after `time` steps (DTMC) or units of time (CTMC).

    Raises UnsupportedError for an MDP, UsageError for a time or distribution that makes no sense.
    """
    options, begun = options or Options(), perf_counter()
    start = _prepared(engine, start)
    if not 0 <= time < np.inf:
        raise UsageError(f"a time is a number that is not negative, not {time}")
    if engine.model.type is ModelType.DTMC and time != int(time):
        raise UsageError(f"a DTMC takes whole steps, not {time}")
    matrix = _matrix(engine)
    if engine.model.type is ModelType.DTMC:
        lower, upper, text = _steps(matrix, start, int(time))
    elif time == 0:
        lower, upper, text = start, start, "no time passes"
    else:
        from symcheck.numerics.transient.uniformization import transient_distribution

        found = transient_distribution(
            matrix, sparse.row_sums(matrix.indptr, matrix.data), start, float(time), options
        )
        lower, upper, text = found.lower, found.upper, found.explanation
    return Distribution(engine, lower, upper, True, text, perf_counter() - begun)


def _prepared(engine: Engine, start: Floats | None) -> Floats:
    if engine.model.type is ModelType.MDP:
        raise UnsupportedError(
            "an MDP has no distribution over its states: that depends on the strategy; P and R properties have bounds"
        )
    if start is None:
        return initial_distribution(engine)
    start = np.asarray(start, np.float64)
    if len(start) != engine.states:
        raise UsageError(
            f"the initial distribution has {len(start)} probabilities, and the model {engine.states} states"
        )
    if not np.all(start >= 0) or abs(float(start.sum()) - 1) > 1e-6:
        raise UsageError("the initial distribution does not consist of probabilities that sum to 1")
    return start


def _matrix(engine: Engine) -> SparseMatrix:
    """All one-step probabilities (rates), as doubles."""
    return engine.system(engine.all).matrix.doubles()


def _steps(matrix: SparseMatrix, start: Floats, steps: int) -> tuple[Floats, Floats, str]:
    """Products with the transposed matrix. Sums of non-negative terms: the rounding error stays
    relative.
    """
    indptr, indices, data = sparse.transpose_values(
        matrix.indptr, matrix.indices, matrix.data, matrix.columns
    )
    longest = int(np.max(np.diff(indptr), initial=0))
    x, y = start.copy(), np.empty(len(start))
    made = 0
    while made < steps:
        sparse.multiply(indptr, indices, data, x, y)
        made += 1
        if np.array_equal(x, y):
            break  # from here on nothing changes any more
        x, y = y, x
    error = (made * (longest + 2) + 2) * _UNIT if steps else 0.0
    if error > 1e-3:
        raise NumericalError(
            f"{steps} steps are too many: rounding may make an error of {error:.1E}"
        )
    if made < steps:
        # The rounded chain stands still, the true one may still move: the bound must hold for all
        # steps.
        error = max(error, min(steps * (longest + 2) * _UNIT, 1.0))
    text = f"{made} products with the matrix" + (", then nothing changes" if made < steps else "")
    return x * (1 - error), x * (1 + error), text


@converts_memory_error()
def steady_state(
    engine: Engine, options: Options | None = None, start: Floats | None = None
) -> Distribution:
    """The long-run distribution: the share of time that is spent in each state.

    Each bottom component has a stationary distribution; it counts with the probability that the
    component is reached. Raises UnsupportedError for an MDP, NumericalError where bounds are wanted
    and a component is too large for them.
    """
    from symcheck.numerics.long_run.stationary import stationary_distribution

    options, begun = options or Options(), perf_counter()
    start = _prepared(engine, start)
    matrix = _matrix(engine)
    parts = graph.bsccs(matrix)
    weights = _reached(engine, parts, start, options)
    lower, upper = np.zeros(engine.states), np.zeros(engine.states)
    certified, largest = True, ""
    for part, (low, high) in zip(parts, weights, strict=True):
        if high == 0.0:
            continue
        place = np.full(engine.states, -1, np.int32)
        place[part] = np.arange(len(part), dtype=np.int32)
        inner = SparseMatrix(
            *sparse.select(
                matrix.indptr, matrix.indices, matrix.data, part.astype(np.int64), place
            ),
            len(part),
        )
        found = stationary_distribution(inner, options)
        certified &= found.certified
        lower[part], upper[part] = found.lower * low, np.minimum(found.upper * high, 1.0)
        largest = found.explanation if len(part) > 1 else largest
    text = f"{len(parts)} bottom component{'s' if len(parts) > 1 else ''}" + (
        f"; {largest}" if largest else ""
    )
    return Distribution(engine, lower, upper, certified, text, perf_counter() - begun)


def _reached(
    engine: Engine, parts: list[Int32s], start: Floats, options: Options
) -> list[tuple[float, float]]:
    """Bounds on the probability of ending in each bottom component."""
    from symcheck.check.measures.reachability import until

    if len(parts) == 1:
        return [(1.0, 1.0)]
    begins = engine.from_bools(start > 0)
    positive = start[start > 0]
    context = Context(engine, options)
    inside = [float(start[p].sum()) for p in parts]
    if abs(sum(inside) - 1.0) <= len(parts) * _UNIT and not np.any(
        start[_outside(parts, engine.states)]
    ):
        return [(w, w) for w in inside]
    out = []
    for part in parts:
        members = np.zeros(engine.states, bool)
        members[part] = True
        values = until(context, engine.all, engine.from_bools(members), None)
        low, high = values.at(begins)
        # What is 'exact up to rounding' gets room for the rounding.
        out.append(
            (
                float(np.dot(low, positive)) * (1 - ROUNDING),
                min(1.0, float(np.dot(high, positive)) * (1 + ROUNDING)),
            )
        )
    return out


def _outside(parts: list[Int32s], n: int) -> Bools:
    outside = np.ones(n, bool)
    for part in parts:
        outside[part] = False
    return outside
