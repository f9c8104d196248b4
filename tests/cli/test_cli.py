"""What a user meets on the command line: exit statuses, messages, switches, limits."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from symcheck.cli import main

ROOT = Path(__file__).parents[2]
DIE = str(ROOT / "models/die/die.pm")
DIE_PCTL = str(ROOT / "models/die/die.pctl")
CROWDS = str(ROOT / "models/crowds/crowds.pm")

# Too many states for a second, and values that rule out a coarse description of them.
ENDLESS = """dtmc
module m
  x : int init 0;
  y : int init 1;
  [] true -> 0.5 : (x'=x+1) + 0.5 : (y'=y+x);
endmodule
"""

MDP = """mdp
module m
  x : [0..2];
  b : bool;
  [a] x<2 -> 0.5 : (x'=x+1) + 0.5 : (b'=!b);
  [c] x>0 -> (x'=0);
endmodule
init x=0 endinit
"""


@pytest.fixture
def write(tmp_path: Path) -> object:
    def write(text: str | bytes, name: str = "model.pm") -> str:
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return write


def results(text: str) -> list[str]:
    return re.findall(r"^Result:\s+(\S+)", text, re.MULTILINE)


@pytest.mark.parametrize(
    ("words", "status", "message"),
    [
        ([], 2, "no model file"),
        (["missing.pm"], 2, "missing.pm"),
        ([str(ROOT)], 2, "directory"),
        ([DIE, "missing.pctl"], 2, "missing.pctl"),
        ([DIE_PCTL, DIE], 2, "in the place of the model"),
        ([CROWDS, "-const", "TotalRuns=3", "CrowdSize=5"], 2, "commas separate constants"),
        ([DIE, "-bogus"], 2, "-bogus"),
        ([DIE, "-pf"], 2, "expected a value"),
        ([DIE, "-epsilon", "x"], 2, "'x' is not a number"),
        ([DIE, "-epsilon", "0"], 2, "between 0 and 1"),
        ([DIE, "-epsilon", "nan"], 2, "between 0 and 1"),
        ([DIE, "-maxiters", "inf"], 2, "whole number"),
        ([DIE, "-timeout", "0"], 2, "no time at all"),
        ([DIE, "-timeout", "soon"], 2, "not a time"),
        ([DIE, "-cuddmaxmem", "10x"], 2, "amount of memory"),
        ([DIE, "-method", "magic"], 2, "there is no method 'magic'"),
        ([DIE, "-exportresults", "out:magic"], 2, "unknown format 'magic'"),
        ([DIE, "-exportresults", "/missing/out.csv:csv"], 2, "no folder"),
        ([DIE, "-exportresults", str(ROOT)], 2, "is a folder"),
        ([DIE, "-exportresults", ""], 2, "names no file"),
        ([CROWDS, "-const", "TotalRuns"], 2, "NAME=VALUE"),
        ([CROWDS, "-const", "TotalRuns=3:1"], 2, "empty"),
        ([CROWDS, "-const", "TotalRuns={}"], 2, "empty"),
        ([CROWDS, "-const", "TotalRuns=1,TotalRuns=2"], 2, "twice"),
        ([CROWDS], 1, "constant TotalRuns is not defined"),
        ([CROWDS, "-const", "TotalRun=3,CrowdSize=3"], 1, "constant TotalRuns is not defined"),
        ([DIE, DIE_PCTL, "-prop", "99"], 1, "no property '99'"),
        ([DIE, DIE_PCTL, "-prop", "3-99"], 1, "no property '3-99'"),
        ([DIE, DIE_PCTL, "-prop", "4-3"], 1, "no property '4-3'"),
        ([DIE, DIE_PCTL, "-prop", "0"], 1, "no property '0'"),
        ([DIE, "-pf", "P=? [ F d=6 "], 1, "']' is missing"),
    ],
)
def test_wrong_command_lines(
    words: list[str], status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == status
    captured = capsys.readouterr()
    assert message in captured.err
    assert "internal" not in captured.err
    assert results(captured.out) == []


def test_a_value_for_no_constant_is_a_warning(capsys: pytest.CaptureFixture[str]) -> None:
    """Benchmark scripts give one list of constants to many models."""
    assert (
        main([CROWDS, "-pf", "P=? [ F phase=2 ]", "-const", "TotalRuns=1,CrowdSize=3,CrowdSise=4"])
        == 0
    )
    out = capsys.readouterr().out
    assert "neither the model nor the properties declare it" in out
    assert "did you mean CrowdSize?" in out
    assert "There were 2 warnings" in out or "There was 1 warning" in out


@pytest.mark.parametrize(
    "text", [b"", b"\x00\x01\xff\xfe", b"dtmc", "dtmc module é endmodule".encode()]
)
def test_files_that_are_no_models(text: bytes, write, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    assert main([write(text)]) in (1, 2)
    assert "error" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("which", "count"),
    [("1", 1), ("1,2", 2), ("2-4", 3), ("face", 1), ("1,face", 1), ("2-3, face", 3)],
)
def test_chosen_properties(which: str, count: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([DIE, DIE_PCTL, "-prop", which]) == 0
    assert len(results(capsys.readouterr().out)) == count


@pytest.mark.parametrize("engine", ["-ex", "-s", "-h", "-m", "-exact"])
def test_the_long_run_of_an_mdp_is_no_single_number(
    engine: str, write, capsys: pytest.CaptureFixture[str]
) -> None:  # type: ignore[no-untyped-def]
    words = [write(MDP), engine]
    for formula in ("S=? [ b ]", "S>0.1 [ b ]", "S=? [ false ]", "P=? [ F b ]", "Pmax=? [ F b ]"):
        words += ["-pf", formula]
    assert main(words) == 1
    out = capsys.readouterr().out
    # A bound asks about all strategies; a value would need one.
    assert results(out) == ["true", "[1,1]" if engine == "-exact" else "[1.0,1.0]"]
    assert out.count("Error:") == 3


def test_words_of_a_verdict(write, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    assert main([DIE, "-pf", "P>0.1 [ F d=1 ]", "-pf", "P>0.2 [ F d=1 ]"]) == 0
    out = capsys.readouterr().out
    assert results(out) == ["true", "false"]
    assert "true (satisfied in the initial state)" in out
    assert "false (not satisfied in the initial state)" in out
    assert main([write(MDP), "-pf", "x=0", "-pf", "b", "-pf", "x>0"]) == 0
    out = capsys.readouterr().out
    assert re.findall(r"satisfied in (.*) initial states", out) == [
        "all of 2",
        "1 of 2",
        "none of 2",
    ]


def test_arguments_of_an_extremum_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([DIE, "-pf", "filter(argmax, P=? [ F d=6 ], s<5)"]) == 0
    assert "\n2:(2,0)=" in capsys.readouterr().out


@pytest.mark.parametrize("engine", ["-ex", "-s", "-exact"])
def test_examples_of_deadlocks_are_short(
    engine: str, write, capsys: pytest.CaptureFixture[str]
) -> None:  # type: ignore[no-untyped-def]
    others = "".join(f"v{i} : [0..1] init 0;" for i in range(30))
    model = write(f"dtmc module m x : [0..1] init 0; {others} [] x=0 -> (x'=1); endmodule")
    assert main([model, engine]) == 0
    assert "such as (x=1,… 30 more)" in capsys.readouterr().out
    assert main([model, engine, "-nofixdl"]) == 1
    assert (
        "1 state has no transition (a deadlock), for example (x=1,… 30 more)"
        in capsys.readouterr().err
    )


def test_results_on_standard_output(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert (
        main(
            [
                DIE,
                "-pf",
                "const int k; P=? [ F d=k ]",
                "-const",
                "k=6:7",
                "-exportresults",
                "stdout:csv",
                "-exact",
            ]
        )
        == 0
    )
    assert capsys.readouterr().out.endswith("\nResults:\n\nk,Result\n6,1/6\n7,0\n")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def exported(write, tmp_path: Path) -> Callable[..., str]:  # type: ignore[no-untyped-def]
    """The file of results of properties of a model where x = a, for values of constants, in a format."""

    def exported(properties: str, constants: str, kind: str, declared: str = "const int a;") -> str:
        model = write(f"dtmc {declared} module m x : [0..9] init a; [] true -> true; endmodule")
        out = tmp_path / "out"
        assert (
            main([model, "-pf", properties, "-const", constants, "-exportresults", f"{out}:{kind}"])
            == 0
        )
        return out.read_text()

    return exported


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("text", "a\tk\tResult\n1\t0\t1\n1\t1\t2\n2\t0\t2\n2\t1\t3\n"),
        ("csv", "a,k,Result\n1,0,1\n1,1,2\n2,0,2\n2,1,3\n"),
        ("matrix", "a\\k:\n\t0\t1\n1\t1\t2\n2\t2\t3\n"),
        ("matrix,csv", "a\\k\n,0,1\n1,1,2\n2,2,3\n"),
        (
            "dataframe",
            "Property,a,k,Result,Accuracy\nx + k,1,0,1,exact\nx + k,1,1,2,exact\nx + k,2,0,2,exact\nx + k,2,1,3,exact\n",
        ),
    ],
)
def test_formats_of_results(kind: str, expected: str, exported: Callable[..., str]) -> None:
    assert exported("const int k; x + k", "a={1,2},k=0:1", kind) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("text", '"first": x + k:\nk\tResult\n0\t1\n1\t2\n\nx:\nResult\n1\n'),
        ("csv", '"""first"": x + k"\nk,Result\n0,1\n1,2\n\nx\nResult\n1\n'),
        ("matrix", '"first": x + k:\nk:\n0\t1\n1\t2\n\nx:\n1\n'),
        (
            "comment",
            '// RESULT (a=1,k=0): 1\n// RESULT (a=1,k=1): 2\n"first": x + k\n\n// RESULT (a=1): 1\nx\n',
        ),
    ],
)
def test_several_properties_have_titles_and_fixed_constants_no_column(
    kind: str, expected: str, exported: Callable[..., str]
) -> None:
    assert exported('const int k; "first": x + k; x', "a=1,k=0:1", kind) == expected


