"""The workbench in a browser, from opening to reloading."""

from __future__ import annotations

import csv
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from workbench.conftest import MODEL, Workbench, put


def texts(rows: list[Any]) -> list[list[str]]:
    return [row.text.split() for row in rows]


def given(bench: Workbench, n: str) -> None:
    bench.fill("#constants input[name=N]", n)


def test_a_check_has_its_value_accuracy_and_verdict(bench: Workbench) -> None:
    given(bench, "4")
    bench.click("check-all")
    value, verdict = bench.until(lambda: len(bench.values) == 2 and bench.values)
    assert float(value) == pytest.approx(0.75**2)
    assert verdict == "✗ false"
    assert "exact" in bench.all("#list .of")[0].text
    given(bench, "5")
    bench.until(lambda: "before the last changes" in bench.all("#list .of")[0].text)


def test_an_error_is_seen_while_typing_and_mended(bench: Workbench, folder: Path) -> None:
    bench.type_at_end('label "far" = y>3;')
    bench.until(lambda: "unknown name y" in bench.at("state").text)
    bench.until(lambda: [e.text for e in bench.all("#model .cm-lintRange-error")] == ["y"])
    bench.type_at_end(Keys.BACKSPACE * 4 + "x>3;")
    bench.until(lambda: not bench.all("#model .cm-lintRange-error"))
    bench.until(lambda: bench.at("model-tab").text == "● walk.nm")
    assert (folder / "walk.nm").read_text() == MODEL
    bench.with_control("s")
    bench.until(lambda: bench.at("model-tab").text == "walk.nm")
    assert (folder / "walk.nm").read_text() == MODEL + 'label "far" = x>3;'


def test_a_fault_that_only_states_show_is_underlined(bench: Workbench) -> None:
    given(bench, "4")
    bench.type_at_end("module n z : [0..1]; [] true -> 0.5 : (z'=1); endmodule")
    bench.until(lambda: "sum" in bench.at("state").text)
    bench.until(lambda: bench.all("#model .cm-lintRange-error"))


def test_words_are_completed_and_explained(bench: Workbench) -> None:
    bench.type_at_end('label "z" = lo')
    bench.until(lambda: bench.all(".cm-completionLabel")[0].text == "lost")
    ActionChains(bench.browser).send_keys(Keys.ESCAPE).perform()
    name = bench.until(lambda: bench.named("#model .k-variable", "lost")[0])
    ActionChains(bench.browser).move_to_element(name).perform()
    bench.until(lambda: "variable of module m" in bench.all(".help")[0].text)


def test_a_check_is_cancelled_while_text_is_typed(bench: Workbench) -> None:
    bench.choose("model-file", "grid.pm")  # and its properties
    bench.until(lambda: bench.at("properties-tab").text == "grid.props")
    bench.until(lambda: "10,000 reachable" in bench.at("state").text)
    bench.press("Check")
    bench.until(lambda: "iteration" in bench.all("#progress output")[0].text)
    bench.type_at_end("formula f = q;")
    bench.until(lambda: "unknown name q" in bench.at("state").text, 5)
    assert bench.all("#progress .bar")
    bench.press("Cancel")
    bench.until(lambda: "cancelled" in bench.all("#list .of")[0].text)
    bench.type_at_end(Keys.BACKSPACE * 14)
    bench.until(lambda: "10,000 reachable" in bench.at("state").text)
    bench.click("build")  # by a new process
    bench.until(lambda: "40,000" in bench.at("facts").text)


def test_a_check_that_fails_after_the_text_has_changed_is_told(
    bench: Workbench, process: subprocess.Popen[str]
) -> None:
    bench.choose("model-file", "grid.pm")
    bench.until(lambda: bench.at("properties-tab").text == "grid.props")
    bench.until(lambda: "10,000 reachable" in bench.at("state").text)
    bench.press("Check")
    bench.until(lambda: "iteration" in bench.all("#progress output")[0].text)
    bench.type_at_end("// a note")
    subprocess.run(["pkill", "-KILL", "-P", str(process.pid)], check=True)
    bench.until(lambda: "the process of this job was ended" in bench.at("trouble").text)


def test_the_properties_of_a_model_are_opened_with_it(bench: Workbench) -> None:
    bench.choose("model-file", "grid.pm")
    bench.until(lambda: bench.at("properties-tab").text == "grid.props")
    bench.until(lambda: "home" in bench.at("list").text)


