"""Paths, experiments, pictures and options in the workbench: what its user sees of them."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("selenium", reason="selenium is not installed")

from workbench.conftest import Workbench

QUEUE = """ctmc
module queue
  q : [0..5] init 0;
  up : bool init true;
  [arrive] q<5 -> 2 : (q'=q+1);
  [serve] q>0 & up -> 3 : (q'=q-1);
  [fail] up -> 0.1 : (up'=false);
  [mend] !up -> 0.5 : (up'=true);
endmodule
"""
OFTEN = """P>0.5 [ F<=50 q=5 ];
"""
COIN = """dtmc
const double p;
module coin
  side : [0..2] init 0;
  [] side=0 -> p : (side'=1) + 1-p : (side'=2);
endmodule
"""
HEADS = """const int k;
const int s;
P=? [ F<=k side+s>2 ];
"""
STEPS = """const int T;
"least": Pmin=? [ F "done" ];
"soon": Pmax=? [ F<=T "done" ];
"wrong": Pmin=? [ F<=2-T "done" ];
"""


@pytest.fixture
def given(bench: Workbench) -> Callable[..., None]:
    """Gives values to constants."""

    def give(**values: str) -> None:
        for name, value in values.items():
            bench.fill(f"#constants input[name={name}]", value)

    return give


def opened(bench: Workbench, folder: Path, model: str, properties: str) -> None:
    """Open a new model with its properties."""
    (folder / "new.sm").write_text(model)
    (folder / "new.props").write_text(properties)
    bench.until(lambda: "new.sm" in bench.at("model-file").get_property("textContent"))
    bench.choose("model-file", "new.sm")
    bench.until(lambda: bench.at("properties-tab").text == "new.props")
    bench.until(lambda: "reachable" in bench.at("state").text)


def rows(bench: Workbench) -> list[list[str]]:
    """The cells of the path."""
    return [
        [cell.text for cell in row.find_elements("css selector", "td")]
        for row in bench.all("#sim-path tr")[1:]
    ]


# ------------------------------------------------------------------------------------- simulator


def test_a_path_starts_in_the_state_that_is_written(bench: Workbench, given: Any) -> None:
    given(N="4")
    bench.at("simulator-tab").click()
    for text in ("x=2, lost=true", "x=2 & lost"):
        bench.fill("#sim-from", text)
        bench.click("sim-start")
        assert "Step 0: x=2, lost=true" in bench.at("sim-state").text
    bench.fill("#sim-from", '"done"')  # one reachable state is
    bench.click("sim-start")
    assert "Step 0: x=4, lost=false" in bench.at("sim-state").text
    bench.fill("#sim-from", "x=2")
    bench.click("sim-start")
    assert "2 states satisfy x=2" in bench.at("trouble").text
    bench.fill("#sim-from", "x=9, !lost")
    bench.click("sim-start")
    assert "outside of the range of x, 0 to 4" in bench.at("trouble").text


def test_a_path_runs_until_a_time(bench: Workbench, folder: Path) -> None:
    opened(bench, folder, QUEUE, OFTEN)
    bench.at("simulator-tab").click()
    bench.click("sim-start")
    bench.choose("sim-unit", "time")
    bench.fill("#sim-far", "12.5")
    bench.click("sim-run")
    times = [float(row[2]) for row in rows(bench)]
    assert times[-2] < 12.5 <= times[-1]
    bench.click("sim-run")
    assert "already" in bench.at("trouble").text
    bench.fill("#sim-far", "soon")
    bench.click("sim-run")
    assert "'soon' is not a time" in bench.at("trouble").text


def test_only_what_has_time_runs_until_a_time(bench: Workbench) -> None:
    assert not bench.all("#sim-unit option")[1].is_enabled()


def test_a_click_on_a_row_goes_back_to_its_step(bench: Workbench, folder: Path) -> None:
    opened(bench, folder, QUEUE, OFTEN)
    bench.at("simulator-tab").click()
    bench.click("sim-start", "sim-run")
    before = rows(bench)
    assert len(before) == 21
    cell = bench.all("#sim-path tr")[8].find_elements("css selector", "td")[1]
    bench.run("arguments[0].scrollIntoView({block: 'center'})", cell)
    cell.click()
    bench.until(lambda: "Step 7:" in bench.at("sim-state").text)
    assert rows(bench) == before[:8]
    bench.all("#sim-path button")[2].send_keys("\n")  # by the keyboard
    bench.until(lambda: "Step 2:" in bench.at("sim-state").text)
    bench.click("sim-step")
    assert rows(bench)[:3] == before[:3]


def test_strategies_are_followed_where_a_property_chooses(
    bench: Workbench, folder: Path, given: Any
) -> None:
    given(N="4")
    bench.at("simulator-tab").click()
    assert bench.at("sim-property").is_enabled()
    assert not bench.at("sim-follow").is_enabled()  # there is no path
    bench.click("sim-start")
    assert bench.at("sim-follow").is_enabled()
    opened(bench, folder, QUEUE, OFTEN)
    bench.click("sim-start")
    assert bench.at("sim-run").is_enabled()
    assert not bench.at("sim-property").is_enabled()
    assert not bench.at("sim-follow").is_enabled()


def test_a_path_of_an_earlier_text_goes_back_but_not_on(bench: Workbench, given: Any) -> None:
    given(N="4")
    bench.at("simulator-tab").click()
    bench.click("sim-start", "sim-step")
    onward = ["sim-step", "sim-run", "sim-follow", "sim-graph"]
    others = ["sim-back", "sim-reset", "sim-csv"]
    kept = bench.at("sim-state").text
    bench.at("check-tab").click()
    given(N="5")
    bench.at("simulator-tab").click()
    past = "of the text before the last changes: start a new path"
    bench.until(lambda: bench.at("sim-state").text == f"{kept}; {past}")
    assert not any(bench.at(name).is_enabled() for name in onward)
    assert not any(button.is_enabled() for button in bench.all("#sim-choices button"))
    assert all(bench.at(name).is_enabled() for name in others)
    bench.click("sim-back")
    assert "Step 0: x=0, lost=false" in bench.at("sim-state").text
    assert past in bench.at("sim-state").text
    bench.click("sim-start")
    assert past not in bench.at("sim-state").text
    assert all(bench.at(name).is_enabled() for name in onward)


def test_the_state_of_a_path_has_its_time_where_there_is_time(
    bench: Workbench, folder: Path, given: Any
) -> None:
    given(N="4")
    bench.at("simulator-tab").click()
    bench.click("sim-start", "sim-step")
    assert "time" not in bench.at("sim-state").text
    opened(bench, folder, QUEUE, OFTEN)
    bench.click("sim-start", "sim-run")
    assert f"; time {rows(bench)[-1][2]}" in bench.at("sim-state").text


# ------------------------------------------------------------------------------------ experiments


def run(bench: Workbench, **ranges: str) -> None:
    bench.at("experiment-tab").click()
    for name, text in ranges.items():
        bench.fill(f"#ranges input[name={name}]", text)
    bench.click("experiment-run")
    bench.until(lambda: bench.all("#experiment-chart [aria-label=dot] circle"))


def test_what_does_not_depend_on_the_axis_is_a_level_line(bench: Workbench, folder: Path) -> None:
    (folder / "walk.props").write_text(STEPS)
    bench.until(lambda: bench.all("#ranges input[name=T]"))
    run(bench, N="4", T="1:4")
    assert bench.at("axis").get_property("value") == "T"
    notes = bench.at("experiment-notes").text.splitlines()
    assert notes[0] == "least does not depend on T: level lines"
    heights = {}
    for dot in bench.all("#experiment-chart [aria-label=dot] circle"):
        heights.setdefault(dot.get_attribute("fill"), []).append(dot.get_attribute("cy"))
    assert [len(found) for found in heights.values()].count(4) == 2
    assert any(len(found) == 4 and len(set(found)) == 1 for found in heights.values())


def test_errors_of_single_runs_are_told(bench: Workbench, folder: Path) -> None:
    (folder / "walk.props").write_text(STEPS)
    bench.until(lambda: bench.all("#ranges input[name=T]"))
    run(bench, N="4", T="1:4")
    told = [e.text for e in bench.all("#experiment-notes .bad")]
    assert [text.split(":")[0] for text in told] == ["wrong at N=4, T=3", "wrong at N=4, T=4"]
    assert "2 of them errors" in bench.log


@pytest.mark.parametrize("keep", [False, True])
def test_a_run_that_is_refused_changes_nothing(bench: Workbench, keep: bool) -> None:
    run(bench, N="2:4")
    if keep:
        bench.at("keep").click()
    before = bench.at("experiment-table").text, bench.at("experiment-chart").text
    bench.fill("#ranges input[name=N]", "7:3")
    bench.click("experiment-run")
    assert "the range 'N=7:3' is empty" in bench.at("trouble").text
    assert (bench.at("experiment-table").text, bench.at("experiment-chart").text) == before
    run(bench, N="2:3")
    rows = 4 + 6 * keep
    bench.until(lambda: len(bench.all("#experiment-table tr")) == 1 + rows)
    assert ("run 2" in bench.at("experiment-chart").text) == keep
    assert "run 3" not in bench.at("experiment-chart").text


def test_an_experiment_asks_for_constants_without_a_value(bench: Workbench) -> None:
    bench.at("experiment-tab").click()
    bench.click("experiment-run")
    assert "N has no value: write one into its field" in bench.at("trouble").text
    field = bench.browser.switch_to.active_element
    assert field == bench.all("#ranges input[name=N]")[0]
    field.send_keys("2:4")
    bench.click("experiment-run")
    bench.until(lambda: len(bench.all("#experiment-table tr")) == 7)
    assert not bench.at("trouble").is_displayed()


def test_a_range_with_one_value_is_told(bench: Workbench, folder: Path) -> None:
    (folder / "coin.pm").write_text(COIN)
    bench.until(lambda: "coin.pm" in bench.at("model-file").get_property("textContent"))
    (folder / "walk.props").write_text("P=? [ F side=1 ];")
    bench.choose("model-file", "coin.pm")
    field = bench.until(lambda: bench.all("#ranges input[name=p]")[0])
    assert field.get_attribute("placeholder") == "0.1:0.1:1"
    bench.until(lambda: "side=1" in bench.at("list").get_property("textContent"))
    run(bench, p="0.3:0.7")
    told = (
        "p=0.3 is the only value of 0.3:0.7, whose step is 1: write another step between its ends"
    )
    bench.until(lambda: bench.at("experiment-notes").text == told)
    run(bench, p="0.3:0.2:0.7")
    bench.until(lambda: not bench.at("experiment-notes").text)


@pytest.mark.parametrize("width", [1280, 420])
def test_labels_and_legend_of_a_plot_are_apart(bench: Workbench, width: int) -> None:
    bench.size(width, 720)
    run(bench, N="1:12")  # two properties
    script = """
        const texts = [...document.querySelectorAll('#experiment-chart svg text')];
        const boxes = texts.filter((t) => t.textContent).map((t) => t.getBoundingClientRect());
        return boxes.flatMap((a, i) => boxes.slice(i + 1).filter((b) => a.left < b.right - 1
          && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1)).length"""
    assert bench.run(script) == 0
    assert bench.run("return document.documentElement.scrollWidth") <= width


# --------------------------------------------------------------------------------------- pictures


def fills(bench: Workbench, least: float) -> None:
    """The next picture fills a share of its pane in one direction, and the pane the frame.

    A picture gets its size after it is drawn.
    """
    script = """
        const pane = document.querySelector('.pane').getBoundingClientRect();
        const drawn = document.querySelector('.pane g.graph').getBoundingClientRect();
        const share = Math.max(drawn.width / pane.width, drawn.height / pane.height);
        const isWhole = document.documentElement.scrollHeight <= innerHeight;
        return isWhole && share > arguments[0] && share <= 1.01 && pane.height > 0.6 * innerHeight"""
    bench.until_drawn(lambda: bench.all("g.node") and bench.run(script, least))


def test_pictures_of_paths_and_strategies_fill_their_pane(bench: Workbench, given: Any) -> None:
    given(N="4")
    bench.click("check-all")
    for name, least in (("Why?", 0.4), ("Strategy", 0.8)):  # two states are not made larger
        bench.at("check-tab").click()
        bench.press(name)
        fills(bench, least)


def test_why_tells_what_the_paths_have_and_what_is_missing(bench: Workbench, folder: Path) -> None:
    opened(bench, folder, QUEUE, OFTEN)
    bench.click("check-all")
    bench.press("Why?")
    bench.until(lambda: bench.at("graph-text").is_displayed())
    text = bench.at("graph-text").text
    assert "1000 paths that" in text
    assert "is missing" in text
    assert "together they have probability" in text
    drawn = bench.until_drawn(lambda: bench.at("note").text)
    assert "of 1000 paths are red, none of the others likelier: probability" in drawn


def test_a_value_has_the_same_digits_beside_its_strategy(bench: Workbench, given: Any) -> None:
    given(N="4")
    bench.click("check-all")
    value = bench.until(lambda: len(bench.values) == 2 and bench.values)[0]
    bench.press("Strategy")
    assert bench.until_drawn(lambda: bench.at("note").text).startswith(f"{value} (")


def test_a_strategy_is_saved_as_files_of_the_text_that_it_was_found_in(
    bench: Workbench, given: Any
) -> None:
    given(N="2")
    bench.click("check-all")
    bench.press("Strategy")
    bench.until(lambda: bench.at("graph-text").is_displayed())
    bench.type_at_end("// a note")
    for kind in ("Actions", "Indices", "Induced chain", "DOT"):
        bench.press(kind)
    assert b"(0,false)=risk\n" in bench.downloaded("walk_strategy_actions.txt")
    assert b"0=1\n" in bench.downloaded("walk_strategy_indices.txt")
    for ending in ("tra", "sta", "lab"):
        assert bench.downloaded(f"walk_strategy_induced.{ending}")
    assert bench.downloaded("walk_strategy_dot.dot").startswith(b"digraph")
    bench.press("Draw the model")
    bench.until(lambda: not bench.at("strategy-files").is_displayed())


def test_more_than_ten_series_differ_by_dots_and_dashes_too(bench: Workbench, folder: Path) -> None:
    opened(bench, folder, COIN.replace("const double p", "const double p = 0.5"), HEADS)
    bench.at("experiment-tab").click()
    for name, values in {"k": "0:2", "s": "0:11"}.items():
        bench.fill(f"#ranges input[name={name}]", values)
    bench.click("experiment-run")

    def lines() -> list[Any]:
        return [
            [line.value_of_css_property(p) for p in ("stroke", "stroke-dasharray")]
            for line in bench.all("#experiment-chart [aria-label=line] path")
        ]

    bench.until(lambda: len(lines()) == 12)
    assert len(set(map(tuple, lines()))) == 12
    names = [e.text for e in bench.all("#experiment-chart svg > text")]
    assert names.count("●") == 10
    assert names.count("▲") == 2


# ---------------------------------------------------------------------------------------- options


def test_options_have_the_words_of_the_command_line(bench: Workbench, given: Any) -> None:
    bench.at("options-tab").click()
    titles = [e.text for e in bench.all("#option-fields legend")]
    assert titles == ["How values are computed", "How the model is built"]
    words = bench.at("option-fields").text
    assert "width of the certified interval (default: 1e-6)" in words
    assert "max_iterations" not in words
    bench.at("option-max_iterations").click()
    about = bench.at("option-about").text
    assert about == "Largest number of iterations of one numerical solution. Default: 1000000."
    bench.at("option-exact").click()
    bench.at("check-tab").click()
    given(N="4")
    bench.click("check-all")
    assert bench.until(lambda: len(bench.values) == 2 and bench.values)[0] == "9/16"


def test_options_are_there_again_after_a_reload(bench: Workbench, given: Any) -> None:
    tab = bench.at("options-tab")
    assert tab.text == "Options"
    tab.click()
    bench.at("option-exact").click()
    assert tab.text == "Options ●"
    bench.browser.refresh()
    bench.until(lambda: bench.at("options-tab").text == "Options ●")
    assert "Not the default: " in bench.at("options-tab").get_attribute("title")
    assert bench.at("option-exact").is_selected()
    bench.until(lambda: bench.all("#constants input[name=N]"))
    given(N="4")
    bench.click("check-all")
    assert bench.until(lambda: len(bench.values) == 2 and bench.values)[0] == "9/16"
    bench.at("options-tab").click()
    bench.at("option-exact").click()
    bench.browser.refresh()
    bench.until(lambda: bench.all("#option-fields label"))
    assert bench.at("options-tab").text == "Options"


# -------------------------------------------------------------------------------------- the end


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_the_workbench_without_a_word(
    browser: Any, folder: Path, tmp_path: Path, number: signal.Signals
) -> None:
    words = [sys.executable, "-m", "symcheck", "workbench", "grid.pm", "grid.props", "--no-browser"]
    process = subprocess.Popen(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    bench = Workbench(browser, process.stdout.readline().split()[-1], tmp_path / "downloads")
    bench.press("Check")
    bench.until(lambda: "iteration" in bench.all("#progress output")[0].text)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (0, "")
    browser.get("about:blank")
