"""Models with known results, on every engine of the registry."""

from __future__ import annotations

import pytest

from checking import RESULTS, judge_file
from symcheck.check.testing.expected_results import VerdictKind
from symcheck.engines.registry import BUILDERS

RUNS = [
    ("die.pm", "die.pctl", {"k": "0"}),
    ("die.pm", "die.pctl", {"k": "3"}),
    ("die.pm", "die.pctl", {"k": "5"}),
    ("gambler.pm", "gambler.pctl", {"n": "10", "i": "3", "p": "0.5"}),
    ("gambler.pm", "gambler.pctl", {"n": "6", "i": "2", "p": "0.4"}),
    ("choices.nm", "choices.pctl", {}),
    ("queue.sm", "queue.csl", {}),
    ("many.pm", "many.pctl", {}),
]


@pytest.mark.parametrize("engine", BUILDERS)
@pytest.mark.parametrize(
    ("model", "properties", "constants"), RUNS, ids=lambda v: str(v) if isinstance(v, dict) else v
)
def test_known_results(model, properties, constants, engine):
    checked = judge_file(RESULTS / model, RESULTS / properties, constants, engine)
    assert any(c.verdict.kind is VerdictKind.PASS for c in checked)
    # What has no rational value is refused by the exact engine, with a reason.
    accepted = (
        {VerdictKind.PASS, VerdictKind.UNSUPPORTED} if engine == "exact" else {VerdictKind.PASS}
    )
    wrong = [f"{c.text}: {c.verdict}" for c in checked if c.verdict.kind not in accepted]
    assert not wrong
