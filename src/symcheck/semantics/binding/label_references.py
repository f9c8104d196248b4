"""Labels of a model that use other labels: `label "a" = "b" & x=1;`."""

from __future__ import annotations

from dataclasses import replace

from symcheck.semantics.binding.static_checks import RESERVED_LABELS
from symcheck.semantics.diagnostics import DiagnosticCollector, suggest
from symcheck.syntax.ast import Expression, LabelReference
from symcheck.syntax.declarations import Program
from symcheck.syntax.traversal import Tree, nodes, transform

__all__ = ["inline_labels"]


def inline_labels(program: Program, report: DiagnosticCollector) -> Program:
    """The program with labels over variables, constants and formulas only.

    Args:
        program: the model; of labels of the same name, the first one is meant.
        report: collects circular, unknown and predefined labels.
    """
    if not any(isinstance(n, LabelReference) for x in program.labels for n in nodes(x.expression)):
        return program
    meant: dict[str, Expression] = {}
    for label in program.labels:
        meant.setdefault(label.name, label.expression)
    done: dict[str, Expression] = {}

    def inlined(expression: Expression, path: tuple[str, ...]) -> Expression:
        def put(node: Tree) -> Tree:
            if not isinstance(node, LabelReference):
                return node
            name = node.name
            if name in path:
                cycle = " -> ".join((*path[path.index(name) :], name))
                report.name("cycle", f'label "{name}" is defined by itself: {cycle}', node.span)
            elif name in RESERVED_LABELS:
                message = f'label "{name}" is predefined and cannot be used by labels of the model'
                hint = "labels of a properties file may use it"
                report.name("reserved-label", message, node.span, hint)
            elif name not in meant:
                message = f'unknown label "{name}"'
                report.name("unknown-label", message, node.span, suggest(name, meant))
            else:
                if name not in done:
                    done[name] = inlined(meant[name], (*path, name))
                return replace(done[name], span=node.span)
            return node

        return transform(expression, put)

    labels = tuple(replace(x, expression=inlined(x.expression, (x.name,))) for x in program.labels)
    return replace(program, labels=labels)
