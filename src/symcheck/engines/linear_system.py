"""Linear equations over some states, written once for all engines: reachability and expected
rewards.

Sources: Baier & Katoen (2008), 10.1.1 and 10.6.1; for rewards, Forejt, Kwiatkowska, Norman & Parker
(2011), 'Automated verification techniques for probabilistic systems', section 4.
"""

from __future__ import annotations

import sys
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from symcheck.direction import Direction
from symcheck.engines.base import EquationsOf, S, S_contra, SolvedValues, SystemOf, V, V_co
from symcheck.engines.reward_sums import RewardSums
from symcheck.errors import NeedsRationalsError, UnsupportedError
from symcheck.lazy_dataclass import dataclass
from symcheck.matrices.numbers import Numbers, is_infinite, is_rational, shared_sum
from symcheck.matrices.operators import SweepOperator
from symcheck.matrices.rows import Bools, Int64s, SparseMatrix, per_row, starts_of
from symcheck.matrices.transition_kernel import TransitionKernel, jump_weights
from symcheck.numerics.linear.masked_problem import MaskedProblem
from symcheck.numerics.linear.mec_quotient import collapse
from symcheck.numerics.linear.problem import (
    LinearProblem,
    Observer,
    Solution,
)
from symcheck.numerics.settings import Settings
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.expressions.literals import LEAST
from symcheck.semantics.rewards import Reward, Structure, Time

__all__ = [
    "ExpectedReward",
    "LinearEquations",
    "LinearSystem",
    "Preprocessing",
    "Query",
    "Reachability",
    "chosen_rows",
    "lifted",
    "refuse_infinite_minimum",
    "require_normal_numbers",
    "require_normal_rewards",
    "solved_values",
]


def refuse_infinite_minimum(direction: Direction | None) -> None:
    """Raise UnsupportedError for least rewards where some reward of a step is infinite."""
    if direction is Direction.MIN:
        raise UnsupportedError(
            "least expected rewards with an infinite reward in a single step are not supported"
        )


_ROUNDINGS = 8
"""More than the rounded operations of a reward, apart from its items and its step."""


def _finite(results: Numbers, *operands: Numbers) -> Numbers:
    """The results; UnsupportedError if one of them is infinite and its operands are not."""
    infinite = is_infinite(results)
    if infinite.any() and not any(is_infinite(o)[infinite].any() for o in operands):
        raise NeedsRationalsError(
            "the reward of a step is beyond the range of floating-point numbers"
        )
    return results


def require_normal_numbers(smallest: float, largest: float, successors: int, rates: bool) -> None:
    """Refuse a matrix whose one-step probabilities are not all normal doubles.

    Args:
        smallest: the least positive entry, or less.
        largest: the largest entry, or more.
        successors: the most entries of a row, or more.
        rates: whether entries are rates, which will be divided by the sum of their row.

    Raises:
        UnsupportedError: a probability may be subnormal, so that rounding has no relative bound.
    """
    exit_rate = successors * largest if rates else 1.0
    if smallest >= sys.float_info.min * max(exit_rate, 1.0):
        return
    numbers = f"rates from {smallest:g} to {largest:g}" if rates else f"probability {smallest:g}"
    raise NeedsRationalsError(
        f"{numbers}: the model has one-step probabilities that are too small for floating-point "
        "numbers"
    )


def require_normal_rewards(*rewards: Numbers) -> None:
    """Refuse rewards that are subnormal doubles, of which many visits may make a large value.

    Raises:
        UnsupportedError: a reward, or its product with a rate, is subnormal.
    """
    for values in rewards:
        if is_rational(values):
            continue
        subnormal = (np.abs(values) < sys.float_info.min) & (values != 0.0)
        if subnormal.any():
            raise NeedsRationalsError(
                f"reward {values[subnormal][0]:g} of a step: the model has rewards that are too "
                "small for floating-point numbers"
            )


