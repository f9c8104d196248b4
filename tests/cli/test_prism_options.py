"""Command lines that were written for PRISM."""

from __future__ import annotations

import io
import re

import pytest

from symcheck.cli import main
from symcheck.cli.switches.arguments import parse_arguments
from symcheck.errors import UsageError

QUEUE = """ctmc
const double mu;
module q
  n : [0..2] init 0;
  [up] n<2 -> 2 : (n'=n+1);
  [down] n>0 -> mu : (n'=n-1);
endmodule
label "full" = n=2;
"""


@pytest.fixture
def queue(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "q.sm").write_text(QUEUE)
    (tmp_path / "q.csl").write_text(
        'label "some" = n>0;\n"f": S=? [ "full" ];\n"g": P=? [ F<=1 "some" ];\n'
    )
    return tmp_path


def run(capsys, *words):
    status = main([str(w) for w in words])
    found = capsys.readouterr()
    return status, found.out, found.err


@pytest.mark.parametrize(
    "words",
    [
        ["-power"],
        ["-gs", "-nopre"],
        ["--gaussseidel"],
        ["-sor", "-omega", "0.9"],
        ["-ii:monotonic,upperbound=2"],
        ["-javamaxmem", "4g", "-javastack", "100m"],
        ["-cuddepsilon", "1e-15", "-sbmax", "1024", "-gsl", "3"],
        ["-transientmethod", "unif", "-nossdetect"],
    ],
)
def test_switches_without_effect_are_taken_and_named(words, queue, capsys):
    status, out, _ = run(capsys, "q.sm", "q.csl", "-const", "mu=2", "-prop", "f", *words)
    assert status == 0
    assert "Result: 0.333333" in out
    for word in words:
        if word.startswith("-"):
            assert word.lstrip("-").partition(":")[0] in out.partition("Type:")[0]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-param", "p=0.5"], "-param: 'p=0.5' is not NAME=LOW:HIGH"),
        (["-paramelimorder", "fw"], "-paramelimorder: functions of parameters are exact"),
        (["-settings", "prism.settings"], "-settings: files of settings are not read"),
        (["-importpepa"], "PEPA is not supported"),
        (["-exportmrmc"], "-exportmodel writes"),
        (
            ["-exporttrnas", "x"],
            "there is no switch -exporttrnas\n  hint: did you mean -exporttrans?",
        ),
        (["-zzz"], "there is no switch -zzz\n  hint: symcheck --help"),
        (["-dir", "/not/there"], "-dir: '/not/there'"),
        (["a.pctl", "b.pctl"], "'b.pctl' is one file too many"),
    ],
)
def test_switches_that_cannot_be_served(words, message, queue, capsys):
    status, out, err = run(capsys, "q.sm", *words)
    assert status == 2
    assert message in err
    assert out == ""


def test_files_may_stand_anywhere():
    found = parse_arguments(["-const", "a=1", "m.pm", "-s", "p.pctl", "-epsilon", "1e-3"])
    assert (found.model, found.properties, found.const, found.options.engine) == (
        "m.pm",
        "p.pctl",
        ["a=1"],
        "sparse",
    )


def test_a_value_may_look_like_a_switch():
    found = parse_arguments(["m.pm", "-pf", "-x>0", "-const", "-", "-transient", "-1"])
    assert (found.pf, found.const, found.transient) == (["-x>0"], ["-"], "-1")
    with pytest.raises(UsageError, match="expected a value"):
        parse_arguments(["m.pm", "-pf"])


def test_a_strategy_is_an_adversary(queue, capsys):
    (queue / "m.nm").write_text(
        "mdp module m x:[0..2]; [a] x=0 -> (x'=1); [b] x=0 -> (x'=2); endmodule"
    )
    assert run(capsys, "m.nm", "-pf", "Pmax=? [ F x=2 ]", "-exportadv", "adv.tra")[0] == 0
    assert (queue / "adv.tra").read_text() == "3 3\n0 2 1 b\n1 1 1\n2 2 1\n"
    assert run(capsys, "m.nm", "-pf", "Pmax=? [ F x=2 ]", "-exportadvmdp", "adv.tra")[0] == 0
    assert (queue / "adv.tra").read_text() == "3 3 3\n0 0 2 1 b\n1 0 1 1\n2 0 2 1\n"
    assert run(capsys, "-importtrans", "adv.tra", "-mdp")[0] == 0


