"""What is asked of sampled paths: each question looks at the states that paths enter, and says
which paths are decided.

A path is in a state from `time` to `leave` (in discrete time one step).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, assert_never

import numpy as np

from symcheck.errors import UnsupportedError
from symcheck.matrices.rows import Bools, Floats, Int32s
from symcheck.numerics.graph import backward_reachable
from symcheck.semantics.model import BoundModel
from symcheck.semantics.path_normal_form import (
    Connected,
    Negated,
    NextState,
    NormalForm,
    StateFormula,
    UntilReached,
    normal_form,
    only_window,
)
from symcheck.semantics.time_bounds import Window, bound_value, window
from symcheck.simulate import tuning
from symcheck.simulate.lazy_chain import LazyChain
from symcheck.syntax.ast import (
    CumulativeReward,
    Eventually,
    Expression,
    InstantaneousReward,
    ModelType,
    PathFormula,
    RewardQuery,
    SteadyStateReward,
    TotalReward,
)

__all__ = ["Decision", "Goal", "Paths", "Question", "path_question", "reward_question"]


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths that are still undecided, all after the same number of steps: states, times, and
    rewards until `time`.
    """

    step: int
    ids: Int32s
    time: Floats
    leave: Floats
    total: Floats


Decision = tuple[Bools, Floats]
"""Which paths are decided, and the values of all (meaningless where undecided)."""


class Question(Protocol):
    """`atoms`: the state formulas that it needs to know; the chain numbers them in this order."""

    @property
    def atoms(self) -> tuple[Expression, ...]:
        """State formulas."""
        ...

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        """Decide what can be decided."""
        ...

    @property
    def goal(self) -> Goal | None:
        """What must be reached if a path is not to go on for ever undecided; None where every path
        gets decided.
        """
        ...


@dataclass(frozen=True, slots=True)
class Goal:
    """States of atom `right` are to be reached through states of atom `left` (None: any); a path
    that cannot is worth `missed`.
    """

    right: int
    left: int | None
    missed: float

    def trapped(self, chain: LazyChain, ids: Int32s) -> Bools:
        """Which paths are in an absorbing state that is no target."""
        trapped = chain.absorbing(ids)
        where = np.flatnonzero(trapped)
        trapped[where] = ~chain.satisfies(self.right, ids[where])
        return trapped

    def lost(self, chain: LazyChain, ids: Int32s) -> Bools:
        """Which paths are in a state from which all ways are known, and miss. Small chains are made
        known for it.
        """
        chain.explore(tuning.MAX_EXPLORED_STATES)
        matrix, expanded = chain.graph()
        everything = np.arange(matrix.states, dtype=np.int32)
        target = ~expanded | chain.satisfies(self.right, everything)
        through = (
            expanded if self.left is None else expanded & chain.satisfies(self.left, everything)
        )
        return ~backward_reachable(matrix, target, through)[ids]


def _undecided(ids: Int32s) -> Decision:
    return np.zeros(len(ids), np.bool_), np.zeros(len(ids))


@dataclass(frozen=True)
class _Now:
    """Whether the first state satisfies a formula."""

    target: Expression
    negative: bool = False

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return (self.target,)

    @property
    def goal(self) -> Goal | None:
        return None

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        holds = chain.satisfies(0, paths.ids) ^ self.negative
        return np.ones(len(holds), np.bool_), holds.astype(np.float64)


@dataclass(frozen=True)
class _Next:
    """Whether the second state satisfies a formula and is entered between two times."""

    target: Expression
    lower: float
    upper: float | None
    negative: bool = False

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return (self.target,)

    @property
    def goal(self) -> Goal | None:
        return None

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        if paths.step == 0:
            return _undecided(paths.ids)
        upper = np.inf if self.upper is None else self.upper
        holds = chain.satisfies(0, paths.ids) & (paths.time >= self.lower) & (paths.time <= upper)
        return np.ones(len(holds), np.bool_), (holds ^ self.negative).astype(np.float64)


