"""Models with known results, on every engine of the registry."""

from __future__ import annotations

import pytest

from checking import RESULTS, judge_file, lines_without_run
from symcheck.check.testing.expected_results import VerdictKind
from symcheck.engines.registry import BUILDERS

RUNS = [
    *(("die.pm", "die.pctl", {"k": k}) for k in "02345"),
    ("gambler.pm", "gambler.pctl", {"n": "10", "i": "3", "p": "0.5"}),
    ("gambler.pm", "gambler.pctl", {"n": "6", "i": "2", "p": "0.4"}),
    ("choices.nm", "choices.pctl", {}),
    ("queue.sm", "queue.csl", {}),
    ("many.pm", "many.pctl", {}),
    ("game.prism", "game.pctl", {}),
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


def test_every_file_of_results_is_run():
    assert {p.name for p in RESULTS.iterdir()} == {name for run in RUNS for name in run[:2]}


@pytest.mark.parametrize("properties", sorted({run[1] for run in RUNS}))
def test_every_result_line_is_compared(properties):
    runs = [(RESULTS / model, constants) for model, file, constants in RUNS if file == properties]
    assert not lines_without_run(RESULTS / properties, runs)


def test_a_result_line_that_no_run_reaches_is_found(tmp_path):
    file = tmp_path / "die.pctl"
    file.write_text("""const int k;
// RESULT (k=3): 0.75
// RESULT (k=4): 9
P=? [ F<=k s=7 ];
// RESULT: 9

P=? [ F s=7 ];
""")
    runs = [(RESULTS / "die.pm", {"k": "3"})]
    assert {line.split()[0] for line in lines_without_run(file, runs)} == {
        "die.pctl:3:",
        "die.pctl:5:",
    }
