"""Switches in any mixture: an answer, or an error that says what is wrong; never a defect, and no half-written files."""

from __future__ import annotations

import os
from random import Random

import pytest

from symcheck.cli import main

FILES = {
    "q.sm": """ctmc
const double mu;
module q n : [0..3] init 0; [up] n<3 -> 2 : (n'=n+1); [down] n>0 -> mu : (n'=n-1); endmodule
label "full" = n=3;
rewards "len" true : n; [up] true : 1; endrewards
""",
    "m.nm": """mdp
module m
  s : [0..3] init 0;
  [go] s=0 -> 0.5 : (s'=1) + 0.5 : (s'=2);
  [safe] s=0 -> (s'=3);
  [] s=1 -> 0.9 : (s'=3) + 0.1 : (s'=0);
  [] s>1 -> true;
endmodule
label "full" = s=3;
rewards "len" [go] true : 1; s=1 : 2; endrewards
""",
    "d.pm": "dtmc const int N = 2; module m x : [0..N]; [a] x<N -> 0.5 : (x'=x+1) + 0.5 : (x'=0); endmodule label \"full\" = x=N;",
}
MODELS = (
    ["q.sm", "-const", "mu=3"],
    ["q.sm", "-const", "mu=1:2"],
    ["m.nm"],
    ["d.pm"],
    ["out.all"],
    ["out.umb"],
)
PROPERTIES = (
    *(
        'P=? [ F "full" ]',
        'S=? [ "full" ]',
        'Pmax=? [ F "full" ]',
        'R{"len"}max=? [ F "full" ]',
        "R=? [ C<=3 ]",
        "x>",
        "true",
    ),
    *(
        "const int k; k+1",
        'label "z" = true; P=? [ X "z" ]',
        'E [ F "full" ]',
        'filter(printall, P=? [ F<=1 "full" ])',
        '"init"',
    ),
    *('multi(Pmax=? [ F "full" ], P>=0.1 [ F s=2 ])', "filter(argmax, n)", 'P>0.5 [ G !"full" ]'),
)
SWITCHES = (
    *(
        "-s",
        "-m",
        "-h",
        "-ex",
        "-exact",
        "-sim",
        "-simpath 3 stdout",
        "-simpath time=1 p",
        "-nobuild",
        "-reduce",
        "-bisim",
        "-fair",
        "-v",
    ),
    *(
        "-nofixdl",
        "-test",
        "-testall",
        "-estimate",
        "-method power",
        "-epsilon 1e-3",
        "-absolute",
        "-prop 1",
        "-dtmc",
        "-ctmc",
        "-mdp",
    ),
    *(
        "-exporttrans stdout",
        "-exportmodel out.all",
        "-exportmodel stdout.all:rows",
        "-exportmodel stdout.drn,dot:states=false",
    ),
    *(
        "-exportmodel o.all:matlab",
        "-exportdot d.dot",
        "-exportsccs stdout",
        "-exportbsccs b",
        "-exportmecs c",
        "-exportvector v",
    ),
    *(
        "-exportstrat st.tra",
        "-exportstrat stdout:type=dot",
        "-exportresults r.txt:matrix",
        "-exportresults stdout:csv",
    ),
    *(
        "-exportproplabels",
        "-exportproplabels pl",
        "-exportlabels stdout",
        "-tr 1",
        "-tr 0:1:2",
        "-ss",
        "-ss -exportss ss",
        "-const k=1:2",
    ),
    *(
        "-exportprism stdout",
        "-exportprismconst e",
        "-exportrewards a b",
        "-exportrows",
        "-gs",
        "-javamaxmem 1g",
        "-simmethod sprt",
    ),
    *("-simsamples 20", "-exporttransrewards stdout", "-exportprecision 3"),
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    main(["d.pm", "-exportmodel", "out.all"])
    return tmp_path


@pytest.mark.parametrize("seed", range(8))
def test_any_mixture_of_switches(seed, folder, capsys):
    rng = Random(seed)
    for _ in range(8):
        words = list(rng.choice(MODELS))
        for _ in range(rng.randint(0, 3)):
            words += ["-pf", rng.choice(PROPERTIES)]
        for _ in range(rng.randint(0, 3)):
            words += rng.choice(SWITCHES).split()
        status = main(words)
        captured = capsys.readouterr()
        assert status in (0, 1, 2), words
        assert "internal" not in captured.out + captured.err, words
        assert "Traceback" not in captured.err, words
        assert not [name for name in os.listdir(folder) if name.endswith(".part")], words
        assert (
            status == 0
            or captured.err
            or "Error" in captured.out
            or "Testing result" in captured.out
        ), words
