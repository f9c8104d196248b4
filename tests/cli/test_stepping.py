"""`symcheck MODEL -step`: lines of the standard input choose the steps."""

from __future__ import annotations

import io
import os
import pty
import signal
import subprocess
import sys
from contextlib import suppress

import pytest

import symcheck
from symcheck.cli import main

MODEL = """mdp module m x : [0..3]; [go] x<3 -> 0.5:(x'=x+1) + 0.5:(x'=0); [back] x=2 -> (x'=0);
endmodule label "end" = x=3;"""


@pytest.fixture
def step(tmp_path, monkeypatch, capsys):
    (tmp_path / "m.nm").write_text(MODEL)
    monkeypatch.chdir(tmp_path)

    def run(text, *words, model="m.nm"):
        monkeypatch.setattr(sys, "stdin", io.StringIO(text))
        status = main([model, "-step", "-seed", "1", *words])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def states(output):
    return [line.partition(": ")[2] for line in output.splitlines() if line.startswith("step ")]


def test_keys(step):
    status, out, err = step("0.0\n[go]\n\n  b \n s \nr 2\nq\n0.0\n")
    assert (status, err) == (0, "")
    shown = states(out)
    assert shown[:2] == ["(x=0)", "(x=1)"]
    assert shown[4] == shown[2]
    assert shown[5] == "(x=0)"
    assert len(shown) == 7
    assert out.splitlines()[-1] == "> q"


def test_a_path_and_its_seed(step):
    _, out, _ = step("0.0\n0.0\n0.0\np\n")
    assert "action step x\n- 0 0\n[go] 1 1\n[go] 2 2\n[go] 3 3\n" in out
    assert "labels: deadlock, end" in out
    assert "seed 1" in out
    assert states(step("\n" * 9)[1]) == states(step("\n" * 9)[1])


def test_the_end_of_the_input_ends_the_run(step):
    assert step("")[0] == 0
    assert step("0.0")[0] == 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("7", "there is no choice 7: expected 0, go"),
        ("[stop]", "there is no choice 'stop'"),
        ("0.5", "no successor 5"),
        ("0.", "'0.' is no step"),
        ("go on", "'go on' is no step"),
        ("r many", "'r many' is no step"),
        ("b", "this is the first state"),
    ],
)
def test_wrong_lines_are_explained(step, line, message):
    status, out, _ = step(f"{line}\n0.0\n")
    assert status == 0
    assert message in out
    assert states(out) == ["(x=0)", "(x=1)"]


def test_faults_of_the_model(step, tmp_path):
    (tmp_path / "bad.pm").write_text(
        "dtmc module m x:[0..1]; [] x=0 -> (x'=1); [] x=1 -> 0.5:(x'=0); endmodule"
    )
    status, out, _ = step("0\n0\nb\n", model="bad.pm")
    assert status == 0
    assert out.count("sum to 0.5") == 2
    assert states(out)[-1] == "(x=0)"


def test_properties_and_explicit_files(step, tmp_path):
    symcheck.export(symcheck.loads(MODEL), str(tmp_path / "m.all"))
    status, out, _ = step("[go]\n", "-pf", 'Pmax=? [ F "end" ]', model="m.all")
    assert status == 0
    assert len(states(out)) == 2
    assert "Result: 1.0" in out
    status, out, _ = step("")
    assert "Result" not in out
    assert "Engine" not in out


def terminal(model, word):
    """A process of the command line at a terminal, which was sent a word."""
    above, below = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", "symcheck", model, "-step", "-seed", "1"],
        stdin=below,
        stdout=below,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(below)
    seen = b""
    while b"\n> " not in seen:
        seen += os.read(above, 4096)
    os.write(above, word)
    return process, above, seen


def test_a_terminal_and_control_c(tmp_path):
    (tmp_path / "m.nm").write_text(MODEL)
    process, above, _ = terminal(str(tmp_path / "m.nm"), b"\n")
    seen = b""
    while b"\n> " not in seen:
        seen += os.read(above, 4096)
    assert b"step 1: " in seen
    err = None
    while err is None:  # a signal between the prompt and the wait for input has no effect
        process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            _, err = process.communicate(timeout=3)
    assert process.returncode == 130
    assert err.startswith("error: interrupted by Ctrl-C")
    os.close(above)


def test_control_d_ends_at_a_terminal(tmp_path):
    (tmp_path / "m.nm").write_text(MODEL)
    process, above, _ = terminal(str(tmp_path / "m.nm"), b"\x04")
    assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 0
    os.close(above)
