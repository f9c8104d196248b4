"""Static checks of a program, which do not depend on the values of constants.

They check names, types, and which modules and commands write which variables.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from symcheck.errors import NO_SPAN, NameFault, Span
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.binding.module_renaming import ModuleInstance, module_instances
from symcheck.semantics.binding.names import ConstantValue, Scope, SymbolTable, names_in, undefined
from symcheck.semantics.diagnostics import suggest
from symcheck.semantics.expressions.literals import type_of_value
from symcheck.semantics.expressions.types import article, rounding_hint
from symcheck.syntax.ast import PRIME, Binary, Name, Type
from symcheck.syntax.declarations import (
    Assignment,
    Command,
    Constant,
    Hiding,
    Label,
    ModuleReference,
    Observable,
    Program,
    Renaming,
    Synchronised,
    VariableDeclaration,
)
from symcheck.syntax.operators import Operator
from symcheck.syntax.traversal import Tree, conjuncts, nodes

if TYPE_CHECKING:
    from symcheck.semantics.binding.kept_modules import KeptModules

__all__ = [
    "RESERVED_LABELS",
    "CheckedProgram",
    "DeclaredVariable",
    "check_assignable",
    "check_constants",
    "check_label",
    "check_program",
    "check_values_given",
    "set_constants",
]

RESERVED_LABELS = frozenset({"init", "deadlock"})


@dataclass(frozen=True, slots=True)
class DeclaredVariable:
    """A declared variable, its module (None: global), and the scope of its declaration."""

    module: str | None
    declaration: VariableDeclaration
    scope: Scope


@dataclass(frozen=True, slots=True)
class CheckedProgram:
    """A program and its resolved names.

    Attributes:
        root: the scope outside of modules.
        modules: the modules after renaming, each with its scope.
        declared: the declared variables, in order.
    """

    program: Program
    table: SymbolTable
    root: Scope
    modules: Sequence[tuple[ModuleInstance, Scope]]
    declared: Mapping[str, DeclaredVariable]

    @property
    def is_concurrent(self) -> bool:
        """Whether players choose at once, so that updates may read the values after the step."""
        return self.program.type is not None and self.program.type.concurrent


def check_program(
    program: Program, table: SymbolTable, kept: KeptModules | None = None
) -> CheckedProgram:
    """Add the declarations of a program to the table, and report its faults to the table's report.

    Args:
        program: the program.
        table: an empty table.
        kept: the modules that are known from the program before.

    Raises:
        InputError: definitions are circular, so that expressions that use them cannot be checked.
    """
    table.add(program.constants, program.formulas)
    table.labels = {label.name for label in program.labels}
    root = Scope(table)
    instances = module_instances(program, table.report)
    commands = (c for i in instances for c in i.base_module.commands)
    table.actions = {c.action for c in commands if c.action is not None}
    modules = [(instance, Scope(table, instance.renaming)) for instance in instances]
    declared: dict[str, DeclaredVariable] = {}
    for name, variable, span in _declared(program, root, modules):
        if table.declare("variable", name, span):
            table.variables[name] = variable.declaration.type
            declared[name] = variable
    table.check_cycles((*table.constants, *table.formulas), set())
    if "cycle" in table.report.codes:
        table.report.raise_all()
    checked = CheckedProgram(program, table, root, modules, declared)
    _check(checked, kept)
    return checked


def _declared(
    program: Program, root: Scope, modules: Iterable[tuple[ModuleInstance, Scope]]
) -> Iterator[tuple[str, DeclaredVariable, Span]]:
    for declaration in program.globals:
        yield declaration.name, DeclaredVariable(None, declaration, root), declaration.span
    for instance, scope in modules:
        for declaration in instance.base_module.variables:
            variable = DeclaredVariable(instance.name, declaration, scope)
            span = instance.span if instance.renaming else declaration.span
            yield scope.renamed(declaration.name), variable, span


def _check(checked: CheckedProgram, kept: KeptModules | None) -> None:
    program, report, typer = checked.program, checked.table.report, checked.root.typer()
    if not program.modules:
        hint = "" if program.span.source.text.strip() else "the text is empty"
        report.input("no-module", "a model needs at least one module", program.span, hint or None)
    check_constants(checked.root, program.constants)
    for formula in program.formulas:
        # The type of an unused formula is not checked.
        for node in names_in(formula.expression):
            checked.root.type(node)
    for variable in checked.declared.values():
        _check_variable(checked, variable)
    for number, (instance, scope) in enumerate(checked.modules):
        if kept is not None and kept.has(number, instance):
            continue
        if instance.base_module.invariant is not None:
            scope.typer().boolean(instance.base_module.invariant, "an invariant")
        for command in instance.base_module.commands:
            _check_command(checked, instance, scope, command)
    taken: set[str] = set()
    for label in program.labels:
        check_label(checked.table, label, taken)
        typer.boolean(label.expression, f'label "{label.name}"')
    observed: set[str] = set()  # a label may have the same name
    for observable in program.observables:
        check_label(checked.table, observable, observed)
        typer.state(observable.expression)
    if program.initial is not None:
        typer.boolean(program.initial, "the condition on initial states")
    _check_system(checked)
    _check_rewards(checked)


# ----------------------------------------------------------------------------- constants and labels


def set_constants(
    table: SymbolTable,
    declared: Iterable[Constant],
    given: Mapping[str, ConstantValue],
    where: str = "model",
) -> None:
    """Add given values of constants to the table; report unknown constants."""
    known = {c.name: c for c in declared}
    for name, value in given.items():
        if name not in known:
            kind = type_of_value(value).value if not isinstance(value, str) else "double"
            hint = suggest(name, known) or f"declare it there: const {kind} {name};"
            table.report.name(
                "unknown-constant",
                f"constant {name} is given a value, but the {where} has no such constant",
                NO_SPAN,
                hint,
            )
            continue
        store = table.given if known[name].value is None else table.repeated
        store[name] = value.item() if hasattr(value, "item") else value  # numpy's scalars


def check_constants(scope: Scope, constants: Iterable[Constant]) -> None:
    """Check the types of constant definitions."""
    for constant in constants:
        if constant.value is not None:
            actual = scope.constant_typer().state(constant.value)
            check_assignable(
                scope.table,
                f"constant {constant.name}",
                constant.type,
                actual,
                constant.value.span,
                _constant_hint(constant, actual),
            )


def _constant_hint(constant: Constant, actual: Type | None) -> str | None:
    """How a constant with a value of another type is declared."""
    if actual is None or constant.value is None:
        return None
    from symcheck.syntax.printer import pretty

    written = f"write const {actual.value} {constant.name} = {pretty(constant.value)};"
    if re.match(r"const\s+\w+\s*=", constant.span.text):
        return f"const alone is const int: {written}"
    if rounding_hint(actual, (constant.type,)) is not None:
        return f"{written} or round the value by floor(…), ceil(…) or round(…)"
    return written


def check_values_given(table: SymbolTable, constants: Iterable[Constant]) -> None:
    """Report the constants that have no value."""
    for constant in constants:
        if constant.value is None and constant.name not in table.given.keys() | table.parameters:
            table.report.absorb(NameFault(undefined(constant)))


def check_assignable(
    table: SymbolTable,
    what: str,
    expected: Type,
    actual: Type | None,
    span: Span,
    hint: str | None = None,
) -> None:
    """Check that a value of type `actual` can be assigned to type `expected`.

    The only implicit conversion is from int to double.
    """
    if actual is None or actual is expected or (actual is Type.INT and expected is Type.DOUBLE):
        return
    table.report.type(
        f"{what} is of type {expected.value}: its value cannot be {article(actual)}",
        span,
        hint or rounding_hint(actual, (expected,)) or _CONVERSIONS.get((actual, expected)),
    )


_CONVERSIONS = {
    (Type.BOOL, Type.INT): "condition ? 1 : 0 converts a bool to an int",
    (Type.INT, Type.BOOL): "a bool is true or false; n!=0 converts an int to a bool",
}


def check_label(table: SymbolTable, label: Label | Observable, taken: set[str]) -> None:
    """Check that the name of a label is not taken or reserved, and add it to those taken."""
    if label.name is None:
        return
    name, report = label.name, table.report
    if name in RESERVED_LABELS:
        message = f'label "{name}" is predefined and cannot be redefined'
        report.name("reserved-label", message, label.span)
    elif name in taken:
        report.name("duplicate-label", f'there is a label "{name}" already', label.span)
    taken.add(name)


# ------------------------------------------------------------------------------------------ modules


def _check_variable(checked: CheckedProgram, variable: DeclaredVariable) -> None:
    declaration, table = variable.declaration, checked.table
    typer = variable.scope.constant_typer()
    for bound in (declaration.low, declaration.high):
        if bound is not None:
            typer.integer(bound, f"a bound of {declaration.name}")
    match declaration.initial:
        case None:
            return
        case Binary(Operator.EQ, Name(declaration.name), value):
            from symcheck.syntax.printer import pretty

            message = "the initial value of a variable is written without its name"
            hint = f"write init {pretty(value)}"
            table.report.input("init-value", message, declaration.initial.span, hint)
            return
        case _:
            pass
    check_assignable(
        table,
        f"variable {declaration.name}",
        declaration.type,
        typer.state(declaration.initial),
        declaration.initial.span,
    )
    if checked.program.initial is not None:
        message = (
            f"variable {declaration.name} has an initial value, but the model has init … endinit"
        )
        table.report.input("init-twice", message, declaration.span, "omit one of them")


def _check_command(
    checked: CheckedProgram, instance: ModuleInstance, scope: Scope, command: Command
) -> None:
    typer = scope.typer()
    if command.others:
        _check_several_actions(checked, command.span)
    typer.boolean(command.guard, "the guard")
    for update in command.updates:
        if update.probability is not None:
            typer.numeric(update.probability, "a probability or rate")
        if update.upper is not None:
            typer.numeric(update.upper, "a probability")
        written: set[str] = set()
        for assignment in update.assignments:
            _check_assignment(checked, instance, scope, command, assignment)
            if assignment.variable in written:
                checked.table.report.name(
                    "assigned-twice",
                    f"{assignment.variable} is assigned twice in one update",
                    assignment.span,
                )
            written.add(assignment.variable)


def _check_several_actions(checked: CheckedProgram, span: Span) -> None:
    if not checked.is_concurrent:
        message = "several actions at once belong to concurrent games"
        hint = "a command has one action; several at once belong to a csg"
        checked.table.report.input("several-actions", message, span, hint)


def _check_assignment(
    checked: CheckedProgram,
    instance: ModuleInstance,
    scope: Scope,
    command: Command,
    assignment: Assignment,
) -> None:
    name, report = scope.renamed(assignment.variable), checked.table.report
    if (hint := _joined_assignments(checked, assignment)) is not None:
        report.input("update", "several assignments share these parentheses", assignment.span, hint)
        return
    typer = scope.typer_after_step() if checked.is_concurrent else scope.typer()
    actual = typer.state(assignment.expression)
    if name not in checked.declared:
        message, hint = f"unknown variable {name}", suggest(name, checked.declared)
        hint = hint or f"declare it: {name} : [low..high];"
        kind = checked.table.kind_of(name)
        if kind is not None:
            message, hint = f"{name} is a {kind}, not a variable", None
        report.name("unknown-variable", message, assignment.span, hint)
        return
    variable = checked.declared[name]
    check_assignable(
        checked.table,
        f"variable {name}",
        variable.declaration.type,
        actual,
        assignment.expression.span,
    )
    if variable.module is None and command.action is not None:
        message = (
            f"a command with an action cannot write the global variable {name}, because several "
            "commands may synchronise and write it at once"
        )
        report.name(
            "global-write",
            message,
            assignment.span,
            "write it in a command with [] or make it local to a module",
        )
    # A duplicate name is reported elsewhere, so a local declaration counts even if another module
    # declared the name first.
    local = {scope.renamed(v.name) for v in instance.base_module.variables}
    if variable.module not in (None, instance.name) and name not in local:
        message = (
            f"module {instance.name} cannot write {name}, a variable of module {variable.module}"
        )
        report.name(
            "foreign-write",
            message,
            assignment.span,
            f"write it in {variable.module}, in a command with the same action",
        )


def _joined_assignments(checked: CheckedProgram, assignment: Assignment) -> str | None:
    """How `(x'=1 & y'=2)` is written, where no update reads values after the step."""
    first, *others = conjuncts(assignment.expression)
    parts = [f"({assignment.variable}'={first.span.text})"]
    for other in others:
        match other:
            case Binary(Operator.EQ, Name(name)) if name.endswith(PRIME):
                parts.append(f"({other.span.text})")
            case _:
                return None
    return None if checked.is_concurrent or not others else f"write {' & '.join(parts)}"


# -------------------------------------------------------------------------- rewards and composition


def _actions(checked: CheckedProgram) -> dict[str, None]:
    """The actions of all modules, and the new actions of renamings in `system … endsystem`."""
    actions_of_commands = {
        scope.renamed(action): None
        for instance, scope in checked.modules
        for c in instance.base_module.commands
        for action in (c.action, *c.others)
        if action is not None
    }
    parts = nodes(checked.program.system) if checked.program.system is not None else ()
    pairs = (pair for part in parts if isinstance(part, Renaming) for pair in part.pairs)
    return actions_of_commands | {new: None for _, new in pairs}


def _check_rewards(checked: CheckedProgram) -> None:
    report, typer, actions = checked.table.report, checked.root.typer(), _actions(checked)
    seen: set[str] = set()
    for structure in checked.program.rewards:
        if structure.name is not None and structure.name in seen:
            report.name(
                "duplicate-rewards",
                f'there is a reward structure "{structure.name}" already',
                structure.span,
            )
        seen.add(structure.name or "")
        for item in structure.items:
            if item.others:
                _check_several_actions(checked, item.span)
            for action in (item.action, *item.others):
                if isinstance(action, str) and action not in actions:
                    message, hint = f"no command has the action {action}", suggest(action, actions)
                    report.name("unknown-action", message, item.span, hint)
            typer.boolean(item.guard, "the guard of a reward")
            typer.numeric(item.value, "a reward")


def _check_system(checked: CheckedProgram) -> None:
    system, report = checked.program.system, checked.table.report
    if system is None:
        return
    known = {m.name: m for m in checked.program.modules}
    parts = tuple(nodes(system))
    used: set[str] = set()
    for part in parts:
        if isinstance(part, ModuleReference):
            if part.name not in known:
                report.name(
                    "unknown-module",
                    f"unknown module {part.name}",
                    part.span,
                    suggest(part.name, known),
                )
            elif part.name in used:
                report.name(
                    "module-twice",
                    f"module {part.name} occurs twice in the composition",
                    part.span,
                )
            used.add(part.name)
    for name in known.keys() - used:
        report.name(
            "module-missing",
            f"module {name} does not occur in the composition",
            system.span,
            f"add it, for example … || {name}",
        )
    actions = _actions(checked)
    for part in parts:
        for action in _mentioned(part):
            if action not in actions:
                report.name(
                    "unknown-action",
                    f"no command has the action {action}",
                    part.span,
                    suggest(action, actions),
                )


def _mentioned(part: Tree) -> tuple[str, ...]:
    match part:
        case Synchronised(_, _, actions) | Hiding(_, actions):
            return actions
        case Renaming(_, pairs):
            return tuple(old for old, _ in pairs)
        case _:  # the other compositions and expressions mention none
            return ()
