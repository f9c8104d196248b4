"""The actions of chains: a line per source, target and action, as PRISM writes them."""

from __future__ import annotations

import io
import re
from collections import defaultdict
from fractions import Fraction
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import symcheck
from exchange.models import some_model
from symcheck.errors import SyntaxFault
from symcheck.exchange.explicit_export import explicit_export
from symcheck.exchange.export import export, parse_target
from symcheck.semantics.interpreter import choices
from symcheck.view import state_graph

DTMC = """dtmc
module m
  x : [0..2];
  [b] x=0 -> (x'=1);
  [a] x=0 -> 1/2 : (x'=1) + 1/2 : (x'=2);
  [] x=0 -> 1/4 : (x'=0) + 3/4 : (x'=1);
  [] x=1 -> (x'=0);
endmodule
"""
# The three choices of state 0 are equally likely; state 2 is a deadlock.
LINES = ["0 0 1/12", "0 1 1/4", "0 1 1/6 a", "0 1 1/3 b", "0 2 1/6 a", "1 0 1", "2 2 1"]
CTMC = """ctmc
module q
  n : [0..2] init 0;
  [arrive] n<2 -> 2 : (n'=n+1);
  [serve] n>0 -> 3 : (n'=n-1);
  [lose] n=1 -> 1 : (n'=0);
endmodule
"""
ENGINES = [{"engine": e} for e in ("explicit", "sparse", "hybrid", "mtbdd")] + [{"exact": True}]


def written(model, target):
    out = io.StringIO()
    list(export(explicit_export(model.engine), parse_target(target, "m"), out))
    return out.getvalue()


def lines_of(text):
    """The lines after the first, with numbers as fractions or doubles."""
    return [line.split() for line in text.splitlines()[1:]]


@pytest.mark.parametrize("options", ENGINES)
def test_a_line_for_each_action(options):
    text = written(symcheck.loads(DTMC, **options), "stdout.tra")
    assert text.startswith("3 7\n")
    expected = [line.split() for line in LINES]
    for found, wanted in zip(lines_of(text), expected, strict=True):
        assert found[:2] + found[3:] == wanted[:2] + wanted[3:]
        assert float(Fraction(found[2])) == pytest.approx(float(Fraction(wanted[2])), rel=1e-15)
    if "exact" in options:
        assert text.splitlines()[1:] == LINES


@pytest.mark.parametrize("options", ENGINES)
def test_rates_of_a_ctmc(options):
    assert written(symcheck.loads(CTMC, **options), "stdout.tra").splitlines() == [
        "3 5",
        "0 1 2 arrive",
        "1 0 1 lose",
        "1 0 3 serve",
        "1 2 2 arrive",
        "2 1 3 serve",
    ]


def test_options():
    model = symcheck.loads(CTMC)
    assert written(model, "stdout.tra:actions=false") == "3 4\n0 1 2\n1 0 4\n1 2 2\n2 1 3\n"
    assert written(model, "stdout.tra:rows") == "3 4\n0 2:1\n1 4:0 2:2\n2 3:1\n"
    assert written(model, "stdout.tra:headers").startswith("# Transitions (CTMC)\n3 5\n")
    assert written(symcheck.loads(DTMC), "stdout.tra:headers").startswith("# Transitions (DTMC)\n3")
    assert "serve" not in written(model, "stdout.drn:actions=false")
    assert '1 -> 0 [label="4"];' in written(model, "stdout.dot:actions=false")


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**9), kind=st.sampled_from(["dtmc", "ctmc"]))
def test_the_interpreter_finds_the_same(seed, kind):
    model = symcheck.loads(some_model(Random(seed), kind).text, exact=True)
    expected = defaultdict(Fraction)
    states = [tuple(s.valuation) for s in model.states]
    for i, state in enumerate(states):
        enabled = choices(model.bound, state)
        for choice in enabled:
            for weight, target in choice.branches:
                share = 1 if kind == "ctmc" else len(enabled)
                expected[i, states.index(target), choice.action or ""] += Fraction(weight) / share
        if not enabled:
            expected[i, i, ""] = Fraction(1)
    found = {
        (int(s), int(t), "".join(action)): Fraction(p)
        for s, t, p, *action in lines_of(written(model, "stdout.tra:headers=false"))
    }
    assert found == {key: weight for key, weight in expected.items() if weight}


