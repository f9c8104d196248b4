"""Name resolution: the constants, formulas and variables of a text, and the renaming of modules."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from contextlib import suppress
from fractions import Fraction

from symcheck.errors import NO_SPAN, Diagnostic, InputError, NameFault, Span, TypeFault
from symcheck.semantics.diagnostics import DiagnosticCollector, suggest
from symcheck.semantics.expressions.evaluate import INT_MAX, evaluate, evaluate_constant, is_int64
from symcheck.semantics.expressions.literals import (
    as_double,
    as_expression,
    convert,
    format_value,
    type_of_value,
)
from symcheck.semantics.expressions.simplify import simplify, simplify_node
from symcheck.semantics.expressions.types import Typer, type_of
from symcheck.semantics.model import Value
from symcheck.syntax.ast import PRIME, Expression, LabelReference, Literal, Name, Type
from symcheck.syntax.declarations import Constant, Formula
from symcheck.syntax.operators import CTL_HINTS
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = [
    "ConstantValue",
    "Scope",
    "SymbolTable",
    "names_in",
    "read_value",
    "undefined",
    "unknown",
]

_MOST_CHARACTERS = 60
"""Names of variables up to this length are listed in a hint."""

_TRUTHS = ("true", "false")

ConstantValue = Value | str


class SymbolTable:
    """Constants, formulas and variables by name; values of constants are computed on demand.

    Attributes:
        labels: the names of the labels, for a hint at a name that is no expression.
        actions: those of the actions, likewise.
        quotes_labels: whether expressions may have labels, in quotes.
        given: values for constants that the text leaves undefined.
        repeated: values for constants that the text defines; they must agree with the definition.
        parameters: constants that are left open: they have no value, and remain names.
        exact: values are fractions. A constant without a rational value has a double near it; where
            it is used, its definition counts.
    """

    def __init__(self, report: DiagnosticCollector, exact: bool) -> None:
        self.report = report
        self.exact = exact
        self.constants: dict[str, Constant] = {}
        self.formulas: dict[str, Formula] = {}
        self.variables: dict[str, Type] = {}
        self.labels: Set[str] = frozenset()
        self.actions: Set[str] = frozenset()
        self.quotes_labels = False
        self.given: dict[str, ConstantValue] = {}
        self.repeated: dict[str, ConstantValue] = {}
        self.parameters: Set[str] = frozenset()
        self._values: dict[str, Value | InputError] = {}
        self._expressions: dict[str, Expression] = {}

    # -------------------------------------------------------------------------------------- filling

    def declare(self, kind: str, name: str, span: Span) -> bool:
        """Whether `name` is free for a constant, formula or variable; reports a duplicate name."""
        old = self.kind_of(name)
        if old is not None:
            message = f"{kind} {name}: there is a {old} of this name already"
            self.report.name("duplicate-name", message, span)
        return old is None

    def kind_of(self, name: str) -> str | None:
        """What a name stands for: "constant", "formula" or "variable"; None if it is free."""
        if name in self.constants:
            return "constant"
        return (
            "formula" if name in self.formulas else "variable" if name in self.variables else None
        )

    def add(self, constants: tuple[Constant, ...], formulas: tuple[Formula, ...]) -> None:
        """Declare constants and formulas."""
        for constant in constants:
            if self.declare("constant", constant.name, constant.span):
                self.constants[constant.name] = constant
        for formula in formulas:
            if self.declare("formula", formula.name, formula.span):
                self.formulas[formula.name] = formula

    def define(
        self, constant: Constant, value: Value, expression: Expression | None = None
    ) -> None:
        """Define a constant with a known value, and an expression for its exact value."""
        self.constants[constant.name] = constant
        self._values[constant.name] = value
        if expression is not None:
            self._expressions[constant.name] = expression

    # ------------------------------------------------------------------------------------- checking

    def definition(self, name: str) -> Expression | None:
        """The expression that defines a constant or formula; None if there is none."""
        if name in self.formulas:
            return self.formulas[name].expression
        return self.constants[name].value if name in self.constants else None

    def check_cycles(self, names: Iterable[str], done: set[str]) -> None:
        """Report those of these constants and formulas whose definitions are circular.

        Args:
            names: the constants and formulas.
            done: those that are checked; the others that are visited are added.
        """
        for start in names:
            self._visit(start, [], done)

    def _visit(self, name: str, path: list[str], done: set[str]) -> None:
        if name in path:
            cycle = path[path.index(name) :]
            node = self.formulas.get(name) or self.constants[name]
            kind = "formula" if name in self.formulas else "constant"
            self.report.name(
                "cycle",
                f"{kind} {name} is defined in terms of itself: {' -> '.join([*cycle, name])}",
                node.span,
            )
        if name in done:
            return
        done.add(name)
        definition = self.definition(name)
        for used in (
            dict.fromkeys(n.name for n in names_in(definition)) if definition is not None else ()
        ):
            self._visit(used, [*path, name], done)

    def used_by(self, expression: Expression) -> set[str]:
        """The names that an expression depends on, directly or through definitions."""
        result: set[str] = set()
        waiting = [expression]
        while waiting:
            for node in names_in(waiting.pop()):
                if node.name not in result:
                    result.add(node.name)
                    definition = self.definition(node.name)
                    if definition is not None:
                        waiting.append(definition)
        return result

    # --------------------------------------------------------------------------------------- values

    def value(self, name: str) -> Value:
        """The value of a constant, converted to its declared type.

        The definitions must not be circular (see `check_cycles`). Raises InputError if the constant
        has no value.
        """
        if name not in self._values:
            # Definitions are not circular here, but given values may be.
            itself = f"the given value of constant {name} refers to {name} itself"
            self._values[name] = NameFault(Diagnostic(itself, self.constants[name].span, "cycle"))
            try:
                self._values[name] = self._compute(self.constants[name])
            except InputError as fault:
                self._values[name] = fault
        value = self._values[name]
        if isinstance(value, InputError):
            raise value
        return value

    def expression(self, name: str, span: Span = NO_SPAN) -> Expression:
        """An expression without names for the exact value of a constant: a literal if that has a
        fraction of moderate length. Raises InputError if the constant has no value.
        """
        if self.is_open(name):
            definition = self.constants[name].value
            return (
                Name(name, span=span)
                if definition is None
                else simplify(self._without_variables(definition))
            )
        value = self.value(name)
        known = self._expressions.get(name)
        if isinstance(known, Literal):
            return Literal(known.value, known.type, span=span)
        return as_expression(value, self.constants[name].type, span) if known is None else known

    def is_open(self, name: str) -> bool:
        """Whether a constant is a parameter, or defined by some."""
        if not self.parameters:
            return False
        return name in self.parameters or not self.parameters.isdisjoint(self.used_by(Name(name)))

    def check_repeated(self) -> None:
        """Report given values that differ from the definitions in the text.

        Raises InputError if a constant has no value.
        """
        for name, given in self.repeated.items():
            constant, value = self.constants[name], self.value(name)
            if self._read_given(constant, given) != value:
                message = (
                    f"constant {name} is given the value {given}, but it is defined as "
                    f"{format_value(value)}"
                )
                hint = f"write `const {constant.type.value} {name};` to leave it undefined"
                self.report.name("constant-defined", message, constant.span, hint)

    def _compute(self, constant: Constant) -> Value:
        if self.is_open(constant.name):
            message = f"constant {constant.name} has no value: it is a parameter, or defined by one"
            hint = "ranges of variables and bounds of properties need numbers: -const gives them"
            raise NameFault(Diagnostic(message, constant.span, "parameter", hint))
        if constant.name in self.given:
            return self._read_given(constant, self.given[constant.name])
        if constant.value is None:
            raise NameFault(undefined(constant))
        return self._settle(constant, self._without_variables(constant.value))

    def _settle(self, constant: Constant, bare: Expression) -> Value:
        """The value of a constant whose definition has no names; notes its exact value."""
        value = convert(self._evaluate(bare), constant.type, self.exact)
        if constant.type is Type.DOUBLE and not (isinstance(value, float) and value - value != 0):
            self._expressions[constant.name] = as_double(simplify(bare))
        return value

    def _evaluate(self, expression: Expression) -> Value:
        return evaluate_constant(expression) if self.exact else evaluate(expression, {})

    def _without_variables(self, expression: Expression) -> Expression:
        def replace(node: Tree) -> Tree:
            if not isinstance(node, Name):
                return node
            if node.name in self.constants:
                return self.expression(node.name, node.span)
            if node.name in self.formulas:
                return self._without_variables(self.formulas[node.name].expression)
            raise NameFault(
                unknown(node, self, "the value of a constant may depend on constants only")
            )

        return transform(expression, replace)

    def _read_given(self, constant: Constant, given: ConstantValue) -> Value:
        if isinstance(given, str):
            expression = read_value(given, f"value of {constant.name}")
            for node in names_in(expression):
                if node.name not in {**self.constants, **self.formulas, **self.variables}:
                    hint = suggest(node.name, self.constants) or _VALUE_HINT
                    raise NameFault(
                        Diagnostic(f"unknown name {node.name}", node.span, "unknown-name", hint)
                    )
            bare = self._without_variables(expression)
            given = convert(self._evaluate(bare), type_of(bare, {}), self.exact)
        elif isinstance(given, float) and given - given == 0:
            given = Fraction(repr(given))  # the decimal that the user sees
            bare = as_expression(given, Type.DOUBLE)
        else:
            bare = as_expression(given, type_of_value(given))
        try:
            convert(given, constant.type, self.exact)
            return self._settle(constant, bare)
        except TypeError:
            message = (
                f"constant {constant.name} is of type {constant.type.value}: its value cannot be "
                f"{format_value(given)}"
            )
            large = isinstance(given, Fraction | float) and not -(2**63) < given < 2**63
            hint = _LARGEST_INT if large else _TYPE_HINTS[constant.type]
            raise TypeFault(Diagnostic(message, constant.span, "constant-type", hint)) from None


_VALUE_HINT = "a value is a number, true, false, or an expression over other constants"
_LARGEST_INT = f"a value of type int is at most {INT_MAX}; one of type double may be larger"
_TYPE_HINTS = {
    Type.INT: "a value of type int is a whole number without a decimal point, such as 3",
    Type.DOUBLE: "a value of type double is a number, such as 0.25 or 1/4",
    Type.BOOL: "a value of type bool is true or false",
}


def names_in(tree: Tree) -> list[Name]:
    """All `Name` nodes of a tree."""
    return [n for n in nodes(tree) if isinstance(n, Name)]


def read_value(text: str, name: str = "<expression>") -> Expression:
    """Parse the value of a constant, such as `5`, `0.25`, `1/3` or `2*N`.

    Args:
        text: the expression.
        name: the name of the text in diagnostics.

    Raises:
        SyntaxFault: the text is not an expression.
    """
    plain = text.strip()
    if plain.lower() in ("true", "false"):
        return Literal(plain.lower() == "true", Type.BOOL)
    digits = plain.removeprefix("-")
    if digits.isascii() and digits.isdigit():
        whole = int(plain)
        return (
            Literal(whole, Type.INT) if is_int64(whole) else Literal(Fraction(whole), Type.DOUBLE)
        )
    if digits[:1].isdigit() and not {"/", "_"} & set(plain):
        with suppress(ValueError):
            return Literal(Fraction(plain), Type.DOUBLE)
    from symcheck.syntax.parse import parse_expression

    return parse_expression(plain, name)


def undefined(constant: Constant) -> Diagnostic:
    """The diagnostic about a constant without a value."""
    hint = (
        f"give it with -const {constant.name}=VALUE, "
        f"in Python with constants='{constant.name}=VALUE'"
    )
    return Diagnostic(
        f"constant {constant.name} is not defined", constant.span, "undefined-constant", hint
    )


def _variables(table: SymbolTable) -> str:
    """The variables, if a line has room for them, as the beginning of a hint."""
    text = ", ".join(table.variables)
    return f"the variables are {text}; or " if 0 < len(text) <= _MOST_CHARACTERS else ""


def _reward_structure(node: Name) -> str | None:
    """A hint at quotes if a name stands alone between braces, as in `R{cost}=?`."""
    text, span = node.span.source.text, node.span
    if text[span.start - 1 : span.start] + text[span.end : span.end + 1] == "{}":
        return f'a reward structure is named in quotes: {{"{node.name}"}}'
    return None


def _no_expression(name: str, table: SymbolTable) -> str | None:
    """A hint at a name of something else than a value."""
    if name in table.labels and table.quotes_labels:
        return f'the label is written "{name}"'
    if name in table.labels:
        return f"{name} is a label; a formula can be used in a guard: formula {name} = …;"
    if name in table.actions:
        return f"{name} is an action, and no condition on states"
    return "write the condition itself, such as !(…)" if name in ("else", "otherwise") else None


def unknown(node: Name, table: SymbolTable, why: str | None = None) -> Diagnostic:
    """The diagnostic about an unknown name, or about a variable that is not allowed (`why`)."""
    if node.name in table.variables:
        return Diagnostic(f"{node.name} is a variable: {why}", node.span, "not-constant")
    if node.name.endswith(PRIME):
        before = node.name.removesuffix(PRIME)
        message = f"{node.name} is a value after the step, which is not known here"
        return Diagnostic(message, node.span, "prime", f"the value before the step is {before}")
    known = (*table.constants, *table.formulas, *table.variables)
    hint = (
        _no_expression(node.name, table)
        or _reward_structure(node)
        or (f"did you mean {node.name.lower()}?" if node.name.lower() in _TRUTHS else None)
        or CTL_HINTS.get(node.name)
        or suggest(node.name, known)
        or f"{_variables(table)}declare a constant: const int {node.name}; "
        f"or const double {node.name};"
    )
    return Diagnostic(f"unknown name {node.name}", node.span, "unknown-name", hint)


class Scope:
    """The names of a symbol table as one module sees them, through the renaming of the module.

    Formulas are expanded before names are renamed, so that a formula refers to the variables of the
    copy. A renaming of the formula itself replaces it by another formula.
    """

    def __init__(self, table: SymbolTable, renaming: Mapping[str, str] | None = None) -> None:
        self.table = table
        self._renaming = renaming or {}
        self._plain = Scope(table) if renaming else self
        self._types: dict[str, Type | None] = {}
        self._formulas: dict[str, Expression] = {}

    def renamed(self, name: str) -> str:
        """The new name of a variable (with or without a prime), action or constant of the base
        module.
        """
        if name.endswith(PRIME):
            return self.renamed(name.removesuffix(PRIME)) + PRIME
        return self._renaming.get(name, name)

    # ---------------------------------------------------------------------------------------- types

    def typer(self, label: Callable[[LabelReference], Type | None] | None = None) -> Typer:
        """A type checker for expressions over these names; for `label` see `Typer`."""
        return Typer(self.table.report, self.type, label)

    def typer_after_step(self) -> Typer:
        """A type checker for expressions that may also read the values after the step."""

        def name(node: Name) -> Type | None:
            variable = self.renamed(node.name).removesuffix(PRIME)
            is_known = node.name.endswith(PRIME) and variable in self.table.variables
            return self.table.variables[variable] if is_known else self.type(node)

        return Typer(self.table.report, name, None)

    def constant_typer(self) -> Typer:
        """A type checker for expressions that must not depend on variables."""

        def name(node: Name) -> Type | None:
            new = Name(self.renamed(node.name), span=node.span)
            if new.name in self.table.variables:
                self.table.report.absorb(
                    NameFault(unknown(new, self.table, "only constants may be used here"))
                )
                return None
            if new.name in self.table.formulas:
                return Typer(self.table.report, name, None).state(
                    self.table.formulas[new.name].expression
                )
            return self.type(node)

        return Typer(self.table.report, name, None)

    def type(self, node: Name) -> Type | None:
        """The type of a name; reports an unknown name and returns None."""
        name, table = self.renamed(node.name), self.table
        if name in table.variables:
            return table.variables[name]
        if name in table.constants:
            return table.constants[name].type
        if name not in table.formulas:
            given_for = "" if name == node.name else f", to which the module renames {node.name}"
            diagnostic = unknown(Name(name, span=node.span), table)
            table.report.name(
                diagnostic.code, diagnostic.message + given_for, diagnostic.span, diagnostic.hint
            )
            return None
        view = self._plain if node.name in self._renaming else self
        if name not in view._types:
            view._types[name] = Typer(table.report, view.type, None).state(
                table.formulas[name].expression
            )
        return view._types[name]

    # ------------------------------------------------------------------------------------ expansion

    def expand(self, expression: Expression) -> Expression:
        """The simplified expression over variables and literals; it must be well typed.

        Raises InputError if a constant has no value.
        """
        return transform(expression, self._replace)

    def constant(self, expression: Expression, kind: Type) -> Value:
        """The value of an expression over constants. Raises InputError if it has none."""
        return convert(
            evaluate(self.expand(expression), {}, exact=self.table.exact), kind, self.table.exact
        )

    def _replace(self, node: Tree) -> Tree:
        if not isinstance(node, Name):
            return simplify_node(node, self.table.variables)
        name, table = self.renamed(node.name), self.table
        if name in table.constants:
            return table.expression(name, node.span)
        if name not in table.formulas:
            return node if name == node.name else Name(name, span=node.span)
        view = self._plain if node.name in self._renaming else self
        if name not in view._formulas:
            view._formulas[name] = view.expand(table.formulas[name].expression)
        return view._formulas[name]
