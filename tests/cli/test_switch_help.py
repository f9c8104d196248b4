"""-help SWITCH, completion in shells, the manual page: what the parser knows."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from symcheck.cli import main
from symcheck.cli.switches.arguments import make_parser
from symcheck.cli.switches.switch_help import SHELLS, completion
from symcheck.options import METHODS, OPTIONS
from symcheck.peers.programs import PEERS

ROOT = Path(__file__).parents[2]


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = main(list(words))
    found = capsys.readouterr()
    return status, found.out, found.err


def script_of(shell: str) -> str:
    parser = make_parser()
    return completion(shell, parser, parser.switches())


@pytest.mark.parametrize("option", [o for o in OPTIONS if o.switches], ids=lambda o: o.name)
def test_each_option_is_explained(option, capsys):
    for switch in option.switches:
        status, out, _ = printed(capsys, "-help", switch.names[-1])
        assert status == 0
        assert option.sentence in out
        assert f"-{switch.names[0]}" in out
        assert f"{option.name}=" in out


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("const", "-const X=V"),
        ("-exportresults", ".parquet"),
        ("--step", "step through the model"),
        ("-gs", "-gs has no effect: the method is chosen"),
        ("paramsplit", "-paramsplit is not supported: functions of parameters are exact"),
    ],
)
def test_other_switches_are_explained(word, message, capsys):
    status, out, _ = printed(capsys, "-help", word)
    assert (status, message in out) == (0, True)


def test_compare_explains_itself(capsys):
    for words in (["compare", "-help"], ["-help", "compare"]):
        status, out, _ = printed(capsys, *words)
        assert (status, "symcheck compare MODEL PROPERTIES -with PEER" in out) == (0, True)


def test_an_unknown_switch_has_a_hint(capsys):
    status, _, err = printed(capsys, "-help", "epsiln")
    assert status == 2
    assert "there is no switch -epsiln\n  hint: did you mean -epsilon?" in err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["-javaversion"], "no Java virtual machine"),
        (["-version"], "symcheck "),
        (["-help"], "-exportresults FILE[:KIND]"),
        (["-?"], "Exit status"),
    ],
)
def test_information(words, expected, capsys):
    status, out, err = printed(capsys, *words)
    assert (status, err) == (0, "")
    assert expected in out


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_of_a_shell_is_correct(shell, tmp_path):
    """Every switch is in it, and the shell reads it, if it is installed."""
    script = script_of(shell)
    for description in make_parser().switches():
        for name in description.names:
            assert name == "-?" or (f" -o {name[1:]} " if shell == "fish" else name) in script
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    path = tmp_path / "script"
    path.write_text(script)
    ran = subprocess.run([shell, "-n", str(path)], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (["-exporttransd"], {"-exporttransdot", "-exporttransdotstates"}),
        (["-maxi"], {"-maxiters"}),
        (["--maxi"], {"--maxiters"}),
        (["-method", ""], set(METHODS)),
        (["--method", "pow"], {"power"}),
        (["-completion", ""], set(SHELLS)),
        (["-with", ""], set(PEERS)),
        (["-simmethod", "a"], {"aci", "apmc"}),
        (["-help", "exporttransd"], {"exporttransdot", "exporttransdotstates"}),
        (["-exporttrans", "di"], {"die.pm", "die.pctl"}),
        (["di"], {"die.pm", "die.pctl"}),
        (["-epsilon", "d"], set()),
    ],
)
def test_bash_completes(line, expected, tmp_path):
    for name in ("die.pm", "die.pctl"):
        (tmp_path / name).touch()
    script = script_of("bash")
    words = " ".join(f"'{word}'" for word in ["symcheck", *line])
    asks = f"COMP_WORDS=({words}); COMP_CWORD={len(line)}; _shtab_symcheck; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    ran = subprocess.run(
        ["bash", "-c", f"{script}\n{asks}"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert (set(ran.stdout.split()), ran.stderr) == (expected, "")


@pytest.mark.skipif(shutil.which("man") is None, reason="man is not installed")
def test_the_manual_page_is_read_without_a_warning():
    page = str(ROOT / "docs" / "symcheck.1")
    ran = subprocess.run(["man", "-l", "--warnings", page], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert "-exportresults" in ran.stdout
