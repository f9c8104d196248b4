"""Strategies as files and as chains: what is written is read, and the chain has the value."""

from __future__ import annotations

from fractions import Fraction
from io import StringIO
from math import isclose, isinf
from pathlib import Path
from random import Random

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import symcheck
from exchange.models import some_model
from symcheck.errors import SymcheckError, SyntaxFault, UnsupportedError, UsageError
from symcheck.exchange.strategies.files import (
    strategy_target,
    strategy_texts,
    write_strategy,
    write_strategy_files,
)
from symcheck.syntax.ast import ModelType

ROBOT = """mdp
const double p = 1/2;
module m
  x : [0..3];
  b : bool;
  [safe] x=0 -> (x'=1);
  [fast] x=0 -> p : (x'=3) + 1-p : (x'=2);
  [safe] x=1 -> p : (x'=3) & (b'=true) + 1-p : (x'=0);
  [] x>1 -> true;
endmodule
formula home = x=3;
label "goal" = home;
rewards "steps" x<3 : 1; [fast] true : 3; endrewards
"""
GOAL = 'P{}=? [ F "goal" ]'
FORMULAS = [
    GOAL,
    'P{}=? [ "b" U "a" ]',
    'P{}=? [ G "b" ]',
    'P{}=? [ F<=3 "a" ]',
    'P{}=? [ G F "a" ]',
    'P{}=? [ (G F "a") & (F G !"b") ]',
    'R{}=? [ F "a" ]',
    'R{}=? [ F ("a" & (X "b")) ]',
    'R{}=? [ (F "a") & (F "b") ]',
    "R{}=? [ C<=4 ]",
    "R{}=? [ I=3 ]",
    "R{}=? [ C ]",
    "R{}=? [ S ]",
    "R{}=? [ C discount=0.9 ]",
    "R{}=? [ C<=3 discount=0.5 ]",
    'P{}=? [ F^{{rew{{"r"}}<=3}} "a" ]',
    'P{}=? [ "b" U^{{rew{{"r"}}[1,4]}} "a" ]',
    'P{}=? [ G^{{rew{{"r"}}<=2}} "b" ]',
    'P{}=? [ F^{{rew{{"r"}}<=3, steps<=3}} "a" ]',
    'T{}=? [ F "a" ]',
    'S{}=? [ "a" ]',
]
NUMBERS = [{}, {"exact": True}]


def same(found, wanted, *, exact):
    if isinf(wanted):
        return isinf(found)
    return found == wanted if exact else isclose(found, wanted, rel_tol=1e-6, abs_tol=1e-9)


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    direction=st.sampled_from(["min", "max"]),
    formula=st.sampled_from(FORMULAS[1:]),
    options=st.sampled_from(NUMBERS),
)
def test_the_chain_has_the_optimal_value(seed, direction, formula, options):
    text = some_model(Random(seed), "mdp").text
    model = symcheck.loads(text, strategy=True, **options)
    try:
        best = model.check(formula.format(direction))
    except SymcheckError:  # such as negative rewards, or those without a common step
        assume(False)
    assume(not best.warnings)
    for reach in (True, False):
        chain = symcheck.induced_chain(model, best, reach=reach)
        assert chain.bound.type is ModelType.DTMC
        found = chain.check(formula.format("")).value
        assert same(found, best.value, exact=bool(options))