def test_one_matrix_for_each_choice_of_further_constants(exported: Callable[..., str]) -> None:
    matrices = exported(
        "const int k; x + k + b", "a=1:2,b=3:4,k=0:1", "matrix", "const int a; const int b;"
    )
    assert (
        matrices == "a=1, b\\k:\n\t0\t1\n3\t4\t5\n4\t5\t6\n\na=2, b\\k:\n\t0\t1\n3\t5\t6\n4\t6\t7\n"
    )


@pytest.mark.parametrize(
    ("switch", "lines", "status", "verdicts"),
    [
        ("-test", ["1/6", "1/6"], 0, 2),
        ("-test", ["1/5", "1/6"], 1, 1),
        ("-testall", ["1/5", "1/6"], 1, 2),
        ("-testall", ["Error:type"], 1, 1),
    ],
)
def test_tests(
    switch: str, lines: list[str], status: int, verdicts: int, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [w for line in lines for w in ("-pf", f"// RESULT: {line}\nP=? [ F d=6 ]")]
    assert main([DIE, switch, *words]) == status
    assert capsys.readouterr().out.count("Testing result:") == verdicts


def _start(*words: str) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    environment.pop("PYTHONUNBUFFERED", None)  # what has been found must be seen at once without it
    command = [sys.executable, "-m", "symcheck", *words]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        preexec_fn=_heard,
    )


