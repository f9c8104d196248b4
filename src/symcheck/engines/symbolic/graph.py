"""Graph questions on diagrams: fixpoints of images and preimages; on rows where these are few, or
on a reduced system.

Source: Bianco & de Alfaro (1995) for prob0/prob1 of MDPs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Literal, assert_never

from symcheck.dd.manager import Bdd
from symcheck.direction import Direction
from symcheck.engines import tuning
from symcheck.engines.symbolic.components import Components
from symcheck.engines.symbolic.deterministic_elimination import DeterministicElimination
from symcheck.engines.symbolic.reduced_system import ReducedSystem
from symcheck.engines.symbolic.sets import SymbolicSet
from symcheck.engines.symbolic.steps import TooSlowError, look_ups
from symcheck.matrices.rows import Bools
from symcheck.numerics import graph
from symcheck.semantics.rewards import Reward

__all__ = ["SymbolicGraph"]

GraphQuestion = tuple[Literal["possible", "prob0", "prob1"], Bdd, Bdd, Direction | None]
"""'possible' (E [left U right]), 'prob0' or 'prob1'; left, right, and the direction."""

OnDiagrams = Callable[[], Bdd]
"""An answer by fixpoints on diagrams."""


@dataclass(frozen=True, eq=False)
class SymbolicGraph(Components):
    """See `symcheck.engines.base.Graph`. `observer` is told of each set on the way to a fixpoint,
    and what it is.
    """

    elimination: DeterministicElimination | None = field(default=None, repr=False)

    # answers on rows, if diagrams are slow

    @cached_property
    def _affordable(self) -> bool:
        limit = self.engine.rows_limit
        return self.observer is None and self.engine.transitions <= (
            tuning.FEW_TRANSITIONS if limit is None else min(limit, tuning.FEW_TRANSITIONS)
        )

    @cached_property
    def _rows(self) -> graph.Incidence:
        return graph.Incidence(self.engine.system(self.engine.all).weights)

    def _answer(
        self,
        question: GraphQuestion,
        on_diagrams: OnDiagrams,
        on_rows: Callable[[graph.Incidence], Bools],
        reward: Reward | None = None,
    ) -> SymbolicSet:
        """An answer on diagrams within the budget, or else on all rows or a reduced system."""
        reducing = self._reducing
        reduced = None if reducing is None else reducing.last(question[1], question[2])
        if reduced is None and "_rows" not in vars(self):
            try:
                return self._set(self._on_diagrams(question, on_diagrams, self._budget))
            except TooSlowError:
                pass
        if self._affordable:
            return self._set(self._d.odd.from_mask(on_rows(self._rows)))
        if reduced is None:
            reduced = self._reduced(question, reward)
        if reduced is None:
            return self._set(self._on_diagrams(question, on_diagrams, None))
        match question[0]:
            case "possible":
                return ~reduced.prob0(Direction.MAX)
            case "prob0":
                return reduced.prob0(question[3])
            case "prob1":
                return reduced.prob1(question[3])
            case _:
                assert_never(question[0])

    @cached_property
    def _reducing(self) -> DeterministicElimination | None:
        """The elimination of deterministic states, if it is possible."""
        step = self.elimination
        return step if self.observer is None and step is not None and step.possible else None

    def _reduced(self, question: GraphQuestion, reward: Reward | None) -> ReducedSystem | None:
        """The reduced system of the question, with a reward if it is given and possible."""
        if self._reducing is None:
            return None
        _, left, right, _ = question
        find = self._reducing.reduced
        return (None if reward is None else find(left, right, reward)) or find(left, right)

    @property
    def _budget(self) -> int | None:
        """The budget of look-ups on diagrams; None if there is no alternative."""
        if self._affordable:
            return tuning.GRAPH_LOOKUPS
        if self._reducing is not None:
            return tuning.GRAPH_LOOKUPS + int(tuning.GRAPH_LOOKUPS_PER_STATE * self._d.count)
        return None

    @cached_property
    def _answers(self) -> dict[GraphQuestion, Bdd]:
        return {}

    def _on_diagrams(
        self, question: GraphQuestion, on_diagrams: OnDiagrams, budget: int | None
    ) -> Bdd:
        if question not in self._answers:
            with look_ups(self._d.manager, budget):
                answer = on_diagrams()
            if len(self._answers) >= tuning.CACHED_ANSWERS:
                self._answers.pop(next(iter(self._answers)))
            self._answers[question] = answer
        return self._answers[question]

    def _certain(
        self, kind: Literal["prob0", "prob1"], left: Bdd, right: Bdd, direction: Direction | None
    ) -> Bdd:
        find = self._prob0 if kind == "prob0" else self._prob1
        return self._on_diagrams(
            (kind, left, right, direction), partial(find, left, right, direction), None
        )

    # reachability

    def reachable(self, sources: Bdd) -> Bdd:
        """All states that paths from `sources` lead to."""
        return self.steps.reachable(sources)

    def predecessors(self, states: SymbolicSet) -> SymbolicSet:
        """States with some transition (of some choice) into the set."""
        return self._set(self.steps.before(states.bdd))

    def all_successors_in(self, states: SymbolicSet) -> SymbolicSet:
        """States all of whose transitions (of all choices) lead into the set."""
        return ~self.predecessors(~states)

    def exists_until(self, left: SymbolicSet, right: SymbolicSet) -> SymbolicSet:
        """E [ left U right ]."""
        to_bools = self.engine.to_bools
        return self._answer(
            ("possible", left.bdd, right.bdd, None),
            partial(self.steps.backward, right.bdd, left.bdd),
            lambda rows: graph.backward_reachable(rows, to_bools(right), to_bools(left)),
        )

    def exists_globally(self, states: SymbolicSet) -> SymbolicSet:
        """E [ G states ]."""
        inside = states.bdd
        while True:
            smaller = inside & self.steps.before(inside)
            if smaller == inside:
                return self._set(inside)
            inside = smaller

    # probability 0 and 1

    def prob0(
        self, left: SymbolicSet, right: SymbolicSet, direction: Direction | None
    ) -> SymbolicSet:
        """States whose (min/max) probability of left U right is 0."""
        to_bools = self.engine.to_bools
        return self._answer(
            ("prob0", left.bdd, right.bdd, direction),
            partial(self._prob0, left.bdd, right.bdd, direction),
            lambda rows: graph.prob0(rows, to_bools(left), to_bools(right), direction),
        )

    def prob1(
        self,
        left: SymbolicSet,
        right: SymbolicSet,
        direction: Direction | None,
        reward: Reward | None = None,
    ) -> SymbolicSet:
        """States whose (min/max) probability of left U right is 1.

        reward: the reward whose expected reward until `right` is going to be asked for.
        """
        to_bools = self.engine.to_bools
        return self._answer(
            ("prob1", left.bdd, right.bdd, direction),
            partial(self._prob1, left.bdd, right.bdd, direction),
            lambda rows: graph.prob1(rows, to_bools(left), to_bools(right), direction),
            reward,
        )

    def _prob0(self, left: Bdd, right: Bdd, direction: Direction | None) -> Bdd:
        if direction != Direction.MIN or self._d.guards is None:
            return self._d.states - self.steps.backward(right, left)
        return self._d.states - self._unavoidable(left, right)

    def _prob1(self, left: Bdd, right: Bdd, direction: Direction | None) -> Bdd:
        if direction == Direction.MAX and self._d.guards is not None:
            return self._almost_sure(left, right)
        # A state that can reach, outside of `right`, a state with least probability 0 is not in
        # prob1.
        no = self._certain("prob0", left, right, direction)
        return self._d.states - self.steps.backward(no, left - right)

    def _unavoidable(self, left: Bdd, right: Bdd) -> Bdd:
        """States from where all strategies have a positive probability of left U right."""
        reach = fresh = right
        before = [self._d.manager.false] * len(self._d.class_guards)
        while fresh:
            found = self.steps.classes_before(fresh)
            before = [known | more for known, more in zip(before, found, strict=True)]
            near = (left & self._d.union(found)) - reach
            escape = self._d.union(
                [(guard & near) - b for guard, b in zip(self._d.class_guards, before, strict=True)]
            )
            fresh = near - escape
            reach |= fresh
            self.steps.tell("every strategy reaches", reach)
        return reach

    def _almost_sure(self, left: Bdd, right: Bdd) -> Bdd:
        """States from where some strategy has probability 1 of left U right."""
        candidates = self.steps.backward(right, left)
        if not self.steps.before(self._d.states - candidates) & (candidates - right):
            return candidates  # no choice leaves them, and each can reach `right`
        while candidates:
            self.steps.tell("candidates", candidates)
            sure = self._surely_within(candidates, left, right)
            if sure == candidates:
                return sure
            candidates = sure
        return candidates

    def _surely_within(self, candidates: Bdd, left: Bdd, right: Bdd) -> Bdd:
        """States with a path into `right` through `left`.

        All choices on it stay within `candidates` with probability 1.
        """
        within = [w & left for w in self.steps.classes_within(candidates)]
        sure = fresh = right
        while fresh:
            before = self.steps.classes_before(fresh)
            fresh = self._d.union([w & b for w, b in zip(within, before, strict=True)]) - sure
            sure = sure | fresh
            self.steps.tell("sure", sure)
        return sure

    # paths

    def _first(self, states: Bdd) -> Bdd:
        return self.engine.first(self._set(states)).bdd

    def witness(
        self, left: SymbolicSet, right: SymbolicSet
    ) -> Sequence[Mapping[str, int | bool]] | None:
        """A shortest path from an initial state that satisfies left U right, as states; None if
        there is none.
        """
        d = self._d
        layers = [d.initial]
        seen = d.initial
        while not layers[-1] & right.bdd:
            following = d.union([step.image(layers[-1] & left.bdd) for step in d.steps]) - seen
            if not following:
                return None
            seen = seen | following
            layers.append(following)
        path = [self._first(layers[-1] & right.bdd)]
        for layer in layers[-2::-1]:
            path.append(self._first(self.steps.before(path[-1]) & layer & left.bdd))
        names = [v.name for v in self.engine.model.variables]
        return [
            dict(zip(names, next(iter(self.engine.valuations(self._set(s)))), strict=True))
            for s in reversed(path)
        ]
