"""The steps of a model one state at a time: what `-simpath` and the step simulator choose from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from symcheck.engines.base import Engine
from symcheck.engines.capabilities import HasExploredModel, HasImportedStates
from symcheck.engines.transition_actions import transition_parts
from symcheck.explicit.explored import RACE, ExploredModel
from symcheck.explicit.initial import initial_rows
from symcheck.explicit.states import StateLayout
from symcheck.matrices.contributions import TransitionParts
from symcheck.matrices.rows import Floats
from symcheck.semantics.command_text import command_text
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.features import Feature, require
from symcheck.semantics.interpreter import State, choices, state_rewards, valuation
from symcheck.semantics.model import BoundCommand, BoundModel, Value
from symcheck.semantics.timed.digital import require_states
from symcheck.simulate.path import PathStep

__all__ = ["Branch", "Choice", "CommandSuccessors", "TableSuccessors", "transition_rewards"]


@dataclass(frozen=True, slots=True)
class Branch:
    """A successor: its probability within the choice (its rate in a CTMC), and the rewards that
    the transition earns, per reward structure.
    """

    probability: Value
    state: State
    rewards: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """A choice in a state: one command, or several that synchronise.

    Attributes:
        action: None for an unlabelled choice.
        module: the module that takes it; None if several do, or if the model has no commands.
        takes_time: whether it races with the other choices of a state, in continuous time.
    """

    action: str | None
    module: str | None
    branches: tuple[Branch, ...]
    commands: tuple[BoundCommand, ...] = ()
    takes_time: bool = False
    model: BoundModel | None = field(default=None, repr=False, compare=False)

    @property
    def text(self) -> str:
        """The commands as they stand in the model; `[action]` if there are none."""
        model = self.model
        texts = [] if model is None else [command_text(model, c) for c in self.commands]
        if model is not None and model.clocks is not None and self.action == model.clocks.time:
            texts = []
        return " || ".join(texts) or f"[{self.action or ''}]"


class CommandSuccessors:
    """The steps of a model in the PRISM language, computed by the interpreter.

    The interpreter knows the commands of each transition; the compiled sampler does not.
    """

    def __init__(self, model: BoundModel, check_sums: bool = True) -> None:
        require_states(model)
        require(model, Feature.STEPPING)
        self.model, self._check_sums = replace(model, unchecked_sums=False), check_sums
        self._variables = tuple(v.name for v in model.variables)

    def initial(self) -> Sequence[State]:
        """The initial states."""
        layout = StateLayout.of(self.model.variables)
        return [layout.unpack(row) for row in initial_rows(self.model, layout)]

    def choices(self, state: State) -> tuple[Choice, ...]:
        """The enabled choices; none in a deadlock. Raises ModelFault."""
        result = []
        for choice in choices(self.model, state, check_sums=self._check_sums):
            modules = {c.module for c in choice.commands}
            name = self.model.modules[modules.pop()].name if len(modules) == 1 else None
            rewards = tuple(map(float, choice.rewards))
            branches = tuple(Branch(p, s, rewards) for p, s in choice.branches)
            timed = choice.commands[0].is_markovian or not self.model.type.has_probabilities
            made = Choice(choice.action, name, branches, choice.commands, timed, self.model)
            result.append(made)
        return tuple(result)

    def rewards(self, state: State) -> tuple[float, ...]:
        """The state reward per reward structure. Raises ModelFault."""
        return tuple(map(float, state_rewards(self.model, state)))

    def has_label(self, state: State, name: str) -> bool:
        """Whether a state has a label of the model."""
        return bool(evaluate(self.model.labels[name], valuation(self.model, state)))

    def start(self, generator: np.random.Generator, state: State | None = None) -> PathStep:
        """The first step of a path: a state, or None for an initial one, all equally likely."""
        if state is None:
            initial = self.initial()
            state = initial[int(generator.integers(len(initial))) if len(initial) > 1 else 0]
        return PathStep(state, 0.0, self.rewards(state), variables=self._variables)

    def take(
        self,
        current: PathStep,
        enabled: Sequence[Choice],
        generator: np.random.Generator,
        moves: Sequence[tuple[Choice, Branch]],
    ) -> PathStep:
        """Sample a transition and its sojourn time; the choices of an MDP are equally likely.

        Args:
            current: the last step of the path.
            enabled: the choices of its state.
            generator: random numbers.
            moves: the transitions from which one is sampled.

        Raises:
            ModelFault: the next state has a reward that is not finite.
        """
        kind = self.model.type
        share = self._share(enabled)
        duration = float(not kind.continuous_time)
        if enabled[0].takes_time:
            rate = sum(float(b.probability) for c in enabled for b in c.branches)
            duration = float(generator.standard_exponential()) / rate
        weights = [float(b.probability) / share for _, b in moves]
        cumulative = np.cumsum(weights)
        index = int(np.searchsorted(cumulative, generator.random() * cumulative[-1], side="right"))
        index = min(index, len(moves) - 1)
        choice, branch = moves[index]
        return PathStep(
            branch.state,
            current.time + duration,
            self.rewards(branch.state),
            choice.action,
            choice.module,
            float(branch.probability) if kind.has_choices else weights[index],
            branch.rewards,
            self._variables,
        )

    def _share(self, enabled: Sequence[Choice]) -> int:
        """By what the probabilities of choices are divided: how many are equally likely."""
        return 1 if enabled[0].takes_time else len(enabled)


class TableSuccessors(CommandSuccessors):
    """The steps of a model from explicit files or from Python, read from its rows."""

    def __init__(self, engine: Engine) -> None:
        explored, imported = (
            engine.capability(HasExploredModel),
            engine.capability(HasImportedStates),
        )
        assert explored is not None
        assert imported is not None
        super().__init__(engine.model)
        self._explored, self._imported = explored.explored, imported
        self._states: list[State] = list(self._explored.states)
        self._numbers = {state: i for i, state in enumerate(self._states)}
        self._parts = transition_parts(engine)

    def initial(self) -> Sequence[State]:
        """The initial states."""
        return [self._states[i] for i in self._explored.initial.tolist()]

    def choices(self, state: State) -> tuple[Choice, ...]:
        """The enabled choices, in a chain the actions; none in a deadlock."""
        explored, number = self._explored, self._numbers[state]
        matrix = explored.matrix
        if number in explored.deadlocks:
            return ()
        if self._parts is not None:
            return self._of_actions(number, self._parts)
        rows = [number] if matrix.groups is None else range(*matrix.groups[number : number + 2])
        actions = explored.choice_actions[list(rows)].tolist()
        names, all_timed = self.model.actions, not self.model.type.has_probabilities
        return tuple(
            Choice(
                None if a < 0 else names[a],
                None,
                self._branches(row),
                takes_time=a == RACE or all_timed,
            )
            for a, row in zip(actions, rows, strict=True)
        )

    def _share(self, enabled: Sequence[Choice]) -> int:
        return len(enabled) if self.model.type.has_choices else 1

    def _of_actions(self, row: int, parts: TransitionParts) -> tuple[Choice, ...]:
        """The transitions of a row of a chain, by action."""
        first, last = self._explored.matrix.indptr[row : row + 2].tolist()
        whole, values = self._branches(row), parts.values.tolist()
        result: dict[int, list[Branch]] = {}
        for i in range(*np.searchsorted(parts.entry, (first, last)).tolist()):
            branch = whole[int(parts.entry[i]) - first]
            part = replace(branch, probability=values[i])
            result.setdefault(int(parts.action[i]), []).append(part)
        names, timed = (*self.model.actions, None), self.model.type.continuous_time
        return tuple(
            Choice(names[a], None, tuple(b), takes_time=timed) for a, b in sorted(result.items())
        )

    def _branches(self, row: int) -> tuple[Branch, ...]:
        explored = self._explored
        matrix = explored.matrix
        part = slice(*matrix.indptr[row : row + 2].tolist())
        targets = [self._states[t] for t in matrix.indices[part].tolist()]
        rewards = map(tuple, self._earned[:, part].T.tolist())
        return tuple(map(Branch, matrix.data[part].tolist(), targets, rewards))

    @cached_property
    def _earned(self) -> Floats:
        """The rewards of transitions: float64[structures, entries]."""
        structures = range(len(self.model.rewards))
        rewards = [transition_rewards(self._explored, self._imported, i) for i in structures]
        return np.array(rewards, np.float64).reshape(len(rewards), self._explored.matrix.entries)

    def rewards(self, state: State) -> tuple[float, ...]:
        """The state reward per reward structure."""
        return tuple(float(r[self._numbers[state]]) for r in self._explored.state_rewards)

    def has_label(self, state: State, name: str) -> bool:
        """Whether a state has a label of the model."""
        return bool(self._imported.members[self.model.labels[name]][self._numbers[state]])


def transition_rewards(
    explored: ExploredModel, imported: HasImportedStates, structure: int
) -> Floats:
    """The reward of each transition of a model without commands: float64[entries].

    A reward of a choice, or of a state of a CTMC, is shared by its transitions.
    """
    given = imported.entry_rewards[structure]
    if given is not None:
        return given
    matrix = explored.matrix
    timed = explored.model.type.continuous_time
    sums = np.add.reduceat(matrix.data, matrix.indptr[:-1]) if timed else 1.0
    return np.repeat(explored.choice_rewards[structure] / sums, matrix.lengths)
