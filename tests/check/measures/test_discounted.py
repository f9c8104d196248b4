"""Discounted rewards: against the sum of their series, policies one by one, and Storm."""

from __future__ import annotations

import itertools
from fractions import Fraction
from itertools import islice

import numpy as np
import pytest

import symcheck
from checking import check_text, engine_of
from generate import bound_models
from symcheck.engines.capabilities import HasMatrix
from symcheck.errors import InputError, UnsupportedError
from symcheck.semantics.rewards import Structure

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd", "exact")

FLIP = """
dtmc
module flip
  s : [0..1] init 0;
  [] s=0 -> 1/2 : (s'=0) + 1/2 : (s'=1);
  [] s=1 -> (s'=0);
endmodule
rewards "r" s=1 : 3; [] s=0 : 1; endrewards
"""
"""With discount g: x0 = 1 + g (x0 + x1)/2 and x1 = 3 + g x0."""

SIGNED = """
mdp
module m
  s : [0..2] init 0;
  [stay] s=0 -> true;
  [go] s=0 -> 1/3 : (s'=1) + 2/3 : (s'=2);
  [back] s>0 -> (s'=0);
  [quit] s=1 -> true;
endmodule
rewards [stay] true : -1; [go] true : -4; s=1 : 9; [back] s=2 : 1; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_chain(engine):
    g = Fraction(9, 10)
    total = (1 + 3 * g / 2) / (1 - g / 2 - g * g / 2)
    model = engine_of(FLIP, engine)
    for text in ("R=? [ Cdiscount=0.9 ]", "R=? [ C discount=9/10 ]"):
        value = check_text(model, text).value
        assert value == (total if engine == "exact" else pytest.approx(float(total), rel=1e-12))
    after = [Fraction(0), Fraction(0)]
    for _ in range(7):
        after = [1 + g * (after[0] + after[1]) / 2, 3 + g * after[0]]
    value = check_text(model, "R=? [ C<=7 discount=0.9 ]").value
    assert value == (after[0] if engine == "exact" else pytest.approx(float(after[0]), rel=1e-13))
    assert check_text(model, f"R>={total} [ C discount=0.9 ]").value is True
    assert check_text(model, f"R>{total} [ C discount=0.9 ]").value is False
    assert check_text(model, "filter(max, R=? [ C discount=0 ])").value == 3
    assert check_text(model, "R=? [ C<=0 discount=0.5 ]").value == 0


@pytest.mark.parametrize("engine", ENGINES[:-1])
@pytest.mark.parametrize(("discount", "close"), [("0.999999", True), ("0.999999999999", False)])
def test_rounding_over_a_long_horizon_is_part_of_the_bounds(engine, discount, close):
    """A chain that ends soon has small values, and small errors, however long the horizon is."""
    text = FLIP.replace("(s'=0);", "true;").replace("s=1 : 3;", "")
    exact = check_text(engine_of(text, "exact"), f"R=? [ C discount={discount} ]").value
    result = check_text(engine_of(text, engine), f"R=? [ C discount={discount} ]")
    low, high = result.bounds
    assert low <= exact <= high
    assert high - low <= (1e-8 if close else 1e-2)
    assert bool(result.warnings) is not close


@pytest.mark.parametrize("engine", ENGINES[:-1])
@pytest.mark.parametrize("query", ["C<=2 discount=0.9", "C discount=0.9"])
def test_small_values_are_as_accurate_as_large_ones(engine, query):
    text = FLIP.replace("1/2 : (s'=0) + 1/2 : (s'=1)", "1-1e-12 : (s'=0) + 1e-12 : (s'=1)")
    text = text.replace(" [] s=0 : 1;", "")
    exact = check_text(engine_of(text, "exact"), f"R=? [ {query} ]").value
    result = check_text(engine_of(text, engine), f"R=? [ {query} ]")
    low, high = result.bounds
    assert low * (1 - 1e-13) <= exact <= high * (1 + 1e-13)  # may be exact up to rounding
    assert high - low <= 1e-6 * exact
    assert not result.warnings


def least_and_greatest(text: str, g: Fraction) -> list[list[Fraction]]:
    """The values of all states by solving the equations of each memoryless strategy."""
    engine = engine_of(text)
    matrix = engine.capability(HasMatrix).matrix
    states, rows = engine.rewards(Structure(0))
    groups = np.arange(matrix.states + 1) if matrix.groups is None else matrix.groups
    owner = np.repeat(np.arange(matrix.states), np.diff(groups))
    dense = np.zeros((matrix.rows, matrix.states))
    np.add.at(
        dense, (np.repeat(np.arange(matrix.rows), matrix.lengths), matrix.indices), matrix.data
    )
    found = []
    for chosen in itertools.product(*(range(a, b) for a, b in itertools.pairwise(groups))):
        rows_of = list(chosen)
        reward = (rows + states[owner])[rows_of]
        found.append(np.linalg.solve(np.eye(matrix.states) - float(g) * dense[rows_of], reward))
    return [np.min(found, axis=0), np.max(found, axis=0)]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("discount", ["0.5", "0.99"])
def test_an_mdp_with_negative_rewards(engine, discount):
    expected = least_and_greatest(SIGNED, Fraction(discount))
    model = engine_of(SIGNED, engine)
    for direction, values in zip(("min", "max"), expected, strict=True):
        for state in range(3):
            text = f"filter(state, R{direction}=? [ C discount={discount} ], s={state})"
            assert float(check_text(model, text).value) == pytest.approx(values[state], rel=1e-6)


def models(kind: str, count: int) -> list[str]:
    return [m.text for m in islice(bound_models("discount", kind), count)]


@pytest.mark.parametrize("text", [*models("dtmc", 8), *models("mdp", 8)])
def test_engines_agree_and_contain_the_exact_value(text):
    kind = text[:4].strip()
    direction = "max" if kind == "mdp" else ""
    for query in ("C discount=0.9", "C discount=0.999", "C<=5 discount=0.9"):
        formula = f"R{direction}=? [ {query} ]"
        exact = float(check_text(engine_of(text, "exact"), formula).value)
        for engine in ENGINES[:-1]:
            result = check_text(engine_of(text, engine), formula)
            low, high = (float(b) for b in result.bounds)
            slack = 1e-11 * abs(exact)
            assert low - slack <= exact <= high + slack, (formula, engine)
            assert high - low <= 2e-6 * max(abs(exact), 1e-300)


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_values_are_storms(kind, tmp_path):
    stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
    for source in models(kind, 12):
        engine = engine_of(source)
        if engine.deadlocks:
            continue  # Storm drops the rewards of deadlock states
        file = tmp_path / "model.prism"
        file.write_text(source)
        program = stormpy.parse_prism_program(str(file))
        for direction in ("min", "max") if kind == "mdp" else ("",):
            for query in ("Cdiscount=0.9", "C<=4 discount=0.5"):
                text = f'R{{"r"}}{direction}=? [ {query} ]'
                properties = stormpy.parse_properties(text, program)
                built = stormpy.build_model(program, properties)
                result = stormpy.model_checking(built, properties[0])
                theirs = result.get_value(built.initial_states[0])
                assert check_text(engine, text).value == pytest.approx(theirs, abs=1e-4), text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("R=? [ C discount=1 ]", "less than 1"),
        ("R=? [ C discount=-0.5 ]", "at least 0"),
        ("R=? [ C discount=s ]", "constant"),
        ("R=? [ C discount=true ]", "number"),
    ],
)
def test_faulty_discounts(text, message):
    with pytest.raises(InputError, match=message):
        symcheck.loads(FLIP).check(text)


def test_a_ctmc_has_none():
    with pytest.raises(UnsupportedError, match="DTMCs and MDPs"):
        symcheck.loads(FLIP.replace("dtmc", "ctmc")).check("R=? [ C discount=0.5 ]")


def test_simulation_refuses_them():
    with pytest.raises(UnsupportedError, match="without sampling"):
        symcheck.loads(FLIP).estimate("R=? [ C discount=0.5 ]")


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_a_threshold_beyond_the_accuracy_of_large_rewards_is_decided_by_rationals(
    engine: str,
) -> None:
    """Closer bounds of 4.6e19, a sum of rewards of both signs, need numbers beyond doubles."""
    model = symcheck.loads(
        """dtmc module m
          s : [0..5];
          [] s=0 -> 1e-300 : (s'=5) + 1/7 : (s'=2) + 1-1/7-1e-300 : (s'=3);
          [] s=1 -> (s'=5);
          [] s=2 -> 0.3 : (s'=4) + 1e-17 : (s'=5) + 1-0.3-1e-17 : (s'=3);
          [] s=3 -> 1-1e-9-0.5 : (s'=0) + 1e-9 : (s'=2) + 0.5 : (s'=3);
          [] s=4 -> 1e-200 : (s'=0) + 1-1e-200 : (s'=1);
          [] s=5 -> 0.25 : (s'=1) + 1e-12 : (s'=0) + 1-0.25-1e-12 : (s'=1);
        endmodule
        rewards "r"
          s=0 : -1e10; s=1 : 1e17; s=2 : -1e17; s=4 : 1e-200; s=5 : -1e16;
          [] s=1 : 1; [] s=5 : 1e16;
        endrewards""",
        engine=engine,
    )
    formula = 'R{"r"}>4.633405197417123e+19 [ C discount=0.999 ]'
    expected = model.with_options(engine="explicit", exact=True).check(formula).value
    assert model.check(formula).value is expected
