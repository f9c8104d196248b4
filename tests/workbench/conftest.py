"""A workbench in a folder of its own, and a browser for it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from page.conftest import browser as browser

pytest.importorskip("starlette", reason="the extra workbench is not installed")

MODEL = """mdp
const int N;
module m
  x : [0..N] init 0;
  lost : bool init false;
  [safe] x<N & !lost -> 0.5 : (x'=x+1) + 0.5 : true;
  [risk] x<N & !lost -> 0.75 : (x'=min(N,x+2)) + 0.25 : (lost'=true);
endmodule
rewards "tries"
  true : 1;
endrewards
label "done" = x=N;
"""
PROPERTIES = """"least": Pmin=? [ F "done" ];
P>=0.9 [ F "done" ];
"""
GRID = """dtmc
module grid
  x : [0..99] init 50;
  y : [0..99] init 50;
  [] true -> 0.25 : (x'=mod(x+1,100)) + 0.25 : (x'=mod(x+99,100))
           + 0.25 : (y'=mod(y+1,100)) + 0.25 : (y'=mod(y+99,100));
endmodule
rewards "home" x=50 & y=50 : 1; endrewards
"""
FOREVER = 'R{"home"}=? [ I=100000000 ];\n'
"""Takes hours, and no shorter way is known: on the torus, the parity of a state alternates."""


def write_files(folder: Path) -> Path:
    """Two models with properties, in a folder."""
    (folder / "walk.nm").write_text(MODEL)
    (folder / "walk.props").write_text(PROPERTIES)
    (folder / "grid.pm").write_text(GRID)
    (folder / "grid.props").write_text(FOREVER)
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_files(tmp_path)


@pytest.fixture
def process(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A workbench."""
    words = ["workbench", "walk.nm", "walk.props", "--no-browser"]
    process = subprocess.Popen(
        [sys.executable, "-m", "symcheck", *words], cwd=folder, stdout=subprocess.PIPE, text=True
    )
    yield process
    process.terminate()
    process.communicate(timeout=60)


@pytest.fixture
def address(process: subprocess.Popen[str]) -> str:
    """The address that a workbench prints."""
    assert process.stdout is not None
    return process.stdout.readline().split()[-1]


def put(file: Path, text: str) -> None:
    """Write a file as an editor does: at no time is a part of the text there."""
    new = file.with_suffix(".new")
    new.write_text(text)
    new.replace(file)


class Workbench:
    """What a user does with the page."""

    def __init__(self, browser: Any, address: str, downloads: Path) -> None:
        self.browser, self.downloads = browser, downloads
        self.size(1280, 720)
        where = {"behavior": "allow", "downloadPath": str(downloads)}
        browser.execute_cdp_cmd("Browser.setDownloadBehavior", where)
        browser.get(address)
        self.until(lambda: "reachable" in self.at("state").text or self.all("#list li"))
        self.pages_drawn = 0
        self.run(
            "window.pagesDrawn = 0; document.addEventListener("
            "'load', (e) => { window.pagesDrawn += e.target.id === 'drawn' }, true)"
        )

    def size(self, width: int, height: int) -> None:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)

    def at(self, id: str) -> Any:
        return self.browser.find_element("id", id)

    def all(self, css: str) -> list[Any]:
        found: list[Any] = self.browser.find_elements("css selector", css)
        return found

    def run(self, script: str, *arguments: object) -> Any:
        return self.browser.execute_script(script, *arguments)

    def until(self, holds: Callable[[], object], seconds: float = 30) -> Any:
        """What holds after a while; if nothing does, the failure tells what the page shows."""
        from selenium.common.exceptions import StaleElementReferenceException, TimeoutException
        from selenium.webdriver.support.wait import WebDriverWait

        passing = [StaleElementReferenceException, IndexError]
        wait = WebDriverWait(self.browser, seconds, 0.05, ignored_exceptions=passing)
        try:
            return wait.until(lambda _: holds())
        except TimeoutException:
            self.browser.switch_to.default_content()
            shown = self.run(
                "return ['model', 'properties', 'state', 'trouble', 'list', 'progress', 'log-lines']"
                ".map((id) => `${id}: ${document.getElementById(id)?.innerText}`).join('\\n')"
            )
            pytest.fail(f"not after {seconds} s; the page shows\n{shown}")

    def until_drawn(self, holds: Callable[[], object]) -> Any:
        """Wait until a new page of the graph is there, and something holds within it.

        The frame is entered when the page has been loaded: one that the driver enters before stays
        blank now and then.
        """
        self.until(lambda: self.run("return window.pagesDrawn") > self.pages_drawn)
        self.pages_drawn = self.run("return window.pagesDrawn")
        self.browser.switch_to.frame(self.at("drawn"))
        try:
            return self.until(holds)
        finally:
            self.browser.switch_to.default_content()

    def click(self, *names: str) -> None:
        """Click buttons one after the other, when what they start has ended."""
        for name in names:
            self.at(name).click()
            self.until(lambda: not self.all("#progress .bar"))

    def press(self, text: str, css: str = "#tools button:not([role])") -> None:
        """Click the button with a text as soon as it is there.

        It may be shown anew after it was found: it is found again then.
        """
        self.until(lambda: self.named(css, text)[0].click() or True)

    def named(self, css: str, text: str) -> list[Any]:
        return [e for e in self.all(css) if e.text == text]

    def fill(self, css: str, text: str) -> None:
        field = self.all(css)[0]
        field.clear()
        field.send_keys(text)

    def choose(self, id: str, value: str) -> None:
        script = (
            "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('change'))"
        )
        self.run(script, self.at(id), value)

    def type_at_end(self, text: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains
        from selenium.webdriver.common.keys import Keys

        self.all("#model .cm-content")[0].click()
        end = ActionChains(self.browser).key_down(Keys.CONTROL).send_keys(Keys.END)
        end.key_up(Keys.CONTROL).send_keys(text).perform()

    def with_control(self, key: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains
        from selenium.webdriver.common.keys import Keys

        chain = ActionChains(self.browser).key_down(Keys.CONTROL).send_keys(key)
        chain.key_up(Keys.CONTROL).perform()

    def answer(self, text: str) -> None:
        """Write an answer into the question of the browser."""
        from selenium.common.exceptions import NoAlertPresentException
        from selenium.webdriver.support.wait import WebDriverWait

        wait = WebDriverWait(self.browser, 30, 0.05, ignored_exceptions=[NoAlertPresentException])
        prompt = wait.until(lambda browser: browser.switch_to.alert)
        prompt.send_keys(text)
        prompt.accept()

    def downloaded(self, name: str) -> bytes:
        path = self.downloads / name
        return bytes(self.until(lambda: path.exists() and path.read_bytes()))

    @property
    def log(self) -> str:
        return str(self.at("log-lines").get_property("textContent"))

    @property
    def values(self) -> list[str]:
        return [e.text for e in self.all("#list .value")]


@pytest.fixture
def bench(
    browser: Any,
    address: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[Workbench]:
    """A page of the workbench; nothing is in its console afterwards."""
    browser.get_log("browser")
    bench = Workbench(browser, address, tmp_path_factory.mktemp("downloads"))
    yield bench
    assert [e["message"] for e in browser.get_log("browser")] == []
    browser.get("about:blank")
