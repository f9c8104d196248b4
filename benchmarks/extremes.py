"""Check models with extreme numbers on every engine, against oracles that share no code with them.

python benchmarks/extremes.py [--runs N] [--seconds S] [--seed TEXT] [--log FILE] [--only SEED]
                              [--engines NAME ...]

Each run checks five properties of one model (2 to 8 states; probabilities such as 1e-300 and
1-1e-16, rewards such as 1e17 of both signs, thresholds at the value and one unit in the last place
beside it) on each engine: 25 or 30 cases. tests/oracles have the truth. A result has to say what it
keeps: an exact value is the truth, a rounded one has close bounds and is never 0 in its place,
bounds contain it, a verdict is right, and each check ends. The log has one JSON object per run and
line, and a campaign that is started again goes on after its last line. Each difference is written
beside the log, as a model and a property with what every engine said.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import time
import warnings
from collections import Counter
from fractions import Fraction
from math import ceil, inf, isnan, log10, ulp
from multiprocessing.connection import Connection
from pathlib import Path

import campaign

import symcheck
from symcheck.check.result import Certified, Estimate, Exact, Result
from symcheck.errors import (
    InternalError,
    NumericalError,
    SymcheckError,
    TimeLimitError,
    UnsupportedError,
)

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from oracles.draw import ACTIONS, Case, Question, Truth, draw

ENGINES = ("default", "explicit", "sparse", "hybrid", "mtbdd", "exact")
ENGINE_OF_STRATEGIES = "explicit"
PATIENCE = 5.0
"""The longest time of one check, in seconds: its model has 8 states at most."""
LONGEST = 200.0
"""The longest time of one run, after which its process has hung."""
WIDEST = 1e-9
"""The largest distance of the bounds of a value that is exact up to rounding, relative to it."""


def options(engine: str) -> dict[str, object]:
    """The options of symcheck that choose an engine."""
    match engine:
        case "default":
            return {}
        case "exact":
            return {"exact": True}
    return {"engine": engine}


def may_refuse(error: SymcheckError, engine: str, kind: str) -> bool:
    """Whether an engine may say nothing: of times there are no rationals, and no long ones."""
    if kind != "ctmc":
        return False
    return isinstance(error, UnsupportedError if engine == "exact" else NumericalError)


def difference(found: campaign.Outcome, truth: Truth, *, silent: bool = False) -> str:
    """How an outcome contradicts the truth; empty if it does not, or may be silent."""
    if isinstance(found, TimeLimitError):
        return "endless"
    if isinstance(found, InternalError) or not isinstance(found, Result | SymcheckError):
        return "crash"
    undefined = truth is None or _is_nan(truth)
    if isinstance(found, SymcheckError):
        refused = "refused" if isinstance(found, campaign.SILENT) else "error"
        return "" if undefined or silent else refused
    if isinstance(truth, bool):
        return "" if found.value is truth else "verdict"
    if isinstance(truth, frozenset):
        assert found.satisfying is not None
        states = frozenset(found.satisfying.mask.nonzero()[0].tolist())
        return "" if states == truth else "states"
    value = found.value
    if isinstance(value, bool) or not isinstance(value, int | float | Fraction):
        return "kind of value"
    if undefined:
        return "" if _is_nan(value) else "defined"
    if _is_nan(value):
        return "NaN"
    assert truth is not None
    return _number_differs(found, truth if isinstance(truth, tuple) else (truth, truth))


def strategy_differs(found: campaign.Outcome, question: Question) -> tuple[str, str]:
    """Whether a strategy does not attain the optimum, by the oracle's own evaluation."""
    if not isinstance(found, Result) or not found.strategies:
        return "", "none"
    assert question.under is not None
    # An action of each state where the choice matters; the oracle's others are the first ones.
    actions = found.strategy.actions
    chosen = [max(ACTIONS.find(action or "-"), 0) for action in actions]
    value, truth = question.under(chosen), question.truth
    shown_value = f"{' '.join(map(str, actions))}: {shown(value)}"
    if value == truth:
        return "", shown_value
    if inf in (abs(value), abs(truth)):
        return "not optimal", shown_value
    near = abs(Fraction(value) - Fraction(truth)) <= Fraction(3, 10**6) * abs(truth)
    return "" if near else "not optimal", shown_value


def _is_nan(value: object) -> bool:
    """Whether a value is NaN; a fraction may be too large for a float."""
    return isinstance(value, float) and isnan(value)


def _number_differs(found: Result, truth: tuple[Fraction | float, Fraction | float]) -> str:
    low, high = truth
    value = found.value
    assert isinstance(value, int | float | Fraction)
    match found.accuracy:
        case Estimate():
            return "estimate"
        case Certified(lower, upper):
            if not (lower <= low and high <= upper):  # NaN neither
                return "outside"
            return "" if campaign.is_narrow(found) else "wide"
        case Exact(rounding=False):
            return "" if low == value == high else "not exact"
    if inf in (abs(value), abs(low)):
        return "" if value == low else "infinite"
    lower, upper = found.bounds
    if not value and low > 0:
        return "rounded to 0"
    if not lower <= low <= high <= upper:
        return "outside"
    return "" if upper - lower <= WIDEST * abs(value) else "rounding"


