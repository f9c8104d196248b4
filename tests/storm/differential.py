"""Random models and properties against Storm.

`python tests/storm/differential.py 2000` runs that many cases and prints every difference; the tests run a few hundred.
Where the two differ, rational arithmetic decides (for a time-bounded property of a CTMC, a matrix exponential). Known
faults of Storm are named in `storm_is_wrong`, each with the reason.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import tempfile
from dataclasses import dataclass
from math import isinf, isnan
from pathlib import Path
from random import Random

import numpy as np
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).parents[1]))

from checking import check_text, engine_of
from generate import Generated, random_model, random_property
from symcheck.check.result import Certified, Result
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import InputError, UnsupportedError
from symcheck.semantics.rewards import Structure

__all__ = ["KINDS", "Comparison", "compare"]

KINDS = ("dtmc", "ctmc", "mdp")


@dataclass(frozen=True)
class Comparison:
    """How one case ended. `outcome`: 'same', 'refused' by one of the two, 'storm' (known to be wrong), or 'different'."""

    outcome: str
    model: Generated
    formula: str
    ours: object = None
    theirs: object = None


def compare(seed: int, kind: str, engine: str = "auto") -> Comparison:
    """One random model with one random property."""
    rng = Random(f"{kind}{seed}")
    model = random_model(rng, kind)
    formula = random_property(rng, model)
    try:
        ours = check_text(engine_of(model.text, engine), formula)
    except (InputError, UnsupportedError) as error:
        return Comparison("refused", model, formula, error)
    theirs = storm(model.text, formula)
    if theirs is None:
        return Comparison("refused", model, formula, ours.value)
    if agree(ours, theirs):
        return Comparison("same", model, formula, ours.value, theirs)
    outcome = "storm" if storm_is_wrong(model, formula, ours) else "different"
    return Comparison(outcome, model, formula, ours.value, theirs)


def agree(ours: Result, theirs: float) -> bool:
    """Whether Storm's value is ours, within the accuracy that was asked of both."""
    low, high = (
        (ours.accuracy.lower, ours.accuracy.upper)
        if isinstance(ours.accuracy, Certified)
        else (ours.value, ours.value)
    )
    low, high = float(low), float(high)
    if isnan(low) or isnan(theirs) or isinf(low) or isinf(theirs):
        return (isnan(low) and isnan(theirs)) or low == high == theirs
    return low - 1e-6 - 1e-5 * abs(theirs) <= theirs <= high + 1e-6 + 1e-5 * abs(theirs)


def storm_is_wrong(model: Generated, formula: str, ours: Result) -> bool:
    """Whether an arbiter takes our side: rational arithmetic, or matrix exponentials where a property is timed.

    Storm drops the rewards of deadlock states, gives R [ I=t ] of a CTMC at another time, and does not ask that the left
    side of an until holds before a positive lower bound.
    """
    try:
        return agree(ours, float(check_text(engine_of(model.text, "exact"), formula).value))
    except UnsupportedError:
        true = by_exponentials(engine_of(model.text), formula)
        return true is not None and agree(ours, true)
    except InputError:
        return False


def by_exponentials(engine: ExplicitEngine, formula: str) -> float | None:
    """A timed property of a CTMC by matrix exponentials; None for a form that this does not know."""
    found = re.fullmatch(
        r"P=\? \[ (.*) U(=|\[)([\d.]+)(?:,([\d.]+)\])? (.*) \]|R\{.*\}=\? \[ (C<|I)=([\d.]+) \]",
        formula,
    )
    if found is None:
        return None
    left, _, lower, upper, right, kind, time = found.groups()
    rates = np.zeros((engine.states, engine.states))
    np.add.at(
        rates,
        (
            np.repeat(np.arange(engine.states), np.diff(engine.weights.indptr)),
            engine.weights.indices,
        ),
        engine.weights.data,
    )
    q = rates - np.diag(rates.sum(axis=1))
    if kind is not None:
        states, rows = engine.rewards(Structure(0))
        larger = np.block([[q, (states + rows)[:, None]], [np.zeros((1, engine.states + 1))]])
        values = (
            expm(q * float(time)) @ states if kind == "I" else expm(larger * float(time))[:-1, -1]
        )
    else:
        stay, goal = (check_text(engine, text).satisfying.mask for text in (left, right))
        low, high = float(lower), float(upper or lower)
        values = expm(np.where((stay & ~goal)[:, None], q, 0) * (high - low)) @ goal.astype(float)
        values = np.where(
            stay, expm(np.where(stay[:, None], q, 0) * low) @ np.where(stay, values, 0), 0
        )
    return float(values[engine.initial.members][0])


def storm(text: str, formula: str) -> float | None:
    """Storm's value in the initial state by its sparse engine; None where it refuses."""
    import stormpy

    with quiet(), tempfile.NamedTemporaryFile("w", suffix=".prism") as file:
        file.write(text)
        file.flush()
        try:
            program = stormpy.parse_prism_program(file.name, prism_compatibility=True)
            properties = stormpy.parse_properties(formula, program)
            model = stormpy.build_model(program, properties)
            environment = stormpy.Environment()
            for solver in (environment.solver().min_max(), environment.solver().native()):
                solver.precision = stormpy.Rational("1/1000000000")
            result = stormpy.model_checking(model, properties[0], environment=environment)
            return float(result.get_value(model.initial_states[0]))
        except RuntimeError:
            return None


@contextlib.contextmanager
def quiet():
    """Storm writes its complaints to the file descriptors themselves."""
    sys.stdout.flush()
    kept = os.dup(1), os.dup(2)
    with open(os.devnull, "w") as nothing:
        try:
            os.dup2(nothing.fileno(), 1)
            os.dup2(nothing.fileno(), 2)
            yield
        finally:
            os.dup2(kept[0], 1)
            os.dup2(kept[1], 2)
            for descriptor in kept:
                os.close(descriptor)


def main() -> int:
    """Run as many cases as the command line says; the exit status tells whether there were differences."""
    counts: dict[str, int] = {}
    for seed in range(int(sys.argv[1]) if len(sys.argv) > 1 else 200):
        for kind in KINDS:
            c = compare(seed, kind)
            counts[c.outcome] = counts.get(c.outcome, 0) + 1
            if c.outcome in ("different", "storm"):
                print(
                    f"{c.outcome}: {kind} {seed}: {c.formula}: ours {c.ours}, Storm's {c.theirs}",
                    flush=True,
                )
                if c.outcome == "different":
                    print(c.model.text, flush=True)
    print(counts)
    return 1 if counts.get("different") else 0


if __name__ == "__main__":
    sys.exit(main())
