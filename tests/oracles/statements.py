"""Random models with a property, and the truth of what a certificate states of them.

Nothing here knows symcheck: the model is read by the checker of certificates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from random import Random
from typing import Any

from symcheck_verify import Model

from oracles import chains, continuous, decisions
from oracles.chains import Value

__all__ = ["Drawn", "draw", "truth"]

STATES = 6
CHOICES = 3


@dataclass(frozen=True)
class Drawn:
    """A model of at most STATES states, and a property of it."""

    kind: str
    text: str
    formula: str


def draw(seed: int) -> Drawn:
    """The model and the property of a number."""
    rng = Random(seed)
    kind = rng.choice(("dtmc", "mdp", "mdp", "ctmc"))
    n = rng.randint(2, STATES)
    largest = 100 if kind == "ctmc" else 10**6  # uniformisation takes as many steps
    lines = [kind, f"module m s : [0..{n - 1}];"]
    for s in range(n):
        for _ in range(rng.randint(1, CHOICES) if kind == "mdp" else 1):
            weights = [rng.choice((1, 1, 2, 3, 9, largest)) for _ in range(rng.randint(1, 3))]
            whole = rng.choice((1, 3, 7)) if kind == "ctmc" else sum(weights)
            parts = [f"{w}/{whole} : (s'={rng.randrange(n)})" for w in weights]
            lines.append(f"[] s={s} -> {' + '.join(parts)};")
    lines += ["endmodule", 'rewards "r"']
    lines += [f"s={s} : {rng.choice((0, 0, 1, 3, 1000))};" for s in range(n)]
    goals = sorted({rng.randrange(n) for _ in range(2)})
    lines += ["endrewards", 'label "goal" = ' + " | ".join(f"s={g}" for g in goals) + ";"]
    lines += [f'label "free" = s!={rng.randrange(n)};']
    return Drawn(kind, "\n".join(lines) + "\n", _formula(rng, kind))


def _formula(rng: Random, kind: str) -> str:
    steps = rng.choice((0, 1, 4)) if kind != "ctmc" else rng.choice(("0", "0.5", "9"))
    paths = ['F "goal"', '"free" U "goal"', 'G "free"', f'F<={steps} "goal"', f'G<={steps} "free"']
    asked = [f"P{{}} [ {path} ]" for path in paths]
    asked += ['R{{"r"}}{} [ F "goal" ]', 'R{{"r"}}{} [ S ]', 'S{} [ "goal" ]']
    if kind != "ctmc":
        more = ['P{} [ X "goal" ]', 'R{{"r"}}{} [ C<=3 ]', 'R{{"r"}}{} [ I=3 ]', 'T{} [ F "goal" ]']
        asked += more
    optimum = rng.choice(("min", "max")) if kind == "mdp" else ""
    return rng.choice(asked).format(f"{optimum}=?")


def truth(model: Model, statement: Mapping[str, Any]) -> Sequence[tuple[Value, Value]]:
    """What contains the value of a statement in each state: mostly a rational twice."""
    if statement["measure"] == "until" and "time" in statement:
        return _in_time(model, statement)
    values = _discrete(model, statement)
    if statement.get("negated"):
        values = [1 - v for v in values]
    return [(v, v) for v in values]


def _discrete(model: Model, statement: Mapping[str, Any]) -> Sequence[Value]:
    best = min if statement["optimum"] == "min" else max
    rows = [_processes(model, s) for s in range(model.states)]
    earned = [[_earned(model, statement, s, r) for r in model.rows_of(s)] for s in range(len(rows))]
    steps = statement.get("steps")
    match statement["measure"]:
        case "until":
            left, right = (_set(model, statement[side]) for side in ("left", "right"))
            if steps is None:
                return decisions.until(rows, best, left, right)
            return decisions.bounded_until(rows, best, left, right, 0, steps)
        case "reward":
            target = _set(model, statement["target"])
            return decisions.over_rewards(
                rows, earned, best, lambda chain, r: chains.reach_reward(chain, r, target)
            )
        case "cumulative":
            return decisions.cumulated(rows, earned, best, steps)
        case "instantaneous":
            at_end = [_of_state(model, statement, s) for s in range(model.states)]
            return decisions.instantaneous(rows, at_end, best, steps)
        case _ if model.exit_rates is None:
            return decisions.over_rewards(rows, earned, best, chains.long_run)
        case _:
            of_states = [_of_state(model, statement, s) for s in range(model.states)]
            return continuous.long_run(_rates(model), of_states, [Fraction(0)] * model.states)


def _in_time(model: Model, statement: Mapping[str, Any]) -> Sequence[tuple[Value, Value]]:
    left, right = (_set(model, statement[side]) for side in ("left", "right"))
    time = Fraction(statement["time"])
    found = continuous.bounded_until(_rates(model), left, right, Fraction(0), time)
    return [(1 - high, 1 - low) for low, high in found] if statement["negated"] else found


def _processes(model: Model, state: int) -> list[dict[int, Fraction]]:
    found = []
    for number in model.rows_of(state):
        row, merged = model.rows[number], {}
        for weight, target in zip(row.weights, row.targets, strict=True):
            merged[target] = merged.get(target, 0) + Fraction(weight, row.denominator)
        found.append(merged)
    return found


def _rates(model: Model) -> list[dict[int, Fraction]]:
    assert model.exit_rates is not None
    return [
        {t: p * model.exit_rates[s] for t, p in _processes(model, s)[0].items()}
        for s in range(model.states)
    ]


def _of_state(model: Model, statement: Mapping[str, Any], state: int) -> Fraction:
    if "states" in statement:
        return Fraction(state in _set(model, statement["states"]))
    if statement["reward"] is None:
        return Fraction(1)
    return model.rewards[statement["reward"]].of_state.get(state, Fraction(0))


def _earned(model: Model, statement: Mapping[str, Any], state: int, row: int) -> Fraction:
    stay = Fraction(1) if model.exit_rates is None else 1 / model.exit_rates[row]
    if statement["measure"] == "until":
        return Fraction(0)
    return stay * _of_state(model, statement, state)


def _set(model: Model, data: Any) -> set[int]:
    everywhere = set(range(model.states))
    match data:
        case {"states": numbers}:
            return set(numbers)
        case {"label": name}:
            return set(model.labels[name])
        case {"not": inner}:
            return everywhere - _set(model, inner)
        case {"or": parts}:
            return set().union(*(_set(model, part) for part in parts))
        case _:
            return everywhere
