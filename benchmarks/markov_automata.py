"""Compare random Markov automata with oracles that share no code with symcheck.

python benchmarks/markov_automata.py [--runs N] [--first N] [--seconds S]

Each run draws an automaton with 2 to 6 states. Unbounded probabilities, expected times and rewards,
and long-run averages are compared with the best of all memoryless strategies, in fractions;
time-bounded probabilities with an enclosure by small steps of time. Differences are printed with
the seed and the text.
"""

from __future__ import annotations

import argparse
import sys
import time
from fractions import Fraction
from math import inf
from pathlib import Path
from random import Random

import symcheck
from symcheck.check.result import Certified, Exact
from symcheck.errors import UnsupportedError

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from oracles.automata import Automaton, draw
from oracles.decisions import strategy_count

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")
STEPS = 40


def questions(automaton: Automaton, rng: Random) -> list[tuple[str, object]]:
    """Properties of the initial state, and their truth: a number, or an interval."""
    n = len(automaton.rates)
    target = sorted(rng.sample(range(n), rng.randint(1, n - 1)))
    left = sorted({*rng.sample(range(n), rng.randint(1, n)), 0})
    right_text = "|".join(f"x={s}" for s in target)
    left_text = "|".join(f"x={s}" for s in left)
    found: list[tuple[str, object]] = []
    zeno = automaton.is_zeno
    for word, best in (("min", min), ("max", max)):
        found.append(
            (f"P{word}=? [ ({left_text}) U ({right_text}) ]",
             automaton.until(best, left, target)[0])
        )  # fmt: skip
        found.append((f"T{word}=? [ F ({right_text}) ]", automaton.reach_time(best, target)[0]))
        found.append((f"R{word}=? [ F ({right_text}) ]", automaton.reach_reward(best, target)[0]))
        if zeno:
            found.append((f"S{word}=? [ {right_text} ]", None))
        else:
            inside = [[t * (s in target) for t in times] for s, times in enumerate(automaton.times)]
            found.append((f"S{word}=? [ {right_text} ]", automaton.long_run(best, inside)[0]))
            found.append((f"R{word}=? [ S ]", automaton.long_run(best, automaton.rewards)[0]))
        end = Fraction(rng.choice([1, 2, 5]), rng.choice([2, 10, 20]))
        found.append(
            (f"P{word}=? [ ({left_text}) U<={float(end)!r} ({right_text}) ]",
             automaton.within(best, left, target, end, STEPS)[0])
        )  # fmt: skip
        other = "max" if word == "min" else "min"
        low, high = found[-1][1]  # type: ignore[misc]
        found.append(
            (f"P{other}=? [ !(({left_text}) U<={float(end)!r} ({right_text})) ]",
             (1 - high, 1 - low))
        )  # fmt: skip
    return found


def wrong(result: symcheck.Result, truth: object) -> str | None:
    """What is wrong with a result; None if nothing is."""
    match result.accuracy:
        case Exact():
            low = high = float(result.value)
            if isinstance(result.value, Fraction) and isinstance(truth, Fraction):
                return None if result.value == truth else "not the fraction"
            low, high = low * (1 - 1e-12), high * (1 + 1e-12)
        case Certified(low, high):
            pass
        case other:
            return f"{other} proves nothing"
    if isinstance(truth, tuple):
        lower, upper = truth
        if low > upper + 1e-9 or high < lower - 1e-9:
            return "outside of the enclosure"
    elif truth == inf or high == inf:
        return None if low == high == truth else "not infinite, or wrongly so"
    elif not low <= truth <= high:  # type: ignore[operator]
        return "outside of the bounds"
    if high - low > 2e-6 * max(abs(high), 1e-12) and high < inf:
        return "wide bounds"
    return None


def run(seed: str) -> list[str]:
    """The differences of one automaton."""
    drawn = draw(seed)
    if strategy_count(drawn.automaton.processes) > 40:
        return []
    rng = Random(f"questions {seed}")
    found = []
    asked = questions(drawn.automaton, rng)
    engines = [rng.choice(ENGINES), "exact"]
    for engine in engines:
        exact = engine == "exact"
        model = symcheck.loads(drawn.text, engine="explicit" if exact else engine, exact=exact)
        for text, truth in asked:
            if exact and isinstance(truth, tuple):
                continue
            try:
                result = model.check(text)
                trivial = result.accuracy == Exact() and result.value in (0, 1)
                unknown = None if trivial else "not refused"
                fault = unknown if truth is None else wrong(result, truth)
            except UnsupportedError as error:
                fault = None if truth is None and "no time" in str(error) else f"refused: {error}"
            if fault:
                found.append(f"{seed} {engine} {text}: {fault}; the truth is {truth}")
                if "refused" not in fault and "fraction" not in fault:
                    found[-1] += f", found {model.check(text)!r}"
    return found


def main() -> None:
    """Run the comparisons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=inf)
    a = parser.parse_args()
    started, failures, count = time.perf_counter(), 0, 0
    for number in range(a.first, a.first + a.runs):
        if time.perf_counter() - started > a.seconds:
            break
        count += 1
        for line in run(str(number)):
            failures += 1
            print(line, flush=True)
    print(f"{count} models, {failures} differences, {time.perf_counter() - started:.0f} s")
    sys.exit(failures > 0)


if __name__ == "__main__":
    main()
