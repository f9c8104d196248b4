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
from symcheck.check.explanation.question import Number, Question, question_of
from symcheck.check.strategies.to_explicit import check_rows_fit, to_explicit
from symcheck.numerics.likeliest_paths import FoundPath, likeliest_paths
from symcheck.numerics.tuning import UNIT_ROUNDOFF
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
    check_rows_fit(context.engine, "a counterexample needs")
    options = replace(context.options, strategy=True)
    context = to_explicit(replace(context, options=options, relevant_states=None))
    question = question_of(context, formula)
    limit = tuning.COUNTEREXAMPLE_PATHS if paths is None else paths
    chosen: list[FoundPath] = []
    total: Number = Fraction(0) if question.engine.exact else 0.0
    complete = _reached(total, chosen, question)
    for path in islice(likeliest_paths(question.problem, question.initial), limit):
        if complete:
            break
        counted = path
        if question.share is not None:
            counted = replace(path, probability=float(path.probability) * question.share(path))
        chosen.append(counted)
        total += _weight(counted, question)
        complete = _reached(total, chosen, question)
    chosen.sort(key=lambda path: -path.probability)
    notes = [question.note] if question.note else []
    if not complete:
        notes.append(
            f"the limit of {limit} paths was reached before the threshold"
            if len(chosen) == limit
            else "these are all paths: the threshold is within their rounding errors"
        )
    sums = (
        [sum((p.probability for p in chosen), Fraction(0)), total]
        if question.engine.exact
        else [fsum(p.probability for p in chosen), fsum(_weight(p, question) for p in chosen)]
    )
    result = Counterexample(
        " ".join((formula.span.text or pretty(formula)).split()),
        question.refutes,
        question.satisfies,
        question.need,
        question.strict,
        named_paths(question, chosen),
        sums[0],
        complete,
        reward=None if question.reward is None else sums[1],
        note="; ".join(notes),
    )
    return result.with_commands(*command_set(question)) if commands else result


def _weight(path: FoundPath, question: Question) -> Number:
    """What a path adds to the sum: its probability, times what it earns."""
    return path.probability if question.reward is None else path.probability * question.reward(path)


def _reached(total: Number, chosen: list[FoundPath], question: Question) -> bool:
    """Whether the sum is proved to reach what is needed.

    total: the sum; of doubles, a rough one, which is computed again near the threshold.
    """
    if not question.engine.exact and total > question.need * _NEARLY:
        slack = _ROUNDINGS * UNIT_ROUNDOFF
        total = fsum(_weight(p, question) * (1 - slack * len(p.states)) for p in chosen)
        total *= 1 - 2 * UNIT_ROUNDOFF
    elif not question.engine.exact:
        return question.need <= 0 and not question.strict
    return total > question.need if question.strict else total >= question.need
