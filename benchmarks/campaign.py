"""Check random properties of random models on the engines, with rationals and with Storm.

python benchmarks/campaign.py [--runs N] [--seconds S] [--seed TEXT] [--log FILE] [--storm SHARE]
                              [--large]

Each run checks four properties of one model in this process: with rationals (time-bounded ones of
CTMCs by matrix exponentials in ball arithmetic) and on two engines, or on all four in one run of
eight. Bounds have to contain the exact value, verdicts and errors have to agree. With --large, a
random half of the size thresholds is lowered in each run, so that methods for large models are used
on small ones. The log has one JSON object per run and line; a campaign that is started again goes
on after its last line. Each difference is written beside the log, as a model and a property with
what every engine said, and its seed is printed; --only SEED repeats that run.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from fractions import Fraction
from math import inf, isinf, isnan
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random
from types import ModuleType
from unittest.mock import patch

import exponentials

import symcheck
from symcheck.check.result import Certified, Estimate, Exact, Result
from symcheck.errors import (
    InputError,
    InternalError,
    NumericalError,
    ResourceError,
    SymcheckError,
    TimeLimitError,
    UnsupportedError,
    UsageError,
)

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from generate import Generated, random_copies, random_question, wild_model
from symcheck.check import tuning as check
from symcheck.engines import tuning as engines
from symcheck.explicit import tuning as explicit
from symcheck.matrices import tuning as matrices
from symcheck.numerics import tuning as numerics
from symcheck.syntax.declarations import PropertiesFile
from symcheck.time_limit import within

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd")
VARIANTS: tuple[dict[str, object], ...] = (
    *({},) * 8,
    *({name: True} for name in ("bisim", "reduce", "strategy", "everywhere", "symmetry")),
    *({"method": name} for name in ("interval", "optimistic", "policy")),
    {"stop_at_targets": True},
    {"truncate": True},
    {"order": ("force",)},
)
"""Options with which an engine has to give the same answers."""

LOWERED: Mapping[ModuleType, Mapping[str, float]] = {
    check: {"LARGE_MODEL_STATES": 1, "DIAGRAMS_FIRST_STATES": 1},
    engines: {
        "STATES_PER_UNKNOWN": 1,
        "KEPT_TRANSPOSE_TRANSITIONS": 0,
        "FEW_TRANSITIONS": 0,
        "BSCC_PIVOTS": 1,
        "END_COMPONENT_STATES": 0,
        "MATERIALIZED_STATES": 0,
        "ELIMINATION_STATES": 1,
        "ACYCLIC_STATES": 1,
        "SMALL_DIAGRAM_NODES": 0,
        "DECODED_STATES": 2,
        "MANY_STATES": 1,
        "FEW_LEAVES": 2,
    },
    explicit: {
        "THREADED_STATES": 1,
        "MIN_STATES_TO_TRIM": 1,
        "VALUATIONS_PER_BLOCK": 2,
        "FIRST_REGION_STATES": 2,
    },
    matrices: {
        "MAX_BLOCK_RUNS": 4,
        "MIN_THREADED_ENTRIES": 1,
        "MIN_THREADED_ROWS_ENTRIES": 1,
    },
    numerics: {
        "STATES_PER_SLICE": 3,
        "SMALL_COMPONENT_STATES": 1,
        "LARGE_COMPONENT_STATES": 1,
        "CHEAP_ENTRIES": 0,
        "EARLY_OPERATIONS_PER_ENTRY": 0,
        "EARLY_OPERATIONS_PER_ENTRY_LARGE": 0,
        "ELIMINATION_STATES": 0,
        "THREADED_TRIANGLES": 1,
        "MIN_BLOCK_ROWS": 1,
        "TWO_THREADS_STATES": 1,
        "TRUNCATION_ENTRIES": 0,
        "TRUNCATION_MAX_KEPT": 0.99,
        "FORWARD_ENTRIES": 0,
        "FORWARD_ACTIVE_SHARE": 1.0,
        "KRYLOV_STEPS": 1,
        "SMOOTHING_STEPS": 0.5,
        "KRYLOV_ENTRIES": 0,
        "KRYLOV_ELIMINATION_STATES": 0,
        "KRYLOV_SLICE_STATES": 3,
        "SMALL_CHAIN_STATES": 0,
        "QUICK_OPERATIONS_PER_ENTRY": 0,
        "DRIFT_STATES": 1,
        "CORE_SHARE": 0.9,
        "DIRECT_EVALUATION_STATES": 0,
        "VALUE_ITERATIONS_BEFORE_POLICIES": 2,
        "INVERSE_STATES": 0,
    },
}
"""Size thresholds and limits, with values at which even small models count as large."""
TOGETHER = {"KRYLOV_STEPS": "SMOOTHING_STEPS"}
"""Thresholds that are lowered exactly when another one is. SMOOTHING_STEPS must stay below
KRYLOV_STEPS, from which on Krylov subspaces are tried."""

PATIENCE = (0.5,) * 19 + (5.0,)
"""The longest time of one check; one model of twenty has more."""

ROUNDING = Fraction(1, 10**10)
"""The largest error of values that are exact up to rounding, relative to them."""

SILENT = UnsupportedError | NumericalError | ResourceError
"""Errors that say nothing about the value."""

Outcome = Result | BaseException
Bounds = tuple[float | Fraction, float | Fraction]


def random_case(seed: str) -> tuple[str, list[str]]:
    """A model and properties of it."""
    rng = Random(seed)
    kind = rng.choice(("dtmc", "ctmc", "mdp"))
    if rng.random() < 0.02:
        text, formula = random_copies(rng, kind)
        return text, [formula]
    model: Generated = wild_model(rng, kind)
    return model.text, [random_question(rng, model) for _ in range(4)]


@contextmanager
def large(seed: str) -> Iterator[None]:
    """Lower a random half of the size thresholds, by the seed, while the context lasts."""
    rng = Random(f"{seed} large")
    with ExitStack() as stack:
        for module, values in LOWERED.items():
            names = [name for name in values if name not in TOGETHER and rng.random() < 0.5]
            names += [name for name, other in TOGETHER.items() if other in names]
            for name in names:
                stack.enter_context(patch.object(module, name, values[name]))
        yield


def outcome(model: symcheck.Model, formula: PropertiesFile, seconds: float) -> Outcome:
    """The result of a property, or the error that it ends with."""
    try:
        return within(seconds, lambda: next(model.check_all(formula))[1])
    except Exception as error:  # of any kind: all are compared
        return error


def by_exponentials(exact: symcheck.Model, formula: str, seconds: float) -> Outcome:
    """The result of a time-bounded property of a small CTMC, without an engine, or an error."""
    try:
        value = within(seconds, lambda: exponentials.value(exact, formula))
    except SymcheckError as error:  # of a part of the property, or no time
        return error
    return UnsupportedError("no exponentials") if value is None else Result(value, Exact())


def word(found: Outcome) -> str:
    """The kind of an outcome, as the log counts it."""
    if isinstance(found, Result):
        if isinstance(found.accuracy, Exact):
            return "rounded" if found.accuracy.rounding else "exact"
        return type(found.accuracy).__name__.lower()
    return type(found).__name__


def said(found: Outcome) -> str:
    """An outcome in words."""
    if isinstance(found, Result):
        return f"{found.value} ({found.accuracy!r})"
    return f"{type(found).__name__}: {found}"


def difference(found: Outcome, true: Outcome) -> str:
    """How an outcome contradicts another one, which is exact if that was possible."""
    for one in (found, true):
        if isinstance(one, InternalError) or not isinstance(one, Result | SymcheckError):
            return "crash"
    if isinstance(found, Result) and isinstance(true, Result):
        estimates = isinstance(found.accuracy, Estimate) or isinstance(true.accuracy, Estimate)
        return "" if estimates else _values_differ(found, true)
    if isinstance(found, SILENT) or isinstance(true, SILENT):
        return ""
    faults = InputError | UsageError
    return "" if isinstance(found, faults) and isinstance(true, faults) else "error"


def _values_differ(found: Result, true: Result) -> str:
    match found.value, true.value:
        case (bool() | None, _) | (_, bool() | None):
            return "verdict" if found.value is not true.value else ""
        case list() as points, list() as others:
            near = len(points) == len(others) and all(
                _near(a, b)
                for p, q in zip(points, others, strict=True)
                for a, b in zip(p, q, strict=True)
            )
            return "" if near else "front"
        case (list(), _) | (_, list()):
            return "kind of value"
    pairs = zip(_ends(found), _ends(true), strict=True)
    overlap = true.accuracy != Exact()  # its value lies between its bounds
    kinds = (_bounds_differ(*pair, overlap=overlap) for pair in pairs)
    return next(filter(None, kinds), "" if is_narrow(found) else "wide")


def _bounds_differ(found: Bounds, true: Bounds, *, overlap: bool) -> str:
    """Whether bounds do not contain the true ones, or, of which none is known, not overlap."""
    (low, high), (least, greatest) = found, true
    if isnan(low) or isnan(least):
        return "" if isnan(low) and isnan(least) else "NaN"
    if overlap:
        return "" if low <= greatest and least <= high else "apart"
    return "" if low <= least and greatest <= high else "outside"


def _ends(result: Result) -> list[Bounds]:
    """The bounds of a number, or of the least and greatest one over several initial states."""
    if not isinstance(result.value, tuple):
        return [result.bounds]
    match result.accuracy:
        case Certified() as within:
            if isinf(within.epsilon):
                return [(-inf, inf)] * 2
            radius = Fraction(within.epsilon)
        case Exact(rounding=True):
            radius = Fraction(0)
        case _:
            return [(v, v) for v in result.value]
    wide = [v if isinf(v) or isnan(v) else Fraction(v) for v in result.value]
    slack = [0 if isinstance(v, float) else radius + ROUNDING * abs(v) for v in wide]
    (low, _), (_, high) = ends = [(v - s, v + s) for v, s in zip(wide, slack, strict=True)]
    if result.accuracy == Exact(rounding=True):  # one interval encloses the values of all states
        low, high = result.bounds
    return [(low, ends[0][1]), (ends[1][0], high)]


def is_narrow(result: Result) -> bool:
    """Whether bounds are as near as asked for, or a warning says that they are not.

    Values below the smallest normal double have bounds up to 1e-300 apart, and sums of them more.
    """
    if not isinstance(result.accuracy, Certified) or result.warnings:
        return True
    low, high = result.accuracy.lower, result.accuracy.upper
    return high - low <= 2.1e-6 * max(map(abs, result.bounds)) or high <= 1e-297


def cancelled(found: Outcome, true: Outcome) -> bool:
    """Whether a sum or difference is as accurate as its operands may be: those are not known."""
    assert isinstance(found, Result)
    assert isinstance(true, Result)
    pairs = zip(_ends(found), _ends(true), strict=True)
    return all(_near(a, b) for found, true in pairs for a, b in zip(found, true, strict=True))


def _near(one: object, other: object) -> bool:
    return one == other or abs(Fraction(one) - Fraction(other)) <= 1e-5 * (1 + abs(other))


class Storm:
    """Storm with rational numbers, in a process that is replaced if it ends or is silent."""

    def __init__(self) -> None:
        self._pipe: Connection | None = None

    def __call__(self, text: str, formula: str) -> str:
        """Its value in the initial state as a text; empty if it has none."""
        if self._pipe is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(target=_answer, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()
        try:
            self._pipe.send((text, formula))
            if self._pipe.poll(max(PATIENCE)):
                return str(self._pipe.recv())
        except (EOFError, OSError):
            pass
        self._process.kill()
        self._pipe = None
        return ""


def _answer(pipe: Connection) -> None:
    import stormpy

    nowhere = os.open(os.devnull, os.O_WRONLY)  # Storm warns of each command
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    with tempfile.NamedTemporaryFile("w+", suffix=".prism") as file:
        while True:
            text, formula = pipe.recv()
            try:
                file.seek(0)
                file.truncate()
                file.write(text)
                file.flush()
                program = stormpy.parse_prism_program(file.name, prism_compatibility=True)
                asked = stormpy.parse_properties(formula, program)
                model = stormpy.build_model[stormpy.Rational](program, asked)
                result = stormpy.model_checking(model, asked[0])
                state = model.initial_states[0]
                number = hasattr(result, "get_value")
                value = result.get_value(state) if number else bool(result[state])
                pipe.send(str(value).lower() if len(model.initial_states) == 1 else "")
            except Exception:  # Storm does not know the property, or says nothing of use
                pipe.send("")


def storm_agrees(model: symcheck.Model, formula: str) -> bool:
    """Whether Storm computes with rationals, and gives the property the same meaning.

    It evaluates no numbers in filters, computes several objectives in floating point, drops the
    rewards of deadlock states, and `a U[t,u] b` does not require a before t (docs/comparison.md).
    """
    if formula.startswith(("filter", "multi")) or re.search(r"U(>|=|\[)", formula):
        return False
    return "R{" not in formula or not model.deadlocks.count


def storm_differs(answer: str, true: Outcome) -> bool:
    """Whether the exact value is not that of Storm."""
    if not answer or not isinstance(true, Result) or not isinstance(true.accuracy, Exact):
        return False
    if isinstance(true.value, bool):
        return answer != str(true.value).lower()
    if not isinstance(true.value, int | Fraction | float):
        return False
    if answer in ("true", "false"):
        return not isnan(true.value)  # no strategy satisfies the bounds of an objective
    theirs: float | Fraction = inf if "inf" in answer else Fraction(answer)
    return theirs != true.value


def run(seed: str, storm: Storm | None, folder: Path) -> dict[str, object]:
    """Check one model; the line of the log."""
    started = time.perf_counter()
    text, formulas = random_case(seed)
    rng = Random(f"{seed} options")
    engines = rng.sample(ENGINES, rng.choice((2,) * 7 + (4,)))
    chosen = {name: rng.choice(VARIANTS) for name in engines}
    seconds = rng.choice(PATIENCE)
    parsed = symcheck.Model(symcheck.parse_model(text), {}, symcheck.Options())
    models = {n: parsed.with_options(engine=n, **options) for n, options in chosen.items()}
    exact = parsed.with_options(exact=True)
    words: Counter[str] = Counter()
    found: list[str] = []
    for i, formula in enumerate(formulas):
        file = symcheck.parse_properties(formula)
        true = outcome(exact, file, seconds)
        outcomes: dict[str, Outcome] = {}
        for name, model in models.items():
            outcomes[name] = outcome(model, file, seconds)
            if isinstance(outcomes[name], TimeLimitError):
                break  # it is as long on the others
        words["exact " + word(true)] += 1
        source = "rationals"
        if isinstance(true, UnsupportedError) and text.startswith("ctmc"):
            true, source = by_exponentials(exact, formula, seconds), "exponentials"
        reference = true
        if isinstance(true, SILENT):
            reference = next((o for o in outcomes.values() if isinstance(o, Result)), true)
        kinds = {}
        for name, one in outcomes.items():
            words[f"{name} {word(one)}"] += 1
            if one is not reference and not isinstance(one, SILENT):
                words["compared with " + (source if reference is true else "an engine")] += 1
            kind = difference(one, reference)
            if re.search(r" [-+] ", formula) and kind in ("wide", "outside"):
                kind = "" if cancelled(one, reference) else kind
            if kind == "error" and chosen[name].keys() & {"stop_at_targets", "truncate"}:
                continue  # the fault may lie in a state that is not explored
            if kind:
                kinds[name] = kind
        answers = {f"{n} {chosen[n]}": said(o) for n, o in outcomes.items()}
        if storm is not None and isinstance(true, Result) and storm_agrees(exact, formula):
            answer = storm(text, formula)
            words["storm " + ("answer" if answer else "none")] += 1
            answers["storm"] = answer
            if storm_differs(answer, true):
                kinds["storm"] = "differs"
        if kinds:
            found.append(f"{i}: {kinds}")
            write(folder, f"{seed}.{i}", text, formula, {"exact": said(true), **answers}, kinds)
    return {
        "seed": seed,
        "kind": text.split()[0],
        "checks": len(formulas),
        "outcomes": words,
        "differences": found,
        "seconds": round(time.perf_counter() - started, 3),
        "megabytes": resident(),
    }


def failed(seed: str, error: Exception) -> dict[str, object]:
    """The line of a run that this program could not compare."""
    line: dict[str, object] = dict.fromkeys(("checks", "seconds"), 0)
    found = [f"campaign: {error!r}"]
    return line | {
        "seed": seed,
        "kind": "failed",
        "outcomes": {},
        "differences": found,
        "megabytes": resident(),
    }


def resident() -> int:
    """The memory of this process, in MB."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() >> 20


