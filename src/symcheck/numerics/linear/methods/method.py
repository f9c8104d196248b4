"""What a solution method declares about itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from symcheck.numerics.linear.problem import LinearProblem, Observer, Solution
from symcheck.numerics.settings import Settings

__all__ = ["CHAINS_AND_MDPS", "Kind", "Method", "Solver"]

Kind = Literal["chain", "mdp", "probability", "reward"]

CHAINS_AND_MDPS: frozenset[Kind] = frozenset(("chain", "mdp", "probability", "reward"))


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
    numbers: the number type of matrix, constants and values.
    sound: whether its bounds are proved.
    kinds: the problems that it solves.
    description: one line for users.
    """

    name: str
    solve: Solver
    requires: Literal["rows", "products"]
    sound: bool
    description: str
    kinds: frozenset[Kind] = CHAINS_AND_MDPS
    numbers: Literal["float64", "rational"] = "float64"
