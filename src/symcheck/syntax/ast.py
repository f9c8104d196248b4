"""The abstract syntax of models and properties: frozen values, each with a span that equality ignores.

State formulas and arithmetic share one closed union, `Expression`, because PRISM mixes them freely
(`P=? [ F x=1 ] + 0.5`, `"safe" & x>2`). Path formulas use the temporal nodes and, between them,
the boolean `Unary`, `Binary` and `Conditional` nodes of state formulas.
"""

from __future__ import annotations

from enum import Enum
from fractions import Fraction
from typing import Literal as Choice

from symcheck.errors import NO_SPAN, Span
from symcheck.records import dataclass, field

__all__ = [
    "Assignment",
    "Binary",
    "Bound",
    "Call",
    "Command",
    "Composition",
    "Conditional",
    "Constant",
    "CumulativeReward",
    "Direction",
    "Eventually",
    "Expression",
    "Filter",
    "Formula",
    "Globally",
    "Hiding",
    "InstantaneousReward",
    "Interleaving",
    "Label",
    "LabelReference",
    "Literal",
    "ModelType",
    "Module",
    "ModuleReference",
    "MultiObjective",
    "Name",
    "Next",
    "Node",
    "Parallel",
    "PathBound",
    "PathFormula",
    "PathQuantifier",
    "ProbabilityOperator",
    "Program",
    "PropertiesFile",
    "Property",
    "Release",
    "RenamedModule",
    "Renaming",
    "RewardBound",
    "RewardBounds",
    "RewardItem",
    "RewardOperator",
    "RewardQuery",
    "RewardStructure",
    "StateFilter",
    "SteadyState",
    "SteadyStateReward",
    "Synchronised",
    "TimeBound",
    "TotalReward",
    "Type",
    "Unary",
    "Until",
    "Update",
    "VariableDeclaration",
    "WeakUntil",
]


@dataclass(frozen=True, slots=True)
class Node:
    """Anything that stands in a text."""

    span: Span = field(default=NO_SPAN, compare=False, repr=False, kw_only=True)


class Type(Enum):
    """Type of an expression."""

    BOOL = "bool"
    INT = "int"
    DOUBLE = "double"


class ModelType(Enum):
    """Kind of model, as its keyword says."""

    DTMC = "dtmc"
    CTMC = "ctmc"
    MDP = "mdp"


# ------------------------------------------------------------------------------------------------ expressions


@dataclass(frozen=True, slots=True)
class Literal(Node):
    """A constant. The value of a double is the exact fraction that its digits write."""

    value: bool | int | Fraction
    type: Type


@dataclass(frozen=True, slots=True)
class Name(Node):
    """A variable, constant or formula, by name."""

    name: str


@dataclass(frozen=True, slots=True)
class Unary(Node):
    """`-x` or `!x`."""

    operator: Choice["-", "!"]
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary(Node):
    """`x op y`; op is one of + - * / ^ = != < <= > >= & | => <=> (`^` is power)."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Conditional(Node):
    """`condition ? then : otherwise`."""

    condition: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True, slots=True)
class Call(Node):
    """`min max floor ceil round pow mod log` applied to arguments (`func(min, x, y)` reads the same)."""

    function: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class LabelReference(Node):
    """`"name"`: a label, "init", "deadlock", or another property."""

    name: str


# ------------------------------------------------------------------------------------------------ state operators

Direction = Choice["min", "max", "minmax", "maxmin"]


@dataclass(frozen=True, slots=True)
class Bound(Node):
    """`>= 0.5`: a comparison (one of < <= > >=) with a threshold."""

    operator: str
    threshold: Expression


@dataclass(frozen=True, slots=True)
class ProbabilityOperator(Node):
    """`P bound [ path ]` or `P=? [ path ]` (bound None)."""

    direction: Direction | None
    bound: Bound | None
    path: PathFormula


@dataclass(frozen=True, slots=True)
class RewardOperator(Node):
    """`R{"name"} bound [ query ]`. `structure`: a name, an index expression (from 1), or None for the first."""

    structure: str | Expression | None
    direction: Direction | None
    bound: Bound | None
    query: RewardQuery


@dataclass(frozen=True, slots=True)
class SteadyState(Node):
    """`S bound [ formula ]` or `S=? [ formula ]`; of an MDP with a direction (`Smax=?`, or as Storm writes it `LRAmax=?`)."""

    bound: Bound | None
    formula: Expression
    direction: str | None = None


@dataclass(frozen=True, slots=True)
class PathQuantifier(Node):
    """CTL's `A [ path ]` and `E [ path ]`."""

    quantifier: Choice["A", "E"]
    path: PathFormula


@dataclass(frozen=True, slots=True)
class Filter(Node):
    """`filter(operator, formula, states)`; `states` None means true. Operators: min max sum avg count range
    forall exists first state argmin argmax print printall (and their symbols + & |, already spelled out).
    """

    operator: str
    formula: Expression
    states: Expression | None


@dataclass(frozen=True, slots=True)
class StateFilter(Node):
    """The older `P=? [ path {states}{min}{max} ]`: values of `formula` over `states`, first, min or max."""

    operators: tuple[Choice["min", "max"], ...]
    formula: Expression
    states: Expression


@dataclass(frozen=True, slots=True)
class MultiObjective(Node):
    """`multi(objective, …)` of an MDP."""

    objectives: tuple[Expression, ...]


# ------------------------------------------------------------------------------------------------ path formulas


