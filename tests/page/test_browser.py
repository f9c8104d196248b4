"""Pages in a browser: every button, the keyboard, narrow and wide windows."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

import symcheck
from symcheck import teach, view

pytest.importorskip("pygraphviz", reason="pictures need the extra 'view'")
MODELS = Path(__file__).resolve().parents[2] / "models"
ROBOT = """mdp
module robot
  at : [0..3] init 0;
  [wait]  at=0 -> true;
  [safe]  at=0 -> 0.9 : (at'=1) + 0.1 : true;
  [risky] at=0 -> 0.5 : (at'=2) + 0.5 : (at'=3);
  [go]    at=1 -> 0.7 : (at'=2) + 0.3 : (at'=3);
  [stay]  at=1 -> 0.5 : true + 0.5 : (at'=3);
  []      at>=2 -> true;
endmodule
"""
MISFITS = """
const found = [], chooser = document.getElementById("show");
for (const { value } of chooser.options) {
  chooser.value = value;
  chooser.dispatchEvent(new Event("change"));
  const title = `${value} ${chooser.selectedOptions[0].text}`;
  if (!document.getElementById("caption").textContent) found.push(`${title}: no caption`);
  if (document.documentElement.scrollWidth > innerWidth) found.push(`${title}: wider than the window`);
  for (const box of document.querySelectorAll(".bar button, .bar select, .bar input, .pane")) {
    const { left, right, height } = box.getBoundingClientRect();
    if (height && (left < 0 || right > innerWidth)) found.push(`${title}: ${box.id || "pane"} is cut`);
    if (box.className === "pane" && height < 80) found.push(`${title}: low pane`);
  }
}
return found;
"""
"""Goes through all pictures and gives what does not fit."""
PLAY = """
const [play, count] = ["play", "count"].map((id) => document.getElementById(id));
play.click();
return [play.textContent, count.textContent];
"""
"""Presses *Play* and gives what stands there at once: the player goes on while a test looks."""
PLAY_AND_PAUSE = PLAY.replace(
    "return [play.textContent, count.textContent]",
    "const seen = [play.textContent, count.textContent]; play.click();"
    "return [...seen, play.textContent]",
)
RIGHT, LEFT, HOME, END = "\ue014", "\ue012", "\ue011", "\ue010"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    made = {
        "die": symcheck.load(MODELS / "die/die.pm").page(
            ["P=? [ F d=6 ]", "P>=1/6 [ F d=6 ]", "P=? [ F d=nought ]", "R=? [ F s=7 ]"]
        ),
        "robot": symcheck.loads(ROBOT).page(
            "Pmax=? [ F<=9 at=2 ]\nPmax=? [ F at=2 ]\nPmin=? [ G at!=3 ]"
        ),
        "queue": symcheck.load(MODELS / "queue/queue.sm").page("P=? [ F<=2 n=5 ]"),
    }
    for name, page in made.items():
        page.save(folder / f"{name}.html")
    return {name: folder / f"{name}.html" for name in made}


@pytest.mark.parametrize("width", [360, 1600])
@pytest.mark.parametrize("name", ["die", "robot", "queue"])
def test_every_picture_at_every_width(
    opened: Callable, pages: dict[str, Path], name: str, width: int
) -> None:
    page = opened(pages[name], width)
    assert len(page.shows()) > 8
    assert page.run(MISFITS) == []


def test_buttons_of_the_player(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    page.select("Reachability")
    assert page.at("count").text == "1 / 5"
    assert page.marked("new") == {"s=0, d=0"}
    assert not page.at("back").is_enabled()
    page.at("forward").click()
    assert page.marked("new") >= {"s=1, d=0", "s=2, d=0"}
    assert page.marked("in") == {"s=0, d=0"}
    page.at("last").click()
    assert page.at("count").text == "5 / 5"
    assert not page.at("forward").is_enabled()
    page.at("back").click()
    assert page.at("count").text == "4 / 5"
    page.at("first").click()
    assert page.at("count").text == "1 / 5"
    page.run(
        "const s = document.getElementById('slider'); s.value = 2; s.dispatchEvent(new Event('input'))"
    )
    assert page.at("count").text == "3 / 5"
    assert page.run(PLAY_AND_PAUSE) == ["Pause", "4 / 5", "Play"]


def test_playing_ends_at_the_last_frame(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    page.select("Reachability")
    page.run(
        "document.getElementById('slider').value = 3; document.getElementById('slider').dispatchEvent(new Event('input'))"
    )
    assert page.run(PLAY) == ["Pause", "5 / 5"]
    deadline = time.monotonic() + 10
    while page.at("play").text == "Pause" and time.monotonic() < deadline:
        time.sleep(0.1)
    assert page.at("play").text == "Play"


def test_the_keyboard(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    page.select("Construction")
    total = page.at("count").text.split(" / ")[1]
    page.run("document.activeElement.blur()")
    page.press(RIGHT, RIGHT, LEFT)
    assert page.at("count").text == f"2 / {total}"
    page.press(END)
    assert page.at("count").text == f"{total} / {total}"
    page.press(HOME)
    assert page.at("count").text == f"1 / {total}"
    page.press(" ")
    assert page.at("play").text == "Pause"
    page.press(" ")
    assert page.at("play").text == "Play"


def test_keys_step_the_player_after_a_choice_in_the_list(
    opened: Callable, pages: dict[str, Path]
) -> None:
    page = opened(pages["die"])
    page.select("Construction")
    chooser = page.at("show")
    chooser.send_keys(RIGHT)
    chooser.send_keys(RIGHT)
    chooser.send_keys(LEFT)
    assert page.at("count").text.startswith("2 / ")
    chooser.send_keys(" ")
    assert page.at("play").text == "Pause"
    chooser.send_keys(" ")
    chosen = chooser.get_property("value")
    chooser.send_keys(END)
    assert not page.at("forward").is_enabled()
    chooser.send_keys(HOME)
    assert not page.at("back").is_enabled()
    assert chooser.get_property("value") == chosen
    assert page.run("return document.activeElement.id") == "show"


@pytest.mark.parametrize("button", ["first", "back", "forward", "last", "slider"])
def test_who_goes_to_a_frame_pauses(opened: Callable, pages: dict[str, Path], button: str) -> None:
    page = opened(pages["die"])
    page.select("Construction")
    page.at("forward").click()
    move = "click()" if button != "slider" else "dispatchEvent(new Event('input'))"
    assert page.run(PLAY)[0] == "Pause"
    page.run(f"document.getElementById('{button}').{move}")
    assert page.at("play").text == "Play"


def test_the_bar_of_a_phone_keeps_the_zoom(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"], 420)

    def resize(width: int, height: int) -> None:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": True}
        page.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        page.run("return new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")

    page.browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
    try:
        resize(420, 900)
        page.at("larger").click()
        view = page.run("return document.querySelector('.pane svg').getAttribute('viewBox')")
        resize(420, 844)
        assert page.run("return innerHeight") == 844
        assert view == page.run(
            "return document.querySelector('.pane svg').getAttribute('viewBox')"
        )
        resize(900, 420)
        assert view != page.run(
            "return document.querySelector('.pane svg').getAttribute('viewBox')"
        )
    finally:
        page.browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})


def test_the_address_names_an_entry_of_the_list_and_a_frame(
    opened: Callable, pages: dict[str, Path]
) -> None:
    page = opened(pages["die"])
    names = page.run("return [...document.getElementById('show').options].map((o) => o.text)")
    number = next(i for i, name in enumerate(names, 1) if name.startswith("Construction"))
    page.browser.get(f"{pages['die'].as_uri()}?again#{number}.2")
    chosen = page.run("return document.getElementById('show').selectedOptions[0].text")
    assert chosen == names[number - 1]
    assert page.at("count").text.startswith("2 / ")


def test_values_of_properties(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    lines = page.all("#properties li")
    assert "0.1666" in lines[0].text
    assert "true" in lines[1].text
    assert "unknown" in lines[2].text
    lines[0].find_element("css selector", "button").click()
    assert lines[0].find_element("css selector", "button").get_attribute("aria-pressed") == "true"
    values = {
        tuple(t.text for t in node.find_elements("css selector", "text"))
        for node in page.all(".pane g.node")
    }
    assert {("s=0, d=0", "0.1667"), ("s=2, d=0", "0.3333"), ("s=7, d=6", "1")} <= values
    page.all("#properties button")[1].click()
    assert page.marked("in") == {"s=0, d=0", "s=2, d=0", "s=6, d=0", "s=7, d=6"}


def test_rewards_are_iterated(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    page.select("Optimistic")
    assert "target: 6 states; infinite reward: 0 states; unknown: 7 states." in page.caption
    page.at("last").click()
    values = {
        tuple(t.text for t in node.find_elements("css selector", "text"))
        for node in page.all(".pane g.node")
    }
    assert ("s=7, d=1", "0") in values
    assert any(name == "s=0, d=0" and number.startswith("3.66") for name, number, *_ in values)


def test_iterations_have_both_bounds(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    page.select("Interval")
    assert "probability 0: 9 states; probability 1: 1 state; unknown: 3 states." in page.caption
    assert page.marked("one") == {"s=7, d=6"}
    page.press(RIGHT)
    page.at("forward").click()
    texts = {t.text for t in page.all(".pane g.node text.value")}
    assert any("…" in text for text in texts)


def test_policy_iteration_marks_the_policy(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["robot"])
    page.select("Policy iteration")
    page.at("last").click()
    assert page.caption.startswith("Policy ")
    chosen = {t.text.strip() for t in page.all(".pane g.edge.chosen text")}
    assert chosen & {"safe", "risky", "go", "stay"}
    page.select("prob1")
    page.at("last").click()
    assert "result" in page.caption


def test_the_simulator_follows_choices_and_goes_back(
    opened: Callable, pages: dict[str, Path]
) -> None:
    page = opened(pages["robot"])
    page.select("Simulator")
    texts = [b.text for b in page.all("#steps button")]
    assert texts == ["1 → at=0", "0.1 → at=0", "0.9 → at=1", "0.5 → at=2", "0.5 → at=3"]
    assert [e.text for e in page.all("#steps em")] == ["wait", "safe", "risky"]
    page.all("#steps button")[2].click()
    assert page.marked("now") == {"at=1"}
    assert "by safe" in page.caption
    assert {"safe", "0.9"} <= {t.text.strip() for t in page.all(".edge.taken text")}
    page.at("back").click()
    assert page.marked("now") == {"at=0"}
    page.all("#steps button")[4].click()  # another way from here
    assert page.marked("now") == {"at=3"}
    assert page.at("count").text == "1 step"
    page.at("restart").click()
    assert (page.marked("now"), page.at("count").text) == ({"at=0"}, "0 steps")
    page.at("step").click()
    page.run("document.activeElement.blur()")
    page.press(RIGHT)
    assert page.at("count").text == "2 steps"
    page.press(LEFT, LEFT)
    assert page.marked("now") == {"at=0"}


def test_the_simulator_shows_labels_and_rewards(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])
    page.select("Simulator")
    assert 'the initial state; reward "tosses" 1' in page.caption
    for number in (0, 1, 0):
        page.all("#steps button")[number].click()
    assert page.caption.startswith("Step 3: s=7, d=2")
    assert '"done"' in page.caption
    assert "reward" not in page.caption


def test_the_simulator_leaves_the_picture(opened: Callable, tmp_path: Path) -> None:
    text = "dtmc module m x:[0..99]; [] x<99 -> (x'=x+1); [] x=99 -> true; endmodule"
    symcheck.loads(text).page("P=? [ F x=99 ]", max_states=3).save(tmp_path / "line.html")
    page = opened(tmp_path / "line.html")
    assert len(page.all(".pane g.node")) == 4  # with the dots behind the last one
    page.all("#properties button")[0].click()
    page.select("Simulator")
    for _ in range(3):
        page.at("step").click()
    assert page.caption.startswith("Step 3: x=3")
    assert "not in the picture" in page.caption
    assert page.marked("now") == set()
    page.at("back").click()
    assert page.marked("now") == {"x=2"}


def test_a_larger_model_is_drawn_near_its_initial_states(opened: Callable, tmp_path: Path) -> None:
    symcheck.load(MODELS / "dining/dining.nm").page().save(tmp_path / "dining.html")
    page = opened(tmp_path / "dining.html")
    boxes = page.run("return [...pane(data.states).nodes.keys()].filter((n) => /^s\\d+$/.test(n))")
    assert 6 < len(boxes) <= 24
    assert f"{len(boxes)} states of 155" in page.caption


@pytest.mark.parametrize("name", ["herman/herman7.pm", "dining/dining.nm"])
def test_a_graph_of_a_larger_model_is_seen_whole_and_can_be_read(
    opened: Callable, tmp_path: Path, name: str
) -> None:
    symcheck.load(MODELS / name).page().save(tmp_path / "page.html")
    for width, height in ((1280, 720), (1920, 1080)):
        page = opened(tmp_path / "page.html", width, height)
        inside = page.run(
            "const box = pane(data.states).box.getBoundingClientRect();"
            "return pane(data.states).scale > 0.75 && [...pane(data.states).nodes.values()].every("
            "(n) => { const b = n.getBoundingClientRect(); return b.left >= box.left - 1 &&"
            " b.right <= box.right + 1 && b.top >= box.top - 1 && b.bottom <= box.bottom + 1; })"
        )
        assert inside


def test_a_narrow_window_shows_a_part_in_letters_that_can_be_read(
    opened: Callable, tmp_path: Path
) -> None:
    symcheck.load(MODELS / "herman/herman7.pm").page().save(tmp_path / "page.html")
    page = opened(tmp_path / "page.html", 420, 800)
    assert page.run("return pane(data.states).scale") >= 0.55
    assert page.run("return document.documentElement.scrollWidth <= innerWidth")
    page.at("fit").click()
    assert page.run("const p = pane(data.states); return p.view.wide >= p.size.width")


def test_the_simulator_follows_a_strategy(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["robot"])
    page.select("Simulator")
    options = page.all("#policy option")
    assert [o.text for o in options] == [
        "at random",
        "strategy of Pmax=? [ F at=2 ]",
        "strategy of Pmin=? [ G at!=3 ]",
    ]
    options[1].click()
    for _ in range(60):
        page.at("step").click()
        if page.marked("now") <= {"at=2", "at=3"}:
            break
    steps = page.run("return walk.path.map((s) => s.by)")
    assert (steps[0], set(steps[1:-1]), steps[-1]) == ("start", {"safe"}, "go")


def test_a_ctmc_has_time(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["queue"])
    page.select("Simulator")
    page.at("step").click()
    page.at("step").click()
    assert page.caption.startswith("Step 2, time ")
    assert page.run("return walk.path[2].time > walk.path[1].time && walk.path[1].time > 0")


def test_zoom_and_pan(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["die"])

    def box() -> list[float]:
        return [float(x) for x in page.all(".pane svg")[0].get_dom_attribute("viewBox").split()]

    before = box()
    page.at("larger").click()
    assert box()[2] == pytest.approx(before[2] / 1.3)
    page.at("smaller").click()
    assert box()[2] == pytest.approx(before[2])
    from selenium.webdriver.common.action_chains import ActionChains

    ActionChains(page.browser).drag_and_drop_by_offset(page.all(".pane")[0], 40, 0).perform()
    assert box()[0] < before[0]
    page.at("fit").click()
    x, _, wide, _ = box()
    width = page.run("return pane(data.states).size.width")
    assert x <= 0
    assert wide >= width


def test_names_for_screen_readers(opened: Callable, pages: dict[str, Path]) -> None:
    page = opened(pages["robot"])
    for button in page.all("#stage button"):
        assert button.get_attribute("aria-label") or button.get_property("textContent").strip()
    assert page.at("caption").get_attribute("aria-live") == "polite"
    assert page.all(".pane")[0].get_attribute("aria-label").startswith("4 states")
    page.select("Reachability")
    page.at("forward").click()
    assert page.at("slider").get_attribute("aria-valuetext").startswith("frame 2 of")


def test_traces_and_pictures_of_notebooks(opened: Callable, tmp_path: Path) -> None:
    model = symcheck.load(MODELS / "die/die.pm")
    parts = {
        "frontiers": teach.frontiers(model),
        "construction": teach.construction(model),
        "prob0": teach.prob0(model, "true", "d=6"),
        "until": teach.until_trace(model, "true", "d=6"),
        "picture": view.state_graph(model),
    }
    for name, part in parts.items():
        path = tmp_path / f"{name}.html"
        path.write_text(
            f"<!DOCTYPE html><meta charset=utf-8>{part._repr_html_()}", encoding="utf-8"
        )
        page = opened(path)
        page.browser.switch_to.frame(0)
        assert page.caption
        assert page.all(".pane svg")
        if name != "picture":
            page.at("forward").click()
            assert page.at("count").text.startswith("2 / ")
        else:
            assert not page.at("player").is_displayed()
        page.browser.switch_to.default_content()
