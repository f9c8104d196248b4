"""Multi-objective queries of random MDPs, compared with Storm's values and Pareto fronts."""

from __future__ import annotations

import re
import sys
import tempfile
from math import isfinite, isnan
from pathlib import Path
from random import Random

import numpy as np
import pytest

pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
sys.path.insert(0, str(Path(__file__).parent))

from differential import quiet

from checking import check_text, engine_of
from generate import random_model
from symcheck.errors import InputError, NumericalError, UnsupportedError

CLOSE = 2e-3
"""Storm's default accuracy of points is 1e-4."""


def storm(text: str, formula: str) -> object:
    """Storm's answer: bool, float, or the text of a Pareto front; None where it refuses."""
    import stormpy

    with quiet(), tempfile.NamedTemporaryFile("w", suffix=".prism") as file:
        file.write(text)
        file.flush()
        try:
            program = stormpy.parse_prism_program(file.name, prism_compatibility=True)
            properties = stormpy.parse_properties(formula, program)
            model = stormpy.build_model(program, properties)
            result = stormpy.model_checking(model, properties[0])
        except RuntimeError:
            return None
    if "Pareto" in type(result).__name__:
        return str(result)
    if "Qualitative" in type(result).__name__:
        return "true" in str(result)
    return float(result.get_value(model.initial_states[0]))


def halfspaces(front: str, name: str) -> list[tuple[np.ndarray, float]]:
    """The half-spaces weights · x <= bound of a part of Storm's text."""
    part = front.split(name)[1].split("Polytope with")[1]
    lines = part.splitlines()[1 : int(part.split()[0]) + 1]
    found = [re.fullmatch(r"\s*\((.*)\) \* x <= (\S+)\s*", line) for line in lines]
    return [
        (np.array([float(w) for w in f[1].split(",")]), float(f[2])) for f in found if f is not None
    ]


def objective(rng: Random, bounded: bool) -> str:
    sign = rng.choice((">=", "<=")) if bounded else rng.choice(("min=?", "max=?"))
    share = rng.choice(("0.1", "0.3", "0.5", "0.9")) if bounded else ""
    amount = rng.choice(("0.5", "1", "3")) if bounded else ""
    label = rng.choice(('"a"', '"b"'))
    averages = (f'R{{"r"}}{sign}{amount} [ LRA ]', f"LRA{sign}{share} [ {label} ]")
    return rng.choice(
        (
            f"P{sign}{share} [ F {label} ]",
            f"P{sign}{share} [ F {label} ]",
            f"P{sign}{share} [ G {label} ]",
            f'R{{"r"}}{sign.replace("max", "min")}{amount} [ F {label} ]',
            f'R{{"r"}}{sign.replace("max", "min")}{amount} [ C ]',
            f'R{{"r"}}{sign}{amount} [ C<=3 ]',
            *(() if bounded else averages),  # Storm may not end where averages are bounded
        )
    )


@pytest.mark.parametrize("asked", [0, 1, 2, 3])
def test_answers_are_storms(asked):
    compared = 0
    for seed in range(24 if asked > 1 else 16):
        rng = Random(f"multi {asked} {seed}")
        model = random_model(rng, "mdp", largest=2)
        bounded = rng.choice((1, 2)) if asked < 2 else rng.choice((0, 0, 1))
        parts = [objective(rng, False) for _ in range(asked)]
        parts += [objective(rng, True) for _ in range(bounded)]
        formula = f"multi({', '.join(parts)})"
        try:
            text = model.text
            engine = engine_of(text)
            if engine.deadlocks:  # Storm drops the rewards of these states
                text = text.replace("endmodule", "  [] true -> true;\nendmodule", 1)
                engine = engine_of(text)
            ours = check_text(engine, formula)
        except (InputError, NumericalError, UnsupportedError):
            continue
        theirs = storm(text, formula)
        if theirs is None:
            continue
        case = f"{formula}: {ours} {theirs}\n{text}"
        if theirs is False and isinstance(ours.value, float):
            assert isnan(ours.value), case  # the bounds cannot be satisfied
        elif isinstance(theirs, bool):
            assert ours.value is theirs, case
        elif isinstance(theirs, float):
            if isnan(ours.value) or not isfinite(theirs):
                continue
            assert ours.value == pytest.approx(theirs, abs=CLOSE, rel=CLOSE), case
        else:
            for name in ("Underapproximation", "Overapproximation"):
                for weights, bound in halfspaces(theirs, name):
                    for point in ours.value:
                        scale = CLOSE * max(1, np.abs(np.array(point)).max())
                        assert weights @ np.array(point) <= bound + scale, case
            points = theirs.split("points found:")[1]
            for numbers in re.findall(r"\(([^()]*)\)", points):
                point = np.array([float(x) for x in numbers.split(",")])
                for h in ours.front.halfspaces:
                    scale = CLOSE * max(1, np.abs(point).max())
                    assert np.array(h.weights) @ point <= h.bound + scale, case
        compared += 1
    assert compared >= 5
