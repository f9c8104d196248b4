"""Properties of which some do not follow the grammar: the others are checked all the same."""

from __future__ import annotations

import re

import pytest

from symcheck.cli import main
from symcheck.errors import SyntaxFault
from symcheck.experiments.properties_input import read_properties

MODEL = "dtmc module m x:[0..1]; [] x=0 -> 0.5:(x'=1)+0.5:(x'=0); [] x=1 -> true; endmodule label \"up\" = x=1;"


def test_what_is_whole_keeps_its_number():
    texts = read_properties(None, ["P=? [ F x=1 ]; P=? [ F x=; x=0", "x>0"])
    assert len(texts.file.properties) == 4
    assert list(texts.unparsed) == [1]
    assert texts.unparsed[1].text == "P=? [ F x="
    assert "<properties>:1:26" in str(texts.unparsed[1].fault)
    assert [p.span.text for i, p in enumerate(texts.file.properties) if i != 1] == [
        "P=? [ F x=1 ]",
        "x=0",
        "x>0",
    ]


@pytest.mark.parametrize(
    "text",
    [
        'x=0; "a": P=? [ F "up',
        "x=0; // ; no end\nP=? [ ",
        "x=0;\n;P==? [ x ]",
        'x=0; P=? [ F "a;b ]',
    ],
)
def test_parts_are_distinguished(text):
    texts = read_properties(None, [text])
    assert texts.file.properties[0].span.text == "x=0"
    assert texts.unparsed or texts.declarations


def test_declarations_are_left_out():
    texts = read_properties(None, ["const int k = ; x=0; label = x; x=1"])
    assert [p.span.text for p in texts.file.properties] == ["x=0", "x=1"]
    assert len(texts.declarations) == 2


@pytest.mark.parametrize("text", ["P=? [ F x=", "P=? [ F\nP=? [ G", "x=", "(", '"'])
def test_where_nothing_is_left_all_is_refused(text):
    with pytest.raises(SyntaxFault):
        read_properties(None, [text])


def test_the_rest_is_answered(tmp_path, capsys):
    (tmp_path / "m.pm").write_text(MODEL)
    (tmp_path / "p.pctl").write_text(
        'P=? [ F x=1 ];\n// comment\n"bad": P=? [ F x= ];\n"good": x=0;\n'
    )
    words = [str(tmp_path / "m.pm"), str(tmp_path / "p.pctl"), "-exportresults", "stdout:csv"]
    assert main(words) == 1
    out = capsys.readouterr().out
    assert "p.pctl:3:" in out
    assert "Result: 1.0" in out
    assert "Result: true" in out
    assert '"""bad"": P=? [ F x= ]"\nResult\nError\n' in out
    assert main([*words[:2], "-prop", "good"]) == 0
    assert "Error" not in capsys.readouterr().out


def test_excerpts_show_what_was_typed(tmp_path, capsys):
    """Also where a faulty property stands on the same line."""
    (tmp_path / "m.pm").write_text(MODEL)
    assert main([str(tmp_path / "m.pm"), "-pf", "P=? [ F 0 0 ]; P=? [ F y=1 ]"]) == 1
    assert "  1 | P=? [ F 0 0 ]; P=? [ F y=1 ]\n" in capsys.readouterr().out


def test_a_property_may_be_called_as_a_label_is(tmp_path, capsys):
    (tmp_path / "m.pm").write_text(MODEL)
    assert main([str(tmp_path / "m.pm"), "-pf", '"up": P=? [ F "up" ]; "down": "up" | x=0']) == 0
    out = capsys.readouterr().out
    assert 'Model checking: "up": P=? [ F "up" ]' in out
    assert "Result: true" in out


def test_the_value_of_a_constant_is_pointed_at(tmp_path, capsys):
    (tmp_path / "m.pm").write_text(
        "dtmc const double mu; module m x:[0..1]; [] true -> mu:(x'=1)+1-mu:(x'=0); endmodule"
    )
    assert main([str(tmp_path / "m.pm"), "-const", "mu=0.5*y"]) == 1
    assert "value of mu:1:5: error[unknown-name]: unknown name y" in capsys.readouterr().err


def answers(tmp_path, capsys, properties):
    (tmp_path / "m.pm").write_text(MODEL)
    (tmp_path / "p.pctl").write_text(properties)
    status = main([str(tmp_path / "m.pm"), str(tmp_path / "p.pctl")])
    out = capsys.readouterr().out
    beginnings = ("Model checking", "Result:", "Error:")
    return status, [line for line in out.splitlines() if line.startswith(beginnings)]


@pytest.mark.parametrize(
    ("faulty", "code"),
    [
        ("P=? [ F x=", "syntax"),
        ("P=? [ F (x=1 ]", "missing"),
        ("<<p1>> P>=0 [ F x=1 ]", "model-type"),
        ("P=? [ F y=1 ]", "unknown-name"),
        ("P=? [ F 2 ]", "type"),
        ('P=? [ F "nothing" ]', "unknown-label"),
        ('"a": "a"', "cycle"),
        ('"first": x=1', "duplicate-property"),
        ("mod(1,0)", "mod-zero"),
        ("P>2 [ F x=1 ]", "threshold"),
        ("R=? [ F x=1 ]", "no-rewards"),
        ("filter(sum, x=1, true)", "filter-type"),
    ],
)
@pytest.mark.parametrize("end", [";", ""])
def test_a_fault_concerns_its_own_property(tmp_path, capsys, faulty, code, end):
    """Also where properties end without a semicolon; the order is that of the file."""
    whole = f'"first": P=? [ F x=1 ]{end}\n{faulty}{end}\n// comment\nP>=1 [ F x=1 ]{end}\n'
    status, lines = answers(tmp_path, capsys, whole)
    assert status == 1
    assert [line.partition(":")[0] for line in lines] == [
        *("Model checking", "Result"),
        *("Model checking", "Error"),
        *("Model checking", "Result"),
    ]
    assert "p.pctl:2:" in lines[3]
    assert lines[5] == "Result: true (satisfied in the initial state)"
    assert code in lines[3] or code == "filter-type"


