"""The protocols of an engine: sets of states, values, graph questions and numerical systems.

Measures use these protocols only; an engine is a folder beside this file. A set contains reachable
states only: `~s` is the complement within the reachable states.

Each protocol is generic in the type S of the engine's sets and the type V of its values, so that
the code of an engine names its own types. Code for all engines uses the aliases at the end of this
file (`Engine`, `System`, ...), where S is any `StateSet` and V any `Values`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import inf, nextafter
from typing import Generic, Protocol, Self, TypeVar, cast

from symcheck.direction import Direction
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, Rationals
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Bools, Int32s, Int64s, SparseMatrix
from symcheck.matrices.transition_kernel import TransitionKernel
from symcheck.numerics.linear.problem import LinearProblem, Observer
from symcheck.numerics.settings import ROUNDING, Settings
from symcheck.semantics.expressions.literals import to_float
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward
from symcheck.syntax.ast import Expression, Type
from symcheck.syntax.operators import Operation

__all__ = [
    "ROUNDING",
    "Automaton",
    "CapabilityT",
    "Engine",
    "EngineOf",
    "Equations",
    "EquationsOf",
    "Graph",
    "GraphOf",
    "Number",
    "Product",
    "ProductOf",
    "S",
    "SolvedValues",
    "StateSet",
    "System",
    "SystemOf",
    "V",
    "Values",
    "ValuesOf",
    "bracket",
    "erased",
    "require_expression",
]


def bracket(number: float | Fraction) -> tuple[float, float]:
    """The largest double not above a number and the smallest not below it (equal where it is a
    double).

    With those of a threshold, `value >= threshold` is exactly `value >= upper`, and `value <=
    threshold` is `value <= lower`, for doubles.
    """
    near = to_float(number)
    if isinstance(number, float) or near == number:
        return near, near
    return (near, nextafter(near, inf)) if near < number else (nextafter(near, -inf), near)


def require_expression(expression: Expression) -> None:
    """Raise TypeError for a text in place of a bound expression."""
    if isinstance(expression, str):
        raise TypeError(f"an engine takes a bound expression; model.where({expression!r}) a text")


CapabilityT = TypeVar("CapabilityT")

S = TypeVar("S", bound="StateSet")
"""The sets of an engine."""
V = TypeVar("V")
"""The values of an engine: ValuesOf[S]."""
V_co = TypeVar("V_co", covariant=True)
S_contra = TypeVar("S_contra", bound="StateSet", contravariant=True)

Number = float | Fraction
"""A number of an engine: a double, or a rational (infinities and NaN are floats) if it is exact."""


class StateSet(Protocol):
    """An immutable set of reachable states. `bool(s)` is 'not empty'; `len` may overflow: use
    `count`.
    """

    @property
    def count(self) -> int:
        """Number of states in the set."""
        ...

    def __and__(self, other: Self, /) -> Self: ...
    def __or__(self, other: Self, /) -> Self: ...
    def __sub__(self, other: Self, /) -> Self: ...
    def __invert__(self) -> Self: ...
    def __bool__(self) -> bool: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __le__(self, other: Self, /) -> bool: ...


class ValuesOf(Protocol[S]):
    """A number per reachable state, known to lie between a lower and an upper value.

    Constants that `lift` was given, and values of expressions, are taken as they are.
    """

    @property
    def is_point(self) -> bool:
        """Whether lower and upper are equal everywhere."""
        ...

    def rounded(self, states: S) -> bool:
        """Whether some value over the set was rounded, and all bounds differ by that alone."""
        ...

    def at(self, states: S) -> tuple[Numbers, Numbers]:
        """Lower and upper values over the states of a set, in index order (use small sets only)."""
        ...

    def minimum(self, states: S) -> tuple[Number, Number]:
        """Lower and upper bound of the least value over a set that is not empty."""
        ...

    def maximum(self, states: S) -> tuple[Number, Number]:
        """Lower and upper bound of the largest value over a set that is not empty."""
        ...

    def total(self, states: S) -> tuple[Number, Number]:
        """Lower and upper bound of the sum of the values over a set."""
        ...

    def compare(self, operator: str, threshold: float | Fraction) -> tuple[S, S]:
        """The states that surely satisfy `value operator threshold`, and those where it is
        undecided.

        Operators: < <= > >= = !=.
        """
        ...

    def map(self, operation: Operation, *others: Self | float) -> Self:
        """Interval arithmetic with an operator or function of the expression language."""
        ...

    def choose(self, states: S, other: Self) -> Self:
        """These values on `states`, the other ones elsewhere."""
        ...


class SystemOf(Protocol[S, V]):
    """The equations over some states: n unknowns, numbered as the states of `states` in index
    order.

    Rows are the choices of these states (one per state in a DTMC or CTMC). `kernel` holds the
    one-step probabilities among the states, and where time is continuous the rates at which they
    are left; what leads out of the states is missing from it. Numbers are float64, or rationals in
    the exact engine.
    """

    states: S
    """The states that are unknowns."""

    @property
    def n(self) -> int:
        """Number of unknowns."""
        ...

    @property
    def groups(self) -> Int64s | None:
        """Rows of each state, int64[n+1] (see SparseMatrix); None where each state has one row."""
        ...

    @property
    def opponents(self) -> Bools | None:
        """The states in which opponents choose against a direction, bool[n]; None: no game."""
        ...

    @property
    def rows(self) -> int:
        """Number of rows."""
        ...

    @property
    def kernel(self) -> TransitionKernel[SparseMatrix | SweepOperator]:
        """The transitions in the engine's own form."""
        ...

    @property
    def row_kernel(self) -> TransitionKernel[SparseMatrix]:
        """The transitions as compressed rows, made on first use."""
        ...

    @property
    def weights(self) -> SparseMatrix:
        """The weights of `row_kernel`, for what asks for the graph or the numbers of the text."""
        ...

    @property
    def exit_rates(self) -> Numbers | None:
        """Per row: the rate at which the state is left, 0 for a choice that takes no time; None in
        discrete time.
        """
        ...

    @property
    def matrix(self) -> SparseMatrix:
        """The probabilities as compressed rows."""
        ...

    @property
    def has_rows(self) -> bool:
        """Whether equations should be solved on `matrix`: the engine works with rows, or these are
        few.
        """
        ...

    @property
    def operator(self) -> SparseMatrix | SweepOperator:
        """The probabilities in the engine's own form, with `multiply(x: Numbers) -> Numbers` giving
        a value per row.
        """
        ...

    def one_step_probability(self, target: S) -> Numbers:
        """Per row: the probability of entering `target` by a step (outside of `states` too)."""
        ...

    def one_step_values(self, values: V) -> tuple[Numbers, Numbers]:
        """Per row: sum over the successors outside of `states` of probability × value (lower,
        upper).
        """
        ...

    def rewards(self, reward: Reward) -> tuple[Numbers, Numbers]:
        """State rewards per state [n], and transition rewards per row.

        The latter is the probability-weighted sum over the row's transitions. In continuous time,
        both are per unit of time: the sum is multiplied by the exit rate.
        """
        ...

    def state_rewards(self, reward: Reward) -> Numbers:
        """The state reward per state; accurate also where items of opposite signs cancel."""
        ...

    def earned(self, reward: Reward) -> Numbers:
        """Per row, the sum of the state reward and the transition rewards, accurate also where they
        cancel. In a CTMC, the reward per unit of time.
        """
        ...

    @property
    def entry_error(self) -> float:
        """That of the engine."""
        ...

    @property
    def error(self) -> float:
        """A bound on the relative error of one-step probabilities, and of their sums in a row."""
        ...

    def state_reward_error(self, reward: Reward) -> float:
        """A bound on the relative error of state rewards that do not cancel."""
        ...

    def earned_error(self, reward: Reward) -> float:
        """A bound on the relative error of `earned`, where it does not cancel."""
        ...

    def reward_error(self, reward: Reward) -> float:
        """A bound on the relative error of `step_rewards`, where they do not cancel."""
        ...

    def step_rewards(self, reward: Reward) -> Numbers:
        """Per row: the expected reward of a step (in continuous time, with the state reward of its
        stay).
        """
        ...

    def step_reward_errors(self, reward: Reward) -> Numbers:
        """Per row: a bound on the rounding error of `step_rewards`, of an engine with doubles."""
        ...

    def reachability(self, target: S) -> EquationsOf[S, V]:
        """The equations of the probability of reaching `target`, a set outside of the states."""
        ...

    def expected_reward(self, reward: Reward, infinite: S) -> EquationsOf[S, V]:
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
        infinite: S | None = None,
        constant_error: float = 0.0,
    ) -> EquationsOf[S, V]:
        """The equations x = A x + constant (bounds: up to `upper`), with the probabilities A.

        `constant_error`: the relative error of constants, beyond that of probabilities.
        `allow_stay`: a strategy may stay for ever where that costs and earns nothing, with value 0
        (greatest rewards); or it must not (least probabilities of what is met outside).
        `infinite`: other states, whose value is infinite; choices that may lead there never
        minimise, and where others may, the value is no unknown.
        """
        ...

    def restrict(self, values: V | S) -> Numbers:
        """A value (or 0/1 membership) per state of `states`."""
        ...

    def full(self, value: Number) -> Numbers:
        """The same number for each state of `states`."""
        ...

    def lift(
        self,
        lower: Numbers,
        upper: Numbers | None,
        rest: Sequence[tuple[S, float]] = (),
        up_to_rounding: bool = False,
    ) -> V:
        """Values on all reachable states.

        Args:
            lower: values on `states`.
            upper: their upper bounds; None if equal to `lower`.
            rest: constants on other sets, 0 elsewhere.
            up_to_rounding: whether the bounds differ by rounding only; without `upper`, the values
                are within ROUNDING of the true ones.
        """
        ...


