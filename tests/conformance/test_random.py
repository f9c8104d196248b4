"""Random small models and properties: every engine against rational arithmetic."""

from __future__ import annotations

from math import isinf, isnan
from random import Random

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from generate import random_model, random_property
from symcheck.engines.registry import BUILDERS
from symcheck.errors import InputError, UnsupportedError


def agrees(low, high, true):
    """Whether the bounds hold the true value and are as near as was asked for."""
    if isnan(true) or isinf(true):
        return (isnan(low) and isnan(true)) or low == high == true
    return (
        low - 1e-11 * (1 + abs(low)) <= true <= high + 1e-11 * (1 + abs(high))
        and high - low <= 2e-6 * abs(high) + 1e-11
    )


@pytest.mark.parametrize("kind", ["dtmc", "ctmc", "mdp"])
@pytest.mark.parametrize("name", [n for n in BUILDERS if n != "exact"])
@settings(
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
@given(seed=st.integers(0, 2**20))
def test_engines_agree_with_rationals(kind, name, seed):
    rng = Random(seed)
    model = random_model(rng, kind)
    try:
        engine, exact = engine_of(model.text, name), engine_of(model.text, "exact")
    except (InputError, UnsupportedError):
        assume(False)
    assert (engine.states, engine.transitions) == (exact.states, exact.transitions)
    for _ in range(3):
        text = random_property(rng, model, timed=False)
        low, high = check_text(engine, text).values.at(engine.all)
        true = check_text(exact, text).values.at(exact.all)[0]
        for state, a, b, t in zip(exact.explored.states, low, high, true, strict=True):
            assert agrees(a, b, float(t)), (
                f"{text} in {state}: [{a}, {b}], and exactly {t}\n{model.text}"
            )
