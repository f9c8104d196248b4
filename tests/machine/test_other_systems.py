"""Runs where Python has none of what only POSIX has: the twins for Windows do the work."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from symcheck import operating_system

MODELS = Path(__file__).resolve().parents[2] / "models"

WITHOUT_POSIX = """
import os, signal, sys
import _signal
for module in ("fcntl", "resource", "termios", "tty", "pty", "syslog", "grp"):
    sys.modules[module] = None
for name in ("SIGALRM", "SIGHUP", "SIGUSR1", "SIGCHLD", "SIGPIPE", "ITIMER_REAL", "setitimer", "getitimer",
             "alarm", "pause", "pthread_kill", "pthread_sigmask", "sigwait", "sigpending", "siginterrupt"):
    for module in (signal, _signal):
        vars(module).pop(name, None)
for name in ("fork", "forkpty", "killpg", "getpgid", "setpgid", "setsid", "sched_getaffinity",
             "getuid", "geteuid", "mkfifo", "nice", "getloadavg", "wait3", "wait4"):
    vars(os).pop(name, None)
"""

COMMANDS = [
    *(f"die/die.pm die/die.pctl {engine}" for engine in ("", "-ex", "-s", "-h", "-m", "-exact")),
    "die/die.pm -pf 'const int k; P=? [ F d=k ]' -const k=1:6 -exportresults stdout:csv",
    "die/die.pm -pf 'const int k; P=? [ F d=k ]' -const k=1:6 -jobs 2",
    "die/die.pm -pf 'P>=1/6 [ F d=6 ]'",
    "die/die.pm -pf 'P=? [ F d=6 ]' -sim -simsamples 1000 -simseed 1",
    "die/die.pm -simpath 5 stdout -simseed 1",
    "die/die.pm -exporttrans stdout -exportstates stdout -exportlabels stdout",
    "die/die.pm -exporttransdot stdout",
    "die/die.pm -pf 'P=? [ F d=6 ]' -timeout 100 -cuddmaxmem 1g",
    "die/die.pm -pf 'P=? [ F d=6 ]' -bisim",
    "die/die.pm -pf 'P=? [ G F d=6 ]'",
    "die/die.pm -pf 'P=? [ F missing ]'",
    "missing.pm",
    "dining/dining.nm -pf 'Pmin=? [ F<=20 \"eating\" ]' -ex",
    "dining/dining.nm -pf 'Pmin=? [ F<=20 \"eating\" ]' -m",
    "dining/dining.nm -pf 'Pmax=? [ F<=20 \"eating\" ]' -exportstrat stdout",
    "-help",
    "-version",
]

RUN = """
import io, json, re, shlex
from contextlib import redirect_stderr, redirect_stdout
from symcheck.cli import main
runs = []
for line in json.loads(sys.argv[1]):
    out = io.StringIO()
    with redirect_stdout(out), redirect_stderr(out):
        status = main(shlex.split(line))
    runs.append([line, status, re.sub(r"[0-9.]+ (?:ms|s\\b|seconds)", "TIME", out.getvalue())])
print(json.dumps(runs))
"""


def python(code: str, *words: str, status: int = 0) -> tuple[str, str]:
    """The output and the errors of a new process."""
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        capture_output=True,
        text=True,
        encoding="utf-8",
        cwd=MODELS,
        timeout=120,
    )
    assert done.returncode == status, done.stderr
    return done.stdout, done.stderr


def test_runs_without_posix_have_the_same_output() -> None:
    words = json.dumps(COMMANDS)
    here, there = (
        json.loads(python(prefix + RUN, words)[0].splitlines()[-1])
        for prefix in ("import sys\n", WITHOUT_POSIX)
    )
    for run, twin in zip(here, there, strict=True):
        assert run == twin
    assert [line for line, status, _ in there if status] == [
        "die/die.pm -pf 'P=? [ F missing ]'",
        "missing.pm",
    ]


def test_the_time_limit_ends_a_run_without_an_interval_timer(tmp_path: Path) -> None:
    """The model has infinitely many states."""
    model = tmp_path / "endless.pm"
    model.write_text(
        "dtmc module m x : int init 0; y : int init 1;"
        " [] true -> 0.5 : (x'=x+1) + 0.5 : (y'=y+x); endmodule",
        encoding="utf-8",
    )
    code = "from symcheck.cli import main; main()"
    words = [str(model), "-pf", "P=? [ F x<0 ]", "-ex", "-timeout", "0.5"]
    assert "the time limit was reached" in python(WITHOUT_POSIX + code, *words, status=3)[1]


def test_lines_of_a_batch_run_in_new_processes_without_fork(tmp_path: Path) -> None:
    lines = tmp_path / "lines.txt"
    lines.write_text("die/die.pm -pf 'P=? [ F d=6 ]' -exact\nmissing.pm\n", encoding="utf-8")
    code = "from symcheck.cli import main; main()"
    out, _ = python(WITHOUT_POSIX + code, "-batch", str(lines), status=1)
    assert "Result: 1/6" in out
    assert "2 lines, 1 with exit status 0, 1 with exit status 2" in out


def test_the_size_of_memory_without_posix(monkeypatch: pytest.MonkeyPatch) -> None:
    """dd (where it has CUDD) and psutil use `os.sysconf` themselves when they are imported."""
    pytest.importorskip("psutil")
    physical = operating_system.physical_memory()
    monkeypatch.delattr(os, "sysconf")
    assert 0 < operating_system.physical_memory() < physical
