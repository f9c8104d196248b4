"""Images and preimages on diagrams, and closures under them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property

from symcheck.dd.manager import Bdd, DiagramManager
from symcheck.dd.saturation import saturate
from symcheck.engines import tuning
from symcheck.engines.symbolic.diagrams import Diagrams
from symcheck.errors import TimeLimitError

__all__ = ["TooSlowError", "TransitionGraph", "look_ups"]


class TooSlowError(Exception):
    """A search on diagrams used up its budget; only graph questions catch it."""


@contextmanager
def look_ups(manager: DiagramManager, budget: int | None) -> Iterator[None]:
    """Raise TooSlowError after so many look-ups in the cache; None: no limit."""
    if budget is None:
        yield
        return
    if budget <= 0:
        raise TooSlowError
    manager.limit_lookups(budget)
    try:
        yield
    except TimeLimitError as error:  # if it is the user's limit, the next operation says so again
        raise TooSlowError from error
    finally:
        manager.limit_lookups(None)


@dataclass(frozen=True, eq=False)
class TransitionGraph:
    """The transition graph of a model on diagrams.

    `observer` is told of each set on the way to a fixpoint, and what it is.
    """

    diagrams: Diagrams = field(repr=False)
    observer: Callable[[str, Bdd], None] | None = field(default=None, repr=False)

    def tell(self, what: str, states: Bdd) -> None:
        """Tell the observer, if there is one."""
        if self.observer is not None:
            self.observer(what, states)

    def before(self, states: Bdd) -> Bdd:
        """Reachable states with a transition into the set."""
        d = self.diagrams
        return (d.union([step.preimage(states) for step in d.steps]) & d.states) | (
            d.loops & states
        )

    def reachable(self, sources: Bdd) -> Bdd:
        """All states that paths from `sources` lead to."""
        return self.close(sources, forward=True, within=self.diagrams.manager.true)

    def close(self, start: Bdd, *, forward: bool, within: Bdd) -> Bdd:
        """The closure of `start` under steps (forward or backward) `within` a set."""
        if not start or within <= start:  # nothing to begin with, or nothing to add
            return start
        if self.observer is None:
            closed = saturate(self.diagrams.saturation(forward), start, within)
            if closed is not None:
                return closed
        return self._in_turns(start, forward, within)

    def _in_turns(self, start: Bdd, forward: bool, within: Bdd) -> Bdd:
        """The same, step by step: steps take turns on the states that are new since their last
        turn.
        """
        steps = [step for level in self.diagrams.levels for step in level]
        done = [self.diagrams.manager.false] * len(steps)
        states = start
        while True:
            before = states
            for number, step in enumerate(steps):
                fresh = states - done[number]
                if fresh:
                    done[number] = states
                    states = states | (
                        (step.image(fresh) if forward else step.preimage(fresh)) & within
                    )
            if states == before:
                return states
            self.tell("closure", states)

    @cached_property
    def _known(self) -> dict[tuple[Bdd, Bdd], Bdd]:
        """The last results of `backward`: prob0 and prob1 of one formula share them."""
        return {}

    def backward(self, target: Bdd, through: Bdd) -> Bdd:
        """States with a path into `target` whose states before are in `through`; with `target`
        itself.
        """
        if (target, through) not in self._known:
            if len(self._known) >= tuning.CACHED_BACKWARD_SEARCHES:
                self._known.pop(next(iter(self._known)))
            self._known[target, through] = self.close(target, forward=False, within=through)
        return self._known[target, through]

    def classes_before(self, states: Bdd) -> list[Bdd]:
        """Per choice class: the states whose choice may lead into the set."""
        return [
            self.diagrams.whole.preimage(states, relation)
            for relation in self.diagrams.class_relations
        ]

    def classes_within(self, states: Bdd) -> list[Bdd]:
        """Per choice class: the states whose choice surely leads into the set."""
        outside = self.classes_before(self.diagrams.states - states)
        return [guard - out for guard, out in zip(self.diagrams.class_guards, outside, strict=True)]
