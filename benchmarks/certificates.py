"""Check that certificates are accepted, and that no changed one is accepted that states a lie.

python benchmarks/certificates.py [--runs N] [--mutants M] [--seed S]

Each run draws a model and a property, writes its certificate, and has it checked; then M changes
of the certificate. What is accepted has to be true by oracles that share no code with symcheck.
Prints how many were accepted (a looser bound is still true) and rejected, and each lie.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
from collections import Counter
from fractions import Fraction
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

import symcheck
from symcheck.errors import InputError

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "verify"))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from symcheck_verify import Model, Rejected, check, read_model

from oracles.statements import Drawn, UnknownError, draw, truth

READ_ERRORS = (ValueError, LookupError, TypeError, ArithmeticError, AttributeError)


def written(drawn: Drawn, folder: Path) -> tuple[Model, dict[str, Any]]:
    """The certificate of a property as the checker reads it, and the model."""
    model = symcheck.loads(drawn.text, strategy=drawn.kind == "mdp")
    file = folder / "proof.json"
    symcheck.save_certificate(model.check(drawn.formula).certificate(), file)
    certificate = json.loads(file.read_text())
    return read_model(file.with_suffix(".tra"), drawn.kind, "rational"), certificate


def is_true(model: Model, statement: dict[str, Any]) -> bool:
    """Whether what a statement says of each of its states is so, by the oracles."""
    about = {k: v for k, v in statement.items() if k not in ("bounds", "comparison")}
    values = _truth((json.dumps(model.digests), json.dumps(about)), model, about)
    verdicts = set()
    for state, (low, high) in statement["bounds"].items():
        least, most = values[int(state)]
        if not (_number(low) <= least and most <= _number(high)):
            return False
        if given := statement.get("comparison"):
            threshold, operator = Fraction(given["threshold"]), given["operator"]
            verdicts.add(
                {"<": most < threshold, "<=": most <= threshold,
                 ">": least > threshold, ">=": least >= threshold}[operator]
            )  # fmt: skip
    return "comparison" not in statement or (verdicts == {True}) is statement["comparison"]["holds"]


_KNOWN: dict[tuple[str, str], Any] = {}


def _truth(key: tuple[str, str], model: Model, about: dict[str, Any]) -> Any:
    if key not in _KNOWN:
        _KNOWN[key] = truth(model, about)
    return _KNOWN[key]


def _number(text: str) -> Fraction | float:
    return float("inf") if text == "Infinity" else Fraction(text)


def mutant(certificate: dict[str, Any], rng: Random) -> dict[str, Any]:
    """The certificate with one to three changes of numbers, choices, ranks, automata or the
    statement.
    """
    changed = copy.deepcopy(certificate)
    for _ in range(rng.randint(1, 3)):
        lists = list(_lists(changed["evidence"]))
        if lists and rng.random() < 0.15:
            chosen = rng.choice(lists)
            if rng.random() < 0.5:
                chosen.pop(rng.randrange(len(chosen)))
            else:
                chosen.insert(rng.randrange(len(chosen)), copy.deepcopy(rng.choice(chosen)))
            continue
        places = list(_leaves({k: changed[k] for k in ("statement", "evidence")}, ()))
        path, value = rng.choice(places)
        inside: Any = changed
        for key in path[:-1]:
            inside = inside[key]
        inside[path[-1]] = _other(path, value, rng)
    return changed


def _leaves(data: Any, path: tuple[Any, ...]) -> Any:
    """The numbers, names and nulls within a certificate, with their places."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        if isinstance(value, dict | list):
            yield from _leaves(value, (*path, key))
        else:
            yield (*path, key), value


def _lists(data: Any) -> Any:
    """The lists within evidence that have members."""
    if isinstance(data, list) and data:
        yield data
    for part in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from _lists(part)


def wrong_model(drawn: Drawn, certificate: dict[str, Any], folder: Path, rng: Random) -> Model:
    """Another model, which the certificate says that it is about: a transition leads elsewhere.

    Raises Rejected: this is no model.
    """
    (folder / "other").mkdir(exist_ok=True)
    for file in folder.glob("proof*"):
        if file.suffix != ".json":
            (folder / "other" / file.name).write_text(file.read_text())
    file = folder / "other" / "proof.tra"
    lines = [line.split() for line in file.read_text().splitlines() if line[0] != "#"]
    changed = rng.choice(lines[1:])
    changed[2 if drawn.kind == "mdp" else 1] = str(rng.randrange(int(lines[0][0])))
    file.write_text("".join(" ".join(line) + "\n" for line in lines))
    model = read_model(file, drawn.kind, "rational")
    certificate["model"]["sha256"] = model.digests
    return model


