"""The switches that read and write models, and print distributions."""

from __future__ import annotations

import csv
import json
from fractions import Fraction
from pathlib import Path

import pytest

from symcheck.cli import main

DIE = """dtmc
module die
  s : [0..2];
  [] s=0 -> 1/3 : (s'=1) + 2/3 : (s'=2);
endmodule
label "two" = s=2;
rewards "r" s=0 : 2; endrewards
rewards "t" [] true : 3; endrewards
"""
QUEUE = "ctmc module q n:[0..1]; [] n=0 -> 3:(n'=1); [] n=1 -> 1:(n'=0); endmodule"


@pytest.fixture
def die(tmp_path):
    (tmp_path / "die.pm").write_text(DIE)
    return tmp_path


def run(capsys, *words):
    status = main([str(w) for w in words])
    found = capsys.readouterr()
    return status, found.out, found.err


def test_the_single_switches(die, capsys):
    names = {
        "exporttrans": "a.tra",
        "exportstates": "a.sta",
        "exportlabels": "a.lab",
        "exporttransdot": "a.dot",
        "exporttransdotstates": "b.dot",
    }
    words = [w for switch, name in names.items() for w in (f"-{switch}", die / name)]
    status, out, _ = run(
        capsys, die / "die.pm", *words, "-exportrewards", die / "a.srew", die / "a.trew"
    )
    assert status == 0
    assert (
        die / "a.tra"
    ).read_text() == "3 4\n0 1 0.3333333333333333\n0 2 0.6666666666666666\n1 1 1\n2 2 1\n"
    assert (die / "a.sta").read_text() == "(s)\n0:(0)\n1:(1)\n2:(2)\n"
    assert (die / "a.lab").read_text() == '0="init" 1="deadlock" 2="two"\n0: 0\n1: 1\n2: 1 2\n'
    assert (die / "a1.srew").read_text() == '# Reward structure "r"\n# State rewards\n3 1\n0 2\n'
    assert (
        die / "a2.trew"
    ).read_text() == '# Reward structure "t"\n# Transition rewards\n3 2\n0 1 3\n0 2 3\n'
    assert "(0)" not in (die / "a.dot").read_text()
    assert "(0)" in (die / "b.dot").read_text()
    assert f"Exported to '{die / 'a.tra'}'" in out


def test_exact_numbers_and_precision(die, capsys):
    assert "0 1 1/3\n" in run(capsys, die / "die.pm", "-exportmodel", "stdout.tra", "-exact")[1]
    assert (
        "0 1 0.333\n"
        in run(capsys, die / "die.pm", "-exporttrans", "stdout", "-exportprecision", "3")[1]
    )


def test_labels_of_the_properties(die, capsys):
    (die / "p.pctl").write_text('label "late" = "two" | s=1;\nP=? [ F "late" ]\n')
    _, out, _ = run(
        capsys, die / "die.pm", die / "p.pctl", "-exportlabels", "stdout", "-exportproplabels"
    )
    assert '0="init" 1="deadlock" 2="two" 3="late"\n0: 0\n1: 1 3\n2: 1 2 3\n' in out


@pytest.mark.parametrize("engine", ["-s", "-h", "-m", "-ex", "-exact"])
def test_export_and_import(die, engine, capsys):
    status, *_ = run(capsys, die / "die.pm", "-exportmodel", die / "out.all", engine)
    assert status == 0
    (die / "p.pctl").write_text('P=? [ F "two" ];\nR{"t"}=? [ C ];\nR{"r"}=? [ C ];\n')
    status, out, _ = run(capsys, "-importmodel", die / "out.all", die / "p.pctl")
    assert status == 0
    assert [line.split()[1] for line in out.splitlines() if line.startswith("Result:")] == [
        "0.6666666666666666",
        "3.0",
        "2.0",
    ]


