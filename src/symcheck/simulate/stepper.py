"""Paths that grow step by step: chosen by the user, by a strategy, or at random."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from math import inf
from numbers import Integral
from typing import TYPE_CHECKING, cast

import numpy as np

from symcheck.errors import UsageError, converts_memory_error
from symcheck.semantics.interpreter import State
from symcheck.semantics.state_faults import describe_state
from symcheck.simulate.path import Path, PathStep, used_seed
from symcheck.simulate.steps import Branch, Choice, CommandSuccessors

if TYPE_CHECKING:
    from symcheck.engines.explicit.strategy import Strategy

__all__ = ["Simulator", "StepStrategy", "simulate"]


class Simulator:
    """A path of a model that grows step by step.

    The same seed and the same calls give the same path.

    Args:
        steps: the steps of the model.
        seed: of the random numbers; None draws one.
        start: the first state; None for an initial one.

    Attributes:
        seed: of the random numbers.

    Examples:
        >>> import symcheck
        >>> text = "mdp module m x:[0..2]; [go] x<2 -> (x'=x+1); [back] x>0 -> (x'=0); endmodule"
        >>> simulator = symcheck.loads(text).simulator(seed=1)
        >>> simulator.step("go")
        {'x': 1}
        >>> [choice.action for choice in simulator.choices]
        ['go', 'back']
    """

    def __init__(
        self, steps: CommandSuccessors, seed: int | None = None, start: State | None = None
    ) -> None:
        self.seed = used_seed(seed)
        self._steps = steps
        self._generator = np.random.default_rng(self.seed)
        self._path: list[PathStep] = [steps.start(self._generator, start)]
        self._known: dict[int, tuple[Choice, ...]] = {}

    # ------------------------------------------------------------------------ the current state

    @property
    def state(self) -> Mapping[str, bool | int]:
        """The values of the variables."""
        names = (v.name for v in self._steps.model.variables)
        return dict(zip(names, self._path[-1].state, strict=True))

    @property
    def choices(self) -> tuple[Choice, ...]:
        """The enabled choices; none in a deadlock. Raises ModelFault."""
        if len(self._path) not in self._known:
            self._known = {len(self._path): self._steps.choices(self._path[-1].state)}
        return self._known[len(self._path)]

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels that the state has, "init" and "deadlock" among them."""
        state = self._path[-1].state
        named = [n for n in self._steps.model.labels if self._steps.has_label(state, n)]
        init = ["init"] if state in self._initial else []
        return (*init, *([] if self.choices else ["deadlock"]), *named)

    @cached_property
    def _initial(self) -> frozenset[State]:
        return frozenset(self._steps.initial())

    @property
    def rewards(self) -> Mapping[str, float]:
        """The rewards of the state, by the name of the reward structure or its number."""
        return self._named(self._path[-1].rewards)

    @property
    def total_rewards(self) -> Mapping[str, float]:
        """The rewards that the path has earned so far."""
        totals = np.zeros(len(self._steps.model.rewards))
        for before, step in pairwise(self._path):
            totals += np.multiply(before.rewards, step.time - before.time) + step.earned
        return self._named(totals.tolist())

    def _named(self, values: Sequence[float]) -> Mapping[str, float]:
        names = (r.name or str(i) for i, r in enumerate(self._steps.model.rewards, 1))
        return dict(zip(names, values, strict=True))

    @property
    def path(self) -> Path:
        """The path so far."""
        end = "steps" if self.choices else "deadlock"
        return Path(self._steps.model, tuple(self._path), end, self.seed)

    # ------------------------------------------------------------------------------------ steps

    def step(
        self, choice: int | str | None = None, branch: int | None = None
    ) -> Mapping[str, bool | int]:
        """Take a step.

        Args:
            choice: the number of a choice or its action ("" without action); None: any choice.
            branch: the number of a successor of the choice; None: one at random.

        Returns:
            The new state.

        Raises:
            UsageError: there is no such choice, or the state is a deadlock.
            ModelFault: the model breaks a rule in the state.
        """
        enabled = self.choices
        if not enabled:
            raise UsageError(f"{self._text(self._path[-1].state)} is a deadlock: there is no step")
        chosen = [c for i, c in enumerate(enabled) if choice in (None, i, c.action or "")]
        if not chosen:
            actions = dict.fromkeys(c.action for c in enabled if c.action is not None)
            known = ", ".join([_numbers(len(enabled)), *actions])
            raise UsageError(f"there is no choice {choice!r}: expected {known}")
        allowed = [(c, b) for c in chosen for i, b in enumerate(c.branches) if branch in (None, i)]
        if not allowed:
            most = max(len(c.branches) for c in chosen)
            raise UsageError(f"the choice has no successor {branch}: expected {_numbers(most)}")
        self._take(enabled, allowed)
        return self.state

    def _take(self, enabled: Sequence[Choice], moves: Sequence[tuple[Choice, Branch]]) -> None:
        """Take one of these transitions at random."""
        self._path.append(self._steps.take(self._path[-1], enabled, self._generator, moves))

    def run(
        self,
        steps: int,
        strategy: StepStrategy | Strategy | None = None,
        *,
        time: float = inf,
    ) -> Mapping[str, bool | int]:
        """Take several steps, fewer if a deadlock or the time is reached.

        Args:
            steps: the number of steps.
            strategy: the strategy of a result; or a function that gives the number or action of the
                next choice; None: choices at random.
            time: end in the first state that is entered at this time of the path, or later.

        Returns:
            The last state.

        Raises:
            UsageError: the strategy has memory, or `steps` is no whole number from 0.
        """
        from symcheck.engines.explicit.strategy import Strategy

        _require_whole(steps)
        chosen = self._following(strategy) if isinstance(strategy, Strategy) else strategy
        for _ in range(steps):
            if self._path[-1].time >= time or not self.choices:
                break
            self.step(None if chosen is None else chosen(self))
        return self.state

    def _following(self, strategy: Strategy) -> StepStrategy:
        """Makes the choices of a strategy: those with its action and the nearest distribution.

        A randomised strategy first draws one of its rows.
        """
        if strategy.memory is not None:
            raise UsageError(
                "a strategy with memory cannot be followed state by state",
                hint="symcheck.induced_chain(model, strategy).simulator() has the memory as a "
                "variable",
            )
        matrix, states = strategy.engine.matrix, list(strategy.states())
        numbers = {state: n for n, state in enumerate(states)}
        names = (*strategy.engine.model.actions, "", "")
        actions, starts = strategy.engine.explored.choice_actions, strategy.starts
        shares = strategy.shares.astype(np.float64)

        def choose(simulator: Simulator) -> int:
            number = numbers[simulator._path[-1].state]
            taken = slice(starts[number], starts[number + 1])
            chosen = int(strategy.rows[number])
            if strategy.weights is not None:
                chosen = int(simulator._generator.choice(strategy.taken[taken], p=shares[taken]))
            row = slice(matrix.indptr[chosen], matrix.indptr[chosen + 1])
            targets = (states[t] for t in matrix.indices[row].tolist())
            probabilities: dict[State, float] = dict(
                zip(targets, matrix.data[row].tolist(), strict=True)
            )

            def difference(choice: Choice) -> float:
                left = dict(probabilities)
                for branch in choice.branches:
                    left[branch.state] = left.get(branch.state, 0.0) - float(branch.probability)
                return sum(abs(value) for value in left.values())

            enabled = [
                (difference(choice), i)
                for i, choice in enumerate(simulator.choices)
                if (choice.action or "") == names[actions[chosen]]
            ]
            return min(enabled)[1]

        return choose

    def back(self, steps: int = 1) -> Mapping[str, bool | int]:
        """Take the last steps back. Raises UsageError if there are not so many."""
        _require_whole(steps)
        if len(self._path) == 1:
            raise UsageError("this is the first state: there is no step to take back")
        if steps >= len(self._path):
            raise UsageError(f"there are {len(self._path) - 1} steps to take back, not {steps}")
        del self._path[len(self._path) - steps :]
        return self.state

    def restart(self) -> Mapping[str, bool | int]:
        """Go back to the first state."""
        del self._path[1:]
        return self.state

    # ------------------------------------------------------------------------------------- text

    def __repr__(self) -> str:
        state = self._text(self._path[-1].state)
        n = len(self.choices)
        choices = f"{n} choice{'s' * (n != 1)}"
        return f"<Simulator: step {len(self._path) - 1}, {state}, {choices}>"

    def __str__(self) -> str:
        """The state, its labels and rewards, and the numbered choices with their successors."""
        model, last = self._steps.model, self._path[-1]
        time = f", time {last.time:.6g}" if model.type.continuous_time else ""
        lines = [f"step {len(self._path) - 1}{time}: {self._text(last.state)}"]
        if self.labels:
            lines.append(f"labels: {', '.join(self.labels)}")
        total = self.total_rewards
        if total:
            texts = (f"{n} {x:.6g} (so far {total[n]:.6g})" for n, x in self.rewards.items())
            lines.append(f"rewards: {', '.join(texts)}")
        for i, choice in enumerate(self.choices):
            module = f"{choice.module}: " if choice.module else ""
            lines.append(f"  {i}: {module}{choice.text}")
            for j, branch in enumerate(choice.branches):
                earned = (f"{n} {x:.6g}" for n, x in self._named(branch.rewards).items() if x)
                weight = branch.probability
                shown = f"{weight:.6g}" if isinstance(weight, float) else str(weight)
                text = f"{shown} to {self._text(branch.state)}"
                lines.append(", ".join([f"     {i}.{j}: {text}", *earned]))
        return "\n".join(lines)

    def _text(self, state: State) -> str:
        return describe_state(self._steps.model.variables, state)