@dataclass(frozen=True)
class _Until:
    """Whether `right` holds at some time between two times, and `left` at all times before."""

    left: Expression
    right: Expression
    lower: float
    upper: float | None
    negative: bool = False

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return self.left, self.right

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        left, right = chain.satisfies(0, paths.ids), chain.satisfies(1, paths.ids)
        upper = np.inf if self.upper is None else self.upper
        late_enough = paths.time >= self.lower
        if chain.continuous:
            hit = right & (late_enough | (left & (paths.leave >= self.lower)))
            missed = ~left | (paths.leave > upper)
        else:
            hit = right & late_enough
            missed = ~left | (paths.time >= upper)
        return hit | missed, (hit ^ self.negative).astype(np.float64)

    @property
    def goal(self) -> Goal | None:
        return Goal(1, 0, float(self.negative)) if self.upper is None else None


@dataclass(frozen=True)
class _Cumulative:
    """The reward until a time."""

    time: float

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return ()

    @property
    def goal(self) -> Goal | None:
        return None

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        if not chain.continuous:
            return paths.time >= self.time, paths.total
        rest = np.maximum(self.time - paths.time, 0.0)
        return paths.leave >= self.time, paths.total + chain.reward(paths.ids) * rest


@dataclass(frozen=True)
class _Instantaneous:
    """The state reward at a time."""

    time: float

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return ()

    @property
    def goal(self) -> Goal | None:
        return None

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        there = paths.leave > self.time if chain.continuous else paths.time >= self.time
        return there, chain.reward(paths.ids)


@dataclass(frozen=True)
class _Reach:
    """The reward until a state of `target`; infinite where there will be none."""

    target: Expression

    @property
    def atoms(self) -> tuple[Expression, ...]:
        return (self.target,)

    def look(self, chain: LazyChain, paths: Paths) -> Decision:
        return chain.satisfies(0, paths.ids), paths.total

    @property
    def goal(self) -> Goal | None:
        return Goal(0, None, np.inf)


# --------------------------------------------------------------------------------- reading formulas


def path_question(path: PathFormula, model: BoundModel) -> Question:
    """What a path formula asks of a path.

    Raises UnsupportedError for formulas with several temporal operators, InputError for bounds.
    """
    return _question(normal_form(path, model), model, negative=False)


def _question(form: NormalForm, model: BoundModel, *, negative: bool) -> Question:
    match form:
        case StateFormula(formula):
            return _Now(formula, negative)
        case Negated(operand):
            return _question(operand, model, negative=not negative)
        case NextState(StateFormula(target), extent):
            return _Next(target, *_times(only_window(extent), model), negative)
        case UntilReached(StateFormula(left), StateFormula(right), extent):
            return _Until(left, right, *_times(only_window(extent), model), negative)
        case Connected() | NextState() | UntilReached():
            raise UnsupportedError(
                "-sim does not answer path formulas with several temporal operators (general LTL); "
                "it answers X, F, G, U, W and R over state formulas, with bounds or without; "
                "without -sim the formula is checked numerically"
            )
        case _:
            assert_never(form)


def _times(times: Window, model: BoundModel) -> tuple[float, float | None]:
    if model.type is ModelType.CTMC:
        return times.times()
    steps = times.steps()
    return float(steps.lower), None if steps.upper is None else float(steps.upper)


def reward_question(query: RewardQuery, model: BoundModel) -> Question:
    """What a reward operator asks. Raises UnsupportedError for S, C without a bound, and LTL;
    InputError for bounds.
    """
    match query:
        case CumulativeReward(bound):
            lower, upper = _times(window(bound), model)
            if upper is None or lower:
                raise UnsupportedError("a cumulative reward has an upper bound only: C<=k")
            return _Cumulative(upper)
        case InstantaneousReward(time):
            value = bound_value(time)
            return _Instantaneous(_times(Window(value, value, span=time.span), model)[0])
        case Eventually(operand, None) if isinstance(
            target := normal_form(operand, model), StateFormula
        ):
            return _Reach(target.formula)
        case SteadyStateReward() | TotalReward():
            raise UnsupportedError(
                "-sim does not estimate R [ "
                f"{'S' if isinstance(query, SteadyStateReward) else 'C'} ], which looks at paths "
                "for ever; "
                "C<=k or I=k with a large k come near, and without -sim it is computed"
            )
        case _:
            raise UnsupportedError(
                "-sim estimates R [ C<=k ], R [ I=k ] and R [ F states ]; without -sim rewards "
                "until a path formula are computed too"
            )
