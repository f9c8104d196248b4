"""A few hundred random cases against Storm; `differential.py` beside this file runs as many as one likes."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
sys.path.insert(0, str(Path(__file__).parent))

from differential import KINDS, compare


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ["auto", "hybrid"])
def test_values_are_storms(kind, engine):
    outcomes = [compare(seed, kind, engine) for seed in range(1000, 1060)]
    different = [
        f"{c.formula}: ours {c.ours}, Storm's {c.theirs}\n{c.model.text}"
        for c in outcomes
        if c.outcome == "different"
    ]
    assert not different, "\n".join(different)
    assert Counter(c.outcome for c in outcomes)["same"] >= 30
