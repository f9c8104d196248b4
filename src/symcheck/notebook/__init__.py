"""Notebooks: cells of models and properties, and a widget to look around in a model.

`%load_ext symcheck.notebook` makes the cells `%%prism` and `%%pctl` known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symcheck.tables import optional_package

if TYPE_CHECKING:
    from IPython.core.interactiveshell import InteractiveShell

    from symcheck.notebook.explorer import Explorer as Explorer

__all__ = ["Explorer", "load_ipython_extension"]


def load_ipython_extension(shell: InteractiveShell) -> None:
    """Make the cells known; `%load_ext symcheck.notebook` calls it."""
    from symcheck.notebook.cells import Cells

    Cells(shell)


def __getattr__(name: str) -> object:
    if name != "Explorer":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    optional_package("anywidget", "notebook")
    from symcheck.notebook.explorer import Explorer

    return Explorer
