"""Mistakes of newcomers at the command line: each message says what is meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from symcheck.cli import main

DIE = (Path(__file__).parents[2] / "models/die/die.pm").read_text()
HEAD = "dtmc\nmodule m\n  x : [0..2];\n"
TAIL = "\nendmodule\n"


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """Runs the command line in a folder with some files; gives the status and all output."""
    monkeypatch.chdir(tmp_path)
    Path("die.pm").write_text(DIE)
    Path("die.pctl").write_text("P=? [ F d=6 ]")
    Path("empty.pm").touch()
    Path("empty.pctl").touch()
    Path("binary.pm").write_bytes(bytes(range(256)))
    Path("bad.pm.gz").write_bytes(b"x")
    Path("crlf.pm").write_bytes(DIE.replace("\n", "\r\n").encode())
    Path("bom.pm").write_bytes(b"\xef\xbb\xbf" + DIE.encode())
    Path("folder").mkdir()

    def run(*words: str) -> tuple[int, str]:
        status = main(list(words))
        printed = capsys.readouterr()
        assert "Traceback" not in printed.out + printed.err
        return status, printed.out + printed.err

    return run


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "no model file is given\n  hint: symcheck MODEL [PROPERTIES]"),
        ("nosuch.pm", "cannot read nosuch.pm"),
        ("folder", "cannot read folder: Is a directory"),
        ("die.pctl die.pm", "hint: symcheck MODEL PROPERTIES"),
        ("die.pctl", "this is a property, where a model is expected"),
        ("die.pm die.pctl x", "'x' is one file too many"),
        ("empty.pm", "a model needs at least one module"),
        ("empty.pm", "hint: the text is empty"),
        ("binary.pm", "not a UTF-8 text file"),
        ("bad.pm.gz", "error: cannot read bad.pm.gz: not a whole .gz file\n"),
        ("die.pm P=?[F|d=6]", "hint: -pf 'P=?[F d=6]' checks a property"),
        ("P=?[F|d=6] die.pm", "hint: -pf 'P=?[F d=6]' checks a property"),
        ("die.pm -const N=3 p=0.5", "hint: commas separate constants"),
        ("die.pm -const N=1:0:3", "the step of the range 'N=1:0:3' is not above 0"),
        ("--prism die.pm", "there is no switch --prism\n  hint: the model needs no switch"),
        ("die.pm die.pctl --sound", "hint: bounds are proved without a switch"),
        ("die.pm die.pctl --prop P=?[F|d=6]", "hint: -pf TEXT checks the properties of a text"),
        ("die.pm -const N==3", "cannot read 'N==3'\n  hint: constants are given as N=3,p=0.5"),
        ("die.pm -const N=3;p=0.5", "cannot read 'N=3;p=0.5'\n  hint: constants are given as"),
        ("nosuch.drn", "error: cannot read nosuch.drn: there is no such file\n"),
        ("die.pm -const N={1,2", "lacks a bracket: a list is written as {V,W}"),
        ("die.pm -engine explicit", "-ex, -s, -h and -m choose an engine"),
        ("die.pm --engine=hybrid", "-ex, -s, -h and -m choose an engine"),
        ("die.pm -sparce", "did you mean -sparse?"),
        ("die.pm -epsilon", "-epsilon: expected a value"),
        ("die.pm -epsilon abc", "-epsilon: 'abc' is not a number"),
        ("die.pm -epsilon 1/0", "-epsilon: '1/0' is not a number"),
        ("die.pm die.pctl -prop 9", "there is no property '9'\n  hint: there is 1"),
    ],
)
def test_files_and_switches(words, message, said):
    status, out = said(*(word.replace("|", " ") for word in words.split()))
    assert status in (1, 2)
    assert message in out


def test_texts_without_a_property_are_told(said):
    assert "Warning: empty.pctl has no property" in said("die.pm", "empty.pctl")[1]
    assert "Warning: -pf has no property" in said("die.pm", "-pf", "")[1]


def test_the_accuracy_may_be_a_fraction(said):
    assert said("die.pm", "die.pctl", "-epsilon", "1/1000")[0] == 0


def test_a_refused_property_without_result_line_is_not_tested_like_every_other(said):
    Path("refused.props").write_text(
        'P=? [ F "nolabel" ];\n<<x>> P>=0.5 [ F d=6 ];\n// RESULT: 1/6\nP=? [ F d=6 ];\n'
    )
    status, out = said("die.pm", "refused.props", "-testall")
    assert status == 0
    assert "Tests: 1 passed, 0 failed, 2 not tested" in out


@pytest.mark.parametrize("name", ["crlf.pm", "bom.pm"])
def test_windows_files_are_read(name, said):
    assert said(name, "-pf", "d=0")[0] == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("P=? [ F d=6", "']' is missing"),
        ("P=? F d=6", "its path stands in brackets: P=? [ F … ]"),
        ("P=? ( F d=6 )", "its path stands in brackets"),
        ("P=? { F d=6 }", "its path stands in brackets"),
        ("P>=0.5", "its path stands in brackets"),
        ("p=? [ F d=6 ]", "write P=?"),
        ("Prob=? [ F d=6 ]", "write P=?"),
        ("P=0.5 [ F d=6 ]", "compare with <, <=, > or >="),
        ("P>=1.5 [ F d=6 ]", "which is not a probability"),
        ("P=? [ F d==6 ]", "equality is written ="),
        ("P=? [ F d=6 && s=7 ]", "and is written &"),
        ("P=? [ F d=6 || d=5 ]", "or is written |"),
        ("P=? [ F d=6 and s=7 ]", "write &"),
        ("P=? [ F not d=6 ]", "write !"),
        ("P=? [ F d~6 ]", "hint: write ! for not, or != for unequal"),
        ('P=? [ F "sixx" ]', 'unknown label or property "sixx"'),
        ('P=? [ F "sixx" ]', 'hint: declare it: label "sixx" = …;'),
        ('P=? [ F "six ]', "this quote is not closed"),
        ("P=? [ F 'six' ]", 'write "six"'),
        ("P=? [ F six ]", "the variables are s, d"),
        ("AG d<7", "write A [ G … ]"),
        ("EF d=6", "write E [ F … ]"),
        ("[] d<7", "always is written G: P>=1 [ G … ]"),
        ("<> d=6", "eventually is written F: P>=1 [ F … ]"),
        ("P=? [ [] d<7 ]", "always is written G"),
        ("P=? [ <> d=6 ]", "eventually is written F"),
        ("S=? [ F d=6 ]", "leave the operator out"),
        ("d=6 -> s=7", "implication is written =>"),
        ("D=6", "did you mean d?"),
        ('R{"coin"}=? [ F d=6 ]', "the names are tosses"),
        ("P=? [ F<=-1 d=6 ]", "an upper bound must be finite and non-negative"),
        ("filter(maxx, P=? [ F d=6 ], true)", "did you mean max?"),
        ("P=? [ F d=6 ], P=? [ F d=5 ]", "properties are separated by ;"),
    ],
)
def test_properties(text, message, said):
    status, out = said("die.pm", "-pf", text)
    assert (status, message in out) == (1, True), out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (HEAD + "[] x=0 => (x'=1);" + TAIL, "a command is [action] guard -> updates;"),
        (HEAD + "[] x=0 : (x'=1);" + TAIL, "a command is [action] guard -> updates;"),
        (HEAD + "[] x=0 -> x'=1;" + TAIL, "write (x'=…)"),
        (HEAD + "[] x=0 -> (x=1);" + TAIL, "write (x'=…)"),
        (HEAD + "[] x=0 -> (x'=1)" + TAIL, "';' is missing before 'endmodule'"),
        (HEAD + "[] x=0 -> (x'=1);", "'endmodule' is missing"),
        (HEAD + "x=0 -> (x'=1);" + TAIL, "a command starts with [action] or []"),
        (HEAD + "[] x=0 -> 0.5:(x'=1), 0.5:(x'=2);" + TAIL, "updates are joined by +"),
        (HEAD + "[] x=0 -> (y'=1);" + TAIL, "unknown variable y"),
        (HEAD + "[] x=0 -> (x'=3);" + TAIL, "outside of [0..2]"),
        (HEAD + "[] x=0 -> 0.5:(x'=1);" + TAIL, "add the missing 0.5"),
        (HEAD + "[] x=0 -> if x=1;" + TAIL, "each case is a command"),
        (HEAD + "\t[] x=0 -> (z'=1);" + TAIL, "t.pm:4:12:"),
        ("dtmc\nmodule m\n x:[0,2];" + TAIL, "name : [low..high]"),
        ("dtmc\nmodule m\n x:0..2;" + TAIL, "name : [low..high]"),
        ("dtmc\nmodule m\n int x:[0..2];" + TAIL, "name : [low..high]"),
        ("dtmc\nmodul m\n x:[0..2];" + TAIL, "did you mean 'module'?"),
        ("dmtc\nmodule m\n x:[0..2];" + TAIL, "did you mean 'dtmc'?"),
        ("dtmc;\nmodule m\n x:[0..2];" + TAIL, "leave out the semicolon"),
        ("dtmc\nconst double p=0,5;\n", "a decimal has a point: 0.5"),
        (HEAD + TAIL + "label six = x=2;", 'write "six"'),
        (HEAD + TAIL + "rewards r\n x=1 : 1;\nendrewards", 'write "r"'),
        (HEAD + TAIL + 'rewards "r"\n x=1 -> 1;\nendrewards', "a reward is guard : value;"),
        ("pta\n" + HEAD, "models of type pta"),
        ('{"jani-version": 1}', "the JANI format ends in .jani"),
        ("@type: DTMC\n", "the DRN format ends in .drn"),
        ("2 1\n0 1 1\n", "-importtrans"),
    ],
)
def test_models(text, message, said):
    Path("t.pm").write_text(text)
    status, out = said("t.pm")
    assert (status, message in out) == (1, True), out
