"""What a terminal shows while numbers are computed, and what Ctrl-C leaves of a simulation."""

from __future__ import annotations

import os
import pty
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from symcheck.cli.output import Output
from symcheck.cli.progress import Progress
from symcheck.numerics.linear.problem import Progress as Iteration

ENDLESS = "dtmc module m s:[0..2]; [] s=0 -> 0.3:(s'=1) + 0.7:(s'=2); [] s>0 -> true; endmodule rewards s=1 : 2; endrewards"
SLOW = """ctmc const int N; module a x:[0..N]; y:[0..N]; [] x<N -> 1:(x'=x+1); [] x>0 & y<N -> 1.1:(x'=x-1)&(y'=y+1);
    [] y>0 -> 1.2:(y'=y-1); endmodule rewards true : x; endrewards"""
MANY = ("-sim", "-simsamples", "100000000", "-seed", "1")


class Terminal:
    """A run whose standard error is a terminal, and whose standard output too, if wanted."""

    def __init__(self, words: Sequence[str], *, output: bool = True) -> None:
        self._above, below = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "symcheck", *words],
            stdin=subprocess.DEVNULL,
            stdout=below if output else subprocess.PIPE,
            stderr=below,
        )
        os.close(below)
        self.seen = ""

    def read(self) -> bool:
        """Read what is there; whether there may be more."""
        try:
            part = os.read(self._above, 4096)
        except OSError:  # the other end is closed
            part = b""
        self.seen += part.decode()
        return bool(part)

    def wait_for(self, pattern: str) -> str:
        """Read until a pattern is seen."""
        while not re.search(pattern, self.seen):
            assert self.read(), self.seen
        return self.seen

    def end(self) -> int:
        """Read to the end; gives the exit status."""
        while self.read():
            pass
        os.close(self._above)
        return self.process.wait()


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "m.pm"
    path.write_text(ENDLESS)
    return path


@pytest.mark.parametrize(
    ("formula", "value", "bound"),
    [
        ("P=? [ F s=1 ]", 0.3, "Clopper and Pearson"),
        ("R=? [ C<=2 ]", 0.6, "Hoeffding"),
    ],
)
def test_samples_are_shown_and_control_c_prints_what_they_give(
    model: Path, formula: str, value: float, bound: str
) -> None:
    run = Terminal([str(model), "-pf", formula, *MANY])
    run.wait_for(r"[\d,]+ of 100,000,000 samples: [-+.\de]+ \+/- \d\.\dE-\d\d")
    run.process.send_signal(signal.SIGINT)
    assert run.end() == 130
    found = re.search(
        r"Result so far: (\S+) \(in \[(\S+), (\S+)\] with probability 0\.99, (\d+) samples, by (.*)\) "
        r"\(first (\d+) of 100000000 samples\)",
        run.seen,
    )
    assert found is not None, run.seen
    assert abs(float(found[1]) - value) < 0.1
    assert float(found[2]) <= value <= float(found[3])
    assert found[4] == found[6]
    assert bound in found[5]
    assert "error: interrupted by Ctrl-C" in run.seen


def test_no_terminal_shows_no_progress_and_control_c_prints_the_same(model: Path) -> None:
    words = [sys.executable, "-m", "symcheck", str(model), "-pf", "P=? [ F s=1 ]", *MANY]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        process.wait(timeout=6)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert re.search(r"Result so far: 0\.(29|30)", out)
    assert "samples:" not in err
    assert "\x1b" not in err + out


def test_the_time_limit_prints_it_too(model: Path) -> None:
    run = Terminal([str(model), "-pf", "P=? [ F s=1 ]", *MANY, "-timeout", "5"])
    assert run.end() == 3
    assert "Result so far: 0." in run.seen


def test_finished_properties_leave_no_samples_behind(model: Path) -> None:
    run = Terminal(
        [str(model), "-pf", "P=? [ F s=1 ]", "-sim", "-simsamples", "1000", "-seed", "1"]
    )
    assert run.end() == 0
    assert "so far" not in run.seen


def test_iterations_are_shown(tmp_path: Path) -> None:
    (tmp_path / "m.sm").write_text(SLOW)
    words = [
        str(tmp_path / "m.sm"),
        "-pf",
        "P=? [ F<=1e5 x=N & y=N ]",
        "-const",
        "N=80",
        "-epsilon",
        "1e-9",
    ]
    run = Terminal(words)
    run.wait_for(r"uniformisation: iteration [\d,]+")
    run.process.kill()
    run.end()


def test_a_computation_that_reports_nothing_shows_its_time(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("symcheck.cli.progress._PATIENCE", 0.01)
    progress = Progress(Output())
    progress.terminal = True
    seen = ""
    with progress.checking():
        while "checking (0 s)" not in seen:
            seen += capsys.readouterr().err
    assert capsys.readouterr().err.endswith("\r\x1b[2K")


def test_the_line_changes_some_times_a_second(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("symcheck.cli.progress.perf_counter", lambda: now)
    progress = Progress(Output())
    progress.terminal = True
    for step in range(1000):
        now = step / 1000
        progress.iteration(Iteration("interval", step, 0.5 / (step + 1), 7))
    shown = capsys.readouterr().err.split("\r\x1b[2K")[1:]
    assert len(shown) == 4
    assert shown[0] == "interval: iteration 201, bounds apart by 2.5E-03, 7 states"
    progress.clear()
    assert capsys.readouterr().err == "\r\x1b[2K"
