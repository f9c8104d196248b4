"""Short intervals of Markov automata: the bounds at a change of the best choice, in closed form."""

from decimal import Decimal, localcontext
from random import Random

import numpy as np
import pytest

from symcheck.direction import Direction
from symcheck.matrices.rows import SparseMatrix
from symcheck.numerics.transient.timed_choices import TimedProblem, TimedSteps


def problem(fast: float, slow: float, chance: float, direction: Direction) -> TimedProblem:
    """State 0 takes time, state 1 chooses between `chance` at once and state 2, which takes time."""
    matrix = SparseMatrix(
        np.array([0, 1, 1, 2, 2]), np.array([1, 2], np.int32), np.ones(2), 3, np.array([0, 1, 3, 4])
    )
    return TimedProblem(
        matrix,
        np.array([fast, 0.0, 0.0, slow]),
        np.array([0.0, chance, 0.0, 1.0]),
        np.array([0.0, 1.0, 0.0, 1.0]),
        np.zeros(3),
        np.zeros(3),
        direction,
        0.0,
        1.0,
    )


def values(
    fast: float, slow: float, chance: float, direction: Direction, time: float
) -> list[Decimal]:
    """The best probabilities to arrive in time: integrals over the time of the first jump."""
    rate, mu, p, t = map(Decimal, (fast, slow, chance, time))
    change = min(t, -(1 - p).ln() / mu)

    def density(a: Decimal, b: Decimal) -> Decimal:
        return (-rate * (t - b)).exp() - (-rate * (t - a)).exp()

    def later(a: Decimal, b: Decimal) -> Decimal:
        d = rate - mu
        power = b - a if d == 0 else ((d * b).exp() - (d * a).exp()) / d
        return density(a, b) - rate * (-rate * t).exp() * power

    arrives = 1 - (-mu * t).exp()
    if direction is Direction.MAX:
        return [p * density(Decimal(0), change) + later(change, t), max(p, arrives), arrives]
    return [later(Decimal(0), change) + p * density(change, t), min(p, arrives), arrives]


@pytest.mark.parametrize("direction", list(Direction))
def test_a_choice_that_changes_within_a_short_interval(direction: Direction):
    rng = Random(5)
    with localcontext() as context:
        context.prec = 50
        for _ in range(150):
            fast, slow = rng.choice([0.3, 1.0, 2.0, 5.0]), rng.choice([0.3, 1.0, 2.0, 5.0])
            chance, jumps = rng.uniform(0.05, 0.95), 10 ** rng.uniform(-4.0, -0.01)
            run = TimedSteps(problem(fast, slow, chance, direction), max(fast, slow))
            length = jumps / run.rate
            begin = max(-np.log1p(-chance) / slow - rng.uniform(-0.3, 1.3) * length, 0.0)
            before = np.array(list(map(float, values(fast, slow, chance, direction, begin))))
            low, high = run.interval(before * (1 - 1e-15), before * (1 + 1e-15), jumps, 1e-13)
            low, high = low * (1.0 - run.error), high * (1.0 + run.error) + run.beyond
            after = values(fast, slow, chance, direction, begin + length)
            for state in (0, 2):
                assert Decimal(low[state]) <= after[state] <= Decimal(high[state])
            assert high[0] - low[0] <= 0.2 * jumps**2 + 1e-11
            assert high[2] - low[2] <= 1e-5 * jumps**2 + 1e-11
