"""Commands that suffice for a bound on a reward: by hand, and against all sets with exact model checking."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import combinations
from pathlib import Path

import pytest

import symcheck
from symcheck.cli import main
from symcheck.errors import UnsupportedError

# From s=0 the rewards are 1, then 4 on average by s=1 or 1 by s=2: 1 + 1/2 * 4 + 1/2 * 1 = 7/2.
FORK = """dtmc module m s:[0..3];
  [] s=0 -> 1/2:(s'=1) + 1/2:(s'=2);
  [] s=1 -> 1/2:(s'=1) + 1/2:(s'=3);
  [] s=2 -> (s'=3);
endmodule rewards s=0 : 1; s=1 : 2; s=2 : 1; endrewards"""
FIRST, SECOND, THIRD = (
    "[] s=0 -> 1/2:(s'=1) + 1/2:(s'=2)",
    "[] s=1 -> 1/2:(s'=1) + 1/2:(s'=3)",
    "[] s=2 -> (s'=3)",
)

# With c5 and c6 both enabled, a chain takes each of them with half of the probability.
SWITCHED = """{type} const bool c0; const bool c1; const bool c2; const bool c3; const bool c4; const bool c5; const bool c6;
module m
  x : [0..6];
  [go] c0 & x=0 -> 0.5:(x'=1) + 0.3:(x'=2) + 0.2:(x'=3);
  [one] c1 & x=1 -> 0.5:(x'=6) + 0.5:(x'=0);
  [] c2 & x=2 -> 0.9:(x'=6) + 0.1:(x'=5);
  [] c3 & x=3 -> 0.2:(x'=6) + 0.8:(x'=4);
  [four] c4 & x=4 -> 0.7:(x'=6) + 0.3:(x'=2);
endmodule
module n
  y : [0..2];
  [go] c5 & y<2 -> 0.5:(y'=y+1) + 0.5:true;
  [go] c6 & y>0 -> (y'=y-1);
endmodule
rewards [go] y<2 : 1; [go] y=2 : 2; [one] true : 1/2; [] true : 1; [four] y>0 : 4; endrewards"""
COMMANDS = 7


def switched(kind, on=range(COMMANDS), **options):
    given = ",".join(f"c{i}={str(i in on).lower()}" for i in range(COMMANDS))
    return symcheck.loads(SWITCHED.format(type=kind), given, **options)


def earned(kind, on, query):
    """What is earned with only these commands, which is nothing once none is enabled."""
    letter = "Rmax" if kind == "mdp" else "R"
    return switched(kind, on, exact=True).check(f"{letter}=? [ {query} ]").value


def numbers(commands):
    return {int(text.split("c")[1][0]) for text in commands.commands}


@pytest.mark.parametrize("engine", ["exact", "explicit", "sparse", "mtbdd", "hybrid"])
@pytest.mark.parametrize(
    ("bound", "wanted"),
    [
        ("<0.9", {FIRST}),
        ("<=0.9", {FIRST}),
        ("<=1.6", {FIRST, SECOND}),
        ("<=2.9", {FIRST, SECOND}),
        ("<=3.1", {FIRST, SECOND, THIRD}),
        (">=0.9", {FIRST}),
        (">2.9", {FIRST, SECOND}),
    ],
)
def test_commands_that_earn_enough(bound, wanted, engine):
    options = {"exact": True} if engine == "exact" else {"engine": engine}
    found = symcheck.loads(FORK, **options).check(f"R{bound} [ F s=3 ]").counterexample()
    assert found.refutes is bound.startswith("<")
    assert set(found.commands.commands) == wanted
    assert found.commands.of_reward
    assert not found.commands.any_strategy


@pytest.mark.parametrize(("bound", "count"), [("<3", 2), ("<=3", 3), ("<7/2", 3)])
def test_sums_at_the_threshold_are_exact(bound, count):
    """The first two commands earn 3 exactly, and all of them 7/2."""
    commands = (
        symcheck.loads(FORK, exact=True).check(f"R{bound} [ F s=3 ]").counterexample(0).commands
    )
    assert (len(commands.commands), commands.of, commands.smallest) == (count, 3, True)


def test_rounding_proves_no_set_at_the_threshold():
    found = symcheck.loads(FORK).check("R<7/2 [ F s=3 ]").counterexample(0)
    assert found.commands is None or len(found.commands.commands) == 3


def test_a_step_counts_with_the_share_of_its_command():
    """Two commands in the same state: each has half of the probability, and only one earns 4."""
    model = symcheck.loads(
        """dtmc module m s:[0..1]; [a] s=0 -> (s'=1); [b] s=0 -> true; endmodule
        rewards [a] true : 4; endrewards""",
        exact=True,
    )
    assert model.check("R=? [ F s=1 ]").value == 4
    one, both = (model.check(f"R<={r} [ F s=1 ]").counterexample().commands for r in ("1.9", "2"))
    assert one.commands == ("[a] s=0 -> (s'=1)",)
    assert len(both.commands) == 2
    assert one.smallest
    assert both.smallest


QUERIES = [("F x>=5", "C"), ("C<=4", "C<=4")]


@pytest.mark.parametrize("threshold", ["1/2", "1", "9/5", "2.5", "3", "3.5", "4", "5", "6"])
@pytest.mark.parametrize(("query", "total"), QUERIES)
def test_the_smallest_set_of_commands_of_a_chain(threshold, query, total):
    result = switched("dtmc", exact=True).check(f"R<={threshold} [ {query} ]")
    if result.value:
        return
    commands = result.counterexample(0).commands
    own, need = numbers(commands), Fraction(threshold)
    # Without one of c5 and c6, the model gives the other one its share: only then it earns more.
    whole = {5, 6} <= own or not {5, 6} & own
    if whole:
        assert earned("dtmc", own, total) > need
    assert commands.smallest
    fewer = (set(c) for c in combinations(range(COMMANDS), len(own) - 1))
    assert not any(
        earned("dtmc", on, total) > need for on in fewer if {5, 6} <= on or not {5, 6} & on
    )


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("threshold", ["1/2", "9/5", "3.01", "4", "5", "6"])
@pytest.mark.parametrize(("query", "total"), QUERIES)
def test_the_smallest_set_of_commands_of_an_mdp(threshold, query, total, exact):
    result = switched("mdp", exact=exact).check(f"R<={threshold} [ {query} ]")
    if result.value:
        return
    commands = result.counterexample(0).commands
    own, need = numbers(commands), Fraction(threshold)
    assert commands.any_strategy
    assert commands.smallest
    assert earned("mdp", own, total) > need
    fewer = combinations(range(COMMANDS), len(own) - 1)
    assert not any(earned("mdp", set(on), total) > need for on in fewer)


def test_thresholds_of_these_tests_are_exceeded():
    """So that the tests above compare sets, and the value is that of all commands."""
    for kind in ("dtmc", "mdp"):
        model = switched(kind, exact=True)
        for query, total in QUERIES:
            letter = "Rmax" if kind == "mdp" else "R"
            value = model.check(f"{letter}=? [ {query} ]").value
            assert value == earned(kind, range(COMMANDS), total)
            assert value > Fraction(5, 2)


# ------------------------------------------------------------------------------- C<=k


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
@pytest.mark.parametrize("steps", [0, 1, 4])
def test_all_paths_of_some_steps_earn_the_value(kind, steps):
    """In an MDP they belong to a best strategy, which counts the steps that are left."""
    model = switched(kind, exact=True)
    letter = "Rmax" if kind == "mdp" else "R"
    value = model.check(f"{letter}=? [ C<={steps} ]").value
    found = model.check(f"{letter}>={value} [ C<={steps} ]").counterexample(paths=5000)
    assert (found.refutes, found.complete, found.reward) == (False, True, value)
    assert all(len(p.actions) == steps for p in found.paths)
    broken = model.check(f"{letter}<={value / 2} [ C<={steps} ]")
    if steps:
        assert broken.counterexample().reward > value / 2


@pytest.mark.parametrize("engine", ["explicit", "sparse", "mtbdd", "hybrid"])
def test_every_engine_finds_the_same(engine):
    for kind, query in (("dtmc", "C<=4"), ("mdp", "C<=4"), ("mdp", "F x>=5")):
        found = switched(kind, engine=engine).check(f"R<=1.6 [ {query} ]").counterexample()
        wanted = switched(kind, exact=True).check(f"R<=1.6 [ {query} ]").counterexample()
        assert found.complete
        assert len(found.commands.commands) == len(wanted.commands.commands)
        assert len(found.paths) == len(wanted.paths)


def test_a_deadlock_earns_without_a_command():
    model = symcheck.loads(
        "dtmc module m s:[0..1]; [] s=0 -> (s'=1); endmodule rewards s=1 : 1; endrewards",
        exact=True,
    )
    found = model.check("R<=3 [ C<=5 ]").counterexample()
    assert found.reward == 4
    assert found.commands.commands == ("[] s=0 -> (s'=1)",)
    start = symcheck.loads(
        "dtmc module m s:[0..1]; [] s=1 -> true; endmodule rewards true : 1; endrewards"
    )
    assert start.check("R<=3 [ C<=5 ]").counterexample().commands.commands == ()


# ------------------------------------------------------------------------------- texts, refusals


def test_texts_and_files(tmp_path, capsys):
    source = tmp_path / "fork.pm"
    source.write_text(FORK)
    words = [str(source), "-pf", "R<=2.9 [ F s=3 ]", "-counterexample"]
    assert main([*words, "-exportcounterexample", str(tmp_path / "c.json")]) == 0
    out = capsys.readouterr().out
    assert "2 of 3 commands earn enough before a run uses another one (a smallest set):\n" in out
    assert f"  {FIRST}\n  {SECOND}\n" in out
    assert json.loads((tmp_path / "c.json").read_text())["commands"] == [FIRST, SECOND]
    words[2] = "R<=1.5 [ C<=2 ]"
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "2 paths with probability 0.75, which earn 1.75 by probability times reward" in out
    assert "  0.5 (earns 2): (s=0) -> (s=2) -> (s=3)\n" in out


def test_one_command_earns_enough():
    commands = symcheck.loads(FORK).check("R<=1/2 [ F s=3 ]").counterexample().commands
    assert str(commands).startswith("1 of 3 commands earns enough before a run uses another one (")


@pytest.mark.parametrize("query", ["F s=2", "C<=9"])
def test_negative_rewards_have_no_lower_bound(query):
    """Another strategy, or another command of a chain, may lose what these have earned."""
    text = """mdp module m s:[0..2]; [a] s=0 -> (s'=2); [b] s=0 -> (s'=1); [] s=1 -> (s'=2); endmodule
      rewards [a] true : 5; [b] true : 1; s=1 : -1; endrewards"""
    model = symcheck.loads(text)
    if query == "C<=9":
        with pytest.raises(UnsupportedError, match="negative rewards"):
            model.check(f"R<=2 [ {query} ]").counterexample()
        return
    found = model.check(f"R<=2 [ {query} ]").counterexample()
    assert found.complete
    assert (found.commands, found.note) == (
        None,
        "no commands: they are not found for negative rewards",
    )


def test_commands_of_a_chain_that_lose_rewards():
    text = """dtmc module m s:[0..1]; [a] s=0 -> (s'=1); [b] s=0 -> (s'=1); endmodule
      rewards [a] true : 4; [b] true : -2; endrewards"""
    found = symcheck.loads(text).check("R<=0.5 [ F s=1 ]").counterexample()
    assert found.note == "no commands: they are not found for negative rewards"


def test_an_infinite_reward_needs_the_commands_that_miss_the_target():
    text = """mdp module m s:[0..3]; [go] s=0 -> (s'=1); [on] s=0 -> (s'=3);
      [] s=3 -> 0.5:(s'=1) + 0.5:(s'=2); [stay] s=2 -> true; [go] s=2 -> (s'=1); endmodule
      rewards s=3 : 1; endrewards"""
    found = symcheck.loads(text).check("R<=9 [ F s=1 ]").counterexample()
    assert "infinite" in found.note
    assert found.commands.commands == ("[] s=3 -> 0.5:(s'=1) + 0.5:(s'=2)", "[on] s=0 -> (s'=3)")
    assert not found.commands.of_reward


@pytest.mark.parametrize(
    ("kind", "formula", "message"),
    [
        ("dtmc", "R<=9 [ C<=3 ]", "no finite set of paths.*\n.*that is false"),
        ("dtmc", "R<=0.1 [ C<=99999999 ]", "too many"),
        ("dtmc", "R<=0.1 [ I=1 ]", r"R<=r \[ C<=k \]"),
        ("ctmc", "R<=0.1 [ C<=2 ]", "in discrete time"),
        ("mdp", "R<=9 [ C<=3 ]", "because of every strategy"),
    ],
)
def test_refusals(kind, formula, message):
    text = FORK.replace("dtmc", kind)
    with pytest.raises(UnsupportedError, match=message):
        symcheck.loads(text).check(formula).counterexample()


def test_a_ctmc_has_paths_and_no_commands():
    found = symcheck.loads(FORK.replace("dtmc", "ctmc")).check("R<=2 [ F s=3 ]").counterexample()
    assert found.complete
    assert "of a CTMC" in found.note


def test_models_without_commands():
    path = Path(__file__).parents[3] / "models/die/die.pm"
    assert (
        symcheck.load(path).check('R{"tosses"}<=1 [ C<=2 ]').counterexample().commands is not None
    )
    matrix = symcheck.from_matrix([[0, 1], [0, 1]])
    found = matrix.check("T<=0.5 [ F s=1 ]").counterexample()
    assert found.note == "no commands: the model has none"