def test_the_comment_above_a_property_stays_with_it(tmp_path, capsys):
    (tmp_path / "m.pm").write_text(MODEL)
    text = "// RESULT: Error\nP=? [ F x=\n\n// RESULT: 1\nP=? [ F x=1 ]\n"
    (tmp_path / "p.pctl").write_text(text)
    assert main([str(tmp_path / "m.pm"), str(tmp_path / "p.pctl"), "-test"]) == 0
    assert "Tests: 2 passed" in capsys.readouterr().out


def test_a_test_of_faulty_properties_only_has_a_verdict_for_each(tmp_path, capsys):
    """Without -test, nothing is built for them."""
    (tmp_path / "m.pm").write_text(MODEL)
    text = "// RESULT: Error\nP=? [ F x=\n\n// RESULT: 1\nP=? [ F x=1 y ];\n"
    (tmp_path / "p.pctl").write_text(text + "\n// RESULT: 1\nforall s : P=? [ F x=1 ]\n")
    words = [str(tmp_path / "m.pm"), str(tmp_path / "p.pctl")]
    assert main([*words, "-testall"]) == 1
    verdicts = re.findall(r"^Testing result: (\w+)", capsys.readouterr().out, re.MULTILINE)
    assert verdicts == ["PASS", "FAIL", "UNSUPPORTED"]
    assert main(words) == 1
    assert "States:" not in capsys.readouterr().out


def test_a_property_may_go_on_behind_a_line(tmp_path, capsys):
    """Where another property is faulty: a line that starts as a property need not be one."""
    whole = "P>=1 [ F\n  P>=1 [ F x=1 ] ]\nfilter(min,\nP=? [ F x=1 ],\ntrue)\nP=? [ F x=\n"
    status, lines = answers(tmp_path, capsys, whole)
    assert status == 1
    assert [line.partition(":")[0] for line in lines].count("Result") == 2


DEFINITIONS = """const int k = 2.5;
const int unused = 2.5; const int also = unused;
label "up" = x=0;
"sound": P=? [ F x=1 ];
P=? [ F<=k x=1 ];
"""


def test_a_faulty_definition_stops_those_that_use_it(tmp_path, capsys):
    """One that no property uses is told once, and the run has failed all the same."""
    (tmp_path / "m.pm").write_text(MODEL.replace("dtmc", "dtmc const int N;"))
    (tmp_path / "p.pctl").write_text(DEFINITIONS)
    words = [str(tmp_path / "m.pm"), str(tmp_path / "p.pctl"), "-const", "N=0"]
    assert main(words) == 1
    out = capsys.readouterr().out
    assert "Result: 1.0" in out
    for line in (1, 2, 3):
        assert out.count(f"p.pctl:{line}:") == 1
    assert out.index("p.pctl:2:") < out.index("Result: 1.0") < out.index("p.pctl:1:")
    assert main([*words[:3], "N=0:1"]) == 1
    out = capsys.readouterr().out
    assert out.count("Result: 1.0") == 2
    assert out.count("p.pctl:2:") == 1
    (tmp_path / "p.pctl").write_text(DEFINITIONS.partition("P=? [ F<=k")[0])
    assert main(words) == 1
    assert "Result: 1.0" in capsys.readouterr().out


def test_who_uses_a_property_that_cannot_be_read_is_told_why(tmp_path, capsys):
    """And a label of the same name is meant where there is one."""
    text = '"bad": P=? [ F x= ];\n"up": P=? [ F ];\n"good": "bad">0.5;\n"down": "up" | x=0;\n'
    status, lines = answers(tmp_path, capsys, text)
    assert status == 1
    assert "p.pctl:1:" in lines[5]
    assert lines[7] == "Result: true (satisfied in the initial state)"


UNREADABLE = """const int k = ;
label "up" x=1;
"sound": P=? [ F x=1 ];
P=? [ F<=k x=1 ];
P=? [ F "up" ];
"""


def test_who_uses_a_definition_that_cannot_be_read_is_told_why(tmp_path, capsys):
    """And not that there is no such name."""
    (tmp_path / "m.pm").write_text(MODEL.partition("label")[0])
    (tmp_path / "p.pctl").write_text(UNREADABLE)
    assert main([str(tmp_path / "m.pm"), str(tmp_path / "p.pctl")]) == 1
    head, *results = capsys.readouterr().out.split("Model checking: ")
    assert (head.count("error[syntax]"), head.count("error[missing]")) == (1, 1)
    assert "Result: 1.0" in results[0]
    assert "p.pctl:1:15: error[syntax]: unexpected ';'" in results[1]
    assert "p.pctl:2:10: error[missing]" in results[2]
    assert "unknown" not in results[1] + results[2]
