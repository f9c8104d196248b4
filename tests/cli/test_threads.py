"""The command line as a function that is called in another thread than the main one."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path
from time import perf_counter

import pytest

from symcheck.cli import main
from symcheck.time_limit import ThreadTimer

CROWDS = Path(__file__).parents[2] / "models" / "crowds" / "crowds.pm"
CHAIN = "dtmc module m x : [0..3000000]; [] x>0 & x<3000000 -> 0.5:(x'=x-1)+0.5:(x'=x+1); [] x=0|x=3000000 -> true; endmodule init x=1500000 endinit"
ENDLESS = """dtmc module m x : [0..100000000]; y : [0..100000000];
  [] true -> 0.5 : (x'=mod(x*7+y+1, 99999989)) + 0.5 : (y'=mod(x+y*5+3, 99999971)); endmodule"""


def in_thread(*words: str) -> int:
    statuses: list[int] = []

    def run() -> None:
        statuses.append(main(list(words)))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    return statuses[0]


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (CHAIN, ["-s"]),
        (CHAIN, ["-h"]),
        (CHAIN, ["-ex"]),
        (ENDLESS, ["-ex"]),
        (ENDLESS, ["-m"]),
        (ENDLESS, ["-exact"]),
        (ENDLESS, ["-sim", "-simsamples", "100000000"]),
    ],
)
def test_the_time_limit_holds_in_a_thread(
    model: str, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "m.pm"
    file.write_text(model)
    started = perf_counter()
    assert in_thread(str(file), "-pf", "P=? [ F<=1000000 x=0 ]", "-timeout", "0.5", *words) == 3
    assert capsys.readouterr().err.startswith("error: the time limit was reached")
    assert perf_counter() - started < 60  # and not hours


@pytest.mark.parametrize("engine", ["-ex", "-m", "-s"])
def test_an_engine_may_notice_the_end_of_the_time_first(
    engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The timer is late on a machine under load."""
    monkeypatch.setattr(ThreadTimer, "start", lambda _: None)
    file = tmp_path / "m.pm"
    file.write_text(ENDLESS)
    assert in_thread(str(file), "-timeout", "0.3", engine) == 3
    assert capsys.readouterr().err.startswith("error: the time limit was reached")


TRACED = """
import sys, threading
from symcheck.cli import main
for _ in range(3):
    thread = threading.Thread(target=main, args=([sys.argv[1], "-timeout", "0.2", "-exact"],))
    thread.start()
    thread.join()
sys.setprofile(lambda *_: None)
print(len([str(i) for i in range(9)]))
(lambda: print("traced"))()
"""


def test_a_time_limit_in_a_thread_leaves_python_as_it_was(tmp_path: Path) -> None:
    """A request to raise that nobody receives would stop CPython 3.11 where calls are traced."""
    file = tmp_path / "m.pm"
    file.write_text(ENDLESS)
    command = [sys.executable, "-c", TRACED, str(file)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert run.stdout.endswith("traced\n")


def test_the_time_limit_holds_beside_an_alarm_of_the_caller(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "m.pm"
    file.write_text(ENDLESS)
    before = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    try:
        assert main([str(file), "-timeout", "0.3", "-exact"]) == 3
    finally:
        signal.signal(signal.SIGALRM, before)


def test_a_run_within_its_time_is_not_disturbed(capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(CROWDS), "-const", "TotalRuns=3,CrowdSize=5", "-timeout", "60"]
    assert in_thread(*words) == 0


def test_processes_end_with_the_time_limit_of_a_thread(tmp_path: Path) -> None:
    (tmp_path / "m.pm").write_text(ENDLESS.replace("module", "const int N; module", 1))
    code = """
import sys, threading
from symcheck.cli import main
statuses = []
words = ["m.pm", "-const", "N=1:2", "-jobs", "2", "-exact", "-timeout", "2"]
thread = threading.Thread(target=lambda: statuses.append(main(words)))
thread.start()
thread.join()
sys.exit(statuses[0])
"""
    ended = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True)
    assert (ended.returncode, ended.stderr.count(b"Traceback")) == (3, 0)
