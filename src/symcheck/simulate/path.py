"""Random paths as values, and as text in the layout that PRISM's -simpath writes and other tools
read.

One line per state: the transition that led there, its probability or rate (probs), the number of
the step, the time (in a CTMC), the values of the variables, and the rewards (rewards): per
structure, of the state and of the transition.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from symcheck.errors import Diagnostic, NameFault
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.interpreter import State
from symcheck.semantics.model import BoundModel
from symcheck.syntax.ast import ModelType

__all__ = ["Layout", "Path", "Step", "rows", "table"]


@dataclass(frozen=True, slots=True)
class Step:
    """A state of a path, and how it was entered.

    time: when it was entered (the number of steps in discrete time). action: the label of the
    transition that led here, None for an unlabelled one; module: who took it, where it was one
    module alone. probability: of that transition (its rate in a CTMC); in an MDP, within its
    choice. earned: per reward structure, the reward of that transition; rewards: the state rewards
    here. The first state has neither action nor probability.
    """

    state: State
    time: float
    rewards: tuple[float, ...] = ()
    action: str | None = None
    module: str | None = None
    probability: float | None = None
    earned: tuple[float, ...] = ()

    @property
    def transition(self) -> str:
        """The transition that led here, as tables write it: `[action]`, or the name of a module."""
        if self.probability is None:
            return "-"
        return f"[{self.action}]" if self.action is not None else self.module or "[]"


@dataclass(frozen=True)
class Path:
    """A path with n + 1 states. `end`: why it ends: 'steps', 'time', 'deadlock', 'loop' or
    'length'.

    deadlock: nothing can happen in the last state. loop: from the last state on, the path can only
    repeat itself, for it has been there before and no choice was left since. length: the longest
    path that was allowed.
    """

    model: BoundModel = field(repr=False)
    steps: tuple[Step, ...] = field(repr=False)
    end: str
    seed: int | None = None

    def __len__(self) -> int:
        return len(self.steps) - 1

    def __iter__(self) -> Iterator[Step]:
        return iter(self.steps)

    def __getitem__(self, index: int) -> Step:
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

    def __str__(self) -> str:
        return table(self).rstrip("\n")

    def _repr_html_(self) -> str:
        """The path as a table, for notebooks."""
        head, *body = rows(self)
        cells = ["".join(f"<td>{c}</td>" for c in row) for row in body]
        return f"<table><tr>{''.join(f'<th>{c}</th>' for c in head)}</tr>{''.join(f'<tr>{c}</tr>' for c in cells)}</table>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """What a table shows. `variables` None: all; `changes`: only states in which one of them (or a
    reward) is new.
    """

    variables: tuple[str, ...] | None = None
    separator: str = " "
    rewards: bool = False
    probabilities: bool = False
    changes: bool = False
    snapshot: float | None = None


def table(path: Path, layout: Layout | None = None) -> str:
    """The path as text: a line of titles, then a line per state. Raises NameFault for an unknown
    variable.
    """
    layout = layout or Layout()
    return "\n".join(layout.separator.join(row) for row in rows(path, layout)) + "\n"


def rows(path: Path, layout: Layout | None = None) -> list[list[str]]:
    """The cells of the table, titles first."""
    layout = layout or Layout()
    names = path.variables if layout.variables is None else layout.variables
    for name in names:
        path.values(name)  # complains about an unknown one
    chosen = [path.variables.index(n) for n in names]
    timed = path.model.type is ModelType.CTMC
    snapshot = layout.snapshot is not None
    titles = [] if snapshot else ["action", *(["probability"] if layout.probabilities else [])]
    titles += [
        "step",
        *(["time"] if timed else []),
        *names,
        *(_reward_titles(len(path.model.rewards)) if layout.rewards else []),
    ]
    found, last = [titles], None
    for number, time, step in _shown(path, layout):
        cells = [format_value(step.state[i]) for i in chosen]
        if layout.rewards:
            cells += [repr(x) for pair in _rewards(step, len(path.model.rewards)) for x in pair]
        if layout.changes and cells == last:
            continue
        last = cells
        lead = (
            []
            if snapshot
            else [step.transition, *([_probability(step)] if layout.probabilities else [])]
        )
        found.append([*lead, str(number), *([repr(time)] if timed else []), *cells])
    return found


def _shown(path: Path, layout: Layout) -> Iterator[tuple[int, float, Step]]:
    """Number, time and step of the lines: all steps, or who is there at the multiples of the
    snapshot's time.
    """
    if layout.snapshot is None:
        yield from ((i, s.time, s) for i, s in enumerate(path.steps))
        return
    tick = 0
    for number, (step, following) in enumerate(
        zip(path.steps, [*path.steps[1:], None], strict=True)
    ):
        while (
            tick * layout.snapshot < following.time
            if following
            else tick * layout.snapshot <= step.time
        ):
            yield number, tick * layout.snapshot, step
            tick += 1


def _reward_titles(count: int) -> Sequence[str]:
    return [f"{kind}_reward{i + 1}" for i in range(count) for kind in ("state", "transition")]


def _rewards(step: Step, count: int) -> list[tuple[float, float]]:
    return list(zip(step.rewards, step.earned or (0.0,) * count, strict=True))


def _probability(step: Step) -> str:
    return "-" if step.probability is None else repr(step.probability)
