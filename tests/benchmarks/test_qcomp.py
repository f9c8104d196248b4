"""The benchmark set beside peers: tasks, verdicts, resumption and summary, on a tiny folder."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import qcomp

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
COIN = "dtmc const int N; module m x : [0..N]; [] x=0 -> 1/2 : (x'=1) + 1/2 : true; endmodule"
PROPERTIES = '"one": P=? [ F<=1 x=1 ]; "sure": P>=1 [ F x=1 ]; "unknown": P=? [ F<=2 x=1 ];'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    family = tmp_path / "set" / "dtmc" / "coin"
    family.mkdir(parents=True)
    (family / "coin.prism").write_text(COIN)
    (family / "coin.props").write_text(PROPERTIES)
    files = {"model": "coin.prism", "props": "coin.props", "constants": {"N": 1}, "states": [2]}
    results = {"one": {"approx": 0.5, "exact": "1/2"}, "sure": True}
    instances = [{**files, "results": results}]
    reference = {"name": "Coin", "type": "dtmc", "instances": instances}
    (family / "reference.json").write_text(json.dumps(reference))
    return tmp_path / "set"


def test_every_property_of_each_instance_is_a_task(folder: Path) -> None:
    tasks = qcomp.tasks(folder)
    assert [(t.name, t.states, t.reference) for t in tasks] == [
        ("coin: coin N=1: one", 2, 0.5),
        ("coin: coin N=1: sure", 2, True),
        ("coin: coin N=1: unknown", 2, None),
    ]


def test_runs_are_measured_once_and_summarised(folder: Path) -> None:
    out = folder / "measured.jsonl"
    words = [str(folder), "--out", str(out), "--tools", "symcheck", "--only", "one", "sure"]
    qcomp.main(words)
    rows = qcomp.read(out)
    assert [(r["verdict"], r["value"], r["states"]) for r in rows] == [
        ("right", "0.5", 2),
        ("right", "true", 2),
    ]
    assert all(r["megabytes"] > 10 and r["processor"] > 0 for r in rows)
    out.write_text(out.read_text() + '{"task": "cut o')  # as if the run had been killed
    qcomp.main([*words, "unknown"])
    assert [r["verdict"] for r in qcomp.read(out)] == ["right", "right", "no reference"]
    assert qcomp.read(out)[:2] == rows
    assert "| symcheck | 3 | 3 | 2 | 0 | 1 | 0 | 0 | 0 | 0 |" in out.with_suffix(".md").read_text()
    assert out.with_suffix(".png").stat().st_size > 1000


def test_a_limit_is_kept_and_larger_instances_are_left_out(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(qcomp, "command", lambda *_: [sys.executable, "-c", "while True: pass"])
    row = qcomp.run(qcomp.tasks(folder)[0], "symcheck", 1, 8000)
    assert (row.ended, row.verdict) == ("time", "none")
    out = folder / "measured.jsonl"
    family = folder / "dtmc" / "coin" / "reference.json"
    data = json.loads(family.read_text())
    data["instances"].append({**data["instances"][0], "constants": {"N": 2}, "states": [3]})
    family.write_text(json.dumps(data))
    words = [str(folder), "--out", str(out), "--tools", "symcheck", "--only", "one"]
    qcomp.main([*words, "--limit", "1", "--skip-larger"])
    assert [(r["task"], r["ended"]) for r in qcomp.read(out)] == [("coin: coin N=1: one", "time")]


@pytest.mark.parametrize(
    ("value", "reference", "verdict"),
    [
        ("0.5", 0.5, "right"),
        ("0.500001", 0.5, "right"),
        ("0.5001", 0.5, "inaccurate"),
        ("0.51", 0.5, "wrong"),
        ("[0,1]", 0.5, "wrong"),
        ("Infinity", float("inf"), "right"),
        ("False", False, "right"),
        ("true", False, "wrong"),
        ("0.5", None, "no reference"),
    ],
)
def test_results_are_compared_with_the_reference(
    value: str, reference: float | bool | None, verdict: str
) -> None:
    assert qcomp.verdict(value, reference) == verdict
