"""A kernel offers probabilities, whatever its engine stores."""

from __future__ import annotations

import numpy as np
import pytest

import symcheck
from symcheck.matrices.rows import SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel


def rows(data):
    return SparseMatrix(np.array([0, 2, 3]), np.array([0, 1, 1], np.int32), np.array(data), 2)


def test_discrete_time_has_probabilities_as_they_are_stored():
    kernel = TransitionKernel(rows([0.25, 0.75, 1.0]))
    assert kernel.exit_rates is None
    assert kernel.probabilities is kernel.weights


def test_continuous_time_has_exit_rates_beside_them():
    kernel = TransitionKernel(rows([1.0, 2.0, 5.0]), np.array([4.0, 5.0]))
    assert kernel.probabilities.data.tolist() == [0.25, 0.5, 1.0]


@pytest.mark.parametrize("engine", ["explicit", "sparse", "hybrid", "mtbdd"])
def test_engines_offer_the_same_probabilities(engine):
    model = symcheck.load("models/tandem/tandem.sm", constants={"c": 2}, engine=engine).engine
    system = model.system(model.all)
    assert system.exit_rates is not None
    of_rows = system.matrix.row_sums()
    assert of_rows == pytest.approx(np.ones(system.n), rel=1e-15)
    x = np.arange(1.0, system.n + 1)
    assert system.operator.multiply(x) == pytest.approx(system.matrix.multiply(x), rel=1e-15)
    assert system.kernel.weights.multiply(x) == pytest.approx(
        system.exit_rates * system.matrix.multiply(x), rel=1e-15
    )
    assert system.one_step_probability(model.all) == pytest.approx(of_rows, rel=1e-15)
