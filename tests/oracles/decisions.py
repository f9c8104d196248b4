"""Markov decision processes in fractions: all memoryless strategies, or backward induction.

Nothing here knows symcheck: each state has a list of rows, one per choice. Memoryless deterministic
strategies attain the optima of unbounded measures (M. Puterman, Markov Decision Processes, 1994,
chapters 6 to 9); bounded ones are optimal step by step (chapter 4).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product
from math import prod

from oracles import chains
from oracles.chains import Chain, Column, Row, States, Value, average

Processes = Sequence[Sequence[Row]]
Optimum = Callable[..., Value]
"""min or max."""
Rewards = Sequence[Sequence[Fraction]]
"""One per choice of each state, with that of the state."""


def strategies(processes: Processes) -> Iterator[tuple[int, ...]]:
    """All memoryless deterministic strategies: one choice per state."""
    return product(*(range(len(choices)) for choices in processes))


def strategy_count(processes: Processes) -> int:
    """How many they are."""
    return prod(len(choices) for choices in processes)


def induced(processes: Processes, strategy: Sequence[int]) -> list[Row]:
    """The chain of a strategy."""
    return [choices[c] for choices, c in zip(processes, strategy, strict=True)]


def over_strategies(
    processes: Processes, best: Optimum, measure: Callable[[Chain], Sequence[Value]]
) -> list[Value]:
    """The optimal value of a measure of chains in each state."""
    values = [measure(induced(processes, s)) for s in strategies(processes)]
    return [best(column) for column in zip(*values, strict=True)]


def over_rewards(
    processes: Processes,
    rewards: Rewards,
    best: Optimum,
    measure: Callable[[Chain, Column], Sequence[Value]],
) -> list[Value]:
    """The optimal value of a measure of chains with rewards in each state."""
    values = [
        measure(induced(processes, s), [r[c] for r, c in zip(rewards, s, strict=True)])
        for s in strategies(processes)
    ]
    return [best(column) for column in zip(*values, strict=True)]


def until(processes: Processes, best: Optimum, left: States, right: States) -> Column:
    """The optimal probability of left U right."""
    return over_strategies(processes, best, lambda chain: chains.until(chain, left, right))


def bounded_until(
    processes: Processes, best: Optimum, left: States, right: States, low: int, high: int
) -> Column:
    """The optimal probability that `right` holds at a step from low to high, `left` before it."""
    values = [Fraction(0)] * len(processes)
    for step in range(high, -1, -1):
        values = [
            Fraction(1)
            if step >= low and s in right
            else best(average(row, values) for row in choices)
            if s in left
            else Fraction(0)
            for s, choices in enumerate(processes)
        ]
    return values


def next_step(processes: Processes, best: Optimum, states: States) -> Column:
    """The optimal probability that the next state is one of these."""
    values = [Fraction(s in states) for s in range(len(processes))]
    return [best(average(row, values) for row in choices) for choices in processes]


def cumulated(
    processes: Processes,
    rewards: Rewards,
    best: Optimum,
    steps: int,
    factor: Fraction = Fraction(1),
) -> Column:
    """The optimal reward of this number of steps, discounted by a factor."""
    values = [Fraction(0)] * len(processes)
    for _ in range(steps):
        values = [
            best(r + factor * average(row, values) for r, row in zip(own, choices, strict=True))
            for own, choices in zip(rewards, processes, strict=True)
        ]
    return values


def instantaneous(
    processes: Processes, rewards: Sequence[Fraction], best: Optimum, steps: int
) -> Column:
    """The optimal expected reward of the state after this number of steps."""
    values = [Fraction(r) for r in rewards]
    for _ in range(steps):
        values = [best(average(row, values) for row in choices) for choices in processes]
    return values


def conditional(
    processes: Processes, best: Optimum, goal: States, given: States
) -> list[Fraction | None]:
    """The optimal probability of F goal given F condition; None where no strategy reaches it.

    A quotient of two linear functions of the visits of states: memoryless strategies are optimal
    until the goal or the condition is met, and the best chance of the other one from there on
    (C. Baier, J. Klein, S. Klüppelholz, S. Märcker, Computing conditional probabilities, 2014).
    Where the least chance of the condition is 0 and every run that meets it has met the goal, any
    other chance gives 1.
    """
    everywhere = range(len(processes))
    other = {
        goal: until(processes, best, everywhere, goal) for goal in map(frozenset, (goal, given))
    }
    possible = until(processes, max, everywhere, given)
    reached = {
        s: (
            (chance := other[frozenset(given)][s], chance, possible[s])
            if s in goal
            else (other[frozenset(goal)][s], Fraction(1), Fraction(1))
        )
        for s in {*goal, *given}
    }
    found: list[list[Fraction]] = [[] for _ in everywhere]
    for strategy in strategies(processes):
        chain = induced(processes, strategy)
        unknown = sorted(chains.can_reach(chain, everywhere, reached) - set(reached))
        both, condition, greatest = (
            {s: parts[part] for s, parts in reached.items()}
            | chains.restricted(
                chain,
                unknown,
                [
                    sum(
                        (p * reached[t][part] for t, p in chain[s].items() if t in reached),
                        Fraction(0),
                    )
                    for s in unknown
                ],
            )
            for part in (0, 1, 2)
        )
        for s in both:
            if greatest[s]:
                found[s].append(both[s] / condition[s] if condition[s] else Fraction(1))
    return [best(values) if values else None for values in found]


def reach_reward(
    processes: Processes, rewards: Rewards, best: Optimum, target: States
) -> list[Value]:
    """The optimal reward before the target; strategies that may miss it have infinity."""
    return over_rewards(
        processes, rewards, best, lambda chain, own: chains.reach_reward(chain, own, target)
    )