def test_import_by_single_switches(die, capsys):
    run(capsys, die / "die.pm", "-exportmodel", die / "out.all")
    words = [
        "-importtrans",
        die / "out.tra",
        "-importstates",
        die / "out.sta",
        "-importlabels",
        die / "out.lab",
    ]
    words += ["-importstaterewards", die / "out1.srew", "-dtmc"]
    status, out, _ = run(capsys, *words, "-pf", 'R=? [ F "two" | s=1 ]')
    assert status == 0
    assert "Result: 2.0" in out
    status, _, err = run(capsys, "-importstates", die / "out.sta")
    assert status == 2
    assert "-importstates has no effect without -importtrans" in err


def test_faults_of_imported_files(die, capsys):
    (die / "bad.tra").write_text("2 2\n0 1 1\n1 9 1\n")
    status, _, err = run(capsys, "-importmodel", die / "bad.tra", "-dtmc")
    assert status == 1
    assert "bad.tra:3:3: error[index]: state 9 does not exist" in err


def test_every_engine_takes_an_imported_model(die, capsys):
    (die / "m.tra").write_text("2 2\n0 1 1\n1 1 1\n")
    for engine in ("mtbdd", "hybrid", "sparse", "explicit"):
        status, out, _ = run(capsys, "-importmodel", die / "m.tra", f"-{engine}")
        assert status == 0
        assert f"Engine:      {engine}\nStates:      2 (1 initial)\nTransitions: 2" in out


def test_exports_that_cannot_be(die, capsys):
    for words in (
        ["-exportmodel", "out"],
        ["-exportmodel", die / "no" / "out.tra"],
        ["-exportmodel", "stdout.umb"],
    ):
        status, _, err = run(capsys, die / "die.pm", *words)
        assert status == 2
        assert err.startswith("error: ")


@pytest.mark.parametrize("engine", ["-s", "-h", "-m", "-ex", "-exact"])
def test_transient_and_steady_state(die, engine, capsys):
    (die / "q.sm").write_text(QUEUE)
    status, out, _ = run(capsys, die / "q.sm", "-tr", "0.5", "-ss", engine)
    assert status == 0
    lines = {
        line.partition("=")[0]: float(Fraction(line.partition("=")[2]))
        for line in out.splitlines()
        if line[:3] in ("0:(", "1:(")
    }
    assert lines == pytest.approx({"0:(0)": 0.25, "1:(1)": 0.75})
    assert "certified: +/- " in out
    transient = out[: out.index("steady-state")].splitlines()
    (first,) = [line for line in transient if line.startswith("0:(0)=")]
    assert float(first.partition("=")[2]) == pytest.approx(
        0.25 + 0.75 * 2.718281828459045**-2, abs=1e-6
    )


def test_distributions_to_files_and_back(die, capsys):
    status, *_ = run(
        capsys,
        die / "die.pm",
        "-tr",
        "0",
        "-exporttr",
        die / "t0.txt",
        "-ss",
        "-exportss",
        die / "ss.txt",
    )
    assert status == 0
    assert (die / "t0.txt").read_text() == "1\n0\n0\n"
    assert [float(x) for x in (die / "ss.txt").read_text().split()] == pytest.approx(
        [0, 1 / 3, 2 / 3]
    )
    (die / "init.txt").write_text("0\n0.5\n0.5\n")
    _, out, _ = run(capsys, die / "die.pm", "-tr", "1", "-importinitdist", die / "init.txt")
    assert "\n1:(1)=0.5\n2:(2)=0.5\n" in out
    (die / "init.txt").write_text("0\nhalf\n0.5\n")
    status, _, err = run(capsys, die / "die.pm", "-tr", "1", "-importinitdist", die / "init.txt")
    assert status == 1
    assert "init.txt:2:1" in err


def test_several_times(die, capsys):
    status, out, _ = run(capsys, die / "die.pm", "-tr", "0:1", "-exporttr", die / "t.txt")
    assert status == 0
    assert (die / "t_0.txt").read_text() == "1\n0\n0\n"
    assert "(time = 1)" in out


