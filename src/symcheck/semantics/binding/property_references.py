"""References between the labels and properties of a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from symcheck.semantics.binding.names import SymbolTable
from symcheck.semantics.binding.static_checks import RESERVED_LABELS
from symcheck.syntax.ast import Expression, LabelReference
from symcheck.syntax.declarations import Constant, PropertiesFile
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = ["PropertyReferences"]


class PropertyReferences:
    """The properties by name, and the labels of the file and the model.

    A label takes precedence over a property of the same name.
    """

    def __init__(
        self, table: SymbolTable, file: PropertiesFile, of_model: Mapping[str, Expression]
    ) -> None:
        self._table = table
        self._file = file
        self._model_labels = of_model
        self._own = {x.name: x.expression for x in file.labels}
        self._properties: dict[str, Expression] = {}
        for p in file.properties:
            if p.name is not None:
                self._properties.setdefault(p.name, p.formula)
        self._inlined: dict[str, Expression] = {}

    def is_label(self, name: str) -> bool:
        """Whether a name refers to a label rather than a property."""
        return name in RESERVED_LABELS or name in self._own or name in self._model_labels

    def known(self) -> tuple[str, ...]:
        """The names of all labels and properties."""
        return (*RESERVED_LABELS, *self._own, *self._model_labels, *self._properties)

    def check_label(self, name: str) -> None:
        """Report a label of the file with circular references."""
        self._report_cycle(self._own[name], (name,))

    def check_property(self, index: int) -> None:
        """Report a property whose name is taken, or whose references are circular."""
        given = self._file.properties[index]
        if given.name is not None and self._properties[given.name] is not given.formula:
            message = f'there is a property "{given.name}" already'
            self._table.report.name("duplicate-property", message, given.span)
        # A label hides a property of the same name, so that property is not part of a cycle.
        named = given.name is not None and not self.is_label(given.name)
        self._report_cycle(given.formula, (given.name,) if named and given.name else ())

    def _report_cycle(self, expression: Expression, path: tuple[str, ...]) -> None:
        cycle = self._cycle(expression, path, set())
        if cycle:
            message = f'"{cycle[-1]}" refers to itself: {" -> ".join(cycle)}'
            self._table.report.name("cycle", message, expression.span)

    def _cycle(
        self, expression: Expression, path: tuple[str, ...], done: set[str]
    ) -> tuple[str, ...] | None:
        """A cycle of references that starts at an expression; None if there is none.

        path: the names whose expressions led to this one. done: names that lead to no cycle.
        """
        for used in _references(expression):
            if used in path:
                return (*path[path.index(used) :], used)
            target = self._target(used)
            if used not in done and target is not None:
                cycle = self._cycle(target, (*path, used), done)
                if cycle:
                    return cycle
                done.add(used)
        return None

    def _target(self, name: str) -> Expression | None:
        """The expression of a label or property of the file; None for other names."""
        if name in RESERVED_LABELS:
            return None
        if name in self._own:
            return self._own[name]
        return None if name in self._model_labels else self._properties.get(name)

    # ------------------------------------------------------------------------------------ expansion

    def inlined(self, formula: Expression) -> Expression:
        """The formula with references to properties replaced; references to labels are kept."""

        def put(node: Tree) -> Tree:
            if (
                not isinstance(node, LabelReference)
                or self.is_label(node.name)
                or node.name not in self._properties
            ):
                return node
            if node.name not in self._inlined:
                self._inlined[node.name] = self.inlined(self._properties[node.name])
            return replace(self._inlined[node.name], span=node.span)  # a fault of its use is here

        return transform(formula, put)

    def label(self, expression: Expression) -> Expression:
        """The expression of a label with references to labels replaced, except reserved ones."""

        def put(node: Tree) -> Tree:
            if not isinstance(node, LabelReference):
                return node
            if node.name in self._own:
                return self.label(self._own[node.name])
            return self._model_labels.get(node.name, node)

        return transform(expression, put)

    def used_labels(self, formula: Expression) -> Iterator[Expression]:
        """The expressions of the labels of the file to which a formula refers."""
        return (self._own[name] for name in _references(formula) if name in self._own)

    # ------------------------------------------------------------------------------------ constants

    def undefined(self, formula: Expression, of_model: Iterable[Constant]) -> tuple[str, ...]:
        """The undefined constants of a formula.

        Args:
            formula: a formula of the file.
            of_model: the constants of the model.

        Returns:
            All undefined constants of the model, then those of the file that the formula reads.
        """
        always = [c.name for c in of_model if c.value is None]
        further = self.used(formula).difference(always)
        constants = self._table.constants.items()
        return (*always, *(n for n, c in constants if c.value is None and n in further))

    def used(self, formula: Expression) -> set[str]:
        """The names that a formula depends on; those of labels and properties in quotes."""
        waiting, used = [formula], set[str]()
        while waiting:
            text = waiting.pop()
            used |= self._table.used_by(text)
            for name in _references(text):
                target = self._target(name)
                if f'"{name}"' not in used and target is not None:
                    waiting.append(target)
                used.add(f'"{name}"')
        return used


def _references(expression: Expression) -> list[str]:
    return list(dict.fromkeys(n.name for n in nodes(expression) if isinstance(n, LabelReference)))
