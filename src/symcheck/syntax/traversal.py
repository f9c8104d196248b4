"""Traversals of expressions, path formulas and reward queries, without recursion, for any depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, TypeVar, assert_never, cast

from symcheck.syntax.ast import (
    Binary,
    Bound,
    Call,
    Conditional,
    CumulativeReward,
    Eventually,
    Expression,
    Filter,
    Globally,
    InstantaneousReward,
    LabelReference,
    Literal,
    MultiObjective,
    Name,
    Next,
    PathBound,
    PathFormula,
    PathMeasure,
    PathQuantifier,
    Release,
    RewardBound,
    RewardBounds,
    RewardOperator,
    RewardQuery,
    StateFilter,
    SteadyState,
    SteadyStateReward,
    TimeBound,
    TotalReward,
    Unary,
    Until,
    WeakUntil,
)

__all__ = ["Tree", "children", "names", "nodes", "substitute", "transform", "with_children"]

Tree = Expression | PathFormula | RewardQuery | Bound | PathBound
"""Any node that occurs within an expression or a property."""


def children(node: Tree) -> tuple[Tree, ...]:
    """The nodes directly below, in the order of their fields; absent ones are left out."""
    match node:
        case Binary(left=left, right=right):
            return left, right
        case Literal() | Name() | LabelReference() | TotalReward() | SteadyStateReward():
            return ()
        case Unary(operand=operand):
            return (operand,)
        case Conditional(condition=condition, then=then, otherwise=otherwise):
            return condition, then, otherwise
        case Call(arguments=parts) | MultiObjective(objectives=parts):
            return parts
        case PathMeasure(bound=bound, path=path):
            return _present(bound, path)
        case RewardOperator(structure=structure, bound=bound, query=query):
            return _present(None if isinstance(structure, str) else structure, bound, query)
        case SteadyState(bound=bound, formula=formula):
            return _present(bound, formula)
        case PathQuantifier(path=path):
            return (path,)
        case Filter(formula=formula, states=states) | StateFilter(formula=formula, states=states):
            return _present(formula, states)
        case (
            Next(operand=path, bound=limit)
            | Eventually(operand=path, bound=limit)
            | Globally(operand=path, bound=limit)
        ):
            return _present(path, limit)
        case (
            Until(left=a, right=b, bound=limit)
            | WeakUntil(left=a, right=b, bound=limit)
            | Release(left=a, right=b, bound=limit)
        ):
            return _present(a, b, limit)
        case Bound(threshold=threshold):
            return (threshold,)
        case TimeBound(lower=lower, upper=upper):
            return _present(lower, upper)
        case RewardBound(structure=structure, lower=lower, upper=upper):
            return _present(None if isinstance(structure, str) else structure, lower, upper)
        case RewardBounds(parts=parts):
            return parts
        case CumulativeReward(bound=time):
            return (time,)
        case InstantaneousReward(time=moment):
            return (moment,)
        case _:
            assert_never(node)


def _present(*parts: Tree | None) -> tuple[Tree, ...]:
    return tuple(p for p in parts if p is not None)


def with_children(node: Tree, parts: tuple[Tree, ...]) -> Tree:
    """The node with other nodes below it, as many as `children` gives. Keeps the span."""
    new: Iterator[Any] = iter(parts)

    def some(old: object) -> Any:
        return None if old is None else next(new)

    match node:
        case Binary(operator=operator):
            return Binary(operator, next(new), next(new), span=node.span)
        case Literal() | Name() | LabelReference() | TotalReward() | SteadyStateReward():
            return node
        case Unary(operator=sign):
            return Unary(sign, next(new), span=node.span)
        case Conditional():
            return Conditional(*new, span=node.span)
        case Call(function=function):
            return Call(function, tuple(new), span=node.span)
        case MultiObjective():
            return MultiObjective(tuple(new), span=node.span)
        case PathMeasure(bound=bound):
            return replace(node, bound=some(bound), path=next(new))
        case RewardOperator(structure=structure, bound=bound):
            which = structure if isinstance(structure, str) else some(structure)
            return replace(node, structure=which, bound=some(bound), query=next(new))
        case SteadyState(bound=bound):
            return replace(node, bound=some(bound), formula=next(new))
        case PathQuantifier():
            return replace(node, path=next(new))
        case Filter(states=states):
            return replace(node, formula=next(new), states=some(states))
        case StateFilter():
            return replace(node, formula=next(new), states=next(new))
        case Next(bound=limit) | Eventually(bound=limit) | Globally(bound=limit):
            return replace(node, operand=next(new), bound=some(limit))
        case Until(bound=limit) | WeakUntil(bound=limit) | Release(bound=limit):
            return replace(node, left=next(new), right=next(new), bound=some(limit))
        case Bound():
            return replace(node, threshold=next(new))
        case TimeBound(lower=lower, upper=upper):
            return replace(node, lower=some(lower), upper=some(upper))
        case RewardBound(structure=structure, lower=lower, upper=upper):
            which = structure if isinstance(structure, str) else some(structure)
            return replace(node, structure=which, lower=some(lower), upper=some(upper))
        case RewardBounds():
            return replace(node, parts=tuple(new))
        case CumulativeReward():
            return replace(node, bound=next(new))
        case InstantaneousReward():
            return replace(node, time=next(new))
        case _:
            assert_never(node)


def nodes(tree: Tree) -> Iterator[Tree]:
    """The tree and all nodes below it, each before those below it, from left to right."""
    stack = [tree]
    while stack:
        node = stack.pop()
        yield node
        stack += reversed(children(node))


T = TypeVar("T", bound=Tree)


def transform(tree: T, f: Callable[[Tree], Tree]) -> T:
    """Replace every node by f(node), from the leaves up: f gets nodes with replaced children.

    A node none of whose children change is handed to f as it is, so that what is not touched stays
    shared. `f` is called on bounds as well as on formulas, and must give a node that fits the
    place.
    """
    done: list[Tree] = []
    stack: list[tuple[Tree, tuple[Tree, ...] | None]] = [(tree, None)]
    while stack:
        node, below = stack.pop()
        if below is None:
            below = children(node)
            if below:
                stack.append((node, below))
                stack.extend((child, None) for child in reversed(below))
                continue
        else:
            new = tuple(done[-len(below) :])
            del done[-len(below) :]
            if any(a is not b for a, b in zip(new, below, strict=True)):
                node = with_children(node, new)
        done.append(f(node))
    return cast(T, done[0])


def names(tree: Tree) -> set[str]:
    """The names of variables, constants and formulas that occur, without labels and rewards."""
    return {node.name for node in nodes(tree) if isinstance(node, Name)}


def substitute(tree: T, mapping: Mapping[str, Expression]) -> T:
    """Replace each name in the mapping by its expression, all at once."""

    def put(node: Tree) -> Tree:
        return mapping.get(node.name, node) if isinstance(node, Name) else node

    return transform(tree, put)
