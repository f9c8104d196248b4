"""The protocols of an engine: sets of states, values, graph questions and numerical systems.

Measures use these protocols only; an engine is a folder beside this file. A set contains reachable
states only: `~s` is the complement within the reachable states.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf, nextafter
from typing import Any, Protocol, TypeVar

from symcheck.direction import Direction
from symcheck.matrices.numbers import Numbers
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import ROUNDING, Settings
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import Expression, Type

__all__ = [
    "ROUNDING",
    "CapabilityT",
    "Engine",
    "Equations",
    "Graph",
    "OwnSet",
    "OwnValues",
    "SolvedValues",
    "StateSet",
    "System",
    "Values",
    "bracket",
]


def bracket(threshold: float | Fraction) -> tuple[float, float]:
    """The largest double not above the threshold and the smallest not below it (equal where it is a
    double).

    With them `value >= threshold` is exactly `value >= upper`, and `value <= threshold` is `value
    <= lower`, for doubles.
    """
    near = float(threshold)
    if isinstance(threshold, float) or near in (inf, -inf) or near == threshold:
        return near, near
    return (near, nextafter(near, inf)) if near < threshold else (nextafter(near, -inf), near)


CapabilityT = TypeVar("CapabilityT")

OwnSet = Any
"""A set of the same engine: sets of different engines are never mixed."""
OwnValues = Any
"""Values of the same engine."""


class StateSet(Protocol):
    """An immutable set of reachable states. `bool(s)` is 'not empty'; `len` may overflow: use
    `count`.
    """

    @property
    def count(self) -> int:
        """Number of states in the set."""
        ...

    def __and__(self, other: Any, /) -> StateSet: ...
    def __or__(self, other: Any, /) -> StateSet: ...
    def __sub__(self, other: Any, /) -> StateSet: ...
    def __invert__(self) -> StateSet: ...
    def __bool__(self) -> bool: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __le__(self, other: Any, /) -> bool: ...


class Values(Protocol):
    """A number per reachable state, known to lie between a lower and an upper value.

    `exact` is True where lower and upper are equal and differ from the truth by rounding only.
    Constants that `lift` was given, and values of expressions, are taken as they are; what was
    computed in floating point is within ROUNDING.
    """

    @property
    def exact(self) -> bool:
        """Whether lower and upper are equal everywhere."""
        ...

    def rounded(self, states: OwnSet) -> bool:
        """Whether some value over the set was computed in floating point.

        Equal bounds of such a value are exact up to rounding only.
        """
        ...

    def at(self, states: OwnSet) -> tuple[Any, Any]:
        """Lower and upper values over the states of a set, in index order (use small sets only)."""
        ...

    def minimum(self, states: OwnSet) -> tuple[Any, Any]:
        """Lower and upper bound of the least value over a set that is not empty."""
        ...

    def maximum(self, states: OwnSet) -> tuple[Any, Any]:
        """Lower and upper bound of the largest value over a set that is not empty."""
        ...

    def total(self, states: OwnSet) -> tuple[Any, Any]:
        """Lower and upper bound of the sum of the values over a set."""
        ...

    def compare(self, operator: str, threshold: float | Fraction) -> tuple[StateSet, StateSet]:
        """The states that surely satisfy `value operator threshold`, and those where it is
        undecided.

        Operators: < <= > >= = !=. A computed value that is exact up to rounding is undecided within
        ROUNDING (relative) of the threshold, so that rounding never decides.
        """
        ...

    def map(self, operator: str, *others: OwnValues | float) -> Values:
        """Interval arithmetic with an operator or function of the expression language.

        '-' without other operands negates.
        """
        ...

    def choose(self, states: OwnSet, other: OwnValues) -> Values:
        """These values on `states`, the other ones elsewhere."""
        ...


class System(Protocol):
    """The equations over some states: n unknowns, numbered as the states of `states` in index
    order.

    Rows are the choices of these states (one per state in a DTMC or CTMC). `matrix` holds the
    one-step probabilities (rates in a CTMC) among the states; what leaves them is missing from it.
    Numbers are float64, or rationals in the exact engine.
    """

    @property
    def states(self) -> StateSet:
        """The states that are unknowns."""
        ...

    @property
    def n(self) -> int:
        """Number of unknowns."""
        ...

    @property
    def groups(self) -> Int64s | None:
        """Rows of each state, int64[n+1] (see SparseMatrix); None where each state has one row."""
        ...

    @property
    def matrix(self) -> SparseMatrix:
        """The matrix as compressed rows, made on first use."""
        ...

    @property
    def has_rows(self) -> bool:
        """Whether equations should be solved on `matrix`: the engine works with rows, or these are
        few.
        """
        ...

    @property
    def operator(self) -> Any:
        """The matrix in the engine's own form, with `multiply(x: Numbers) -> Numbers` giving a
        value per row.
        """
        ...

    def one_step_probability(self, target: OwnSet) -> Numbers:
        """Per row: the one-step probability (rate) of entering `target` (states outside of `states`
        too).
        """
        ...

    def one_step_values(self, values: OwnValues) -> tuple[Numbers, Numbers]:
        """Per row: sum over the successors outside of `states` of probability (rate) × value
        (lower, upper).
        """
        ...

    def row_sums(self) -> Numbers:
        """Per row: the total probability (exit rate), successors outside of `states` included."""
        ...

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards per state [n], and transition rewards per row.

        The latter is the probability-(rate-)weighted sum over the row's transitions.
        """
        ...

    def embedded(self, rows: Numbers) -> Numbers:
        """Rates per row of a CTMC as probabilities of its embedded DTMC; of other models, the
        values themselves.
        """
        ...

    def step_rewards(self, reward: Reward) -> Numbers:
        """Per row: the expected reward of a step (in a CTMC, with the state reward of its stay)."""
        ...

    def reachability(self, target: OwnSet) -> Equations:
        """The equations of the probability of reaching `target`, a set outside of the states."""
        ...

    def expected_reward(self, reward: Reward, infinite: OwnSet) -> Equations:
        """The equations of the expected reward until the states are left; it is infinite on
        `infinite`.
        """
        ...

    def equations(
        self,
        constant: Numbers,
        upper: Numbers | None = None,
        *,
        probability: bool,
        allow_stay: bool = False,
    ) -> Equations:
        """The equations x = A x + constant (bounds: up to `upper`); rates are divided by exit
        rates.

        `allow_stay`: a strategy may stay for ever where that costs and earns nothing, with value 0
        (greatest rewards); or it must not (least probabilities of what is met outside).
        """
        ...

    def restrict(self, values: OwnValues | OwnSet) -> Numbers:
        """A value (or 0/1 membership) per state of `states`."""
        ...

    def full(self, value: float) -> Numbers:
        """The same number for each state of `states`."""
        ...

    def lift(
        self,
        lower: Numbers,
        upper: Numbers | None,
        rest: Sequence[tuple[OwnSet, float]] = (),
        exact: bool = False,
    ) -> Values:
        """Values on all reachable states.

        Args:
            lower: values on `states`.
            upper: their upper bounds; None if equal to `lower`.
            rest: constants on other sets, 0 elsewhere.
            exact: whether the values carry rounding errors only.
        """
        ...


