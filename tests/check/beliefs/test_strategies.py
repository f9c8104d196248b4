"""Strategies of partially observed models see observations only, and attain what is claimed."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest

import symcheck
from oracles.beliefs import drawn
from symcheck.errors import NoStrategyError

MODELS = Path(__file__).parents[3] / "models"


def decides_by_observation(strategy, observation) -> bool:
    """Whether what is done, and the memory that follows, depend on the observation and the memory."""
    seen = defaultdict(set)
    for state, memory, action, after, there in zip(
        strategy.origin.tolist(),
        strategy.memory.tolist(),
        strategy.actions,
        _following(strategy),
        (strategy.reachable & strategy.matters).tolist(),
        strict=True,
    ):
        if there:
            seen[observation[state], memory].add((action, after))
    return all(len(decisions) == 1 for decisions in seen.values())


def _following(strategy):
    starts, after = strategy.starts.tolist(), strategy.following.tolist()
    return [tuple(after[a:b]) for a, b in pairwise(starts)]


@pytest.mark.parametrize(
    ("name", "query", "options"),
    [
        ("tiger", 'R{"cost"}min=? [ F "open" ]', {}),
        ("tiger", 'Pmax=? [ F "free" ]', {"beliefs": 100}),
        ("maze", 'R{"steps"}min=? [ F "target" ]', {}),
        ("maze", 'Pmax=? [ F "target" ]', {}),
        ("maze", 'Pmin=? [ F "target" ]', {}),
        ("rover", 'Pmax=? [ F "arrived" ]', {}),
        ("rover", 'Pmax=? [ F "arrived" ]', {"exact": True}),
        ("channels", 'R{"arrived"}max=? [ F "end" ]', {}),
        ("channels", 'Pmin=? [ F "both" ]', {}),
        # The belief at the beginning is not expanded.
        ("tiger", 'R{"cost"}min=? [ F "open" ]', {"beliefs": 1}),
        ("tiger", 'Pmax=? [ F "free" ]', {"beliefs": 2}),
        # The memory counts steps, too.
        ("tiger", 'Pmax=? [ F<=4 "free" ]', {}),
        ("tiger", 'Pmin=? [ G[1,4] !"free" ]', {"exact": True}),
        ("rover", 'Pmax=? [ X "arrived" ]', {}),
    ],
)
def test_models(name, query, options):
    from symcheck.check.beliefs.model import observations

    given = {"slip": "0.1"} if name == "maze" else {}
    model = symcheck.load(
        MODELS / name / f"{name}.prism", constants=given, strategy=True, **options
    )
    result = model.check(query)
    strategy = result.strategy
    assert decides_by_observation(strategy, observations(strategy.base).tolist())
    chain = symcheck.induced_chain(model, strategy)
    one = chain.check(query.replace("max", "").replace("min", ""))
    low, high = result.bounds
    assert low - 1e-9 <= one.value <= high + 1e-9


@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("beliefs", ["few", "many"])
def test_random_models(seed, beliefs):
    """Building a strategy checks it as a chain; here the induced chain is checked again."""
    number = 100 if beliefs == "many" else 1 + seed % 6
    model = symcheck.loads(drawn(Random(seed)).text, strategy=True, beliefs=number)
    queries = ['Pmax=? [ F "goal" ]', 'Pmin=? [ F "goal" ]', 'Rmin=? [ F "goal" ]']
    if beliefs == "few":
        queries += ['Rmax=? [ F "goal" ]', 'Pmax=? [ G !"goal" ]']
        queries += ['Pmax=? [ F<=3 "goal" ]', 'Pmin=? [ F[2,3] "goal" ]', 'Pmax=? [ G<=2 !"goal" ]']
    for query in queries:
        result = model.check(query)
        if not result.strategies:
            assert any("no strategy is built for" in w for w in result.warnings)
            continue
        chain = symcheck.induced_chain(model, result.strategy)
        value = chain.check(query.replace("max", "").replace("min", "")).bounds
        low, high = result.bounds
        slack = 1e-9 * max(1.0, abs(high))
        if "max" in query:
            assert value[1] >= low - slack
        else:
            assert value[0] <= high + slack


def test_a_file_of_decisions(tmp_path):
    from symcheck.cli import main

    file = tmp_path / "listen.txt"
    tiger = str(MODELS / "tiger/tiger.prism")
    main([tiger, "-pf", 'R{"cost"}min=? [ F "open" ]', "-exportstrat", str(file)])
    lines = file.read_text().splitlines()
    assert "(0,0,0,false),0=hide" in lines
    assert "# memory: 0" in lines
    assert any(line.endswith("=left") for line in lines)


def test_values_without_a_strategy():
    rover = symcheck.load(MODELS / "rover/rover.prism", strategy=True)
    result = rover.check('Pmax=? [ "arrived" ]')
    with pytest.raises(NoStrategyError, match="paths and rewards until states are reached"):
        _ = result.strategy
