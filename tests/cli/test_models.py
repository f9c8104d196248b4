"""Every model under models/ has the values that its RESULT lines tell, on every engine that claims to answer."""

from __future__ import annotations

from pathlib import Path

import pytest

from symcheck.cli import main

MODELS = Path(__file__).parents[2] / "models"

# What the models leave open, by the model's file.
CONSTANTS = {
    "crowds.pm": "TotalRuns=3,CrowdSize=5",
    "kanban.sm": "t=1",
    "multiplex.pm": "N=4,K=1",
    "retransmission.pm": "N=16,MAX=2",
    "tandem.sm": "c=5,T=1",
}
ENGINES = ["", "-ex", "-s", "-h", "-m", "-exact"]
# The study has tests of its own: its instances are large.
CASES = sorted(
    (model, properties)
    for properties in MODELS.glob("*/*.[pc][cs][tl]*")
    for model in properties.parent.glob(f"{properties.stem}.*")
    if model.suffix in (".pm", ".sm", ".nm") and "injection" not in model.name
)


def test_the_models_are_found():
    assert {m.name for m, _ in CASES} >= {
        "die.pm",
        "crowds.pm",
        "herman7.pm",
        "queue.sm",
        "dining.nm",
        "contract.pm",
    }


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("model", "properties"), CASES, ids=lambda p: p.name)
def test_results_are_as_published(model, properties, engine, capsys):
    constants = ["-const", CONSTANTS[model.name]] if model.name in CONSTANTS else []
    status = main(
        [str(model), str(properties), *constants, *([engine] if engine else []), "-testall"]
    )
    out = capsys.readouterr().out
    verdicts = [
        line.removeprefix("Testing result: ")
        for line in out.splitlines()
        if line.startswith("Testing result:")
    ]
    assert verdicts, out
    # Rational arithmetic refuses what has no rational value, and says so; nothing else may be left unanswered.
    allowed = ("PASS", "UNSUPPORTED") if engine == "-exact" else ("PASS",)
    assert all(v.startswith(allowed) for v in verdicts), out
    assert "PASS" in verdicts
    assert status == (1 if any(v.startswith("UNSUPPORTED") for v in verdicts) else 0)
