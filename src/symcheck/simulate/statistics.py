"""Confidence intervals (CI, ACI, APMC) and Wald's sequential probability ratio test (SPRT).

The confidence of an interval is the probability with which it contains the true value; `error` is 1
minus the confidence, and is the parameter `error`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, exp, isfinite, log, sqrt
from numbers import Integral
from typing import Literal

import numpy as np

from symcheck.errors import NumericalError, UsageError
from symcheck.machine import require_memory_for_scipy
from symcheck.matrices.rows import Floats
from symcheck.simulate import tuning
from symcheck.simulate.samples import Samples

__all__ = ["METHODS", "IntervalEstimate", "Plan", "estimate", "sequential_test"]

Method = Literal["ci", "aci", "apmc", "sprt"]
METHODS: tuple[Method, ...] = ("ci", "aci", "apmc", "sprt")
_MAX_SAMPLES = 10**9
_BLOCK_SIZE = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Method and size of a sample; a field that is None is computed from the others or defaulted.

    Attributes:
        method: 'ci' (default): for probabilities the interval of Clopper and Pearson (Biometrika
            1934), whose coverage is at least its confidence for any number of samples; for rewards
            Student's t. 'aci': the normal approximation, valid for many samples only. 'apmc': the
            bound of Okamoto (1958) on the number of samples, as Hérault et al. (VMCAI 2004) use it.
            'sprt': Wald's test, for thresholds on probabilities only.
        samples: number of paths (default 1000).
        error: probability that the interval or the verdict is wrong (default 0.01).
        width: half the width of the interval; for 'sprt' and 'apmc' half the width of the
            indifference region (default 0.05).
        pilot: number of samples from which the variance is estimated if `width` determines the
            number of samples.
        most: an upper bound on the reward of a path, for 'apmc'.
        max_steps: maximal length of a path (see `Sampler.sample`).
        seed: seed of the random numbers; None draws one.
    """

    method: Method = "ci"
    samples: int | None = None
    error: float | None = None
    width: float | None = None
    pilot: int = 1000
    most: float | None = None
    max_steps: int = 10_000
    seed: int | None = None

    def __post_init__(self) -> None:
        """Check the whole numbers. Raises UsageError."""
        for name, least in (("samples", 1), ("pilot", 1), ("max_steps", 1), ("seed", 0)):
            given = getattr(self, name)
            if given is not None and not (isinstance(given, Integral) and int(given) >= least):
                raise UsageError(f"{name}={given!r}: expected a whole number from {least}")


@dataclass(frozen=True, slots=True)
class IntervalEstimate:
    """A sample mean and an interval that contains the true value with probability `confidence`."""

    mean: float
    lower: float
    upper: float
    confidence: float
    samples: int


def estimate(samples: Samples, plan: Plan, *, probability: bool) -> IntervalEstimate:
    """Estimate a mean by 'ci', 'aci' or 'apmc'.

    At most two of samples, error and width may be given; the third follows from them. The mean is
    infinite if a sampled path earns an infinite reward.

    Args:
        probability: the samples are 0 or 1.

    Raises:
        UsageError: the numbers of the plan do not fit the method.
        NumericalError, ModelFault: see `Samples.sample`.
    """
    if plan.samples is not None and plan.error is not None and plan.width is not None:
        raise UsageError(
            "at most two of 'samples', 'error' and 'width' may be given: the "
            "third follows from them"
        )
    if plan.method == "apmc":
        return _apmc(samples, plan, probability)
    if plan.width is None or plan.samples is not None:
        return _interval(samples.sample(plan.samples or _BLOCK_SIZE), plan, probability)
    return _estimate_to_width(samples, plan, plan.width, probability)


def _estimate_to_width(
    samples: Samples, plan: Plan, width: float, probability: bool
) -> IntervalEstimate:
    """Sample until the half width of the interval is at most `width`.

    The variance of a pilot sample determines the number of samples; a wider interval than expected
    repeats the computation (rarely).
    """
    values = samples.sample(plan.pilot)
    while True:
        result = _interval(values, Plan(method=plan.method, error=plan.error), probability)
        half = max(result.upper - result.mean, result.mean - result.lower)
        if not isfinite(half) or half <= width:
            return result
        needed = ceil(len(values) * min(100.0, 1.02 * (half / width) ** 2)) + 1
        if needed > _MAX_SAMPLES:
            raise NumericalError(
                f"a half width of {width:g} needs more than {_MAX_SAMPLES:,} samples; choose a "
                "larger 'width'"
            )
        values = np.concatenate([values, samples.sample(needed - len(values))])


def _interval(values: Floats, plan: Plan, probability: bool) -> IntervalEstimate:
    """The interval of CI or ACI."""
    n = len(values)
    if n < 2:
        raise UsageError("an interval needs at least two samples: choose a larger 'samples'")
    mean = float(np.mean(values))
    if not isfinite(mean):
        return IntervalEstimate(mean, mean, mean, 1.0, n)
    if plan.width is not None:
        error = _error_probability(values, plan.width, plan.method, probability)
        return IntervalEstimate(mean, mean - plan.width, mean + plan.width, 1 - error, n)
    error = plan.error or 0.01
    if probability and plan.method == "ci":
        lower, upper = _clopper_pearson(int(np.sum(values)), n, error)
    else:
        half = _quantile(plan.method, n, error) * float(np.std(values, ddof=1)) / sqrt(n)
        lower, upper = mean - half, mean + half
    return IntervalEstimate(mean, lower, upper, 1 - error, n)


