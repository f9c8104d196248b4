"""State graphs: every state, choice and transition is drawn, in layers by distance."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import symcheck
from symcheck import view
from symcheck.errors import UnsupportedError, UsageError
from symcheck.explicit.model import ExplicitModel
from symcheck.options import Options
from symcheck.syntax.parse import parse_expression
from symcheck.view.picture import WINDOW, Picture, Room
from symcheck.view.states import neighbourhood, paths_graph, strategy_graph

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


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_intervals_are_written_on_edges(kind: str, exact: bool) -> None:
    text = f"""{kind}
        module m
          x : [0..2] init 0;
          [go] x=0 -> [0.25,0.5] : (x'=1) + [0.5,0.75] : (x'=2);
          [] x>0 -> true;
        endmodule
    """
    model = symcheck.loads(text, exact=exact)
    labels = [edge.label for edge in view.state_graph(model).edges]
    low, half, high = ("1/4", "1/2", "3/4") if exact else ("0.25", "0.5", "0.75")
    assert {f"[{low},{half}]", f"[{half},{high}]"} <= set(labels)
    near = view.state_graph(model, around="x=1", radius=0)
    assert [edge.label for edge in near.edges if edge.target == "s1"] == [
        "" if kind == "mdp" else "1"
    ]


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


def robot(**options: object) -> symcheck.Model:
    return symcheck.loads(BACK.replace("[back]", "[] at=2 -> true; [back]"), **options)  # type: ignore[arg-type]


def test_values_and_sets_of_a_model_are_drawn() -> None:
    model = robot()
    picture = view.state_graph(
        model, values=model.check("Pmax=? [ F at=3 ]"), sets={"goal": "at=2", "far": "at>1"}
    )
    labels = {n.label: n.fill for n in picture.nodes if n.kind != "choice"}
    assert labels["at=2\n0"] == picture.keys[0][0]  # the first set has the colour
    assert labels["at=3\n1"] == picture.keys[1][0]
    assert [text for _, text in picture.keys] == ["goal", "far"]
    assert "goal" in picture.svg
    infinite = view.state_graph(model, values=[0.5, 1, 2, float("inf")])
    assert "at=3\n∞" in {n.label for n in infinite.nodes}


def test_a_strategy_is_bold() -> None:
    model = robot(strategy=True)
    result = model.check("Pmin=? [ F at=2 ]")
    picture = view.state_graph(model, strategy=result)
    chosen = {e.label for e in picture.edges if e.emphasis == "chosen" and e.source == "s0"}
    others = {e.label for e in picture.edges if e.emphasis == "other" and e.source == "s0"}
    assert (chosen, others) == ({"wait"}, {"safe", "risky"})
    bounded = view.state_graph(model, strategy=model.check("Pmax=? [ F<=2 at=2 ]"))
    assert any("memory=" in n.label for n in bounded.nodes)


def test_a_path_is_red() -> None:
    model = symcheck.loads("dtmc module m x : [0..4]; [] true -> (x'=mod(x+1,5)); endmodule")
    paths = (model.simulate(2), [0, 1, 2], [(0,), (1,), (2,)], [{"x": 0}, {"x": 1}, {"x": 2}])
    for path in paths:
        picture = view.state_graph(model, path=path)  # type: ignore[arg-type]
        red = {(e.source, e.target) for e in picture.edges if e.emphasis == "path"}
        assert red == {("s0", "s1"), ("s1", "s2")}


def test_the_neighbourhood_of_states() -> None:
    model = symcheck.loads(
        "dtmc module m x : [0..9999]; [] x<9999 -> 0.5:(x'=x+1)+0.5:true; [] x=9999 -> true; endmodule"
    )
    picture = view.state_graph(model, around="x=5000", radius=2)
    states = [n.label for n in picture.nodes if n.kind == "state"]
    assert states == [f"x={i}" for i in range(4998, 5003)]
    (outside,) = [e for e in picture.edges if e.dashed]
    assert (outside.source, outside.label) == ("s5002", "0.5")
    assert "not drawn" in picture.legend
    with pytest.raises(UnsupportedError, match="10,000 states"):
        view.state_graph(model)
    with pytest.raises(UnsupportedError, match="10,000 transitions"):
        view.state_graph(model.with_constants({}), max_states=6000, around="x<5000", radius=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"values": [1.0]}, "4 values are expected, not 1"),
        ({"path": [(9,)]}, "not a reachable state"),
        ({"sets": {str(i): "at=0" for i in range(7)}}, "at most 6 sets"),
    ],
)
def test_what_does_not_belong_to_the_model_is_refused(
    arguments: dict[str, object], message: str
) -> None:
    with pytest.raises(UsageError, match=message):
        view.state_graph(robot(), **arguments)  # type: ignore[arg-type]


def test_a_result_without_a_strategy_is_refused() -> None:
    model = robot()
    result = model.check("Pmax=? [ F at=2 ]")
    with pytest.raises(UsageError, match="no strategy"):
        view.state_graph(model, strategy=result)


def test_random_choices_have_their_probabilities() -> None:
    text = "mdp module m x:[0..2]; [a] x=0 -> (x'=1); [b] x=0 -> (x'=2); [] x>0 -> true; endmodule"
    model = symcheck.loads(text, strategy=True)
    result = model.check("multi(P>=0.25 [ F x=1 ], P>=0.75 [ F x=2 ])")
    picture = view.state_graph(model, strategy=result)
    assert {e.label for e in picture.edges if e.emphasis == "chosen"} >= {"a (0.25)", "b (0.75)"}


def test_labels_inside_a_rank_do_not_end_graphviz() -> None:
    """All states are initial, hence in one rank, and Graphviz 14 fails on labels there."""
    text = "dtmc module m x : [0..40]; [] true -> 0.5:(x'=mod(x+1,41))+0.25:(x'=mod(x+7,41))+0.25:(x'=0); endmodule"
    picture = view.state_graph(symcheck.loads(text + " init true endinit"))
    assert "rank=same" not in picture.dot
    assert picture.svg.count('class="node"') == 41


def size(picture: Picture) -> tuple[float, float]:
    """Width and height in points."""
    found = re.search(r'viewBox="0.00 0.00 ([\d.]+) ([\d.]+)"', picture.svg)
    assert found
    return float(found[1]), float(found[2])


MODELS = Path(__file__).parents[2] / "models"


def test_a_crowded_picture_is_no_column_of_its_states() -> None:
    """All states of the ring are initial, hence in one layer; Graphviz took minutes for labels."""
    picture = view.state_graph(symcheck.load(MODELS / "herman/herman7.pm", engine="explicit"))
    assert len(picture.edges) > 2000
    assert not any("->" in line and "label=" in line for line in picture.dot.splitlines())
    assert "rank=same" not in picture.dot
    width, height = size(picture)
    assert 1 < width / height < 3


def test_a_picture_has_its_layers_in_the_direction_that_fits() -> None:
    def line(n: int) -> Picture:
        text = f"dtmc module m x:[0..{n}]; [] true -> (x'=min(x+1,{n})); endmodule"
        return view.state_graph(symcheck.loads(text))

    assert line(9).sideways  # a line of ten is too high for a window
    assert "rankdir=LR" in line(9).dot
    room = min(WINDOW.width / size(line(9))[0], WINDOW.height / size(line(9))[1])
    down = size(replace(line(9), sideways=False))
    assert room > min(WINDOW.width / down[0], WINDOW.height / down[1])
    assert not line(1).free


def test_grids_of_many_steps_are_drawn_without_layers() -> None:
    """Graphviz took more than a minute for the layers."""
    tandem = symcheck.load(MODELS / "tandem/tandem.sm", {"c": 7})
    picture = view.state_graph(tandem)
    assert picture.free
    assert len(re.findall('class="node"', picture.svg)) == 120


@pytest.mark.parametrize(
    ("name", "around"),
    [("herman/herman7.pm", "x1+x2+x3+x4+x5+x6+x7=0"), ("dining/dining.nm", "p1+p2+p3=0")],
)
def test_the_states_near_others_are_as_many_as_fit_a_window(name: str, around: str) -> None:
    model = symcheck.load(MODELS / name, engine="explicit")
    picture, radius = neighbourhood(model, around)
    states = [n for n in picture.nodes if n.name.startswith("s")]
    assert 6 <= len(states) <= 24
    assert radius >= 1
    assert [n.name for n in states if n.kind == "marked"] == [
        f"s{s.number}" for s in model.where(around)
    ]
    width, height = size(picture)
    assert width <= WINDOW.width
    assert height <= WINDOW.height + 40  # and the legend
    dots = [n.name for n in picture.nodes if n.label == "…"]
    assert len(dots) == len(set(dots)) <= len(states)  # one for the choices of a state


def test_the_likeliest_paths_are_drawn_that_can_be_read() -> None:
    text = "dtmc module m x:[0..40]; [] x<40 -> 0.4:(x'=x+1) + 0.6:(x'=max(0,x-1)); endmodule"
    model = symcheck.loads(text, engine="explicit")
    found = model.check("P<0.9 [ F x=4 ]").counterexample(200)
    picture, count = paths_graph(model, found)
    states = {n.name for n in picture.nodes}
    assert count == 200
    assert states == {f"s{x}" for x in range(5)}  # of the other states, nothing tells
    assert {e.source for e in picture.edges if e.emphasis != "path"} <= {"s4"}  # where they end
    steep = model.check("P<0.9 [ F x=9 ]").counterexample(200)
    small, fewer = paths_graph(model, steep, room=Room(100, 100))
    assert 1 <= fewer <= 200
    assert {f"s{x}" for x in range(10)} == {n.name for n in small.nodes}  # the first one is whole


def test_a_path_with_too_many_states_is_refused() -> None:
    text = "dtmc module m x:[0..300]; [] x<300 -> (x'=x+1); endmodule"
    model = symcheck.loads(text, engine="explicit")
    with pytest.raises(UnsupportedError):
        paths_graph(model, model.check("P<1 [ F x=300 ]").counterexample())


def test_a_large_strategy_is_drawn_near_its_initial_states() -> None:
    model = symcheck.load(MODELS / "dining/dining.nm", strategy=True, engine="explicit")
    strategy = model.check('R{"acts"}min=? [ F "eating" ]').strategy
    picture, count = strategy_graph(strategy)
    assert 6 <= count <= 24 < model.engine.states
    assert sum(n.name.startswith("s") for n in picture.nodes) == count
    assert {e.emphasis for e in picture.edges} >= {"chosen"}
