"""Checking one property of a run: its answer, what is written of it, and its verdict in a test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from symcheck.check.checker import check
from symcheck.check.expected_results import Verdict, VerdictKind, judge
from symcheck.check.property_instance import Question
from symcheck.check.result import Result, Statistical, show_value
from symcheck.cli.output_paths import Values, own_file
from symcheck.cli.properties_input import Broken
from symcheck.cli.report import property_text
from symcheck.cli.run_state import Job
from symcheck.cli.simulation import Simulation
from symcheck.engines.base import Engine
from symcheck.errors import ResourceError, SymcheckError
from symcheck.experiment.table import Row
from symcheck.options import Options

if TYPE_CHECKING:
    from symcheck.check.bisimulation.on_quotient import SharedQuotient

__all__ = ["Stop", "answer", "broken", "conclude", "internal", "unbuilt"]


class Stop(Exception):
    """A test has failed and -test was asked for."""


def answer(
    job: Job,
    subject: Engine | Simulation,
    question: Question,
    options: Options,
    constants: Values,
    choice: Values,
    varying: Values,
    shared: SharedQuotient | None = None,
) -> None:
    """Check a property and report what comes out; a fault of one property does not stop the others.

    constants: of the model. choice: of the property. varying: what is in the names of the files that are written. shared: a
    quotient by bisimulation for several questions.
    Raises ResourceError and MemoryError, UsageError for files that cannot be written, and Stop.
    """
    bound, labels = question.bind(subject.model)
    text = property_text(bound)
    name, title = bound.name or text, f'"{bound.name}": {text}' if bound.name else text
    job.report.property(text, bound.name, constants, choice)
    outcome: Result | SymcheckError
    try:
        if isinstance(subject, Simulation):
            outcome = subject.check(bound.formula, labels)
        else:
            outcome = check(
                subject,
                bound.formula,
                options,
                labels=labels,
                rebind=question.formula,
                shared=shared,
            )
        job.report.result(outcome)
    except (ResourceError, MemoryError):
        raise
    except Exception as error:  # a defect in one property must not take the others along
        outcome = error if isinstance(error, SymcheckError) else internal(error)
        job.report.error(outcome)
        job.failures += not job.testing
        job.rows.append(
            Row(
                name,
                {**constants, **choice},
                "Error",
                str(outcome).splitlines()[0],
                title=title,
                fixed=job.fixed,
            )
        )
    else:
        job.rows.append(
            Row(
                name,
                {**constants, **choice},
                show_value(outcome.value),
                str(outcome.accuracy),
                title=title,
                fixed=job.fixed,
            )
        )
        _write(job, outcome, varying)
    if job.testing and isinstance(outcome, Result) and isinstance(outcome.accuracy, Statistical):
        conclude(job, Verdict(VerdictKind.NOT_TESTED, "the result is an estimate"))
    elif job.testing:
        conclude(job, judge(bound.comments, outcome, bound.constants, exact=options.exact))


def broken(job: Job, property: Broken) -> None:
    """Report a property that does not follow the grammar."""
    job.report.property(property.text, None, {}, {})
    job.report.error(property.fault)
    job.failures += 1
    job.rows.append(Row(property.text, {}, "Error", str(property.fault).splitlines()[0]))


def unbuilt(
    job: Job, questions: list[tuple[str, Values]], constants: Values, error: SymcheckError
) -> None:
    """Report a model that cannot be built, one of several; its properties have no answers."""
    job.report.error(error)
    job.failures += 1
    reason = str(error).splitlines()[0]
    job.rows += [
        Row(name, {**constants, **choice}, "Error", reason, fixed=job.fixed)
        for name, choice in questions
    ]


def conclude(job: Job, verdict: object) -> None:
    """Report the comparison with a RESULT line. Raises Stop where -test is to end with it."""
    job.report.verdict(verdict)
    kind = getattr(verdict, "kind", None)
    if kind in (VerdictKind.FAIL, VerdictKind.UNSUPPORTED):
        job.failures += 1
        if job.arguments.test and kind is VerdictKind.FAIL:
            raise Stop


def internal(error: Exception) -> SymcheckError:
    """A defect of symcheck, as an error that can be reported."""
    import traceback

    where = traceback.extract_tb(error.__traceback__)[-1]
    hint = "this is a defect of symcheck; please report it with the model"
    if isinstance(error, ImportError) and (error.name or "").startswith("symcheck."):
        hint = "sources and compiled modules are of different versions: build again (pip install -e ., or make demo in a checkout)"
    return SymcheckError(
        f"internal error: {type(error).__name__}: {error} ({Path(where.filename).name}:{where.lineno})\n  hint: {hint}"
    )


# ------------------------------------------------------------------------------------------------------------------- files


def _write(job: Job, outcome: Result, varying: Values) -> None:
    if outcome.strategy is not None:
        _write_strategy(job, outcome, varying)
    if job.arguments.exportvector is not None:
        _write_vector(job, outcome, own_file(job.arguments.exportvector, varying))


def _write_strategy(job: Job, outcome: Result, varying: Values) -> None:
    from symcheck.exchange.strategies import strategy_target, strategy_texts
    from symcheck.exchange.text import write_text

    target = strategy_target(job.arguments.exportstrat)
    path = own_file(target.path, varying)
    write_text(path, strategy_texts(outcome.strategy, target), job.report.out)
    if path != "stdout":
        job.report.line(f'Strategy written to "{path}" ({target.kind})')


def _write_vector(job: Job, outcome: Result, path: str) -> None:
    """The values in all states in the order of the exported states: numbers, or true and false."""
    from symcheck.exchange.explicit_export import state_order
    from symcheck.exchange.text import lines, write_text

    engine = outcome.engine
    if engine is None or (outcome.values is None and outcome.satisfying is None):
        job.report.warn("-exportvector: this property has no values of its own in the states")
        return
    order = state_order(engine)
    if outcome.values is not None:
        low, high = outcome.values.at(engine.all)
        # Of bounds the middle is taken, as for a result; infinite values are their own middle.
        values = (
            np.asarray(low) if low is high else np.where(low == high, low, low + (high - low) / 2)
        )
        column = values if order is None else values[order]
        text = lines("%s", len(column), column, precision=job.arguments.exportprecision)
    else:
        members = engine.to_bools(outcome.satisfying)
        names = np.where(members if order is None else members[order], "true", "false").tolist()
        text = lines("%s", len(names), names)
    write_text(path, text, job.report.out)
    if path != "stdout":
        job.report.line(f"Exported to '{path}'")
