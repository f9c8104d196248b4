"""Steps that nothing can observe, taken together with the step before.

At some control locations exactly one thing can happen, for certain, and nothing that the properties observe differs before
and after. A state there and its successor are alike for every property that does not count steps: they are stutter
equivalent, and no run stays in such steps. So an update that leads to such a location goes on to the next one at once.
Source: C. Baier, J.-P. Katoen: Principles of Model Checking (2008), 7.7 (stutter bisimulation, with divergence).

Faults of the model stay faults: a value that would be overwritten on the way must be known to be in its range.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from symcheck.semantics.model import BoundModel, BoundUpdate, Event
from symcheck.semantics.reduction.control_locations import Location, Locations, folded
from symcheck.semantics.reduction.live_variables import harmless, partial
from symcheck.syntax.ast import (
    Binary,
    Bound,
    Call,
    Conditional,
    Eventually,
    Expression,
    Globally,
    LabelReference,
    Literal,
    ModelType,
    Name,
    Release,
    StateOperator,
    Unary,
    Until,
    WeakUntil,
)
from symcheck.syntax.traversal import Tree, names, nodes, substitute

__all__ = ["Shortened", "counts_steps", "shorten"]

_ROUNDS = 20  # of finding locations that cannot be passed over after all
_LONGEST = 2_000  # nodes of an expression that substitution makes

Assignments = dict[int, Expression]


def counts_steps(formula: Expression) -> bool:
    """Whether a formula may tell one step from two: true unless each of its nodes is known not to."""
    return any(map(_may_count, nodes(formula)))


def _may_count(node: Tree) -> bool:
    match node:
        case Literal() | Name() | Unary() | Binary() | Conditional() | Call() | LabelReference():
            return False
        case StateOperator():
            return node.counts_steps
        case Eventually() | Globally() | Until() | WeakUntil() | Release():
            return node.bound is not None
        case Bound():
            return False
        case _:  # also a node that is not known here
            return True


@dataclass(frozen=True, eq=False)
class Shortened:
    """A model that passes over some control locations. `passed`: which; none of them is ever reached."""

    model: BoundModel
    passed: frozenset[Location] = field(default=frozenset())


def shorten(model: BoundModel, locations: Locations, observed: Sequence[Expression]) -> Shortened:
    """The same model, or one that passes over the locations at which nothing that is observed changes.

    observed: state expressions; "deadlock" is a name that no variable has. For formulas that do not count steps.
    """
    rewards = (e for r in model.rewards for i in r.items for e in (i.guard, i.value))
    if (
        model.type not in (ModelType.DTMC, ModelType.MDP)
        or model.initial is not None
        or any(partial(n) for e in rewards for n in nodes(e))
    ):
        return Shortened(model)
    return _Chains(model, locations, tuple(observed)).run()


@dataclass(frozen=True)
class _Step:
    """The only thing that happens at a location: where it leads, and what it assigns."""

    target: Location
    assignments: Assignments


@dataclass(frozen=True, eq=False)
class _Entrance:
    """An update, and where it may lead from each location at which it may happen; `alone`: no other module takes part."""

    update: BoundUpdate
    alone: bool
    targets: dict[Location, frozenset[Location]]


class _Chains:
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
        self.entrances = list(self._entrances())

    def run(self) -> Shortened:
        passed = set(self.steps)
        for _ in range(_ROUNDS):
            if not passed:
                break
            changed, faulty = self._attempt(passed)
            if not faulty:
                events = tuple(self._event(e, changed) for e in self.model.events)
                return Shortened(replace(self.model, events=events), frozenset(passed))
            passed -= faulty
        return Shortened(self.model)

    def _attempt(self, passed: set[Location]) -> tuple[dict[int, BoundUpdate], set[Location]]:
        """Updates that pass over these locations, by the id of the old one; and locations that cannot be passed over."""
        changed: dict[int, BoundUpdate] = {}
        faulty: set[Location] = set()
        chains: dict[Location, Assignments] = {}
        for x in passed:
            chain = self._chain(x, passed)
            if chain is None:
                faulty.add(x)
            else:
                chains[x] = chain
        for entrance in self.entrances:
            reached = frozenset[Location]().union(
                *(t for x, t in entrance.targets.items() if x not in passed)
            )
            hit = reached & passed
            if not hit:
                continue
            (where,) = hit if len(reached) == 1 else (None,)
            whole = None
            if where is not None and entrance.alone and where in chains:
                whole = self._then(dict(entrance.update.assignments), chains[where])
            if whole is None:
                faulty |= hit
            else:
                changed[id(entrance.update)] = replace(
                    entrance.update, assignments=tuple(whole.items())
                )
        return changed, faulty

    def _chain(self, location: Location, passed: set[Location]) -> Assignments | None:
        """What all steps from a location do together, up to the first that is not passed over."""
        step = self.steps[location]
        whole: Assignments | None = step.assignments
        seen = {location}
        while step.target in passed and whole is not None:
            if step.target in seen:
                return None
            seen.add(step.target)
            step = self.steps[step.target]
            whole = self._then(whole, step.assignments)
        return whole

    def _then(self, first: Assignments, second: Assignments) -> Assignments | None:
        """One set of assignments after another. None where a fault of the first might go unseen, or expressions grow long."""
        variables = self.model.variables
        if not all(harmless(first[i], variables[i], variables) for i in first if i in second):
            return None
        values = {variables[i].name: e for i, e in first.items()}
        after = {i: substitute(e, values) for i, e in second.items()}
        if any(sum(1 for _ in nodes(e)) > _LONGEST for e in after.values()):
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

    # what happens at a location

    def _step(self, location: Location) -> _Step | None:
        """The step at a location where exactly one is possible, always, with probability 1, to one other location."""
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
            or not self._always(effect.command.guard, location)
            or len(targets) != 1
            or targets[0] == location
        ):
            return None
        own = {i: self.locations.residual(e, location) for i, e in effect.update.assignments}
        return _Step(targets[0], own)

    def _always(self, guard: Expression, location: Location) -> bool:
        residual = self.locations.residual(guard, location)
        return isinstance(residual, Literal) and residual.value is True

    def _invisible(self, location: Location, step: _Step) -> bool:
        """Whether everything observed has the same value before and after the step."""
        values = {self.model.variables[i].name: e for i, e in step.assignments.items()}
        for e in self.observed:
            after = self.locations.residual(e, step.target)
            if names(after) & set(values):
                after = folded(substitute(after, values), self.model.exact, self.types)
            if after != self.locations.residual(e, location):
                return False
        # A deadlock is seen by its name only: what comes after must be none, as what comes before is none.
        seen = any(
            isinstance(n, Name) and n.name == '"deadlock"' for e in self.observed for n in nodes(e)
        )
        return not seen or self._alive(step.target)

    def _alive(self, location: Location) -> bool:
        alone = [m.effects[0] for m in self.locations.moves[location] if len(m.effects) == 1]
        return any(self._always(e.command.guard, location) for effects in alone for e in effects)

    def _entrances(self) -> Iterator[_Entrance]:
        found: dict[int, _Entrance] = {}
        for location, moves in self.locations.moves.items():
            for move in moves:
                for participant, effects in enumerate(move.effects):
                    for e in effects:
                        entrance = found.setdefault(
                            id(e.update), _Entrance(e.update, len(move.effects) == 1, {})
                        )
                        if len(move.effects) != 1 and entrance.alone:
                            entrance = found[id(e.update)] = replace(entrance, alone=False)
                        own = move.targets[participant][e.control]
                        entrance.targets[location] = (
                            entrance.targets.get(location, frozenset()) | own
                        )
        yield from found.values()