StepStrategy = Callable[[Simulator], int | str | None]
"""Gives the number or the action of the next choice of a simulator."""


def _numbers(n: int) -> str:
    """The numbers below n as a text."""
    return "0" if n == 1 else f"0 to {n - 1}"


def _require_whole(steps: int, otherwise: str = "") -> None:
    """Raise UsageError unless this is a whole number from 0."""
    if not isinstance(cast(object, steps), Integral) or steps < 0:
        raise UsageError(f"steps={steps!r}: expected a whole number from 0{otherwise}")


@converts_memory_error("a shorter path needs less")
def simulate(
    model: CommandSuccessors,
    steps: int | None = None,
    *,
    time: float | None = None,
    seed: int | None = None,
    loop_check: bool = True,
    max_steps: int = 10_000,
) -> Path:
    """Sample a path from an initial state; several initial states are equally likely.

    The path ends in a deadlock or at the first limit that is reached. The choices of an MDP are
    equally likely.

    Args:
        model: the steps of the model.
        steps: maximal number of steps; None: `max_steps`.
        time: end in the state that is occupied at this time; None: no limit.
        seed: seed of the generator; None draws one.
        loop_check: end the path when it can only repeat itself.
        max_steps: end after this many steps in any case.

    Raises:
        ModelFault: the model breaks a rule in a state on the path.
        UsageError: `steps` is no whole number from 0.
    """
    if steps is not None:
        _require_whole(steps, ", or None")
    simulator = Simulator(model, seed)
    limit = max_steps if steps is None else min(steps, max_steps)
    path = simulator._path
    forced: set[State] = set()  # states since the last one with several branches
    end = "length" if steps is None or steps > max_steps else "steps"
    while len(path) <= limit:
        enabled = simulator.choices
        if not enabled:
            end = "deadlock"
            break
        moves = [(c, b) for c in enabled for b in c.branches]
        if len(moves) > 1:
            forced.clear()
        elif loop_check and path[-1].state in forced:
            end = "loop"
            break
        else:
            forced.add(path[-1].state)
        simulator._take(enabled, moves)
        if time is not None and path[-1].time >= time:
            end = "time"
            break
    return Path(model.model, tuple(path), end, simulator.seed)
