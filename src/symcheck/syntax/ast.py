"""The abstract syntax of expressions and formulas: frozen values with spans that == ignores.

State formulas and arithmetic share one closed union, `Expression`, because PRISM mixes them freely
(`P=? [ F x=1 ] + 0.5`, `"safe" & x>2`). Path formulas use the temporal nodes and, between them,
the boolean `Unary`, `Binary` and `Conditional` nodes of state formulas. Declarations are in
`declarations.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from enum import Enum
from fractions import Fraction
from typing import ClassVar, NamedTuple, get_args
from typing import Literal as Choice

from symcheck.errors import NO_SPAN, Span
from symcheck.lazy_dataclass import dataclass
from symcheck.syntax.operators import Function, Operator, UnaryOperator

__all__ = [
    "LETTERS",
    "MEASURES",
    "MEASURE_WORDS",
    "PRIME",
    "TYPE_WORDS",
    "AnyMeasure",
    "Binary",
    "BinaryTemporal",
    "Bound",
    "Call",
    "Coalition",
    "Conditional",
    "ConditionalProbability",
    "CostBoundedReward",
    "CumulativeReward",
    "DiscountedReward",
    "EndedReward",
    "Equilibrium",
    "Eventually",
    "ExpectedTime",
    "Expression",
    "ExpressionNode",
    "Filter",
    "Globally",
    "InstantaneousReward",
    "LabelReference",
    "Limits",
    "Literal",
    "Measure",
    "ModelType",
    "MultiObjective",
    "Name",
    "Next",
    "Node",
    "Parameter",
    "PathBound",
    "PathFormula",
    "PathMeasure",
    "PathQuantifier",
    "ProbabilityOperator",
    "Quantile",
    "Release",
    "RewardBound",
    "RewardBounds",
    "RewardOperator",
    "RewardQuery",
    "RewardQueryNode",
    "StateFilter",
    "StateOperator",
    "SteadyState",
    "SteadyStateReward",
    "TimeBound",
    "TotalReward",
    "Type",
    "Unary",
    "UnaryTemporal",
    "Until",
    "WeakUntil",
    "Weights",
    "letters_of",
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


class _Class(NamedTuple):
    """A row of the table of model types; `players` is that of `ModelType`."""

    called: str
    continuous_time: bool = False
    players: int = 0
    concurrent: bool = False
    partially_observed: bool = False
    has_clocks: bool = False


_CLASSES = {
    "dtmc": _Class("discrete-time Markov chains"),
    "ctmc": _Class("continuous-time Markov chains", continuous_time=True),
    "mdp": _Class("Markov decision processes", players=1),
    "ma": _Class("Markov automata", continuous_time=True, players=1),
    "pta": _Class("probabilistic timed automata", players=1, has_clocks=True),
    "pomdp": _Class("partially observable decision processes", players=1, partially_observed=True),
    "popta": _Class(
        "partially observable timed automata", players=1, partially_observed=True, has_clocks=True
    ),
    "smg": _Class("stochastic games", players=2),
    "csg": _Class("concurrent stochastic games", players=2, concurrent=True),
    "tptg": _Class("timed games", players=2, has_clocks=True),
}


class ModelType(Enum):
    """Kind of model. Code asks for its properties; its name is for reading and printing.

    Attributes:
        called: its name in messages, in the plural.
        continuous_time: states may be left at rates; otherwise, time counts steps or is measured
            by clocks.
        players: 0: chance alone chooses; 1: a player chooses among the commands that a state
            enables; 2: several players do, each in some of the states, or all at once.
        concurrent: players choose at once.
        partially_observed: the player tells states apart by their observations alone.
        has_clocks: clocks measure time.
    """

    DTMC = "dtmc"
    CTMC = "ctmc"
    MDP = "mdp"
    MA = "ma"
    PTA = "pta"
    POMDP = "pomdp"
    POPTA = "popta"
    SMG = "smg"
    CSG = "csg"
    TPTG = "tptg"

    def __init__(self, keyword: str) -> None:
        row = _CLASSES[keyword]
        self.called = row.called
        self.continuous_time = row.continuous_time
        self.players = row.players
        self.concurrent = row.concurrent
        self.partially_observed = row.partially_observed
        self.has_clocks = row.has_clocks

    @property
    def one(self) -> str:
        """A model of this type in messages, such as 'an MDP'."""
        letters = self.value.upper()
        return f"{'an' if letters[0] in 'MS' else 'a'} {letters}"

    @property
    def has_choices(self) -> bool:
        """Whether a player chooses among the commands that a state enables; otherwise, chance does:
        in proportion to their rates, or uniformly in discrete time.
        """
        return self.players > 0

    @property
    def immediate_choices(self) -> bool:
        """Whether choices take no time, and time passes at rates where there is none to make."""
        return self.continuous_time and self.has_choices

    @property
    def has_probabilities(self) -> bool:
        """Whether the updates of some commands have probabilities, and not rates."""
        return self.has_choices or not self.continuous_time

    @property
    def chooses_uniformly(self) -> bool:
        """Whether chance chooses among enabled commands with equal probabilities."""
        return not (self.continuous_time or self.has_choices)

    @property
    def has_own_syntax(self) -> bool:
        """Whether its models have declarations or commands that others have not, so that the text
        of another type cannot be read as one of it.
        """
        special = self.immediate_choices or self.partially_observed or self.has_clocks
        return special or self.players > 1

    @staticmethod
    def with_properties(
        *,
        continuous_time: bool = False,
        has_choices: bool = False,
        several_players: bool = False,
        partially_observed: bool = False,
        has_clocks: bool = False,
    ) -> ModelType:
        """The type with these properties, where players do not choose at once.

        Raises LookupError if there is none.
        """
        who = 2 if several_players else int(has_choices)
        wanted = continuous_time, who, False, partially_observed, has_clocks
        for kind in ModelType:
            if _CLASSES[kind.value][1:] == wanted:
                return kind
        raise LookupError("no type of models has these properties")


_OTHER_WORDS = {
    "probabilistic": "dtmc",
    "stochastic": "ctmc",
    "nondeterministic": "mdp",
    "tsg": "smg",
}
TYPE_WORDS: Mapping[str, ModelType] = {kind.value: kind for kind in ModelType} | {
    word: ModelType(keyword) for word, keyword in _OTHER_WORDS.items()
}
"""The words that tell the type of a model in its text."""


class Weights(Enum):
    """Kind of the probabilities of a model."""

    NUMBERS = "numbers"
    INTERVALS = "intervals"
    PARAMETERS = "parameters"


WITHOUT_KEYWORD = ModelType.MDP
"""The type of a model whose text does not name one, as in PRISM."""


# -------------------------------------------------------------------------------------- expressions


class ExpressionNode(Node):
    """What has a value in a state: an expression, or an operator over states."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Literal(ExpressionNode):
    """A constant. The value of a double is the exact fraction that its digits write."""

    value: bool | int | Fraction
    type: Type


