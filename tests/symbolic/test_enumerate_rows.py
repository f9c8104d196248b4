"""Rows enumerated from the diagrams of commands: the matrix that the explicit search finds."""

from __future__ import annotations

import random

import numpy as np
import pytest

import symcheck
from engines.twins import MODELS as TWINS
from generate import random_model, random_property
from symbolic.oracle import bound
from symbolic.test_on_the_fly_relations import NOTHING, WIDE
from symcheck.engines.symbolic.enumerated_rows import EnumeratedEngine
from symcheck.errors import ModelFault, SymcheckError
from symcheck.explicit.build import explore
from symcheck.matrices.rows import SparseMatrix
from symcheck.options import Options
from symcheck.symbolic import tuning
from symcheck.symbolic.build import build, build_state_space
from symcheck.symbolic.matrix.enumerate_rows import enumerate_rows
from symcheck.symbolic.reachability.search import reach


def dense(matrix: SparseMatrix):
    out = np.zeros((matrix.states, matrix.states))
    for row in range(matrix.states):
        span = slice(matrix.indptr[row], matrix.indptr[row + 1])
        assert len(set(matrix.indices[span])) == matrix.indptr[row + 1] - matrix.indptr[row]
        out[row, matrix.indices[span]] = matrix.data[span]
    return out


@pytest.mark.parametrize("limits", [None, NOTHING], ids=["full", "on the fly"])
@pytest.mark.parametrize("text", [TWINS["dtmc"], TWINS["ctmc"], WIDE], ids=["dtmc", "ctmc", "wide"])
def test_enumerated_rows_are_those_of_the_search(text, limits, monkeypatch):
    monkeypatch.setattr(tuning, "STATES_PER_CHUNK", 7)
    monkeypatch.setattr(tuning, "TARGET_BITS", 2)
    model = bound(text)
    found = enumerate_rows(reach(build(model, Options(), limits=limits)))
    assert found is not None
    np.testing.assert_allclose(dense(found), dense(explore(model, Options()).matrix), rtol=1e-15)


def test_choices_and_very_many_joint_updates_are_not_enumerated(monkeypatch):
    assert enumerate_rows(build_state_space(bound(TWINS["mdp"]), Options())) is None
    monkeypatch.setattr(tuning, "MAX_JOINT_UPDATES", 1)
    assert enumerate_rows(build_state_space(bound(TWINS["dtmc"]), Options())) is None


@pytest.mark.parametrize("engine", ["sparse", "hybrid", "mtbdd"])
@pytest.mark.parametrize("seed", range(12))
def test_models_that_do_not_compress_have_the_same_values(engine, seed, monkeypatch):
    monkeypatch.setattr("symcheck.engines.tuning.SMALL_DIAGRAM_NODES", 0)
    monkeypatch.setattr("symcheck.engines.tuning.MAX_NODES_PER_STATE", 0.0)
    rng = random.Random(seed)
    source = random_model(rng, rng.choice(["dtmc", "ctmc"]))
    try:
        model, oracle = (
            symcheck.loads(source.text, engine=engine),
            symcheck.loads(source.text, engine="explicit"),
        )
        assert isinstance(model.engine, EnumeratedEngine)
        assert (model.engine.states, model.engine.transitions) == (
            oracle.engine.states,
            oracle.engine.transitions,
        )
    except SymcheckError:
        with pytest.raises(SymcheckError):
            oracle = symcheck.loads(source.text, engine="explicit").engine
        return
    for _ in range(6):
        question = random_property(rng, source)
        try:
            expected = oracle.check(question).value
        except SymcheckError:
            with pytest.raises(SymcheckError):
                model.check(question)
            continue
        assert model.check(question).value == pytest.approx(expected, rel=3e-6, nan_ok=True), (
            question
        )


def test_faults_are_found_before_rows_are_listed(monkeypatch):
    monkeypatch.setattr("symcheck.engines.tuning.SMALL_DIAGRAM_NODES", 0)
    monkeypatch.setattr("symcheck.engines.tuning.MAX_NODES_PER_STATE", 0.0)
    model = symcheck.loads(
        "dtmc module m x : [0..3]; [] true -> 0.5 : (x'=x+1) + 0.5 : (x'=0); endmodule",
        engine="sparse",
    )
    with pytest.raises(ModelFault, match="x would become 4"):
        _ = model.engine


def test_diagrams_that_compress_stay_diagrams():
    assert not isinstance(symcheck.loads(TWINS["dtmc"], engine="sparse").engine, EnumeratedEngine)
