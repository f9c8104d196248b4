"""The coarsest bisimulation, against splitting all blocks again and again."""

from __future__ import annotations

from random import Random

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from checking import engine_of
from generate import random_model
from symcheck.errors import InputError
from symcheck.numerics.bisimulation import lump

SLOW = settings(max_examples=50, deadline=None, suppress_health_check=list(HealthCheck))


def naive(matrix, colours):
    """The coarsest bisimulation, by splitting all blocks again and again."""
    groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups
    names = list(zip(*(c.tolist() for c in colours), strict=True))
    while True:
        keys = []
        for s in range(matrix.states):
            rows = set()
            for r in range(groups[s], groups[s + 1]):
                sums = {}
                for k in range(matrix.indptr[r], matrix.indptr[r + 1]):
                    c = names[matrix.indices[k]]
                    sums[c] = sums.get(c, 0.0) + matrix.data[k]
                rows.add(frozenset((c, round(v, 10)) for c, v in sums.items()))
            keys.append((names[s], frozenset(rows)))
        numbers = {k: i for i, k in enumerate(dict.fromkeys(keys))}
        following = [numbers[k] for k in keys]
        if len(numbers) == len(set(names)):
            return following
        names = following


def random_engine(seed, kind):
    try:
        return engine_of(random_model(Random(seed), kind, largest=5).text)
    except InputError:
        assume(False)


@SLOW
@given(seed=st.integers(0, 2**20), kind=st.sampled_from(["dtmc", "ctmc", "mdp"]))
def test_coarsest_partition(seed, kind):
    engine = random_engine(seed, kind)
    colours = [engine.explored.states.column(0) % 2]
    found = lump(engine.matrix, colours)
    want = naive(engine.matrix, colours)
    pairs = set(zip(found.block.tolist(), want, strict=True))
    assert len(pairs) == len(set(want)) == len(found.first)
    assert (np.diff(found.first) > 0).all()
    assert (found.block[found.first] == np.arange(len(found.first))).all()


def test_long_chains():
    text = "dtmc\nmodule m\n x : [0..20000];\n [] x<20000 -> 0.5:(x'=x+1) + 0.5:(x'=x);\n [] x=20000 -> true;\nendmodule\n"
    assert lump(engine_of(text).matrix, [np.arange(20001) == 20000]).matrix.states == 20001


def test_rewards_of_rows_tell_states_apart():
    text = "mdp\nmodule m\n x : [0..2];\n [] x<2 -> (x'=2);\n [] x=2 -> true;\nendmodule\n"
    matrix = engine_of(text.replace("endmodule", "endmodule\ninit true endinit")).matrix
    last = np.arange(3) == 2
    assert lump(matrix, [last]).matrix.states == 2
    assert lump(matrix, [last], [np.array([0.0, 1.0, 0.0])]).matrix.states == 3
