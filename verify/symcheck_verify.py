"""Check certificates of probabilistic model checking: `symcheck-verify MODEL.tra CERTIFICATE`.

The model is read from explicit files (.tra, .lab, .srew, .trew), the certificate from JSON. Numbers
are rationals, or integers that are rounded outward. What is accepted is believed because of the
rules below, each with its proof, and not because of its writer.
"""

from __future__ import annotations

import hashlib
import json
import operator
import re
import sys
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, partial
from itertools import islice
from math import lcm
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["Model", "Rejected", "check", "main", "read_model"]


class Rejected(Exception):
    """Something is not proved: the message names the state and the inequality that fails."""


@contextmanager
def _readable(what: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # whatever it is, nothing is proved
        text = f"{what} cannot be read: {error!a:.200}"
        raise error if isinstance(error, Rejected) else Rejected(text) from error


class Row(NamedTuple):
    """The distribution of a choice: probability `weights[i] / denominator` of `targets[i]`."""

    weights: tuple[int, ...]
    targets: tuple[int, ...]
    denominator: int


class Reward(NamedTuple):
    """What a state earns (in a ctmc, per unit of time), a transition, and a row on average."""

    of_state: dict[int, Fraction]
    of_step: dict[tuple[int, int], Fraction]  # by row and target
    of_row: dict[int, Fraction]


@dataclass(slots=True)
class Model:
    """A Markov chain or Markov decision process."""

    kind: str  # dtmc, ctmc or mdp
    first: list[int] = field(default_factory=lambda: [0])  # the rows of s begin at first[s]
    rows: list[Row] = field(default_factory=list)  # of a ctmc, the distributions of its jumps
    exit_rates: list[Fraction] | None = None  # of a ctmc, the rate at which each state is left
    labels: dict[str, frozenset[int]] = field(default_factory=dict)  # the states with a label
    rewards: dict[str, Reward] = field(default_factory=dict)  # the reward structures by name
    digests: dict[str, str] = field(default_factory=dict)  # SHA-256 of each file that was read

    @property
    def states(self) -> int:
        """The number of states."""
        return len(self.first) - 1

    def rows_of(self, state: int) -> range:
        """The rows among which a state chooses."""
        return range(self.first[state], self.first[state + 1])

    def stay(self, row: int) -> Fraction:
        """The mean time of a step by a row."""
        return Fraction(1) if self.exit_rates is None else 1 / self.exit_rates[row]

    def where(self, state: int, row: int) -> str:
        """The text of a row of a state."""
        return f"state {state}, choice {row - self.first[state]}"


_Number = Callable[[str], Fraction]
_NUMBER = re.compile(r"-?([0-9]+/[0-9]+|([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,4})?)")


def number_of(text: Any, *, double: bool = False) -> Fraction:
    """What a text stands for: the number that its digits say, or the nearest double."""
    if type(text) is not str or not _NUMBER.fullmatch(text):
        raise Rejected(f"not the text of a number: {text!a:.60}")
    return Fraction(float(text)) if double else Fraction(text)


@_readable("the model")
def read_model(path: Path, kind: str, numbers: str, wanted: Collection[str] | None = None) -> Model:
    """The model of FILE.tra; FILE.lab, FILE.srew, FILE1.srew, … beside it are read, too.

    It is a dtmc, ctmc or mdp; its numbers are rational, or double for the nearest doubles of what
    the files say. Files of rewards are read if their digests are wanted (None: all of them).
    """
    if kind not in ("dtmc", "ctmc", "mdp") or numbers not in ("rational", "double"):
        raise Rejected(f"unknown type of models or kind of numbers: {kind}, {numbers}")
    model, known = Model(kind), cache(partial(number_of, double=numbers == "double"))
    _read_transitions(model, _lines(model, path.read_text("utf-8"), ".tra"), known)
    if (labels := path.with_suffix(".lab")).exists():
        _read_labels(model, _lines(model, labels.read_text("utf-8"), ".lab"))
    pattern = re.compile(re.escape(path.stem) + r"\d*\.[st]rew")
    files = (f for f in path.parent.glob("*rew") if pattern.fullmatch(f.name))
    for suffix, text in sorted({(f.suffix, f.read_text("utf-8")) for f in files}):
        if wanted is None or hashlib.sha256(text.encode()).hexdigest() in wanted:
            _read_rewards(model, suffix, text, known)
    return model


def _lines(model: Model, text: str, name: str) -> Iterator[list[str]]:
    """The words of each line that is no comment; the digest of the file is kept."""
    if name in model.digests:
        raise Rejected(f"two files beside the model are {name}")
    model.digests[name] = hashlib.sha256(text.encode()).hexdigest()
    return (words for line in text.split("\n") if (words := line.split()) and words[0] != "#")


def _read_transitions(model: Model, lines: Iterator[list[str]], number: _Number) -> None:
    counts, columns = [int(word) for word in next(lines, [])], 3 if model.kind == "mdp" else 2
    found: dict[tuple[int, ...], tuple[list[int], list[Fraction]]] = {}
    whole = cache(int)  # the same number is stored once
    for words in lines:
        *place, target = map(whole, words[:columns])
        targets, values = found.setdefault(tuple(place), ([], []))
        targets.append(target)
        values.append(number(words[columns]))
        if not (0 <= place[0] < counts[0] and 0 <= target < counts[0] and values[-1] > 0):
            raise Rejected(f"transition {' '.join(words)}: no such state, or not positive")
    transitions = sum(len(targets) for targets, _ in found.values())
    of_file = [len({place[0] for place in found}), len(found), transitions]
    if counts != (of_file if model.kind == "mdp" else of_file[::2]):
        raise Rejected("the counts of the first line are others, or a state has no transition")
    shared: dict[tuple[Fraction, ...], tuple[tuple[int, ...], int]] = {}
    exit_rates = []
    for row, (targets, values) in sorted(found.items()):
        if row[0] == model.states:
            model.first.append(len(model.rows))
        if row != (row[0], len(model.rows) - model.first[row[0]])[: columns - 1]:
            raise Rejected(f"state {row[0]}: its choices are not numbered from 0")
        exit_rates.append(sum(values, Fraction(0)))
        if model.kind != "ctmc" and exit_rates[-1] != 1:
            raise Rejected(f"state {row[0]}: the probabilities of row {row} do not sum to 1")
        key = tuple(v / exit_rates[-1] for v in values)
        if key not in shared:
            denominator = lcm(*(v.denominator for v in key))
            shared[key] = tuple(int(v * denominator) for v in key), denominator
        model.rows.append(Row(shared[key][0], tuple(targets), shared[key][1]))
        model.first[-1] = len(model.rows)
    model.exit_rates = exit_rates if model.kind == "ctmc" else None


def _read_labels(model: Model, lines: Iterator[list[str]]) -> None:
    parts = [word.partition("=") for word in next(lines, [])]
    members: dict[int, set[int]] = {int(number): set() for number, _, _ in parts}
    for state, *of_state in lines:
        for number in of_state:
            members[int(number)].add(int(state.rstrip(":")))
    model.labels = {name.strip('"'): frozenset(members[int(i)]) for i, _, name in parts}
    if not len(model.labels) == len(members) == len(parts):
        raise Rejected("two labels have one name or number")


def _read_rewards(model: Model, suffix: str, text: str, number: _Number) -> None:
    found = re.search(r'^# Reward structure "([^"]*)"', text, re.MULTILINE)
    name = found.group(1) if found else ""
    lines = _lines(model, text, f"{suffix} {name}".strip())
    next(lines, None)
    reward = model.rewards.setdefault(name, Reward({}, {}, {}))
    columns = 1 if suffix == ".srew" else 3 if model.kind == "mdp" else 2
    seen: set[tuple[int, ...]] = set()
    for *words, value in lines:
        place = tuple(int(word) for word in words)
        if len(place) != columns or min(place) < 0 or place[0] >= model.states or place in seen:
            raise Rejected(f"{suffix} {name}: no such place, or a repeated one: {' '.join(words)}")
        seen.add(place)
        if columns == 1:
            reward.of_state[place[0]] = number(value)
            continue
        row = model.rows[index := model.rows_of(place[0])[place[1] if columns == 3 else 0]]
        weight = sum(w for w, t in zip(row.weights, row.targets, strict=True) if t == place[-1])
        reward.of_step[index, place[-1]] = earned = number(value)
        reward.of_row[index] = (
            reward.of_row.get(index, 0) + Fraction(weight, row.denominator) * earned
        )


@dataclass(frozen=True, slots=True)
class Vector:
    """A number per state: `numerators[s] / denominator`; None stands for infinity."""

    numerators: list[Any]
    denominator: int

    @staticmethod
    def read(data: Any, model: Model) -> Vector:
        """The vector of a certificate."""
        vector = Vector(data["numerators"], int(data["denominator"]))
        whole = all(x is None or type(x) is int for x in vector.numerators)
        if not whole or vector.denominator <= 0 or len(vector.numerators) != model.states:
            raise Rejected("a vector has an integer or null per state, over a positive denominator")
        return vector

    def at(self, state: int) -> Fraction | None:
        """The number of a state; None: infinity."""
        value = self.numerators[state]
        return None if value is None else Fraction(value, self.denominator)

    def excess(self, state: int, row: Row, earned: Fraction, num: int = 1, den: int = 1) -> int:
        """A number with the sign of `x(state) - earned - num/den P x`, where these are finite."""
        values = map(self.numerators.__getitem__, row.targets)
        left: int = self.numerators[state] * row.denominator * den
        left -= sum(map(operator.mul, row.weights, values)) * num
        if not earned:
            return left
        return (
            left * earned.denominator - earned.numerator * row.denominator * self.denominator * den
        )


Rows = Callable[[int], Iterable[int]]  # the rows of a state that inequalities are about
Earned = Callable[[int, int], Fraction]  # what a step from a state by a row earns on average
Proved = Callable[[int], Fraction | None]  # the bound of each state; None: infinity
Proofs = tuple[Proved, Proved]  # the lower and the upper bounds
States = Collection[int]
_WORD, _ZERO = {1: ">=", -1: "<="}, Fraction(0)


class Side(NamedTuple):
    """An upper (sign 1, x >= r + P x) or lower bound (-1) of a minimum, a maximum, or a chain."""

    optimum: str | None
    sign: int


def _rows(model: Model, evidence: Any, side: Side) -> Rows:
    """All rows, or those of the strategy of the certificate.

    A maximum is at least what one strategy attains, and a minimum at most: there, a strategy
    without memory suffices. The other bounds hold for all rows. In a chain, a state has one row.
    """
    if side.optimum is None or (side.optimum == "max") is (side.sign > 0):
        return model.rows_of
    choices = evidence["choices"]
    for state in range(model.states):
        if type(choices[state]) is not int or not 0 <= choices[state] < len(model.rows_of(state)):
            raise Rejected(f"state {state} has no choice {choices[state]}")
    return lambda state: (model.first[state] + choices[state],)


def _ranks(model: Model, evidence: Any) -> list[int | None]:
    """The ranks of a certificate; None: no rank."""
    ranks: list[int | None] = evidence["ranks"]
    if len(ranks) != model.states or not all(r is None or type(r) is int for r in ranks):
        raise Rejected("ranks are whole numbers or null, one per state")
    return ranks


def _require_progress(model: Model, rows: Rows, ranks: Sequence[int | None], ends: States) -> None:
    """Each state with a rank is an end, or each of its rows may enter a state of lower rank.

    So every strategy over these rows reaches an end with positive probability from any of them.
    """
    for state, rank in enumerate(ranks):
        if rank is None or state in ends:
            continue
        for row in rows(state):
            if all((r := ranks[t]) is None or r >= rank for t in model.rows[row].targets):
                raise Rejected(f"{model.where(state, row)}: no transition lowers the rank {rank}")


def until_bound(model: Model, evidence: Any, side: Side, left: States, right: States) -> Vector:
    """A bound x of the probability of `left U right`, where P is the distribution of a row.

    Upper: x >= 0, x >= 1 on `right`, and x >= P x on the other states of `left`. By induction, x
    bounds the probability of reaching `right` within n steps.

    Lower: x <= 1 on `right`, x <= P x on the other states of `left`, x <= 0 elsewhere; and where
    x > 0 in `left`, there is a rank that some transition of each row lowers, down to `right`. For
    every n, x is at most the probability of having reached `right` after n steps plus the mean of x
    over the other runs. Almost surely these enter an end component without `right`, or end outside
    of `left`. No state of such a component has a rank, as its rows would lead to `right`: x <= 0.
    """
    x, rows = Vector.read(evidence["vector"], model), _rows(model, evidence, side)
    ranks = [None] * model.states if side.sign > 0 else _ranks(model, evidence)
    for state, value in enumerate(x.numerators):
        inside, end = state in left and state not in right, int(state in right)
        if value is None or (side.sign > 0 and value < 0):
            raise Rejected(f"state {state}: 0 <= x does not hold")
        if inside:
            _require(model, x, state, rows(state), None, side)
        elif (value - end * x.denominator) * side.sign < 0:
            raise Rejected(f"state {state}: x {_WORD[side.sign]} {end} does not hold")
        if side.sign < 0 and inside and value > 0 and ranks[state] is None:
            raise Rejected(f"state {state}: x > 0 needs a rank")
        if ranks[state] is not None and not inside and not end:
            raise Rejected(f"state {state}: a rank where paths may not go")
    _require_progress(model, rows, ranks, right)
    return x


def reach_reward_bound(
    model: Model, evidence: Any, side: Side, earned: Earned, target: States
) -> Vector:
    """A bound x of the expected reward r until `target`; it is infinite where that may be missed.

    Upper, with r >= 0: where x is finite, x >= 0; outside of `target`, x >= r + P x, only states of
    finite x follow, and some transition of each row lowers a rank, down to `target`, which is
    reached almost surely, therefore. By induction, x bounds what is earned within n steps.

    Lower: x <= 0 on `target`, and where x is finite, x <= r + P x for each row that leads only to
    states of finite x. For a strategy that reaches `target` almost surely, x is at most what it
    earns in n steps plus the mean of x afterwards, and the latter tends to at most 0; other
    strategies earn infinitely much. x is infinite only where `missed` shows it: an upper bound
    below 1 of the probability of reaching `target`.
    """
    x, rows = Vector.read(evidence["vector"], model), _rows(model, evidence, side)
    ranks = [None] * model.states if side.sign < 0 else _ranks(model, evidence)
    infinite = {state for state, value in enumerate(x.numerators) if value is None}
    if infinite and side.sign < 0:
        dual = {None: None, "max": "min", "min": "max"}[side.optimum]
        y = until_bound(model, evidence["missed"], Side(dual, 1), range(model.states), target)
        if unproved := [s for s in infinite if y.numerators[s] >= y.denominator]:
            raise Rejected(f"state {unproved[0]}: it is not proved that the target may be missed")
    for state, value in enumerate(x.numerators):
        if value is None:
            continue
        if (side.sign > 0 and value < 0) or (state in target and value * side.sign < 0):
            raise Rejected(f"state {state}: x {_WORD[side.sign]} 0 does not hold")
        if state not in target:
            if side.sign > 0 and ranks[state] is None:
                raise Rejected(f"state {state}: a finite reward needs a rank")
            of_state = rows(state)
            if side.sign < 0:
                of_state = [r for r in of_state if infinite.isdisjoint(model.rows[r].targets)]
            _require(model, x, state, of_state, earned, side)
    _require_progress(model, rows, ranks, target)
    return x


def average_bound(model: Model, evidence: Any, side: Side, earned: Earned) -> Vector:
    """A bound g of the long-run average of the reward r per step; in a ctmc, per unit of time.

    With the mean time t of a step and a bias h: g >= P g and t g + h >= r + P h (for a lower bound,
    <=). Added over n steps, the second one bounds what they earn by the sum of t g, up to the
    difference of two values of h; the mean of g after any step is at most (least) g. In a ctmc, g
    is constant in a recurrent class, where this bounds rewards by g times the time.
    """
    gain, bias = Vector.read(evidence["gain"], model), Vector.read(evidence["bias"], model)
    rows, word = _rows(model, evidence, side), _WORD[side.sign]
    for state in range(model.states):
        for row in rows(state):
            of_gain = Fraction(gain.numerators[state], gain.denominator)
            rest = earned(state, row) - model.stay(row) * of_gain
            if gain.excess(state, model.rows[row], Fraction(0)) * side.sign < 0:
                raise Rejected(f"{model.where(state, row)}: g {word} P g does not hold")
            if bias.excess(state, model.rows[row], rest) * side.sign < 0:
                raise Rejected(f"{model.where(state, row)}: t g + h {word} r + P h does not hold")
    return gain


def _require(
    model: Model, x: Vector, state: int, rows: Iterable[int], earned: Earned | None, side: Side
) -> None:
    """Require x >= r + P x, or <= for a lower bound, of these rows of a state."""
    for row in rows:
        gained = _ZERO if earned is None else earned(state, row)
        try:
            holds = x.excess(state, model.rows[row], gained) * side.sign >= 0 <= gained.numerator
        except TypeError:  # a value is infinite
            holds = False
        if not holds:
            text = f"x {_WORD[side.sign]} {'r + P x, with r >= 0,' if earned else 'P x'}"
            raise Rejected(f"{model.where(state, row)}: {text} does not hold")


def discounted(model: Model, evidence: Any, side: Side, earned: Earned, factor: Fraction) -> Vector:
    """A bound x of the reward r of all steps, where step i counts factor**i times.

    x >= r + factor P x (for a lower bound, <=). Added over n steps, it bounds their rewards, up to
    the mean of x after them times factor**n, which vanishes.
    """
    if not 0 <= factor < 1:
        raise Rejected("a discount is at least 0 and less than 1")
    x, word = Vector.read(evidence["vector"], model), f"x {_WORD[side.sign]} r + factor P x"
    rows = _rows(model, evidence, side)
    for state in range(model.states):
        for row in rows(state):
            ratio, given = factor.as_integer_ratio(), earned(state, row)
            if x.excess(state, model.rows[row], given, *ratio) * side.sign < 0:
                raise Rejected(f"{model.where(state, row)}: {word} does not hold")
    return x


ONE = 1 << 96  # values within steps are integers over it: a step moves a bound by 2**-96
BUDGET = 10**9  # transitions that are taken in all steps: some minutes


class Steps(NamedTuple):
    """Steps v := best of (gains + factor P v) in the free states of a model."""

    model: Model
    free: States
    best: Any = min
    gains: Mapping[int, Fraction] = {}
    factor: Fraction = Fraction(1)

    def values(self, start: Iterable[Any], *, up: bool) -> Iterator[list[int]]:
        """The values after 0, 1, … steps, times 2**96, rounded, until they do not change."""
        values = [scaled(Fraction(v), up=up) for v in start]
        gains = {row: scaled(gain, up=up) for row, gain in self.gains.items()}
        model, (num, den), settled, work = self.model, self.factor.as_integer_ratio(), False, 0
        while not settled:
            yield values
            if work > BUDGET:
                raise Rejected(f"the steps take more than the budget of {BUDGET} transitions")
            new = values.copy()
            for s in self.free:
                of_rows = []
                for row in range(model.first[s], model.first[s + 1]):
                    weights, targets, denominator = model.rows[row]
                    total = sum(map(operator.mul, weights, map(values.__getitem__, targets)))
                    mean = divided(num * total, den * denominator, up=up)
                    of_rows.append(mean + gains.get(row, 0))
                    work += len(targets)
                new[s] = of_rows[0] if len(of_rows) == 1 else self.best(of_rows)
            values, settled = new, new == values

    def after(self, count: int, start: Sequence[Any]) -> Proofs:
        """Bounds of the values after a number of steps."""
        walks = (islice(self.values(start, up=up), count + 1) for up in (False, True))
        low, high = (deque(walk, 1)[0] for walk in walks)
        return Vector(low, ONE).at, Vector(high, ONE).at


def divided(value: int, by: int, *, up: bool) -> int:
    """The quotient, rounded up or down."""
    return -(-value // by) if up else value // by


def scaled(value: Fraction, *, up: bool) -> int:
    """The number times 2**96, rounded up or down."""
    return divided(value.numerator * ONE, value.denominator, up=up)


_SETS = "left negated right"
_WITHIN = "least left negated reward right", "left most negated reward right"
_ABOUT = {  # what else a statement has, in alphabetic order, after its measure
    "until": (_SETS, f"{_SETS} steps", f"{_SETS} time", *_WITHIN),
    "ltl": ("atoms formula negated",),
    "conditional": ("atoms condition formula",),
    "reward": ("reward target",),
    "cumulative": ("reward steps", "reward time", "factor reward", "factor reward steps"),
    "instantaneous": ("reward steps", "reward time", "states steps"),
    "average": ("reward", "states"),
}
_OPERATORS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


@_readable("the certificate")
def check(model: Model, certificate: Any) -> list[str]:
    """What a certificate proves of a model, as sentences.

    Raises Rejected: something that it states is not proved.
    """
    if differing := sorted(dict(certificate["model"]["sha256"].items() ^ model.digests.items())):
        raise Rejected(f"the certificate is about another model: {', '.join(differing)} differ")
    statement = certificate["statement"]
    if statement["optimum"] not in (("min", "max") if model.kind == "mdp" else (None,)):
        raise Rejected("an mdp needs the optimum min or max, and other models have none")
    lower, upper = _proved(model, statement, certificate["evidence"], notes := list[str]())
    proved, verdicts, given = [], set(), statement.get("comparison")
    for text, ends in statement["bounds"].items():
        state, (low, high) = int(text), [None if e == "Infinity" else number_of(e) for e in ends]
        if not 0 <= state < model.states:
            raise Rejected(f"there is no state {state}")
        found_low, found_high = lower(state), upper(state)
        if found_low is not None and (low is None or found_low < low):
            raise Rejected(f"state {state}: the value is not proved to be at least {ends[0]}")
        if high is not None and (found_high is None or found_high > high):
            raise Rejected(f"state {state}: the value is not proved to be at most {ends[1]}")
        proved.append(f"state {state}: the value is from {ends[0]} to {ends[1]}")
        if given is not None:
            compare, threshold = _OPERATORS[given["operator"]], number_of(given["threshold"])
            of_ends = {compare(float("inf") if e is None else e, threshold) for e in (low, high)}
            if len(of_ends) > 1:
                raise Rejected(f"state {state}: the bounds do not decide the comparison")
            verdicts |= of_ends
    if not proved:
        raise Rejected("the certificate states nothing")
    if given is not None:
        if (verdicts == {True}) is not given["holds"]:
            raise Rejected("the verdict of the comparison is not what the bounds say")
        text = f"{given['operator']} {given['threshold']} in each of these states"
        proved.append(f"{given['holds']}: the value is {text}")
    return proved + notes


def _proved(model: Model, statement: Any, evidence: Any, notes: list[str]) -> Proofs:
    """The lower and the upper bounds that are proved of the measure of a statement."""
    optimum, steps, everywhere = statement["optimum"], statement.get("steps"), range(model.states)
    about = sorted(statement.keys() - {"measure", "optimum", "bounds", "comparison"})
    known = " ".join(about) in _ABOUT.get(statement["measure"], ())
    if not known or type(statement.get("negated", False)) is not bool:
        raise Rejected(f"no measure that is known: {statement['measure']} of {', '.join(about)}")
    whole = "steps" not in statement or (type(steps) is int and steps >= 0)
    factor, reward = number_of(statement.get("factor", "1")), Reward({}, {}, {})
    if not whole or factor < 0 or ({"steps", "factor"} & statement.keys() and model.exit_rates):
        raise Rejected("a whole number of steps in discrete time is needed; factors at least 0")
    if "states" in statement:
        reward.of_state.update(dict.fromkeys(states_of(model, statement["states"]), Fraction(1)))
    elif statement.get("reward") is not None:
        reward = model.rewards[statement["reward"]]
    elif "reward" in statement:  # the time
        reward.of_state.update(dict.fromkeys(everywhere, Fraction(1)))

    def earned(state: int, row: int) -> Fraction:
        of_row, of_state = reward.of_row.get(row, _ZERO), reward.of_state.get(state)
        if of_state is None:
            return of_row
        staying = of_state if model.exit_rates is None else of_state / model.exit_rates[row]
        return staying + of_row if of_row else staying

    def by_rule(rule: Callable[..., Vector], *about: Any) -> Proofs:
        low = rule(model, evidence["lower"], Side(optimum, -1), *about)
        return low.at, rule(model, evidence["upper"], Side(optimum, 1), *about).at

    def repeated(start: list[Any], free: States, gains: Mapping[int, Fraction]) -> Proofs:
        taken = Steps(model, free, min if optimum == "min" else max, gains, factor)
        return taken.after(steps, start)

    left, right = (states_of(model, statement.get(side, "all")) for side in ("left", "right"))
    match statement["measure"]:
        case _ if {"atoms", "least", "most", "time"} & statement.keys():
            from symcheck_verify_derived import proved

            found = proved(model, statement, evidence, reward, earned, notes)
        case "until" if steps is None:
            found = by_rule(until_bound, left, right)
        case "until":
            found = repeated([int(s in right) for s in everywhere], left - right, {})
        case "reward":
            found = by_rule(reach_reward_bound, earned, states_of(model, statement["target"]))
        case "cumulative" if "steps" in statement:
            gains = {row: earned(s, row) for s in everywhere for row in model.rows_of(s)}
            found = repeated([0] * model.states, everywhere, gains)
        case "cumulative":
            found = by_rule(discounted, earned, factor)
        case "instantaneous":
            found = repeated([reward.of_state.get(s, 0) for s in everywhere], everywhere, {})
        case _:
            found = by_rule(average_bound, earned)
    if statement.get("negated"):  # the optimum is that of the formula that is negated
        low, high = (lambda s, side=side: 1 - side(s) for side in found)
        return high, low
    return found


def states_of(model: Model, data: Any) -> frozenset[int]:
    """A set of states: "all", numbers, a label, or what `not`, `and` and `or` make of sets."""
    everywhere = frozenset(range(model.states))
    match list(data.items()) if isinstance(data, dict) else data:
        case "all":
            return everywhere
        case [("states", numbers)] if all(type(s) is int and s in everywhere for s in numbers):
            return frozenset(numbers)
        case [("label", name)]:
            return everywhere & model.labels[name]
        case [("not", inner)]:
            return everywhere - states_of(model, inner)
        case [("or", parts)]:
            return frozenset[int]().union(*(states_of(model, part) for part in parts))
        case _:
            raise Rejected(f"unknown set of states: {data!a:.60}")


def main(arguments: list[str] | None = None) -> int:
    """Check a certificate; the exit status is 0 if it is accepted, 1 if not, 2 for wrong usage."""
    sys.modules.setdefault("symcheck_verify", sys.modules[__name__])  # also if it is run as a file
    words = sys.argv[1:] if arguments is None else arguments
    if len(words) != 2:
        print("usage: symcheck-verify MODEL.tra CERTIFICATE", file=sys.stderr)
        return 2
    try:
        with _readable("the model or the certificate"):
            certificate = json.loads(Path(words[1]).read_text("utf-8"))
            kind, numbers, digests = map(certificate["model"].get, ("type", "numbers", "sha256"))
            proved = check(read_model(Path(words[0]), kind, numbers, digests.values()), certificate)
            left_out = ("bounds", "comparison")
            about = {k: v for k, v in certificate["statement"].items() if k not in left_out}
            proved += [f"of a {kind} with {numbers} numbers"]
            proved += [f"(its writer reads this as {certificate['property']!a})"]
            print("\n  ".join([f"accepted: {json.dumps(about)}", *proved]))
            return 0
    except Rejected as error:
        print(f"rejected: {ascii(str(error))[1:-1]}")
        return 1


if __name__ == "__main__":
    sys.exit(main())
