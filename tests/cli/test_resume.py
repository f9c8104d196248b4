"""-resume FILE: a stopped run goes on with what it has not finished."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main

MODEL = (
    """dtmc const int N; module m x : [0..9]; [] x<9 -> 0.5:(x'=min(x+N,9)) + 0.5:true; endmodule"""
)
TEXT = "const int k; P=? [ F<=k x=9 ]; P=? [ F x=6 ]"


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.chdir(tmp_path)
    Path("m.pm").write_text(MODEL)

    def checked(constants: str, *words: str) -> tuple[int, str]:
        status = main(["m.pm", "-pf", TEXT, "-const", constants, "-resume", "r.jsonl", *words])
        printed = capsys.readouterr()
        return status, printed.out + printed.err

    return checked


def results(out: str) -> list[str]:
    return re.findall(r"^Result: (\S+)", out, re.MULTILINE)


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_finished_results_are_read(run, jobs):
    first = run("N=1:2,k=3", "-jobs", jobs)[1]
    assert (first.count("States:"), "from r.jsonl" in first) == (2, False)
    status, second = run("N=1:4,k=3", "-jobs", jobs, "-exportresults", "stdout")
    assert (status, second.count("States:"), second.count("(from r.jsonl)")) == (0, 2, 4)
    alone = [results(run(f"N={n},k=3")[1]) for n in "1234"]
    assert results(second) == [value for values in alone for value in values]
    assert len(re.findall(r"^\d\t", second, re.MULTILINE)) == 8


def test_the_file_is_that_of_the_library(run):
    rows = symcheck.experiment("m.pm", TEXT, {"N": [1, 2], "k": 3}, resume="r.jsonl")
    status, out = run("N=1:2,k=3")
    assert (status, "States:" in out) == (0, False)
    assert results(out) == [str(row.value) for row in sorted(rows, key=lambda r: r.constants["N"])]


def test_another_experiment_is_an_error(run):
    run("N=1,k=3")
    status, out = run("N=1,k=3", "-epsilon", "1e-9")
    assert (status, "-resume: 'r.jsonl' has the rows of another experiment" in out) == (2, True)


def test_errors_stay_errors(run):
    assert run("N=10,k=-1")[0] == run("N=10,k=-1")[0] == 1
