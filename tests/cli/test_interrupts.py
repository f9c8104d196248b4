"""Runs that are stopped end with one message, their exit status, and whole files (see benchmarks/interrupts.py)."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import interrupts
import pytest

ROOT = Path(__file__).parents[2]
CROWDS = (
    *(str(ROOT / "models" / "crowds" / f"crowds.{ending}") for ending in ("pm", "pctl")),
    "-const",
    "TotalRuns=3:6,CrowdSize=5",
    "-exportresults",
    "r.csv",
)
EXPLAINED = (
    *(str(ROOT / "models/crowds/crowds.pm"), "-const", "TotalRuns=4,CrowdSize=5"),
    *("-pf", "P<=0.001 [ F observed0>1 ]", "-exportcounterexample", "c.txt"),
)
"""A run that imports scipy."""
ENDLESS = """dtmc module m x : [0..100000000]; y : [0..100000000];
  [] true -> 0.5 : (x'=mod(x*7+y+1, 99999989)) + 0.5 : (y'=mod(x+y*5+3, 99999971)); endmodule"""
CHAIN = "dtmc module m x : [0..3000000]; [] x>0 & x<3000000 -> 0.5:(x'=x-1)+0.5:(x'=x+1); [] x=0|x=3000000 -> true; endmodule init x=1500000 endinit"


@pytest.mark.parametrize(
    ("kind", "moment", "amount", "way"),
    [
        ("SIGINT", 1.5, 0, ""),
        ("SIGTERM", 1.5, 0, ""),
        ("time", 0.01, 0, ""),
        ("memory", 0, 2 << 20, "-cuddmaxmem"),
        ("memory", 0, 4 << 20, "SYMCHECK_MEMORY"),
        ("memory", 0, 24 << 20, "address space"),
        ("memory", 0, 90 << 20, "address space"),
        ("memory", 0, 130 << 20, "address space"),
        ("memory", 0, 43 << 20, "data"),
        ("memory", 0, 70 << 20, "data"),
        ("space", 0, 100, ""),
        ("full output", 0, 0, ""),
        ("closed pipe", 0, 300, ""),
    ],
)
def test_a_disturbed_run_ends_as_it_should(kind: str, moment: float, amount: int, way: str) -> None:
    trial = interrupts.Trial(CROWDS, kind, moment, amount, way)
    assert interrupts.faults(trial, interrupts.run(trial), slack=10) == []


DURING_IMPORTS = """
import os, signal, sys
class Signals:
    def find_spec(self, name, path=None, target=None):
        if name == sys.argv[1]:
            os.kill(os.getpid(), int(sys.argv[2]))
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Signals())
from symcheck.cli import main
main()
"""


@pytest.mark.parametrize(
    "module", ["symcheck.cli.entry_point", "numpy", "symcheck.syntax.lalr", "symcheck.api"]
)
@pytest.mark.parametrize(("number", "status"), [(2, 130), (15, 143), (14, 3)])
def test_a_signal_during_the_imports_ends_the_process(
    module: str, number: int, status: int
) -> None:
    command = [sys.executable, "-c", DURING_IMPORTS, module, str(number)]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (status, "")
    assert re.fullmatch(r"error: .*\n", ended.stderr)


@pytest.mark.parametrize("amount", [24, 40, 64])
@pytest.mark.parametrize("way", ["SYMCHECK_MEMORY", "-cuddmaxmem"])
def test_too_little_memory_for_scipy_ends_the_run(amount: int, way: str) -> None:
    """The BLAS of scipy would wait for memory without end."""
    trial = interrupts.Trial(EXPLAINED, "memory", 0, amount << 20, way)
    assert interrupts.faults(trial, interrupts.run(trial), slack=10) == []


@pytest.mark.parametrize("engine", ["-ex", "-s", "-h", "-m", ""])
def test_the_time_limit_holds_in_compiled_loops(engine: str, tmp_path: Path) -> None:
    """Millions of iterations of one component, or a search without end."""
    (tmp_path / "m.pm").write_text(CHAIN if engine in ("-s", "-h") else ENDLESS)
    words = (str(tmp_path / "m.pm"), "-pf", "P=? [ F x=0 ]", *([engine] if engine else []))
    found = interrupts.run(interrupts.Trial(words, "time", 2.0))
    assert (found.status, found.err.splitlines()[0]) == (3, "error: the time limit was reached")
    assert found.late < 10


def test_faults_are_found() -> None:
    """The check itself notices a wrong status, a traceback and a late end."""
    trial = interrupts.Trial(CROWDS, "SIGINT")
    wrong = interrupts.Outcome(1, "", "Traceback (most recent call last):", 99.0, {"x.part": b""})
    assert len(interrupts.faults(trial, wrong, 1)) == 4
