"""Counterexamples: each path is replayed on the model, sums are exact, command sets are compared with brute force."""

from __future__ import annotations

import json
from fractions import Fraction
from functools import cache
from itertools import combinations, pairwise
from math import prod
from pathlib import Path

import pytest

import symcheck
from symcheck import view
from symcheck.cli import main
from symcheck.errors import UnsupportedError, UsageError
from symcheck.semantics.interpreter import choices
from symcheck.tables import SHOWN_ROWS

MODELS = Path(__file__).parents[3] / "models"
DIE = MODELS / "die/die.pm"
STAKES = MODELS / "gambler/stakes.nm"

SWITCHED = """{type} const bool c0; const bool c1; const bool c2; const bool c3; const bool c4; const bool c5; const bool c6;
module m
  x : [0..6];
  [go] c0 & x=0 -> 0.5:(x'=1) + 0.3:(x'=2) + 0.2:(x'=3);
  [] c1 & x=1 -> 0.5:(x'=6) + 0.5:(x'=0);
  [] c2 & x=2 -> 0.9:(x'=6) + 0.1:(x'=5);
  [] c3 & x=3 -> 0.2:(x'=6) + 0.8:(x'=4);
  [] c4 & x=4 -> 0.7:(x'=6) + 0.3:(x'=2);
endmodule
module n
  y : [0..2];
  [go] c5 & y<2 -> 0.5:(y'=y+1) + 0.5:true;
  [go] c6 & y>0 -> (y'=y-1);
endmodule"""
COMMANDS = 7


def switched(kind, on=range(COMMANDS), exact=True):
    given = ",".join(f"c{i}={str(i in on).lower()}" for i in range(COMMANDS))
    return symcheck.loads(SWITCHED.format(type=kind), given, exact=exact, check_sums=False)


@cache
def choices_of(number, state):
    return choices(BOUND[number], state)


def cached_choices(bound, state):
    BOUND[id(bound)] = bound
    return choices_of(id(bound), state)


BOUND = {}


def replayed(model, path):
    """The probability of a path by the interpreter; in an MDP, that of the best choices with its actions."""
    bound, total = model.bound, Fraction(1)
    kind = bound.type.value
    for (a, b), action in zip(pairwise(path.states), path.actions, strict=True):
        enabled = cached_choices(bound, a.valuation)
        shares = [
            sum((Fraction(p) for p, t in c.branches if t == b.valuation), Fraction(0))
            for c in enabled
        ]
        if kind == "mdp":
            total *= max(
                s for s, c in zip(shares, enabled, strict=True) if (c.action or "") == action
            )
        else:
            assert action == ",".join(
                dict.fromkeys(
                    c.action for s, c in zip(shares, enabled, strict=True) if s and c.action
                )
            )
            out = sum(Fraction(p) for c in enabled for p, _ in c.branches)
            total *= sum(shares) / out
    return total


@pytest.mark.parametrize("operator", ["<", "<=", ">", ">="])
@pytest.mark.parametrize("shift", [Fraction(-1, 50), 0, Fraction(1, 50)])
@pytest.mark.parametrize(
    "path",
    [
        "F d=6", "F<=4 d=6", "G<=3 d=0", "s!=5 U d>2", "X s=1", "d=0 W d=3", "G d<6", "F<=6 !(d=0)",
        'F{"tosses"}<=4 d=6',  'F{"tosses"}>=4 d=6', 'G{"tosses"}<=3 d=0', 'X{"tosses"}<=1 s=1',
        'd=0 U{"tosses"}[2,3] d>2', 'F^{rew{"tosses"}<=5, steps<=4} d=6',
    ],
)  # fmt: skip
def test_paths_prove_the_verdict(operator, shift, path):
    die = symcheck.load(DIE, exact=True)
    value = die.check(f"P=? [ {path} ]").value
    result = die.check(f"P{operator}{value + shift} [ {path} ]")
    found = result.counterexample(paths=60)
    assert found.refutes is not result.value
    assert found.satisfies == ((operator in "<=") == found.refutes)
    assert found.threshold == (value + shift if found.satisfies else 1 - value - shift)
    total = sum(p.probability for p in found.paths)
    assert found.probability == total == sum(replayed(die, p) for p in found.paths)
    assert len({p.states for p in found.paths}) == len(found.paths)
    reached = total > found.threshold if found.strict else total >= found.threshold
    assert found.complete == reached
    if shift:
        assert reached
    if found.complete and found.paths:  # the fewest paths: without the last one, too few
        less = total - found.paths[-1].probability
        assert not (less > found.threshold if found.strict else less >= found.threshold)
    # and what they show is the verdict, by arithmetic alone
    of_path = (value if found.satisfies else 1 - value) - total
    assert of_path >= 0


