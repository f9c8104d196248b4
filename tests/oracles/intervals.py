"""Intervals of probabilities: by the vertices of each row, and every strategy of player and nature.

A row has an interval for each successor. Its distributions are a polytope; linear functions have
their optima at vertices, where at most one probability lies strictly within its interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product

from oracles import chains, decisions
from oracles.chains import Chain, Row, States, Value

Interval = tuple[Fraction, Fraction]
IntervalRow = dict[int, Interval]
Games = Sequence[Sequence[IntervalRow]]
"""Per state its choices."""
Optimum = Callable[..., Value]


def vertices(row: IntervalRow) -> list[Row]:
    """The vertices of the distributions of a row, without successors of probability 0."""
    found: list[Row] = []
    for free in row:
        others = [t for t in row if t != free]
        for ends in product(*(row[t] for t in others)):
            rest = 1 - sum(ends)
            if row[free][0] <= rest <= row[free][1]:
                full = dict(zip(others, ends, strict=True)) | {free: rest}
                vertex = {t: p for t, p in full.items() if p}
                if vertex not in found:
                    found.append(vertex)
    return found


def _answers(games: Games) -> Iterator[list[list[Row]]]:
    """Per strategy of the player, the vertices that nature may choose in each state."""
    for strategy in decisions.strategies(games):
        yield [vertices(choices[c]) for choices, c in zip(games, strategy, strict=True)]


def value(
    games: Games, player: Optimum, nature: Optimum, measure: Callable[[Chain], Sequence[Value]]
) -> list[Value]:
    """A measure of chains: the player chooses a strategy, and nature, which knows it, vertices."""
    values = [decisions.over_strategies(answer, nature, measure) for answer in _answers(games)]
    return [player(column) for column in zip(*values, strict=True)]


def until(
    games: Games, player: Optimum, nature: Optimum, left: States, right: States
) -> list[Value]:
    """The probability of left U right."""
    return value(games, player, nature, lambda chain: chains.until(chain, left, right))


def reach_reward(
    games: Games,
    rewards: Sequence[Sequence[Fraction]],
    player: Optimum,
    nature: Optimum,
    target: States,
) -> list[Value]:
    """The reward before the target, infinite where it may be missed; rewards per choice."""
    values = []
    for strategy, answer in zip(decisions.strategies(games), _answers(games), strict=True):
        own = [r[c] for r, c in zip(rewards, strategy, strict=True)]
        values.append(
            decisions.over_strategies(
                answer, nature, lambda chain, own=own: chains.reach_reward(chain, own, target)
            )
        )
    return [player(column) for column in zip(*values, strict=True)]


def steps(
    games: Games,
    rewards: Sequence[Sequence[Fraction]],
    player: Optimum,
    nature: Optimum,
    last: Sequence[Fraction],
    count: int,
    kept: States = (),
) -> list[Value]:
    """The value of `last` after some steps, with the rewards of each step; some states keep it."""
    values: list[Value] = list(last)
    for _ in range(count):
        values = [
            last[s]
            if s in kept
            else player(
                r + nature(chains.average(vertex, values) for vertex in vertices(row))
                for r, row in zip(rewards[s], choices, strict=True)
            )
            for s, choices in enumerate(games)
        ]
    return values


def infinitely_often(games: Games, player: Optimum, nature: Optimum, states: States) -> list[Value]:
    """The probability of visiting some states infinitely often."""

    def measure(chain: Chain) -> list[Fraction]:
        recurrent = {t for c in chains.components(chain) if c & set(states) for t in c}
        return chains.until(chain, range(len(chain)), recurrent)

    return value(games, player, nature, measure)


def long_run(
    games: Games, rewards: Sequence[Fraction], player: Optimum, nature: Optimum
) -> list[Value]:
    """The average reward per step, of states."""
    return value(games, player, nature, lambda chain: chains.long_run(chain, rewards))