def _heard() -> None:
    """Ctrl-C counts, as in a terminal: what a shell starts in the background, maybe these tests, ignores it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
def test_output_that_nobody_wants_may_be_closed(closed: str) -> None:
    number = {"stdout": 1, "stderr": 2}[closed]
    command = [
        "/bin/sh",
        "-c",
        f'exec "$@" {number}>&-',
        "sh",
        sys.executable,
        "-m",
        "symcheck",
        DIE,
        "-pf",
        "P=? [ F d=6 ]",
    ]
    ended = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert len(results(ended.stdout)) == (0 if closed == "stdout" else 1)


def test_time_limit(write, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    started = time.perf_counter()
    assert main([write(ENDLESS), "-ex", "-timeout", "1"]) == 3
    assert time.perf_counter() - started < 20
    assert "time limit" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("number", "status", "message"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "by SIGTERM")],
)
def test_a_signal_ends_a_run_with_a_message(write, number: int, status: int, message: str) -> None:  # type: ignore[no-untyped-def]
    process = _start(write(ENDLESS), "-ex", "-timeout", "60")
    assert process.stdout is not None
    while not process.stdout.readline().startswith("Variables:"):
        assert process.poll() is None
    time.sleep(0.5)
    process.send_signal(number)
    try:
        _, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == status
    assert message in errors
    assert "Traceback" not in errors


def test_an_interrupt_that_has_no_effect_is_repeated(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is interrupted may be code that cannot raise, such as a destructor; Python then goes on."""

    def deaf(_: object) -> int:
        for _ in range(3):
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                time.sleep(0.3)
        raise AssertionError

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    monkeypatch.setattr("symcheck.cli.entry_point.run", deaf)
    try:
        assert main([DIE]) == 130
        assert capsys.readouterr().err == "error: interrupted by Ctrl-C\n"
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