def test_distributions_that_cannot_be(die, capsys):
    assert run(capsys, die / "die.pm", "-tr", "x")[0] == 2
    assert run(capsys, die / "die.pm", "-exporttr", die / "t.txt")[0] == 2
    assert run(capsys, die / "die.pm", "-tr", "1", "-mdp")[0] == 1


def test_results_as_json(die, capsys):
    run(
        capsys,
        die / "die.pm",
        "-pf",
        'P=? [ F "two" ]; P>=0.5 [ F "two" ]',
        "-exportresults",
        f"{die / 'r.json'}:json",
    )
    found = json.loads((die / "r.json").read_text())
    assert [r["value"] for r in found] == [0.6666666666666666, True]
    assert found[0]["property"] == 'P=? [ F "two" ]'


def test_a_page(die, capsys):
    properties = die / "die.pctl"
    properties.write_text("const int k;\nP=? [ F s=k ];")
    target = die / "die.html"
    words = (die / "die.pm", properties, "-const", "k=1", "-exportpage", target)
    status, out, _ = run(capsys, *words)
    assert (status, str(target) in out) == (0, True)
    text = target.read_text()
    assert text.startswith("<!DOCTYPE html>")
    assert "0.3333" in text
    status, _, err = run(capsys, *words[:-1], die / "missing" / "die.html")
    assert (status, "there is no folder" in err) == (2, True)


