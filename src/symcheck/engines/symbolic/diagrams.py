"""A built model, or its product with an automaton, as diagrams shared by all symbolic engines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, assert_never

import numpy as np

from symcheck.dd.odd import Odd
from symcheck.engines.linear_system import require_normal_rewards
from symcheck.semantics.rewards import Reward, Steps, Structure, Time
from symcheck.symbolic.model import LazySequence, TransitionPart

if TYPE_CHECKING:
    from symcheck.dd.manager import (
        Bdd,
        Cube,
        DiagramManager,
        Mtbdd,
        Renaming,
        Saturation,
        Transition,
    )
    from symcheck.symbolic.model import StateSpace, Transitions

__all__ = ["Diagrams", "HasDiagrams", "TransitionPart", "diagrams_of", "set_diagrams_of"]


@dataclass(frozen=True, eq=False)
class Diagrams:
    """States over `rows`, transitions from `rows` to `columns` (alternating, from the top of the
    diagrams down).

    states: all reachable states. deadlocks: those that had no transition of their own. loops:
    states with a self-loop that no step has (deadlocks, unless an automaton moves on there). steps:
    the transitions of positive probability without these loops, of all choices. roots: the matrices
    on reachable rows, loops included: one, or one per choice class of an MDP; `guards` (None unless
    an MDP): the states that have a choice in each class. actions: (class, action or None) to the
    states whose choice it is. state_rewards: per structure. transition_rewards: per structure and
    class, weighted by probability (rate). continuous: whether time is (of a CTMC).
    """

    manager: DiagramManager = field(repr=False)
    rows: tuple[str, ...] = field(repr=False)
    columns: tuple[str, ...] = field(repr=False)
    states: Bdd = field(repr=False)
    initial: Bdd = field(repr=False)
    deadlocks: Bdd = field(repr=False)
    loops: Bdd = field(repr=False)
    steps: tuple[TransitionPart, ...] = field(repr=False)
    roots: Sequence[Mtbdd] = field(repr=False)
    guards: tuple[Bdd, ...] | None = field(repr=False)
    actions: Mapping[tuple[int, str | None], Bdd] = field(repr=False)
    state_rewards: Sequence[Mtbdd] = field(repr=False)
    transition_rewards: Sequence[tuple[Mtbdd, ...]] = field(repr=False)
    continuous: bool = False

    def rewards(self, reward: Reward) -> tuple[Mtbdd, Sequence[Mtbdd]]:
        """State rewards, and transition rewards per choice class, by probability (rate)."""
        match reward:
            case Structure(index):
                states, rows = self.state_rewards[index], self.transition_rewards[index]
                require_normal_rewards(*(f.leaves for f in (states, *rows)))
                return states, rows
            case Time() if self.continuous:
                return self.states.to_mtbdd(), [self.manager.zero] * len(self.roots)
            case Steps() | Time():
                return self.manager.zero, [r.sum_over(self.column_cube) for r in self.roots]
            case _:
                assert_never(reward)

    @cached_property
    def entry_range(self) -> tuple[float, float]:
        """The smallest and the largest positive entry of the matrices."""
        leaves = np.concatenate([root.leaves for root in self.roots])
        positive = leaves[leaves > 0.0]
        return float(positive.min(initial=np.inf)), float(positive.max(initial=0.0))

    @cached_property
    def odd(self) -> Odd:
        """Numbers of all reachable states."""
        return Odd(self.manager, self.states, self.rows)

    @cached_property
    def count(self) -> int:
        """Number of reachable states."""
        return self.manager.count(self.states, self.row_cube)

    @cached_property
    def row_cube(self) -> Cube:
        """The row bits, for quantification."""
        return self.manager.cube(self.rows)

    @cached_property
    def column_cube(self) -> Cube:
        """The column bits, for quantification."""
        return self.manager.cube(self.columns)

    @cached_property
    def to_columns(self) -> Renaming:
        """Row bits to column bits."""
        return self.manager.renaming(dict(zip(self.rows, self.columns, strict=True)))

    @cached_property
    def whole(self) -> Transition:
        """All bits, for images by relations that change any of them."""
        return self.manager.transition(self.rows, self.columns)

    @cached_property
    def class_relations(self) -> tuple[Bdd, ...]:
        """The transitions of positive probability of each choice class, over all bits."""
        return tuple(root.to_bdd() for root in self.roots)

    @property
    def class_guards(self) -> tuple[Bdd, ...]:
        """Per choice class: the states that have a choice in it."""
        return (self.states,) if self.guards is None else self.guards

    @cached_property
    def levels(self) -> tuple[tuple[TransitionPart, ...], ...]:
        """Steps by the topmost variable that they change, lowest in the diagrams first."""
        groups: dict[int, list[TransitionPart]] = {}
        for step in self.steps:
            groups.setdefault(step.top, []).append(step)
        return tuple(tuple(groups[top]) for top in sorted(groups, reverse=True))

    @cached_property
    def transition_count(self) -> int:
        """Number of non-zero entries of all matrices."""
        both = self.manager.cube([*self.rows, *self.columns])
        return sum(self.manager.count(relation, both) for relation in self.class_relations)

    @cached_property
    def choice_count(self) -> int:
        """Number of choices (states, where there is no nondeterminism)."""
        return sum(self.manager.count(guard, self.row_cube) for guard in self.class_guards)

    @cached_property
    def _saturations(self) -> dict[bool, Saturation]:
        return {}

    def saturation(self, forward: bool) -> Saturation:
        """All steps in the form that saturation takes."""
        if forward not in self._saturations:
            relations = [(step.relation, step.transition) for step in self.steps]
            self._saturations[forward] = self.manager.saturation(relations, forward=forward)
        return self._saturations[forward]

    def union(self, sets: Sequence[Bdd]) -> Bdd:
        """Union of sets."""
        return self.manager.disjunction(sets)


class HasDiagrams(Protocol):
    """A capability (see `symcheck.engines.capabilities`): states and matrix are at hand as
    diagrams.
    """

    diagrams: Diagrams
    space: StateSpace
    """The reachable states, and the translation of expressions."""


def diagrams_of(transitions: Transitions) -> Diagrams:
    """The diagrams of a model without automaton."""
    space = transitions.space
    symbolic = space.symbolic
    return Diagrams(
        symbolic.manager,
        symbolic.encoding.rows,
        symbolic.encoding.columns,
        space.states,
        symbolic.initial,
        transitions.fixed,
        transitions.fixed,
        symbolic.relations,
        transitions.roots,
        None if transitions.matrix is not None else tuple(c.guard for c in transitions.choices),
        transitions.action_sets,
        transitions.state_rewards,
        transitions.transition_rewards,
        symbolic.model.type.continuous_time,
    )


def set_diagrams_of(space: StateSpace) -> Diagrams:
    """The diagrams of a chain where there are no MTBDDs: its graph is complete, and access to its
    matrix or rewards raises UnsupportedError.
    """
    symbolic = space.symbolic
    assert not symbolic.model.type.has_choices  # its graph needs choice classes
    matrix = LazySequence([lambda: symbolic.manager.zero])
    structures = range(len(symbolic.model.rewards))
    return Diagrams(
        symbolic.manager,
        symbolic.encoding.rows,
        symbolic.encoding.columns,
        space.states,
        symbolic.initial,
        space.deadlocks,
        space.deadlocks,
        symbolic.relations,
        matrix,
        None,
        {},
        LazySequence([lambda: symbolic.manager.zero for _ in structures]),
        LazySequence([lambda: (symbolic.manager.zero,) for _ in structures]),
        symbolic.model.type.continuous_time,
    )
