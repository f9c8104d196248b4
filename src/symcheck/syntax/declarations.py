"""The abstract syntax of models and properties files: declarations, modules, compositions."""

from __future__ import annotations

from dataclasses import field
from typing import Literal as Choice

from symcheck.errors import InputError
from symcheck.lazy_dataclass import dataclass
from symcheck.syntax.ast import WITHOUT_KEYWORD, Expression, ModelType, Node, Type

__all__ = [
    "Assignment",
    "Command",
    "Composition",
    "Constant",
    "Formula",
    "Hiding",
    "Interleaving",
    "Label",
    "Module",
    "ModuleReference",
    "Observable",
    "Parallel",
    "Player",
    "Program",
    "PropertiesFile",
    "Property",
    "RenamedModule",
    "Renaming",
    "RewardItem",
    "RewardStructure",
    "Synchronised",
    "Update",
    "VariableDeclaration",
]


@dataclass(frozen=True, slots=True)
class Constant(Node):
    """`const type name = value;` (value None: to be given)."""

    name: str
    type: Type
    value: Expression | None


@dataclass(frozen=True, slots=True)
class Formula(Node):
    """`formula name = expression;`."""

    name: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Label(Node):
    """`label "name" = expression;`."""

    name: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Observable(Node):
    """`observable "name" = expression;`; name None for a name in `observables … endobservables`."""

    name: str | None
    expression: Expression


@dataclass(frozen=True, slots=True)
class VariableDeclaration(Node):
    """`name : [low..high] init value;`; low and high None: unbounded int, or bool by `type`.

    clock: `name : clock;`. Its type is int, because it is compared with ints.
    """

    name: str
    type: Type
    low: Expression | None
    high: Expression | None
    initial: Expression | None
    clock: bool = False


@dataclass(frozen=True, slots=True)
class Assignment(Node):
    """`(variable'=expression)`."""

    variable: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Update(Node):
    """`probability : assignments`; probability None is 1; no assignments is `true`.

    upper: the upper end of an interval `[probability,upper]`; None: the probability is a number.
    """

    probability: Expression | None
    assignments: tuple[Assignment, ...]
    upper: Expression | None = None


@dataclass(frozen=True, slots=True)
class Command(Node):
    """`[action] guard -> updates;`; action None for `[]`.

    is_markovian: `<action> guard -> updates;` of a Markov automaton, whose updates have rates.
    others: the further actions of `[a,b]`, which players of a concurrent game pick at once.
    """

    action: str | None
    guard: Expression
    updates: tuple[Update, ...]
    is_markovian: bool = False
    others: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Module(Node):
    """`module name … endmodule`; time passes only while its invariant (None: true) holds."""

    name: str
    variables: tuple[VariableDeclaration, ...]
    commands: tuple[Command, ...]
    invariant: Expression | None = None


@dataclass(frozen=True, slots=True)
class RenamedModule(Node):
    """`module name = base [ old=new, … ] endmodule`."""

    name: str
    base: str
    renaming: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Player(Node):
    """`player name module, [action], … endplayer`: who chooses among unlabelled commands of the
    modules, and among the commands of the actions.
    """

    name: str
    modules: tuple[str, ...]
    actions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RewardItem(Node):
    """`guard : value;` of states (action False), or `[a] guard : value;` (action None for `[]`).

    others: the further actions of `[a,b]`.
    """

    action: str | Choice[False] | None
    guard: Expression
    value: Expression
    others: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class RewardStructure(Node):
    """`rewards "name" … endrewards`; name None where none is given."""

    name: str | None
    items: tuple[RewardItem, ...]


@dataclass(frozen=True, slots=True)
class ModuleReference(Node):
    """A module in a `system` expression."""

    name: str


@dataclass(frozen=True, slots=True)
class Parallel(Node):
    """`A || B || …`: synchronise on the actions that both sides have."""

    operands: tuple[Composition, ...]


@dataclass(frozen=True, slots=True)
class Interleaving(Node):
    """`A ||| B ||| …`: no synchronisation."""

    operands: tuple[Composition, ...]


@dataclass(frozen=True, slots=True)
class Synchronised(Node):
    """`A |[a,b]| B`: synchronise on the given actions only."""

    left: Composition
    right: Composition
    actions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Hiding(Node):
    """`A / {a,b}`."""

    operand: Composition
    actions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Renaming(Node):
    """`A {a<-b, …}`: pairs (old, new)."""

    operand: Composition
    pairs: tuple[tuple[str, str], ...]


Composition = ModuleReference | Parallel | Interleaving | Synchronised | Hiding | Renaming


@dataclass(frozen=True, slots=True)
class Program(Node):
    """A whole model text. `type` None where no keyword stands (PRISM reads that as an MDP)."""

    type: ModelType | None
    constants: tuple[Constant, ...] = ()
    formulas: tuple[Formula, ...] = ()
    labels: tuple[Label, ...] = ()
    globals: tuple[VariableDeclaration, ...] = ()
    modules: tuple[Module | RenamedModule, ...] = ()
    rewards: tuple[RewardStructure, ...] = ()
    initial: Expression | None = None
    system: Composition | None = None
    players: tuple[Player, ...] = ()
    observables: tuple[Observable, ...] = ()

    @property
    def is_race(self) -> bool:
        """Whether all commands are Markovian: then nothing is left to choose."""
        bodies = [m.commands for m in self.modules if isinstance(m, Module)]
        return any(bodies) and all(c.is_markovian for commands in bodies for c in commands)

    def model_type(self, given: ModelType | None = None) -> ModelType:
        """The type of the model: a Markov automaton in which nothing is left to choose is a CTMC.

        Args:
            given: the type that the text is read as, in place of its own.
        """
        kind = given or self.type or WITHOUT_KEYWORD
        if kind.immediate_choices and self.is_race:
            return ModelType.with_properties(continuous_time=True)
        return kind

    def __repr__(self) -> str:
        """One line, as the nodes fill pages; `symcheck.pretty` gives the text."""
        kind = self.type.value if self.type is not None else "no type"
        parts = _counted(
            constants=self.constants,
            modules=self.modules,
            labels=self.labels,
            rewards=self.rewards,
        )
        return f"<Program: {kind}, {parts}>"


@dataclass(frozen=True, slots=True)
class Property(Node):
    """One property. `comments` has the comment lines directly above it, without their slashes."""

    name: str | None
    formula: Expression
    comments: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True, slots=True)
class PropertiesFile(Node):
    """A whole properties text, in its order.

    faulty: names of constants and formulas, and of labels and properties in quotes, whose
        definitions do not follow the grammar, and their faults, which have been told.
    """

    constants: tuple[Constant, ...] = ()
    formulas: tuple[Formula, ...] = ()
    labels: tuple[Label, ...] = ()
    properties: tuple[Property, ...] = ()
    faulty: tuple[tuple[str, InputError], ...] = ()

    def __repr__(self) -> str:
        """One line, as the nodes fill pages; `symcheck.pretty` gives the text."""
        parts = _counted(constants=self.constants, labels=self.labels, properties=self.properties)
        return f"<PropertiesFile: {parts}>"


def _counted(**parts: tuple[Node, ...]) -> str:
    """The number of nodes of each kind, and their names: `constants N p (2), modules m (1)`."""
    result = []
    for kind, nodes in parts.items():
        names = [name for name in (getattr(n, "name", None) for n in nodes) if name]
        shown = " ".join([*names[:4], *(["…"] if len(names) > 4 else [])])
        result.append(f"{kind} {shown} ({len(nodes)})" if shown else f"{len(nodes)} {kind}")
    return ", ".join(result)
