"""The interpreter: initial states and transitions, computed one state at a time.

It defines the semantics of models, and is the oracle for the state-space builders. In a DTMC
overlapping choices are equally likely; in a CTMC they race, so their rates add up; in an MDP each
is a choice. In a Markov automaton, Markovian commands race where no other command is enabled
(maximal progress). Probabilities (rates) of synchronised commands multiply.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import cast

from symcheck.errors import InputError, ModelFault
from symcheck.lazy_dataclass import dataclass
from symcheck.semantics import state_faults
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import to_float
from symcheck.semantics.model import BoundCommand, BoundModel, BoundReward, BoundUpdate, Value
from symcheck.syntax.ast import Expression

__all__ = [
    "Choice",
    "Row",
    "State",
    "action_rewards",
    "choices",
    "initial_states",
    "is_race",
    "state_rewards",
    "transitions",
    "valuation",
    "value",
]

State = tuple[bool | int, ...]


@dataclass(frozen=True, slots=True)
class Choice:
    """A combination of synchronised commands that is enabled in a state.

    Attributes:
        branches: probability (rate) and next state of each combination of updates with a positive
            probability; states may repeat.
        rewards: the transition reward of each branch, per reward structure.
    """

    action: str | None
    commands: tuple[BoundCommand, ...]
    branches: tuple[tuple[Value, State], ...]
    rewards: tuple[Value, ...]


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the transition matrix: a state of a DTMC or CTMC, or a choice of an MDP.

    Attributes:
        is_race: whether it is the row of a Markovian state of a Markov automaton.
        action: the action; None if choices with several actions were merged.
        branches: probability (rate) and next state; no state occurs twice.
        rewards: transition rewards weighted by the probabilities (rates), per reward structure.
    """

    is_race: bool
    action: str | None
    branches: tuple[tuple[Value, State], ...]
    rewards: tuple[Value, ...]


def valuation(model: BoundModel, state: State) -> dict[str, Value]:
    """The values of the variables by name."""
    return dict(zip((v.name for v in model.variables), state, strict=True))


def value(model: BoundModel, state: State, expression: Expression) -> Value:
    """The value of an expression over the variables. Raises ModelFault, with the state, if it has
    none.
    """
    return _StateEvaluator(model, state).value(expression)


def initial_states(model: BoundModel) -> tuple[State, ...]:
    """The initial states in lexicographic order.

    For init … endinit all valuations are enumerated, so this is for small models only. Raises
    ModelFault if there is no initial state.
    """
    if model.initial is None:
        return (tuple(cast("bool | int", v.initial) for v in model.variables),)
    # Binding rules out variables without bounds beside init … endinit.
    states = product(*(v.domain or () for v in model.variables))
    result = tuple(s for s in states if _StateEvaluator(model, s).value(model.initial))
    if not result:
        raise ModelFault(state_faults.no_initial_state(model.initial.span))
    return result


def choices(model: BoundModel, state: State, *, check_sums: bool = True) -> tuple[Choice, ...]:
    """The enabled choices in a state, unlabelled ones first.

    Args:
        model: the model.
        state: the values of its variables, in the order of declaration.
        check_sums: check that the probabilities of updates sum to 1.

    Raises:
        ModelFault: the model has a fault in this state.
    """
    evaluator = _StateEvaluator(model, state)
    result: list[Choice] = []
    has_choices = model.type.has_choices
    total = nothing = [0.0] * len(model.rewards)
    for event in model.events:
        if event.is_markovian and result and not is_race(result):
            break  # time does not pass where there is a choice to make
        enabled = (
            [c for c in commands if evaluator.value(c.guard)] for commands in event.participants
        )
        for combination in product(*enabled):
            branches = evaluator.branches(combination, check_sums)
            if branches:
                rewards = evaluator.rewards(False, event.action)
                result.append(Choice(event.action, combination, branches, rewards))
                if not model.is_rational:
                    race = not has_choices or event.is_markovian
                    total = evaluator.earned(result[-1], total if race else nothing)
    return tuple(result)


def transitions(model: BoundModel, state: State, *, check_sums: bool = True) -> tuple[Row, ...]:
    """The rows of the transition matrix of a state.

    Returns:
        At most one row for a DTMC or CTMC; no row in a deadlock.

    Raises:
        ModelFault: the model has a fault in this state.
    """
    result = choices(model, state, check_sums=check_sums)
    if not result:
        return ()
    if model.type.has_choices and not is_race(result):
        return tuple(_row((c,), 1) for c in result)
    return (_row(result, len(result) if model.type.chooses_uniformly else 1),)


def is_race(enabled: Sequence[Choice]) -> bool:
    """Whether the enabled choices of a state of a Markov automaton are Markovian."""
    return bool(enabled) and enabled[0].commands[0].is_markovian


def state_rewards(model: BoundModel, state: State) -> tuple[Value, ...]:
    """The state reward per reward structure. Raises ModelFault if one is not finite."""
    return _StateEvaluator(model, state).rewards(True, None)


def action_rewards(model: BoundModel, state: State, action: str | None) -> tuple[Value, ...]:
    """The reward of a transition of an action, per reward structure. Raises ModelFault if one is
    not finite.
    """
    return _StateEvaluator(model, state).rewards(False, action)