def satisfied_by(path, text):
    """Whether a finite path of the die decides a path formula, by hand."""
    s, d = ([state[v] for state in path] for v in "sd")
    match text:
        case "F d=6":
            return 6 in d
        case "G<=3 d=0":
            return len(d) == 4 and not any(d)
        case "F<=4 d=6":
            return 6 in d[:5]
        case "s<3 U d>2":
            return d[-1] > 2 and all(x < 3 for x in s[:-1])
    raise AssertionError


@pytest.mark.parametrize("text", ["F d=6", "G<=3 d=0", "F<=4 d=6", "s<3 U d>2"])
def test_paths_satisfy_the_formula(text):
    found = symcheck.load(DIE, exact=True).check(f"P<0.01 [ {text} ]")
    if found.value:
        return
    paths = found.counterexample().paths
    assert all(satisfied_by(p, text) for p in paths)


def test_a_violation_is_final():
    """Paths that violate F d=6 end where 6 cannot be reached any more."""
    die = symcheck.load(DIE, exact=True)
    found = die.check("P>=0.3 [ F d=6 ]").counterexample()
    impossible = die.where("P<=0 [ F d=6 ]")
    assert found.complete
    assert all(
        p[-1] in impossible and all(s not in impossible for s in p[:-1]) for p in found.paths
    )


@pytest.mark.parametrize(
    "formula",
    ['P<=0.1 [ F "rich" ]', 'P>=0.3 [ F "rich" ]', 'P<=0.2 [ F<=4 "rich" ]', 'P>=0.2 [ F<=3 "rich" ]',
     'Pmax>=0.2 [ F "rich" ]', 'Pmin<0.2 [ F<=4 "rich" ]', 'Pmax>0.21 [ F<=4 "rich" ]', 'P<0.1 [ X money=4 ]'],
)  # fmt: skip
def test_strategies_of_mdps(formula):
    model = symcheck.load(STAKES)
    result = model.check(formula)
    found = result.counterexample(paths=5000)
    assert found.refutes is not result.value
    assert found.complete, found.summary
    for p in found.paths:
        assert p.probability == pytest.approx(float(replayed(model, p)))
    # one strategy: after the same history the same action (with a bound, the number of steps is in it)
    taken = {}
    for p in found.paths:
        for i, action in enumerate(p.actions):
            assert taken.setdefault(p.states[: i + 1], action) == action


@pytest.mark.parametrize(
    "formula", ['P<0.256 [ F "rich" ]', 'P>=0.3 [ F "rich" ]', 'P<32/125 [ F<=4 "rich" ]']
)
def test_sums_over_a_strategy_are_exact(formula):
    model = symcheck.load(STAKES, exact=True)
    found = model.check(formula).counterexample(paths=2000)
    assert found.complete
    assert found.probability == sum(p.probability for p in found.paths)
    assert all(p.probability == replayed(model, p) for p in found.paths[:50])


def test_paths_begin_in_an_initial_state_that_breaks_the_bound():
    text = "dtmc module m x:[0..3]; y:[0..1]; [] x<3 -> 0.5:(x'=x+1)+0.5:(x'=0); endmodule init x=0 endinit"
    found = symcheck.loads(text, exact=True).check("P<=0.3 [ F x=3&y=1 ]").counterexample()
    assert {p[0].valuation for p in found.paths} == {(0, 1)}


def test_models_without_commands():
    found = (
        symcheck.from_matrix([[0, 0.5, 0.5], [0, 1, 0], [0.5, 0, 0.5]])
        .check("P<=0.6 [ F s=1 ]")
        .counterexample()
    )
    assert [[s["s"] for s in p] for p in found.paths] == [[0, 1], [0, 2, 0, 1]]
    assert found.note == "no commands: the model has none"


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("engine", ["explicit", "sparse", "mtbdd"])
def test_every_engine_gives_the_same_paths(kind, engine):
    model = symcheck.loads(
        SWITCHED.format(type=kind), ",".join(f"c{i}=true" for i in range(7)), engine=engine
    )
    found = model.check("P<=0.6 [ F x=6 ]").counterexample()
    assert found.complete
    assert [p.probability for p in found.paths[:3]] == pytest.approx(
        [0.135, 0.135, 0.125][:3]
    ) or kind == "mdp"