class LinearSystem(SystemOf[S, V]):
    """The part of a system that follows from the matrix of an engine.

    An engine's system inherits from this class and implements the other members of `SystemOf`.
    """

    direction: Direction | None
    """Minimise or maximise over strategies; None for a chain."""

    @property
    @abstractmethod
    def continuous_time(self) -> bool:
        """Whether entries of the matrix are rates."""

    @property
    @abstractmethod
    def has_end_components(self) -> bool:
        """Whether some end component lies within the states (MDP)."""

    @property
    @abstractmethod
    def reward_sums(self) -> RewardSums:
        """The sums of rewards of the engine that floating point gets wrong."""

    @property
    @abstractmethod
    def entry_error(self) -> float:
        """That of the engine."""

    @cached_property
    def error(self) -> float:
        """A bound on the relative error of one-step probabilities, and of their sums in a row."""
        entries = self.entry_error
        return 2.0 * (entries + UNIT_ROUNDOFF) if self.continuous_time else entries

    def state_reward_error(self, reward: Reward) -> float:
        """A bound on the relative error of state rewards that do not cancel."""
        return (
            self.reward_sums.relative_error(reward.index) if isinstance(reward, Structure) else 0.0
        )

    def earned_error(self, reward: Reward) -> float:
        """A bound on the relative error of `earned`, where it does not cancel."""
        error = self.state_reward_error(reward)
        if isinstance(reward, Structure):
            of_rows = self.reward_sums.on_transitions(reward.index)
        else:
            of_rows = not (isinstance(reward, Time) and self.continuous_time)
        return error + _ROUNDINGS * UNIT_ROUNDOFF + self.entry_error if of_rows else error

    def reward_error(self, reward: Reward) -> float:
        """A bound on the relative error of `step_rewards`, where they do not cancel."""
        return self.earned_error(reward) + (self.error if self.continuous_time else 0.0)

    @property
    def opponents(self) -> Bools | None:
        """The states in which opponents choose against a direction; None: it is no game."""
        return None

    @property
    def preprocessing(self) -> Sequence[Preprocessing[S, V]]:
        """Steps that may shorten the equations, in the order in which they are tried."""
        return ()

    @property
    @abstractmethod
    def weights(self) -> SparseMatrix:
        """The weights of the kernel as compressed rows, made on first use."""

    @property
    @abstractmethod
    def weight_operator(self) -> SparseMatrix | SweepOperator:
        """The weights of the kernel in the engine's own form."""

    @abstractmethod
    def weight_into(self, target: S) -> Numbers:
        """Per row: the sum of the weights that lead into `target`."""

    @abstractmethod
    def weighted_values(self, values: V) -> tuple[Numbers, Numbers]:
        """Per row: sum over the successors outside of `states` of weight × value (lower, upper)."""

    @abstractmethod
    def weight_sums(self) -> Numbers:
        """Per row: the sum of all weights, of successors outside of `states` too."""

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.n if self.groups is None else int(self.groups[-1])

    @property
    @abstractmethod
    def takes_time(self) -> Bools | None:
        """The rows whose weights are rates, in a Markov automaton; None for other models."""

    @cached_property
    def exit_rates(self) -> Numbers | None:
        """Per row: the rate at which the state is left, 0 for a choice that takes no time; None in
        discrete time.
        """
        if not self.continuous_time:
            return None
        sums, timed = self.weight_sums(), self.takes_time
        return sums if timed is None else np.where(timed, sums, 0)

    @property
    def kernel(self) -> TransitionKernel[SparseMatrix | SweepOperator]:
        """The transitions in the engine's own form."""
        return TransitionKernel(self.weight_operator, self.exit_rates)

    @property
    def row_kernel(self) -> TransitionKernel[SparseMatrix]:
        """The transitions as compressed rows."""
        return TransitionKernel(self.weights, self.exit_rates)

    @property
    def matrix(self) -> SparseMatrix:
        """The probabilities as compressed rows."""
        return self.row_kernel.probabilities

    @cached_property
    def operator(self) -> SparseMatrix | SweepOperator:
        """The probabilities in the engine's own form."""
        return self.kernel.probabilities

    def one_step_probability(self, target: S) -> Numbers:
        """Per row: the probability of entering `target` by a step (outside of `states` too)."""
        return self._per_jump(self.weight_into(target))

    def one_step_values(self, values: V) -> tuple[Numbers, Numbers]:
        """Per row: sum over the successors outside of `states` of probability × value (lower,
        upper).
        """
        lower, upper = self.weighted_values(values)
        low = self._per_jump(lower)
        return low, low if upper is lower else self._per_jump(upper)

    def _per_jump(self, rows: Numbers) -> Numbers:
        """What rows give per jump, from what they give per unit of time; the same where time is
        discrete.
        """
        return rows if self.exit_rates is None else rows / jump_weights(self.exit_rates)

    def step_rewards(self, reward: Reward) -> Numbers:
        """Per row: the expected reward of a step (in a CTMC, with the state reward of its stay)."""
        earned = self.earned(reward)
        steps = _finite(self._per_jump(earned), earned)
        if steps is not earned and not is_rational(steps):
            require_normal_rewards(np.where((steps == 0.0) & (earned != 0.0), LEAST, steps))
        return steps

    def step_reward_errors(self, reward: Reward) -> Numbers:
        """Per row: a bound on the rounding error of `step_rewards`, of an engine with doubles."""
        if isinstance(reward, Structure):
            errors = self.reward_sums.errors(reward.index, self.states)
            if errors is not None:
                return self._per_jump(errors) * (1.0 + 1e-9)
        return self.reward_error(reward) * np.abs(self.step_rewards(reward))

    def state_rewards(self, reward: Reward) -> Numbers:
        """The state reward per state; accurate also where items of opposite signs cancel."""
        if isinstance(reward, Structure):
            accurate = self.reward_sums.per_state(reward.index, self.states)
            if accurate is not None:
                return accurate
        return self.rewards(reward)[0]

    def earned(self, reward: Reward) -> Numbers:
        """Per row, the sum of the state reward and the transition rewards, accurate also where they
        cancel.
        """
        if isinstance(reward, Structure):
            accurate = self.reward_sums.per_row(reward.index, self.states)
            if accurate is not None:
                return accurate
        states, rows = self.rewards(reward)
        each = self.of_stay(states)
        return _finite(shared_sum(each, rows), each, rows)

    def of_stay(self, states: Numbers) -> Numbers:
        """Per row, the state reward, which a choice that takes no time does not earn."""
        each = per_row(self.groups, states)
        return each if self.takes_time is None else np.where(self.takes_time, each, 0)

    def reachability(self, target: S) -> Reachability[S, V]:
        """The equations of the probability of reaching `target`, a set outside of the states."""
        return Reachability(self, target)

    def expected_reward(self, reward: Reward, infinite: S) -> ExpectedReward[S, V]:
        """The equations of the expected reward until the states are left; it is infinite on
        `infinite`.
        """
        return ExpectedReward(self, reward, infinite=infinite)

    def equations(
        self,
        constant: Numbers,
        upper: Numbers | None = None,
        *,
        probability: bool,
        allow_stay: bool = False,
        infinite: S | None = None,
        constant_error: float = 0.0,
    ) -> LinearEquations[S, V]:
        """The equations x = A x + constant (bounds: up to `upper`)."""
        return LinearEquations(
            self, constant, upper, probability, allow_stay, constant_error, infinite=infinite
        )

    def problem(
        self, constant: Numbers, upper: Numbers | None, *, probability: bool
    ) -> LinearProblem:
        """The equations x = A x + constant for a numerical method."""
        leave = self.one_step_probability(~self.states)
        direction = self.direction
        if self.has_rows or self._end_components_matter(probability):
            return LinearProblem(
                constant,
                self.matrix,
                upper,
                leave,
                direction,
                probability,
                opponents=self.opponents,
                error=self.error,
            )
        operator = self.operator
        assert not isinstance(operator, SparseMatrix)  # an engine with rows is asked for its matrix
        return LinearProblem(
            constant,
            None,
            upper,
            leave,
            direction,
            probability,
            operator,
            self.groups,
            self.error,
        )

    def _end_components_matter(self, probability: bool) -> bool:
        """Whether end components prevent the convergence of upper bounds.

        They can be removed from rows only.
        """
        if self.direction is None or probability != (self.direction is Direction.MAX):
            return False
        return self.has_end_components


