"""The coarsest bisimulation on diagrams: the same partition as of explicit states, and of models that
nobody can list.
"""

from __future__ import annotations

from math import comb
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import check_text, engine_of
from generate import random_model
from symcheck.check import tuning
from symcheck.engines.explicit.array_values import ArrayValues
from symcheck.engines.symbolic import bisimulation as symbolic_lump
from symcheck.engines.symbolic.bisimulation import lump_diagrams
from symcheck.errors import InputError, UnsupportedError
from symcheck.numerics.bisimulation import lump
from symcheck.semantics.binding.bind import bind_properties
from symcheck.semantics.rewards import Structure
from symcheck.syntax.parse import parse_properties

SLOW = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))

PART = """module m{0}
 x{0} : [0..3];
 [] x{0}=0 -> 2:(x{0}'=1);
 [] x{0}=1 -> 1:(x{0}'=2) + 3:(x{0}'=0);
 [] x{0}=2 -> 0.1:(x{0}'=3) + 0.2:(x{0}'=0) + 0.3:(x{0}'=1);
 [] x{0}=3 -> 5:(x{0}'=0);
endmodule
"""


SWITCH = "module m{0}\n x{0} : [0..1];\n [] x{0}=0 -> 0.3:(x{0}'=1);\n [] x{0}=1 -> 1.7:(x{0}'=0);\nendmodule\n"


def symmetric(n, part=PART, last=3):
    text = "ctmc\n" + "".join(part.format(i) for i in range(n))
    failed = " + ".join(f"(x{i}={last}?1:0)" for i in range(n))
    return text + f"formula failed = {failed};\nrewards\n true : failed;\nendrewards\n"


def rows_of(matrix, rewards=None):
    """Per state the set of its rows, each as its entries."""
    groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups
    found = []
    for s in range(matrix.states):
        rows = set()
        for r in range(groups[s], groups[s + 1]):
            here = slice(matrix.indptr[r], matrix.indptr[r + 1])
            entries = zip(
                matrix.indices[here].tolist(),
                (round(v, 9) for v in matrix.data[here].tolist()),
                strict=True,
            )
            rows.add((frozenset(entries), None if rewards is None else round(rewards[r], 9)))
        found.append(rows)
    return found


def where(engine, text):
    return engine.where(
        bind_properties(parse_properties(text), engine.model, {}).properties[0].formula
    )


def random_engine(seed, kind):
    try:
        return engine_of(random_model(Random(seed), kind, largest=5).text, "sparse")
    except InputError:
        assume(False)


@SLOW
@given(
    seed=st.integers(0, 2**20),
    kind=st.sampled_from(["dtmc", "ctmc", "mdp"]),
    rewarded=st.booleans(),
    told=st.integers(0, 3),
)
def test_the_partition_of_listed_states(seed, kind, rewarded, told):
    engine = random_engine(seed, kind)
    variable = engine.model.variables[told % len(engine.model.variables)]
    low = variable.low
    states = where(engine, f"{variable.name}={low}" if low is not None else variable.name)
    structures = [0] if rewarded and engine.model.rewards else []
    system = engine.system(engine.all)
    colours, rows = [engine.to_bools(states)], []
    for structure in structures:
        of_states, of_rows = system.rewards(Structure(structure))
        colours.append(of_states)
        rows.append(of_rows)
    want = lump(system.weights, colours, rows)
    found = lump_diagrams(engine.diagrams, [states.bdd], structures)
    assert found.blocks == len(want.first)
    assert (found.block_of_states() == want.block).all()
    rewards = (rows[0][want.rows], found.rewards[0]) if structures else (None, None)
    assert rows_of(found.matrix, rewards[1]) == rows_of(want.matrix, rewards[0])
    assert found.members.tolist() == engine.diagrams.odd.unrank(want.first).tolist()
    assert (
        found.meeting(engine.initial.bdd).tolist()
        == np.unique(want.block[engine.to_bools(engine.initial)]).tolist()
    )


@SLOW
@given(seed=st.integers(0, 2**20))
def test_values_of_blocks_are_values_of_states(seed):
    engine = random_engine(seed, "dtmc")
    lumped = lump_diagrams(engine.diagrams, [engine.initial.bdd])
    values = ArrayValues(np.arange(lumped.blocks) / 2, np.arange(lumped.blocks) / 2 + 1)
    lower, upper = lumped.lift(values).at(engine.all)
    block = lumped.block_of_states()
    assert (lower == block / 2).all()
    assert (upper == block / 2 + 1).all()
    odd = np.arange(lumped.blocks) % 2 == 1
    assert (engine.to_bools(lumped.lift_set(odd)) == (block % 2 == 1)).all()


