"""Turn-based stochastic games in fractions: all pairs of memoryless strategies, or induction.

Nothing here knows symcheck: a game is a decision process and the set of the states in which the
maximiser chooses. Both sides have memoryless deterministic optimal strategies for reachability and
for the rewards here that grow along a run (A. Condon, The complexity of stochastic games, 1992;
T. Chen et al., Automatic verification of competitive stochastic systems, 2013); bounded measures are
optimal step by step. Rewards that are lost where the target is missed need memory, so that they are
given as limits of bounded ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product

from oracles import chains
from oracles.chains import Chain, Column, States, Value, average
from oracles.decisions import Processes, Rewards, induced

Measure = Callable[[Chain, Column], Sequence[Value]]


def value(game: Processes, maximiser: States, rewards: Rewards, measure: Measure) -> list[Value]:
    """max over the maximiser's strategies of min over the other's, which is min of max."""
    mine = [range(len(c)) if s in maximiser else range(1) for s, c in enumerate(game)]
    others = [range(1) if s in maximiser else range(len(c)) for s, c in enumerate(game)]
    table = [
        [
            measure(
                induced(game, strategy := [a + b for a, b in zip(first, second, strict=True)]),
                [r[c] for r, c in zip(rewards, strategy, strict=True)],
            )
            for second in product(*others)
        ]
        for first in product(*mine)
    ]
    lower, upper = [], []
    for s in range(len(game)):
        column = [[values[s] for values in line] for line in table]
        lower.append(max(min(line) for line in column))
        upper.append(min(max(line) for line in zip(*column, strict=True)))
    assert lower == upper, "memoryless strategies determine these games"
    return lower


def until(game: Processes, maximiser: States, left: States, right: States) -> list[Value]:
    """The probability of left U right."""
    nothing = [[Fraction(0)] * len(c) for c in game]
    return value(game, maximiser, nothing, lambda chain, _: chains.until(chain, left, right))


def reach_reward(
    game: Processes, maximiser: States, rewards: Rewards, target: States
) -> list[Value]:
    """The reward until a target is reached; infinite where it is missed."""
    return value(game, maximiser, rewards, lambda c, r: chains.reach_reward(c, r, target))


def kept_reward(
    game: Processes, maximiser: States, rewards: Rewards, target: States
) -> list[Value]:
    """The reward until a target is reached, or for ever."""
    ended = [[{s: Fraction(1)}] * len(c) if s in target else c for s, c in enumerate(game)]
    earned = [[Fraction(0)] * len(r) if s in target else r for s, r in enumerate(rewards)]
    return value(ended, maximiser, earned, chains.total)


def stepwise(
    game: Processes, maximiser: States, start: Column, steps: int, rewards: Rewards | None = None
) -> Column:
    """The best values some steps before these values; rewards are added in each."""
    values = start
    for _ in range(steps):
        values = [
            (max if s in maximiser else min)(
                average(row, values) + (rewards[s][c] if rewards else 0)
                for c, row in enumerate(choices)
            )
            for s, choices in enumerate(game)
        ]
    return values


def bounded_until(
    game: Processes, maximiser: States, left: States, right: States, steps: int
) -> Column:
    """The probability of left U<=steps right."""
    ended = [c if s in left and s not in right else [{s: Fraction(1)}] for s, c in enumerate(game)]
    start = [Fraction(s in right) for s in range(len(game))]
    return stepwise(ended, maximiser, start, steps)


def lost_reward(
    game: Processes, maximiser: States, rewards: Rewards, target: States, steps: int
) -> Column:
    """The reward until a target that is reached within some steps; 0 where it is not.

    Rewards are natural numbers. The values grow with the steps towards that without a bound.
    """
    known: dict[tuple[int, int, int], Fraction] = {}

    def best(state: int, earned: int, left: int) -> Fraction:
        if state in target:
            return Fraction(earned)
        if left == 0:
            return Fraction(0)
        key = (state, earned, left)
        if key not in known:
            known[key] = (max if state in maximiser else min)(
                sum(
                    (
                        p * best(t, earned + int(rewards[state][c]), left - 1)
                        for t, p in row.items()
                    ),
                    Fraction(0),
                )
                for c, row in enumerate(game[state])
            )
        return known[key]

    return [best(s, 0, steps) for s in range(len(game))]
