"""Partially observed decision processes in fractions: trees of beliefs, and all small strategies.

Nothing here knows symcheck: each state has an observation and a list of rows, one per action of its
observation. Unbounded values have no algorithm; two-sided bounds come from a tree of beliefs whose
leaves are bounded by what strategies without memory attain, and by what those attain that see the
state (L. Kaelbling, M. Littman, A. Cassandra, Planning and acting in partially observable stochastic
domains, 1998).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import inf
from random import Random

from oracles import chains, decisions
from oracles.chains import Row, Value

Belief = dict[int, Fraction]


@dataclass(frozen=True)
class Hidden:
    """A process whose states are seen as their observations.

    targets: observations. rewards: per state and action.
    """

    observation: Sequence[int]
    rows: Sequence[Sequence[Row]]
    targets: frozenset[int]
    rewards: Sequence[Sequence[Fraction]]

    @property
    def goal(self) -> set[int]:
        """The states to be reached."""
        return {s for s, o in enumerate(self.observation) if o in self.targets}

    @property
    def text(self) -> str:
        """A model in the PRISM language; state 0 is the initial one."""
        n = len(self.rows)
        seen = " : ".join(f"s={s} ? {o}" for s, o in enumerate(self.observation)) + " : 0"
        lines = ["pomdp", f'observable "o" = {seen};', "module m", f"  s : [0..{n}] init 0;"]
        items = []
        for s, rows in enumerate(self.rows):
            for a, row in enumerate(rows):
                updates = " + ".join(f"{p} : (s'={t})" for t, p in row.items())
                lines.append(f"  [a{a}] s={s} -> {updates};")
                items.append(f"  [a{a}] s={s} : {self.rewards[s][a]};")
        goal = " | ".join(f"s={s}" for s in sorted(self.goal)) or "false"
        return "\n".join(
            [*lines, "endmodule", "rewards", *items, "endrewards", f'label "goal" = {goal};']
        )


def drawn(random: Random) -> Hidden:
    """A small random process: most have states in which all is won, and others in which all is lost."""
    inner, kinds = random.randint(2, 5), random.randint(1, 2)
    observation = [0, *(random.randrange(kinds) for _ in range(inner - 1)), kinds, kinds + 1]
    n = len(observation)
    actions = [random.randint(1, 3) for _ in range(kinds)]
    rows = [[_row(random, n) for _ in range(actions[o])] for o in observation[:inner]]
    rows += [[{inner: Fraction(1)}], [{inner + 1: Fraction(1)}]]
    if random.random() < 0.2:  # from there, too
        rows[inner + 1] = [_row(random, n)]
    rewards = [[Fraction(random.randint(0, 3)) for _ in r] for r in rows]
    return Hidden(observation, rows, frozenset({kinds}), rewards)


def _row(random: Random, n: int) -> Row:
    targets = set(random.sample(range(n), random.randint(1, min(3, n))))
    targets |= {t for t in (n - 2, n - 1) if random.random() < 0.3}
    weights = [random.choice((1, 1, 2, 3)) for _ in targets]
    return {t: Fraction(w, sum(weights)) for t, w in zip(targets, weights, strict=True)}


def successors(model: Hidden, belief: Belief, action: int) -> Iterator[tuple[Fraction, Belief]]:
    """The beliefs after an action, one for each observation, with their probabilities."""
    after: dict[int, Belief] = {}
    for s, p in belief.items():
        for t, q in model.rows[s][action].items():
            part = after.setdefault(model.observation[t], {})
            part[t] = part.get(t, Fraction(0)) + p * q
    for part in after.values():
        total = sum(part.values(), Fraction(0))
        yield total, {s: p / total for s, p in part.items()}


def tree(
    model: Hidden, belief: Belief, steps: int, best: decisions.Optimum, leaf: Sequence[Sequence[Value]],
    *, reward: bool,
) -> Value:  # fmt: skip
    """The value of a belief if after so many steps a vector of values of states is received.

    leaf: these vectors; the best of them is taken.
    """
    if model.observation[next(iter(belief))] in model.targets:
        return Fraction(0) if reward else Fraction(1)
    if not steps:
        return best(sum(p * v[s] for s, p in belief.items()) for v in leaf)
    found = []
    for action in range(len(model.rows[next(iter(belief))])):
        value: Value = Fraction(0)
        if reward:
            value = sum((p * model.rewards[s][action] for s, p in belief.items()), Fraction(0))
        for chance, after in successors(model, belief, action):
            value += chance * tree(model, after, steps - 1, best, leaf, reward=reward)
        found.append(value)
    return best(found)


def memoryless(model: Hidden) -> Iterator[tuple[list[Row], list[Fraction]]]:
    """The chain and the rewards of each strategy that remembers the last observation only."""
    seen = sorted(set(model.observation))
    counts = [len(model.rows[model.observation.index(o)]) for o in seen]
    for picks in product(*(range(c) for c in counts)):
        pick = dict(zip(seen, picks, strict=True))
        choice = [pick[o] for o in model.observation]
        yield (
            [rows[c] for rows, c in zip(model.rows, choice, strict=True)],
            [r[c] for r, c in zip(model.rewards, choice, strict=True)],
        )


def bounds(
    model: Hidden, best: decisions.Optimum, steps: int, *, reward: bool
) -> tuple[Value, Value]:
    """What strategies surely attain from state 0, and what those that see the state attain."""
    every, goal = range(len(model.rows)), model.goal
    blind: list[Sequence[Value]] = []
    for chain, earned in memoryless(model):
        blind.append(
            chains.reach_reward(chain, earned, goal) if reward else chains.until(chain, every, goal)
        )
    start: Belief = {0: Fraction(1)}
    attained = tree(model, start, steps, best, blind, reward=reward)
    seeing: list[Value]
    if reward:
        seeing = decisions.over_rewards(
            model.rows, model.rewards, best, lambda c, r: chains.reach_reward(c, r, goal)
        )
    else:
        seeing = decisions.over_strategies(model.rows, best, lambda c: chains.until(c, every, goal))
    return attained, tree(model, start, steps, best, [seeing], reward=reward)


def within(model: Hidden, best: decisions.Optimum, steps: int) -> Value:
    """The probability of reaching the target from state 0 within so many steps."""
    nothing = [Fraction(0)] * len(model.rows)
    return tree(model, {0: Fraction(1)}, steps, best, [nothing], reward=False)


__all__ = [
    "Belief",
    "Hidden",
    "bounds",
    "drawn",
    "inf",
    "memoryless",
    "successors",
    "tree",
    "within",
]
