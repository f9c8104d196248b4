"""Statistical model checking: the value of a property from sampled paths, without building the
model.

Paths are sampled from the exact distribution of a DTMC or CTMC. The choices of an MDP are resolved
uniformly at random: the result is the value of that strategy, between the minimum and the maximum.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf, isinf
from time import perf_counter

from symcheck.check.result import Accuracy, Exact, Result, Statistical
from symcheck.engines.base import Engine
from symcheck.errors import NumericalError, UnsupportedError, converts_memory_error
from symcheck.parallel.workers import Workers
from symcheck.semantics.binding.probability_sums import normalised_at
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.features import Feature, require
from symcheck.semantics.model import BoundModel
from symcheck.semantics.query import (
    LongRunProbability,
    PathProbability,
    ProbabilityGiven,
    Threshold,
    query_of,
)
from symcheck.semantics.state_faults import AlmostOne
from symcheck.simulate.intervals import IntervalEstimate, Moments
from symcheck.simulate.monitors import monitor_of
from symcheck.simulate.path import used_seed
from symcheck.simulate.samples import SampledProperty, Samples
from symcheck.simulate.statistics import Plan, estimate, interval_so_far, sequential_test
from symcheck.syntax.ast import AnyMeasure, Expression
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

    def __str__(self) -> str:
        accuracy = self.accuracy
        if accuracy is None:
            estimate = f"mean {self.mean:.6g}"
        else:
            half = max(accuracy.upper - self.mean, self.mean - accuracy.lower)
            estimate = f"{self.mean:.6g} +/- {half:.1E}"
        target = "" if self.target is None else f" of {self.target:,}"
        return f"{self.samples:,}{target} samples: {estimate}"


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
        model: the model.
        formula: a bound formula (see `bind_properties`).
        plan: method and size of the sample; None: the default plan.
        labels: labels of the properties file.
        fix_deadlocks: give deadlock states a loop; if False, a deadlock raises ModelFault.
        table: the explicit engine of a model without commands, whose rows are sampled.
        workers: sample the paths; None: this process. The result is the same.
        observer: is told of the samples so far, and may raise to end the sampling.

    Returns:
        A result whose accuracy is `Statistical`; of an MDP it is that of the uniform strategy.

    Raises:
        UnsupportedError: the property cannot be estimated from paths.
        NumericalError: a path is too long, or the threshold lies within the confidence interval.
        UsageError: no method fits the plan.
        ModelFault: the model breaks a rule in a state on a path.
    """
    started = perf_counter()
    plan = plan or Plan()
    if not isinstance(formula, AnyMeasure):
        raise UnsupportedError(
            f"sampling supports a single P, R or T operator, not '{pretty(formula)}'; "
            "without sampling it is checked numerically"
        )
    require(model, Feature.SIMULATION)
    query = query_of(formula, model)
    quantity, threshold = query.quantity, query.threshold
    monitor = monitor_of(quantity, model)
    if model.type.has_choices and threshold is not None:
        raise UnsupportedError(
            "sampling does not decide thresholds of an mdp: a threshold must hold for all "
            "strategies, and sampling follows one, the uniform strategy; without sampling it is "
            "decided"
        )
    if model.is_rational:
        raise UnsupportedError(
            "sampling estimates values, and rational arithmetic (exact) computes them: one of the "
            "two has to go"
        )
    seed = used_seed(plan.seed)
    match quantity:
        case PathProbability() | ProbabilityGiven() | LongRunProbability():
            reward = None
        case _:
            reward = quantity.reward
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
            _decide_by_test(samples, plan, threshold, probability)
            if plan.method == "sprt"
            else _estimate_by_interval(samples, plan, threshold, probability)
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
    accuracy = result.accuracy
    if model.type.has_choices:
        accuracy = _of_uniform_strategy(accuracy, samples.samples)
    uniform = (_UNIFORM,) if model.type.has_choices else ()
    explanation = (
        f"{result.explanation}; {samples.samples} paths of "
        f"{samples.steps / max(samples.samples, 1):.1f} steps on average, seed {seed}"
    )
    return Result(
        result.value,
        accuracy,
        explanation,
        warnings=(*model.warnings, *uniform, *result.warnings),
        seconds=perf_counter() - started,
    )


def _of_uniform_strategy(accuracy: Accuracy, samples: int) -> Statistical:
    """The accuracy of a value of an MDP; without an interval, the value is infinite for certain."""
    if isinstance(accuracy, Statistical):
        return replace(accuracy, uniform=True)
    return Statistical(1.0, inf, inf, samples, uniform=True)


def _estimate_by_interval(
    samples: Samples, plan: Plan, threshold: Threshold | None, probability: bool
) -> Result:
    if samples.support.low == inf:
        return _infinite("paths that never reach the target have a positive probability", threshold)
    interval = estimate(samples, plan, probability=probability)
    method = f"estimated by {plan.method.upper()}"
    if isinf(interval.mean):
        return _infinite("a sampled path never reaches the target", threshold)
    accuracy = _accuracy(interval)
    if threshold is None:
        return Result(interval.mean, accuracy, method, warnings=interval.warnings)
    return Result(
        _verdict(interval, threshold),
        accuracy,
        f"{method}: {format_value(interval.mean)} ({accuracy})",
        warnings=interval.warnings,
    )


def _infinite(explanation: str, threshold: Threshold | None) -> Result:
    """The result of a reward that some paths accumulate without end."""
    return Result(threshold.admits(inf) if threshold else inf, Exact(), explanation)


def _accuracy(interval: IntervalEstimate) -> Statistical:
    return Statistical(
        interval.confidence,
        interval.lower,
        interval.upper,
        interval.samples,
        interval.bound,
        interval.approximate,
    )


def _verdict(interval: IntervalEstimate, threshold: Threshold) -> bool:
    """Compare the interval with the threshold. Raises NumericalError if it does not decide."""
    verdict = threshold.admits(interval.lower)
    if verdict != threshold.admits(interval.upper):
        raise NumericalError(
            f"the threshold {float(threshold.value):g} lies within the interval "
            f"[{interval.lower:.6g}, {interval.upper:.6g}] estimated from {interval.samples} "
            "samples, so it is not decided; take more samples ('samples'), or check without "
            "sampling"
        )
    return verdict


def _decide_by_test(
    samples: Samples, plan: Plan, threshold: Threshold | None, probability: bool
) -> Result:
    if threshold is None or not probability:
        raise UnsupportedError(
            "the method sprt decides thresholds on probabilities only (P>=0.5 [ … ]); ci, aci and "
            "apmc estimate values"
        )
    value = float(threshold.value)
    above, used = sequential_test(samples, plan, value)
    width, error = plan.width or 0.05, plan.error or 0.01
    explanation = (
        f"decided by SPRT after {used} samples; correct with probability {1 - error:g} unless the "
        f"value is within {width:g} of {value:g}"
    )
    # Within the indifference region the test may decide either way.
    lower, upper = (value - width, 1.0) if above else (0.0, value + width)
    return Result(
        above is threshold.operator.is_lower_bound,
        Statistical(1 - error, lower, upper, used, "Wald's test"),
        explanation,
    )
