"""Tables and plots of experiments."""

from __future__ import annotations

import json
import sys
from fractions import Fraction
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas
import pytest

import symcheck
from symcheck.check.result import Certified, Estimate, Exact
from symcheck.errors import UnsupportedError, UsageError
from symcheck.experiments.rows import Row
from symcheck.experiments.table import Experiment

DIE = Path(__file__).parents[2] / "models" / "die" / "die.pm"
mpl.use("Agg")


@pytest.fixture(scope="module")
def die() -> Experiment:
    return symcheck.experiment(DIE, 'const int k; "face": P=? [ F d=k ]; P>0 [ F d=k ]', "k=5:7")


MIXED = Experiment(
    (
        Row("a", {"N": 1, "value": 2}, 0.5, Certified(0.25, 0.75), states=3),
        Row("a", {"N": 2, "value": 2}, Fraction(1, 3), Exact()),
        Row("a", {"N": 3, "value": 2}, float("inf"), Estimate()),
        Row("b", {"N": 1}, (0.25, 0.75), Exact()),
        Row("b", {"N": 2}, [(0.0, 1.0)], Exact()),
        Row("b", {"N": 3}, error="no <such> label"),
    ),
    ("N",),
)


def test_a_data_frame(die: Experiment) -> None:
    frame = die.to_frame()
    assert die.to_pandas().equals(frame)
    assert list(frame.columns) == [
        *("property", "k", "value", "lower", "upper", "accuracy"),
        *("states", "transitions", "build_seconds", "seconds", "error"),
    ]
    faces = frame[frame.property == "face"]
    assert faces.k.dtype == np.int64
    assert list(faces.value) == pytest.approx([1 / 6, 1 / 6, 0])
    assert list(faces.lower) == pytest.approx(list(faces.upper))


def test_tables_as_files(tmp_path: Path) -> None:
    for name in ("x.csv", "x.json", "x.parquet"):
        MIXED.save(tmp_path / name)
    assert (tmp_path / "x.csv").read_text().splitlines()[:5] == [
        "property,N,constant value,value,lower,upper,accuracy,states,transitions,build_seconds,seconds,error",
        "a,1,2,0.5,0.25,0.75,certified: +/- 2.5E-01,3,0,0.0,0.0,",
        "a,2,2,1/3,0.3333333333333333,0.33333333333333337,exact,0,0,0.0,0.0,",
        "a,3,2,Infinity,,,estimate,0,0,0.0,0.0,",
        'b,1,,"[0.25,0.75]",0.25,0.75,exact,0,0,0.0,0.0,',
    ]
    objects = json.loads((tmp_path / "x.json").read_text(), parse_constant=pytest.fail)
    values = [0.5, "1/3", "Infinity", [0.25, 0.75], [[0.0, 1.0]], None]
    assert [o["value"] for o in objects] == values
    assert objects[5]["error"] == "no <such> label"
    frame = pandas.read_parquet(tmp_path / "x.parquet")
    assert frame["N"].tolist() == [1, 2, 3, 1, 2, 3]
    assert frame["lower"].tolist()[:2] == [0.25, 1 / 3]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.csv", "x.json", "x.parquet"]


def test_parquet_has_numbers_where_all_values_are(die: Experiment, tmp_path: Path) -> None:
    die.save(tmp_path / "die.parquet")
    values = pandas.read_parquet(tmp_path / "die.parquet")["value"]
    assert sorted(values) == pytest.approx([0, 0, 1 / 6, 1 / 6, 1, 1])


