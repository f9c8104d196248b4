"""From samples to answers: intervals with a confidence (CI, ACI, APMC) and Wald's sequential test
(SPRT).

A confidence `c` is here the probability with which the interval holds the true value; `error` is 1
- c, which is what -simconf gives.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, exp, isfinite, log, sqrt
from typing import Literal

import numpy as np

from symcheck.errors import NumericalError, UsageError
from symcheck.matrices.rows import Floats
from symcheck.simulate.sampling import Sampler

__all__ = ["METHODS", "Estimated", "Plan", "estimate", "sequential_test"]

Method = Literal["ci", "aci", "apmc", "sprt"]
METHODS: tuple[Method, ...] = ("ci", "aci", "apmc", "sprt")
_MOST = 10**9
_BLOCK = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How to sample; what is None is computed from the others, or gets its default.

    method: 'ci' (default): for probabilities the interval of Clopper and Pearson (Biometrika 1934),
    which holds the value at least as often as it says for any number of samples; for rewards
    Student's t. 'aci': the normal distribution, right for many samples only. 'apmc': the bound of
    Okamoto (1958) on the number of samples, as Hérault et al. (VMCAI 2004) use it. 'sprt': Wald's
    test, for thresholds on probabilities only. samples: number of paths (default 1000). error: of
    the interval or verdict (default 0.01). width: half the width of the interval; for 'sprt' and
    'apmc' the distance that is told apart (default 0.05). pilot: samples from which the variance is
    estimated where samples are to be found for a width. most: the largest reward that a path can
    earn, for 'apmc'. max_steps: longest path (see `Sampler`). seed: of numpy's default generator;
    None draws one.
    """

    method: Method = "ci"
    samples: int | None = None
    error: float | None = None
    width: float | None = None
    pilot: int = 1000
    most: float | None = None
    max_steps: int = 10_000
    seed: int | None = None


@dataclass(frozen=True, slots=True)
class Estimated:
    """A mean of samples with the interval that holds the true value with probability `confidence`."""

    mean: float
    lower: float
    upper: float
    confidence: float
    samples: int


def estimate(sampler: Sampler, plan: Plan, *, probability: bool) -> Estimated:
    """Estimate a mean. Two of samples, error and width may be given, the third is found.

    Where a path earns an infinite reward the mean is infinite, surely. Raises UsageError for
    numbers that do not fit the method, and what sampling raises.
    """
    if plan.samples is not None and plan.error is not None and plan.width is not None:
        raise UsageError(
            "two of -simsamples, -simconf and -simwidth (-simapprox) may be given: the third "
            "follows from them"
        )
    if plan.method == "apmc":
        return _apmc(sampler, plan, probability)
    if plan.width is None or plan.samples is not None:
        return _interval(sampler.sample(plan.samples or _BLOCK), plan, probability)
    return _of_width(sampler, plan, plan.width, probability)


def _of_width(sampler: Sampler, plan: Plan, width: float, probability: bool) -> Estimated:
    """Sample until the interval is narrow: first a pilot, then as many as its variance asks for,
    then (rarely) more.
    """
    values = sampler.sample(plan.pilot)
    while True:
        found = _interval(values, Plan(method=plan.method, error=plan.error), probability)
        half = max(found.upper - found.mean, found.mean - found.lower)
        if not isfinite(half) or half <= width:
            return found
        wanted = ceil(len(values) * min(100.0, 1.02 * (half / width) ** 2)) + 1
        if wanted > _MOST:
            raise NumericalError(
                f"a half width of {width:g} needs more than {_MOST:,} samples; a larger -simwidth "
                "needs fewer"
            )
        values = np.concatenate([values, sampler.sample(wanted - len(values))])


def _interval(values: Floats, plan: Plan, probability: bool) -> Estimated:
    """The interval of CI or ACI."""
    n = len(values)
    if n < 2:
        raise UsageError("an interval needs at least two samples; -simsamples gives their number")
    mean = float(np.mean(values))
    if not isfinite(mean):
        return Estimated(mean, mean, mean, 1.0, n)
    if plan.width is not None:
        error = _error_of(values, plan.width, plan.method, probability)
        return Estimated(mean, mean - plan.width, mean + plan.width, 1 - error, n)
    error = plan.error or 0.01
    if probability and plan.method == "ci":
        lower, upper = _clopper_pearson(int(np.sum(values)), n, error)
    else:
        half = _quantile(plan.method, n, error) * float(np.std(values, ddof=1)) / sqrt(n)
        lower, upper = mean - half, mean + half
    return Estimated(mean, lower, upper, 1 - error, n)


