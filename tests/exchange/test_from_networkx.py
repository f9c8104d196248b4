"""Models from graphs: there and back, and against the same models as texts."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import networkx
import numpy as np
import pytest

import symcheck
from symcheck.errors import ModelFault, UsageError

MODELS = Path(__file__).parents[2] / "models"
WALK = """mdp
module m
  x : [0..4] init 2;
  home : bool init false;
  [walk] x>0 & x<4 -> 1/3 : (x'=x-1) + 2/3 : (x'=x+1);
  [wait] x=2 -> true;
  [] x=4 -> (home'=true);
endmodule
"""


def test_a_chain_there_and_back() -> None:
    die = symcheck.load(MODELS / "die" / "die.pm")
    back = symcheck.from_networkx(die.to_networkx())
    assert back.engine.states == die.engine.states
    for face in range(1, 7):
        query = f"P=? [ F s=7 & d={face} ]"
        assert back.check(query).value == pytest.approx(1 / 6)
        assert back.check(query).value == die.check(query).value


@pytest.mark.parametrize("engine", ["explicit", "hybrid", "exact"])
def test_an_mdp_there_and_back(engine: str) -> None:
    model = symcheck.loads(WALK)
    back = symcheck.from_networkx(model.to_networkx(), engine=engine)
    assert back.engine.choices == model.engine.choices
    for query in ("Pmin=? [ F home ]", "Pmax=? [ F home ]", "Pmax=? [ F<=3 x=0 ]"):
        assert float(back.check(query).value) == pytest.approx(model.check(query).value)


def test_weights_are_fractions_or_rates() -> None:
    graph = networkx.DiGraph()
    graph.add_edge("up", "down", rate=Fraction(1, 10))
    graph.add_edge("down", "up", rate=Fraction(9, 10))
    model = symcheck.from_networkx(
        graph,
        weight="rate",
        type="ctmc",
        labels={"up": ["up"]},
        rewards={"cost": {"down": 5}},
        initial="down",
        exact=True,
    )
    assert model.check('S=? [ "up" ]').value == Fraction(9, 10)
    assert model.check('R{"cost"}=? [ S ]').value == Fraction(1, 2)
    assert model.check("P=? [ X s=0 ]").value == 1  # from down, the second node


def test_attributes_are_variables_where_they_tell_nodes_apart() -> None:
    graph = networkx.DiGraph()
    graph.add_node("a", level=3, open=True, name="A")
    graph.add_node("b", level=4, open=True, name="B")
    graph.add_edge("a", "b", probability=1)
    graph.add_edge("b", "a", probability=1)
    model = symcheck.from_networkx(graph)
    assert [v.name for v in model.bound.variables] == ["level", "open"]
    for node in graph:  # no names of fields
        graph.nodes[node].update({"class": 1, "_hidden": 2, "no name": 3, 4: 5})
    assert [v.name for v in symcheck.from_networkx(graph).bound.variables] == ["level", "open"]
    graph.nodes["a"]["level"] = np.int64(3)
    assert [v.name for v in symcheck.from_networkx(graph).bound.variables] == ["level", "open"]
    graph.nodes["b"]["level"] = 3
    assert [v.name for v in symcheck.from_networkx(graph).bound.variables] == ["s"]


@pytest.mark.parametrize(
    ("graph", "keywords", "error", "message"),
    [
        (networkx.Graph(), {}, UsageError, "expected a directed graph"),
        (networkx.DiGraph(), {}, UsageError, "no nodes"),
        (
            networkx.DiGraph([("a", "b", {"probability": 0.9})]),
            {},
            ModelFault,
            "the probabilities of node 'a' sum to 0.9, not to 1",
        ),
        (
            networkx.DiGraph([("a", "b", {"probability": -1})]),
            {},
            ModelFault,
            "node 'a' gives -1 as the probability or rate of 'b'",
        ),
        (
            networkx.DiGraph([("a", "b", {"probability": "1/2"})]),
            {},
            UsageError,
            "the edge from 'a' to 'b' has probability='1/2': expected a number",
        ),
        (networkx.DiGraph([(0, 1)]), {}, UsageError, "the edge from 0 to 1 has no 'probability'"),
        (networkx.DiGraph([(0, 0, {"p": 0.5})]), {"weight": "p"}, ModelFault, "0.5"),
        (
            networkx.DiGraph([(0, 0)]),
            {"initial": 3},
            UsageError,
            "initial: the graph has no node 3",
        ),
        ({0: [0]}, {}, UsageError, "expected a directed graph of networkx, not {0: [0]}"),
        (networkx.DiGraph([(0, 0, {1: 2})]), {}, UsageError, "those of this edge: 1"),
        (networkx.DiGraph([(0, 0)]), {"initial": [0]}, UsageError, "no node [0]"),
        (networkx.DiGraph([(0, 0)]), {"labels": [0]}, UsageError, "labels: expected a mapping"),
        (networkx.DiGraph([(0, 0)]), {"labels": {"a": 0}}, UsageError, "a list of nodes, not 0"),
        (
            networkx.DiGraph([(0, 0)]),
            {"rewards": {"r": 3}},
            UsageError,
            "mapping from nodes, not 3",
        ),
        (networkx.DiGraph([(0, 0)]), {"type": "pta"}, UsageError, "type='pta': such a model needs"),
        (networkx.DiGraph([(0, 0)]), {"type": "ma"}, UsageError, "nothing tells rates from"),
        (networkx.DiGraph([(0, 0)]), {"labels": {"a": [7]}}, UsageError, "labels['a']: the graph"),
    ],
)
def test_errors_of_graphs(
    graph: networkx.Graph, keywords: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        symcheck.from_networkx(graph, **keywords)  # type: ignore[arg-type]
    assert message in str(caught.value)
