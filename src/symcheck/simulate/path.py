"""Random paths, and their text in the format of PRISM's -simpath.

Each state has one line: the transition that led to it, the probability or rate of that transition
(`probs`), the number of the step, the time (in a CTMC), the values of the variables, and the
rewards (`rewards`) of the state and of the transition, per structure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from symcheck.engines.states import Named
from symcheck.errors import Diagnostic, NameFault
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.interpreter import State
from symcheck.semantics.model import BoundModel
from symcheck.tables import Columns, Table, Tabular

__all__ = ["Path", "PathFormat", "PathStep", "rows", "table", "used_seed"]


@dataclass(frozen=True, slots=True)
class PathStep:
    """A state of a path, and the transition that led to it; `step["x"]` is the value of x.

    Attributes:
        state: the values of the variables, in their order.
        time: when the state was entered (in discrete time, the number of steps).
        action: the label of the transition; None for an unlabelled one, and in the first state.
        module: the module that took the transition; None if several took part.
        probability: of the transition (its rate in a CTMC; within its choice in an MDP); None in
            the first state.
        rewards: state rewards per structure.
        earned: transition rewards per structure.
        variables: the names of the variables.
    """

    state: State
    time: float
    rewards: tuple[float, ...] = ()
    action: str | None = None
    module: str | None = None
    probability: float | None = None
    earned: tuple[float, ...] = ()
    variables: tuple[str, ...] = field(default=(), repr=False)

    def __getitem__(self, name: str) -> bool | int:
        """The value of a variable. Raises KeyError."""
        return Named(zip(self.variables, self.state, strict=True))[name]

    @property
    def transition(self) -> str:
        """The transition that led here, as tables show it: `[action]`, or the name of a module."""
        if self.probability is None:
            return "-"
        return f"[{self.action}]" if self.action is not None else self.module or "[]"


@dataclass(frozen=True)
class Path(Tabular):
    """A path with n + 1 states.

    Attributes:
        end: why the path ends: 'steps', 'time', 'deadlock' (the last state has no transition),
            'loop' (the path can only repeat itself: it visited the last state before, and every
            state since has one branch) or 'length' (the maximal length).
    """

    model: BoundModel = field(repr=False)
    steps: tuple[PathStep, ...] = field(repr=False)
    end: str
    seed: int | None = None

    def __len__(self) -> int:
        return len(self.steps) - 1

    def __iter__(self) -> Iterator[PathStep]:
        return iter(self.steps)

    def __getitem__(self, index: int) -> PathStep:
        return self.steps[index]

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables, in the order of the states."""
        return tuple(v.name for v in self.model.variables)

    @property
    def times(self) -> list[float]:
        """When each state was entered."""
        return [s.time for s in self.steps]

    def values(self, variable: str) -> list[bool | int]:
        """The values of a variable along the path. Raises NameFault."""
        if variable not in self.variables:
            hint = "the model has " + ", ".join(self.variables)
            raise NameFault(
                Diagnostic(f"there is no variable '{variable}'", code="unknown-name", hint=hint)
            )
        index = self.variables.index(variable)
        return [s.state[index] for s in self.steps]

    def columns(self) -> Columns:
        """Transition, probability (rate) and time of each step, the variables, and per reward
        structure the reward of the state and of the transition that led to it.
        """
        result: dict[str, Sequence[object]] = {
            "step": range(len(self.steps)),
            "action": [s.action for s in self.steps],
            "probability": [s.probability for s in self.steps],
            "time": self.times,
        }
        result |= {name: self.values(name) for name in self.variables}
        for i, r in enumerate(self.model.rewards):
            name = r.name or str(i + 1)
            result[f"{name}_state"] = [s.rewards[i] for s in self.steps]
            result[f"{name}_transition"] = [s.earned[i] if s.earned else 0.0 for s in self.steps]
        return result

    def __str__(self) -> str:
        return table(self).rstrip("\n")

    def _table(self) -> Table:
        head, *body = rows(self)
        return Table.of(head, body)


@dataclass(frozen=True, slots=True, kw_only=True)
class PathFormat:
    """The format of a path as text.

    Attributes:
        variables: names of the variables shown; None: all.
        changes: show only states in which a shown variable or reward changes.
        snapshot: show the state at the multiples of this time; None: show all states.
    """

    variables: tuple[str, ...] | None = None
    separator: str = " "
    rewards: bool = False
    probabilities: bool = False
    changes: bool = False
    snapshot: float | None = None


def used_seed(seed: int | None) -> int:
    """The seed, or one that is drawn."""
    return int(np.random.SeedSequence().generate_state(1)[0]) if seed is None else seed


def table(path: Path, path_format: PathFormat | None = None) -> str:
    """The path as text: a line of titles, then a line per state. Raises NameFault for an unknown
    variable.
    """
    path_format = path_format or PathFormat()
    return "\n".join(path_format.separator.join(row) for row in rows(path, path_format)) + "\n"


def rows(path: Path, path_format: PathFormat | None = None) -> list[list[str]]:
    """The cells of the table, titles first."""
    path_format = path_format or PathFormat()
    names = path.variables if path_format.variables is None else path_format.variables
    for name in names:
        path.values(name)  # raises NameFault for an unknown variable
    chosen = [path.variables.index(n) for n in names]
    timed = path.model.type.continuous_time
    snapshot = path_format.snapshot is not None
    titles = [] if snapshot else ["action", *(["probability"] if path_format.probabilities else [])]
    titles += [
        "step",
        *(["time"] if timed else []),
        *names,
        *(_reward_titles(len(path.model.rewards)) if path_format.rewards else []),
    ]
    lines, last = [titles], None
    for number, time, step in _shown(path, path_format):
        cells = [format_value(step.state[i]) for i in chosen]
        if path_format.rewards:
            cells += [repr(x) for pair in _rewards(step, len(path.model.rewards)) for x in pair]
        if path_format.changes and cells == last:
            continue
        last = cells
        lead = (
            []
            if snapshot
            else [step.transition, *([_probability(step)] if path_format.probabilities else [])]
        )
        lines.append([*lead, str(number), *([repr(time)] if timed else []), *cells])
    return lines


def _shown(path: Path, path_format: PathFormat) -> Iterator[tuple[int, float, PathStep]]:
    """Number, time and step of each line: all steps, or those occupied at the multiples of the
    snapshot time.
    """
    if path_format.snapshot is None:
        yield from ((i, s.time, s) for i, s in enumerate(path.steps))
        return
    tick = 0
    for number, (step, following) in enumerate(
        zip(path.steps, [*path.steps[1:], None], strict=True)
    ):
        while (
            tick * path_format.snapshot < following.time
            if following
            else tick * path_format.snapshot <= step.time
        ):
            yield number, tick * path_format.snapshot, step
            tick += 1


def _reward_titles(count: int) -> Sequence[str]:
    return [f"{kind}_reward{i + 1}" for i in range(count) for kind in ("state", "transition")]


def _rewards(step: PathStep, count: int) -> list[tuple[float, float]]:
    return list(zip(step.rewards, step.earned or (0.0,) * count, strict=True))


def _probability(step: PathStep) -> str:
    return "-" if step.probability is None else repr(step.probability)
