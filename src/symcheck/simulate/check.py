"""Statistical model checking: the value of a property from sampled paths, without building the
model.

Paths have the exact distribution of a DTMC or CTMC. In an MDP choices are equally likely: the value
is that of one strategy between the minimum and the maximum.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from math import isinf
from time import perf_counter

import numpy as np

from symcheck.check.result import Exact, Result, Statistical
from symcheck.errors import NumericalError, UnsupportedError, converts_memory_error
from symcheck.semantics.expressions.evaluate import evaluate
from symcheck.semantics.expressions.literals import format_value
from symcheck.semantics.model import BoundModel
from symcheck.semantics.rewards import Reward, operator_reward
from symcheck.simulate.monitors import Question, path_question, reward_question
from symcheck.simulate.sampling import Sampler
from symcheck.simulate.statistics import Estimated, Plan, estimate, sequential_test
from symcheck.syntax.ast import Bound, Expression, ModelType, ProbabilityOperator, RewardOperator

__all__ = ["check_by_sampling"]

_UNIFORM = (
    "nondeterminism is resolved by equally likely choices: this is the value of that strategy, not "
    "the minimum or maximum"
)


@converts_memory_error("fewer samples need less")
def check_by_sampling(
    model: BoundModel,
    formula: Expression,
    plan: Plan | None = None,
    *,
    labels: Mapping[str, Expression] | None = None,
    fix_deadlocks: bool = True,
) -> Result:
    """Estimate the value of a property `P=?` or `R=?` in the initial state, or decide its
    threshold.

    Args:
        formula: a bound formula (see `bind_properties`).
        plan: method and size of the sample; None: the default plan.
        labels: labels of the properties file.
        fix_deadlocks: give deadlock states a loop; if False, a deadlock raises ModelFault.

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
    question, reward, bound = _read(model, formula)
    if model.type is ModelType.MDP and bound is not None:
        raise UnsupportedError(
            "-sim does not decide thresholds of an mdp: they speak of all strategies, and sampling "
            "takes one, with equally likely "
            "choices; without -sim the threshold is decided"
        )
    if model.exact:
        raise UnsupportedError(
            "-sim estimates, and -exact asks for rational arithmetic: one of the two has to go"
        )
    seed = int(np.random.SeedSequence().generate_state(1)[0]) if plan.seed is None else plan.seed
    sampler = Sampler(
        model,
        question,
        np.random.default_rng(seed),
        reward,
        labels or {},
        plan.max_steps,
        fix_deadlocks,
    )
    probability = reward is None
    result = (
        _by_test(sampler, plan, bound, probability)
        if plan.method == "sprt"
        else _by_interval(sampler, plan, bound, probability)
    )
    warnings = (_UNIFORM,) if model.type is ModelType.MDP else ()
    about = (
        f"{result.explanation}; {sampler.samples} paths of "
        f"{sampler.steps / max(sampler.samples, 1):.1f} steps on average, seed {seed}"
    )
    return Result(
        result.value, result.accuracy, about, warnings=warnings, seconds=perf_counter() - started
    )


def _read(model: BoundModel, formula: Expression) -> tuple[Question, Reward | None, Bound | None]:
    match formula:
        case ProbabilityOperator(_, bound, path):
            return path_question(path, model), None, bound
        case RewardOperator(_, bound, _, query):
            return reward_question(query, model), operator_reward(formula, model), bound
        case _:
            raise UnsupportedError(
                f"-sim answers a single P or R operator, and this is a {type(formula).__name__}; "
                "without -sim it is checked numerically"
            )


def _by_interval(sampler: Sampler, plan: Plan, bound: Bound | None, probability: bool) -> Result:
    found = estimate(sampler, plan, probability=probability)
    method = f"estimated by {plan.method.upper()}"
    if isinf(found.mean):
        explanation = "a sampled path misses the target for ever"
        return Result(_compare(found.mean, bound) if bound else found.mean, Exact(), explanation)
    accuracy = Statistical(found.confidence, found.lower, found.upper, found.samples)
    if bound is None:
        return Result(found.mean, accuracy, method)
    return Result(
        _verdict(found, bound), accuracy, f"{method}: {format_value(found.mean)} ({accuracy})"
    )


def _compare(value: float, bound: Bound) -> bool:
    comparison = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}[
        bound.operator
    ]
    return bool(comparison(value, _threshold(bound)))


def _threshold(bound: Bound) -> float:
    return float(evaluate(bound.threshold, {}))


def _verdict(found: Estimated, bound: Bound) -> bool:
    """Compare the interval with the threshold. Raises NumericalError where the threshold lies
    inside.
    """
    threshold = _threshold(bound)
    if found.lower <= threshold <= found.upper:
        raise NumericalError(
            f"the threshold {threshold:g} lies within the interval [{found.lower:.6g}, "
            f"{found.upper:.6g}] that {found.samples} samples "
            "give, so that they decide nothing; more samples (-simsamples) may, and without -sim "
            "it is decided for certain"
        )
    return _compare(found.mean, bound)


def _by_test(sampler: Sampler, plan: Plan, bound: Bound | None, probability: bool) -> Result:
    if bound is None or not probability:
        raise UnsupportedError(
            "-simmethod sprt decides thresholds on probabilities (P>=0.5 [ … ]); ci, aci and apmc "
            "estimate values"
        )
    threshold = _threshold(bound)
    above, used = sequential_test(sampler, plan, threshold)
    width, error = plan.width or 0.05, plan.error or 0.01
    explanation = (
        f"decided by SPRT after {used} samples; right with probability {1 - error:g} unless the "
        f"value is within {width:g} of {threshold:g}"
    )
    lower, upper = (threshold + width, 1.0) if above else (0.0, threshold - width)
    return Result(
        above is (bound.operator in (">", ">=")),
        Statistical(1 - error, lower, upper, used),
        explanation,
    )
