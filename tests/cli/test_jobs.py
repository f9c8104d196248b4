"""-jobs gives the output of one process; -exportresults writes by the extension of the file."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
from multiprocessing import active_children
from pathlib import Path

import pytest

from symcheck.cli import main
from symcheck.parallel.workers import Lost, Workers

ROOT = Path(__file__).parents[2]
DIE = str(ROOT / "models" / "die" / "die.pm")
CROWDS = [str(ROOT / "models" / "crowds" / f"crowds.{ending}") for ending in ("pm", "pctl")]
MODEL = """mdp const int N; const double p; module m s : [0..3] init N;
  [] s>0 -> p:(s'=s-1) + 1-p:(s'=s); [a] s>1 -> (s'=s-2); [] s=0 -> true; endmodule"""
MANY = ["-const", "N=0:4,p={0.5,1},k=1:2"]
PROPERTIES = ["-pf", 'const int k; "steps": Pmax=? [ F<=k s=0 ]; Pmin=? [ F s=0 ]; P=? [ F x=1 ]']


@pytest.fixture
def model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.nm").write_text(MODEL)
    return "m.nm"


def output(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Status and output, without times."""
    status = main(list(words))
    printed = capsys.readouterr()
    return status, re.sub(r"\d+\.\d+ seconds", "", printed.out), printed.err


def written(folder: Path) -> dict[str, str]:
    """Files by name, without times."""
    found = {p.name: p.read_text() for p in folder.iterdir()}
    found["r.csv"] = re.sub(r"\d\.\d{4,}(e-\d+)?,", "", found["r.csv"])
    return found


def test_the_output_is_that_of_one_process(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a model at fault (N=4), a faulty property, files for each instance and for the results."""
    words = [model, *PROPERTIES, *MANY, "-v", "-exporttrans", "t.tra", "-exportresults", "r.csv"]
    one, one_files = output(capsys, *words), written(tmp_path)
    for path in [*tmp_path.glob("*.tra"), tmp_path / "r.csv"]:
        path.unlink()
    assert output(capsys, *words, "-jobs", "3") == one
    assert written(tmp_path) == one_files
    assert len(one_files) == 2 + 8
    assert one[0] == 1
    assert one[1].count("Model checking:") == 8 * (2 + 1 + 1)
    assert active_children() == []


def test_a_fault_of_the_run_ends_it_in_order(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "p.props").write_text(
        "// RESULT (N=0): 1\n// RESULT (N=1): 1\n// RESULT (N=2): 7\n// RESULT: 1\nPmin=? [ F s=0 ]\n"
    )
    words = [model, "p.props", "-const", "N=0:3,p=1", "-test"]
    one = output(capsys, *words)
    assert output(capsys, *words, "-jobs", "2") == one
    assert one[0] == 1
    assert one[1].count("Model checking:") == 3


@pytest.mark.parametrize(
    "words",
    [["-jobs", "0"], ["-jobs", "two"], ["-exportresults", "r.xlsx"], ["-exportresults", "r.doc"]],
)
def test_faults_of_the_switches(
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = output(capsys, DIE, *words)
    assert (status, out) == (2, "")
    assert words[0] in err or "-jobs" in err


def test_a_missing_package_is_told_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for name, extra in (("r.parquet", "frames"), ("r.svg", "plot")):
        status, out, err = output(capsys, DIE, "-pf", "P=? [ F d=1 ]", "-exportresults", name)
        assert (status, out) == (1, "")
        assert f"pip install 'symcheck[{extra}]'" in err
    assert list(tmp_path.iterdir()) == []


def test_results_are_written_by_extension(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [model, "-pf", "Pmax=? [ F<=2 s=0 ]", "-const", "N=1:3,p={0.5,1}", "-exportresults"]
    for name in ("r.csv", "r.json", "r.parquet", "r.png", "r.svg", "r.txt", "r", "r.dat:csv"):
        assert output(capsys, *words, name)[0] == 0
    rows = list(csv.DictReader((tmp_path / "r.csv").read_text().splitlines()))
    assert [(r["N"], r["p"], r["value"]) for r in rows][:3] == [
        ("1", "0.5", "0.75"),
        ("1", "1", "1.0"),
        ("2", "0.5", "1.0"),
    ]
    assert [o["value"] for o in json.loads((tmp_path / "r.json").read_text())][:2] == [0.75, 1.0]
    assert (tmp_path / "r.parquet").read_bytes()[:4] == b"PAR1"
    assert (tmp_path / "r.png").read_bytes()[1:4] == b"PNG"
    assert (tmp_path / "r.txt").read_text().startswith("N\tp\tResult\n1\t0.5\t0.75\n")
    assert (tmp_path / "r").read_text() == (tmp_path / "r.txt").read_text()
    assert (tmp_path / "r.dat").read_text().startswith("N,p,Result\n")
    assert not list(tmp_path.glob(".*"))


def test_a_killed_process_loses_no_result(model: str, tmp_path: Path) -> None:
    run = subprocess.Popen(
        [sys.executable, "-m", "symcheck", *CROWDS, "-const", "TotalRuns=3:6,CrowdSize=2:5", "-jobs", "2", "-exportresults", "r.csv"],
        stdout=-1, stderr=-1, text=True,
    )  # fmt: skip
    assert run.stdout is not None
    while not run.stdout.readline().startswith("Result:"):
        pass
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    os.kill(int(children[-1]), signal.SIGKILL)
    run.communicate(timeout=120)
    assert run.returncode == 0
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 1 + 16 * 4


def test_ctrl_c_writes_finished_rows(model: str, tmp_path: Path) -> None:
    run = subprocess.Popen(
        [sys.executable, "-m", "symcheck", *CROWDS, "-const", "TotalRuns=3:6,CrowdSize=2:9", "-jobs", "2", "-exportresults", "r.csv"],
        stdout=-1, stderr=-1, text=True,
    )  # fmt: skip
    assert run.stdout is not None
    while not run.stdout.readline().startswith("Result:"):
        pass
    run.send_signal(signal.SIGINT)
    _, err = run.communicate(timeout=60)
    assert run.returncode == 130
    rows = len((tmp_path / "r.csv").read_text().splitlines()) - 1
    assert 4 <= rows < 32 * 4
    assert err.splitlines() == [
        "error: interrupted by Ctrl-C",
        f"  note: {rows} finished results are above",
    ]
    assert "Traceback" not in err


def test_a_killed_process_ends_with_the_status_of_a_limit(
    model: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Workers, "completed", lambda *_: ((i, Lost()) for i in range(2)))
    status, out, _ = output(
        capsys, model, "-pf", "P=? [ F s=0 ]", "-const", "p=0.5,N=1:2", "-jobs", "2"
    )
    assert (status, out.count("its process was killed")) == (3, 2)