def write(
    folder: Path,
    name: str,
    text: str,
    formula: str,
    answers: Mapping[str, str],
    kinds: Mapping[str, str],
) -> None:
    """Write a model and a property with the answers, and what is wrong with them."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"// {engine}: {' '.join(answer.split())}" for engine, answer in answers.items()]
    (folder / f"{name}.pm").write_text(text)
    (folder / f"{name}.props").write_text("\n".join([f"// {dict(kinds)}", *lines, formula, ""]))


class Summary:
    """The counts of a log, which is not kept."""

    def __init__(self) -> None:
        self.models, self.checks, self.seconds, self.most = 0, 0, 0.0, 0
        self.words: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.differing: list[str] = []
        self.done: set[str] = set()

    def add(self, line: Mapping[str, object]) -> None:
        """Count one line."""
        self.models += 1
        self.done.add(line["seed"])
        self.kinds[line["kind"]] += 1
        self.checks += line["checks"]
        self.words.update(line["outcomes"])
        self.seconds += line["seconds"]
        self.most = max(self.most, line["megabytes"])
        if line["differences"]:
            self.differing.append(f"  {line['seed']}: {line['differences']}")

    def __str__(self) -> str:
        compared = sum(n for word, n in self.words.items() if word.startswith("compared"))
        compared += self.words["storm answer"]
        out = [f"{self.models} models ({dict(self.kinds)}), {self.checks} properties"]
        out += [f"  {name}: {count}" for name, count in sorted(self.words.items())]
        out.append(f"{compared} comparisons, {self.seconds:.0f} seconds, at most {self.most} MB")
        out.append(f"{len(self.differing)} models with a difference")
        return "\n".join([*out, *self.differing[-50:]])


def add_arguments(parser: argparse.ArgumentParser, log: Path) -> None:
    """The arguments of each campaign that keeps a log."""
    parser.add_argument("--runs", type=int, default=100, help="models, with those of the log")
    parser.add_argument("--seconds", type=float, default=inf, help="no new model is begun after")
    parser.add_argument("--seed", default="1", help="a campaign: run I has the seed SEED-I")
    parser.add_argument("--only", metavar="SEED", help="repeat one run, and print its line")
    parser.add_argument("--log", type=Path, default=log)


def folder_of(parser: argparse.ArgumentParser, log: Path) -> Path:
    """The folder of the differences."""
    if not log.suffix:
        parser.error("the log needs an extension: differences are written into the folder without")
    return log.with_suffix("")


def continued(asked: argparse.Namespace, run: Callable[[str], dict[str, object]]) -> int:
    """Do the runs that the log does not have, and print a summary; 1 if there is a difference."""
    counts = Summary()
    if asked.log.exists():
        with asked.log.open() as log:
            for text in log:
                counts.add(json.loads(text))
    start, end, memory = time.monotonic(), time.monotonic() + asked.seconds, []
    with asked.log.open("a") as log:
        for i in range(asked.runs):
            if (seed := f"{asked.seed}-{i}") in counts.done:
                continue
            if time.monotonic() > end:
                break
            try:
                line = run(seed)
            except KeyboardInterrupt:
                break
            except Exception as error:  # a run of days goes on
                line = failed(seed, error)
            memory = [*memory[:100], line["megabytes"]]
            counts.add(line)
            if line["differences"]:
                print(f"seed {seed}: {line['differences']}", flush=True)
            log.write(json.dumps(line) + "\n")
            log.flush()
    print(counts)
    if memory:
        print(f"{memory[0]} MB after the first model, {memory[-1]} MB after the last of this start")
        print(f"{time.monotonic() - start:.0f} seconds since this start")
    return 1 if counts.differing else 0


def main() -> int:
    """Run what is left of the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    add_arguments(parser, Path("campaign.jsonl"))
    parser.add_argument(
        "--storm", type=float, default=0, metavar="SHARE", help="ask stormpy about these models"
    )
    parser.add_argument("--large", action="store_true", help="lower size thresholds")
    asked = parser.parse_args()
    storm, folder = Storm(), folder_of(parser, asked.log)
    lowered = large if asked.large else nullcontext
    if asked.only:
        with lowered(asked.only):
            line = run(asked.only, storm if asked.storm else None, folder)
        print(json.dumps(line))
        return 1 if line["differences"] else 0

    def run_one(seed: str) -> dict[str, object]:
        sampled = Random(f"{seed} storm").random() < asked.storm
        with lowered(seed):
            return run(seed, storm if sampled else None, folder)

    return continued(asked, run_one)


if __name__ == "__main__":
    sys.exit(main())