def _row(merged: tuple[Choice, ...], divisor: int) -> Row:
    """Merge choices into one row, with their probabilities divided by `divisor`."""
    branches: dict[State, Value] = {}
    rewards: list[Value] = [0] * len(merged[0].rewards)
    for choice in merged:
        for probability, state in choice.branches:
            share = probability / divisor
            branches[state] = branches.get(state, 0) + share
            rewards = [
                total + share * reward
                for total, reward in zip(rewards, choice.rewards, strict=True)
            ]
    actions = {c.action for c in merged}
    return Row(
        is_race(merged),
        actions.pop() if len(actions) == 1 else None,
        tuple((p, s) for s, p in branches.items()),
        tuple(rewards),
    )


class _StateEvaluator:
    """Evaluates expressions, commands and rewards of a model at one state."""

    def __init__(self, model: BoundModel, state: State) -> None:
        self.model = model
        self.state = state
        self.valuation: Mapping[str, Value] = valuation(model, state)

    def describe(self) -> str:
        return state_faults.describe_state(self.model.variables, self.state)

    def value(self, expression: Expression) -> Value:
        try:
            return evaluate(expression, self.valuation, exact=self.model.is_rational)
        except InputError as fault:
            raise state_faults.at_state(fault, self.describe()) from None

    def real(self, expression: Expression) -> Fraction | float:
        value = self.value(expression)
        return Fraction(value) if self.model.is_rational and isinstance(value, int) else value

    def branches(
        self, commands: tuple[BoundCommand, ...], check_sums: bool
    ) -> tuple[tuple[Value, State], ...]:
        """All combinations of the commands' updates that have a positive probability."""
        weighted = [[(self.probability(c, u), c, u) for u in c.updates] for c in commands]
        has_rates = commands[0].is_markovian or not self.model.type.has_probabilities
        if check_sums and not has_rates:
            self.check_sums(commands, [sum(p for p, _, _ in updates) for updates in weighted])
        result = []
        for combination in product(*weighted):
            probability = math.prod(p for p, _, _ in combination)
            if probability > 0:
                result.append((probability, self.successor([(c, u) for _, c, u in combination])))
        return tuple(result)

    def check_sums(self, commands: tuple[BoundCommand, ...], sums: list[Value]) -> None:
        total = math.prod(sums)
        is_one = state_faults.sums_to_one(total)
        # Compiled search may add in another order: the interpreter confirms what it finds.
        tolerance = 0.5 * state_faults.sum_tolerance(self.model.unchecked_sums)
        if is_one and (not self.model.unchecked_sums or abs(to_float(total) - 1) <= tolerance):
            return
        worst = max(range(len(sums)), key=lambda i: abs(to_float(sums[i]) - 1))
        if is_one:
            raise state_faults.AlmostOne(commands[worst], sums[worst], self.describe())
        command, total = commands[worst], sums[worst]
        other = self.completing(command, total)
        raise ModelFault(state_faults.update_sum(command, total, self.describe(), other))

    def completing(self, command: BoundCommand, total: Value) -> BoundCommand | None:
        """Another enabled command of its module that has the probability which is missing."""
        for other in self.model.modules[command.module].commands:
            if (
                other.action == command.action
                and other.span != command.span
                and self.value(other.guard)
                and state_faults.sums_to_one(
                    total + sum(self.real(u.probability) for u in other.updates)
                )
            ):
                return other
        return None

    def probability(self, command: BoundCommand, update: BoundUpdate) -> Fraction | float:
        value = self.real(update.probability)
        is_finite = not isinstance(value, float) or math.isfinite(value)
        if not is_finite or value < 0:
            fault = state_faults.negative_update if is_finite else state_faults.update_not_finite
            raise ModelFault(fault(command, update, value, self.describe(), self.model.type))
        return value

    def successor(self, updates: list[tuple[BoundCommand, BoundUpdate]]) -> State:
        """The successor state of updates, whose expressions are evaluated in this state."""
        state = list(self.state)
        for command, update in updates:
            for i, expression in update.assignments:
                value = self.value(expression)
                variable = self.model.variables[i]
                if (variable.low is not None and value < variable.low) or (
                    variable.high is not None and value > variable.high
                ):
                    raise ModelFault(
                        state_faults.update_range(command, update, variable, value, self.describe())
                    )
                state[i] = cast("bool | int", value)
        return tuple(state)

    def rewards(self, on_states: bool, action: str | None) -> tuple[Value, ...]:
        """The sum of the items that apply, per reward structure."""
        totals = []
        for structure in self.model.rewards:
            total: Fraction | float = 0
            for item in structure.items:
                if item.on_states == on_states and item.action == action and self.value(item.guard):
                    total += self.finite(item, self.real(item.value), "this reward")
                    self.finite(item, total, "the sum of the rewards up to this one")
            totals.append(total)
        return tuple(totals)

    def finite(self, item: BoundReward, value: Fraction | float, what: str) -> Fraction | float:
        """A number that belongs to a reward item. Raises ModelFault if it is not finite."""
        if isinstance(value, float) and not math.isfinite(value):
            raise ModelFault(state_faults.reward_not_finite(item, value, what, self.describe()))
        return value

    def earned(self, choice: Choice, before: list[float]) -> list[float]:
        """Per reward structure, what was earned before plus the reward of a choice times its
        probability (rate). Raises ModelFault where that is infinite.
        """
        weight = sum(p for p, _ in choice.branches)
        totals = []
        for structure, reward, total in zip(
            self.model.rewards, choice.rewards, before, strict=True
        ):
            total += weight * reward
            for item in structure.items:
                if not item.on_states and item.action == choice.action:
                    what = f"this reward times the {state_faults.weight_name(self.model.type)}"
                    self.finite(item, total, what)
            totals.append(total)
        return totals
