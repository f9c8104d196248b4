"""Binding of a properties file to a bound model.

Each property is bound separately: its fault or its missing constants do not affect the others. A
fault of a constant, formula or label is one of each property that uses it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import field, replace
from typing import NamedTuple

from symcheck.errors import NO_SPAN, Diagnostic, InputError, NameFault, Span
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.binding.bound_conditions import check_conditions, for_one_player
from symcheck.semantics.binding.names import ConstantValue, Scope, SymbolTable, undefined
from symcheck.semantics.binding.property_references import PropertyReferences
from symcheck.semantics.binding.static_checks import (
    RESERVED_LABELS,
    check_constants,
    check_label,
    set_constants,
)
from symcheck.semantics.diagnostics import DiagnosticCollector, suggest
from symcheck.semantics.expressions.deep_recursion import with_deep_recursion
from symcheck.semantics.expressions.literals import type_of_value
from symcheck.semantics.model import BoundModel, Value
from symcheck.syntax.ast import Expression, LabelReference, Name, Quantile, Type
from symcheck.syntax.declarations import Constant, Formula, Program, PropertiesFile
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = [
    "BoundProperties",
    "BoundProperty",
    "SplitConstants",
    "bind_expression",
    "bind_properties",
    "bind_property",
    "needed_constants",
    "split_constants",
    "without_unused_faults",
]


@dataclass(frozen=True)
class BoundProperty:
    """A property of a bound model, or the fault that prevents it from being checked.

    Attributes:
        name, span: as in the text.
        type: type of its value; None if it has a fault of names or types.
        constants: the known values of the constants of the model and the properties.
        undefined: constants without a value in the text: all of the model, and those of the
            properties that the property depends on.
        missing: constants in `undefined` that were not given.
        fault: why the property cannot be checked; None if it can.
        comments: the comments above the property, including RESULT lines.
        bound: the bound formula; None if there is a fault.
    """

    name: str | None
    type: Type | None
    constants: Mapping[str, Value] = field(repr=False)
    undefined: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    fault: InputError | None = None
    comments: tuple[str, ...] = field(default=(), repr=False)
    span: Span = field(default=NO_SPAN, compare=False, repr=False)
    bound: Expression | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        return f"<BoundProperty: {self}{', faulty' if self.fault else ''}>"

    def __str__(self) -> str:
        """The name of the property, or its text on one line."""
        return self.name or " ".join(self.span.text.strip().rstrip(";").split())

    @property
    def formula(self) -> Expression:
        """The formula over variables, literals and labels, with other properties inlined.

        Raises:
            InputError: the property has a fault.
        """
        if self.bound is None:
            assert self.fault is not None
            raise self.fault
        return self.bound


@dataclass(frozen=True)
class BoundProperties:
    """The properties of a file in its order, and the labels of the model and the file."""

    model: BoundModel = field(repr=False)
    properties: tuple[BoundProperty, ...]
    labels: Mapping[str, Expression] = field(repr=False)
    constants: Mapping[str, Value]

    def find(self, which: str | int) -> BoundProperty:
        """The property with a name or a number (from 1, also as text). Raises NameFault."""
        if isinstance(which, str):
            for p in self.properties:
                if p.name == which:
                    return p
        if str(which).isdecimal() and 1 <= int(which) <= len(self.properties):
            return self.properties[int(which) - 1]
        hint = suggest(str(which), (p.name for p in self.properties if p.name is not None))
        raise NameFault(
            Diagnostic(
                f"there is no property {which} among the {len(self.properties)} properties",
                NO_SPAN,
                "unknown-property",
                hint,
            )
        )


def needed_constants(program: Program, file: PropertiesFile) -> tuple[tuple[str, ...], ...]:
    """The constants that must be given for each property.

    Returns:
        For each property, all undefined constants of the model, then the undefined constants of
        the properties that it depends on.
    """
    report = DiagnosticCollector()
    table = SymbolTable(report, exact=False)
    table.add(program.constants, program.formulas)
    table.add(file.constants, file.formulas)
    labels = {x.name: x.expression for x in program.observables if x.name is not None}
    labels |= {x.name: x.expression for x in program.labels}
    texts = PropertyReferences(table, file, labels)
    return tuple(texts.undefined(p.formula, program.constants) for p in file.properties)


class SplitConstants(NamedTuple):
    """Given constants of the model and of the properties, and a warning for each unknown one."""

    of_model: dict[str, ConstantValue]
    of_properties: dict[str, ConstantValue]
    warnings: tuple[Diagnostic, ...]


def split_constants(
    program: Program, file: PropertiesFile | None, given: Mapping[str, ConstantValue]
) -> SplitConstants:
    """Split given constants into those for `bind` and those for `bind_properties`.

    An unknown name is only a warning: if it is a misspelt one, the correct constant is undefined,
    which is an error.
    """
    of_model = {c.name for c in program.constants}
    of_file = {c.name for c in file.constants} if file is not None else set()
    split = SplitConstants(
        {}, {}, tuple(_unknown(n, of_model | of_file) for n in given if n not in of_model | of_file)
    )
    for name, value in given.items():
        if name in of_model:
            split.of_model[name] = value
        elif name in of_file:
            split.of_properties[name] = value
    return split


def _unknown(name: str, known: Iterable[str]) -> Diagnostic:
    message = (
        f"constant {name} is given a value, but neither the model nor the properties declare it"
    )
    return Diagnostic(message, NO_SPAN, "unknown-constant", suggest(name, known), "warning")


@with_deep_recursion
def bind_properties(
    file: PropertiesFile, model: BoundModel, constants: Mapping[str, ConstantValue] | None = None
) -> BoundProperties:
    """Bind properties to a model.

    Args:
        file: the parsed properties.
        model: the bound model.
        constants: values of the constants that the file leaves undefined; constants of the model
            are ignored.

    Raises:
        InputError: constants or labels that no property uses are faulty, or a given value is. The
            fault of a single property is its attribute `fault`.

    Examples:
        >>> from symcheck import load, parse_properties, pretty
        >>> die = load("models/die/die.pm").bound
        >>> bound = bind_properties(parse_properties('P=? [ F "done" ]'), die)
        >>> pretty(bound.properties[0].formula)
        'P=? [ F "done" ]'
    """
    return _Properties(file, model, constants or {}).bind(range(len(file.properties)))


@with_deep_recursion
def bind_property(
    file: PropertiesFile, index: int, model: BoundModel, constants: Mapping[str, ConstantValue]
) -> tuple[BoundProperty, Mapping[str, Expression]]:
    """Bind one property, and leave the others of its file unbound.

    Args:
        file: the properties.
        index: the number of the property, from 0.
        model: the bound model.
        constants: as for `bind_properties`.

    Returns:
        The property, and the labels that it may use.

    Raises:
        InputError: as for `bind_properties`.
    """
    bound = _Properties(file, model, constants).bind([index])
    return bound.properties[0], bound.labels


@with_deep_recursion
def without_unused_faults(
    file: PropertiesFile, model: BoundModel
) -> tuple[PropertiesFile, InputError | None]:
    """The file without the faulty constants, formulas and labels that no property uses.

    Returns:
        The file, and all faults of what it lacks as one; None if there are none.
    """
    return _Properties(file, model, {}).without_unused_faults()


@with_deep_recursion
def bind_expression(
    expression: Expression,
    model: BoundModel,
    *,
    labels: Mapping[str, Expression] | None = None,
    constants: Mapping[str, Value] | None = None,
    formulas: Mapping[str, Expression] | None = None,
) -> tuple[Expression, Type]:
    """Bind a state expression without operators such as P.

    Args:
        expression: may refer to variables, constants, formulas and labels of the model.
        model: the bound model.
        labels: further labels.
        constants: values of further constants.
        formulas: further formulas.

    Returns:
        The simplified expression over variables and literals, and its type.

    Raises:
        NameFault, TypeFault, InputError: all faults of the expression.
    """
    report = DiagnosticCollector()
    table = _table(model, report)
    for name, value in (constants or {}).items():
        table.define(Constant(name, type_of_value(value), None), value)
    table.formulas.update({n: Formula(n, x) for n, x in (formulas or {}).items()})
    known = {**model.labels, **(labels or {})}

    def inline(node: Tree) -> Tree:
        return known.get(node.name, node) if isinstance(node, LabelReference) else node

    scope, whole = Scope(table), transform(expression, inline)
    result = scope.typer().state(whole)
    report.raise_all()
    assert result is not None
    return scope.expand(whole), result


def _table(model: BoundModel, report: DiagnosticCollector) -> SymbolTable:
    """The symbols of a model, as properties refer to them.

    Properties are bound in rational arithmetic on every engine: 0.1 is a tenth in them.
    """
    table = SymbolTable(report, exact=True)
    for constant in model.program.constants:
        name = constant.name
        if name in model.constants:
            table.define(constant, model.constants[name], model.definitions.get(name))
    table.parameters = model.parameters.keys()
    table.constants.update({c.name: c for c in model.program.constants})
    table.formulas.update({f.name: f for f in model.program.formulas})
    table.variables.update({v.name: v.type for v in model.variables})
    return table


class _Properties:
    """Binds the properties of one file."""

    def __init__(
        self, file: PropertiesFile, model: BoundModel, constants: Mapping[str, ConstantValue]
    ) -> None:
        self.file = file
        self.model = model
        self.table = _table(model, DiagnosticCollector())
        of_model = {f'"{name}"' for name in model.labels}  # a property may be called as one is
        self.faults = {name: fault for name, fault in file.faulty if name not in of_model}
        for constant in file.constants:
            with self._noted(constant.name):
                self.table.add((constant,), ())
        for formula in file.formulas:
            with self._noted(formula.name):
                self.table.add((), (formula,))
        own_labels = {label.name for label in file.labels}
        self.table.labels = model.labels.keys() | own_labels | RESERVED_LABELS
        self.table.actions = {e.action for e in model.events if e.action is not None}
        self.table.quotes_labels = True
        set_constants(
            self.table,
            file.constants,
            {n: v for n, v in constants.items() if n not in model.constants},
            "properties file",
        )
        self.texts = PropertyReferences(self.table, file, model.labels)
        self.scope = Scope(self.table)
        self._check()

    def bind(self, indices: Iterable[int]) -> BoundProperties:
        if fault := self.without_unused_faults()[1]:
            raise fault
        constants = dict(self.model.constants) | self._values(self.file.constants)
        labels = dict(self.model.labels) | self._labels()
        properties = tuple(self._property(i, constants) for i in indices)
        return BoundProperties(self.model, properties, labels, constants)

    @contextmanager
    def _noted(self, name: str) -> Iterator[None]:
        """Note what is reported in this context as the fault of a definition."""
        report = self.table.report
        self.table.report = DiagnosticCollector()
        if name in self.faults:
            self.table.report.absorb(self.faults[name])
        yield
        if fault := self.table.report.fault():
            self.faults[name] = fault
        self.table.report = report

    def _check(self) -> None:
        """Check the definitions of the file. A fault in what one of them uses is its own too.

        Raises InputError if a given value is faulty.
        """
        file, taken = self.file, set(self.model.labels)
        done = set[str]()
        for name in (*(c.name for c in file.constants), *(f.name for f in file.formulas)):
            if self._fault_of(Name(name)) is None:
                with self._noted(name):
                    self.table.check_cycles([name], done)
                if name in self.faults:
                    done = set()  # others may use the cycle too
        for constant in file.constants:
            if self._fault_of(Name(constant.name)) is None:
                with self._noted(constant.name):
                    check_constants(self.scope, [constant])
        for label in file.labels:
            with self._noted(f'"{label.name}"'):
                check_label(self.table, label, taken)
                self.texts.check_label(label.name)
        scope = self.scope
        for label in file.labels:
            if self._fault_of(LabelReference(label.name)) is None:
                quoted = f'"{label.name}"'
                with self._noted(quoted):
                    scope.typer().boolean(self.texts.label(label.expression), f"label {quoted}")
                if quoted in self.faults:
                    scope = Scope(self.table)  # it reports a fault in a formula again
        repeated = self.table.repeated
        self.table.repeated = {n: repeated[n] for n in repeated if not self._fault_of(Name(n))}
        self.table.check_repeated()
        self.table.report.raise_all()

    def _fault_of(self, formula: Expression) -> InputError | None:
        """The faults of the definitions that a formula uses."""
        return self._all_of(self.texts.used(formula)) if self.faults else None

    def without_unused_faults(self) -> tuple[PropertiesFile, InputError | None]:
        file = self.file
        if not self.faults:
            return file, None
        used = set[str]().union(*(self.texts.used(p.formula) for p in file.properties))

        def kept(name: str, formula: Expression) -> bool:
            return name in used or self._fault_of(formula) is None

        sound = replace(
            file,
            constants=tuple(c for c in file.constants if kept(c.name, Name(c.name))),
            formulas=tuple(f for f in file.formulas if kept(f.name, Name(f.name))),
            labels=tuple(x for x in file.labels if kept(f'"{x.name}"', LabelReference(x.name))),
        )
        return sound, self._all_of(self.faults.keys() - used - dict(file.faulty).keys())

    def _all_of(self, names: Set[str]) -> InputError | None:
        report = DiagnosticCollector()
        for name in self.faults.keys() & names:
            report.absorb(self.faults[name])
        return report.fault()

    def _values(self, constants: Iterable[Constant]) -> dict[str, Value]:
        """The values of those constants that have one."""
        values: dict[str, Value] = {}
        for constant in constants:
            if self._fault_of(Name(constant.name)):
                continue
            try:
                values[constant.name] = self.table.value(constant.name)
            except InputError:
                continue  # reported as the fault of each property that depends on it
        return values

    def _labels(self) -> dict[str, Expression]:
        """The labels whose constants are all known."""
        result: dict[str, Expression] = {}
        for label in self.file.labels:
            if self._fault_of(LabelReference(label.name)):
                continue
            try:
                result[label.name] = self.scope.expand(self.texts.label(label.expression))
            except InputError:
                continue
        return result

    def _property(self, number: int, constants: Mapping[str, Value]) -> BoundProperty:
        text = self.file.properties[number]
        needed = self.texts.undefined(text.formula, self.model.program.constants)
        missing = tuple(
            n
            for n in needed
            if n not in self.table.given.keys() | self.model.constants | self.table.parameters
        )
        result: Type | None = None
        formula: Expression | None = None
        fault: InputError | None = None
        try:
            if fault := self._fault_of(text.formula):
                raise fault
            whole, result = self._typed(number)
            if missing:
                raise NameFault(*(undefined(self.table.constants[n]) for n in missing))
            for label in self.texts.used_labels(whole):
                self.scope.expand(self.texts.label(label))
            formula = for_one_player(self.scope.expand(whole), self.model)
            if self.model.parameters:
                from symcheck.semantics.binding.parameters import with_open_thresholds

                formula = with_open_thresholds(formula, self.model.parameters)
            check_conditions(formula, self.model)
        except InputError as error:
            fault = error
            formula = None
        return BoundProperty(
            text.name, result, constants, needed, missing, fault, text.comments, text.span, formula
        )

    def _typed(self, number: int) -> tuple[Expression, Type]:
        """The formula with properties inlined, and its type. Raises NameFault or TypeFault."""
        self.table.report = DiagnosticCollector()
        self.texts.check_property(number)
        self.table.report.raise_all()
        # A new scope reports a fault in a formula for every property that uses it.
        typer = Scope(self.table).typer(self._label_type)
        whole = self.texts.inlined(self.file.properties[number].formula)
        result = typer.state(whole)
        for node in nodes(whole):
            if isinstance(node, Quantile):
                self._check_quantile(node)
        self.table.report.raise_all()
        assert result is not None
        return whole, result

    def _check_quantile(self, node: Quantile) -> None:
        """Report a bound variable that would hide a name of the model or of the file."""
        name, table = node.variable, self.table
        for kind, names in (
            ("variable", table.variables),
            ("constant", table.constants),
            ("formula", table.formulas),
        ):
            if name in names:
                message = f"the bound {name} of a quantile hides the {kind} {name}"
                hint = f"a name that is free, such as {name}_bound"
                table.report.name("quantile", message, node.span, hint)

    def _label_type(self, node: LabelReference) -> Type | None:
        if self.texts.is_label(node.name):
            return Type.BOOL
        self.table.report.name(
            "unknown-label",
            f'unknown label or property "{node.name}"',
            node.span,
            suggest(node.name, self.texts.known()) or f'declare it: label "{node.name}" = …;',
        )
        return None
