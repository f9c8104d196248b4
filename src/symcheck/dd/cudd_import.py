"""dd's CUDD module, imported without networkx.

dd imports networkx at import time if it is installed, which more than triples the start-up time of
a small run, and uses it for `to_nx` only. While dd is imported, an entry None in `sys.modules`
makes the import of networkx fail, which dd allows. The entry is removed at once, so that a later
`import networkx` works, and dd gets a stand-in that imports networkx on first use. Where networkx
or dd is loaded already, nothing of this is done.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any

__all__ = ["REQUIRED_VERSION", "cudd"]

REQUIRED_VERSION = "0.6.0"


class _OnDemand(ModuleType):
    """A module that is imported on first access to an attribute."""

    def __getattr__(self, attribute: str) -> Any:
        return getattr(importlib.import_module(self.__name__), attribute)


def _import_cudd() -> ModuleType:
    skip = "networkx" not in sys.modules and "dd._utils" not in sys.modules
    if skip:
        sys.modules["networkx"] = None  # type: ignore[assignment]
    try:
        module = importlib.import_module("dd.cudd")
    except ImportError as error:
        raise ImportError(
            f"symcheck needs dd {REQUIRED_VERSION} with its compiled module dd.cudd "
            "(Linux wheels of CPython 3.11 to 3.13 have it): "
            f"pip install dd=={REQUIRED_VERSION}"
        ) from error
    finally:
        if skip:
            del sys.modules["networkx"]
    if skip:
        names = vars(importlib.import_module("dd._utils"))
        names["_nx"] = _OnDemand("networkx")
        # dd keeps the error, whose traceback would keep all active frames and their models alive.
        names["_nx_error"] = None
    return module


cudd = _import_cudd()
