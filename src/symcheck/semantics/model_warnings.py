"""What a beginner may not have meant: conditions that never hold, and actions that never happen.

Guards, labels and the conditions of properties are looked at. Only what the ranges of the variables
show is reported: no value within them makes the condition true. Conditions that constants switch
off are meant, and conditions over very many valuations are not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import prod

import numpy as np
from numpy.typing import NDArray

from symcheck.errors import Diagnostic, Span
from symcheck.options import Options
from symcheck.semantics.diagnostics import suggest
from symcheck.semantics.expressions.vectorised import Column, evaluate_columns, open_mesh
from symcheck.semantics.model import BoundCommand, BoundModel, Event, Variable
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Unary
from symcheck.syntax.declarations import Module, Program, RenamedModule
from symcheck.syntax.operators import UnaryOperator
from symcheck.syntax.printer import pretty
from symcheck.syntax.traversal import Tree, children, conjuncts, names, nodes

__all__ = ["model_warnings", "property_warnings"]

_VALUATIONS = 1 << 14
"""The most valuations that are looked at for a condition."""
_ALL_VALUATIONS = 1 << 20
"""Likewise for all conditions of a model."""


def model_warnings(model: BoundModel, options: Options) -> list[Diagnostic]:
    """Guards and labels that no values of the variables satisfy, actions on which modules never
    agree, and copies of modules that rename what is misspelt, or take two variables for one.

    Args:
        model: the model; nothing is reported of timed automata, whose clocks have no range.
        options: which warnings are wanted.

    Examples:
        >>> import symcheck
        >>> model = symcheck.loads("dtmc module m x : [0..3]; [] x=5 -> (x'=0); endmodule")
        >>> print(model_warnings(model.bound, symcheck.Options())[0].message)
        the guard holds for no values of its variables: x is in [0..3]
    """
    if model.type.has_clocks or model.clocks is not None:
        return []
    search = _Search({v.name: v for v in model.variables})
    found: dict[Span, Diagnostic] = {}
    if options.warn_unsatisfiable:
        guards = [("guard", c.guard) for m in model.modules for c in m.commands]
        labels = [(f'label "{name}"', e) for name, e in model.labels.items()]
        for what, condition in (*guards, *labels):
            if names(condition) and not search.may_hold([[condition]]):
                ranges = search.ranges(condition)
                text = f"the {what} holds for no values of its variables: {ranges}"
                found[condition.span] = _warning(text, condition.span, "unsatisfiable")
    if options.warn_blocked and not model.type.concurrent:  # players need not pick all at once
        actions: dict[str, list[Event]] = {}
        for event in model.events:
            if event.action is not None:
                actions.setdefault(event.action, []).append(event)
        for action, events in actions.items():
            if all(_is_blocked(event, search) for event in events):
                guards_of = [p[0].guard for p in events[0].participants]
                parts = " and ".join(
                    dict.fromkeys(model.modules[p[0].module].name for p in events[0].participants)
                )
                text = f"[{action}] never happens: {parts} never enable it at once"
                found[guards_of[-1].span] = _warning(text, guards_of[-1].span, "blocked-action")
    renamings: list[Diagnostic] = []
    if options.warn_renaming:
        renamings = [*_misspelt_renamings(model.program), *_half_renamings(model)]
    return [*renamings, *found.values()]


def property_warnings(model: BoundModel, formula: Expression) -> list[str]:
    """The conditions on states in a bound formula that no values of the variables satisfy.

    Args:
        model: the model; nothing is reported of timed automata.
        formula: names are resolved and constants are folded.

    Examples:
        >>> import symcheck
        >>> model = symcheck.loads("dtmc module m x : [0..3]; [] x<3 -> (x'=x+1); endmodule")
        >>> model.check("P=? [ F x=7 ]").warnings
        ('x=7 holds for no values of its variables: x is in [0..3]',)
    """
    if model.type.has_clocks or model.clocks is not None:
        return []
    search = _Search({v.name: v for v in model.variables})
    found: list[str] = []
    waiting: list[Tree] = [formula]
    while waiting:
        node = waiting.pop()
        if not isinstance(node, _PLAIN) or not all(isinstance(n, _PLAIN) for n in nodes(node)):
            waiting += reversed(children(node))
        elif _is_condition(node) and names(node) and not search.may_hold([[node]]):
            text = f"{pretty(node)} holds for no values of its variables: {search.ranges(node)}"
            found.append(text)
    return found


def _misspelt_renamings(program: Program) -> Iterator[Diagnostic]:
    """Names that copies of modules rename and that the text declares nowhere, but for others that
    are like them.
    """
    declared = {c.name for c in program.constants} | {f.name for f in program.formulas}
    declared |= {v.name for v in program.globals} | {label.name for label in program.labels}
    for module in program.modules:
        if isinstance(module, Module):
            declared |= {v.name for v in module.variables}
            declared |= {a for c in module.commands for a in (c.action, *c.others) if a is not None}
        else:
            declared |= {new for _, new in module.renaming}
    for module in program.modules:
        if isinstance(module, RenamedModule):
            free = declared - {name for pair in module.renaming for name in pair}
            for old, _ in module.renaming:
                if old not in declared and (hint := suggest(old, free)):
                    text = f"module {module.base} has no {old}; {hint}"
                    yield _warning(text, module.span, "renaming")


def _half_renamings(model: BoundModel) -> Iterator[Diagnostic]:
    """Copies whose own variable is one that the original reads of another module, and that they do
    not rename: in the copy, one name stands for both.
    """
    modules = {m.name: m for m in model.modules}
    for module in model.program.modules:
        if isinstance(module, RenamedModule):
            base, new_of = modules[module.base], dict(module.renaming)
            reads = {n for c in base.commands for e in _expressions(c) for n in names(e)}
            for own in (model.variables[i].name for i in base.variables):
                if (new := new_of.get(own)) in reads - new_of.keys():
                    text = f"in module {module.name}, {new} stands for {own} and for {new} of "
                    text += f"{module.base}"
                    hint = f"rename {new} too, as in {new}={own}; formulas are renamed as well"
                    yield _warning(text, module.span, "renaming", hint)


def _expressions(command: BoundCommand) -> Iterator[Expression]:
    yield command.guard
    for update in command.updates:
        yield update.probability
        yield from (value for _, value in update.assignments)


def _is_condition(expression: Expression) -> bool:
    if isinstance(expression, Unary):
        return expression.operator is UnaryOperator.NOT
    return isinstance(expression, Binary) and expression.operator.is_boolean


_PLAIN = (Binary, Unary, Literal, Name, Call, Conditional)
"""The nodes of conditions that the variables decide."""


def _warning(message: str, span: Span, code: str, hint: str | None = None) -> Diagnostic:
    return Diagnostic(message, span, code, hint, severity="warning")


def _is_blocked(event: Event, search: _Search) -> bool:
    """Whether modules never agree on an event that each of them may take."""
    guards = [[c.guard for c in commands] for commands in event.participants]
    return (
        len(guards) > 1
        and all(search.may_hold([of_one]) for of_one in guards)
        and not search.may_hold(guards)
    )


class _Search:
    def __init__(self, variables: Mapping[str, Variable]) -> None:
        self._variables = variables
        self._budget = _ALL_VALUATIONS

    def may_hold(self, conditions: Sequence[Sequence[Expression]]) -> bool:
        """Whether some values satisfy one of each alternatives, or that is not known."""
        everything = [c for alternatives in conditions for c in alternatives]
        if any(not names(part) for c in everything for part in conjuncts(c)):
            return True  # a constant may switch it off
        read = set().union(*map(names, everything))
        if not read <= self._variables.keys():
            return True  # a label of a model in files, which is a list of states
        domains = {n: v.domain for n, v in self._variables.items() if n in read}
        mesh = open_mesh(domains, min(_VALUATIONS, self._budget))
        if mesh is None:
            return True
        columns, shape = mesh
        self._budget -= prod(shape)
        holds = np.ones(prod(shape), np.bool_)
        for alternatives in conditions:
            holds &= np.logical_or.reduce([_holds(c, columns, shape) for c in alternatives])
        return bool(holds.any())

    def ranges(self, condition: Expression) -> str:
        """The ranges of the variables of a condition."""
        read = names(condition)
        parts = []
        for name, variable in self._variables.items():
            if name in read and variable.low is not None:
                parts.append(f"{name} is in [{variable.low}..{variable.high}]")
            elif name in read:
                parts.append(f"{name} is false or true")
        return ", ".join(parts)


def _holds(
    condition: Expression, columns: Mapping[str, Column], shape: tuple[int, ...]
) -> NDArray[np.bool_]:
    """Where a condition holds, or has no value, which is another fault."""
    lanes = evaluate_columns(condition, columns).spread(shape)
    holds = lanes.values.astype(np.bool_)
    return holds if lanes.faults is None else holds | lanes.faults
