"""Strong, bottom and end components as files, and matrices for Matlab."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.errors import UnsupportedError
from symcheck.exchange.components import components_file
from symcheck.exchange.explicit_export import explicit_export
from symcheck.exchange.export import ExportOptions as Options
from symcheck.exchange.export import Target, _texts, file_options

CHAIN = """dtmc
module m
  x : [0..4];
  [] x=0 -> 0.5 : (x'=1) + 0.5 : (x'=3);
  [] x=1 -> (x'=2);
  [] x=2 -> 0.5 : (x'=1) + 0.5 : (x'=0);
  [] x=3 -> (x'=4);
endmodule
"""
MDP = "mdp module m x:[0..2]; [a] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [b] x=0 -> true; [a] x=1 -> (x'=0); [] x=2 -> true; endmodule"


def written(text, kind):
    return "".join(components_file(explicit_export(symcheck.loads(text).engine), kind))


def test_components_of_a_chain():
    assert written(CHAIN, "sccs") == "(x)\n\nSCC 1/2:\n0:(0)\n1:(1)\n2:(2)\n\nSCC 2/2:\n4:(4)\n"
    assert written(CHAIN, "bsccs") == "(x)\n\nBSCC 1/1:\n4:(4)\n"
    with pytest.raises(UnsupportedError, match="exportbsccs"):
        written(CHAIN, "mecs")


def test_components_of_an_mdp():
    assert written(MDP, "mecs") == "(x)\n\nMEC 1/2:\n0:(0)\n\nMEC 2/2:\n2:(2)\n"
    assert written(MDP, "sccs") == "(x)\n\nSCC 1/2:\n0:(0)\n1:(1)\n\nSCC 2/2:\n2:(2)\n"


def matlab(text, kind):
    model = symcheck.loads(text)
    shot = explicit_export(
        model.engine, list(model.bound.labels), lambda n: model.engine.where(model.bound.labels[n])
    )
    return [
        "".join(chunks) for _, chunks in _texts(shot, Target(kind, "stdout", Options(matlab=True)))
    ]


def test_a_chain_for_matlab():
    text = """ctmc module q n:[0..1]; b:bool; [] n=0 -> 3:(n'=1)&(b'=true); [] n=1 -> 0.5:(n'=0); endmodule
    label "up" = n=1; rewards true : n; endrewards rewards [] n=0 : 2; endrewards"""
    assert matlab(text, "tra") == ["R = sparse(3,3);\nR(1,3)=3;\nR(2,3)=3;\nR(3,2)=0.5;\n"]
    assert matlab(text, "sta") == ["% (n,b)\nstates=[\n0,0\n0,1\n1,1\n];\n"]
    (labels,) = matlab(text, "lab")
    assert (
        labels
        == "l_init=sparse(3,1);\nl_deadlock=sparse(3,1);\nl_up=sparse(3,1);\n\nl_init(1)=1;\nl_up(3)=1;\n"
    )
    assert matlab(text, "srew") == ["c1 = sparse(3,1);\nc1(3)=1;\n", "c2 = sparse(3,1);\n"]
    assert matlab(text, "trew") == [
        "C1 = sparse(3,3);\n",
        "C2 = sparse(3,3);\nC2(1,3)=2;\nC2(2,3)=2;\n",
    ]


def test_an_mdp_has_no_single_matrix():
    with pytest.raises(UnsupportedError, match="has one matrix, and an MDP has several choices"):
        matlab(MDP, "tra")


def test_options_of_a_file():
    assert file_options("a.lab:matlab", Options()) == ("a.lab", Options(matlab=True))
    assert file_options("c:/a.lab", Options()) == ("c:/a.lab", Options())
