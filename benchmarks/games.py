"""Check random turn-based games on every engine, against tests/oracles in plain fractions.

python benchmarks/games.py [--runs N] [--seconds S] [--first SEED] [--extreme] [--engines NAME ...]

Each run draws a game of 2 to 6 states and 3 players, and asks a question of each kind about it, for
a random coalition, and most of them with the value as a threshold. An exact value has to be the
truth, bounds have to contain it, and a verdict has to be right. Differences are printed.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections import Counter
from math import inf
from pathlib import Path

import symcheck
from symcheck.errors import SymcheckError

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from oracles.draw_games import contradiction, draw


def main() -> None:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=inf)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--extreme", action="store_true")
    parser.add_argument("--engines", nargs="+", default=["explicit", "sparse", "exact"])
    arguments = parser.parse_args()
    counted: Counter[str] = Counter()
    start = time.time()
    for seed in range(arguments.first, arguments.first + arguments.runs):
        if time.time() - start > arguments.seconds:
            break
        counted["games"] += 1
        drawn = draw(str(seed), extreme=arguments.extreme)
        for engine in arguments.engines:
            options = {"exact": True} if engine == "exact" else {"engine": engine}
            model = symcheck.loads(drawn.text, **options)
            for question in drawn.questions:
                ask = f"filter(state, {question.text}, s={question.state})"
                try:
                    with warnings.catch_warnings(record=True) as wide:
                        warnings.simplefilter("always")
                        found = contradiction(question, model.check(ask))
                    counted["wide"] += bool(wide)
                    if wide:
                        print(seed, engine, "wide", ask, wide[0].message, flush=True)
                except SymcheckError as error:
                    refused = "F0" in ask and engine == "exact"
                    found = "" if refused else f"error: {error}"
                    counted["refused"] += refused
                counted["questions"] += 1
                if found:
                    counted["differences"] += 1
                    print(seed, engine, found, ask, question.value, question.upper, flush=True)
    print(dict(counted), f"{time.time() - start:.0f} s")
    sys.exit(counted["differences"] > 0)


if __name__ == "__main__":
    main()
