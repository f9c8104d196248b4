"""Files that are read: forms that are allowed, and faults with their places."""

from __future__ import annotations

import pytest

import symcheck
from symcheck.errors import (
    InputError,
    MemoryLimitError,
    ModelFault,
    UnsupportedError,
    UsageError,
)
from symcheck.syntax.ast import ModelType

DTMC = "3 4\n0 1 0.5\n0 2 0.5\n1 1 1\n2 2 1\n"
MDP = "2 3 4\n0 0 0 0.5 a\n0 0 1 0.5 a\n0 1 1 1 b\n1 0 1 1\n"


def load(tmp_path, *, kind=None, **files):
    for ending, text in files.items():
        (tmp_path / f"m.{ending}").write_text(text)
    options = {"fix_deadlocks": files.get("fix", True)}
    return symcheck.load_explicit(str(tmp_path / "m.all"), type=kind, **options)


def test_comments_blanks_and_order_do_not_matter(tmp_path):
    model = load(
        tmp_path, tra="# Transitions (DTMC)\n\n3 4\n2 2 1\n  0 2   .5\n1 1 1\n\n0 1 5e-1\n"
    )
    assert model.check("P=? [ F x=1 ]").value == 0.5


def test_the_type_is_seen(tmp_path):
    assert load(tmp_path, tra=DTMC).bound.type is ModelType.DTMC
    assert load(tmp_path, tra=MDP).bound.type is ModelType.MDP
    assert load(tmp_path, tra="2 2\n0 1 3\n1 0 2\n").bound.type is ModelType.CTMC
    assert (
        load(tmp_path, tra="# Transitions (CTMC)\n2 2\n0 1 1\n1 0 1\n").bound.type is ModelType.CTMC
    )
    assert (
        load(tmp_path, tra="2 2\n0 1 1\n1 0 1\n", kind=ModelType.CTMC).bound.type is ModelType.CTMC
    )


def test_deadlocks_are_fixed(tmp_path):
    model = load(tmp_path, tra="3 2\n0 1 0.5\n0 2 0.5\n", kind=ModelType.DTMC)
    assert model.check('filter(count, "deadlock")').value == 2
    assert model.check('P=? [ F x=2&"deadlock" ]').value == 0.5
    again = load(tmp_path, tra="3 2 3\n0 0 1 0.5\n0 0 2 0.5\n2 0 2 1 a\n", trew="3 2 1\n2 0 2 7\n")
    assert again.check('filter(count, "deadlock")').value == 1
    assert again.check("Rmax=? [ C<=2 ]").value == 3.5


def test_a_deadlock_may_be_an_error(tmp_path):
    (tmp_path / "m.tra").write_text("3 2\n0 1 0.5\n0 2 0.5\n")
    with pytest.raises(ModelFault, match="2 deadlock states"):
        symcheck.load_explicit(
            str(tmp_path / "m.tra"), type=ModelType.DTMC, fix_deadlocks=False
        ).check("true")


def test_actions_labels_and_rewards(tmp_path):
    model = load(
        tmp_path,
        tra=MDP,
        sta="(go,n)\n1:(true,-4)\n0:(false,7)\n",
        lab='0="init" 1="deadlock" 2="goal"\n0: 0\n1: 2\n',
        srew='# Reward structure: "cost"\n# State rewards\n2 1\n0 2\n',
        trew="2 3 1\n0 0 1 4\n",
    )
    assert model.engine.model.actions == ("a", "b")
    assert model.check('R{"cost"}min=? [ F "goal" ]').value == 2
    assert model.check('R{"cost"}max=? [ F n<0 & go ]').value == pytest.approx(8, rel=1e-6)
    assert model.check('Pmin=? [ X "goal" ]').value == 0.5


def test_a_chain_may_have_actions_and_comments_anywhere(tmp_path):
    text = "# a comment\n3 5\n# before\n0 1 0.25 go # behind\n0 1 0.25 jump\n0 2 0.5 go\n\n1 1 1\n2 2 1\n# after\n"
    model = load(tmp_path, tra=text)
    assert model.bound.type is ModelType.DTMC
    assert model.engine.transitions == 4  # what two actions do between the same states adds up
    assert model.check("P=? [ X x=1 ]").value == 0.5


def test_comments_in_every_file(tmp_path):
    files = {
        "tra": DTMC,
        "sta": "# s\n(s)\n# t\n0:(5) # first\n1:(6)\n2:(7)\n",
        "srew": '# Reward structure "r"\n3 1\n# here\n0 2\n',
    }
    model = load(tmp_path, **files, lab='# l\n0="init" 1="a"\n# m\n0: 0\n1: 1\n')
    assert model.check('P=? [ F "a" ]').value == model.check("P=? [ F s=6 ]").value
    assert model.check('R{"r"}=? [ C<=1 ]').value == 2


