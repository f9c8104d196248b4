"""`BoundModel`: a program with its constants evaluated, names resolved and types checked.

In the expressions of a bound model every `Name` is a variable; constants are literals, formulas and
renamings are expanded, and `LabelReference` does not occur.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from fractions import Fraction
from typing import Protocol

from symcheck.lazy_dataclass import dataclass
from symcheck.syntax.ast import Expression, Literal, ModelType, Node, Type, Weights
from symcheck.syntax.declarations import Composition, Program

__all__ = [
    "BoundCommand",
    "BoundModel",
    "BoundModule",
    "BoundPlayer",
    "BoundReward",
    "BoundRewards",
    "BoundUpdate",
    "Delays",
    "Event",
    "Observations",
    "TimeReading",
    "Value",
    "Variable",
]

_SHOWN = 8
Value = bool | int | float | Fraction


@dataclass(frozen=True, slots=True)
class Variable(Node):
    """A state variable.

    Attributes:
        low, high: bounds of an int, None if it is unbounded; 0 and 1 for a bool.
        initial: the initial value; None if the model has `init … endinit`.
        module: the module that declares the variable; None: global.
        clock: its value grows as time passes. Its type is int, because it is compared with ints.
    """

    name: str
    type: Type
    low: int | None
    high: int | None
    initial: bool | int | None
    module: str | None
    clock: bool = False

    @property
    def domain(self) -> Sequence[bool | int] | None:
        """All values, in order; None if they are unbounded."""
        if self.type is Type.BOOL:
            return (False, True)
        if self.low is None or self.high is None:
            return None
        return range(self.low, self.high + 1)

    def literal(self, value: bool | int) -> Literal:
        """A value as an expression; that of a bool may be 0 or 1."""
        is_bool = self.type is Type.BOOL
        return Literal(bool(value) if is_bool else value, self.type)


@dataclass(frozen=True, slots=True)
class BoundUpdate(Node):
    """An update: its probability (a rate in a CTMC), and assignments by variable index.

    upper: the upper end of an interval of probabilities; None: the probability is a number.
    """

    probability: Expression
    assignments: tuple[tuple[int, Expression], ...]
    upper: Expression | None = None


@dataclass(frozen=True, slots=True)
class BoundCommand(Node):
    """A guarded command of module number `module`; `is_markovian`: its updates have rates, in a
    model that also has commands without. `others`: the further actions that players of a concurrent
    game have to pick at once.
    """

    module: int
    action: str | None
    guard: Expression
    updates: tuple[BoundUpdate, ...]
    is_markovian: bool = False
    others: tuple[str, ...] = ()

    @property
    def actions(self) -> frozenset[str]:
        """Its action, and the others."""
        return frozenset(() if self.action is None else (self.action, *self.others))


@dataclass(frozen=True, slots=True)
class BoundModule:
    """A module after renaming; `variables` are the indices of its local variables.

    invariant: time passes only while it holds; None: true.
    """

    name: str
    variables: tuple[int, ...]
    commands: tuple[BoundCommand, ...]
    invariant: Expression | None = None


@dataclass(frozen=True, slots=True)
class BoundReward(Node):
    """A reward of states (`on_states`), or of the transitions of `action` (None: unlabelled) and
    `others`.
    """

    on_states: bool
    action: str | None
    guard: Expression
    value: Expression
    others: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class BoundRewards:
    """A reward structure; `name` is None if it has none."""

    name: str | None
    items: tuple[BoundReward, ...]


@dataclass(frozen=True, slots=True)
class BoundPlayer:
    """A player, who chooses among the unlabelled commands of modules and the events of actions."""

    name: str
    modules: frozenset[str]
    actions: frozenset[str]


@dataclass(frozen=True, slots=True)
class Event:
    """Commands that synchronise: one of each participant's `commands` is executed at once.

    The guard of a joint choice is the conjunction of the chosen guards, its updates are all
    combinations, and probabilities (rates) multiply. `action` None is the unlabelled (or hidden)
    action. An unlabelled command is an event with one participant and one command.

    picks: in a concurrent game, the action that each player picks, None of those who pick none.
    """

    action: str | None
    participants: tuple[tuple[BoundCommand, ...], ...]
    picks: tuple[str | None, ...] = ()

    @property
    def is_markovian(self) -> bool:
        """Whether it takes time in a Markov automaton: its commands have rates, and race."""
        return self.participants[0][0].is_markovian


@dataclass(frozen=True, slots=True)
class Observations:
    """What properties read of a model.

    Attributes:
        expressions: state expressions.
        rewards: they read rewards.
    """

    expressions: tuple[Expression, ...]
    rewards: bool


class TimeReading(Protocol):
    """How a timed automaton is read on a model that is checked in its place."""

    @property
    def automaton(self) -> BoundModel:
        """The automaton."""
        ...

    @property
    def time(self) -> str | None:
        """The action with which time passes; None if no step is one of time."""
        ...

    @property
    def for_property(self) -> bool:
        """Whether the model was made for one property."""
        ...

    @property
    def lists_states(self) -> bool:
        """Whether a state of the model is one of the automaton, at a time."""
        ...


@dataclass(frozen=True, slots=True)
class Delays:
    """What the steps of a model are that come from a timed automaton: delays, or actions at once.

    Attributes:
        time: the reward structure that counts the time.
        clocks: the variables that count it in units, up to a limit.
    """

    time: str
    clocks: frozenset[str]


@dataclass(frozen=True, repr=False)
class BoundModel:
    """A model whose state space can be built.

    Attributes:
        events: the flattened composition (see `symcheck.semantics.binding.composition`).
        initial: the condition on initial states; None: the variables' initial values.
        definitions: an expression without names for the exact value of each constant.
        is_rational: values are computed in exact arithmetic. (Conditions always are.)
        players: the players of a game, in the order of their declarations.
        given: the values of constants as they were given, which `constants` may have rounded.
        derivation: of a transformed model (such as a reduced one), the function that transforms
            another bound model of the same text in the same way.
        builder: of a model without a text, the function that builds its engine from options.
        observed: if not None, only values at the initial states are asked for; then one state may
            represent all that a symmetry makes of it, or that agree on the variables that matter.
            The function gives what the properties read of a model, None if that is more than such
            values.
        warnings: what its users should know, one sentence each.
        sums_divided: whether probabilities that sum to almost 1 are divided by their sum.
        unchecked_sums: whether probabilities may sum to almost 1 in some state. The search for
            states tells which command they have (`AlmostOne`).
        weights: the kind of its probabilities.
        clocks: of a model that counts the time of a timed automaton, how that is read on it.
        delays: of the chain of a strategy of a timed automaton, what its steps are.
        parameters: the constants that are left open, and their open ranges.
        observables: what strategies see of a state, if that is not all.
    """

    program: Program
    type: ModelType
    variables: tuple[Variable, ...]
    modules: tuple[BoundModule, ...]
    events: tuple[Event, ...]
    initial: Expression | None
    labels: Mapping[str, Expression]
    rewards: tuple[BoundRewards, ...]
    constants: Mapping[str, Value]
    is_rational: bool = False
    players: tuple[BoundPlayer, ...] = ()
    given: Mapping[str, Value | str] = field(default_factory=dict, compare=False)
    system: Composition | None = None
    definitions: Mapping[str, Expression] = field(default_factory=dict)
    derivation: Callable[[BoundModel], BoundModel] | None = field(default=None, compare=False)
    builder: Callable[..., object] | None = field(default=None, compare=False)
    observed: Callable[[BoundModel], Observations | None] | None = field(
        default=None, compare=False
    )
    warnings: tuple[str, ...] = field(default=(), compare=False)
    sums_divided: bool = field(default=False, compare=False)
    unchecked_sums: bool = False
    weights: Weights = Weights.NUMBERS
    clocks: TimeReading | None = field(default=None, compare=False)
    delays: Delays | None = None
    parameters: Mapping[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    observables: tuple[Expression, ...] = ()

    def __repr__(self) -> str:
        """A summary on one line."""
        names = " ".join(v.name for v in self.variables[:_SHOWN]) + (
            " …" if len(self.variables) > _SHOWN else ""
        )
        commands = sum(len(m.commands) for m in self.modules)
        return (
            f"<BoundModel: {self.type.value}, {len(self.modules)} modules, {commands} commands, "
            f"variables {names}>"
        )

    @property
    def observations(self) -> Observations | None:
        """What the properties read; None if more than values at the initial states may be asked."""
        return None if self.observed is None else self.observed(self)

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
