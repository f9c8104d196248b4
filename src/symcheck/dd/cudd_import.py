"""CUDD: the compiled module of dd, or a shared library of the system.

1. `dd.cudd`, which wheels of dd have on Linux, x86-64, CPython up to 3.13. Its diagrams and those
   of symcheck are the same objects.
2. A shared library with CUDD 3.0: the file that the environment variable SYMCHECK_CUDD names, the
   one in the folder of Python's libraries, where conda-forge's package is, or that of the system.

Without both, everything but diagrams works, and the first `DiagramManager` raises UnsupportedError;
`python_manager.py` has BDDs of sets for teaching.

dd imports networkx at import time if it is installed, which more than triples the start-up time of
a small run, and uses it for `to_nx` only. While dd is imported, an entry None in `sys.modules`
makes the import of networkx fail, which dd allows. The entry is removed at once, so that a later
`import networkx` works, and dd gets a stand-in that imports networkx on first use. Where networkx
or dd is loaded already, nothing of this is done.
"""

from __future__ import annotations

import importlib
import os
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType

from symcheck.errors import UnsupportedError

__all__ = ["INSTALL_HINT", "REQUIRED_VERSION", "Function", "available", "cudd", "library"]

REQUIRED_VERSION = "0.6.0"
INSTALL_HINT = (
    f"wheels of dd {REQUIRED_VERSION} for Linux on x86-64 and CPython up to 3.13 contain it; "
    "elsewhere, that of conda-forge's package cudd is found, and SYMCHECK_CUDD names a shared "
    "library with CUDD 3.0. The engines -ex and -exact need no diagrams"
)
"""Where CUDD comes from."""


class _OnDemand(ModuleType):
    """A module that is imported on first access to an attribute."""

    def __getattr__(self, attribute: str) -> object:
        return getattr(importlib.import_module(self.__name__), attribute)


def _import_cudd() -> ModuleType | None:
    skip = "networkx" not in sys.modules and "dd._utils" not in sys.modules
    if skip:
        sys.modules["networkx"] = None  # type: ignore[assignment]
    try:
        module = importlib.import_module("dd.cudd")
    except ImportError:
        return None
    finally:
        if skip:
            del sys.modules["networkx"]
    if skip:
        names = vars(importlib.import_module("dd._utils"))
        names["_nx"] = _OnDemand("networkx")
        # dd keeps the error, whose traceback would keep all active frames and their models alive.
        names["_nx_error"] = None
    return module


def library() -> str:
    """The file of the shared library with CUDD's functions. Raises UnsupportedError if there is
    none.
    """
    if cudd is not None:
        return str(cudd.__file__)
    name = os.environ.get("SYMCHECK_CUDD") or _system_library()
    if name is None:
        raise UnsupportedError(
            "decision diagrams need CUDD, which is not installed here", hint=INSTALL_HINT
        )
    return name


@cache
def _system_library() -> str | None:
    """The library in the folder of Python's libraries, or the one that the system finds as `cudd`.

    The loader is asked first: the search of `find_library` starts processes, which a small system
    does not have.
    """
    import ctypes
    from ctypes.util import find_library  # they import modules that are needed nowhere else

    here = Path(sys.base_prefix, "lib")
    for name in (here / "libcudd.so", here / "libcudd.dylib", "libcudd.so", "libcudd-3.0.0.so.0"):
        with suppress(OSError):
            ctypes.CDLL(str(name))
            return str(name)
    return find_library("cudd")


def available() -> bool:
    """Whether there is a CUDD, so that there can be diagrams."""
    try:
        return bool(library())
    except UnsupportedError:
        return False


cudd = _import_cudd()
"""dd's module, or None."""

Function: type | tuple[()] = () if cudd is None else cudd.Function
"""The class of dd's diagrams, for isinstance."""