def test_what_is_missing_and_what_is_wrong_stands_where_it_is_asked(bench: Workbench) -> None:
    bench.at("check-all").click()
    bench.until(lambda: "N has no value" in bench.at("trouble").text)
    assert bench.browser.switch_to.active_element.get_attribute("name") == "N"
    given(bench, "4")
    bench.at("graph-tab").click()
    bench.fill("#around", "xx=2")
    bench.click("draw-near")
    bench.until(lambda: "did you mean x?" in bench.at("trouble").text)
    bench.press("✕")
    bench.until(lambda: not bench.at("trouble").is_displayed())


def test_a_faulty_model_is_not_asked_for_the_constants_of_the_one_before(
    bench: Workbench, folder: Path
) -> None:
    put(folder / "faulty.nm", "hello")
    bench.until(lambda: "faulty.nm" in bench.at("model-file").get_property("textContent"))
    bench.choose("model-file", "faulty.nm")
    bench.until(lambda: "unexpected" in bench.at("state").text)
    assert not bench.all("#constants input")
    bench.click("check-all")
    bench.until(lambda: "unexpected" in bench.all("#list .bad")[0].text)


def test_a_neighbourhood_of_10_000_states_is_drawn(bench: Workbench) -> None:
    bench.choose("model-file", "grid.pm")
    bench.until(lambda: bench.at("properties-tab").text == "grid.props")
    bench.choose("properties-file", "")
    bench.until(lambda: "10,000 reachable" in bench.at("state").text)
    bench.at("simulator-tab").click()
    bench.click("sim-start", "sim-step", "sim-graph")
    assert 6 <= len(bench.until_drawn(lambda: bench.all("g.node"))) <= 48  # 24 states, and dots
    bench.click("draw")
    bench.until_drawn(
        lambda: "60 states of 10,000" in bench.at("note").text or "60" in bench.at("caption").text
    )