@pytest.mark.parametrize(
    ("kind", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")]
)
def test_plots_as_files(kind: str, start: bytes, die: Experiment, tmp_path: Path) -> None:
    die.save(tmp_path / f"die.{kind}")
    assert (tmp_path / f"die.{kind}").read_bytes().startswith(start)
    assert len(list(tmp_path.iterdir())) == 1


def labels(axes) -> list[str]:
    return [line.get_label() for line in axes.lines if not line.get_label().startswith("_")]


def test_a_plot_has_a_line_for_each_property(die: Experiment) -> None:
    axes = die.select("face").plot()
    (line,) = axes.lines
    assert line.get_xydata() == pytest.approx(np.array([[5, 1 / 6], [6, 1 / 6], [7, 0]]))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("k", "face")
    again = die.plot()
    assert die.plot(axes=again) is again
    assert [t.get_text() for t in again.get_legend().get_texts()][:2] == ["face", "P>0 [ F d=k ]"]


def test_rewards_have_an_axis_of_their_own() -> None:
    rows = [
        Row(name, {"N": n}, value, Exact(), formula=formula)
        for n in (1, 2)
        for name, value, formula in (("p", n / 4, "P=? [ F x=N ]"), ("r", 9.0 * n, "R=? [ F x=N ]"))
    ]
    left = Experiment(tuple(rows), ("N",)).plot()
    right = next(a for a in left.figure.axes if a is not left)
    assert (labels(left), labels(right)) == (["p"], ["r"])
    assert left.lines[0].get_color() != right.lines[0].get_color()
    legend = right.get_legend()
    assert [t.get_text() for t in legend.get_texts()] == ["p", "r"]
    left.figure.draw_without_rendering()
    assert legend.get_window_extent().y1 < left.get_window_extent().y0  # it hides no line


def test_lines_by_a_constant_and_bounds() -> None:
    rows = [
        Row("a", {"N": n, "p": p}, n * p, Certified(n * p - 0.1, n * p + 0.1))
        for n in (3, 1, 2)
        for p in (0.5, 1.0)
    ]
    experiment = Experiment(tuple(rows), ("N", "p"))
    axes = experiment.plot(x="N", by="p")
    assert labels(axes) == ["p=0.5", "p=1.0"]
    assert list(axes.lines[0].get_xdata()) == [1, 2, 3]
    bars = axes.collections[0].get_segments()
    assert bars[0].tolist() == [[1, pytest.approx(0.4)], [1, pytest.approx(0.6)]]
    many = [Row("a", {"N": n}, float(n), Certified(n - 1, n + 1)) for n in range(50)]
    band = Experiment(tuple(many), ("N",)).plot()
    assert band.collections[0].get_paths()[0].vertices[:, 1].max() == 50
    assert labels(experiment.plot(x="p")) == ["N=3", "N=1", "N=2"]


def test_plots_of_what_is_no_number() -> None:
    assert labels(MIXED.plot()) == ["a", "b"]
    names = Experiment((Row("a", {}, True, Exact()), Row("b", {}, 2, Exact()))).plot()
    assert [t.get_text() for t in names.get_xticklabels()] == ["a", "b"]


def test_faults_of_plots() -> None:
    rows = tuple(Row("a", {"N": n, "p": p}, 1, Exact()) for n in (1, 2) for p in (1, 2))
    experiment = Experiment(rows, ("N", "p"))
    with pytest.raises(UsageError, match="no constant 'M'; the constants are N, p"):
        experiment.plot(x="M")
    with pytest.raises(UsageError, match="p has several values too"):
        experiment.plot(x="N", by=())


def test_faults_of_files(die: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UsageError, match=r"none of \.csv, \.json"):
        die.save(tmp_path / "x.xls")
    with pytest.raises(UsageError, match="cannot write"):
        die.save(tmp_path / "missing" / "x.csv")
    for name in ("matplotlib", "pandas", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(UnsupportedError, match=r"needs pyarrow.*\n.*'symcheck\[frames\]'"):
        die.save(tmp_path / "x.parquet")
    with pytest.raises(UnsupportedError, match=r"needs matplotlib.*\n.*'symcheck\[plot\]'"):
        die.save(tmp_path / "x.png")
    with pytest.raises(UnsupportedError, match=r"needs pandas.*\n.*'symcheck\[frames\]'"):
        die.to_frame()
    assert list(tmp_path.iterdir()) == []


def test_a_notebook_shows_a_table() -> None:
    text = MIXED._repr_html_()
    assert text.startswith("<table><tr><th>property</th><th>N</th><th>value</th><th>value</th>")
    assert "<td>no &lt;such&gt; label</td>" in text
    assert repr(MIXED) == "<Experiment: 6 rows, 1 error>"


def test_ticks_of_whole_numbers_are_whole_numbers() -> None:
    rows = symcheck.experiment(
        symcheck.loads("dtmc const int N; module m x : [0..N]; [] x<N -> (x'=x+1); endmodule"),
        "T=? [ F x=N ]",
        "N=3:5",
    )
    ticks = rows.plot().get_xticks()
    assert all(tick == round(tick) for tick in ticks)
