"""Rewards within a cost: by hand, against step bounds, a model that counts itself, and Storm."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from math import inf, isfinite

import numpy as np
import pytest

import symcheck
from checking import check_text, engine_of
from generate import bound_models
from symcheck.errors import UnsupportedError
from symcheck.semantics.rewards import Structure

ENGINES = ("explicit", "sparse", "hybrid", "mtbdd", "exact")

CYCLE = """
dtmc
module m
  s : [0..2] init 0;
  [a] s=0 -> 1/2 : (s'=1) + 1/2 : (s'=0);
  [b] s=1 -> (s'=2);
  [c] s=2 -> (s'=0);
endmodule
rewards "r" s=0 : 1; [b] true : 10; [c] true : 100; endrewards
rewards "c" [a] true : 2; s=1 : 1; endrewards
"""
"""The step from 2 costs nothing, so it is counted whenever the step before was."""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("budget", "value"), [(0, 0), (1, 0), (2, 1), (3, 56), (4, 56.5), (5, 84.5), (6, 112.25)]
)
def test_by_hand(engine, budget, value):
    model = engine_of(CYCLE, engine)
    found = check_text(model, f'R{{"r"}}=? [ C{{"c"}}<={budget} ]').value
    assert float(found) == pytest.approx(value, rel=1e-9)
    strict = check_text(model, f'R{{"r"}}=? [ C^{{rew{{"c"}}<{budget + 1}}} ]').value
    assert strict == found
    assert check_text(model, f'R{{"r"}}>={value} [ C{{"c"}}<={budget} ]').value is True


STAY = """
mdp
const int B;
module m
  s : [0..3] init 0;
  b : [0..B] init B;  // what is left of the budget
  [go] s=0 & b>=2 -> 0.3 : (s'=1) & (b'=b-2) + 0.7 : (s'=2) & (b'=b-2);
  [free] s=1 -> 0.5 : (s'=0) + 0.5 : (s'=2);
  [pay] s=1 & b>=3 -> (s'=3) & (b'=b-3);
  [rest] s=2 -> true;
  [back] s=2 & b>=1 -> (s'=0) & (b'=b-1);
  [back] s=3 & b>=1 -> (s'=0) & (b'=b-1);
  [stop] s=0 & b<2 | s=1 & b<3 | s>=2 & b<1 -> (s'=3) & (b'=0);
endmodule
rewards "r" [go] true : 1; [free] true : 2; [pay] true : 9; s=2 : 0; endrewards
"""
"""Counts its budget itself; the action stop stands for a step beyond the budget."""

COSTS = """
mdp
module m
  s : [0..3] init 0;
  [go] s=0 -> 0.3 : (s'=1) + 0.7 : (s'=2);
  [free] s=1 -> 0.5 : (s'=0) + 0.5 : (s'=2);
  [pay] s=1 -> (s'=3);
  [rest] s=2 -> true;
  [back] s=2 -> (s'=0);
  [back] s=3 -> (s'=0);
endmodule
rewards "r" [go] true : 1; [free] true : 2; [pay] true : 9; endrewards
rewards "c" [go] true : 2; [pay] true : 3; [back] true : 1; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("budget", [0, 2, 5, 11, 20])
def test_a_model_that_counts_itself(engine, budget):
    counting = engine_of(STAY, "exact", {"B": str(budget)})
    model = engine_of(COSTS, engine)
    for direction in ("min", "max"):
        expected = check_text(counting, f'R{{"r"}}{direction}=? [ C ]').value
        found = check_text(model, f'R{{"r"}}{direction}=? [ C{{"c"}}<={budget} ]').value
        assert float(found) == pytest.approx(float(expected), rel=1e-9)


def models(kind: str, count: int) -> Iterator[str]:
    """Models with costs and without deadlocks, as Storm drops the rewards of deadlock states."""
    texts = (m.text for m in bound_models("cost", kind, costs=True))
    return islice((t for t in texts if not engine_of(t).deadlocks), count)


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_steps_are_a_cost(kind):
    for text in models(kind, 10):
        for direction in ("min", "max") if kind == "mdp" else ("",):
            engine = engine_of(text)
            head = f'R{{"r"}}{direction}=? '
            steps = check_text(engine, f"{head}[ C^{{steps<=6}} ]").value
            assert steps == pytest.approx(check_text(engine, f"{head}[ C<=6 ]").value, rel=1e-12)


def by_iteration(text: str, budget: int, direction: str) -> float:
    """The value of the initial state by iterating the equations of all levels many times."""
    engine = engine_of(text)
    matrix = engine.system(engine.all).matrix
    groups = np.arange(matrix.rows + 1) if matrix.groups is None else matrix.groups
    owner = np.repeat(np.arange(matrix.states), np.diff(groups))
    dense = np.zeros((matrix.rows, matrix.states))
    np.add.at(
        dense, (np.repeat(np.arange(matrix.rows), matrix.lengths), matrix.indices), matrix.data
    )
    (r_states, r_rows), (c_states, c_rows) = (engine.rewards(Structure(i)) for i in (0, 1))
    reward, cost = r_states[owner] + r_rows, (c_states[owner] + c_rows).round().astype(int)
    best = np.minimum if direction == "min" else np.maximum
    x = np.zeros((budget + 1, matrix.states))
    for _ in range(3000):
        for level in range(budget + 1):
            after = x[np.maximum(level - cost, 0)]
            rows = reward + (dense * after).sum(axis=1)
            x[level] = best.reduceat(np.where(cost <= level, rows, 0), groups[:-1])
    return x[budget][int(engine.numbers(engine.initial)[0])]


@pytest.mark.parametrize("kind", ["dtmc", "mdp"])
def test_random_models(kind):
    compared = 0
    for text in models(kind, 12):
        for direction in ("min", "max") if kind == "mdp" else ("",):
            formula = f'R{{"r"}}{direction}=? [ C{{"c"}}<=7 ]'
            try:
                results = [
                    check_text(engine_of(text, e), formula) for e in ("explicit", "hybrid", "exact")
                ]
            except UnsupportedError:
                continue
            value = float(results[-1].value)
            if not isfinite(value):
                continue
            assert by_iteration(text, 7, direction) == pytest.approx(value, rel=1e-6), formula
            for result in results[:-1]:
                low, high = result.bounds
                assert low * (1 - 1e-11) <= value <= high * (1 + 1e-11), (formula, text)
            compared += 1
    assert compared >= 8


def test_values_of_mdps_are_storms(tmp_path):
    """Storm gives other values to some DTMCs with overlapping commands; the iteration above decides."""
    stormpy = pytest.importorskip("stormpy", reason="Storm's Python package is not installed")
    compared = 0
    for text in [CYCLE, *models("mdp", 15)]:
        file = tmp_path / "model.prism"
        file.write_text(text)
        program = stormpy.parse_prism_program(str(file))
        for direction in ("min", "max") if "mdp" in text else ("",):
            formula = f'R{{"r"}}{direction}=? [ C{{"c"}}<=7 ]'
            try:
                ours = check_text(engine_of(text), formula).value
            except UnsupportedError:
                continue
            if not isfinite(ours):
                continue
            properties = stormpy.parse_properties(formula, program)
            built = stormpy.build_model(program, properties)
            found = stormpy.model_checking(built, properties[0], only_initial_states=True)
            theirs = found.get_value(built.initial_states[0])
            assert ours == pytest.approx(theirs, rel=1e-4, abs=1e-6), (formula, text)
            compared += 1
    assert compared >= 10


FREE = """
mdp
module m
  s : [0..2] init 0;
  [a] s=0 -> (s'=1);
  [b] s=0 -> (s'=2);
  [earn] s=1 -> true;
  [] s=2 -> (s'=0);
endmodule
rewards "r" [earn] true : 1; s=2 : 5; endrewards
rewards "c" [a] true : 3; s=2 : 1; endrewards
"""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_free_cycle_with_a_reward_is_infinite_once_it_is_affordable(engine):
    model = engine_of(FREE, engine)
    assert check_text(model, 'R{"r"}max=? [ C{"c"}<=2 ]').value == 10
    assert check_text(model, 'R{"r"}max=? [ C{"c"}<=3 ]').value == inf
    with pytest.raises(UnsupportedError, match="least reward that is infinite"):
        check_text(model, 'R{"r"}min=? [ C{"c"}<=2 ]')


RARELY_LEFT = """
mdp
module m
  x : [0..1]; z : [0..1];
  [go] x=0 -> 1e-17 : (x'=1) + 1-1e-17 : (z'=1-z);
  [pay] x=0 -> (z'=1);
  [stop] x=0 -> (x'=1);
  [] x=1 -> true;
endmodule
rewards "r" true : 1; endrewards
rewards "c" [pay] true : 2; x=1 : 1; endrewards
"""
"""In doubles, `go` never leads to x=1, and no upper bound is found for the reward without cost."""


def test_a_component_that_rounding_hides_is_solved_in_rationals():
    result = symcheck.loads(RARELY_LEFT).check('R{"r"}max=? [ C{"c"}<=3 ]')
    exact = symcheck.loads(RARELY_LEFT, exact=True).check('R{"r"}max=? [ C{"c"}<=3 ]').value
    assert result.accuracy.lower <= exact <= result.accuracy.upper < 1.001 * exact


def test_a_reward_without_an_upper_bound_is_not_called_infinite(monkeypatch):
    monkeypatch.setattr("symcheck.numerics.rational_limits.COMPONENT_STATES", 0)
    result = symcheck.loads(RARELY_LEFT).check('R{"r"}max=? [ C{"c"}<=3 ]')
    assert isfinite(result.value)
    assert result.accuracy.upper == inf
    assert "further than asked for" in result.warnings[0]
    exact = symcheck.loads(RARELY_LEFT, exact=True).check('R{"r"}max=? [ C{"c"}<=3 ]').value
    assert result.accuracy.lower <= exact


def test_a_ctmc_pays_for_transitions():
    race = """
    ctmc
    module race
      x : [0..2];
      [] x=0 -> 3 : (x'=1) + 1 : (x'=2);
      [] x>0 -> 2 : (x'=0);
    endmodule
    rewards "time" true : 1; endrewards
    rewards "jumps" [] true : 1; endrewards
    """
    model = symcheck.loads(race)
    assert model.check('R{"time"}=? [ C{"jumps"}<=3 ]').value == pytest.approx(
        1 / 4 + 1 / 2 + 1 / 4
    )


@pytest.mark.parametrize(
    "text", ['R{"r"}=? [ C{"c"}>=3 ]', 'R{"r"}=? [ C^{rew{"c"}<=3, steps<=2} ]']
)
def test_what_is_not_supported(text):
    with pytest.raises(UnsupportedError, match="cumulative reward"):
        symcheck.loads(CYCLE).check(text)