@pytest.mark.parametrize("kind", ["actions", "indices", "actions,states=false"])
@pytest.mark.parametrize("options", NUMBERS)
def test_what_is_written_is_read(kind, options, tmp_path):
    model = symcheck.loads(ROBOT, strategy=True, **options)
    best = model.check(GOAL.format("max"))
    path = tmp_path / "s.txt"
    path.write_text("".join(strategy_texts(best.strategy, strategy_target(f"s:type={kind}"))))
    read = symcheck.load_strategy(model, path)
    assert read.rows.tolist() == best.strategy.rows.tolist()
    chain = symcheck.induced_chain(model, read)
    assert chain.check(GOAL.format("")).value == 1
    # Constants, formulas, labels and rewards are those of the model.
    assert chain.check("P=? [ F home & b ]").value == 1
    assert chain.check('R{"steps"}=? [ F "goal" ]').value == pytest.approx(4, rel=1e-6)
    assert chain.check("p").value == 0.5


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**9),
    direction=st.sampled_from(["min", "max"]),
    formula=st.sampled_from(FORMULAS[1:]),
    kind=st.sampled_from(["actions", "indices", "actions,states=false"]),
    options=st.sampled_from(NUMBERS),
)
def test_a_strategy_that_is_read_again_has_the_value(
    seed, direction, formula, kind, options, tmp_path_factory
):
    model = symcheck.loads(some_model(Random(seed), "mdp").text, strategy=True, **options)
    try:
        best = model.check(formula.format(direction))
    except SymcheckError:
        assume(False)
    assume(not best.warnings)
    path = tmp_path_factory.getbasetemp() / "read.txt"
    path.write_text("".join(strategy_texts(best.strategy, strategy_target(f"s:type={kind}"))))
    try:
        read = symcheck.load_strategy(model, path)
    except SyntaxFault:  # choices with the same action
        assert kind != "indices"
        assume(False)
    chain = symcheck.induced_chain(model, read)
    found = chain.check(formula.format("")).value
    assert same(found, best.value, exact=bool(options))


MIXED = "(0,false)=0.25:safe+0.75:fast\n(1,false)=safe\n"


@pytest.mark.parametrize("options", NUMBERS)
def test_random_choices_are_read_and_written(options, tmp_path):
    model = symcheck.loads(ROBOT, **options)
    (tmp_path / "s.txt").write_text(MIXED)
    read = symcheck.load_strategy(model, tmp_path / "s.txt")
    chain = symcheck.induced_chain(model, read)
    # x = 1/4 (1/2 + 1/2 x) + 3/4 1/2
    assert chain.check(GOAL.format("")).value == pytest.approx(4 / 7)
    # r = 1 + 3/4 3 + 1/4 (1 + 1/2 r): a transition reward is that of the choice that is taken
    assert chain.check('R{"steps"}=? [ F x>1 ]').value == pytest.approx(4)
    again = "".join(strategy_texts(read, strategy_target("s")))
    assert again == (MIXED if not options else MIXED.replace("0.25", "1/4").replace("0.75", "3/4"))
    assert symcheck.load_strategy(model, tmp_path / "s.txt").actions == read.actions
    indices = "".join(strategy_texts(read, strategy_target("s:type=indices")))
    (tmp_path / "i.txt").write_text(indices)
    assert symcheck.load_strategy(model, tmp_path / "i.txt").actions == read.actions
    simulator = model.simulator(seed=1)
    simulator.run(1, read)
    assert {simulator.restart() and simulator.run(1, read)["x"] for _ in range(30)} == {1, 2, 3}
    dot = "".join(strategy_texts(read, strategy_target("s.dot")))
    assert "fast" in dot


def test_lines():
    model = symcheck.loads(ROBOT, strategy=True)
    out = StringIO()
    write_strategy(model.check(GOAL.format("max")).strategy, out)
    assert out.getvalue() == "(0,false)=safe\n(1,false)=safe\n"
    bounded = model.check('Pmax=? [ F<=1 "goal" ]').strategy
    out = StringIO()
    write_strategy(bounded, out)
    assert out.getvalue().startswith("(0,false),0=fast\n")


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_every_engine_checks_the_chain(engine):
    model = symcheck.loads(ROBOT, strategy=True, engine=engine)
    chain = symcheck.induced_chain(model, model.check(GOAL.format("min")))
    assert chain.engine.name == engine
    assert chain.check(GOAL.format("")).value == pytest.approx(0.5)
    chain = symcheck.induced_chain(model, model.check('Pmax=? [ (F x=1) & (F "goal") ]'))
    assert chain.check('P=? [ (F x=1) & (F "goal") ]').value == 1
    assert "memory" in [v.name for v in chain.variables]


