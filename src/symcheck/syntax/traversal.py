"""Traversals of syntax trees, without recursion, for any depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import cache
from operator import is_not
from typing import Any, TypeVar, cast

from symcheck.syntax.ast import (
    Binary,
    Bound,
    Expression,
    LabelReference,
    Literal,
    Name,
    Node,
    PathBound,
    PathFormula,
    RewardBound,
    RewardQuery,
    StateOperator,
)
from symcheck.syntax.declarations import Composition
from symcheck.syntax.operators import Operator

__all__ = [
    "Tree",
    "children",
    "conjuncts",
    "names",
    "nodes",
    "operands",
    "reads_rewards",
    "substitute",
    "transform",
    "with_children",
    "with_labels",
]

Tree = Expression | PathFormula | RewardQuery | Bound | PathBound | Composition
"""Any node that occurs within an expression, a property or a composition of modules."""

_LEAVES = (Name, Literal)


@cache
def _fields(kind: Any) -> tuple[str, ...]:
    """The names of the fields of a kind of node, without its span."""
    return tuple(f.name for f in fields(kind) if f.name != "span")


def children(node: Tree) -> tuple[Tree, ...]:
    """The nodes directly below, in the order of their fields; absent ones are left out."""
    # Most nodes are of these kinds, for which this is faster.
    if isinstance(node, Binary):
        return node.left, node.right
    if isinstance(node, _LEAVES):
        return ()
    below: list[object] = []
    kind: Any = type(node)
    for name in _fields(kind):
        value = getattr(node, name)
        below += value if isinstance(value, tuple) else (value,)
    return tuple(cast("list[Tree]", [part for part in below if isinstance(part, Node)]))


def operands(expression: Expression) -> tuple[Expression, ...]:
    """The expressions directly below, in the order of their fields."""
    return tuple(part for part in children(expression) if isinstance(part, Expression))


def conjuncts(condition: Expression) -> Iterator[Expression]:
    """The conditions that a conjunction requires, in order."""
    stack = [condition]
    while stack:
        part = stack.pop()
        if isinstance(part, Binary) and part.operator is Operator.AND:
            stack += (part.right, part.left)
        else:
            yield part


def with_children(node: Tree, parts: tuple[Tree, ...]) -> Tree:
    """The node with other nodes below it, as many as `children` gives. Keeps the span."""
    new: Iterator[Any] = iter(parts)
    if isinstance(node, Binary):
        return Binary(node.operator, next(new), next(new), span=node.span)

    def renewed(value: object) -> object:
        if isinstance(value, tuple):
            return tuple(map(renewed, value))
        return next(new) if isinstance(value, Node) else value

    kind: Any = type(node)
    values = {name: renewed(getattr(node, name)) for name in _fields(kind)}
    return cast(Tree, kind(**values, span=node.span))


def nodes(tree: Tree) -> Iterator[Tree]:
    """The tree and all nodes below it, each before those below it, from left to right."""
    stack = [tree]
    while stack:
        node = stack.pop()
        yield node
        stack += reversed(children(node))


def with_labels(formula: Tree, labels: Mapping[str, Expression]) -> Iterator[Tree]:
    """The nodes of a formula, and those of the labels to which it refers."""
    seen: set[str] = set()
    formulas = [formula]
    while formulas:
        for node in nodes(formulas.pop()):
            yield node
            if isinstance(node, LabelReference) and node.name in labels.keys() - seen:
                seen.add(node.name)
                formulas.append(labels[node.name])


T = TypeVar("T", bound=Tree)


def transform(tree: T, f: Callable[[Tree], Tree]) -> T:
    """Replace every node by f(node), from the leaves up: f gets nodes with replaced children.

    A node none of whose children change is handed to f as it is, so that what is not touched stays
    shared. `f` is called on bounds as well as on formulas, and must give a node that fits the
    place.
    """
    if isinstance(tree, _LEAVES):
        return cast(T, f(tree))
    node, below, new = cast(Tree, tree), children(tree), list[Tree]()
    above: list[tuple[Tree, tuple[Tree, ...], list[Tree]]] = []
    while True:
        for child in below[len(new) :]:
            if not isinstance(child, _LEAVES):
                above.append((node, below, new))
                node, below, new = child, children(child), []
                break
            new.append(f(child))
        else:
            if any(map(is_not, new, below)):
                node = with_children(node, tuple(new))
            done = f(node)
            if not above:
                return cast(T, done)
            node, below, new = above.pop()
            new.append(done)


def names(tree: Tree) -> set[str]:
    """The names of variables, constants and formulas that occur, without labels and rewards."""
    return {node.name for node in nodes(tree) if isinstance(node, Name)}


def substitute(tree: T, mapping: Mapping[str, Expression]) -> T:
    """Replace each name in the mapping by its expression, all at once."""

    def put(node: Tree) -> Tree:
        return mapping.get(node.name, node) if isinstance(node, Name) else node

    return transform(tree, put)


def reads_rewards(node: Tree) -> bool:
    """Whether a node of a formula itself may read the rewards of the model."""
    return isinstance(node, RewardBound) or (isinstance(node, StateOperator) and node.reads_rewards)
