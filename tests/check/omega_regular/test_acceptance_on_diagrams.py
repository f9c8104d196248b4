"""LTL on large MDPs as diagrams: almost-sure acceptance without a list of end components."""

from __future__ import annotations

from random import Random
from unittest.mock import patch

import pytest

from checking import check_text, engine_of
from generate import random_model
from symcheck.engines import tuning
from symcheck.errors import InputError

FORMULAS = (
    'G F "a"',
    'F G "a"',
    '(G F "a") & (G F "b")',
    '(G F "a") & (F G "b")',
    '(F G "a") | (G F "b")',
    'G ("a" => F "b")',
    '(G F "a") & (G F !"a") & G F "b"',
)


@pytest.mark.parametrize("direction", ["min", "max"])
def test_values_are_those_of_the_explicit_engine(direction):
    compared = 0
    for seed in range(40):
        rng = Random(f"acceptance {seed}")
        text = random_model(rng, "mdp", largest=2).text
        query = f"P{direction}=? [ {rng.choice(FORMULAS)} ]"
        try:
            listed = engine_of(text)
        except InputError:
            continue
        want = check_text(listed, query)
        with patch.object(tuning, "END_COMPONENT_STATES", 0):
            found = check_text(engine_of(text, "mtbdd"), query)
        wanted, values = want.values, found.values
        for state in range(listed.states):
            assert values[state] == pytest.approx(wanted[state], abs=1e-8), (seed, query, text)
        compared += 1
    assert compared >= 20


def test_many_states():
    # Nine workers, ten states each: too many to list.
    worker = """module w1
      w1 : [0..9];
      [] w1=0 -> true;
      [] w1<5 -> 0.5 : (w1'=w1+1) + 0.5 : (w1'=0);
      [] w1>=5 & w1<9 -> (w1'=w1+1);
      [] w1=9 -> (w1'=0);
    endmodule"""
    copies = "".join(f"module w{i} = w1 [ w1=w{i} ] endmodule\n" for i in range(2, 10))
    works = " | ".join(f"w{i}>=5" for i in range(1, 10))
    engine = engine_of(f'mdp {worker}\n{copies} label "works" = {works};', "mtbdd")
    assert engine.states == 10**9
    assert check_text(engine, 'Pmin=? [ G F "works" ]').value == 0
    assert check_text(engine, 'Pmax=? [ G F "works" ]').value == 1
    assert check_text(engine, 'Pmin=? [ F G "works" ]').value == 0
    assert check_text(engine, 'Pmax=? [ F G "works" ]').value == 1
