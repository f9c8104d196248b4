"""States, choices and transitions as Python values: what pictures, pages and simulators show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from symcheck.check.context import Context
from symcheck.check.result import Result
from symcheck.check.state_formulas import satisfying
from symcheck.engines.base import Engine, EngineOf, S, StateSet, V, erased
from symcheck.engines.capabilities import HasActions, HasBlocks
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.engines.explicit.intervals import IntervalEngine
from symcheck.engines.states import States as NamedStates
from symcheck.engines.transition_actions import transition_parts
from symcheck.errors import UnsupportedError, UsageError
from symcheck.explicit.model import ExplicitModel
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix
from symcheck.options import Options
from symcheck.semantics.binding.bind import bind_properties
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.model import BoundModel
from symcheck.simulate.path import PathStep
from symcheck.simulate.steps import CommandSuccessors
from symcheck.syntax.parse import parse_properties

if TYPE_CHECKING:
    from symcheck.engines.explicit.strategy import Strategy

__all__ = [
    "Choice",
    "ChoiceGraph",
    "GivenModel",
    "Source",
    "States",
    "StatesOnPath",
    "engine_of",
    "number_text",
    "refuse",
    "set_of",
    "strategy_of",
]

State = tuple[bool | int, ...]
States = str | StateSet | Bools | Sequence[int]
"""A set of states: a formula such as 'd=6' or '"done"', a set of the model or of the engine,
bool[states], or numbers of states.
"""
StatesOnPath = Iterable[PathStep | State | Mapping[str, bool | int] | int]


@runtime_checkable
class GivenModel(Protocol):
    """A model with its options: `symcheck.Model`."""

    @property
    def bound(self) -> BoundModel:
        """The bound model."""
        ...

    @property
    def options(self) -> Options:
        """How it is built."""
        ...

    @property
    def engine(self) -> Engine:
        """The built model."""
        ...


Source = GivenModel | ExplicitModel | Engine
"""Where states come from: a model, an explored model, or an engine."""


def engine_of(source: Source) -> Engine:
    """The engine of a model; an explored model becomes one. Raises UsageError for a file's name."""
    if isinstance(cast(object, source), str | Path | int):
        raise UsageError(f"a model is expected, not {source!r}", hint="symcheck.load reads a file")
    if isinstance(source, ExplicitModel):
        return erased(ExplicitEngine(source))
    return source.engine if isinstance(source, GivenModel) else source


def set_of(engine: EngineOf[S, V], states: str | NamedStates | S) -> S:
    """The states that satisfy a formula, such as 'd=6' or '"done"'; a set of the engine as it is.

    Raises InputError, and UsageError for a set of another engine.
    """
    if isinstance(states, NamedStates):
        if states.engine is not erased(engine):
            raise UsageError(
                "the set of states belongs to another engine", hint="give its formula as a text"
            )
        return cast(S, states.members)
    if not isinstance(states, str):
        return states
    formula = bind_properties(parse_properties(states), engine.model, {}).properties[0].formula
    whole = erased(engine)
    return cast(S, satisfying(Context(whole, Options()), formula, whole.all))


def number_text(value: float | Fraction) -> str:
    """A number with four significant digits; a rational with a short text as it is."""
    if isinstance(value, Fraction) and len(str(value)) <= 9:
        return str(value)
    return f"{float(value):.4g}".replace("inf", "∞")


@dataclass(frozen=True, slots=True)
class Choice:
    """A row of the matrix.

    Attributes:
        row: its number.
        action: its action, or "".
        successors: pairs of a state and its probability or rate; of an interval, the upper end.
        lower: the lower ends of intervals; empty for numbers.
    """

    row: int
    action: str
    successors: tuple[tuple[int, float | Fraction], ...]
    lower: tuple[float | Fraction, ...] = ()

    def text(self, number: int) -> str:
        """The probability, the rate or the interval of a successor."""
        upper = number_text(self.successors[number][1])
        if not self.lower or self.lower[number] == self.successors[number][1]:
            return upper
        return f"[{number_text(self.lower[number])},{upper}]"


