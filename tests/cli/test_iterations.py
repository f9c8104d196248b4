"""-exportiterations: the iterations of numerical methods as files."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from symcheck.cli import main

GAMBLER = str(Path(__file__).parents[2] / "models/gambler/gambler.pm")
METHOD = ["-method", "interval", "-ex"]
REACH = "P=? [ F money=20 ]"


def written(tmp_path: Path, *words: str) -> list[dict[str, str]]:
    file = tmp_path / "i.csv"
    assert main([GAMBLER, "-pf", REACH, "-exportiterations", str(file), *words]) == 0
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_each_iteration_has_a_row(tmp_path: Path) -> None:
    rows = written(tmp_path, *METHOD)
    assert list(rows[0]) == ["run", "method", "iteration", "width", "states"]
    assert {(r["run"], r["method"]) for r in rows} == {("1", "interval iteration")}
    iterations = [int(r["iteration"]) for r in rows]
    assert iterations == sorted(set(iterations))
    widths = [float(r["width"]) for r in rows]
    assert widths[-1] < 1e-6 < widths[0]


def test_json_has_the_same_rows(tmp_path: Path) -> None:
    rows = written(tmp_path, *METHOD)
    file = tmp_path / "i.json"
    assert main([GAMBLER, "-pf", REACH, *METHOD, "-exportiterations", str(file)]) == 0
    objects = json.loads(file.read_text())
    assert [{n: str(v) for n, v in o.items()} for o in objects] == rows


def test_each_property_has_its_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    two = f'"win": {REACH}; "lose": P=? [ F money=0 ]; "sure": P=? [ F true ]'
    file = str(tmp_path / "i.csv")
    assert main([GAMBLER, "-pf", two, *METHOD, "-exportiterations", file]) == 0
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["i_property=lose.csv", "i_property=win.csv"]
    assert "this property was checked without iterations" in capsys.readouterr().out


def test_the_iterations_until_their_limit_are_written(tmp_path: Path) -> None:
    file = tmp_path / "i.csv"
    words = [*METHOD, "-maxiters", "5", "-exportiterations", str(file)]
    assert main([GAMBLER, "-pf", REACH, *words]) == 0
    assert len(file.read_text().splitlines()) == 6


def test_the_value_is_the_same_with_and_without(tmp_path, capsys) -> None:
    def results(*words: str) -> list[str]:
        assert main([GAMBLER, "-pf", REACH, *words]) == 0
        lines = capsys.readouterr().out.splitlines()
        return [line for line in lines if line.startswith("Result")]

    for engine in ("-ex", "-s", "-h", "-m"):
        file = ("-exportiterations", str(tmp_path / "i.csv"))
        assert results(engine, *METHOD[:2]) == results(engine, *METHOD[:2], *file)
