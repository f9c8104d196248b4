"""Models that diagrams do not compress: the symbolic engines explore their rows explicitly."""

from __future__ import annotations

import random

import pytest

import symcheck
from engines.twins import MODELS as TWINS
from generate import random_model, random_property
from symcheck.engines.capabilities import HasExploredModel
from symcheck.errors import ModelFault, SymcheckError

ENGINES = ["sparse", "hybrid", "mtbdd"]


@pytest.fixture
def _nothing_compresses(monkeypatch):
    monkeypatch.setattr("symcheck.engines.tuning.SMALL_DIAGRAM_NODES", 0)
    monkeypatch.setattr("symcheck.engines.tuning.MAX_NODES_PER_STATE", 0.0)


@pytest.mark.usefixtures("_nothing_compresses")
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", range(6))
def test_the_values_are_those_of_the_explicit_engine(engine, seed):
    rng = random.Random(seed)
    source = random_model(rng, rng.choice(["dtmc", "ctmc", "mdp"]))
    model, oracle = (symcheck.loads(source.text, engine=e) for e in (engine, "explicit"))
    try:
        found = model.engine
        assert found.name.startswith(f"{engine} (")
        assert found.name.endswith("rows are explored explicitly)")
        assert (found.states, found.transitions) == (
            oracle.engine.states,
            oracle.engine.transitions,
        )
    except SymcheckError:
        with pytest.raises(SymcheckError):
            _ = oracle.engine
        return
    for _ in range(3):
        question = random_property(rng, source)
        try:
            expected = oracle.check(question).value
        except SymcheckError:
            with pytest.raises(SymcheckError):
                model.check(question)
            continue
        assert model.check(question).value == pytest.approx(expected, rel=3e-6, nan_ok=True)


@pytest.mark.usefixtures("_nothing_compresses")
def test_faults_are_found():
    model = symcheck.loads(
        "dtmc module m x : [0..3]; [] true -> 0.5 : (x'=x+1) + 0.5 : (x'=0); endmodule",
        engine="sparse",
    )
    with pytest.raises(ModelFault, match="x would become 4"):
        _ = model.engine


@pytest.mark.parametrize("engine", ENGINES)
def test_diagrams_that_compress_stay_diagrams(engine):
    found = symcheck.loads(TWINS["dtmc"], engine=engine).engine
    assert found.capability(HasExploredModel) is None
