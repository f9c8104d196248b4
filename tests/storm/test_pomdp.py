"""Bounds on partially observed models beside Storm's: both contain the value, so they overlap."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
import stormpy
import stormpy.pomdp

import symcheck
from oracles.beliefs import drawn

MODELS = Path(__file__).parents[2] / "models"


def storm_bounds(file: Path, query: str) -> tuple[float, float]:
    """What strategies of Storm attain, and the bound of its discretized beliefs, in order."""
    program = stormpy.parse_prism_program(str(file))
    formula = stormpy.parse_properties(query, program)[0]
    model = stormpy.build_model(program, [formula])
    unfolding, grid = (
        stormpy.pomdp.verify_with_belief_unfolding(model, formula, max_exploration_size=500),
        stormpy.pomdp.verify_with_belief_discretization(model, formula, resolution=3),
    )
    low, high = sorted((unfolding.value, grid.value))
    return low, high


@pytest.mark.parametrize(
    ("name", "query"),
    [
        ("tiger", 'R{"cost"}min=? [ F "open" ]'),
        ("rover", 'Pmax=? [ F "arrived" ]'),
        ("rover", 'Pmax=? [ F "lost" ]'),
        ("channels", 'R{"arrived"}max=? [ F "end" ]'),
    ],
)
def test_models(name, query):
    file = MODELS / name / f"{name}.prism"
    low, high = symcheck.load(file).check(query).bounds
    lower, upper = storm_bounds(file, query)
    assert low <= upper * (1 + 1e-5)
    assert lower <= high * (1 + 1e-5)
    assert high - low <= (upper - lower) + 1e-5  # closer together than Storm's


@pytest.mark.parametrize("seed", range(8))
def test_random_models(seed, tmp_path):
    text = drawn(Random(100 + seed)).text.replace('observable "o"', 'observable "seen"')
    file = tmp_path / "model.prism"
    file.write_text(text)
    model = symcheck.loads(text, beliefs=200)
    for query in ('Pmax=? [ F "goal" ]', 'Pmin=? [ F "goal" ]'):
        low, high = model.check(query).bounds
        lower, upper = storm_bounds(file, query)
        assert low <= upper + 1e-5
        assert lower <= high + 1e-5
