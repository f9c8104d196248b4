"""Bounds on the reward of a state or a transition by the ranges of the variables that it reads."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, prod

import numpy as np

from symcheck.semantics.expressions.vectorised import evaluate_columns
from symcheck.semantics.model import BoundModel, BoundReward
from symcheck.simulate import tuning
from symcheck.simulate.intervals import UNKNOWN, Range
from symcheck.syntax.traversal import names

__all__ = ["sum_range"]


def sum_range(items: Sequence[BoundReward], model: BoundModel) -> Range:
    """Bounds on the sum of rewards, over all valuations of the variables."""
    ranges = [_item_range(item, model) for item in items]
    return Range(sum(r.low for r in ranges), sum(r.high for r in ranges))


def _item_range(item: BoundReward, model: BoundModel) -> Range:
    """Bounds on what one item gives, which is 0 where its guard is false."""
    read = names(item.guard) | names(item.value)
    domains = {v.name: v.domain for v in model.variables if v.name in read}
    sizes = [inf if domain is None else len(domain) for domain in domains.values()]
    if prod(sizes) > tuning.MAX_REWARD_VALUATIONS:
        return UNKNOWN
    mesh = np.meshgrid(*map(np.asarray, domains.values()), indexing="ij")
    columns = {name: column.reshape(-1) for name, column in zip(domains, mesh, strict=True)}
    guard, value = evaluate_columns(item.guard, columns), evaluate_columns(item.value, columns)
    earned = np.where(guard.values, value.numbers(), 0.0)
    if guard.faults is not None or not np.isfinite(earned).all():
        return UNKNOWN
    return Range(float(earned.min(initial=0.0)), float(earned.max(initial=0.0)))
