"""Export and import for the library: `symcheck.export` and `symcheck.load_explicit`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Self, TextIO, Unpack

from symcheck.api.arguments import ModelTypeName, model_type, properties_file, takes_options
from symcheck.api.model import Model
from symcheck.api.stages import Smaller
from symcheck.check.context import Context
from symcheck.check.property_instance import PropertyInstance
from symcheck.check.state_formulas import satisfying
from symcheck.constant_values import GivenConstants
from symcheck.engines.base import Engine, StateSet
from symcheck.engines.registry import build
from symcheck.errors import UnsupportedError, UsageError, converts_memory_error
from symcheck.exchange import export as targets
from symcheck.exchange.explicit_data import (
    ExplicitData,
    build_imported,
    imported_program,
    without_choices,
)
from symcheck.exchange.explicit_export import explicit_export
from symcheck.exchange.formats.jani_writer import LeftOut, jani_text
from symcheck.exchange.formats.prism_reader import ModelFiles, read_files, read_model
from symcheck.exchange.text import write_text
from symcheck.options import Options, OptionValues, make_options
from symcheck.semantics.binding.bind import BoundProperty
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import Expression, LabelReference, ModelType
from symcheck.syntax.declarations import PropertiesFile
from symcheck.syntax.traversal import names as names_in

if TYPE_CHECKING:
    from symcheck.check.property_instance import PropertyInstance
    from symcheck.simulate.steps import CommandSuccessors

__all__ = [
    "ImportedModel",
    "explicit_model",
    "export",
    "export_targets",
    "imported_model",
    "load_explicit",
    "product_targets",
]


@dataclass(frozen=True, eq=False, repr=False)
class ImportedModel(Model):
    """A model from explicit files or from Python: its program declares names, without commands."""

    data: ExplicitData | None = None
    objects: Sequence[Hashable] = ()
    """The states of a model from Python, in the order of their numbers."""

    @cached_property
    def bound(self) -> BoundModel:
        """Names and types; labels are sets of states."""
        return self.engine.model

    @cached_property
    def engine(self) -> Engine:
        """The engine that the options name. Raises ModelFault, UnsupportedError, ResourceError."""
        assert self.data is not None
        return build_imported(self.data, self.options)

    def reduced_for(self, *_: object, **__: object) -> Self:
        """The model itself: reduction rewrites commands, and there are none."""
        return self

    @cached_property
    def _table(self) -> Engine:
        """The explicit engine."""
        return build(self.bound, replace(self.options, engine="explicit"))

    @cached_property
    def _steps(self) -> CommandSuccessors:
        from symcheck.simulate.steps import TableSuccessors

        return TableSuccessors(self._table)


@converts_memory_error()
def export(
    model: Model,
    target: str | Path,
    properties: str | Path | PropertiesFile | None = None,
    constants: GivenConstants | str | None = None,
) -> list[str]:
    """Write a model to files. It is built, unless the format is JANI.

    Of a timed automaton, all other formats hold the process with digital clocks.

    Args:
        model: the model.
        target: FILES[:OPTIONS] as for -exportmodel: `die.all`, `die.tra,sta`, `die.drn`, `die.dot`,
            `die.pexp`, `die.umb`, `die.umbt`, `die.jani`.
        properties: those that a JANI file holds, as for `Model.check_all`.
        constants: one value for each constant that the properties leave open.

    Returns:
        The names of the files.

    Raises:
        UsageError: a file cannot be written, or there are properties and no JANI file.
        UnsupportedError: JANI cannot express a property. No file is written.
        SymcheckError: the model cannot be built.

    Examples:
        >>> symcheck.export(model, "die.tra,sta")  # doctest: +SKIP
        ['die.tra', 'die.sta']
    """
    if not isinstance(target, str | Path):
        raise UsageError(f"export takes the name of a file, such as 'die.tra', not {target!r}")
    parts = targets.parse_target(str(target), "model")
    file = PropertiesFile() if properties is None else properties_file(properties)
    if properties is not None and all(part.kind != "jani" for part in parts):
        raise UsageError(
            f"{target} holds no properties", hint="only JANI files do: export(model, 'm.jani', …)"
        )

    def bound(exact: Model) -> Sequence[BoundProperty]:
        return exact.properties(file, constants).properties

    return list(export_targets(model, parts, sys.stdout, properties=bound))


def export_targets(
    model: Model,
    parts: Sequence[targets.Target],
    out: TextIO,
    labels: Mapping[str, Expression] | None = None,
    properties: Callable[[Model], Sequence[BoundProperty]] = lambda _: (),
    left_out: LeftOut | None = None,
) -> Iterator[str]:
    """Write parts of a model one after the other, and yield the names of the files.

    Args:
        model: the model.
        parts: what is written where.
        out: the stream that 'stdout' stands for.
        labels: those of the model and of properties, if the latter may be written too.
        properties: those that a JANI file holds, bound to the model with exact numbers.
        left_out: as in `jani_text`.
    """
    clocks = model.bound.clocks
    for part in parts:
        if part.kind == "jani":
            exact = replace(model, options=replace(model.options, exact=True))
            if clocks is not None:  # the automaton itself, not the process that counts time units
                exact = replace(exact, smaller=Smaller(clocks.automaton))
            write_text(part.path, jani_text(exact.bound, properties(exact), left_out), out)
            yield part.path
    parts = [part for part in parts if part.kind != "jani"]
    if not parts:
        return
    engine = model.engine
    if model.bound.builder is not None:  # diagrams have no rewards of single transitions
        engine = build(model.bound, replace(model.options, engine="explicit"))
    labels = labels or {}
    context = Context(engine, model.options, labels)

    def states(name: str) -> StateSet:
        return satisfying(context, LabelReference(name), engine.all)

    predefined = ("init", "deadlock")
    with_properties = any(t.options.proplabels or t.kind == "proplab" for t in parts)
    names = [n for n in engine.model.labels if n not in predefined]
    others = [n for n in labels if n not in (*names, *predefined)] if with_properties else []
    counted = clocks.automaton.variables if clocks is not None else ()
    for name in others:
        if any(v.clock and v.name in names_in(labels[name]) for v in counted):
            raise UnsupportedError(
                f'the label "{name}" compares a clock, which counts units up to a limit here',
                hint="it can be written as a label of the model",
            )
    data = explicit_export(engine, names, states, property_labels=others)
    yield from targets.export(data, parts, out)


def product_targets(
    model: Model,
    instance: PropertyInstance,
    files: Mapping[str, str],
    precision: int,
    out: TextIO,
) -> Iterator[str]:
    """Write the product of a model with the automaton of a property, and yield the files' names.

    Args:
        model: the model.
        instance: the property.
        files: the file of the transitions ('tra'), and that of the states ('sta').
        precision: significant digits.
        out: the stream that 'stdout' stands for.

    Raises:
        UnsupportedError: the property is checked without an automaton.
        UsageError: a file cannot be written.
    """
    from symcheck.exchange.product_export import product_export

    bound, labels = instance.bind(model.bound)
    product = product_export(model.engine, bound.formula, model.options, labels)
    options = targets.ExportOptions(precision=precision)
    targets_of_files = [targets.Target(kind, path, options) for kind, path in files.items()]
    yield from targets.export(product, targets_of_files, out)


@takes_options
def load_explicit(
    files: str, *, type: ModelType | ModelTypeName | None = None, **options: Unpack[OptionValues]
) -> Model:
    """Read a model from explicit files: `die.all`, `die.tra,lab`, `die.pexp`, `die.drn`, `die.umb`.

    Files that end in .gz or .xz are compressed (`die.all.gz`).

    Args:
        files: the files, as for -importmodel.
        type: of the model; None for the type that the files imply.
        options: see `symcheck.Options`.

    Raises:
        SyntaxFault: a file is faulty; the error names the place.
        UsageError: a file cannot be read, or an option has a wrong value.
    """
    return imported_model(files, make_options(options), model_type(type))


@converts_memory_error("reading a .umb file needs less memory than reading text")
def imported_model(
    files: str | ModelFiles, options: Options, type: ModelType | None = None
) -> Model:
    """A model from explicit files, named as for -importmodel or one by one.

    Raises SyntaxFault, UsageError.
    """
    if isinstance(files, str):
        data = read_files(files, type, check_sums=options.check_sums)
    else:
        data = read_model(files, type, check_sums=options.check_sums)
    return explicit_model(data, options)


def explicit_model(
    data: ExplicitData, options: Options, objects: Sequence[Hashable] = ()
) -> ImportedModel:
    """A model from arrays.

    Args:
        data: the arrays.
        options: see `symcheck.Options`.
        objects: the states of a model from Python, in the order of their numbers.
    """
    data = without_choices(data)
    return ImportedModel(imported_program(data), {}, options, data.type, data=data, objects=objects)
