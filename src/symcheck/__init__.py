"""symcheck: a symbolic probabilistic model checker for models in the PRISM language.

>>> import symcheck
>>> symcheck.load("models/die/die.pm").check("P=? [ F d=6 ]")  # doctest: +SKIP

The names here are looked up when they are used, so that importing symcheck costs next to nothing.
"""

from __future__ import annotations

from symcheck.version import __version__ as __version__

TYPE_CHECKING = False  # for type checkers; the module `typing` takes ten milliseconds
if TYPE_CHECKING:
    from symcheck import teach as teach
    from symcheck import view as view
    from symcheck.api.loading import load as load
    from symcheck.api.loading import loads as loads
    from symcheck.api.model import Model as Model
    from symcheck.check.result import Result as Result
    from symcheck.check.state_distributions import Distribution as Distribution
    from symcheck.engines.base import Engine as Engine
    from symcheck.engines.explicit.strategy import Strategy as Strategy
    from symcheck.engines.states import State as State
    from symcheck.engines.states import States as States
    from symcheck.errors import SymcheckError as SymcheckError
    from symcheck.exchange.api_io import export as export
    from symcheck.exchange.api_io import load_explicit as load_explicit
    from symcheck.exchange.certificates import save_certificate as save_certificate
    from symcheck.exchange.python.builder import ModelBuilder as ModelBuilder
    from symcheck.exchange.python.from_function import from_function as from_function
    from symcheck.exchange.python.from_matrix import from_matrix as from_matrix
    from symcheck.exchange.python.from_networkx import from_networkx as from_networkx
    from symcheck.exchange.quotient import quotient as quotient
    from symcheck.exchange.strategies.induced_chain import induced_chain as induced_chain
    from symcheck.exchange.strategies.reader import load_strategy as load_strategy
    from symcheck.experiments.many import Check as Check
    from symcheck.experiments.many import check_many as check_many
    from symcheck.experiments.run import experiment as experiment
    from symcheck.explicit.build import explore as explore
    from symcheck.options import Options as Options
    from symcheck.peers.compare import compare as compare
    from symcheck.semantics.binding.bind import bind as bind
    from symcheck.semantics.binding.bind import bind_properties as bind_properties
    from symcheck.semantics.model import BoundModel as BoundModel
    from symcheck.symbolic.build import build as build
    from symcheck.symbolic.reachability.search import reach as reach
    from symcheck.syntax.parse import parse_model as parse_model
    from symcheck.syntax.parse import parse_model_file as parse_model_file
    from symcheck.syntax.parse import parse_properties as parse_properties
    from symcheck.syntax.parse import parse_properties_file as parse_properties_file
    from symcheck.syntax.printer import pretty as pretty

_MODULES = {
    "api.loading": "load loads",
    "api.model": "Model",
    "check.result": "Result",
    "check.state_distributions": "Distribution",
    "engines.explicit.strategy": "Strategy",
    "engines.base": "Engine",
    "engines.states": "State States",
    "errors": "SymcheckError",
    "exchange.api_io": "export load_explicit",
    "exchange.certificates": "save_certificate",
    "exchange.python.builder": "ModelBuilder",
    "exchange.python.from_function": "from_function",
    "exchange.python.from_networkx": "from_networkx",
    "exchange.python.from_matrix": "from_matrix",
    "exchange.quotient": "quotient",
    "exchange.strategies.induced_chain": "induced_chain",
    "exchange.strategies.reader": "load_strategy",
    "experiments.many": "Check check_many",
    "experiments.run": "experiment",
    "explicit.build": "explore",
    "options": "Options",
    "peers.compare": "compare",
    "semantics.binding.bind": "bind bind_properties",
    "semantics.model": "BoundModel",
    "symbolic.build": "build",
    "symbolic.reachability.search": "reach",
    "syntax.parse": "parse_model parse_model_file parse_properties parse_properties_file",
    "syntax.printer": "pretty",
    "teach": "",
    "view": "",
}
"""The names of each module; none for a package that is a name itself."""
_HOME = {name: module for module, names in _MODULES.items() for name in names.split() or [module]}

__all__ = [*_HOME, "__version__"]


if not TYPE_CHECKING:  # a type checker reports unknown names

    def __getattr__(name):
        if name not in _HOME:
            raise AttributeError(f"module 'symcheck' has no attribute '{name}'")
        from importlib import import_module  # takes a millisecond, before signals have handlers

        module = import_module(f"symcheck.{_HOME[name]}")
        return module if _HOME[name] == name else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
