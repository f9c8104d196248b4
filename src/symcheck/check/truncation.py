"""Values of models with too many states, or infinitely many, on a region of their states.

Where a path leaves the region, nothing more is known of it. Until formulas grow with their
operands: if the states on the boundary satisfy neither operand, the probability is a lower bound,
and if they satisfy both, it is an upper one. The region grows where paths leave it most probably,
until the bounds are as close as requested; without a bound on time, they may stay apart, because
paths that leave need not come back. What chooses the region is an estimate, and what is printed is
proved.

Rewards within a bound are those of the region, up to what paths earn that leave it. A bound on the
rewards of all states (`reward_growth.py`), as the reward of the states on the boundary, makes that
a reward of the finite model. Within a bound on steps, states earn nothing that are too far away.

Sources: E. Hahn, H. Hermanns, B. Wachter, L. Zhang: INFAMY: an infinite-state Markov model checker
(CAV 2009), for bounds from what leaves the explored states; T. Neupane, C. Myers, C. Madsen,
H. Zheng, Z. Zhang: STAMINA: stochastic approximate model-checker for infinite-state analysis (CAV
2019), for growth by reachability probabilities.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from time import perf_counter

import numpy as np

from symcheck.check import tuning
from symcheck.check.context import CheckLog, Context
from symcheck.check.measures.signed_steps import REWARD_ERROR
from symcheck.check.queries.path_probabilities import probability
from symcheck.check.queries.values import values
from symcheck.check.result import Answer, Certified, Exact, Result, SolverRun
from symcheck.check.state_formulas import states_of
from symcheck.direction import Direction
from symcheck.engines.base import StateSet, erased
from symcheck.engines.explicit.engine import ExplicitEngine
from symcheck.errors import (
    Interrupted,
    MemoryLimitError,
    NumericalError,
    ResourceError,
    UnsupportedError,
)
from symcheck.explicit.region import Region
from symcheck.matrices.rows import Bools, Floats, SparseMatrix
from symcheck.numerics.linear.problem import Observer, largest_width
from symcheck.numerics.transient.state_space_truncation import expected_times
from symcheck.options import Options
from symcheck.semantics.features import Feature, offers
from symcheck.semantics.model import BoundModel, BoundRewards
from symcheck.semantics.path_formulas import NextPath, UntilPath, over_leaves
from symcheck.semantics.query import (
    CumulativeReward,
    InstantaneousReward,
    PathProbability,
    Query,
    query_of,
)
from symcheck.semantics.reduction.stop_at_targets import deciding_states, stop_at
from symcheck.semantics.reward_growth import reward_growth
from symcheck.semantics.rewards import Structure, reward_items
from symcheck.syntax.ast import AnyMeasure, Expression, StateOperator
from symcheck.syntax.traversal import nodes
from symcheck.tables import counted

__all__ = ["check_by_truncation", "has_bounds_on_a_part", "truncates"]

_LARGEST = float(np.finfo(np.float64).max)


def truncates(formula: Expression, model: BoundModel) -> bool:
    """Whether a bound formula needs a part of the states only: P of X, or of F, G, U, W or R with
    an upper bound on steps or time, over conditions without operators, and rewards up to a bound or
    at a time, from one initial state.
    """
    match _measured(formula, model):
        case UntilPath(window=window) | CumulativeReward(window=window):
            return window.upper is not None
        case NextPath() | InstantaneousReward():
            return True
        case _:
            return False


def has_bounds_on_a_part(formula: Expression, model: BoundModel) -> bool:
    """Whether a part of the states bounds a formula: as above, with or without an upper bound. If
    there is none, the bounds need not meet.
    """
    return truncates(formula, model) or isinstance(_measured(formula, model), UntilPath)


def _measured(formula: Expression, model: BoundModel) -> object:
    """What is asked for of one initial state: the path formula of P over conditions without
    operators, or another quantity; None: neither.
    """
    if not offers(model, Feature.TRUNCATION) or model.initial is not None:
        return None
    if not isinstance(formula, AnyMeasure) or any(
        isinstance(node, StateOperator) for node in nodes(formula) if node is not formula
    ):
        return None
    quantity = query_of(formula, model).quantity
    return quantity.path if isinstance(quantity, PathProbability) else quantity


def check_by_truncation(
    model: BoundModel,
    formula: Expression,
    options: Options,
    labels: Mapping[str, Expression],
    observer: Observer | None = None,
) -> Result:
    """Check a formula on a region of the states that grows until its value is known well enough.

    Args:
        model: the model.
        formula: one for which `has_bounds_on_a_part` holds.
        options: the accuracy, and limits.
        labels: those of the properties file.
        observer: is told of each iteration of a numerical method, and may raise to end it.

    Raises:
        ModelFault: the model breaks a rule in a state of the region.
        NumericalError: a threshold is not decided.
        UnsupportedError: exact values are asked for.
        ResourceError: a limit was reached before there were bounds.
    """
    if options.exact:
        raise UnsupportedError(
            "a part of the states gives bounds, and no exact value",
            hint="leave out -exact (exact=True) or -truncate (truncate=True)",
        )
    assert isinstance(formula, AnyMeasure)
    started = perf_counter()
    stop = deciding_states(model, [(formula, labels)])
    is_path = isinstance(query_of(formula, model).quantity, PathProbability)
    part = (_Truncated if is_path else _TruncatedReward)(
        model if stop is None else stop_at(model, stop), formula, options, labels, observer
    )
    lower, upper = part.bounds()
    explored = part.explored
    left = 0 if explored.boundary is None else len(explored.boundary)
    text = f"{counted(len(explored.states), 'state')} explored, of which {left:,} are not expanded"
    if not left:
        text = f"{counted(len(explored.states), 'state')}, which are all that matter"
    run = SolverRun("graph", "truncation", len(explored.states), part.rounds, text)
    answer, accuracy = part.answer(lower, upper)
    width = largest_width(np.array([lower]), np.array([upper]), options.relative)
    if not isinstance(answer, bool):
        part.context.warn_if_wide(width, text)
    log = part.context.log
    return Result(
        answer,
        accuracy,
        f"value in the initial state; {text}",
        lines=tuple(log.lines),
        runs=(run, *log.runs),
        warnings=tuple(dict.fromkeys(log.warnings)),
        seconds=perf_counter() - started,
        engine=part.context.engine,
    )


class _Truncated:
    """A formula on a region of the states of a model.

    widest: bounds on any value, before something is known. shifts: those of the estimates.
    """

    widest: tuple[float, float] = 0.0, 1.0
    shifts: tuple[float, ...] = tuning.TRUNCATION_SHIFTS

    def __init__(
        self,
        model: BoundModel,
        formula: AnyMeasure,
        options: Options,
        labels: Mapping[str, Expression],
        observer: Observer | None,
    ) -> None:
        self._options = replace(options, strategy=False, everywhere=False, bisim=False)
        self._formula, self._labels, self._observer = formula, labels, observer
        self._query: Query[Expression] = query_of(formula, model)
        self._prepare(model)
        self._region = Region(model, options)
        self.rounds = 0
        self._unsure = 0.0  # the greater width of the bounds of the two finite models
        self._explore()

    def _prepare(self, model: BoundModel) -> None:
        """Find what is proved of all states, before any is explored."""

    def _explore(self) -> None:
        self.rounds += 1
        self.explored = self._region.explored()
        self.context = Context(
            erased(ExplicitEngine(self.explored)),
            self._options,
            self._labels,
            log=CheckLog(warnings=list(self.explored.model.warnings)),
            formula=self._formula,
            observer=self._observer,
            trimmed=True,
        )

    def bounds(self) -> tuple[float, float]:
        """Bounds on the value in the initial state, as close as requested or as can be."""
        return self._within_time() if self._ends else self._approaching()

    def _approaching(self) -> tuple[float, float]:
        """Bounds without a bound on time, until they meet or approach each other no longer."""
        known, gaps = (0.0, 1.0), [1.0]
        try:
            while True:
                lower, upper = known = self._solved(known)
                gaps.append(upper - lower)
                is_small, states = gaps[-1] < tuning.APPROACHED, len(self._region)
                if is_small or self._is_enough(lower, upper) or not self._boundary.any():
                    return known
                earlier = gaps[max(0, len(gaps) - 1 - tuning.APPROACHING_ROUNDS)]
                is_hopeful = gaps[-1] < tuning.APPROACHING * earlier
                is_unknown = known == (0.0, 1.0)
                begins = is_unknown or len(gaps) <= tuning.APPROACHING_ROUNDS
                most = tuning.UNKNOWN_STATES if begins else tuning.TRUNCATION_STATES
                if states > most and is_unknown:
                    raise NumericalError(
                        f"nothing is known after {counted(states, 'state')}: paths leave them, and "
                        "need not come back",
                        hint="ask within a bound on time, or bound the variables; -notruncate "
                        "(truncate=False) explores every state",
                    )
                if states > most or not (begins or is_hopeful):
                    return known
                self._grow(self._flows(), 0.0)
        except (ResourceError, MemoryError, KeyboardInterrupt) as error:
            if known == (0.0, 1.0):
                raise
            if isinstance(error, MemoryLimitError | MemoryError):
                return known
            note = f"the value is between {known[0]!r} and {known[1]!r}"
            raise Interrupted("interrupted", note=note) from None

    def _within_time(self) -> tuple[float, float]:
        """Bounds with a bound on time: the region grows until hardly any path leaves it."""
        epsilon = self._options.epsilon
        goal, known = tuning.TRUNCATION_SHARE * epsilon, self.widest
        while True:
            flows, is_large = self._flows(), len(self._region) > tuning.TRUNCATION_STATES
            if flows.sum() <= goal or (is_large and flows.sum() < tuning.TRUNCATION_USELESS):
                lower, upper = known = self._solved(known)
                if self._is_enough(lower, upper):
                    return known
                if is_large or not len(flows) or goal < tuning.TRUNCATION_LEAST:
                    return known
                least = max(lower, -upper)
                if not self._options.relative or least <= 0.0:
                    least = 1.0
                goal = min(goal / 10, tuning.TRUNCATION_SHARE * epsilon * least)
            elif is_large:
                raise NumericalError(
                    f"within the bound of the formula, paths leave any "
                    f"{counted(len(self._region), 'state')} that are explored",
                    hint="ask for less time, or bound the variables",
                )
            try:
                self._grow(flows, goal)
            except (MemoryLimitError, MemoryError):
                if known == self.widest:
                    raise
                return known

    def _is_enough(self, lower: float, upper: float) -> bool:
        """Whether bounds are as close as requested, or decide a threshold, or more states do not
        help.
        """
        largest = max(abs(lower), abs(upper)) if self._options.relative else 1.0
        wide = self._options.epsilon * largest
        return upper - lower <= wide or self._is_decided(lower, upper) or self._unsure > wide

    def _solved(self, known: tuple[float, float]) -> tuple[float, float]:
        """Bounds by the region, within those that are known."""
        engine, query = self.context.engine, self._query
        boundary = engine.from_bools(self._boundary)
        context = self.context.relevant_at(engine.initial)
        context = context.with_epsilon(tuning.TRUNCATION_SHARE * self._options.epsilon)
        quantity = query.over(states_of(context)).quantity
        assert isinstance(quantity, PathProbability)
        path = quantity.path

        def without(states: StateSet) -> StateSet:
            return states - boundary

        def within(states: StateSet) -> StateSet:
            return states | boundary

        low, high = (within, without) if path.negative else (without, within)
        found = [
            probability(context, over_leaves(path, leaf), query.direction) for leaf in (low, high)
        ]
        (least, below), (above, most) = (
            (float(values.minimum(engine.initial)[0]), float(values.maximum(engine.initial)[1]))
            for values in found
        )
        self._unsure = max(below - least, most - above)
        return max(known[0], least, 0.0), min(known[1], most, 1.0)

    @property
    def _boundary(self) -> Bools:
        """The states that are not expanded: bool[states]."""
        members = np.zeros(len(self.explored.states), np.bool_)
        if self.explored.boundary is not None:
            members[self.explored.boundary] = True
        return members

    def _flows(self) -> Floats:
        """About the probability of entering each state of the boundary within the time that counts:
        float64[boundary].

        Choices are taken with equal probabilities.
        """
        explored, boundary = self.explored, self.explored.boundary
        if boundary is None or not len(boundary):
            return np.empty(0)
        chain = _as_chain(explored.matrix)
        exits = chain.row_sums()
        start = np.zeros(chain.states)
        start[explored.initial] = 1.0 / len(explored.initial)
        horizon = self._horizon(float(exits.max()))
        if horizon == 0.0:
            return np.zeros(len(boundary))
        flows = [
            expected_times(chain, exits, horizon, start, shift)[boundary] * shift / horizon
            for shift in self.shifts
        ]
        return np.asarray(np.minimum.reduce(flows))

    @property
    def _ends(self) -> bool:
        """Whether there is a bound on time or steps."""
        quantity = self._query.quantity
        if not isinstance(quantity, PathProbability):
            return True
        assert isinstance(quantity.path, UntilPath | NextPath)
        return isinstance(quantity.path, NextPath) or quantity.path.window.upper is not None

    def _horizon(self, rate: float) -> float:
        """The time that counts. Without a bound: in which a path may go through the region."""
        quantity = self._query.quantity
        assert isinstance(quantity, PathProbability)
        if isinstance(quantity.path, UntilPath):
            upper = quantity.path.window.upper
            return len(self._region) / rate if upper is None else float(upper)
        return 1.0 / rate

    def _grow(self, flows: Floats, goal: float) -> None:
        """Expand the states of the boundary into which most paths go."""
        boundary = self.explored.boundary
        assert boundary is not None
        order = np.argsort(flows)
        left = int(np.searchsorted(np.cumsum(flows[order]), max(0.1 * goal, 0.1 * flows.sum())))
        chosen = boundary[np.sort(order[min(left, len(order) - 1) :])]
        rows = np.ascontiguousarray(self.explored.states.rows[chosen])
        self._region.grow(rows)
        self._explore()

    def _is_decided(self, lower: float, upper: float) -> bool:
        threshold = self._query.threshold
        return threshold is not None and threshold.admits(lower) == threshold.admits(upper)

    def answer(self, lower: float, upper: float) -> tuple[Answer, Certified | Exact]:
        """The value, or the verdict of a threshold. Raises NumericalError: it is not decided."""
        threshold = self._query.threshold
        if threshold is None:
            if lower == upper:
                return lower, Exact()
            return lower + (upper - lower) / 2, Certified(lower, upper)
        if not self._is_decided(lower, upper):
            raise NumericalError(
                f"cannot decide whether the value is {threshold.operator.value} "
                f"{float(threshold.value)!r}: by {counted(len(self.explored.states), 'state')} it "
                f"lies between {lower!r} and {upper!r}"
            )
        return threshold.admits(lower), Exact()


class _TruncatedReward(_Truncated):
    """A reward up to a bound or at a time. What is earned outside of the region is bounded."""

    widest = -math.inf, math.inf
    shifts = tuning.TRUNCATION_REWARD_SHIFTS

    def _prepare(self, model: BoundModel) -> None:
        quantity = self._query.quantity
        assert isinstance(quantity, CumulativeReward | InstantaneousReward)
        self._quantity, items = quantity, reward_items(quantity.reward, model)
        if isinstance(quantity, CumulativeReward):
            assert quantity.window.upper is not None
            self._time = Fraction(quantity.window.upper)
        else:
            self._time = quantity.time
            items = tuple(item for item in items if item.on_states)
        self._growth = reward_growth(model, items, self._time)
        self._is_timed = model.type.continuous_time
        if self._growth is None and self._is_timed:
            raise UnsupportedError(
                "no bound is found on what is earned outside of the states that are explored",
                hint="rewards have to be bounded, or polynomials in variables that grow in steps "
                "at rates that are at most linear in them; otherwise bound the variables; "
                "-notruncate (truncate=False) explores every state",
            )

    def _horizon(self, rate: float) -> float:  # noqa: ARG002 (paths need it)
        return float(self._time)

    @property
    def _outside(self) -> Floats:
        """What is earned at most, at a time or in a step, by paths that leave the region, by the
        state where they do: float64[boundary].
        """
        explored, boundary = self.explored, self.explored.boundary
        if boundary is None or not self._time:
            return np.zeros(0 if boundary is None else len(boundary))
        bound = np.full(len(boundary), np.inf)
        if self._growth is not None:
            columns = {i: explored.states.column(i)[boundary] for i in self._growth.weights}
            bound = self._growth.bound(columns, len(boundary), float(self._time))
        return bound if self._is_timed else np.where(self._in_time[boundary], bound, 0.0)

    @property
    def _in_time(self) -> Bools:
        """The states that are reached within the steps that count: bool[states]."""
        matrix = self.explored.matrix
        owner = matrix.state_of_row[matrix.row_of_entry]
        reached = np.zeros(len(self.explored.states), np.bool_)
        reached[self.explored.initial] = True
        count = 0
        for _ in range(int(self._time)):
            reached[matrix.indices[reached[owner]]] = True
            earlier, count = count, int(np.count_nonzero(reached))
            if count == earlier:
                break
        return reached

    def _flows(self) -> Floats:
        """About what is earned by paths that leave the region, by the state where they do."""
        outside = self._outside
        if not outside.any():
            return np.empty(0)
        entered = super()._flows()
        if not len(entered):
            entered = np.ones(len(outside))
        per_time = float(self._time) if isinstance(self._quantity, CumulativeReward) else 1.0
        lost = np.minimum(outside, _LARGEST / len(outside) / max(per_time, 1.0))
        found = np.minimum(entered, 1.0) * lost * per_time
        # Where nothing is known of what is earned, all states have to be expanded.
        return np.where(np.isinf(outside), _LARGEST / len(outside), found)

    def _solved(self, known: tuple[float, float]) -> tuple[float, float]:
        """Bounds by the rewards of the region, and by what may be missing to them."""
        earned, missing = self._rewards()
        low, high = self._value(earned, self._query.direction)
        self._unsure = high - low
        if missing.any():
            most = None if self._query.direction is None else Direction.MAX
            lost = self._value(missing, most)[1] * (1.0 + 1e-12)
            if lost:
                low = math.nextafter(low - lost, -math.inf)
                high = math.nextafter(high + lost, math.inf)
        return max(known[0], low), min(known[1], high)

    def _rewards(self) -> tuple[Floats, Floats]:
        """What is earned within the region, and a bound on its error, or on what is earned from
        there outside of it: per row, or per state if it is a reward at a time.
        """
        engine, reward = self.context.engine, self._quantity.reward
        system, boundary = engine.system(engine.all), self.explored.boundary
        if isinstance(self._quantity, CumulativeReward):
            earned = np.array(system.earned(reward), np.float64)
            missing = np.array(system.step_reward_errors(reward), np.float64)
            if system.exit_rates is not None:
                missing *= system.exit_rates * (1.0 + 1e-12)
            groups = self.explored.matrix.groups
        else:
            earned = np.array(system.state_rewards(reward), np.float64)
            missing = max(system.state_reward_error(reward), REWARD_ERROR) * np.abs(earned)
            groups = None
        if boundary is not None and len(boundary):
            rows = boundary if groups is None else groups[boundary]  # each has one loop
            earned[rows], missing[rows] = 0.0, self._outside
        return earned, missing

    def _value(self, rewards: Floats, direction: Direction | None) -> tuple[float, float]:
        """Bounds on the value of the query in the initial state, with other rewards."""
        explored, is_sum = self.explored, isinstance(self._quantity, CumulativeReward)
        none = np.zeros(len(explored.states) if is_sum else explored.matrix.rows)
        number = len(explored.model.rewards)
        matrix, boundary = explored.matrix, explored.boundary
        if self._is_timed and boundary is not None and len(boundary) < matrix.rows:
            # Loops have the rate 1, and change nothing; faster ones than others take time.
            data, loops = matrix.data.copy(), matrix.indptr[boundary]
            data[loops] = np.delete(matrix.row_sums(), boundary).max()
            matrix = replace(matrix, data=data)
        # Without items, a structure is one that was read.
        given = replace(
            explored,
            matrix=matrix,
            model=replace(
                explored.model, rewards=(*explored.model.rewards, BoundRewards(None, ()))
            ),
            state_rewards=[*explored.state_rewards, none if is_sum else rewards],
            choice_rewards=[*explored.choice_rewards, rewards if is_sum else none],
        )
        context = replace(self.context, engine=erased(ExplicitEngine(given)))
        context = context.relevant_at(context.engine.initial)
        context = context.with_epsilon(tuning.TRUNCATION_SHARE * self._options.epsilon)
        quantity = replace(self._quantity, reward=Structure(number))
        query: Query[StateSet] = Query(quantity, direction, None)
        found = values(context, query)
        initial = context.engine.initial
        return float(found.minimum(initial)[0]), float(found.maximum(initial)[1])


def _as_chain(matrix: SparseMatrix) -> SparseMatrix:
    """The matrix of a chain, or that of an MDP whose choices have equal probabilities."""
    if matrix.groups is None:
        return matrix
    choices = np.diff(matrix.groups)
    lengths = np.diff(matrix.indptr[matrix.groups])
    return SparseMatrix(
        matrix.indptr[matrix.groups],
        matrix.indices,
        matrix.data / np.repeat(choices, lengths),
        matrix.columns,
    )