@pytest.mark.parametrize("suffix", ["all", "umb"])
@pytest.mark.parametrize("text", [DTMC, CTMC])
def test_what_is_read_is_written_again(text, suffix, tmp_path):
    if suffix == "umb":
        pytest.importorskip("umbi")
    model = symcheck.loads(text)
    symcheck.export(model, str(tmp_path / f"m.{suffix}"))
    for options in ENGINES:
        read = symcheck.load_explicit(str(tmp_path / f"m.{suffix}"), **options)
        assert read.transitions.action.tolist() == model.transitions.action.tolist()
        assert read.engine.transitions == model.engine.transitions
        symcheck.export(read, str(tmp_path / "again.tra"))
        again = lines_of((tmp_path / "again.tra").read_text())
        for found, wanted in zip(again, lines_of(written(model, "stdout.tra")), strict=True):
            assert found[:2] + found[3:] == wanted[:2] + wanted[3:]
            assert float(Fraction(found[2])) == pytest.approx(float(wanted[2]), rel=1e-15)


def test_the_same_action_twice_is_a_fault(tmp_path):
    (tmp_path / "m.tra").write_text("2 4\n0 1 0.5 a\n0 1 0.25 b\n0 1 0.25 a\n1 1 1\n")
    with pytest.raises(SyntaxFault, match=r"(?s)m.tra:4:1.*this transition is in the file already"):
        symcheck.load_explicit(str(tmp_path / "m.all"))


def test_tables_graphs_and_pictures(tmp_path):
    model = symcheck.loads(CTMC)
    actions = ["arrive", "lose, serve", "arrive", "serve"]
    assert model.transitions.action.tolist() == actions
    edges = model.to_networkx().edges(data="action")
    assert [action for _, _, action in edges] == actions
    symcheck.export(model, str(tmp_path / "m.tra"))
    for drawn in (model, symcheck.load_explicit(str(tmp_path / "m.tra"))):
        assert {e.label for e in state_graph(drawn).edges} == {
            "2 arrive",
            "4 lose, serve",
            "3 serve",
        }
    assert '1 -> 0 [label="3:serve"];' in written(model, "stdout.dot")
    assert "state 1 !6\n\taction arrive_lose_serve\n" in written(model, "stdout.drn")


@pytest.mark.parametrize("options", ENGINES)
def test_steps_of_a_chain_that_was_read(options, tmp_path):
    symcheck.export(symcheck.loads(DTMC), str(tmp_path / "m.tra"))
    read = symcheck.load_explicit(str(tmp_path / "m.tra"), **options)
    simulator = read.simulator(seed=3)
    assert [c.action for c in simulator.choices] == [None, "a", "b"]
    simulator.step("a", 1)
    assert simulator.state == {"x": 2}
    assert simulator.path.steps[-1].action == "a"
    assert simulator.path.steps[-1].probability == pytest.approx(1 / 6)


def test_storm_finds_the_same_actions(tmp_path):
    stormpy = pytest.importorskip("stormpy")
    (tmp_path / "m.pm").write_text(DTMC)
    options = stormpy.BuilderOptions()
    options.set_build_choice_labels(True)
    program = stormpy.parse_prism_program(str(tmp_path / "m.pm"))
    labels = stormpy.build_model(program, options=options).choice_labeling
    expected = ["_".join(sorted(labels.get_labels_of_choice(s))) or "__NOLABEL__" for s in range(3)]
    found = re.findall(r"action (\w+)", written(symcheck.loads(DTMC), "stdout.drn"))
    assert sorted(found) == sorted(expected)
    symcheck.export(symcheck.loads(DTMC), str(tmp_path / "m.drn"))
    assert stormpy.build_model_from_drn(str(tmp_path / "m.drn")).nr_transitions == 5
