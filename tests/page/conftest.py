"""A headless Chromium for the pages; tests that need it are skipped where it is missing."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

SWITCHES = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("Chromium or its driver is not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for switch in (*SWITCHES, f"--user-data-dir={tmp_path_factory.mktemp('chromium')}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(driver)
    found = webdriver.Chrome(options=options, service=service)
    yield found
    found.quit()


class PageInBrowser:
    """A page that a browser has opened, and what a reader does with it."""

    def __init__(self, browser: Any, path: Path, width: int = 1300, height: int = 900) -> None:
        self.browser = browser
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get(path.as_uri())

    def at(self, id: str) -> Any:
        return self.browser.find_element("id", id)

    def all(self, css: str) -> list[Any]:
        found: list[Any] = self.browser.find_elements("css selector", css)
        return found

    def run(self, script: str, *arguments: object) -> Any:
        return self.browser.execute_script(script, *arguments)

    def press(self, *keys: str) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.browser).send_keys(*keys).perform()

    def shows(self) -> list[str]:
        return [o.get_property("text") for o in self.all("#show option")]

    def select(self, name: str, group: str = "") -> None:
        """Choose a picture or player by the start of its name, in a group of the list."""
        from selenium.common.exceptions import StaleElementReferenceException
        from selenium.webdriver.support.wait import WebDriverWait

        css = f"#show optgroup[label='{group}'] option" if group else "#show option"
        # A browser that is short of time may still show the page before.
        wait = WebDriverWait(self.browser, 30, 0.05, [StaleElementReferenceException])
        option = wait.until(
            lambda _: next(
                (o for o in self.all(css) if o.get_property("text").startswith(name)), None
            ),
            f"no '{name}' among {self.shows()}",
        )
        self.run(
            "const s = document.getElementById('show'); s.value = arguments[0].value;"
            "s.dispatchEvent(new Event('change'))",
            option,
        )

    @property
    def caption(self) -> str:
        return str(self.at("caption").text)

    def marked(self, name: str) -> set[str]:
        """The texts of the nodes with a mark."""
        nodes = self.all(f".pane g.node.{name}")
        return {n.find_element("css selector", "text").text for n in nodes}

    def errors(self) -> list[str]:
        return [e["message"] for e in self.browser.get_log("browser") if e["level"] == "SEVERE"]


@pytest.fixture
def opened(browser: Any) -> Iterator[Any]:
    """Opens pages, and finds no errors in the console afterwards."""
    pages: list[PageInBrowser] = []

    def open_page(path: Path, width: int = 1300, height: int = 900) -> PageInBrowser:
        pages.append(PageInBrowser(browser, path, width, height))
        return pages[-1]

    yield open_page
    assert [e for p in pages for e in p.errors()] == []
