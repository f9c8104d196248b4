"""Chains without cycles on diagrams: the values of the explicit engine, wherever they are asked
for.
"""

from __future__ import annotations

import numpy as np
import pytest

from symcheck.engines import tuning
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.symbolic.acyclic import solve_acyclic
from symcheck.engines.symbolic.forms import SparseEngine
from symcheck.explicit.build import Exploration
from symcheck.numerics.linear.methods import solve_linear
from symcheck.numerics.linear.problem import LinearProblem
from symcheck.numerics.settings import Accuracy
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind
from symcheck.semantics.rewards import Structure
from symcheck.symbolic.build import construct
from symcheck.syntax.parse import parse_expression as parse
from symcheck.syntax.parse import parse_model

TREE = """
dtmc
module tree
  depth : [0..5] init 0;
  place : [0..31] init 0;
  [] depth<5 -> 0.3 : (depth'=depth+1) & (place'=place) + 0.7 : (depth'=depth+1) & (place'=31-floor(place/2));
  [] depth=5 -> {loop};
endmodule
rewards depth<5 : place/7; [] true : 0.25; endrewards
"""


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Models of any size are large enough."""
    monkeypatch.setattr(tuning, "ACYCLIC_STATES", 1)
    monkeypatch.setattr(tuning, "ACYCLIC_NODE_SHARE", 1e9)
    monkeypatch.setattr(tuning, "ACYCLIC_NODES_PER_STATE", 1e9)


def engines(loop: str = "true") -> tuple[SparseEngine, ExplicitEngine]:
    model = bind(parse_model(TREE.replace("{loop}", loop)))
    exploration = Exploration(model, Options())
    exploration.run()
    return SparseEngine.of(construct(model, Options())), ExplicitEngine(exploration.finish())


def among(engine: ExplicitEngine, inside: np.ndarray, constant: np.ndarray) -> np.ndarray:
    system = engine.system(engine.from_bools(inside))
    found = solve_linear(
        LinearProblem(constant[inside], system.matrix, probability=False), Accuracy()
    )
    out = np.zeros(len(inside))
    out[inside] = found.middle
    return out


@pytest.mark.usefixtures("small")
def test_rewards_are_those_of_rows() -> None:
    symbolic, explicit = engines()
    states = symbolic.where(parse("depth<5"))
    found = solve_acyclic(
        symbolic.diagrams,
        states,
        None,
        Structure(0),
        [(symbolic.where(parse("depth=5 & place>3")), 7.0)],
    )
    assert found is not None
    inside = explicit.where(parse("depth<5")).members
    per_state, per_row = explicit.system(explicit.all).rewards(Structure(0))
    expected = among(explicit, inside, per_state + per_row)
    expected[explicit.where(parse("depth=5 & place>3")).members] = 7.0
    low, high = found.values.at(symbolic.all)
    assert np.all(low <= expected * (1 + 1e-13))
    assert np.all(expected * (1 - 1e-13) <= high)
    assert np.all(high - low <= 1e-12 * high)
    assert found.steps == 5


@pytest.mark.usefixtures("small")
def test_probabilities_and_a_part_of_the_states() -> None:
    symbolic, explicit = engines()
    found = solve_acyclic(
        symbolic.diagrams,
        symbolic.where(parse("depth<5")),
        symbolic.where(parse("depth=5 & place>20")),
        None,
        [],
    )
    assert found is not None
    inside = explicit.where(parse("depth<5")).members
    expected = among(
        explicit,
        inside,
        explicit.system(explicit.all).one_step_probability(
            explicit.where(parse("depth=5 & place>20"))
        ),
    )
    low, high = found.values.minimum(symbolic.initial)
    assert low <= expected[0] <= high
    yes, open_ = found.values.compare(">", 0.5)
    assert np.array_equal(symbolic.to_bools(yes), expected > 0.5)
    assert not open_


@pytest.mark.usefixtures("small")
def test_cycles_are_left_to_others() -> None:
    symbolic, _ = engines("0.5 : (depth'=0) + 0.5 : true")
    assert solve_acyclic(symbolic.diagrams, symbolic.all, None, Structure(0), []) is None


def test_few_states_are_left_to_arrays() -> None:
    symbolic, _ = engines()
    assert (
        solve_acyclic(symbolic.diagrams, symbolic.where(parse("depth<5")), None, Structure(0), [])
        is None
    )
