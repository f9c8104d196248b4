"""Notebooks: cells of models and properties, a widget to look around in a model, and sliders.

`%load_ext symcheck.notebook` makes the cells `%%prism` and `%%pctl` known.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from symcheck.tables import optional_package

if TYPE_CHECKING:
    from IPython.core.interactiveshell import InteractiveShell

    from symcheck.notebook.constant_sliders import Sliders as Sliders
    from symcheck.notebook.constant_sliders import sliders as sliders
    from symcheck.notebook.explorer import Explorer as Explorer

_MODULES = {
    "Explorer": "explorer",
    "Sliders": "constant_sliders",
    "sliders": "constant_sliders",
}
"""The module of each name; it is imported when the name is used."""

__all__ = ["Explorer", "Sliders", "load_ipython_extension", "sliders"]


def load_ipython_extension(shell: InteractiveShell) -> None:
    """Make the cells known; `%load_ext symcheck.notebook` calls it."""
    from symcheck.notebook.cells import Cells

    Cells(shell)


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    optional_package("anywidget", "notebook")
    from importlib import import_module

    found: object = getattr(import_module(f"symcheck.notebook.{_MODULES[name]}"), name)
    return found
