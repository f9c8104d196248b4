"""`-batch`: each line runs as if alone, whatever the others do."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from symcheck.cli import main

ROOT = Path(__file__).parents[2]
DIE = str(ROOT / "models/die/die.pm")
SIX = "-pf 'P=? [ F d=6 ]'"
SYMCHECK = [sys.executable, "-m", "symcheck"]

ENDLESS = """dtmc module m x : int init 0; y : int init 1;
  [] true -> 0.5 : (x'=x+1) + 0.5 : (y'=y+x); endmodule"""


def run(words: Sequence[str], text: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run([*SYMCHECK, *words], input=text, capture_output=True, text=True)


def statuses(output: str) -> list[int]:
    return [int(s) for s in re.findall(r"^Exit status: (\d+)$", output, re.MULTILINE)]


def without_times(output: str) -> str:
    return re.sub(r"\d+\.\d+ seconds", "", output)


def test_each_line_has_the_output_and_status_that_it_has_alone(tmp_path: Path) -> None:
    lines = [
        f"{DIE} {SIX}",
        f"{DIE} -pf 'P=? [ F d=6'",
        f"{DIE} {SIX} -hybrid  # diagrams",
        f"{tmp_path}/missing.pm",
        f'{DIE} "',
        "-batch other.txt",
    ]
    file = tmp_path / "suite.txt"
    file.write_text("# the suite\n\n" + "\n".join(lines) + "\n")
    batch = run(["-batch", str(file)])
    assert batch.returncode == 1
    assert statuses(batch.stdout) == [0, 1, 0, 2, 2, 2]
    parts = re.split(r"^=+\nLine (\d+): .*\n\n", batch.stdout, flags=re.MULTILINE)
    assert parts[1::2] == ["3", "4", "5", "6", "7", "8"]
    alone = [run([DIE, "-pf", "P=? [ F d=6 ]"]), run([DIE, "-pf", "P=? [ F d=6"])]
    for part, single in zip(parts[2::2], alone, strict=False):
        assert without_times(part).startswith(without_times(single.stdout))
        assert single.stderr in batch.stderr
    assert "missing.pm" in batch.stderr
    assert f"{file}:7: No closing quotation" in batch.stderr
    assert batch.stdout.endswith(
        "Batch: 6 lines, 2 with exit status 0, 1 with exit status 1, 3 with exit status 2\n"
    )


def test_results_arrive_before_the_next_line_is_read() -> None:
    with subprocess.Popen(
        [*SYMCHECK, "-batch", "-"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for _ in range(2):
            process.stdin.write(f"{DIE} {SIX}\n")
            process.stdin.flush()
            while not (line := process.stdout.readline()).startswith("Exit status"):
                assert line
            assert line == "Exit status: 0\n"
        process.stdin.close()
        assert process.wait() == 0


def test_limits_hold_for_each_line(tmp_path: Path) -> None:
    model = tmp_path / "endless.pm"
    model.write_text(ENDLESS)
    words = ["-batch", "-", "-timeout", "1"]
    batch = run(words, f"{model} -pf 'P=? [ F x<0 ]' -ex\n{DIE} {SIX}\n")
    assert statuses(batch.stdout) == [3, 0]
    assert batch.returncode == 1
    assert "the time limit was reached" in batch.stderr


def test_switches_beside_it_hold_for_each_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "suite.txt"
    file.write_text(f"{DIE}\n{DIE} -hybrid\n")
    assert main(["-sparse", "-batch", str(file)]) == 0
    assert re.findall(r"Engine: +(\w+)", capfd.readouterr().out) == ["sparse", "hybrid"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-batch", "missing.txt"], "cannot read 'missing.txt'"),
        (["-batch", str(ROOT)], "cannot read"),
        ([DIE, "-batch", "-"], "whose lines name models"),
        (
            ["-batch", "-", "-exportresults", "x.csv"],
            "each line of -batch would write the same file",
        ),
        (["-batch"], "expected a value"),
    ],
)
def test_a_faulty_command_line_ends_it(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert message in capsys.readouterr().err


def stopped(number: signal.Signals, line: str, after: str) -> subprocess.CompletedProcess[str]:
    """A batch that gets a signal when it has printed a line with this beginning."""
    with subprocess.Popen(
        [*SYMCHECK, "-batch", "-"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(line)
        process.stdin.flush()
        while not process.stdout.readline().startswith(after):
            pass
        process.send_signal(number)
        out, err = process.communicate()
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_line_and_the_batch(tmp_path: Path, number: signal.Signals) -> None:
    model = tmp_path / "endless.pm"
    model.write_text(ENDLESS)
    ended = stopped(number, f"{model} -pf 'P=? [ F x<0 ]' -ex\n{DIE}\n", "Type:")
    assert statuses(ended.stdout) == [ended.returncode] == [128 + number]
    assert "interrupted by" in ended.stderr


@pytest.mark.parametrize(
    ("number", "sender"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")]
)
def test_a_signal_between_two_lines_ends_the_batch(number: signal.Signals, sender: str) -> None:
    ended = stopped(number, f"{DIE}\n", "Exit status:")
    assert (ended.returncode, ended.stderr) == (
        128 + number,
        f"error: interrupted by {sender}\n",
    )


def test_a_line_that_crashes_does_not_end_the_batch(tmp_path: Path) -> None:
    """The process of the line kills itself, as a defect of a compiled module would."""
    script = """
import os, sys
from symcheck.cli import batch
from symcheck.cli.entry_point import run_safely
def run(words, started):
    os.kill(os.getpid(), 9) if words == ["x"] else os._exit(0)
sys.exit(batch.run_batch(["-batch", "-"], run, run_safely))
"""
    result = subprocess.run(
        [sys.executable, "-c", script], input="x\ny\n", capture_output=True, text=True, cwd=tmp_path
    )
    assert statuses(result.stdout) == [128 + signal.SIGKILL, 0]
    assert "the run was ended by SIGKILL" in result.stderr
    assert result.returncode == 1


@pytest.mark.parametrize("engine", [[], ["-hybrid"]])
def test_a_line_finds_loaded_what_it_needs(engine: Sequence[str]) -> None:
    code = f"""
import sys
from symcheck.cli.batch import load
from symcheck.cli.entry_point import run_safely
load(run_safely)
before = set(sys.modules)
status = run_safely([{DIE!r}, "-pf", "P=? [ F d=6 ]", *{engine!r}])
print(sorted(n for n in set(sys.modules) - before if n.startswith("symcheck")))
sys.exit(status)
"""
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert found.stdout.splitlines()[-1] == "[]"
