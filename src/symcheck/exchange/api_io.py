"""Export and import for the library: `symcheck.export(model, "die.all")`, `symcheck.load_explicit`."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

from symcheck.api import Model
from symcheck.check.context import Context
from symcheck.check.state_formulas import satisfying
from symcheck.engines.base import Engine, StateSet
from symcheck.errors import UnsupportedError, told_in_memory
from symcheck.exchange import export as targets
from symcheck.exchange.explicit_data import ExplicitData, imported_engine
from symcheck.exchange.explicit_export import explicit_export
from symcheck.exchange.formats.prism_reader import read_files
from symcheck.options import Options
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import LabelReference, ModelType

__all__ = ["ReadModel", "export", "load_explicit"]


@dataclass(frozen=True, eq=False, repr=False)
class ReadModel(Model):
    """A model that was read state by state. Its program declares names and has no commands."""

    given: ExplicitData | None = None

    @cached_property
    def bound(self) -> BoundModel:
        """Names and types; labels are sets of states."""
        return self.engine.model

    @cached_property
    def engine(self) -> Engine:
        """The explicit engine, or the rational one. Raises ModelFault, UnsupportedError."""
        assert self.given is not None
        engine = imported_engine(self.given, fix_deadlocks=self.options.fix_deadlocks)
        return engine.rational() if self.options.exact else engine

    def with_options(self, **changes: Any) -> Model:
        """The same model, to be checked otherwise."""
        return replace(self, options=replace(self.options, **changes))

    def simulate(self, *_: Any, **__: Any) -> NoReturn:
        """Not offered. Raises UnsupportedError."""
        raise UnsupportedError(
            "a random path follows the commands of a model in the PRISM language, "
            "and a model in explicit files has none"
        )

    def estimate(self, *_: Any, **__: Any) -> NoReturn:
        """Not offered. Raises UnsupportedError."""
        self.simulate()


@told_in_memory()
def export(model: Model, target: str) -> list[str]:
    """Write a model to files.

    Args:
        model: the model.
        target: the files, as for `-exportmodel`: `die.all`, `die.tra,sta`, `die.drn`, `die.dot`,
            `die.umb`.

    Returns:
        The names of the files that were written.

    Raises:
        UsageError: a format is unknown, or a file cannot be written.
        SymcheckError: the model cannot be built.

    Example:
        >>> symcheck.export(model, "die.tra,sta")  # doctest: +SKIP
        ['die.tra', 'die.sta']
    """
    wanted, context = targets.parse_target(target, "model"), Context(model.engine, model.options)

    def states(name: str) -> StateSet:
        return satisfying(context, LabelReference(name), model.engine.all)

    return list(
        targets.export(
            explicit_export(model.engine, list(model.engine.model.labels), states),
            wanted,
            sys.stdout,
        )
    )


@told_in_memory("reading a .umb file needs less memory than reading text")
def load_explicit(files: str, *, type: ModelType | None = None, **options: Any) -> Model:
    """Read a model from explicit files.

    Args:
        files: PRISM's explicit files, such as `die.all` or `die.tra,lab`, or a UMB file.
        type: the model type. None: as the files say.
        options: the fields of `symcheck.Options`.

    Raises:
        SyntaxFault: a file is faulty; the error points at the place.
        UsageError: a file cannot be read.
    """
    chosen = Options(**options)
    given = read_files(files, type, check_sums=chosen.check_sums)
    program = imported_engine(given).model.program
    return ReadModel(program, {}, chosen, given.type, given)
