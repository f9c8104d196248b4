"""Certificates: what is stated of a value, and vectors that prove it to a checker of its own.

The inequalities are those of `symcheck_verify`, which imports nothing of symcheck.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.exact_twin import exact_twin
from symcheck.check.queries.values import values
from symcheck.check.state_formulas import query_of
from symcheck.direction import Direction
from symcheck.engines.base import StateSet
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import UnsupportedError
from symcheck.matrices.numbers import Rationals, doubles
from symcheck.matrices.rows import Bools, Floats, Int64s, per_row
from symcheck.numerics import graph
from symcheck.numerics.inductive_bounds import (
    Inequalities,
    InductiveVector,
    average_vectors,
    inductive,
)
from symcheck.semantics import query as asked
from symcheck.semantics.path_formulas import NextPath, UntilPath
from symcheck.semantics.query import Query
from symcheck.semantics.rewards import Reward, Structure, Time
from symcheck.semantics.time_bounds import Window
from symcheck.syntax.ast import AnyMeasure, Binary, Expression, LabelReference, Literal, Unary
from symcheck.syntax.operators import Operator, UnaryOperator

__all__ = ["Certificate", "certify"]

_STEP_ERROR = Fraction(1, 2**90)
"""More than what a checker's step of bounded measures adds to the width of bounds."""
_STATED = Fraction(1, 10**11)
"""Relative width that is stated of values within steps or a time; the checker computes them."""

Json = dict[str, object]


@dataclass(frozen=True, eq=False, repr=False)
class Certificate:
    """A statement about the values of a property, and its proof.

    Attributes:
        engine: the model that it is about, in rational arithmetic.
        property: the text of the property.
        statement: what is stated: the measure, and bounds of its value in each initial state.
        evidence: the vectors, strategies and ranks that prove the lower and the upper bounds.
    """

    engine: ExplicitEngine = field(repr=False)
    property: str
    statement: Mapping[str, object]
    evidence: Mapping[str, object]


def certify(context: Context, formula: Expression) -> Certificate:
    """A certificate of the value of a measure in the initial states.

    Args:
        context: the model, and the accuracy of the values.
        formula: a P, R, T or S formula.

    Raises:
        UnsupportedError: there are no certificates for such a formula, or the model cannot be
            explored in rational arithmetic.
        NumericalError: no vectors were found that satisfy the inequalities.
    """
    if not isinstance(formula, AnyMeasure):
        raise UnsupportedError("certificates are for P, R, T and S formulas")
    if context.options.fairness:
        raise UnsupportedError("certificates are not supported with -fair")
    context = replace(context, relevant_states=None)
    exact = context if context.engine.exact else exact_twin(context)
    model = exact.engine.capability(ExplicitEngine)
    assert model is not None
    return _Writer(context, exact, model, formula).certificate()