@dataclass(frozen=True, slots=True)
class SolvedValues(Generic[V_co]):
    """The solution of equations, and how it was found.

    width: the greatest distance of certified bounds, relative or absolute as the settings say.
    choices: the choice of each unknown, numbered within its state, int64[n], that together attain
        the lower bounds of a maximum, the upper ones of a minimum (-1: any choice does); None in a
        chain, and unless the settings ask for a strategy.
    """

    values: V_co
    method: str
    unknowns: int
    iterations: int
    explanation: str = ""
    certified: bool = True
    width: float = 0.0
    choices: Int64s | None = None


class EquationsOf(Protocol[S, V_co]):
    """Equations over the states of a system, ready to be solved."""

    @property
    def states(self) -> S:
        """The states that are unknowns."""
        ...

    @property
    def n(self) -> int:
        """Number of unknowns."""
        ...

    @property
    def usable_rows(self) -> Bools | None:
        """Rows that can be optimal, bool[rows]; None: all."""
        ...

    def problem(self) -> LinearProblem:
        """The equations among the usable rows for a numerical method, without preprocessing."""
        ...

    def solve(
        self,
        known: Sequence[tuple[S, float]],
        settings: Settings,
        observer: Observer | None = None,
    ) -> SolvedValues[V_co]:
        """The solution on all states; `known`: finite constants on other sets, 0 elsewhere."""
        ...


