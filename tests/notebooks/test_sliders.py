"""Sliders for constants: what is shown when one is moved."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

pytest.importorskip("ipywidgets", reason="the extra notebook is not installed")

from ipywidgets import HTML

import symcheck
from symcheck.api.arguments import properties_file
from symcheck.errors import SyntaxFault, UsageError
from symcheck.notebook import Sliders, constant_sliders, sliders

WALK = """dtmc
const double p;
const int N;
module walk
  x : [0..N] init 1;
  [] x>0 & x<N -> p : (x'=x+1) + 1-p : (x'=x-1);
  [] x=0 | x=N -> true;
endmodule
"""
WON = "P=? [ F x=N ]"


def shown(widget: Sliders) -> str:
    """The text of the tables and messages."""
    return " ".join(w.value for w in widget.children if isinstance(w, HTML))


def pictures(widget: Sliders) -> list[bytes]:
    return [bytes(image.value) for image in widget.children[-1].children]


def test_the_values_are_those_at_the_positions() -> None:
    widget = sliders(WALK, WON, p=(0, 1, 0.25), N=(2, 4))
    assert widget.inputs["p"].options == ("0.0", "0.25", "0.5", "0.75", "1.0")
    assert widget.positions == {"p": "0.5", "N": "3"}
    assert float(widget.results[0].value) == pytest.approx(1 / 3)
    assert "0.3333333333333" in shown(widget)
    assert "exact up to rounding" in shown(widget)
    widget.inputs["N"].value = "2"
    assert widget.results[0].value == 0.5
    assert "<td>0.5</td>" in shown(widget)
    widget.inputs["p"].value = "0.25"
    assert widget.results[0].value == 0.25


def test_twenty_steps_lead_to_the_end() -> None:
    texts = sliders(WALK, WON, p=(0.1, 0.3), N=[2]).inputs["p"].options
    assert (len(texts), texts[1], texts[-1]) == (21, "0.11", "0.3")


def test_no_slider_sends_what_it_passes() -> None:
    widget = sliders(WALK, WON, p=(0.1, 0.9), N=(2, 4))
    assert [s.continuous_update for s in widget.inputs.values()] == [False, False]


def test_models_are_files_texts_and_loaded_with_positions_to_begin_with(tmp_path: Path) -> None:
    path = tmp_path / "walk.pm"
    path.write_text(WALK)
    properties = tmp_path / "walk.pctl"
    properties.write_text(f"const int k; {WON}; P=? [ F<=k x=N ]")
    widget = sliders(path, properties, p=(0.1, 0.9), N=[2, 9], k="1:2:5")
    assert widget.inputs["k"].options == ("1", "3", "5")
    assert [row.value for row in widget.results] == [
        pytest.approx(float(symcheck.load(path, {"p": 0.5, "N": 9}).check(WON))),
        0,
    ]
    model = symcheck.loads(WALK, {"p": 0.5, "N": 3})
    assert sliders(model, WON, N=(2, 9)).positions == {"N": "3"}
    assert sliders(model.with_options(exact=True), WON, N=(2, 9)).results[0].text == "1/3"
    assert sliders(model, WON, options={"exact": True}, N=(2, 9)).results[0].text == "1/3"


def test_a_truth_value_has_two_positions() -> None:
    text = "dtmc const bool fair; module m x:[0..1]; [] true -> (fair?0.5:1):(x'=1) + (fair?0.5:0):(x'=0); endmodule"
    widget = sliders(text, "P=? [ X x=1 ]", across="fair", fair=None)
    assert widget.inputs["fair"].options == ("false", "true")
    assert widget.results[0].value == 0.5
    widget.inputs["fair"].value = "false"
    assert widget.results[0].value == 1
    assert [row.value for row in widget.curve] == [1, 0.5]


def test_a_curve_over_a_constant_is_computed_again_if_another_one_moves() -> None:
    widget = sliders(WALK, WON, across="p", p=(0.25, 0.75, 0.25), N=(2, 4))
    (first,) = pictures(widget)
    curve = widget.curve
    assert [float(row.value) for row in curve] == pytest.approx([1 / 13, 1 / 3, 9 / 13])
    assert b"<svg" in first
    widget.inputs["p"].value = "0.75"
    assert widget.curve is curve
    assert pictures(widget) != [first]  # the line at the position has moved
    widget.inputs["N"].value = "2"
    assert [float(row.value) for row in widget.curve] == pytest.approx([0.25, 0.5, 0.75])


def test_a_curve_has_few_points_and_both_ends() -> None:
    widget = sliders(WALK, WON, across="p", p=(0, 1, 0.001), N=[2])
    points = [float(row.constants["p"]) for row in widget.curve]
    assert 20 < len(points) <= 42
    assert (points[0], points[-1]) == (0, 1)


def test_a_curve_that_takes_too_long_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(constant_sliders, "_PATIENCE", 0.0)
    model = symcheck.loads(WALK, {"p": 0.5, "N": 2})
    widget = Sliders(model, properties_file(WON), {"p": (0.1, 0.9), "N": [2, 3]}, across="p")
    assert widget.results[0].value is not None
    assert len(widget.curve) == 1
    assert "the curve has 1 point" in widget.message
    assert "the curve has 1 point" in shown(widget)


def test_the_state_graph_is_that_of_the_positions() -> None:
    widget = sliders(WALK, WON, graph=True, p=[0.5], N=(2, 4))
    (first,) = pictures(widget)
    assert first.count(b'class="node') == 4
    widget.inputs["N"].value = "4"
    assert pictures(widget)[0].count(b'class="node') == 5


def test_faults_are_messages() -> None:
    widget = sliders(WALK, f"{WON}; P=? [ F y=1 ]", p=[0.5, 2], N=(2, 4))
    assert "probabilit" in shown(widget)
    widget.inputs["p"].value = "0.5"
    assert "unknown name y" in shown(widget)
    assert float(widget.results[0].value) == pytest.approx(1 / 3)
    assert "no value is given for N" in shown(sliders(WALK, WON, p=(0, 1)))
    large = sliders(WALK, WON, graph=True, p=[0.5], N=[3, 500])
    assert "the picture would have 501 states" in large.message
    assert "the picture would have 501 states" in shown(large)
    assert large.results[0].error is None
    large.inputs["N"].value = "3"
    assert large.message == ""
    assert "the picture" not in shown(large)


def test_faulty_arguments_are_told_at_once() -> None:
    with pytest.raises(UsageError, match="there is no constant q"):
        sliders(WALK, WON, q=(0, 1))
    with pytest.raises(UsageError, match="across='M': there is no such slider"):
        sliders(WALK, WON, across="M", p=(0, 1), N=(2, 4))
    with pytest.raises(UsageError, match=r"expected \(low, high\)"):
        sliders(WALK, WON, p=(0, 1, 0.1, 4), N=(2, 4))
    with pytest.raises(UsageError, match="p=None: it is no constant that is true or false"):
        sliders(WALK, WON, p=None, N=(2, 4))
    with pytest.raises(UsageError, match="N: 9,999 positions"):
        sliders(WALK, WON, p=[0.5], N=(2, 10_000))
    with pytest.raises(
        UsageError, match=r"the constant c has a value in the text[^$]*const int c;"
    ):
        sliders("dtmc const int c = 1; module m x:[0..c]; endmodule", "P=? [ F x=1 ]", c=(1, 2))
    with pytest.raises(SyntaxFault):
        sliders(WALK, "P=? [ F ]", p=(0, 1), N=(2, 4))


def test_movements_that_come_together_are_checked_once() -> None:
    """As in a kernel, whose loop reads what was moved while a check was running."""

    async def moved() -> tuple[list[str], Sliders]:
        widget = sliders(WALK, WON, p=(0.1, 0.9), N=(2, 9))
        seen: list[str] = []
        plain = widget.refresh

        def counting() -> None:
            plain()
            seen.append(widget.positions["N"])

        widget.refresh = counting
        for n in range(2, 10):
            widget.inputs["N"].value = str(n)
            await asyncio.sleep(0)
        while not seen:
            await asyncio.sleep(0.1)
        await asyncio.sleep(0.5)  # and not again
        return seen, widget

    seen, widget = asyncio.run(moved())
    assert seen == ["9"]
    assert widget.results[0].constants["N"] == 9
