"""Markov automata in fractions: all memoryless strategies, or time in small steps.

Nothing here knows symcheck. A state has rates of its successors, or a list of rows of
probabilities, of which a strategy chooses one at once. Memoryless deterministic strategies attain
the optima of unbounded measures and of long-run averages (D. Guck et al., Analysis of timed and
long-run objectives for Markov automata, 2014); time-bounded probabilities are enclosed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import exp
from random import Random

from oracles import chains, decisions
from oracles.chains import Column, Row, States, Value
from oracles.decisions import Optimum

Interval = tuple[float, float]


@dataclass(frozen=True)
class Automaton:
    """rates: of a Markovian state, else None. choices: the rows of the others. earned: the reward
    of each state per unit of time, and of each choice.
    """

    rates: Sequence[Row | None]
    choices: Sequence[Sequence[Row]]
    state_rewards: Sequence[Fraction]
    choice_rewards: Sequence[Sequence[Fraction]]

    @property
    def processes(self) -> list[list[Row]]:
        """The embedded decision process."""
        return [
            list(rows) if rates is None else [_divided(rates)]
            for rates, rows in zip(self.rates, self.choices, strict=True)
        ]

    @property
    def times(self) -> list[list[Fraction]]:
        """The mean time of each choice."""
        return [
            [Fraction(0)] * len(rows) if rates is None else [1 / sum(rates.values())]
            for rates, rows in zip(self.rates, self.choices, strict=True)
        ]

    @property
    def rewards(self) -> list[list[Fraction]]:
        """The mean reward of each choice."""
        return [
            list(earned) if rates is None else [per_time * times[0]]
            for rates, earned, per_time, times in zip(
                self.rates, self.choice_rewards, self.state_rewards, self.times, strict=True
            )
        ]

    @property
    def is_zeno(self) -> bool:
        """Whether some strategy goes round for ever in no time, from a state that 0 may reach."""
        every = [{t: Fraction(1) for row in rows for t in row} for rows in self.processes]
        found = chains.reachable(every, 0) | {0}
        for chain in map(self._chain, decisions.strategies(self.processes)):
            if any(
                all(self.rates[s] is None and s in found for s in component)
                for component in chains.components(chain)
            ):
                return True
        return False

    def _chain(self, strategy: Sequence[int]) -> list[Row]:
        return decisions.induced(self.processes, strategy)

    def until(self, best: Optimum, left: States, right: States) -> Column:
        """The optimal probability of left U right."""
        return decisions.until(self.processes, best, left, right)

    def reach_time(self, best: Optimum, target: States) -> list[Value]:
        """The optimal time before the target."""
        return decisions.reach_reward(self.processes, self.times, best, target)

    def reach_reward(self, best: Optimum, target: States) -> list[Value]:
        """The optimal reward before the target."""
        return decisions.reach_reward(self.processes, self.rewards, best, target)

    def long_run(self, best: Optimum, rewards: Sequence[Sequence[Fraction]]) -> list[Value]:
        """The optimal long-run average per unit of time of rewards per step."""
        found: list[list[Fraction]] = []
        for strategy in decisions.strategies(self.processes):
            chain = self._chain(strategy)
            values = [Fraction(0)] * len(chain)
            for component in chains.components(chain):
                visits = chains.stationary(chain, component)
                earned = sum(v * rewards[s][strategy[s]] for s, v in visits.items())
                time = sum(v * self.times[s][strategy[s]] for s, v in visits.items())
                if not time:  # no run from state 0 gets there
                    continue
                ends = chains.until(chain, range(len(chain)), component)
                values = [v + p * earned / time for v, p in zip(values, ends, strict=True)]
            found.append(values)
        return [best(column) for column in zip(*found, strict=True)]

    def within(
        self, best: Optimum, left: States, right: States, time: Fraction, steps: int
    ) -> list[Interval]:
        """Bounds on the optimal probability of left U<=time right.

        It grows with the time that is left. So within a small step, the first jump leads to no less
        than what was possible before the step, and no more than what is possible after it.
        """
        delta = float(time) / steps
        low = high = self._resolved(best, left, right, [0.0] * len(self.rates))
        for _ in range(steps):
            low = self._step(best, left, right, low, low, delta)
            ahead = [1.0] * len(high)
            for _ in range(6):
                ahead = self._step(best, left, right, high, ahead, delta)
            high = ahead
        return list(zip(low, high, strict=True))

    def _step(
        self,
        best: Optimum,
        left: States,
        right: States,
        before: Sequence[float],
        landing: Sequence[float],
        delta: float,
    ) -> list[float]:
        values = list(before)
        for s, rates in enumerate(self.rates):
            if rates is not None and s in left and s not in right:
                leave = float(sum(rates.values()))
                stay = exp(-leave * delta)
                mean = sum(float(r) * landing[t] for t, r in rates.items()) / leave
                values[s] = stay * before[s] + (1.0 - stay) * mean
        return self._resolved(best, left, right, values)

    def _resolved(
        self,
        best: Optimum,
        left: States,
        right: States,
        values: Sequence[float],
    ) -> list[float]:
        """With the values of states that take no time: the least solution, as runs that never let
        time pass do not count. It is found by iteration, to 1e-14.
        """
        values = [float(s in right) if s in right or s not in left else v
                  for s, v in enumerate(values)]  # fmt: skip
        instants = [
            s for s, r in enumerate(self.rates) if r is None and s in left and s not in right
        ]
        for s in instants:
            values[s] = 0.0
        change = 1.0
        while change > 1e-14:
            change = 0.0
            for s in instants:
                new = best(
                    sum(float(p) * values[t] for t, p in row.items()) for row in self.choices[s]
                )
                change = max(change, new - values[s])
                values[s] = new
        return values


def _divided(rates: Row) -> Row:
    total = sum(rates.values())
    return {t: r / total for t, r in rates.items()}


@dataclass(frozen=True)
class Drawn:
    """A random automaton, and its text."""

    automaton: Automaton
    text: str


def draw(seed: str) -> Drawn:
    """Draw an automaton with 2 to 6 states."""
    rng = Random(seed)
    n = rng.randint(2, 6)
    rates: list[Row | None] = []
    choices: list[list[Row]] = []
    rewards: list[list[Fraction]] = []
    per_time = [Fraction(rng.randint(0, 4), rng.randint(1, 3)) for _ in range(n)]
    lines = []
    for s in range(n):
        takes_time = rng.random() < 0.5
        rows = [_row(rng, n) for _ in range(1 if takes_time else rng.randint(1, 3))]
        if takes_time:
            factor = Fraction(rng.choice([1, 2, 5, 20]), rng.choice([1, 3]))
            rates.append({t: p * factor for t, p in rows[0].items()})
            choices.append([])
            rewards.append([])
            lines += _race(rng, s, rates[-1] or {})
            continue
        rates.append(None)
        choices.append(rows)
        rewards.append([Fraction(rng.randint(0, 3)) for _ in rows])
        for i, row in enumerate(rows):
            lines.append(f"  [a{i}] x={s} -> {_updates(row)};")
        if rng.random() < 0.2:  # maximal progress: it never happens
            lines.append(f"  <> x={s} -> 3 : (x'={rng.randrange(n)});")
    rng.shuffle(lines)
    body = "\n".join(lines)
    items = [f"  x={s} : {v};" for s, v in enumerate(per_time)]
    items += [f"  [a{i}] x={s} : {v};" for s, row in enumerate(rewards) for i, v in enumerate(row)]
    text = f"ma\nmodule m\n  x : [0..{n - 1}];\n{body}\nendmodule\nrewards\n" + "\n".join(items)
    return Drawn(Automaton(rates, choices, per_time, rewards), f"{text}\nendrewards\n")


def _row(rng: Random, n: int) -> Row:
    parts: Row = {}
    for _ in range(rng.randint(1, 3)):
        target = rng.randrange(n)
        parts[target] = parts.get(target, Fraction(0)) + Fraction(rng.randint(1, 4))
    total = sum(parts.values())
    return {t: p / total for t, p in parts.items()}


def _race(rng: Random, s: int, rates: Row) -> Iterator[str]:
    """One command, or one for each successor."""
    parts = [rates] if rng.random() < 0.5 else [{t: r} for t, r in rates.items()]
    for part in parts:
        yield f"  <> x={s} -> {_updates(part)};"


def _updates(row: Row) -> str:
    return " + ".join(f"{w} : (x'={t})" for t, w in row.items())
