"""Transition structures: probabilities, and exit rates beside them where time is continuous."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np

from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.operators import Operator

__all__ = ["TransitionKernel", "jump_weights"]

M_co = TypeVar("M_co", bound=Operator, covariant=True)


@dataclass(frozen=True, eq=False)
class TransitionKernel(Generic[M_co]):
    """The transitions among some states: probabilities, and the rates at which states are left.

    Attributes:
        weights: the probabilities; in continuous time each times the exit rate of its row. Engines
            store these products, because their quotients are more distinct numbers, and an MTBDD
            would have many more nodes.
        exit_rates: per row, successors outside of the states included; None in discrete time, and
            0 for a choice of a Markov automaton that takes no time, whose weights are its
            probabilities.
    """

    weights: M_co
    exit_rates: Numbers | None = None

    @property
    def probabilities(self) -> M_co:
        """The one-step probabilities; in continuous time a new matrix at each use."""
        rates = self.exit_rates
        return self.weights if rates is None else self.weights.divided(jump_weights(rates))


def jump_weights(exit_rates: Numbers) -> Numbers:
    """Per row, the sum of its weights: its exit rate, 1 for a choice that takes no time."""
    return np.where(exit_rates > 0, exit_rates, 1)
