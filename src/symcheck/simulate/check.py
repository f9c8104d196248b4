"""Statistical model checking: the value of a property from sampled paths, without building the
model.

Paths are sampled from the exact distribution of a DTMC or CTMC. The choices of an MDP are resolved
uniformly at random: the result is the value of that strategy, between the minimum and the maximum.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from math import inf, isinf
from time import perf_counter
from typing import assert_never

from symcheck.check.result import Exact, Result, Statistical
from symcheck.engines.base import Engine
from symcheck.errors import NumericalError, UnsupportedError, converts_memory_error
from symcheck.parallel.workers import Workers
from symcheck.semantics.binding.probability_sums import normalised_at
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, Time, operator_reward
from symcheck.semantics.state_faults import AlmostOne
from symcheck.simulate.intervals import IntervalEstimate, Moments
from symcheck.simulate.monitors import Monitor, path_monitor, reward_monitor
from symcheck.simulate.path import used_seed
from symcheck.simulate.samples import SampledProperty, Samples
from symcheck.simulate.statistics import Plan, estimate, interval_so_far, sequential_test
from symcheck.syntax.ast import (
    Bound,
    ConditionalProbability,
    ExpectedTime,
    Expression,
    ExpressionNode,
    ProbabilityOperator,
    RewardOperator,
)
from symcheck.syntax.printer import pretty

__all__ = ["SampledSoFar", "SamplesObserver", "check_by_sampling"]

_UNIFORM = (
    "nondeterminism is resolved uniformly at random: this is the value of that strategy, not the "
    "minimum or maximum"
)


@dataclass(frozen=True, eq=False)
class SampledSoFar:
    """The samples so far, as an observer receives them.

    Attributes:
        samples: their number.
        target: the number that was planned; None if it depends on the samples.
        mean: their mean.
    """

    samples: int
    target: int | None
    mean: float
    _interval: Callable[[], IntervalEstimate | None] = field(repr=False)

    @property
    def accuracy(self) -> Statistical | None:
        """The interval of these samples; None if they give none."""
        interval = self._interval()
        return None if interval is None else _accuracy(interval)


SamplesObserver = Callable[[SampledSoFar], None]


@converts_memory_error("fewer samples need less")
def check_by_sampling(
    model: BoundModel,
    formula: Expression,
    plan: Plan | None = None,
    *,
    labels: Mapping[str, Expression] | None = None,
    fix_deadlocks: bool = True,
    table: Engine | None = None,
    workers: Workers | None = None,
    observer: SamplesObserver | None = None,
) -> Result:
    """Estimate the value of a property `P=?` or `R=?` in the initial state, or decide its
    threshold.

    Args:
        formula: a bound formula (see `bind_properties`).
        plan: method and size of the sample; None: the default plan.
        labels: labels of the properties file.
        fix_deadlocks: give deadlock states a loop; if False, a deadlock raises ModelFault.
        table: the explicit engine of a model without commands, whose rows are sampled.
        workers: sample the paths; None: this process. The result is the same.
        observer: is told of the samples so far, and may raise to end the sampling.

    Returns:
        A result whose accuracy is `Statistical`.

    Raises:
        UnsupportedError: the property cannot be estimated from paths.
        NumericalError: a path is too long, or the threshold lies within the confidence interval.
        UsageError: no method fits the plan.
        ModelFault: the model breaks a rule in a state on a path.
    """
    started = perf_counter()
    plan = plan or Plan()
    monitor, reward, bound = _read_operator(model, formula)
    if model.type.has_choices and bound is not None:
        raise UnsupportedError(
            "sampling does not decide thresholds of an mdp: a threshold must hold for all "
            "strategies, and sampling follows one, the uniform strategy; without sampling it is "
            "decided"
        )
    if model.exact:
        raise UnsupportedError(
            "sampling estimates values, and rational arithmetic (exact) computes them: one of the "
            "two has to go"
        )
    seed = used_seed(plan.seed)
    sampled = SampledProperty(
        model, table, monitor, reward, labels or {}, seed, plan.max_steps, fix_deadlocks
    )
    probability = reward is None

    def report(moments: Moments, target: int) -> None:
        assert observer is not None
        planned = None if plan.method == "sprt" else target
        interval = partial(interval_so_far, moments, samples, plan, probability)
        observer(SampledSoFar(moments.count, planned, moments.mean, interval))

    samples = Samples(sampled, workers or Workers(), None if observer is None else report)
    try:
        result = (
            _decide_by_test(samples, plan, bound, probability)
            if plan.method == "sprt"
            else _estimate_by_interval(samples, plan, bound, probability)
        )
    except AlmostOne as fault:
        return check_by_sampling(
            normalised_at(model, fault),
            formula,
            plan,
            labels=labels,
            fix_deadlocks=fix_deadlocks,
            workers=workers,
            observer=observer,
        )
    uniform = (_UNIFORM,) if model.type.has_choices else ()
    explanation = (
        f"{result.explanation}; {samples.samples} paths of "
        f"{samples.steps / max(samples.samples, 1):.1f} steps on average, seed {seed}"
    )
    return Result(
        result.value,
        result.accuracy,
        explanation,
        warnings=(*model.warnings, *uniform, *result.warnings),
        seconds=perf_counter() - started,
    )


def _read_operator(
    model: BoundModel, formula: Expression
) -> tuple[Monitor, Reward | None, Bound | None]:
    match formula:
        case ProbabilityOperator(_, bound, path):
            return path_monitor(path, model), None, bound
        case RewardOperator(_, bound, _, query):
            return reward_monitor(query, model), operator_reward(formula, model), bound
        case ExpectedTime(_, bound, path):
            return reward_monitor(path, model), Time(), bound
        case ConditionalProbability():
            raise UnsupportedError(
                "sampling does not estimate conditional probabilities; without it they are "
                "computed numerically"
            )
        case ExpressionNode():
            raise UnsupportedError(
                f"sampling supports a single P, R or T operator, not '{pretty(formula)}'; "
                "without sampling it is checked numerically"
            )
        case _:
            assert_never(formula)


def _estimate_by_interval(
    samples: Samples, plan: Plan, bound: Bound | None, probability: bool
) -> Result:
    if samples.support.low == inf:
        return _infinite("paths that never reach the target have a positive probability", bound)
    interval = estimate(samples, plan, probability=probability)
    method = f"estimated by {plan.method.upper()}"
    if isinf(interval.mean):
        return _infinite("a sampled path never reaches the target", bound)
    accuracy = _accuracy(interval)
    if bound is None:
        return Result(interval.mean, accuracy, method, warnings=interval.warnings)
    return Result(
        _verdict(interval, bound),
        accuracy,
        f"{method}: {format_value(interval.mean)} ({accuracy})",
        warnings=interval.warnings,
    )


def _infinite(explanation: str, bound: Bound | None) -> Result:
    """The result of a reward that some paths accumulate without end."""
    return Result(_compare(inf, bound) if bound else inf, Exact(), explanation)


def _accuracy(interval: IntervalEstimate) -> Statistical:
    return Statistical(
        interval.confidence,
        interval.lower,
        interval.upper,
        interval.samples,
        interval.bound,
        interval.approximate,
    )


def _compare(value: float, bound: Bound) -> bool:
    comparison = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}[
        bound.operator
    ]
    return bool(comparison(value, _threshold(bound)))


def _threshold(bound: Bound) -> Fraction | float:
    value = evaluate(bound.threshold, {}, exact=True)
    return value if isinstance(value, float) else Fraction(value)


def _verdict(interval: IntervalEstimate, bound: Bound) -> bool:
    """Compare the interval with the threshold. Raises NumericalError if it does not decide."""
    verdict = _compare(interval.lower, bound)
    if verdict != _compare(interval.upper, bound):
        raise NumericalError(
            f"the threshold {float(_threshold(bound)):g} lies within the interval "
            f"[{interval.lower:.6g}, {interval.upper:.6g}] estimated from {interval.samples} "
            "samples, so it is not decided; take more samples ('samples'), or check without "
            "sampling"
        )
    return verdict


def _decide_by_test(samples: Samples, plan: Plan, bound: Bound | None, probability: bool) -> Result:
    if bound is None or not probability:
        raise UnsupportedError(
            "the method sprt decides thresholds on probabilities only (P>=0.5 [ … ]); ci, aci and "
            "apmc estimate values"
        )
    threshold = float(_threshold(bound))
    above, used = sequential_test(samples, plan, threshold)
    width, error = plan.width or 0.05, plan.error or 0.01
    explanation = (
        f"decided by SPRT after {used} samples; correct with probability {1 - error:g} unless the "
        f"value is within {width:g} of {threshold:g}"
    )
    # Within the indifference region the test may decide either way.
    lower, upper = (threshold - width, 1.0) if above else (0.0, threshold + width)
    return Result(
        above is (bound.operator in (">", ">=")),
        Statistical(1 - error, lower, upper, used, "Wald's test"),
        explanation,
    )