@dataclass(frozen=True, slots=True)
class SolvedValues:
    """The solution of equations, and how it was found.

    width: the greatest distance of certified bounds, relative or absolute as the settings say.
    """

    values: Values
    method: str
    unknowns: int
    iterations: int
    explanation: str = ""
    certified: bool = True
    width: float = 0.0


class Equations(Protocol):
    """Equations over the states of a system, ready to be solved."""

    @property
    def n(self) -> int:
        """Number of unknowns."""
        ...

    def problem(self) -> LinearProblem:
        """The equations among the unknowns for a numerical method, without preprocessing."""
        ...

    def solve(
        self,
        known: Sequence[tuple[OwnSet, float]],
        settings: Settings,
        observer: Observer | None = None,
    ) -> SolvedValues:
        """The solution on all states; `known`: constants on other sets, 0 elsewhere."""
        ...


class Graph(Protocol):
    """Questions that need no numbers. `direction` is None in a DTMC or CTMC, 'min' or 'max' in an
    MDP.
    """

    def predecessors(self, states: OwnSet) -> StateSet:
        """States with some transition (of some choice) into `states`."""
        ...

    def all_successors_in(self, states: OwnSet) -> StateSet:
        """States all of whose transitions (of all choices) lead into `states`."""
        ...

    def exists_until(self, left: OwnSet, right: OwnSet) -> StateSet:
        """E [ left U right ]."""
        ...

    def exists_globally(self, states: OwnSet) -> StateSet:
        """E [ G states ]."""
        ...

    def prob0(self, left: OwnSet, right: OwnSet, direction: Direction | None) -> StateSet:
        """States whose (min/max) probability of left U right is 0."""
        ...

    def prob1(self, left: OwnSet, right: OwnSet, direction: Direction | None) -> StateSet:
        """States whose (min/max) probability of left U right is 1."""
        ...

    def bsccs(self) -> Iterator[StateSet]:
        """Bottom strongly connected components (DTMC, CTMC)."""
        ...

    def end_components(self, within: OwnSet) -> Iterator[StateSet]:
        """Maximal end components of the states `within` (MDP)."""
        ...

    def accepting_end_components(
        self, pairs: Sequence[tuple[OwnSet, Sequence[OwnSet]]]
    ) -> StateSet:
        """States in an accepting end component.

        Args:
            pairs: (avoid, visits); an end component is accepting if, for some pair, it avoids
                `avoid` and meets every set in `visits`.
        """
        ...

    def witness(self, left: OwnSet, right: OwnSet) -> Sequence[Mapping[str, int | bool]] | None:
        """A shortest path from an initial state that satisfies left U right, as states; None if
        there is none.
        """
        ...