@dataclass(frozen=True, slots=True)
class Parameter(Literal):
    """The variable of a quantile where it stands as a bound: a number that is looked for."""

    name: str


PRIME = "'"
"""Ends the name of the value that a variable has after a step."""


@dataclass(frozen=True, slots=True)
class Name(ExpressionNode):
    """A variable, constant or formula, by name; `x'` is the value of x after the step."""

    name: str


@dataclass(frozen=True, slots=True)
class Unary(ExpressionNode):
    """`-x` or `!x`."""

    operator: UnaryOperator
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary(ExpressionNode):
    """`x op y`."""

    operator: Operator
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Conditional(ExpressionNode):
    """`condition ? then : otherwise`."""

    condition: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True, slots=True)
class Call(ExpressionNode):
    """A function applied to arguments (`func(min, x, y)` reads the same)."""

    function: Function
    arguments: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class LabelReference(ExpressionNode):
    """`"name"`: a label, "init", "deadlock", or another property."""

    name: str


# ---------------------------------------------------------------------------------- state operators


@dataclass(frozen=True, slots=True)
class Bound(Node):
    """`>= 0.5`: a comparison (one of < <= > >=) with a threshold."""

    operator: Operator
    threshold: Expression


@dataclass(frozen=True, slots=True)
class StateOperator(ExpressionNode):
    """An operator whose value at a state depends on the paths from it, or on other states.

    The defaults of the attributes are safe for any operator.

    reads_rewards: whether it may read the rewards of the model.
    """

    reads_rewards: ClassVar[bool] = True

    @property
    def is_bisimulation_invariant(self) -> bool:
        """Whether bisimilar states have the same value, so that reductions keep it."""
        return False


