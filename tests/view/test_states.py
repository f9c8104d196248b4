"""State graphs: every state, choice and transition is drawn, in layers by distance."""

from __future__ import annotations

import pytest

import symcheck
from symcheck import view
from symcheck.errors import UnsupportedError
from symcheck.explicit.model import ExplicitModel
from symcheck.options import Options
from symcheck.syntax.parse import parse_expression

MDP = """mdp
module m
  x : [0..2] init 0;
  ok : bool init true;
  [go] x=0 -> 0.5 : (x'=1) + 0.5 : (x'=2);
  [stop] x=0 -> (ok'=false);
  [] x>0 -> true;
endmodule
"""


def explored(text: str) -> ExplicitModel:
    return symcheck.explore(symcheck.bind(symcheck.parse_model(text)), Options())


def test_choices_are_points_between_states() -> None:
    model = explored(MDP)
    picture = view.state_graph(model, marked=model.evaluate(parse_expression("x=2")))
    kinds = {n.label: (n.kind, n.layer) for n in picture.nodes if n.kind != "choice"}
    assert kinds["x=0, ok"] == ("initial", 0)
    assert kinds["x=1, ok"] == ("state", 2)
    assert kinds["x=2, ok"] == ("marked", 2)
    assert "x=0, !ok" in kinds
    assert max(n.layer for n in picture.nodes) < len(picture.layers)
    start = next(n.name for n in picture.nodes if n.kind == "initial")
    point = next(e.target for e in picture.edges if e.source == start and e.label == "go")
    assert [e.label for e in picture.edges if e.source == point] == ["0.5", "0.5"]
    assert sum(e.label == "stop" for e in picture.edges if e.source == start) == 1


def test_chains_have_an_edge_per_transition() -> None:
    model = explored(
        "dtmc module m x : [0..3] init 0; [] true -> 0.5 : (x'=0) + 0.5 : (x'=min(x+1,3)); endmodule"
    )
    picture = view.state_graph(model)
    assert len(picture.edges) == model.matrix.entries
    assert [n.layer for n in picture.nodes] == [0, 1, 2, 3]
    assert picture.svg.count('class="node"') == 4


def test_large_models_are_refused() -> None:
    with pytest.raises(UnsupportedError, match="max_states"):
        view.state_graph(
            explored("dtmc module m x : [0..9] init 0; [] true -> (x'=mod(x+1,10)); endmodule"),
            max_states=9,
        )


BACK = """mdp
module robot
  at : [0..3] init 0;
  [wait]  at=0 -> true;
  [safe]  at=0 -> 0.9 : (at'=1) + 0.1 : true;
  [risky] at=0 -> 0.5 : (at'=2) + 0.5 : (at'=3);
  [go]    at=1 -> 0.8 : (at'=2) + 0.2 : (at'=0);
  [back]  at=3 -> 0.5 : (at'=0) + 0.5 : (at'=3);
endmodule
"""


def test_steps_back_and_loops_are_drawn() -> None:
    model = explored(BACK)
    picture = view.state_graph(model)
    layer = {n.name: n.layer for n in picture.nodes}
    back = [e for e in picture.edges if layer[e.source] > layer[e.target]]
    assert len(back) == 5
    assert picture.svg.count('class="edge ') == len(picture.edges)