def test_another_folder(queue, capsys, monkeypatch):
    monkeypatch.chdir("/")
    words = [
        "-dir",
        queue,
        "q.sm",
        "-const",
        "mu=1",
        "-exportstates",
        "out.sta",
        "-exportresults",
        "r.txt",
        "-pf",
        "true",
    ]
    assert run(capsys, *words)[0] == 0
    assert (queue / "out.sta").is_file()
    assert (queue / "r.txt").read_text() == "Result\ntrue\n"


def test_a_model_is_recognised_by_its_ending(queue, capsys):
    assert run(capsys, "q.sm", "-const", "mu=2", "-exportmodel", "o.all")[0] == 0
    _, out, _ = run(capsys, "o.all", "-pf", 'S=? [ "full" ]')
    assert "Result: 0.33333" in out


def test_two_models_are_one_too_many(queue, capsys):
    assert run(capsys, "q.sm", "-const", "mu=2", "-exportmodel", "o.all")[0] == 0
    status, _, err = run(capsys, "q.sm", "-importmodel", "o.all")
    assert status == 2
    assert "'q.sm' and -import… both name a model to read" in err


def test_the_model_as_a_text(queue, capsys):
    status, out, _ = run(capsys, "q.sm", "-exportprism", "stdout", "-nobuild")
    assert status == 0
    assert "const double mu;" in out
    assert "States:" not in out
    assert run(capsys, "q.sm", "-const", "mu=1:2", "-exportprismconst", "o.prism")[0] == 0
    assert "const double mu = 2.0;" in (queue / "o_mu=2.prism").read_text()
    assert run(capsys, "o_mu=2.prism", "-pf", 'S=? [ "full" ]')[0] == 0


def test_exact_and_an_engine(queue, capsys):
    _, out, _ = run(capsys, "q.sm", "-const", "mu=2", "-exact", "-s", "-pf", 'S=? [ "full" ]')
    assert "Note: -exact has an engine of its own" in out
    assert "Result: 1/3 (exact)" in out


# ------------------------------------------------------------------------------------------------------- several experiments


def test_each_experiment_writes_its_own_files(queue, capsys):
    words = [
        "-const",
        "mu=1:2",
        "-exporttrans",
        "o.tra",
        "-ss",
        "-exportss",
        "s.txt",
        "-tr",
        "1:2",
        "-exporttr",
        "t.txt",
    ]
    assert run(capsys, "q.sm", *words)[0] == 0
    names = {p.name for p in queue.iterdir()} - {"q.sm", "q.csl"}
    times = {f"t_{t}_mu={mu}.txt" for t in (1, 2) for mu in (1, 2)}
    assert names == {"o_mu=1.tra", "o_mu=2.tra", "s_mu=1.txt", "s_mu=2.txt"} | times
    assert "1 0 2" in (queue / "o_mu=2.tra").read_text()


def test_each_experiment_writes_its_own_path(queue, capsys):
    assert run(capsys, "q.sm", "-const", "mu=1:2", "-simpath", "3", "p.txt", "-seed", "1")[0] == 0
    assert {"p_mu=1.txt", "p_mu=2.txt"} <= {p.name for p in queue.iterdir()}


def test_each_property_writes_its_own_vector(queue, capsys):
    assert (
        run(capsys, "q.sm", "q.csl", "-const", "mu=2", "-exportvector", "v.txt", "-prop", "f")[0]
        == 0
    )
    assert [float(x) for x in (queue / "v.txt").read_text().split()] == pytest.approx([1 / 3] * 3)
    assert (
        run(capsys, "q.sm", "q.csl", "-const", "mu=2", "-exportvector", "v.txt", "-pf", "n>0")[0]
        == 0
    )
    assert (queue / "v_property=3.txt").read_text() == "false\ntrue\ntrue\n"
    assert {"v_property=f.txt", "v_property=g.txt"} <= {p.name for p in queue.iterdir()}


