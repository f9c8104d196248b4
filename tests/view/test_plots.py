"""Plots show the numbers that they were given; without matplotlib they say what to install."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

import symcheck
from symcheck import teach, view
from symcheck.errors import UnsupportedError
from symcheck.numerics.linear.problem import Progress
from symcheck.options import Options
from symcheck.symbolic.build import construct
from symcheck.symbolic.model import Iteration

matplotlib = pytest.importorskip("matplotlib", reason="plots need the extra 'plot'")
matplotlib.use("Agg")

MODELS = Path(__file__).resolve().parents[2] / "models"
ITERATIONS = [Iteration(i, 2**i, 10 + i, 2 ** max(0, i - 1), 5 + i, 0.1 * i) for i in range(4)]


@pytest.fixture(autouse=True)
def _closed() -> object:
    yield
    from matplotlib import pyplot

    pyplot.close("all")


def test_search() -> None:
    axes = view.plot_search([*ITERATIONS, Iteration(4, None, None, None, None, 1.0)])
    assert axes.lines[0].get_ydata().tolist() == [10, 11, 12, 13]
    assert axes.lines[1].get_ydata().tolist() == [5, 6, 7, 8]
    right = next(a for a in axes.figure.axes if a is not axes)
    assert right.lines[0].get_ydata().tolist() == [1, 2, 4, 8]


def test_bounds() -> None:
    steps = [
        Progress("interval", i, 0.0, 2, np.array([0.0, i / 10]), np.array([1.0, 1 - i / 10]))
        for i in range(1, 4)
    ]
    axes = view.plot_bounds(steps, 1, truth=0.4)
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_allclose(lines["lower bound"].get_ydata(), [0.1, 0.2, 0.3])
    np.testing.assert_allclose(lines["upper bound"].get_ydata(), [0.9, 0.8, 0.7])
    estimates = view.plot_bounds([Progress("power", 1, 0.0, 1, np.array([0.5]))])
    assert [line.get_label() for line in estimates.lines] == ["iterate"]


def test_blocks_orders_and_pictures() -> None:
    made = construct(
        symcheck.bind(symcheck.parse_model_file(MODELS / "herman/herman7.pm")), Options()
    )
    seen = teach.block_structure(made, budget=1)
    assert len(view.plot_blocks(seen).patches) == len(seen.occurrences)
    many = dataclasses.replace(seen, occurrences=np.zeros((20_001, 4), np.int64))
    with pytest.raises(UnsupportedError, match="smaller model"):
        view.plot_blocks(many)
    frames = list(
        teach.compare_orders(
            symcheck.bind(symcheck.parse_model_file(MODELS / "die/die.pm")), Options()
        )
    )
    assert [t.get_text() for t in view.plot_orders(frames).get_yticklabels()] == ["s < d", "d < s"]
    picture = view.picture(made.space.states, made.space.symbolic.encoding, title="all")
    axes = picture.draw()
    assert axes.images[0].get_array().shape[:2] > (20, 20)


def test_missing_matplotlib_is_said_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for plot in (
        lambda: view.plot_search(ITERATIONS),
        lambda: view.Picture("", (), (), ()).draw(),
    ):
        with pytest.raises(UnsupportedError, match=r"pip install 'symcheck\[plot\]'"):
            plot()


def test_tables() -> None:
    model = symcheck.load(MODELS / "die/die.pm")
    table = view.results([(f, model.check(f)) for f in ("P=? [ F d=6 ]", "P>1/6 [ F d=6 ]")])
    assert str(table).splitlines()[2] == "P>1/6 [ F d=6 ]  false                exact"
    assert "<td>P&gt;1/6 [ F d=6 ]</td><td>false</td>" in table._repr_html_()


def test_a_distribution_is_plotted_with_its_bounds() -> None:
    model = symcheck.loads("ctmc module m x : [0..3]; [] x<3 -> 1:(x'=x+1); endmodule")
    axes = model.transient(1.0).plot()
    assert [t.get_text() for t in axes.get_yticklabels()] == [f"x={i}" for i in range(4)]
    assert [p.get_width() for p in axes.patches] == pytest.approx(list(model.transient(1.0).values))
    few = model.transient(1.0).plot(most=2)
    assert [t.get_text() for t in few.get_yticklabels()] == ["x=0", "x=1"]
    assert few.get_xlabel() == "probability: the 2 largest"


def test_a_pareto_front_is_plotted() -> None:
    model = symcheck.loads("mdp module m x : [0..2]; [] x=0 -> (x'=1); [] x=0 -> (x'=2); endmodule")
    front = model.check("multi(Pmax=? [ F x=1 ], Pmax=? [ F x=2 ])").front
    axes = front.plot()
    (line,) = axes.lines
    assert sorted(map(tuple, line.get_xydata().tolist())) == [(0.0, 1.0), (1.0, 0.0)]
    assert "F x=1" in axes.get_xlabel()


def test_the_states_of_bars_are_texts_of_the_language() -> None:
    model = symcheck.loads(
        "dtmc module m b : bool; [] true -> 0.5 : (b'=!b) + 0.5 : true; endmodule"
    )
    names = [t.get_text() for t in model.steady_state().plot().get_yticklabels()]
    assert names == ["b=false", "b=true"]
