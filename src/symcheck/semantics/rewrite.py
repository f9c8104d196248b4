"""Rewrite trees from the leaves up, and list what they name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, TypeVar

from symcheck.syntax.ast import LabelReference, Name, Node

__all__ = ["labels_in", "names_in", "rewrite", "subnodes"]

N = TypeVar("N", bound=Node)


_FIELDS: dict[type[Node], tuple[str, ...]] = {}  # filled once per class: dataclasses.fields is slow


def _field_names(kind: type[Node]) -> tuple[str, ...]:
    if kind not in _FIELDS:
        _FIELDS[kind] = tuple(f.name for f in fields(kind) if f.name != "span")
    return _FIELDS[kind]


def rewrite(node: N, f: Callable[[Any], Any]) -> N:
    """`f` applied to every node, operands first; what `f` puts in the place of a node is not visited again."""
    changes = {}
    for name in _field_names(type(node)):
        old = getattr(node, name)
        if isinstance(old, Node):
            new: Any = rewrite(old, f)
        elif isinstance(old, tuple) and old and isinstance(old[0], Node):
            parts = tuple(rewrite(x, f) for x in old)
            new = old if all(a is b for a, b in zip(parts, old, strict=True)) else parts
        else:
            continue
        if new is not old:
            changes[name] = new
    if changes:
        values = {name: changes.get(name, getattr(node, name)) for name in _field_names(type(node))}
        node = type(node)(**values, span=node.span)
    return f(node)  # type: ignore[no-any-return]


def subnodes(node: Node) -> Iterator[Node]:
    """The node and all nodes below it."""
    yield node
    for name in _field_names(type(node)):
        value = getattr(node, name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Node):
                yield from subnodes(part)


def names_in(node: Node) -> list[Name]:
    """Every use of a name below a node."""
    return [n for n in subnodes(node) if isinstance(n, Name)]


def labels_in(node: Node) -> list[LabelReference]:
    """Every use of a label or property below a node."""
    return [n for n in subnodes(node) if isinstance(n, LabelReference)]