def test_the_chain_is_simulated():
    model = symcheck.loads(ROBOT, strategy=True)
    chain = symcheck.induced_chain(model, model.check('Pmax=? [ F<=3 "goal" ]'))
    assert {step.action for step in chain.simulate(8, seed=1).steps} <= {None, "safe", "fast"}
    simulator = chain.simulator(seed=1)
    assert len(simulator.choices) == 1
    assert set(simulator.state) == {"x", "b", "memory"}


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ("(0,false)=walk\n", SyntaxFault, r"(?s)s.txt:1:1.*no choice with action 'walk'.*'safe'"),
        ("(9,false)=safe\n", SyntaxFault, r"\(9,false\) is not a reachable state .*\(x,b\)"),
        ("0=5\n", SyntaxFault, "the state has no choice 5: it has 2, numbered from 0"),
        ("77=0\n", SyntaxFault, "state 77 does not exist"),
        ("0=0\n0=1\n", SyntaxFault, "(?s)s.txt:2:1.*in the file already"),
        ("0 go\n", SyntaxFault, r"(?s)a line should hold a state.*such as \(0,true\)=go"),
        ("(0,false)=0.5:safe+0.4:fast\n", SyntaxFault, r"(?s)s.txt:1:1.*sum to 0.9, not 1"),
        ("(0,false)=1e400:safe+0.4:fast\n", SyntaxFault, "sum to more than 1000, not 1"),
        ("(0,false)=1/0:safe\n", SyntaxFault, "no choice with action '1/0:safe'"),
        ("(0,false)==0=0\n", SyntaxFault, "no choice with action '=0=0'"),
        ("(0,false)=0.5:safe+0.5:walk\n", SyntaxFault, "no choice with action 'walk'"),
        ("(0,false),0=safe\n(1,false)=safe\n", SyntaxFault, "others have none"),
        ("(0,false),0=safe\n# memory: 0\n# (1,false),0 -> 1\n", SyntaxFault, "no choice of this"),
        (
            "(0,false),1=safe\n",
            UnsupportedError,
            "(?s)does not say how the memory changes.*# memory: 0",
        ),
    ],
)
def test_faults(text, error, message, tmp_path):
    (tmp_path / "s.txt").write_text(text)
    with pytest.raises(error, match=message):
        symcheck.load_strategy(symcheck.loads(ROBOT), tmp_path / "s.txt")


def test_what_has_no_strategy(tmp_path):
    (tmp_path / "s.txt").write_text("0=0\n")
    with pytest.raises(UnsupportedError, match="only for MDPs"):
        symcheck.load_strategy(symcheck.loads("dtmc module m endmodule"), tmp_path / "s.txt")
    model = symcheck.loads(ROBOT)
    with pytest.raises(UsageError, match="strategy=True"):
        symcheck.induced_chain(model, model.check(GOAL.format("max")))


@pytest.mark.parametrize("engine", ["sparse", "mtbdd"])
def test_a_file_for_a_model_without_room_for_its_rows_is_refused_at_once(
    engine, tmp_path, monkeypatch
):
    (tmp_path / "s.txt").write_text("(0,false)=safe\n")
    model = symcheck.loads(ROBOT, engine=engine)
    assert model.engine.states > 1
    monkeypatch.setenv("SYMCHECK_MEMORY", "0")
    with pytest.raises(UnsupportedError, match=r"a strategy from a file.*the rows of all"):
        symcheck.load_strategy(model, tmp_path / "s.txt")


def test_equal_actions_need_indices(tmp_path):
    text = "mdp module m x:[0..1]; [a] x=0 -> true; [a] x=0 -> (x'=1); [a] x=1 -> true; endmodule"
    model = symcheck.loads(text)
    (tmp_path / "s.txt").write_text("(0)=a\n")
    with pytest.raises(SyntaxFault, match=r"(?s)2 choices with action 'a'.*type indices"):
        symcheck.load_strategy(model, tmp_path / "s.txt")
    (tmp_path / "s.txt").write_text("0=1\n")
    chain = symcheck.induced_chain(model, symcheck.load_strategy(model, tmp_path / "s.txt"))
    assert chain.check("P=? [ F x=1 ]").value == 1