def test_rates_of_a_ctmc_become_probabilities():
    model = symcheck.load(MODELS / "queue/queue.sm", exact=True)
    found = model.check("P<=0.5 [ n<2 U n=2 ]").counterexample()
    assert found.complete
    assert found.probability == sum(replayed(model, p) for p in found.paths)
    assert found.commands is None
    assert "CTMC" in found.note


# ------------------------------------------------------------------------------- commands


def reaches(kind, on, threshold, strict, bound=""):
    """Whether the model with only these commands reaches x=6 often enough, by exact model checking."""
    letter = "Pmax" if kind == "mdp" else "P"
    value = switched(kind, on).check(f"{letter}=? [ F{bound} x=6 ]").value
    return value > threshold if strict else value >= threshold


def numbers(commands):
    return {int(text.split("c")[1][0]) for text in commands.commands}


@pytest.mark.parametrize("threshold", ["1/10", "1/4", "0.5", "0.6", "0.75", "0.85"])
@pytest.mark.parametrize("bound", ["", "<=3"])
def test_the_smallest_set_of_commands_of_a_chain(threshold, bound):
    result = switched("dtmc").check(f"P<={threshold} [ F{bound} x=6 ]")
    if result.value:
        return
    commands = result.counterexample().commands
    own = numbers(commands)
    need = Fraction(threshold)
    # The commands of n overlap: a chain takes each with half of the probability, so that leaving one out makes
    # the other more likely. Paths lose what the one has, and a set without it may only seem to suffice.
    if not {5, 6} & own or {5, 6} <= own:
        assert reaches("dtmc", own, need, True, bound)
    assert commands.smallest
    fewer = (set(c) for c in combinations(range(COMMANDS), len(own) - 1))
    assert not any(
        reaches("dtmc", on, need, True, bound) for on in fewer if not {5, 6} & on or {5, 6} <= on
    )


@pytest.mark.parametrize("threshold", ["0.1", "0.5", "0.6", "0.75", "0.85"])
@pytest.mark.parametrize("bound", ["", "<=3"])
def test_the_smallest_set_of_commands_of_an_mdp(threshold, bound):
    result = switched("mdp", exact=False).check(f"P<={threshold} [ F{bound} x=6 ]")
    if result.value:
        return
    commands = result.counterexample().commands
    assert commands.smallest
    assert reaches("mdp", numbers(commands), Fraction(threshold), True, bound)
    fewer = combinations(range(COMMANDS), len(commands.commands) - 1)
    assert not any(reaches("mdp", set(on), Fraction(threshold), True, bound) for on in fewer)


def test_a_budget_leaves_an_irreducible_set(monkeypatch):
    monkeypatch.setattr("symcheck.check.tuning.COMMAND_SET_CHECKS", 1)
    commands = switched("dtmc").check("P<=0.5 [ F x=6 ]").counterexample().commands
    assert not commands.smallest
    assert "maybe not a smallest one" in str(commands)
    own = numbers(commands)
    assert reaches("dtmc", own, Fraction(1, 2), True)
    assert not any(reaches("dtmc", own - {c}, Fraction(1, 2), True) for c in own - {5, 6})


def test_renamed_modules_have_their_own_commands():
    text = """dtmc module a x : [0..2]; [t] x=0 -> 0.5:(x'=1)+0.5:(x'=2); endmodule
      module b = a [x=y] endmodule"""
    found = symcheck.loads(text).check("P<0.2 [ F x=1&y=1 ]").counterexample()
    assert found.commands.commands == (
        "[t] x=0 -> 0.5:(x'=1)+0.5:(x'=2)",
        "[t] y=0 -> 0.5 : (y'=1) + 0.5 : (y'=2)",
    )


