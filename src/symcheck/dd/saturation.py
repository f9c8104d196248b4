"""Closing a set under relations by whichever of two ways is faster, told by letting them take turns."""

from __future__ import annotations

import time

from symcheck.dd.cudd.extension import Bdd, Closure

__all__ = ["close"]

FIRST = {True: 30_000_000, False: 300_000}
"""Steps of the first turn, forward and backward: forward the second way gains little, and loses much where it loses."""


def close(
    closure: Closure, states: Bdd, within: Bdd | None = None, deadline: float | None = None
) -> Bdd | None:
    """As `Closure.close`; None past the `deadline` (of time.monotonic), or where too many families of relations would be needed.

    Moving everything found on, or only what is new: the first is up to 50 times as fast where counters meet (mapk, zeroconf),
    the second where a clock drives everything (wlan backwards). Turns double, and each finds what the other remembered,
    so that the loser costs little. They are counted in steps: the same run does the same on any machine.
    """
    steps, fresh = FIRST[closure.forward], False
    while True:
        result = closure.close(states, within, deadline=deadline, steps=steps, fresh=fresh)
        if (
            result is not None
            or closure.exhausted
            or (deadline is not None and time.monotonic() > deadline)
        ):
            return result
        steps, fresh = 2 * steps if fresh else steps, not fresh
