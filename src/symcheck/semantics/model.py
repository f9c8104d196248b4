"""`BoundModel`: a program with its constants evaluated, names resolved and types checked.

In the expressions of a bound model, every `Name` is a variable of the model; constants are literals, formulas and
renamings are expanded, and `LabelReference` does not occur.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from symcheck.errors import NO_SPAN, Span
from symcheck.syntax.ast import Expression, ModelType, Type
from symcheck.syntax.declarations import Composition, Program

__all__ = [
    "BoundCommand",
    "BoundModel",
    "BoundModule",
    "BoundReward",
    "BoundRewards",
    "BoundUpdate",
    "Event",
    "Value",
    "Variable",
]

_SHOWN = 8
Value = bool | int | float | Fraction


@dataclass(frozen=True, slots=True)
class Variable:
    """A state variable. `low`/`high` None: an unbounded int; a bool has bounds 0 and 1. `module` None: global.

    `initial` is None where the model has `init … endinit`.
    """

    name: str
    type: Type
    low: int | None
    high: int | None
    initial: bool | int | None
    module: str | None
    span: Span = field(default=NO_SPAN, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BoundUpdate:
    """`probability` (a rate in a CTMC) and the new values, by variable index."""

    probability: Expression
    assignments: tuple[tuple[int, Expression], ...]
    span: Span = field(default=NO_SPAN, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BoundCommand:
    """A guarded command of module number `module`."""

    module: int
    action: str | None
    guard: Expression
    updates: tuple[BoundUpdate, ...]
    span: Span = field(default=NO_SPAN, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BoundModule:
    """A module after renaming. `variables`: indices of its local variables."""

    name: str
    variables: tuple[int, ...]
    commands: tuple[BoundCommand, ...]


@dataclass(frozen=True, slots=True)
class BoundReward:
    """A reward on states (`on_states`), or on the transitions of `action` (None: unlabelled ones)."""

    on_states: bool
    action: str | None
    guard: Expression
    value: Expression
    span: Span = field(default=NO_SPAN, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class BoundRewards:
    """A reward structure; `name` is None where none is given."""

    name: str | None
    items: tuple[BoundReward, ...]


@dataclass(frozen=True, slots=True)
class Event:
    """Commands that happen together: one of each participant's `commands`, all at once.

    The guard of a joint choice is the conjunction of the chosen guards, its updates are all combinations, and the
    probabilities (rates) multiply. `action` None is the unlabelled (or hidden) action. An unlabelled command is an
    event of its own, with one participant that has one command.
    """

    action: str | None
    participants: tuple[tuple[BoundCommand, ...], ...]


@dataclass(frozen=True, repr=False)
class BoundModel:
    """A model ready to be built. `events` is its composition, flattened (see `symcheck.semantics.binding.composition`).

    `exact` says that double values in literals are to be used as the fractions that they are. `derivation` (of a model that is not
    what its text says, but made from that, such as a reduced one) makes the like from another bound model of the text.
    """

    program: Program = field(repr=False)
    type: ModelType
    variables: tuple[Variable, ...]
    modules: tuple[BoundModule, ...]
    events: tuple[Event, ...]
    initial: Expression | None
    labels: Mapping[str, Expression]
    rewards: tuple[BoundRewards, ...]
    constants: Mapping[str, Value]
    exact: bool = False
    system: Composition | None = None
    derivation: Callable[[BoundModel], BoundModel] | None = field(
        default=None, repr=False, compare=False
    )

    def __repr__(self) -> str:
        """One line: the whole is in the fields, and would fill pages."""
        names = " ".join(v.name for v in self.variables[:_SHOWN]) + (
            " …" if len(self.variables) > _SHOWN else ""
        )
        commands = sum(len(m.commands) for m in self.modules)
        return f"<BoundModel: {self.type.value}, {len(self.modules)} modules, {commands} commands, variables {names}>"

    @property
    def actions(self) -> tuple[str, ...]:
        """The action names, in order of first appearance."""
        return tuple(dict.fromkeys(e.action for e in self.events if e.action is not None))

    def index(self, name: str) -> int:
        """Index of a variable. Raises KeyError for an unknown name."""
        for i, v in enumerate(self.variables):
            if v.name == name:
                return i
        raise KeyError(name)