# ------------------------------------------------------------------------------- refusals, limits, texts


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("Pmax=? [ F x=6 ]", "with a bound"),
        ("P<=0.999 [ F x=6 ]", "every strategy"),
        ("T<=0.1 [ F (x=6 & X x=6) ]", "supported for F states"),
        (
            "T<=100 [ F x=1 | x=2 | x=3 ]",
            "of every strategy",
        ),
        ("x=0", "with a bound"),
        ("P<=0.1 [ F<=10000000 x=6 ]", "too many"),
    ],
)
def test_refusals(formula, message):
    with pytest.raises(UnsupportedError, match=message):
        switched("mdp", exact=False).check(formula).counterexample()


def test_a_limit_is_told():
    found = symcheck.load(DIE).check("P<0.16666 [ F d=6 ]").counterexample(paths=2)
    assert not found.complete
    assert found.note == "the limit of 2 paths was reached before the threshold"
    assert found.summary.endswith("0.15625: not yet at least 0.16666, 0.01041 is missing")
    assert found.commands is not None
    with pytest.raises(UsageError, match="a number of paths"):
        symcheck.load(DIE).check("P<0.1 [ F d=6 ]").counterexample(paths=-1)


def test_the_probability_of_paths_that_are_not_printed_is_told():
    found = symcheck.load(DIE).check("P<0.1666666666 [ F d=6 ]").counterexample()
    *_, told = (line for line in str(found).splitlines() if "none likelier" in line)
    shown = sum(float(p.probability) for p in found.paths[:SHOWN_ROWS])
    assert float(told.split()[-1]) == pytest.approx(float(found.probability) - shown, rel=1e-5)


def test_rounding_does_not_reach_a_threshold():
    """1/3 of the text lies above the double 1/3: the sum of doubles is no proof, that of rationals is."""
    text = "dtmc module m x:[0..3]; [] x=0 -> 1/3:(x'=1)+1/3:(x'=2)+1/3:(x'=3); endmodule"
    for exact in (False, True):
        found = symcheck.loads(text, exact=exact).check("P<1/3 [ F x=1 ]").counterexample()
        assert found.complete is exact
        assert ("rounding errors" in found.note) is not exact
        assert "0 is missing" not in found.summary


def test_nothing_needs_to_be_shown_of_a_trivial_bound():
    found = symcheck.load(DIE).check("P>=0 [ F d=6 ]").counterexample()
    assert (found.paths, found.complete) == ((), True)


def test_an_initial_target_is_a_path():
    none = symcheck.load(DIE).check("P<=0.1 [ F<=0 d=6 ]").counterexample()
    assert [(len(p), p.probability) for p in none.paths] == [(1, 1.0)]
    found = symcheck.load(DIE).check("P<=0.5 [ F s=0 ]").counterexample()
    assert [len(p) for p in found.paths] == [1]
    assert found.note == "no commands: the initial state decides"


def test_texts_and_files(tmp_path, capsys):
    found = symcheck.load(DIE).check("P<=0.13 [ F d=6 ]").counterexample()
    lines = str(found).splitlines()
    assert lines[:2] == [
        "2 paths that satisfy the path formula, with probability 0.15625: more than 0.13, so the property is false",
        "  0.125: (s=0, d=0) -> (s=2, d=0) -> (s=6, d=0) -> (s=7, d=6)",
    ]
    assert lines[3] == "3 of 3 commands suffice (a smallest set):"
    assert "<td>0.125</td>" in found._repr_html_()
    words = [str(DIE), "-pf", "P<=0.13 [ F d=6 ]", "-counterexample"]
    for name in ("c.txt", "c.json", "c.dot"):
        assert main([*words, "-exportcounterexample", str(tmp_path / name)]) == 0
        assert "\n".join(lines) in capsys.readouterr().out
    assert lines[2] in (tmp_path / "c.txt").read_text()
    written = json.loads((tmp_path / "c.json").read_text())
    assert written["paths"][0]["states"][-1] == {"s": 7, "d": 6}
    assert written["threshold"] == "13/100"
    assert written["smallest"] is True
    assert prod([0.5] * 3) == written["paths"][0]["probability"]
    dot = (tmp_path / "c.dot").read_text()
    assert '12 [label="(s=7, d=6)", peripheries=2]' in dot
    assert dot.count("->") == len(found.steps) == 4


