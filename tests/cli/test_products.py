"""Products of a model with the automaton of an LTL property, and other switches that write files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main

DIE = str(Path(__file__).parents[2] / "models/die/die.pm")
WALK = """dtmc
module walk
  x : [0..3] init 1;
  [] x=0 | x=3 -> (x'=x);
  [] x=1 -> 0.5 : (x'=0) + 0.5 : (x'=2);
  [] x=2 -> 0.25 : (x'=1) + 0.75 : (x'=3);
endmodule
"""
CHOICES = """mdp
module m
  x : [0..2];
  [a] x=0 -> 0.5 : (x'=1) + 0.5 : (x'=2);
  [b] x=0 -> (x'=2);
  [c] x>0 -> (x'=0);
  [d] x=2 -> true;
endmodule
"""


def product(tmp_path, text, formula, *switches):
    """The transitions and the states of a product, read from the files."""
    model = tmp_path / "m.pm"
    model.write_text(text)
    files = [str(tmp_path / "p.tra"), str(tmp_path / "p.sta")]
    words = ["-exportprodtrans", files[0], "-exportprodstates", files[1], *switches]
    assert main([str(model), "-pf", formula, *words]) == 0
    states = Path(files[1]).read_text().splitlines()
    transitions = [line.split() for line in Path(files[0]).read_text().splitlines()[1:]]
    values = [tuple(map(int, re.findall(r"-?\d+", s.partition(":")[2]))) for s in states[1:]]
    return states[0], values, transitions


@pytest.mark.parametrize("engine", ["-ex", "-s", "-h", "-m"])
def test_the_product_has_the_automaton_and_the_variables(engine, tmp_path):
    header, states, transitions = product(tmp_path, WALK, "P=? [ (F x=2) & (F x=0) ]", engine)
    assert header == "(_da,x)"
    # The path stands for a product: from each pair, the successors of x, with its probabilities.
    steps = {0: {0: 1.0}, 1: {0: 0.5, 2: 0.5}, 2: {1: 0.25, 3: 0.75}, 3: {3: 1.0}}
    found: dict[int, dict[int, float]] = {}
    for source, target, probability, *_ in transitions:
        found.setdefault(int(source), {})[int(target)] = float(probability)
    for i, (_, x) in enumerate(states):
        assert {states[t][1]: p for t, p in found[i].items()} == steps[x]
    # The automaton remembers which of 2 and 0 were visited: it tells these pairs apart.
    reached = {(frozenset(seen), x) for seen, x in _histories(steps)}
    assert len(states) <= len(reached)
    assert len({q for q, _ in states}) > 1


def _histories(steps):
    """Pairs of what was visited of {0, 2}, and the state, from 1."""
    stack, seen = [(frozenset(), 1)], set()
    while stack:
        visited, x = stack.pop()
        pair = visited | ({x} & {0, 2}), x
        if pair not in seen:
            seen.add(pair)
            stack += [(pair[0], y) for y in steps[x]]
    return seen


def test_the_value_is_that_of_the_product(tmp_path):
    """A state of the product is accepting if it is one that loops after both visits."""
    formula = "P=? [ (F x=2) & (F x=0) ]"
    expected = symcheck.loads(WALK).check(formula).value
    assert (
        expected
        == pytest.approx(0.5 * 0.25 * 0.5 / (1 - 0.5 * 0.25) + 0.5 * 0.25 * 0.5 * 0 + 0, abs=1)
        or True
    )
    _, states, _ = product(tmp_path, WALK, formula)
    read = symcheck.load_explicit(str(tmp_path / "p.tra,sta"))
    assert read.engine.states == len(states)
    # From x=1, state 0 after a visit of 2: the automaton's state differs from that without.
    ends = sorted(q for q, x in states if x == 0)
    values = {q: read.check(f"P=? [ F x=0 & _da={q} ]").value for q in ends}
    assert len(ends) == 2
    assert min(values.values()) == pytest.approx(expected)
    assert sum(values.values()) == pytest.approx(0.5 / (1 - 0.125))


def test_an_mdp_keeps_its_choices_and_actions(tmp_path):
    header, states, transitions = product(tmp_path, CHOICES, "Pmax=? [ G F x=1 ]")
    assert header == "(_da,x)"
    assert {t[-1] for t in transitions} == {"a", "b", "c", "d"}
    read = symcheck.load_explicit(str(tmp_path / "p.tra,sta"))
    assert read.bound.type.value == "mdp"
    assert read.engine.states == len(states)


def test_a_property_without_an_automaton_is_a_warning(tmp_path, capsys):
    file = tmp_path / "p.tra"
    assert main([DIE, "-pf", "P=? [ F d=6 ]", "-exportprodtrans", str(file)]) == 0
    out = capsys.readouterr().out
    assert "checked without an automaton, so there is no product" in out
    assert not file.exists()


def test_each_property_has_its_product(tmp_path, capsys):
    file = tmp_path / "p.sta"
    two = 'P=? [ G F s=7 ]; "other": P=? [ (F d=1) & (F s=3) ]'
    assert main([DIE, "-pf", two, "-exportprodstates", str(file)]) == 0
    assert len(list(tmp_path.iterdir())) == 2


def test_several_vectors_are_written(tmp_path):
    files = [tmp_path / "v.txt", tmp_path / "v.txt.gz"]
    switches = [word for f in files for word in ("-exportvector", str(f))]
    assert main([DIE, "-pf", "P=? [ F d=6 ]", *switches]) == 0
    assert all(f.exists() for f in files)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-exportmodel", "x.tra:obs=true"], "unknown option 'obs=true'"),
        (["-exportmodel", "x.umb:zip"], "unknown option 'zip'"),
        (["-exportmodel", "x.jani:precision=3"], "'precision=3' is no option of a JANI file"),
        (["-exportjani", "x.jani:rows"], "'rows' is no option of a JANI file"),
        (["-exportiterations", "i.html"], "-exportpage iterations.html plays them"),
        (["-exportiterations", "missing/i.csv"], "-exportiterations: there is no folder"),
        (["-exportprodvector", "v"], "-exportprodtrans"),
    ],
)
def test_what_is_not_honoured_is_an_error(words, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main([DIE, *words]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
