"""What some engines offer beyond `symcheck.engines.base.Engine`: optional protocols, and the one
way to ask for them.

An engine declares a capability by inheriting from its protocol. Other rooms ask with
`engine.capability(HasMatrix)`, which gives the engine under that protocol, or None; nobody else
asks what an engine is. Capabilities that speak of diagrams are beside these: `HasDiagrams` in
engines/symbolic/diagrams.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from symcheck.engines.base import CapabilityT, Engine
from symcheck.matrices.rows import Bools, Int32s, SparseMatrix
from symcheck.syntax.ast import Expression

if TYPE_CHECKING:
    from symcheck.explicit.explored import ExploredModel

__all__ = [
    "Capable",
    "HasActions",
    "HasBlocks",
    "HasExploredModel",
    "HasImportedStates",
    "HasMatrix",
    "HasRationalTwin",
]


class Capable:
    """The capabilities of an engine: the protocols that its class inherits from."""

    def capability(self, kind: type[CapabilityT]) -> CapabilityT | None:
        """The engine as what offers `kind` (a protocol, or the class of an engine); None where it
        does not.

        Example:
            >>> rows = engine.capability(HasMatrix)
            >>> entries = None if rows is None else rows.matrix.entries
        """
        return self if kind in type(self).__mro__ else None  # type: ignore[return-value]


class HasMatrix(Protocol):
    """The rows of all states are at hand."""

    @property
    def matrix(self) -> SparseMatrix:
        """One-step probabilities (rates) as doubles, deadlocks fixed."""
        ...


class HasExploredModel(Protocol):
    """States are rows of a table."""

    explored: ExploredModel
    """States, rows, rewards and actions as arrays."""


class HasActions(Protocol):
    """The action of each choice is known (MDP)."""

    def row_actions(self) -> Int32s:
        """Per row of all states: the number of its action among the model's, -1 for none."""
        ...


class HasRationalTwin(Protocol):
    """The model has no text to bind again, and says itself what it is in rational arithmetic."""

    def rational(self) -> Engine:
        """The same model in rational arithmetic. Raises UnsupportedError where there is none."""
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
    entry_rewards: Sequence[Any]
    """Per reward structure the reward of each transition (None: those of its row are all the
    row's).
    """
