"""Time-bounded properties of small CTMCs by matrix exponentials in ball arithmetic (python-flint).

It shares no numerical code with the engines: rates are rational, and the exponential of the
generator has proved digits.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction
from operator import ge, gt, le, lt

from flint import arb, arb_mat, ctx, fmpq

import symcheck

__all__ = ["MOST_STATES", "value"]

MOST_STATES = 50
BITS = 1500
"""Of the numbers: complements of the least doubles are known, though the squarings of the
exponential lose some 2 bits per factor of 2 in a rate."""

PATH = re.compile(r"P=\? \[ (?:([FG])|(.+) U)(<=|<|>=|>|=|\[)([\d.]+)(?:,([\d.]+)\])? (.+) \]")
REWARD = re.compile(r'R\{"(\w)"\}=\? \[ ([CI])(?:<=|=)([\d.]+) \]')
BOUND = re.compile(r'(P|R\{"\w"\})(<=|<|>=|>)([\de./-]+) \[')
COMPARISONS = {"<": lt, "<=": le, ">": gt, ">=": ge}
TERM = re.compile(r"-?[\d.]+(?:e-?\d+)?(?:/\d+)?")
"""Of a bound such as 1-1e-9."""
Column = list[arb]
Answer = bool | Fraction | tuple[Fraction, Fraction]


def value(exact: symcheck.Model, formula: str) -> Answer | None:
    """The verdict, or the value in the initial state (the least and the greatest), to 30 digits.

    None for a form that this does not know, and for a model with more than MOST_STATES states.
    """
    bound = BOUND.match(formula)
    asked = formula if bound is None else f"{bound[1]}=? [{formula[bound.end() :]}"
    path, reward = PATH.fullmatch(asked), REWARD.fullmatch(asked)
    if re.search(r"\] [-+*]", formula) or (path is None and reward is None):
        return None
    if exact.engine.states > MOST_STATES:
        return None
    ctx.prec = BITS
    if path is not None:
        values = _until(exact, path)
    else:
        assert reward is not None
        values = _reward(exact, *reward.groups())
    initial = exact.where('"init"').mask
    chosen = [_fraction(v) for v, start in zip(values, initial, strict=True) if start]
    if bound is not None:
        limit = sum(map(Fraction, TERM.findall(bound[3])), Fraction(0))
        return all(COMPARISONS[bound[2]](v, limit) for v in chosen)
    return chosen[0] if len(chosen) == 1 else (min(chosen), max(chosen))


def _until(exact: symcheck.Model, path: re.Match[str]) -> Column:
    letter, left, operator, first, second, right = path.groups()
    goal = f"!({right})" if letter == "G" else right
    allowed = left or "true"
    stay, goals = exact.where(allowed).mask, exact.where(goal).mask
    time = Fraction(first)
    low, high = Fraction(0), time
    match operator:
        case "[":
            low, high = time, Fraction(second)
        case "=":
            low = time
        case ">=" | ">":
            low = time
            until = exact.check(f"filter(print, P=? [ ({allowed}) U ({goal}) ])").values
            assert until is not None
            values = [_arb(v) for v in until.array]
    if operator not in (">=", ">"):
        moving = [s and not g for s, g in zip(stay, goals, strict=True)]
        values = _product(_exponential(exact, moving, high - low), [arb(int(g)) for g in goals])
    if low or operator == ">":
        inside = [v if s else arb(0) for v, s in zip(values, stay, strict=True)]
        delayed = _product(_exponential(exact, list(stay), low), inside)
        values = [v if s else arb(0) for v, s in zip(delayed, stay, strict=True)]
    return [1 - v for v in values] if letter == "G" else values


def _reward(exact: symcheck.Model, name: str, kind: str, time: str) -> Column:
    rewards = exact.rewards[name]
    everywhere = [True] * exact.engine.states
    states = [_arb(r) for r in rewards.states]
    if kind == "I":
        return _product(_exponential(exact, everywhere, Fraction(time)), states)
    rates = [s + _arb(r) for s, r in zip(states, rewards.choices, strict=True)]
    exponential = _exponential(exact, everywhere, Fraction(time), rates)
    return _product(exponential, [*(arb(0) for _ in rates), arb(1)])[:-1]


def _exponential(
    exact: symcheck.Model, moving: Sequence[bool], time: Fraction, rates: Sequence[arb] = ()
) -> arb_mat:
    """exp(Q t) where states that do not move are absorbing; `rates` is one more column of Q."""
    matrix, n = exact.transitions.matrix, exact.engine.states
    size = n + bool(rates)
    generator = [[arb(0)] * size for _ in range(size)]
    for i in (i for i in range(n) if moving[i]):
        for k in range(matrix.indptr[i], matrix.indptr[i + 1]):
            rate = _arb(matrix.data[k])
            generator[i][int(matrix.indices[k])] += rate
            generator[i][i] -= rate
        if rates:
            generator[i][n] = rates[i]
    return (arb_mat(generator) * _arb(time)).exp()


def _product(matrix: arb_mat, column: Column) -> Column:
    product = matrix * arb_mat([[v] for v in column])
    return [product[i, 0] for i in range(product.nrows())]


def _arb(number: int | Fraction) -> arb:
    return arb(fmpq(number.numerator, number.denominator))


def _fraction(number: arb) -> Fraction:
    assert number.rad() < 1e-30 * max(arb(1), abs(number).mid()), "too few bits"
    mantissa, exponent = number.mid().man_exp()
    value = Fraction(int(mantissa)) * Fraction(2) ** int(exponent)
    whole = round(value)
    return Fraction(whole) if number.contains(whole) else value