def test_an_experiment_is_plotted_zoomed_and_saved(bench: Workbench) -> None:
    bench.at("experiment-tab").click()
    bench.fill("#ranges input[name=N]", "1:6")
    bench.choose("experiment-property", "0")
    bench.click("experiment-run")
    bench.until(lambda: len(bench.all("#experiment-chart [aria-label=dot] circle")) == 6)

    def ticks() -> list[str]:
        return [e.text for e in bench.all("#experiment-chart [aria-label^='x-axis tick l'] text")]

    bench.until(lambda: ticks() == ["1", "2", "3", "4", "5", "6"])
    bench.press("Zoom in")
    bench.until(lambda: "1" not in ticks())
    bench.press("Whole")
    bench.until(lambda: ticks() == ["1", "2", "3", "4", "5", "6"])
    for kind in ("CSV", "SVG", "PNG"):
        bench.press(kind)
    head, *rows = csv.reader(bench.downloaded("experiment.csv").decode().splitlines())
    assert head[:3] == ["property", "N", "value"]
    assert [float(row[2]) for row in rows] == pytest.approx(
        [0.75 ** ((n + 1) // 2) for n in range(1, 7)]
    )
    assert bench.downloaded("experiment.svg").startswith(b"<svg")
    assert bench.downloaded("experiment.png").startswith(b"\x89PNG")


def test_a_path_is_stepped_followed_and_taken_back(bench: Workbench) -> None:
    given(bench, "4")
    bench.at("simulator-tab").click()
    bench.fill("#sim-seed", "1")
    bench.click("sim-start")
    bench.until(lambda: "x=0, lost=false" in bench.at("sim-state").text)
    bench.press("0.75: x=2")
    bench.until(lambda: "Step 1: x=2" in bench.at("sim-state").text)
    bench.click("sim-follow")  # Pmin takes risks
    rows = bench.until(lambda: len(shown := bench.all("#sim-path tr")[1:]) > 2 and texts(shown))
    assert {row[1] for row in rows[1:]} == {"[risk]"}
    bench.run("arguments[0].open = true", bench.at("sim-plot"))
    bench.until(lambda: bench.all("#sim-chart [aria-label=line] path"))
    bench.click("sim-back")
    bench.until(lambda: len(bench.all("#sim-path tr")) == len(rows))
    bench.click("sim-reset")
    bench.until(lambda: "Step 0" in bench.at("sim-state").text)


def test_counterexamples_and_strategies_are_drawn(bench: Workbench) -> None:
    given(bench, "4")
    bench.click("check-all")
    for name, count in (("Why?", 2), ("Strategy", 8)):
        bench.at("check-tab").click()
        bench.press(name)
        bench.until_drawn(
            lambda n=count: sum("lost" in e.text for e in bench.all("g.node text")) >= n
        )
    assert "[risk]" in bench.log


def test_the_model_is_exported(bench: Workbench) -> None:
    given(bench, "1")
    bench.at("export-tab").click()
    bench.press(".tra")
    assert bench.downloaded("walk.tra").splitlines()[0].split() == [
        b"3",
        b"4",
        b"6",
    ]  # states, choices, transitions


def test_a_change_outside_is_read_and_never_overwritten(bench: Workbench, folder: Path) -> None:
    file = folder / "walk.nm"
    put(file, "// theirs\n" + MODEL)
    bench.until(lambda: "// theirs" in bench.at("model").text)
    bench.type_at_end("// mine")
    put(file, "// again\n" + MODEL)
    bench.with_control("s")
    bench.until(lambda: "has changed on disk" in bench.at("conflict").text)
    assert file.read_text() == "// again\n" + MODEL
    mine = bench.named("#conflict button", "Keep mine")[0]
    seen = "const s = getComputedStyle(arguments[0]); return s.color !== s.backgroundColor"
    assert bench.run(seen, mine)
    mine.send_keys("")  # has the focus, and keeps it while the page looks at the files
    time.sleep(4.5)
    assert bench.browser.switch_to.active_element == mine
    mine.click()
    bench.until(lambda: not bench.at("conflict").is_displayed())
    bench.with_control("s")
    bench.until(lambda: bench.at("model-tab").text == "walk.nm")
    assert file.read_text() == "// theirs\n" + MODEL + "// mine"


def test_unsaved_text_is_there_after_reloading(bench: Workbench, folder: Path) -> None:
    given(bench, "3")
    bench.type_at_end("// not saved")
    bench.browser.refresh()
    bench.until(lambda: "// not saved" in bench.at("model").text)
    bench.until(lambda: bench.at("model-tab").text == "● walk.nm")
    assert (folder / "walk.nm").read_text() == MODEL
    bench.until(lambda: len(bench.all("#list li")) == 2)
    bench.click("check-all")  # with the constant
    bench.until(lambda: len(bench.values) == 2)


def test_a_new_model_is_open_again_after_saving_and_reloading(bench: Workbench) -> None:
    bench.choose("model-file", "")
    bench.until(lambda: bench.at("model-tab").text == "model")
    bench.type_at_end("dtmc module m x:[0..1]; endmodule ")
    bench.with_control("s")
    bench.answer("mine.pm")
    bench.until(lambda: bench.at("model-tab").text == "mine.pm")
    bench.type_at_end("// not saved")
    bench.browser.refresh()
    bench.until(lambda: "// not saved" in bench.at("model").text)
    bench.until(lambda: bench.at("model-tab").text == "● mine.pm")


def test_facts_of_another_text_are_gone(bench: Workbench) -> None:
    given(bench, "3")
    bench.click("build")
    bench.until(lambda: "4" in bench.at("facts").text)
    bench.type_at_end("// another text")
    bench.until(lambda: bench.at("facts").text == "")


@pytest.mark.parametrize("width", [1280, 420])
def test_nothing_is_wider_than_the_window(bench: Workbench, width: int) -> None:
    bench.size(width, 720)
    given(bench, "4")
    bench.click("check-all")
    for tab in bench.all('#tools [role="tab"]'):
        tab.click()
        assert bench.run("return document.documentElement.scrollWidth") <= width


def test_everything_is_reached_by_keyboard(bench: Workbench) -> None:
    bench.at("check-tab").send_keys(Keys.ARROW_RIGHT + "")
    assert bench.at("experiment").is_displayed()
    ActionChains(bench.browser).send_keys(Keys.ARROW_LEFT).perform()
    to_constant = [Keys.TAB] * 4  # past Check all, Estimate all and Build
    ActionChains(bench.browser).send_keys(*to_constant).send_keys("2", Keys.ENTER).perform()
    bench.until(lambda: len(bench.values) == 2)
    ActionChains(bench.browser).key_down(Keys.SHIFT).send_keys(*to_constant[1:]).perform()
    ActionChains(bench.browser).key_up(Keys.SHIFT).perform()
    assert bench.browser.switch_to.active_element.get_attribute("id") == "check-all"
