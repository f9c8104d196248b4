"""Where sampled paths take their transitions from: the commands of a model, or its stored rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, assert_never

import numpy as np

from symcheck.check.context import Context
from symcheck.check.state_formulas import satisfying
from symcheck.engines.base import Engine
from symcheck.engines.capabilities import HasExploredModel, HasImportedStates
from symcheck.explicit.explored import ExploredModel
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import Rows, StateLayout
from symcheck.explicit.successors import SuccessorGenerator, Successors
from symcheck.matrices.rows import Bools, Floats, Int64s, spans, starts_of
from symcheck.options import Options
from symcheck.semantics.expressions.vectorised import evaluate_columns, open_mesh
from symcheck.semantics.model import BoundModel, BoundReward
from symcheck.semantics.rewards import Reward, Steps, Structure, Time, reward_items
from symcheck.semantics.state_faults import describe_state
from symcheck.simulate import tuning
from symcheck.simulate.intervals import UNKNOWN, Range
from symcheck.simulate.state_predicates import StatePredicate, compile_predicate
from symcheck.simulate.steps import transition_rewards
from symcheck.syntax.ast import Expression
from symcheck.syntax.traversal import names

__all__ = ["CommandSource", "Source", "TableSource"]


class Source(Protocol):
    """States as rows of words, uint64[n, words], and their successors."""

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        ...

    @property
    def words(self) -> int:
        """The number of words of a state."""
        ...

    @property
    def initial(self) -> Rows:
        """The initial states."""
        ...

    def successors(self, rows: Rows) -> Successors:
        """All branches of states; the choices of an MDP are equally likely. Raises ModelFault."""
        ...

    def state_rewards(self, rows: Rows) -> Floats:
        """The state rewards of some states, float64[n]. Raises ModelFault."""
        ...

    def reward_ranges(self) -> tuple[Range, Range]:
        """Bounds on the rewards of states and of transitions, over more states than are reached."""
        ...

    def predicate(self, formula: Expression) -> StatePredicate:
        """A state formula as a predicate. Raises NameFault, UnsupportedError."""
        ...

    def text(self, row: Rows) -> str:
        """A state, uint64[words], as a text for messages."""
        ...


class CommandSource:
    """The successors that the commands of a model give, by the compiled successor function.

    Args:
        model: a model with commands.
        reward: the reward that is sampled; None: rewards are 0.
        labels: labels of the properties file.
    """

    def __init__(
        self,
        model: BoundModel,
        reward: Reward | None = None,
        labels: Mapping[str, Expression] | None = None,
    ) -> None:
        self.model, self._labels = model, {**model.labels, **(labels or {})}
        self._reward = reward
        self.layout = StateLayout.of(model.variables)
        self.words = self.layout.words
        generator = SuccessorGenerator(model, self.layout, reward)
        self.successors, self.state_rewards = generator.successors, generator.state_rewards

    @property
    def initial(self) -> Rows:
        """The initial states."""
        return initial_rows(self.model, self.layout)

    def reward_ranges(self) -> tuple[Range, Range]:
        """Bounds on the rewards of states and of transitions, by the ranges of variables."""
        items = () if self._reward is None else reward_items(self._reward, self.model)
        states = _sum_range([i for i in items if i.on_states], self.model)
        transitions = [
            _sum_range([i for i in items if not i.on_states and i.action == action], self.model)
            for action in (None, *self.model.actions)
        ]
        return states, Range(min(r.low for r in transitions), max(r.high for r in transitions))

    def predicate(self, formula: Expression) -> StatePredicate:
        """A state formula as a predicate. Raises NameFault, UnsupportedError."""
        return compile_predicate(formula, self.model, self.layout, self._labels)

    def text(self, row: Rows) -> str:
        """A state as a text for messages."""
        return describe_state(self.model.variables, self.layout.unpack(row))


@dataclass(frozen=True, eq=False)
class TableSource:
    """The rows of a model that was read or made in Python; a state is one word, its number.

    Attributes:
        engine: the explicit engine.
        reward: the reward that is sampled; None: rewards are 0.
        labels: labels of the properties file.
    """

    engine: Engine
    reward: Reward | None
    labels: Mapping[str, Expression]
    words: int = 1

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        return self.engine.model

    @cached_property
    def _explored(self) -> ExploredModel:
        having = self.engine.capability(HasExploredModel)
        assert having is not None
        return having.explored

    @property
    def initial(self) -> Rows:
        """The initial states."""
        return _as_rows(self._explored.initial)

    @cached_property
    def _starts(self) -> Int64s:
        """The first row of each state."""
        groups = self._explored.matrix.groups
        return np.arange(self.engine.states + 1) if groups is None else groups

    @cached_property
    def _rewards(self) -> tuple[Floats, Floats]:
        """The reward of each state, and of each transition."""
        explored, matrix = self._explored, self._explored.matrix
        states, entries = np.zeros(self.engine.states), np.zeros(matrix.entries)
        timed = self.model.type.continuous_time
        match self.reward:
            case None:
                pass
            case Structure(index):
                states = explored.state_rewards[index]
                imported = self.engine.capability(HasImportedStates)
                assert imported is not None
                entries = transition_rewards(explored, imported, index)
            case Time() if timed:
                states = np.ones(self.engine.states)
            case Steps() | Time():
                entries = np.ones(matrix.entries)
            case _:
                assert_never(self.reward)
        return states, entries

    def successors(self, rows: Rows) -> Successors:
        """All branches of some states; the choices of an MDP are equally likely."""
        matrix, states = self._explored.matrix, rows[:, 0].astype(np.int64)
        first, last = matrix.indptr[self._starts[states]], matrix.indptr[self._starts[states + 1]]
        entries, counts = spans(first, last), last - first
        choices = (self._starts[states + 1] - self._starts[states]).repeat(counts)
        return Successors(
            starts_of(counts),
            matrix.data[entries] / choices,
            _as_rows(matrix.indices[entries].astype(np.int64)),
            self._rewards[1][entries],
            np.isin(states, self._explored.deadlocks),
        )

    def state_rewards(self, rows: Rows) -> Floats:
        """The state rewards of some states, float64[n]."""
        return self._rewards[0][rows[:, 0].astype(np.int64)]

    def reward_ranges(self) -> tuple[Range, Range]:
        """Bounds on the rewards of states and of transitions."""
        states, transitions = (
            Range(float(r.min(initial=0.0)), float(r.max(initial=0.0))) for r in self._rewards
        )
        return states, transitions

    def predicate(self, formula: Expression) -> StatePredicate:
        """A state formula as a predicate. Raises SymcheckError."""
        context = Context(self.engine, Options(), {**self.model.labels, **self.labels})
        members = self.engine.to_bools(satisfying(context, formula, self.engine.all))
        return lambda rows, _: members[rows[:, 0].astype(np.int64)]

    def text(self, row: Rows) -> str:
        """A state as a text for messages."""
        (state,) = self.engine.valuations(self.engine.from_bools(self._only(int(row[0]))))
        return describe_state(self.model.variables, state)

    def _only(self, number: int) -> Bools:
        return np.asarray(np.arange(self.engine.states) == number)


def _as_rows(numbers: Int64s) -> Rows:
    return numbers.astype(np.uint64).reshape(-1, 1)


def _sum_range(items: Sequence[BoundReward], model: BoundModel) -> Range:
    """Bounds on the sum of rewards, over all valuations of the variables."""
    ranges = [_item_range(item, model) for item in items]
    return Range(sum(r.low for r in ranges), sum(r.high for r in ranges))


def _item_range(item: BoundReward, model: BoundModel) -> Range:
    """Bounds on what one item gives, which is 0 where its guard is false."""
    read = names(item.guard) | names(item.value)
    domains = {v.name: v.domain for v in model.variables if v.name in read}
    mesh = open_mesh(domains, tuning.MAX_REWARD_VALUATIONS)
    if mesh is None:
        return UNKNOWN
    columns, shape = mesh
    guard, value = (evaluate_columns(e, columns).spread(shape) for e in (item.guard, item.value))
    earned = np.where(guard.values, value.numbers(), 0.0)
    if guard.faults is not None or not np.isfinite(earned).all():
        return UNKNOWN
    return Range(float(earned.min(initial=0.0)), float(earned.max(initial=0.0)))