@dataclass(frozen=True, eq=False)
class BaseEquations(EquationsOf[S, V]):
    """The common part of equations over the states of a system.

    infinite: other states, whose value is infinite; None: none are.
    """

    system: LinearSystem[S, V]
    infinite: S | None = field(default=None, kw_only=True)

    @property
    def constant_error(self) -> float:
        """The relative error of constants beyond that of probabilities."""
        return 0.0

    @property
    def states(self) -> S:
        """The states that are unknowns."""
        return self.system.states

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return self.system.n

    @cached_property
    def usable_rows(self) -> Bools | None:
        """Rows that can be optimal, bool[rows]; None: all.

        A choice that may lead to an infinite value never minimises.

        Raises:
            ValueError: an unknown has only such choices.
        """
        system = self.system
        if not self.infinite or (
            system.opponents is None and system.direction is not Direction.MIN
        ):
            return None
        usable: Bools = system.weight_into(self.infinite) == 0
        if system.opponents is not None:
            maximises = system.opponents ^ (system.direction is Direction.MAX)
            usable |= per_row(system.groups, maximises)
        if usable.all():
            return None
        assert system.groups is not None
        if not np.logical_or.reduceat(usable, system.groups[:-1]).all():
            raise ValueError("a state all of whose choices lead to infinite values is no unknown")
        return usable

    def _usable(self, problem: LinearProblem) -> LinearProblem:
        """The problem on the usable rows."""
        usable = self.usable_rows
        return problem if usable is None else chosen_rows(problem, self.system.matrix, usable)

    def solve(
        self,
        known: Sequence[tuple[S, float]],
        settings: Settings,
        observer: Observer | None = None,
    ) -> SolvedValues[V]:
        """The solution on all states; `known`: finite constants on other sets, 0 elsewhere.

        Raises:
            ValueError: a constant is infinite. The equations must know where values are infinite.
        """
        if not all(np.isfinite(value) for _, value in known):
            raise ValueError("infinite values are given to the equations, not to their solution")
        if self.infinite:
            known = [*known, (self.infinite, np.inf)]
        if self.system.states:
            solved = self._solved(known, settings, observer)
            return replace(solved, choices=self._choices(solved.choices, settings))
        values = self.system.lift(self.system.full(0), None, known)
        return SolvedValues(values, "", 0, 0)

    def _choices(self, rows: Int64s | None, settings: Settings) -> Int64s | None:
        """The rows of a strategy, which are among the usable ones, as choices of their states."""
        groups = self.system.groups
        if rows is None or groups is None or not settings.strategy:
            return None
        if self.usable_rows is not None:
            rows = np.where(rows < 0, -1, np.flatnonzero(self.usable_rows)[rows])
        return np.where(rows < 0, -1, rows - groups[:-1])

    def _solved(
        self, known: Sequence[tuple[S, float]], settings: Settings, observer: Observer | None
    ) -> SolvedValues[V]:
        """The solution over some unknowns."""
        return solved_values(self.system, self.problem(), known, settings, observer)