def test_closed_pipe() -> None:
    process = _start(DIE, DIE_PCTL)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.wait(60) == 1
    message = "error: cannot write the output: its reader has closed the pipe\n"
    assert process.stderr.read() == message
    process.stderr.close()


def test_stages_are_shown_in_a_line() -> None:
    import symcheck

    model = symcheck.load(DIE)
    stages = (
        model,
        model.program,
        symcheck.parse_properties_file(DIE_PCTL),
        model.bound,
        model.engine,
        model.check("P=? [ F d=6 ]"),
    )
    assert [repr(stage) for stage in stages if len(repr(stage)) > 200] == []
    assert "module" in repr(model.program)


def test_one_quotient_for_several_properties(capsys):
    assert main([DIE, "-pf", "P=? [ F d=6 ]; P=? [ F<=4 d=6 ]; E [ F d=6 ]", "-bisim"]) == 0
    shown = capsys.readouterr().out
    assert re.search(
        r"Bisimulation: 13 states -> 5, common to 2 of 3 properties \(\d rounds on explicit states; \d\.\d\d s in all\)",
        shown,
    )
    assert shown.count("13 states -> 5 by bisimulation") == 2
    assert "arning" not in shown
    main([DIE, "-pf", "P=? [ F d=6 ]", "-bisim"])
    assert "Bisimulation:" not in capsys.readouterr().out


def test_compiled_modules_of_another_version_are_named(monkeypatch, capsys):
    def broken(*_: object, **__: object) -> None:
        raise ImportError(
            "cannot import name 'f' from 'symcheck.kernels.rows.submatrix'",
            name="symcheck.kernels.rows.submatrix",
        )

    monkeypatch.setattr("symcheck.engines.registry.build", broken)
    assert main([DIE]) == 1
    assert "build again (pip install -e ." in capsys.readouterr().err


def test_a_small_run_imports_nothing_large_that_it_does_not_need() -> None:
    """Each of these takes as long as the check itself."""
    program = (
        "import sys\n"
        "from symcheck.cli import main\n"
        f"status = main({[DIE, DIE_PCTL]!r})\n"
        "print(*sorted(sys.modules), file=sys.stderr)\n"
        "sys.exit(status)\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120
    )
    imported = set(run.stderr.split())
    assert "symcheck.check.checker" in imported
    assert not imported & {"dd", "matplotlib", "networkx", "numpy.ma", "numpy.random", "scipy"}