class GraphOf(Protocol[S]):
    """Questions that need no numbers. `direction` is None in a DTMC or CTMC, 'min' or 'max' in an
    MDP.
    """

    def predecessors(self, states: S) -> S:
        """States with some transition (of some choice) into `states`."""
        ...

    def all_successors_in(self, states: S) -> S:
        """States all of whose transitions (of all choices) lead into `states`."""
        ...

    def exists_until(self, left: S, right: S) -> S:
        """E [ left U right ]."""
        ...

    def exists_globally(self, states: S) -> S:
        """E [ G states ]."""
        ...

    def prob0(self, left: S, right: S, direction: Direction | None) -> S:
        """States whose (min/max) probability of left U right is 0."""
        ...

    def prob1(self, left: S, right: S, direction: Direction | None) -> S:
        """States whose (min/max) probability of left U right is 1."""
        ...

    def bsccs(self) -> Iterator[S]:
        """Bottom strongly connected components (DTMC, CTMC)."""
        ...

    def end_components(self, within: S) -> Iterator[S]:
        """Maximal end components of the states `within` (MDP)."""
        ...

    def accepting_end_components(self, pairs: Sequence[tuple[S, Sequence[S]]]) -> S:
        """States in an accepting end component.

        There may also be states from which such a component is reached almost surely by choices
        that avoid what it avoids: the probability of reaching the set is the same.

        Args:
            pairs: (avoid, visits); an end component is accepting if, for some pair, it avoids
                `avoid` and meets every set in `visits`.
        """
        ...

    def witness(self, left: S, right: S) -> Sequence[Mapping[str, int | bool]] | None:
        """A shortest path from an initial state that satisfies left U right, as states; None if
        there is none.
        """
        ...


class Automaton(Protocol):
    """A deterministic automaton: numbered states and a table of successors.

    A letter is a number whose bit i says whether letter set number i holds.
    """

    @property
    def initial(self) -> int:
        """The state in which every run begins."""
        ...

    @property
    def table(self) -> Int32s:
        """int32[states, 2**letters]: the successor of a state under a letter."""
        ...


