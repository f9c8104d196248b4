"""Every model under models/ has the values that its RESULT lines tell, on every engine that claims to answer."""

from __future__ import annotations

from pathlib import Path

import pytest

from checking import lines_without_run
from symcheck.cli import main

MODELS = Path(__file__).parents[2] / "models"

# What the models leave open, by the model's file.
CONSTANTS = {
    "crowds.pm": ["TotalRuns=3,CrowdSize=5"],
    "kanban.sm": ["t=1"],
    "channels.nm": ["p=0.5,q=0.2", "p=0.9,q=0.3"],
    "multiplex.pm": ["N=4,K=1"],
    "retransmission.pm": ["N=16,MAX=2", "N=8,MAX=3"],
    "tandem.sm": ["c=5,T=1"],
    "zeroconf.pm": ["p=0.1,q=0.5"],
}
ENGINES = ["", "-ex", "-s", "-h", "-m", "-exact"]
# Rational systems of 12 642 states take a minute: two of the properties are enough.
EXACT = {"polling_stations.ma": ["-prop", "1,2"]}
# The study has tests of its own: its instances are large.
CASES = sorted(
    (model, properties)
    for properties in MODELS.glob("*/*.[pc][cs][tl]*")
    for model in properties.parent.glob(f"{properties.stem}.*")
    if model.suffix in (".pm", ".sm", ".nm", ".ma") and "injection" not in model.name
)


STUDY = {"cell_injection.pm", "cell_injection.pctl"}
HIDDEN = sorted(  # partially observed: no diagrams
    path for path in MODELS.glob("*/*.prism") if "pomdp" in path.read_text(encoding="utf-8")
)
GAMES = {
    "duel.prism": "",
    "piglet.prism": "goal=2",
    "pig.prism": "goal=100",
    "inspection.prism": "n=5,k=2",
}
ENDLESS = MODELS / "expression" / "expression.prism"  # infinitely many states
OF_OTHER_TESTS = {"README.md", "die.jani", "generate.py", "study.py"}


def test_every_file_is_run():
    files = {p.name for p in MODELS.rglob("*") if p.is_file() and "__pycache__" not in p.parts}
    others = [model.stem for model in (*HIDDEN, ENDLESS)] + [
        name.removesuffix(".prism") for name in GAMES
    ]
    of_pairs = {f"{stem}.{end}" for stem in others for end in ("prism", "props")}
    of_cases = {path.name for case in CASES for path in case}
    assert files == of_cases | of_pairs | STUDY | OF_OTHER_TESTS


@pytest.mark.parametrize(("model", "properties"), CASES, ids=lambda p: p.name)
def test_every_result_line_is_compared(model, properties):
    runs = [
        (model, dict(pair.split("=") for pair in given.split(",") if pair))
        for given in CONSTANTS.get(model.name, [""])
    ]
    assert not lines_without_run(properties, runs)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("model", "properties", "given"),
    [(*case, given) for case in CASES for given in CONSTANTS.get(case[0].name, [""])],
    ids=lambda value: value if isinstance(value, str) else value.name,
)
def test_results_are_as_published(model, properties, given, engine, capsys):
    options = ["-const", given] if given else []
    if engine == "-exact":
        options += EXACT.get(model.name, [])
    status = main(
        [str(model), str(properties), *options, *([engine] if engine else []), "-testall"]
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


@pytest.mark.parametrize("engine", [[], ["-ex"], ["-exact"]], ids=str)
@pytest.mark.parametrize("model", HIDDEN, ids=lambda p: p.name)
def test_partially_observed_models(model, engine, capsys):
    # What only bounds are known of has no exact value: listening to the tiger never ends.
    given = ["-const", "slip=0"] if model.name == "maze.prism" else []
    options = [*given, *engine, "-testall", "-timeout", "60"]
    status = main([str(model), str(model.with_suffix(".props")), *options])
    out = capsys.readouterr().out
    verdicts = [v for v in out.splitlines() if v.startswith("Testing result:")]
    wrong = [v for v in verdicts if not v.endswith("PASS")]
    endless = model.name == "tiger.prism" and engine == ["-exact"]
    assert verdicts, out
    assert endless or (status == 0 and not wrong), out
    assert all("only finitely many beliefs have exact values" in v for v in wrong), out


@pytest.mark.parametrize(
    ("game", "engine"),
    [
        *((game, engine) for game in ("duel.prism", "piglet.prism") for engine in ENGINES),
        ("pig.prism", ""),  # a million states
        *(("inspection.prism", engine) for engine in ("", "-ex")),  # concurrent
    ],
)
def test_games(game, engine, capsys):
    model = next(MODELS.glob(f"*/{game}"))
    given = ["-const", GAMES[game]] if GAMES[game] else []
    options = [*given, *([engine] if engine else []), "-testall"]
    status = main([str(model), str(model.with_suffix(".props")), *options])
    out = capsys.readouterr().out
    verdicts = [v for v in out.splitlines() if v.startswith("Testing result:")]
    assert verdicts, out
    assert (status, [v for v in verdicts if not v.endswith("PASS")]) == (0, []), out


def test_a_model_with_infinitely_many_states(capsys):
    assert main([str(ENDLESS), str(ENDLESS.with_suffix(".props")), "-truncate", "-testall"]) == 0
    assert capsys.readouterr().out.count("Testing result: PASS") == 5


def test_truncation_says_where_it_has_no_effect(capsys):
    die = MODELS / "die" / "die.pm"
    assert main([str(die), "-pf", "S=? [ d=6 ]; P=? [ F<=3 d=6 ]; P=? [ F d=6 ]", "-truncate"]) == 0
    out = capsys.readouterr().out
    assert out.count("Note: -truncate has no effect: this property needs every state") == 1
    assert "States:      13" in out
    assert main([str(die), "-pf", "P=? [ F m=6 ]; P=? [ F d=6 ]", "-truncate"]) == 1
    assert "Result: 0.1666" in capsys.readouterr().out
    main([str(die), "-truncate"])
    assert "Note: -truncate" in capsys.readouterr().out
