"""Strategies at extreme numbers: the chain that one induces, in rationals, attains the value."""

from __future__ import annotations

from fractions import Fraction
from math import inf
from random import Random

import pytest

import symcheck

PROBABILITIES = ["1e-16", "1e-200", "1e-300", "1e-9", "0.5", "1/3", "1e-12", "0.25", "1e-5"]
REWARDS = ["0", "1", "1e16", "1e-16", "3", "1e-200", "1e200", "1e-9", "7", "1e9"]
QUERIES = [
    'P{}=? [ F "a" ]',
    'P{}=? [ "b" U "a" ]',
    'P{}=? [ G "b" ]',
    "P{}=? [ X s=0 ]",
    'R{}=? [ F "a" ]',
    "R{}=? [ C ]",
    "R{}=? [ C discount=0.9 ]",
    "R{}=? [ S ]",
    'S{}=? [ "a" ]',
]

LEFT_RARELY = """mdp
module m
  s : [0..1];
  [go] s=0 -> 1e-16:(s'=1) + 1-1e-16:true;
  [wait] s=0 -> true;
  [back] s=1 -> (s'=0);
  [stay] s=1 -> true;
endmodule
rewards s=0 : 1e16; endrewards
"""


def test_an_average_is_left_with_the_least_probability():
    """Going and staying earns 0. Going and coming back, or waiting, is hidden by the reward 1e16."""
    model = symcheck.loads(LEFT_RARELY, strategy=True)
    result = model.check("Rmin=? [ S ]")
    assert result.value == 0
    chain = symcheck.induced_chain(model, result)
    assert chain.check("R=? [ S ]").value == 0


class Mdp:
    """A random MDP of two to four states as the commands of each state."""

    def __init__(self, seed: int) -> None:
        rng = Random(seed)
        self.n = rng.randint(2, 4)
        self.commands: list[list[str]] = []
        self.rewards = [
            f"s={s} : {rng.choice(REWARDS)};" for s in range(self.n) if rng.randrange(2)
        ]
        for s in range(self.n):
            own = []
            for c in range(rng.randint(1, 3)):
                p, t, u = rng.choice(PROBABILITIES), *rng.choices(range(self.n), k=2)
                own.append(f"[c{s}{c}] s={s} -> {p}:(s'={t}) + 1-{p}:(s'={u});")
                if rng.random() < 0.4:
                    self.rewards.append(f"[c{s}{c}] true : {rng.choice(REWARDS)};")
            self.commands.append(own)
        self.labels = {
            "a": rng.sample(range(self.n), rng.randint(1, self.n // 2)),
            "b": rng.sample(range(self.n), rng.randint(1, self.n)),
        }

    def text(self, rows: list[int] | None = None) -> str:
        """The MDP, or the chain of one row per state."""
        chosen = self.commands
        if rows is not None:
            chosen = [[own[r]] for own, r in zip(self.commands, rows, strict=True)]
        names = {c.split("]")[0] + "]" for own in chosen for c in own}
        rewards = [r for r in self.rewards if not r.startswith("[") or r.split(" ")[0] in names]
        labels = [
            f'label "{name}" = ' + " | ".join(f"s={s}" for s in states) + ";"
            for name, states in self.labels.items()
        ]
        lines = [
            "mdp" if rows is None else "dtmc",
            f"module m s : [0..{self.n - 1}];",
            *(c for own in chosen for c in own),
            "endmodule",
            *labels,
            "rewards true : 0;",
            *rewards,
            "endrewards",
        ]
        return "\n".join(lines)


@pytest.mark.parametrize("seed", [*range(16), 20, 30, 31, 32, 37, 48, 53, 82, 91])
def test_the_induced_chain_attains_the_value(seed):
    mdp = Mdp(seed)
    model = symcheck.loads(mdp.text(), strategy=True, engine="explicit")
    exact = model.with_options(exact=True, strategy=False)
    for query in QUERIES:
        for direction in ("min", "max"):
            result = model.check(query.format(direction))
            rows = [0] * mdp.n
            groups = result.strategy.engine.matrix.groups
            for i, state in enumerate(model.states):
                rows[state["s"]] = int(result.strategy.rows[i] - groups[i])
            found = symcheck.loads(mdp.text(rows), exact=True).check(query.format("")).value
            best = exact.check(query.format(direction)).value
            if inf in (found, best):
                assert found == best, (query, direction)
            else:
                assert abs(found - best) <= Fraction(1, 10**6) * abs(best), (query, direction)
                low, high = bounds(result)
                assert low <= best <= high, (query, direction)


def bounds(result) -> tuple[Fraction | float, Fraction | float]:
    """What the result promises."""
    low, high = result.bounds
    return Fraction(low), Fraction(high) if high < inf else inf


@pytest.mark.xfail(
    strict=True, reason="strategies with memory are chosen by products of doubles, which underflow"
)
@pytest.mark.parametrize("formula", ["Pmax=? [ F<=2 s=3 ]", "Rmax=? [ C<=3 ]"])
def test_a_strategy_with_memory_attains_a_value_that_underflows(formula):
    text = (
        "mdp module m s:[0..3]; [a] s=0 -> true; [b] s=0 -> 1e-200:(s'=2) + 1-1e-200:true; "
        "[c] s=2 -> 1e-200:(s'=3) + 1-1e-200:true; [a] s=2 -> true; [] s=3 -> true; endmodule "
        "rewards s=3 : 1; endrewards"
    )
    strategy = symcheck.loads(text).with_options(strategy=True).check(formula).strategy
    assert strategy.actions[0] == "b"  # [a] gives 0, and this 1e-400