def test_the_command_line_says_why_there_is_none(tmp_path, capsys):
    assert main([str(DIE), "-pf", "P=? [ F d=6 ]", "-counterexample"]) == 0
    assert (
        "Warning: no counterexample: counterexamples are for P, R and T with a bound"
        in capsys.readouterr().out
    )
    assert main([str(DIE), "-pf", "d=0", "-exportcounterexample", "c.pdf"]) == 2
    assert "none of .txt, .json, .dot" in capsys.readouterr().err


def test_a_long_path_is_printed_without_its_middle():
    text = "dtmc module m x:[0..99]; [] x<99 -> (x'=x+1); endmodule"
    found = symcheck.loads(text).check("P<=0.5 [ F x=99 ]").counterexample()
    assert "(x=5) … 88 more states … -> (x=94)" in str(found)
    assert "(x=50)" in str(found.paths[0])


def test_pictures_show_all_paths():
    model = symcheck.load(DIE)
    found = model.check("P<=0.13 [ F d=6 ]").counterexample()
    one, both = (view.state_graph(model, path=p).dot for p in (found.paths[0], found))
    assert one.count("#b3261e") < both.count("#b3261e")


def test_pictures_emphasise_the_action_of_a_path():
    """Both actions lead to x=1, and only one belongs to the strategy."""
    text = """mdp module m x:[0..2];
      [a] x=0 -> 0.9:(x'=1)+0.1:(x'=2); [b] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [] x>0 -> true; endmodule"""
    model = symcheck.loads(text)
    found = model.check("P<=0.6 [ F x=1 ]").counterexample()
    picture = view.state_graph(model, path=found)
    red = {(e.source, e.target, e.label) for e in picture.edges if e.emphasis == "path"}
    assert {label for _, _, label in red} == {"a", "0.9"}
    assert picture.legend == "red: on a path"


def test_pictures_leave_out_what_is_the_same_in_all_states(tmp_path):
    names = "abcdefgh"
    variables = " ".join(f"{n}:[0..1];" for n in names)
    text = f"dtmc module m {variables} [] a=0 -> 0.5:(a'=1)+0.5:true; [] a=1&h=0 -> (h'=1); [] h=1 -> true; endmodule"
    model = symcheck.loads(text)
    found = model.check("P<=0.7 [ F h=1 ]").counterexample()
    picture = view.state_graph(model, path=found)
    assert picture.nodes[0].label == "a=0, h=0"
    assert "in all states: b=0, c=0, d=0, e=0, f=0, g=0" in picture.legend
    found.save(tmp_path / "c.dot")
    dot = (tmp_path / "c.dot").read_text()
    assert '[label="(a=1, h=1)", peripheries=2]' in dot
    assert '[label=" 0.5 "]' in dot
    assert "so the property is false\\nbold: the first state" in dot
    assert found.paths[0].steps == (0.5, 1.0)


def test_many_variables_are_shown_where_they_change():
    names = "abcdefgh"
    variables = " ".join(f"{n}:[0..1];" for n in names)
    text = f"dtmc module m {variables} [] a=0 -> (a'=1); [] a=1&h=0 -> (h'=1)&(c'=1); endmodule"
    (path,) = symcheck.loads(text).check("P<=0.5 [ F h=1 ]").counterexample().paths
    assert str(path).endswith("h=0) -> (a=1) -> (c=1, h=1)")


def test_a_path_goes_on_to_where_every_strategy_has_lost() -> None:
    """In the initial state, the strategy has lost already; the path shows by what it does."""
    model = symcheck.loads(
        """mdp
        module robot
          pos : [0..3] init 0;
          bat : [0..6] init 6;
          [fast] pos<3 & bat>0 -> 0.9:(pos'=pos+1)&(bat'=bat-1) + 0.1:(bat'=bat-1);
          [slow] pos<3 & bat>1 -> (pos'=min(3,pos+1))&(bat'=bat-2);
          [stop] bat=0 -> true;
        endmodule
        """
    )
    found = model.check("P>=0.9 [ F pos=3 & bat>0 ]").counterexample()
    (path,) = found.paths
    assert [s.valuation for s in path] == [(0, 6), (1, 4), (2, 2), (3, 0)]
    assert path.actions == ("slow", "slow", "slow")
    assert found.probability == 1.0
    (trivial,) = model.check("P>=0.9 [ F pos=3 & bat>6 ]").counterexample().paths
    assert len(trivial) == 1  # no strategy helps
