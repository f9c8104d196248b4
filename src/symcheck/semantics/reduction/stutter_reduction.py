"""Stutter reduction: unobserved deterministic steps are merged with the step before them.

At some control locations exactly one step is possible, with probability 1, and the observed
expressions have the same values before and after it. The two states are stutter equivalent, and no
path stays in such steps for ever, so they satisfy the same formulas that do not count steps. An
update that leads to such a location is replaced by one that leads to the next location.
Source: C. Baier, J.-P. Katoen: Principles of Model Checking (2008), 7.7 (stutter bisimulation, with
divergence).

Faults of the model are preserved: a value may be overwritten by a merged step only if it is known
to be in the variable's range.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from symcheck.lazy_dataclass import dataclass
from symcheck.semantics.model import BoundModel, BoundUpdate, Event
from symcheck.semantics.reduction.control_locations import Location, Locations, simplified
from symcheck.semantics.reduction.live_variables import is_safe, may_be_undefined
from symcheck.syntax.ast import (
    BinaryTemporal,
    Bound,
    Expression,
    Literal,
    Name,
    Next,
    StateOperator,
    UnaryTemporal,
)
from symcheck.syntax.traversal import Tree, names, nodes, substitute

__all__ = ["StutterReduction", "counts_steps", "reduce_stutter_steps"]

_MAX_ROUNDS = 20
"""Give up if this many attempts each found locations that cannot be eliminated."""

_MAX_NODES = 2_000
"""Do not merge steps if substitution makes an expression of more nodes."""

Assignments = dict[int, Expression]


def counts_steps(formula: Expression) -> bool:
    """Whether a formula may distinguish one step from two; True for unknown nodes."""
    return any(map(_may_count, nodes(formula)))


def _may_count(node: Tree) -> bool:
    match node:
        case StateOperator():
            return node.counts_steps
        case UnaryTemporal() | BinaryTemporal():
            return isinstance(node, Next) or node.bound is not None
        case _:  # bounds count steps, and so may rewards and nodes that are not known here
            return not isinstance(node, Expression | Bound)


class StutterReduction(NamedTuple):
    """A model, and the control locations that it does not reach any more."""

    model: BoundModel
    eliminated: frozenset[Location] = frozenset()


def reduce_stutter_steps(
    model: BoundModel, locations: Locations, observed: Sequence[Expression]
) -> StutterReduction:
    """Eliminate the locations whose only step changes no observed expression.

    The reduced model satisfies the same formulas over `observed` that do not count steps.

    Args:
        locations: the control locations of the model.
        observed: state expressions; a `Name` with the text "deadlock" in quotation marks stands
            for the deadlock label.

    Returns:
        The reduction; it holds the given model where no location can be eliminated.

    Source: Baier & Katoen (2008), 7.7.
    """
    rewards = (e for r in model.rewards for i in r.items for e in (i.guard, i.value))
    if (
        model.type.continuous_time
        or model.initial is not None
        or any(may_be_undefined(n) for e in rewards for n in nodes(e))
    ):
        return StutterReduction(model)
    return _StutterReducer(model, locations, tuple(observed)).run()


@dataclass(frozen=True)
class _DeterministicStep:
    """The only step at a location: its target, and its assignments."""

    target: Location
    assignments: Assignments


@dataclass(frozen=True, eq=False)
class _EnteringUpdate:
    """An update and its possible target locations, by source location.

    Attributes:
        alone: no other module takes part in the events of the update.
    """

    update: BoundUpdate
    alone: bool
    targets: dict[Location, frozenset[Location]]


class _StutterReducer:
    def __init__(
        self, model: BoundModel, locations: Locations, observed: tuple[Expression, ...]
    ) -> None:
        self.model = model
        self.locations = locations
        self.observed = observed
        self.types = {v.name: v.type for v in model.variables}
        begin = tuple(model.variables[i].initial for i in locations.control)
        steps = {x: self._step(x) for x in locations.moves if x != begin}
        self.steps = {x: s for x, s in steps.items() if s is not None and self._invisible(x, s)}
        self.entering_updates = list(self._entering_updates())

    def run(self) -> StutterReduction:
        eliminated = set(self.steps)
        for _ in range(_MAX_ROUNDS):
            if not eliminated:
                break
            changed, faulty = self._attempt(eliminated)
            if not faulty:
                events = tuple(self._event(e, changed) for e in self.model.events)
                return StutterReduction(replace(self.model, events=events), frozenset(eliminated))
            eliminated -= faulty
        return StutterReduction(self.model)

    def _attempt(self, eliminated: set[Location]) -> tuple[dict[int, BoundUpdate], set[Location]]:
        """Try to eliminate a set of locations.

        Returns:
            The new updates by the id of the updates that they replace, and the locations that
            cannot be eliminated.
        """
        changed: dict[int, BoundUpdate] = {}
        faulty: set[Location] = set()
        composed: dict[Location, Assignments] = {}
        for x in eliminated:
            chain = self._composed_steps(x, eliminated)
            if chain is None:
                faulty.add(x)
            else:
                composed[x] = chain
        for entering in self.entering_updates:
            reached = frozenset[Location]().union(
                *(t for x, t in entering.targets.items() if x not in eliminated)
            )
            hit = reached & eliminated
            if not hit:
                continue
            (where,) = hit if len(reached) == 1 else (None,)
            composition = None
            if where is not None and entering.alone and where in composed:
                composition = self._compose(dict(entering.update.assignments), composed[where])
            if composition is None:
                faulty |= hit
            else:
                changed[id(entering.update)] = replace(
                    entering.update, assignments=tuple(composition.items())
                )
        return changed, faulty

    def _composed_steps(self, location: Location, eliminated: set[Location]) -> Assignments | None:
        """The composed assignments of the steps from a location to the first that is kept.

        None if the steps form a cycle or cannot be composed.
        """
        step = self.steps[location]
        composition: Assignments | None = step.assignments
        seen = {location}
        while step.target in eliminated and composition is not None:
            if step.target in seen:
                return None
            seen.add(step.target)
            step = self.steps[step.target]
            composition = self._compose(composition, step.assignments)
        return composition

    def _compose(self, first: Assignments, second: Assignments) -> Assignments | None:
        """The sequential composition of two sets of assignments.

        None if a fault of the first might be lost, or an expression becomes too large.
        """
        variables = self.model.variables
        if not all(is_safe(first[i], variables[i], variables) for i in first if i in second):
            return None
        values = {variables[i].name: e for i, e in first.items()}
        after = {i: substitute(e, values) for i, e in second.items()}
        if any(sum(1 for _ in nodes(e)) > _MAX_NODES for e in after.values()):
            return None
        return {**first, **after}

    def _event(self, event: Event, changed: Mapping[int, BoundUpdate]) -> Event:
        parts = tuple(
            tuple(
                replace(c, updates=tuple(changed.get(id(u), u) for u in c.updates))
                for c in commands
            )
            for commands in event.participants
        )
        return replace(event, participants=parts)

    # ------------------------------------------------------------------------- steps at a location

    def _step(self, location: Location) -> _DeterministicStep | None:
        """The step of a location whose only step leads to one other location with probability 1."""
        moves = self.locations.moves[location]
        if (
            len(moves) != 1
            or len(moves[0].effects) != 1
            or len(moves[0].effects[0]) != 1
            or len(moves[0].combinations) != 1
        ):
            return None
        (effect,) = moves[0].effects[0]
        ((_, targets),) = moves[0].combinations
        probability = self.locations.residual(effect.update.probability, location)
        certain = isinstance(probability, Literal) and probability.value == 1
        if (
            not certain
            or not self._is_always_true(effect.command.guard, location)
            or len(targets) != 1
            or targets[0] == location
        ):
            return None
        assignments = effect.update.assignments
        values = {i: self.locations.residual(e, location) for i, e in assignments}
        return _DeterministicStep(targets[0], values)

    def _is_always_true(self, guard: Expression, location: Location) -> bool:
        residual = self.locations.residual(guard, location)
        return isinstance(residual, Literal) and residual.value is True

    def _invisible(self, location: Location, step: _DeterministicStep) -> bool:
        """Whether every observed expression has the same value before and after the step."""
        values = {self.model.variables[i].name: e for i, e in step.assignments.items()}
        for e in self.observed:
            after = self.locations.residual(e, step.target)
            if names(after) & set(values):
                after = simplified(substitute(after, values), self.types)
            if after != self.locations.residual(e, location):
                return False
        # Only the deadlock label distinguishes deadlocks: the source is none, so the target must
        # not be one either.
        seen = any(
            isinstance(n, Name) and n.name == '"deadlock"' for e in self.observed for n in nodes(e)
        )
        return not seen or self._has_transition(step.target)

    def _has_transition(self, location: Location) -> bool:
        """Whether some unsynchronised command is enabled in every state of the location."""
        alone = [m.effects[0] for m in self.locations.moves[location] if len(m.effects) == 1]
        return any(
            self._is_always_true(e.command.guard, location) for effects in alone for e in effects
        )

    def _entering_updates(self) -> Iterator[_EnteringUpdate]:
        updates: dict[int, _EnteringUpdate] = {}
        for location, move, participant, effect in self.locations.steps():
            update, alone = effect.update, len(move.effects) == 1
            entering = updates.get(id(update), _EnteringUpdate(update, alone, {}))
            updates[id(update)] = replace(entering, alone=entering.alone and alone)
            targets = entering.targets.get(location, frozenset())
            entering.targets[location] = targets | move.targets[participant][effect.control]
        yield from updates.values()
