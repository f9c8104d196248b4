"""Random models with a property, and the truth of what a certificate states of them.

Nothing here knows symcheck: the model is read by the checker of certificates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import nan
from random import Random
from typing import Any

from symcheck_verify import Model

from oracles import chains, continuous, decisions, linear_time
from oracles.chains import Value

__all__ = ["Drawn", "UnknownError", "draw", "truth"]

STATES = 6
CHOICES = 3


class UnknownError(Exception):
    """The oracle does not know the values of a statement."""


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
    formula = _formula(rng, kind)
    small = kind == "mdp" and ("G F" in formula or "X (" in formula)
    n = rng.choice((2, 2, 3)) if small else rng.randint(2, STATES)
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
    return Drawn(kind, "\n".join(lines) + "\n", formula)


def _formula(rng: Random, kind: str) -> str:
    steps = rng.choice((0, 1, 4)) if kind != "ctmc" else rng.choice(("0", "0.5", "9"))
    paths = ['F "goal"', '"free" U "goal"', 'G "free"', f'F<={steps} "goal"', f'G<={steps} "free"']
    asked = [f"P{{}} [ {path} ]" for path in paths]
    asked += ['R{{"r"}}{} [ F "goal" ]', 'R{{"r"}}{} [ S ]', 'S{} [ "goal" ]']
    if kind != "ctmc":
        more = ['P{} [ X "goal" ]', 'R{{"r"}}{} [ C<=3 ]', 'R{{"r"}}{} [ I=3 ]', 'T{} [ F "goal" ]']
        asked += more
        bound = rng.choice((0, 2, 4))
        asked += [f'P{{}} [ "free" U^{{{{rew{{{{"r"}}}}<={bound}}}}} "goal" ]']
        asked += [f'P{{}} [ F^{{{{rew{{{{"r"}}}}>={bound + 1}}}}} "goal" ]']
        asked += ['R{{"r"}}{} [ C discount=0.9 ]', 'R{{"r"}}{} [ C<=3 discount=1/3 ]']
    else:
        asked += [f'R{{{{"r"}}}}{{}} [ C<={steps} ]', f'R{{{{"r"}}}}{{}} [ I={steps} ]']
    asked += ['P{} [ (G F "goal") & X ("free" U "goal") ]', 'P{} [ (F G "free") | X (X "goal") ]']
    asked += ['P{} [ (G F "goal") => (G F "free") ]', 'P{} [ X ("free" & X F "goal") ]']
    if kind != "mdp":
        asked += ['P{} [ G ("free" => F "goal") ]', 'P{} [ ("free" U (X "goal")) | F G "free" ]']
        asked += ['P{} [ F "goal" || G F "free" ]', 'P{} [ X "goal" || "free" U "goal" ]']
    if rng.random() < 0.6:
        asked = asked[7:]
    optimum = rng.choice(("min", "max")) if kind == "mdp" else ""
    return rng.choice(asked).format(f"{optimum}=?")


def truth(model: Model, statement: Mapping[str, Any]) -> Sequence[tuple[Value, Value]]:
    """What contains the value of a statement in each state: mostly a rational twice.

    Raises UnknownError: the oracle does not know.
    """
    if statement["measure"] == "until" and "time" in statement:
        return _in_time(model, statement)
    if "time" in statement:
        return _within_time(model, statement)
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
        case "ltl":
            return _linear_time(model, statement)
        case "conditional":
            labels = _labels(model, statement)
            parts = (_formula_of(statement[part]) for part in ("formula", "condition"))
            found = linear_time.conditional([choices[0] for choices in rows], labels, *parts)
            return [nan if value is None else value for value in found]
        case "until":
            left, right = (_set(model, statement[side]) for side in ("left", "right"))
            if "reward" in statement:
                steps_earn = [
                    [_of_state(model, statement, s) for _ in c] for s, c in enumerate(rows)
                ]
                at_least = "least" in statement
                bound = Fraction(statement["least" if at_least else "most"])
                about = rows, steps_earn, best, left, right
                return _within_reward(*about, bound, {}, at_least=at_least)
            if steps is None:
                return decisions.until(rows, best, left, right)
            return decisions.bounded_until(rows, best, left, right, 0, steps)
        case "reward":
            target = _set(model, statement["target"])
            return decisions.over_rewards(
                rows, earned, best, lambda chain, r: chains.reach_reward(chain, r, target)
            )
        case "cumulative":
            factor = Fraction(statement.get("factor", 1))
            if steps is not None:
                return decisions.cumulated(rows, earned, best, steps, factor)
            return decisions.over_rewards(
                rows, earned, best, lambda chain, r: chains.discounted(chain, r, factor)
            )
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


def _within_time(model: Model, statement: Mapping[str, Any]) -> Sequence[tuple[Value, Value]]:
    of_states = [_of_state(model, statement, s) for s in range(model.states)]
    time, rates = Fraction(statement["time"]), _rates(model)
    if statement["measure"] == "cumulative":
        return continuous.cumulated(rates, of_states, [Fraction(0)] * model.states, time)
    return continuous.instantaneous(rates, of_states, time)


def _within_reward(
    rows: decisions.Processes,
    earned: decisions.Rewards,
    best: decisions.Optimum,
    left: set[int],
    right: set[int],
    budget: Fraction,
    known: dict[Fraction, Sequence[Value]],
    *,
    at_least: bool,
) -> Sequence[Value]:
    """The optimal probability of `left U right` with what is left of a budget, or of what has to be
    earned before (at_least).

    Choices that cost something lead to 0 (won) or 1 (lost) by the values of the smaller budget.
    """
    if at_least and budget <= 0:
        return decisions.until(rows, best, left, right)
    if budget < 0:
        return [Fraction(0)] * len(rows)
    if budget not in known:
        won, lost = len(rows), len(rows) + 1
        level: list[list[chains.Row]] = []
        for own, choices in zip(earned, rows, strict=True):
            level.append([])
            for cost, row in zip(own, choices, strict=True):
                if cost:
                    rest = budget - cost
                    about = rows, earned, best, left, right
                    after = _within_reward(*about, rest, known, at_least=at_least)
                    p = chains.average(row, after)
                    level[-1].append({t: q for t, q in ((won, p), (lost, 1 - p)) if q})
                else:
                    level[-1].append(row)
        level += [[{won: Fraction(1)}], [{lost: Fraction(1)}]]
        goals = {won} if at_least else right | {won}
        known[budget] = decisions.until(level, best, left, goals)[: len(rows)]
    return known[budget]


def _labels(model: Model, statement: Mapping[str, Any]) -> dict[str, set[int]]:
    sets = {str(i): _set(model, atom) for i, atom in enumerate(statement["atoms"])}
    everywhere = set(range(model.states))
    return sets | {f"!{i}": everywhere - states for i, states in sets.items()}


def _formula_of(data: Any) -> linear_time.Formula:
    """An LTL formula of a statement as the oracle reads it."""
    match data:
        case bool():
            return data
        case int():
            return str(data)
        case ["not", inner]:
            return ("!", _formula_of(inner))
        case ["U", left, right, int() as bound]:
            a, b = _formula_of(left), _formula_of(right)
            found = b
            for _ in range(bound):
                found = ("|", b, ("&", a, ("X", found)))
            return found
        case [operator, *operands]:
            return ({"and": "&", "or": "|"}.get(operator, operator), *map(_formula_of, operands))
        case _:
            raise ValueError(data)


def _linear_time(model: Model, statement: Mapping[str, Any]) -> Sequence[Value]:
    """The probability of a formula, or the greatest one. Raises UnknownError."""
    labels, rows = _labels(model, statement), [_processes(model, s) for s in range(model.states)]
    formula = _formula_of(statement["formula"])
    if statement["optimum"] is None:
        return linear_time.probability([choices[0] for choices in rows], labels, formula)
    prefixes: list[linear_time.Formula] = []
    recurring: list[str] = []

    def reader(part: linear_time.Formula, negated: bool) -> Any:
        """What says whether a part holds, from the truth of prefixes and of recurring labels."""
        often, opposite = _recurring(part), _recurring(("!", part))
        if (label := often or opposite) is not None:
            recurring.append(label)
            i, wanted = len(recurring) - 1, (often is not None) is not negated
            return lambda _, visits: visits[i] is wanted
        if isinstance(part, tuple) and part[0] == "!":
            return reader(part[1], not negated)
        if isinstance(part, tuple) and part[0] in ("&", "|"):
            sides = [reader(p, negated) for p in part[1:]]
            every = all if (part[0] == "&") is not negated else any
            return lambda done, visits: every(side(done, visits) for side in sides)
        prefixes.append(_co_safe(part))
        j = len(prefixes) - 1
        return lambda done, _: done[j] is not negated

    accepts = reader(formula, False)
    found = linear_time.maximum(rows, labels, prefixes, recurring, accepts, most_states=13)
    if found is None:
        raise UnknownError("the product is too large")
    return found


def _recurring(formula: linear_time.Formula) -> str | None:
    match formula:
        case ("!", ("U", True, ("!", ("U", True, str() as label)))):
            return label
        case ("!", ("U", True, ("!", ("U", True, ("!", str() as label))))):
            return f"!{label}"
        case _:
            return None


def _co_safe(formula: linear_time.Formula) -> linear_time.Formula:
    """The formula without operators that the unfolding does not know."""
    match formula:
        case ("!", str()):
            return formula
        case ("!", ("!", inner)):
            return _co_safe(inner)
        case ("!", ("&" | "|" as operator, a, b)):
            return ({"&": "|", "|": "&"}[operator], _co_safe(("!", a)), _co_safe(("!", b)))
        case ("!", ("X", a)):
            return ("X", _co_safe(("!", a)))
        case ("!", _):
            raise UnknownError(formula)
        case (operator, *operands):
            return (operator, *map(_co_safe, operands))
        case _:
            return formula


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
    if statement["measure"] in ("until", "ltl", "conditional"):
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