def test_bits_that_nobody_reads_count_for_all_their_values():
    text = (
        "dtmc\nmodule m\n x : [0..3];\n y : [0..7];\n"
        " [] x<3 -> 1/16:(x'=x+1)&(y'=0)"
        + "".join(f" + 1/16:(x'=x+1)&(y'={i})" for i in range(1, 8))
        + " + 1/2:(x'=3);\n"
        " [] x=3 -> true;\nendmodule\n"
    )
    engine = engine_of(text, "sparse")
    found = lump_diagrams(engine.diagrams, [where(engine, "x=3").bdd])
    assert found.blocks == 4  # x=2 moves to x=3 with probability 1, x=0 and x=1 do not alike
    assert np.bincount(found.matrix.indices, found.matrix.data).sum() == 4


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_coins_that_nobody_reads_count_for_all_their_values_also_at_the_top(kind):
    text = (
        f"{kind}\nmodule coins\n c : [0..1]; d : [0..1]; x : [0..1];\n"
        " [] true -> 1/4:(c'=0)&(d'=0)&(x'=1) + 1/4:(c'=1)&(d'=0)&(x'=1)"
        " + 1/4:(c'=0)&(d'=1)&(x'=1) + 1/4:(c'=1)&(d'=1)&(x'=1);\nendmodule\n"
    )
    engine = engine_of(text, "sparse")
    for colours, blocks in (
        ([], 1),
        ([where(engine, "x=1").bdd], 2),
        ([where(engine, "d=1").bdd], 2),
    ):
        found = lump_diagrams(engine.diagrams, colours)
        assert found.blocks == blocks
        assert found.matrix.row_sums().tolist() == [1.0] * blocks


def test_components_that_are_alike():
    engine = engine_of(symmetric(8), "hybrid")
    observed = []
    found = lump_diagrams(engine.diagrams, [], [0], observed.append)
    assert found.blocks == comb(11, 3)  # multisets of 8 of 4 states
    assert observed[-1].blocks == found.blocks == observed[-2].blocks
    assert (
        found.matrix.entries
        == lump(
            engine.system(engine.all).weights, [engine.system(engine.all).rewards(Structure(0))[0]]
        ).matrix.entries
    )


def test_more_states_than_can_be_numbered():
    engine = engine_of(symmetric(64, SWITCH, 1), "hybrid")
    assert engine.states == 2**64
    found = lump_diagrams(engine.diagrams, [], [0])
    assert found.blocks == 65
    result = check_text(engine, "filter(max, R=? [ S ])", bisim=True)
    assert result.value == pytest.approx(64 * 0.3 / 2.0, rel=1e-6)
    assert "-> 65 by bisimulation" in result.explanation


def test_what_is_no_longer_needed_is_dropped(monkeypatch):
    text = "mdp\nmodule m\n x : [0..40];\n y : [0..1];\n [a] x<40 -> 0.5:(x'=x+1) + 0.5:(y'=1-y);\n [b] x>0 -> (x'=x-1);\nendmodule\n"
    engine = engine_of(text + "rewards\n [b] true : x;\nendrewards\n", "sparse")
    make, made = symbolic_lump._matrices, []

    def small(*arguments):
        made.append(make(*arguments))
        made[-1].threshold = 10
        return made[-1]

    want = lump_diagrams(engine.diagrams, [where(engine, "x=40").bdd], [0])
    monkeypatch.setattr(symbolic_lump, "_matrices", small)
    found = lump_diagrams(engine.diagrams, [where(engine, "x=40").bdd], [0])
    assert made[0].threshold > 10
    assert found.nodes < want.nodes
    assert (found.block_of_states() == want.block_of_states()).all()
    assert rows_of(found.matrix, found.rewards[0]) == rows_of(want.matrix, want.rewards[0])


def test_giving_up():
    engine = engine_of(symmetric(6), "sparse")
    different = [where(engine, f"x{i}=1").bdd for i in range(6)]
    with pytest.raises(UnsupportedError, match="more than 100 blocks"):
        lump_diagrams(engine.diagrams, different, most=100)
    with pytest.raises(UnsupportedError, match="outgrows 1 MiB"):
        lump_diagrams(engine_of(symmetric(10), "sparse").diagrams, [], [0], limit=2**20)


def test_giving_up_after_many_operations():
    engine = engine_of(symmetric(6), "sparse")
    with pytest.raises(UnsupportedError, match=r"outgrows 0 operations \(64 blocks"):
        lump_diagrams(engine.diagrams, [], budget=0)
    large = engine_of(symmetric(10), "sparse")  # here in the middle of a round
    different = [
        where(large, " + ".join(f"{i}*x{i}" for i in range(10)) + f"={k}").bdd for k in (30, 31)
    ]
    with pytest.raises(UnsupportedError, match=r"outgrows 100,000 operations"):
        lump_diagrams(large.diagrams, different, budget=100_000)


def test_explicit_states_where_diagrams_take_too_long(monkeypatch):
    monkeypatch.setattr(tuning, "LUMPING_OPERATIONS", 0)
    result = check_text(engine_of(symmetric(5), "sparse"), "R=? [ S ]", bisim=True)
    assert "on explicit states" in result.runs[0].explanation
    assert "1024 states -> 56 by bisimulation" in result.explanation
