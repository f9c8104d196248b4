"""Discrete-time Markov chains in fractions, by the textbook's equations.

Nothing here knows symcheck: a chain is a list of rows, and a row maps successors to probabilities.
All functions return one value per state. Source: C. Baier and J.-P. Katoen, Principles of Model
Checking (2008), chapter 10; discounted and long-run rewards: M. Puterman, Markov Decision Processes
(1994), sections 6.1 and 8.2.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction
from math import inf, nan

Row = dict[int, Fraction]
Chain = Sequence[Row]
States = Collection[int]
Column = list[Fraction]
Value = Fraction | float
"""A fraction, infinity, or NaN where a value is undefined."""


def solve(rows: Sequence[Row], right: Sequence[Fraction]) -> Column:
    """The x with x = rows x + right, by Gaussian elimination; the solution has to be unique."""
    n = len(rows)
    system = [[Fraction(i == j) - rows[i].get(j, 0) for j in range(n)] for i in range(n)]
    for i, line in enumerate(system):
        line.append(Fraction(right[i]))
    for k in range(n):
        pivot = next(i for i in range(k, n) if system[i][k])
        system[k], system[pivot] = system[pivot], system[k]
        system[k] = [v / system[k][k] for v in system[k]]
        for i in range(n):
            if i != k and system[i][k]:
                factor = system[i][k]
                system[i] = [a - factor * b for a, b in zip(system[i], system[k], strict=True)]
    return [line[n] for line in system]


def restricted(
    chain: Chain, states: Sequence[int], right: Sequence[Fraction], factor: Fraction = Fraction(1)
) -> dict[int, Fraction]:
    """The x with x = factor chain x + right on these states, x being 0 on the others."""
    index = {s: i for i, s in enumerate(states)}
    rows = [{index[t]: factor * p for t, p in chain[s].items() if t in index} for s in states]
    return dict(zip(states, solve(rows, right), strict=True))


def average(row: Row, values: Sequence[Fraction]) -> Fraction:
    """The expected value of the next state."""
    return sum((p * values[t] for t, p in row.items()), Fraction(0))


def can_reach(chain: Chain, left: States, right: States) -> set[int]:
    """The states with a path to `right` through `left`."""
    found = set(right)
    while True:
        more = {s for s in left if s not in found and any(t in found for t in chain[s])}
        if not more:
            return found
        found |= more


def reachable(chain: Chain, state: int) -> set[int]:
    """The states that a state reaches, with itself."""
    seen, queue = {state}, [state]
    while queue:
        for t in set(chain[queue.pop()]) - seen:
            seen.add(t)
            queue.append(t)
    return seen


def until(chain: Chain, left: States, right: States) -> Column:
    """The probability of left U right."""
    unknown = sorted(can_reach(chain, left, right) - set(right))
    one_step = [sum((p for t, p in chain[s].items() if t in right), Fraction(0)) for s in unknown]
    found = restricted(chain, unknown, one_step)
    return [Fraction(1) if s in right else found.get(s, Fraction(0)) for s in range(len(chain))]


def bounded_until(chain: Chain, left: States, right: States, low: int, high: int) -> Column:
    """The probability that `right` holds at a step from low to high, and `left` before it."""
    values = [Fraction(0)] * len(chain)
    for step in range(high, -1, -1):
        values = [
            Fraction(1)
            if step >= low and s in right
            else average(row, values)
            if s in left
            else Fraction(0)
            for s, row in enumerate(chain)
        ]
    return values


def until_from(chain: Chain, left: States, right: States, low: int) -> Column:
    """The probability that `right` holds at step low or later, and `left` before it."""
    values = until(chain, left, right)
    for _ in range(low):
        values = [average(row, values) if s in left else Fraction(0) for s, row in enumerate(chain)]
    return values


def next_step(chain: Chain, states: States) -> Column:
    """The probability that the next state is one of these."""
    return [sum((p for t, p in row.items() if t in states), Fraction(0)) for row in chain]


def until_within_cost(
    chain: Chain, costs: Sequence[int], left: States, right: States, budget: int
) -> Column:
    """The probability of left U right at a cost of at most `budget`; a cost is that of a step."""
    n = len(chain)
    product: list[Row] = []
    for rest in range(budget + 1):  # state s with this budget has the number rest n + s
        for s, row in enumerate(chain):
            affordable = costs[s] <= rest
            product.append(
                {(rest - costs[s]) * n + t: p for t, p in row.items()} if affordable else {}
            )
    lifted = [{b * n + s for b in range(budget + 1) for s in group} for group in (left, right)]
    return until(product, *lifted)[budget * n :]


def components(chain: Chain) -> list[set[int]]:
    """The bottom strongly connected components."""
    reach = [reachable(chain, s) for s in range(len(chain))]
    found: list[set[int]] = []
    for s in range(len(chain)):
        if all(s in reach[t] for t in reach[s]) and reach[s] not in found:
            found.append(reach[s])
    return found


def stationary(chain: Chain, component: States) -> dict[int, Fraction]:
    """The stationary distribution of a bottom component."""
    first, *others = sorted(component)
    # The expected visits between two visits of the first state, which counts once.
    backward: list[Row] = [{} for _ in chain]
    for s in component:
        for t, p in chain[s].items():
            backward[t][s] = p
    start = [chain[first].get(t, Fraction(0)) for t in others]
    visits = {first: Fraction(1), **restricted(backward, others, start)}
    total = sum(visits.values())
    return {s: v / total for s, v in visits.items()}


def long_run(chain: Chain, rewards: Sequence[Fraction]) -> Column:
    """The long-run average reward per step."""
    everywhere = range(len(chain))
    values = [Fraction(0)] * len(chain)
    for component in components(chain):
        mean = sum((v * rewards[s] for s, v in stationary(chain, component).items()), Fraction(0))
        ends = until(chain, everywhere, component)
        values = [v + p * mean for v, p in zip(values, ends, strict=True)]
    return values


def cumulated(
    chain: Chain, rewards: Sequence[Fraction], steps: int, factor: Fraction = Fraction(1)
) -> Column:
    """The expected reward of this number of steps; the i-th counts with the i-th power of factor."""
    values = [Fraction(0)] * len(chain)
    for _ in range(steps):
        values = [r + factor * average(row, values) for r, row in zip(rewards, chain, strict=True)]
    return values


def instantaneous(chain: Chain, rewards: Sequence[Fraction], steps: int) -> Column:
    """The expected reward of the state after this number of steps."""
    values = [Fraction(r) for r in rewards]
    for _ in range(steps):
        values = [average(row, values) for row in chain]
    return values


def reach_reward(chain: Chain, rewards: Sequence[Fraction], target: States) -> list[Value]:
    """The expected reward before the target, infinite where it may be missed."""
    sure = until(chain, range(len(chain)), target)
    unknown = [s for s, p in enumerate(sure) if p == 1 and s not in target]
    found = restricted(chain, unknown, [rewards[s] for s in unknown])
    return [found.get(s, Fraction(0)) if sure[s] == 1 else inf for s in range(len(chain))]


def total(chain: Chain, rewards: Sequence[Fraction]) -> list[Value]:
    """The expected total reward; NaN where components with rewards of both signs are reachable."""
    signs: dict[int, set[bool]] = {s: set() for s in range(len(chain))}
    recurrent: set[int] = set()
    for component in components(chain):
        recurrent |= component
        for sign in {rewards[s] > 0 for s in component if rewards[s]}:
            for s in can_reach(chain, range(len(chain)), component):
                signs[s].add(sign)
    unknown = [s for s in signs if s not in recurrent and not signs[s]]
    found = restricted(chain, unknown, [rewards[s] for s in unknown])
    infinite = {(True,): inf, (False,): -inf, (False, True): nan}
    return [
        infinite[tuple(sorted(signs[s]))] if signs[s] else found.get(s, Fraction(0)) for s in signs
    ]


def discounted(chain: Chain, rewards: Sequence[Fraction], factor: Fraction) -> Column:
    """The expected reward where step i counts with the i-th power of the factor."""
    return list(restricted(chain, range(len(chain)), rewards, factor).values())
