"""Tests of properties: counts, reports, and the exit status that says whether all passed."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import SyntaxFault, UsageError

DIE = Path(__file__).parents[3] / "models/die/die.pm"
PROPERTIES = """const int k;
// RESULT (k=6): 1/6
// RESULT (k=7): 0
"face": P=? [ F d=k ];
// RESULT: 1/5
"wrong": P=? [ F d=1 ];
// RESULT: Error
"refused": Pmin=? [ F d=1 & "nowhere" ];
// RESULT: Error
"answered": d=0;
// RESULT: ?
"unknown": P=? [ F d=2 ];
P=? [ F d<3 ];
"""
VERDICTS = ["PASS", "FAIL", "PASS", "FAIL", "NOT TESTED", "NOT TESTED"]


@pytest.fixture
def properties(tmp_path: Path) -> Path:
    path = tmp_path / "p.pctl"
    path.write_text(PROPERTIES)
    return path


def test_the_library_and_the_command_line_agree(properties, tmp_path, capsys):
    tests = symcheck.load(DIE).test(properties, "k=6")
    assert [t.verdict.kind.value for t in tests] == VERDICTS
    assert [t.line for t in tests] == [4, 6, 8, 10, 12, 13]
    assert [t.name for t in tests.failed] == ["wrong", "answered"]
    assert not tests.ok
    assert tests.summary == (
        "2 passed, 2 failed, 2 not tested (1: the expected result is unknown; 1: no RESULT line)"
    )
    report = tmp_path / "t.json"
    words = [str(DIE), str(properties), "-const", "k=6", "-exporttests", str(report)]
    assert main([*words, "-testall"]) == 1
    assert f"Tests: {tests.summary}\n  wrong: FAIL: 1/5 was expected" in capsys.readouterr().out
    written = json.loads(report.read_text())
    assert [t["verdict"] for t in written["tests"]] == VERDICTS
    assert [t["line"] for t in written["tests"]] == [4, 6, 8, 10, 12, 13]
    assert (written["passed"], written["failed"], written["not tested"]) == (2, 2, 2)
    assert main([*words, "-test"]) == 1
    assert [t["verdict"] for t in json.loads(report.read_text())["tests"]] == VERDICTS[:2]


def test_a_run_without_failures_ends_with_0(properties, tmp_path):
    words = [str(DIE), str(properties), "-testall", "-const", "k=5:7", "-prop", "face,unknown"]
    assert main([*words, "-exporttests", str(tmp_path / "t.xml")]) == 0
    suite = ElementTree.parse(tmp_path / "t.xml").getroot()[0]
    assert suite.attrib | {"time": ""} == {
        "name": f"{DIE} {properties}",
        "tests": "4",
        "failures": "0",
        "errors": "0",
        "skipped": "2",
        "time": "",
    }
    assert [case.get("name") for case in suite] == [f"face (k={k})" for k in (5, 6, 7)] + [
        "unknown"
    ]
    assert suite[0].find("skipped").get("message") == "no RESULT line has these constants"
    assert suite[1].find("skipped") is None


def test_processes_report_the_same_tests(tmp_path):
    model, properties = tmp_path / "m.pm", tmp_path / "p.pctl"
    model.write_text("dtmc const int N; module m x:[0..9]; [] x<N -> (x'=x+1); endmodule")
    properties.write_text("// RESULT (N=3): 1\n// RESULT: 0\nP=? [ F x=3 ]")
    reports = []
    for jobs in "13":
        path = tmp_path / f"{jobs}.json"
        words = [str(model), str(properties), "-const", "N=1:4", "-jobs", jobs, "-testall"]
        assert main([*words, "-exporttests", str(path)]) == 1
        tests = json.loads(path.read_text())["tests"]
        reports.append([(t["N"], t["verdict"]) for t in tests])
    assert reports[0] == reports[1]
    assert reports[0] == [("1", "PASS"), ("2", "PASS"), ("3", "PASS"), ("4", "FAIL")]


def test_faults_of_the_text_are_tests_too(tmp_path, capsys):
    path = tmp_path / "p.pctl"
    path.write_text("// RESULT: Error\nP=? [ F d= ];\nP=? [ F = ];\n// RESULT: 1\nd=0+;\nd=0")
    assert main([str(DIE), str(path), "-testall", "-exporttests", str(tmp_path / "t.json")]) == 1
    tests = json.loads((tmp_path / "t.json").read_text())["tests"]
    assert [(t["line"], t["verdict"]) for t in tests] == [
        (2, "PASS"),
        (3, "FAIL"),
        (5, "FAIL"),
        (6, "NOT TESTED"),
    ]
    with pytest.raises(SyntaxFault):
        symcheck.load(DIE).test(path)


BROKEN = "dtmc module m x : [0..1]; [] x=0 -> (x'=x+2); endmodule"


def test_an_error_of_the_model_is_the_result_of_its_properties(tmp_path, capsys):
    path = tmp_path / "m.pm"
    path.write_text(BROKEN)
    text = "// RESULT: Error\nP=? [ F x=1 ];\n// RESULT: 1\nP=? [ F x=0 ];"
    assert [t.verdict.kind.value for t in symcheck.loads(BROKEN).test(text)] == ["PASS", "FAIL"]
    assert main([str(path), "-testall", "-pf", text]) == 1
    assert "Tests: 1 passed, 1 failed" in capsys.readouterr().out
    assert main([str(path), "-testall", "-pf", "P=? [ F x=1 ]"]) == 1  # no line expects it
    assert "error" in capsys.readouterr().err


def test_a_run_that_an_error_ends_is_no_success(properties, tmp_path, capsys):
    report = tmp_path / "t.xml"
    words = [str(DIE), str(properties), "-testall", "-exporttests", str(report)]
    assert main([*words, "-prop", "7"]) == 1
    case = ElementTree.parse(report).getroot()[0][0]
    assert (case.get("name"), case[0].tag) == ("the run", "error")
    assert "there is no property '7'" in case[0].get("message")


def test_any_text_becomes_xml(tmp_path):
    tests = symcheck.load(DIE).test('// RESULT: <&">\x01\nd=0')
    tests.save(tmp_path / "t.xml")
    case = ElementTree.parse(tmp_path / "t.xml").getroot()[0][0]
    assert case[0].get("message") == tests[0].verdict.message.replace("\x01", "\ufffd")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-testall", "-exporttests", "t.txt"], "neither .xml (JUnit) nor .json"),
        (["-exporttests", "t.xml"], "no effect without -test or -testall"),
        (["-testall", "-exporttests", "nowhere/t.xml"], "there is no folder 'nowhere'"),
    ],
)
def test_faults_of_the_switch_are_found_first(words, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([str(DIE), *words]) == 2
    found = capsys.readouterr()
    assert message in found.err
    assert not found.out


def test_tests_as_a_table(properties):
    tests = symcheck.load(DIE).test(properties, "k=6")
    assert str(tests).splitlines()[1].split() == [
        "face",
        "(k=6)",
        "1/6",
        "0.16666666666666669",
        "PASS",
    ]
    assert str(tests).splitlines()[-1] == tests.summary
    assert tests.to_frame()["verdict"].tolist() == VERDICTS
    assert tests[:2].summary == "1 passed, 1 failed"
    assert repr(tests[:1]) == "<PropertyTests: 1 passed, 0 failed>"
    with pytest.raises(UsageError, match="neither"):
        tests.save("t.html")
