"""The tutorial's code prints what the tutorial says, and its figures exist and can be made again."""

from __future__ import annotations

import doctest
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
DOCS = ROOT / "docs"


def test_the_tutorial_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    text = (DOCS / "tutorial.md").read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    test = doctest.DocTestParser().get_doctest(code, {}, "tutorial", "tutorial.md", 0)
    assert len(test.examples) > 40
    said: list[str] = []
    found = doctest.DocTestRunner(verbose=False).run(test, out=said.append)
    assert found.failed == 0, "".join(said)


@pytest.mark.parametrize("page", ["tutorial.md", "architecture.md"])
def test_links_lead_somewhere(page: str) -> None:
    text = (DOCS / page).read_text()
    targets = [t for t in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in t]
    assert targets
    for target in targets:
        assert (DOCS / target).exists(), target


def test_paths_in_the_architecture_exist() -> None:
    text = (DOCS / "architecture.md").read_text()
    paths = re.findall(r"`((?:\w+/)*\w+\.(?:py|pyx|md))`", text)
    assert len(paths) > 10
    for path in paths:
        assert (
            (ROOT / path).exists()
            or (ROOT / "src/symcheck" / path).exists()
            or list((ROOT / "src").rglob(path))
        ), path


def test_figures_can_be_made(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="figures need the extra 'plot'")
    runpy.run_path(str(DOCS / "make_figures.py"))["main"](tmp_path)
    made = {p.name for p in tmp_path.iterdir()}
    assert made <= {p.name for p in (DOCS / "figures").iterdir()}
    text = "".join(
        (DOCS / name).read_text() for name in ("tutorial.md", "pages.md", "parameters.md")
    )
    shown = set(re.findall(r"figures/(\w+\.png)", text))
    assert made <= shown
    assert shown - made <= {"page.png"}  # it is made if Chromium is there
