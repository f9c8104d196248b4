"""What a solution method declares about itself."""

from __future__ import annotations

from typing import Literal, Protocol

from symcheck.lazy_dataclass import dataclass
from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["Method", "Solver"]


class Solver(Protocol):
    """A function that solves linear problems."""

    def __call__(
        self, problem: LinearProblem, settings: Settings, observer: Observer | None = None, /
    ) -> Solution:
        """Bounds on the solution, or an estimate."""
        ...


@dataclass(frozen=True, slots=True)
class Method:
    """A method to solve linear problems, and its requirements, which are checked before it runs.

    requires: 'rows' (a SparseMatrix) or 'products' (an operator suffices).
    sound: whether its bounds are proved.
    description: one line for users.
    rewards: whether it solves expected rewards as well as probabilities.
    is_rational: whether it is for rationals, and for these only.
    """

    name: str
    solve: Solver
    requires: Literal["rows", "products"]
    sound: bool
    description: str
    rewards: bool = True
    is_rational: bool = False