def test_several_reward_structures(tmp_path):
    model = load(tmp_path, tra=DTMC, srew="3 0\n")
    (tmp_path / "m.srew").unlink()
    (tmp_path / "m1.srew").write_text('# Reward structure "one"\n3 1\n0 1\n')
    (tmp_path / "m2.trew").write_text('# Reward structure "two"\n3 1\n0 1 5\n')
    model = symcheck.load_explicit(str(tmp_path / "m.all"))
    assert model.check('R{"one"}=? [ C<=3 ]').value == 1
    assert model.check('R{"two"}=? [ C<=3 ]').value == 2.5
    assert model.check("R{2}=? [ C<=3 ]").value == 2.5


def test_several_initial_states(tmp_path):
    model = load(tmp_path, tra=DTMC, lab='0="init"\n0: 0\n1: 0\n')
    assert model.check("P=? [ F x=1 ]").value == (0.5, 1)


def test_more_states_than_there_is_memory_for(tmp_path, monkeypatch):
    monkeypatch.setenv("SYMCHECK_MEMORY", "1m")
    assert load(tmp_path, tra="3 0\n").check("filter(count, true)").value == 3
    with pytest.raises(MemoryLimitError, match=r"m\.tra: 100,000 states take more than the free"):
        load(tmp_path, tra="100000 0\n")


UNCERTAIN = "2 3\n0 1 [0.2,0.6]\n0 0 [1/3,2/3]\n1 1 1\n"


def test_intervals(tmp_path):
    chain = load(tmp_path, tra=UNCERTAIN)
    assert chain.bound.type is ModelType.DTMC
    assert [chain.check(f"P{d}=? [ X x=1 ]").value for d in ("min", "max")] == pytest.approx(
        [1 / 3, 0.6]
    )
    text = "2 3 4\n0 0 1 [0.2,0.6]\n0 0 0 [1/3,2/3]\n0 1 0 1\n1 0 1 1\n"  # no action
    decisions = load(tmp_path, tra=text)
    assert decisions.bound.type is ModelType.MDP
    assert decisions.check("Pmaxmax=? [ X x=1 ]").value == 0.6