@pytest.mark.parametrize("options", NUMBERS)
def test_the_chain_of_a_strategy_with_memory_is_written_and_read(options, tmp_path):
    best = symcheck.loads(ROBOT, strategy=True, **options).check('Pmax=? [ F<=3 "goal" ]')
    target = strategy_target(f"{tmp_path}/best.tra,sta,lab,srew,trew")
    assert target.kind == "induced"
    names = write_strategy_files(best.strategy, target, StringIO())
    assert [Path(name).suffix for name in names] == [".tra", ".sta", ".lab", ".srew", ".trew"]
    read = symcheck.load_explicit(str(tmp_path / "best.all"), **options)
    assert read.check('P=? [ F<=3 "goal" ]').value == best.value


def test_constants_stay_known():
    text = ROBOT.replace("const double p = 1/2;", "const double p;")
    model = symcheck.loads(text, constants={"p": 0.25}, strategy=True)
    chain = symcheck.induced_chain(model, model.check(GOAL.format("min")))
    assert chain.given_constants == {"p": 0.25}
    assert chain.check("p").value == 0.25


def test_chains_that_are_not_available(tmp_path):
    (tmp_path / "s.txt").write_text("(0)=a\n")
    text = "[a] s=0 -> p:(s'=1) + 1-p:(s'=0); [b] s=0 -> (s'=1); [] s=1 -> true; endmodule"
    text = "{} const double p; module m s:[0..1]; " + text
    automaton = symcheck.loads(text.format("ma"), {"p": 0.5})
    functions = symcheck.loads(text.format("mdp")).parametric("p")
    for model, kind in ((automaton, "Markov automata"), (functions, "with parameters")):
        strategy = symcheck.load_strategy(model, tmp_path / "s.txt")
        with pytest.raises(UnsupportedError, match=f"not available for .*{kind}"):
            symcheck.induced_chain(model, strategy)


UNCERTAIN = """mdp
module m
  s : [0..4];
  [a] s=0 -> [0.1,0.3]:(s'=1) + [0.7,0.9]:(s'=2);
  [b] s=0 -> [0.2,0.8]:(s'=0) + [0.2,0.8]:(s'=4) + [1/10,1/4]:(s'=3);
  [] s=1 -> [0.5,0.5]:(s'=0) + [0.2,0.6]:(s'=3) + [0.1,0.3]:(s'=4);
  [] s=2 -> 0.5:(s'=3) + 0.5:(s'=4);
  [] s>2 -> true;
endmodule
label "a" = s=3;
rewards "paid" s=0: 2; [a] true: 3; endrewards
"""


@pytest.mark.parametrize("options", NUMBERS)
@pytest.mark.parametrize("asked", ['P{}{}=? [ F "a" ]', "R{}{}=? [ F s>2 ]"])
def test_a_strategy_that_is_read_leaves_intervals_to_nature(asked, options, tmp_path):
    model = symcheck.loads(UNCERTAIN, strategy=True, **options)
    for direction in ("min", "max"):
        best = model.check(asked.format(direction, "min"))
        target = strategy_target(str(tmp_path / "s.txt"))
        write_strategy_files(best.strategy, target, StringIO())
        read = symcheck.load_strategy(model, tmp_path / "s.txt")
        for reach in (True, False):
            chain = symcheck.induced_chain(model, read, reach=reach)
            worst = chain.check(asked.format("", "min")).value
            assert same(worst, best.value, exact=bool(options))
            assert chain.check(asked.format("", "max")).value >= worst
    with pytest.raises(SymcheckError, match="no unique value in a model with intervals"):
        chain.check(asked.format("", ""))


