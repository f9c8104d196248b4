"""All operators and functions with every number of operands, for tests that read the table."""

from __future__ import annotations

from symcheck.syntax.ast import Binary, Call, Expression
from symcheck.syntax.operators import Function, Operator, Signature

__all__ = ["APPLICATIONS", "NUMERIC", "Application", "applications", "applied"]

Application = tuple[Operator | Function, int]
"""An operator or function, and how many operands it has."""

MOST = 3
"""Functions with any number of arguments have up to so many."""

APPLICATIONS: list[Application] = [
    *((operator, 2) for operator in Operator),
    *((f, n) for f in Function for n in ([f.arity] if f.arity else range(1, MOST + 1))),
]
NUMERIC = [(o, n) for o, n in APPLICATIONS if o.signature is not Signature.LOGICAL]


def applications(*signatures: Signature) -> list[Application]:
    """The operators and functions of some signatures."""
    return [(o, n) for o, n in APPLICATIONS if o.signature in signatures]


def applied(operation: Operator | Function, *operands: Expression) -> Expression:
    """An operator or function of operands."""
    if isinstance(operation, Operator):
        return Binary(operation, *operands)
    return Call(operation, operands)