@dataclass(frozen=True, slots=True)
class TimeBound(Node):
    """Steps or time: from `lower` (None: 0) to `upper` (None: no end). `=k` has both equal."""

    lower: Expression | None = None
    lower_strict: bool = False
    upper: Expression | None = None
    upper_strict: bool = False


@dataclass(frozen=True, slots=True)
class RewardBound(Node):
    """`^{rew{"name"}<=k}`: the reward gathered, from `lower` (None: 0) to `upper` (None: no end). structure None: steps."""

    structure: str | Expression | None
    lower: Expression | None = None
    lower_strict: bool = False
    upper: Expression | None = None
    upper_strict: bool = False


@dataclass(frozen=True, slots=True)
class RewardBounds(Node):
    """`^{rew{"a"}<=k, steps<=n, …}`: several bounds, all of which must be met."""

    parts: tuple[RewardBound, ...]


PathBound = TimeBound | RewardBound | RewardBounds


@dataclass(frozen=True, slots=True)
class Next(Node):
    """`X path`."""

    operand: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class Eventually(Node):
    """`F path`."""

    operand: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class Globally(Node):
    """`G path`."""

    operand: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class Until(Node):
    """`left U right`."""

    left: PathFormula
    right: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class WeakUntil(Node):
    """`left W right`: until, or left for ever."""

    left: PathFormula
    right: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class Release(Node):
    """`left R right`: not (not left U not right)."""

    left: PathFormula
    right: PathFormula
    bound: PathBound | None = None


# ------------------------------------------------------------------------------------------------ reward queries


@dataclass(frozen=True, slots=True)
class CumulativeReward(Node):
    """`C<=k`."""

    bound: TimeBound


@dataclass(frozen=True, slots=True)
class TotalReward(Node):
    """`C`."""


@dataclass(frozen=True, slots=True)
class InstantaneousReward(Node):
    """`I=k`."""

    time: Expression


@dataclass(frozen=True, slots=True)
class SteadyStateReward(Node):
    """`S`."""


Expression = (
    Literal
    | Name
    | Unary
    | Binary
    | Conditional
    | Call
    | LabelReference
    | ProbabilityOperator
    | RewardOperator
    | SteadyState
    | PathQuantifier
    | Filter
    | StateFilter
    | MultiObjective
)
PathFormula = Expression | Next | Eventually | Globally | Until | WeakUntil | Release
RewardQuery = CumulativeReward | TotalReward | InstantaneousReward | SteadyStateReward | PathFormula


# ------------------------------------------------------------------------------------------------ programs


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
class VariableDeclaration(Node):
    """`name : [low..high] init value;`; low and high None: unbounded int, or bool by `type`."""

    name: str
    type: Type
    low: Expression | None
    high: Expression | None
    initial: Expression | None


@dataclass(frozen=True, slots=True)
class Assignment(Node):
    """`(variable'=expression)`."""

    variable: str
    expression: Expression


@dataclass(frozen=True, slots=True)
class Update(Node):
    """`probability : assignments`; probability None is 1; no assignments is `true`."""

    probability: Expression | None
    assignments: tuple[Assignment, ...]


@dataclass(frozen=True, slots=True)
class Command(Node):
    """`[action] guard -> updates;`; action None for `[]`."""

    action: str | None
    guard: Expression
    updates: tuple[Update, ...]


@dataclass(frozen=True, slots=True)
class Module(Node):
    """`module name … endmodule`."""

    name: str
    variables: tuple[VariableDeclaration, ...]
    commands: tuple[Command, ...]


@dataclass(frozen=True, slots=True)
class RenamedModule(Node):
    """`module name = base [ old=new, … ] endmodule`."""

    name: str
    base: str
    renaming: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class RewardItem(Node):
    """`guard : value;` on states (action False), `[] guard : value;` (action None) or `[a] guard : value;`."""

    action: str | Choice[False] | None
    guard: Expression
    value: Expression


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

    def __repr__(self) -> str:
        """A line: the nodes fill pages (`symcheck.pretty` gives the text)."""
        kind = self.type.value if self.type is not None else "no type"
        return f"<Program: {kind}, {_counted(constants=self.constants, modules=self.modules, labels=self.labels, rewards=self.rewards)}>"


@dataclass(frozen=True, slots=True)
class Property(Node):
    """One property. `comments`: the comment lines directly above it, without their slashes (RESULT lines)."""

    name: str | None
    formula: Expression
    comments: tuple[str, ...] = field(default=(), compare=False)


@dataclass(frozen=True, slots=True)
class PropertiesFile(Node):
    """A whole properties text, in its order."""

    constants: tuple[Constant, ...] = ()
    formulas: tuple[Formula, ...] = ()
    labels: tuple[Label, ...] = ()
    properties: tuple[Property, ...] = ()

    def __repr__(self) -> str:
        """A line: the nodes fill pages (`symcheck.pretty` gives the text)."""
        return f"<PropertiesFile: {_counted(constants=self.constants, labels=self.labels, properties=self.properties)}>"


def _counted(**parts: tuple[Node, ...]) -> str:
    """How many there are of each, and their names: `constants N p (2), modules m (1)`."""
    found = []
    for kind, nodes in parts.items():
        names = [name for name in (getattr(n, "name", None) for n in nodes) if name]
        shown = " ".join([*names[:4], *(["…"] if len(names) > 4 else [])])
        found.append(f"{kind} {shown} ({len(nodes)})" if shown else f"{len(nodes)} {kind}")
    return ", ".join(found)