@dataclass(frozen=True, eq=False)
class LinearEquations(BaseEquations[S, V]):
    """Equations x = A x + constant.

    Args:
        constant: float64 per row; `upper`: its upper bound where it is not known exactly.
        probability: whether the solution consists of probabilities; else of expected rewards.
        allow_stay: whether a strategy may stay for ever at no reward, with value 0 (greatest
            rewards); it must not for least probabilities.
        constant_error: see `BaseEquations`.
    """

    constant: Numbers = field(repr=False)
    upper: Numbers | None = field(repr=False)
    probability: bool
    allow_stay: bool = False
    constant_error: float = 0.0

    def problem(self) -> LinearProblem:
        """The equations for a numerical method, on the usable rows.

        Raises:
            ValueError: an unknown has an infinite value.
        """
        system = self.system
        if (
            system.direction is not Direction.MIN
            and system.opponents is None
            and self.infinite
            and np.any(system.weight_into(self.infinite) != 0)
        ):
            raise ValueError("a state with a choice that leads to an infinite value is no unknown")
        problem = system.problem(self.constant, self.upper, probability=self.probability)
        return self._usable(replace(problem, constant_error=self.constant_error))

    def _solved(
        self, known: Sequence[tuple[S, float]], settings: Settings, observer: Observer | None
    ) -> SolvedValues[V]:
        from symcheck.numerics.linear.methods import solve_linear

        problem, quotient = self.problem(), None
        if problem.opponents is not None:
            problem = replace(problem, allow_stay=self.allow_stay)
        elif self.allow_stay and (not self.probability or self.system.has_end_components):
            # End components without reward become single states, as for least rewards. Rewards are
            # not negative, so that staying is never better than leaving and need not be a choice
            # there.
            against = Direction.MAX if self.probability else Direction.MIN
            rows = problem.matrix
            if rows is None:
                rows = self.system.matrix
            quotient = collapse(replace(problem, matrix=rows, direction=against))
        if quotient is None:
            return solved_values(self.system, problem, known, settings, observer)
        inner = replace(quotient.problem, direction=problem.direction)
        solution = quotient.expand(solve_linear(inner, settings, observer))
        return lifted(self.system, solution, known, settings)


@dataclass(frozen=True, eq=False)
class Reachability(BaseEquations[S, V]):
    """The probability of reaching `target` from the states of a system: x = A x + (probability of
    entering it).
    """

    target: S

    def problem(self) -> LinearProblem:
        """The equations for a numerical method."""
        constant = self.system.one_step_probability(self.target)
        return self.system.problem(constant, None, probability=True)

    def _solved(
        self, known: Sequence[tuple[S, float]], settings: Settings, observer: Observer | None
    ) -> SolvedValues[V]:
        return _preprocessed(self, known, settings, observer) or super()._solved(
            known, settings, observer
        )


