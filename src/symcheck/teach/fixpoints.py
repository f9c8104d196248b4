"""The fixpoints of prob0 and prob1 (Baier & Katoen 2008, 10.1.1 and 10.6.1), set by set."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from symcheck.direction import Direction
from symcheck.engines.symbolic.graph import SymbolicGraph

if TYPE_CHECKING:
    from symcheck.dd.manager import Bdd
    from symcheck.engines.symbolic.engine import SymbolicEngine
    from symcheck.engines.symbolic.sets import SymbolicSet

__all__ = ["SetFrame", "prob0", "prob1"]


@dataclass(frozen=True, eq=False)
class SetFrame:
    """An iterate of a fixpoint.

    Attributes:
        number: the number of the frame, from 0.
        stage: 'closure' (backward reachability, growing), 'every strategy reaches' (prob0 for the
            minimum), 'candidates' and 'sure' (prob1 for the maximum: outer and inner fixpoint), or
            'result'.
        states: the set.
        count: its number of states.
        nodes: its number of BDD nodes.
    """

    number: int
    stage: str
    states: SymbolicSet = field(repr=False)
    count: int
    nodes: int

    @property
    def bdd(self) -> Bdd:
        """The BDD of the set."""
        return self.states.bdd

    def __str__(self) -> str:
        return f"{self.number}: {self.stage}, {self.count} states in {self.nodes} nodes"


def prob0(
    engine: SymbolicEngine,
    left: SymbolicSet,
    right: SymbolicSet,
    direction: Direction | None = None,
) -> Iterator[SetFrame]:
    """The iterates of prob0; the last frame holds the states with probability 0.

    Args:
        engine: a symbolic engine.
        left, right: the sets of `left U right`.
        direction: minimise or maximise over strategies; None for a chain.
    """
    return _trace(engine, lambda graph: graph.prob0(left, right, direction))


def prob1(
    engine: SymbolicEngine,
    left: SymbolicSet,
    right: SymbolicSet,
    direction: Direction | None = None,
) -> Iterator[SetFrame]:
    """The iterates of prob1; the last frame holds the states with probability 1. See `prob0`."""
    return _trace(engine, lambda graph: graph.prob1(left, right, direction))


def _trace(
    engine: SymbolicEngine, run: Callable[[SymbolicGraph], SymbolicSet]
) -> Iterator[SetFrame]:
    from symcheck.engines.symbolic.sets import SymbolicSet

    seen: list[tuple[str, Bdd]] = []
    result = run(SymbolicGraph(engine, lambda what, states: seen.append((what, states))))
    for number, (what, bdd) in enumerate([*seen, ("result", result.bdd)]):
        states = SymbolicSet(engine.diagrams, bdd)
        yield SetFrame(number, what, states, states.count, bdd.node_count)
