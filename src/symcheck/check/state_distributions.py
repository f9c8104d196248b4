"""Transient and steady-state distributions of chains, from an initial distribution.

By default, all initial states have the same probability.

Sources: Stewart (1994), 'Introduction to the Numerical Solution of Markov Chains'; Baier & Katoen
(2008), 10.1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from numbers import Real
from time import perf_counter
from typing import ClassVar, Literal

import numpy as np

from symcheck.check.context import Context
from symcheck.engines.base import ROUNDING, Engine, Number, StateSet
from symcheck.engines.states import StateVector, variable_names
from symcheck.errors import NumericalError, UnsupportedError, UsageError, converts_memory_error
from symcheck.kernels.rows import sparse
from symcheck.matrices.numbers import Numbers, doubles, full, is_rational, numbers, rationals
from symcheck.matrices.rows import Floats, Int32s, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics import graph
from symcheck.numerics.tuning import (
    ENTRY_ERROR,
    SQUARING_STATES,
    SQUARING_STEPS,
    STEP_ENTRIES,
    UNIT_ROUNDOFF,
)
from symcheck.options import Options
from symcheck.semantics.features import Feature, require
from symcheck.tables import Table, counted, state_table

__all__ = ["Distribution", "initial_distribution", "steady_state", "transient"]


@dataclass(frozen=True, eq=False)
class Distribution(StateVector):
    """Probabilities of all states, in index order.

    It is indexed as `StateVector` says, and iteration gives the states with positive probability.

    Attributes:
        engine: the engine of the states.
        lower, upper: bounds on the probabilities, float64[n]; equal Fractions if exact.
        certified: the bounds are proved.
        explanation: the method, in words.
        seconds: the time of the computation.
    """

    _noun: ClassVar[str] = "probability"

    engine: Engine = field(repr=False)
    lower: Numbers = field(repr=False)
    upper: Numbers = field(repr=False)
    certified: bool = True
    explanation: str = ""
    seconds: float = 0.0

    @property
    def exact(self) -> bool:
        """Whether the probabilities are rationals without error."""
        return is_rational(self.lower)

    @property
    def values(self) -> Numbers:
        """The midpoints of the bounds, float64[n], or the rationals."""
        return self.lower if self.exact else 0.5 * (self.lower + self.upper)

    @property
    def error(self) -> float:
        """The largest possible distance of a value from the true probability."""
        return 0.0 if self.exact else 0.5 * float(np.max(self.upper - self.lower, initial=0.0))

    def at(self, states: StateSet) -> tuple[Numbers, Numbers]:
        """Lower and upper bounds over a set of the engine, in index order."""
        numbers = self.engine.numbers(states)
        return self.lower[numbers], self.upper[numbers]

    def __iter__(self) -> Iterator[tuple[int, tuple[bool | int, ...], float | Fraction]]:
        """Index, variable values and probability of each state with positive probability."""
        values = self.values
        some = np.asarray(values > 0, np.bool_)
        states = self.engine.valuations(self.engine.from_bools(some))
        return zip(np.flatnonzero(some).tolist(), states, values[some].tolist(), strict=True)

    def _table(self) -> Table:
        rows = sorted(self, key=lambda row: -row[2])
        note = f"{len(rows):,} of {len(self):,} states have positive probability"
        return state_table(variable_names(self.engine.model), rows, (self._noun,), note)


def initial_distribution(engine: Engine) -> Numbers:
    """The uniform distribution over the initial states, float64[n] or rationals."""
    members = numbers(engine.to_bools(engine.initial), rational=engine.is_rational)
    return np.asarray(members / members.sum())


@converts_memory_error()
def transient(
    engine: Engine,
    time: float,
    options: Options | None = None,
    start: Numbers | None = None,
) -> Distribution:
    """The distribution after `time` steps (DTMC) or units of time (CTMC).

    That of a CTMC has bounds in rational arithmetic too: it is irrational, with powers of e.

    Args:
        engine: the engine of a chain.
        time: the time, non-negative; an integer for a DTMC.
        options: the accuracy.
        start: the initial distribution, float64[n]; None: uniform over the initial states.

    Raises:
        UnsupportedError: the model is an MDP.
        UsageError: the time is negative or not an integer, or `start` is not a distribution.
        NumericalError: rounding errors of the steps are too large.
    """
    options, started = options or Options(), perf_counter()
    start = _prepared(engine, start, "transient")
    if not isinstance(time, Real) or not 0 <= time < np.inf:
        raise UsageError(f"a time is a number that is not negative, not {time!r}")
    if not engine.model.type.continuous_time and time != int(time):
        raise UsageError(f"a DTMC takes whole steps, not {time}")
    if engine.is_rational and (engine.model.type.chooses_uniformly or time == 0):
        lower = upper = _exact_steps(engine, start, time)
        text = f"{counted(int(time), 'step')} in rational arithmetic"
        return Distribution(engine, lower, upper, True, text, perf_counter() - started)
    kernel, start = engine.system(engine.all).row_kernel, doubles(start)
    weights = kernel.weights.doubles()
    if kernel.exit_rates is None:
        lower, upper, text = _steps(weights, start, int(time), engine.entry_error)
    elif time == 0:
        lower, upper, text = start, start, "no time passes"
    else:
        from symcheck.numerics.transient.values import transient_distribution

        kernel = TransitionKernel(weights, doubles(kernel.exit_rates))
        error = engine.entry_error
        solution = transient_distribution(kernel, start, float(time), options, error)
        lower, upper, text = solution.lower, solution.upper, solution.explanation
    return Distribution(engine, lower, upper, True, text, perf_counter() - started)


def _exact_steps(engine: Engine, start: Numbers, time: float) -> Numbers:
    """The probabilities after some steps, as rationals."""
    matrix, x = engine.system(engine.all).matrix, start
    for _ in range(int(time)):
        y = full(len(x), 0, rational=True)
        np.add.at(y, matrix.indices, matrix.data * np.repeat(x, matrix.lengths))
        if np.array_equal(x, y):
            break
        x = y
    return x


_Kind = Literal["transient", "steady-state"]
_OF_AN_MDP: Mapping[_Kind, str] = {
    "transient": "Pmin=? [ F=10 x=1 ] and Pmax=? [ F=10 x=1 ] bound a probability after 10 steps",
    "steady-state": "Smin=? [ x=1 ] and Smax=? [ x=1 ] bound a probability in the long run",
}


def _prepared(engine: Engine, start: Numbers | None, kind: _Kind) -> Numbers:
    require(engine.model, Feature.DISTRIBUTIONS)
    if engine.model.type.has_choices:
        raise UnsupportedError(
            f"an MDP has no {kind} distribution over its states: it depends on the strategy",
            hint=f"{_OF_AN_MDP[kind]}; the chain of one strategy has one: "
            "symcheck.induced_chain(model, strategy), or -importstrat FILE",
        )
    if start is None:
        return initial_distribution(engine)
    if not engine.is_rational:
        start = np.asarray(start, np.float64)
    else:  # doubles are the decimals that users see
        start = rationals(Fraction(repr(p)) if isinstance(p, float) else p for p in list(start))
    if len(start) != engine.states:
        raise UsageError(
            f"the initial distribution has {len(start)} probabilities, "
            f"and the model {counted(engine.states, 'state')}"
        )
    if not np.all(start >= 0) or abs(start.sum() - 1) > (0 if engine.is_rational else 1e-6):
        raise UsageError("the initial distribution does not consist of probabilities that sum to 1")
    return start


def _steps(
    matrix: SparseMatrix, start: Floats, steps: int, entry_error: float
) -> tuple[Floats, Floats, str]:
    """Bounds after products with the transposed matrix, and an explanation.

    All terms are non-negative, so the rounding error is relative. Small chains are squared.
    entry_error: of the matrix, relative.
    """
    if matrix.states <= SQUARING_STATES and steps > SQUARING_STEPS:
        from symcheck.numerics.transient.squaring import IntervalChain, squaring_entries

        chain = IntervalChain.of_steps(
            matrix,
            np.zeros(len(start)),
            ENTRY_ERROR + entry_error + matrix.longest * UNIT_ROUNDOFF,
        )
        cheap = squaring_entries(matrix.states, steps) < steps * max(matrix.entries, STEP_ENTRIES)
        if chain is not None and cheap:
            found = chain.distribution(steps, start)
            return found.lower, found.upper, f"{found.squarings} squarings of a matrix"
    indptr, indices, data = sparse.transpose_values(*matrix.arrays, matrix.columns)
    longest = int(np.max(np.diff(indptr), initial=0))
    x, y = start.copy(), np.empty(len(start))
    made = 0
    while made < steps:
        sparse.multiply(indptr, indices, data, x, y)
        made += 1
        if np.array_equal(x, y):
            break  # a fixpoint of the rounded products
        x, y = y, x
    step = (longest + 2) * UNIT_ROUNDOFF + entry_error
    error = 1.01 * made * step + 4 * UNIT_ROUNDOFF if steps else 0.0
    if error > 1e-3:
        raise NumericalError(
            f"{steps} steps are too many: rounding may make an error of {error:.1E}"
        )
    if made < steps:
        # The rounded products reached a fixpoint, the true ones may still change: the bound must
        # hold for all steps.
        error = max(error, min(1.01 * steps * step, 1.0))
    text = f"{made} products with the matrix" + (", then nothing changes" if made < steps else "")
    return x * (1 - error), x * (1 + error), text


@converts_memory_error()
def steady_state(
    engine: Engine, options: Options | None = None, start: Numbers | None = None
) -> Distribution:
    """The long-run distribution: the fraction of the time that is spent in each state.

    The stationary distribution of each bottom component is weighted with the probability of
    reaching the component.

    Args:
        engine: the engine of a chain.
        options: the accuracy.
        start: the initial distribution, float64[n]; None: uniform over the initial states.

    Raises:
        UnsupportedError: the model is an MDP.
        UsageError: `start` is not a distribution.
    """
    from symcheck.numerics.linear import rational
    from symcheck.numerics.long_run.stationary import stationary_distribution

    options, started = options or Options(), perf_counter()
    start = _prepared(engine, start, "steady-state")
    matrix = engine.system(engine.all).weights
    parts = graph.bsccs(matrix)
    weights = _reached(engine, parts, start, options)
    lower, upper = (full(engine.states, 0, rational=engine.is_rational) for _ in range(2))
    certified, largest = True, ""
    for part, (low, high) in zip(parts, weights, strict=True):
        if high == 0.0:
            continue
        index = np.full(engine.states, -1, np.int32)
        index[part] = np.arange(len(part), dtype=np.int32)
        component = matrix.select(part, index, len(part))
        if engine.is_rational:
            lower[part] = rational.stationary_distribution(component) * np.asarray(low, object)
            continue
        solution = stationary_distribution(component, options, error=engine.entry_error)
        certified &= solution.certified
        rounding = 0.0 if low == 1 else 4.0 * UNIT_ROUNDOFF
        lower[part] = solution.lower * float(low) * (1.0 - rounding)
        upper[part] = np.minimum(solution.upper * float(high) * (1.0 + rounding), 1.0)
        largest = solution.explanation if len(part) > 1 else largest
    if engine.is_rational:
        upper, largest = lower, "rational elimination"
    text = counted(len(parts), "bottom component") + (f"; {largest}" if largest else "")
    return Distribution(engine, lower, upper, certified, text, perf_counter() - started)


def _reached(
    engine: Engine, parts: list[Int32s], start: Numbers, options: Options
) -> list[tuple[Number, Number]]:
    """Bounds on the probability of reaching each bottom component."""
    from symcheck.check.measures.reachability import until

    if len(parts) == 1:
        return [(1, 1)]
    begins, positive = engine.from_bools(start > 0), start[start > 0]
    context = Context(engine, options)
    if sum(np.count_nonzero(start[part]) for part in parts) == len(positive):
        return [(mass, mass) for mass in (start[part].sum() for part in parts)]
    out: list[tuple[Number, Number]] = []
    for part in parts:
        members = np.zeros(engine.states, bool)
        members[part] = True
        values = until(context, engine.all, engine.from_bools(members), None)
        low, high = values.at(begins)
        if engine.is_rational:
            mass = np.dot(low, positive)
            out.append((mass, mass))
            continue
        # The sum is rounded.
        out.append(
            (
                float(np.dot(low, positive)) * (1 - ROUNDING),
                min(1.0, float(np.dot(high, positive)) * (1 + ROUNDING)),
            )
        )
    return out
