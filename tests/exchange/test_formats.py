"""The texts themselves, against files written by hand from the description of the formats."""

from __future__ import annotations

import io

import numpy as np
import pytest

import symcheck
from symcheck.errors import OutputError, UsageError
from symcheck.exchange import text as texts
from symcheck.exchange.explicit_export import explicit_export
from symcheck.exchange.export import export, parse_target

MDP = """mdp
module m
  s : [0..2]; b : bool init false;
  [go] s=0 -> 0.7:(s'=1) + 0.3:(s'=2);
  [] s=0 -> (b'=true)&(s'=2);
  [go] s=2&b -> (s'=2);
endmodule
label "end" = s=2;
rewards "steps" [go] true : 2; s=0 : 0.5; endrewards
rewards true : 1; endrewards
"""
CTMC = """ctmc
module q
  n : [0..2];
  [] n<2 -> 3/2 : (n'=n+1);
  [] n>0 -> 2 : (n'=n-1);
endmodule
rewards [] n=1 : 4; endrewards
"""


def written(model, target, labels=()):
    out = io.StringIO()
    built = symcheck.loads(model) if isinstance(model, str) else model
    shot = explicit_export(
        built.engine, labels, lambda n: built.engine.where(built.bound.labels[n])
    )
    list(export(shot, parse_target(target, "m"), out))
    return out.getvalue()


def test_states():
    assert (
        written(MDP, "stdout.sta") == "(s,b)\n0:(0,false)\n1:(1,false)\n2:(2,false)\n3:(2,true)\n"
    )


def test_transitions_of_an_mdp():
    lines = written(MDP, "stdout.tra").splitlines()
    assert lines[0] == "4 5 6"
    assert sorted(lines[1:]) == sorted(
        ["0 0 1 0.7 go", "0 0 2 0.3 go", "0 1 3 1", "1 0 1 1", "2 0 2 1", "3 0 3 1 go"]
        if "0 1 3 1" in lines
        else ["0 1 1 0.7 go", "0 1 2 0.3 go", "0 0 3 1", "1 0 1 1", "2 0 2 1", "3 0 3 1 go"]
    )


def test_options_leave_out_actions_and_cut_digits():
    assert "go" not in written(MDP, "stdout.tra:actions=false")
    assert "0 1 0.3333\n" in written(
        "dtmc module m x:[0..2]; [] x=0 -> 1/3:(x'=1)+2/3:(x'=2); endmodule",
        "stdout.tra:precision=4",
    )


def test_rows():
    assert written(CTMC, "stdout.tra:rows") == "3 4\n0 1.5:1\n1 2:0 1.5:2\n2 2:1\n"


def test_transitions_of_a_chain():
    assert written(CTMC, "stdout.tra") == "3 4\n0 1 1.5\n1 0 2\n1 2 1.5\n2 1 2\n"


def test_labels():
    assert (
        written(MDP, "stdout.lab", ["end"])
        == '0="init" 1="deadlock" 2="end"\n0: 0\n1: 1\n2: 1 2\n3: 2\n'
    )


def test_state_rewards():
    expected = '# Reward structure "steps"\n# State rewards\n4 1\n0 0.5\n# Reward structure\n# State rewards\n4 4\n0 1\n1 1\n2 1\n3 1\n'
    assert written(MDP, "stdout.srew") == expected
    assert written(MDP, "stdout.srew:headers=false") == "4 1\n0 0.5\n4 4\n0 1\n1 1\n2 1\n3 1\n"


def test_transition_rewards():
    found = written(MDP, "stdout.trew:headers=false").splitlines()
    assert found[0] == "4 5 3"
    assert [line.split()[0] + line.split()[2:][0] for line in found[1:4]] == ["01", "02", "33"]
    assert all(line.endswith(" 2") for line in found[1:4])
    assert found[4] == "4 5 0"


def test_transition_rewards_of_a_ctmc_keep_the_expected_reward():
    assert written(CTMC, "stdout.trew:headers=false") == "3 2\n1 0 4\n1 2 4\n"


def test_rationals():
    model = symcheck.loads(
        "dtmc module m x:[0..2]; [] x=0 -> 1/3:(x'=1)+2/3:(x'=2); endmodule", exact=True
    )
    assert "0 1 1/3\n0 2 2/3\n" in written(model, "stdout.tra")


def test_dot():
    found = written(MDP, "stdout.dot")
    assert found.startswith("digraph M {\n")
    assert found.endswith("}\n")
    assert '3 [label="3\\n(2,true)"];' in found
    assert ':go",arrowhead="none"];' in found
    assert '0 [label="0"];' in written(MDP, "stdout.dot:states=false")
    assert '0 -> 1 [label="1.5"];' in written(CTMC, "stdout.dot")


def test_number_texts_give_the_double_back():
    values = np.random.default_rng(5).random(1000) * 10.0 ** np.random.default_rng(6).integers(
        -20, 20, 1000
    )
    assert [float(t) for t in texts.number_texts(values)] == values.tolist()
    assert texts.number_texts(np.array([1.0, 0.5, np.inf, 2e300])) == [
        "1",
        "0.5",
        "Infinity",
        "2e+300",
    ]


def test_long_files_are_written_in_chunks(monkeypatch):
    monkeypatch.setattr(texts, "CHUNK", 3)
    chunks = list(texts.lines("%d %s", 8, np.arange(8), np.arange(8) / 2))
    assert len(chunks) == 3
    assert "".join(chunks) == "".join(f"{i} {i // 2 if i % 2 == 0 else i / 2}\n" for i in range(8))


def test_a_file_is_whole_or_absent(tmp_path):
    def broken():
        yield "some"
        raise OSError(28, "No space left on device")

    old = tmp_path / "old.tra"
    old.write_text("before")
    with pytest.raises(OutputError, match="No space left"):
        texts.write_text(str(old), broken(), io.StringIO())
    assert old.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["old.tra"]


@pytest.mark.parametrize(
    ("argument", "expected"),
    [
        ("out.tra,sta", ["out.tra", "out.sta"]),
        (".tra", ["dir/model.tra"]),
        ("out.all", ["out.tra", "out.sta", "out.lab", "out.srew", "out.trew"]),
        ("out.rew", ["out.srew", "out.trew"]),
        ("stdout.tra", ["stdout"]),
        ("out.x.tra:actions=false,precision=3", ["out.x.tra"]),
    ],
)
def test_targets(argument, expected):
    assert [t.path for t in parse_target(argument, "dir/model.pm")] == expected


@pytest.mark.parametrize(
    "argument", ["out", "out.xyz", "out.tra:colour=red", "out.tra:precision=0"]
)
def test_targets_that_are_no_targets(argument):
    with pytest.raises(UsageError, match="hint: "):
        parse_target(argument, "model.pm")


def test_matlab_is_told_by_the_ending_and_by_the_format():
    assert [(t.kind, t.path, t.options.matlab) for t in parse_target("out.m", "x.pm")] == [
        ("tra", "out.m", True)
    ]
    assert [
        (t.kind, t.path, t.options.matlab) for t in parse_target("stdout:format=matlab", "x.pm")
    ] == [("tra", "stdout", True)]
    assert [t.kind for t in parse_target("out.tra,sta:matlab", "x.pm")] == ["tra", "sta"]
