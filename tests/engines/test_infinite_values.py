"""Equations know where values are infinite: a choice that may lead there never counts as 0."""

from __future__ import annotations

from math import inf

import pytest

import symcheck
from symcheck.direction import Direction
from symcheck.matrices.numbers import full
from symcheck.numerics.settings import Accuracy

FORKED = """mdp
module m
  s : [0..2];
  [risk] s=0 -> 0.5:(s'=1) + 0.5:(s'=2);
  [wait] s=0 -> 0.5:true + 0.5:(s'=1);
  [] s=1 -> true;
  [] s=2 -> true;
endmodule
"""
ENGINES = ["explicit", "exact", "sparse", "hybrid", "mtbdd"]


def forked(engine: str, direction: Direction):
    """The equations of s=0, where each step costs 1, and the states s=1 and s=2."""
    built = symcheck.loads(FORKED, engine=engine).engine
    start = built.initial
    one, two = (where(built, f"s={s}") for s in (1, 2))
    return built.system(start, direction), start, one, two


def one_each(system):
    """The cost of each row."""
    return full(system.rows, 1, rational=system.matrix.data.dtype == object)


def where(engine, text: str):
    return engine.from_bools([str(v[0]) == text[-1] for v in engine.valuations(engine.all)])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_choice_that_may_lead_to_an_infinite_value_never_minimises(engine):
    system, start, _, two = forked(engine, Direction.MIN)
    equations = system.equations(one_each(system), probability=False, infinite=two)
    values = equations.solve([], Accuracy()).values
    assert float(values.minimum(start)[0]) == pytest.approx(2)  # by [wait]; [risk] would give 1
    assert values.minimum(two) == (inf, inf)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_state_that_may_lead_to_an_infinite_value_is_no_unknown(engine):
    system, _, _, two = forked(engine, Direction.MAX)
    equations = system.equations(one_each(system), probability=False, infinite=two)
    with pytest.raises(ValueError, match="leads to an infinite value is no unknown"):
        equations.solve([], Accuracy())
    system, _, one, two = forked(engine, Direction.MIN)
    equations = system.equations(one_each(system), probability=False, infinite=one | two)
    with pytest.raises(ValueError, match="all of whose choices lead to infinite values"):
        equations.solve([], Accuracy())


@pytest.mark.parametrize("engine", ENGINES)
def test_an_infinite_constant_is_refused(engine):
    """Rows that may enter such states would count it as 0."""
    system, _, _, two = forked(engine, Direction.MIN)
    equations = system.equations(one_each(system), probability=False)
    with pytest.raises(ValueError, match="infinite values are given to the equations"):
        equations.solve([(two, inf)], Accuracy())
