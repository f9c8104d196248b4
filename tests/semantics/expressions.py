"""Random well-typed expressions over two ints, a bool and literals."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import strategies as st

from symcheck.semantics.model import Value
from symcheck.syntax.ast import Binary, Call, Conditional, Expression, Literal, Name, Type, Unary
from symcheck.syntax.operators import Function, Operator, UnaryOperator

TYPES = {"x": Type.INT, "y": Type.INT, "b": Type.BOOL}
Strategy = st.SearchStrategy[Expression]

valuations: st.SearchStrategy[dict[str, Value]] = st.fixed_dictionaries(
    {"x": st.integers(-3, 4), "y": st.integers(0, 3), "b": st.booleans()}
)


def _binary(operators: str, left: Strategy, right: Strategy) -> Strategy:
    return st.builds(Binary, st.sampled_from(operators.split()).map(Operator), left, right)


def _call(functions: str, *arguments: Strategy) -> Strategy:
    return st.builds(Call, st.sampled_from(functions.split()).map(Function), st.tuples(*arguments))


def typed(depth: int = 3) -> dict[Type, Strategy]:
    """A strategy for each type, of expressions up to this depth."""
    i: Strategy = st.one_of(
        st.integers(-3, 9).map(lambda v: Literal(v, Type.INT)),
        st.sampled_from([Name("x"), Name("y")]),
    )
    rationals = [Fraction(0), Fraction(1, 3), Fraction(-5, 2), Fraction(1, 10), Fraction(10) ** 30]
    d: Strategy = st.sampled_from(rationals).map(lambda v: Literal(v, Type.DOUBLE))
    b: Strategy = st.one_of(st.booleans().map(lambda v: Literal(v, Type.BOOL)), st.just(Name("b")))
    for _ in range(depth):
        n = st.one_of(i, d)
        more_i = [
            _binary("+ - * ^", i, i),
            _call("min max mod pow", i, i),
            _call("floor ceil round", n),
            st.builds(Unary, st.just(UnaryOperator.MINUS), i),
        ]
        more_d = [
            _binary("/", n, n),
            _binary("+ - * ^", n, d),
            _binary("+ - *", d, n),
            _call("min max pow log", d, n),
        ]
        more_d += [
            st.builds(Conditional, b, i, d),
            st.builds(Conditional, b, d, n),
            st.builds(Unary, st.just(UnaryOperator.MINUS), d),
        ]
        more_b = [
            _binary("& | => <=>", b, b),
            _binary("= != < <= > >=", n, n),
            _binary("= !=", b, b),
            st.builds(Unary, st.just(UnaryOperator.NOT), b),
        ]
        new_i = st.one_of(i, *more_i, st.builds(Conditional, b, i, i))
        new_d = st.one_of(d, *more_d)
        i, d, b = new_i, new_d, st.one_of(b, *more_b, st.builds(Conditional, b, b, b))
    return {Type.INT: i, Type.DOUBLE: d, Type.BOOL: b}


anything: Strategy = st.one_of(*typed().values())