def test_one_bad_experiment_leaves_the_others(queue, capsys):
    status, out, err = run(
        capsys, "q.sm", "-const", "mu=-1:1", "-pf", 'S=? [ "full" ]', "-exportresults", "stdout:csv"
    )
    assert status == 1
    assert err == ""
    assert "error[update-negative]: rate -1 is negative" in out
    assert out.endswith("Results:\n\nmu,Result\n-1,Error\n0,1.0\n1,0.5714285714285714\n")


def test_random_paths_need_no_model_but_exports_do(queue, capsys):
    for switch in (
        "-exporttransdot",
        "-exportstaterewards",
        "-exportvector",
        "-exportbsccs",
        "-exportdot",
    ):
        status, _, err = run(
            capsys, "q.sm", "-const", "mu=1", "-pf", "P=? [ F<=1 n=2 ]", "-sim", switch, "x"
        )
        assert status == 2
        assert f"{switch} has no effect: -sim builds no model" in err
    status, out, _ = run(
        capsys,
        "q.sm",
        "-const",
        "mu=1",
        "-simpath",
        "3",
        "p.txt",
        "-exportstates",
        "stdout",
        "-seed",
        "1",
    )
    assert status == 0
    assert "0:(0)\n1:(1)\n2:(2)\n" in out
    assert len((queue / "p.txt").read_text().splitlines()) == 5


def test_labels_of_the_properties_in_a_file_of_their_own(queue, capsys):
    words = [
        "-const",
        "mu=1",
        "-nofixdl",
        "-exportproplabels",
        "p.lab",
        "-exportlabels",
        "m.lab",
        "-prop",
        "f",
    ]
    assert run(capsys, "q.sm", "q.csl", *words)[0] == 0
    assert (queue / "p.lab").read_text() == '0="some"\n1: 0\n2: 0\n'
    assert (queue / "m.lab").read_text() == '0="init" 1="deadlock" 2="full"\n0: 0\n2: 2\n'


def test_diagrams_in_dot(queue, capsys):
    assert run(capsys, "q.sm", "-const", "mu=3", "-m", "-exportdot", "d.dot")[0] == 0
    assert (queue / "d.dot").read_text().startswith("digraph")
    status, _, err = run(capsys, "q.sm", "-const", "mu=3", "-ex", "-exportdot", "d.dot")
    assert status == 1
    assert "-m, -h or -s build diagrams" in err


def test_options_of_model_exports(queue, capsys):
    _, out, _ = run(
        capsys,
        "q.sm",
        "-const",
        "mu=3",
        "-exportmodel",
        "stdout.all:labels=false,rewards=false,format=matlab",
    )
    assert "R = sparse(3,3);" in out
    assert "l_init" not in out
    status, _, err = run(capsys, "q.sm", "-const", "mu=3", "-exportmodel", "stdout.all:colour=red")
    assert status == 2
    assert "unknown option 'colour=red'" in err
    assert run(capsys, "q.sm", "-const", "mu=3", "-exportmodel", "o.txt:format=drn")[0] == 0
    assert (queue / "o.txt").read_text().startswith("@type: CTMC")


def test_the_output_goes_to_a_file(queue, capsys):
    status, out, err = run(
        capsys, "q.sm", "-const", "mu=2", "-exporttrans", "stdout", "-mainlog", "log"
    )
    assert (status, out, err) == (0, "", "")
    log = (queue / "log").read_text()
    assert "Type:        CTMC" in log
    assert " 1 " in log.partition("Time for model")[2]


def test_a_model_from_the_standard_input(queue, capsys, monkeypatch):
    text = (queue / "q.sm").read_text()
    monkeypatch.setattr("sys.stdin", io.StringIO(text))
    status, out, _ = run(capsys, "-", "q.csl", "-const", "mu=2", "-prop", "f")
    assert status == 0
    assert "Reading the model from the standard input" in out
    assert "Result: 0.333333" in out
    monkeypatch.setattr("sys.stdin", io.StringIO("ctmc module"))
    assert "<stdin>:1:11: error[syntax]" in run(capsys, "-")[2]
    assert run(capsys, "-", "-step")[2].startswith("error: -step reads the standard input")


