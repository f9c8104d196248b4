"""Answers of other model checkers beside ours. Storm is asked itself; PRISM is a script that prints what we want."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path

import pytest

import symcheck
from symcheck.check.result import Certified, Estimate, Exact, Result
from symcheck.cli import main
from symcheck.errors import MemoryLimitError, UnsupportedError, UsageError
from symcheck.peers.compare import Agreement, _relation
from symcheck.peers.programs import PeerError, _read

MODELS = Path(__file__).parents[2] / "models"
DIE = MODELS / "die/die.pm"
SAME, DIFFERENT, UNANSWERED = Agreement


@pytest.fixture
def prism(tmp_path, monkeypatch):
    """Makes a program `prism` that runs a script of the shell; its words are appended to a file."""

    def install(script: str) -> Path:
        program, log = tmp_path / "prism", tmp_path / "log"
        program.write_text(f'#!/bin/sh\necho "$@" >> {log}\n{script}\n')
        program.chmod(0o755)
        monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
        return log

    return install


def test_storm_agrees_about_the_die():
    pytest.importorskip("stormpy")
    text = """const int k; label "six" = d=6; "face": P=? [ F d=k ];
      P>=1/6 [ F "six" ]; R{"tosses"}=? [ F "done" ]; "likely": P>=1/6 [ F<=k "six" ]; P=? [ F "likely" ];"""
    found = symcheck.compare(DIE, text, "k=6")
    assert found.summary == "5 same, 0 different, 0 unanswered"
    assert [p.peer_value for p in found][1:2] == [True]
    frame = found.to_frame()
    assert frame["k"].fillna("").tolist() == ["6", "", "", "6", "6"]
    assert frame["peer"].tolist()[0] == pytest.approx(1 / 6)
    assert frame["difference"].abs().max() < 1e-12


def test_constants_have_several_values():
    pytest.importorskip("stormpy")
    found = symcheck.compare(
        MODELS / "crowds/crowds.pm",
        "const int c; P=? [ F<=c phase=0 & runs=0 ]",
        "TotalRuns=2:3,CrowdSize=3,c={5,20}",
    )
    assert [p.constants for p in found] == [
        {"TotalRuns": r, "CrowdSize": "3", "c": c} for r in "23" for c in ("5", "20")
    ]
    assert {p.agreement for p in found} == {SAME}


def test_what_one_of_the_two_does_not_answer_is_no_difference(capsys):
    pytest.importorskip("stormpy")
    words = [
        "compare",
        str(DIE),
        "-pf",
        "E [ F d=6 ]; P=? [ F nowhere ]; P=? [ F d=2 ]",
        "-with",
        "storm",
    ]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "1 same, 0 different, 2 unanswered (1 by symcheck, 1 by Storm)" in out
    assert "Storm: it has no CTL operator E" in out
    assert "symcheck: -pf:1:22: error" in out


@pytest.mark.parametrize("text", ["ctmc", "mdp"])
def test_a_model_is_given_with_the_type_that_it_is_read_as(text):
    pytest.importorskip("stormpy")
    model = (
        symcheck.load(MODELS / "queue/queue.sm", type="dtmc", check_sums=False)
        if text == "mdp"
        else symcheck.load(MODELS / "queue/queue.sm")
    )
    query = "P=? [ F<=3 n=2 ]" if text == "ctmc" else "n=0"
    assert symcheck.compare(model, query)[0].agreement is SAME


def test_models_in_jani_are_given_in_the_prism_language(tmp_path, monkeypatch):
    pytest.importorskip("stormpy")
    stakes, path = MODELS / "gambler/stakes", str(tmp_path / "g.jani")
    assert main([f"{stakes}.nm", f"{stakes}.pctl", "-exportjani", path]) == 0
    assert symcheck.compare(symcheck.load(path), "Pmax=? [ F money=8 ]")[0].agreement is SAME
    assert main(["compare", path, "-with", "storm", "-prop", "1"]) == 0


def test_prism_reads_the_files_themselves(prism, tmp_path):
    log = prism("echo 'Result: 0.1666666 (exact floating point)'")
    properties = tmp_path / "p.pctl"
    properties.write_text('const int k; "a": P=? [ F d=1 ];\n"b": P=? [ F d=k ];')
    found = symcheck.compare(DIE, properties, "k=2:3", peer="prism -s -epsilon 1e-9")
    assert [p.title for p in found] == ["a", "b (k=2)", "b (k=3)"]
    asked = [line.split() for line in log.read_text().splitlines()]
    assert [words[2:] for words in asked] == [
        ["-prop", "1", "-s", "-epsilon", "1e-9"],
        ["-prop", "2", "-const", "k=2", "-s", "-epsilon", "1e-9"],
        ["-prop", "2", "-const", "k=3", "-s", "-epsilon", "1e-9"],
    ]
    assert all(not Path(words[0]).exists() for words in asked)


def test_a_wrong_answer_is_found_and_named(prism, capsys):
    prism("echo 'Result: 0.16666 (value in the initial state)'")
    words = ["compare", str(DIE), "-pf", "P=? [ F d=6 ]; d=0", "--with", "prism"]
    assert main(words) == 1
    out = capsys.readouterr().out
    assert "PRISM is too low: at least 0.1666666667 is proved up to rounding" in out
    assert "PRISM answers in another form" in out
    prism("echo 'Result: false'")
    assert main(["compare", str(DIE), "-pf", "P>=1/6 [ F d=6 ]", "-with", "prism"]) == 1
    assert "PRISM is wrong: the answer of symcheck is proved" in capsys.readouterr().out


def test_a_peer_without_an_answer(prism):
    prism("echo 'Error: Out of memory.'; exit 1")
    assert symcheck.compare(DIE, "d=0", peer="prism")[0].explanation == "PRISM: Out of memory."
    prism("exit 3")
    found = symcheck.compare(DIE, "d=0", peer="prism")[0]
    assert found.explanation == "PRISM: it ended with status 3 and without a result"
    prism("sleep 60 & wait")
    found = symcheck.compare(DIE, "d=0", peer="prism", time_limit=0.2)[0]
    assert (found.agreement, found.explanation) == (UNANSWERED, "PRISM: no answer in 0.2 seconds")


def test_a_peer_that_runs_out_of_memory_leaves_the_other_rows(prism, capsys):
    prism(
        "case $* in *'-prop 1'*) kill -9 $$;; *'-prop 2'*) echo 'ERROR: std::bad_alloc';; *) echo 'Result: true'; esac"
    )
    found = symcheck.compare(DIE, "d=0; s=0; true", peer="prism")
    assert [p.explanation for p in found] == [
        "PRISM: it was ended by SIGKILL: perhaps the memory is exhausted",
        "PRISM: there is not enough memory",
        "",
    ]
    assert found.summary == "1 same, 0 different, 2 unanswered (2 by PRISM)"


def test_a_memory_limit_of_ours_leaves_the_other_rows(prism, monkeypatch):
    prism("echo 'Result: true'")
    check = symcheck.Model.check_instance

    def limited(model, instance, **others):
        if instance.index == 0:
            raise MemoryLimitError("the memory limit was reached")
        return check(model, instance, **others)

    monkeypatch.setattr(symcheck.Model, "check_instance", limited)
    found = symcheck.compare(DIE, "d=0; true", peer="prism")
    assert [p.explanation for p in found] == ["symcheck: the memory limit was reached", ""]


def test_rows_are_kept_when_the_run_is_stopped(prism, capsys):
    prism("case $* in *'-prop 2'*) sleep 60;; *) echo 'Result: true'; esac")
    assert main(["compare", str(DIE), "-pf", "d=0; s=0", "-with", "prism", "-timeout", "1"]) == 3
    out, err = capsys.readouterr()
    assert "1 same, 0 different, 0 unanswered" in out
    assert "the time limit was reached" in err


def test_a_run_without_two_answers_fails(prism, capsys):
    prism("echo 'Error: no such thing.'; exit 1")
    assert main(["compare", str(DIE), "-pf", "d=0", "-with", "prism"]) == 1
    assert "there are no two answers to compare" in capsys.readouterr().out


def test_a_faulty_model_is_an_error_of_the_run(prism, tmp_path, capsys):
    prism("echo 'Result: true'")
    model = tmp_path / "m.pm"
    model.write_text("dtmc module m x : [0..1]; [] x=0 -> 0.5 : (x'=1); endmodule")
    assert main(["compare", str(model), "-pf", "true", "-with", "prism"]) == 1
    assert "probabilities sum to 0.5" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("multi(Pmax=? [F money=8], Pmax=? [F money=0])", "its answer is a front"),
        ("quantile(min B, Pmax>0.9 [ F<=B money=8 ])", "its answer is no single number"),
        ("multilex(Pmax=? [F money=8], Pmax=? [F money=0])", "no call that answers multilex"),
        ("Pmax=? [ F money=8 ] + 1", "it has no arithmetic with values of operators"),
        ("-Pmax=? [ F money=8 ]", "it has no arithmetic with values of operators"),
        ("E [ F money=8 ]", "it has no CTL operator E"),
        ("Pmax=? [ F money=8 {money=1} ]", "it has no filters in braces"),
        ("filter(first, Pmax=? [ F money=8 ])", "only its filters min, max, sum, avg"),
        ("filter(max, Pmax=? [ G<=3 money>2 ])", "it has no bounds at G, W and R within"),
        ("filter(max, Pmax=? [ F money=8 ]) > 0.1", "it has no filter within another formula"),
        ("Pmax=? [ F (G<=3 money>2) ]", "it has no bounds at G, W and R within other formulas"),
    ],
)
def test_storm_gives_reasons_in_its_words_and_not_in_those_of_python(text, message):
    pytest.importorskip("stormpy")
    found = symcheck.compare(MODELS / "gambler/stakes.nm", text)[0]
    assert message in found.explanation
    assert not any(word in found.explanation for word in ("object", "Exception", "attribute"))


@pytest.mark.parametrize(
    "text",
    [
        'R{"tosses"}=? [ C discount=0.9 ]',
        'R{"tosses"}=? [ C<=5 discount=0.9 ]',
        'R{1}=? [ C{"tosses"}<=3 ]',
        'P=? [ F{"tosses"}<=3 d>0 ]',
        'P=? [ G{"tosses"}<=2 d=0 ]',
        "P=? [ F d=6 || F d>3 ]",
        'quantile(min B, P>0.9 [ F{"tosses"}<=B d>0 ])',
        "P=? [ G<=3 d=0 ]",
        "P>=0.2 [ G<=3 d=0 ]",
        "P=? [ s<3 W d=6 ]",
        "P=? [ (d>0) R<=3 (s<7) ]",
        "P=? [ F d=6 => F d=5 ]",
        "P=? [ F (d=6 <=> s=7) ]",
        '"init" => P>=0.1 [ F d=6 ]',
        "P=? [ F d=6 ] > 0.1",
        "0.1 > P=? [ F d=6 ]",
        "filter(max, P=? [ F d=6 ], s<3)",
        "filter(avg, P=? [ F d=6 ])",
        "filter(sum, P=? [ F<=5 d=6 ], s<3)",
        "filter(range, P=? [ F d=6 ], s<3)",
        "filter(state, P=? [ F d=6 ], s=6)",
        "filter(count, P>=0.5 [ F d=6 ])",
        "filter(forall, P>=0.5 [ F d=6 ], s=6)",
        "filter(exists, P>=0.5 [ F d=6 ], s=1)",
    ],
)
def test_storm_answers_what_it_spells_differently(text):
    pytest.importorskip("stormpy")
    found = symcheck.compare(DIE, text)[0]
    assert (found.agreement, found.explanation) == (SAME, "")


def test_bounds_of_time_at_g_are_time_in_storm_too():
    """Storm takes `!(F<=3 a)` of a CTMC for three steps; the complement of `F<=3 a` is asked for."""
    pytest.importorskip("stormpy")
    assert symcheck.compare(MODELS / "queue/queue.sm", "P=? [ G<=3 n!=2 ]")[0].agreement is SAME


def test_long_texts_and_fronts_take_several_lines():
    pytest.importorskip("stormpy")
    text = 'multi(Pmax=? [ F money=8 ], R{"bets"}max=? [ C<=9 ])'
    lines = str(symcheck.compare(MODELS / "gambler/stakes.nm", text)).splitlines()
    assert "… 2 more]" in lines[-2]
    assert max(map(len, lines)) < 150
    assert sum("[(0.256,2.24)" in line for line in lines) == 1


def test_the_program_storm_gets_the_filter_in_its_words(tmp_path, monkeypatch):
    program = tmp_path / "storm"
    program.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/log\necho "Result: 0.25"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    found = symcheck.compare(DIE, "filter(max, P=? [ X s=7 ]); P=? [ G<=3 d=0 ]", peer="storm -v")
    assert found[1].agreement is DIFFERENT
    assert found[1].peer_value == (0.75, 0.75)
    assert "--prop filter(max, P=? [ X s=7 ], true)" in (tmp_path / "log").read_text()


def test_a_missing_peer_is_told_first(monkeypatch, capsys):
    monkeypatch.setenv("PATH", "")
    assert main(["compare", "nowhere.pm", "-pf", "true", "-with", "prism"]) == 2
    assert (
        capsys.readouterr().err
        == "error: prism is not installed: there is no program prism in PATH\n"
    )
    monkeypatch.setattr("symcheck.peers.programs.find_spec", lambda name: None)
    with pytest.raises(UsageError, match="no program storm in PATH, and no Python package stormpy"):
        symcheck.compare(DIE, "true")
    monkeypatch.undo()
    with pytest.raises(UsageError, match="there is no peer 'spin'; there are storm, prism"):
        symcheck.compare(DIE, "true", peer="spin")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["compare", str(DIE), "-pf", "true"], "compare needs a peer"),
        ([str(DIE), "-pf", "true", "-with", "storm"], "-with is a switch of compare"),
    ],
)
def test_compare_and_its_switch_belong_together(words, message, capsys):
    assert main(words) == 2
    assert message in capsys.readouterr().err


def test_a_model_without_commands_is_refused(prism):
    prism("echo 'Result: true'")
    with pytest.raises(UnsupportedError, match="this model has none"):
        symcheck.compare(symcheck.from_matrix([[1.0]]), "true", peer="prism")


@pytest.mark.parametrize(
    ("value", "accuracy", "theirs", "agreement", "explanation"),
    [
        (0.5, Certified(0.4, 0.6), (0.55, 0.55), SAME, "P is within the proved bounds"),
        (0.5, Certified(0.4, 0.6), (0.7, 0.7), DIFFERENT, "P is too high: at most 0.6 is proved"),
        (0.5, Certified(0.4, 0.6), (nan, nan), DIFFERENT, "P is too low: at least 0.4 is proved"),
        (0.5, Estimate(), (0.6, 0.6), DIFFERENT, "undecided: the value of symcheck is an estimate"),
        (0.5, Exact(), (0.5000004, 0.5000004), SAME, ""),
        (inf, Exact(), (inf, inf), SAME, ""),
        (inf, Exact(), (9.0, 9.0), DIFFERENT, "P is too low: at least inf is proved"),
        (nan, Exact(), (nan, nan), SAME, ""),
        ((0.1, 0.5), Exact(), (0.1, 0.5), SAME, ""),
        ((0.1, 0.5), Exact(), (0.1, 0.6), DIFFERENT, "P is too high: at most 0.5 is proved"),
        ((0.1, 0.5), Exact(), (0.2, 0.5), DIFFERENT, "undecided: the proved bounds enclose both intervals"),
        ([(0.1, 0.5)], Exact(), (0.1, 0.6), UNANSWERED, "P answers in another form"),
    ],
)  # fmt: skip
def test_bounds_decide(value, accuracy, theirs, agreement, explanation):
    ours = Result(value, accuracy)
    bounds = None if isinstance(accuracy, Estimate) or isinstance(value, list) else ours.bounds
    assert _relation(ours, bounds, theirs, "P", 1e-6) == (agreement, explanation)


@pytest.mark.parametrize(
    ("output", "answer"),
    [
        ("Result: true (property satisfied in the initial state)", True),
        ("Result: 0.25 (+/- 1.0E-7 estimated; rel err 4.0E-7)", (0.25, 0.25)),
        ("Result (for initial states): 0.25", (0.25, 0.25)),
        ("Result: [0.25,0.5] (range of values over initial states)", (0.25, 0.5)),
        ("Result: Infinity", (inf, inf)),
        ("Result (for initial states): inf", (inf, inf)),
    ],
)
def test_results_are_read(output, answer):
    assert _read(f"Model checking: x\n\n{output}\n", 0) == answer


def test_results_that_are_none():
    for output, message in (
        ("Result: [(1,2)]", "its result is not a number"),
        ("ERROR (x.cpp:3): no such thing", "no such thing"),
        ("Segmentation fault", "status 139"),
    ):
        with pytest.raises(PeerError, match=message):
            _read(output, 139)
