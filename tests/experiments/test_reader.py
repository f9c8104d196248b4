"""Results are read as they were written."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from symcheck.check.result import Certified, Estimate, Exact, Statistical
from symcheck.cli import main
from symcheck.errors import UsageError
from symcheck.experiments.prism_tables import render
from symcheck.experiments.rows import Row
from symcheck.experiments.table import Experiment

ROWS = Experiment(
    (
        Row("a", {"N": 1, "value": 0.5}, 0.5, Certified(0.25, 0.75), None, 3, 4, 0.25, 0.125),
        Row("a", {"N": 2, "value": 0.5}, Fraction(1, 3), Exact()),
        Row("a", {"N": 3, "value": 0.5}, float("inf"), Estimate()),
        Row("a", {"N": 4, "value": 0.5}, 0.5, Statistical(0.99, 0.25, 0.75, 100)),
        Row(
            "a", {"N": 5, "value": 0.5}, 0.5, Statistical(0.99, 0.25, 0.75, 9, "Student's t", True)
        ),
        Row("a", {"N": 6, "value": 0.5}, 0.5, Statistical(0.99, 0.25, 0.75, 9, uniform=True)),
        Row("b", {"N": 1}, (0.25, 0.75), Exact(rounding=True)),
        Row("b", {"N": 2}, [(0.0, 1.0), (1.0, 0.5)], Exact()),
        Row("b", {"N": 3}, error='no, "such" label'),
        Row("c", {}, True, Exact()),
        Row("c", {"N": 4}, 7, Exact()),
        Row("d", {"mode": "2*N"}, [], Exact()),
        Row("d", {"up": True}, None, Exact()),
    ),
    ("N",),
)


@pytest.mark.parametrize("name", ["r.csv", "r.json"])
def test_a_table_is_read_as_it_was_written(name: str, tmp_path: Path) -> None:
    ROWS.save(tmp_path / name)
    read = Experiment.load(tmp_path / name)
    assert read.rows == ROWS.rows
    assert read.varying == ("N",)
    read.save(tmp_path / f"again.{name}")
    assert (tmp_path / name).read_text() == (tmp_path / f"again.{name}").read_text()


def test_a_data_frame_has_values_and_accuracies(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(render(ROWS.rows, ROWS.varying, ["dataframe"]))
    read = Experiment.load(tmp_path / "r.csv")
    sizes = {"states": 0, "transitions": 0, "build_seconds": 0.0, "seconds": 0.0}
    assert read[1:] == replace(ROWS[1:], varying=read.varying)
    assert replace(read[0], accuracy=None) == replace(ROWS[0], accuracy=None, **sizes)


@pytest.mark.parametrize("value", [0.123, (0.25, 0.75)])
def test_the_bounds_of_a_data_frame_enclose_those_that_were_proved(value, tmp_path: Path) -> None:
    proved = Row("a", {}, value, Certified(0.123 - 1.049e-4, 0.123 + 1.049e-4))
    (tmp_path / "r.csv").write_text(render([proved], (), ["dataframe"]))
    low, high = Experiment.load(tmp_path / "r.csv")[0].bounds or (1.0, 0.0)
    inner = proved.bounds or (0.0, 1.0)
    assert low <= inner[0] <= inner[1] <= high


def test_a_range_keeps_its_bounds(tmp_path: Path) -> None:
    row = Row("a", {}, (0.25, 0.75), Certified(0.4, 0.6))
    Experiment((row,)).save(tmp_path / "r.json")
    assert Experiment.load(tmp_path / "r.json")[0].bounds == pytest.approx((0.15, 0.85))


def test_the_data_frame_of_prism_has_estimates(tmp_path: Path) -> None:
    """PRISM writes no accuracy, and 'Error' and its reason for a value."""
    text = "Property,N,Result\np1,3,0.25\np1,4,Error: no memory\n"
    (tmp_path / "r.csv").write_text(text)
    rows = Experiment.load(tmp_path / "r.csv").rows
    assert rows == (
        Row("p1", {"N": 3}, 0.25, Estimate()),
        Row("p1", {"N": 4}, error="no memory"),
    )


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("r.csv", "N,Result\n3,0.5\n", r"r.csv:1: expected a table with the columns property"),
        ("r.csv", "", r"r.csv:1: expected a table"),
        ("r.csv", "property,value\na,1\nb\n", r"r.csv:3: expected 2 columns.*there are 1"),
        ("r.csv", "property,value\na,seven\n", r"r.csv:2: 'seven' is no value"),
        ("r.csv", "property,value\na,[1]\n", r"r.csv:2: 1 numbers in brackets"),
        ("r.csv", "property,value,states\na,1,few\n", r"r.csv:2: 'few' in the column states"),
        ("r.csv", "property,value,accuracy\na,1,certified: x\n", r"r.csv:2: 'certified: x' is no"),
        ("r.csv", "property,value,value\n", r"r.csv:1: two columns"),
        ("r.json", '[{"property": "a",\n', r"r.json:2:1: "),
        ("r.json", '{"property": "a"}', r"r.json:1: expected a list of objects"),
        (
            "r.json",
            '[{"property": "a", "value": 1},\n\n{"property": "b"}]',
            r"json:3: an object wi",
        ),
        ("r.json", '[{"property": "a",\n "value": {}}]', r"r.json:1: '{}' is no value"),
        (
            "r.json",
            '[{"property": "a", "value": 1, "N": []}]',
            r"r.json:1: '\[\]' is no value of a",
        ),
        ("r.svg", "<svg/>", r"r.svg: results are read from \.csv and \.json"),
    ],
)
def test_a_fault_names_file_and_line(name: str, text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(UsageError, match=message):
        Experiment.load(tmp_path / name)


def test_imported_results_are_written_in_another_form(tmp_path: Path, capsys) -> None:
    source, target = tmp_path / "r.csv", tmp_path / "r.json"
    ROWS.save(source)
    assert main(["-importresults", str(source), "-exportresults", str(target)]) == 0
    assert [o["property"] for o in json.loads(target.read_text())] == [r.name for r in ROWS]
    plot = tmp_path / "r.svg"
    assert main(["-importresults", str(target), "-exportresults", str(plot)]) == 0
    assert "<svg" in plot.read_text()
    capsys.readouterr()
    assert main(["-importresults", str(target)]) == 0
    assert "a:\nN\tvalue\tResult" not in (out := capsys.readouterr().out)
    assert "N\tResult\n1\t0.5\n2\t1/3\n" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["m.pm"], "m.pm has no effect: -importresults reads finished results"),
        (["-pf", "true"], "-pf has no effect: -importresults"),
        (["-test"], "-test has no effect: -importresults"),
    ],
)
def test_nothing_is_checked_beside_imported_results(words, message, tmp_path, capsys) -> None:
    ROWS.save(tmp_path / "r.csv")
    assert main([*words, "-importresults", str(tmp_path / "r.csv")]) == 2
    assert message in capsys.readouterr().err
    assert main(["-importresults", str(tmp_path / "missing.csv")]) == 2
    assert "-importresults: cannot read" in capsys.readouterr().err
