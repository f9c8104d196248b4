"""Counterexamples and witnesses of `P bound [ path ]`, `R bound [ F states ]`, `R bound [ C<=k ]`.

The likeliest paths are added until they show together that the bound is broken, or holds.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import islice
from math import fsum

from symcheck.check import tuning
from symcheck.check.context import Context
from symcheck.check.counterexample import Counterexample
from symcheck.check.explanation.command_sets import command_set
from symcheck.check.explanation.named_paths import named_paths
from symcheck.check.explanation.path_search import Number, PathSearch, path_search
from symcheck.check.strategies.to_explicit import check_rows_fit, to_explicit
from symcheck.numerics.likeliest_paths import FoundPath, likeliest_paths
from symcheck.numerics.tuning import UNIT_ROUNDOFF
from symcheck.semantics.features import Feature, require
from symcheck.syntax.ast import Expression
from symcheck.syntax.printer import pretty

__all__ = ["find_counterexample"]

_ROUNDINGS = 16
"""Rounding errors of a step in the probability and the reward of a path, in units, or more."""
_NEARLY = Fraction(999_999_999, 1_000_000_000)
"""The sum is computed accurately once a plain sum reaches this part of the threshold."""


def find_counterexample(
    context: Context, formula: Expression, paths: int | None = None, *, commands: bool = True
) -> Counterexample:
    """Paths, and commands, that show why a bound is false, or true.

    Args:
        context: the model, on any engine.
        formula: `P bound [ path ]`, `R bound [ F states ]`, `T bound [ F states ]`, or in discrete
            time `R bound [ C<=k ]`.
        paths: the most paths; None for 1000.
        commands: also look for a small set of commands that suffices.

    Raises:
        UnsupportedError: the formula is of another kind, or no set of paths shows its value.
    """
    require(context.engine.model, Feature.COUNTEREXAMPLES)
    check_rows_fit(context.engine, "a counterexample needs")
    options = replace(context.options, strategy=True)
    context = to_explicit(replace(context, options=options, relevant_states=None))
    search = path_search(context, formula)
    limit = tuning.COUNTEREXAMPLE_PATHS if paths is None else paths
    chosen: list[FoundPath] = []
    total: Number = Fraction(0) if search.engine.is_rational else 0.0
    complete = _reached(total, chosen, search)
    for path in islice(likeliest_paths(search.problem, search.initial), limit):
        if complete:
            break
        counted = path
        if search.probability_in_time is not None:
            counted = replace(
                path, probability=float(path.probability) * search.probability_in_time(path)
            )
        chosen.append(counted)
        total += _weight(counted, search)
        complete = _reached(total, chosen, search)
    chosen.sort(key=lambda path: -path.probability)
    notes = [search.note] if search.note else []
    if not complete:
        notes.append(
            f"the limit of {limit} paths was reached before the threshold"
            if len(chosen) == limit
            else "these are all paths: the threshold is within their rounding errors"
        )
    sums = (
        [sum((p.probability for p in chosen), Fraction(0)), total]
        if search.engine.is_rational
        else [fsum(p.probability for p in chosen), fsum(_weight(p, search) for p in chosen)]
    )
    result = Counterexample(
        " ".join((formula.span.text or pretty(formula)).split()),
        search.refutes,
        search.satisfies,
        search.threshold,
        search.strict,
        named_paths(search, chosen),
        sums[0],
        complete,
        reward=None if search.reward is None else sums[1],
        note="; ".join(notes),
    )
    return result.with_commands(*command_set(search)) if commands else result


def _weight(path: FoundPath, search: PathSearch) -> Number:
    """What a path adds to the sum: its probability, times what it earns."""
    return path.probability if search.reward is None else path.probability * search.reward(path)


def _reached(total: Number, chosen: list[FoundPath], search: PathSearch) -> bool:
    """Whether the sum is proved to reach what is needed.

    total: the sum; of doubles, a rough one, which is computed again near the threshold.
    """
    if not search.engine.is_rational and total > search.threshold * _NEARLY:
        slack = _ROUNDINGS * UNIT_ROUNDOFF
        total = fsum(_weight(p, search) * (1 - slack * len(p.states)) for p in chosen)
        total *= 1 - 2 * UNIT_ROUNDOFF
    elif not search.engine.is_rational:
        return search.threshold <= 0 and not search.strict
    return total > search.threshold if search.strict else total >= search.threshold
