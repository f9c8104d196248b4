"""The widget: what Python answers, and what a browser shows of it."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("anywidget", reason="the extra notebook is not installed")

import symcheck
from symcheck.notebook import Explorer
from symcheck.notebook import explorer as module

ROOT = Path(__file__).resolve().parents[2]
DIE = ROOT / "models" / "die" / "die.pm"
QUEUE = (
    "ctmc module queue n:[0..1000000000]; [arrive] true -> 2:(n'=min(n+1,1000000000)); endmodule"
)
END = "mdp module m x:[0..1]; [go] x=0 -> (x'=1); endmodule"


def test_buttons_move_the_path() -> None:
    explorer = Explorer(symcheck.load(DIE), seed=1)
    explorer.receive({"do": "step", "choice": 0, "branch": 1})
    assert explorer.shown["path"]["state"] == "s=2 & d=0"
    assert explorer.shown["svg"].lstrip().startswith("<?xml")
    assert "at most 3 steps" in explorer.shown["note"]
    explorer.receive({"do": "back"})
    explorer.receive({"do": "back"})  # at the start already
    assert explorer.shown["path"]["length"] == 1
    explorer.receive({"do": "run", "steps": 50})
    length = explorer.shown["path"]["length"]
    assert explorer.simulator.state["s"] == 7
    explorer.receive({"do": "restart"})
    assert 1 == explorer.shown["path"]["length"] < length


@pytest.mark.parametrize("name", Explorer.PICTURES)
def test_each_picture_is_drawn(name: str) -> None:
    explorer = Explorer(symcheck.load(DIE), seed=1)
    explorer.receive({"do": "draw", "picture": name})
    assert explorer.shown["picture"] == name
    assert ("<svg" in explorer.shown["svg"]) == (name != "none")


def test_what_cannot_be_done_is_said() -> None:
    explorer = Explorer(symcheck.loads(END))
    explorer.receive({"do": "step"})
    explorer.receive({"do": "step"})
    assert "is a deadlock" in explorer.shown["error"]
    explorer.receive({"do": "fly"})
    assert "there is no such move" in explorer.shown["error"]
    explorer.receive({"do": "draw", "picture": "a horse"})
    assert "there is no such move" in explorer.shown["error"]


def test_a_model_with_many_states_is_walked_through_without_being_built() -> None:
    explorer = Explorer(symcheck.loads(QUEUE), seed=1)
    explorer.receive({"do": "run", "steps": 1000})
    assert explorer.shown["path"]["length"] == 1001
    assert len(explorer.shown["path"]["rows"]) == 200
    assert explorer.shown["first"] == 801
    assert explorer.shown["note"].startswith("the states are not drawn")


PAGE = """<!doctype html><meta charset="utf-8"><title>widget</title><style>@CSS@</style>
<div id="cell"></div><script>
window.sent = [];
const listeners = [];
let shown = @SHOWN@;
window.tell = (value) => { shown = value; listeners.forEach((listener) => listener()); };
const model = {
  get: () => shown,
  send: (message) => window.sent.push(message),
  on: (_, listener) => listeners.push(listener),
  off: (_, listener) => listeners.splice(listeners.indexOf(listener), 1),
};
const source = new Blob([@SCRIPT@], { type: "text/javascript" });
import(URL.createObjectURL(source)).then((widget) => {
  widget.default.render({ model, el: document.getElementById("cell") });
  document.body.dataset.ready = "yes";
});
</script>"""


class Cell:
    """The widget in a browser; what its buttons send is given to Python, and its answer back."""

    def __init__(self, browser, explorer: Explorer, folder: Path) -> None:
        import json

        self.browser, self.explorer = browser, explorer
        here = Path(module.__file__).parent
        page = PAGE.replace("@CSS@", (here / "explorer.css").read_text())
        page = page.replace("@SHOWN@", json.dumps(explorer.shown).replace("<", "\\u003c"))
        script = json.dumps((here / "explorer.js").read_text()).replace("<", "\\u003c")
        path = folder / "widget.html"
        path.write_text(page.replace("@SCRIPT@", script))
        size = {"width": 900, "height": 600, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get(path.as_uri())
        self._wait(lambda: browser.execute_script("return document.body.dataset.ready"))

    @staticmethod
    def _wait(holds) -> None:
        from time import monotonic, sleep

        end = monotonic() + 30
        while not holds():
            assert monotonic() < end
            sleep(0.02)

    def answer(self) -> list[dict]:
        """Let Python answer what was sent."""
        sent = self.browser.execute_script("return window.sent.splice(0)")
        for message in sent:
            self.explorer.receive(message)
        self.browser.execute_script("window.tell(arguments[0])", self.explorer.shown)
        return sent

    def press(self, text: str) -> None:
        self.browser.find_element("xpath", f"//button[contains(., '{text}')]").click()
        assert len(self.answer()) == 1

    def key(self, key: str) -> list[dict]:
        self.browser.find_element("css selector", ".symcheck").send_keys(key)
        return self.answer()

    @property
    def text(self) -> str:
        return self.browser.find_element("css selector", ".symcheck").text


def test_a_reader_walks_with_buttons_and_keys(browser, tmp_path: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    browser.get_log("browser")
    cell = Cell(browser, Explorer(symcheck.load(DIE), seed=1), tmp_path)
    assert "s=0 & d=0" in cell.text
    assert not browser.find_element("css selector", "[data-key=back]").is_enabled()
    cell.press("0.5: s=2")
    assert "s=2 & d=0" in cell.text
    image = browser.find_element("css selector", "img")
    cell._wait(lambda: image.size["height"] > 50)
    cell.press("Step")
    assert browser.switch_to.active_element.text == "Step"
    assert len(browser.find_elements("css selector", ".path tr")) == 4
    cell.press("Restart")
    browser.execute_script("document.querySelector('.symcheck').focus()")
    assert cell.key(Keys.ARROW_RIGHT) == [{"do": "step"}]
    assert cell.key(Keys.ARROW_LEFT) == [{"do": "back"}]
    assert "s=0 & d=0" in cell.text
    cell.press("10 steps")
    assert "s=7" in cell.text
    choice = browser.find_element("css selector", "select")
    choice.send_keys("matrix")
    assert cell.answer() == [{"do": "draw", "picture": "matrix"}]
    assert browser.find_element("css selector", "img").get_attribute("alt") == "matrix"
    browser.save_screenshot(str(tmp_path / "widget.png"))
    assert [e for e in browser.get_log("browser") if "favicon" not in e["message"]] == []
