"""symcheck: a symbolic probabilistic model checker for models in the PRISM language.

>>> import symcheck
>>> symcheck.load("models/die/die.pm").check("P=? [ F d=6 ]")  # doctest: +SKIP

The names here are looked up when they are used, so that importing symcheck costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOME = {
    "BoundModel": "symcheck.semantics.model",
    "Engine": "symcheck.engines.base",
    "Model": "symcheck.api",
    "Options": "symcheck.options",
    "Result": "symcheck.check.result",
    "SymcheckError": "symcheck.errors",
    "bind": "symcheck.semantics.binding.bind",
    "bind_properties": "symcheck.semantics.binding.bind",
    "build": "symcheck.symbolic.build",
    "explore": "symcheck.explicit.build",
    "export": "symcheck.exchange.api_io",
    "from_function": "symcheck.exchange.from_function",
    "from_matrix": "symcheck.exchange.from_matrix",
    "load": "symcheck.api",
    "load_explicit": "symcheck.exchange.api_io",
    "loads": "symcheck.api",
    "parse_model": "symcheck.syntax.parse",
    "parse_model_file": "symcheck.syntax.parse",
    "parse_properties": "symcheck.syntax.parse",
    "parse_properties_file": "symcheck.syntax.parse",
    "pretty": "symcheck.syntax.printer",
    "reach": "symcheck.symbolic.reachability.search",
}

__version__ = "0.2.0"
__all__ = [
    "BoundModel",
    "Engine",
    "Model",
    "Options",
    "Result",
    "SymcheckError",
    "__version__",
    "bind",
    "bind_properties",
    "build",
    "explore",
    "export",
    "from_function",
    "from_matrix",
    "load",
    "load_explicit",
    "loads",
    "parse_model",
    "parse_model_file",
    "parse_properties",
    "parse_properties_file",
    "pretty",
    "reach",
]


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'symcheck' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted(__all__)