def test_intervals_and_memory(tmp_path):
    text = "mdp module m x:[0..1]; [go] true -> [1/4,1/2]:(x'=1) + [1/2,3/4]:(x'=0); "
    model = symcheck.loads(text + "[stay] true -> true; endmodule", exact=True)
    lines = "(0),0=go\n(1),0=stay\n(0),1=stay\n# memory: 0\n# (0),0 -> 1\n"
    (tmp_path / "once.txt").write_text(lines)
    chain = symcheck.induced_chain(model, symcheck.load_strategy(model, tmp_path / "once.txt"))
    assert [chain.check(f"P{d}=? [ F x=1 ]").value for d in ("min", "max")] == [
        Fraction(1, 4),
        Fraction(1, 2),
    ]
    (tmp_path / "mixed.txt").write_text("(0)=1/2:go+1/2:stay\n(1)=stay\n")
    mixed = symcheck.load_strategy(model, tmp_path / "mixed.txt")
    with pytest.raises(UnsupportedError, match=r"at random is not available.*intervals"):
        symcheck.induced_chain(model, mixed)


def test_in_a_chain_with_intervals_nature_alone_chooses(tmp_path):
    (tmp_path / "s.txt").write_text("0=0\n")
    text = "dtmc module m x:[0..1]; [] true -> [0.1,0.9]:(x'=1) + [0.1,0.9]:true; endmodule"
    chain = symcheck.loads(text)
    with pytest.raises(UnsupportedError, match=r"(?s)nature alone chooses.*FILE\.tra writes"):
        symcheck.load_strategy(chain, tmp_path / "s.txt")


TIMED = """pta
module m
  s : [0..3];
  x : clock;
  invariant (s=0 => x<=20) & (s=1 => x<=30) endinvariant
  [a] s=0 & x>=10 -> 0.9:(s'=1)&(x'=0) + 0.1:(s'=2)&(x'=0);
  [b] s=1 & x>=20 -> 0.5:(s'=0)&(x'=0) + 0.5:(s'=3);
endmodule
label "d" = s=3;
label "late" = x>=200;
"""


@pytest.mark.parametrize("asked", ['Pmax=? [ F "d" ]', 'Pmax=? [ F<=30 "d" ]', "Tmin=? [ F s>1 ]"])
def test_steps_of_the_chain_of_a_timed_automaton_are_no_time(asked):
    model = symcheck.loads(TIMED, exact=True, strategy=True)
    best = model.check(asked)
    chain = symcheck.induced_chain(model, best)
    assert chain.check('P=? [ F^{rew{"time"}<=30} "d" ]').value == Fraction(9, 20)
    assert chain.check('R{"time"}=? [ F s>1 ]').value == Fraction(560, 11)
    assert chain.check('P=? [ F "d" ]').value == Fraction(9, 11)
    assert "late" not in chain.labels  # clocks were counted up to the bounds of the property
    smaller = symcheck.quotient(chain.with_options(exact=False), labels=["d"])
    for refused in (
        *('P=? [ F<=30 "d" ]', 'P=? [ F^{steps<=3} "d" ]', "P=? [ X s=1 ]", 'S=? [ "d" ]'),
        *('T=? [ F "d" ]', "R=? [ C<=3 ]", "R=? [ I=3 ]", "R=? [ S ]", 'E [ F<=3 "d" ]'),
        *("P=? [ F x>=20 ]", 'label "in" = x>=20; P=? [ F "in" ]', "R=? [ C discount=0.5 ]"),
    ):
        for asked_of in (chain, smaller)[: 1 + ('"d"' in refused)]:
            with pytest.raises(UnsupportedError, match="strategy of a timed automaton"):
                asked_of.check(refused)
    for distribution in (lambda: chain.transient(3), chain.steady_state):
        with pytest.raises(UnsupportedError, match=r"distributions .* of timed automata"):
            distribution()


def test_labels_that_compare_clocks_in_the_chain_of_a_timed_automaton(tmp_path):
    model = symcheck.loads(TIMED.replace("x>=200", "x>=20"), exact=True)
    lines = "(0,0)=time\n(0,1)=a\n(1,0)=time\n(1,1)=time\n(1,2)=b\n"
    (tmp_path / "s.txt").write_text(lines)
    chain = symcheck.induced_chain(model, symcheck.load_strategy(model, tmp_path / "s.txt"))
    within = 'P=? [ F^{{rew{{"time"}}<={}}} "late" ]'
    assert [chain.check(within.format(time)).value for time in (29, 30)] == [0, 1]
