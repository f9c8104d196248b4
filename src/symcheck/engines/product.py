"""The product with an automaton: an engine over pairs, and the projection to the model."""

from __future__ import annotations

from typing import Protocol

from symcheck.engines.base import Engine, StateSet, Values
from symcheck.matrices.rows import Int32s

__all__ = ["Automaton", "Product"]


class Automaton(Protocol):
    """A deterministic automaton: numbered states and a table of successors.

    A letter is a number whose bit i says whether letter set number i holds.
    """

    @property
    def initial(self) -> int:
        """The state in which every run begins."""
        ...

    @property
    def table(self) -> Int32s:
        """int32[states, 2**letters]: the successor of a state under a letter."""
        ...


class Product(Protocol):
    """`engine` is over the pairs that are reachable from (s, q0) for every state s of the base
    model.

    The automaton reads the letter of the state that is left: from (s, q) with q' = delta(q,
    letter(s)) each transition s -> s' becomes (s, q) -> (s', q'). So a run's automaton states are
    shifted by one step and nothing else changes.
    """

    engine: Engine

    def lift(self, states: StateSet) -> StateSet:
        """The pairs whose first part is in `states` (a set of the base engine)."""
        ...

    def automaton_states(self, states: frozenset[int]) -> StateSet:
        """The pairs whose second part is in `states`."""
        ...

    def edges(self, edges: frozenset[tuple[int, int]]) -> StateSet:
        """The pairs (s, q) for which (q, letter of s) is in `edges`."""
        ...

    def project(self, values: Values) -> Values:
        """For each state s of the base model, the value at (s, q0)."""
        ...

    def project_set(self, states: StateSet) -> StateSet:
        """The states s of the base model with (s, q0) in `states`."""
        ...
