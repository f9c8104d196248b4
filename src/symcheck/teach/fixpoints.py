"""prob0 and prob1: how graph analysis finds the certain states, set by set."""

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
    """A set on the way to a fixpoint.

    stage: 'closure' (states with a path to the target, growing), 'every strategy reaches' (prob0 of 'min'), 'candidates' and
    'sure' (prob1 of 'max': the outer and the inner fixpoint), and 'result'.
    """

    number: int
    stage: str
    states: SymbolicSet = field(repr=False)
    count: int
    nodes: int

    @property
    def bdd(self) -> Bdd:
        """The set as a diagram."""
        return self.states.bdd

    def __str__(self) -> str:
        return f"{self.number}: {self.stage}, {self.count} states in {self.nodes} nodes"


def prob0(
    engine: SymbolicEngine,
    left: SymbolicSet,
    right: SymbolicSet,
    direction: Direction | None = None,
) -> Iterator[SetFrame]:
    """The sets on the way to the states whose (min/max) probability of left U right is 0; the last frame holds these."""
    return _film(engine, lambda graph: graph.prob0(left, right, direction))


def prob1(
    engine: SymbolicEngine,
    left: SymbolicSet,
    right: SymbolicSet,
    direction: Direction | None = None,
) -> Iterator[SetFrame]:
    """As `prob0`, for probability 1."""
    return _film(engine, lambda graph: graph.prob1(left, right, direction))


def _film(
    engine: SymbolicEngine, run: Callable[[SymbolicGraph], SymbolicSet]
) -> Iterator[SetFrame]:
    from symcheck.engines.symbolic.sets import SymbolicSet

    seen: list[tuple[str, Bdd]] = []
    result = run(SymbolicGraph(engine, lambda what, states: seen.append((what, states))))
    for number, (what, bdd) in enumerate([*seen, ("result", result.bdd)]):
        states = SymbolicSet(engine.diagrams, bdd)
        yield SetFrame(number, what, states, states.count, bdd.node_count)
