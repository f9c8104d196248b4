"""Successors of many states at once, command by command: expressions are compiled, everything else is arrays.

Written from the rules of the language alone (see `symcheck.semantics.interpreter`, its scalar form), and apart from the
explicit builder and from the encoding as diagrams, so that simulation tests both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from symcheck.errors import Diagnostic, InputError, ModelFault
from symcheck.explicit.compile import Code, compile_expression
from symcheck.explicit.tables import total_reward
from symcheck.matrices.rows import Bools, Floats, Int64s
from symcheck.semantics.interpreter import choices, state_rewards
from symcheck.semantics.model import BoundCommand, BoundModel, Event
from symcheck.semantics.state_faults import SUM_TOLERANCE, describe_state
from symcheck.syntax.ast import ModelType, Type

__all__ = ["Expander", "Successors"]

_FARTHEST = 2**31 - 1  # of a variable without bounds


@dataclass(frozen=True, eq=False)
class Successors:
    """Branches of n states: those of state i are offsets[i] to offsets[i+1], in the order of the model.

    weights: float64[m], rates in a CTMC, else probabilities (choices of an MDP are equally likely). columns:
    int64[variables, m]. rewards: float64[m], what the branch earns. deadlock: bool[n]; such a state has one branch, a loop.
    """

    offsets: Int64s
    weights: Floats
    columns: Int64s
    rewards: Floats
    deadlock: Bools


@dataclass(frozen=True, eq=False)
class _Update:
    probability: Code
    assignments: tuple[tuple[int, Code], ...]


@dataclass(frozen=True, eq=False)
class _Command:
    number: int
    guard: Code
    updates: tuple[_Update, ...]


@dataclass(frozen=True, eq=False)
class _Event:
    participants: tuple[tuple[_Command, ...], ...]
    reward: Code | None


@dataclass(eq=False)
class _Found:
    """Branches in the order in which they are found: lanes, weights, new columns, rewards; choices per lane."""

    choices: Int64s
    lanes: list[Int64s] = field(default_factory=list)
    weights: list[Floats] = field(default_factory=list)
    columns: list[Int64s] = field(default_factory=list)
    rewards: list[Floats] = field(default_factory=list)


class _Broken(Exception):
    """Something is wrong in lane number `lane`; the scalar semantics will say what."""

    def __init__(self, lane: int) -> None:
        super().__init__(lane)
        self.lane = lane


class Expander:
    """A model, compiled. `structure`: the number of the reward structure whose transition rewards are wanted, if any."""

    def __init__(self, model: BoundModel, structure: int | None = None) -> None:
        self.model = model
        self._commands: dict[int, _Command] = {}
        self._alive: list[BoundCommand] = []  # so that no id is given twice
        self._events = [self._event(e, structure) for e in model.events]
        items = (
            [] if structure is None else [i for i in model.rewards[structure].items if i.on_states]
        )
        self._state_reward = compile_expression(total_reward(items), model) if items else None
        self._lows = [-_FARTHEST if v.low is None else v.low for v in model.variables]
        self._highs = [_FARTHEST if v.high is None else v.high for v in model.variables]

    # -------------------------------------------------------------------------------------------- compiling

    def _event(self, event: Event, structure: int | None) -> _Event:
        rewards = [] if structure is None else self.model.rewards[structure].items
        items = [i for i in rewards if not i.on_states and i.action == event.action]
        code = compile_expression(total_reward(items), self.model) if items else None
        return _Event(
            tuple(tuple(self._command(c) for c in part) for part in event.participants), code
        )

    def _command(self, command: BoundCommand) -> _Command:
        """A command's code, made once although it may take part in several events."""
        known = self._commands.get(id(command))
        if known is None:
            updates = tuple(
                _Update(
                    compile_expression(u.probability, self.model),
                    tuple((v, compile_expression(x, self.model)) for v, x in u.assignments),
                )
                for u in command.updates
            )
            known = _Command(
                len(self._commands), compile_expression(command.guard, self.model), updates
            )
            self._commands[id(command)] = known
            self._alive.append(command)
        return known

    # -------------------------------------------------------------------------------------------- running

    def state_rewards(self, columns: Int64s) -> Floats:
        """State rewards of n states (int64[variables, n]): float64[n]. Raises ModelFault where one is not finite."""
        n = columns.shape[1]
        if self._state_reward is None:
            return np.zeros(n)
        values = _values(self._state_reward, columns, np.arange(n))
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            state_rewards(self.model, self._state(columns, int(bad[0])))
            raise AssertionError(
                "a state reward that is not finite, where the scalar semantics finds no fault"
            )
        return values

    def successors(self, columns: Int64s) -> Successors:
        """All branches of n states (int64[variables, n]). Raises ModelFault where the model breaks a rule in one of them."""
        try:
            return self._assembled(columns, self._found(columns))
        except _Broken as broken:
            suspects = range(broken.lane, broken.lane + 1)
        except InputError:
            suspects = range(columns.shape[1])
        raise self._fault(columns, suspects)

    def _fault(self, columns: Int64s, lanes: Sequence[int]) -> ModelFault:
        """Raise what the scalar semantics raises for one of these lanes; where it finds nothing, numbers have grown too large."""
        for lane in lanes:
            choices(self.model, self._state(columns, lane))
        shown = describe_state(self.model.variables, columns[:, lanes[0]].tolist())
        message = f"a variable without bounds leaves 32 bits, after the state {shown}"
        return ModelFault(
            Diagnostic(message, code="unbounded", hint="give it a range, or a guard that stops it")
        )

    def _state(self, columns: Int64s, lane: int) -> tuple[bool | int, ...]:
        values = columns[:, lane].tolist()
        return tuple(
            bool(x) if v.type is Type.BOOL else x
            for v, x in zip(self.model.variables, values, strict=True)
        )

    def _found(self, columns: Int64s) -> _Found:
        n = columns.shape[1]
        everywhere = np.arange(n)
        found = _Found(np.zeros(n, np.int64))
        enabled = [_values(c.guard, columns, everywhere) != 0 for c in self._commands.values()]
        for event in self._events:
            for together, lanes in _joint(event.participants, enabled, (), everywhere):
                self._choice(event, together, lanes, columns, found)
        return found

    def _choice(
        self,
        event: _Event,
        together: tuple[_Command, ...],
        lanes: Int64s,
        columns: Int64s,
        found: _Found,
    ) -> None:
        """All branches of one joint choice, in the lanes where it is enabled."""
        weights = [[_values(u.probability, columns, lanes) for u in c.updates] for c in together]
        for w in (w for command in weights for w in command):
            _demand((w >= 0) & (w < np.inf), lanes)
        sums = np.ones(len(lanes))
        for command in weights:
            sums = sums * sum(command)
        if self.model.type is not ModelType.CTMC:
            _demand(np.abs(sums - 1) <= SUM_TOLERANCE, lanes)
        found.choices[lanes] += sums > 0
        reward = (
            np.zeros(len(lanes)) if event.reward is None else _values(event.reward, columns, lanes)
        )
        _demand(np.isfinite(reward) | (sums == 0), lanes)
        for weight, updates in _combinations(together, weights, np.ones(len(lanes)), ()):
            possible = weight > 0
            if possible.any():
                at = lanes[possible]
                found.lanes.append(at)
                found.weights.append(weight[possible])
                found.columns.append(self._after(updates, at, columns))
                found.rewards.append(reward[possible])

    def _after(self, updates: tuple[_Update, ...], lanes: Int64s, columns: Int64s) -> Int64s:
        new = columns[:, lanes]
        for update in updates:
            for variable, code in update.assignments:
                value = code.run(_operands(code, columns, lanes))
                _demand((value >= self._lows[variable]) & (value <= self._highs[variable]), lanes)
                new[variable] = value
        return new

    def _assembled(self, columns: Int64s, found: _Found) -> Successors:
        """Branches by lane, with loops at deadlocks."""
        n = columns.shape[1]
        dead = np.flatnonzero(found.choices == 0)
        lanes = np.concatenate([*found.lanes, dead])
        order = np.argsort(lanes, kind="stable")
        weights = np.concatenate([*found.weights, np.ones(len(dead))])
        if self.model.type is not ModelType.CTMC:
            weights /= np.maximum(found.choices, 1)[lanes]
        offsets = np.zeros(n + 1, np.int64)
        np.cumsum(np.bincount(lanes, minlength=n), out=offsets[1:])
        after = np.concatenate([*found.columns, columns[:, dead]], axis=1)
        rewards = np.concatenate([*found.rewards, np.zeros(len(dead))])
        return Successors(
            offsets, weights[order], after[:, order], rewards[order], found.choices == 0
        )