def _error_probability(values: Floats, width: float, method: Method, probability: bool) -> float:
    """The probability that the sample mean is farther than `width` from the true mean."""
    require_memory_for_scipy()
    from scipy import special

    n, deviation = len(values), float(np.std(values, ddof=1))
    hoeffding = min(1.0, 2 * exp(-2 * n * width * width)) if probability else 1.0
    if deviation == 0.0:
        # All samples are equal and say nothing about the variance; Hoeffding's bound needs none.
        return hoeffding
    t = width * sqrt(n) / deviation
    tail = float(special.stdtr(n - 1, -t)) if method == "ci" else float(special.ndtr(-t))
    return min(1.0, 2 * tail)


def _quantile(method: Method, n: int, error: float) -> float:
    require_memory_for_scipy()
    from scipy import special

    return float(
        special.stdtrit(n - 1, 1 - error / 2) if method == "ci" else special.ndtri(1 - error / 2)
    )


def _clopper_pearson(hits: int, n: int, error: float) -> tuple[float, float]:
    require_memory_for_scipy()
    from scipy import special

    lower = 0.0 if hits == 0 else float(special.betaincinv(hits, n - hits + 1, error / 2))
    upper = 1.0 if hits == n else float(special.betaincinv(hits + 1, n - hits, 1 - error / 2))
    return lower, upper


def _apmc(samples: Samples, plan: Plan, probability: bool) -> IntervalEstimate:
    """Okamoto's bound: |sample mean - true mean| < width * range with probability 1 - error, where
    error = 2 exp(-2 samples width²).
    """
    if not probability and plan.most is None:
        raise UsageError(
            "the method apmc needs an upper bound on the reward of a path: give 'most'"
        )
    scale = 1.0 if probability else plan.most or 1.0
    count, error, width = (
        plan.samples,
        plan.error,
        None if plan.width is None else plan.width / scale,
    )
    if count is not None and width is not None:
        error = min(1.0, 2 * exp(-2 * count * width * width))
    else:
        error = error or 0.01
        if count is None:
            width = width or 0.05
            count = ceil(log(2 / error) / (2 * width * width))
        else:
            width = sqrt(log(2 / error) / (2 * count))
    if count > _MAX_SAMPLES:
        raise NumericalError(
            f"this accuracy needs {count:,} samples; choose a larger 'width' or 'error'"
        )
    values = samples.sample(count)
    mean = float(np.mean(values))
    if not isfinite(mean):
        return IntervalEstimate(mean, mean, mean, 1.0, count)
    if float(np.max(values)) > scale or float(np.min(values)) < 0:
        raise NumericalError(
            f"a sampled path has reward {float(np.max(values)):g}, outside of [0, {scale:g}] given "
            "by 'most': the error bound does not hold"
        )
    return IntervalEstimate(mean, mean - width * scale, mean + width * scale, 1 - error, count)


def sequential_test(samples: Samples, plan: Plan, threshold: float) -> tuple[bool, int]:
    """Decide by Wald's test whether the probability is at least `threshold` + width or at most
    `threshold` - width.

    The verdict is wrong with probability at most `error` if the true probability is not within
    `width` of the threshold.

    Returns:
        The verdict (True: above), and the number of samples used.

    Raises:
        NumericalError: `plan.samples` samples do not decide.
        UsageError: the indifference region is not within [0, 1].

    Source: A. Wald: Sequential tests of statistical hypotheses (1945); H. Younes (2005).
    """
    error, width = plan.error or 0.01, plan.width or 0.05
    high, low = threshold + width, threshold - width
    if high > 1 or low < 0 or (low == 0 and high == 1):
        raise UsageError(
            f"the method sprt distinguishes {low:g} from {high:g} here, which are not both "
            f"probabilities: 'width' must be at most {min(threshold, 1 - threshold):g}; "
            "thresholds 0 and 1 are decided without sampling"
        )
    hit_term = log(high / low) if low > 0 else np.inf
    miss_term = log((1 - high) / (1 - low)) if high < 1 else -np.inf
    accept, reject = log((1 - error) / error), log(error / (1 - error))
    ratio, used = 0.0, 0
    while plan.samples is None or used < plan.samples:
        block = min(max(_BLOCK_SIZE, used // 2), tuning.MAX_SEQUENTIAL_BLOCK)
        values = samples.sample(min(block, (plan.samples or _MAX_SAMPLES) - used))
        log_ratios = ratio + np.cumsum(np.where(values > 0, hit_term, miss_term))
        decisions = np.flatnonzero((log_ratios >= accept) | (log_ratios <= reject))
        if len(decisions):
            return bool(log_ratios[decisions[0]] >= accept), used + int(decisions[0]) + 1
        ratio, used = float(log_ratios[-1]), used + len(values)
    raise NumericalError(
        f"{used} samples do not decide whether the probability is above {threshold:g}; choose a "
        "larger 'samples'"
    )