def units(found: campaign.Outcome) -> str:
    """The distance of bounds that rounding explains, in units in the last place: a power of 10."""
    if not isinstance(found, Result) or found.accuracy != Exact(rounding=True):
        return "not rounded"
    low, high = (float(v) for v in found.bounds)
    if not low < high < inf:
        return "1 unit"
    return f"{10 ** ceil(log10((high - low) / ulp(max(abs(low), abs(high)))))} units"


def shown(truth: Truth) -> str:
    """The truth in words."""
    if isinstance(truth, tuple):
        return f"in [{', '.join(map(shown, truth))}]"
    if not isinstance(truth, Fraction):
        return str(truth)
    short = max(abs(truth.numerator), truth.denominator) < 10**20
    return str(truth) if short else f"{_decimal(truth)} (rounded)"


def said(found: campaign.Outcome) -> str:
    """An outcome in words, without the digits of a long fraction."""
    if isinstance(found, Result) and isinstance(found.value, Fraction):
        return f"{shown(found.value)} ({found.accuracy!r})"
    if isinstance(found, Result) and found.value is None:
        return f"{found.lines or found.satisfying}"
    return campaign.said(found)


def _decimal(value: Fraction) -> str:
    """17 digits, also far below the least double."""
    from decimal import Decimal, localcontext

    with localcontext(prec=17, Emin=-(10**6), Emax=10**6):
        return str(Decimal(value.numerator) / Decimal(value.denominator))


def run(seed: str, folder: Path, engines: tuple[str, ...] = ENGINES) -> dict[str, object]:
    """Check one model; the line of the log."""
    started = time.perf_counter()
    case: Case = draw(seed)
    parsed = symcheck.Model(symcheck.parse_model(case.text), {}, symcheck.Options())
    models = {name: parsed.with_options(**options(name)) for name in engines}
    words: Counter[str] = Counter()
    found: list[str] = []
    warnings.simplefilter("error")  # one of numpy is a crash
    for i, question in enumerate(case.questions):
        file = symcheck.parse_properties(question.text)
        kinds, answers = {}, {"truth": shown(question.truth)}
        for name, model in models.items():
            outcome = campaign.outcome(model, file, PATIENCE)
            words[f"{name} {campaign.word(outcome)}"] += 1
            words["compared with an oracle"] += 1
            words[f"{name} {units(outcome)}"] += 1
            answers[name] = said(outcome)
            silent = isinstance(outcome, SymcheckError) and may_refuse(outcome, name, case.kind)
            if kind := difference(outcome, question.truth, silent=silent):
                kinds[name] = kind
        if question.under is not None and ENGINE_OF_STRATEGIES in models:
            model = models[ENGINE_OF_STRATEGIES].with_options(strategy=True)
            words["strategies"] += 1
            kind, answers["strategy"] = strategy_differs(
                campaign.outcome(model, file, PATIENCE), question
            )
            kinds |= {"strategy": kind} if kind else {}
        if kinds:
            found.append(f"{i}: {kinds}")
            campaign.write(folder, f"{seed}.{i}", case.text, question.text, answers, kinds)
    return {
        "seed": seed,
        "kind": case.kind,
        "checks": len(case.questions) * len(engines),
        "outcomes": words,
        "differences": found,
        "seconds": round(time.perf_counter() - started, 3),
        "megabytes": campaign.resident(),
    }


class Runner:
    """Runs in a process that is replaced if it hangs or ends."""

    def __init__(self, folder: Path, engines: tuple[str, ...]) -> None:
        self._words = (folder, engines)
        self._pipe: Connection | None = None

    def __call__(self, seed: str) -> dict[str, object]:
        """The line of a run."""
        if self._pipe is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            words = (theirs, *self._words)
            self._process = context.Process(target=_answer, args=words, daemon=True)
            self._process.start()
            theirs.close()
        try:
            self._pipe.send(seed)
            if self._pipe.poll(LONGEST):
                line: dict[str, object] = self._pipe.recv()
                return line
            error: Exception = TimeoutError(f"hangs for {LONGEST:.0f} seconds")
        except (EOFError, OSError) as ended:
            error = ended
        self._process.kill()
        self._pipe = None
        return campaign.failed(seed, error)


def _answer(pipe: Connection, folder: Path, engines: tuple[str, ...]) -> None:
    while True:
        seed = pipe.recv()
        try:
            pipe.send(run(seed, folder, engines))
        except Exception as error:  # a run of days goes on
            pipe.send(campaign.failed(seed, error))


def main() -> int:
    """Run what is left of the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    campaign.add_arguments(parser, Path("extremes.jsonl"))
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=ENGINES)
    asked = parser.parse_args()
    folder, engines = campaign.folder_of(parser, asked.log), tuple(asked.engines)
    if asked.only:
        line = run(asked.only, folder, engines)
        print(json.dumps(line))
        return 1 if line["differences"] else 0
    return campaign.continued(asked, Runner(folder, engines))


if __name__ == "__main__":
    sys.exit(main())