def _error_of(values: Floats, width: float, method: Method, probability: bool) -> float:
    """How often the mean is farther than `width` from the truth."""
    from scipy import special

    n, deviation = len(values), float(np.std(values, ddof=1))
    hoeffding = min(1.0, 2 * exp(-2 * n * width * width)) if probability else 1.0
    if deviation == 0.0:
        # All samples are alike, and the variance cannot be told from them: Hoeffding's bound needs
        # none.
        return hoeffding
    t = width * sqrt(n) / deviation
    tail = float(special.stdtr(n - 1, -t)) if method == "ci" else float(special.ndtr(-t))
    return min(1.0, 2 * tail)


def _quantile(method: Method, n: int, error: float) -> float:
    from scipy import special

    return float(
        special.stdtrit(n - 1, 1 - error / 2) if method == "ci" else special.ndtri(1 - error / 2)
    )


def _clopper_pearson(hits: int, n: int, error: float) -> tuple[float, float]:
    from scipy import special

    lower = 0.0 if hits == 0 else float(special.betaincinv(hits, n - hits + 1, error / 2))
    upper = 1.0 if hits == n else float(special.betaincinv(hits + 1, n - hits, 1 - error / 2))
    return lower, upper


def _apmc(sampler: Sampler, plan: Plan, probability: bool) -> Estimated:
    """|mean - truth| < width * range with probability 1 - error, from error = 2 exp(-2 samples
    width²).
    """
    if not probability and plan.most is None:
        raise UsageError(
            "-simmethod apmc bounds the error by the largest reward of a path: give it with "
            "-simmaxrwd"
        )
    scale = 1.0 if probability else plan.most or 1.0
    samples, error, width = (
        plan.samples,
        plan.error,
        None if plan.width is None else plan.width / scale,
    )
    if samples is not None and width is not None:
        error = min(1.0, 2 * exp(-2 * samples * width * width))
    else:
        error = error or 0.01
        if samples is None:
            width = width or 0.05
            samples = ceil(log(2 / error) / (2 * width * width))
        else:
            width = sqrt(log(2 / error) / (2 * samples))
    if samples > _MOST:
        raise NumericalError(
            f"this accuracy needs {samples:,} samples; a larger -simapprox or -simconf needs fewer"
        )
    values = sampler.sample(samples)
    mean = float(np.mean(values))
    if not isfinite(mean):
        return Estimated(mean, mean, mean, 1.0, samples)
    if float(np.max(values)) > scale or float(np.min(values)) < 0:
        raise NumericalError(
            f"a path earned {float(np.max(values)):g}, which -simmaxrwd {scale:g} rules out: the "
            "bound does not hold"
        )
    return Estimated(mean, mean - width * scale, mean + width * scale, 1 - error, samples)


def sequential_test(sampler: Sampler, plan: Plan, threshold: float) -> tuple[bool, int]:
    """Whether the probability is at least `threshold` + width (rather than at most `threshold` -
    width), by Wald's test.

    Gives the answer and the number of samples used. It is wrong with probability at most `error`
    where the true probability is not within `width` of the threshold (Wald 1945; Younes 2005).
    Raises NumericalError where `samples` are not enough, and UsageError where the indifference
    region leaves (0, 1).
    """
    error, width = plan.error or 0.01, plan.width or 0.05
    high, low = threshold + width, threshold - width
    if high > 1 or low < 0 or (low == 0 and high == 1):
        raise UsageError(
            f"-simmethod sprt tells {low:g} from {high:g} here, which are not both probabilities: "
            f"-simwidth must be at most {min(threshold, 1 - threshold):g}; for thresholds 0 and 1 "
            "nothing is sampled without -sim"
        )
    up = log(high / low) if low > 0 else np.inf
    down = log((1 - high) / (1 - low)) if high < 1 else -np.inf
    accept, reject = log((1 - error) / error), log(error / (1 - error))
    ratio, used = 0.0, 0
    while plan.samples is None or used < plan.samples:
        values = sampler.sample(min(_BLOCK, (plan.samples or _MOST) - used))
        course = ratio + np.cumsum(np.where(values > 0, up, down))
        ends = np.flatnonzero((course >= accept) | (course <= reject))
        if len(ends):
            return bool(course[ends[0]] >= accept), used + int(ends[0]) + 1
        ratio, used = float(course[-1]), used + len(values)
    raise NumericalError(
        f"{used} samples do not decide whether the probability is above {threshold:g}; a larger "
        "-simsamples may"
    )
