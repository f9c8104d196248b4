"""Random well-typed expressions over two ints, a bool and literals."""

from __future__ import annotations

from fractions import Fraction
from functools import partial

from hypothesis import strategies as st

from symcheck.semantics.model import Value
from symcheck.syntax.ast import Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Signature, UnaryOperator
from syntax.operations import applications, applied

TYPES = {"x": Type.INT, "y": Type.INT, "b": Type.BOOL}
Strategy = st.SearchStrategy[Expression]

valuations: st.SearchStrategy[dict[str, Value]] = st.fixed_dictionaries(
    {"x": st.integers(-3, 4), "y": st.integers(0, 3), "b": st.booleans()}
)


INTS: Strategy = st.one_of(
    st.integers(-3, 9).map(lambda v: Literal(v, Type.INT)),
    st.sampled_from([Name("x"), Name("y")]),
)
DOUBLES: Strategy = st.sampled_from(
    [Fraction(0), Fraction(1, 3), Fraction(-5, 2), Fraction(1, 10), Fraction(10) ** 30]
).map(lambda v: Literal(v, Type.DOUBLE))
BOOLS: Strategy = st.one_of(st.booleans().map(lambda v: Literal(v, Type.BOOL)), st.just(Name("b")))


def _applied(signature: Signature, *operands: Strategy) -> list[Strategy]:
    """Every operator and function of a signature, with every number of operands.

    operands: the first ones; the others are like the last.
    """
    return [
        st.builds(partial(applied, operation), *[*operands, *operands[-1:] * n][:n])
        for operation, n in applications(signature)
    ]


def typed(
    depth: int = 3, i: Strategy = INTS, d: Strategy = DOUBLES, b: Strategy = BOOLS
) -> dict[Type, Strategy]:
    """A strategy for each type, of expressions up to this depth.

    Args:
        i, d, b: the ints, doubles and bools of depth 0.
    """
    minus, negation = st.just(UnaryOperator.MINUS), st.just(UnaryOperator.NOT)
    for _ in range(depth):
        n = st.one_of(i, d)
        more_i = [
            *_applied(Signature.ARITHMETIC, i),
            *_applied(Signature.INTEGER, i),
            *_applied(Signature.ROUNDING, n),
            st.builds(Unary, minus, i),
            st.builds(Conditional, b, i, i),
        ]
        more_d = [
            *_applied(Signature.DIVISION, n),
            *_applied(Signature.ARITHMETIC, d, n),
            *_applied(Signature.ARITHMETIC, n, d),
            st.builds(Unary, minus, d),
            st.builds(Conditional, b, i, d),
            st.builds(Conditional, b, d, n),
        ]
        more_b = [
            *_applied(Signature.LOGICAL, b),
            *_applied(Signature.ORDER, n),
            *_applied(Signature.EQUALITY, n),
            *_applied(Signature.EQUALITY, b),
            st.builds(Unary, negation, b),
            st.builds(Conditional, b, b, b),
        ]
        i, d, b = (st.one_of(s, *more) for s, more in ((i, more_i), (d, more_d), (b, more_b)))
    return {Type.INT: i, Type.DOUBLE: d, Type.BOOL: b}


anything: Strategy = st.one_of(*typed().values())