@dataclass(frozen=True, eq=False)
class ExpectedReward(BaseEquations[S, V]):
    """The expected reward until the states of a system are left; on the set `infinite` it is
    infinite.
    """

    reward: Reward
    infinite: S = field(kw_only=True)

    @property
    def cancels(self) -> bool:
        """Whether rewards of opposite signs cancel somewhere."""
        sums = self.system.reward_sums
        return isinstance(self.reward, Structure) and sums.cancels(self.reward.index)

    @property
    def constant_error(self) -> float:
        """The relative error of the rewards of steps."""
        return UNIT_ROUNDOFF if self.cancels else self.system.reward_error(self.reward)

    def problem(self) -> LinearProblem:
        """The equations for a numerical method, on the usable rows."""
        constant = self.system.step_rewards(self.reward)
        problem = self._usable(self.system.problem(constant, None, probability=False))
        if is_rational(constant):
            return problem
        return replace(problem, constant_error=self.constant_error)

    def _solved(
        self, known: Sequence[tuple[S, float]], settings: Settings, observer: Observer | None
    ) -> SolvedValues[V]:
        return _preprocessed(self, known, settings, observer) or super()._solved(
            known, settings, observer
        )


Query = Reachability[S, V] | ExpectedReward[S, V]


class Preprocessing(Protocol[S, V]):
    """A step that shortens equations, or solves them without a numerical method."""

    def accepts(self, query: Query[S, V], settings: Settings) -> bool:
        """Whether the step can be tried."""
        ...

    def apply(
        self,
        query: Query[S, V],
        known: Sequence[tuple[S, float]],
        settings: Settings,
        observer: Observer | None,
    ) -> SolvedValues[V] | None:
        """The solution; None if the step does not pay."""
        ...


def _preprocessed(
    query: Query[S, V],
    known: Sequence[tuple[S, float]],
    settings: Settings,
    observer: Observer | None,
) -> SolvedValues[V] | None:
    """The solution by the first preprocessing step that has one.

    These steps add the rewards of a structure themselves.
    """
    if isinstance(query, ExpectedReward) and query.cancels:
        return None
    for step in query.system.preprocessing:
        if step.accepts(query, settings):
            solution = step.apply(query, known, settings, observer)
            if solution is not None:
                return solution
    return None


class Lifts(Protocol[S_contra, V_co]):
    """The part of a system that lifts solutions to all states."""

    @property
    def n(self) -> int:
        """Number of unknowns."""
        ...

    def lift(
        self,
        lower: Numbers,
        upper: Numbers | None,
        rest: Sequence[tuple[S_contra, float]] = (),
        up_to_rounding: bool = False,
    ) -> V_co:
        """Values on all states."""
        ...


def solved_values(
    system: Lifts[S, V],
    problem: LinearProblem | MaskedProblem,
    known: Sequence[tuple[S, float]],
    settings: Settings,
    observer: Observer | None,
) -> SolvedValues[V]:
    """The solution of a problem over the unknowns of a system, on all states."""
    from symcheck.numerics.linear.methods import solve_linear

    return lifted(system, solve_linear(problem, settings, observer), known, settings)


def lifted(
    system: Lifts[S, V], solution: Solution, known: Sequence[tuple[S, float]], settings: Settings
) -> SolvedValues[V]:
    """A solution over the unknowns, on all states."""
    exact = is_rational(solution.lower)
    values = (
        system.lift(solution.lower, solution.upper, known, solution.up_to_rounding)
        if solution.certified and not exact
        else system.lift(solution.middle, None, known, up_to_rounding=True)
    )
    return SolvedValues(
        values,
        solution.method,
        system.n,
        solution.iterations,
        solution.explanation,
        solution.certified,
        solution.width(settings.relative) if solution.certified else 0.0,
        solution.strategy,
    )


def chosen_rows(problem: LinearProblem, matrix: SparseMatrix, allowed: Bools) -> LinearProblem:
    """The problem with some choices only.

    Args:
        problem: the equations with all choices.
        matrix: the rows of the problem, where it has only an operator.
        allowed: bool[rows]; every state keeps a row.
    """
    matrix = problem.matrix if problem.matrix is not None else matrix
    assert matrix.groups is not None
    assert problem.exit is not None
    rows: Int64s = np.flatnonzero(allowed)
    before: Int64s = starts_of(allowed)
    chosen = matrix.choose(rows, before[matrix.groups])
    upper = None if problem.upper is None else problem.upper[rows]
    return LinearProblem(
        problem.constant[rows],
        chosen,
        upper,
        problem.exit[rows],
        problem.direction,
        problem.probability,
        error=problem.error,
        constant_error=problem.constant_error,
        opponents=problem.opponents,
    )