@dataclass(frozen=True, eq=False)
class ChoiceGraph:
    """The states of an engine with their choices.

    Attributes:
        engine: the engine; states have its numbers.
        strategy: a strategy on this engine, whose memory is then a part of the states.
    """

    engine: Engine
    strategy: Strategy | None = None

    @cached_property
    def matrix(self) -> SparseMatrix:
        """Probabilities or rates of all states; of intervals, the upper ends."""
        if self._intervals is not None:
            return self._intervals.weights
        return self.engine.system(self.engine.all).weights

    @cached_property
    def _intervals(self) -> IntervalEngine | None:
        return self.engine.capability(IntervalEngine)

    @cached_property
    def _starts(self) -> Int64s:
        groups = self.matrix.groups
        return np.arange(self.engine.states + 1) if groups is None else groups

    @cached_property
    def successor_counts(self) -> Int64s:
        """The number of transitions of each state."""
        return np.diff(self.matrix.indptr[self._starts])

    @cached_property
    def _entries(self) -> tuple[Int64s, Int64s]:
        """The states from and to which each entry of the matrix leads."""
        sources = np.repeat(np.arange(self.engine.states), self.successor_counts)
        return sources, np.asarray(self.matrix.indices, np.int64)

    @cached_property
    def _actions(self) -> list[str] | None:
        """The action of each row of an MDP."""
        having = self.engine.capability(HasActions)
        if self.matrix.groups is None or having is None:
            return None
        names = self.engine.model.actions
        return [names[a] if a >= 0 else "" for a in having.row_actions().tolist()]

    @cached_property
    def initial(self) -> Bools:
        """The initial states."""
        return self.engine.to_bools(self.engine.initial)

    @cached_property
    def valuations(self) -> list[State]:
        """The values of the variables in each state."""
        engine, strategy = self.engine, self.strategy
        return list(engine.valuations(engine.all) if strategy is None else strategy.states())

    @cached_property
    def _numbers(self) -> dict[State, int]:
        return {state: i for i, state in enumerate(self.valuations)}

    @property
    def names(self) -> tuple[str, ...]:
        """The variables of a state."""
        return tuple(v.name for v in self.engine.model.variables)

    @property
    def is_chain(self) -> bool:
        """Whether each state has a single row."""
        return self.matrix.groups is None

    @cached_property
    def _steps(self) -> CommandSuccessors | None:
        """The commands of a chain with actions."""
        engine, model = self.engine, self.engine.model
        if not self.is_chain or engine.capability(HasBlocks) is not None or self._intervals:
            return None
        if len(self._numbers) < engine.states:  # a product with an automaton
            return None
        return (
            CommandSuccessors(model, check_sums=False) if model.actions and model.events else None
        )

    def actions_to(self, state: int) -> Mapping[int, str]:
        """The actions of a chain's transitions from a state, joined by commas, by target."""
        if self._steps is not None:
            result: dict[int, set[str]] = {}
            for choice in self._steps.choices(self.valuations[state]):
                for branch in choice.branches:
                    to = self._numbers.get(branch.state, -1)
                    result.setdefault(to, set()).add(choice.action or "")
            return {t: ", ".join(sorted(filter(None, names))) for t, names in result.items()}
        part = range(*self.matrix.indptr[state : state + 2].tolist())
        return {int(self.matrix.indices[i]): self._read_actions[i] for i in part}

    @cached_property
    def _read_actions(self) -> Sequence[str]:
        """The actions of each entry of the matrix of a chain that was read; empty for none."""
        model, entries = self.engine.model, self.matrix.entries
        read = self.is_chain and model.actions and model.builder is not None
        parts = transition_parts(self.engine) if read else None
        return [""] * entries if parts is None else parts.joined(model.actions, entries)

    def choices(self, state: int) -> list[Choice]:
        """The choices of a state."""
        m, result = self.matrix, []
        for row in range(int(self._starts[state]), int(self._starts[state + 1])):
            part = slice(int(m.indptr[row]), int(m.indptr[row + 1]))
            successors = zip(m.indices[part].tolist(), m.data[part].tolist(), strict=True)
            action = "" if self._actions is None else self._actions[row]
            lower = () if self._intervals is None else self._intervals.lower[part].tolist()
            result.append(Choice(row, action, tuple(successors), tuple(lower)))
        return result

    def number(self, state: PathStep | State | Mapping[str, bool | int] | int) -> int:
        """The number of a state. Raises UsageError if it is not reachable."""
        match state:
            case int():
                return state
            case PathStep():
                values = tuple(state.state)
            case Mapping():
                values = tuple(state[name] for name in self.names)
            case _:
                values = tuple(state)
        if values not in self._numbers:
            raise UsageError(f"{values} is not a reachable state of ({', '.join(self.names)})")
        return self._numbers[values]

    def members(self, states: States) -> Bools:
        """Membership of each state, bool[states]. Raises InputError for a faulty formula."""
        if not isinstance(states, str) and isinstance(states, Sequence | np.ndarray):
            array = np.asarray(states)
            if array.dtype == bool:
                return array
            mask = np.zeros(self.engine.states, bool)
            mask[array.astype(np.int64)] = True
            return mask
        return self.engine.to_bools(set_of(self.engine, states))

    def numbers(
        self, values: Result | Sequence[float] | Sequence[str] | NDArray[np.generic]
    ) -> Sequence[float | Fraction | bool | str]:
        """A number or a text for each state.

        Args:
            values: a result with values or with a set of states, or one value for each state.

        Raises:
            UsageError: there are none, or they belong to other states.
        """
        if not isinstance(values, Result):
            result: list[float | Fraction | bool | str] = list(values)
            if len(result) == self.engine.states:
                return result
            raise UsageError(f"{self.engine.states:,} values are expected, not {len(result):,}")
        on = values.engine or self.engine
        if values.values_or_none is not None:
            result = values.values.array.tolist()
        elif values.satisfying_or_none is not None:
            result = values.satisfying.mask.tolist()
        else:
            raise UsageError("this result has no values of states")
        if on is self.engine:
            return result
        if on.states != self.engine.states:
            raise UsageError(
                "the values belong to the states of another model",
                hint="check without the options bisim and reduce",
            )
        known = dict(zip(on.valuations(on.all), result, strict=True))
        return [known[state] for state in self.valuations]

    def distances(self, start: Bools, radius: int | None, limit: int, *, back: bool) -> Int64s:
        """The number of steps from the states `start`; -1 beyond the radius, or unreachable.

        Args:
            start: where steps begin, bool[states].
            radius: the most steps. None: as many as keep the states within the limit.
            limit: see `radius`.
            back: take transitions in both directions.
        """
        source, target = self._entries
        distance = np.where(start, 0, -1)
        step, frontier = 0, start
        while frontier.any() and (radius is None or step < radius):
            step += 1
            result = np.zeros_like(start)
            result[target[frontier[source]]] = True
            if back:
                result[source[frontier[target]]] = True
            frontier = result & (distance < 0)
            if radius is None and int((distance >= 0).sum() + frontier.sum()) > limit:
                break
            distance[frontier] = step
        return distance

    def text(
        self,
        state: Sequence[bool | int],
        *,
        named: bool,
        width: int,
        shown: Sequence[int] | None = None,
    ) -> str:
        """A state in lines of `width` values: 's=0, !b', or without names '0, f'.

        shown: the numbers of the values; None: all.
        """
        short = {True: "t", False: "f"}
        texts = (
            [short[v] if isinstance(v, bool) else str(v) for v in state]
            if not named
            else [
                (n if v else f"!{n}") if isinstance(v, bool) else f"{n}={format_value(v)}"
                for n, v in zip((*self.names, "memory"), state, strict=False)
            ]
        )
        texts = texts if shown is None else [texts[i] for i in shown]
        lines = [
            (", " if named else ",").join(texts[i : i + width]) for i in range(0, len(texts), width)
        ]
        return "\n".join(lines) or "state"


def strategy_of(chosen: Strategy | Result) -> Strategy:
    """A strategy, or that of a result. Raises NoStrategyError if it has none."""
    return chosen.strategy if isinstance(chosen, Result) else chosen


def refuse(count: int, limit: int, what: str = "states") -> UnsupportedError:
    """The error for a graph that is too large to be drawn."""
    return UnsupportedError(
        f"the picture would have {count:,} {what}, and at most {limit:,} are drawn",
        hint="draw a part with around='FORMULA', radius=2, a smaller model, or raise max_states",
    )
