"""A browser for the widget, and a shell of IPython."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from page.conftest import browser as browser

pytest.importorskip("IPython", reason="the extra notebook is not installed")


@pytest.fixture
def shell(tmp_path, monkeypatch) -> Iterator[Any]:
    """A shell that knows the cells, and shows nothing."""
    from IPython.core.interactiveshell import InteractiveShell

    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    made = InteractiveShell()
    made.history_manager.enabled = False
    made.run_line_magic("load_ext", "symcheck.notebook")
    yield made
    made.history_manager.end_session()
