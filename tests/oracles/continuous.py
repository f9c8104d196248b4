"""Continuous-time Markov chains: proved enclosures of transient values, in integers.

Nothing here knows symcheck. A chain is a list of rows of rates, as fractions. The exponential of a
generator has no negative entry and rows with the sum 1, so lower bounds of its entries give upper
ones: what a row lacks of 1 is the greatest error of each of its entries. Lower bounds come from the
series of uniformisation (A. Jensen, 1953), whose terms are nonnegative, cut off and rounded down,
and from squaring (C. Moler and C. Van Loan, Nineteen dubious ways, 2003, method 3), rounded down.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from oracles import chains
from oracles.chains import Column, Row, States

Interval = tuple[Fraction, Fraction]
Matrix = list[list[int]]
"""Multiples of 2^-BITS."""

BITS = 2200
"""Of numbers between 0 and 1: each squaring doubles errors, at most some 100 times."""
SHORT = 32
"""The series is taken of a time in which 2^-SHORT events are expected."""


def embedded(rates: Sequence[Row]) -> list[Row]:
    """The chain of the jumps."""
    return [{t: r / sum(row.values()) for t, r in row.items()} for row in rates]


def exits(rates: Sequence[Row]) -> Column:
    """The exit rates."""
    return [sum(row.values(), Fraction(0)) for row in rates]


def occupied(rates: Sequence[Row], states: Sequence[Fraction], jumps: Sequence[Fraction]) -> Column:
    """The expected reward of a visit: that of the time in the state, and that of the jump."""
    return [s / e + j for s, j, e in zip(states, jumps, exits(rates), strict=True)]


def long_run(rates: Sequence[Row], states: Sequence[Fraction], jumps: Sequence[Fraction]) -> Column:
    """The long-run reward per time: in each bottom component, that per cycle by its length."""
    chain = embedded(rates)
    earned, lasts = occupied(rates, states, jumps), [1 / e for e in exits(rates)]
    values = [Fraction(0)] * len(chain)
    for component in chains.components(chain):
        share = chains.stationary(chain, component)
        mean = sum(v * earned[s] for s, v in share.items())
        mean /= sum(v * lasts[s] for s, v in share.items())
        ends = chains.until(chain, range(len(chain)), component)
        values = [v + p * mean for v, p in zip(values, ends, strict=True)]
    return values


def exponential(rates: Sequence[Row], time: Fraction) -> tuple[Matrix, Matrix]:
    """Lower bounds of exp(Q t), and of its mean over the times from 0 to t."""
    n, one = len(rates), 1 << BITS
    identity = [[one * (i == j) for j in range(n)] for i in range(n)]
    moving = [{t: r for t, r in row.items() if t != s} for s, row in enumerate(rates)]
    fastest = max(exits(moving))
    if not fastest or not time:
        return identity, identity
    doublings = max(0, _log2(fastest * time) + SHORT)
    events = fastest * time / 2**doublings  # at most 2^-SHORT
    jumps = [[_down(row.get(j, Fraction(0)) / fastest) for j in range(n)] for row in moving]
    for i, leaves in enumerate(exits(moving)):
        jumps[i][i] = _down(1 - leaves / fastest)
    # The Poisson weights x^k/k! and their means over the time, the sums of x^(j-1)/j! for j > k:
    # both times exp(-x), which is at least 1 over the series of exp(x) rounded up.
    orders = range(BITS // SHORT + 2)
    weights, parts, upper = [one], [one], one + 2  # 2 for the rest of the series
    for k in orders[1:]:
        weights.append(weights[-1] * events.numerator // (events.denominator * k))
        parts.append(parts[-1] * events.numerator // (events.denominator * (k + 1)))
        upper += weights[-1] + 1
    decay = one * one // upper
    at_end, mean_time, power = _zero(n), _zero(n), identity
    for k in orders:
        rest = sum(parts[k:])
        for i in range(n):
            for j in range(n):
                at_end[i][j] += power[i][j] * (weights[k] * decay >> BITS) >> BITS
                mean_time[i][j] += power[i][j] * (rest * decay >> BITS) >> BITS
        power = _times(power, jumps)
    for _ in range(doublings):  # the mean over a doubled time is that of two halves
        pairs = zip(mean_time, _times(at_end, mean_time), strict=True)
        mean_time = [[(a + b) >> 1 for a, b in zip(*pair, strict=True)] for pair in pairs]
        at_end = _times(at_end, at_end)
    return at_end, mean_time


def bounded_until(
    rates: Sequence[Row], left: States, right: States, low: Fraction, high: Fraction
) -> list[Interval]:
    """The probability that `right` holds at a time from low to high, and `left` before it."""
    stopped = [row if s in left and s not in right else {} for s, row in enumerate(rates)]
    reached = [_point(s in right) for s in range(len(rates))]
    later = _means(stopped, exponential(stopped, high - low)[0], reached)
    return _delayed(rates, left, later, low)


def until_from(rates: Sequence[Row], left: States, right: States, low: Fraction) -> list[Interval]:
    """The probability that `right` holds at time low or later, and `left` before it."""
    later = [(p, p) for p in chains.until(embedded(rates), left, right)]
    return _delayed(rates, left, later, low)


def _delayed(
    rates: Sequence[Row], left: States, values: Sequence[Interval], time: Fraction
) -> list[Interval]:
    """The probability to stay in `left` for this time, and then that of the values."""
    if not time:
        return list(values)
    inside = [row if s in left else {} for s, row in enumerate(rates)]
    kept = [v if s in left else _point(0) for s, v in enumerate(values)]
    found = _means(inside, exponential(inside, time)[0], kept)
    return [v if s in left else _point(0) for s, v in enumerate(found)]


def cumulated(
    rates: Sequence[Row], states: Sequence[Fraction], jumps: Sequence[Fraction], time: Fraction
) -> list[Interval]:
    """The expected reward up to a time: that of states per time, and that of jumps."""
    earned = [s + e * j for s, e, j in zip(states, exits(rates), jumps, strict=True)]
    found = _means(rates, exponential(rates, time)[1], [(v, v) for v in earned])
    return [(time * low, time * high) for low, high in found]


def instantaneous(
    rates: Sequence[Row], states: Sequence[Fraction], time: Fraction
) -> list[Interval]:
    """The expected reward of the state at a time."""
    return _means(rates, exponential(rates, time)[0], [(v, v) for v in states])


def _log2(x: Fraction) -> int:
    """An integer that is at least the binary logarithm."""
    return x.numerator.bit_length() - x.denominator.bit_length() + 1


def _down(x: Fraction) -> int:
    return (x.numerator << BITS) // x.denominator


def _zero(n: int) -> Matrix:
    return [[0] * n for _ in range(n)]


def _times(left: Matrix, right: Matrix) -> Matrix:
    columns = list(zip(*right, strict=True))
    return [
        [
            sum(a * b for a, b in zip(row, column, strict=True) if a and b) >> BITS
            for column in columns
        ]
        for row in left
    ]


def _point(value: int) -> Interval:
    return Fraction(value), Fraction(value)


def _means(rates: Sequence[Row], matrix: Matrix, values: Sequence[Interval]) -> list[Interval]:
    """The expected values: what the lower bounds of a row lack of 1 is in any reachable state."""
    found = []
    for s, row in enumerate(matrix):
        reachable = chains.reachable(rates, s)
        lacking = Fraction((1 << BITS) - sum(row), 1 << BITS)
        low, high = (
            sum((Fraction(row[t], 1 << BITS) * values[t][end] for t in reachable), Fraction(0))
            for end in (0, 1)
        )
        least, most = min(values[t][0] for t in reachable), max(values[t][1] for t in reachable)
        found.append((low + lacking * least, high + lacking * most))
    return found