class ProductOf(Protocol[S, V]):
    """The product with an automaton: an engine over pairs, and the projection to the model.

    `engine` is over the pairs that are reachable from (s, q0) for every state s of the base
    model.

    The automaton reads the letter of the state that is left: from (s, q) with q' = delta(q,
    letter(s)) each transition s -> s' becomes (s, q) -> (s', q'). So a run's automaton states are
    shifted by one step and nothing else changes.
    """

    @property
    def engine(self) -> EngineOf[S, V]:
        """The engine over the pairs."""
        ...

    def lift(self, states: S) -> S:
        """The pairs whose first part is in `states` (a set of the base engine)."""
        ...

    def automaton_states(self, states: frozenset[int]) -> S:
        """The pairs whose second part is in `states`."""
        ...

    def edges(self, edges: frozenset[tuple[int, int]]) -> S:
        """The pairs (s, q) for which (q, letter of s) is in `edges`."""
        ...

    def project(self, values: V) -> V:
        """For each state s of the base model, the value at (s, q0)."""
        ...

    def project_set(self, states: S) -> S:
        """The states s of the base model with (s, q0) in `states`."""
        ...


class EngineOf(Protocol[S, V]):
    """A built model in one representation."""

    @property
    def name(self) -> str:
        """Short name, as switches and results say it."""
        ...

    @property
    def is_rational(self) -> bool:
        """Whether the numbers are rationals (arrays of Fraction objects) instead of doubles."""
        ...

    @property
    def has_rows(self) -> bool:
        """Whether the engine works with `System.matrix`.

        If not, the matrix is built only where `System.operator` does not suffice.
        """
        ...

    @property
    def has_opponents(self) -> bool:
        """Whether it is a game: in some states, opponents choose against a direction."""
        ...

    @property
    def model(self) -> BoundModel:
        """The bound model."""
        ...

    @property
    def all(self) -> S:
        """Every reachable state."""
        ...

    @property
    def none(self) -> S:
        """The empty set."""
        ...

    @property
    def initial(self) -> S:
        """The initial states."""
        ...

    @property
    def deadlocks(self) -> S:
        """States without a transition, before they were given a self-loop."""
        ...

    @property
    def graph(self) -> GraphOf[S]:
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

    @property
    def entry_range(self) -> tuple[float, float]:
        """The least positive and the greatest one-step probability (in continuous time, rate)."""
        ...

    @property
    def entry_error(self) -> float:
        """A bound on the relative error of a sum of entries of a row: numbers of the text and sums
        are rounded.
        """
        ...

    def where(self, expression: Expression) -> S:
        """The states that satisfy a boolean expression over the variables."""
        ...

    def values(self, expression: Expression, type: Type) -> V:
        """The value of a numeric expression over the variables, at each state."""
        ...

    def constant(self, lower: Number, upper: Number | None = None, *, rounded: bool = False) -> V:
        """The same value (or bounds of it) everywhere; `rounded`: it came out of floating-point
        arithmetic.
        """
        ...

    def rationals(self, values: Rationals) -> V:
        """Values that are known without error: one per state in index order, or one for all."""
        ...

    def indicator(self, states: S) -> V:
        """1 on the set and 0 elsewhere."""
        ...

    def from_bools(self, members: Bools) -> S:
        """The set of the states (bool[states], in index order) that are True."""
        ...

    def to_bools(self, states: S) -> Bools:
        """Membership of each reachable state, bool[states] in index order."""
        ...

    def system(self, states: S, direction: Direction | None = None) -> SystemOf[S, V]:
        """The equations over some states; `direction`: of the strategies of an MDP."""
        ...

    def finite_reward(self, reward: Reward, target: S, direction: Direction | None) -> S:
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

    def first(self, states: S) -> S:
        """The singleton of the state with the lowest index; `states` must not be empty."""
        ...

    def numbers(self, states: S, limit: int | None = None, start: int = 0) -> Int64s:
        """The index of each state of a set among the reachable states, int64[count], ascending.

        The first `start` states are left out, and of the others at most `limit` are given.
        """
        ...

    def valuations(
        self, states: S, limit: int | None = None, start: int = 0
    ) -> Iterator[tuple[bool | int, ...]]:
        """The states' variable values, in index order (lexicographic in declaration order).

        `limit` and `start` are as for `numbers`.
        """
        ...

    def product(self, letters: Sequence[S], automaton: Automaton) -> ProductOf[S, V]:
        """The product with a deterministic automaton that reads, in each state, which of `letters`
        hold.

        Returns an engine over pairs, and the means to go between the two.
        """
        ...


Values = ValuesOf[StateSet]
System = SystemOf[StateSet, Values]
Equations = EquationsOf[StateSet, Values]
Graph = GraphOf[StateSet]
Engine = EngineOf[StateSet, Values]
Product = ProductOf[StateSet, Values]


def erased(engine: EngineOf[S, V]) -> Engine:
    """An engine for code that serves all engines: the types of sets and values are forgotten.

    That is sound because sets and values of different engines are never mixed: such code receives
    all of them from one engine, and gives them back to the same one.
    """
    return cast(Engine, engine)