@dataclass(frozen=True, slots=True)
class Coalition:
    """`<<players>>`: they have a strategy. `[[players]]` (`against`): others have one against them.

    players: their names or numbers; None: all, `*`.
    """

    players: tuple[str, ...] | None
    against: bool
    span: Span = field(default=NO_SPAN, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Measure(StateOperator):
    """An operator that computes a value, or compares it with a bound; in an MDP with a direction.

    letter: how the operator is written. is_probability: whether its values are from 0 to 1.
    bound None: a query, `=?`. coalition: the players who choose in the direction; None: all.
    """

    letter: ClassVar[str]
    is_probability: ClassVar[bool] = False

    direction: str | None
    bound: Bound | None
    coalition: Coalition | None = field(default=None, kw_only=True)


@dataclass(frozen=True, slots=True)
class PathMeasure(Measure):
    """Base of the measures of one path formula: `letter bound [ path ]`."""

    path: PathFormula


@dataclass(frozen=True, slots=True)
class ProbabilityOperator(PathMeasure):
    """`P bound [ path ]` or `P=? [ path ]`."""

    letter = "P"
    is_probability = True
    is_bisimulation_invariant = True
    reads_rewards = False


@dataclass(frozen=True, slots=True)
class ConditionalProbability(Measure):
    """`P bound [ path || condition ]`: the probability of a path formula given another one."""

    letter = "P"
    is_probability = True
    is_bisimulation_invariant = True
    reads_rewards = False

    path: PathFormula
    condition: PathFormula


@dataclass(frozen=True, slots=True)
class ExpectedTime(PathMeasure):
    """`T bound [ path ]` or `T=? [ path ]`: the expected time until a path satisfies it.

    Time of a CTMC; a step of a DTMC or MDP takes one.
    """

    letter = "T"
    is_bisimulation_invariant = True
    reads_rewards = False


@dataclass(frozen=True, slots=True)
class RewardOperator(Measure):
    """`R{"name"} bound [ query ]`.

    `structure` is a name, an index from 1 as an expression, or None for the first structure.
    """

    letter = "R"
    is_bisimulation_invariant = True

    structure: str | Expression | None
    query: RewardQuery


@dataclass(frozen=True, slots=True)
class SteadyState(Measure):
    """`S bound [ formula ]` or `S=? [ formula ]` (bound None).

    An MDP needs a direction: `Smax=?`, or `LRAmax=?` as Storm writes it.
    """

    letter = "S"
    is_probability = True
    is_bisimulation_invariant = True
    reads_rewards = False

    formula: Expression


@dataclass(frozen=True, slots=True)
class PathQuantifier(StateOperator):
    """CTL's `A [ path ]` and `E [ path ]`."""

    is_bisimulation_invariant = True
    reads_rewards = False

    quantifier: Choice["A", "E"]
    path: PathFormula


FilterOperator = Choice[
    "min", "max", "sum", "avg", "count", "range", "forall", "exists", "first", "state",
    "argmin", "argmax", "print", "printall",
]  # fmt: skip
"""The operators of filters; the signs + & | are spelled out as sum, forall and exists."""


@dataclass(frozen=True, slots=True)
class Filter(StateOperator):
    """`filter(operator, formula, states)`; `states` None means all states."""

    reads_rewards = False

    operator: FilterOperator
    formula: Expression
    states: Expression | None

    @property
    def is_bisimulation_invariant(self) -> bool:
        """Whether it does not count states or name one."""
        return self.operator in ("min", "max", "range", "forall", "exists")


@dataclass(frozen=True, slots=True)
class Quantile(StateOperator):
    """`quantile(min B, formula)`: the least (greatest) integer B for which a formula holds.

    The formula has a `Parameter` wherever B stands.
    """

    is_bisimulation_invariant = True
    reads_rewards = False

    optimum: Choice["min", "max"]
    variable: str
    formula: Expression


@dataclass(frozen=True, slots=True)
class StateFilter(StateOperator):
    """The older `P=? [ path {states}{min}{max} ]`: the first, least or largest value there."""

    reads_rewards = False

    operators: tuple[Choice["min", "max"], ...]
    formula: Expression
    states: Expression

    @property
    def is_bisimulation_invariant(self) -> bool:
        """Whether it does not name a state."""
        return self.operators != ()


@dataclass(frozen=True, slots=True)
class MultiObjective(StateOperator):
    """`multi(objective, …)` of an MDP.

    lexicographic: `multilex(…)`, where each objective matters more than all that follow.
    """

    is_bisimulation_invariant = True
    reads_rewards = False

    objectives: tuple[Expression, ...]
    lexicographic: bool = False


@dataclass(frozen=True, slots=True)
class Equilibrium(StateOperator):
    """`<<one:two>>max=? (P [ … ] + R [ … ])`: what coalitions gain together in an equilibrium.

    objectives: what each coalition optimises, all in the same direction. bound None: a query, `=?`.
    correlated: `{corr}`, where a signal tells all what to do. fair: `{fair}`, of all equilibria one
    with the least difference of gains; otherwise one with the greatest sum.
    """

    objectives: tuple[ProbabilityOperator | RewardOperator, ...]
    bound: Bound | None
    correlated: bool = False
    fair: bool = False

    @property
    def coalitions(self) -> tuple[Coalition, ...]:
        """Whose objectives they are, in their order."""
        return tuple(o.coalition for o in self.objectives if o.coalition is not None)


# ------------------------------------------------------------------------------------ path formulas


@dataclass(frozen=True, slots=True)
class Limits(Node):
    """Base of the bounds from `lower` (None: 0) to `upper` (None: no end)."""

    lower: Expression | None = None
    lower_strict: bool = False
    upper: Expression | None = None
    upper_strict: bool = False


@dataclass(frozen=True, slots=True)
class TimeBound(Limits):
    """Steps or time. `=k` has both limits equal."""


@dataclass(frozen=True, slots=True)
class RewardBound(Limits):
    """`^{rew{"name"}<=k}`: the accumulated reward.

    `structure` is as in `RewardOperator`, except that None counts steps.
    """

    structure: str | Expression | None = None


@dataclass(frozen=True, slots=True)
class RewardBounds(Node):
    """`^{rew{"a"}<=k, steps<=n, …}`: several bounds, all of which must be met."""

    parts: tuple[RewardBound, ...]


PathBound = TimeBound | RewardBound | RewardBounds


@dataclass(frozen=True, slots=True)
class UnaryTemporal(Node):
    """Base of the temporal operators before one path formula: `symbol bound operand`."""

    symbol: ClassVar[str]

    operand: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class Next(UnaryTemporal):
    """`X path`."""

    symbol = "X"


@dataclass(frozen=True, slots=True)
class Eventually(UnaryTemporal):
    """`F path`."""

    symbol = "F"


@dataclass(frozen=True, slots=True)
class Globally(UnaryTemporal):
    """`G path`."""

    symbol = "G"


@dataclass(frozen=True, slots=True)
class BinaryTemporal(Node):
    """Base of the temporal operators between two path formulas: `left symbol bound right`."""

    symbol: ClassVar[str]

    left: PathFormula
    right: PathFormula
    bound: PathBound | None = None


@dataclass(frozen=True, slots=True)
class Until(BinaryTemporal):
    """`left U right`."""

    symbol = "U"


@dataclass(frozen=True, slots=True)
class WeakUntil(BinaryTemporal):
    """`left W right`: until, or left for ever."""

    symbol = "W"


@dataclass(frozen=True, slots=True)
class Release(BinaryTemporal):
    """`left R right`: not (not left U not right)."""

    symbol = "R"


# ----------------------------------------------------------------------------------- reward queries


class RewardQueryNode(Node):
    """Base of what `R [ … ]` asks for, other than the reward until a path satisfies a formula."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class CumulativeReward(RewardQueryNode):
    """`C<=k`."""

    bound: TimeBound


@dataclass(frozen=True, slots=True)
class CostBoundedReward(RewardQueryNode):
    """`C{"c"}<=k`: the reward of the steps whose accumulated cost is at most k."""

    bound: RewardBound | RewardBounds


@dataclass(frozen=True, slots=True)
class TotalReward(RewardQueryNode):
    """`C`."""


@dataclass(frozen=True, slots=True)
class DiscountedReward(RewardQueryNode):
    """`C discount=g`, `C<=k discount=g`: the reward of step i counts g^i times, from i = 0."""

    bound: TimeBound | None
    discount: Expression


@dataclass(frozen=True, slots=True)
class EndedReward(RewardQueryNode):
    """`Fc target` (`kept`) and `F0 target`: runs that miss the target keep their reward or not."""

    kept: bool
    target: Expression


@dataclass(frozen=True, slots=True)
class InstantaneousReward(RewardQueryNode):
    """`I=k`."""

    time: Expression


@dataclass(frozen=True, slots=True)
class SteadyStateReward(RewardQueryNode):
    """`S`."""


AnyMeasure = (
    ProbabilityOperator | ConditionalProbability | ExpectedTime | RewardOperator | SteadyState
)
MEASURES: tuple[type[Measure], ...] = get_args(AnyMeasure)
LETTERS = tuple(sorted({kind.letter for kind in MEASURES}))
MEASURE_WORDS = frozenset(letter + suffix for letter in LETTERS for suffix in ("", "min", "max"))
"""The beginnings of measures as a text writes them: P, Pmin, Pmax, R, …"""


def letters_of(measures: object, conjunction: str = "and") -> str:
    """The letters of a union of measures in a sentence, such as "P, R, S and T"."""
    *others, last = sorted({kind.letter for kind in get_args(measures)})
    return f"{', '.join(others)} {conjunction} {last}"


Expression = (
    Literal
    | Parameter
    | Name
    | Unary
    | Binary
    | Conditional
    | Call
    | LabelReference
    | AnyMeasure
    | PathQuantifier
    | Filter
    | StateFilter
    | Quantile
    | MultiObjective
    | Equilibrium
)
PathFormula = Expression | Next | Eventually | Globally | Until | WeakUntil | Release
RewardQuery = (
    CumulativeReward
    | CostBoundedReward
    | TotalReward
    | DiscountedReward
    | EndedReward
    | InstantaneousReward
    | SteadyStateReward
    | PathFormula
)
