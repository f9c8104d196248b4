"""Estimates with a confidence interval (CI, ACI, APMC), and Wald's sequential test (SPRT).

The confidence of an interval is the probability with which it contains the true value; `error` is 1
minus the confidence, and is the parameter `error`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, exp, isfinite, log, sqrt
from numbers import Integral
from typing import Literal

import numpy as np

from symcheck.errors import NumericalError, UsageError
from symcheck.simulate import tuning
from symcheck.simulate.intervals import IntervalEstimate, Moments, Range, error_within, interval
from symcheck.simulate.samples import Samples

__all__ = ["METHODS", "Plan", "estimate", "interval_so_far", "sequential_test"]

Method = Literal["ci", "aci", "apmc", "sprt"]
METHODS: tuple[Method, ...] = ("ci", "aci", "apmc", "sprt")
_MAX_SAMPLES = 10**9
_BLOCK_SIZE = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Method and size of a sample; a field that is None is computed from the others or defaulted.

    Attributes:
        method: 'ci' (default): for probabilities the interval of Clopper and Pearson (Biometrika
            1934); for rewards whose range is known from the model or `most`, the intervals of
            Hoeffding (1963) and of Maurer and Pontil (COLT 2009). They hold for any number of
            samples; for other rewards, Student's t is an approximation. 'aci': the normal
            approximation, valid for many samples only. 'apmc': the bound of Okamoto (1958) on the
            number of samples, as Hérault et al. (VMCAI 2004) use it. 'sprt': Wald's test, for
            thresholds on probabilities only.
        samples: number of paths (default 1000).
        error: probability that the interval or the verdict is wrong (default 0.01).
        width: half the width of the interval; for 'sprt' and 'apmc' half the width of the
            indifference region (default 0.05).
        pilot: number of samples from which the variance is estimated if `width` determines the
            number of samples.
        most: an upper bound on the reward of a path, which is not negative; 'apmc' needs it.
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


def estimate(samples: Samples, plan: Plan, *, probability: bool) -> IntervalEstimate:
    """Estimate a mean by 'ci', 'aci' or 'apmc'.

    At most two of samples, error and width may be given; the third follows from them. The mean is
    infinite if a sampled path earns an infinite reward.

    Args:
        samples: draws the samples.
        plan: method, number of samples, error and width.
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
        moments = Moments.of(samples.sample(plan.samples or _BLOCK_SIZE))
        return _interval(moments, plan, _support(samples, plan, probability), probability)
    return _estimate_to_width(samples, plan, plan.width, probability)


def interval_so_far(
    moments: Moments, samples: Samples, plan: Plan, probability: bool
) -> IntervalEstimate | None:
    """The interval of some of the samples that a plan asks for; None if they give none."""
    if moments.count < 2 or not isfinite(moments.mean):
        return None
    part = Plan(method="aci" if plan.method == "aci" else "ci", error=plan.error, most=plan.most)
    return _interval(moments, part, _support(samples, part, probability), probability)


def _support(samples: Samples, plan: Plan, probability: bool) -> Range:
    """What is known of the range of the samples."""
    if probability or plan.most is None:
        return samples.support
    return Range(*samples.support.clipped(0.0, plan.most))


def _estimate_to_width(
    samples: Samples, plan: Plan, width: float, probability: bool
) -> IntervalEstimate:
    """Sample until the half width of the interval is at most `width`.

    The interval of a pilot sample determines how many others are taken; if theirs is still too
    wide, these determine the next number. The interval is that of the last of these samples alone,
    whose number does not depend on their values, and each has half of the error that is left, so
    that all of them together are wrong with probability `error` at most.
    """
    support = _support(samples, plan, probability)
    error, count, total = plan.error or 0.01, plan.pilot, plan.error or 0.01
    while True:
        error /= 2
        part = Plan(method=plan.method, error=error, most=plan.most)
        result = _interval(Moments.of(samples.sample(count)), part, support, probability)
        if not isfinite(result.half) or result.half <= width:
            return replace(result, confidence=1 - total)
        count = ceil(count * min(100.0, 1.2 * (result.half / width) ** 2)) + 1
        if count > _MAX_SAMPLES:
            raise NumericalError(
                f"a half width of {width:g} needs more than {_MAX_SAMPLES:,} samples; choose a "
                "larger 'width'"
            )


def _interval(moments: Moments, plan: Plan, support: Range, probability: bool) -> IntervalEstimate:
    """The interval of CI or ACI."""
    n, mean = moments.count, moments.mean
    if n < 2:
        raise UsageError("an interval needs at least two samples: choose a larger 'samples'")
    if not isfinite(mean):
        return IntervalEstimate(mean, mean, mean, 1.0, n, "")
    _check_range(moments, support, plan.most)
    if plan.width is not None:
        t = plan.method == "ci"
        error, approximate = error_within(moments, plan.width, support, t=t)
        bound = ("Student's t" if t else "the normal distribution") if approximate else "Hoeffding"
        ends = support.clipped(mean - plan.width, mean + plan.width)
        return IntervalEstimate(mean, *ends, 1 - error, n, bound, approximate)
    limit: Literal["normal"] | None = "normal" if plan.method == "aci" else None
    return interval(moments, plan.error or 0.01, support, probability=probability, limit=limit)


def _check_range(moments: Moments, support: Range, most: float | None) -> None:
    """Raises NumericalError if samples are outside of the range that `most` gives."""
    if most is None:
        return
    slack = tuning.ROUNDING * most
    for value in (moments.greatest, moments.least):
        if not support.low - slack <= value <= support.high + slack:
            raise NumericalError(
                f"a sampled path has reward {value:g}, outside of [0, {most:g}] given by 'most': "
                "the error bound does not hold"
            )


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
    moments = Moments.of(samples.sample(count))
    mean = moments.mean
    if not isfinite(mean):
        return IntervalEstimate(mean, mean, mean, 1.0, count, "")
    support = Range(0.0, scale)
    _check_range(moments, support, plan.most)
    ends = support.clipped(mean - width * scale, mean + width * scale)
    return IntervalEstimate(mean, *ends, 1 - error, count, "Okamoto")


def sequential_test(samples: Samples, plan: Plan, threshold: float) -> tuple[bool, int]:
    """Decide by Wald's test whether the probability is at least `threshold` + width or at most
    `threshold` - width.

    The verdict is wrong with probability at most `error` if the true probability is not within
    `width` of the threshold. This holds for the limits 1 / `error` and `error` of the likelihood
    ratio, by Ville's inequality; Wald's are approximations.

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
    accept, reject = -log(error), log(error)
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
