"""Capabilities: optional protocols of engines, and the function that asks for them.

An engine declares a capability by inheriting from its protocol. Other packages ask with
`engine.capability(HasMatrix)`, which returns the engine under that protocol, or None. The
capability of engines with diagrams is `HasDiagrams` in engines/symbolic/diagrams.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from symcheck.direction import Direction
from symcheck.engines.base import CapabilityT, Engine
from symcheck.matrices.contributions import Contributions
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Int32s, SparseMatrix
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.explicit.explored import ExploredModel
    from symcheck.explicit.orbits import Represented

__all__ = [
    "Capable",
    "HasActions",
    "HasBestExpectations",
    "HasBlocks",
    "HasExploredModel",
    "HasImportedStates",
    "HasMatrix",
    "HasRationalTwin",
    "HasUncertainty",
    "RepresentsOrbits",
]


class Capable:
    """The capabilities of an engine: the protocols that its class inherits from."""

    @property
    def has_opponents(self) -> bool:
        """Whether some states choose against the direction of what is asked: no, by default."""
        return False

    def capability(self, kind: type[CapabilityT]) -> CapabilityT | None:
        """The engine under the protocol `kind`, or None.

        Args:
            kind: a protocol of this file, or the class of an engine.

        Examples:
            >>> import symcheck
            >>> engine = symcheck.load("models/die/die.pm", engine="explicit").engine
            >>> rows = engine.capability(HasMatrix)
            >>> None if rows is None else rows.matrix.entries
            20
        """
        return self if kind in type(self).__mro__ else None  # type: ignore[return-value]


class HasMatrix(Protocol):
    """The rows of all states are available."""

    @property
    def weights(self) -> SparseMatrix:
        """The weights of the kernel (see TransitionKernel), deadlocks fixed."""
        ...

    @property
    def matrix(self) -> SparseMatrix:
        """One-step probabilities, deadlocks fixed; in continuous time a new matrix at each use."""
        ...


class HasExploredModel(Protocol):
    """States are rows of a table."""

    explored: ExploredModel
    """States, rows, rewards and actions as arrays."""


class RepresentsOrbits(Protocol):
    """States may stand for others: those that symmetries make of them, or that differ in variables
    on which the properties do not depend.
    """

    represented: Represented | None
    """The counts of the whole model; None if every state is explored."""


class HasActions(Protocol):
    """The action of each choice is known (MDP)."""

    def row_actions(self) -> Int32s:
        """Per row of all states: the number of its action among the model's, -1 for none."""
        ...


class HasRationalTwin(Protocol):
    """The model was built without a text, and converts itself to rational arithmetic."""

    def rational(self) -> Engine:
        """The same model in rational arithmetic.

        Raises:
            UnsupportedError: there is none.
        """
        ...


class HasUncertainty(Protocol):
    """Probabilities are intervals, from which nature chooses."""

    def against(
        self, direction: Direction | None, nature: Direction
    ) -> tuple[Engine, Direction | None]:
        """The engine in which nature minimises or maximises, and the direction to ask it for.

        That engine derives the direction of nature from that of the player, so that complements are
        computed as in other models. Where chance alone chooses, nature becomes the player.

        Args:
            direction: that of the player's strategies; None where chance alone chooses.
            nature: that of nature, which knows the strategy.
        """
        ...


class HasBestExpectations(Protocol):
    """Nature has a direction: the best expectations of rows of intervals are known."""

    def best_expectations(
        self, lower: Numbers, upper: Numbers, direction: Direction | None
    ) -> tuple[Numbers, Numbers]:
        """Per row, bounds of the expectation that nature chooses, if the player has a direction.

        Args:
            lower: lower bounds of the values of all states, not negative in doubles.
            upper: their upper bounds.
            direction: that of the player.
        """
        ...


class HasBlocks(Protocol):
    """The states are blocks of a partition of the states that the model's text describes."""

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        ...


class HasImportedStates(Protocol):
    """The model was read state by state: states keep the order of the files, labels are sets."""

    members: Mapping[Expression, Bools]
    """Per label the states that have it, bool[states]."""
    entry_rewards: Sequence[Numbers | None]
    """Per reward structure the reward of each transition (None: those of its row are all the
    row's).
    """
    contributions: Contributions | None
    """What each action contributes to the transitions of a chain; None without actions."""
