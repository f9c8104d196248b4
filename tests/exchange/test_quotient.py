"""The quotient as a model: the coarsest partition, with the values of the original."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import symcheck
from exchange.models import some_model
from generate import random_property
from symcheck import view
from symcheck.errors import InputError, SymcheckError, UnsupportedError, UsageError

ROOT = Path(__file__).parents[2]
DIE = symcheck.load(ROOT / "models" / "die" / "die.pm")
SLOW = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
KINDS = st.sampled_from(["dtmc", "ctmc", "mdp"])
SEEDS = st.integers(0, 2**20)
OF_LABELS = [
    'P{}=? [ F "a" ]',
    'P{}=? [ "b" U "a" ]',
    'P{}=? [ G !"b" ]',
    'P{}=? [ X "a" ]',
    'P{}=? [ G F "a" ]',
    'P{}=? [ F<=3 "a" ]',
    'R{{"r"}}{}=? [ F "a" ]',
    'R{{"r"}}{}=? [ C<=4 ]',
    'R{{"r"}}{}=? [ I=2 ]',
    'R{{"r"}}{}=? [ S ]',
    'S{}=? [ "b" ]',
]


def same_values(model, smaller, text):
    """In each state, the value of its block."""
    try:
        want = model.check(text).values.array
    except UnsupportedError:
        return
    found = smaller.check(text).values.array
    assert found[smaller.block].tolist() == pytest.approx(want.tolist(), rel=1e-5, abs=1e-9), text


@SLOW
@given(seed=SEEDS, kind=KINDS, text=st.sampled_from(OF_LABELS))
def test_all_labels_and_rewards_have_their_values(seed, kind, text):
    model = symcheck.loads(some_model(Random(seed), kind).text, everywhere=True)
    direction = ("min", "max")[seed % 2] if kind == "mdp" else ""
    same_values(model, symcheck.quotient(model), text.format(direction))


@SLOW
@given(seed=SEEDS, kind=KINDS, engine=st.sampled_from(["explicit", "sparse", "mtbdd"]))
def test_a_property_has_its_values_on_its_quotient(seed, kind, engine):
    generated = some_model(Random(seed), kind)
    model = symcheck.loads(generated.text, everywhere=True, engine=engine)
    text = random_property(Random(seed + 1), generated)
    same_values(model, symcheck.quotient(model, text), text)


@SLOW
@given(seed=SEEDS)
def test_several_objectives_have_their_values(seed):
    model = symcheck.loads(some_model(Random(seed), "mdp").text)
    text = 'multi(Pmax=? [ F "a" ], P>=0.25 [ G !"b" ])'
    try:
        want = model.check(text).value
    except UnsupportedError:
        return
    found = symcheck.quotient(model).check(text).value
    assert found == pytest.approx(want, rel=1e-5, abs=1e-6, nan_ok=True)


def partition(model, labels, rewards):
    """The coarsest bisimulation, by refinement with fractions: the oracle."""
    m, table = model.transitions.matrix, model.transitions
    members = [model.labels[name].mask for name in labels]
    of_states = [model.rewards[name].states for name in rewards]
    of_rows = [model.rewards[name].choices for name in rewards]
    owner = m.state_of_row.tolist()
    assert len(table) == m.entries
    block = [tuple(float(c[s]) for c in (*members, *of_states)) for s in range(m.states)]
    while True:
        rows = [set() for _ in block]
        for row, state in enumerate(owner):
            sums = {}
            for i in range(m.indptr[row], m.indptr[row + 1]):
                to = block[m.indices[i]]
                weight = Fraction(float(m.data[i])).limit_denominator(10**6)
                sums[to] = sums.get(to, 0) + weight
            paid = tuple(round(float(c[row]), 9) for c in of_rows)
            rows[state].add((paid, frozenset(sums.items())))
        finer = list(zip(block, map(frozenset, rows), strict=True))
        number = {signature: i for i, signature in enumerate(dict.fromkeys(finer))}
        if len(number) == len(set(block)):
            return block
        block = [number[signature] for signature in finer]


@SLOW
@given(seed=SEEDS, kind=KINDS, with_rewards=st.booleans())
def test_the_partition_is_the_coarsest(seed, kind, with_rewards):
    model = symcheck.loads(some_model(Random(seed), kind).text, engine="explicit")
    rewards = ["r"] if with_rewards else []
    smaller = symcheck.quotient(model, labels=["a", "b"], rewards=rewards)
    want = partition(model, ["a", "b"], rewards)
    pairs = set(zip(want, smaller.block.tolist(), strict=True))
    assert len(pairs) == len(set(want)) == len(smaller.states)
    again = symcheck.quotient(smaller, labels=["a", "b"], rewards=rewards)
    assert len(again.states) == len(smaller.states)


PART = """module m{0}
  x{0} : [0..2];
  [] x{0}=0 -> 2:(x{0}'=1);
  [] x{0}=1 -> 1:(x{0}'=2) + 3:(x{0}'=0);
endmodule
"""


def test_blocks_of_independent_equal_parts_are_multisets():
    text = "ctmc\n" + "".join(map(PART.format, range(4)))
    model = symcheck.loads(text + 'label "all" = x0+x1+x2+x3=8;')
    smaller = symcheck.quotient(model)
    assert (len(model.states), len(smaller.states)) == (81, 15)  # 4 of 3 values: 6 over 4
    assert smaller.type.value == "ctmc"
    assert [v.name for v in smaller.variables] == ["block"]
    # From "all in 0", one of four becomes 1 with rate 2 each.
    assert smaller.matrix[[0]].data.tolist() == [8.0]
    assert float(smaller.check('P=? [ F<=2 "all" ]')) == pytest.approx(
        float(model.check('P=? [ F<=2 "all" ]')), rel=1e-6
    )


def test_rings_of_herman_are_lumped_to_the_gaps_between_their_tokens():
    model = symcheck.load(ROOT / "models" / "herman" / "herman7.pm")
    smaller = symcheck.quotient(model, 'R=? [ F "stable" ]')
    assert len(smaller.states) == 9
    assert len(symcheck.quotient(smaller).states) == 9
    for one, other in zip(
        *(m.check('R=? [ F "stable" ]').value for m in (smaller, model)), strict=True
    ):
        assert one == pytest.approx(other, rel=1e-12)


def test_states_of_blocks():
    smaller = symcheck.quotient(DIE, labels={"six": "d=6"})
    assert smaller.block.tolist() == [0, 1, 2, 1, 1, 1, 3, 1, 1, 1, 1, 1, 4]
    assert [[s.number for s in smaller.members(b)] for b in range(5)] == [
        *([0], [1, 3, 4, 5, 7, 8, 9, 10, 11], [2], [6], [12])
    ]
    with pytest.raises(IndexError, match="block 5 of 5 blocks"):
        smaller.members(5)
    assert smaller.texts(1)[1:3] == ["(s=1, d=0)\nand 8 more", "(s=2, d=0)"]
    drawn = view.state_graph(smaller, values=smaller.texts(1))
    assert next(n.label for n in drawn.nodes if n.name == "s3") == "block=3\n(s=6, d=0)"


def test_variables_on_which_blocks_agree_remain():
    text = "dtmc module m x:[0..3]; b:bool; [] x<2 -> 0.5:(x'=2)&(b'=true) + 0.5:(x'=3); [] x>1 -> true; endmodule"
    smaller = symcheck.quotient(symcheck.loads(text), labels={"b": "b", "done": "x>1"})
    assert [v.name for v in smaller.variables] == ["block", "x", "b"]
    smaller = symcheck.quotient(symcheck.loads(text), labels={"b": "b"})
    assert [v.name for v in smaller.variables] == ["block", "x", "b"]
    smaller = symcheck.quotient(symcheck.loads(text + " init x<2 endinit"), labels={"b": "b"})
    assert [v.name for v in smaller.variables] == ["block", "b"]
    assert smaller.check("P=? [ F b ]").value == (0.5, 1.0)


def test_a_variable_may_be_called_block():
    text = "dtmc const int block_ = 1; module m block:[0..1]; [] true -> (block'=block_); endmodule"
    smaller = symcheck.quotient(symcheck.loads(text), "P=? [ F block=block_ ]")
    assert [v.name for v in smaller.variables] == ["block__", "block"]
    assert smaller.check("P=? [ F block=block_ ]").value == 1


CHOICES = """mdp module m
  x : [0..4];
  [a] x=0 -> 0.5:(x'=1) + 0.5:(x'=2);
  [b] x=0 -> 0.5:(x'=2) + 0.5:(x'=1);
  [c] x=0 -> (x'=3);
  [a] x=1 -> (x'=3);
  [b] x=2 -> (x'=3);
  [c] x=3 -> (x'=4);
  [] x=4 -> true;
endmodule
label "end" = x=4;
rewards "cost" [a] true : 1; [b] true : 1; [c] true : 2; endrewards
"""


def test_choices_that_are_equal_on_blocks_are_one():
    model = symcheck.loads(CHOICES)
    assert len(symcheck.quotient(model, labels=["end"]).transitions) == 4 + 1
    smaller = symcheck.quotient(model)
    assert len(smaller.states) == 4
    assert smaller.matrix.shape == (5, 4)
    assert smaller.rewards["cost"].choices.tolist() == [1, 2, 1, 2, 0]
    assert set(smaller.transitions.action) == {None}
    with_actions = symcheck.quotient(model, actions=True)
    assert len(with_actions.states) == 5  # a tells x=1 from x=2
    assert list(with_actions.transitions.action) == ["a", "a", "b", "b", "c", "a", "b", "c", None]


def test_what_is_named_is_kept_and_nothing_else():
    model = symcheck.loads(CHOICES)
    assert list(symcheck.quotient(model).labels) == ["end", "init", "deadlock"]
    smaller = symcheck.quotient(model, rewards=["cost"])
    assert list(smaller.labels) == ["init", "deadlock"]
    assert list(symcheck.quotient(model, labels=["end"]).rewards) == []
    assert list(symcheck.quotient(model, 'R{"cost"}min=? [ F "end" ]').rewards) == ["cost"]
    assert "end" in symcheck.quotient(model, 'Rmin=? [ F "end" ]').labels
    assert list(symcheck.quotient(model, 'Pmax=? [ F "end" ]').rewards) == []
    third = "".join(f'rewards "r{i}" x={i} : 1; endrewards ' for i in range(3))
    numbered = symcheck.quotient(symcheck.loads(CHOICES + third), "R{3}max=? [ C<=4 ]")
    assert list(numbered.rewards) == ["cost", "r0", "r1"]
    assert numbered.check("R{3}max=? [ C<=4 ]").value == 0.5


CIRCLE = """dtmc module m x:[0..3]; [] true -> (x'=mod(x+1,4)); endmodule
label "even" = mod(x,2)=0;"""


def test_init_is_refused_where_states_of_a_block_differ_in_it():
    model = symcheck.loads(CIRCLE)
    smaller = symcheck.quotient(model)
    assert len(smaller.states) == 2
    assert smaller.check('P=? [ X "even" ]').value == 0
    assert smaller.check('filter(max, P=? [ X "even" ], "init")').value == 0
    assert smaller.check("filter(count, true)").value == 2
    for ask in (smaller.check, lambda text: smaller.estimate(text, samples=10)):
        with pytest.raises(UnsupportedError, match='states of one block differ in "init"'):
            ask('P=? [ F[1,2] "init" ]')
    with pytest.raises(UnsupportedError, match='differ in "init"'):
        list(smaller.check_all('"start": "init"; P=? [ X X "start" ]'))
    for kept in (
        symcheck.quotient(model, labels=["init"]),
        symcheck.quotient(model, 'P=? [ F[1,2] "init" ]'),
    ):
        assert len(kept.states) == 4
        assert kept.check('P=? [ F[1,2] "init" ]').value == 0


def test_deadlocks():
    text = "dtmc module m x:[0..2]; [] x=0 -> 0.5:(x'=1)+0.5:(x'=2); [] x=1 -> true; endmodule"
    model = symcheck.loads(text)
    smaller = symcheck.quotient(model)
    assert len(smaller.states) == 1
    with pytest.raises(UnsupportedError, match='differ in "deadlock"'):
        smaller.check('A [ F "deadlock" ]')
    smaller = symcheck.quotient(model, labels=["deadlock"])
    assert len(smaller.states) == 3
    assert smaller.check('P=? [ F "deadlock" ]').value == 0.5


def test_bounds_on_rewards_of_transitions_are_those_of_choices():
    text = (
        "dtmc module m x:[0..2]; [a] x=0 -> (x'=1); [b] x=0 -> (x'=2); [] x>0 -> true; endmodule "
    )
    text += (
        'label "end" = x>0; rewards "r" [b] true : 2; endrewards rewards "s" x=0 : 1; endrewards'
    )
    smaller = symcheck.quotient(symcheck.loads(text))
    assert smaller.check('R{"r"}=? [ F "end" ]').value == 1
    assert smaller.check('P=? [ F{"s"}<=1 "end" ]').value == 1
    with pytest.raises(UnsupportedError, match="bounds on transition rewards of a chain"):
        smaller.check('P=? [ F{"r"}<=1 "end" ]')
    model = symcheck.loads(CHOICES)
    asked = 'Pmax=? [ F{"cost"}<=3 "end" ]'
    assert symcheck.quotient(model).check(asked).value == model.check(asked).value == 0


@pytest.mark.parametrize("kind", ["all", "drn", "umb"])
def test_files(tmp_path, kind):
    smaller = symcheck.quotient(symcheck.loads(CHOICES))
    symcheck.export(smaller, tmp_path / f"m.{kind}")
    read = symcheck.load_explicit(str(tmp_path / f"m.{kind}"))
    asked = 'R{"cost"}max=? [ F "end" ]'
    assert len(read.states) == 4
    assert read.check(asked).value == smaller.check(asked).value == pytest.approx(4)


def test_paths_and_estimates():
    smaller = symcheck.quotient(DIE, labels={"six": "d=6"})
    path = smaller.simulate(20, seed=3)
    steps = [(s.state[0], t.state[0]) for s, t in pairwise(path)]
    assert set(steps) <= {(0, 1), (0, 2), (1, 1), (2, 1), (2, 3), (3, 2), (3, 4), (4, 4)}
    found = smaller.estimate('P=? [ F "six" ]', samples=2000, seed=1)
    assert abs(float(found) - 1 / 6) < 0.04


REFUSED = {
    "Markov automata": "ma module m x:[0..1]; <> x=0 -> 1:(x'=1); [] x=1 -> true; endmodule",
    "partially observable decision processes": "pomdp observables x endobservables module m x:[0..1]; [] true -> (x'=1); endmodule",
    "with intervals of probabilities": (
        "dtmc module m x:[0..1]; [] true -> [0.2,0.8]:(x'=0) + [0.2,0.8]:(x'=1); endmodule"
    ),
    "games": "smg player p m endplayer module m x:[0..1]; [a] true -> (x'=1); endmodule",
    "timed automata": "pta module m x:[0..1]; c:clock; [] c>=1 -> (x'=1); endmodule",
}


@pytest.mark.parametrize("called", REFUSED)
def test_other_classes_are_refused_by_name(called):
    model = symcheck.loads(REFUSED[called])
    with pytest.raises(UnsupportedError, match=f"quotients by bisimulation are not .*{called}"):
        symcheck.quotient(model)


def test_faulty_arguments_are_named():
    with pytest.raises(UnsupportedError, match="this model has rationals"):
        symcheck.quotient(DIE.with_options(exact=True))
    with pytest.raises(UnsupportedError, match="fair strategies"):
        symcheck.quotient(symcheck.loads(CHOICES, fairness=True))
    with pytest.raises(UsageError, match=r"there is no label 'dune'\s.*did you mean done"):
        symcheck.quotient(DIE, labels=["dune"])
    with pytest.raises(UsageError, match="there is no reward structure 'toses'"):
        symcheck.quotient(DIE, rewards=["toses"])
    with pytest.raises(UsageError, match="labels: expected several names"):
        symcheck.quotient(DIE, labels="done")
    with pytest.raises(UsageError, match="actions=True is for the choices of an MDP"):
        symcheck.quotient(DIE, actions=True)
    with pytest.raises(InputError, match="unknown name D"):
        symcheck.quotient(DIE, labels={"six": "D=6"})
    with pytest.raises(InputError, match='the label "init" is predefined'):
        symcheck.quotient(DIE, labels={"init": "d=6"})


def test_formulas_of_the_model_are_kept_with_their_variables():
    text = "mdp formula top = x=2; formula high = top | x=1; formula other = y;"
    text += "module m x:[0..2]; y:bool; [] true -> 0.5:(x'=2)&(y'=true) + 0.5:(x'=2)&(y'=false);"
    smaller = symcheck.quotient(symcheck.loads(text + " endmodule"), "Pmax=? [ X high ]")
    assert [v.name for v in smaller.variables] == ["block", "x"]
    assert smaller.check("Pmax=? [ X high & !(x=0) ]").value == 1
    with pytest.raises(InputError, match="unknown name other"):
        smaller.check("other")


def test_constants_of_properties_are_given():
    smaller = symcheck.quotient(DIE, "const int k; P=? [ F d=k ]", "k=6")
    assert smaller.check("const int k; P=? [ F d=k ]", "k=6").value == pytest.approx(1 / 6)
    with pytest.raises(SymcheckError, match="k"):
        symcheck.quotient(DIE, "const int k; P=? [ F d=k ]")