def _values(code: Code, columns: Int64s, lanes: Int64s) -> Floats:
    """The value of an expression in some lanes, as float64."""
    return np.asarray(code.run(_operands(code, columns, lanes)), np.float64)


def _operands(code: Code, columns: Int64s, lanes: Int64s) -> Int64s:
    """The variables that an expression reads, in some lanes."""
    return columns[np.array(code.support, np.int64)[:, None], lanes]


def _demand(fine: Bools, lanes: Int64s) -> None:
    if not fine.all():
        raise _Broken(int(lanes[np.flatnonzero(~fine)[0]]))


def _joint(
    parts: tuple[tuple[_Command, ...], ...],
    enabled: list[Bools],
    chosen: tuple[_Command, ...],
    lanes: Int64s,
) -> Iterator[tuple[tuple[_Command, ...], Int64s]]:
    """One command of each participant, and the lanes where all of them are enabled, unless there are none."""
    if not len(lanes):
        return
    if len(chosen) == len(parts):
        yield chosen, lanes
        return
    for command in parts[len(chosen)]:
        yield from _joint(parts, enabled, (*chosen, command), lanes[enabled[command.number][lanes]])


def _combinations(
    together: tuple[_Command, ...],
    weights: list[list[Floats]],
    weight: Floats,
    chosen: tuple[_Update, ...],
) -> Iterator[tuple[Floats, tuple[_Update, ...]]]:
    """One update of each command, and the product of their weights."""
    if len(chosen) == len(together):
        yield weight, chosen
        return
    place = len(chosen)
    for update, own in zip(together[place].updates, weights[place], strict=True):
        yield from _combinations(together, weights, weight * own, (*chosen, update))