def _other(path: tuple[Any, ...], value: Any, rng: Random) -> Any:
    if path[-1] == "optimum":
        return rng.choice(("min", "max")) if value else None
    if path[-1] in ("label", "left", "right", "target", "states"):
        return rng.choice(("goal", "free", "init")) if path[-1] == "label" else "all"
    if isinstance(value, bool):
        return not value
    if path[-1] in ("time", "factor", "least", "most"):
        return str(Fraction(value) * Fraction(rng.choice((1, 2, 3)), 2))
    if value is None or rng.random() < 0.05:
        return rng.choice((0, 1, None))
    if isinstance(value, int):
        steps = (-2, -1, 1, 2, value // 2 + 1, -(value // 3) - 1, -value // 10**6, value // 10**6)
        return value + rng.choice(steps)
    if path[1:2] == ("bounds",):
        scale = Fraction(rng.choice((1, -1)), rng.choice((2, 100, 10**6, 10**9)))
        base = Fraction(0) if value == "Infinity" else Fraction(value)
        return str(base * (1 + scale)) if rng.random() < 0.9 else "Infinity"
    if path[-1] == "denominator":
        return str(int(value) * rng.choice((2, 3)))
    return value


def attack(
    drawn: Drawn, rng: Random, mutants: int, folder: Path, counts: Counter[str]
) -> list[str]:
    """What is wrong with the certificate of a property and its changes, as sentences."""
    model, certificate = written(drawn, folder)
    faults, kind = [], _kind(certificate["statement"])
    try:
        check(model, certificate)
        counts["accepted"] += 1
        counts[f"{kind}: accepted"] += 1
    except Rejected as error:
        faults.append(f"rejected: {error}")
    try:
        if not is_true(model, certificate["statement"]):
            faults.append("the certificate itself is not true")
    except UnknownError:
        counts["certificates that the oracle does not know"] += 1
    for _ in range(mutants):
        counts[f"{kind}: mutants"] += 1
        about, changed = model, copy.deepcopy(certificate)
        try:
            if rng.random() < 0.2:
                about = wrong_model(drawn, changed, folder, rng)
            else:
                changed = mutant(certificate, rng)
            said = check(about, changed)
        except Rejected:
            counts["mutants rejected"] += 1
            continue
        except READ_ERRORS:
            counts["mutants that cannot be read"] += 1
            continue
        if any("trusted" in line for line in said):
            faults.append("an automaton is trusted")
        try:
            true = is_true(about, changed["statement"])
        except UnknownError:
            counts["mutants accepted, and not known to the oracle"] += 1
            continue
        if true:
            counts["mutants accepted, and true"] += 1
        else:
            faults.append(f"a lie is accepted: {json.dumps(changed)}")
    return faults


def _kind(statement: dict[str, Any]) -> str:
    """The measure of a statement, with its bounds."""
    bounds = sorted({"steps", "time", "least", "most", "factor", "states"} & statement.keys())
    return " ".join([statement["measure"], *bounds])


def main() -> int:
    """Run the campaign; the exit status is 1 if something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=500)
    parser.add_argument("--mutants", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    counts, wrong = Counter[str](), 0
    with TemporaryDirectory() as folder:
        for seed in range(given.seed, given.seed + given.runs):
            drawn = draw(seed)
            faults: list[str] = []
            try:
                for file in Path(folder).rglob("proof*"):
                    file.unlink()
                faults = attack(drawn, Random(seed), given.mutants, Path(folder), counts)
            except InputError:
                counts["conditions that are impossible"] += 1
            except symcheck.SymcheckError as error:
                faults = [f"no certificate: {error}"]
            wrong += bool(faults)
            for fault in faults:
                print(f"{seed}: {drawn.formula}\n{drawn.text}{fault}\n", flush=True)
    for name, count in sorted(counts.items()):
        print(f"{count:8,} {name}")
    print(f"{wrong} runs with a fault")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
