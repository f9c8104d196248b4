"""Unions of zones (federations) as arrays of difference bounds.

A federation of m zones over n clocks, among them clock 0 whose value is 0, is int64[m, n, n]. Entry
(i, j) of a zone bounds x_i - x_j: 2c + 1 for <= c, 2c for < c, `INFINITE` for no bound. All zones
are closed (their bounds are tight) and not empty.
Source: Bengtsson & Yi, Timed automata: semantics, algorithms and tools, LNCS 3098 (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from symcheck.kernels.zones.shortest_paths import close_zones
from symcheck.matrices.rows import Bools, Int64s

__all__ = [
    "INFINITE",
    "Atom",
    "before",
    "close",
    "complement",
    "constrained",
    "distinct",
    "empty",
    "everything",
    "future",
    "includes",
    "intersection",
    "is_within",
    "past",
    "point",
    "reset",
    "subtraction",
    "time_predecessors",
    "union",
    "without_resets",
    "zone_of",
]

INFINITE = 1 << 40
_WEAK = 1  # x_i - x_j <= 0
Atom = tuple[int, int, int]
"""A bound (i, j, code) on x_i - x_j."""


def everything(clocks: int) -> Int64s:
    """All values of the clocks, which are not negative."""
    zone = np.full((1, clocks, clocks), INFINITE, np.int64)
    zone[:, 0, :] = _WEAK
    zone[:, range(clocks), range(clocks)] = _WEAK
    return zone


def empty(clocks: int) -> Int64s:
    """No values."""
    return np.empty((0, clocks, clocks), np.int64)


def close(zones: Int64s) -> Int64s:
    """Tighten all bounds, in place, and leave out empty zones."""
    kept = _close(zones)
    return zones if kept.all() else zones[kept]


def _close(zones: Int64s) -> Bools:
    """Tighten all bounds, in place; which zones are not empty."""
    kept = np.empty(len(zones), np.uint8)
    close_zones(zones, kept, INFINITE)
    return kept.astype(np.bool_)


def constrained(zones: Int64s, *atoms: Atom) -> Int64s:
    """The part that satisfies further bounds."""
    if not atoms or not len(zones):
        return zones
    zones = zones.copy()
    for i, j, code in atoms:
        np.minimum(zones[:, i, j], code, out=zones[:, i, j])
    return close(zones)


def zone_of(clocks: int, *atoms: Atom) -> Int64s:
    """The values that satisfy some bounds."""
    return constrained(everything(clocks), *atoms)


def union(*parts: Int64s) -> Int64s:
    """All zones, without those that are within another one."""
    return distinct(np.concatenate(parts))


def distinct(zones: Int64s) -> Int64s:
    """The federation without zones that are within another one."""
    if len(zones) < 2:
        return zones
    within = includes(zones, zones)
    within &= ~(within.T & np.tri(len(zones), dtype=bool))  # the first one of equal zones stays
    return zones[~within.any(axis=0)]


def includes(outer: Int64s, inner: Int64s) -> Bools:
    """Whether zone i of `outer` includes zone j of `inner`, bool[i, j]."""
    return np.asarray((outer[:, None] >= inner[None, :]).all(axis=(2, 3)))


def intersection(left: Int64s, right: Int64s) -> Int64s:
    """What both federations have."""
    n = left.shape[1]
    pairs = np.minimum(left[:, None], right[None, :]).reshape(-1, n, n)
    return distinct(close(pairs)) if len(pairs) else pairs


def subtraction(zones: Int64s, taken: Int64s) -> Int64s:
    """What the first federation has, and the second has not."""
    for zone in taken:
        if not len(zones):
            break
        apart = ~_close(np.minimum(zones, zone))
        parts, rest = [zones[apart]], zones[~apart]
        for i, j in zip(*np.nonzero(zone < INFINITE), strict=True):
            if i == j or not len(rest):
                continue
            code = int(zone[i, j])
            if (rest[:, i, j] <= code).all():
                continue
            parts.append(constrained(rest, (j, i, 1 - code)))
            rest = constrained(rest, (i, j, code))
        zones = np.concatenate(parts)
    return zones


def complement(zones: Int64s) -> Int64s:
    """All values that the federation has not."""
    return subtraction(everything(zones.shape[1]), zones)


def is_within(zones: Int64s, outer: Int64s) -> bool:
    """Whether the second federation includes the first."""
    left = zones[~includes(outer, zones).any(axis=0)] if len(outer) and len(zones) else zones
    return not len(left) or not len(subtraction(left, outer))


def past(zones: Int64s) -> Int64s:
    """The values from which time leads into the federation."""
    if not len(zones) or zones.shape[1] == 1:
        return zones
    zones = zones.copy()
    zones[:, 0, 1:] = zones[:, 1:, 1:].min(axis=1)
    return zones


def future(zones: Int64s) -> Int64s:
    """The values into which time leads from the federation."""
    zones = zones.copy()
    zones[:, 1:, 0] = INFINITE
    return zones


def reset(zones: Int64s, resets: Mapping[int, int]) -> Int64s:
    """The values after some clocks were set to numbers."""
    if not resets or not len(zones):
        return zones
    zones = zones.copy()
    for clock in resets:
        _free(zones, clock)
    return constrained(zones, *_equal(resets))


def without_resets(zones: Int64s, resets: Mapping[int, int]) -> Int64s:
    """The values from which setting some clocks to numbers leads into the federation."""
    if not resets:
        return zones
    zones = constrained(zones, *_equal(resets)).copy()
    for clock in resets:
        _free(zones, clock)
    return zones


def _equal(resets: Mapping[int, int]) -> list[Atom]:
    return [
        atom
        for clock, value in resets.items()
        for atom in ((clock, 0, 2 * value + 1), (0, clock, 1 - 2 * value))
    ]


def _free(zones: Int64s, clock: int) -> None:
    zones[:, clock, :] = INFINITE
    zones[:, :, clock] = zones[:, :, 0]
    zones[:, clock, clock] = _WEAK


def time_predecessors(goal: Int64s, avoided: Int64s) -> Int64s:
    """The values from which time leads into a goal, without being in what is avoided until then.

    Source: Cassez, David, Fleury, Larsen & Lime, Efficient on-the-fly algorithms for the analysis
    of timed games, CONCUR 2005, theorem 2.
    """
    if not len(avoided):
        return past(goal)
    parts = []
    for k in range(len(goal)):
        one = goal[k : k + 1]
        result = past(one)
        for j in range(len(avoided)):
            bad = avoided[j : j + 1]
            before = past(bad)
            behind = subtraction(past(one), before)
            first = past(subtraction(intersection(one, before), bad))
            result = intersection(result, np.concatenate([behind, first]))
        parts.append(result)
    return union(*parts) if parts else goal


def before(zones: Int64s) -> Int64s:
    """The values from which a positive time leads into some zones."""
    earlier = past(zones)
    upper = earlier[:, 1:, 0]
    upper[upper < INFINITE // 2] &= ~1  # the limits themselves are excluded
    return close(earlier)


def point(zone: Int64s) -> list[Fraction]:
    """Values of the clocks, without clock 0, in the first zone of a federation."""
    clocks = zone.shape[1]
    scale = 1 << clocks
    finite = zone[:1] < INFINITE // 2
    zone = np.where(finite, (zone[:1] >> 1) * 2 * scale + (zone[:1] & 1), zone[:1])
    values = []
    for i in range(1, clocks):
        limit = int(zone[0, 0, i])
        # A limit that is excluded is a multiple of the last step, and this step is half of it.
        value = -(limit >> 1) + (0 if limit & 1 else scale >> i)
        values.append(Fraction(value, scale))
        zone = constrained(zone, *_equal({i: value}))
    return values
