"""Pictures of diagrams against the functions that they show: following edges by values must give the function's value."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

import symcheck
from symcheck import view
from symcheck.errors import UnsupportedError, UsageError
from symcheck.options import Options
from symcheck.symbolic.build import construct
from symcheck.symbolic.model import Transitions

MODEL = """dtmc
module m
  x : [2..7] init 2;
  b : bool init false;
  [] x<7 -> 0.25 : (x'=x+1) + 0.75 : (b'=!b);
  [] x=7 -> true;
endmodule
"""


@pytest.fixture(scope="module")
def made() -> Transitions:
    return construct(symcheck.bind(symcheck.parse_model(MODEL)), Options())


def test_reachable_states_are_drawn_by_values(made: Transitions) -> None:
    picture = view.picture(made.space.states, made.space.symbolic.encoding)
    assert [n.label for n in picture.nodes if n.kind == "row"] == ["x\n2..7"]  # b is free
    assert [(e.label, e.dashed) for e in picture.edges] == [("2..7", False)]
    assert [n.label for n in picture.nodes if n.kind == "leaf"] == ["true"]


def test_following_the_edges_gives_the_matrix(made: Transitions) -> None:
    encoding = made.space.symbolic.encoding
    assert made.matrix is not None
    picture = view.picture(made.matrix, encoding)
    labels = {n.name: n.label for n in picture.nodes}
    paths: set[tuple[str, ...]] = set()

    def follow(name: str, path: tuple[str, ...]) -> None:
        out = [e for e in picture.edges if e.source == name]
        if not out:
            paths.add((*path, labels[name]))
        for e in out:
            follow(e.target, (*path, e.label))

    follow(picture.nodes[0].name, ())
    assert paths == {
        ("2..6 unchanged", "false → true; true → false", "0.75"),
        ("2..6: +1", "false, true unchanged", "0.25"),
        ("7 stays", "false, true unchanged", "1"),
    }


def test_bits_have_row_and_column_nodes(made: Transitions) -> None:
    encoding = made.space.symbolic.encoding
    assert made.matrix is not None
    picture = view.picture(made.matrix, encoding, bits=True)
    assert len(picture.nodes) == made.matrix.node_count - 1  # the leaf 0 is left out
    assert {n.label for n in picture.nodes if n.kind == "column"} <= {
        "x'\n+4",
        "x'\n+2",
        "x'\n+1",
        "b'",
    }
    assert any(e.dashed for e in picture.edges)
    assert any(not e.dashed for e in picture.edges)


def test_constants_are_single_leaves(made: Transitions) -> None:
    manager, encoding = made.space.symbolic.manager, made.space.symbolic.encoding
    for bits in (False, True):
        for diagram, label in (
            (manager.true, "true"),
            (manager.false, "false"),
            (manager.constant(2.5), "2.5"),
        ):
            picture = view.picture(diagram, encoding, bits=bits)
            assert ([n.label for n in picture.nodes], picture.edges) == ([label], ())


def test_a_column_set_has_column_nodes(made: Transitions) -> None:
    encoding = made.space.symbolic.encoding
    update = made.space.symbolic.events[0].participants[0][0].updates[0]
    states = update.relation.exists(made.space.symbolic.manager.cube(encoding.rows))
    picture = view.picture(states, encoding)
    assert {n.kind for n in picture.nodes} == {"column", "leaf"}
    assert picture.nodes[0].label == "x'\n3..7"


def test_bits_that_are_not_neighbours_are_drawn_one_by_one() -> None:
    made = construct(symcheck.bind(symcheck.parse_model(MODEL)), Options())
    manager, encoding = made.space.symbolic.manager, made.space.symbolic.encoding
    assert made.matrix is not None
    order = sorted(encoding.bits, key=lambda bit: (bit.split(".")[1], bit))
    manager.reorder(order)
    picture = view.picture(made.matrix, encoding)
    assert {n.kind for n in picture.nodes} == {"row", "column", "leaf"}


@pytest.mark.parametrize("bits", [False, True])
def test_a_large_diagram_is_refused(made: Transitions, bits: bool) -> None:
    assert made.matrix is not None
    with pytest.raises(UnsupportedError, match="max_nodes"):
        view.picture(made.matrix, made.space.symbolic.encoding, bits=bits, max_nodes=3)


def test_dot_and_svg_name_every_node(made: Transitions) -> None:
    assert made.matrix is not None
    encoding = made.space.symbolic.encoding
    picture = view.picture(made.matrix, encoding, title='the "matrix"')
    text = view.dot(made.matrix, encoding, title='the "matrix"')
    assert text == picture.dot
    assert text.startswith('digraph "the \\"matrix\\"" {')
    assert len(re.findall(r"^  \"n\d+\" \[", text, re.MULTILINE)) == len(picture.nodes)
    assert text.count(' -> "n') == len(picture.edges)
    assert "0x" not in text
    root = ElementTree.fromstring(picture._repr_svg_())
    texts = [t.text for t in root.iter("{http://www.w3.org/2000/svg}text")]
    assert all(line in texts for n in picture.nodes for line in n.label.split("\n"))


def test_pictures_are_saved_by_their_extension(made: Transitions, tmp_path: Path) -> None:
    picture = view.picture(made.space.states, made.space.symbolic.encoding)
    for extension, start in ((".svg", b"<?xml"), (".png", b"\x89PNG"), (".pdf", b"%PDF")):
        path = tmp_path / f"states{extension}"
        picture.save(path)
        assert path.read_bytes().startswith(start)
    picture.save(tmp_path / "states.dot")
    assert (tmp_path / "states.dot").read_text() == picture.dot
    with pytest.raises(UsageError, match=r"cannot be saved as '.gif'"):
        picture.save(tmp_path / "states.gif")


def test_pictures_say_what_to_install(made: Transitions, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = view.picture(made.space.states, made.space.symbolic.encoding)
    monkeypatch.setitem(sys.modules, "pygraphviz", None)
    with pytest.raises(UnsupportedError, match=r"pip install 'symcheck\[view\]'"):
        picture.save("states.svg")


def test_legends_say_what_edges_mean(made: Transitions) -> None:
    states, encoding = made.space.states, made.space.symbolic.encoding
    assert "dashed edge: 0" in view.picture(states, encoding, bits=True).dot
    assert "labelled with values" in view.picture(states, encoding).dot


def test_models_are_drawn_without_an_encoding() -> None:
    model = symcheck.loads(MODEL)
    made = construct(model.bound, Options())
    states, encoding = made.space.states, made.space.symbolic.encoding
    assert made.matrix is not None
    assert view.picture(model, part="states").dot == view.picture(states, encoding).dot
    assert view.picture(model, bits=True).dot == view.picture(made.matrix, encoding, bits=True).dot
    with pytest.raises(UsageError, match="with its encoding"):
        view.picture(states)


def test_legends_count_nodes(made: Transitions) -> None:
    encoding = made.space.symbolic.encoding
    assert made.matrix is not None
    picture = view.picture(made.matrix, encoding, bits=True)
    count = made.matrix.node_count
    assert f"{count - 1} nodes are drawn; {count} are in memory" in picture.legend
    assert "no complement edges" in picture.legend


def test_pictures_zoom_in_notebooks(made: Transitions) -> None:
    html = view.picture(made.space.states, made.space.symbolic.encoding)._repr_html_()
    assert html.startswith("<iframe")
    assert "Zoom in" in html


@pytest.mark.parametrize("engine", ["explicit", "mtbdd"])
def test_a_set_of_states_is_drawn(engine: str) -> None:
    model = symcheck.loads(MODEL, engine=engine)  # type: ignore[arg-type]
    picture = view.picture(model.where("x>=6 & b"))
    assert [n.label for n in picture.nodes] == ["x\n6, 7", "b\ntrue", "true"]


def test_a_model_without_commands_is_drawn() -> None:
    rows = [[0, 1, 0], [0.5, 0, 0.5], [0, 0, 1]]
    model = symcheck.from_matrix(rows)
    edges = [e.label for e in view.picture(model).edges]
    assert sorted(edges) == ["0 → 1; 2 → 2", "1 → 0, 2"]
    assert [n.label for n in view.picture(model, part="states").nodes] == ["s\n0..2", "true"]
    with pytest.raises(UsageError, match="model without commands"):
        view.picture(model.where("s=1"))
    on_diagrams = model.with_options(engine="mtbdd").where("s=1")
    assert [n.label for n in view.picture(on_diagrams).nodes] == ["s\n1", "true"]