class Engine(Protocol):
    """A built model in one representation."""

    @property
    def name(self) -> str:
        """Short name, as switches and results say it."""
        ...

    @property
    def exact(self) -> bool:
        """Whether the numbers are rationals (arrays of Fraction objects) instead of doubles."""
        ...

    @property
    def has_rows(self) -> bool:
        """Whether the engine works with `System.matrix`.

        If not, the matrix is built only where `System.operator` does not suffice.
        """
        ...

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        ...

    @property
    def all(self) -> StateSet:
        """Every reachable state."""
        ...

    @property
    def none(self) -> StateSet:
        """The empty set."""
        ...

    @property
    def initial(self) -> StateSet:
        """The initial states."""
        ...

    @property
    def deadlocks(self) -> StateSet:
        """States without a transition, before they were given a self-loop."""
        ...

    @property
    def graph(self) -> Graph:
        """Questions that need no numbers."""
        ...

    @property
    def states(self) -> int:
        """Number of reachable states."""
        ...

    @property
    def transitions(self) -> int:
        """Number of transitions."""
        ...

    @property
    def choices(self) -> int:
        """Number of choices (of states, where each has one)."""
        ...

    def where(self, expression: Expression) -> StateSet:
        """The states that satisfy a boolean expression over the variables."""
        ...

    def values(self, expression: Expression, type: Type) -> Values:
        """The value of a numeric expression over the variables, at each state."""
        ...

    def constant(
        self, lower: float, upper: float | None = None, *, rounded: bool = False
    ) -> Values:
        """The same value (or bounds of it) everywhere; `rounded`: it came out of floating-point
        arithmetic.
        """
        ...

    def indicator(self, states: OwnSet) -> Values:
        """1 on the set and 0 elsewhere."""
        ...

    def from_bools(self, members: Bools) -> StateSet:
        """The set of the states (bool[states], in index order) that are True."""
        ...

    def to_bools(self, states: OwnSet) -> Bools:
        """Membership of each reachable state, bool[states] in index order."""
        ...

    def system(self, states: OwnSet, direction: Direction | None = None) -> System:
        """The equations over some states; `direction`: of the strategies of an MDP."""
        ...

    def finite_reward(
        self, reward: Reward, target: OwnSet, direction: Direction | None
    ) -> StateSet:
        """States from which the expected reward until `target` is finite.

        These reach `target` almost surely ('max': under all strategies, 'min': under some), and
        meet no step with an infinite reward before. Raises UnsupportedError for least rewards where
        some reward of a step is infinite.
        """
        ...

    def capability(self, kind: type[CapabilityT]) -> CapabilityT | None:
        """The engine as a `symcheck.engines.capabilities` protocol; None where it does not offer
        that.
        """
        ...

    def first(self, states: OwnSet) -> StateSet:
        """The singleton of the state with the lowest index; `states` must not be empty."""
        ...

    def valuations(
        self, states: OwnSet, limit: int | None = None
    ) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order (lexicographic in declaration order)."""
        ...

    def product(self, letters: Sequence[OwnSet], automaton: Any) -> Any:
        """The product with a deterministic automaton that reads, in each state, which of `letters`
        hold.

        Returns a Product: an engine over pairs, and the means to go between the two (see
        engines/product.py).
        """
        ...
