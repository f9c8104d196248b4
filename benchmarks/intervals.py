"""Random models with intervals of probabilities, against vertices and strategies in fractions.

    python benchmarks/intervals.py --runs 5000 [--seed 1] [--engines explicit,exact,mtbdd]

Each model is checked on every engine: values have to lie in the bounds, `-exact` has to give the
fraction, and thresholds exactly at the value have to be decided. A difference is printed with its
model, and the exit status is 1.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from pathlib import Path
from random import Random

import symcheck
from symcheck.check.result import Certified
from symcheck.errors import SymcheckError

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles import intervals
from oracles.intervals import Games, IntervalRow

ENDS = ("0.1", "0.2", "0.25", "0.3", "1/3", "0.5", "0.7", "0.9", "1")
EXTREME = ("1e-9", "1e-16", "1e-300", "1-1e-16", "1-1e-9", "1e-3")
OPTIMA: dict[str, Callable] = {"min": min, "max": max}
STEPS = (0, 1, 2, 5)


@dataclass(frozen=True)
class Case:
    """A model as a text, and questions with their value in the initial state."""

    text: str
    questions: tuple[tuple[str, Fraction | float], ...]


def drawn(random: Random, *, zeros: bool = False) -> Case:
    """A random model of three to five states, of which the last two are absorbing."""
    n = random.randint(3, 5)
    is_chain = random.random() < 0.4
    ends = ENDS + (EXTREME if random.random() < 0.2 else ()) + (("0",) * 4 if zeros else ())
    games: list[list[IntervalRow]] = []
    lines = []
    for s in range(n):
        choices = []
        for _ in range(1 if is_chain or s >= n - 2 else random.choice((1, 1, 2))):
            row, text = _row(random, n, s, ends)
            choices.append(row)
            lines.append(f"  [] s={s} -> {text};")
        games.append(choices)
    values = [random.choice(("0", "1", "2", "0.5", "7/3")) for _ in range(n - 2)]
    kind = "dtmc" if is_chain else "mdp"
    body = "\n".join(lines)
    items = "\n".join(f"  s={s} : {v};" for s, v in enumerate(values))
    text = (
        f"{kind}\nmodule m\n  s : [0..{n - 1}];\n{body}\nendmodule\nrewards\n{items}\nendrewards\n"
    )
    rewards = [Fraction(v) for v in values] + [Fraction(0)] * 2
    return Case(text, tuple(_questions(games, rewards, is_chain, random)))


def _row(random: Random, n: int, s: int, ends: tuple[str, ...]) -> tuple[IntervalRow, str]:
    if s >= n - 2:
        return {s: (Fraction(1), Fraction(1))}, f"1:(s'={s})"
    while True:
        row: IntervalRow = {}
        parts = []
        for t in random.sample(range(n), random.choice((1, 2, 2, 2, 3))):
            low, high = sorted(random.choices(ends, k=2), key=_number)
            if random.random() < 0.15:
                high = low
            row[t] = (_number(low), _number(high))
            parts.append(f"[{low},{high}]:(s'={t})")
        sums = [sum(side) for side in zip(*row.values(), strict=True)]
        if sums[0] <= 1 <= sums[1] and all(high for _, high in row.values()):
            return row, " + ".join(parts)


def _number(text: str) -> Fraction:
    first, _, rest = text.partition("-") if text.startswith("1-") else (text, "", "")
    return Fraction(first) - (Fraction(rest) if rest else 0)


def _questions(
    games: Games, rewards: list[Fraction], is_chain: bool, random: Random
) -> Iterator[tuple[str, Fraction | float]]:
    n = len(games)
    goal, sink, k = n - 1, n - 2, random.choice(STEPS)
    own = [[rewards[s]] * len(choices) for s, choices in enumerate(games)]
    none = [[Fraction(0)] * len(choices) for choices in games]
    is_goal = [Fraction(s == goal) for s in range(n)]
    everywhere = range(n)
    for player in ("min", "max"):
        for nature in ("min", "max"):
            if is_chain and player != nature:
                continue
            d = nature if is_chain else player + nature
            both = OPTIMA[player], OPTIMA[nature]
            other = tuple(OPTIMA["max" if x == "min" else "min"] for x in (player, nature))
            yield f"P{d}=? [ F s={goal} ]", intervals.until(games, *both, everywhere, {goal})[0]
            left = frozenset(everywhere) - {1}
            yield f"P{d}=? [ s!=1 U s={goal} ]", intervals.until(games, *both, left, {goal})[0]
            missed = intervals.until(games, *other, everywhere, {goal})[0]
            yield f"P{d}=? [ G s!={goal} ]", 1 - missed
            again = intervals.infinitely_often(games, *both, {1})[0]
            yield f"P{d}=? [ G F s=1 ]", again
            often = intervals.infinitely_often(games, *other, {0})[0]
            yield f"P{d}=? [ F G s!=0 ]", 1 - often
            found = intervals.reach_reward(games, own, *both, {goal, sink})[0]
            yield f"R{d}=? [ F s>={sink} ]", found
            yield f"R{d}=? [ F s={goal} ]", intervals.reach_reward(games, own, *both, {goal})[0]
            bounded = intervals.steps(games, none, *both, is_goal, k, kept={goal})[0]
            yield f"P{d}=? [ F<={k} s={goal} ]", bounded
            later = intervals.steps(games, none, *both, is_goal, k, kept={goal})
            yield (
                f"P{d}=? [ F[1,{k + 1}] s={goal} ]",
                intervals.steps(games, none, *both, later, 1)[0],
            )
            yield (
                f"P{d}=? [ X s=1 ]",
                intervals.steps(games, none, *both, [Fraction(s == 1) for s in everywhere], 1)[0],
            )
            zero = [Fraction(0)] * n
            yield f"R{d}=? [ C<={k} ]", intervals.steps(games, own, *both, zero, k)[0]
            yield f"R{d}=? [ I={k} ]", intervals.steps(games, none, *both, rewards, k)[0]


def differences(case: Case, engine: str) -> Iterator[str]:
    """What an engine answers wrongly, with the words of each difference."""
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    try:
        model = symcheck.loads(case.text, **options)
        _ = model.engine
    except SymcheckError as error:
        yield f"{engine}: {error}"
        return
    for text, truth in case.questions:
        try:
            result = model.check(text)
            if problem := _wrong(result, truth, engine):
                yield f"{engine}: {text}: {problem}, and the truth is {truth} = {float(truth)!r}"
            if truth != inf:
                yield from _thresholds(model, text, truth, engine)
        except SymcheckError as error:
            if engine == "exact" or "use -exact" not in str(error) + str(error.hint):
                yield f"{engine}: {text}: {error}"


def _wrong(result: symcheck.Result, truth: Fraction | float, engine: str) -> str | None:
    if engine == "exact":
        return None if result.value == truth else f"{result.value}"
    accuracy = result.accuracy
    if isinstance(accuracy, Certified):
        inside = (
            Fraction(accuracy.lower)
            <= truth
            <= (inf if accuracy.upper == inf else Fraction(accuracy.upper))
        )
        return None if inside else f"{accuracy.lower!r} to {accuracy.upper!r}"
    if result.value == truth or (truth != inf and abs(result.value - truth) <= 1e-12 * truth):
        return None
    return f"{result.value!r} ({accuracy})"


def _thresholds(model: symcheck.Model, text: str, truth: Fraction, engine: str) -> Iterator[str]:
    head, _, path = text.partition("=?")
    shown = f"{truth.numerator}/{truth.denominator}"
    pairs = ((">=", True), (">", False)), (("<=", True), ("<", False))
    for operator, holds in pairs[truth.denominator % 2]:
        if model.check(f"{head}{operator}{shown}{path}").value is not holds:
            yield f"{engine}: {head}{operator}{shown}{path} is not {holds}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engines", default="explicit,exact,mtbdd")
    parser.add_argument("--zeros", action="store_true", help="lower ends of 0 too")
    given = parser.parse_args()
    found = 0
    for run in range(given.runs):
        case = drawn(Random(f"{given.seed}-{run}"), zeros=given.zeros)
        for engine in given.engines.split(","):
            for difference in differences(case, engine):
                found += 1
                print(f"run {run}: {difference}\n{case.text}", flush=True)
    print(f"{given.runs} models, {found} differences")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
