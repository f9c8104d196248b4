"""Temporal operators nested within path formulas without extra brackets, read and valued as Storm does."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
sys.path.insert(0, str(Path(__file__).parent))

from differential import KINDS, agree, storm

from checking import check_text, engine_of
from generate import random_model

ATOMS = ('"a"', '"b"', '!"a"', '"init"')


def chained(rng: Random, depth: int) -> str:
    """Atoms joined by one operator; the last part may begin with a temporal operator.

    A chain has one operator only, because Storm reads `x | y & F z` as `(x | y) & F z`.
    """
    operator = rng.choice((" & ", " | "))
    parts = [rng.choice(ATOMS) for _ in range(rng.choice((0, 1, 1, 2)))]
    last = prefixed(rng, depth - 1) if depth else rng.choice(ATOMS)
    return operator.join((*parts, last))


def prefixed(rng: Random, depth: int) -> str:
    """A formula that begins with X, F, G or !, with or without brackets."""
    inner = chained(rng, depth)
    sign = rng.choice(("X ", "F ", "G ", "F ", "G ", "!F ", "!X "))
    return sign + (f"({inner})" if rng.random() < 0.5 else inner)


def path_formula(rng: Random) -> str:
    match rng.randrange(3):
        case 0:
            return prefixed(rng, 2)
        case 1:
            return chained(rng, 2)
        case _:
            return f"{chained(rng, 1)} U {chained(rng, 1)}"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ["auto", "hybrid"])
def test_values_are_storms(kind, engine):
    compared = 0
    for seed in range(25):
        rng = Random(f"path {kind} {seed}")
        model = random_model(rng, kind)
        direction = rng.choice(("min", "max")) if kind == "mdp" else ""
        formula = f"P{direction}=? [ {path_formula(rng)} ]"
        theirs = storm(model.text, formula)
        if theirs is None:
            continue
        ours = check_text(engine_of(model.text, engine), formula)
        assert agree(ours, theirs), f"{formula}: {ours} {theirs}\n{model.text}"
        compared += 1
    assert compared >= 20