FAULTS = [
    ({"tra": ""}, "m.tra:1:1", "empty"),
    ({"tra": "3\n"}, "m.tra:1:1", "first line"),
    ({"tra": "3 4x\n"}, "m.tra:1:3", "4x"),
    ({"tra": "0 0\n"}, "m.tra:1:1", "at least one state"),
    ({"tra": "2147483648 0\n"}, "m.tra:1:1", "at most 2**31 - 1 states"),
    (
        {"tra": "3 5\n0 1 0.5\n0 2 0.5\n1 1 1\n2 2 1\n"},
        "m.tra:1:3",
        "announces 5 transitions, but 4 follow",
    ),
    ({"tra": "3 4\n0 1 0.5\n0 2 zero\n1 1 1\n2 2 1\n"}, "m.tra:3:5", "'zero' is not a number"),
    ({"tra": "3 4\n0 1 0.5\n0 2 nan\n1 1 1\n2 2 1\n"}, "m.tra:3:5", "not negative"),
    ({"tra": "3 4\n0 1 0.5\n0 2 1/0\n1 1 1\n2 2 1\n"}, "m.tra:3:5", "'1/0' is not a number"),
    ({"tra": "3 4\n0 1 0.5\n0 2 -0.5\n1 1 1\n2 2 1\n"}, "m.tra:3:5", "not negative"),
    ({"tra": "3 4\n0 1 0.5\n0 3 0.5\n1 1 1\n2 2 1\n"}, "m.tra:3:3", "state 3 does not exist"),
    ({"tra": "3 4\n0 1 0.5\n0 a 0.5\n1 1 1\n2 2 1\n"}, "m.tra:3:3", "'a' is not an integer"),
    (
        {"tra": f"3 4\n0 1 1/2\n0 {2**63} 0.5\n1 1 1\n2 2 1\n"},
        "m.tra:3:3",
        f"'{2**63}' has more than 64 bits",
    ),
    ({"tra": "3 4\n0 1 0.5\n0 1 0.5\n1 1 1\n2 2 1\n"}, "m.tra:3:1", "already"),
    ({"tra": "3 4\n0 1 0.5\n0 2\n1 1 1\n2 2 1\n"}, "m.tra:3:1", "source, target"),
    (
        {"tra": "# Transitions (DTMC)\n3 4\n0 1 0.5\n0 2 0.4\n1 1 1\n2 2 1\n"},
        "m.tra:3:1",
        "sum to 0.9, not to 1",
    ),
    ({"tra": MDP.replace("0 0 1 0.5 a", "0 0 1 0.6 a")}, "m.tra:2:1", "sum to 1.1, not to 1"),
    ({"tra": MDP.replace("0 0 1 0.5 a", "0 0 1 0.5 c")}, "m.tra:3:1", "different actions"),
    ({"tra": MDP.replace("0 1 1 1 b", "0 2 1 1 b")}, "m.tra:4:3", "choice 1 of state 0 is missing"),
    ({"tra": MDP.replace("2 3 4", "2 4 4")}, "m.tra:1:3", "announces 4 choices, but 3 follow"),
    ({"tra": UNCERTAIN.replace("[0.2", "[0")}, "m.tra:2:5", "lower end 0 is not supported"),
    ({"tra": UNCERTAIN.replace("[0.2", "[0.7")}, "m.tra:2:5", "lower end is above its upper end"),
    ({"tra": UNCERTAIN.replace("[0.2", "[nan")}, "m.tra:2:5", "must be finite"),
    ({"tra": UNCERTAIN.replace("[0.2", "[low")}, "m.tra:2:5", "'low' is not a number"),
    ({"tra": UNCERTAIN.replace("0.6]", "0.6")}, "m.tra:2:5", "'[0.2,0.6' is not a number"),
    ({"tra": UNCERTAIN.replace("0.6]", "1.6]")}, "m.tra:2:5", "the upper end of this interval is"),
    ({"tra": UNCERTAIN.replace("0.6]", "0.3]")}, "m.tra:3:1", "upper ends of these intervals sum"),
    (
        {"tra": "# Transitions (CTMC)\n" + UNCERTAIN},
        "m.tra:2:1",
        "intervals of rates are not supported",
    ),
    ({"tra": DTMC, "sta": "x\n0:(1)\n1:(2)\n2:(3)\n"}, "m.sta:1:1", "names of the variables"),
    ({"tra": DTMC, "sta": "(x)\n0:(1)\n1:(2)\n"}, "m.sta:3:1", "has 3 states, but this file has 2"),
    ({"tra": DTMC, "sta": "(x)\n0:(1)\n1:(2,3)\n2:(3)\n"}, "m.sta:3:1", "number:(x)"),
    ({"tra": DTMC, "sta": "(x)\n0:(1)\n1:(yes)\n2:(3)\n"}, "m.sta:3:1", "'yes' is not a value"),
    ({"tra": DTMC, "sta": "(x)\n0:(1)\n0:(2)\n2:(3)\n"}, "m.sta:3:1", "already"),
    ({"tra": DTMC, "sta": "(x,x)\n0:(1,1)\n1:(2,2)\n2:(3,3)\n"}, "m.sta:1:1", "same name"),
    ({"tra": DTMC, "lab": "init\n0: 0\n"}, "m.lab:1:1", "labels"),
    ({"tra": DTMC, "lab": '0="init"\n0: 0\n7: 0\n'}, "m.lab:3:1", "state 7 does not exist"),
    ({"tra": DTMC, "lab": '0="init"\n0: 0\n1: 4\n'}, "m.lab:3:1", "label 4"),
    ({"tra": DTMC, "lab": '0="init"\n0 0\n'}, "m.lab:2:1", "colon"),
    ({"tra": DTMC, "lab": '0="init" 1="a"\n0: 1\n'}, "m.lab:1:1", 'no state has the label "init"'),
    ({"tra": DTMC, "srew": "4 1\n0 1\n"}, "m.srew:1:1", "has 3 states, but this file announces 4"),
    ({"tra": DTMC, "srew": "3 2\n0 1\n"}, "m.srew:1:3", "announces 2 rewards, but 1 follow"),
    ({"tra": DTMC, "trew": "3 1\n1 0 1\n"}, "m.trew:2:1", "no such transition"),
    ({"tra": DTMC, "srew": "3 1\n0 nan\n"}, "m.srew:2:3", "a reward must be finite"),
    ({"tra": DTMC, "trew": "3 1\n0 1 inf\n"}, "m.trew:2:5", "a reward must be finite"),
    ({"tra": MDP, "trew": "2 3 1\n1 3 1 1\n"}, "m.trew:2:3", "state 1 has no choice 3"),
]


@pytest.mark.parametrize(("files", "place", "message"), FAULTS, ids=[m for _, _, m in FAULTS])
def test_faults_are_pointed_at(files, place, message, tmp_path):
    with pytest.raises(InputError) as caught:
        load(tmp_path, **files)
    text = str(caught.value)
    assert place in text
    assert message in text


def test_the_type_asked_for_must_fit(tmp_path):
    with pytest.raises(InputError, match="an MDP has states, choices and transitions"):
        load(tmp_path, tra=DTMC, kind=ModelType.MDP)
    with pytest.raises(InputError, match="a CTMC has states and transitions"):
        load(tmp_path, tra=MDP, kind=ModelType.CTMC)
    for kind in (ModelType.MA, ModelType.POMDP, ModelType.PTA, ModelType.SMG):
        with pytest.raises(UnsupportedError, match=f"cannot hold {kind.called}"):
            load(tmp_path, tra=MDP, kind=kind)


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(UsageError, match="cannot read"):
        symcheck.load_explicit(str(tmp_path / "none.all"))
    with pytest.raises(UsageError, match=r"does not end in \.all"):
        symcheck.load_explicit(str(tmp_path / "none.xyz"))