@pytest.mark.parametrize(
    ("switch", "target", "message"),
    [
        (
            "-exportpage",
            "stdout",
            "-exportpage: 'stdout' is no HTML file\n  hint: -exportpage stdout",
        ),
        ("-exportpage", "page.pdf", "-exportpage: 'page.pdf' is no HTML file"),
        ("-exportpage", "nowhere/page.html", "-exportpage: there is no folder 'nowhere'"),
        ("-exportstrat", "s.txt:type=action", "-exportstrat: cannot read 'type=action'"),
        (
            "-exportstrat",
            "best.foo",
            "the extension '.foo' names no kind of strategy file\n  hint:",
        ),
        ("-exportstrat", "best.tar.gz", "the extension '.tar' names no kind of strategy file"),
    ],
)
def test_a_faulty_target_is_found_before_the_model_is_read(
    switch: str, target: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["nosuch.nm", switch, target]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert "nosuch" not in error


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nosuch.nm", "-transient", "soon"], "-transient: 'soon' is not a time"),
        (["nosuch.tra"], "nosuch.tra lists states or transitions\n  hint: -importmodel"),
    ],
)
def test_a_faulty_time_and_an_explicit_file_are_found_first(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert message in capsys.readouterr().err


STAKES = Path(__file__).parents[2] / "models" / "gambler" / "stakes.nm"
DIE_FILE = STAKES.parents[1] / "die" / "die.pm"
FRONT = 'multi(Pmax=? [ F "rich" ], R{"bets"}max=? [ C<=3 ])'


@pytest.mark.parametrize("name", ["f.csv", "f.json"])
def test_a_pareto_front_is_written(tmp_path, name):
    out = tmp_path / name
    assert main([str(STAKES), "-pf", FRONT, "-exportpareto", str(out)]) == 0
    if name == "f.csv":
        head, *rows = csv.reader(out.read_text().splitlines())
        assert head == ['Pmax=? [ F "rich" ]', 'R{"bets"}max=? [ C<=3 ]']
    else:
        whole = json.loads(out.read_text())
        rows = whole["vertices"]
        for h in whole["halfspaces"]:
            values = [sum(w * x for w, x in zip(h["weights"], p, strict=True)) for p in rows]
            assert max(values) == pytest.approx(h["bound"])
    points = [tuple(map(float, row)) for row in rows]
    assert points == [(0.256, 2.24), (0.24448, 2.6), (0.22528, 3.0)]


def test_files_of_fronts_have_a_known_extension(capsys):
    assert main([str(STAKES), "-pf", FRONT, "-exportpareto", "f.txt"]) != 0
    assert "none of .csv, .json" in capsys.readouterr().err


COIN = """dtmc const double p; const double q; const double r = 1/2;
module m x : [0..2]; [] x=0 -> 4*p*q : (x'=1) + 1-4*p*q : (x'=2); endmodule"""
BOXES = ["coin.pm", "-pf", "P<=0.3 [ F x=1 ]", "-regions", "0.9", "-exportregions"]


def boxes_of(path: Path) -> list[tuple[str, list[Fraction]]]:
    """The outcomes and boxes of a file of regions."""
    if path.suffix == ".csv":
        head, *rows = csv.reader(path.read_text().splitlines())
        assert head == ["outcome", "p_low", "p_high", "q_low", "q_high"]
        return [(outcome, [*map(Fraction, ends)]) for outcome, *ends in rows]
    whole = json.loads(path.read_text())
    assert whole["ranges"] == {"p": ["1/10", "1"], "q": ["0", "1"]}
    assert whole["well_defined"] == ["p*q - 1/4 < 0"]
    return [
        (entry["outcome"], [Fraction(e) for side in box.values() for e in side])
        for entry in whole["outcomes"]
        for box in entry["boxes"]
    ]


@pytest.mark.parametrize("name", ["r.csv", "r.json"])
def test_boxes_of_regions_are_written_as_fractions(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    Path("coin.pm").write_text(COIN)
    assert main([*BOXES, name, "-param", "p=0.1:1,q"]) == 0
    boxes = boxes_of(Path(name))
    assert {outcome for outcome, _ in boxes} == {"true", "false", "no model", "undecided"}
    volume = Fraction(0)
    for outcome, (left, right, low, high) in boxes:
        volume += (right - left) * (high - low)
        least, most = 4 * left * low, 4 * right * high
        assert {"true": most <= 0.3, "false": least >= 0.3, "no model": least >= 1}.get(
            outcome, True
        )
    assert volume == Fraction(9, 10)


@pytest.mark.parametrize(
    ("name", "begins"), [("r.png", b"\x89PNG"), ("r.svg", b"<?xml"), ("r.pdf", b"%PDF")]
)
@pytest.mark.parametrize("ranges", ["p=0.1:0.5,q", "p=0.1:0.5 -const q=0.5"])
def test_regions_are_drawn(tmp_path, monkeypatch, name, begins, ranges):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    Path("coin.pm").write_text(COIN)
    assert main([*BOXES, name, "-param", *ranges.split()]) == 0
    assert Path(name).read_bytes().startswith(begins)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("r.png -param p,q,s", "'r.png': a picture has one or two parameters, and there are 3: p,"),
        ("r.txt -param p", "'r.txt': the extension says how regions are written, and it is none"),
        ("no/r.csv -param p", "there is no folder 'no'"),
        ("r.csv", "-exportregions has no effect without -param"),
    ],
)
def test_faulty_files_of_regions_are_found_first(tmp_path, monkeypatch, capsys, words, message):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    Path("coin.pm").write_text(COIN)
    assert main([*BOXES, *words.split()]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("-exportstrat a -exportstrat b", "-exportstrat is given twice"),
        ("-exportstrat a", "-exportstrat has no effect without a property to check"),
        ("-exportstrat a.tra.gz", "the files of an induced chain are not compressed"),
        ("-exportpage die.html.gz", "hint: -exportpage die.html"),
    ],
)
def test_what_cannot_be_written_is_said_at_once(words, message, capsys):
    assert main([str(DIE_FILE), *words.split()]) == 2
    assert message in capsys.readouterr().err


def test_compare_takes_no_switches_that_it_does_not_honour(capsys):
    die = str(DIE_FILE)
    assert main(["compare", die, "-pf", "P=? [ F d=6 ]", "-with", "storm", "-test"]) == 2
    assert "-test has no effect: compare prints a table of answers only" in capsys.readouterr().err
    assert main(["compare", die, "-with", "storm"]) == 2
    assert "compare has no effect without a property to check" in capsys.readouterr().err


