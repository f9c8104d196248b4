"""What a page of a model holds, without a browser."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import pytest

import symcheck
from symcheck.errors import NameFault, UnsupportedError, UsageError

pytest.importorskip("pygraphviz", reason="pictures need the extra 'view'")
MODELS = Path(__file__).resolve().parents[2] / "models"


def names(page: Any) -> list[str]:
    return [show["name"] for show in page.data["shows"]]


def test_every_frame_refers_to_what_is_there() -> None:
    model = symcheck.load(MODELS / "dining/dining.nm")
    data = model.page('Pmin=? [ F<=5 "eating" ]\nPmax=? [ !"eating" U p1=3 ]').data
    graphs, states = len(data["graphs"]), len(data["model"]["ids"])
    for show in data["shows"]:
        for frame in show["frames"]:
            assert all(0 <= g < graphs for g in frame.get("panes", show.get("panes", ())))
            for graph, _, nodes in frame.get("marks", ()):
                svg = data["graphs"][graph]
                assert all(f"<title>{node}</title>" in svg for node in nodes)
            assert {len(frame[k]) for k in ("low", "high") if k in frame} <= {states}
    assert {"prob0", "prob1", "Interval iteration"} <= set(names(model.page("Pmax=? [ F p1=5 ]")))


def test_values_strategies_and_bounds_are_those_of_the_library() -> None:
    text = """mdp module m x : [0..3]; [a] x=0 -> 0.4:(x'=1)+0.6:(x'=2); [b] x=0 -> 0.7:(x'=3)+0.3:(x'=2);
        [c] x=3 -> 0.5:(x'=1)+0.5:(x'=2); [] x=1|x=2 -> true; endmodule"""
    page = symcheck.loads(text).page("Pmax=? [ F x=1 ]")
    by_name = {show["name"]: show["frames"] for show in page.data["shows"]}
    assert by_name["Values"][0]["low"] == pytest.approx([0.4, 1, 0, 0.5])
    last = by_name["Interval iteration"][-1]
    assert all(
        a <= v + 1e-4 and v <= b + 1e-4
        for a, v, b in zip(last["low"], [0.4, 1, 0, 0.5], last["high"], strict=True)
    )
    (strategy,) = page.data["model"]["strategies"]
    row = {r for r, action, _ in page.data["model"]["rows"][0] if action == "a"}
    assert {strategy["rows"][0]} == row
    assert by_name["Policy iteration"][-1]["low"] == pytest.approx([0.4, 1, 0, 0.5])
    # the policy: the best choices of the unknown states 0 and 3
    assert set(by_name["Policy iteration"][-1]["rows"]) == {
        strategy["rows"][0],
        strategy["rows"][3],
    }


def test_the_reachability_frames_cover_all_states() -> None:
    page = symcheck.load(MODELS / "die/die.pm").page()
    frames = next(s for s in page.data["shows"] if s["name"].startswith("Reach"))["frames"]
    found = [
        n
        for f in frames
        for g, mark, nodes in f["marks"]
        if mark == "new" and g == page.data["states"]
        for n in nodes
    ]
    assert sorted(found) == sorted(f"s{i}" for i in range(13))


def test_a_large_model_is_shown_in_part() -> None:
    text = "dtmc module m x : [0..9999]; [] x<9999 -> 0.5:(x'=x+1)+0.5:true; [] x=9999 -> true; endmodule"
    page = symcheck.loads(text).page("P=? [ F x=9999 ]", max_states=50)
    data = page.data
    assert (
        data["graphs"][data["states"]].count('class="node"') == 51
    )  # with the dots behind the last
    assert data["model"]["ids"] == list(range(500))
    assert data["model"]["rows"][499] == [[499, "", [[499, 0.5], [-1, 0.5]]]]
    assert "50 states of 10,000" in dict(data["facts"])["left out"]
    assert data["properties"][0]["value"] == "1.0"


def test_a_page_of_500_states_is_small() -> None:
    model = symcheck.load(MODELS / "crowds/crowds.pm", "CrowdSize=5,TotalRuns=3")
    page = model.page('P=? [ F "exposed" ]')
    assert len(page.data["model"]["ids"]) == 500
    assert len(page.html.encode()) < 5e6


def test_models_without_diagrams_have_pages(tmp_path: Path) -> None:
    text = "dtmc module m x : int init 0; [] x<3 -> 0.5:(x'=x+1)+0.5:(x'=0); [] x>=3 -> true; endmodule"
    page = symcheck.loads(text).page("P=? [ F x=3 ]")
    assert "Diagrams" in names(page)
    assert "Interval iteration" in names(page)


def test_a_model_without_commands_has_all_but_their_construction(tmp_path: Path) -> None:
    die = symcheck.load(MODELS / "die/die.pm")
    symcheck.export(die, f"{tmp_path}/die.all")
    imported = symcheck.load_explicit(f"{tmp_path}/die.all").page("P=? [ F d=6 ]")
    of_text = names(die.page("P=? [ F d=6 ]"))
    assert names(imported) == [name for name in of_text if not name.startswith("Construction")]
    assert imported.data["text"] == ""
    stages = {
        s["name"]: s["frames"]
        for s in symcheck.quotient(die, labels={"six": "d=6"}).page('P=? [ F "six" ]').data["shows"]
    }
    reached = {
        node
        for _, _, nodes in stages["Reachability, frontier by frontier"][-1]["marks"]
        for node in nodes
        if node.startswith("s")
    }
    assert len(reached) == 5


def test_rationals_and_infinity() -> None:
    page = symcheck.load(MODELS / "die/die.pm", exact=True).page('R{"tosses"}=? [ F d=6 ]')
    low = next(s for s in page.data["shows"] if s["name"] == "Values")["frames"][0]["low"]
    assert "∞" in low
    assert all(x == "∞" or math.isfinite(x) for x in low)
    assert "∞" in page.html  # JSON has no infinity, and the page would not be written


def test_what_cannot_be_shown_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = symcheck.load(MODELS / "die/die.pm")
    page = model.page("const int k; P=? [ F d=k ]", "k=3")
    assert page.data["properties"][0]["value"].startswith("0.1666")
    with pytest.raises(UsageError, match="cannot write"):
        page.save(tmp_path / "missing" / "die.html")
    page = model.page(["P=? [ F d=nought ]", "P=? [ F d=1 ]"])
    assert [p["value"] == "error" for p in page.data["properties"]] == [True, False]
    monkeypatch.setitem(sys.modules, "pygraphviz", None)
    with pytest.raises(UnsupportedError, match="pip install"):
        model.page()


def test_a_page_says_what_it_is() -> None:
    page = symcheck.load(MODELS / "die/die.pm").page()
    assert repr(page) == "<Page: die.pm, 8 pictures and players>"
    assert page._repr_html_().startswith("<iframe")
    assert (
        symcheck.loads("dtmc module m x:[0..1]; [] true -> (x'=1-x); endmodule")
        .page()
        .data["title"]
        == "m"
    )
    with pytest.raises(NameFault):
        symcheck.loads("dtmc module m x:[0..y]; endmodule").page()


def test_long_traces_lose_their_middle() -> None:
    text = "dtmc module m x : [0..400]; [] x<400 -> (x'=x+1); [] x=400 -> true; endmodule"
    page = symcheck.loads(text).page("P=? [ F x=400 ]", max_states=20)
    shows = {s["name"]: s for s in page.data["shows"]}
    for name in ("Reachability, frontier by frontier", "prob0"):
        assert len(shows[name]["frames"]) == 150
        assert "frames in the middle are left out" in shows[name]["note"]