def test_a_diagram_is_drawn_without_an_engine(queue, capsys):
    status, out, _ = run(capsys, "q.sm", "-const", "mu=2", "-exportdot", "d.dot")
    assert status == 0
    assert "Note: -exportdot needs diagrams: the engine is hybrid" in out
    assert (queue / "d.dot").read_text().startswith("digraph")
    assert "Note" not in run(capsys, "q.sm", "-const", "mu=2", "-exportdot", "d.dot", "-m")[1]
    status, _, err = run(capsys, "q.sm", "-const", "mu=2", "-exportdot", "d.dot", "-exact")
    assert (status, "-m, -h or -s build diagrams" in err) == (1, True)


@pytest.mark.parametrize(
    ("formula", "about"),
    [
        ("S=? [ n=0 ]", "long-run averages, which are computed by elimination"),
        ("P=? [ F<=2.5 n=1 ]", "bounds on time, which are computed by uniformisation"),
        ("P=? [ n<2 U n=2 ]", None),
    ],
)
def test_a_method_that_has_no_effect_is_named(formula, about, queue, capsys):
    words = ["q.sm", "-const", "mu=2", "-pf", formula, "-method"]
    for method, named in (("power", True), ("auto", False)):
        status, out, _ = run(capsys, *words, method)
        assert status == 0
        if about is not None and named:
            assert f"Note: -method {method} has no effect on {about}" in out
        else:
            assert "has no effect" not in out


@pytest.mark.parametrize("engine", ["-s", "-h", "-m", "-ex", "-exact"])
def test_details_are_sentences(engine, queue, capsys):
    status, out, _ = run(
        capsys, "q.sm", "-const", "mu=2", "-pf", "S=? [ n=0 ]; P=? [ F n=2 ]", "-v", engine
    )
    assert status == 0
    assert "Long run: " in out
    assert not re.search(r"\w+\([a-z_]+=|[A-Z]\w+\(\d|\[\]: ", out)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-const", "mu=1:0:3"], "the step of the range 'mu=1:0:3' is not above 0"),
        (["-const", "mu=3:1"], "the range 'mu=3:1' is empty"),
    ],
)
def test_messages_about_ranges(words, message, queue, capsys):
    status, out, err = run(capsys, "q.sm", *words)
    assert status in (1, 2)
    assert message in out + err


FRACTION = "123456789012345678901234567890/987654321098765432109876543210"


def test_fractions_that_are_printed_are_read(tmp_path, capsys):
    """Also those whose terms are beyond 64 bits: constants, thresholds, models, RESULT lines."""
    model, properties = tmp_path / "m.pm", tmp_path / "m.props"
    model.write_text(
        f"dtmc const double p; const double q = {FRACTION}; module m x:[0..2];"
        "[] x=0 -> p:(x'=1)+1-p:(x'=2); [] x=1 -> q:(x'=2)+1-q:true; [] x=2 -> true; endmodule"
    )
    properties.write_text(
        "// RESULT: 13717421/109739369\nP=? [ F x=1 ];\n"
        f"// RESULT: {FRACTION}\nP=? [ F x=1 ];\n"
        f"// RESULT: true\nP>={FRACTION} [ F x=1 ];\n"
        f"// RESULT: true\nP<={FRACTION} [ F x=1 ];\n"
        "// RESULT: true\np=q;\n"
    )
    words = [str(model), str(properties), "-test", "-const", f"p={FRACTION}"]
    assert main(words) == 0
    assert main([*words, "-exact"]) == 0
    assert "Result: 13717421/109739369 (exact)" in capsys.readouterr().out


def test_a_large_int_is_a_double_or_refused(tmp_path, capsys):
    model = tmp_path / "m.pm"
    model.write_text("dtmc const double r; const int n; module m x:[0..1]; endmodule")
    words = [str(model), "-pf", "r=1e30", "-const"]
    assert main([*words, f"r={10**30},n=1"]) == 0
    assert "Result: true" in capsys.readouterr().out
    assert main([*words, f"r=1,n={10**30}"]) == 1
    assert "an int is at most" in capsys.readouterr().err.replace("a value of type int", "an int")
