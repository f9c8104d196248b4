"""Check bounds on partially observed models against trees of beliefs in fractions.

python benchmarks/beliefs.py [--runs N] [--seed S] [--steps K]

Each run draws a small model, whose values are bounded by an oracle that shares no code with
symcheck. The two pairs of bounds must overlap, thresholds must be decided rightly or not at all,
values within a bound on steps must be equal, and exported strategies must attain what is claimed.
Prints how often bounds are exact or certified within epsilon, and each contradiction.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from math import inf, isinf
from pathlib import Path
from random import Random

import symcheck
from symcheck.errors import NumericalError

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from oracles.beliefs import Hidden, bounds, drawn, within

QUERIES = {
    'Pmax=? [ F "goal" ]': (max, False),
    'Pmin=? [ F "goal" ]': (min, False),
    'Rmax=? [ F "goal" ]': (max, True),
    'Rmin=? [ F "goal" ]': (min, True),
}
SLACK = 1e-9
OPTIONS = {"beliefs": 300}


def contradictions(model: Hidden, steps: int, counts: Counter[str]) -> Iterator[str]:
    """What symcheck says of a model that the oracle refutes."""
    loaded = symcheck.loads(model.text, **OPTIONS)
    for query, (best, reward) in QUERIES.items():
        attained, seeing = bounds(model, best, steps, reward=reward)
        low, high = (attained, seeing) if best is max else (seeing, attained)
        result = loaded.check(query)
        lower, upper = result.bounds
        counts[_kind(lower, upper)] += 1
        if _above(lower, high) or _above(low, upper):
            yield f"{query}: [{lower}, {upper}], and the truth is in [{float(low)}, {float(high)}]"
        yield from _thresholds(loaded, query, low, high, counts)
    yield from _strategies(model, counts)
    for steps_bound in (0, 1, 3):
        for name, best in (("max", max), ("min", min)):
            query = f'P{name}=? [ F<={steps_bound} "goal" ]'
            truth = within(model, best, steps_bound)
            value = loaded.check(query).value
            if abs(float(value) - float(truth)) > SLACK:
                yield f"{query}: {value}, and the truth is {float(truth)}"


def _strategies(model: Hidden, counts: Counter[str]) -> Iterator[str]:
    """A strategy whose induced chain is worse than the bound that it was said to attain."""
    beliefs = 1 + len(model.text) % 6  # few, so that all parts of a strategy are used
    loaded = symcheck.loads(model.text, strategy=True, beliefs=beliefs)
    for query in (*QUERIES, 'Pmax=? [ F<=3 "goal" ]', 'Pmin=? [ G<=3 !"goal" ]'):
        result = loaded.check(query)
        yield from (f"{query}: {w}" for w in result.warnings if "was claimed" in w)
        if not result.strategies:
            continue
        counts["strategies"] += 1
        chain = symcheck.induced_chain(loaded, result.strategy)
        low, high = chain.check(query.replace("max", "").replace("min", "")).bounds
        lower, upper = result.bounds
        if _above(lower, high) if "max" in query else _above(low, upper):
            yield f"{query}: the strategy attains [{low}, {high}], not [{lower}, {upper}]"


def _thresholds(
    loaded: symcheck.Model,
    query: str,
    low: Fraction | float,
    high: Fraction | float,
    counts: Counter[str],
) -> Iterator[str]:
    """A threshold that the oracle decides, and the bounds of the oracle themselves."""
    for operator, threshold in ((">=", low), ("<=", high), (">", high), ("<", low)):
        if isinf(threshold):
            continue
        expected = operator in (">=", "<=")
        # Over the optimal strategy: the query with its direction and a bound.
        text = query.replace("=?", f"{operator}{Fraction(threshold)}")
        try:
            found = loaded.check(text).value
        except NumericalError:
            counts["undecided"] += 1
            continue
        counts["decided"] += 1
        if found is not expected:
            yield f"{text}: {found}"


def _above(a: Fraction | float, b: Fraction | float) -> bool:
    if a == b or b == inf:
        return False
    return a == inf or float(a) > float(b) + SLACK * max(1.0, abs(float(b)))


def _kind(lower: float, upper: float) -> str:
    if lower == upper:
        return "exact"
    width = (upper - lower) / upper if upper != inf else inf
    return "within 1e-6" if width <= 1e-6 else "within 1%" if width <= 0.01 else "wide"


def main() -> int:
    """Returns the number of contradictions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=3)
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    wrong = 0
    for run in range(given.runs):
        model = drawn(Random(given.seed + run))
        for text in contradictions(model, given.steps, counts):
            wrong += 1
            print(f"seed {given.seed + run}: {text}\n{model.text}")
    print(f"{given.runs} models: {dict(counts)}, {wrong} contradictions")
    return wrong


if __name__ == "__main__":
    sys.exit(min(main(), 1))