def test_properties_that_jani_cannot_express_are_left_out_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, file = tmp_path / "m.pm", tmp_path / "m.jani"
    model.write_text("dtmc module m x : [0..1]; [] x=0 -> (x'=1); [] x=1 -> true; endmodule")
    given = (
        '"six": P=? [ F x=1 ]; "both": P=? [ (G F x=1) & (F G x=1) ]; "odd": P=? [ F x=1 || F x=1 ]'
    )
    assert main([str(model), "-pf", given, "-exportjani", str(file)]) == 0
    names = [p["name"] for p in json.loads(file.read_text())["properties"]]
    assert "six" in names
    assert "odd" not in names
    assert 'the property "odd" is left out: JANI has nothing for' in capsys.readouterr().out


def test_the_paths_of_a_counterexample_may_be_more(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "m.pm"
    model.write_text(
        "dtmc module m x : [0..20]; [] x<20 -> 1/20:(x'=20) + 19/20:(x'=x+1);"
        " [] x=20 -> true; endmodule"
    )
    words = [str(model), "-pf", "P<=0.9 [ F<=20 x=20 ]", "-counterexample"]
    assert main([*words, "-counterexamplepaths", "2"]) == 0
    assert "the limit of 2 paths was reached" in capsys.readouterr().out
    assert main([*words, "-counterexamplepaths", "30"]) == 0
    assert "the limit" not in capsys.readouterr().out


def test_without_properties_nostates_has_one_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "m.pm"
    model.write_text("dtmc module m x : [0..1]; [] true -> true; endmodule")
    assert main([str(model), "-nostates"]) == 0
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Note:")]
    assert len(notes) == 1


def test_a_strategy_that_needs_no_decision_in_some_states_is_read_without_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, file = tmp_path / "m.nm", tmp_path / "best.txt"
    model.write_text(
        "mdp module m x : [0..2]; [a] x=0 -> (x'=1); [b] x=0 -> (x'=2);"
        " [c] x=1 -> (x'=0); [d] x=1 -> true; [] x=2 -> true; endmodule"
    )
    assert main([str(model), "-pf", "Pmax=? [ F x=1 ]", "-exportstrat", str(file)]) == 0
    assert file.read_text() == "(0)=a\n# other states: any choice\n"
    capsys.readouterr()
    assert main([str(model), "-pf", "P=? [ F x=1 ]", "-importstrat", str(file)]) == 0
    assert "leaves out" not in capsys.readouterr().out
    file.write_text("(0)=a\n")
    assert main([str(model), "-pf", "P=? [ F x=1 ]", "-importstrat", str(file)]) == 0
    assert "leaves out 1 state with several choices" in capsys.readouterr().out


def test_the_process_of_a_timed_automaton_is_exported_with_a_note(tmp_path, capsys):
    (tmp_path / "t.nm").write_text(
        "pta module m s:[0..1]; x:clock; invariant s=0 => x<=20 endinvariant"
        " [] s=0 & x>=10 -> (s'=1); endmodule"
    )
    status, out, _ = run(capsys, tmp_path / "t.nm", "-exportmodel", tmp_path / "t.drn")
    assert status == 0
    assert "process with digital clocks, in which steps are no units of time" in out
    status, out, _ = run(capsys, tmp_path / "t.nm", "-exportjani", tmp_path / "t.jani")
    assert status == 0
    assert "Note:" not in out
    assert '"type": "pta"' in (tmp_path / "t.jani").read_text()
    properties = [
        "-pf",
        'label "late" = x>=200; Pmax=? [ F "late" ]',
        "-exportproplabels",
        "stdout",
    ]
    status, out, err = run(capsys, tmp_path / "t.nm", *properties)
    assert status == 1
    assert 'error: the label "late" compares a clock' in err
